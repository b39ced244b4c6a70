"""A sphere strikes a wall under a thin liquid layer, rebounds on a liquid bridge, or sticks.

What you'll learn: how viscous and capillary forces, contact and gravity share the energy of a wet impact.

>>> from scenarios.collisions.wet_wall import impact
>>> result = impact("glass_1.74", "water", film=100e-6, velocity=1.0)
>>> result.outcome, round(result.restitution, 3)
('rebound', 0.844)
>>> impact("glass_1.74", "water", film=100e-6, velocity=0.3).outcome
'stick'
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from cfddem.backend.errors import InputError, nearest
from cfddem.backend.json_text import summary_of
from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from cfddem.particles.material_pairs import pair_table
from closures import capillary, contact, timescales
from scenarios.collisions.wet_wall.engine import integrate as integrate_in_engine
from scenarios.collisions.wet_wall.materials import BALLS, GLASS, LIQUIDS, Ball, Liquid, half_filling, sliding_friction
from scenarios.references.wet_wall import motion
from scenarios.references.wet_wall.motion import COLUMNS, Path, Wet, integrate

PULLED_IN = {"always": ("I", "III", "IV"), "rebound": ("III", "IV"), "bridge": ("IV",)}
"""Phases with a capillary force, by name; the source does not say whether the first is among them."""

SLENDER = 0.01
"""Arc of the toroid over the radius of the sphere, below which the suction before contact determines the result."""

CUTTING = 1e-4
"""Relaxation time of the spring of a sliding contact towards Coulomb's limit, over the Hertz time."""

REMEDY = 'use solver="equations"'

FASTEST = 1e3
"""Fastest impact that is computed [m/s]."""


@dataclass(frozen=True)
class Impact:
    """Result of a wet impact. Speeds are taken where the sphere meets the layer and where the bridge ruptures."""

    outcome: Literal["rebound", "stick"]
    restitution: float  # normal speed out over in; 0 where the sphere sticks [-]
    restitution_tangential: float  # the same along the wall [-]; NaN head-on or stuck
    restitution_rotational: float  # spin after over before [-]; NaN without spin or stuck
    spin: float  # afterwards [rad/s]
    energy_lost: dict[str, float]  # by contact, viscous, capillary and gravity, over the mass [J/kg]
    half_filling_angle: float | None  # [deg]; None when dry
    friction: float | None  # [-]; None where nothing slides
    contact_speed: float  # towards the wall when the solids meet [m/s]
    bridge_volume: float | None  # liquid in the bridge when it breaks [m3]
    rupture_length: float | None  # [m]
    duration: float  # until the bridge breaks, or the sphere has come to rest [s]
    time: np.ndarray = field(repr=False)  # [s]
    history: dict[str, np.ndarray] = field(repr=False)  # columns of motion.COLUMNS, and the phase, 1 to 4
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """The result without its histories, ready for JSON."""
        return summary_of(self)


class WetImpact(Settings):
    """A sphere that strikes a wall under a liquid layer, from above."""

    by_place: ClassVar[int] = 4

    particle: str | Ball = Field(
        "glass_1.74", description='"glass_0.91", "glass_1.74" or "alumina_1.74"; in Python also a Ball'
    )
    liquid: str | Liquid | None = Field(
        "water",
        description='"water", "tween", "glycerol_35" or "glycerol_51"; in Python also a Liquid, or None for a dry wall',
    )
    film: float = Field(100e-6, ge=0, description="thickness of the layer; 0 for a dry wall [m]")
    velocity: float = Field(
        1.0, gt=0, le=FASTEST, description="normal speed where the sphere meets the layer, at most 1000 m/s [m/s]"
    )
    angle: float = Field(
        0.0, ge=0, lt=90, description="between velocity and normal there; tan(angle) = tangential/normal [deg]"
    )
    spin: float = Field(
        0.0, ge=-1e6, le=1e6,
        description="before; positive if it moves the lowest point in the direction of the sphere [rad/s]",
    )  # fmt: skip
    half_filling_angle: float | None = Field(
        None, gt=0, le=90,
        description="of the bridge; that of table 5 of the source where it lists the case [deg]",
    )  # fmt: skip
    friction: float | None = Field(
        None, ge=0, description="of the contact; that of table 3 of the source where it lists the case [-]"
    )
    wall: Material = Field(GLASS, description="solid of the wall")
    capillary_phases: Literal["always", "rebound", "bridge"] = Field(
        "always", description='"always" where there is liquid, on "rebound" only, or on the "bridge" only'
    )
    length_from: Literal["surface", "wall"] = Field(
        "surface", description='where the length of the bridge counts from: the "surface" of the layer, or the "wall"'
    )
    film_signs: Literal["goldman", "printed"] = Field(
        "goldman", description='of the coupling of sliding and spin in the film: "goldman" (1967), or as "printed"'
    )
    spring: Literal["cut", "kept"] | None = Field(
        None,
        description='of the contact along the wall while it slides: "cut" to Coulomb\'s limit, as the engine does, or '
        '"kept" as the whole displacement, as printed; if not given, what the solver does',
    )
    smallest_arc: float | None = Field(
        None, gt=0,
        description="floor of r_m for layers in which the toroid is singular; such layers are refused without [m]",
    )  # fmt: skip
    smallest_gap: float = Field(0.5e-6, gt=0, description="below it the film's resistance no longer grows [m]")
    gravity: float = Field(9.81, ge=0, le=1e4, description="towards the wall [m/s2]")
    tolerance: float = Field(1e-10, ge=1e-13, le=1e-3, description="of the equations, relative")
    solver: Literal["particles", "equations"] = Field(
        "particles",
        description='the "particles" engine, which cuts the spring and pulls always, or "equations" phase by phase',
    )

    @property
    def wetted(self) -> bool:
        """Whether there is liquid on the wall."""
        return self.film > 0.0 and self.liquid is not None

    def wet(self, ball: Ball, filled: float | None, friction: float) -> Wet:
        """The constants of the impact."""
        fluid = _named("liquid", self.liquid, LIQUIDS) if self.wetted else None
        radius, row = 0.5 * ball.diameter, pair_table([ball.material, self.wall])[0, 1]
        mass, stiffness = (
            ball.material.density * 4.0 / 3.0 * math.pi * radius**3,
            contact.hertz_stiffness(float(row["contact_modulus"]), radius),
        )
        cut = (self.spring or ("cut" if self.solver == "particles" else "kept")) == "cut"
        return Wet(
            radius=radius,
            mass=mass,
            gravity=self.gravity,
            stiffness=stiffness,
            damping_ratio=float(row["damping_ratio"]),
            shear_modulus=float(row["shear_modulus"]),
            friction=friction,
            film=self.film if self.wetted else 0.0,
            viscosity=fluid.viscosity if fluid else 0.0,
            liquid_density=fluid.density if fluid else 0.0,
            surface_tension=fluid.surface_tension if fluid else 0.0,
            contact_angle=math.radians(fluid.contact_angle) if fluid else 0.0,
            half_filling_angle=math.radians(filled) if filled else 0.0,
            smallest_gap=self.smallest_gap,
            smallest_arc=self.smallest_arc or 0.0,
            pulled_in=PULLED_IN[self.capillary_phases],
            length_from=self.film if self.length_from == "surface" else 0.0,
            printed_signs=self.film_signs == "printed",
            cutting_time=CUTTING * timescales.hertz_time(mass, stiffness, self.velocity) if cut else 0.0,
        )


@takes(WetImpact)
def impact(strike: WetImpact) -> Impact:
    """Let a sphere strike a wall that carries a liquid layer, from above.

    Raises InputError where the contact line of the bridge lies within the layer while the solids touch.

    >>> sliding = impact("alumina_1.74", None, angle=60, solver="equations")
    >>> round(sliding.restitution_tangential, 3), round(1 - 0.195 * 1.76 / math.tan(math.radians(60)), 3)
    (0.802, 0.802)
    """
    ball, velocity, spin = _named("particle", strike.particle, BALLS), strike.velocity, strike.spin
    if strike.wetted:
        _named("liquid", strike.liquid, LIQUIDS)
    liquid = strike.liquid if strike.wetted else None
    oblique = strike.angle != 0.0 or spin != 0.0
    rubs = (
        sliding_friction(strike.particle, liquid, strike.friction) if oblique or strike.friction is not None else None
    )
    filled = half_filling(strike.particle, liquid, strike.film, strike.half_filling_angle) if strike.wetted else None
    along = velocity * math.tan(math.radians(strike.angle))
    wet = strike.wet(ball, filled, rubs or 0.0)
    if strike.wetted and strike.smallest_arc is None and strike.capillary_phases != "bridge":
        _refuse_the_singular(wet)
    if strike.solver == "particles":
        _refuse_other_readings(wet, oblique)
        path = integrate_in_engine(wet, (ball.material, strike.wall), velocity, along, spin)
    else:
        path = integrate(wet, velocity, along, spin, strike.tolerance)
    return replace(_result(path, wet, velocity, along, spin, filled, rubs), warnings=_nearly_singular(wet))


def sticking_velocity(
    particle: str | Ball, liquid: str | Liquid, film: float, *, precision: float = 1e-4, **options: Any
) -> float:
    """Slowest normal impact that rebounds, by bisection [m/s].

    particle, liquid, film, options  as in :func:`impact`
    precision                        of the velocity, relative

    >>> round(sticking_velocity("glass_1.74", "water", 100e-6, precision=1e-3), 3)
    0.346
    """

    def sticks(velocity: float) -> bool:
        return impact(particle, liquid, film, velocity, **options).outcome == "stick"

    low, high = 0.0, 0.1
    while sticks(high):
        low, high = high, 2.0 * high
        if high > FASTEST:
            raise InputError("film", film, "thin enough for a sphere to rebound", f"it sticks even at {FASTEST:g} m/s")
    while high - low > precision * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sticks(middle) else (low, middle)
    return high


def _refuse_other_readings(wet: Wet, oblique: bool) -> None:
    """Refuse readings of the equations that the particle engine does not have."""
    if oblique and wet.cutting_time == 0.0:
        raise InputError("spring", "kept", '"cut" with solver="particles", for an impact that slides', REMEDY)
    if wet.film > 0.0 and wet.pulled_in != PULLED_IN["always"]:
        raise InputError("capillary_phases", None, '"always" with solver="particles"', REMEDY)


def _refuse_the_singular(wet: Wet) -> None:
    """Refuse a toroid whose contact line lies within the layer: its arc has no radius."""
    height = wet.radius * (1.0 - math.cos(wet.half_filling_angle))
    if height > wet.film:
        return
    least = math.degrees(math.acos(max(1.0 - wet.film / wet.radius, -1.0)))
    raise InputError(
        "half_filling_angle",
        round(math.degrees(wet.half_filling_angle), 3),
        f"above {least:.1f} degrees in a layer of {wet.film * 1e6:g} um, so that the contact line of the bridge stays "
        f"above the layer; it lies at {height * 1e6:.0f} um while the solids touch",
        "smallest_arc=5e-6 limits the radius of the toroid from below; the result then depends on this limit",
    )


def _nearly_singular(wet: Wet) -> tuple[str, ...]:
    """Warn if the suction before contact grows so much that the result depends on the arc of the toroid."""
    if wet.film == 0.0 or wet.pulled_in == PULLED_IN["bridge"]:
        return ()
    arc = motion.bridge(motion.toroid_of(wet), wet.radius).meridional
    if arc > SLENDER * wet.radius:
        return ()
    return (
        f"the arc of the toroid shrinks to {arc * 1e6:.2g} um at contact (below {SLENDER:g} of the radius): the "
        "result depends on it; compare with smallest_arc=5e-6",
    )


def _result(
    path: Path, wet: Wet, velocity: float, along: float, spin: float, filled: float | None, friction: float | None
) -> Impact:
    """The result from the end of the path."""
    end, nan = path.state[:, -1], math.nan
    rebounds, wetted = not path.stuck, filled is not None
    height, speed = float(end[motion.HEIGHT]), float(end[motion.SPEED])
    met = path.state[motion.SPEED, np.argmax(path.phase == 2)] if (path.phase == 2).any() else 0.0
    broken = motion.volume(motion.toroid_of(wet), height) if wetted and rebounds else None
    return Impact(
        outcome="rebound" if rebounds else "stick",
        restitution=speed / velocity if rebounds else 0.0,
        restitution_tangential=float(end[motion.ALONG]) / along if rebounds and along else nan,
        restitution_rotational=float(end[motion.SPIN]) / spin if rebounds and spin else nan,
        spin=float(end[motion.SPIN]),
        energy_lost={name[5:]: float(end[row]) for row, name in enumerate(COLUMNS) if name.startswith("lost_")},
        half_filling_angle=filled,
        friction=friction,
        contact_speed=-float(met),
        bridge_volume=broken,
        rupture_length=None
        if broken is None
        else float(
            capillary.rupture_length(wet.viscosity * max(speed, 0.0) / wet.surface_tension, wet.contact_angle, broken)
        ),
        duration=float(path.time[-1]),
        time=path.time,
        history=dict(zip(COLUMNS, path.state)) | {"phase": path.phase},
    )


def _named(name: str, value: Any, choices: dict[str, Any]) -> Any:
    """The value of a name; anything but a string is returned as it is."""
    if not isinstance(value, str):
        return value
    if value not in choices:
        raise InputError(name, value, nearest(value, choices))
    return choices[value]
