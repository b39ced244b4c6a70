"""Off-screen rendering of spheres, surfaces and the walls of a case, and a test whether this machine can render.

Scenes are seen along a horizontal axis without perspective, so that an image fits plane axes in metres.
"""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from cfddem.analysis.report import case_of
from cfddem.backend.errors import CfddemError, RunFailed
from cfddem.backend.launch import python_command
from cfddem.case.walls import CaseWall
from cfddem.io.reading import RunData

REMEDY = "on Debian or Ubuntu install the missing libraries: apt-get install -y --no-install-recommends libegl1 libgl1"

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
_PROBE = """
import cfddem
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere())
raise SystemExit(not plotter.screenshot(return_img=True).std() > 0)
"""

# A disc shaded like a sphere: half ambient light, half light from the viewer.
_SPHERE = """//VTK::Color::Impl
float square = dot(offsetVCVSOutput.xy, offsetVCVSOutput.xy);
if (square > 1.0) discard;
float light = 0.5 + 0.5 * sqrt(1.0 - square);
ambientColor *= light;
diffuseColor *= light;
"""


@cache
def why_not() -> str | None:
    """Why this machine cannot render; None if it can.

    The test runs in a separate process, because a missing library kills the process and raises no exception. The kind
    of window that works is used from then on.
    """
    if os.environ.get(_WINDOW):
        kinds = [os.environ[_WINDOW]]
    else:
        kinds = [""] * bool(os.environ.get("DISPLAY")) + ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    for kind in kinds:
        environment = os.environ | ({_WINDOW: kind} if kind else {})
        try:
            tried = subprocess.run(python_command("-c", _PROBE), env=environment, capture_output=True, timeout=120)
        except subprocess.TimeoutExpired:
            continue
        if tried.returncode == 0:
            os.environ.update({_WINDOW: kind} if kind else {})
            return None
    return f"this machine cannot render, tried {', '.join(kind or 'the screen' for kind in kinds)}; {REMEDY}"


def require_rendering() -> None:
    """Raise RunFailed with the remedy if this machine cannot render."""
    fault = why_not()
    if fault is not None:
        raise RunFailed(f"pictures: {fault}")


@dataclass(frozen=True)
class View:
    """What an image shows."""

    bounds: np.ndarray  # (3, 2), lowest and highest x, y, z [m]
    depth: int  # axis of the line of sight, 0 or 1
    pixels: tuple[int, int]  # width and height


def spheres(
    view: View,
    position: np.ndarray,
    radius: np.ndarray,
    values: np.ndarray,
    limits: tuple[float, float],
    colours: Any = "viridis",
    others: Callable[[Any], None] = lambda plotter: None,
) -> np.ndarray:
    """An image of spheres.

    view              what the image shows
    position, radius  (n, 3), (n,) [m]
    values            (n,) that the colours show
    limits            values of the first and the last colour
    colours           a colour map of matplotlib
    others            adds more to the scene
    returns           (height, width, 3), white background
    """
    plotter = _plotter(view)
    add_spheres(plotter, position, radius, values, limits, colours, show_scalar_bar=False)
    others(plotter)
    return _image(plotter)


def add_spheres(
    plotter: Any,
    position: np.ndarray,
    radius: np.ndarray,
    values: np.ndarray,
    limits: tuple[float, float],
    colours: Any = "viridis",
    **options: Any,
) -> None:
    """Add spheres to a scene, each as one shaded disc, which is twenty times faster than meshes.

    options  of `pyvista.Plotter.add_mesh`; other arguments as in `spheres`
    """
    import pyvista

    if not len(position):
        return
    points = pyvista.PolyData(np.ascontiguousarray(position, dtype=float))
    points["radius"], points["values"] = np.asarray(radius, float), np.asarray(values, float)
    actor = plotter.add_mesh(
        points, scalars="values", clim=limits, cmap=colours, style="points_gaussian", emissive=False, lighting=False,
        **options,
    )  # fmt: skip
    actor.ForceOpaqueOn()  # otherwise the discs blend instead of hiding each other
    actor.mapper.SetScaleArray("radius")
    actor.mapper.SetScaleFactor(1.0)
    actor.mapper.SetSplatShaderCode(_SPHERE)


def surfaces(view: View, meshes: dict[str, Any]) -> np.ndarray:
    """An image of surfaces, colour -> mesh."""
    plotter = _plotter(view, lighting="light kit")
    for colour, mesh in meshes.items():
        if mesh.n_points:
            plotter.add_mesh(mesh, color=colour, smooth_shading=True, specular=0.3, show_scalar_bar=False)
    return _image(plotter)


def _plotter(view: View, lighting: Any = "none") -> Any:
    """An empty scene whose image shows exactly the bounds of the view."""
    import pyvista

    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[int(n) for n in view.pixels], lighting=lighting)
    plotter.set_background("white")
    centre, size = view.bounds.mean(axis=1), np.diff(view.bounds, axis=1).ravel()
    eye = centre.copy()
    # Along y the camera stands in front, and x points to the right; along x it must stand behind for y to do so.
    eye[view.depth] += (-1.0 if view.depth == 1 else 1.0) * 3.0 * float(size.max())
    plotter.camera_position = [tuple(eye), tuple(centre), (0.0, 0.0, 1.0)]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = 0.5 * float(size[2])
    return plotter


def _image(plotter: Any) -> np.ndarray:
    image: np.ndarray = plotter.screenshot(return_img=True)
    plotter.close()
    return image


# ---------------------------------------------------------------- walls of a case


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
