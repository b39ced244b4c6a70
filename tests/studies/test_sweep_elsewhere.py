"""Sweeps as job arrays of any scheduler, and on the workers of a dask scheduler."""

from __future__ import annotations

import shlex
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import call
from test_cluster_commands import TEXT

from cfddem.case.gallery import overrides
from cfddem.case.schema import Case
from cfddem.studies.sweep import cases_of


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A case file in a folder whose name has a space."""
    home = tmp_path / "my cases"
    home.mkdir()
    monkeypatch.chdir(home)
    (home / "case.toml").write_text(TEXT)
    return home / "case.toml"


def test_a_job_array_has_one_command_for_each_run(case: Path) -> None:
    """Commands name the same cases as the sweep; the script starts each of them as the shell reads it."""
    done = call("sweep", "case.toml", "--over", "seed=1,2", "--over", "column.sides=no_slip,free_slip",
                "--set", "bed.initial_velocity=[0.0, 0.0, 0.1]", "--set", "run.record_collisions=false",
                "-o", "seeds", "--write-jobs")  # fmt: skip
    assert done.code == 0 and "4 commands" in done.out, done.err
    lines = (case.parent / "seeds" / "jobs.txt").read_text().splitlines()
    shared = overrides(["bed.initial_velocity=[0.0, 0.0, 0.1]", "run.record_collisions=false"])
    runs = cases_of(case, {"bed.seed": [1, 2], "column.sides": ["no_slip", "free_slip"]}, shared)
    for line, (name, (wanted, _)) in zip(lines, runs.items(), strict=True):
        words = shlex.split(line)
        assert words[1:3] == ["run", str(case)] and words[words.index("-o") + 1] == str(case.parent / "seeds" / name)
        assert "--continue" in words
        given = [words[k + 1] for k, word in enumerate(words) if word == "--set"]
        assert Case.from_toml(case, overrides(given)) == wanted
    script = (case.parent / "seeds" / "jobs.slurm").read_text()
    assert "#SBATCH --array=1-4" in script
    start = script.splitlines()[-1].replace("srun bash -c", "echo").replace("exec ", "")
    said = subprocess.run(["bash", "-c", f"SLURM_ARRAY_TASK_ID=2; {start}"], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == lines[1]


def test_wrong_jobs_are_refused_before_anything_is_written(case: Path) -> None:
    """A case with errors."""
    done = call("sweep", "case.toml", "--over", "diameter=1e-3,0.02", "-o", "sizes", "--write-jobs")
    assert done.code == 2 and "diameter-0.02" in done.err
    assert not (case.parent / "sizes").exists()


def test_a_run_goes_on_where_the_folder_holds_one(case: Path) -> None:
    """`--continue` runs, then resumes; a finished run is left as it is."""
    short = ["run", "case.toml", "-o", "bed", "--continue", "--set", "bed.count=20", "--set", "run.until=0.002",
             "--set", "run.every=0.001"]  # fmt: skip
    for _ in range(2):
        done = call(*short)
        assert done.code == 0, done.err
        assert "differs" not in done.err
    assert len(list((case.parent / "bed" / "data").iterdir())) == 3
    done = call(*short, "--set", "bed.seed=7")
    assert done.code == 0 and "warning: bed.seed: the case given differs from that of bed" in done.err


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs dask: pip install 'cfddem[cluster]'")
def test_workers_of_a_scheduler_make_the_runs(case: Path) -> None:
    """Two processes of a local cluster."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        done = call("sweep", "case.toml", "--over", "seed=1,2", "--set", "bed.count=20", "--set", "run.until=0.002",
                    "-o", "seeds", "--scheduler", cluster.scheduler_address)  # fmt: skip
    assert done.code == 0, done.err
    assert (case.parent / "seeds" / "sweep.csv").read_text().count("finished") == 2


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs dask: pip install 'cfddem[cluster]'")
def test_a_scheduler_that_does_not_answer_is_refused(case: Path) -> None:
    """An address that is none."""
    done = call("sweep", "case.toml", "--over", "seed=1,2", "-o", "seeds", "--scheduler", "nowhere")
    assert done.code == 2 and "--scheduler" in done.err
