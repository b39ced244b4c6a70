"""Force of the particles on the walls."""

from __future__ import annotations

import numpy as np

from cfddem.particles.pair_graph import Edges
from cfddem.particles.walls.nearest_point import Walls


def wall_forces(edges: Edges, walls: Walls) -> np.ndarray:
    """Force of contacts and of the pull of bridges on each wall, without impulses of films (M, 3) [N]."""
    result, at_walls = np.zeros((len(walls.sweep), 3)), slice(edges.between_particles, None)
    wall = walls.wall[edges.second[at_walls]]
    np.subtract.at(result, wall, edges.force[at_walls])
    if "bridge_force" in edges:
        np.subtract.at(result, wall, edges.bridge_force[at_walls])
    return result
