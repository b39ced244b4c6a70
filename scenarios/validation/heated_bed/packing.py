"""The packing of the heated bed: poured from the side, closed with a lid, and turned upright.

`python -m scenarios.validation.heated_bed.packing FILE` makes `scenarios/data/heated_bed_8849.npz` anew, in minutes.
The box was filled from the side: z is up while it is filled. Friction is low in this part, 0.2, which gives the
measured porosity of 42 %; with the friction of the inputs, 0.7, a slow filling is too loose. A lid comes down and
levels the surface at the height of that porosity. Then gravity acts along -x, with the friction of the inputs.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from cfddem import Material, ParticleSolver, Plane, make_particles, pair_table
from cfddem.case.schema import Case
from cfddem.particles.interactions.laws import Laws
from cfddem.run.simulation import Simulation

COUNT, DIAMETER, DENSITY = 8849, 6.4e-3, 7747.0
LENGTH, DEPTH, HEIGHT = 0.2, 0.1, 0.1047
"""Of the closed box along x, y and z; the porosity is 42 % [m]."""

LID_SPEED, AT_REST = 0.05, 0.3
"""Speed of the lid [m/s], and time in which the bed comes to rest after it was turned [s]."""

STEEL = {"density": DENSITY, "youngs_modulus": 200e9, "contact_modulus": 50e6, "poisson": 0.29, "restitution": 0.8}
PLATE = {"density": 2700.0, "youngs_modulus": 100e9, "contact_modulus": 50e6, "poisson": 0.33, "restitution": 0.8}
"""Steel spheres and walls; 50 MPa in contacts, as in the example of lethe."""


def _solids(friction: float) -> list[Material]:
    return [Material(**each, friction=friction, rolling_friction=0.02) for each in (STEEL, PLATE)]


def poured() -> np.ndarray:
    """Places of the spheres after filling (N, 3) [m]."""
    case = Case(
        material={"steel": STEEL | {"friction": 0.2}, "plate": PLATE | {"friction": 0.2}},
        column={"width": LENGTH, "depth": DEPTH, "height": 0.25, "cell": 0.02, "material": "plate"},
        bed={"material": "steel", "diameter": DIAMETER, "count": COUNT},
        run={"until": 1.0, "reference_speed": 0.5},
    )  # type: ignore[arg-type]  # tables as mappings
    return np.asarray(Simulation(case).particles.position)


def _walls(lid: float, speed: float) -> list[Plane]:
    """The box, with a lid at a height [m] that comes down with a speed [m/s]."""
    return [
        Plane(material=1),
        Plane(point=(0.0, 0.0, lid), normal=(0.0, 0.0, -1.0), velocity=(0.0, 0.0, -speed), material=1),
        Plane(normal=(1.0, 0.0, 0.0), material=1),
        Plane(point=(LENGTH, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), material=1),
        Plane(normal=(0.0, 1.0, 0.0), material=1),
        Plane(point=(0.0, DEPTH, 0.0), normal=(0.0, -1.0, 0.0), material=1),
    ]


def closed_and_turned(place: np.ndarray) -> np.ndarray:
    """Places in the closed box, at rest under gravity along -x (N, 3) [m]."""
    top = float(place[:, 2].max()) + 0.5 * DIAMETER + 1e-5  # local: one process
    spheres = make_particles(place, 0.5 * DIAMETER, DENSITY)
    walls = _walls(top, LID_SPEED)
    lying = ParticleSolver(spheres, pair_table(_solids(0.2)), walls=walls, gravity=(0.0, 0.0, -9.81))
    step = lying.recommended_step(0.3)
    steps = math.ceil((top - HEIGHT) / LID_SPEED / step)
    lying.advance((top - HEIGHT) / LID_SPEED / steps, steps)
    upright = ParticleSolver(
        make_particles(lying.particles.position, 0.5 * DIAMETER, DENSITY), pair_table(_solids(0.7)),
        walls=_walls(HEIGHT, 0.0), laws=Laws(rolling="constant_torque"), gravity=(-9.81, 0.0, 0.0),
    )  # fmt: skip
    upright.advance(step, round(AT_REST / step))
    return np.asarray(upright.particles.position)


if __name__ == "__main__":
    np.savez_compressed(sys.argv[1], position=closed_and_turned(poured()))
