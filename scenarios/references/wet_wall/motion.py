"""A sphere meets a wall under a liquid layer: the forces and the motion in each phase.

Phase I, into the layer; II, contact with the wall; III, out of the layer; IV, on a liquid bridge until it breaks.
Along the normal, viscous and capillary forces and gravity act outside the contact; inside it the contact and
gravity alone. Along the wall, the contact acts in II and the film of the layer in I and III.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cfddem.backend.errors import RunFailed
from closures import capillary, contact, layer, lubrication, numbers, timescales
from closures.friction import coulomb_limit
from scenarios.references.ode import event

LONGEST = 1.0
"""A sphere that has not left a phase after this time has stuck [s]."""

NECK = 1e-3
"""Least radius of the neck of a bridge, over that of the sphere."""

BOUNCES = 30.0
"""A contact that lasts this many Hertz times is a sphere at rest on the wall."""

PHASES = ("I", "II", "III", "IV")
COLUMNS = {
    "height": "m",
    "speed": "m/s",
    "distance": "m",
    "speed_along": "m/s",
    "spin": "rad/s",
    "displacement": "m",
    "lost_contact": "J/kg",
    "lost_viscous": "J/kg",
    "lost_capillary": "J/kg",
    "lost_gravity": "J/kg",
}
"""Columns of the history with units.

They are height of the centre above the wall and its rate, the same along the wall, spin, and tangential displacement of
the contact point. The others are the energy dissipated by each kind of force, over the mass.
"""

HEIGHT, SPEED, DISTANCE, ALONG, SPIN, DISPLACEMENT = range(6)
CONTACT, VISCOUS, CAPILLARY, GRAVITY = range(6, 10)
_SCALE = np.array([1e-6, 1.0, 1e-6, 1.0, 1e3, 1e-6, 1.0, 1.0, 1.0, 1.0])
"""Least size of each column to which the relative tolerance applies."""


class Wet(NamedTuple):
    """Constants of an impact, in SI units and radians."""

    radius: float
    mass: float
    gravity: float
    stiffness: float  # k of the Hertz contact [N/m^1.5]
    damping_ratio: float
    shear_modulus: float  # G* [Pa]
    friction: float
    film: float  # thickness of the layer; 0 dry [m]
    viscosity: float
    liquid_density: float
    surface_tension: float
    contact_angle: float
    half_filling_angle: float
    smallest_gap: float  # below it the resistance of the film is constant [m]
    smallest_arc: float  # lower limit of r_m [m]
    pulled_in: tuple[str, ...]  # phases with a capillary force
    length_from: float  # height of the sphere's lowest point from which the length of the bridge counts [m]
    printed_signs: bool  # of the coupling of sliding and spin in the film
    cutting_time: float  # in which the spring of a sliding contact is cut to Coulomb's limit; 0: it is kept [s]


class Bridge(NamedTuple):
    """The toroid at one height of the sphere."""

    line_radius: float
    line_height: float
    meridional: float
    azimuthal: float


class Toroid(NamedTuple):
    """What the shape of a bridge depends on, apart from the height of the sphere."""

    radius: float  # of the sphere
    film: float  # thickness of the layer
    half_filling_angle: float
    contact_angle: float
    smallest_arc: float


def toroid_of(wet: Wet) -> Toroid:
    """The bridge of an impact."""
    return Toroid(wet.radius, wet.film, wet.half_filling_angle, wet.contact_angle, wet.smallest_arc)


def bridge(toroid: Toroid, height: float) -> Bridge:
    """Shape of the bridge while the centre is at a height."""
    filled, wetting = toroid.half_filling_angle, toroid.contact_angle
    line_radius = toroid.radius * math.sin(filled)
    line_height = height - toroid.radius * math.cos(filled) - toroid.film
    arc = max(capillary.meridional_radius(line_height, filled, wetting), toroid.smallest_arc)
    return Bridge(line_radius, line_height, arc, capillary.azimuthal_radius(line_radius, arc, filled, wetting))


def pull(toroid: Toroid, surface_tension: float, height: float) -> float:
    """Capillary pull towards the wall [N]."""
    line_radius, _, arc, azimuthal = bridge(toroid, height)
    neck = max(azimuthal, NECK * toroid.radius)  # only trial steps reach a closed neck
    filled, wetting = toroid.half_filling_angle, toroid.contact_angle
    return capillary.toroid_pull(surface_tension, line_radius, arc, neck, filled, wetting)


def volume(toroid: Toroid, height: float) -> float:
    """Liquid in the bridge [m3]."""
    _, line_height, arc, neck = bridge(toroid, height)
    filled, wetting = toroid.half_filling_angle, toroid.contact_angle
    return max(0.0, capillary.toroid_volume(toroid.radius, arc, neck, line_height, filled, wetting))


def length_left(wet: Wet, height: float, speed: float) -> float:
    """How far the bridge can still be stretched before it ruptures [m]."""
    number = numbers.capillary(wet.viscosity, max(speed, 0.0), wet.surface_tension)
    longest = capillary.rupture_length(number, wet.contact_angle, volume(toroid_of(wet), height))
    return longest - (height - wet.radius - wet.length_from)


def resistance(
    radius: float,
    gap: float,
    speed: float,
    half_filling_angle: float,
    viscosity: float,
    density: float,
    smallest_gap: float,
) -> float:
    """Viscous resistance along the normal: drag of the wetted part or the film's, whichever is larger [kg/s]."""
    width = 2.0 * radius * math.sin(half_filling_angle)
    drag = layer.white(numbers.reynolds(density, abs(speed), width, viscosity))
    film = lubrication.film_strength(viscosity, radius) / max(gap, smallest_gap)
    return max(3.0 * math.pi * viscosity * width * drag, film)


def resistance_of(wet: Wet, height: float, speed: float) -> float:
    """The same of an impact [kg/s]."""
    return resistance(
        wet.radius, height - wet.radius, speed, wet.half_filling_angle, wet.viscosity, wet.liquid_density,
        wet.smallest_gap,
    )  # fmt: skip


def film_along(wet: Wet, height: float, along: float, spin: float) -> tuple[float, float]:
    """Force along the wall and torque of the film between sphere and wall [N, N m]."""
    ratio = max(height - wet.radius, wet.smallest_gap) / wet.radius
    rolling = spin * wet.radius
    force_of_spin, torque_of_sliding = layer.spin_force(ratio), layer.sliding_torque(ratio)
    if wet.printed_signs:
        force_of_spin, torque_of_sliding = force_of_spin + 2.0 * 0.2526, torque_of_sliding + 2.0 * 0.1895
    force = layer.sliding_force(ratio) * along + force_of_spin * rolling
    torque = torque_of_sliding * along + layer.spin_torque(ratio) * rolling
    strength = wet.viscosity * wet.radius
    return -6.0 * math.pi * strength * force, -8.0 * math.pi * strength * wet.radius * torque


def touch(wet: Wet, state: Any) -> tuple[float, float, float]:
    """Normal force and force along the wall of the contact [N], and the rate of its spring's displacement [m/s].

    A sliding contact carries friction times the normal force, with its sign, also in the weak pull that ends a damped
    contact. The tangential impulse of a contact that slides throughout is therefore friction times the normal impulse.
    A truncated spring follows Coulomb's limit, less the force of the dashpot, within a small part of the contact time;
    as in the particle engine, such a contact has no friction while it pulls.
    """
    overlap = max(wet.radius - state[HEIGHT], 0.0)
    damping = contact.hertz_damping(wet.damping_ratio, wet.mass, wet.stiffness, overlap)
    normal = contact.hertz_force(wet.stiffness, overlap) - damping * state[SPEED]
    slip = state[ALONG] + state[SPIN] * wet.radius
    stiffness = contact.mindlin_stiffness(wet.shear_modulus, wet.radius, overlap)
    pulled = stiffness * state[DISPLACEMENT] + damping * slip
    limit = coulomb_limit(wet.friction, normal)
    if abs(pulled) <= limit:
        return normal, -pulled, slip
    rate = slip
    if wet.cutting_time > 0.0 and stiffness > 0.0:
        carried = max(limit - math.copysign(damping, pulled) * slip, 0.0)
        rate -= (state[DISPLACEMENT] - math.copysign(carried / stiffness, pulled)) / wet.cutting_time
        return normal, -math.copysign(limit, pulled), rate
    return normal, -math.copysign(wet.friction * normal, pulled * normal), rate


def rates(wet: Wet, phase: str) -> Callable[[float, Any], list[float]]:
    """Rates of all columns in one phase."""
    inertia = 0.4 * wet.mass * wet.radius**2
    wetted, in_layer, on_bridge = phase != "II", phase in ("I", "III"), phase == "IV"
    pulled, toroid = phase in wet.pulled_in, toroid_of(wet)

    def of(_: float, state: Any) -> list[float]:
        height, speed, along, spin = state[HEIGHT], state[SPEED], state[ALONG], state[SPIN]
        pressed = sideways = couple = touched = drawn = viscous = rubbed = stretched = 0.0
        if wetted:
            above = max(height, wet.radius)  # phases in the layer end there; only trial steps go below
            viscous = -resistance_of(wet, above, speed) * speed
            if pulled:
                drawn = -pull(toroid, wet.surface_tension, above)
            if in_layer:
                sideways, couple = film_along(wet, above, along, spin)
            rubbed = viscous * speed + sideways * along + couple * spin
        else:
            pressed, sideways, stretched = touch(wet, state)
            couple = wet.radius * sideways
            touched = pressed * speed + sideways * along + couple * spin
        weight = wet.mass + (wet.liquid_density * volume(toroid, height) if on_bridge else 0.0)
        fall = weight * wet.gravity
        return [
            speed,
            (pressed + viscous + drawn - fall) / wet.mass,
            along,
            sideways / wet.mass,
            couple / inertia,
            stretched,
            -touched / wet.mass,
            -rubbed / wet.mass,
            -drawn * speed / wet.mass,
            fall * speed / wet.mass,
        ]

    return of


class Path(NamedTuple):
    """The motion from the surface of the layer until the bridge breaks, or the sphere sticks."""

    time: np.ndarray  # [s]
    state: np.ndarray  # (columns, times)
    phase: np.ndarray  # number of the phase, 1 to 4
    ends: dict[str, float]  # time at which each phase ended [s]
    stuck: bool


def integrate(wet: Wet, speed: float, along: float, spin: float, tolerance: float) -> Path:
    """Move a sphere that arrives at the surface of the layer, or of a dry wall.

    speed      towards the wall, > 0 [m/s]
    along      along the wall [m/s]
    spin       [rad/s]
    tolerance  of each step, relative
    """
    state = np.zeros(len(COLUMNS))
    state[HEIGHT], state[SPEED], state[ALONG], state[SPIN] = wet.radius + wet.film, -speed, along, spin
    dry = wet.film == 0.0
    time, times, states, phases, ends = 0.0, [], [], [], {}
    for phase in ("II",) if dry else PHASES:
        if phase == "II":
            state[HEIGHT], state[DISPLACEMENT] = wet.radius, 0.0
        through, at_rest = _ends(wet, phase)
        stops = [through] if phase in ("I", "II") else [through, at_rest]
        longest = LONGEST
        if phase == "II":
            longest = BOUNCES * timescales.hertz_time(wet.mass, wet.stiffness, -float(state[SPEED]))
        solution = solve_ivp(
            rates(wet, phase),
            (time, time + longest),
            state,
            method="LSODA",
            rtol=tolerance,
            atol=tolerance * _SCALE,
            events=stops,
        )
        if solution.status < 0 or not np.isfinite(solution.y[:, -1]).all():
            raise RunFailed(f"phase {phase} of a wet impact at {speed:g} m/s stopped: {solution.message}")
        times.append(solution.t)
        states.append(solution.y)
        phases.append(np.full(len(solution.t), PHASES.index(phase) + 1))
        time, state = float(solution.t[-1]), solution.y[:, -1].copy()
        ends[phase] = time
        if not solution.t_events[0].size:
            return Path(np.concatenate(times), np.hstack(states), np.concatenate(phases), ends, True)
    if not dry and bridge(toroid_of(wet), state[HEIGHT]).azimuthal <= NECK * wet.radius:
        raise RunFailed(
            f"the neck of the bridge closed at a height of {state[HEIGHT] - wet.radius:.3g} m before the bridge broke; "
            "the toroid does not describe it, take a larger half_filling_angle"
        )
    return Path(np.concatenate(times), np.hstack(states), np.concatenate(phases), ends, False)


def _ends(wet: Wet, phase: str) -> tuple[Any, Any]:
    """Events that end a phase: the sphere reaches its end, or comes to rest while it moves out."""
    toroid = toroid_of(wet)

    def at_wall(_: float, state: Any) -> float:
        return float(state[HEIGHT] - wet.radius)

    def at_surface(_: float, state: Any) -> float:
        return float(state[HEIGHT] - wet.radius - wet.film)

    def breaks(_: float, state: Any) -> float:
        closed = bridge(toroid, state[HEIGHT]).azimuthal - NECK * wet.radius
        return min(length_left(wet, state[HEIGHT], state[SPEED]), closed)

    def rests(_: float, state: Any) -> float:
        return float(state[SPEED])

    through = {"I": at_wall, "II": at_wall, "III": at_surface, "IV": breaks}[phase]
    return event(through, {"I": -1, "II": 1, "III": 1, "IV": -1}[phase]), event(rests, -1)
