"""Off-screen rendering of spheres and surfaces, and a test whether this machine can render.

Scenes are seen along a horizontal axis without perspective, so that an image fits plane axes in metres.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.backend.launch import python_command

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
