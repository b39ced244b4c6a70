"""Beds poured between walls: all spheres are inside, lie still, and the same seed gives the same bed."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.initial.filling import loose_places
from cfddem.particles.initial.packing import from_table
from cfddem.particles.initial.pouring import AT_REST, poured_bed
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.walls.shapes import Cylinder, Plane, Wall

GRAIN = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.7, friction=0.3)
DIAMETER = 1e-3
CUP = [Plane(), Cylinder(radius=4 * DIAMETER)]
AROUND, SIZE = (-4e-3, -4e-3, 0.0), (8e-3, 8e-3, 5e-3)


@pytest.mark.parametrize("sizes", [np.array([1.0]), np.array([1.0, 0.45, 0.2])], ids=["equal", "three sizes"])
def test_spheres_start_apart_and_inside(sizes: np.ndarray) -> None:
    """No two spheres touch, and none touches a wall; small ones share the place of a large one."""
    diameters = from_table(300, DIAMETER * sizes, np.ones(len(sizes)), seed=1)
    places = loose_places(diameters, CUP, AROUND, SIZE, seed=2)
    radius = 0.5 * diameters
    assert (np.hypot(places[:, 0], places[:, 1]) + radius < 4e-3).all()
    assert (places[:, 2] > radius).all()
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(300)
    assert (apart > radius[:, None] + radius[None]).all()
    assert np.array_equal(places, loose_places(diameters, CUP, AROUND, SIZE, seed=2))


def test_box_without_room_is_refused() -> None:
    """Too narrow for a sphere, or closed above before all spheres are in."""
    with pytest.raises(InputError, match=r"size\[0\]"):
        loose_places(np.full(3, 1e-2), CUP, AROUND, SIZE, seed=1)
    lid = [*CUP, Plane(point=(0.0, 0.0, 3e-3), normal=(0.0, 0.0, -1.0))]
    with pytest.raises(InputError, match="places for the largest sphere"):
        loose_places(np.full(300, DIAMETER), lid, AROUND, SIZE, seed=1)


def test_bed_in_a_cup_lies_still() -> None:
    """Below the stated limit without damping; the largest overlap is that of the contacts."""
    bed = poured_bed(pair_table([GRAIN]), np.full(200, DIAMETER), 2500.0, CUP, AROUND, SIZE, seed=1)
    position = bed.particles.position
    assert bed.energy < AT_REST
    assert 0.0 < bed.largest_overlap < 0.01
    assert (np.hypot(position[:, 0], position[:, 1]) < 3.5e-3 * (1.0 + bed.largest_overlap)).all()
    assert np.array_equal(bed.particles.id, np.arange(200))
    weight = 9.81 * bed.particles.mass.sum()
    assert -bed.run.wall_force[:, 2].sum() == pytest.approx(weight, rel=1e-2)


def test_walls_that_move_later_are_at_rest_while_a_bed_is_poured() -> None:
    """A belt under the bed does not carry it away."""
    belt: list[Wall] = [Plane(velocity=(1.0, 0.0, 0.0)), CUP[1]]
    bed = poured_bed(pair_table([GRAIN]), np.full(30, DIAMETER), 2500.0, belt, AROUND, SIZE, seed=1)
    assert not bed.run.walls.velocity.any()
