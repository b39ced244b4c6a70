"""A small run to be killed: a state that depends on all earlier steps, with snapshots, history and checkpoints."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from cfddem.io.checkpoint import newest
from cfddem.io.quantities import TIME, Quantity
from cfddem.io.writer import RunFolder

GRID = SimpleNamespace(cells=(4, 3, 5), spacing=(0.1, 0.1, 0.1), origin=(0.0, 0.0, 0.0))
STEP = 0.01
QUANTITIES = {
    "history": {"time": TIME, "bed_height": Quantity("m", "bed height")},
    "particles": {"position": Quantity("m", "position")},
    "fluid": {"voidage": Quantity("1", "voidage")},
}


def advance(state: dict) -> dict:
    """The state one step later; every number depends on all earlier steps and on the random generator."""
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
    """Start or resume, up to a number of steps; a snapshot at each, a checkpoint at every third."""
    if (folder / "run.json").exists():
        output = RunFolder.reopen(folder)
        state = newest(folder) if (folder / "checkpoint").exists() and any((folder / "checkpoint").iterdir()) else None
        output.drop_after(-1.0 if state is None else state["step"] * STEP)
    else:
        output, state = RunFolder.create(folder, "toy = true\n", {"seed": 7}, GRID, QUANTITIES), None
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


def series(path: Path) -> Iterator[tuple[float, dict]]:
    """All steps of an index as VTK reads them: time, block name -> pyvista object."""
    import pyvista
    import vtk

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for when in reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()):
        reader.UpdateTimeStep(when)
        blocks = pyvista.wrap(reader.GetOutputDataObject(0))
        yield when, {blocks.get_block_name(k): blocks[k] for k in range(len(blocks))}


if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]))
