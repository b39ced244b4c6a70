"""Statistics of series in time: means with errors, stationarity, spectra."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.analysis import series
from cfddem.backend.errors import InputError


def random(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def with_memory(count: int, memory: float, seed: int) -> np.ndarray:
    """A series of unit variance whose correlation decreases by the factor `memory` from value to value."""
    noise = random(seed).normal(0.0, np.sqrt(1.0 - memory**2), count)
    values = np.empty(count)
    values[0] = random(seed + 10_000).normal()
    for k in range(1, count):
        values[k] = memory * values[k - 1] + noise[k]
    return values


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_error_of_a_mean_accounts_for_correlation(memory: float) -> None:
    """Exact: sqrt((1 + r)/(1 - r)/n). The estimate is within 10 % and covers the truth as often as a normal error."""
    known = np.sqrt((1.0 + memory) / (1.0 - memory) / 4000.0)
    found = [series.block_average(with_memory(4000, memory, seed)) for seed in range(60)]
    assert np.mean([average.error for average in found]) == pytest.approx(known, rel=0.10)
    hits = np.mean([abs(average.mean) < average.error for average in found])
    assert 0.68 - 0.18 < hits < 0.68 + 0.18
    assert np.mean([average.independent for average in found]) == pytest.approx(1.0 / known**2, rel=0.25)


def test_the_error_of_a_short_record_is_a_lower_bound() -> None:
    """400 values worth 21 independent ones, as 20 s of a bubbling bed: 10 to 25 % low, and marked as a lower bound."""
    known = np.sqrt(19.0 / 400.0)
    found = [series.block_average(with_memory(400, 0.9, seed)) for seed in range(200)]
    assert 0.75 * known < np.mean([average.error for average in found]) < 0.9 * known
    assert np.mean([average.enough for average in found]) < 0.1


def test_a_record_too_short_for_an_error_is_marked() -> None:
    assert np.isnan(series.block_average(np.arange(10.0)).error)
    assert not series.block_average(np.sin(np.linspace(0.0, 1.0, 200))).enough
    assert series.block_average(with_memory(4000, 0.8, 1)).enough
    assert series.block_average(np.full(50, 3.0)) == (3.0, 0.0, 1, 50.0, True)
    assert str(series.block_average(np.full(50, 3.0))) == "3 +- 0"


def test_the_start_up_is_found() -> None:
    """A bed that settles within a time of 100 values about a noisy level: cut between 2 and 8 such times."""
    time = np.arange(4000.0)
    for seed in range(10):
        found = series.stationarity(5.0 * np.exp(-time / 100.0) + 0.2 * with_memory(4000, 0.8, seed))
        assert found.stationary
        assert 200 <= found.start <= 800


def test_a_start_up_of_two_fifths_is_cut_and_one_of_three_fifths_is_too_long() -> None:
    count = np.arange(4000)
    for seed in range(5):
        noise = 0.2 * with_memory(4000, 0.5, seed)
        short, long = (series.stationarity(noise + 5.0 * (count < end)) for end in (1600, 2400))
        assert short.stationary
        assert 1600 <= short.start <= 1700
        assert not long.stationary
        assert long.start >= 2400


def test_a_late_trend_is_detected() -> None:
    """Steady for 70 % of the record, then rising by one deviation: no start-up to cut, but the halves differ."""
    late = np.maximum(np.arange(4000.0) - 2800.0, 0.0) / 1200.0
    for seed in range(5):
        found = series.stationarity(late + with_memory(4000, 0.5, seed))
        assert not found.stationary
        assert found.start < 2000
        assert found.drift > 3.0 * found.error


def test_a_steady_record_is_stationary_and_a_drifting_one_is_not() -> None:
    time = np.arange(4000.0)
    steady = [series.stationarity(with_memory(4000, 0.8, seed)) for seed in range(30)]
    assert sum(found.stationary for found in steady) >= 28
    assert np.median([found.start for found in steady]) < 400
    for seed in range(10):
        assert not series.stationarity(time / 1000.0 + 0.3 * with_memory(4000, 0.8, seed)).stationary
    assert series.stationarity(np.full(101, 0.1)).stationary
    assert not series.stationarity(np.arange(5.0)).stationary
    assert not series.stationarity(np.exp(time / 1000.0)).stationary


def test_a_constant_record_is_stationary_however_short() -> None:
    """As every measure of a packed bed: constant, or to rounding."""
    for values in (np.zeros(20), 0.0155 + 1e-18 * np.arange(20.0)):
        assert series.stationarity(values)[:3] == (True, 0, 0.0)


def test_a_wave_is_stationary_wherever_the_record_ends() -> None:
    """Four periods of a wave with little noise, in all phases: the last crest is no steady part."""
    time = np.arange(0.0, 4.0, 0.005)
    for phase in np.linspace(0.0, 2.0 * np.pi, 20):
        angle = 2.0 * np.pi * time + phase
        wave = np.sin(angle) + 0.4 * np.sin(2.0 * angle) + 0.05 * with_memory(len(time), 0.8, 1)
        assert series.stationarity(wave).stationary


def test_main_frequency_of_a_noisy_wave() -> None:
    """2.63 Hz in as much noise, 10 s at 100 Hz."""
    time = np.arange(1000) * 0.01
    values = 7.0 + np.sin(2.0 * np.pi * 2.63 * time) + random().normal(0.0, 0.7, 1000)
    found = series.spectrum(values, 0.01)
    assert found.main == pytest.approx(2.63, abs=0.03)
    assert np.sum(found.density) * found.frequency[1] == pytest.approx(np.var(values), rel=0.15)
    assert np.isnan(series.spectrum(np.full(100, 2.0), 0.01).main)
    with pytest.raises(InputError, match="at least 16"):
        series.spectrum(np.zeros(5), 0.01)


def test_mean_frequency_and_its_error() -> None:
    """Periods of 0.4 s with a deviation of 20 %, in noise: the truth is within one error in two of three records."""
    hits, errors = 0, []
    for seed in range(60):
        lengths = 0.4 * (1.0 + 0.2 * random(seed).uniform(-np.sqrt(3.0), np.sqrt(3.0), 60))
        ends = np.concatenate([[0.0], np.cumsum(lengths)])
        time = np.arange(0.0, 12.0, 0.01)
        wave = np.sin(2.0 * np.pi * np.interp(time, ends, np.arange(61.0))) + random(seed).normal(0.0, 0.1, len(time))
        found = series.mean_frequency(wave, 0.01)
        assert 26 <= found.periods <= 32
        hits += abs(found.frequency - 2.5) < found.error
        errors.append(found.error)
    assert 0.5 < hits / 60.0 < 0.85
    assert np.mean(errors) == pytest.approx(2.5 * 0.2 / np.sqrt(29.0), rel=0.15)
    assert np.isnan(series.mean_frequency(np.arange(100.0), 0.1).frequency)


def test_error_of_the_peak_of_a_short_record() -> None:
    """Periods of 0.37 s that scatter by 20 %: the main frequency is known to 0.3 Hz from 3 s, to 0.2 Hz from 10 s."""
    scatter = {}
    for length in (3.0, 10.0):
        peaks = []
        for seed in range(200):
            draw = random(seed)
            lengths = 0.37 * (1.0 + 0.2 * draw.uniform(-np.sqrt(3.0), np.sqrt(3.0), 80))
            time = np.arange(0.0, length, 0.02)
            phase = np.interp(time, np.concatenate([[0.0], np.cumsum(lengths)]), np.arange(81.0))
            size = 1.0 + 0.4 * draw.normal(size=80)
            wave = size[phase.astype(int)] * np.sin(2.0 * np.pi * phase) + 0.2 * draw.normal(size=len(time))
            peaks.append(series.spectrum(wave, 0.02, 1 if length < 5.0 else 3).main)
        scatter[length] = float(np.std(peaks))
    assert scatter[3.0] == pytest.approx(0.30, abs=0.06)
    assert scatter[10.0] == pytest.approx(0.20, abs=0.05)


def test_interpolation_at_even_intervals() -> None:
    interval, values = series.even(np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0, 4.0]), 5)
    assert interval == 1.0
    assert values == pytest.approx(np.arange(5.0))
    with pytest.raises(InputError, match="ascending"):
        series.even(np.array([0.0, 0.0]), np.array([1.0, 2.0]))
