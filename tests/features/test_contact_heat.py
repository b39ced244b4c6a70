"""Heat between particles, with walls and with the surroundings; the how-to page is docs/how-to/contact-heat.md."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem.analysis.report import references_of
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.contact_heat import HeatExchangeOfContacts
from cfddem.features.contact_heat_keys import wall_names
from cfddem.preflight.summary import preflight
from cfddem.run.history import all_columns, bed_voidage_from_pressure, row
from cfddem.run.simulation import Simulation
from scenarios.validation import heated_bed
from scenarios.validation.heat.spheres import COLD, GAS, HEAT, HOT, RADII, exact_cases, two_spheres
from scenarios.validation.table import Row

PAGE = Path(__file__).parents[2] / "docs/how-to/contact-heat.md"


@pytest.mark.parametrize("number", range(5))
def test_spheres_follow_the_exact_solutions_of_mfix(number: int, exact: list[Row]) -> None:
    """Within 0.1 % of the difference of temperature at the start, at the printed times; the validation goes on."""
    assert len(exact) == 5 and exact[number].verdict == "holds", exact[number]


@pytest.fixture(scope="module")
def exact() -> list[Row]:
    """Convection, contact, gap, radiation, and their balances over 10 s."""
    return exact_cases({}, latest=10.0)


def test_a_step_far_too_long_ends_at_the_common_temperature_with_the_heat_conserved() -> None:
    simulation = Simulation(two_spheres(-1.33e-7, 1e6, 1e7))
    heat = simulation.feature(HeatExchangeOfContacts)
    capacity = heat.capacity(simulation.particles)
    before = float(capacity @ simulation.particles.temperature)
    simulation.step()
    assert np.ptp(simulation.particles.temperature) < 0.1
    for _ in range(20):
        simulation.step()
    assert np.ptp(simulation.particles.temperature) < 1e-6
    assert float(capacity @ simulation.particles.temperature) == pytest.approx(before, rel=1e-13)


def test_a_softened_contact_conducts_as_the_real_one_under_the_same_force() -> None:
    """The radius of Hertz takes the real modulus; the overlap of a thousand times softer contact does not count."""

    def conductance(overlap: float, softened: float | None) -> float:
        soft = {"material.light.contact_modulus": softened, "material.heavy.contact_modulus": softened}
        changes = soft if softened else {}
        hard = {"material.light.youngs_modulus": 1e10, "material.heavy.youngs_modulus": 1e10}
        case = two_spheres(-overlap, 1.0, 10.0, **{k.replace(".", "__"): v for k, v in (hard | changes).items()})
        simulation = Simulation(case)
        simulation.step()
        heat = simulation.feature(HeatExchangeOfContacts)
        return heat.scale / 1.0 / float(np.ptp(simulation.particles.temperature))

    assert conductance(1e-5, 1e7) == pytest.approx(conductance(1e-7, None), rel=1e-6)


def test_contacts_across_a_periodic_side_conduct_as_any_other() -> None:
    def warmed(x: float, **changes: Any) -> float:
        places = [(x, 0.005, 0.005), ((x + RADII - 1e-7) % 0.045, 0.005, 0.005)]
        simulation = Simulation(two_spheres(0.0, 1.0, 10.0, bed__positions=places, **changes))
        simulation.until(5.0)
        return float(simulation.particles.temperature[0])

    within = warmed(0.005)
    assert within > COLD + 1.0
    assert warmed(0.043, column__sides="periodic") == pytest.approx(within, abs=1e-6)


@pytest.mark.parametrize("gap", [-1.33e-7, 1e-4])
def test_nothing_passes_between_spheres_on_both_sides_of_a_plate(gap: float) -> None:
    """Through a contact or a gap of gas; beside the end of the plate they exchange heat as ever."""

    def exchanged(height: float) -> float:
        edges = [[0.0, 0.02, 0.0], [0.0, 0.0, height]]
        plate = {"shape": "plate", "point": [0.005 + 1.5e-3 + 0.5 * gap, 0.0, 0.0], "edges": edges}
        heat = {"gap": "lens", "gas_conductivity": GAS}
        simulation = Simulation(two_spheres(gap, 1.0, 10.0, heat, wall=[plate]))
        simulation.step()
        return simulation.feature(HeatExchangeOfContacts).scale

    assert exchanged(0.0108) == 0.0 and exchanged(0.0045) > 0.0


def at_the_floor(wall: dict[str, Any], **heat: Any) -> Case:
    """One sphere on the floor, pressed by its weight, and one that touches nothing."""
    given = {"wall": {"floor": wall}, "gap": "lens", "gas_conductivity": GAS, **heat}
    changes = {"bed__positions": [(0.005, 0.005, 0.00149995), (0.03, 0.01, 0.006)], "laws__gravity": (0.0, 0.0, -9.81)}
    return two_spheres(0.0, 0.1, 500.0, given, **changes)


def test_a_wall_at_a_temperature_warms_the_particle_that_touches_it_alone() -> None:
    simulation = Simulation(at_the_floor({"temperature": 350.0}).with_(**{"run.fluid_step": 1.0}))
    simulation.until(500.0)
    assert simulation.particles.temperature == pytest.approx([350.0, HOT], abs=1e-3)
    capacity = simulation.feature(HeatExchangeOfContacts).capacity(simulation.particles)[0]
    assert row(simulation)["contact_heat_from_walls"] == pytest.approx(capacity * (350.0 - COLD), rel=1e-3)
    assert simulation.feature(HeatExchangeOfContacts).imbalance < 1e-11


def test_a_wall_with_a_coefficient_warms_by_its_exponential() -> None:
    simulation = Simulation(at_the_floor({"temperature": 350.0, "coefficient": 500.0}))
    simulation.until(10.0)
    capacity = simulation.feature(HeatExchangeOfContacts).capacity(simulation.particles)[0]
    rate = 500.0 * math.pi * 1.5e-3**2 / capacity
    assert simulation.particles.temperature[0] == pytest.approx(350.0 - 51.85 * math.exp(-rate * 10.0), abs=0.05)


def test_a_wall_with_a_power_gives_all_of_it() -> None:
    simulation = Simulation(at_the_floor({"power": 1e-3}))
    simulation.until(10.0)
    capacity = simulation.feature(HeatExchangeOfContacts).capacity(simulation.particles)[0]
    assert capacity * (simulation.particles.temperature[0] - COLD) == pytest.approx(1e-2, rel=1e-9)
    assert row(simulation)["contact_heat_from_walls"] == pytest.approx(1e-2, rel=1e-9)


def test_a_rough_contact_resists_and_gas_between_its_asperities_helps() -> None:
    rough = {
        "contact": "rough",
        "microhardness": {"light": 3e9, "heavy": 3e9},
        "slope": {"light": 0.056, "heavy": 0.056},
        "surface_roughness": {"light": 1e-7, "heavy": 1e-7},
    }
    gas = {"gap": "rarefied", "gas_conductivity": 0.027}

    def scale(heat: dict[str, Any]) -> float:
        simulation = Simulation(two_spheres(-1e-7, 0.1, 10.0, heat))
        simulation.step()
        return simulation.feature(HeatExchangeOfContacts).scale

    smooth, asperities, with_gas = scale({}), scale(rough), scale(rough | gas)
    assert asperities < 0.9 * smooth and asperities < with_gas
    assert scale(gas) > smooth


def test_history_snapshot_and_checkpoint_have_the_heat_and_continue_with_the_same_bits() -> None:
    simulation = Simulation(two_spheres(-1.33e-7, 0.5, 10.0, {"gap": "lens", "gas_conductivity": GAS}))
    simulation.step()
    again = Simulation.restored(simulation.case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert repr(row(again)) == repr(row(simulation))
    assert {"mean_temperature", "contact_heat_from_walls", "contact_heat_radiated", "contact_heat_imbalance"} <= row(
        again
    ).keys()
    assert np.array_equal(again.snapshot()["temperature"], simulation.snapshot()["temperature"])


def test_rounding_of_temperatures_that_are_equal_is_no_imbalance() -> None:
    """Two spheres of one temperature exchange nothing but rounding, which over itself would be of order 1."""
    simulation = Simulation(two_spheres(-1.33e-7, 0.5, 10.0))
    simulation.particles.temperature[:] = COLD
    for _ in range(3):
        simulation.step()
    heat = simulation.feature(HeatExchangeOfContacts)
    assert heat.imbalance < 1e-6
    heat.gained, heat.scale = 1e-13 * heat.total_capacity, 1e-13 * heat.total_capacity  # as rounding leaves it
    assert heat.total_capacity == pytest.approx(float(heat.capacity(simulation.particles).sum()), rel=1e-14)
    assert heat.imbalance == pytest.approx(1e-10, rel=1e-6)  # of a thousandth of a kelvin
    heat.gained = 1e-2 * heat.total_capacity  # heat from nowhere is seen as before
    heat.scale = heat.gained
    assert heat.imbalance == pytest.approx(1.0)


def test_particles_that_move_exchange_heat_while_they_touch() -> None:
    """Two spheres of the gap test that fly towards each other, bounce and part."""
    case = two_spheres(1e-5, 1e-4, 1.0, {"held": False}, bed__initial_velocity=(0.0, 0.0, 0.0))
    simulation = Simulation(case)
    simulation.particles.velocity[:, 0] = (0.01, -0.01)
    simulation.until(0.02)
    assert simulation.particles.velocity[0, 0] < 0.0
    assert simulation.particles.temperature[0] > COLD and simulation.feature(HeatExchangeOfContacts).imbalance < 1e-10
    now = simulation.particles.temperature.copy()
    simulation.until(0.03)
    assert np.array_equal(simulation.particles.temperature, now)


def test_heat_of_the_fluid_and_of_contacts_act_together_on_one_temperature() -> None:
    """Two spheres in air of 400 K: contacts even them out, and the air warms both; each budget holds."""
    air = {"fluid_temperature": 400.0, "conductivity": 0.026, "fluid_heat_capacity": 1007.0}
    of_both = {"particle_temperature": COLD, "heat_capacity": HEAT["heat_capacity"]}
    case = two_spheres(
        -1.33e-7, 0.01, 1.0, {"particle_temperature": None, "heat_capacity": {}},
        fluid={"density": 1.2, "viscosity": 1.8e-5}, heat=air | of_both, laws__drag="none",
        column__cell=(0.015, 0.01, 0.0054),
    )  # fmt: skip
    simulation = Simulation(case)
    simulation.particles.temperature = (COLD, HOT)
    simulation.until(1.0)
    cold, hot = simulation.particles.temperature
    now = row(simulation)
    assert COLD < cold < 400.0 < hot < HOT
    assert now["heat_imbalance"] < 1e-10 and now["contact_heat_imbalance"] < 1e-10
    capacity = simulation.feature(HeatExchangeOfContacts).capacity(simulation.particles)
    assert float(capacity @ (cold - COLD, hot - HOT)) == pytest.approx(now["heat_received"], rel=1e-9)


@pytest.mark.parametrize(
    ("heat", "message"),
    [
        ({"particle_temperature": {"cold": -1.0, "hot": 300.0}}, "particle_temperature.cold = -1.0: .*absolute zero"),
        ({"particle_temperature": {"cold": 300.0}}, "particle_temperature.hot"),
        ({"particle_temperature": {"cold": 300.0, "hot": 300.0, "warm": 3.0}}, "particle_temperature.warm"),
        ({"conductivity": {"light": -1.0}}, "contact_heat.conductivity.light"),
        ({"conductivity": {"light": 1.0}}, "contact_heat.conductivity.heavy: must be given"),
        ({"heat_capacity": {"light": 0.0, "heavy": 1.0}}, "contact_heat.heat_capacity.light"),
        ({"gap": "lens"}, "contact_heat.gas_conductivity"),
        ({"contact": "rough"}, "contact_heat.microhardness.heavy"),
        ({"emissivity": {"light": 1.2, "heavy": 0.8}}, "contact_heat.emissivity.light"),
        ({"emissivity": {"light": 0.2, "heavy": 0.8}}, "contact_heat.surroundings_temperature"),
        ({"wall": {"flor": {"temperature": 300.0}}}, "contact_heat.wall.flor: .*floor"),
        ({"wall": {"floor": {"temperature": -3.0}}}, "contact_heat.wall.floor.temperature"),
        ({"wall": {"floor": {}}}, "contact_heat.wall.floor.temperature: must be given, or power"),
    ],
)
def test_wrong_input_is_refused_in_one_line(heat: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        two_spheres(0.0, 0.1, 1.0, heat)
    assert len(str(failure.value).splitlines()) == 1


def test_fixed_particles_have_no_forces_and_are_refused_with_the_remedy() -> None:
    with pytest.raises(InputError, match=re.escape("contact_heat.held = true")):
        two_spheres(0.0, 0.1, 1.0, bed__fixed=True)


def test_held_particles_have_no_feed_and_no_velocity() -> None:
    feed = {"corner": (0.0, 0.0, 0.005), "size": (0.045, 0.02, 0.005), "rate": 1.0, "species": "cold"}
    with pytest.raises(InputError, match=r"contact_heat.held = True: must be false where there is a feed"):
        two_spheres(0.0, 0.1, 1.0, feed=[feed])
    with pytest.raises(InputError, match=r"bed.initial_velocity = .*: must be left out with contact_heat.held"):
        two_spheres(0.0, 0.1, 1.0, bed__initial_velocity=(0.0, 0.0, -1.0))


def held_bed(**changes: Any) -> Case:
    """Particles that are held in a stream of water, with keys of a bed that moves."""
    heat = {"held": True, "particle_temperature": None, "heat_capacity": {}}
    of_both = {"particle_temperature": COLD, "heat_capacity": HEAT["heat_capacity"]}
    of_water = {"fluid_temperature": COLD, "conductivity": 0.6, "fluid_heat_capacity": 4180.0}
    return two_spheres(
        -1.33e-7, 0.01, 1.0, heat, fluid={"density": 998.0, "viscosity": 1e-3}, bed__inlet_velocity=0.01,
        heat=of_water | of_both, column__cell=(0.015, 0.01, 0.0054), laws__gravity=(0.0, 0.0, -9.81),
        laws__lubrication="nijssen", laws__drag="gidaspow_smooth", **changes,
    )  # fmt: skip


def test_a_held_bed_has_no_numbers_of_beds_that_move() -> None:
    """No collisions, films or steps of particles, and no weight that the flow carries."""
    case = held_bed(run__reference_speed=30.0, run__particle_step=1.0)
    checked = preflight(case)
    keys = {"run.particle_step", "laws.agitation", "material.light.contact_modulus", "material.heavy.contact_modulus"}
    assert not keys & {issue.key for issue in checked.issues}, checked.issue_lines()
    names = {row.name for row in checked.rows if row.group == "collisions and film"}
    assert "overlap / diameter, at rest" in names
    assert names <= {"overlap / diameter, at rest", "contact modulus / real"}
    columns = all_columns(case)
    assert not {name for name in columns if "film" in name}
    simulation = Simulation(case)
    simulation.step()
    assert math.isnan(bed_voidage_from_pressure(simulation))
    assert not any("lubrication" in citation.kind for citation in references_of(case))


def test_check_warns_of_a_circle_of_softened_contacts() -> None:
    softened = {"material__light": {"density": 420.0, "youngs_modulus": 1e9, "poisson": 0.25, "contact_modulus": 1e7}}
    case = two_spheres(0.0, 0.1, 1.0, {"radius": "overlap_circle"}, **softened)
    assert "contact_heat.radius" in [each.key for each in preflight(case).issues]


def by_id(case: Case, ranks: Any = None, steps: int = 3) -> dict[str, np.ndarray]:
    """Temperatures by id after some steps, and the columns of the history, of all ranks."""
    simulation = Simulation(case) if ranks is None else Simulation(case, communicator=ranks)
    for _ in range(steps):
        simulation.step()
    values = {name: value for name, value in row(simulation).items() if "heat" in name or "temperature" in name}
    return {"particles": simulation.whole("temperature"), "row": np.array(list(values.values()))}


@pytest.mark.parametrize("size", [2, 3])
def test_ranks_have_the_bits_of_one_process(size: int) -> None:
    """Contacts, gaps, a wall of a temperature, one with a power, one with a coefficient, and radiation inside a bed."""
    spacing, radius = 3.2999e-3, 1.65e-3
    x, y, z = (radius - 1e-7 + spacing * np.arange(n) for n in (13, 4, 2))
    kinds = {"cold": "light", "hot": "heavy"}
    case = two_spheres(
        0.0, 0.5, 10.0,
        {
            "gap": "lens", "gas_conductivity": GAS, "emissivity": {"light": 0.8, "heavy": 0.8},
            "surroundings_temperature": 400.0, "surroundings": "local",
            "wall": {
                "floor": {"temperature": 350.0}, "x_low": {"power": 0.1},
                "y_low": {"temperature": 280.0, "coefficient": 50.0},
            },
        },
        bed={
            "species": {name: {"material": each, "diameter": 3.3e-3, "count": 52} for name, each in kinds.items()},
            "positions": [(float(a), float(b), float(c)) for a in x for b in y for c in z],
        },
    )  # fmt: skip
    alone = by_id(case)
    assert np.ptp(alone["particles"]) > 1.0
    for found in on_ranks(size, lambda ranks: by_id(case, ranks)):
        assert all(np.array_equal(values, found[name]) for name, values in alone.items())


def test_walls_are_named_in_the_order_of_the_solver() -> None:
    case = two_spheres(0.0, 0.1, 1.0)
    names, solver = wall_names(case), Simulation(case).particle_solver
    assert names == ["floor", "lid", "x_low", "x_high", "y_low", "y_high"] and len(names) == len(solver.walls.sweep)


def test_a_mixture_is_placed_one_centre_for_each_particle() -> None:
    with pytest.raises(InputError, match=r"bed\.positions = 1: must be as many as the species count together, 2"):
        two_spheres(0.0, 0.1, 1.0, bed__positions=[(0.005, 0.005, 0.005)])


def test_the_case_of_the_page_is_checked_and_written_and_read_back() -> None:
    block = re.search(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    case = Case.from_text(block[1])
    assert not [each for each in preflight(case).issues if each.severity == "error"]
    assert Case.from_text(case.to_toml()).feature_tables == case.feature_tables


@pytest.mark.slow
def test_a_heated_bed_has_the_same_bits_on_two_threads() -> None:
    found, before = [], use_threads(None)
    for threads in (1, 2):
        use_threads(threads)
        simulation = Simulation(heated_bed.case_of(next(iter(heated_bed.LAWS.values()))))
        for _ in range(3):
            simulation.step(30.0)
        found.append(simulation.particles.temperature.copy())
    use_threads(before)
    assert np.ptp(found[0]) > 1.0 and np.array_equal(*found)


@pytest.mark.slow
def test_the_heated_bed_of_beaulieu_holds_its_limits_but_for_the_upper_depth() -> None:
    """At 4.0 cm it is 1.4 K colder than measured, within the measurement's error of 2.2 K."""
    curves: dict[str, Any] = {}
    failed = [each for each in heated_bed.rough(curves) if each.verdict != "holds"]
    found = {depth: curves["rough"][f"at {depth:g} cm"][0] for depth in heated_bed.LIMITS}
    diffusivity, lag, apart = heated_bed.as_slab(found)
    print(f"as a slab: {diffusivity:.3g} m2/s, {1e3 * lag:.2f} mm from the plate, within {apart:.2f} K")
    assert apart < 0.25 and diffusivity == pytest.approx(3.2e-7, rel=0.05) and lag == pytest.approx(5.5e-3, rel=0.1)
    assert len(failed) == 1 and "at 4 cm" in failed[0].quantity
    assert failed[0].difference == pytest.approx(-1.4, abs=0.1)


def test_the_measurement_of_beaulieu_is_that_of_a_slab_that_touches_the_plate() -> None:
    """A known slab is found, and the measured one has no resistance at the plate: that of the run is 5.5 mm away."""
    time = np.array(heated_bed.TIMES, float)
    made = {depth: heated_bed.slab(time, 0.01 * depth, 3e-7, 4e-3) for depth in heated_bed.LIMITS}
    assert heated_bed.as_slab(made)[:2] == pytest.approx((3e-7, 4e-3), rel=0.01)
    diffusivity, lag, apart = heated_bed.as_slab({depth: heated_bed.measured(depth) for depth in heated_bed.LIMITS})
    assert diffusivity == pytest.approx(2.75e-7, rel=0.02) and lag < 1e-4 and apart < 0.5
