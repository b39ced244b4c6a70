"""The conserved count: a particle that is no number, has left, or was pressed through something ends the run."""

from __future__ import annotations

import numpy as np

from cfddem.errors import RunFailed
from cfddem.particles.pairs import Edges
from cfddem.particles.state import Bodies

CRUSHED = 1.0
"""Overlap over radius at which a sphere's centre is in the surface of the other body: it has gone through."""


def guard(
    bodies: Bodies,
    edges: Edges,
    gap: np.ndarray,
    domain: np.ndarray | None,
    time: float,
    step: float,
    owner: np.ndarray,
) -> None:
    """Stop the run, naming the particle, where one is lost.

    gap     (n,) of every edge [m]
    domain  (2, 3) corners of the room that no centre may leave; None for all of space [m]
    time    [s]
    step    last time step [s]
    owner   wall that each piece of a wall belongs to
    """
    sound = np.isfinite(bodies.position).all(axis=1) & np.isfinite(bodies.velocity).all(axis=1)
    if not sound.all():
        row = int(np.argmin(sound))
        raise RunFailed(
            f"{_place(bodies, row, time, step)} is no number any more; "
            "the step is too large or a force from outside is no number: halve the step, check the forces"
        )
    if domain is not None:
        inside = ((bodies.position >= domain[0]) & (bodies.position <= domain[1])).all(axis=1)
        if not inside.all():
            row = int(np.argmin(inside))
            raise RunFailed(
                f"{_place(bodies, row, time, step)} has left the domain {domain[0]} to {domain[1]} m"
                f"{_last_wall(row, edges, owner)}; close the walls there, enlarge the domain, or take a smaller step"
            )
    if len(gap):
        radius = bodies.radius[edges.first]
        split = edges.between_particles
        radius[:split] = np.minimum(radius[:split], bodies.radius[edges.second[:split]])
        deepest = int(np.argmin(gap / radius))
        if gap[deepest] < -CRUSHED * radius[deepest]:
            row, other = int(edges.first[deepest]), int(edges.second[deepest])
            what = f"particle {bodies.id[other]}" if deepest < split else f"wall {owner[other]}"
            raise RunFailed(
                f"{_place(bodies, row, time, step)} is pressed into {what} by {-gap[deepest] / radius[deepest]:.2g} "
                f"radii (limit {CRUSHED:g}); take a smaller step or a stiffer contact, or start without overlaps"
            )


def _place(bodies: Bodies, row: int, time: float, step: float) -> str:
    x, y, z = bodies.position[row]
    speed = float(np.linalg.norm(bodies.velocity[row]))
    name = f"particle {bodies.id[row]} at ({x:.4g}, {y:.4g}, {z:.4g}) m"
    return f"{name}, t = {time:.6g} s, speed {speed:.3g} m/s, step {step:.3g} s,"


def _last_wall(row: int, edges: Edges, owner: np.ndarray) -> str:
    split = edges.between_particles
    met = edges.second[split:][edges.first[split:] == row]
    return f", last near wall {int(owner[met[0]])}" if len(met) else ""
