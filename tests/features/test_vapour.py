"""One vapour in the cells of the fluid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.features.vapour import Vapour
from cfddem.model.feature import Equipment
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures.heat_transfer import ranz_marshall
from scenarios.validation.heat.packed import HEAT, lattice, packed

VAPOUR: dict[str, Any] = {"fluid_fraction": 0.0, "inlet_fraction": 0.01, "diffusivity": 2.5e-5}


class Wet(Equipment):
    """Particles with a wet surface of the mass fraction 0.02."""

    name = "wet"
    lost = 0.0
    units = 0.0

    def before(self, simulation: Any, step: float) -> None:
        vapour, surface = simulation.feature(Vapour), np.full(simulation.owned.count, 0.02)
        conductance = vapour.conductance(simulation.terms)
        self.units = float(conductance.sum()) / (1.2 * 0.5 * 0.008**2)
        self.lost -= float(vapour.exchange(simulation, conductance, surface, step).sum())


def test_a_wet_bed_saturates_the_air_by_its_transfer_units_and_loses_what_the_air_gains() -> None:
    """The air leaves with 0.02 - 0.01 exp(-n), n from the law."""
    wet = Wet()
    case = packed(vapour=VAPOUR, bed__positions=lattice(4e-3, (2, 2, 10)), laws__kernel_width=0.0)
    simulation = Simulation(case, features=[wet])
    simulation.until(0.5)
    vapour, expected = simulation.feature(Vapour), 0.02 - 0.01 * np.exp(-wet.units)
    print(f"units {wet.units:.3f}: the air leaves with {vapour.cells.leaving:.5f}, exact {expected:.5f}")
    assert vapour.cells.leaving == pytest.approx(expected, abs=3e-4) and wet.units > 0.5
    assert vapour.imbalance < 1e-12
    assert row(simulation)["vapour_from_particles"] == pytest.approx(wet.lost, rel=1e-12)
    assert vapour.cells.value.min() >= 0.0 and vapour.cells.value.max() <= 0.02 + 1e-12


def test_the_sherwood_number_is_the_nusselt_number_with_the_schmidt_number() -> None:
    case = packed(
        vapour=VAPOUR,
        bed={"diameter": 2e-3, "positions": lattice(4e-3, (2, 2, 2)), "inlet_velocity": 0.5, "fixed": True},
    )
    simulation = Simulation(case)
    simulation.step()
    flow, schmidt = simulation.terms.flow, 1.8e-5 / (1.2 * 2.5e-5)  # type: ignore[union-attr]
    expected = np.pi * 2e-3 * 1.2 * 2.5e-5
    expected = expected * np.array([ranz_marshall(*each) for each in zip(flow.reynolds, [schmidt] * 8, flow.voidage)])
    assert simulation.feature(Vapour).conductance(simulation.terms) == pytest.approx(expected, rel=1e-12)


def test_a_run_resumes_with_the_same_vapour() -> None:
    first = Simulation(packed(vapour=VAPOUR))
    for _ in range(20):
        first.step()
    again = Simulation.restored(first.case, first.checkpoint())
    for each in (first, again):
        for _ in range(10):
            each.step()
    same = [row(first)[name] == value for name, value in row(again).items() if "vapour" in name]
    assert len(same) == 6 and all(same) and 0.0 < row(first)["mean_vapour"] < 0.01
    assert np.array_equal(first.feature(Vapour).cells.value, again.feature(Vapour).cells.value)


def test_air_and_particles_in_equilibrium_have_no_imbalance_of_round_off_over_round_off() -> None:
    same = HEAT | {"particle_temperature": 300.0}
    simulation = Simulation(packed(vapour=VAPOUR | {"fluid_fraction": 0.01}, heat=same))
    for _ in range(10):
        simulation.step()
    assert row(simulation)["vapour_imbalance"] < 1e-9 and row(simulation)["heat_imbalance"] < 1e-9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"heat": None}, r"vapour.*left out without \[heat\].*add the table \[heat\]"),
        ({"heat": HEAT | {"fluid": "uniform"}}, "vapour.*left out where the fluid has one temperature"),
        ({"vapour": VAPOUR | {"inlet_fraction": 1.2}}, "vapour.inlet_fraction"),
        ({"vapour": VAPOUR | {"diffusivity": -1.0}}, "vapour.diffusivity"),
    ],
)
def test_wrong_input_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        packed(**{"vapour": VAPOUR} | changes)
    assert len(str(failure.value).splitlines()) == 1
