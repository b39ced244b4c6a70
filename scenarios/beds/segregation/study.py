"""Two species in one stream of water: which one sinks below and above the velocity at which they change places.

Small dense beads lie below large light pellets at low velocity, and above them at high velocity. The published
threshold is the velocity of equal bulk densities of the two layers. The drag law has its own threshold, where the
forces on both species vanish in the uniform mixture. Both are computed without a run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.plotting.curves import BLUE, ORANGE, label, legend, panels, save
from cfddem.preflight.bed_estimate import estimate_bed, net_downward_forces
from cfddem.preflight.expansion import expansion_exponents
from cfddem.run.history import MEAN_HEIGHT
from closures.balance import inversion_velocity

VELOCITIES = (0.04, 0.105)
"""Superficial velocities on both sides of the threshold [m/s]."""


def mixture(velocity: float = VELOCITIES[0]) -> Case:
    """The case of the gallery at a superficial velocity [m/s]."""
    return Case.from_toml(gallery_files()["segregation"], {"bed.inlet_velocity": velocity})


def thresholds(case: Case) -> dict[str, float]:
    """Velocity at which the layers of the two species are equally dense, by each published law of expansion [m/s]."""
    alone = [expansion_exponents(_alone(case, name)) for name in case.species]
    densities = [case.material_of(species).density for species in case.species.values()]
    first, second = densities
    return {
        law: inversion_velocity(
            (alone[0][law][1], alone[1][law][1]), (alone[0][law][0], alone[1][law][0]), (first, second),
            case.required_fluid.density,
        )
        for law in alone[0]
    }  # fmt: skip


def balance(case: Case) -> float:
    """Velocity at which the drag law of the case carries both species in the uniform mixture; NaN if none [m/s]."""
    from scipy.optimize import brentq

    second = list(case.species)[1]

    def force(velocity: float) -> float:
        estimate = estimate_bed(case.with_(**{"bed.inlet_velocity": velocity}))
        return net_downward_forces(case, velocity, estimate.voidage)[second]

    estimate = estimate_bed(case)
    low, high = 1.05 * estimate.onset, 0.8 * estimate.terminal
    return float(brentq(force, low, high, xtol=1e-6)) if force(low) * force(high) < 0.0 else math.nan


def separation(history: Mapping[str, np.ndarray], names: tuple[str, str], begin: float) -> float:
    """How far the second species lies above the first: 0 mixed, 1 a layer above the other, -1 a layer below it [-].

    history  of a run
    names    of the species
    begin    of the mean [s]

    The centres of two layers that fill the bed are half of its height apart.
    """
    window = history["time"] >= begin
    below, above = (history[f"{MEAN_HEIGHT}{name}"][window] for name in names)
    return float((2.0 * (above - below) / history["bed_height"][window]).mean())


def figure(runs: Mapping[float, RunData], path: Path) -> None:
    """Two species from the side at the end of each run, and the mean heights of both in time.

    runs  by superficial velocity [m/s]
    path  PNG
    """
    from matplotlib.collections import EllipseCollection

    picture, axes = panels(2 * len(runs), width=5.6 * len(runs), height=4.6)
    highest = max(float(run.particles()["position"][:, 2].max()) for run in runs.values())
    for (velocity, run), side, heights in zip(runs.items(), axes[::2], axes[1::2]):
        particles, names = run.particles(), [name for name in run.history if name.startswith(MEAN_HEIGHT)]
        order = np.argsort(-particles["position"][:, 1])  # the nearest are drawn last
        sizes, colours = 2e3 * particles["radius"][order], np.array([BLUE, ORANGE])[particles["species"][order]]
        places = 1e3 * particles["position"][order][:, [0, 2]]
        spheres = EllipseCollection(
            sizes, sizes, np.zeros_like(sizes), units="x", offsets=places, offset_transform=side.transData,
            facecolors=colours, edgecolors="white", linewidths=0.2,
        )  # fmt: skip
        side.add_collection(spheres)
        side.set(xlim=(0.0, 1e3 * _width(run)), ylim=(0.0, 1.05e3 * highest), aspect="equal")
        label(side, "x", "mm", "z", "mm", f"{velocity:g} m/s, {run.times[-1]:g} s")
        for name, colour in zip(names, (BLUE, ORANGE)):
            species = name.removeprefix(MEAN_HEIGHT)
            heights.plot(run.history["time"], 1e3 * run.history[name], color=colour, label=species)
        heights.set(ylim=(0.0, None))
        label(heights, "time", "s", "mean height", "mm")
        legend(heights)
    save(picture, path)


def _width(run: RunData) -> float:
    """Width of the column of a run [m]."""
    assert run.grid is not None
    return run.grid.spacing[0] * run.grid.cells[0]


def _alone(case: Case, name: str) -> Case:
    """The case with one of its species only."""
    species = case.species[name].model_dump(exclude={"fraction", "count"})
    rest = {key: value for key, value in case.bed.model_dump().items() if key not in ("species", "height", *species)}
    return case.with_(bed={**rest, **species, "count": case.counts[name]})
