"""Agitation: the law of free spheres against the resolved runs it was fitted to, those it was not, and beds.

The fit uses the autocovariance of the force in every other point of the matrix of resolved runs, in the time in which
the suspension is even. The unresolved model is then run in the same boxes, and in fluidised beds; nothing is fitted to
a granular temperature or a voidage. Every box and every bed is kept in a file of its own: a study that was stopped
goes on where it was.

`python -m scenarios.validation.agitation.study TABLE.json OUTPUT.png` draws the table of `cfddem validate agitation`.

The mean flow is uniform: the filter kernel is as wide as half of the box, so that all spheres see the same mean
velocity and voidage, and no wave of the box grows. Agitation comes from the closure alone; drag, contacts and films
dissipate it. Spheres, contacts, density ratio, solid fraction, mean slip and mean drag are those of the resolved run.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.case.schema import Case
from cfddem.plotting.curves import BLUE, GREEN, ORANGE, blank, label, legend, save
from cfddem.run.simulation import Simulation
from closures.agitation import SHARES, TIMES, free_spheres
from closures.drag_resolved import tenneti
from scenarios.beds.liquid_bed.study import STUDIES, FluidisedBed, Study, coarse_glass, fluidise
from scenarios.references.resolved_suspension import matrix
from scenarios.references.resolved_suspension.film import new_impacts
from scenarios.references.resolved_suspension.fitting import fit_levels, fit_shares
from scenarios.references.resolved_suspension.measures import Series, measure
from scenarios.references.resolved_suspension.study import stored
from scenarios.references.resolved_suspension.suspension import OVERLAP, Point, random_arrangement
from scenarios.validation.kept_runs import kept
from scenarios.validation.table import Progress, Row

FITTED_UP_TO = 60.0
"""Largest Re_m that was asked of the runs of the fit; those above it were made later [-]."""

LIMIT = 0.3
"""Largest deviation of the unresolved model from the resolved runs that are not part of the fit."""

COMPARED = {
    "granular temperature": "temperature_without_waves",
    "anisotropy": "anisotropy_without_waves",
    "collision rate": "collision_rate",
}
"""What is compared, and its name in a row."""

KEPT = (*COMPARED.values(), "averaged", "reynolds")
"""Measured values of a box that are kept in its file."""

FURTHER: dict[str, Any] = {"laws.added_mass": 0.5, "laws.history": "mei_adrian"}
"""Forces that the closure was fitted without; the boxes are run with them, too."""

BEDS = {**STUDIES, "coarse glass": Study(coarse_glass, (0.06,), 1.0, 2.0)}
"""The beds; coarse glass, at Re_m = 96, is between the resolved runs of the fit and those above it."""

PUBLISHED = {0.009: 0.635, 0.012: 0.703}
"""Velocity [m/s] and mean of the voidages of alginate beads by three power laws, where the law of agitation acts."""

ALUMINA = (0.12, 0.157033, 0.20)
"""Velocities of the beds of alumina [m/s]."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Fit, runs in the boxes of the resolved runs, and beds."""
    use_threads(1)  # the boxes are small
    rows = [*fits(), *boxes(folder, progress)]
    use_threads(None)
    return rows + list(beds(folder, progress))


def even_rows() -> list[dict[str, Any]]:
    """Measured values of the stored runs, each while its suspension is even."""
    return [{**row["even"], "point": row["point"]} for row in stored() if row["even"] is not None]


def fitted(row: dict[str, Any]) -> bool:
    """Whether a run belongs to the half of the points that the law is fitted to: every other one up to FITTED_UP_TO."""
    numbers = [matrix.name(point) for point in matrix.POINTS]
    point = Point(**{**row["point"], "seed": 1})
    return point.reynolds <= FITTED_UP_TO and numbers.index(matrix.name(point)) % 2 == 0


def fits() -> Iterator[Row]:
    """The numbers of the laws, fitted again to the stored runs."""
    half = [row for row in even_rows() if fitted(row)]
    levels, shares = fit_levels(half), fit_shares(half)
    note = f"{len(half)} runs"
    yield Row("free spheres: variance along", free_spheres(0.3, 40.0, 1.0, 2.5), levels.along, 0.002, "w^2", note)
    yield Row("free spheres: variance across", free_spheres(0.3, 40.0, 0.0, 2.5), levels.across, 0.002, "w^2", note)
    yield Row("free spheres: correlation time", TIMES["free_spheres"], levels.time, 0.02, "d/w", note)
    along, across = SHARES["pseudo_turbulence"]
    yield Row("pseudo-turbulence: a_d along", along, shares.along, 0.01, "-", note)
    yield Row("pseudo-turbulence: a_d across", across, shares.across, 0.01, "-", note)
    yield Row("pseudo-turbulence: a_i", 0.0, shares.inertia, 0.01, "-", note)
    yield Row("pseudo-turbulence: correlation time", TIMES["pseudo_turbulence"], shares.time, 0.02, "d/w", note)


def boxes(folder: Path, progress: Progress) -> Iterator[Row]:
    """The unresolved model over the resolved runs, mean of the seeds; limits for points that are not fitted.

    With added mass and history force, which the closure was fitted without, no row has a limit.
    """
    points: dict[str, list[dict[str, Any]]] = {}
    for row in even_rows():
        points.setdefault(matrix.name(Point(**{**row["point"], "seed": 1})), []).append(row)
    for rows in points.values():
        point, is_fitted = rows[0]["point"], fitted(rows[0])
        name = f"density ratio {point['density_ratio']:g}, solid fraction {point['solid_fraction']:g}"
        if point["reynolds"] > FITTED_UP_TO:
            name += f", Re_m {np.mean([row['reynolds'] for row in rows]):.0f}"
        progress(name)
        rule, of_fit = (None, ", fitted to its force") if is_fitted else (LIMIT, "")
        yield from _compared(name, [_box(folder, row) for row in rows], rows, rule, of_fit)
        name += ", with added mass and history force"
        progress(name)
        yield from _compared(name, [_box(folder, row, "-further", **FURTHER) for row in rows], rows, None, of_fit)


def _compared(
    name: str, results: list[dict[str, Any]], rows: list[dict[str, Any]], limit: float | None, remark: str
) -> Iterator[Row]:
    """Means of the unresolved model over those of the resolved runs."""
    for quantity, key in COMPARED.items():
        model, resolved = (float(np.mean([_value(row[key]) for row in some])) for some in (results, rows))
        note = f"{model:.3g} for {resolved:.3g}, {len(rows)} seeds{remark}"
        yield Row(f"{name}: {quantity}", model / resolved, 1.0, limit, note=note)


def _box(folder: Path, row: dict[str, Any], ending: str = "", **changes: Any) -> dict[str, Any]:
    """What the unresolved model gives in the box of a resolved run, with further keys of the case."""

    def compute() -> dict[str, Any]:
        results = run(row, **changes)
        return {name: results[name] for name in KEPT}

    return kept(folder / f"box-{matrix.name(Point(**row['point']))}{ending}.json", compute)


def _value(mean: Any) -> float:
    return float(mean[0] if isinstance(mean, list) else mean)


def beds(folder: Path, progress: Progress) -> Iterator[Row]:
    """Beds of glass within the measured range, of alginate at its edge, of alumina far outside."""

    def bed(beads: str, velocity: float, agitation: str, seed: int = 1) -> FluidisedBed:
        name = f"bed-{beads}-{1e3 * velocity:g}-{agitation}-seed{seed}"
        progress(name)
        changes = {"laws.agitation": agitation, "laws.surface": "smeared", "bed.seed": seed}
        return FluidisedBed(**kept(folder / f"{name}.json", lambda: asdict(fluidise(BEDS[beads], velocity, **changes))))

    glass = [(beads, velocity) for beads in ("glass", "coarse glass") for velocity in BEDS[beads].velocities]
    for beads, velocity in glass:
        name, still = f"{beads} at {1e3 * velocity:g} mm/s", bed(beads, velocity, "none")
        yield from _expansion(name, bed(beads, velocity, "free_spheres"), 0.02, None)
        yield Row(f"{name}, without agitation: voidage", still.voidage, still.balance)
        yield Row(f"{name}, without agitation: deviation of layers in time", still.layers)
    for velocity, published in PUBLISHED.items():
        name = f"alginate at {1e3 * velocity:g} mm/s"
        moved, quiet = (bed("alginate", velocity, law).voidage for law in ("free_spheres", "none"))
        yield Row(f"{name}, without agitation: voidage", quiet, published, 0.015)
        yield Row(f"{name}: voidage", moved, published, 0.015)
        farther = max(abs(moved - published) - abs(quiet - published), 0.0)
        yield Row(f"{name}: farther from the published mean than without agitation", farther, 0.0, 0.005)
    for velocity in ALUMINA:
        for law in ("free_spheres", "none"):
            name = (
                f"alumina at {1e3 * velocity:.0f} mm/s, {'an extrapolation' if law != 'none' else 'without agitation'}"
            )
            seeds = [bed("alumina", velocity, law, seed) for seed in (1, 2, 3)]
            yield from _packings(name, seeds)


def _packings(name: str, beds: list[FluidisedBed]) -> Iterator[Row]:
    """Means of several packings with their standard errors; the limits hold for the means."""

    def mean(quantity: str) -> tuple[float, str]:
        values = [getattr(bed, quantity) for bed in beds]
        error = float(np.std(values, ddof=1)) / math.sqrt(len(values))
        return float(np.mean(values)), f"{len(values)} seeds, standard error {error:.2g}"

    first, (voidage, note) = beds[0], mean("voidage")
    yield Row(f"{name}: voidage", voidage, first.balance, 0.02, note=f"balance of weight and drag; {note}")
    nearest = min(max(voidage, first.lowest), first.highest)
    spread = f"published laws: {first.lowest:.3f} to {first.highest:.3f}"
    yield Row(f"{name}: voidage outside of the published laws", abs(voidage - nearest), 0.0, 0.0, note=spread)
    yield Row(f"{name}: voidage of the layers inside", mean("inside")[0], first.balance, note=mean("inside")[1])
    layers, note = mean("layers")
    yield Row(f"{name}: deviation of layers in time", layers, 0.0, 0.03, note=f"layers of 2.5 d; {note}")
    carried, note = mean("carried")
    yield Row(f"{name}: pressure drop and wall load over weight", carried, 1.0, 0.01, note=note)


def _expansion(name: str, bed: FluidisedBed, limit: float, layers: float | None) -> Iterator[Row]:
    """Voidage with its limit, waves with theirs, and what carries the weight."""
    yield Row(f"{name}: voidage", bed.voidage, bed.balance, limit, note="balance of weight and drag")
    yield Row(f"{name}: deviation of layers in time", bed.layers, 0.0, layers, note="solid fraction, layers of 2.5 d")
    yield Row(f"{name}: pressure drop and wall load over weight", bed.carried, 1.0, 0.01)


# ---------------------------------------------------------------- figure of agitation


POINT = re.compile(r"density ratio ([\d.]+), solid fraction ([\d.]+)(?:, Re_m (\d+))?: (.*)")
QUANTITIES = ("granular temperature", "anisotropy", "collision rate")
MARKS = {"1.03": ("o", BLUE), "2.5": ("s", ORANGE), "3.6": ("D", GREEN), "7": ("^", "black")}
"""Marker and colour of each density ratio."""


def figure(rows: list[dict[str, Any]], path: Path) -> None:
    """Ratio of the unresolved to the resolved value against the solid fraction; hollow points were fitted."""
    drawn, axes = blank(1, len(QUANTITIES), width=9.0, height=4.0, sharey=True)
    for axis, quantity in zip(axes, QUANTITIES):
        axis.axhspan(0.7, 1.3, color="#eeeeee", zorder=0)
        axis.axhline(1.0, color="black", lw=1.0)
        axis.set_xlim(0.15, 0.57)
        axis.set_yscale("log")
        axis.set_yticks([0.5, 0.7, 1.0, 1.3, 1.7], ["0.5", "0.7", "1", "1.3", "1.7"])
        axis.minorticks_off()
        label(axis, "solid fraction", "-", "unresolved over resolved" if axis is axes[0] else "", "-", quantity)
    axes[1].set_ylabel("")
    axes[2].set_ylabel("")
    for row in rows:
        if point := POINT.match(row["quantity"]):
            marker, colour = MARKS[point[1]]
            face = "white" if row["verdict"] == "report" else colour
            panel, place = axes[QUANTITIES.index(point[4])], (float(point[2]), row["value"])
            panel.plot(*place, marker, color=colour, mfc=face, mew=1.6, ms=8)
            if point[3]:
                panel.annotate(f"$Re_m$ {point[3]}", place, (6, -3), textcoords="offset points", fontsize="small")
    for ratio, (marker, colour) in MARKS.items():
        axes[0].plot([], [], marker, color=colour, ms=8, label=f"density ratio {ratio}")
    axes[0].plot([], [], "o", color="black", mfc="white", mew=1.6, ms=8, label="hollow: fitted")
    legend(axes[0], loc="upper left")
    save(drawn, path)


# ---------------------------------------------------------------- the unresolved model


DIAMETER, SLIP, DENSITY = 1e-3, 0.05, 1000.0
"""Diameter [m], mean slip [m/s] and fluid density [kg/m3] of the case; results are made dimensionless by them."""

SAMPLES, LOOKS = 16, 4
"""Samples within d/w, and looks for new contacts within each; more looks find no more contacts."""


def case_of(point: Point, row: dict[str, Any], **changes: Any) -> Case:
    """Case of the box of a resolved run.

    row      of the resolved run: its Reynolds number and its mean drag
    changes  further keys of the case
    """
    phi, d = row["solid_fraction"], DIAMETER
    viscosity = (1.0 - phi) * DENSITY * SLIP * d / row["reynolds"]
    volume, excess = math.pi / 6.0 * d**3, (point.density_ratio - 1.0) * DENSITY
    weight = 3.0 * math.pi * viscosity * d * row["drag_factor"] * SLIP
    reduced_mass, reduced_radius = 0.5 * point.density_ratio * DENSITY * volume, 0.25 * d
    reduced_modulus = 15.0 / 16.0 * reduced_mass * SLIP**2 / (math.sqrt(reduced_radius) * (OVERLAP * d) ** 2.5)
    modulus = 2.0 * reduced_modulus * (1.0 - 0.25**2)
    side = point.box * d
    places = random_arrangement(point) * (d / point.diameter) % side
    case = Case(
        fluid={"density": DENSITY, "viscosity": viscosity},
        material={
            "sphere": {
                "density": point.density_ratio * DENSITY,
                "youngs_modulus": 1e9 * modulus,
                "contact_modulus": modulus,
                "poisson": 0.25,
                "restitution": point.restitution,
                "friction": point.friction,
                "roughness": point.roughness * d,
            }
        },
        column={"width": side, "height": side, "cell": side / 3.0, "sides": "periodic", "ends": "periodic"},
        bed={"diameter": d, "start": "placed", "positions": [tuple(place) for place in places.tolist()]},
        laws={
            "drag": "tenneti",
            "agitation": "free_spheres",
            "surface": "smeared",
            "self_disturbance_correction": False,
            "kernel_width": 0.5 * point.box,
            "gravity": (0.0, 0.0, -weight / (volume * excess)),
        },
        run={"until": 1e3, "reference_speed": SLIP},
    )
    return case.with_(**changes)


def run(row: dict[str, Any], *, settle: float = 10.0, until: float = 60.0, **changes: Any) -> dict[str, Any]:
    """Run the unresolved model in the box of a resolved run, and measure it in the same way.

    row            of the resolved run
    settle, until  time that is dropped, and end of the run [d/w]
    changes        further keys of the case
    """
    point = replace(Point(**row["point"]), reynolds=row["reynolds"])
    case = case_of(point, row, **changes)
    simulation = Simulation(case)
    ratio = row["drag_factor"] / tenneti(row["reynolds"], 1.0 - row["solid_fraction"])
    _hold_drag(simulation, ratio)
    fluid, particles = simulation.fluid, simulation.particles
    excess = (point.density_ratio - 1.0) * DENSITY
    fluid.boundaries.driving[2] = row["solid_fraction"] * excess * -case.laws.gravity[2]
    fluid.set_velocity((0.0, 0.0, SLIP))
    series = Series(round(point.diameter / point.slip / SAMPLES))
    touching = np.zeros(0, np.int64)
    for sample in range(round(SAMPLES * until)):
        hits, impact = 0.0, 0.0
        for look in range(LOOKS):
            velocity = particles.velocity[np.argsort(particles.id)]
            simulation.until((sample + (look + 1) / LOOKS) / SAMPLES * DIAMETER / SLIP)
            touching, speeds = new_impacts(simulation.particle_solver, velocity, touching)
            hits, impact = hits + len(speeds), impact + float(speeds.sum())
        _note(series, simulation, point, hits, impact)
    return measure(point, series, settle, weight=ratio * point.weight)


def _hold_drag(simulation: Simulation, ratio: float) -> None:
    """Multiply the drag law, so that the mean drag is that of the resolved run."""
    drag = simulation.forces["drag"]
    law = drag.conductance
    drag.conductance = lambda particles, flow: ratio * law(particles, flow)


def _note(series: Series, simulation: Simulation, point: Point, hits: float, impact: float) -> None:
    """Add a sample, in units of the lattice."""
    fluid, particles = simulation.fluid, simulation.particles
    order = np.argsort(particles.id)
    length, speed = point.diameter / DIAMETER, point.slip / SLIP
    weight = (particles.mass - fluid.density * particles.volume)[:, None] * np.array(simulation.case.laws.gravity)
    voidage = fluid.voidage[..., None]
    flow = (voidage * fluid.velocity).sum(axis=(0, 1, 2)) / voidage.sum()
    series.slip.append((flow - particles.velocity.mean(axis=0)) * speed)
    series.force.append((particles.applied - weight)[order] * (length * speed) ** 2 / DENSITY)
    series.velocity.append(particles.velocity[order] * speed)
    series.position.append(particles.position[order] * length)
    series.collisions.append(hits)
    series.impact.append(impact * speed)


if __name__ == "__main__":
    figure(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))["rows"], Path(sys.argv[2]))
