"""Columns that are cylinders: the start of the particles and the flow through floor and lid."""

from __future__ import annotations

import numpy as np
import pytest
from test_coupling import suspension

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.run.build import laws_of, materials_of, walls_of
from cfddem.run.initial_particles import particles_of
from cfddem.run.simulation import Simulation

WIDTH = 0.01


def cylinder(**changes: object) -> Case:
    """Spheres in a cylinder of water, 8 cells across, whose corner cells are solid."""
    column = {"shape": "cylinder", "width": WIDTH, "height": 0.02, "cell": WIDTH / 8.0, "ends": "flow"}
    bed = {"diameter": 1e-3, "count": 300, "start": "suspended", "inlet_velocity": 0.02}
    return suspension(**{"column": column, "bed": bed} | changes)


@pytest.mark.parametrize("count", [1, 300, 600])
def test_suspended_particles_start_inside_the_wall(count: int) -> None:
    case = cylinder(**{"bed.count": count})
    places = particles_of(case, materials_of(case), walls_of(case), laws_of(case)).position
    assert len(places) == count
    assert np.hypot(*(places[:, :2] - 0.5 * WIDTH).T).max() <= 0.5 * (WIDTH - 1e-3)


@pytest.mark.parametrize("jet", [{}, {"round": True}, {"round": False}], ids=["no jet", "round jet", "slot"])
def test_what_enters_through_the_open_floor_leaves_through_the_lid(jet: dict) -> None:
    """Every open cell of the floor has the velocity of the inlet or of the jet; the solid ones at the corners none."""
    chosen = {"bed.jet": {"width": 3e-3, "velocity": 0.1} | jet} if jet else {}
    simulation = Simulation(cylinder(**chosen))
    fluid = simulation.fluid
    assert fluid is not None and not fluid.grid.open[0, 0, 0]
    simulation.step()
    floor, lid = fluid.volume_flux(2)[0], fluid.volume_flux(2)[-1]
    stored = fluid.fields.owned("voidage_rate").sum() * fluid.grid.cell_volume
    assert (floor.sum() - lid.sum()) * fluid.grid.face_area(2) == pytest.approx(
        stored, abs=1e-6 * floor.sum() * fluid.grid.face_area(2)
    )
    opened, fast = fluid.grid.open[0], np.isclose(floor, 0.1, rtol=1e-3)
    assert (floor[~opened] == 0.0).all()
    assert floor[opened & ~fast] == pytest.approx(0.02, rel=1e-3)
    assert fast.any() == bool(jet)


def test_a_random_packing_is_refused() -> None:
    with pytest.raises(InputError, match=r'bed.start = .packed.*"poured" or "suspended" in a cylinder'):
        cylinder(**{"bed.start": "packed"})
