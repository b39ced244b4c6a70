"""A small run to be killed: a state that only its own past can give, snapshots, history, checkpoints, going on."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from cfddem.record.checkpoint import newest
from cfddem.record.output import RunFolder

GRID = SimpleNamespace(cells=(4, 3, 5), spacing=(0.1, 0.1, 0.1), origin=(0.0, 0.0, 0.0))
STEP = 0.01


def advance(state: dict) -> dict:
    """The state one step later: every number depends on all steps before and on the random generator."""
    generator = np.random.Generator(np.random.PCG64())
    generator.bit_generator.state = state["random"]
    position = np.sin(state["position"] * 1.7 + generator.random(state["position"].shape))
    return {
        "position": position,
        "voidage": 0.5 * (state["voidage"] + position.mean()),
        "random": generator.bit_generator.state,
        "step": state["step"] + 1,
    }


def beginning(particles: int = 500) -> dict:
    """The state at time zero."""
    return {
        "position": np.linspace(0.0, 1.0, 3 * particles).reshape(-1, 3),
        "voidage": np.full((5, 3, 4), 0.4),
        "random": np.random.PCG64(7).state,
        "step": 0,
    }


def run(folder: Path, steps: int) -> None:
    """Begin or go on, to a number of steps; a snapshot at each, a checkpoint at every third."""
    if (folder / "run.json").exists():
        output = RunFolder.reopen(folder)
        state = newest(folder) if (folder / "checkpoint").exists() and any((folder / "checkpoint").iterdir()) else None
        output.drop_after(-1.0 if state is None else state["step"] * STEP)
    else:
        output, state = RunFolder.create(folder, "toy = true\n", {"seed": 7}, GRID), None
    state = state or beginning()
    while state["step"] < steps:
        print(state["step"], flush=True)
        state = advance(state)
        time = state["step"] * STEP
        output.append_history({"time": time, "bed_height": float(state["position"].max())})
        fluid = {"voidage": state["voidage"]}
        output.write_snapshot(time, state["step"], fluid, {"position": state["position"]})
        if state["step"] % 3 == 0:
            output.write_checkpoint(state)
    output.finish("finished")


if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]))
