"""Commands that let a few spheres meet: the scenarios that end in numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cfddem.commands.printing import show, tell_of_compilation
from cfddem.errors import InputError, nearest


def collide(
    *,
    material: Annotated[str, Parameter(help="steel_smooth, steel_rough, glass or delrin")] = "delrin",
    target: Annotated[str | None, Parameter(help="material of the target or wall; the same if not given")] = None,
    diameter: Annotated[float, Parameter(help="of the striker [m]")] = 12.7e-3,
    target_diameter: Annotated[float | None, Parameter(help="of the target; the same if not given [m]")] = None,
    velocity: Annotated[float | None, Parameter(help="normal approach speed at h_co [m/s]")] = None,
    viscosity: Annotated[float | None, Parameter(help="of the fluid; 0 for a dry collision [Pa s]")] = None,
    stokes: Annotated[float | None, Parameter(help="of the normal approach; give two of the three")] = None,
    angle: Annotated[float, Parameter(help="between velocity and line of centres [deg]")] = 0.0,
    against: Annotated[str, Parameter(help="sphere or wall")] = "sphere",
    trajectory: Annotated[str, Parameter(help="frozen or full")] = "frozen",
    spin: Annotated[float, Parameter(help="of the striker before [rad/s]")] = 0.0,
    integrator: Annotated[str, Parameter(help="drift or verlet")] = "drift",
    friction_onset: Annotated[str, Parameter(help="film or overlap")] = "film",
    step_fraction: Annotated[float | None, Parameter(help="time step over the Hertz time")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let two spheres, or a sphere and a wall, collide in a fluid.

    Example: cfddem collide --material delrin --stokes 30 --velocity 0.1
    """
    tell_of_compilation()
    from scenarios.binary_collision import MATERIALS
    from scenarios.binary_collision import collide as run

    for name in (material, target):
        if name is not None and name not in MATERIALS:
            raise InputError("material", name, nearest(name, MATERIALS))
    result = run(
        (MATERIALS[material], MATERIALS[target or material]),
        diameter=(diameter, diameter if target_diameter is None else target_diameter),
        velocity=velocity,
        viscosity=viscosity,
        stokes=stokes,
        angle=angle,
        against=against,
        trajectory=trajectory,
        spin=(spin, 0.0),
        integrator=integrator,
        friction_onset=friction_onset,
        step_fraction=step_fraction,
    )
    show(result.summary(), _COLLISION_UNITS, json)


_COLLISION_UNITS = {
    "rebound_angle_striker": "deg",
    "rebound_angle_relative": "deg",
    "minimum_gap": "m",
    "stop_gap": "m",
    "spin": "rad/s",
}


def wet_wall(
    *,
    particle: Annotated[str, Parameter(help="glass_0.91, glass_1.74 or alumina_1.74")] = "glass_1.74",
    liquid: Annotated[str, Parameter(help="water, tween, glycerol_35 or glycerol_51")] = "water",
    film: Annotated[float, Parameter(help="thickness of the liquid layer; 0 for a dry wall [m]")] = 100e-6,
    velocity: Annotated[float, Parameter(help="normal speed where the sphere meets the layer [m/s]")] = 1.0,
    angle: Annotated[float, Parameter(help="between velocity and normal [deg]")] = 0.0,
    spin: Annotated[float, Parameter(help="before [rad/s]")] = 0.0,
    half_filling_angle: Annotated[
        float | None, Parameter(help="of the bridge; the measured one if known [deg]")
    ] = None,
    friction: Annotated[float | None, Parameter(help="of the contact; the published one if known")] = None,
    capillary_phases: Annotated[str, Parameter(help="always, rebound or bridge")] = "always",
    length_from: Annotated[str, Parameter(help="length of the bridge from the surface or the wall")] = "surface",
    smallest_arc: Annotated[float | None, Parameter(help="floor of the toroid's arc in thick layers [m]")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a sphere strike a wall under a thin liquid layer.

    Example: cfddem wet-wall --particle glass_1.74 --film 2e-4 --velocity 0.6
    """
    from scenarios.wet_wall import impact

    result = impact(
        particle,
        liquid,
        film,
        velocity,
        angle=angle,
        spin=spin,
        half_filling_angle=half_filling_angle,
        friction=friction,
        capillary_phases=capillary_phases,
        length_from=length_from,
        smallest_arc=smallest_arc,
    )
    values = result.summary()
    if not json:
        values |= {f"{name}_lost": energy for name, energy in values.pop("energy_lost").items()}
    show(values, _WET_WALL_UNITS, json)


_WET_WALL_UNITS = {
    "spin": "rad/s",
    "half_filling_angle": "deg",
    "contact_speed": "m/s",
    "bridge_volume": "m3",
    "rupture_length": "m",
    "duration": "s",
    "contact_lost": "J/kg",
    "viscous_lost": "J/kg",
    "capillary_lost": "J/kg",
    "gravity_lost": "J/kg",
}


def three_spheres(
    *,
    stokes: Annotated[float, Parameter(help="of the normal speed of impact")] = 8.0,
    theta12: Annotated[float, Parameter(help="line of centres 1-2 against the velocity [deg]")] = 45.0,
    theta23: Annotated[float, Parameter(help="line of centres 2-3 against the velocity [deg]")] = 0.0,
    film_ratio: Annotated[float, Parameter(help="film of the first pair over the diameter")] = 0.01,
    minimum_gap: Annotated[float, Parameter(help="gap at which solids touch, over the film")] = 0.05,
    capillary_number: Annotated[float, Parameter(help="infinite for no capillary pull")] = float("inf"),
    friction: Annotated[float, Parameter(help="of the solids")] = 0.0,
    restitution: Annotated[float, Parameter(help="of the solids, dry")] = 1.0,
    gap23: Annotated[float, Parameter(help="first gap of 2 and 3 over the film")] = 1.0,
    film23: Annotated[float, Parameter(help="film of 2 and 3 over that of 1 and 2")] = 1.0,
    film13: Annotated[float, Parameter(help="film of 1 and 3 over that of 1 and 2")] = 1.0,
    spheres: Annotated[int, Parameter(help="3, or 2 without the third")] = 3,
    until: Annotated[float, Parameter(help="way of the striker at its first speed, in diameters")] = 8.0,
    map: Annotated[Path | None, Parameter(help="picture of the outcomes at all St and angles, PNG")] = None,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a wet sphere strike a resting pair of wet spheres.

    Example: cfddem three-spheres --stokes 12 --theta12 30
    """
    given = {name: value for name, value in locals().items() if name not in ("json", "map")}
    tell_of_compilation()
    from scenarios.three_spheres import simulate
    from scenarios.three_spheres_figures import draw_map

    if map is not None:
        draw_map(map, given)

    values = simulate(**given).summary()
    if not json:
        events, contacts = values.pop("events"), values.pop("contacts")
        values |= {f"contacts{pair}": count for pair, count in contacts.items()}
    show(values, {}, json)
    if not json:
        for event in events:
            print("t = {time:<9.4f} t* = {time_star:<8.4f} {pair} {kind:<8} at {speed:.4f}".format(**event))


def wet_pair(
    *,
    stokes: Annotated[float, Parameter(help="of the normal speed of impact")] = 2.0,
    angle: Annotated[float, Parameter(help="between velocity and line of centres [deg]")] = 0.0,
    bridge: Annotated[str, Parameter(help="deforming or static")] = "deforming",
    cut: Annotated[str, Parameter(help="film below the minimum gap: zero or constant")] = "zero",
    tangential: Annotated[str, Parameter(help="film across the line of centres: davis, nase or none")] = "davis",
    friction: Annotated[float, Parameter(help="of the solids")] = 0.0,
    capillary: Annotated[bool, Parameter(help="with a capillary pull", negative="")] = False,
    glass_transition_pressure: Annotated[
        float | None, Parameter(help="that sets the minimum gap; the fitted one if not given [Pa]")
    ] = None,
    film: Annotated[float, Parameter(help="on both spheres together [m]")] = 270e-6,
    viscosity: Annotated[float, Parameter(help="of the film [Pa s]")] = 10.0,
    radius: Annotated[float, Parameter(help="of the spheres [m]")] = 12.7e-3,
    restitution: Annotated[float, Parameter(help="of the solids, dry")] = 0.9,
    duration: Annotated[float, Parameter(help="after which a pair counts as stuck [s]")] = 1.0,
    json: Annotated[bool, Parameter(help="print the result as JSON", negative="")] = False,
) -> None:
    """Let a wet steel sphere strike another that rests.

    Example: cfddem wet-pair --stokes 1.2 --angle 60
    """
    given = {name: value for name, value in locals().items() if name not in ("json", "tangential")}
    tell_of_compilation()
    from scenarios.wet_pair import collide_wet

    result = collide_wet(**given, tangential=None if tangential == "none" else tangential)
    show(result.summary(), _WET_PAIR_UNITS, json)


_WET_PAIR_UNITS = {"spin": "rad/s", "separation_time": "s", "minimum_gap": "m", "velocity": "m/s", "turned": "deg"}
