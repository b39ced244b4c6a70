"""Run folders after SIGKILL: whole at every instant, and unchanged at their end."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import toy_run
from toy_run import series

from cfddem.io.reading import open_run
from cfddem.io.writer import _ALWAYS_INDEXED


class Undisturbed:
    """The states of the toy run, computed without files."""

    def __init__(self) -> None:
        self.states = [toy_run.beginning()]

    def __getitem__(self, step: int) -> dict:
        while len(self.states) <= step:
            self.states.append(toy_run.advance(self.states[-1]))
        return self.states[step]


def check_killed(folder: Path, undisturbed: Undisturbed) -> int:
    """Every snapshot, the series in VTK and the history equal those of the undisturbed run."""
    if not (folder / "run.json").exists():
        return 0
    seen = open_run(folder)
    count, rows = len(seen.snapshots), len(seen.history.get("time", ()))
    assert not seen.missing and rows >= count
    for k in range(rows):
        assert seen.history["bed_height"][k] == undisturbed[k + 1]["position"].max()
    steps = list(series(folder / "run.vtkhdf")) if (folder / "run.vtkhdf").exists() else []
    if len(steps) == 2 and steps[1][0] == np.nextafter(steps[0][0], 1.0):
        steps.pop()  # a single step is shown twice
    # The index may lack the very last snapshot, and of long series whatever follows those that are always in it.
    assert min(count - 1, _ALWAYS_INDEXED) <= len(steps) <= count
    for k in range(count):
        assert (seen.steps[k], seen.times[k]) == (k + 1, (k + 1) * toy_run.STEP)
        position = undisturbed[k + 1]["position"].astype("f4")
        assert np.array_equal(seen.particles(k)["position"], position)
        assert np.array_equal(seen.fluid("voidage", k), undisturbed[k + 1]["voidage"].astype("f4"))
        assert k >= len(steps) or np.array_equal(steps[k][1]["particles"].points, position)
    return count


def kill_and_go_on(folder: Path, kills: int, seed: int) -> None:
    """Kill a run repeatedly at random instants, check it, resume it, and check its end."""
    undisturbed, instants, reached = Undisturbed(), random.Random(seed), [0]
    for _ in range(kills):
        writer = subprocess.Popen(
            [sys.executable, toy_run.__file__, folder / "run", "1000000"],
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert writer.stdout is not None
        for _ in range(instants.randint(1, 6)):
            assert writer.stdout.readline()
        time.sleep(instants.uniform(0.0, 0.05))
        writer.kill()
        assert writer.wait() == -signal.SIGKILL
        writer.stdout.close()
        reached.append(check_killed(folder / "run", undisturbed))
    assert max(reached) > 3
    toy_run.run(folder / "run", max(reached) + 3)
    assert check_killed(folder / "run", undisturbed) == max(reached) + 3
    assert len(list(series(folder / "run" / "run.vtkhdf"))) == max(reached) + 3
    assert open_run(folder / "run").status == "finished"


def test_four_kills_leave_the_run_whole_and_its_end_unchanged(tmp_path):
    kill_and_go_on(tmp_path, kills=4, seed=1)


@pytest.mark.slow
def test_a_hundred_kills_leave_the_run_whole_and_its_end_unchanged(tmp_path):
    kill_and_go_on(tmp_path, kills=100, seed=2)
