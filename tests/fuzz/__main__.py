"""The command `python -m tests.fuzz`: many trials in worker processes, some of them as real commands."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import chain, count, islice
from pathlib import Path

from fuzz.trials import KINDS, PLAUSIBLE, Surroundings, chance_of, described, kind_of
from fuzz.workers import Limits, Outcome, many, real_command, trial


def main(words: list[str]) -> int:
    """Make the trials and print what was found; 1 if something was."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="trials in worker processes")
    parser.add_argument("--first", type=int, default=0, help="number of the first trial: goes on where a run ended")
    parser.add_argument("--kind", choices=[*KINDS], default=None, help="only trials of this kind")
    parser.add_argument("--commands", type=int, default=0, help="further trials as real commands")
    parser.add_argument("--plausible", type=int, default=0, help="command lines of all commands, mostly valid")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=20.0, help="limit of one trial")
    parser.add_argument("--memory", type=float, default=4.0, help="address space of a worker [GB]")
    parser.add_argument("--patience", type=float, default=6.0, help="limit of one trial by the clock, in limits")
    parser.add_argument("--nice", type=int, default=19, help="niceness of the workers")
    parser.add_argument("--loaded", action="store_true", help="commands end where they would compile a loop")
    parser.add_argument("--minutes", type=float, default=60.0, help="limit of all trials")
    parser.add_argument("--only", type=int, default=None, help="repeat one trial and show it")
    parser.add_argument("--output", type=Path, default=None, help="JSON file for the outcome")
    given = parser.parse_args(words)
    os.environ["NUMBA_NUM_THREADS"] = "1"
    limits = Limits(given.seconds, given.memory, given.nice, not given.loaded, given.patience)
    with tempfile.TemporaryDirectory() as home:
        around = Surroundings(Path(home))
        if given.only is not None:
            print(described(around, given.seed, given.only))
            print(trial(around, given.seed, given.only, limits))
            return 0
        return _report(given, limits, around)


def _report(given: argparse.Namespace, limits: Limits, around: Surroundings) -> int:
    begun, outcome = time.monotonic(), Outcome()
    end = begun + 60.0 * given.minutes
    home = str(around.home)
    likely = range(PLAUSIBLE + given.first, PLAUSIBLE + given.first + given.plausible)
    numbers = chain(_trials(given), likely)
    for number, answer, seconds in many(given.seed, numbers, given.workers, limits, end - time.monotonic(), home):
        if outcome.add(number, answer, seconds):
            print(f"trial {number}: {answer}", flush=True)
        done = sum(outcome.counts.values())
        if done % 1000 == 0:
            spent = time.monotonic() - begun
            print(f"{done} trials up to number {number} in {spent:.0f} s: {dict(outcome.counts)}", flush=True)
    made = sum(outcome.counts.values())
    commands = Outcome()
    for number in range(given.commands):
        if time.monotonic() > end:
            break
        answer, seconds, words = real_command(around, given.seed, 10**9 + number, limits)
        good = answer in ("accepted", "refused")
        if commands.add(10**9 + number, answer if good else f"{' '.join(words)[:200]}: {answer}", seconds):
            print(f"command {number}: {words} {answer}", flush=True)
    summary = {
        "seed": given.seed, "first": given.first, "kind": given.kind,
        "trials": made, "answers": outcome.counts, "slowest": outcome.slowest,
        "commands": commands.counts, "slowest_command": commands.slowest, "seconds": round(time.monotonic() - begun, 1),
        "limits": [limits.seconds, limits.memory], "python": platform.python_version(),
        "faults": {key: [len(each), each[:5]] for key, each in {**outcome.faults, **commands.faults}.items()},
    }  # fmt: skip
    if given.output is not None:
        given.output.write_text(json.dumps(summary, indent=1))
    for key, each in summary.pop("faults").items():  # type: ignore[attr-defined]
        print(f"\n{each[0]} times, such as --only {each[1]}:\n  {key}")
    print(json.dumps(summary))
    return int(bool(outcome.faults or commands.faults))


def _trials(given: argparse.Namespace) -> Iterator[int]:
    """Numbers of the trials in worker processes."""
    numbers = iter(range(given.first, given.first + given.count)) if given.kind is None else count(given.first)
    wanted = (each for each in numbers if given.kind in (None, kind_of(chance_of(given.seed, each), each)))
    return islice(wanted, given.count)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
