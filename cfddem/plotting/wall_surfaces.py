"""Walls of a case as surfaces for pictures, at their places at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.analysis.report import case_of
from cfddem.backend.errors import CfddemError
from cfddem.case.walls import CaseWall
from cfddem.io.reading import RunData

COLOUR, OPACITY, EDGE = "#6b6b6b", 0.18, "#3c3c3c"
"""Colour of a wall, its opacity, and the colour of its edges."""

BEYOND = 1e-3
"""Part of the space in view by which walls are drawn beyond it [-]."""

SHARP = 25.0
"""Angle between two triangles from which their common edge is drawn [degrees]."""


def walls_of(run: RunData) -> tuple[CaseWall, ...]:
    """The walls of a run beside those of its column, and the pieces of its vessel; none if its case or its surface
    files cannot be read."""
    try:
        case = case_of(run)
        return (*case.wall, *(case.vessel.walls_in(case.column) if case.vessel else ()))
    except CfddemError:
        return ()


def with_walls(bounds: np.ndarray, run: RunData) -> np.ndarray:
    """Bounds (3, 2) [m] that also hold the walls of a run, as far as these have ends and lie in the column."""
    try:
        case = case_of(run)
        boxes = [box for wall in case.wall if (box := wall.form.extent()) is not None]
    except CfddemError:
        return bounds
    low, high = bounds.T
    for box in boxes:
        low, high = np.minimum(low, np.maximum(box[0], 0.0)), np.maximum(high, np.minimum(box[1], case.column.size))
    return np.stack([low, high], axis=1)


def add_walls(plotter: Any, walls: Sequence[CaseWall], bounds: np.ndarray, time: float, behind: Any = None) -> None:
    """Add walls to a scene: translucent, with their edges as lines.

    bounds  that cut the walls (3, 2) [m]
    time    [s]
    behind  function of a mesh that keeps the part behind a plane; all is drawn if None
    """
    reach = bounds + np.ptp(bounds, axis=1)[:, None] * [-BEYOND, BEYOND]  # no seam where a round wall touches the sides
    for number, wall in enumerate(walls):
        mesh = (
            _moved(_surface(wall, bounds), wall, time)
            .clip_box(reach.ravel(), invert=False)
            .extract_surface(algorithm="dataset_surface")
        )
        mesh = mesh if behind is None or not mesh.n_points else behind(mesh)
        edges = mesh.extract_feature_edges(SHARP) if mesh.n_points else mesh
        for name, part, options in (
            ("wall", mesh, {"color": COLOUR, "opacity": OPACITY}),
            ("edges", edges, {"color": EDGE, "line_width": 1.5}),
        ):
            if part.n_points:
                plotter.add_mesh(
                    part, name=f"{name} {number}", lighting=False, render=False, reset_camera=False, **options
                )


def _surface(wall: CaseWall, bounds: np.ndarray) -> Any:
    """The surface of a wall at the start; one without an end reaches beyond the bounds."""
    import pyvista

    middle = bounds.mean(axis=1)
    far = 2.0 * float(np.linalg.norm(bounds[:, 1] - bounds[:, 0])) + float(np.linalg.norm(middle - wall.form.middle()))
    make: Any = pyvista.PolyData.from_regular_faces
    first, *others = (
        make(faces.reshape(-1, 3), np.arange(faces.shape[0] * faces.shape[1]).reshape(faces.shape[:2]))
        for faces in wall.form.polygons(far)
    )
    return first.append_polydata(*others).clean() if others else first.clean()


def _moved(mesh: Any, wall: CaseWall, time: float) -> Any:
    """A surface of the start at a later time."""
    if not wall.moves:
        return mesh
    motion = wall.motion()
    if any(wall.spin):
        turned = math.degrees(math.hypot(*wall.spin) * motion.active(time))
        mesh = mesh.rotate_vector(wall.spin, turned, point=wall.form.middle() if wall.centre is None else wall.centre)
    return mesh.translate(motion.displacement(time))
