"""The resolved reference: momentum, drag of arrays, reproducibility, resume, and the fit of the closure."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cfddem.backend.compile import serial, use_threads
from cfddem.coupling.forces.agitation import _advanced, _transition
from closures.agitation import SHORT
from scenarios.references.resolved_suspension import fitting, matrix, study, verification
from scenarios.references.resolved_suspension.film import approach_resistance, unresolved_film
from scenarios.references.resolved_suspension.measures import _box_waves, autocovariance, averaged, block_mean
from scenarios.references.resolved_suspension.study import measured, stored
from scenarios.references.resolved_suspension.suspension import Point, Suspension, prepare

SMALL = Point(2.5, 0.3, 20.0, diameter=6, box=3.0)


@pytest.fixture
def one_thread():
    """Run loops on one thread, and give the threads back."""
    before = use_threads(None)
    use_threads(1)
    yield
    use_threads(before)


def stirred(point: Point, steps: int) -> Suspension:
    """A suspension after some steps."""
    suspension = prepare(point)
    for _ in range(steps):
        suspension.step()
    return suspension


@pytest.mark.slow
def test_momentum_of_spheres_and_fluid_is_conserved_to_round_off(one_thread):
    suspension = stirred(SMALL, 60)
    assert suspension.solver.particles.count == 15
    scale = suspension.mass * np.abs(suspension.velocity).sum()
    assert scale > 1.0
    assert np.abs(suspension.momentum).max() < 1e-12 * scale


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.03, 7.0])
def test_density_ratios_from_just_above_one_are_stable(one_thread, ratio):
    suspension = stirred(Point(ratio, 0.3, 20.0, diameter=6, box=3.0), 300)
    slip = suspension.mean_slip()
    assert 0.01 < slip[2] < 0.1
    assert np.abs(slip[:2]).max() < 0.02
    assert np.abs(suspension.velocity).max() < 0.2


@pytest.mark.slow
def test_creeping_drag_of_a_cubic_array(one_thread):
    factor = verification.cubic_array(0.216, diameter=12.0, viscosity=0.1)
    assert abs(factor / verification.ZICK_HOMSY[0.216] - 1.0) < 0.03


def test_zick_and_homsys_values_agree_with_the_expansion_where_it_holds():
    for solid_fraction in (0.064, 0.125):
        exact = verification.cubic_expansion(solid_fraction)
        assert abs(verification.ZICK_HOMSY[solid_fraction] / exact - 1.0) < 2e-3


@pytest.mark.slow
def test_the_bits_do_not_depend_on_threads():
    before = use_threads(None)
    try:
        found = []
        for threads in (1, 2):
            use_threads(threads)
            found.append(stirred(SMALL, 15))
    finally:
        use_threads(before)
    assert np.array_equal(found[0].flow.populations, found[1].flow.populations)
    assert np.array_equal(found[0].velocity, found[1].velocity)


@pytest.mark.slow
def test_a_run_goes_on_from_its_file_to_the_same_bits(one_thread, tmp_path: Path):
    whole = matrix.Kept(prepare(SMALL))
    whole.series.sample(whole.suspension, 10)
    whole.save(tmp_path / "state.npz")
    resumed = matrix.Kept(prepare(SMALL))
    resumed.load(tmp_path / "state.npz")
    for kept in (whole, resumed):
        kept.series.sample(kept.suspension, 10)
    assert np.array_equal(whole.suspension.flow.populations, resumed.suspension.flow.populations)
    assert np.array_equal(whole.suspension.velocity, resumed.suspension.velocity)
    for name, values in whole.series.arrays().items():
        assert np.array_equal(values, resumed.series.arrays()[name]), name


@pytest.mark.slow
def test_a_point_of_the_matrix_is_measured_and_continues(one_thread, tmp_path: Path):
    told: list[str] = []
    first = matrix.run(SMALL, tmp_path, told.append, settle=1.0, until=2.0)
    again = matrix.run(SMALL, tmp_path, told.append, settle=1.0, until=2.0)
    assert first == again and len(told) == 2
    longer = matrix.run(SMALL, tmp_path, told.append, settle=1.0, until=3.0)
    assert len(told) == 3
    assert longer["averaged"] > first["averaged"]
    assert 0.2 < longer["drag_over_tenneti"] < 3.0
    assert len(measured(longer)) == 2
    study.correlations([longer], tmp_path / "correlation.png")
    study.slice_of(stirred(SMALL, 1), tmp_path / "slice.png")
    assert (tmp_path / "slice.png").stat().st_size > 10_000


def test_the_table_holds_runs_of_the_matrix():
    listed = {matrix.name(point) for point in matrix.runs()}
    for row in stored():
        assert matrix.name(Point(**row["point"])) in listed
        assert row["until"] - row["settle"] >= 10.0


@pytest.mark.slow
@pytest.mark.parametrize("part", verification.PARTS, ids=lambda part: part.__name__)
def test_verification_holds(one_thread, part):
    assert [row.quantity for row in part() if row.verdict == "FAILS"] == []


def test_waves_of_the_box_are_taken_out_of_the_granular_temperature():
    random = np.random.default_rng(7)
    phase = random.uniform(0.0, 2.0 * np.pi, (200, 80, 3))
    velocity = random.normal(0.0, 0.1, phase.shape)
    velocity[:, :, 2] += 0.5 * np.sin(phase[:, :, 2] + 1.0)
    found = _box_waves(velocity, phase, 10)
    assert abs(found["temperature_without_waves"][0] / 0.01 - 1.0) < 0.03
    assert abs(found["anisotropy_without_waves"] - 1.0) < 0.05
    assert found["wave_amplitude_along"][0] < 0.3


def test_resistance_of_two_approaching_spheres_has_its_limits():
    # Jeffrey & Onishi (1984), X11 - X12: 1/(2 xi) + 9/20 ln(1/xi) + 1.3456
    gap = 1e-4
    near = 0.5 / gap + 0.45 * math.log(1.0 / gap) + 1.3456
    assert abs(approach_resistance(gap) - near) < 0.01
    far = 1000.0
    assert abs(approach_resistance(far) - 1.0 - 1.5 / (far + 2.0)) < 1e-5


def test_the_film_fades_out_where_the_grid_resolves_the_gap():
    resistances = [unresolved_film(gap, 1.0, 3.0, 2.0) for gap in (1e-3, 0.1, 1.0, 2.0, 3.0)]
    assert all(np.diff(resistances) <= 0.0)
    assert resistances[-2:] == [0.0, 0.0]


def test_means_and_correlations_of_a_known_series():
    time = np.arange(4000)
    wave = np.cos(2 * np.pi * time / 40)[:, None, None] * np.ones((1, 3, 1))
    covariance, scatter = autocovariance(wave)
    assert np.allclose(covariance[[0, 20, 40]], [0.5, -0.5, 0.5], atol=0.01)
    assert np.allclose(scatter, 0.0, atol=1e-12)
    assert np.allclose(averaged(wave, 40), 0.0, atol=1e-12)
    mean, error = block_mean(np.random.default_rng(3).normal(2.0, 1.0, 40000), 10)
    assert abs(mean - 2.0) < 0.02 and abs(error / 0.005 - 1.0) < 0.1


@serial
def _agitate(numbers, long, short, step, path):
    transition = _transition(long, short, step)
    for column in range(path.shape[1]):
        value, rate = numbers[0, column, 0], numbers[0, column, 1]
        for n in range(len(path)):
            value, rate = _advanced(value, rate, transition, numbers[n, column, 0], numbers[n, column, 1])
            path[n, column] = value


def test_the_fit_finds_the_numbers_that_a_run_agitates_with():
    """The force is made by the process of the run itself, so that fit and run mean the same by their numbers."""
    a_d, a_i, tau, step, window, inertia = 0.9, 0.4, 1.3, 0.01, 0.25, 0.7
    path = np.empty((5000, 1500))
    numbers = np.random.default_rng(5).standard_normal((*path.shape, 2))
    _agitate(numbers, (1.0 - SHORT) * tau, SHORT * tau, step, path)
    force = a_d * path[1:] + a_i * inertia * np.diff(path, axis=0) / step
    force = averaged(force, round(window / step))
    lags = np.arange(0, 300, 5)
    covariance = np.array([(force[: len(force) - k] * force[k:]).mean() for k in lags])
    row = {"lag": (lags * step).tolist(), "window": window, "inertia": inertia, "solid_fraction": 0.3, "reynolds": 40.0}
    for way, variance in zip(("along", "across"), fitting.seen_fluctuation(0.3, 40.0)):
        row[f"seen_covariance_{way}"] = (variance * covariance).tolist()
    found = fitting.fit_shares([row])
    assert found.along == pytest.approx(a_d, rel=0.05)
    assert found.across == pytest.approx(found.along, rel=1e-3)
    assert found.inertia == pytest.approx(a_i, rel=0.1)
    assert found.time == pytest.approx(tau, rel=0.05)
