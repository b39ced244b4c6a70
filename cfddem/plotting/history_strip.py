"""Curves of the history as one narrow image, and where a time lies in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cfddem.io.quantities import shown_unit
from cfddem.io.reading import Run
from cfddem.plotting.curves import BLUE, blank, encoded

USUAL = ("bed_height", "pressure_drop", "kinetic_energy", "largest_speed")
"""Columns that are shown at first, as far as a run has them."""

_MOST, _USED = 6, 3
_WIDTH, _PANEL, _AROUND = 4.2, 1.35, 0.5  # of the image, of a panel, of the time axis [inch]


@dataclass(frozen=True)
class Strip:
    """An image of curves, with the place of its time axis in parts of the image."""

    image: str  # PNG as an address that holds its data
    left: float  # of the first time
    right: float  # of the last time
    top: float
    bottom: float
    first: float  # time at `left` [s]
    last: float  # time at `right` [s]

    def place_of(self, time: float) -> float:
        """Horizontal place of a time, 0 to 1 of the image."""
        part = (time - self.first) / (self.last - self.first)
        return self.left + min(max(part, 0.0), 1.0) * (self.right - self.left)


def usual_columns(known: Sequence[str]) -> list[str]:
    """The columns that are shown at first."""
    return [name for name in USUAL if name in known][:_USED] or list(known[:_USED])


def strip(run: Run, columns: Sequence[str]) -> Strip | None:
    """Curves of some columns against time, one below the other; None if there is nothing to draw."""
    names = [name for name in columns if name in run.history][:_MOST]
    if not names or len(run.history["time"]) < 2:
        return None
    time = run.history["time"]
    figure, axes = blank(len(names), 1, width=_WIDTH, height=_AROUND + _PANEL * len(names), sharex=True)
    for name, each in zip(names, axes):
        each.plot(time, run.history[name], color=BLUE, linewidth=1.3)
        each.set_title(f"{name.replace('_', ' ')}  [{shown_unit(run.unit(name))}]", loc="left", fontsize=10)
        each.tick_params(labelsize=9)
        each.locator_params(axis="y", nbins=4)
    first, last = float(time[0]), float(time[-1])
    axes[-1].set_xlim(first, last if last > first else first + 1.0)
    axes[-1].set_xlabel("time  [s]", fontsize=10)
    image = "data:image/png;base64," + encoded(figure, 200)  # lays the figure out, too
    boxes = [each.get_position() for each in axes]
    begin, end = axes[-1].get_xlim()
    return Strip(image, boxes[0].x0, boxes[0].x1, 1.0 - boxes[0].y1, 1.0 - boxes[-1].y0, begin, end)
