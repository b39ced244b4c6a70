"""Drag of a sphere beside a wall: the laws against exact resistances, and film and drag together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.coupling.forces.wall_drag import CLOSEST, WallDrag
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.run.simulation import Simulation
from closures.lubrication import film_resistance, film_strength
from closures.tangential_lubrication import film_logarithm, shear_resistance
from closures.wall_drag import along_wall, film_along_wall, towards_wall
from scenarios.beds.settling import study as settling
from scenarios.beds.settling.landing import RADIUS as RADIUS_OF_NYLON
from scenarios.beds.settling.landing import Walls, land, landing_ode

RADIUS, VISCOSITY = 1e-3, 0.1
STOKES = 6.0 * math.pi * VISCOSITY * RADIUS

GOLDMAN_COX_BRENNER = {
    0.003202: 4.0223, 0.005004: 3.7863, 0.0453: 2.6475, 0.1276: 2.1514, 0.5431: 1.5675, 1.3524: 1.3079,
    2.7622: 1.1738, 9.0677: 1.0587,
}  # fmt: skip
"""Gap over radius: drag along the wall over Stokes' (Chem. Eng. Sci. 22 (1967) 637, table 1, from memory; the first two
agree with the limit 0.9588 - 8/15 ln x of the same paper, the last two with Faxen's series, within 0.1 %)."""


def brenner(gap: float) -> float:
    """Brenner's series (1961) for the drag towards a wall over Stokes'."""
    a, total = math.acosh(1.0 + gap), 0.0
    for n in range(1, max(10, int(20.0 / a))):
        squares = (2.0 * math.sinh((n + 0.5) * a)) ** 2 - ((2 * n + 1) * math.sinh(a)) ** 2
        ratio = (2.0 * math.sinh((2 * n + 1) * a) + (2 * n + 1) * math.sinh(2.0 * a)) / squares
        total += n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (ratio - 1.0)
    return 4.0 / 3.0 * math.sinh(a) * total


def test_the_law_towards_a_wall_is_the_series() -> None:
    for gap in np.geomspace(CLOSEST, 10.0, 30).tolist():
        assert 1.0 / gap + towards_wall(gap) == pytest.approx(brenner(gap), rel=1.5e-3)


def test_the_law_along_a_wall_is_the_table() -> None:
    for gap, exact in GOLDMAN_COX_BRENNER.items():
        assert along_wall(gap) == pytest.approx(exact, rel=4e-3)
    for gap in (1e-4, 1e-3):
        assert along_wall(gap) == pytest.approx(0.9588 - 8.0 / 15.0 * math.log(gap), rel=4e-3)
    for gap in (5.0, 10.0, 50.0):
        place = 1.0 / (1.0 + gap)
        faxen = 1.0 - 9.0 / 16.0 * place + place**3 / 8.0 - 45.0 / 256.0 * place**4 - place**5 / 16.0
        assert along_wall(gap) == pytest.approx(1.0 / faxen, rel=4e-3)


def extra(slip: list[float], gaps: list[float], which: str = "nearest", **films: bool) -> tuple[np.ndarray, np.ndarray]:
    """Force over Stokes' conductance, and the explicit part of it, of spheres over a floor under a lid."""
    places = [[0.0, 0.0, (1.0 + gap) * RADIUS] for gap in gaps]
    spheres = make_particles(places, RADIUS, 2000.0, viscosity=VISCOSITY)
    lid = Plane(point=(0.0, 0.0, 30.0 * RADIUS), normal=(0.0, 0.0, -1.0))
    given = np.tile(slip, (len(gaps), 1))
    terms = WallDrag([Plane(), lid], which, **({"film": True} | films)).terms(spheres, given)  # type: ignore[arg-type]
    return (terms.conductance[:, None] * given + terms.force) / STOKES, terms.force / STOKES


GAPS = [10.0, 5.0, 2.0, 1.001, 0.999, 0.5, 0.1, 0.01, 1e-3, 1e-4]
MINIMUM = 1e-4 * RADIUS


@pytest.mark.parametrize("film", [True, False])
def test_a_sphere_feels_the_exact_resistance_towards_the_wall(film: bool) -> None:
    """Stokes' drag, the film and the extra drag together: within 0.2 % at every gap."""
    found, aside = extra([0.0, 0.0, 1.0], GAPS, film=film)
    assert np.abs(aside[:-1]).max() < 1e-12
    for gap, one in zip(GAPS, found[:, 2].tolist()):
        strength = film_strength(VISCOSITY, RADIUS)
        of_film = film_resistance(strength, gap * RADIUS, MINIMUM, RADIUS) / STOKES if film else 0.0
        assert 1.0 + one + of_film == pytest.approx(brenner(gap), rel=2e-3)


@pytest.mark.parametrize("shear", [True, False])
def test_a_sphere_feels_the_exact_resistance_along_the_wall(shear: bool) -> None:
    """With and without a film against sliding: within 0.4 % at every gap."""
    gaps = list(GOLDMAN_COX_BRENNER)
    found, aside = extra([1.0, 0.0, 0.0], gaps, shear=shear)
    assert np.abs(aside[:, 1:]).max() < 1e-12
    for gap, one in zip(gaps, found[:, 0].tolist()):
        of_film = film_along_wall(gap) if shear else 0.0
        assert 1.0 + one + of_film == pytest.approx(GOLDMAN_COX_BRENNER[gap], rel=4e-3)


def test_the_part_of_the_film_is_that_of_the_film_against_sliding() -> None:
    for gap in (1e-3, 0.1, 0.9, 2.0):
        film = shear_resistance(VISCOSITY, RADIUS, -1.0) * film_logarithm(gap * RADIUS, MINIMUM, RADIUS)
        assert film_along_wall(gap) == pytest.approx(film / STOKES, abs=1e-12)


def test_an_oblique_motion_is_the_sum_of_both() -> None:
    both = extra([1.0, 0.0, -2.0], [0.3])[0] - extra([1.0, 0.0, 0.0], [0.3])[0] - extra([0.0, 0.0, -2.0], [0.3])[0]
    assert np.abs(both).max() < 1e-12


def test_all_walls_are_summed() -> None:
    nearest, every = (extra([0.0, 0.0, 1.0], [4.0], which)[0][0, 2] for which in ("nearest", "all"))
    assert every - nearest == pytest.approx(1.0 / 24.0 + towards_wall(24.0) - 1.0)


def test_walls_that_move_are_refused() -> None:
    with pytest.raises(InputError, match="at rest"):
        WallDrag([Plane(velocity=(0.0, 0.0, 1.0))], "nearest", film=True)


@pytest.mark.parametrize("walls", ["none", "nearest"])
def test_a_sphere_lands_as_the_equation_of_motion_says(walls: Walls) -> None:
    """Film and wall drag against the exact resistance, by another integrator: within 1 % of the terminal velocity."""
    density, viscosity, terminal = 962.0, 0.113, 0.091  # ten Cate et al. (2002), E3
    gaps, speeds = land(density, viscosity, walls)
    exact = landing_ode(density, viscosity, walls, gaps)
    assert np.abs(speeds - exact).max() < 0.01 * terminal
    assert gaps[-1] < 0.01 * RADIUS_OF_NYLON


@pytest.mark.slow
def test_a_case_with_drag_beside_walls_slows_a_sphere_over_the_floor() -> None:
    """A falling sphere at a gap of a radius loses more velocity in a step; far from walls nothing changes."""

    def change(height: float, which: str) -> float:
        case = settling.ten_cate(962.0, 0.113).with_(
            **{
                "bed.positions": [(0.75, 0.75, height)],
                "bed.initial_velocity": (0.0, 0.0, -0.05),
                "laws.wall_drag": which,
                "column.width": 1.5,
                "column.height": 1.5,
            }
        )
        simulation = Simulation(case)
        simulation.step()
        return float(simulation.particles.velocity[0, 2]) + 0.05

    near, far = ([change(height, which) for which in ("none", "nearest")] for height in (0.015, 0.75))
    assert near[1] > near[0]
    assert far[1] - far[0] < 0.05 * (near[1] - near[0])
