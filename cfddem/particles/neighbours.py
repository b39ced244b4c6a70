"""Who is near whom: the list of pairs that may interact before anything has moved half the skin."""

from __future__ import annotations

import numpy as np

from cfddem.kernels import kernel
from cfddem.particles.pairs import Edges, edges
from cfddem.particles.state import Bodies
from cfddem.particles.walls import Walls


def list_edges(bodies: Bodies, walls: Walls, cutoff_ratio: float, skin: float, record: bool = False) -> Edges:
    """A fresh pair graph of all that is closer than the reach of the film plus a skin.

    cutoff_ratio  reach of a film over the reduced radius; 0 for dry contacts [-]
    skin          allowance for motion until the next list [m]
    record        keep the begin of encounters, for a record of them
    """
    first, second = _pairs(bodies.position, bodies.radius, bodies.inverse_mass, cutoff_ratio, skin)
    particle, wall = _walls(bodies.position, bodies.radius, walls.point, walls.normal, cutoff_ratio, skin)
    return edges(
        np.concatenate([first, particle]), np.concatenate([second, wall]), len(first), len(bodies.radius), record
    )


@kernel
def _pairs(position, radius, inverse_mass, cutoff_ratio, skin):
    """All pairs i < j within reach."""
    first, second = [], []
    for i in range(len(radius)):
        for j in range(i + 1, len(radius)):
            if inverse_mass[i] + inverse_mass[j] == 0.0:
                continue
            touch = radius[i] + radius[j]
            reach = touch + cutoff_ratio * radius[i] * radius[j] / touch + skin
            apart = 0.0
            for axis in range(3):
                apart += (position[i, axis] - position[j, axis]) ** 2
            if apart < reach * reach:
                first.append(i)
                second.append(j)
    return np.array(first, dtype=np.int32), np.array(second, dtype=np.int32)


@kernel
def _walls(position, radius, point, normal, cutoff_ratio, skin):
    """All particles within reach of a wall."""
    first, second = [], []
    for i in range(len(radius)):
        for w in range(len(point)):
            distance = 0.0
            for axis in range(3):
                distance += (position[i, axis] - point[w, axis]) * normal[w, axis]
            if distance < (1.0 + cutoff_ratio) * radius[i] + skin:
                first.append(i)
                second.append(w)
    return np.array(first, dtype=np.int32), np.array(second, dtype=np.int32)
