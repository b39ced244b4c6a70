"""Limits of the particles' time step, from quantities known before a run; nothing is compiled here."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cfddem.backend.errors import UnstableStep
from closures import contact, timescales

STEPS_PER_HERTZ_TIME = 50
"""The default step is 2 % of the Hertz time of the fastest approach."""

STABLE = 1.0
"""A step may be at most this over the largest angular frequency; velocity Verlet breaks at 2."""

CROSSING = 0.1
"""Part of its radius that a particle may move in a step."""


@dataclass(frozen=True)
class TimeScales:
    """Largest time step that each criterion allows [s]; infinite if it sets no limit."""

    hertz: float  # 2 % of the Hertz time at the reference speed
    impact: float  # stability of an impact at the reference speed
    overlap: float  # stability of the contacts that exist
    film: float  # stability of films as explicit forces; films that act by impulses have no limit
    crossing: float  # a particle moves by at most a tenth of its radius in a step

    @property
    def recommended(self) -> float:
        """Recommended step: 2 % of the Hertz time, less where stability requires it [s]."""
        return min(self.hertz, 0.5 * self.limit)

    @property
    def limit(self) -> float:
        """Step above which a run is refused [s]."""
        return min(self.impact, self.overlap, self.film, self.crossing)

    @property
    def limiting(self) -> str:
        """The criterion that sets the limit."""
        return min(("impact", "overlap", "film", "crossing"), key=lambda name: float(getattr(self, name)))


def check_step(step: float, read: TimeScales) -> None:
    """Refuse a step above the limit; the message recommends a step."""
    if step > read.limit:
        raise UnstableStep(step, read.limit, f"{read.limiting} criterion", f"take {read.recommended:.2g} s")


def hertz_steps(reduced_mass: float, reduced_radius: float, modulus: float, speed: float) -> tuple[float, float]:
    """Default step and stability limit of an impact by Hertz [s].

    reduced_mass    m* [kg]
    reduced_radius  R* [m]
    modulus         E* of the contact [Pa]
    speed           of the approach, > 0 [m/s]
    """
    stiffness = contact.hertz_stiffness(modulus, reduced_radius)
    deepest = contact.hertz_largest_overlap(reduced_mass, stiffness, speed)
    return (
        timescales.hertz_time(reduced_mass, stiffness, speed) / STEPS_PER_HERTZ_TIME,
        STABLE * timescales.overlap_period(reduced_mass, stiffness, deepest),
    )


def stiffness_steps(reduced_mass: float, stiffness: float) -> tuple[float, float]:
    """Default step and stability limit of an impact on a spring [s]; infinite without a stiffness.

    reduced_mass  m* [kg]
    stiffness     largest of the impact, normal or tangential [N/m]
    """
    if stiffness <= 0.0:
        return math.inf, math.inf
    swing = math.sqrt(reduced_mass / stiffness)
    return math.pi * swing / STEPS_PER_HERTZ_TIME, STABLE * swing


def crossing_step(radius: float, speed: float) -> float:
    """Step in which the fastest particle crosses a tenth of the smallest radius [s]."""
    return CROSSING * radius / speed if speed > 0.0 else math.inf
