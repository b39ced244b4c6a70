"""The conical spouted bed: its correlation, and what counts as a spout that closes."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.case.gallery import gallery
from scenarios.beds.conical_spout import olazar, spouting


def test_the_correlation_gives_the_number_of_the_page():
    """By hand: Ar = 1.06e7 with glass of 2 420 kg/m3 in air, D_b/D_o = 2.22, tan(gamma/2) = 0.288."""
    assert olazar(gallery()["conical-spout"]) == pytest.approx(9.73, abs=0.01)


def test_a_spout_closes_where_the_pressure_drop_peaks_last():
    case = gallery()["conical-spout"]
    time = np.linspace(0.0, 1.0, 101)
    drop = 300.0 + 200.0 * np.exp(-(((time - 0.3) / 0.05) ** 2)) + 100.0 * np.exp(-(((time - 0.6) / 0.05) ** 2))
    drop += 20.0 * np.exp(-(((time - 0.8) / 0.02) ** 2))  # too low to count
    run = SimpleNamespace(
        grid=SimpleNamespace(cells=(16, 16, 24), spacing=(0.01, 0.01, 0.01)),
        times=np.array([0.0, 0.5, 1.0]),
        history={"time": time, "pressure_drop": drop},
        fluid=lambda name, n: np.full((24, 16, 16), (0.4, 0.8, 0.5)[n]),
    )
    found = spouting(run, case)
    nozzle = case.patch["nozzle"]
    assert found.closes == pytest.approx(nozzle.speed(0.6)) and found.last_open == pytest.approx(nozzle.speed(0.5))
