"""Particles that enter and leave during a run, and particles from files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.features.feeds import Feed, ParticleOutlet
from cfddem.io import checkpoint
from cfddem.particles.initial.packing import normal, random_packing, read_particles
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane

GRAIN = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.7, friction=0.3)
DIAMETER = 1e-3


def packed() -> ParticleSolver:
    """A periodic packing of 200 spheres, pressed a little."""
    places, box = random_packing(np.full(200, DIAMETER), 0.6, seed=3)
    return ParticleSolver(make_particles(places, 0.502 * DIAMETER, 2500.0), pair_table([GRAIN]), box=tuple(box))


def springs(run: ParticleSolver) -> dict[tuple[int, int], np.ndarray]:
    """Tangential spring of each pair by the ids of the two."""
    one, other = (run.particles.id[rows] for rows in (run.edges.first, run.edges.second))
    return {(int(i), int(j)): spring for i, j, spring in zip(one, other, run.edges.spring)}


def test_those_that_stay_remember_each_other_when_others_come_and_go() -> None:
    """Springs of the pairs that stay are the same but for rounding; ids are never given twice."""
    run = packed()
    run.particles.velocity[:] = np.random.default_rng(1).normal(0.0, 0.01, (200, 3))
    run.advance(run.recommended_step(0.1), 50)
    before = springs(run)
    gone = run.remove(np.isin(run.particles.id, [3, 199]))
    assert sorted(gone.id) == [3, 199]
    assert run.particles.count == 198
    after = springs(run)
    staying = {pair for pair in after if pair in before}
    held = {pair for pair, spring in before.items() if spring.any() and not {3, 199} & set(pair)}
    assert len(held) > 300
    assert held <= staying
    assert all(after[pair] == pytest.approx(before[pair], rel=1e-9, abs=1e-18) for pair in held)
    assert run.insert(gone).tolist() == [200, 201]
    came = springs(run)
    assert all(came[pair] == pytest.approx(after[pair], rel=1e-9, abs=1e-18) for pair in held)
    run.advance(run.recommended_step(0.1), 50)
    assert np.isfinite(run.particles.position).all()


def test_the_last_particle_cannot_be_taken_out() -> None:
    """A run without particles is none."""
    with pytest.raises(InputError, match="fewer than all 200"):
        packed().remove(np.ones(200, bool))


def test_feed_brings_its_rate_and_nothing_overlaps() -> None:
    """1 000 a second for 0.05 s; none is inserted into another, and the outlet counts all that fell out."""
    sphere = make_particles([[0.0, 0.0, 0.02]], 0.5 * DIAMETER, 2500.0)
    run = ParticleSolver(sphere, pair_table([GRAIN]), gravity=(0.0, 0.0, -9.81))
    feed = Feed(1000.0, (0.0, 0.0, 0.02), (3e-3, 3e-3, 0.0), lambda n, _: np.full(n, DIAMETER), 2500.0, seed=1)
    outlet = ParticleOutlet(low=(-np.inf, -np.inf, 0.015))
    step = run.recommended_step(1.0)
    feed(run)
    while run.time < 0.05:
        run.advance(step, 50)
        feed(run)
        outlet(run)
        assert run.gap.min(initial=0.0) > -0.01 * DIAMETER
    assert feed.entered + len(feed.waiting) == int(1000.0 * run.time)
    assert feed.entered > 40
    assert outlet.left > 0
    assert outlet.left + run.particles.count == feed.entered + 1
    assert outlet.mass == pytest.approx(outlet.left * 2500.0 * np.pi / 6.0 * DIAMETER**3)


def test_a_resumed_feed_and_outlet_continue_with_the_same_bits(tmp_path: Path) -> None:
    """Random diameters and positions, particles that wait, and counts, through a file."""

    def parts() -> tuple[ParticleSolver, Feed, ParticleOutlet]:
        sphere = make_particles([[0.0, 0.0, 0.02]], 0.5 * DIAMETER, 2500.0)
        run = ParticleSolver(sphere, pair_table([GRAIN]), gravity=(0.0, 0.0, -9.81))
        feed = Feed(
            2e4, (0.0, 0.0, 0.02), (3e-3, 3e-3, 0.0), lambda n, draw: normal(n, 1e-3, 2e-4, draw), 2500.0, seed=1
        )
        return run, feed, ParticleOutlet(low=(-np.inf, -np.inf, 0.0199))

    def go_on(parts: tuple[ParticleSolver, Feed, ParticleOutlet]) -> None:
        run, feed, outlet = parts
        for _ in range(10):
            feed(run)
            run.advance(1e-5, 30)
            outlet(run)

    straight, again = parts(), parts()
    go_on(straight)
    names = ("run", "feed", "outlet")
    checkpoint.write(tmp_path, {name: part.checkpoint() for name, part in zip(names, straight)})
    kept = checkpoint.newest(tmp_path)
    for name, part in zip(names, again):
        part.restore(kept[name])
    for each in (straight, again):
        go_on(each)
    assert straight[1].entered > 20 and straight[2].left > 0 and len(straight[1].waiting) > 0
    assert (again[1].entered, again[2].left, again[2].mass) == (straight[1].entered, straight[2].left, straight[2].mass)
    assert np.array_equal(again[1].waiting, straight[1].waiting)
    for name, array in straight[0].particles.arrays.items():
        assert np.array_equal(again[0].particles[name], array), name


def test_an_earlier_run_is_remembered_by_the_next() -> None:
    """A sphere held by friction on a tilted wall stays where it is in a run over its particles, if that remembers."""
    down = (9.81 * 0.2, 0.0, -9.81)

    def run(after: ParticleSolver | None, sphere: object) -> ParticleSolver:
        return ParticleSolver(
            sphere, pair_table([GRAIN]), walls=[Plane()], gravity=down, settings=SolverSettings(after=after)
        )  # type: ignore[arg-type]

    first = run(None, make_particles([[0.0, 0.0, 0.4999 * DIAMETER]], 0.5 * DIAMETER, 2500.0))
    first.advance(first.recommended_step(0.01), 200)
    assert first.edges.spring.any()
    assert np.array_equal(run(first, first.particles).edges.spring, first.edges.spring)
    assert not run(None, first.particles).edges.spring.any()
    with pytest.raises(InputError, match="after"):
        run(first, make_particles([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]], 0.5 * DIAMETER, 2500.0))


def test_particles_from_files(tmp_path: Path) -> None:
    """Both kinds of file give the same particles; a scale makes metres of millimetres."""
    table = tmp_path / "grains.csv"
    table.write_text("# a bed\nx [mm],y [mm],z [mm],diameter [mm],material\n1,2,3,1,0\n4,5,6,2,1\n")
    arrays = tmp_path / "grains.npz"
    np.savez(arrays, position=[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], diameter=[1.0, 2.0], material=[0, 1])
    for path in (table, arrays):
        made = read_particles(path, density=2500.0, scale=1e-3)
        assert made.position == pytest.approx(1e-3 * np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
        assert made.radius == pytest.approx([0.5e-3, 1e-3])
        assert made.material.tolist() == [0, 1]
    with pytest.raises(InputError, match="density"):
        read_particles(table, scale=1e-3)
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("x,y,z,diametre\n1,2,3,4\n")
    with pytest.raises(InputError, match="did you mean 'diameter'"):
        read_particles(wrong, density=1.0)
    for text, said in (
        ("x [mm],y,z,diameter\n1,2,3,4\n", "scale = 1.0: must be 0.001, as x in wrong.csv is in mm"),
        ("x,y,z,diameter [inch]\n1,2,3,4\n", "unit of diameter in wrong.csv = 'inch': must be one of m, cm"),
        ("x [mm],y [mm],z [mm],diameter [um]\n1,2,3,4\n", "x in mm, y in mm, z in mm, diameter in um'"),
        ("x [mm],y,z,diameter [um]\n1,2,3,4\n", "must be one unit for x, y, z and diameter"),
        ("x,y,z,diameter,density [g/cm3]\n1,2,3,4,5\n", "unit of density in wrong.csv"),
        ("x,y,z,diameter\n", "must be rows of numbers below a line of names"),
    ):
        wrong.write_text(text)
        with pytest.raises(InputError, match=re.escape(said)):
            read_particles(wrong, density=1.0)
    for mu in ("u", "\N{MICRO SIGN}", "\N{GREEK SMALL LETTER MU}"):
        for of_density in ("kg/m3", "kg/m^3", "kg/m\N{SUPERSCRIPT THREE}", "kg m-3"):
            header = f"x [{mu}m],y [{mu}m],z,diameter [{mu}m],density [{of_density}],material [number]"
            wrong.write_text(f"{header}\n1,2,3,4,5,0\n", encoding="utf-8-sig")
            assert read_particles(wrong, scale=1e-6).density.tolist() == [5.0]
    wrong.write_bytes("x [\N{MICRO SIGN}m],y,z,diameter\n1,2,3,4\n".encode("latin-1"))
    with pytest.raises(InputError, match="must be a text in UTF-8"):
        read_particles(wrong, density=1.0)
    wrong.write_text("x,y,z,diameter\n1,2,3,4\n1,2,three,4\n")
    with pytest.raises(InputError, match="particle 1"):
        read_particles(wrong, density=1.0)
