"""Pictures and films of a run: coloured spheres, slices of voidage, bubbles, streamlines.

>>> from cfddem.plotting.pictures import picture       # doctest: +SKIP
>>> picture("bed-run", "bed.png")                  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.io.files import PARTIAL
from cfddem.io.reading import open_run
from cfddem.plotting.curves import save
from cfddem.plotting.panels import Stage

_MOST_EXAMINED = 20  # snapshots that set the colour limits of a film


def picture(
    folder: str | Path,
    output: str | Path | None = None,
    *,
    snapshot: int = -1,
    show: Sequence[str] = (),
    colour: str = "speed",
    cut: bool | None = None,
) -> Path:
    """Draw one snapshot: spheres coloured by speed and, with a fluid, a slice of the voidage.

    folder    of a run
    output    PNG; NAME.png in the current folder if not given
    snapshot  0 the first, -1 the last
    show      panels: spheres, voidage, bubbles, streamlines
    colour    of the spheres: speed, or a recorded field; of a vector its magnitude
    cut       leave out the spheres in front of the middle plane; None does so in deep beds
    returns   the file
    errors    RunFailed with the remedy if this machine cannot render
    """
    run = open_run(folder)
    output = Path(f"{Path(folder).resolve().name}.png" if output is None else output)
    if output.suffix.lower() != ".png":
        raise InputError("output", str(output), "a file that ends in .png", "use movie for films")
    stage = Stage.of(run, [snapshot], show, colour, cut)
    save(stage.figure(snapshot), output)
    return output


def movie(
    folder: str | Path,
    output: str | Path,
    *,
    frames_per_second: float = 10.0,
    show: Sequence[str] = (),
    colour: str = "speed",
    cut: bool | None = None,
) -> Path:
    """Make a film of all snapshots, drawn as by `picture`, with the same colour limits throughout.

    output             ends in .gif or .mp4
    frames_per_second  of the film [1/s]
    others, returns    as `picture`
    errors             RunFailed if this machine cannot render; InputError if .mp4 lacks its package
    """
    run, output = open_run(folder), Path(output)
    if output.suffix.lower() not in (".gif", ".mp4"):
        raise InputError("output", str(output), "a file that ends in .gif or .mp4")
    if output.suffix.lower() == ".mp4":
        _require_ffmpeg()
    count = len(run.times)
    examined = sorted(set(np.linspace(0, count - 1, min(count, _MOST_EXAMINED)).astype(int).tolist()))
    stage = Stage.of(run, examined, show, colour, cut)
    fresh = output.with_name(f".{output.stem}{PARTIAL}{output.suffix}")
    fresh.unlink(missing_ok=True)
    try:
        (_write_gif if output.suffix.lower() == ".gif" else _write_mp4)(fresh, stage.frames(), frames_per_second)
        fresh.replace(output)
    finally:
        fresh.unlink(missing_ok=True)
    return output


def _require_ffmpeg() -> None:
    from importlib.util import find_spec

    if find_spec("imageio") is None or find_spec("imageio_ffmpeg") is None:
        raise InputError(
            "output", ".mp4", "written by imageio-ffmpeg", "`pip install 'cfddem[movie]'`, or ask for .gif"
        )


def _write_gif(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    from PIL import Image

    images = (Image.fromarray(each).quantize(256, kmeans=1) for each in frames)
    first = next(images)
    first.save(path, save_all=True, append_images=images, duration=round(1000 / frames_per_second), loop=0)


def _write_mp4(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    import imageio

    writer: Any = imageio.get_writer(path, fps=frames_per_second, macro_block_size=2, quality=8)
    with writer:
        for each in frames:
            writer.append_data(each)
