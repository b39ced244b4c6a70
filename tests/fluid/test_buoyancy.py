"""Weight of the fluid by its temperature, after Boussinesq."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.preflight.summary import preflight
from cfddem.run.simulation import Simulation
from scenarios.validation.heat.packed import HEAT, packed

EDGE, WARMER, PRANDTL = 0.1, 10.0, 0.71


def cavity(rayleigh: float, cells: int, **changes: Any) -> Case:
    """Air between a hot wall and a cold one, in a closed box of one cell depth; a speck of dust stands in it."""
    tiny, spacing = 1e-5, EDGE / cells
    around = {"sides": "no_slip", "front": "free_slip", "ends": "closed"}
    product = 9.81 * WARMER / 300.0 * EDGE**3 / rayleigh  # of kinematic viscosity and thermal diffusivity
    diffusivity = math.sqrt(product / PRANDTL)
    return packed(
        fluid={"density": 1.2, "viscosity": 1.2 * PRANDTL * diffusivity},
        column={
            "width": EDGE, "depth": spacing, "height": EDGE, "cell": spacing, **around,
        },
        bed={"diameter": tiny, "positions": [(0.05, 0.5 * spacing, 0.05)], "fixed": True},
        run={
            "until": 0.6 * EDGE**2 / diffusivity, "reference_speed": 0.01,
            "fluid_step": 0.15 * spacing**2 / diffusivity,
        },
        heat=HEAT | {
            "particle_temperature": 300.0, "conductivity": 1.2 * 1000.0 * diffusivity,
            "wall_temperature": {"x_low": 300.0 + 0.5 * WARMER, "x_high": 300.0 - 0.5 * WARMER},
            "buoyancy": "boussinesq",
        }, **changes,
    )  # fmt: skip


@pytest.mark.slow
def test_a_cavity_with_a_hot_wall_passes_the_heat_of_the_benchmark() -> None:
    """Ra = 1e4: Nu = 2.243, largest velocities 16.18 and 19.62 (de Vahl Davis, Int. J. Numer. Methods Fluids 3 (1983)
    249-264); within 2 % on 32 x 32 cells."""
    cells = 32
    simulation = Simulation(cavity(1e4, cells))
    simulation.until(simulation.case.run.until)
    heat, fluid = simulation.feature(HeatExchange).cells, simulation.fluid
    assert heat is not None
    temperature, unit = heat.value[:, 0], heat.kind.conductivity / heat.kind.capacity / EDGE
    hot = 2.0 * cells * (300.0 + 0.5 * WARMER - temperature[:, 0]).mean() / WARMER
    cold = 2.0 * cells * (temperature[:, -1] - 300.0 + 0.5 * WARMER).mean() / WARMER
    across = np.abs(fluid.velocity[:, 0, cells // 2 - 1 : cells // 2 + 1, 0].mean(axis=1)).max() / unit
    up = np.abs(fluid.velocity[cells // 2 - 1 : cells // 2 + 1, 0, :, 2].mean(axis=0)).max() / unit
    print(f"Nu {hot:.4f} at the hot wall, {cold:.4f} at the cold one; velocities {across:.3f}, {up:.3f}")
    assert hot == pytest.approx(2.243, rel=0.02) and cold == pytest.approx(hot, rel=2e-3)
    assert across == pytest.approx(16.178, rel=0.02) and up == pytest.approx(19.617, rel=0.02)


def test_warm_fluid_is_lighter_by_its_expansion_and_at_rest_where_it_is_warm_everywhere() -> None:
    simulation = Simulation(cavity(1e4, 4))
    fluid, heat = simulation.fluid, simulation.feature(HeatExchange)
    assert heat.cells is not None
    heat.cells.value[:] = 303.0
    force = heat.buoyancy(fluid)
    assert force[..., 2] == pytest.approx(1.2 * 9.81 * 3.0 / 300.0, rel=1e-6) and not force[..., :2].any()
    heat.cells.value[:, :, 2:] = 300.0
    fluid.step(1e-3)
    velocity = fluid.velocity[..., 2]
    assert (velocity[1:3, 0, :2] > 0.0).all() and (velocity[1:3, 0, 2:] < 0.0).all()
    heat.cells.value[:] = 303.0
    fluid.set_velocity((0.0, 0.0, 0.0))
    fluid.step(1e-3)
    assert np.abs(fluid.velocity).max() < 1e-9


@pytest.mark.parametrize(
    ("heat", "message"),
    [
        ({"expansion": 1e-3}, "heat.expansion = 0.001: must be left out without buoyancy; set"),
        ({"buoyancy": "boussinesq", "fluid": "uniform"}, "heat.buoyancy.*must be none where the fluid has one temper"),
        ({"buoyancy": "boussinesq", "expansion": -1e-3}, "heat.expansion.*above 0"),
    ],
)
def test_wrong_input_is_refused_in_one_line(heat: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        packed(heat=HEAT | heat)
    assert len(str(failure.value).splitlines()) == 1


def test_a_liquid_needs_its_expansion_and_large_differences_are_warned_of() -> None:
    water = {"fluid": {"density": 998.0, "viscosity": 1e-3}, "heat": HEAT | {"buoyancy": "boussinesq"}}
    with pytest.raises(InputError, match=re.escape("heat.expansion: must be given with buoyancy")):
        packed(**water)
    found = [each for each in preflight(packed(heat=HEAT | {"buoyancy": "boussinesq"})).issues if "10 %" in each.reason]
    assert [each.key for each in found] == ["heat.buoyancy"] and "by 33 %" in found[0].reason
