"""Wet spheres that are stirred, meet, and agglomerate.

What you'll learn: how large agglomerates of wet spheres grow, against the capillary number of the stirring.

Spheres with individual film thicknesses move in a periodic box, carried by a steady cellular flow. Contacts, the
viscous part of the films and the liquid bridges are those of the particle engine; the drag of the flow is added as
impulses. The flow does not feel the spheres, and its drag is linear.

    from scenarios.collisions.wet_tumbler import tumble

    result = tumble(capillary_number=0.05, count=60, until=0.01)
    print(result.mean_size[-1])
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydantic import Field

from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles

GRAIN = Material(
    density=2500,
    youngs_modulus=60e9,
    contact_modulus=5e5,
    poisson=0.25,
    restitution=0.9,
    friction=0.3,
    friction_lubricated=0.1,
    roughness=1e-6,
)
"""Glass whose contacts are softened, so that the steps are long; films feel the real modulus."""

SUBSTEPS = 8
"""Steps of the engine between two kicks of the flow, which is much softer than contacts."""

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Tumbling:
    """Growth of agglomerates: spheres joined by bridges; a single sphere counts as an agglomerate of one."""

    capillary_number: float  # eta G d / sigma [-]
    surface_tension: float  # [N/m]
    time: np.ndarray  # [s]
    mean_size: np.ndarray  # spheres per agglomerate [-]
    weighed_size: np.ndarray  # size of the agglomerate that a sphere is in, mean over spheres [-]
    largest_size: np.ndarray  # [-]
    bridges: np.ndarray  # per sphere [-]
    formed: int  # bridges, over the run
    broken: int
    spheres: int
    momentum_error: float  # change of momentum less the impulse of the flow, over the sum of m |v| [-]
    liquid_error: float  # change of the liquid in films and bridges, relative [-]
    agglomerates: np.ndarray = field(repr=False)  # that each sphere is in at the end, by row of the run (N,)
    run: ParticleSolver = field(repr=False)  # at the end

    def late(self, values: np.ndarray) -> float:
        """Mean over the last half of the run."""
        return float(values[len(values) // 2 :].mean())


class Stirring(Settings):
    """Wet spheres that are stirred in a periodic box."""

    by_place: ClassVar[int] = 2

    capillary_number: float = Field(0.03, gt=0, description="Ca [-]")
    count: int = Field(5000, gt=0, description="number of spheres")
    until: float = Field(0.25, gt=0, description="length of the run [s]")
    shear_rate: float = Field(100.0, ge=0, description="G, largest shear rate of the flow; 0 for no flow [1/s]")
    diameter: float = Field(1e-3, gt=0, description="d [m]")
    film: float = Field(25e-6, gt=0, description="mean thickness of the films at the start [m]")
    film_spread: float = Field(
        0.5, ge=0, lt=1, description="largest deviation from it, drawn evenly for each sphere, relative [-]"
    )
    viscosity: float = Field(5e-3, gt=0, description="eta, of the liquid [Pa s]")
    contact_angle: float = Field(15.0, ge=0, le=90, description="of the liquid on the spheres [deg]")
    solid_fraction: float = Field(0.1, gt=0, lt=0.64, description="of the box [-]")
    drag_time: float = Field(5e-3, gt=0, description="relaxation time of a sphere towards the flow [s]")
    seed: int = Field(1, ge=0, description="same seed, same run")
    samples: int = Field(50, gt=0, description="times at which agglomerates are counted")
    progress: Progress | None = Field(None, description="called with the completed fraction of the run")


@takes(Stirring)
def tumble(stirring: Stirring) -> Tumbling:
    r"""Stir wet spheres in a periodic box.

    The flow is u = U (sin kz, sin kx, sin ky) with one wave in the box and k U the shear rate G. The surface tension
    follows from the capillary number, :math:`Ca = \eta G d/\sigma`, so that viscous films are the same at each.
    """
    film, viscosity, shear_rate, diameter = stirring.film, stirring.viscosity, stirring.shear_rate, stirring.diameter
    samples, until, progress = stirring.samples, stirring.until, stirring.progress
    surface_tension = viscosity * max(shear_rate, 1.0) * diameter / stirring.capillary_number
    thickness = film * (
        1.0 + stirring.film_spread * np.random.default_rng(stirring.seed).uniform(-1.0, 1.0, stirring.count)
    )
    liquid = BridgeLaws(viscosity, surface_tension, math.radians(stirring.contact_angle))
    run, bridges = _spheres(diameter, thickness, film, liquid, stirring.solid_fraction, stirring.seed)
    flow = Flow(run, shear_rate, stirring.drag_time)
    run.particles.velocity[:] = flow.speed
    run.refresh()
    start, all_liquid = _momentum(run), bridges.liquid
    step = run.time_scales(2.0 * shear_rate * diameter).recommended
    rounds = max(1, round(until / samples / SUBSTEPS / step))
    counted = [_count(bridges)]
    for sample in range(samples):
        for _ in range(rounds):
            flow.advance(step)
        counted.append(_count(bridges))
        if progress is not None:
            progress((sample + 1) / samples)
    carried = float((run.particles.mass[:, None] * np.abs(run.particles.velocity)).sum())
    drift = np.abs(_momentum(run) - start - flow.impulse).max() / carried
    mean, weighed, largest, per_sphere = np.array(counted).T
    return Tumbling(
        capillary_number=stirring.capillary_number,
        surface_tension=surface_tension,
        time=np.arange(samples + 1) * rounds * SUBSTEPS * step,
        mean_size=mean,
        weighed_size=weighed,
        largest_size=largest,
        bridges=per_sphere,
        formed=bridges.formed,
        broken=bridges.broken,
        spheres=len(np.unique(run.particles.id)),
        momentum_error=float(drift),
        liquid_error=abs(bridges.liquid / all_liquid - 1.0),
        agglomerates=bridges.agglomerates,
        run=run,
    )


class Flow:
    """A steady cellular flow that drags the spheres of a periodic box.

    shear_rate  G = k U [1/s]
    drag_time   [s]
    """

    def __init__(self, run: ParticleSolver, shear_rate: float, drag_time: float) -> None:
        self.run, self.drag_time = run, drag_time
        self.wave = 2.0 * np.pi / run.box
        self.fastest = shear_rate / self.wave
        self.impulse = np.zeros(3)  # given to all spheres so far [N s]
        self.update()

    def advance(self, step: float) -> None:
        """Make `SUBSTEPS` steps of the engine between two kicks of the flow [s]."""
        self.kick(0.5 * SUBSTEPS * step)
        self.run.advance(step, SUBSTEPS)
        self.update()
        self.kick(0.5 * SUBSTEPS * step)

    def update(self) -> None:
        """Update the flow velocity at the positions of the spheres (N, 3) [m/s]."""
        waves = self.fastest * np.sin(self.wave * self.run.particles.position)
        self.speed = waves[:, [2, 0, 1]]  # along x it changes with z, along y with x, along z with y

    def kick(self, span: float) -> None:
        """Apply the drag of the flow over a time, exactly [s]."""
        particles = self.run.particles
        gain = -np.expm1(-span / self.drag_time) * (self.speed - particles.velocity)
        particles.velocity[:] += gain
        self.impulse += (particles.mass[:, None] * gain).sum(axis=0)


def _spheres(
    diameter: float, thickness: np.ndarray, film: float, liquid: BridgeLaws, solid_fraction: float, seed: int
) -> tuple[ParticleSolver, Bridges]:
    """Spheres at random in a periodic box, with no films in contact; the range of a film is two layers."""
    coated = diameter + 4.0 * film
    places, box = random_packing(np.full(len(thickness), coated), solid_fraction * (coated / diameter) ** 3, seed)
    spheres = make_particles(places, 0.5 * diameter, GRAIN.density, viscosity=liquid.viscosity)
    coat(spheres, thickness)
    laws = Laws(film=True, cutoff_ratio=2.0 * film / (0.25 * diameter), bridge=liquid)
    run = ParticleSolver(spheres, pair_table([GRAIN]), laws=laws, box=(box[0], box[1], box[2]))
    return run, run.feature(Bridges)


def _momentum(run: ParticleSolver) -> np.ndarray:
    return (run.particles.mass[:, None] * run.particles.velocity).sum(axis=0)  # type: ignore[no-any-return]


def _count(bridges: Bridges) -> tuple[float, float, float, float]:
    """Mean, weighted and largest size of the agglomerates, and bridges per sphere."""
    size = np.bincount(bridges.agglomerates)
    return float(size.mean()), float((size**2).sum() / size.sum()), float(size.max()), bridges.count / size.sum()
