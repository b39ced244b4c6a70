"""Columns that are cylinders: the start of the particles and the flow through floor and lid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from test_coupling import suspension

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.particles.initial.packing import OVERLAP_LIMIT
from cfddem.run.build import laws_of, materials_of, walls_of
from cfddem.run.check import check
from cfddem.run.initial_particles import expanded_height, particles_of
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


@pytest.mark.parametrize(
    ("start", "sizes", "vessel"),
    [("expanded", [[0.8e-3, 0.4], [1.2e-3, 0.6]], None), ("packed", [], None), ("expanded", [], 0.8 * WIDTH)],
    ids=["sizes", "packed", "vessel"],
)
def test_a_random_packing_fills_a_round_column(start: str, sizes: list, vessel: float | None) -> None:
    """No sphere overlaps another or the wall, and the bed reaches up to the lid, or to its height in the flow."""
    about = {"sizes": sizes} if sizes else {"diameter": 1e-3}
    count = 1300 if start == "packed" else 500
    round_wall = {"vessel": {"shape": "cylinder", "radius": 0.5 * vessel}, "column.shape": "box"} if vessel else {}
    bed = {"count": count, "start": start, "inlet_velocity": 0.02, "fixed": vessel is not None} | about
    case = cylinder(bed=bed).with_(**round_wall)
    spheres = particles_of(case, materials_of(case), walls_of(case), laws_of(case))
    away = np.hypot(*(spheres.position[:, :2] - 0.5 * WIDTH).T) + spheres.radius
    assert away.max() <= 0.5 * (vessel or WIDTH) * (1.0 + 1e-9)
    near = cKDTree(spheres.position).query_pairs(2.0 * spheres.radius.max(), output_type="ndarray")
    apart = np.linalg.norm(spheres.position[near[:, 0]] - spheres.position[near[:, 1]], axis=1)
    assert (apart > (1.0 - 2.0 * OVERLAP_LIMIT) * spheres.radius[near].sum(axis=1)).all()
    height = case.column.height if start == "packed" else expanded_height(case)
    top = (spheres.position[:, 2] + spheres.radius).max()
    assert top <= height * (1.0 + 1e-9)
    assert top > 0.95 * height
    across = vessel or WIDTH
    inner = np.hypot(*(spheres.position[:, :2] - 0.5 * WIDTH).T) < 0.25 * across
    share = (0.25 * across / (0.5 * across - 0.5e-3)) ** 2  # of the area in which centres lie
    assert spheres.volume[inner].sum() / spheres.volume.sum() == pytest.approx(share, abs=0.06)


def test_a_lattice_without_room_beside_a_round_wall_is_an_error_of_the_check() -> None:
    """The check and the run refuse it with the same words."""
    full = cylinder(**{"bed.count": 1150})
    (issue,) = [issue for issue in check(full).issues if issue.severity == "error"]
    assert issue.key == "bed.count"
    assert "lattice" in issue.reason
    with pytest.raises(InputError, match="lattice"):
        particles_of(full, materials_of(full), walls_of(full), laws_of(full))


def test_a_random_packing_fills_no_cone() -> None:
    cone = {"shape": "cone", "radius": 2e-3, "length": 0.01}
    with pytest.raises(InputError, match=r'bed.start = .packed.*"poured" or "suspended" in this vessel'):
        cylinder(**{"bed.start": "packed", "column.shape": "box", "vessel": cone})
