"""Steps on a graphics processor against those of the processor: in the simulator of the compiler, and on a GPU."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem import Case, Laws, Material, ParticleSolver, SolverSettings, make_particles, pair_table
from cfddem.backend import gpu
from cfddem.backend.errors import InputError
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.walls.meshes import Mesh
from cfddem.preflight.summary import preflight
from cfddem.run.resuming import require_compiled

pytest.importorskip("numba.cuda", reason="the simulator is part of numba-cuda, and of older versions of numba")

SYSTEM = """
import os
import sys
import numpy as np
from cfddem.case.materials import Material
from cfddem.particles.initial.packing import lattice
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Cylinder, Plane

gpu, contact, rolling, films, path = sys.argv[1] != "processor", *sys.argv[2:]
laws = Laws(contact=contact, rolling=rolling, film=films != "dry", film_motions="full" if films == "full" else "normal")
glass = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.7, friction=0.4,
                 rolling_friction=0.01, surface_energy=0.005)
draw = np.random.default_rng(2)
places = lattice(1e-3, ((0, 0, 0), (4.0e-3, 4.0e-3, 3.0e-3)), 1.0)
places = places + draw.uniform(-2e-5, 2e-5, places.shape)
size = 0.5e-3 * draw.uniform(0.97, 1.03, len(places))
spheres = make_particles(places, size, 2500.0, velocity=draw.normal(0, 0.05, places.shape),
                         spin=draw.normal(0, 50.0, places.shape), fixed=np.arange(len(places)) == 5,
                     viscosity=0.0 if films == "dry" else 0.1)
table = pair_table([glass])
walls = [Plane(velocity=(0.1, 0.0, 0.0)),
         Cylinder(point=(2e-3, 0.0, 1.5e-3), axis=(0.0, 1.0, 0.0), radius=2.29e-3, spin=(0.0, 5.0, 0.0))]
settings = SolverSettings(gpu=gpu, skin=2e-6 if films == "dry" else 5e-7)
table = table.view(np.recarray) if "NUMBA_DISABLE_JIT" in os.environ else table
run = ParticleSolver(spheres, table, walls=walls, laws=laws,
                     gravity=(0.0, 0.0, -9.81), box=(None, 4.0e-3, None), settings=settings)
spheres.applied[:] = 1e-7
run.advance(1e-6, 15 if films == "dry" else 5)
assert run.lists.made > 0 and np.abs(run.edges.spring).max() > 0.0
assert len(run.edges.first) > run.edges.between_particles > 50
gone = run.remove(run.particles.id == 20)
run.insert(make_particles(gone.position, 0.5e-3, 2500.0, velocity=(0.0, 0.0, -0.3),
                          viscosity=0.0 if films == "dry" else 0.1))
if films != "dry":  # impulses of the last step would add energy now
    run.particles.velocity[:] *= -1.0
    run.particles.spin[:] *= -1.0
made = run.lists.made
run.advance(1e-6, 5 if films == "dry" else 2)
assert run.lists.made > made
alone = ParticleSolver(make_particles([[0.0, 0.0, 0.0], [0.99e-3, 0.0, 0.0]], 0.5e-3, 2500.0), table,
                       laws=laws, settings=settings)
alone.advance(1e-6, 3)
spheres = run.particles
np.savez(path, position=spheres.position, velocity=spheres.velocity, spin=spheres.spin, force=spheres.force,
         torque=spheres.torque, edge_force=run.edges.force, edge_spring=run.edges.spring, walls=run.wall_force,
         shift=run.walls.shift, film_counts=run.film_counts, lists=[made, run.lists.made],
         alone=alone.particles.position)
"""


SIMULATED = {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}


@pytest.mark.parametrize(
    "where, contact, rolling, films",
    [
        ("simulated", "hertz", "none", "dry"),
        ("simulated", "hertz", "none", "full"),
        pytest.param("simulated", "jkr", "spring_dashpot", "dry", marks=pytest.mark.slow),
        pytest.param("simulated", "hertz", "none", "normal", marks=pytest.mark.slow),
        ("gpu", "hertz", "none", "dry"),
        ("gpu", "hertz", "none", "full"),
    ],
)
def test_steps_on_a_gpu_agree_with_those_on_the_processor(
    where: str, contact: str, rolling: str, films: str, tmp_path: Path
) -> None:
    """48 spheres, one of them fixed, a sliding plane and a turning cylinder, outside force, new lists, an insert.

    Dry they have the same bits. Films take logarithms, whose last digits differ; 288 are solved in 7 steps, 41 at a
    time. In one of them the impulses of the last step would add energy.
    """
    if where == "gpu":
        try:
            gpu.name_of_gpu()
        except InputError as missing:
            pytest.skip(str(missing))
    states = []
    there = SIMULATED if where == "simulated" else {}
    here = {"NUMBA_DISABLE_JIT": "1"} if there and films != "dry" else {}  # to compile films takes longer
    for place, settings in (("processor", here), (where, there)):
        path = tmp_path / f"{place}.npz"
        done = subprocess.run(
            [sys.executable, "-c", SYSTEM, place, contact, rolling, films, str(path)], capture_output=True, text=True,
            env={**os.environ, "NUMBA_NUM_THREADS": "1", **settings}, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        with np.load(path) as arrays:
            states.append({name: arrays[name] for name in arrays.files})
    assert films == "dry" or states[0]["film_counts"][3] == 288
    for name, values in states[0].items():
        error = 0.0 if films == "dry" or name in ("film_counts", "lists") else 1e-12 * np.abs(values).max()
        np.testing.assert_allclose(states[1][name], values, rtol=0.0, atol=error, err_msg=name)


GLASS = Material(density=2500.0, youngs_modulus=1e7, poisson=0.25)
CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
FLOOR = Mesh(vertices=CORNERS, triangles=np.array([[0, 1, 2]]))
WATER = BridgeLaws(viscosity=1e-3, surface_tension=0.072)


@pytest.mark.parametrize(
    "others, words",
    [
        ({"laws": Laws(film=True, integrator="verlet")}, "films as explicit forces"),
        ({"laws": Laws(bridge=WATER)}, "liquid bridges"),
        ({"walls": [FLOOR]}, "walls of triangles"),
        ({"settings": SolverSettings(record=True, gpu=True)}, "a record of collisions"),
        ({"settings": SolverSettings(energies=True, gpu=True)}, "an energy account"),
    ],
)
def test_what_a_gpu_does_not_have_is_refused(others: dict, words: str) -> None:
    settings = {"settings": SolverSettings(gpu=True), **others}
    with pytest.raises(InputError, match=f"gpu = '{words}': must be a run of contacts, and films that act by impulses"):
        ParticleSolver(make_particles([[0.0, 0.0, 1e-3]], 1e-3, 2500.0), pair_table([GLASS]), **settings)


DRY = Case.from_text(
    """
material.grain = {density = 2500, youngs_modulus = 1e7, poisson = 0.25}
column = {width = 0.01, depth = 0.01, height = 0.02, cell = 2.5e-3}
bed = {diameter = 1e-3, count = 10, start = "suspended"}
run = {until = 0.001, gpu = true}
"""
)


@pytest.mark.parametrize("key, value", [("run.energy_budget", True), ("run.record_collisions", True)])
def test_a_check_names_the_keys_that_a_gpu_does_not_know(key: str, value: Any) -> None:
    films = DRY.with_(**{"fluid": {"density": 998.0, "viscosity": 1e-3}, "laws.lubrication": "nijssen"})
    assert films.has_films and not [issue for issue in preflight(films).issues if issue.key == "run.gpu"]
    assert not [issue for issue in preflight(DRY).issues if issue.key == "run.gpu"]
    (issue,) = [issue for issue in preflight(DRY.with_(**{key: value})).issues if issue.key == "run.gpu"]
    assert issue.severity == "error" and key in issue.reason


@pytest.mark.parametrize(
    "package, words", [(None, "pip install 'cfddem\\[gpu\\]'"), (object(), "no driver here.*see nvidia-smi")]
)
def test_a_machine_without_a_gpu_is_told_what_is_missing(package: Any, words: str, monkeypatch: Any) -> None:
    """Before a bed is poured, in one line with the remedy: the package, or the driver."""

    def no_device() -> None:
        raise RuntimeError("no\ndriver here")

    monkeypatch.setattr(gpu, "find_spec", lambda name: package)
    monkeypatch.setattr(gpu.cuda, "get_current_device", no_device)
    with pytest.raises(InputError, match=words) as refusal:
        require_compiled(DRY)
    assert "\n" not in str(refusal.value)
