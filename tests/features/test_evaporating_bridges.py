"""Water that evaporates from bridges: rate, latent heat and balance of a wet doublet, and what dry bridges leave."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem.backend.communicator import SERIAL
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.evaporation import EvaporationOfLiquid
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures import law
from closures.bond import neck_area
from closures.evaporation import latent_heat, saturation_pressure, stefan_drive, vapour_fraction
from closures.heat_transfer import ranz_marshall
from scenarios.validation.heat.drops import HUMID, drop

DIAMETER, SPEED = 1e-3, 3.0
HOT = {"fluid_temperature": 353.15, "conductivity": 0.03, "fluid_heat_capacity": 1010.0}
NO_FILM = {"liquid__film": "none", "liquid__tangential": "none"}
"""The loops of bridges that resist take twice as long to compile."""
BOND = {"solid_fraction": 0.05, "youngs_modulus": 1e7, "tensile_strength": 1e6}


def doublet(until: float = 30.0, **changes: Any) -> Case:
    """Two wet beads that touch, without weight, in hot dry air."""
    beads = [(0.2, 0.2, 0.2), (0.2 + DIAMETER - 1e-7, 0.2, 0.2)]
    glass = {"density": 2500.0, "youngs_modulus": 1e5, "poisson": 0.25, "friction": 0.3, "roughness": 1e-6}
    liquid = {"viscosity": 1e-3, "surface_tension": 0.02, "thickness": 1e-6, "pull": "pendular", "film": "deforming"}
    given = {
        "material": {"glass": glass}, "liquid": liquid, "evaporation__drops": [], "evaporation__rate": "stefan",
        "evaporation__vapour_fraction": 0.0, "bed__positions": beads, "bed__fixed": False, "fluid": HUMID,
        "run__particle_step": 2e-5, "run__fluid_step": 0.02, "run__reference_speed": 0.05,
    }  # fmt: skip
    thermal = {"particle_temperature": 303.15, "heat_capacity": {"glass": 840.0}, **HOT}
    return drop(DIAMETER, SPEED, until, thermal, **given | changes)


def rate_per_area(temperature: float, simulation: Simulation) -> float:
    """Evaporation of a wet surface of the beads [kg/m2/s]."""
    diffusivity = simulation.feature(EvaporationOfLiquid).diffusivity
    reynolds = HUMID["density"] * SPEED * DIAMETER / HUMID["viscosity"]
    sherwood = ranz_marshall(reynolds, HUMID["viscosity"] / (HUMID["density"] * diffusivity))
    surface = vapour_fraction(saturation_pressure(temperature), 101325.0)
    return sherwood * HUMID["density"] * diffusivity / DIAMETER * stefan_drive(surface, 0.0)


def test_a_bridge_dries_at_the_rate_of_its_meniscus_and_cools_both_beads() -> None:
    """After the films are dry: the rate is that of the law at the temperature of the beads, within 1 %."""
    simulation = Simulation(doublet(**NO_FILM))
    simulation.step()
    assert row(simulation)["bridge_count"] == 1.0
    while simulation.particles.liquid.any():
        simulation.step()
    then = row(simulation)
    bridges = simulation.particle_solver.bridges
    assert bridges is not None and then["liquid_on_particles"] == 0.0
    area = neck_area(float(bridges.volume[0]), float(bridges.gaps()[0][0]), 0.25 * DIAMETER)
    temperature = simulation.particles.temperature.copy()
    assert temperature[0] == pytest.approx(temperature[1], abs=1e-3) and temperature[0] < 350.0
    begin = simulation.time
    simulation.step()
    now = row(simulation)
    lost = now["evaporated_mass"] - then["evaporated_mass"]
    middle = float(0.5 * (temperature + simulation.particles.temperature).mean())
    assert lost / (simulation.time - begin) == pytest.approx(area * rate_per_area(middle, simulation), rel=0.01)
    heat = now["latent_heat_taken"] - then["latent_heat_taken"]
    assert heat == pytest.approx(lost * latent_heat(middle), rel=1e-3)
    assert now["liquid_imbalance"] < 1e-12


def test_a_dry_bridge_breaks_and_all_water_has_gone() -> None:
    simulation = Simulation(doublet(liquid__thickness=2e-8, **NO_FILM))
    simulation.step()
    now = row(simulation)
    water, first = now["liquid_on_particles"] + now["liquid_in_bridges"], now["evaporated_mass"]
    while row(simulation)["bridge_count"] and simulation.time < 30.0:
        simulation.step()
    simulation.step()
    end = row(simulation)
    print(f"dry after {simulation.time:.2f} s")
    assert end["bridge_count"] == 0.0 and end["liquid_in_bridges"] == 0.0 == end["liquid_on_particles"]
    assert end["evaporated_mass"] - first == pytest.approx(998.0 * water, rel=1e-9)
    assert end["liquid_imbalance"] < 1e-12


@pytest.mark.slow
def test_with_bonds_a_dry_bridge_becomes_one_that_holds() -> None:
    """The bond appears when the volume of the bridge has fallen to that of its solids; pulled apart, it holds."""
    case = doublet(liquid__thickness=2e-7, liquid__bond=BOND, run__energy_budget=True)
    simulation = Simulation(case)
    while not row(simulation)["bond_count"] and simulation.time < 30.0:
        simulation.step()
    now = row(simulation)
    assert now["bonds_formed"] == 1.0 == now["bond_count"] and now["largest_agglomerate"] == 2.0
    assert now["liquid_imbalance"] < 1e-12
    assert abs(now["energy_remainder"]) < 1e-3 * max(now["energy_put_in"], abs(now["energy_bridges_broken"]))
    print(f"bond after {simulation.time:.2f} s; remainder {now['energy_remainder']:.2g} J", now["energy_put_in"])
    simulation.particles.velocity[:] = [[-1e-3, 0, 0], [1e-3, 0, 0]]
    for _ in range(20):
        simulation.step()
    apart = float(np.linalg.norm(simulation.particles.position[1] - simulation.particles.position[0]))
    assert apart < 1.01 * DIAMETER and row(simulation)["bond_count"] == 1.0
    again = Simulation.restored(case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert np.array_equal(again.particles.position, simulation.particles.position) and again.time == simulation.time


@pytest.mark.slow
def test_liquid_on_walls_evaporates_by_its_coefficient_and_the_walls_give_the_heat() -> None:
    """A bead on a wet floor: the film and the patch below the bead lose the same thickness; all liquid is counted."""
    case = doublet(
        liquid__wall_share=0.5, liquid__wall_thickness=2e-6, evaporation__wall_coefficient=2e-3,
        evaporation__wall_temperature=320.0, bed__positions=[(0.2, 0.2, 0.5 * DIAMETER)],
        laws__gravity=(0.0, 0.0, -9.81), evaporation__liquid_density=1000.0,
    )  # fmt: skip
    simulation = Simulation(case)
    simulation.step()
    films = simulation.feature(EvaporationOfLiquid).walls
    assert films is not None and row(simulation)["liquid_gained_by_walls"] < 0.0
    solver, begin, film = simulation.particle_solver, simulation.time, films.film
    patch = solver.walls.patch_liquid[:1].copy()
    for _ in range(20):
        simulation.step()
    surface = vapour_fraction(saturation_pressure(320.0), 101325.0)
    thinned = 2e-3 * HUMID["density"] * stefan_drive(surface, 0.0) / 1000.0 * (simulation.time - begin)
    assert film - films.film == pytest.approx(thinned, rel=1e-9) and solver.parameters.bridge.wall_film == films.film
    assert (patch - solver.walls.patch_liquid[:1]) / DIAMETER**2 == pytest.approx(thinned, rel=1e-9)
    now = row(simulation)
    assert now["latent_heat_of_walls"] == pytest.approx(latent_heat(320.0) * 1000.0 * DIAMETER**2 * thinned, rel=0.1)
    assert now["liquid_imbalance"] < 1e-12
    simulation.particles.velocity[:] = (0.1, 0.0, 0.2)  # to other patches, which have lost liquid before
    for _ in range(60):
        simulation.step()
    assert int(solver.walls.patch_count[0]) >= 2 and row(simulation)["liquid_imbalance"] < 1e-12
    again = Simulation.restored(case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert row(again)["evaporated_mass"] == row(simulation)["evaporated_mass"]
    with pytest.raises(InputError, match=r"wall_coefficient.*0 where walls take no liquid"):
        doublet(evaporation__wall_coefficient=1e-3)


@pytest.mark.slow
def test_a_bridge_between_two_ranks_dries_as_on_one() -> None:
    """The beads are on both sides of the border: each rank finds what its bead takes, and both have the same bits. One
    process finds the same to the tolerance of the pressure, which changes the slip."""
    beads = [(0.2, 0.2 - 0.5 * DIAMETER, 0.2), (0.2, 0.2 + 0.5 * DIAMETER - 1e-7, 0.2)]

    def dried(communicator: Any = SERIAL) -> tuple[float, ...]:
        simulation = Simulation(doublet(bed__positions=beads, column__cell=0.05), communicator=communicator)
        for _ in range(150):
            simulation.step()
        now = row(simulation)
        assert now["bridge_count"] == 1.0 and now["liquid_imbalance"] < 1e-12
        known = float(simulation.particle_solver.edges.bridge_volume.max())
        return known, now["liquid_in_bridges"], now["evaporated_mass"], now["mean_temperature"]

    alone = dried()
    assert alone[0] > 0.0
    one, other = on_ranks(2, dried)
    assert one == other and one == pytest.approx(alone, rel=1e-6)


@law("drying", "for these tests")
def a_quarter(volume: float) -> float:
    """A quarter of the rate, as long as there is liquid."""
    return 0.25 if volume > 0.0 else 0.0


def test_a_law_of_ones_own_gives_the_falling_rate() -> None:
    def rate(**changes: Any) -> float:
        simulation = Simulation(doublet(run__fluid_step=1e-3, **NO_FILM, **changes))
        simulation.step()
        return row(simulation)["evaporated_mass"]

    assert rate(laws__drying="a_quarter") == pytest.approx(0.25 * rate(), rel=0.05)


def test_bonds_without_evaporation_are_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"liquid.bond.*left out without \[evaporation\]") as failure:
        doublet(liquid__bond=BOND).with_(evaporation=None)
    assert len(str(failure.value).splitlines()) == 1
    with pytest.raises(InputError, match=r"laws\.drying"):
        doublet(laws__drying="a_qarter")
