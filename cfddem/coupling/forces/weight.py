"""Weight of every particle less the weight of the fluid that it displaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.coupling.terms import ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce


class Weight(FluidForce):
    """Weight, less buoyancy.

    density  of the fluid [kg/m3]
    gravity  (3,) [m/s2]
    """

    name, lines = "weight", ("weight",)

    def __init__(self, density: float, gravity: Sequence[float] | Array) -> None:
        self.density, self.gravity = density, np.array(gravity, float)

    def act(self, terms: ForceTerms) -> None:
        """The same force in every step; the fluid carries the weight of its own volume."""
        excess_mass = (terms.particles.density - self.density) * terms.particles.volume
        terms.push("weight", np.stack([excess_mass * along for along in self.gravity], axis=1))
