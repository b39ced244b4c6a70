"""The coating scenario: its case, and its numbers from a made-up run."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.backend.communicator import SERIAL
from cfddem.features import liquid
from cfddem.features.spray import SprayZone
from cfddem.plotting.curves import draw_coating, panels
from cfddem.preflight.summary import refuse_errors
from cfddem.run.history import all_columns
from scenarios.beds.coating import bed, coating, distribution

RUN = SimpleNamespace(
    times=np.array([0.0, 0.5]),
    history={
        "time": np.array([0.0, 0.25, 0.5]),
        "agglomerated_share": np.array([0.0, 0.1, 0.2]),
        "spray_residence_time": np.array([np.nan, 0.01, 0.02]),
        "spray_circulation_time": np.array([np.nan, 0.1, 0.2]),
    },
    particles=lambda snapshot: {"liquid_carried": [np.zeros(4), np.array([0.0, 1e-13, 1e-13, 2e-13])][snapshot]},
)


def test_the_case_begins_dry_and_sprays_into_the_column() -> None:
    case = bed()
    refuse_errors(case)
    assert case.liquid is not None and case.spray is not None
    assert case.liquid.thickness is case.liquid.liquid_fraction is None
    sprayed = case.spray.rate * (case.run.until - case.spray.begin)
    solid = case.bed.count * np.pi / 6.0 * case.bed.diameter**3
    assert sprayed / solid == pytest.approx(1e-3, rel=0.02)


def test_the_share_in_the_spray_zone_is_measured_from_the_start() -> None:
    """Drops that begin later do not change where the particles are."""
    case = bed().with_(**{"spray.nozzle": [0.025, 0.005, 0.060]})
    places = np.random.default_rng(1).uniform(0.0, [0.050, 0.010, 0.060], (case.bed.count, 3))
    simulation = SimpleNamespace(communicator=SERIAL, owned=SimpleNamespace(position=places, count=len(places)))
    zone = SprayZone(case, simulation)
    inside = zone.spray.zone(places)
    assert 0 < inside.sum() < case.bed.count
    assert zone.share(simulation) == inside.mean()


def test_the_distribution_of_the_coating_is_measured_and_drawn() -> None:
    """Ten particles with 1 to 10 parts of liquid: deciles over the mean, and a histogram of 100 % of them."""
    carried = 1e-13 * np.arange(1.0, 11.0)
    names = ("coating_at_10_percent", "coating_at_50_percent", "coating_at_90_percent")
    assert set(names) <= set(all_columns(bed()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(liquid, "_carried", lambda solver: carried)
        measures = {each.name: each.value for each in liquid.LiquidOnParticles.measures}
        found = [measures[name](None, SimpleNamespace(particle_solver=None)) for name in names]
    assert found == pytest.approx([1.9 / 5.5, 1.0, 9.1 / 5.5])
    _, axes = panels()
    draw_coating(axes, carried)
    assert sum(each.get_height() for each in axes.patches) == pytest.approx(90.0)  # the last one is beyond 99.5 %


def test_coating_of_a_snapshot() -> None:
    last = coating(RUN)  # type: ignore[arg-type]
    assert (last.time, last.liquid, last.wet_share) == (0.5, 1e-13, 0.75)
    assert last.variation == pytest.approx(np.sqrt(0.5))
    assert (last.joined_share, last.residence_time, last.circulation_time) == (0.2, 0.02, 0.2)
    assert np.isnan(coating(RUN, 0).variation)  # type: ignore[arg-type]
    shares = distribution(RUN, np.array([0.0, 0.5, 1.5, 2.5]))  # type: ignore[arg-type]
    assert shares.tolist() == [0.25, 0.5, 0.25]
