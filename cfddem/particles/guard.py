"""Checks that end a run: a position is NaN, a particle has left the domain, or was pressed through another body."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import serial
from cfddem.backend.errors import RunFailed
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles

EVERYWHERE = ((-math.inf,) * 3, (math.inf,) * 3)

CRUSHED = 1.0
"""Overlap over radius at which the centre of a sphere reaches the surface of the other body."""


def guard(
    particles: Particles,
    edges: Edges,
    gap: np.ndarray | None,
    domain: np.ndarray | None,
    time: float,
    step: float,
    owner: np.ndarray,
    communicator: Communicator = SERIAL,
) -> None:
    """Stop the run, on all ranks, if a particle is lost, and name it.

    gap     (n,) of every edge [m]; None skips the check of overlaps
    domain  (2, 3) opposite corners of the region that no centre may leave; None if unlimited [m]
    time    [s]
    step    last time step [s]
    owner   wall that each piece of a wall belongs to
    """
    if failure := communicator.first(_failure(particles, edges, gap, domain, time, step, owner)):
        raise RunFailed(failure)


def _failure(
    particles: Particles,
    edges: Edges,
    gap: np.ndarray | None,
    domain: np.ndarray | None,
    time: float,
    step: float,
    owner: np.ndarray,
) -> str | None:
    """What has happened to a particle of this rank; None if none is lost."""
    own = slice(particles.owned)
    allowed = np.array(EVERYWHERE) if domain is None else domain
    lost, gone = _first_lost(particles.position[own], particles.velocity[own], allowed)
    if lost >= 0:
        return (
            f"{_place(particles, lost, time, step)} is NaN; "
            "the step is too large or an applied force is NaN: halve the step, check the forces"
        )
    if gone >= 0 and domain is not None:
        return (
            f"{_place(particles, gone, time, step)} has left the domain {domain[0]} to {domain[1]} m"
            f"{_last_wall(gone, edges, owner)}; close the walls there, enlarge the domain, or take a smaller step"
        )
    if gap is None:
        return None
    split = edges.between_particles
    deepest, overlap = _deepest(gap, edges.first, edges.second, split, particles.radius)
    if overlap > CRUSHED:
        row, other = int(edges.first[deepest]), int(edges.second[deepest])
        obstacle = f"particle {particles.id[other]}" if deepest < split else f"wall {owner[other]}"
        return (
            f"{_place(particles, row, time, step)} is pressed into {obstacle} by {overlap:.2g} "
            f"radii (limit {CRUSHED:g}); take a smaller step or a stiffer contact, or start without overlaps"
        )
    return None


@serial
def _first_lost(position, velocity, domain):
    """First row that is NaN, and first row outside the domain; -1 if there is none."""
    lost, gone = -1, -1
    for n in range(len(position)):
        for d in range(3):
            if lost < 0 and not (math.isfinite(position[n, d]) and math.isfinite(velocity[n, d])):
                lost = n
            if gone < 0 and not domain[0, d] <= position[n, d] <= domain[1, d]:
                gone = n
    return lost, gone


@serial
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


def _place(particles: Particles, row: int, time: float, step: float) -> str:
    x, y, z = particles.position[row]
    speed = math.hypot(*particles.velocity[row])
    name = f"particle {particles.id[row]} at ({x:.4g}, {y:.4g}, {z:.4g}) m"
    return f"{name}, t = {time:.6g} s, speed {speed:.3g} m/s, step {step:.3g} s,"


def _last_wall(row: int, edges: Edges, owner: np.ndarray) -> str:
    split = edges.between_particles
    near = edges.second[split:][edges.first[split:] == row]
    return f", last near wall {int(owner[near[0]])}" if len(near) else ""
