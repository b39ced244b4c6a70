"""The film impact with smoothed particles, the method of the paper: exact solutions, and impacts beside the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from scenarios.collisions.film_impact import impact
from scenarios.references.isph import kernel, liquid
from scenarios.references.isph.impact import layer_at_rest, taylor_green
from scenarios.references.isph.liquid import solid


def test_a_layer_at_rest_has_hydrostatic_pressure_and_stays_at_rest() -> None:
    """Force on the plate and pressure of the lowest layer within 2 %; speeds below 1 % of 0.5 m/s."""
    layer = layer_at_rest(10, steps=60)
    assert abs(layer.plate_force) < 0.02
    assert abs(layer.bottom_pressure) < 0.02
    assert layer.largest_speed < 0.005


def test_a_vortex_decays_by_viscosity() -> None:
    """Taylor-Green vortex on 20 x 20 particles: speed within 1 %."""
    assert abs(taylor_green(20, until=0.1)) < 0.01


@pytest.mark.slow
def test_a_fine_vortex_decays_by_viscosity() -> None:
    """50 x 50 particles: within 1 % (0.2 %)."""
    assert abs(taylor_green(50)) < 0.01


def test_a_solid_is_the_limit_of_its_particles() -> None:
    """Sum of a lattice beyond half a spacing within 6 %; the force of a pressure, 2 G summed over distances, is 1."""
    flat, side = solid(1.0), np.arange(-3.0, 4.0)
    lattice = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    below = np.concatenate([[[0.0, 0.0, 0.0]], lattice[lattice[:, 2] < 0.0]])
    start, found = kernel.neighbours(below, 1, kernel.REACH)
    counted = float(kernel.weights(below, start, found, 1.0)[0].sum())
    assert float(flat.at(np.array([0.5])).count[0]) == pytest.approx(counted, rel=0.06)
    assert 2.0 * np.trapezoid(flat.push, flat.distance) == pytest.approx(1.0, abs=1e-3)
    assert np.trapezoid(flat.slope, flat.distance) == pytest.approx(1.0, abs=0.02)
    convex = solid(1.0, 30.0)
    assert (convex.count[:-20] < flat.count[:-20]).all()
    assert convex.push[0] == pytest.approx(flat.push[0], rel=0.05)


def test_images_close_the_box() -> None:
    """A particle in a corner of the quarter has three images in the two planes, with the velocity turned."""
    place = np.array([[0.2, 0.3, 0.5]])
    every, origin, signs = liquid.images(place, np.array([10.0, 10.0, np.inf]), 1.0)
    assert sorted(map(tuple, every[:, :2].tolist())) == [(-0.2, -0.3), (-0.2, 0.3), (0.2, -0.3), (0.2, 0.3)]
    assert (origin == 0).all()
    assert (signs[:, 2] == 1.0).all()
    assert (np.sign(every[:, :2]) == signs[:, :2]).all()


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"method": "sph"}, "did you mean 'isph'"),
        ({"method": "isph", "cavitation": -1e5}, "cavitation = -100000.0: must be left out with method"),
        ({"method": "isph", "flip": 0.9}, "flip"),
        ({"method": "isph", "film": 3e-3}, "film"),
    ],
)
def test_what_smoothed_particles_do_not_have_is_refused(given: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        impact(**given)


@pytest.mark.slow
@pytest.mark.parametrize("case", [(5.5e-3, "m5", 0.45e-3, 0.5), (8e-3, "water", 0.4e-3, 1.0)])
def test_smoothed_particles_agree_with_the_grid(case: tuple[float, str, float, float]) -> None:
    """Restitution within 0.1, P1 to P4 in order, speed at the plate within 2 %."""
    result, on_grid = impact(*case, method="isph"), impact(*case, cells=10)
    assert result.restitution == pytest.approx(on_grid.restitution, abs=0.1)
    assert result.p1.time < result.p2.time == result.p3.time < result.p4.time
    assert result.p1.velocity < result.p2.velocity < 0.0 < result.p4.velocity < result.p3.velocity
    assert result.p2.velocity == pytest.approx(on_grid.p2.velocity, rel=0.02)
    assert result.highest_pressure > 0.0 > result.lowest_pressure
    assert result.cells == 5
    assert abs(result.ledger_error) < 0.02
    assert 0.05 < result.energies["exchange"] < 0.2  # what the projection of the particles loses
