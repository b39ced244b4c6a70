"""The conserved count: a particle that is no number, has left, or was pressed through something ends the run."""

from __future__ import annotations

import math

import numpy as np

from cfddem.errors import RunFailed
from cfddem.kernels import kernel
from cfddem.particles.pairs import Edges
from cfddem.particles.state import Bodies

EVERYWHERE = ((-math.inf,) * 3, (math.inf,) * 3)

CRUSHED = 1.0
"""Overlap over radius at which a sphere's centre is in the surface of the other body: it has gone through."""


def guard(
    bodies: Bodies,
    edges: Edges,
    gap: np.ndarray | None,
    domain: np.ndarray | None,
    time: float,
    step: float,
    owner: np.ndarray,
) -> None:
    """Stop the run, naming the particle, where one is lost.

    gap     (n,) of every edge [m]; None leaves out who was pressed through whom
    domain  (2, 3) corners of the room that no centre may leave; None for all of space [m]
    time    [s]
    step    last time step [s]
    owner   wall that each piece of a wall belongs to
    """
    lost, gone = _first_lost(bodies.position, bodies.velocity, np.array(EVERYWHERE) if domain is None else domain)
    if lost >= 0:
        raise RunFailed(
            f"{_place(bodies, lost, time, step)} is no number any more; "
            "the step is too large or a force from outside is no number: halve the step, check the forces"
        )
    if gone >= 0 and domain is not None:
        raise RunFailed(
            f"{_place(bodies, gone, time, step)} has left the domain {domain[0]} to {domain[1]} m"
            f"{_last_wall(gone, edges, owner)}; close the walls there, enlarge the domain, or take a smaller step"
        )
    if gap is None:
        return
    split = edges.between_particles
    deepest, overlap = _deepest(gap, edges.first, edges.second, split, bodies.radius)
    if overlap > CRUSHED:
        row, other = int(edges.first[deepest]), int(edges.second[deepest])
        what = f"particle {bodies.id[other]}" if deepest < split else f"wall {owner[other]}"
        raise RunFailed(
            f"{_place(bodies, row, time, step)} is pressed into {what} by {overlap:.2g} "
            f"radii (limit {CRUSHED:g}); take a smaller step or a stiffer contact, or start without overlaps"
        )


@kernel
def _first_lost(position, velocity, domain):
    """First row that is no number, and first that is outside; -1 where none is."""
    lost, gone = -1, -1
    for n in range(len(position)):
        for d in range(3):
            if lost < 0 and not (math.isfinite(position[n, d]) and math.isfinite(velocity[n, d])):
                lost = n
            if gone < 0 and not domain[0, d] <= position[n, d] <= domain[1, d]:
                gone = n
    return lost, gone


@kernel
def _deepest(gap, first, second, between_particles, radius):
    """The edge of the largest overlap over the smaller radius, and that."""
    deepest, largest = 0, -math.inf
    for k in range(len(gap)):
        smaller = radius[first[k]]
        if k < between_particles:
            smaller = min(smaller, radius[second[k]])
        if -gap[k] > largest * smaller:
            deepest, largest = k, -gap[k] / smaller
    return deepest, largest


def _place(bodies: Bodies, row: int, time: float, step: float) -> str:
    x, y, z = bodies.position[row]
    speed = float(np.linalg.norm(bodies.velocity[row]))
    name = f"particle {bodies.id[row]} at ({x:.4g}, {y:.4g}, {z:.4g}) m"
    return f"{name}, t = {time:.6g} s, speed {speed:.3g} m/s, step {step:.3g} s,"


def _last_wall(row: int, edges: Edges, owner: np.ndarray) -> str:
    split = edges.between_particles
    met = edges.second[split:][edges.first[split:] == row]
    return f", last near wall {int(owner[met[0]])}" if len(met) else ""
