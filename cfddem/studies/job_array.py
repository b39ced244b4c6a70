"""A sweep as a job array: one command for each run, and a script for Slurm that starts them."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfddem.backend.errors import InputError
from cfddem.preflight.summary import preflight
from cfddem.studies.sweep import Over, cases_of, make_output

SLURM = """#!/bin/bash
# One run a task. Set partition, account and time; then: sbatch {script}
# A run that is stopped writes a checkpoint; submitted again, it goes on from there. Runs that have finished are kept.
#SBATCH --job-name={name}
#SBATCH --array=1-{count}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=24:00:00
#SBATCH --signal=TERM@120
#SBATCH --output={output}/%a.log
export NUMBA_NUM_THREADS=$SLURM_CPUS_PER_TASK
srun bash -c "exec $(sed -n "${{SLURM_ARRAY_TASK_ID}}p" {jobs})"
"""


def write_jobs(
    path: Path, over: Over, output: Path, overrides: Mapping[str, Any] | None = None
) -> tuple[Path, Path, int]:
    """Write `jobs.txt`, one command for each run of a sweep, and `jobs.slurm`, which starts them; nothing is run.

    Arguments as of :func:`cfddem.studies.sweep.sweep`, which collects table and figure when the jobs have ended.

    returns  the two files, and the number of runs
    errors   InputError for a case with errors, before anything is written
    """
    shared = dict(overrides or {})
    runs = cases_of(path, over, shared)
    for name, (case, _) in runs.items():
        found = [f"{each.key}: {each.reason}" for each in preflight(case).issues if each.severity == "error"]
        if found:
            raise InputError(f"run {name}", None, "a case without errors", "; ".join(found))
    make_output(output)
    output = output.absolute()
    program = Path(sys.executable).parent / "cfddem"
    lines = []
    for name, (_, values) in runs.items():
        words = [str(program), "run", str(Path(path).absolute()), "-o", str(output / name), "--continue"]
        for key, value in {**shared, **values}.items():
            words += ["--set", f"{key}={_text(value)}"]
        lines.append(shlex.join(words))
    jobs, script = output / "jobs.txt", output / "jobs.slurm"
    jobs.write_text("\n".join(lines) + "\n", encoding="utf-8")
    names = {"name": output.name, "count": len(lines), "output": output, "script": script}
    script.write_text(SLURM.format(jobs=shlex.quote(str(jobs)), **names), encoding="utf-8")
    return jobs, script, len(lines)


def _text(value: Any) -> str:
    """A value as `--set` reads it."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(list(value)) if isinstance(value, tuple) else str(value)
