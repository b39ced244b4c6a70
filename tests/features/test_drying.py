"""Water that evaporates into the cells of the fluid, which take the vapour and give the heat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_heat_in_fluid import SEEDS

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.portions import collected
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.heat import HeatExchange
from cfddem.features.vapour import Vapour
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures.evaporation import saturation_pressure, vapour_fraction
from scenarios.validation.heat.packed import dried_beads, wet_bed, wet_drops


def test_a_wet_bed_dries_at_the_rate_of_the_air_that_leaves_and_at_the_wet_bulb() -> None:
    """The first layer is at the wet bulb of the air that enters, and no drop leaves its balance."""
    rows = wet_drops({})
    assert len(rows) == 4 and all(each.verdict == "holds" for each in rows), rows


@pytest.mark.slow
def test_a_layer_of_wet_beads_is_dry_when_the_balance_says() -> None:
    """A plateau at the wet bulb, a constant rate, and the end within 2 % of the water over the rate by the air that
    leaves."""
    rows = dried_beads({})
    assert len(rows) == 4 and all(each.verdict == "holds" for each in rows), rows


@pytest.mark.parametrize(("steps", "limit"), [(1000, 1e-13), pytest.param(10_000, 1e-12, marks=pytest.mark.slow)])
def test_air_at_rest_over_drops_is_saturated_and_no_water_is_lost(steps: int, limit: float) -> None:
    """The drops shrink, so that air flows in through the open end; it is counted."""
    case = wet_bed(
        4, column={"width": 0.008, "height": 0.016, "cell": 0.004, "sides": "periodic"}, run__fluid_step=2e-3
    )
    simulation = Simulation(case.with_(**{"bed.inlet_velocity": 0.0}))
    vapour, water = simulation.feature(Vapour), float(simulation.particles.mass.sum())
    for _ in range(steps):
        simulation.step()
    sums, mass = vapour.cells.sums, float(simulation.particles.mass.sum())
    assert mass + vapour.cells.content + sums["outflow"] - sums["inflow"] == pytest.approx(water, rel=limit)
    surface = vapour_fraction(saturation_pressure(float(simulation.particles.temperature.mean())), 101325.0)
    print(f"vapour {vapour.cells.value.mean():.6f}, saturated {surface:.6f}")
    assert vapour.cells.value == pytest.approx(surface, rel=5e-3)
    assert simulation.feature(Vapour).imbalance < 1e-10 and row(simulation)["heat_imbalance"] < 1e-10


MOVING = SEEDS.with_(**{
    "heat.particle_temperature": 310.0, "heat.fluid_temperature": 340.0, "evaporation": {"drops": ["seed"]},
    "vapour": {"fluid_fraction": 0.005, "diffusivity": 2.8e-5},
})  # fmt: skip
"""A bed of seeds that move, which dry as drops do."""


def dried(simulation: Simulation, steps: int) -> dict[str, np.ndarray]:
    """Particles by id, cells and history after some steps."""
    for _ in range(steps):
        simulation.step()
    order, parts = np.argsort(simulation.whole("id")), (simulation.feature(HeatExchange), simulation.feature(Vapour))
    cells = {name: values for each in parts for name, values in each.cells_for_snapshot().items()}
    cells = collected(cells, simulation.communicator)
    particles = {
        f"{name} of particles": simulation.whole(name)[order] for name in ("temperature", "radius", "position")
    }
    return {**particles, **cells, "history": np.array(list(row(simulation).values()))}


@pytest.fixture(scope="module")
def alone() -> dict[str, np.ndarray]:
    """A bed after 20 steps of one process on one thread."""
    found = dried(Simulation(MOVING), 20)
    assert np.ptp(found["vapour"]) > 1e-3 and found["radius of particles"].max() < 0.6e-3
    return found


def assert_same_bits(found: dict[str, np.ndarray], alone: dict[str, np.ndarray]) -> None:
    for name, values in alone.items():
        assert np.array_equal(values, found[name], equal_nan=True), name


def test_a_drying_bed_has_the_same_bits_when_it_goes_on(alone: dict[str, np.ndarray]) -> None:
    stopped = Simulation(MOVING)
    dried(stopped, 10)
    assert_same_bits(dried(Simulation.restored(MOVING, stopped.checkpoint()), 10), alone)


@pytest.mark.slow  # as plain tests: the scalar of a fluid, and a bed with all forces, on two threads
def test_a_drying_bed_has_the_same_bits_on_two_threads(alone: dict[str, np.ndarray]) -> None:
    before = use_threads(2)
    try:
        assert_same_bits(dried(Simulation(MOVING), 20), alone)
    finally:
        use_threads(before)


def test_two_processes_dry_a_bed_with_the_bits_of_one(alone: dict[str, np.ndarray]) -> None:
    for shared in on_ranks(2, lambda ranks: dried(Simulation(MOVING, communicator=ranks), 20)):
        assert_same_bits(shared, alone)


@pytest.mark.slow  # its law set is compiled for no other plain test
def test_films_give_their_water_to_the_air_from_the_inlet_on_and_then_warm_up() -> None:
    """All water of the films is in the vapour of the cells and of the air that left; the first layer is dry first."""
    film = {"viscosity": 1e-3, "surface_tension": 0.072, "thickness": 1e-6}
    simulation = Simulation(
        wet_bed(10).with_(
            **{"material.glass.density": 2500.0, "heat.heat_capacity": {"glass": 40.0}},
            **{"evaporation.drops": [], "liquid": film},
        )
    )
    particles, first = simulation.particles, simulation.particles.position[:, 2] < 3e-3
    water, begin = 998.0 * float(particles.liquid.sum()), float(particles.temperature[0])
    simulation.until(0.4)
    middle, early = row(simulation), particles.liquid[first].mean() / particles.liquid[~first].mean()
    keys, cold = Evaporation.of(simulation.case), float(particles.temperature[first].mean())
    assert keys is not None
    print(f"{middle['evaporated_mass'] / water:.2%} of the water, first film over others {early:.2f}, at {cold:.2f} K")
    assert 0.2 < middle["evaporated_mass"] / water < 0.8 and early < 0.9
    assert cold == pytest.approx(keys.wet_bulb(simulation.case), abs=0.5) and cold < begin
    simulation.until(2.5)
    now, vapour = row(simulation), simulation.feature(Vapour)
    assert particles.liquid.max() == 0.0 and now["evaporated_mass"] == pytest.approx(water, rel=1e-12)
    sums = vapour.cells.sums
    assert vapour.cells.content + sums["outflow"] - sums["inflow"] == pytest.approx(water, rel=1e-9)
    assert now["liquid_imbalance"] < 1e-12 and now["vapour_imbalance"] < 1e-10 and now["heat_imbalance"] < 1e-10
    assert particles.temperature[first] == pytest.approx(320.0, abs=0.3)


@pytest.mark.slow  # walls with liquid are a law set of their own
def test_water_of_bridges_at_walls_and_of_the_patches_below_them_is_all_found_in_the_air() -> None:
    """Beads on a wet floor: what films, bridges at the floor and its patches lose is in the vapour of the cells and of
    the air that left. Neither the latent heat nor the volume that evaporation has noted is used."""
    film = {"viscosity": 1e-3, "surface_tension": 0.07, "thickness": 2e-7, "wall_share": 0.5, "wall_thickness": 2e-7}
    at_floor = [(x, y, 1e-3 - 1e-8) for x, y in ((2e-3, 2e-3), (6e-3, 2e-3), (2e-3, 6e-3), (6e-3, 6e-3))]
    simulation = Simulation(
        wet_bed(1, liquid=film).with_(**{"evaporation": {}, "bed.positions": at_floor, "bed.fixed": False})
    )
    particles, solver, sums = simulation.particles, simulation.particle_solver, simulation.feature(Vapour).cells.sums
    bridges = solver.bridges
    assert bridges is not None

    def there() -> float:
        """Water in films, bridges and patches [m3]."""
        return float(particles.liquid.sum() + bridges.volume.sum()) + bridges.gained_by_walls

    water = there()

    def missing() -> float:
        """Water that has left the solids and is not in the air, over all there was [-]."""
        in_air = simulation.feature(Vapour).cells.content + sums["outflow"] - sums["inflow"]
        return abs(998.0 * (water - there()) - in_air) / (998.0 * water)

    simulation.until(0.02)
    of_walls = bridges.bodies.reshape(-1, 2)[:, 1] < 0
    print(f"{of_walls.sum()} bridges at the floor, {bridges.gained_by_walls / water:.3f} of the water from its patches")
    assert of_walls.sum() == 4 and bridges.gained_by_walls < 0.0 and bridges.volume.min() > 0.0
    assert missing() < 1e-9
    while particles.liquid.any() and simulation.time < 0.3:
        simulation.step()
    then = bridges.volume.sum()
    simulation.until(simulation.time + 0.01)
    print(f"films dry at {simulation.time - 0.01:.3f} s; bridges lose {1.0 - bridges.volume.sum() / then:.2g} in 10 ms")
    assert not particles.liquid.any() and bridges.volume.sum() < (1.0 - 1e-5) * then and missing() < 1e-9
    assert row(simulation)["liquid_imbalance"] < 1e-12


@pytest.mark.slow  # as the test above that one
def test_drops_of_a_spray_bring_their_heat_and_all_budgets_close() -> None:
    """Cold drops on warm beads in warm air: heat of the air in, latent heat out, heat of the drops in, the rest is
    stored. A bead that receives more than one drop is between its temperature and that of the drops."""
    film = {"viscosity": 1e-3, "surface_tension": 0.072, "thickness": 1e-6}
    spray = {"rate": 2e-9, "drop_volume": 5e-13, "zone": "box", "corner": (0, 0, 0.02), "size": (8e-3, 8e-3, 0.02)}
    case = wet_bed(10).with_(
        **{"material.glass.density": 2500.0, "evaporation.drops": [], "liquid": film, "spray": spray},
        **{"heat.spray_temperature": 280.0},
    )
    simulation = Simulation(case)
    simulation.until(0.3)
    middle = Simulation.restored(case, simulation.checkpoint())
    simulation.until(0.6)
    middle.until(0.6)
    now, heat = row(simulation), simulation.feature(HeatExchange)
    assert list(row(middle)) == list(now)
    assert np.array_equal(list(row(middle).values()), list(now.values()), equal_nan=True)
    landed = now["liquid_sprayed"]
    colder = 298.0 - 280.0
    print(f"{landed / 5e-13:.0f} drops brought {now['heat_from_spray']:.4g} J, latent {now['latent_heat_taken']:.4g} J")
    assert landed == pytest.approx(2e-9 * 0.6, rel=1e-3) and now["liquid_missed"] == 0.0
    assert now["heat_from_spray"] == pytest.approx(-landed * 4.17e6 * colder, rel=0.35)
    gained = now["heat_in"] - now["heat_out"] + now["heat_from_walls"] - now["latent_heat_taken"]
    scale = heat.scale + now["latent_heat_taken"]
    assert now["heat_stored"] == pytest.approx(gained + now["heat_from_spray"], abs=1e-11 * scale)
    assert now["liquid_imbalance"] < 1e-12 and now["vapour_imbalance"] < 1e-10 and now["heat_imbalance"] < 1e-10


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"vapour__inlet_fraction": 0.5}, "vapour.inlet_fraction = 0.5: must be at most saturated.*0.0"),
        ({"evaporation__relative_humidity": 0.5}, "evaporation.relative_humidity.*left out with .vapour."),
        ({"vapour": None}, "evaporation.vapour_fraction.*found none"),
    ],
)
def test_air_that_cannot_be_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        wet_bed(2).with_(**{name.replace("__", "."): value for name, value in changes.items()})
    assert len(str(failure.value).splitlines()) == 1
