"""The beds of the map of films: their dimensionless numbers, their cases, and the order in which they run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from scipy.optimize import brentq

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.preflight.expansion import expansion_exponents
from closures.agitation import free_spheres
from closures.registry import law_of

STOKES = (20.0, 100.0, 500.0)
"""Stokes numbers at the terminal velocity of a single sphere; those of the collisions are 20 to 60 times smaller."""

SOLID_FRACTIONS = (0.25, 0.35, 0.45)
"""By Richardson and Zaki; they set the velocity of each bed."""

DENSITY_RATIOS = (1.5, 2.5, 7.0)
"""Of spheres over liquid."""

ROUGHNESS = {"smooth": 5.0e-8, "rough": 1.0e-5, "soft": 5.0e-8}
"""Of the spheres with films [m]; the reduced radius R* is 5e-4 m."""

SOFT = 5.0
"""Real modulus of soft spheres, over that of the softened contact; others have that of glass."""

DRY = "no film"

SPHERES = 440
"""The lowest beds are four cells high."""

CORNERS = {"solid_fraction": (0.25, 0.45), "density_ratio": (2.5, 7.0)}
"""Levels of the coarse design, which runs first; it has all Stokes numbers."""

SEEDS = (1, 2, 3)

TURNOVERS, SETTLED = 4.0, 1.5
"""End of a run and start of its averages, over the time in which the flow rises through the bed, H/U."""

ROOM = 1.6
"""Height of the column over that of the bed by Richardson and Zaki, at least."""

REFERENCE_SPEED = 0.64
"""Speed of the fastest collisions over the superficial velocity."""

REFERENCE_VELOCITY = 0.0785
"""Superficial velocity for which the softened contact of the gallery case, 0.1 MPa, was chosen [m/s]."""


class Point(NamedTuple):
    """The dimensionless numbers of a bed."""

    stokes: float
    solid_fraction: float
    density_ratio: float
    agitated: bool = False

    @property
    def name(self) -> str:
        """Name for folders."""
        words = f"St{self.stokes:g}-phi{self.solid_fraction:g}-ratio{self.density_ratio:g}"
        return f"{words}-agitated" if self.agitated else words


class Run(NamedTuple):
    """One bed of the study."""

    point: Point
    film: str  # of ROUGHNESS, or DRY
    seed: int

    @property
    def name(self) -> str:
        """Name of its folder and of its file of results."""
        return f"{self.point.name}-{self.film.replace(' ', '_')}-seed{self.seed}"


def points() -> list[Point]:
    """All points: without agitation, then those within the range of agitation with it."""
    even = [Point(*values) for values in itertools.product(STOKES, SOLID_FRACTIONS, DENSITY_RATIOS)]
    return even + [point._replace(agitated=True) for point in even if is_corner(point) and is_in_range(point)]


def is_corner(point: Point) -> bool:
    """Whether a point belongs to the coarse design."""
    return all(getattr(point, name) in levels for name, levels in CORNERS.items())


@cache
def is_in_range(point: Point) -> bool:
    """Whether agitation was measured at the Reynolds number of a point."""
    lowest, highest = law_of(free_spheres).ranges["reynolds"]
    return bool(lowest <= reynolds(bed(point, DRY, SEEDS[0])) <= highest)


def plan() -> Iterator[Run]:
    """All runs, in the order in which they begin: a table is complete, and then finer, after each part.

    The coarse design with two seeds, its agitated beds, the third seed, soft spheres, all other points.
    """
    corners = [point for point in points() if is_corner(point)]
    even, agitated = ([corner for corner in corners if corner.agitated == moved] for moved in (False, True))
    others = [point for point in points() if not is_corner(point)]
    first = (DRY, "smooth", "rough")
    for chosen, films, seeds in (
        (even, first, SEEDS[:2]),
        (agitated, first, SEEDS[:2]),
        (corners, first, SEEDS[2:]),
        (corners, ("soft",), SEEDS),
        (others, first, SEEDS),
    ):
        for seed, point, film in itertools.product(seeds, chosen, films):
            yield Run(point, film, seed)


@cache
def reference_bed() -> Case:
    """The lubrication study, from which all beds of the map are made."""
    return Case.from_toml(gallery_files()["lubrication-study"])


def bed(point: Point, film: str, seed: int) -> Case:
    """The case of a bed: that of the lubrication study with other liquid, spheres, velocity and duration.

    The contacts are softened so that spheres overlap as little in all beds, by their weight and by their collisions.
    """
    case = _of_liquid(point.density_ratio, viscosity(point.stokes, point.density_ratio))
    exponent, terminal = expansion_exponents(case)["Richardson-Zaki"]
    velocity = terminal * (1.0 - point.solid_fraction) ** exponent
    height = (
        case.particle_count * math.pi / 6.0 * case.bed.diameter**3 / (case.column.floor_area * point.solid_fraction)
    )
    end, reference = TURNOVERS * height / velocity, reference_bed()
    faster = (velocity / REFERENCE_VELOCITY) ** 2
    solid, liquid = reference.solid.density, reference.required_fluid.density
    heavier = (point.density_ratio - 1.0) * liquid / (solid - liquid)
    modulus, cell = reference.solid.contact_modulus, case.column.cell
    assert modulus is not None and isinstance(cell, float)
    softened = modulus * max(heavier, point.density_ratio * liquid / solid * faster)
    return case.with_(**{
        "title": f"Bed of the map of films: {point.name}, {film}",
        "bed.inlet_velocity": velocity,
        "bed.seed": seed,
        "material.sphere.roughness": ROUGHNESS.get(film, ROUGHNESS["smooth"]),
        "material.sphere.contact_modulus": softened,
        "material.sphere.youngs_modulus": SOFT * softened if film == "soft" else case.solid.youngs_modulus,
        "laws.lubrication": "none" if film == DRY else case.laws.lubrication,
        "laws.agitation": "free_spheres" if point.agitated else "none",
        "laws.surface": "smeared",
        "column.height": cell * math.ceil(ROOM * height / cell),
        "run.until": end,
        "run.average_from": SETTLED * height / velocity,
        "run.every": end / 4.0,
        "run.history_every": end / 160.0,
        "run.reference_speed": REFERENCE_SPEED * velocity,
        "run.energy_budget": True,
    })  # fmt: skip


@cache
def viscosity(stokes: float, density_ratio: float) -> float:
    """Viscosity at which a single sphere that falls has a Stokes number [Pa s]."""

    def excess(logarithm: float) -> float:
        case = _of_liquid(density_ratio, math.exp(logarithm))
        return math.log(stokes_of(case, expansion_exponents(case)["Richardson-Zaki"][1]) / stokes)

    return math.exp(brentq(excess, math.log(1e-5), math.log(1.0), xtol=1e-9))


def stokes_of(case: Case, speed: float) -> float:
    r"""Stokes number of a pair of spheres of a bed that approach each other at a speed.

    .. math:: St = \frac{m^* v}{6\pi\eta R^{*2}} = \frac{2\rho_p d v}{9\eta}

    speed  v [m/s]
    """
    return 2.0 * case.solid.density * case.bed.diameter * speed / (9.0 * viscosity_of(case))


def viscosity_of(case: Case) -> float:
    """Viscosity of the liquid, which has no layers [Pa s]."""
    viscosity = case.required_fluid.viscosity
    assert isinstance(viscosity, float)
    return viscosity


def reynolds(case: Case) -> float:
    """Re_m of a uniform bed: the solid fraction and its mean slip make it that of the superficial velocity."""
    assert isinstance(case.bed.inlet_velocity, float)
    return case.required_fluid.density * case.bed.inlet_velocity * case.bed.diameter / viscosity_of(case)


def _of_liquid(density_ratio: float, viscosity: float) -> Case:
    case = reference_bed()
    density = density_ratio * case.required_fluid.density
    changes = {"bed.count": SPHERES, "material.sphere.density": density, "fluid.viscosity": viscosity}
    return case.with_(**changes)
