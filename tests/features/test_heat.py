"""Temperature of particles in a fluid of one temperature; the how-to page docs/how-to/heat.md shows the keys.

The cooling sphere is the convection test of MFIX, legacy_tests/dem-tests/convection, of J. Musser.
"""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.preflight.summary import preflight
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from scenarios.validation.heat.spheres import COOLED, SPHERE, with_changes

PAGE = Path(__file__).parents[2] / "docs/how-to/heat.md"


def case_of(**changes: Any) -> Case:
    """A sphere at 6 m/s in air at rest, without drag; changes with __ for the point."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.1854, "viscosity": 1.8603e-5},
        "material.metal": {"density": 8850.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": 0.04, "height": 0.04, "cell": 0.01, "sides": "periodic", "ends": "periodic"},
        "bed": {"diameter": 3.6e-3, "positions": [(0.02, 0.02, 0.02)], "initial_velocity": (6.0, 0.0, 0.0)},
        "laws": {"drag": None, "gravity": (0.0, 0.0, 0.0), "lubrication": "none"},
        "run": {"until": 1.0, "reference_speed": 6.0, "particle_step": 1e-5, "fluid_step": 1e-5},
        "heat": SPHERE,
    }
    return with_changes(values, changes)


def started(**changes: Any) -> tuple[Simulation, HeatExchange]:
    """A simulation after one short step, which knows the slip."""
    simulation = Simulation(case_of(**changes))
    simulation.step()
    return simulation, simulation.feature(HeatExchange)


@pytest.mark.parametrize("step", [0.01, 0.5])
def test_a_sphere_cools_by_the_published_exponential_at_any_step(step: float) -> None:
    simulation, heat = started()
    simulation.particles.temperature = 373.15
    for number in range(1, round(5.0 / step) + 1):
        heat.before(simulation, step)
        if (time := round(number * step, 9)) in COOLED:
            assert abs(simulation.particles.temperature[0] - COOLED[time]) < 1e-3 * 75.0
    assert simulation.feature(HeatExchange).imbalance < 1e-12


def test_a_step_far_too_long_ends_at_the_temperature_of_the_fluid() -> None:
    simulation, heat = started()
    heat.before(simulation, 1e6)
    assert simulation.particles.temperature[0] == pytest.approx(298.15, abs=1e-9)


def test_a_mixed_fluid_and_the_particles_end_at_the_common_temperature_with_the_heat_conserved() -> None:
    simulation, heat = started(heat__fluid_total_capacity=0.01)
    capacity = heat.capacity(simulation.owned)[0]
    common = (capacity * 373.15 + 0.01 * 298.15) / (capacity + 0.01)
    for step in (0.1, 1.0, 1e3, 1e3, 1e3, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6):
        heat.before(simulation, step)
        assert heat.fluid_temperature <= common + 1e-9 and simulation.particles.temperature[0] >= common - 1e-9
        total = capacity * simulation.particles.temperature[0] + 0.01 * heat.fluid_temperature
        assert total == pytest.approx((capacity + 0.01) * common, rel=1e-13)
    assert row(simulation)["mean_temperature"] == pytest.approx(common, abs=1e-6)


def test_history_snapshot_and_checkpoint_have_the_heat_and_continue_with_the_same_bits() -> None:
    simulation, _ = started(heat__fluid_total_capacity=0.01)
    again = Simulation.restored(simulation.case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert row(again) == row(simulation) and {"mean_temperature", "heat_imbalance"} <= row(again).keys()
    assert np.array_equal(again.snapshot()["temperature"], simulation.snapshot()["temperature"])
    assert again.particles.temperature[0] < 373.15


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fluid_temperature": -1.0}, "heat.fluid_temperature"),
        ({"particle_temperature": -0.1}, "heat.particle_temperature"),
        ({"heat_capacity": {"metal": -5.0}}, "heat.heat_capacity.metal"),
        ({"heat_capacity": {}}, "heat.heat_capacity.metal"),
        ({"heat_capacity": {"metal": 5.0, "wood": 5.0}}, "heat.heat_capacity.wood"),
    ],
)
def test_wrong_input_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as failure:
        case_of(heat=SPHERE | changes)
    assert len(str(failure.value).splitlines()) == 1


def test_a_fluid_without_viscosity_is_refused() -> None:
    """It has no Reynolds number; temperatures would be NaN."""
    with pytest.raises(InputError, match=r"fluid.viscosity.*above 0 with \[heat\]"):
        case_of(fluid__viscosity=0.0)


def test_check_warns_of_a_large_biot_number() -> None:
    def keys(conductivity: float) -> list[str]:
        case = case_of(heat=SPHERE | {"solid_conductivity": {"metal": conductivity}})
        return [each.key for each in preflight(case).issues if "Biot" in each.reason]

    biot = 17.81 * SPHERE["conductivity"] / 6.0
    assert keys(9.0 * biot) == ["heat.solid_conductivity.metal"] and keys(11.0 * biot) == []
    poor = case_of(heat=SPHERE | {"solid_conductivity": {"metal": 0.1}})
    assert "heat.solid_conductivity.metal" in [each.key for each in preflight(poor).issues]


def test_the_keys_of_the_page_make_a_case_that_is_written_and_read_back() -> None:
    block = re.search(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block is not None
    table = tomllib.loads(block[1])["heat"]
    case = case_of(heat=table | {"heat_capacity": {"metal": 840.0}})
    assert Case.from_text(case.to_toml()).feature_tables == case.feature_tables
    assert math.isclose(case.feature_tables[0].capacities(case)[0], 840.0)  # type: ignore[attr-defined]
