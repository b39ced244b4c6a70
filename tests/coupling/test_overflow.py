"""A fluidised bed that a feed fills and a weir in the side of its vessel empties: holdup, balances, residence times."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from cfddem.case.schema import Case
from cfddem.fluid import budgets
from cfddem.fluid.cut_cells import open_share
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

TEXT = """
[fluid]                        # water
density = 1000.0
viscosity = 1.0e-3

[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 1.0e5
poisson = 0.23
friction = 0.4

[column]
width = 0.02
height = 0.04
cell = 0.005

[vessel]
shape = "cylinder"

[patch.weir]
kind = "outlet"
side = "x_high"
shape = "box"
centre = [0.01, 0.017]
size = [0.012, 0.012]
particles = "leave"

[bed]
diameter = 2.0e-3
count = 400
start = "suspended"
inlet_velocity = 0.06

[[feed]]
corner = [0.003, 0.006, 0.030]
size = [0.005, 0.008, 0.006]
rate = 800.0

[laws]
lubrication = "none"

[run]
until = 5.0
"""
RATE, SILL, BEGIN, END = 800.0, 0.011, 3.0, 5.0
"""Feed [1/s], lower edge of the weir [m], and the time over which the bed is steady [s]."""
OFTEN = 20
"""Steps from one look at the balances to the next."""

VOLUME = math.pi / 6.0 * 2e-3**3


@dataclass
class Overflow:
    """What was seen in each step of a run."""

    simulation: Simulation
    time: list[float] = field(default_factory=list)  # at the end of a step [s]
    count: list[int] = field(default_factory=list)  # of particles
    entered: dict[int, float] = field(default_factory=dict)  # id -> time [s]
    left: dict[int, float] = field(default_factory=dict)
    last_seen: list[np.ndarray] = field(default_factory=list)  # place and velocity of those that left, before the step
    momentum: list[float] = field(default_factory=list)  # imbalances of the history
    volume: list[float] = field(default_factory=list)
    fluid: list[float] = field(default_factory=list)  # flow in, less that out, less what is kept, over the flow in
    solids: list[float] = field(default_factory=list)  # volume of particles that the fluid lacks over their own, less 1


def watched(until: float) -> Overflow:
    """Run the case and note who is there, step by step, by ids: no counter of feeds and outlets is read."""
    simulation = Simulation(Case.from_text(TEXT, "c.toml"))
    seen, fluid = Overflow(simulation), simulation.fluid
    held = open_share(fluid.grid) * fluid.grid.cell_volume
    before = set(simulation.particles.id.tolist())
    while simulation.time < until:
        particles = simulation.particles
        places = {
            int(name): np.concatenate([at, velocity])
            for name, at, velocity in zip(particles.id, particles.position, particles.velocity)
        }
        simulation.step()
        now = set(simulation.particles.id.tolist())
        seen.entered |= dict.fromkeys(now - before, simulation.time)
        seen.left |= dict.fromkeys(before - now, simulation.time)
        seen.last_seen += [places[name] for name in sorted(before - now)]
        before = now
        seen.time.append(simulation.time)
        seen.count.append(len(now))
        if len(seen.time) % OFTEN:
            continue
        found, kept = row(simulation), budgets.continuity_residual(fluid)
        seen.momentum.append(found["momentum_imbalance"])
        seen.volume.append(found["volume_imbalance"])
        x, z = fluid.volume_flux(0)[:, :, -1].sum(), fluid.volume_flux(2)[[0, -1]].sum(axis=(1, 2))
        flows = np.array([z[0], -z[1], -x]) * fluid.face_areas[0]
        stored = (fluid.fields.owned("voidage_rate") * held).sum()
        seen.fluid.append(abs(flows.sum() - stored) / flows[0])
        assert np.abs(kept).max() < 1e-6 * flows[0]
        lacking = ((1.0 - fluid.voidage) * held).sum()
        seen.solids.append(lacking / (len(now) * VOLUME) - 1.0)
    return seen


@pytest.fixture(scope="module")
def overflow() -> Overflow:
    """The run, once for all tests."""
    return watched(END)


@pytest.mark.slow
def test_every_particle_that_enters_is_there_or_was_last_seen_before_the_weir(overflow: Overflow) -> None:
    """By their ids alone: those there at the end are those of the start and those that came, less those that left."""
    particles, found = overflow.simulation.particles, row(overflow.simulation)
    came, left = set(overflow.entered), set(overflow.left)
    start = set(particles.id.tolist()) | left
    assert len(start - came) == 400 and not left - start
    assert set(particles.id.tolist()) == (set(range(400)) | came) - left
    assert len(came) == found["fed_count"] and len(left) == found["removed_count"] > 500
    assert abs(len(came) - RATE * END) <= 1.0 + found["waiting_count"]
    place, velocity = np.hsplit(np.array(overflow.last_seen), 2)
    ahead = place + 2e-3 * velocity  # a step later
    away = np.hypot(ahead[:, 0] - 0.01, ahead[:, 1] - 0.01)
    print(f"{len(left)} left, from z = {place[:, 2].min():.4f} m, off the axis by {away.min():.4f} m at least")
    assert (place[:, 2] > SILL).all() and (np.abs(place[:, 1] - 0.01) < 0.006).all() and (place[:, 0] > 0.01).all()
    assert away.min() > 0.009 - 1e-3


@pytest.mark.slow
def test_volume_and_momentum_are_kept_while_a_bed_overflows(overflow: Overflow) -> None:
    """Fluid in less fluid out is what the cells keep, to the tolerance of the pressure; its voidage lacks what the
    particles take; each particle gets what the fluid gives."""
    fluid, solids, momentum = max(overflow.fluid), max(map(abs, overflow.solids)), max(overflow.momentum)
    print(f"fluid {fluid:.2g} of the flow, solids {solids:.2g} of their volume, momentum {momentum:.2g}")
    assert fluid < 1e-7 and solids < 1e-9 and momentum < 1e-12 and max(overflow.volume) < 1e-8


@pytest.mark.slow
def test_the_times_in_the_bed_add_up_to_its_holdup(overflow: Overflow) -> None:
    """Little's law, by ids: the integral of the count is the sum of all stays, also of those that are not over.

    The history's mean stay is that of the ids. Most of the steady holdup takes part: the stays of those that leave,
    times their rate, are most of it; what stays longer than the window is the rest.
    """
    found, time, count = row(overflow.simulation), np.array(overflow.time), np.array(overflow.count)
    stays = {name: at - overflow.entered.get(name, 0.0) for name, at in overflow.left.items()}
    there = [time[-1] - overflow.entered.get(name, 0.0) for name in overflow.simulation.particles.id.tolist()]
    fed = [stay for name, stay in stays.items() if name in overflow.entered]
    held = float((count * np.diff(time, prepend=0.0)).sum())
    assert held == pytest.approx(sum(stays.values()) + sum(there), rel=2e-3)
    assert found["residence_time"] == pytest.approx(np.mean(fed), rel=0.02)
    steady = time > BEGIN
    halves = [count[steady & (time <= 0.5 * (BEGIN + END))].mean(), count[time > 0.5 * (BEGIN + END)].mean()]
    late = [stays[name] for name, at in overflow.left.items() if at > BEGIN]
    rate, holdup = len(late) / (END - BEGIN), count[steady].mean()
    part = np.mean(late) * rate / holdup
    print(f"holdup {holdup:.1f} ({halves[0]:.1f}, {halves[1]:.1f}); {rate:.1f} 1/s leave after {np.mean(late):.3f} s: "
          f"{part:.3f} of the holdup; history {found['residence_time']:.3f} s, ids {np.mean(fed):.3f} s")  # fmt: skip
    assert halves[1] == pytest.approx(halves[0], rel=0.05) and rate == pytest.approx(RATE, rel=0.03)
    assert 0.8 < part <= 1.0
