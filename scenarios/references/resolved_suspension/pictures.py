"""Pictures of resolved runs: a slice through flow and spheres, and the autocorrelation of the force."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import BLUE, ORANGE, label, panels, save
from scenarios.references.resolved_suspension.suspension import Suspension


def slice_of(suspension: Suspension, path: Path) -> None:
    """Speed of the fluid over the mean slip in the plane y = half of the box, the spheres it cuts in white."""
    flow = suspension.flow
    nx, ny, nz = flow.shape
    extent = (-0.5, nx - 0.5, -0.5, nz - 0.5)
    frame, slip = suspension.velocity.mean(axis=0), float(np.linalg.norm(suspension.mean_slip()))
    velocity = (flow.velocity()[:, :, ny // 2] - frame[:, None, None]) / slip
    solid = np.where(flow.share[:, ny // 2] > 0.5, 1.0, np.nan)
    figure, axis = panels(1, width=6.0)
    image = axis.imshow(velocity[2], origin="lower", cmap="RdBu_r", vmin=-3.0, vmax=3.0, extent=extent)
    axis.imshow(solid, origin="lower", cmap="gray", vmin=0.0, vmax=1.2, alpha=0.6, extent=extent)
    step = max(nx // 24, 1)
    x, z = np.meshgrid(np.arange(0, nx, step), np.arange(0, nz, step))
    axis.quiver(x, z, velocity[0, ::step, ::step], velocity[2, ::step, ::step], scale=60.0, width=0.002)
    figure.colorbar(image, ax=axis, label="vertical velocity against the spheres' mean, over w")
    label(axis, "x", "cells", "z", "cells")
    save(figure, path)


def correlations(rows: list[dict[str, Any]], path: Path) -> None:
    """Autocorrelation of the force per sphere, along and across, of all runs."""
    figure, axes = panels(2, width=10.0)
    for axis, which, colour in ((axes[0], "along", BLUE), (axes[1], "across", ORANGE)):
        for row in rows:
            values = row[f"correlation_{which}"]
            axis.plot(row["lag"][: len(values)], values[: len(row["lag"])], color=colour, linewidth=0.8)
        axis.axhline(0.0, color="black", linewidth=0.5)
        label(axis, "lag", "d/w", f"autocorrelation of the force {which}", "-")
    save(figure, path)
