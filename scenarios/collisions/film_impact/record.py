"""Record of an impact: one row per step, and frames at P1 to P4."""

from __future__ import annotations

import math

import numpy as np

from scenarios.collisions.film_impact.result import COLUMNS, Frame, Moment
from scenarios.collisions.film_impact.solver import GridImpact
from scenarios.references.isph.impact import SmoothedImpact


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
