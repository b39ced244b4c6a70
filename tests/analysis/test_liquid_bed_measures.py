"""Measures of liquid beds, on data whose answer is known: a travelling wave, a random walk, a Maxwellian gas."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from command_line import call, parsed
from disturbed_runs import TINY
from example_case import TEXT

from cfddem import open_run
from cfddem.analysis.fluctuations import dispersion, impacts, maxwellian_impact_speed, spreading
from cfddem.analysis.layers import LayerMap, waves
from cfddem.analysis.measures import cells_of, granular_temperature, layer_solid_fraction
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.plotting.study_figures import wave_map
from cfddem.run.history import collisional_pressure, floor_pressure
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation


@pytest.mark.parametrize("speed", [0.1, -0.04])
@pytest.mark.parametrize("length", [0.03, 0.05])
def test_a_travelling_wave_is_found(speed: float, length: float) -> None:
    """Wavelength and speed within 5 %, amplitude within 10 %, growth within 2 %, over a profile that rests."""
    time, height, growth, amplitude = np.arange(0.0, 5.0, 0.02), np.arange(0.004, 0.2, 0.008), 0.2, 0.03
    number = 2.0 * math.pi / length
    wave = np.cos(number * (height[None] - speed * time[:, None])) * np.exp(growth * time[:, None])
    noise = np.random.default_rng(1).normal(0.0, 0.002, wave.shape)
    found = waves(LayerMap(time, height, 0.4 - height + amplitude * wave + noise), 0.0, 0.2)
    assert found.wavelength == pytest.approx(length, rel=0.05) and found.speed == pytest.approx(speed, rel=0.05)
    mean_square = float(np.mean(np.exp(2.0 * growth * time)))
    assert found.amplitude == pytest.approx(amplitude * math.sqrt(mean_square), rel=0.1)
    assert found.growth == pytest.approx(growth, rel=0.02, abs=0.02)
    assert found.deviation == pytest.approx(found.amplitude / math.sqrt(2.0), rel=0.1)


def test_too_short_a_map_has_no_waves() -> None:
    found = waves(LayerMap(np.arange(3.0), np.arange(5.0), np.ones((3, 5))), 0.0, 4.0)
    assert math.isnan(found.speed) and math.isnan(found.wavelength)
    with pytest.raises(InputError, match="low"):
        waves(LayerMap(np.arange(9.0), np.arange(5.0), np.ones((9, 5))), 1.0, 1.0)


def test_layers_hold_the_volume_of_the_spheres() -> None:
    """Spheres of three sizes, some larger than a layer; no volume is lost or counted twice."""
    draw = np.random.default_rng(2)
    radius = draw.choice([0.5e-3, 2e-3, 7e-3], 300)
    position = draw.uniform(0.02, 0.18, (300, 3))
    edges = np.linspace(0.0, 0.2, 41)
    layers = layer_solid_fraction(position, radius, edges, 0.04)
    assert layers.sum() * 0.04 * 0.005 == pytest.approx((4.0 / 3.0 * np.pi * radius**3).sum(), rel=1e-12)
    assert (layers >= 0.0).all()


def test_a_random_walk_has_its_coefficient_of_dispersion() -> None:
    """Within 5 %, by direction, across periodic sides, and without the drift of the mean."""
    draw, wanted, step = np.random.default_rng(3), np.array([1e-5, 2e-5, 5e-6]), 0.01
    moves = draw.normal(0.0, 1.0, (200, 400, 3)) * np.sqrt(2.0 * wanted * step) + np.array([1e-4, 0.0, 0.0])
    position = (5.0 + np.cumsum(moves, axis=0)) % np.array([0.02, 0.02, 10.0])
    found = dispersion(spreading(np.arange(200) * step, position, (0.02, 0.02, None)), after=0.02)
    assert found == pytest.approx(wanted, rel=0.05)


def test_velocity_fluctuations_by_direction_and_height() -> None:
    """Deviations of 1, 2, 3 in the lower half and twice that in the upper half, on a mean flow that varies by cell."""
    draw = np.random.default_rng(4)
    position = draw.uniform(0.0, 1.0, (40_000, 3))
    upper = position[:, 2] > 0.5
    velocity = draw.normal(0.0, 1.0, position.shape) * np.array([1.0, 2.0, 3.0]) * np.where(upper, 2.0, 1.0)[:, None]
    velocity += np.floor(4.0 * position[:, [0]])
    found = granular_temperature(velocity, cells_of(position, (4, 4, 4), (0.25, 0.25, 0.25)))
    squares = np.array([1.0, 4.0, 9.0])
    assert found.layers == pytest.approx(np.outer([1.0, 1.0, 4.0, 4.0], squares), rel=0.05)
    assert found.components == pytest.approx(2.5 * squares, rel=0.03)
    assert found.mean == pytest.approx(found.components.mean(), rel=1e-12)


def test_collisions_of_a_maxwellian_gas() -> None:
    """Rate, mean speed and distribution of recorded collisions; walls and other times are left out."""
    temperature, count = 4e-3, 50_000
    draw = np.random.default_rng(5)
    speed = np.sqrt(4.0 * temperature * draw.exponential(1.0, count))
    record = {
        "end": draw.uniform(0.0, 2.0, count), "second": np.where(np.arange(count) % 10 == 0, -1.0, 7.0),
        "approach_speed": speed, "weight": np.full(count, 2.0), "stokes": np.full(count, 3.0),
        "closest_gap": np.where(np.arange(count) % 10 < 5, 1e-7, 2e-6), "minimum_gap": np.full(count, 1e-6),
    }  # fmt: skip
    found = impacts(record, 1.0, 2.0, particles=1000)
    assert found.rate == pytest.approx(2.0 * 2.0 * 0.9 * 0.5 * count / 1000, rel=0.03)
    assert found.contact_rate == pytest.approx(4.0 / 9.0 * found.rate, rel=0.03)
    assert found.mean_speed == pytest.approx(math.sqrt(math.pi * temperature), rel=0.02)
    middle = 0.5 * (found.edges[1:] + found.edges[:-1])
    expected = maxwellian_impact_speed(middle, temperature)
    assert np.abs(found.density - expected).max() < 0.06 * expected.max()
    assert impacts({}, 0.0, 1.0, particles=10).rate == 0.0


def test_a_liquid_bed_reports_its_motion(tmp_path: Path) -> None:
    """Columns, lines of the report and the picture of a short run."""
    case = Case.from_text(TINY)
    Run.begin(case, tmp_path / "run").go()
    run = open_run(tmp_path / "run")
    history = run.history
    along, across = history["granular_temperature_along"], history["granular_temperature_across"]
    assert history["granular_temperature"] == pytest.approx((along + 2.0 * across) / 3.0, rel=1e-12)
    assert history["floor_pressure"].min() >= 0.0 and history["collisional_pressure"].max() > 0.0
    result = report(tmp_path / "run")
    found = result.impacts
    assert found["rate"] >= found["contact_rate"] >= 0.0
    assert "collisions of a particle" in "\n".join(lines(result))
    picture = wave_map(tmp_path / "run", tmp_path / "waves.png")
    assert picture.stat().st_size > 10_000


def test_contacts_at_rest_carry_the_weight() -> None:
    """A column of spheres at rest in still water: each contact carries the buoyant weight of the spheres above."""
    changes = {"bed.start": "placed", "bed.inlet_velocity": 0.0, "laws.lubrication": "none", "run.until": 1.0}
    text = TINY.replace("count = 160\n", "").replace("restitution = 0.9", "restitution = 0.2")
    places = [[0.006, 0.006, 1e-3 * (2 * k + 1)] for k in range(6)]
    simulation = Simulation(Case.from_text(text, "case", {**changes, "bed.positions": places}))
    simulation.until(0.1)
    weight = float(simulation.particles.volume[0]) * 1500.0 * 9.81
    area = 0.012**2
    assert floor_pressure(simulation) == pytest.approx(6.0 * weight / area, rel=0.02)
    expected = sum(range(1, 6)) * weight * 2e-3 / (3.0 * area * 0.99 * 0.012)
    assert collisional_pressure(simulation) == pytest.approx(expected, rel=0.03)


def test_stability_of_a_case_is_shown(tmp_path: Path) -> None:
    """Alumina of 3.087 mm in water breaks up into waves of 31 mm; agitation lowers their growth."""
    case = tmp_path / "alumina.toml"
    case.write_text(TEXT)
    done = call("stability", str(case), "--plot", str(tmp_path / "growth.png"))
    assert done.code == 0 and "breaks up into plugs" in done.out, done.out + done.err
    assert (tmp_path / "growth.png").stat().st_size > 10_000
    plain, agitated = (
        parsed(call("stability", str(case), "--json", "--set", f"agitation={law}").out)
        for law in ("none", "pseudo_turbulence")
    )
    assert plain["granular_temperature"] == 0.0 < agitated["granular_temperature"]
    assert agitated["fastest"]["growth"] < 0.8 * plain["fastest"]["growth"]
    assert plain["fastest"]["wavelength"] == pytest.approx(0.033, abs=0.003)
    assert all(wave["on_cells"] == wave["growth"] for wave in plain["waves"])  # no damping with sharp surfaces
    smeared = parsed(call("stability", str(case), "--json", "--set", "surface=smeared").out)
    assert all(wave["on_cells"] < wave["growth"] for wave in smeared["waves"] if wave["speed"] > 0.0)
    assert smeared["fastest"]["wavelength"] != plain["fastest"]["wavelength"]
    done = call("stability", "packed-bed")
    assert done.code == 2 and "a fluidised liquid bed" in done.err
