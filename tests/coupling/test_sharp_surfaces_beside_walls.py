"""Sharp surfaces of beds in vessels, beside thin walls and in a gas: fixed layers carry the load of their law."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from cfddem import Case
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.seen_solids import SeenSolids, cells_of
from cfddem.fluid.cut_cells import open_share, within
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.surfaces import cylinder
from cfddem.particles.state import sphere_volume
from cfddem.run import history
from cfddem.run.simulation import Simulation
from closures.balance import pressure_gradient
from closures.drag import di_felice
from closures.drag_resolved import beetstra
from scenarios.beds.liquid_bed.study import glass

DIAMETER, PITCH, LAYERS = 1e-3, 0.01 / 9, 6
SPEED, RADIUS = 0.03, 5e-3
"""Superficial velocity of water [m/s], and radius of the round column, 4.5 pitches [m]."""

SPHERE = math.pi / 6.0 * DIAMETER**3
WEIGHT = (2500.0 - 998.0) * 9.81 * SPHERE
"""Volume of a sphere [m3], and its weight in water [N]."""

Layer = tuple[Array, Array, float]
"""Places along x and y of the spheres of a layer from the axis [m], and its cross-section [m2]."""


def square(turn: float) -> Layer:
    """A layer of a cubic lattice in a square of 10 mm, turned [degree]."""
    line, angle = (np.arange(9) - 4.0) * PITCH, math.radians(turn)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle), 1e-4


def rings(radius: float, turn: float = 0.0) -> Layer:
    """A layer in a round column: rings, each with as many spheres as its area has in the lattice."""
    count = math.floor(radius / PITCH - 0.49)
    apart, places = radius / (count + 0.5), [0j]
    for ring in range(1, count + 1):
        on_ring = round(2.0 * math.pi * ring * (apart / PITCH) ** 2)
        angles = 2.0 * math.pi * np.arange(on_ring) / on_ring + 0.7 * ring + turn
        places += list(ring * apart * np.exp(1j * angles))
    return np.real(places), np.imag(places), math.pi * radius**2


def through(layers: list[Layer], opening: float, cell: float, wide: int, **keys: Any) -> tuple[float, Array]:
    """Pressure drop of fixed layers over that of their law, and force on each over its law's, from the top.

    layers   from the floor up
    opening  cross-section at the floor [m2]
    wide     cells along x and y; the axis is in the middle
    keys     of the case
    """
    width, places, loads = wide * cell, [], []
    for number, (x, y, area) in enumerate(layers):
        places += [(0.5 * width + a, 0.5 * width + b, (number + 0.5) * PITCH) for a, b in zip(x, y)]
        speed, voidage = SPEED * opening / area, 1.0 - len(x) * SPHERE / (area * PITCH)
        loads.append(PITCH * pressure_gradient(speed, DIAMETER, 998.0, 1e-3, voidage, di_felice))
    bed = {"start": "placed", "positions": places, "count": None, "fixed": True}
    height = cell * math.ceil(2.2 * len(layers) * PITCH / cell)
    column = {"width": width, "height": height, "cell": cell}
    changes = {"column": column, "laws.agitation": "none", **{f"bed.{key}": value for key, value in bed.items()}}
    case = glass(SPEED).with_(**changes, **keys)
    assert case.surface == "sharp"
    run = Simulation(case)
    run.until(0.05)
    particles, row = run.particles, history.row(run)
    assert row["momentum_imbalance"] < 1e-13
    on_layers = np.bincount((particles.position[:, 2] / PITCH).astype(int), particles.applied[:, 2] + WEIGHT)
    areas = np.array([area for _, _, area in layers])
    return row["pressure_drop"] / sum(loads), (on_layers / (areas * loads))[::-1]


ROUND = {"shape": "cylinder", "radius": RADIUS}


@pytest.mark.parametrize(
    ("layer", "vessel", "cell", "wide"),
    [
        (rings(RADIUS, 0.3), ROUND, 2.5e-3, 5),
        pytest.param(rings(RADIUS), ROUND, 5e-3 / 3.0, 7, marks=pytest.mark.slow),
        pytest.param(rings(RADIUS), ROUND, 5e-3 / 3.0, 8, marks=pytest.mark.slow),
        pytest.param(square(20.0), {"shape": "box", "size": [0.01, 0.01], "turn": 20.0}, 5e-3 / 3.0, 9,
                     marks=pytest.mark.slow),
        pytest.param(square(45.0), {"shape": "box", "size": [0.01, 0.01], "turn": 45.0}, 5e-3 / 3.0, 10,
                     marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_layers_in_a_vessel_carry_the_load_of_their_law(
    layer: Layer, vessel: dict[str, Any], cell: float, wide: int
) -> None:
    """At any turn and shift against the grid; the last layer has half of it with the kernel alone."""
    drop, layers = through([layer] * LAYERS, layer[2], cell, wide, vessel=vessel)
    assert drop == pytest.approx(1.0, abs=0.03)
    assert layers == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("wide", [13, 14])
def test_upper_layers_in_a_cone_carry_the_load_of_their_law(wide: int) -> None:
    """Of eight; the lower ones are in a stream that still spreads."""
    layers = [rings(RADIUS + 0.35 * (number + 0.5) * PITCH) for number in range(8)]
    top = RADIUS + 0.35 * 8 * PITCH
    cone = {"shape": "cone", "radius": RADIUS, "top_radius": top, "length": 8 * PITCH}
    found = through(layers, math.pi * RADIUS**2, 5e-3 / 3.0, wide, vessel=cone)[1]
    assert found[:6] == pytest.approx(1.0, abs=0.1)


def test_both_sides_of_a_thin_wall_have_a_bed_of_their_own() -> None:
    """Six layers on one side, three on the other: all carry their load, and see nothing through the wall. They are
    fixed, so that films would only take time to compile."""
    wide, cell = 10 * PITCH, 10 * PITCH / 6
    places = [((i + 0.5) * PITCH, (j + 0.5) * PITCH, (k + 0.5) * PITCH)
              for k in range(LAYERS) for j in range(10) for i in range(10 if k < 3 else 5)]  # fmt: skip
    bed = {"start": "placed", "positions": places, "count": None, "fixed": True, "inlet_velocity": SPEED}
    plate = {"shape": "plate", "point": [0.5 * wide, 0.0, 0.0], "edges": [[0.0, wide, 0.0], [0.0, 0.0, 9 * cell]]}
    column = {"width": wide, "height": 9 * cell, "cell": cell, "sides": "no_slip"}
    case = glass(SPEED).with_(**{f"bed.{key}": value for key, value in bed.items()},
                              **{"column": column, "wall": [plate], "laws.agitation": "none",
                                 "laws.lubrication": "none"})  # fmt: skip
    assert case.surface == "sharp"
    run = Simulation(case)
    run.until(0.05)
    particles, row = run.particles, history.row(run)
    assert row["momentum_imbalance"] < 1e-13
    law = PITCH**3 * pressure_gradient(SPEED, DIAMETER, 998.0, 1e-3, 1.0 - SPHERE / PITCH**3, di_felice)
    force = (particles.applied[:, 2] + WEIGHT) / law
    layer, left = (particles.position[:, 2] / PITCH).astype(int), particles.position[:, 0] < 0.5 * wide
    deep = [force[left & (layer == k)].mean() for k in range(LAYERS)]
    shallow = [force[~left & (layer == k)].mean() for k in range(3)]
    assert deep == pytest.approx([1.0] * LAYERS, abs=0.12)
    assert shallow == pytest.approx([1.0] * 3, abs=0.08)


@pytest.mark.slow
@pytest.mark.parametrize(("across", "limit"), [(8, 0.05), (6, 0.05), (4, 0.05), (3, 0.08)])
def test_a_fixed_bed_in_air_has_the_drag_of_its_law(across: int, limit: float) -> None:
    """Seeds of 1.2 mm, in cells of 1.25 to 3.3 diameters; drag is stiff: the fluid follows it within a step."""
    diameter, speed, count = 1.2e-3, 0.3, 9
    pitch = diameter / 0.9
    cell = count * pitch / across
    places = [((i + 0.5) * pitch, (j + 0.5) * pitch, (k + 0.5) * pitch)
              for k in range(LAYERS) for j in range(count) for i in range(count)]  # fmt: skip
    seed = {"density": 1000.0, "youngs_modulus": 1.2e8, "contact_modulus": 1e6, "poisson": 0.3, "restitution": 0.9}
    case = Case(
        fluid={"density": 1.13, "viscosity": 1.68e-5},
        material={"seed": {**seed, "friction": 0.1}},
        column={"width": count * pitch, "height": cell * math.ceil(13 * pitch / cell), "cell": cell,
                "sides": "free_slip"},
        bed={"diameter": diameter, "start": "placed", "positions": places, "fixed": True, "inlet_velocity": speed},
        laws={"drag": "beetstra", "surface": "sharp", "self_disturbance_correction": False},
        run={"until": 0.05, "particle_step": 1e-5, "fluid_step": 5e-4, "reference_speed": 0.3},
    )  # fmt: skip
    run = Simulation(case)
    run.until(0.03)
    law = pressure_gradient(speed, diameter, 1.13, 1.68e-5, 1.0 - math.pi / 6.0 * 0.9**3, beetstra)
    drops = []
    for step in range(4):
        run.until(0.03 + 0.005 * step)
        drops.append(history.row(run)["pressure_drop"] / (LAYERS * pitch * law))
    assert drops == pytest.approx([1.0] * 4, abs=limit)
    assert np.ptp(drops) < 1e-4
    particles = run.particles
    force = particles.applied[:, 2] + (1000.0 - 1.13) * 9.81 * sphere_volume(0.5 * diameter)
    layers = np.bincount((particles.position[:, 2] / pitch).astype(int), force) / (count**2 * pitch**3 * law)
    assert layers == pytest.approx(np.ones(LAYERS), abs=0.1)


COLUMN = cylinder((0.52, 0.47, 0.0), 0.44)


def kernel_in_column() -> tuple[FilterKernel, Array]:
    """A kernel in a round column, and many places that fill it evenly."""
    grid = within(Grid((8, 8, 10), (0.125, 0.125, 0.1)), COLUMN)
    number, layers = np.arange(2000) + 0.5, (np.arange(40) + 0.5) / 40.0
    distance, angle = 0.44 * np.sqrt(number / 2000.0), number * math.pi * (3.0 - math.sqrt(5.0))
    places = [np.stack([0.52 + distance * np.cos(angle + k), 0.47 + distance * np.sin(angle + k),
                        np.full(2000, layer)], axis=-1) for k, layer in enumerate(layers)]  # fmt: skip
    return FilterKernel(grid, (False, False, False), smoothing=0.07), np.concatenate(places)


def test_parts_of_cut_cells_keep_the_volume_of_particles() -> None:
    """The cells in which particles see are cut by the same wall, and hold what particles deposit."""
    kernel, places = kernel_in_column()
    cells = cells_of(kernel)
    cut = within(Grid((16, 16, 20), (0.0625, 0.0625, 0.05)), COLUMN)
    solid = cells.solid_fraction(cells.map_particles(places, np.full(len(places), 1e-3)))
    volume = (solid * open_share(cut)).sum() * cut.cell_volume
    assert volume == pytest.approx(len(places) * sphere_volume(1e-3), rel=1e-12)


def test_a_uniform_suspension_is_seen_as_uniform_up_to_a_round_wall() -> None:
    """With the mean over particles, away from floor and lid."""
    kernel, places = kernel_in_column()
    seen = SeenSolids(kernel).around(kernel.map_particles(places, np.full(len(places), 1e-3)))
    exact = len(places) * sphere_volume(1e-3) / (math.pi * 0.44**2)
    inner = (places[:, 2] > 0.2) & (places[:, 2] < 0.8)
    assert seen[inner] == pytest.approx(exact, rel=0.03)
