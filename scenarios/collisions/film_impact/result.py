"""Result of a film impact."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from cfddem.backend.json_text import summary_of
from closures.restitution import singh_crossover
from scenarios.collisions.film_impact.solver import GridImpact
from scenarios.references.isph.impact import SmoothedImpact


class Moment(NamedTuple):
    """One of the moments P1 to P4 of the paper."""

    time: float  # since the bead met the film [s]
    velocity: float  # of the bead, positive upwards [m/s]


class Frame(NamedTuple):
    """Liquid and bead at one moment, for pictures."""

    time: float  # [s]
    gap: float  # height of the lowest point of the bead [m]
    particles: np.ndarray  # radius and height of the liquid particles (n, 2) [m]
    pressure: np.ndarray  # in the cells (radial, vertical) [Pa]
    liquid: np.ndarray  # whether a cell is liquid (radial, vertical)
    dx: float  # width of a cell [m]


@dataclass(frozen=True)
class FilmImpact:
    """Result of an impact. Speeds are those of the bead where its lowest point passes the undisturbed surface."""

    outcome: Literal["rebound", "stick"]
    restitution: float  # speed out over speed in; 0 where the bead sticks [-]
    stokes: float  # rho_p D v/(9 eta); infinite without viscosity [-]
    film_ratio: float  # gamma, depth of the film over the diameter [-]
    added_mass: float  # mu, of the wetted film over the mass of the bead at contact [-]
    minimum_gap: float  # at which the solids touch [m]
    p1: Moment  # the bead meets the film
    p2: Moment  # before it strikes the plate
    p3: Moment  # after
    p4: Moment  # it passes the undisturbed surface again
    turned_speed: float  # of the bead once the liquid has turned with it, just after P3 [m/s]
    turning_energy: tuple[float, float]  # of the liquid, least while it turns, and after, over that before [-]
    fastest: float  # largest speed towards the plate [m/s]
    energies: dict[str, float]  # over the kinetic energy of the bead at P1; see below
    ledger_error: float  # the loss of the bead that the energies leave unexplained, over the same [-]
    volume_error: float  # liquid where there is no room for it, over all [-]
    momentum_error: float  # impulse on the bead against that on liquid and plate at P4, over the first [-]
    lowest_pressure: float  # on the plate after the contact, from 1 us after it [Pa]
    highest_pressure: float  # on the plate before the contact [Pa]
    wetted_radius: float  # at contact [m]
    mass_carried: float  # liquid that rises at P4 with more than half the speed of the bead [kg]
    contacts: int
    steps: int
    cells: int  # in the depth of the film
    seconds: float  # processor time of the computation
    warnings: tuple[str, ...]
    history: dict[str, np.ndarray] = field(repr=False)  # columns of COLUMNS
    frames: dict[str, Frame] = field(repr=False)  # at P1 to P4

    @property
    def regime(self) -> int:
        """Regime of the paper: 2 above the Stokes number at which the branches of its fit meet, 1 below."""
        return 2 if self.stokes > singh_crossover(self.film_ratio) else 1

    def summary(self) -> dict[str, Any]:
        """The result without histories and frames, ready for JSON."""
        return summary_of(self)


ENERGIES = ("liquid_kinetic", "liquid_potential", "contact", "viscous", "impulsive", "exchange", "voids", "surface")
"""Where the energy of the bead goes, in this order.

It goes to what the liquid has at the end, the dry contact, viscous stress, and sudden changes of the flow (above all at
contact). Particles and grid lose some in exchange, an error of the method. The last two are the voids of a liquid that
cavitates, and the surface of one with surface tension.
"""

COLUMNS = {
    "time": "s",
    "gap": "m",
    "velocity": "m/s",
    "force": "N",
    "plate_force": "N",
    "pressure_axis": "Pa",
    "pressure_low": "Pa",
    "pressure_high": "Pa",
    "wetted_radius": "m",
    "liquid_kinetic": "J",
    "liquid_potential": "J",
    "contact": "J",
    "viscous": "J",
    "impulsive": "J",
    "exchange": "J",
    "voids": "J",
    "surface": "J",
}
"""Columns of the history: pressures are on the plate, energies are those of the liquid and those lost so far."""


# ---------------------------------------------------------------- record


class Record:
    """Rows and frames of one impact."""

    def __init__(self, impact: GridImpact | SmoothedImpact) -> None:
        self.impact = impact
        self.rows: list[tuple[float, ...]] = []
        self.frames: dict[str, Frame] = {}
        self.p1 = Moment(0.0, impact.bead.velocity)
        self.p2 = self.p3 = self.p4 = Moment(math.nan, math.nan)
        self.turned = math.nan
        self.rest = impact.liquid_energy()[1]  # potential energy of the layer at rest

    def add(self, contacts_before: int, velocity_before: float) -> None:
        """Write down a step, and the moments it has passed."""
        impact, bead = self.impact, self.impact.bead
        kinetic, potential, _ = impact.liquid_energy()
        plate, losses = impact.solved.pressure[:, 0], impact.losses
        touched = impact.contacts > contacts_before
        if impact.steps == 1:
            self.frames["P1"] = self.frame()
        if touched and impact.contacts == 1:
            speed = abs(bead.velocity) / impact.restitution
            self.p2, self.p3 = Moment(impact.time, -speed), Moment(impact.time, bead.velocity)
            self.frames["P2"] = self.frame()
        elif impact.contacts == 1 and "P3" not in self.frames:
            self.turned, self.frames["P3"] = bead.velocity, self.frame()
        velocity = -abs(bead.velocity) / impact.restitution if touched else bead.velocity
        motion = (impact.time, bead.gap, velocity, bead.force, impact.solved.plate)
        pressures = (plate[0], plate.min(), plate.max(), impact.wetted * impact.grid.dx)
        lost = (losses.contact, losses.viscous, losses.impulsive, losses.exchange, losses.voids, losses.surface)
        self.rows.append((*motion, *pressures, kinetic, potential - self.rest, *lost))

    def leave(self, height: float) -> None:
        """The bead has passed the undisturbed surface; the moment lies within the last step."""
        (time, gap, velocity), (time_0, gap_0, velocity_0) = self.rows[-1][:3], self.rows[-2][:3]
        share = (height - gap_0) / (gap - gap_0)
        self.p4 = Moment(time_0 + share * (time - time_0), velocity_0 + share * (velocity - velocity_0))
        self.frames["P4"] = self.frame()

    def frame(self) -> Frame:
        """Liquid and bead now."""
        impact = self.impact
        particles = impact.particles[:, :2].astype(np.float32)
        solved = impact.solved.pressure.astype(np.float32)
        return Frame(impact.time, impact.bead.gap, particles, solved, impact.liquid.copy(), impact.grid.dx)

    def history(self) -> dict[str, np.ndarray]:
        """The rows as columns."""
        return dict(zip(COLUMNS, np.array(self.rows).T))
