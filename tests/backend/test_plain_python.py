"""The compiled pair loop against the same source run by the Python interpreter."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SYSTEM = """
import sys
import numpy as np
from numba import config
from cfddem.case.materials import Material
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import CHOICES, Laws
from cfddem.particles.initial.packing import lattice
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.particles.solver import ParticleSolver

film, integrator, onset, spring, contact, plain, path = *(int(word) for word in sys.argv[1:7]), sys.argv[7]
words = zip(("integrator", "friction_onset", "spring"), (integrator, onset, spring))
assert bool(config.DISABLE_JIT) == bool(plain)
glass = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.7, friction=0.4, roughness=2e-6,
                 friction_lubricated=0.1)
draw = np.random.default_rng(2)
places = lattice(1e-3, ((0, 0, 0), (4.0e-3, 4.0e-3, 3.0e-3)), 1.0)
places = places + draw.uniform(-2e-5, 2e-5, places.shape)
size = 0.5e-3 * draw.uniform(0.97, 1.03, len(places))
spheres = make_particles(places, size, 2500.0, velocity=draw.normal(0, 0.05, places.shape),
                 spin=draw.normal(0, 50.0, places.shape), viscosity=0.01 * film)
laws = Laws(film=bool(film), **{name: CHOICES[name][number] for name, number in words},
            contact=LINEAR.with_parameters(normal_stiffness=500.0, tangential_stiffness=300.0) if contact else "hertz")
table = pair_table([glass])
run = ParticleSolver(spheres, table.view(np.recarray) if plain else table, walls=[Plane()], laws=laws,
                 gravity=(0.0, 0.0, -9.81), box=(4.0e-3, 4.0e-3, None))
run.advance(1e-6, 12)
assert (np.abs(run.edges.spring).max() > 0.0) and len(run.edges.first) > run.edges.between_particles > 50
np.savez(path, position=spheres.position, velocity=spheres.velocity, spin=spheres.spin, force=spheres.force,
         torque=spheres.torque, edge_force=run.edges.force, edge_spring=run.edges.spring)
"""


def state(folder: Path, plain: bool, choices: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Run the system in a separate process and read its state."""
    path = folder / f"{plain}.npz"
    words = [*map(str, choices), str(int(plain)), str(path)]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": str(int(plain)), "NUMBA_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", SYSTEM, *words], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


@pytest.mark.parametrize(
    "choices",
    [
        (0, 0, 0, 0, 0),
        (1, 0, 0, 0, 0),
        pytest.param((1, 1, 1, 1, 0), marks=pytest.mark.slow),
        pytest.param((0, 0, 0, 0, 1), marks=pytest.mark.slow),
    ],
    ids=["dry", "film", "film, explicit, friction at overlap, rescaled", "linear"],
)
def test_compiled_loop_equals_interpreted_loop(choices: tuple[int, ...], tmp_path: Path) -> None:
    """48 spheres, 12 steps; positions, velocities, forces and springs agree within 1e-12 of their maxima."""
    compiled, plain = (state(tmp_path, way, choices) for way in (False, True))
    for name, values in compiled.items():
        assert np.abs(values - plain[name]).max() <= 1e-12 * np.abs(values).max(), name
