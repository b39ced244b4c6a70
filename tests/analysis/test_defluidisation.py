"""The detector of defluidisation, on made-up series."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made_up_run import BED, made_up

from cfddem.analysis.run_warnings import defluidisation, defluidisation_of
from cfddem.case.schema import Case
from cfddem.io.reading import open_run

TIME = np.linspace(0.0, 2.0, 201)
SHARE = np.linspace(0.0, 1.0, 201)
BLOWN = np.where(TIME > 0.2, 0.5, 0.0)  # m/s above minimum fluidisation
WAVES = 1.0 + 0.15 * np.sin(40.0 * TIME)
MOTION = 1e-3 * (1.0 + 0.5 * np.sin(25.0 * TIME))


def test_a_bubbling_bed_is_fluidised() -> None:
    assert defluidisation(TIME, WAVES, MOTION, SHARE, BLOWN) is None


def test_a_bed_that_comes_to_rest_is_found_with_its_time() -> None:
    found = defluidisation(TIME, WAVES, np.where(TIME < 1.2, MOTION, 1e-6), SHARE, BLOWN)
    assert found is not None and found.rests and not found.passed
    assert found.time == pytest.approx(1.2, abs=0.1)
    assert found.largest_share == pytest.approx(0.6, abs=0.05)
    assert "granular temperature" in str(found) and "pressure drop" not in str(found)


def test_channels_show_in_the_pressure_drop() -> None:
    found = defluidisation(TIME, np.where(TIME < 0.8, WAVES, 0.5), MOTION, SHARE, BLOWN)
    assert found is not None and found.passed and not found.rests
    assert found.time == pytest.approx(0.8, abs=0.1)
    assert "pressure drop is below 80 % of the weight" in str(found)


def test_a_pause_and_a_bed_that_is_not_blown_are_no_defluidisation() -> None:
    pause = np.where((TIME > 0.8) & (TIME < 1.2), 1e-6, MOTION)
    assert defluidisation(TIME, WAVES, pause, SHARE, BLOWN) is None
    stopped = np.where(TIME < 1.2, MOTION, 1e-6)
    assert defluidisation(TIME, WAVES, stopped, SHARE, BLOWN * (TIME < 1.3)) is None
    assert defluidisation(TIME[:3], WAVES[:3], MOTION[:3], SHARE[:3], BLOWN[:3]) is None


def test_a_bed_that_never_moved_is_found() -> None:
    """It carries its weight as one piece, or gas passes it, from the start."""
    found = defluidisation(TIME, np.ones(201), np.full(201, 1e-6), SHARE, BLOWN)
    assert found is not None and found.rests and not found.passed and found.time < 0.25
    found = defluidisation(TIME, np.full(201, 0.6), np.full(201, 1e-6), SHARE, BLOWN)
    assert found is not None and found.rests and found.passed


def test_a_short_dip_at_the_end_is_no_defluidisation() -> None:
    dip = np.where(TIME > 1.9, 0.5, WAVES)
    assert defluidisation(TIME, dip, MOTION, SHARE, BLOWN) is None


def test_the_less_a_bed_moves_at_the_end_the_sooner_it_counts_as_at_rest() -> None:
    def ending(begin: float, temperature: float) -> object:
        return defluidisation(TIME, WAVES, np.where(begin > TIME, MOTION, temperature), SHARE, BLOWN)

    assert ending(1.7, 1e-9) is not None
    assert ending(1.7, 5e-5) is None and ending(1.4, 5e-5) is not None
    assert ending(1.9, 1e-9) is None


def test_a_bed_that_no_liquid_joins_is_not_held_by_liquid(tmp_path: Path) -> None:
    liquid = "[liquid]\nviscosity = 5e-3\nsurface_tension = 0.07\nthickness = 1e-6\n[run]"
    text = BED.replace("[run]", liquid)
    for largest, held in ((1.0, False), (50.0, True)):
        still = {"granular_temperature": 1e-12, "particle_count": 100.0, "largest_agglomerate": largest}
        run = open_run(made_up(tmp_path / str(largest), text, **still))
        assert (defluidisation_of(run, Case.from_text(text)) is not None) == held


def test_a_spout_is_judged_by_rest_alone() -> None:
    """It breaks through once, and then carries a part of the weight at a tenth of that motion."""
    eruption, share = np.where(TIME < 0.5, 20.0 * MOTION, MOTION), np.full(201, 0.5)
    assert defluidisation(TIME, share, eruption, SHARE, BLOWN) is not None
    assert defluidisation(TIME, share, eruption, SHARE, BLOWN, spouts=True) is None
    found = defluidisation(TIME, share, np.where(TIME < 1.2, eruption, 1e-6), SHARE, BLOWN, spouts=True)
    assert found is not None and found.rests and not found.passed
    assert found.time == pytest.approx(1.2, abs=0.1)


def test_the_jet_counts_where_the_rest_of_the_floor_does_not_fluidise(tmp_path: Path) -> None:
    liquid = "[liquid]\nviscosity = 5e-3\nsurface_tension = 0.07\nthickness = 1e-6\n[run]"
    text = BED.replace("[run]", liquid).replace("inlet_velocity = 0.05", "inlet_velocity = 0.01")
    blown = text.replace("inlet_velocity = 0.01", "inlet_velocity = 0.01\njet = { velocity = 0.3, width = 0.004 }")
    assert text != blown and Case.from_text(text).bed.inlet_velocity == 0.01
    still = {"granular_temperature": 1e-12, "particle_count": 100.0, "largest_agglomerate": 50.0}
    run = open_run(made_up(tmp_path / "run", text, **still))
    assert defluidisation_of(run, Case.from_text(text)) is None
    found = defluidisation_of(run, Case.from_text(blown))
    assert found is not None and found.rests
