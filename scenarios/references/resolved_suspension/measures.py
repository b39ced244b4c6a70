"""What is measured in a resolved suspension: slip, drag, fluctuating force, granular temperature, collisions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from closures.drag_resolved import beetstra, tenneti
from scenarios.references.resolved_suspension.fitting import inertia_coefficient
from scenarios.references.resolved_suspension.flow import sphere_volume
from scenarios.references.resolved_suspension.suspension import Point, Suspension

ALONG = 2
"""Axis of gravity."""

LAGS = 65
"""Samples of the autocorrelation, four times d/w at sixteen samples each."""

DEVELOPED, EVEN, SMOOTHED = 5.0, 0.25, 2.0
"""A suspension is developed after this time [d/w], and even while its wave of one box length along gravity, in running
means over the last time [d/w], stays below the given part of the solid fraction."""


@dataclass
class Series:
    """Samples in time, in lattice units."""

    every: int = 1  # steps between samples
    slip: list[np.ndarray] = field(default_factory=list)  # mean slip (3,)
    force: list[np.ndarray] = field(default_factory=list)  # of the fluid on each sphere, mean since the last sample
    velocity: list[np.ndarray] = field(default_factory=list)  # of each sphere
    position: list[np.ndarray] = field(default_factory=list)  # of each centre
    collisions: list[float] = field(default_factory=list)  # pairs whose solids came to touch since the last sample
    impact: list[float] = field(default_factory=list)  # sum of their normal speeds of approach

    def sample(self, suspension: Suspension, every: int) -> None:
        """Run so many steps and note what came of them."""
        self.every = every
        force = np.zeros_like(suspension.force)
        collisions, impact = 0.0, 0.0
        for _ in range(every):
            suspension.step()
            force += suspension.force / every
            collisions += len(suspension.impacts)
            impact += float(suspension.impacts.sum())
        self.slip.append(suspension.mean_slip())
        self.force.append(force)
        self.velocity.append(suspension.velocity.copy())
        self.position.append(suspension.solver.particles.position.copy())
        self.collisions.append(collisions)
        self.impact.append(impact)

    def arrays(self) -> dict[str, Any]:
        """The samples as arrays."""
        return {name: np.asarray(values) for name, values in vars(self).items()}

    @classmethod
    def of(cls, arrays: dict[str, Any]) -> Series:
        """The samples again."""
        return cls(int(arrays["every"]), *(list(arrays[name]) for name in list(vars(cls()))[1:]))


def even_window(point: Point, series: Series) -> tuple[float, float]:
    """Times between which the suspension is developed and even [d/w, by the slip aimed at]."""
    step = series.every * point.slip / point.diameter
    phase = 2.0 * math.pi / point.cells * np.array(series.position)[:, :, ALONG]
    amplitude = 2.0 * np.abs(np.exp(1j * phase).mean(axis=1))
    start, window = round(DEVELOPED / step), round(SMOOTHED / step)
    waves = averaged(amplitude[start:], window) > EVEN
    end = start + window // 2 + int(np.argmax(waves)) if waves.any() else len(amplitude)
    return start * step, end * step


def measure(
    point: Point, series: Series, settle: float, until: float = math.inf, *, weight: float | None = None
) -> dict[str, Any]:
    """The row of a point: means and standard errors of everything that is measured.

    Speeds are over the mean slip w, times over d/w, forces over the mean drag. Drag is the force of the fluid without
    that of the mean pressure gradient.

    settle  time that is dropped [d/w, by the slip aimed at]
    until   end of what is measured [d/w, by the slip aimed at]
    weight  buoyant weight of a sphere; that of the point by default
    """
    sampled = series.every * point.slip / point.diameter
    start, end = round(settle / sampled), round(min(until / sampled, len(series.slip)))
    arrays = {name: values[start:end] for name, values in series.arrays().items() if name != "every"}
    slip = arrays["slip"][:, ALONG]
    w = float(slip.mean())
    step = series.every * w / point.diameter  # between samples [d/w]
    block, quarter = max(round(3.0 / step), 1), max(round(0.25 / step), 1)
    solid = point.count * sphere_volume(point.diameter) / point.cells**3
    pressure = solid * (point.weight if weight is None else weight)
    drag = float(arrays["force"][:, :, ALONG].mean()) - pressure
    velocity, force = (_deviation(arrays[name]) / scale for name, scale in (("velocity", w), ("force", drag)))
    phase = 2.0 * math.pi / point.cells * arrays["position"]
    fluid_velocity = without_waves(force + velocity, phase)
    return {
        "spheres": point.count,
        "solid_fraction": solid,
        "averaged": len(slip) * step,
        "slip": block_mean(slip, block),
        **_mean_drag(point, solid, w, drag),
        **_agitation(velocity, block),
        **_box_waves(velocity, phase, block),
        **_collisions(arrays, point.count, step, w, block),
        **_fluctuating_force(averaged(force, quarter), averaged(fluid_velocity, quarter), block),
        "lag": [round(k * step, 5) for k in range(LAGS)],
        "window": quarter * step,
        "inertia": inertia_coefficient(point.density_ratio, 1.0, solid) * sphere_volume(point.diameter)
        * w**2 / point.diameter / drag,
    }  # fmt: skip


def _deviation(values: np.ndarray) -> np.ndarray:
    """Deviation from the mean over all spheres, at every time."""
    return np.asarray(values - values.mean(axis=1, keepdims=True))


def _mean_drag(point: Point, solid: float, w: float, drag: float) -> dict[str, Any]:
    """Reynolds number and mean drag beside the laws of fixed arrays."""
    reynolds = (1.0 - solid) * w * point.diameter / point.viscosity
    factor = drag / (3.0 * math.pi * point.viscosity * point.diameter * (1.0 - solid) * w)
    return {
        "reynolds": reynolds,
        "drag_factor": factor,
        "drag_over_tenneti": factor / tenneti(reynolds, 1.0 - solid),
        "drag_over_beetstra": factor / beetstra(reynolds, 1.0 - solid),
    }


def _agitation(velocity: np.ndarray, block: int) -> dict[str, Any]:
    """Granular temperature, its components, and their ratio."""
    square = (velocity**2).mean(axis=1)
    along, across = square[:, ALONG], square[:, :ALONG].mean(axis=1)
    return {
        "temperature": block_mean((along + 2.0 * across) / 3.0, block),
        "temperature_along": block_mean(along, block),
        "temperature_across": block_mean(across, block),
        "anisotropy": float(along.mean() / across.mean()),
    }


def _box_waves(velocity: np.ndarray, phase: np.ndarray, block: int) -> dict[str, Any]:
    """Waves as long as the box: their amplitude over the solid fraction, and the granular temperature without them."""
    square = (without_waves(velocity, phase) ** 2).mean(axis=1)
    along, across = square[:, ALONG], square[:, :ALONG].mean(axis=1)
    amplitude = 2.0 * np.abs(np.exp(1j * phase).mean(axis=1))
    return {
        "wave_amplitude_along": block_mean(amplitude[:, ALONG], block),
        "wave_amplitude_across": block_mean(amplitude[:, :ALONG].mean(axis=1), block),
        "temperature_without_waves": block_mean((along + 2.0 * across) / 3.0, block),
        "anisotropy_without_waves": float(along.mean() / across.mean()),
    }


def without_waves(values: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Values of the spheres (time, spheres, components) less their mean and waves of one period along each axis.

    The best sum of these seven modes is taken out at every time; the rest is scaled up for the freedom that they took.

    phase  positions in the box, from 0 to 2 pi
    """
    modes = np.concatenate([np.ones_like(phase[:, :, :1]), np.cos(phase), np.sin(phase)], axis=2)
    weights = np.linalg.solve(np.einsum("tni,tnj->tij", modes, modes), np.einsum("tni,tnc->tic", modes, values))
    count = phase.shape[1]
    left = count / (count - modes.shape[2])
    return np.asarray(math.sqrt(left) * (values - np.einsum("tni,tic->tnc", modes, weights)))


def _collisions(arrays: dict[str, Any], count: int, step: float, w: float, block: int) -> dict[str, Any]:
    """Collisions of a sphere within d/w, and their mean normal speed of approach."""
    hits = float(arrays["collisions"].sum())
    speed = float(arrays["impact"].sum()) / hits / w if hits else math.nan
    return {"collision_rate": block_mean(2.0 * arrays["collisions"] / count / step, block), "impact_speed": speed}


def _fluctuating_force(force: np.ndarray, fluid_velocity: np.ndarray, block: int) -> dict[str, Any]:
    """Deviation and autocorrelation of the force, and autocovariance of the force that the closure describes.

    force           averaged over a quarter of d/w
    fluid_velocity  the same without waves as long as the box, and without the drag on a sphere's own fluctuation
    """
    numbers: dict[str, Any] = {}
    for way, axes in (("along", slice(ALONG, None)), ("across", slice(None, ALONG))):
        squares = (force[:, :, axes] ** 2).mean(axis=(1, 2))
        covariance, scatter = autocovariance(force[:, :, axes])
        numbers[f"force_deviation_{way}"] = block_root(squares, block)
        numbers[f"correlation_{way}"] = _rounded(covariance / covariance[0])
        numbers[f"correlation_error_{way}"] = _rounded(scatter / covariance[0])
        numbers[f"seen_covariance_{way}"] = _rounded(autocovariance(fluid_velocity[:, :, axes])[0])
    return numbers


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(number), 5) for number in values]


def averaged(values: np.ndarray, window: int) -> np.ndarray:
    """Running means over so many samples, along the first axis."""
    total = np.cumsum(np.concatenate([np.zeros_like(values[:1]), values]), axis=0)
    return np.asarray((total[window:] - total[:-window]) / window)


def autocovariance(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Autocovariance of samples (time, spheres, components) about zero, and its standard error over the spheres."""
    per_sphere = np.array(
        [(values[: len(values) - k] * values[k:]).mean(axis=(0, 2)) for k in range(min(LAGS, len(values)))]
    )
    return per_sphere.mean(axis=1), per_sphere.std(axis=1) / math.sqrt(values.shape[1])


def block_mean(values: np.ndarray, block: int) -> list[float | None]:
    """Mean and standard error, from the scatter of means over blocks; no error where there are fewer than two."""
    count = len(values) // block
    means = values[len(values) - count * block :].reshape(count, block).mean(axis=1)
    error = float(means.std(ddof=1)) / math.sqrt(count) if count > 1 else None
    return [float(values.mean()), error]


def block_root(squares: np.ndarray, block: int) -> list[float | None]:
    """Root of the mean square and its standard error."""
    mean, error = block_mean(squares, block)
    assert mean is not None
    root = math.sqrt(mean)
    return [root, None if error is None else 0.5 * error / root]
