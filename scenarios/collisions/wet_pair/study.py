"""Two wet spheres collide obliquely: they bounce, stick, or turn about each other and separate.

What you'll learn: which of the film laws between coated spheres matters, and when.

>>> from scenarios.collisions.wet_pair import collide_wet
>>> result = collide_wet(stokes=2.0, angle=45.0)
>>> result.outcome, round(result.restitution, 3)
('bounce', 0.527)
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.json_text import summary_of
from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, blank, label, legend, panels, shades
from closures import contact, timescales
from closures.contact import hertz_stiffness
from closures.lubrication import film_strength
from closures.minimum_gap import glass_transition
from scenarios.references.wet_pair import Motion, Pair, integrate

TRANSITION_PRESSURES = {
    ("static", "constant"): 4.9e6,
    ("static", "zero"): 23e6,
    ("deforming", "constant"): 2.6e6,
    ("deforming", "zero"): 11.6e6,
}
"""Glass transition pressure of silicone oil of 10 Pa s, as fitted for each film by Punch et al. (2023, fig. 8) [Pa]."""

LEAST_SPEED, FASTEST = 1e-12, 1e3
"""Speeds of impact that can be followed [m/s]."""

LEAST_VISCOSITY, LARGE_RADIUS = 1.0, 0.1
"""Viscosity below which the fitted pressures are those of another liquid [Pa s], and radius that may be in mm [m]."""


@dataclass(frozen=True)
class WetPair:
    """Result of a wet collision; speeds are taken where the films separate, at h = film."""

    outcome: Literal["bounce", "stick_rotate_separate", "stick"]
    restitution: float  # normal speed of separation over that of impact; 0 where the pair does not separate [-]
    spin: float  # of each sphere, positive in the direction in which the pair turns [rad/s]
    separation_time: float | None  # after the films met [s]
    minimum_gap: float  # h_min [m]
    velocity: float  # normal speed of impact [m/s]
    turned: float  # by the line of centres [deg]
    history: dict[str, np.ndarray] = field(repr=False)  # time, gap, angle, approach speed, turning, spin
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """The result without its history, ready for JSON."""
        return summary_of(self)


class WetImpact(Settings):
    """A wet sphere that strikes an equal one at rest; the defaults are steel spheres in silicone oil."""

    by_place: ClassVar[int] = 4

    stokes: float = Field(2.0, gt=0, description="St_n = m* v_n0 / (6 pi eta R*^2), of the normal speed of impact [-]")
    angle: float = Field(0.0, ge=0, lt=90, description="between velocity and line of centres at impact [deg]")
    bridge: Literal["deforming", "static"] = Field(
        "deforming", description='"deforming", which grows with the liquid squeezed out, or "static"'
    )
    cut: Literal["zero", "constant"] = Field("zero", description='film below h_min: "zero", or "constant" as at h_min')
    tangential: Literal["davis", "nase", "none"] = Field(
        "davis", description='resistance of the film to sliding: "davis", "nase" or "none"'
    )
    friction: float = Field(0.0, ge=0, description="of the solids [-]")
    capillary: bool = Field(False, description="whether the bridge attracts the spheres")
    glass_transition_pressure: float | None = Field(
        None, gt=0, description="sets h_min; the value fitted for this bridge and cut if not given [Pa]"
    )
    film: float = Field(270e-6, gt=0, description="h_max, thickness of the liquid on both spheres together [m]")
    viscosity: float = Field(10.0, gt=0, description="of the film [Pa s]")
    radius: float = Field(12.7e-3, ge=1e-9, description="of the spheres [m]")
    density: float = Field(7960.0, gt=0, description="of the spheres [kg/m3]")
    youngs_modulus: float = Field(2.0e11, gt=0, description="of the spheres [Pa]")
    poisson: float = Field(0.35, gt=-1, le=0.5, description="Poisson's ratio of the spheres [-]")
    restitution: float = Field(0.9, gt=0, le=1, description="dry, of the solids [-]")
    surface_tension: float = Field(0.0205, ge=0, description="of the film [N/m]")
    duration: float = Field(1.0, gt=0, description="after which a pair that has not separated counts as stuck [s]")
    solver: Literal["particles", "equations"] = Field(
        "particles", description='the "particles" engine, or "equations" in polar coordinates'
    )

    @property
    def laws(self) -> BridgeLaws:
        """The laws of the bridge."""
        pressure = self.glass_transition_pressure
        return BridgeLaws(
            viscosity=self.viscosity,
            surface_tension=self.surface_tension,
            film=self.bridge,
            cut=self.cut,
            tangential=self.tangential,
            pull="constant" if self.capillary else "none",
            rupture="film",
            transition_pressure=TRANSITION_PRESSURES[self.bridge, self.cut] if pressure is None else pressure,
        )

    @property
    def solid(self) -> Material:
        """The solid of the spheres."""
        return Material(**{name: getattr(self, name) for name in OF_SOLID})

    def pair(self) -> Pair:
        """The constants of the pair."""
        viscosity, radius, elastic = self.viscosity, self.radius, (self.youngs_modulus, self.poisson)
        mass = self.density * 4.0 / 3.0 * math.pi * radius**3
        speed = self.stokes * film_strength(viscosity, 0.5 * radius) / (0.5 * mass)
        if not LEAST_SPEED <= speed <= FASTEST:
            limit = f"that of an impact at {LEAST_SPEED:g} to {FASTEST:g} m/s; it gives {speed:.3g} m/s"
            raise InputError("stokes", self.stokes, limit)
        return Pair(
            speed=speed,
            film=self.film,
            minimum_gap=glass_transition(viscosity, speed, self.laws.transition_pressure, 0.5 * radius, self.film),
            radius=radius,
            mass=mass,
            modulus=contact.reduced_modulus(*elastic, *elastic),
            shear_modulus=contact.reduced_shear_modulus(*elastic, *elastic),
            damping_ratio=contact.damping_ratio(self.restitution),
            friction=self.friction,
            liquid=self.laws.numbers,
        )

    def warn(self, pair: Pair) -> tuple[str, ...]:
        """Warn of a minimum gap as large as the film, of a pressure fitted to another liquid, and of a radius in mm."""
        complaints = []
        if pair.minimum_gap >= pair.film:
            complaints.append(
                f"at {pair.speed:.3g} m/s the whole film of {pair.film:.3g} m is above its glass transition pressure "
                "and does not act; the fitted pressure does not hold at so high a Stokes number"
            )
        if self.glass_transition_pressure is None and self.viscosity < LEAST_VISCOSITY:
            complaints.append(
                f"glass_transition_pressure is that of silicone oil of 10 Pa s, but viscosity is {self.viscosity:g} "
                "Pa s; give one for this liquid"
            )
        if self.radius >= LARGE_RADIUS:
            complaints.append(f"radius is {self.radius:g} m; did you mean {1e-3 * self.radius:g} m?")
        for complaint in complaints:
            warnings.warn(complaint, stacklevel=4)
        return tuple(complaints)


OF_SOLID = ("density", "youngs_modulus", "poisson", "restitution", "friction")


@takes(WetImpact)
def collide_wet(impact: WetImpact) -> WetPair:
    """Let one wet sphere strike an equal one at rest; the defaults are steel spheres in silicone oil.

    >>> slow = collide_wet(stokes=0.5, angle=60.0)
    >>> slow.outcome, round(slow.spin, 2), round(slow.turned)
    ('stick_rotate_separate', 5.42, 47)
    """
    pair, laws = impact.pair(), impact.laws

    def collision(at: float) -> Motion:
        if impact.solver == "equations":
            return integrate(pair, laws, at, impact.duration)
        return integrate_in_engine(pair, laws, impact.solid, at, impact.duration)

    motion = collision(impact.angle)
    bounces = motion.separated and (impact.angle == 0.0 or collision(0.0).separated)
    return WetPair(
        outcome="bounce" if bounces else "stick_rotate_separate" if motion.separated else "stick",
        restitution=-float(motion.approach[-1]) / pair.speed if motion.separated else 0.0,
        spin=float(motion.spin[-1]),
        separation_time=float(motion.time[-1]) if motion.separated else None,
        minimum_gap=pair.minimum_gap,
        velocity=pair.speed,
        turned=math.degrees(float(motion.angle[-1])),
        history=_history(motion),
        warnings=impact.warn(pair),
    )


def _history(motion: Motion) -> dict[str, np.ndarray]:
    """History by name, in SI units with the angle in degrees."""
    return {
        "time": motion.time,
        "gap": motion.gap,
        "angle": np.degrees(motion.angle),
        "approach_speed": motion.approach,
        "turning": motion.turning,
        "spin": motion.spin,
    }


# ---------------------------------------------------------------- two wet spheres in the particle engine


FILM_STEP = 1e-3
"""Step where the solids are apart, over the time in which the pair crosses the film at its present speed."""

SLOWEST = 0.02
"""Speed over that of impact below which the step in the film no longer grows."""

IMPACT_STEP = 0.01
"""Step in contact over the Hertz time."""

MOST_STEPS = 2_000_000


def integrate_in_engine(pair: Pair, liquid: BridgeLaws, solid: Material, angle: float, duration: float) -> Motion:
    """Integrate in the particle engine until the bridge has ruptured or the time is over.

    liquid    laws of the bridge
    angle     between velocity and line of centres at impact [deg]
    duration  [s]
    """
    apart = 2.0 * pair.radius + pair.film * (1.0 - 1e-9)
    velocity = [[pair.speed, -pair.speed * math.tan(math.radians(angle)), 0.0], [0.0, 0.0, 0.0]]
    two = make_particles(
        np.array([[0.0, 0.0, 0.0], [apart, 0.0, 0.0]]), pair.radius, solid.density, velocity=np.array(velocity)
    )
    coat(two, 0.5 * pair.film)
    # the steps are chosen here: they follow the film, whose resistance changes as it opens and closes
    run = ParticleSolver(two, pair_table([solid]), laws=Laws(bridge=liquid), settings=SolverSettings(check_steps=False))
    bridges = run.feature(Bridges)
    stiffness = hertz_stiffness(pair.modulus, 0.5 * pair.radius)
    short = IMPACT_STEP * timescales.hertz_time(0.5 * pair.mass, stiffness, pair.speed)
    times, rows = [0.0], [_look(run)]
    while bridges.count and run.time < duration:
        gap, _, approach, *_ = rows[-1]
        long = FILM_STEP * pair.film / max(abs(approach), SLOWEST * pair.speed)
        run.advance(short if gap < 2.0 * long * abs(approach) else long)
        times.append(run.time)
        rows.append(_look(run))
        if run.steps > MOST_STEPS:
            raise RunFailed(f"the pair is still in its film after {MOST_STEPS} steps, at t = {run.time:.6g} s")
    return Motion(bridges.count == 0, np.array(times), *np.array(rows).T)


def _look(run: ParticleSolver) -> tuple[float, float, float, float, float]:
    """Gap [m], angle turned [rad], approach speed [m/s], rate of turning and spin [rad/s] of the pair."""
    body = run.particles
    x, y, _ = body.position[1] - body.position[0]
    u, v, _ = body.velocity[1] - body.velocity[0]
    distance = math.hypot(x, y)
    gap = distance - float(body.radius.sum())
    return gap, math.atan2(y, x), -(x * u + y * v) / distance, (x * v - y * u) / distance**2, float(body.spin[0, 2])


# ---------------------------------------------------------------- figures of the wet pair


Curve = dict[float, np.ndarray]
TITLES = {
    ("static", "constant"): "static bridge, constant below $h_{min}$",
    ("static", "zero"): "static bridge, nothing below $h_{min}$",
    ("deforming", "constant"): "deforming bridge, constant below $h_{min}$",
    ("deforming", "zero"): "deforming bridge, nothing below $h_{min}$",
}


def films(stokes: np.ndarray, curves: dict[tuple[str, str], Curve]) -> Any:
    """Restitution of four films at five angles, as in figure 8 of Punch et al. (2023)."""
    figure, panel = blank(2, 2, width=10.0, height=7.2, sharex=True, sharey=True)
    for axes, (kind, curve) in zip(panel, curves.items()):
        for (angle, values), colour in zip(curve.items(), shades(len(curve))):
            axes.plot(stokes, values, color=colour, label=f"{angle:g} deg")
        axes.set(xlim=(0, stokes[-1]), ylim=(0, 1))
        label(axes, "Stokes number  $St_n$", "-", "restitution  $e_n$", "-", TITLES[kind])
        axes.label_outer()
    legend(panel[0], loc="upper left")
    return figure


def spins(stokes: np.ndarray, curves: dict[float, Curve]) -> Any:
    """Spin after the collision without and with friction, as in figure 12 of Punch et al. (2023)."""
    figure, panel = panels(len(curves), width=9.6, height=4.2, sharey=True)
    for axes, (friction, curve) in zip(panel, curves.items()):
        for (angle, values), colour in zip(curve.items(), shades(len(curve))):
            axes.plot(stokes, values, color=colour, label=f"{angle:g} deg")
        axes.set(xlim=(0, stokes[-1]), ylim=(0, None))
        label(axes, "Stokes number  $St_n$", "-", r"spin  $\omega$", "rad/s", rf"friction  $\mu$ = {friction:g}")
    panel[1].set_ylabel("")
    legend(panel[0], loc="upper right")
    return figure


def tangential(stokes: np.ndarray, curves: dict[str, np.ndarray]) -> Any:
    """Restitution at 60 degrees for each film across the line of centres, as in figure 14 of Punch et al. (2023)."""
    figure, axes = panels(width=8.0, height=4.4)
    for (name, values), colour in zip(curves.items(), (BLUE, ORANGE, GREY, GREEN, RED)):
        axes.plot(stokes, values, color=colour, label=name)
    axes.set(xlim=(0, stokes[-1]), ylim=(0, 0.8))
    label(axes, "Stokes number  $St_n$", "-", "restitution  $e_n$", "-", "Impact at 60 degrees, watched for 1 s")
    legend(axes, loc="upper left")
    return figure
