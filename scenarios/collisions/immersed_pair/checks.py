"""Binary collisions compared with exact solutions, converged solutions, and runs with a finer step."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cfddem.backend.errors import UnstableStep
from cfddem.case.materials import Material
from cfddem.particles.material_pairs import pair_table
from closures.minimum_gap import elastohydrodynamic
from scenarios.collisions.immersed_pair.study import MATERIALS, Collision, collide
from scenarios.validation.table import Columns, Curves, Row, numbers, worst

DRY = 0.97  # e_dry of the four materials
CUTOFF = 12.7e-3 / 4  # R* of two equal spheres and the reach of their film [m]
WATER = 1.0e-3  # [Pa s]
SPEED = 0.1  # of approach, unless given [m/s]
CONVERGED = 5e-4
"""Step of a converged solution, over the Hertz time."""


def film_gap(material: Material, speed: float, stokes: float, diameter: float = 12.7e-3) -> float:
    """h_min of two equal spheres by its two laws [m]."""
    row, radius = pair_table([material])[0, 0], diameter / 4.0
    mass = material.density * math.pi / 12.0 * diameter**3
    viscosity = speed * mass / (6.0 * math.pi * radius**2 * stokes)
    return max(float(row["roughness_gap"]), elastohydrodynamic(viscosity, speed, float(row["film_modulus"]), radius))


def walls(curves: Curves) -> list[Row]:
    """Pair against wall on one curve of the binary Stokes number."""
    stokes, rows = np.geomspace(25.0, 2000.0, 20), []
    for name in ("steel_rough", "glass", "delrin"):
        pair, wall = (
            np.array([collide(MATERIALS[name], velocity=SPEED, stokes=st, against=body).restitution for st in stokes])
            for body in ("sphere", "wall")
        )
        curves[f"pair_and_wall/{name}"] = {"stokes": (stokes, "-"), "pair": (pair, "-"), "wall": (wall, "-")}
        offset = [(st, a - b, (1.0 + DRY) * math.log(2.0) / st) for st, a, b in zip(stokes, pair, wall) if b > 0.0]
        rows.append(worst(f"{name}: e pair - e wall, (1+e_dry) ln2/St", offset, 1e-3))
    return rows


def readings(curves: Curves) -> list[Row]:
    """Two readings of restitution: where the pair leaves the film, and at the time 2 h0/v0."""
    stokes = np.array([18, 18.5, 19, 20, 21, 21.5, 22, 23, 25, 27, 30, 33, 36, 40, 45, 50, 60], float)
    rows = []
    for name in ("delrin", "glass"):
        leaving, timed = [], []
        for st in stokes:
            run = collide(MATERIALS[name], viscosity=WATER, stokes=st, trajectory="full")
            speed = run.history["normal_speed"] / -run.history["normal_speed"][0]
            end = 4.0 * CUTOFF / -run.history["normal_speed"][0]
            leaving.append(run.restitution)
            timed.append(float(np.interp(end, run.time, speed)))
        curves[f"readings/{name}"] = {
            "stokes": (stokes, "-"),
            "restitution_at_cutoff": (leaving, "-"),
            "restitution_at_time": (timed, "-"),
        }
        rows += [
            Row(f"{name}, St {st:.0f}: e at 2 h0/v0; ref. at h_co", timed[k], leaving[k])
            for k, st in enumerate(stokes)
            if st in (20, 30)
        ]
    return rows


def film_zone(curves: Curves) -> list[Row]:
    """In the film zone the speed is linear in ln h."""
    points = []
    for name, material in MATERIALS.items():
        for stokes in (5, 30, 100):
            run = collide(material, velocity=SPEED, stokes=stokes)
            inbound = (np.arange(len(run.gap)) < np.argmin(run.gap)) & (run.gap > film_gap(material, SPEED, stokes))
            speed = run.history["normal_speed"][inbound] / SPEED
            line = -1.0 + np.log(CUTOFF / run.gap[inbound]) / stokes
            most = int(np.abs(speed - line).argmax())
            points.append((stokes, speed[most], line[most]))
            curves[f"film_zone/{name}_stokes_{stokes}"] = {"gap": (run.gap[inbound], "m"), "speed": (speed, "-")}
    return [worst("film zone: u/v0, -1 + ln(h_co/h)/St", points, 1e-3)]


def tables(curves: Curves) -> list[Row]:
    """Converged solutions: head-on, oblique with a frozen line of centres, oblique on the full path."""
    head_on, frozen, full = (
        numbers(f"binary_collision_{name}") for name in ("head_on", "oblique_frozen", "oblique_full")
    )
    rows = []
    for name in ("delrin", "glass"):
        e = [collide(MATERIALS[name], velocity=SPEED, stokes=st).restitution for st in head_on["St"]]
        rows.append(worst(f"{name}, head-on: e at St 20 to 2000", zip(head_on["St"], e, head_on[f"e_{name}"]), 1e-3))
    delrin = MATERIALS["delrin"]
    runs = [collide(delrin, viscosity=WATER, stokes=100.0, angle=angle) for angle in frozen["angle"]]
    along = [
        collide(
            delrin,
            viscosity=WATER,
            stokes=100.0 * math.cos(math.radians(angle)),
            angle=angle,
            trajectory="full",
            friction_onset="overlap",
        )
        for angle in full["angle"]
    ]
    for title, results, reference, column, name, limit in (
        ("oblique, frozen: e_t", runs, frozen, "e_t", "restitution_tangential", 5e-3),
        ("oblique, frozen: striker's angle", runs, frozen, "angle_striker", "rebound_angle_striker", 0.3),
        ("oblique, frozen: relative angle", runs, frozen, "angle_relative", "rebound_angle_relative", 0.3),
        ("oblique, full path: e_n", along, full, "e_n", "restitution", 5e-3),
        ("oblique, full path: e_t", along, full, "e_t", "restitution_tangential", 5e-3),
        ("oblique, full path: striker's angle", along, full, "angle_striker", "rebound_angle_striker", 0.3),
    ):
        values = [getattr(result, name) for result in results]
        unit = "deg" if limit == 0.3 else "-"
        rows.append(worst(title, zip(reference["angle"], values, reference[column]), limit, unit=unit))
    return rows


@dataclass(frozen=True)
class RandomImpact:
    """A head-on impact drawn at random."""

    material: Material
    diameter: float
    speed: float
    stokes: float

    @property
    def deformed(self) -> bool:
        """Whether the film's pressure, not the asperities, sets the minimum gap."""
        return film_gap(self.material, self.speed, self.stokes, self.diameter) > self.material.roughness

    def collide(self, **options: Any) -> Collision:
        """Collide two such spheres."""
        return collide(self.material, diameter=self.diameter, velocity=self.speed, stokes=self.stokes, **options)


def drawn(count: int, seed: int, restitution: tuple[float, float]) -> Iterator[RandomImpact]:
    """Impacts over 0.2 to 13 mm, 50 MPa to 190 GPa, either mechanism, and a range of dry restitution."""
    random = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    for _ in range(count):
        diameter = between(0.2e-3, 13e-3)
        material = Material(
            density=between(1100.0, 8000.0),
            youngs_modulus=between(50e6, 190e9),
            poisson=0.3,
            restitution=random.uniform(*restitution),
            roughness=between(5e-9, 3e-6) * math.sqrt(diameter / 13e-3),
        )
        yield RandomImpact(material, diameter, between(0.02, 1.0), between(15.0, 1000.0))


def integrators(curves: Curves) -> list[Row]:
    """Both integrators at 2 % of the Hertz time against a step forty times finer."""
    rows = []
    for title, count, span, limit in (
        ("e_dry 0.9 to 0.98", 32, (0.9, 0.98), 1e-3),
        ("e_dry 0.5 to 0.9", 12, (0.5, 0.9), 4e-3),
    ):
        impacts = Integrated()
        for impact in drawn(count, seed=7, restitution=span):
            impacts.add(impact)
        group = f"integrators/{title.replace(' ', '_')}"
        for name in ("drift", "verlet", "verlet_with_warning"):
            curves[f"{group}/{name}"] = _columns(getattr(impacts, name))
        mix = f"{impacts.deformed} of {count} elastohydrodynamic; plain Verlet refused {impacts.refused}"
        rows += [worst(f"drift at 2 %, {title}: e", impacts.drift, limit, note=mix)]
        if impacts.verlet:
            rows += [worst(f"Verlet, film resolved, {title}: e", impacts.verlet, 0.012, note=mix)]
        if impacts.verlet_with_warning:
            rows += [worst(f"Verlet, with warning, {title}: e", impacts.verlet_with_warning, note=mix)]
    return rows


def oblique(curves: Curves) -> list[Row]:
    """Oblique impacts drawn at random, at the default step and at 0.1 % of the Hertz time."""
    random = np.random.default_rng(11)
    rows = []
    for onset in ("film", "overlap"):
        pairs = []
        for impact in drawn(12, seed=13, restitution=(0.9, 0.98)):
            surface = {"friction": random.uniform(0.05, 0.5), "friction_lubricated": random.uniform(0.01, 0.1)}
            rubbing = replace(impact, material=impact.material.model_copy(update=surface), stokes=impact.stokes + 10.0)
            options: dict[str, Any] = {"angle": random.uniform(3.0, 70.0), "friction_onset": onset}
            pairs.append((rubbing.collide(**options), rubbing.collide(**options, step_fraction=1e-3)))
        for title, name, limit, unit in (
            ("e_t", "restitution_tangential", 5e-3, "-"),
            ("striker's angle", "rebound_angle_striker", 0.3, "deg"),
            ("relative angle", "rebound_angle_relative", 0.3, "deg"),
        ):
            points = [(fine.stokes, getattr(run, name), getattr(fine, name)) for run, fine in pairs]
            rows.append(worst(f"oblique, random, {onset}: {title}", points, limit, unit=unit))
            curves[f"integrators/oblique_{onset}/{name}"] = _columns(points, unit)
    return rows


@dataclass
class Integrated:
    """Results of both integrators for some impacts: (St, e, e converged) of each."""

    drift: list[tuple[float, float, float]] = field(default_factory=list)
    verlet: list[tuple[float, float, float]] = field(default_factory=list)
    verlet_with_warning: list[tuple[float, float, float]] = field(default_factory=list)
    deformed: int = 0
    refused: int = 0

    def add(self, impact: RandomImpact) -> None:
        """Run an impact with a converged step, with the drift integrator, and with Verlet unless that is refused."""
        self.deformed += impact.deformed
        exact = impact.collide(step_fraction=CONVERGED).restitution
        self.drift.append((impact.stokes, impact.collide().restitution, exact))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                value = impact.collide(integrator="verlet").restitution
            except UnstableStep:
                self.refused += 1
                return
        (self.verlet_with_warning if caught else self.verlet).append((impact.stokes, value, exact))


def _columns(points: list[tuple[float, float, float]], unit: str = "-") -> Columns:
    stokes, value, exact = np.array(points).reshape(-1, 3).T
    return {"stokes": (stokes, "-"), "value": (value, unit), "converged": (exact, unit)}
