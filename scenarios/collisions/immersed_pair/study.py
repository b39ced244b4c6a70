"""Two spheres, or a sphere and a wall, collide in a fluid.

What you'll learn: how the film, the roughness and the elasticity of two particles set their rebound.

>>> from scenarios.collisions.immersed_pair import MATERIALS, collide
>>> result = collide(MATERIALS["delrin"], velocity=0.1, stokes=30)
>>> result.outcome, round(float(result.restitution), 2)
('rebound', 0.39)
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from cfddem.backend.errors import InputError, UnstableStep
from cfddem.backend.html import table
from cfddem.backend.json_text import summary_of
from cfddem.backend.law_choice import called_by_name, chosen
from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from cfddem.particles.collision_record import CollisionRecord
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from closures import contact, lubrication, timescales
from closures.friction import dry_or_lubricated
from closures.kinds import BUILT_IN, GAP_ARGUMENTS
from closures.minimum_gap import elastohydrodynamic
from scenarios.collisions.immersed_pair.motion import Setting, chosen_forces, fluid_around, integrate, stage

SLOWEST, FASTEST = 1e-12, 1e3
"""Speeds of approach that are computed [m/s]."""

ROUGH = 0.05
"""Largest roughness over the smaller diameter, as of cases [-]."""

BUILT_IN_LAWS = {"minimum_gap": ("elastohydrodynamic",), "lubrication": ("nijssen", "auto")}
"""Names of the laws of a collision without a user's law."""

MATERIALS = {
    "steel_smooth": Material(
        density=7780, youngs_modulus=190e9, poisson=0.27, restitution=0.97,
        friction=0.11, friction_lubricated=0.02, roughness=24e-9,
    ),
    "steel_rough": Material(
        density=7780, youngs_modulus=190e9, poisson=0.27, restitution=0.97,
        friction=0.11, friction_lubricated=0.02, roughness=272e-9,
    ),
    "glass": Material(
        density=2540, youngs_modulus=60e9, poisson=0.23, restitution=0.97,
        friction=0.40, friction_lubricated=0.10, roughness=134e-9,
    ),
    "delrin": Material(
        density=1400, youngs_modulus=2.8e9, poisson=0.35, restitution=0.97,
        friction=0.20, friction_lubricated=0.10, roughness=796e-9,
    ),
}  # fmt: skip
"""The spheres of Yang & Hunt (2006), as listed in table 1 of Nijssen et al. (2023)."""


@dataclass(frozen=True)
class Collision:
    """Result of a collision. Rebound speeds are taken where the pair leaves the film, at h = h_co."""

    stokes: float  # of the normal approach at h_co [-]; infinite when dry
    velocity: float  # of the normal approach at h_co [m/s]
    viscosity: float  # of the fluid [Pa s]
    outcome: Literal["no_touch", "touch_no_rebound", "rebound"]
    restitution: float  # normal speed out over in [-]
    restitution_tangential: float  # tangential speed out over in [-]; NaN head-on
    rebound_angle_striker: float  # of the striker's own velocity against the line of centres at contact [deg]
    rebound_angle_relative: float  # of the relative velocity against the line of centres at contact [deg]
    minimum_gap: float  # h_min [m]; 0 when dry
    mechanism: str  # "roughness" or "elastohydrodynamic", or the name of a user-defined law; "dry" without a film
    friction_used: float  # [-]
    stop_gap: float | None  # where a pair that does not separate stops [m]
    spin: tuple[float, float]  # of striker and target about the plane's normal [rad/s]
    time: np.ndarray = field(repr=False)  # [s]
    gap: np.ndarray = field(repr=False)  # at these times [m]
    history: dict[str, np.ndarray] = field(repr=False)  # more columns at these times
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """The result without its histories, ready for JSON."""
        return summary_of(self)

    def _repr_html_(self) -> str:
        """The result in a notebook."""
        rows = [(name.replace("_", " "), f"{value:.4g}" if isinstance(value, float) else f"{value}")
                for name, value in self.summary().items() if value not in (None, [])]  # fmt: skip
        return table(f"Collision: {self.outcome.replace('_', ' ')}", rows)


class Impact(Settings):
    """One body that strikes another at rest in a fluid."""

    by_place: ClassVar[int] = 1

    material: Any = Field(description="of both particles, or (striker, target); with a wall, (sphere, wall)")
    diameter: float | tuple[float, float] = Field(12.7e-3, description="of both spheres, or (striker, target) [m]")
    velocity: float | None = Field(None, gt=0, description="normal approach speed at the cut-off gap h_co = R* [m/s]")
    viscosity: float | None = Field(None, ge=0, description="of the fluid; 0 for a dry collision [Pa s]")
    stokes: float | None = Field(None, gt=0, description="of the normal approach [-]")
    angle: float = Field(0.0, ge=0, lt=90, description="between velocity and line of centres at contact [deg]")
    against: Literal["sphere", "wall"] = Field("sphere", description='"sphere" or "wall"')
    trajectory: Literal["frozen", "full"] = Field(
        "frozen",
        description='"frozen" holds the line of centres; "full" starts at a gap of 2 R* aimed at the contact point',
    )
    spin: tuple[float, float] = Field(
        (0.0, 0.0), description="of striker and target before, about the plane's normal [rad/s]"
    )
    integrator: str = Field(
        "drift", description='"drift" (film as a potential difference) or "verlet" (film as a force)'
    )
    friction_onset: str = Field(
        "film",
        description='"film": at h_min, weighted by 1 - h/h_min; "overlap": at h = 0, as in the published figures',
    )
    spring: str = Field("total", description='"total" tangential displacement, or "rescaled" while loading')
    step_fraction: float | None = Field(
        None, gt=0, le=0.2,
        description='of the Hertz time; 0.02, or 0.005 for an oblique impact with the sudden onset "overlap" [-]',
    )  # fmt: skip
    surroundings: str | Sequence[str] = Field(
        "none",
        description='beyond the film: "none", "all", or some of drag, added_mass, history, wall_drag, joined by commas',
    )
    fluid_density: float = Field(1000.0, ge=0, description="[kg/m3]")
    gravity: float = Field(0.0, description="from striker to target; the weight is less buoyancy [m/s2]")
    until: float | None = Field(
        None, gt=0,
        description="follow the pair for this time, also after it has left the film, or until it rests [s]",
    )  # fmt: skip
    minimum_gap: str | Callable[..., float] | None = Field(
        None, description="a user-defined law for h_min, or its name; default: elastohydrodynamic"
    )
    lubrication: str | Callable[..., float] | None = Field(
        None, description="a user-defined law for the resistance of the film, or its name; default: nijssen"
    )
    film_motions: str = Field(
        "normal", description='that films resist: "normal"; "full" with sliding and rolling; "full_twist"'
    )

    @field_validator("minimum_gap", "lubrication")
    @classmethod
    def _laws_exist(cls, value: Any, about: ValidationInfo) -> Any:
        """The function of a law; None for the default one, and for none given."""
        kind = about.field_name or ""
        if value is None or value in BUILT_IN_LAWS[kind]:
            return None
        if value in BUILT_IN[kind]:
            remedy = 'film_motions = "full" resists sliding; with a viscosity of 0 there is no film'
            raise InputError(kind, value, f"{BUILT_IN_LAWS[kind][0]} or a user-defined law", remedy)
        return chosen(kind, value).function

    @property
    def step(self) -> float:
        """Step in contact over the Hertz time [-]."""
        oblique = self.angle > 0.0 or any(self.spin)
        return self.step_fraction or (0.005 if oblique and self.friction_onset == "overlap" else 0.02)

    def laws(self, viscosity: float) -> Laws:
        """Contact and film in a fluid of a viscosity [Pa s]."""
        return Laws(
            film=viscosity > 0.0,
            integrator=self.integrator,
            friction_onset=self.friction_onset,
            spring=self.spring,
            minimum_gap=self.minimum_gap,  # type: ignore[arg-type]  # a function by now
            lubrication=self.lubrication,  # type: ignore[arg-type]
            film_motions=self.film_motions if viscosity > 0.0 else "normal",
        )


@takes(Impact)
def collide(impact: Impact) -> Collision:
    """Let one body strike another at rest in a fluid, in the particle engine.

    Two of velocity, viscosity and stokes are given: St = m* v / (6 pi eta R*^2).

    >>> wall = collide(MATERIALS["glass"], against="wall", velocity=0.2, stokes=50)
    >>> wall.mechanism, round(float(wall.restitution), 2)
    ('roughness', 0.53)
    """
    bodies = Bodies(_both(impact.material), _both(impact.diameter), impact.against)
    velocity, viscosity = _speed_and_viscosity(bodies, impact.velocity, impact.viscosity, impact.stokes)
    laws = impact.laws(viscosity)
    laws.check()
    full, density, gravity = impact.trajectory == "full", impact.fluid_density, impact.gravity
    table = pair_table(bodies.materials)
    setting = _setting(table[0, 1], bodies, velocity, viscosity, impact.angle, impact.step, laws)
    caveats = _check_film_step(setting, laws, impact.step)
    simulation = stage(setting, table, bodies.materials, laws, full, impact.spin)
    forces = chosen_forces(impact.surroundings)
    fluid = fluid_around(simulation, forces, density, viscosity, gravity, impact.against == "wall")
    history = integrate(simulation, setting, full, fluid, impact.until)
    collision = _result(simulation, setting, table, history, laws, full, caveats)
    if impact.stokes is None or not laws.film:
        return collision
    return replace(collision, stokes=impact.stokes)  # without round-off


def _both(value: Any) -> tuple[Any, Any]:
    return value if isinstance(value, tuple) else (value, value)


def _check(name: str, value: Any, holds: bool, limit: str) -> None:
    if not holds:
        raise InputError(name, value, limit)


class Bodies(NamedTuple):
    """Striker and target."""

    materials: tuple[Material, Material]
    diameters: tuple[float, float]  # [m]
    against: str  # "sphere" or "wall"

    def reduced(self) -> tuple[float, float]:
        """Reduced radius [m] and reduced mass [kg]."""
        for material in self.materials:
            _check("material", material, isinstance(material, Material), "a Material, such as MATERIALS['glass']")
        for name, diameter in zip(("diameter", "diameter of the target"), self.diameters):
            _check(name, diameter, 1e-9 <= diameter <= 1e3, "between 1e-9 and 1000 m")
        most = ROUGH * min(self.diameters)
        for material in self.materials:
            _check(
                "roughness", material.roughness, material.roughness <= most, f"at most 5 % of a diameter, {most:.3g} m"
            )
        wall = self.against == "wall"
        mass = [m.density * math.pi / 6.0 * d**3 for m, d in zip(self.materials, self.diameters)]
        other = (math.inf, math.inf) if wall else (0.5 * self.diameters[1], mass[1])
        return contact.reduced(0.5 * self.diameters[0], other[0]), contact.reduced(mass[0], other[1])


def _speed_and_viscosity(
    bodies: Bodies, velocity: float | None, viscosity: float | None, stokes: float | None
) -> tuple[float, float]:
    """Speed and viscosity, from any two of the three given values."""
    choices = {"velocity": velocity, "viscosity": viscosity, "stokes": stokes}
    names = [name for name, value in choices.items() if value is not None]
    if len(names) != 2:
        raise InputError("velocity, viscosity, stokes", names, "two of the three", "the third follows from them")
    radius, mass = bodies.reduced()
    film_speed_per_viscosity = lubrication.film_strength(1.0, radius) / mass
    if velocity is None:
        _check("viscosity", viscosity, viscosity > 0.0, "above 0 where stokes sets the velocity")  # type: ignore[arg-type, operator]
        velocity = stokes * viscosity * film_speed_per_viscosity  # type: ignore[operator]
    if viscosity is None:
        viscosity = velocity / (stokes * film_speed_per_viscosity)  # type: ignore[operator]
    _check("velocity", velocity, SLOWEST <= velocity <= FASTEST, f"between {SLOWEST:g} and {FASTEST:g} m/s")
    return velocity, viscosity


def _setting(
    row: np.void, bodies: Bodies, velocity: float, viscosity: float, angle: float, step_fraction: float, laws: Laws
) -> Setting:
    """Numbers of the collision; `row` is the entry of the pair table for the two materials."""
    reduced_radius, reduced_mass = bodies.reduced()
    stiffness = contact.hertz_stiffness(float(row["contact_modulus"]), reduced_radius)
    roughness = float(row["roughness_gap"])
    asked = (roughness, velocity, viscosity, float(row["film_modulus"]), reduced_radius)
    deformed = called_by_name(laws.minimum_gap or elastohydrodynamic, GAP_ARGUMENTS, asked)
    return Setting(
        radius=(0.5 * bodies.diameters[0], math.inf if bodies.against == "wall" else 0.5 * bodies.diameters[1]),
        reduced_radius=reduced_radius,
        reduced_mass=reduced_mass,
        speed=velocity,
        tangential_speed=velocity * math.tan(math.radians(angle)),
        viscosity=viscosity,
        stiffness=stiffness,
        impact_step=step_fraction * timescales.hertz_time(reduced_mass, stiffness, velocity),
        minimum_gap=max(roughness, deformed) if viscosity > 0.0 else 0.0,
        film_speed=lubrication.film_strength(viscosity, reduced_radius) / reduced_mass,
    )


def _check_film_step(setting: Setting, laws: Laws, step_fraction: float) -> tuple[str, ...]:
    """Refuse or warn where the step is too long for the film as an explicit force."""
    if not laws.film or laws.integrator == "drift":
        return ()
    film_time = timescales.film_time(
        setting.reduced_mass, setting.film_speed * setting.reduced_mass, setting.minimum_gap
    )
    step = setting.impact_step
    if step >= 2.0 * film_time:
        raise UnstableStep(
            step,
            2.0 * film_time,
            "film",
            f'use integrator="drift", or step_fraction below {2.0 * film_time / step * step_fraction:.2g}',
        )
    depth = contact.hertz_largest_overlap(setting.reduced_mass, setting.stiffness, setting.speed) / setting.minimum_gap
    if step < film_time and depth < 15.0:
        return ()
    caveat = (
        f"the film is poorly resolved: step/film time = {step / film_time:.2g} (should be below 1), "
        f'largest overlap/minimum gap = {depth:.2g} (should be below 15); use integrator="drift"'
    )
    warnings.warn(caveat, stacklevel=4)
    return (caveat,)


def _result(
    simulation: ParticleSolver,
    setting: Setting,
    table: np.ndarray,
    history: dict[str, np.ndarray],
    laws: Laws,
    full: bool,
    caveats: tuple[str, ...],
) -> Collision:
    """The result from where the pair leaves the film, or from the end of the history."""
    cutoff = setting.cutoff_gap if laws.film else 0.0
    left = np.flatnonzero((history["gap"] > cutoff) & (history["normal_speed"] > 0.0))
    end = int(left[0]) if len(left) else -1
    velocity, spin = history["velocity"][end], history["spin"][end]
    target = velocity[1] if len(velocity) == 2 else np.zeros(3)
    parting = target - velocity[0]
    separated = history["gap"][end] > cutoff
    touched = bool(history.pop("touched"))
    restitution = float(parting[0]) / setting.speed if separated or full else 0.0
    sideways = -float(parting[1])
    minimum_gap = _frozen_gap(simulation, setting)
    row = table[0, 1]
    friction = dry_or_lubricated(
        minimum_gap, float(row["roughness_gap"]), float(row["friction"]), float(row["friction_lubricated"])
    )
    deformed = "elastohydrodynamic" if laws.minimum_gap is None else chosen("minimum_gap", laws.minimum_gap).name
    mechanism = deformed if minimum_gap > row["roughness_gap"] else "roughness"
    return Collision(
        stokes=setting.speed / setting.film_speed if laws.film else math.inf,
        velocity=setting.speed,
        viscosity=setting.viscosity,
        outcome="rebound" if separated and touched else "touch_no_rebound" if touched else "no_touch",
        restitution=restitution,
        restitution_tangential=sideways / setting.tangential_speed if setting.tangential_speed > 0.0 else math.nan,
        rebound_angle_striker=_degrees(float(velocity[0, 1]), float(velocity[0, 0])),
        rebound_angle_relative=_degrees(sideways, restitution * setting.speed),
        minimum_gap=minimum_gap,
        mechanism=mechanism if laws.film else "dry",
        friction_used=friction if laws.film else float(row["friction"]),
        stop_gap=None if separated else float(history["gap"][end]),
        spin=(float(spin[0]), float(spin[1]) if len(spin) == 2 else 0.0),
        time=history.pop("time"),
        gap=history.pop("gap"),
        history=history,
        warnings=caveats,
    )


def _frozen_gap(simulation: ParticleSolver, setting: Setting) -> float:
    """Minimum gap of the collision, from its record or, where it has not ended, from the pair."""
    if not simulation.laws.film:
        return 0.0
    ended = simulation.feature(CollisionRecord).table
    return float(ended["minimum_gap"][-1] if len(ended) else simulation.edges.minimum_gap[0])


def _degrees(sideways: float, along: float) -> float:
    """Angle against the line of centres, 0 along it in either direction."""
    return math.degrees(math.atan2(sideways, abs(along))) if sideways else 0.0
