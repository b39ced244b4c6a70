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

REYNOLDS = (30.0, 60.0, 120.0)
"""Re_m, of the superficial velocity: that of the mean slip in a uniform bed. Agitation was measured from 25 to 130."""

SOLID_FRACTIONS = (0.25, 0.33, 0.42)
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

CORNERS = tuple((levels[0], levels[-1]) for levels in (REYNOLDS, SOLID_FRACTIONS, DENSITY_RATIOS))
"""Levels of the coarse design, which runs first: the outer two of each number."""

SEEDS = (1, 2, 3)

TURNOVERS, SETTLED = 3.0, 1.0
"""End of a run and start of its averages, over the time in which the flow rises through the bed, H/U."""

ROOM = 1.6
"""Height of the column over that of the bed by Richardson and Zaki, at least."""


class Point(NamedTuple):
    """The dimensionless numbers of a bed."""

    reynolds: float
    solid_fraction: float
    density_ratio: float
    agitated: bool = True

    @property
    def stokes(self) -> float:
        """Stokes number of a pair of spheres at the superficial velocity."""
        return 2.0 / 9.0 * self.density_ratio * self.reynolds

    @property
    def name(self) -> str:
        """Name for folders."""
        words = f"Re{self.reynolds:g}-phi{self.solid_fraction:g}-ratio{self.density_ratio:g}"
        return words if self.agitated else f"{words}-without_agitation"


STILL = Point(120.0, 0.25, 7.0, agitated=False)
"""The bed that runs without agitation, too."""


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
    """All points: those with agitation, and the one without."""
    return [*(Point(*values) for values in itertools.product(REYNOLDS, SOLID_FRACTIONS, DENSITY_RATIOS)), STILL]


def is_corner(point: Point) -> bool:
    """Whether a point belongs to the coarse design."""
    return point.agitated and all(number in levels for number, levels in zip(point, CORNERS))


def is_end(point: Point) -> bool:
    """Whether its Stokes number at the superficial velocity is the lowest or the highest of the coarse design."""
    return is_corner(point) and (point.reynolds == REYNOLDS[0]) == (point.density_ratio == DENSITY_RATIOS[0])


def plan() -> Iterator[Run]:
    """All runs, in the order in which they begin: a table is complete, and then finer, after each part.

    The coarse design with two seeds, its lowest and highest Stokes numbers first, the bed without agitation, the third
    seed, soft spheres, all other points.
    """
    corners = [point for point in points() if is_corner(point)]
    others = [point for point in points() if not is_corner(point) and point.agitated]
    first = (DRY, "smooth", "rough")
    for chosen, films, seeds in (
        ([point for point in corners if is_end(point)], first, SEEDS[:2]),
        ([point for point in corners if not is_end(point)], first, SEEDS[:2]),
        ([STILL], first, SEEDS[:2]),
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
    case, velocity = _liquid(point)
    height = (
        case.particle_count * math.pi / 6.0 * case.bed.diameter**3 / (case.column.floor_area * point.solid_fraction)
    )
    end, reference = TURNOVERS * height / velocity, reference_bed()
    modulus, cell, slower = reference.solid.contact_modulus, case.column.cell, reference.bed.inlet_velocity
    assert modulus is not None and isinstance(cell, float) and isinstance(slower, float)
    faster = velocity / slower
    solid, liquid = reference.solid.density, reference.required_fluid.density
    heavier = (point.density_ratio - 1.0) * liquid / (solid - liquid)
    softened = modulus * max(heavier, point.density_ratio * liquid / solid * faster**2)
    return case.with_(**{
        "title": f"Bed of the map of films: {point.name}, {film}",
        "bed.inlet_velocity": velocity,
        "bed.seed": seed,
        "material.sphere.roughness": ROUGHNESS.get(film, ROUGHNESS["smooth"]),
        "material.sphere.contact_modulus": softened,
        "material.sphere.youngs_modulus": SOFT * softened if film == "soft" else case.solid.youngs_modulus,
        "laws.lubrication": "none" if film == DRY else case.laws.lubrication,
        "laws.agitation": "free_spheres" if point.agitated else "none",
        "column.height": cell * math.ceil(ROOM * height / cell),
        "run.until": end,
        "run.average_from": SETTLED * height / velocity,
        "run.every": end / 4.0,
        "run.history_every": end / 160.0,
        "run.reference_speed": reference.reference_speed * faster,
        "run.energy_budget": True,
    })  # fmt: skip


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


@cache
def _liquid(point: Point) -> tuple[Case, float]:
    """Spheres in the liquid in which they have their numbers, and the superficial velocity [m/s]."""

    def tried(logarithm: float) -> tuple[Case, float]:
        density = point.density_ratio * reference_bed().required_fluid.density
        changes = {"material.sphere.density": density, "fluid.viscosity": math.exp(logarithm)}
        case = reference_bed().with_(**{"bed.count": SPHERES, **changes})
        exponent, terminal = expansion_exponents(case)["Richardson-Zaki"]
        return case, terminal * (1.0 - point.solid_fraction) ** exponent

    def excess(logarithm: float) -> float:
        return math.log(stokes_of(*tried(logarithm)) / point.stokes)

    return tried(brentq(excess, math.log(1e-5), math.log(1.0), xtol=1e-9))
