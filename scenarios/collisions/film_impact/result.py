"""Result of a film impact."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from closures.restitution import singh_crossover
from scenarios.collisions.results import plain


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

    outcome: str  # "rebound" or "stick"
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
        names = [name for name in self.__dataclass_fields__ if name not in ("history", "frames")]
        moments = {name: getattr(self, name)._asdict() for name in ("p1", "p2", "p3", "p4")}
        return {name: plain(moments.get(name, getattr(self, name))) for name in names}


ENERGIES = ("liquid_kinetic", "liquid_potential", "contact", "viscous", "impulsive", "exchange", "voids", "surface")
"""Where the energy of the bead goes: what the liquid has at the end, the dry contact, viscous stress, sudden changes of
the flow (above all at contact), and what particles and grid lose in exchange, an error of the method; the voids
of a liquid that cavitates; and the surface of one with surface tension."""

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
