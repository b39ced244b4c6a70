"""The hopper with air: Beverloo's law for its cone, and what a run is read for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.case.column_grid import grid_of
from cfddem.case.gallery import gallery
from cfddem.fluid.boundaries import Boundaries
from cfddem.preflight.summary import preflight
from cfddem.run.build import boundaries_of
from scenarios.beds.hopper_with_air import beverloo, discharge


def test_the_law_gives_the_number_of_the_page():
    """By hand: 0.58 x 1450 kg/m3 x sqrt(9.81 m/s2) x (24 - 4.2 mm)^2.5, times 0.6^-0.35 for the cone."""
    assert beverloo(gallery()["hopper-with-air"]) == pytest.approx(0.58 * 1450 * 9.81**0.5 * 0.0198**2.5 * 0.6**-0.35)


def test_discharge_and_gradient_are_those_of_the_orifice_in_the_averaging_window():
    """A rate that doubles in the middle; a pressure 30 Pa higher in the second layer of cells than in the first."""
    case, time = gallery()["hopper-with-air"], np.linspace(0.0, 0.3, 301)
    pressure, velocity = np.zeros((23, 10, 10)), np.zeros((23, 10, 10, 3))
    pressure[1], velocity[:2, ..., 2] = 30.0, 2.0
    fields = {"pressure": pressure, "velocity": velocity, "voidage": np.full(pressure.shape, 0.5)}
    run = SimpleNamespace(
        grid=SimpleNamespace(cells=(10, 10, 23), spacing=(0.006, 0.006, 0.006)),
        times=np.array([0.0, 0.1, 0.2]),
        history={"time": time, "removed_mass": np.where(time < 0.14, 0.1 * time, 0.2 * time - 0.014)},
        fluid=lambda name, n: fields[name] * (n > 0),
    )
    found = discharge(run, case)
    assert found.rate == pytest.approx(0.15) and found.error == pytest.approx(0.05 * (6 / 5 / 6) ** 0.5)
    ratio, error = found.over(replace(found, rate=0.3, error=0.0))
    assert ratio == pytest.approx(0.5) and error == pytest.approx(found.error / 0.3)
    assert found.air == pytest.approx(1.0) and found.gradient == pytest.approx(5000.0)
    assert found.factor == pytest.approx((1.0 + 5000.0 / 1450.0 / 9.81) ** 0.5, rel=1e-3)


def test_air_passes_floor_and_lid_by_their_pressures():
    """The whole orifice is open to the pressure of its patch, and nothing else of the floor is."""
    case = gallery()["hopper-with-air"].with_(**{"patch.orifice.pressure": -100.0})
    boundaries = Boundaries(grid_of(case), boundaries_of(case))
    low, high = (next(each for each in boundaries.sides if each.name == name) for name in ("z_low", "z_high"))
    assert low.outlet[2:-3, 2:-3].sum() == 16 and (low.pressure[2:-3, 2:-3].sum() == -1600.0)
    assert not low.inlets and high.outlet[2:-3, 2:-3].sum() > 60 and not high.pressure.any()


def test_the_case_has_no_errors():
    assert not [each for each in preflight(gallery()["hopper-with-air"]).issues if each.severity != "note"]
