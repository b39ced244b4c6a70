"""A user's film law with resistance to sliding in one file, as docs/how-to/user-law.md writes it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import closures
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.film_law import FilmLaw
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures.registry import REGISTRY
from closures.tangential_lubrication import film_logarithm, shear_resistance

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "user-law.md").read_text(encoding="utf-8")
BLOCK = next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.S) if "my_film_sliding" in block)
NAMES = ("my_film", "my_film_sliding")


@pytest.fixture
def page() -> Iterator[dict[str, Any]]:
    """Names of the block of the page."""
    names: dict[str, Any] = {"closures": closures, "math": __import__("math"), "__name__": "page"}
    exec(BLOCK, names)
    yield names
    for name in NAMES:
        REGISTRY["lubrication"].pop(name, None)


@pytest.mark.parametrize(("reduced", "asymmetry"), [(0.5e-3, 0.0), (0.4e-3, 0.5), (1e-3, -1.0)])
def test_the_law_of_the_page_is_the_built_in_one(page: dict[str, Any], reduced: float, asymmetry: float) -> None:
    for gap in (1e-8, 1e-6, 1e-4, 5e-3):
        smaller = 2.0 * reduced / (1.0 + abs(asymmetry))
        expected = shear_resistance(1e-3, reduced, asymmetry) * film_logarithm(gap, 1e-9, smaller)
        assert page["my_film_sliding"](gap, 1e-3, reduced, asymmetry) == pytest.approx(expected, rel=1e-12)


def test_a_law_with_this_ending_makes_the_film_resist_sliding(page: dict[str, Any]) -> None:
    named = Laws(film=True, lubrication=page["my_film"])
    direct = Laws(film=True, lubrication=FilmLaw(page["my_film"], sliding=page["my_film_sliding"]))
    for laws in (named, direct):
        laws.check()
        assert laws.shears and laws.choices()["SHEAR"]
        law = laws.choices()["film_sliding"].py_func.__globals__["law"]
        assert law.py_func.__code__ is page["my_film_sliding"].__code__
    del REGISTRY["lubrication"]["my_film_sliding"]
    assert not Laws(film=True, lubrication=page["my_film"]).shears


def test_what_such_a_film_cannot_do_is_refused(page: dict[str, Any]) -> None:
    film = FilmLaw(page["my_film"], sliding=page["my_film_sliding"])
    with pytest.raises(InputError, match="film_motions = 'full_twist'"):
        Laws(film=True, lubrication=film, film_motions="full_twist").check()
    with pytest.raises(InputError, match="film_motions"):
        Laws(film=True, lubrication=film, integrator="verlet").check()
    with pytest.raises(InputError, match=r"argument of .* = 'temperature'"):
        Laws(film=True, lubrication=FilmLaw(page["my_film"], sliding=lambda temperature: temperature)).choices()


@pytest.mark.slow
def test_particles_move_as_with_the_built_in_film(page: dict[str, Any]) -> None:
    """Three spheres that slide, roll and approach each other and a wall, over 400 steps."""
    glass = Material(density=2500, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.3, roughness=1e-7)
    ended = []
    for laws in (Laws(film=True, film_motions="full"), Laws(film=True, lubrication=page["my_film"])):
        spheres = make_particles(
            [[0, 0, 1.01e-3], [2.02e-3, 0, 1.02e-3], [1e-3, 1.8e-3, 1.03e-3]], 1e-3, 2500.0, viscosity=0.1,
            velocity=[[0.02, 0.05, -0.02], [-0.02, -0.05, 0.0], [0.01, -0.03, 0.02]],
        )  # fmt: skip
        run = ParticleSolver(spheres, pair_table([glass]), walls=[Plane()], laws=laws)
        run.advance(1e-6, 400)
        ended.append(np.concatenate([run.particles.velocity, 1e-3 * run.particles.spin]))
    assert np.abs(ended[1] - ended[0]).max() < 1e-6 * np.abs(ended[0]).max()
    assert np.abs(ended[0][3:]).max() > 1e-4, "they have been turned"
