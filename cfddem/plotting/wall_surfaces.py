"""Walls of a case as surfaces for pictures, at their places at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.analysis.report import case_of
from cfddem.backend.errors import CfddemError
from cfddem.case.wall_geometry import circle, direction, extent, triangles
from cfddem.case.walls import CaseWall
from cfddem.io.reading import RunData
from cfddem.particles.walls.motion import Motion

COLOUR, OPACITY, EDGE = "#6b6b6b", 0.18, "#3c3c3c"
"""Colour of a wall, its opacity, and the colour of its edges."""

AROUND = 72
"""Edges of a drawn circle."""

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
        boxes = [box for wall in case.wall if (box := extent(wall)) is not None]
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
    for number, wall in enumerate(walls):
        mesh = (
            _moved(_surface(wall, bounds), wall, time)
            .clip_box(bounds.ravel(), invert=False)
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

    point, middle = np.array(wall.point), bounds.mean(axis=1)
    far = 2.0 * float(np.linalg.norm(bounds[:, 1] - bounds[:, 0])) + float(np.linalg.norm(middle - point))
    if wall.has_triangles:
        corners = triangles(wall)
        return _polygons(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)).clean()
    if wall.shape == "plane":
        return pyvista.Plane(point, wall.normal, far, far, 1, 1)
    low, high = (0.0, wall.length) if wall.length is not None else (-far, far)
    return _round(point, direction(wall), (low, high), wall.radii, wall.caps)


def _round(
    point: np.ndarray, axis: np.ndarray, ends: tuple[float, float], radii: tuple[float, float], caps: bool
) -> Any:
    """A surface of revolution about an axis of unit length between two circles."""
    around = circle(axis, AROUND)
    points = np.concatenate([point + end * axis + radius * around for end, radius in zip(ends, radii)])
    here, after = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    faces = np.stack([here, after, after + AROUND, here + AROUND], axis=1)
    side = _polygons(points, faces)
    if not caps:
        return side
    discs = _polygons(points, np.arange(2 * AROUND).reshape(2, AROUND))
    return side.append_polydata(discs)


def _polygons(points: np.ndarray, faces: np.ndarray) -> Any:
    """A surface of polygons with equally many corners."""
    import pyvista

    make: Any = pyvista.PolyData.from_regular_faces
    return make(points, faces)


def _moved(mesh: Any, wall: CaseWall, time: float) -> Any:
    """A surface of the start at a later time."""
    if not wall.moves:
        return mesh
    end = math.inf if wall.end is None else wall.end
    motion = Motion(0, wall.velocity, wall.spin, wall.amplitude, wall.frequency, wall.begin, end)
    if any(wall.spin):
        middle = np.array(wall.point) + 0.5 * (wall.length or 0.0) * direction(wall)
        if wall.has_triangles:
            middle = 0.5 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))
        turned = math.degrees(math.hypot(*wall.spin) * motion.active(time))
        mesh = mesh.rotate_vector(wall.spin, turned, point=middle if wall.centre is None else wall.centre)
    return mesh.translate(motion.displacement(time))
