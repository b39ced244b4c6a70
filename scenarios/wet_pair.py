"""Two wet spheres meet obliquely, with a film that ends and a soft contact: stick, turn about each other, or bounce.

What you'll learn: which of the film laws between coated spheres matters, and when.

>>> from scenarios.wet_pair import collide_wet
>>> result = collide_wet(stokes=2.0, angle=45.0)
>>> result.outcome, round(result.restitution, 3)
('bounce', 0.527)
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from cfddem.errors import InputError, RunFailed, nearest
from cfddem.particles.bridge_loops import BRIDGE_FILMS, CUTS, PULLS, TANGENTIALS, BridgeLaws
from closures import contact
from closures.lubrication import film_strength
from closures.minimum_gap import glass_transition
from scenarios import wet_pair_motion as motion
from scenarios.wet_pair_motion import STATE, Numbers

BRIDGES = {name: BRIDGE_FILMS[name] for name in ("deforming", "static")}
TANGENTIAL: dict[str | None, int] = {None: TANGENTIALS["none"], **TANGENTIALS}

TRANSITION_PRESSURES = {
    ("static", "constant"): 4.9e6,
    ("static", "zero"): 23e6,
    ("deforming", "constant"): 2.6e6,
    ("deforming", "zero"): 11.6e6,
}
"""Pressure at which silicone oil of 10 Pa s turns to glass, as Punch et al. (2023, fig. 8) fitted each film [Pa]."""

_BUFFER = 4000


@dataclass(frozen=True)
class WetPair:
    """What came of a wet collision; speeds are taken where the films part, at h = film."""

    outcome: str  # "bounce", "stick_rotate_separate" or "stick"
    restitution: float  # normal speed of parting over that of impact; 0 where the pair has not parted [-]
    spin: float  # of each sphere, in the sense in which the pair turns [rad/s]
    separation_time: float | None  # after the films met [s]
    minimum_gap: float  # h_min [m]
    velocity: float  # normal speed of impact [m/s]
    turned: float  # by the line of centres [deg]
    history: dict[str, np.ndarray] = field(repr=False)  # time, gap, angle, approach speed, turning, spin
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """The result without its history, ready for JSON."""
        kept = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "history"}
        return kept | {"warnings": list(self.warnings)}


def collide_wet(
    stokes: float,
    angle: float = 0.0,
    bridge: str = "deforming",
    cut: str = "zero",
    tangential: str | None = "davis",
    friction: float = 0.0,
    capillary: bool = False,
    glass_transition_pressure: float | None = None,
    film: float = 270e-6,
    viscosity: float = 10.0,
    radius: float = 12.7e-3,
    density: float = 7960.0,
    youngs_modulus: float = 2.0e11,
    poisson: float = 0.35,
    restitution: float = 0.9,
    surface_tension: float = 0.0205,
    duration: float = 1.0,
) -> WetPair:
    r"""Let one wet sphere strike an equal one that rests; steel in silicone oil unless said otherwise.

    stokes                     St_n = m* v_n0 / (6 pi eta R*^2), of the normal speed of impact [-]
    angle                      between velocity and line of centres at impact, 0 <= angle < 90 [deg]
    bridge                     "deforming", which swells with the liquid squeezed out, or "static"
    cut                        film below h_min: "zero", or "constant" as at h_min
    tangential                 "davis", "nase", or None for no resistance of the film to sliding
    friction                   of the solids [-]
    capillary                  whether the bridge pulls
    glass_transition_pressure  that sets h_min; the one fitted for this bridge and cut if not given [Pa]
    film                       h_max, thickness of the liquid on both spheres together [m]
    viscosity                  of the film [Pa s]
    radius, density            of the spheres [m], [kg/m3]
    youngs_modulus, poisson    of the spheres [Pa], [-]
    restitution                dry, of the solids [-]
    surface_tension            of the film [N/m]
    duration                   after which a pair that has not parted counts as stuck [s]
    returns                    :class:`WetPair`

    >>> slow = collide_wet(stokes=0.5, angle=60.0)
    >>> slow.outcome, round(slow.spin, 2), round(slow.turned)
    ('stick_rotate_separate', 5.44, 47)
    """
    _check("stokes", stokes, 0.0 < stokes < math.inf, "above 0 and finite")
    _check("angle", angle, 0.0 <= angle < 90.0, "at least 0 and below 90 degrees")
    lengths = {"film": film, "radius": radius, "viscosity": viscosity, "density": density, "duration": duration}
    for name, value in (lengths | {"youngs_modulus": youngs_modulus}).items():
        _check(name, value, 0.0 < value < math.inf, "above 0 and finite")
    _check("restitution", restitution, 0.0 < restitution <= 1.0, "above 0 and at most 1")
    _check("poisson", poisson, -1.0 < poisson <= 0.5, "above -1 and at most 0.5")
    for name, value in (("friction", friction), ("surface_tension", surface_tension)):
        _check(name, value, 0.0 <= value < math.inf, "at least 0 and finite")
    liquid = BridgeLaws(
        viscosity=viscosity,
        surface_tension=surface_tension,
        film=_choice("bridge", bridge, BRIDGES),
        cut=_choice("cut", cut, CUTS),
        tangential=_choice("tangential", tangential, TANGENTIAL),
        pull=PULLS["constant" if capillary else "none"],
    )
    pressure = TRANSITION_PRESSURES[bridge, cut] if glass_transition_pressure is None else glass_transition_pressure
    _check("glass_transition_pressure", pressure, 0.0 < pressure < math.inf, "above 0 and finite")

    mass = density * 4.0 / 3.0 * math.pi * radius**3
    speed = stokes * film_strength(viscosity, 0.5 * radius) / (0.5 * mass)
    numbers = Numbers(
        speed=speed,
        film=film,
        minimum_gap=glass_transition(viscosity, speed, pressure, 0.5 * radius, film),
        radius=radius,
        mass=mass,
        modulus=contact.reduced_modulus(youngs_modulus, poisson, youngs_modulus, poisson),
        shear_modulus=contact.reduced_shear_modulus(youngs_modulus, poisson, youngs_modulus, poisson),
        damping_ratio=contact.damping_ratio(restitution),
        friction=friction,
        liquid=liquid,
    )
    parted, time, state, rows = _run(numbers, angle, duration, keep=True)
    bounces = parted and (angle == 0.0 or _run(numbers, 0.0, duration, keep=False)[0])
    return WetPair(
        outcome="bounce" if bounces else "stick_rotate_separate" if parted else "stick",
        restitution=-float(state[motion.APPROACH]) if parted else 0.0,
        spin=float(state[motion.SPIN]) * speed / film,
        separation_time=time if parted else None,
        minimum_gap=numbers.minimum_gap,
        velocity=speed,
        turned=math.degrees(float(state[motion.ANGLE])),
        history=_columns(rows, numbers),
        warnings=_caveats(numbers),
    )


def _caveats(numbers: Numbers) -> tuple[str, ...]:
    """Where the model says less than it seems to."""
    if numbers.minimum_gap < numbers.film:
        return ()
    caveat = (
        f"at {numbers.speed:.3g} m/s the liquid is glass through the whole film of {numbers.film:.3g} m, which then "
        "does not act; the fitted pressure does not hold at so high a Stokes number"
    )
    warnings.warn(caveat, stacklevel=3)
    return (caveat,)


def _run(numbers: Numbers, angle: float, duration: float, keep: bool) -> tuple[bool, float, np.ndarray, np.ndarray]:
    """Whether the films part, when, the state at the end, and the rows of the history."""
    unit = numbers.film / numbers.speed
    state = np.zeros(STATE)
    state[motion.GAP] = state[motion.APPROACH] = 1.0
    state[motion.TURNING] = math.tan(math.radians(angle)) / (2.0 * numbers.radius / numbers.film + 1.0)
    clock, counts = np.array([0.0, 1e-3, 0.0]), np.zeros(1, np.int64)
    samples = np.empty((_BUFFER if keep else 0, 1 + STATE))
    rows, reason = [np.concatenate([[0.0], state])[None]], motion.FULL
    while reason == motion.FULL:
        counts[0] = 0
        reason = motion.follow(clock, state, numbers, duration / unit, samples, counts)
        rows.append(samples[: counts[0]].copy())
    if reason == motion.STUCK:
        raise RunFailed(f"the pair cannot be followed beyond t = {clock[0] * unit:.6g} s; try a shorter duration")
    return reason == motion.PARTED, float(clock[0]) * unit, state, np.concatenate(rows)


def _columns(rows: np.ndarray, numbers: Numbers) -> dict[str, np.ndarray]:
    """History by name, in SI with the angle in degrees."""
    rate = numbers.speed / numbers.film
    return {
        "time": rows[:, 0] / rate,
        "gap": rows[:, 1 + motion.GAP] * numbers.film,
        "angle": np.degrees(rows[:, 1 + motion.ANGLE]),
        "approach_speed": rows[:, 1 + motion.APPROACH] * numbers.speed,
        "turning": rows[:, 1 + motion.TURNING] * rate,
        "spin": rows[:, 1 + motion.SPIN] * rate,
    }


Chosen = TypeVar("Chosen")


def _choice(name: str, value: Any, choices: dict[Any, Chosen]) -> Chosen:
    if value not in choices:
        raise InputError(name, value, nearest(str(value), [str(each) for each in choices]))
    return choices[value]


def _check(name: str, value: float, holds: bool, limit: str) -> None:
    if not holds:
        raise InputError(name, value, limit)
