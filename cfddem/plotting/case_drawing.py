"""A drawing of a case from the front, before it runs: column, cells, bed, inflow, walls, feeds and outlets."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import CfddemError
from cfddem.case.column_grid import grid_of
from cfddem.case.liquid import Spray
from cfddem.case.patches import ENDS, PLANES, CasePatch, lengths_of, middle_of
from cfddem.case.schema import Case
from cfddem.case.vessel_shape import outline
from cfddem.case.walls import CaseWall
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, blank
from cfddem.preflight.bed_estimate import estimate_bed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_SPHERES, MOST_CELLS, MOST_TRIANGLES = 3000, 80, 2000
"""Largest number of spheres that are drawn one by one, of cells in a direction, and of triangles of a surface."""

LEGIBLE: dict[str, Any] = {"bbox": {"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 1.0}}
"""Of a text over particles."""

_HEIGHT, _NARROWEST, _WIDEST, _FACTS = 5.0, 1.0, 5.0, 2.9  # of the column on paper, and of the text beside it [inch]


def case_drawing(case: Case, bed_height: float | None = None) -> Figure:
    """Draw a case as seen along y.

    bed_height  measured height, marked by a line [m]
    returns     the figure, for :func:`cfddem.plotting.curves.save`
    """
    width, _, height = case.column.size
    tall = height / width
    across = min(max(_HEIGHT / tall, _NARROWEST), _WIDEST)
    figure, (axes, text) = blank(
        1, 2, width=across + 1.3 + _FACTS, height=min(across * tall, _HEIGHT) + 1.1, width_ratios=[across + 1.0, _FACTS]
    )
    _cells(axes, case)
    _particles(axes, case)
    for wall in (*case.wall, *(case.vessel.walls_in(case.column) if case.vessel else ())):
        _wall(axes, wall, 2.0 * max(width, height))
    for boxes, name, colour in ((case.feed, "feed", GREEN), (case.outlet, "outlet", RED)):
        for box in boxes:
            _box(axes, box.corner, box.size, name, colour)
    if case.spray is not None:
        _spray(axes, case.spray)
    _column(axes, case)
    _inflow(axes, case)
    _patches(axes, case)
    if bed_height is not None and math.isfinite(bed_height):
        axes.hlines(bed_height, 0.0, width, color=ORANGE, linewidth=1.6, linestyle="--")
        axes.text(1.05 * width, bed_height, "bed height", color=ORANGE, fontsize=9.5, va="center", clip_on=False)
    margin = 0.04 * max(width, height)
    low = -0.16 * height if case.fastest_inflow > 0.0 and case.column.ends == "flow" else -margin
    axes.set(xlim=(-margin, width + margin), ylim=(low, height + margin), xlabel="x  [m]", ylabel="z  [m]")
    axes.set_aspect("equal")
    axes.grid(False)
    axes.locator_params(axis="x", nbins=max(1, int(across / 0.7)))
    text.axis("off")
    text.text(0.0, 1.0, "\n".join(_facts(case)), va="top", ha="left", fontsize=9.5, transform=text.transAxes)
    return figure


def _column(axes: Axes, case: Case) -> None:
    """Sides, floor and lid: thick where they are walls, dashed where periodic."""
    width, _, height = case.column.size
    sides = "--" if case.column.sides == "periodic" else "-"
    ends = {"flow": ":", "closed": "-", "periodic": "--"}[case.column.ends]
    for x in (0.0, width):
        axes.plot([x, x], [0.0, height], color="#222222", linewidth=2.2, linestyle=sides)
    for z in (0.0, height):
        axes.plot([0.0, width], [z, z], color="#222222", linewidth=1.6, linestyle=ends)


def _cells(axes: Axes, case: Case) -> None:
    """The lines of the grid of the fluid; none if they are too many to be seen."""
    if case.fluid is None:
        return
    try:
        grid = grid_of(case)
    except CfddemError:
        return
    (nx, _, nz), (dx, _, dz) = grid.shape[::-1], grid.spacing
    if max(nx, nz) <= MOST_CELLS:
        axes.vlines(np.arange(1, nx) * dx, 0.0, nz * dz, color="#e2e2e2", linewidth=0.6, zorder=0)
        axes.hlines(np.arange(1, nz) * dz, 0.0, nx * dx, color="#e2e2e2", linewidth=0.6, zorder=0)


def _particles(axes: Axes, case: Case) -> None:
    """The particles at the start, in an order that shows their size; a plain area if they are too many."""
    from matplotlib.collections import EllipseCollection
    from matplotlib.patches import Rectangle

    bed, diameter = case.bed, case.bed.diameter
    corner, size = _start(case)
    if bed.positions:
        centres = np.array(bed.positions)[:, ::2]
    else:
        rows, columns = size[1] / (0.87 * diameter), size[0] / diameter
        if rows * columns > MOST_SPHERES:
            axes.add_patch(Rectangle(corner, *size, facecolor=BLUE, alpha=0.35, linewidth=0))
            return
        solids = sum(case.volumes.values()) / max(size[0] * size[1] * case.column.size[1], 1e-300)
        share = 1.0 if bed.start == "poured" else min(1.0, 1.5 * solids)
        centres = _lattice(corner, size, diameter)
        kept = np.random.default_rng(1).random(len(centres)) < share
        centres = centres[kept]
        middle = np.full(len(centres), 0.5 * case.column.size[1])
        inside = case.beyond_the_side(np.stack([centres[:, 0], middle, centres[:, 1]], axis=-1), 0.5 * diameter) <= 0.0
        centres = centres[inside]
    wide = np.full(len(centres), diameter)
    axes.add_collection(
        EllipseCollection(
            wide, wide, np.zeros(len(centres)), units="x", offsets=centres, transOffset=axes.transData, facecolor=BLUE,
            alpha=0.55, edgecolor="white", linewidth=0.3,
        )
    )  # fmt: skip


def _start(case: Case) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lower corner and size (x, z) of the region that holds the particles at the start [m]."""
    bed, (width, _, height) = case.bed, case.column.size
    if bed.start_corner is not None and bed.start_size is not None:
        return bed.start_corner[::2], bed.start_size[::2]
    if bed.start in ("poured", "expanded"):
        with np.errstate(all="ignore"):
            estimate = estimate_bed(case)
            height = min(height, estimate.poured_height if bed.start == "poured" else estimate.height)
    return (0.0, 0.0), (width, height)


def _lattice(corner: tuple[float, float], size: tuple[float, float], diameter: float) -> np.ndarray:
    """Centres of a hexagonal arrangement in a rectangle (n, 2) [m]."""
    rows = max(int((size[1] - diameter) / (0.87 * diameter)) + 1, 1)
    places = []
    for row in range(rows):
        first = 0.5 * diameter * (1 + row % 2)
        x = corner[0] + np.arange(first, size[0] - 0.49 * diameter, diameter)
        places.append(np.stack([x, np.full(len(x), corner[1] + (0.5 + 0.87 * row) * diameter)], axis=1))
    return np.concatenate(places)


def _inflow(axes: Axes, case: Case) -> None:
    """Arrows of the inflow below the floor, longer in the jet, with the velocities."""
    bed, (width, _, height) = case.bed, case.column.size
    if case.column.ends != "flow" or bed.fastest_inflow <= 0.0:
        return
    half, fastest, words = 0.0, bed.highest_inlet_velocity, f"{bed.highest_inlet_velocity:.3g} m/s"
    for jet in bed.jets:
        half, fastest = 0.5 * jet.width, jet.velocity
        words += f", jet {fastest:.3g} m/s"
    for x in (np.arange(7) + 0.5) * width / 7.0:
        speed = fastest if abs(x - 0.5 * width) <= half else bed.highest_inlet_velocity
        length = 0.09 * height * speed / bed.fastest_inflow
        if length > 0.0:
            axes.annotate("", (x, 0.0), (x, -length), arrowprops={"arrowstyle": "-|>", "color": SKY, "linewidth": 1.4})
    axes.text(0.5 * width, -0.105 * height, words, ha="center", va="top", fontsize=9.5, color=BLUE)


def _patches(axes: Axes, case: Case) -> None:
    """Patches as thick lines with their names, or as outlines on the sides that one looks at: blue where fluid enters,
    red where it leaves."""
    width, _, height = case.column.size
    for number, (name, patch) in enumerate(case.patches.items()):
        if patch.side not in ENDS:
            _beside(axes, case, name, patch)
            continue
        centres = patch.places(middle_of(case, patch.side))[:, 0]
        half = 0.5 * (patch.size[0] if patch.size else patch.diameter or width)
        z, colour = (0.0, height)[patch.side == "lid"], {"inlet": BLUE, "outlet": RED, "wall": GREY}[patch.kind]
        inner = 0.5 * (patch.inner_diameter or 0.0)
        for side, centre in product((-1.0, 1.0), centres):
            x = centre + side * inner, centre + side * half
            axes.plot(x, [z, z], color=colour, linewidth=4.0, solid_capstyle="butt")
        words = f"{name} {patch.highest:.3g} m/s" if patch.brings else name
        lower = (-0.04 if patch.side == "floor" else 0.02) * height * (1.0 + number % 2)
        middle = patch.centre[0] if patch.centre else 0.5 * width
        axes.text(middle, z + lower, words, color=colour, fontsize=9.5, ha="center", va="center", **LEGIBLE)


def _beside(axes: Axes, case: Case, name: str, patch: CasePatch) -> None:
    """A patch of a side, as `_patches`."""
    colour = {"inlet": BLUE, "outlet": RED, "wall": GREY}[patch.kind]
    if patch.shape == "whole":
        first, second = lengths_of(case, patch.side)
        at = np.array([[0.0, 0.0], [first, 0.0], [first, second], [0.0, second]])
    else:
        at = outline(patch, middle_of(case, patch.side))
    axis, high = PLANES[patch.side]
    x, z = (at[:, 0], at[:, 1]) if axis == 1 else (np.full(len(at), case.column.width * high), at[:, 1])
    axes.plot([*x, x[0]], [*z, z[0]], color=colour, linewidth=1.6 if axis == 1 else 4.0, solid_capstyle="butt")
    words = f"{name} {patch.highest:.3g} m/s" if patch.brings else name
    axes.text(x.mean(), z.max(), words, color=colour, fontsize=9.5, ha="center", va="bottom", **LEGIBLE)


def _box(axes: Axes, corner: Any, size: Any, name: str, colour: str) -> None:
    from matplotlib.patches import Rectangle

    wide, tall = size[0], size[2]
    axes.add_patch(Rectangle((corner[0], corner[2]), wide, tall, fill=False, edgecolor=colour, linewidth=1.4))
    axes.text(
        corner[0] + 0.5 * wide, corner[2] + tall, name, color=colour, fontsize=9.5, ha="center", va="bottom", **LEGIBLE
    )


def _spray(axes: Axes, spray: Spray) -> None:
    """The spray zone: a box, or the outline of a cone."""
    if spray.corner is not None and spray.size is not None:
        _box(axes, spray.corner, spray.size, "spray", SKY)
    elif spray.nozzle is not None and spray.length is not None:
        tip, axis = np.array(spray.nozzle)[::2], np.array(spray.direction)[::2] / math.hypot(*spray.direction)
        half = spray.length * math.tan(math.radians(0.5 * spray.angle)) * np.array([-axis[1], axis[0]])
        end = tip + spray.length * axis
        axes.fill(*zip(tip, end + half, end - half), facecolor=SKY, alpha=0.3, edgecolor=SKY)
        axes.text(tip[0], tip[1], " spray", color=BLUE, fontsize=9.5, va="bottom")


OUTLINE: dict[str, Any] = {"color": "#222222", "linewidth": 1.6}


def _wall(axes: Axes, wall: CaseWall, far: float) -> None:
    """A wall as seen along y; nothing of one that cannot be read, because the check of the case says so.

    far  length of a wall without ends, to each side [m]
    """
    try:
        lines, areas = wall.form.sketch(far)
    except CfddemError:
        return
    for line in lines:
        axes.plot(*line.T, **OUTLINE)
    for area in areas[:MOST_TRIANGLES]:
        axes.fill(*area.T, facecolor=GREY, alpha=0.15, edgecolor=GREY, linewidth=0.3)


def _facts(case: Case) -> list[str]:
    """What the drawing cannot show, one line each."""
    width, depth, height = case.column.size
    box = f"width {width:.4g} m\ndepth {depth:.4g} m\nheight {height:.4g} m"
    if case.vessel:
        across = f"{2.0 * case.line[0][1]:.4g} m" if case.line else f"{case.floor_area:.3g} m2"
        box += f"\n{case.vessel.shape}, {across} at the floor"
    lines = [f"cylinder\ndiameter {width:.4g} m\nheight {height:.4g} m" if case.column.shape == "cylinder" else box]
    lines.append(f"sides {case.column.sides.replace('_', ' ')}\nends {case.column.ends}")
    lines.append("")
    for name, species in case.species.items():
        material = case.material_of(species)
        classes = [diameter for diameter, _ in species.sizes]
        sizes = f"{min(classes):.3g} to {max(classes):.3g} m" if classes else f"{species.diameter:.4g} m"
        lines.append(f"{case.counts[name]} spheres of {name}\nd = {sizes}")
        lines.append(f"{material.density:.4g} kg/m3, friction {material.friction:.3g}")
    if case.fluid is not None:
        lines += ["", f"fluid {case.fluid.density:.4g} kg/m3", f"viscosity {case.fluid.viscosity:.3g} Pa s"]
        cells = case.column.cell
        lines.append(f"cells {cells if isinstance(cells, float) else max(cells):.3g} m")
    return lines
