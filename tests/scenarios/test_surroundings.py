"""A collision in a fluid that is more than a film: drag, added mass, history force and drag beside the wall."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from scenarios.collisions.immersed_pair import MATERIALS, collide
from scenarios.collisions.immersed_pair.motion import FORCES, chosen_forces

WALL = {"material": MATERIALS["delrin"], "against": "wall", "velocity": 0.1, "stokes": 60.0}


def test_names_of_forces() -> None:
    assert chosen_forces("none") == ()
    assert chosen_forces("all") == FORCES
    assert chosen_forces("drag, history") == ("drag", "history")
    with pytest.raises(InputError, match="added_mass"):
        chosen_forces("drag,add_mass")


def test_nothing_around_changes_nothing() -> None:
    film, none = collide(**WALL), collide(**WALL, surroundings="none")
    assert film.restitution == none.restitution
    assert np.array_equal(film.gap, none.gap)


def test_each_force_of_the_fluid_slows_the_rebound() -> None:
    film = collide(**WALL).restitution
    with_drag = collide(**WALL, surroundings="drag")
    beside = collide(**WALL, surroundings="drag,wall_drag").restitution
    everything = collide(**WALL, surroundings="all")
    assert everything.restitution < with_drag.restitution < film
    assert beside < with_drag.restitution
    assert {"force_drag", "force_history"} <= set(everything.history)
    power = everything.history["force_drag"][:, 0] * everything.history["velocity"][:, 0, 0]
    assert (power <= 0.0).mean() > 0.95  # a step in which the contact turns the velocity excepted


def test_a_pair_slows_down_in_the_fluid() -> None:
    """The striker drags at the fluid; the sum of the momenta falls, which a film alone keeps."""
    pair = {"material": MATERIALS["glass"], "velocity": 0.1, "stokes": 100.0}
    film, drag = collide(**pair), collide(**pair, surroundings="drag,added_mass,history")
    total = [each.history["velocity"][:, :, 0].sum(axis=1) for each in (film, drag)]
    assert total[0][-1] == pytest.approx(total[0][0], rel=1e-9)
    assert total[1][-1] < 0.99 * total[1][0]
    assert drag.outcome == "rebound"


def test_gravity_accelerates_the_sphere() -> None:
    """After 5 ms of the approach the sphere is faster than without gravity, by less than without added mass."""
    light, heavy = (collide(**WALL, surroundings="added_mass", gravity=g, until=5e-3) for g in (0.0, 9.81))
    assert heavy.time[-1] == pytest.approx(5e-3, rel=0.15)
    assert heavy.history["force_weight"][-1, 0] > 0.0
    speed = np.interp(5e-3, light.time, light.history["velocity"][:, 0, 0])
    gained = np.interp(5e-3, heavy.time, heavy.history["velocity"][:, 0, 0]) - speed
    falling = (1.0 - 1.0 / 1.4) * 9.81 * 5e-3  # less buoyancy, without added mass
    assert 0.5 * falling < gained < falling


def test_the_rebound_is_measured_where_the_pair_leaves_its_film() -> None:
    """Also where it is followed for longer."""
    left, followed = (collide(**WALL, surroundings="added_mass", until=until) for until in (None, 0.2))
    assert followed.time[-1] > left.time[-1]
    assert followed.restitution == left.restitution > 0.1
    assert (followed.outcome, followed.rebound_angle_striker) == (left.outcome, left.rebound_angle_striker)
