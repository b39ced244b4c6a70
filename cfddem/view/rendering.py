"""Three-dimensional scenes without a screen: can this machine render, and images of spheres and surfaces.

Scenes are seen along a horizontal axis without perspective, so that an image fits onto plane axes in metres.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from cfddem.errors import RunFailed

REMEDY = "on Debian or Ubuntu `apt-get install -y --no-install-recommends libegl1 libgl1` brings what is missing"

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"
_PROBE = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere())
raise SystemExit(not plotter.screenshot(return_img=True).std() > 0)
"""

# A disc shaded as the sphere it stands for: light comes from the viewer, half of it from everywhere.
_SPHERE = """//VTK::Color::Impl
float square = dot(offsetVCVSOutput.xy, offsetVCVSOutput.xy);
if (square > 1.0) discard;
float light = 0.5 + 0.5 * sqrt(1.0 - square);
ambientColor *= light;
diffuseColor *= light;
"""


@cache
def why_not() -> str | None:
    """Why this machine cannot render, or None if it can.

    Tried in a process of its own, because a missing library ends a process and is no exception. The kind of window
    that works is kept for this process.
    """
    if os.environ.get(_WINDOW):
        kinds = [os.environ[_WINDOW]]
    else:
        kinds = [""] * bool(os.environ.get("DISPLAY")) + ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    for kind in kinds:
        environment = os.environ | ({_WINDOW: kind} if kind else {})
        try:
            tried = subprocess.run([sys.executable, "-c", _PROBE], env=environment, capture_output=True, timeout=120)
        except subprocess.TimeoutExpired:
            continue
        if tried.returncode == 0:
            os.environ.update({_WINDOW: kind} if kind else {})
            return None
    return f"nothing renders here, tried {', '.join(kind or 'the screen' for kind in kinds)}; {REMEDY}"


def must_render() -> None:
    """Raise RunFailed with the remedy where this machine cannot render."""
    fault = why_not()
    if fault is not None:
        raise RunFailed(f"pictures: {fault}")


def spheres(
    position: np.ndarray,
    radius: np.ndarray,
    values: np.ndarray,
    bounds: np.ndarray,
    depth: int,
    limits: tuple[float, float],
    colours: Any,
    pixels: Sequence[int],
) -> np.ndarray:
    """An image of spheres seen along a horizontal axis.

    position, radius  (n, 3), (n,) [m]
    values            (n,) what the colour shows
    bounds            (3, 2) lowest and highest x, y, z that the image shows [m]
    depth             axis along which it is seen, 0 or 1
    limits            of the values, lowest and highest colour
    colours           a colour map of matplotlib
    pixels            width and height
    returns           (height, width, 3), white where nothing is
    """
    plotter = _stage(bounds, depth, pixels)
    add_spheres(plotter, position, radius, values, limits, colours, show_scalar_bar=False)
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
    """Put spheres into a scene, one shaded disc each; twenty times as fast as meshes of them.

    options  handed to `pyvista.Plotter.add_mesh`; others as in `spheres`
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
    actor.ForceOpaqueOn()  # or the discs are mixed instead of hiding each other
    actor.mapper.SetScaleArray("radius")
    actor.mapper.SetScaleFactor(1.0)
    actor.mapper.SetSplatShaderCode(_SPHERE)


def surfaces(meshes: dict[str, Any], bounds: np.ndarray, depth: int, pixels: Sequence[int]) -> np.ndarray:
    """An image of surfaces, colour -> mesh, seen along a horizontal axis; arguments as in `spheres`."""
    plotter = _stage(bounds, depth, pixels, lighting="light kit")
    for colour, mesh in meshes.items():
        if mesh.n_points:
            plotter.add_mesh(mesh, color=colour, smooth_shading=True, specular=0.3, show_scalar_bar=False)
    return _image(plotter)


def _stage(bounds: np.ndarray, depth: int, pixels: Sequence[int], lighting: Any = "none") -> Any:
    """An empty scene whose image shows exactly the bounds."""
    import pyvista

    plotter: Any = pyvista.Plotter(off_screen=True, window_size=[int(n) for n in pixels], lighting=lighting)
    plotter.set_background("white")
    centre, size = bounds.mean(axis=1), np.diff(bounds, axis=1).ravel()
    eye = centre.copy()
    # From the front x runs to the right; along x one must look from the far side for y to run to the right.
    eye[depth] += (-1.0 if depth == 1 else 1.0) * 3.0 * float(size.max())
    plotter.camera_position = [tuple(eye), tuple(centre), (0.0, 0.0, 1.0)]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = 0.5 * float(size[2])
    return plotter


def _image(plotter: Any) -> np.ndarray:
    image: np.ndarray = plotter.screenshot(return_img=True)
    plotter.close()
    return image
