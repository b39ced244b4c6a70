"""Wet impacts on a wall: figures 7 to 13 of Buck et al. (2018) redrawn, and comparisons.

The paper shows its results as figures only. The table compares the solution of its equations with a second solution,
the velocities below which spheres stick, dry sliding with its exact solution, and the sum of dissipated energies with
the loss.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, SKY, blank, label, legend, panels, save, shades
from scenarios.collisions.immersed_pair.study import collide
from scenarios.collisions.wet_wall.materials import ALUMINA, FRICTION, GLASS
from scenarios.collisions.wet_wall.study import Impact, impact, sticking_velocity
from scenarios.references.wet_wall.checks import independent
from scenarios.validation.table import Columns, Curves, Row, worst

exact = partial(impact, solver="equations")
CHANNELS = {"viscous": BLUE, "capillary": SKY, "contact": ORANGE, "gravity": GREY}
SPEEDS = np.concatenate([np.arange(0.2, 1.59, 0.04), np.linspace(1.6, 3.0, 6)])
ANGLES = np.array([1.0, 3.0, 6.0, *np.arange(10.0, 90.0, 4.0), 88.0, 89.0])
FLOOR = 5e-6
"""Least radius of the arc in layers whose toroid is singular; such curves are drawn dotted [m]."""


IMPACTS = (  # sphere, liquid, film, half-filling angle, speed, angle, spin, friction
    ("glass_1.74", "water", 100e-6, 35.0, 0.35, 0.0, 0.0, 0.0),
    ("glass_1.74", "water", 200e-6, 45.0, 0.6, 0.0, 0.0, 0.0),
    ("glass_0.91", "water", 100e-6, 45.0, 1.0, 0.0, 0.0, 0.0),
    ("alumina_1.74", "glycerol_51", 200e-6, 43.0, 2.0, 0.0, 0.0, 0.0),
    *(("alumina_1.74", "tween", 100e-6, 35.0, 1.0, angle, -960.0, 0.16) for angle in (10.0, 30.0, 50.0, 80.0)),
)
STICKING: tuple[tuple[str, str, float, float, float | None], ...] = (  # and the floor of the arc
    ("glass_1.74", "water", 100e-6, 0.345, None),
    ("glass_1.74", "water", 200e-6, 0.456, None),
    ("glass_0.91", "water", 100e-6, 0.587, None),
    ("alumina_1.74", "tween", 100e-6, 0.549, None),
    ("alumina_1.74", "water", 100e-6, 0.652, FLOOR),  # nearly singular: 0.673 without the floor
)
"""Velocities below which spheres stick, with limits of 2 % [m/s]."""


def solution(_: Path, __: Curves) -> list[Row]:
    """Wet wall: against a second solution of the same equations."""
    normal, along, spins = [], [], []
    for sphere, liquid, film, filled, speed, angle, spin, friction in IMPACTS:
        ours = exact(sphere, liquid, film, speed, angle=angle, spin=spin, friction=friction)
        e, e_t, omega = independent(sphere, liquid, film, filled, speed, angle, spin, friction)
        normal.append((speed, ours.restitution, e))
        if angle:
            along.append((angle, ours.restitution_tangential, e_t))
            spins.append((angle, ours.spin, omega))
    return [
        worst("wet wall: restitution against a second solution", normal, 0.005),
        worst("wet wall: tangential restitution against a second solution", along, 0.005),
        worst("wet wall: spin against a second solution", spins, 1.0, unit="rad/s"),
    ]


def engine(_: Path, __: Curves) -> list[Row]:
    """Wet wall: the particle engine against the equations, and the velocities below which it lets spheres stick."""
    times, normal, along, spins, slowest = [], [], [], [], []
    for sphere, liquid, film, _filled, speed, angle, spin, friction in IMPACTS:
        options: dict[str, Any] = {"angle": angle, "spin": spin, "friction": friction, "spring": "cut"}
        ours = impact(sphere, liquid, film, speed, **options)
        reference = exact(sphere, liquid, film, speed, **options)
        times.append((speed, ours.duration / reference.duration, 1.0))
        normal.append((speed, ours.restitution, reference.restitution))
        if angle:
            along.append((angle, ours.restitution_tangential, reference.restitution_tangential))
            spins.append((angle, ours.spin / reference.spin, 1.0))
    for sphere, liquid, film, published, arc in STICKING:
        slowest_velocity = sticking_velocity(sphere, liquid, film, precision=2e-3, smallest_arc=arc)
        slowest.append((published, slowest_velocity / published, 1.0))
    return [
        worst("wet wall, particle engine over equations: time until the bridge breaks", times, 0.005),
        worst("wet wall, particle engine: restitution against the equations", normal, 0.005),
        worst("wet wall, particle engine: tangential restitution against the equations", along, 0.005),
        worst("wet wall, particle engine over equations: spin", spins, 0.01),
        worst("wet wall, particle engine: velocities of sticking over the published ones", slowest, 0.02),
    ]


def sticking(_: Path, __: Curves) -> list[Row]:
    """Wet wall: velocities below which spheres stick."""
    rows = []
    for sphere, liquid, film, reference, arc in STICKING:
        velocity = sticking_velocity(sphere, liquid, film, precision=1e-3, smallest_arc=arc, solver="equations")
        floor = "" if arc is None else f", arc >= {arc * 1e6:.0f} um"
        name = f"wet wall: {sphere} sticks, {liquid}, {film * 1e6:.0f} um{floor}"
        rows.append(Row(name, velocity, reference, 0.02 * reference, "m/s"))
    case = ("glass_1.74", "water")
    for least in (1e-6, FLOOR, 20e-6):
        velocity = sticking_velocity(
            *case, 400e-6, precision=1e-2, tolerance=1e-8, smallest_arc=least, solver="equations"
        )
        rows.append(
            Row(f"wet wall: glass_1.74 sticks, 400 um, singular, arc >= {least * 1e6:.0f} um", velocity, unit="m/s")
        )
    readings: tuple[dict[str, Any], ...] = (
        {"capillary_phases": "rebound"}, {"capillary_phases": "bridge"}, {"length_from": "wall"}
    )  # fmt: skip
    for options in readings:
        velocity = sticking_velocity(*case, 100e-6, precision=1e-3, tolerance=1e-8, solver="equations", **options)
        chosen = " ".join(f"{name} {value}" for name, value in options.items())
        rows.append(Row(f"wet wall: glass_1.74 sticks, 100 um, {chosen}", velocity, 0.345, unit="m/s"))
    return rows


def head_on(folder: Path, curves: Curves) -> list[Row]:
    """Wet wall: restitution against velocity (figures 7 and 8)."""
    water = ("glass_1.74", "water")
    groups: tuple[tuple[str, tuple[Any, ...]], ...] = (
        (
            "glass 1.74 mm, water",
            (
                ("dry", GREY, "glass_1.74", None, 0.0, {}),
                ("100 um", SKY, *water, 100e-6, {}),
                ("200 um", BLUE, *water, 200e-6, {}),
                ("400 um", GREEN, *water, 400e-6, {"smallest_arc": FLOOR}),
            ),
        ),
        (
            "glass 0.91 mm, water",
            (
                ("100 um", SKY, "glass_0.91", "water", 100e-6, {}),
                ("200 um", BLUE, "glass_0.91", "water", 200e-6, {"smallest_arc": FLOOR}),
            ),
        ),
        (
            "glass 1.74 mm, 200 um",
            (
                ("1 mPa s", BLUE, *water, 200e-6, {}),
                ("3 mPa s", ORANGE, "glass_1.74", "glycerol_35", 200e-6, {"half_filling_angle": 45.0}),
                ("6.7 mPa s", RED, "glass_1.74", "glycerol_51", 200e-6, {"half_filling_angle": 45.0}),
            ),
        ),
        (
            "alumina 1.74 mm",
            (
                ("dry", GREY, "alumina_1.74", None, 0.0, {}),
                ("water, 100 um", SKY, "alumina_1.74", "water", 100e-6, {}),
                ("water, 200 um", BLUE, "alumina_1.74", "water", 200e-6, {}),
                ("35 % glycerol, 200 um", ORANGE, "alumina_1.74", "glycerol_35", 200e-6, {}),
            ),
        ),
    )
    figure, axes = blank(2, 2, width=10.0, height=7.6, sharex=True, sharey=True)
    fastest: dict[str, float] = {}
    for place, (title, cases) in enumerate(groups):
        for name, colour, sphere, liquid, film, options in cases:
            e = np.array([exact(sphere, liquid, film, float(v), tolerance=1e-8, **options).restitution for v in SPEEDS])
            curves[f"head_on/{sphere}/{liquid}/{film * 1e6:.0f}um"] = {"velocity": (SPEEDS, "m/s"), "e": (e, "-")}
            fastest[f"{sphere} {name}"] = float(e[-1])
            singular = "smallest_arc" in options
            named = name + f" (arc >= {1e6 * FLOOR:.0f} um)" * singular
            axes[place].plot(SPEEDS, e, ":" if singular else "-", color=colour, label=named)
        label(axes[place], "velocity", "m/s", "restitution", "-", title)
        axes[place].label_outer()
        axes[place].set_ylim(-0.03, 1.03)
        legend(axes[place], loc="lower right")
    save(figure, folder / "wet_wall_head_on.png")
    order = [fastest[f"glass_1.74 {name}"] for name in ("dry", "100 um", "200 um")]
    return [Row(f"wet wall: glass_1.74 at 3 m/s, {n}", e) for n, e in zip(("dry", "100 um", "200 um"), order)]


def energy(folder: Path, curves: Curves) -> list[Row]:
    """Wet wall: where the energy goes (figure 9)."""
    figure, axes = panels(2, width=10.0)
    points, shares = [], []
    cases = (("glass_1.74", 200e-6), ("glass_0.91", 100e-6))
    for place, (sphere, film) in enumerate(cases):
        speeds = np.linspace(0.7, 3.0, 12)
        results = [exact(sphere, "water", film, float(v)) for v in speeds]
        lost = {name: np.array([r.energy_lost[name] for r in results]) for name in CHANNELS}
        for v, r in zip(speeds, results):
            points.append((float(v), sum(r.energy_lost.values()), 0.5 * v**2 * (1.0 - r.restitution**2)))
        shares.append(results[4].energy_lost["capillary"] / sum(results[4].energy_lost.values()))
        axes[place].stackplot(speeds, *lost.values(), colors=list(CHANNELS.values()), labels=list(lost), alpha=0.9)
        title = f"glass {sphere[6:]} mm, {film * 1e6:.0f} um of water"
        label(axes[place], "velocity", "m/s", "energy lost over mass", "J/kg", title)
        legend(axes[place], loc="upper left")
        curves[f"energy/{sphere}"] = {"velocity": (speeds, "m/s")} | {n: (e, "J/kg") for n, e in lost.items()}
    save(figure, folder / "wet_wall_energy.png")
    return [
        worst("wet wall: sum of the dissipated energies against the loss", points, 1e-6, unit="J/kg"),
        Row("wet wall: capillary share of the loss, 0.91 mm", shares[1], note="above that of 1.74 mm in figure 9"),
        Row("wet wall: capillary share of the loss, 1.74 mm", shares[0]),
    ]


def oblique(folder: Path, curves: Curves) -> list[Row]:
    """Wet wall: oblique impacts of alumina, dry and wet (figure 10)."""
    figure, axes = panels(3, width=11.0)
    small = {}
    for liquid, colour, name in ((None, "#222222", "dry"), ("tween", ORANGE, "Tween 20, 100 um")):
        for spin, line in ((200.0, ":"), (0.0, "-"), (-300.0, "--")):
            results = _sweep("alumina_1.74", liquid, 100e-6, spin)
            if spin == 0.0:
                small[name] = results[2].restitution_tangential  # at 6 degrees
            _plot(axes, results, colour, line, f"{name}, {spin:g} rad/s")
            curves[f"oblique/{name}/{spin:g}"] = _columns(results)
    cut = _sweep("alumina_1.74", None, 0.0, 0.0, spring="cut")
    _plot(axes, cut, GREEN, "-", "dry, 0 rad/s, spring cut")
    curves["oblique/dry/cut"] = _columns(cut)
    axes[1].set_ylim(-0.5, 2.5)
    legend(axes[0], loc="lower left")
    save(figure, folder / "wet_wall_oblique.png")
    wetter = [exact("alumina_1.74", "tween", angle=a).restitution_tangential for a in (60.0, 89.0)]
    dryer = [exact("alumina_1.74", None, angle=a).restitution_tangential for a in (60.0, 89.0)]
    e, mu, points, turned = 0.76, 0.195, [], []
    for angle in (52.0, 60.0, 70.0, 80.0, 88.0):
        dry = exact("alumina_1.74", None, angle=angle)
        points.append((angle, dry.restitution_tangential, 1.0 - mu * (1.0 + e) / math.tan(math.radians(angle))))
        turned.append((angle, dry.spin / (-2.5 * mu * (1.0 + e) / 0.87e-3), 1.0))
    return [
        worst("wet wall: dry sliding, e_t = 1 - mu (1 + e)/tan", points, 1e-3),
        worst("wet wall: dry sliding, spin over -2.5 mu (1 + e) v/R", turned, 1e-3),
        worst("wet wall: dry e_t, spring cut, against the particle engine", _against_the_engine("cut")),
        worst("wet wall: dry e_t, spring kept, against the particle engine", _against_the_engine("kept")),
        Row("wet wall: e_t at 60 deg, Tween 20 against dry", wetter[0], dryer[0], note="less friction"),
        Row("wet wall: e_t at 89 deg, Tween 20 against dry", wetter[1], dryer[1], note="more film drag"),
        Row("wet wall: e_t at 6 deg, dry", small["dry"], 0.82, 0.01, note="about 0.82 in the text"),
        Row("wet wall: e_t at 6 deg, Tween 20", small["Tween 20, 100 um"], 0.82, 0.01, note="about 0.82 in the text"),
    ]


def spinning(folder: Path, curves: Curves) -> list[Row]:
    """Wet wall: spin before the impact (figures 11 and 12)."""
    figure, axes = blank(2, 2, width=10.0, height=7.6, sharex=True)
    spins = (-623.0, -961.0, -1366.0, -1777.0)
    for spin, colour in zip(spins, shades(4)):
        results = _sweep("alumina_1.74", "tween", 100e-6, spin)
        _plot(axes, results, colour, "-", f"{spin:g} rad/s")
        curves[f"spinning/{spin:g}"] = _columns(results)
    axes[1].set_ylim(0.0, 3.0)
    legend(axes[0], loc="lower left")
    save(figure, folder / "wet_wall_spinning.png")
    rolling = []
    for spin in spins:  # no friction where the lowest point is at rest along the wall
        angle = math.degrees(math.atan(-spin * 0.87e-3))
        dry = exact("alumina_1.74", None, angle=angle, spin=spin)
        rolling += [(spin, dry.restitution_tangential, 1.0), (spin, dry.restitution_rotational, 1.0)]
    wet = exact("alumina_1.74", "tween", 100e-6, angle=math.degrees(math.atan(961.0 * 0.87e-3)), spin=-961.0)
    return [
        worst("wet wall: e_t and e_omega of a dry rolling impact", rolling, 1e-6),
        Row("wet wall: e_omega of a wet rolling impact", wet.restitution_rotational, 1.0),
    ]


def liquids(folder: Path, curves: Curves) -> list[Row]:
    """Wet wall: liquid and thickness at -500 rad/s (figure 13)."""
    figure, axes = blank(2, 2, width=10.0, height=7.6, sharex=True)
    e = {}
    for name, colour, liquid, film in (
        ("dry", "#222222", None, 0.0),
        ("Tween 20, 100 um", BLUE, "tween", 100e-6),
        ("Tween 20, 150 um", GREEN, "tween", 150e-6),
        ("35 % glycerol, 100 um", ORANGE, "glycerol_35", 100e-6),
    ):
        results = _sweep("alumina_1.74", liquid, film, -500.0)
        _plot(axes, results, colour, "-", name)
        curves[f"liquids/{name}"] = _columns(results)
        e[name] = [r.restitution for r in results]
    axes[1].set_ylim(0.0, 3.0)
    legend(axes[0], loc="lower left")
    save(figure, folder / "wet_wall_liquids.png")
    spread = max(max(values) - min(values) for values in e.values())
    return [Row("wet wall: restitution, spread over all angles", spread, 0.0, 1e-6)]


def _against_the_engine(spring: str) -> list[tuple[float, float, float]]:
    """Dry tangential restitution here and in the particle engine, whose springs are cut to Coulomb's limit."""
    points = []
    solids = tuple(solid.model_copy(update={"friction": FRICTION[None]}) for solid in (ALUMINA, GLASS))
    for angle in (5.0, 10.0, 20.0, 30.0, 40.0, 60.0):
        dry = {"velocity": 1.0, "viscosity": 0.0, "angle": angle, "against": "wall", "step_fraction": 2e-3}
        engine = collide(solids, diameter=1.74e-3, **dry)  # type: ignore[arg-type]
        here = exact("alumina_1.74", None, angle=angle, spring=spring, tolerance=1e-8)
        points.append((angle, here.restitution_tangential, engine.restitution_tangential))
    return points


def _sweep(sphere: str, liquid: str | None, film: float, spin: float, **options: Any) -> list[Impact]:
    """Impacts at 1 m/s along the normal, over the angles."""
    return [exact(sphere, liquid, film, angle=float(a), spin=spin, tolerance=1e-9, **options) for a in ANGLES]


_SHOWN = {
    "restitution": ("restitution", "-"),
    "restitution_tangential": ("tangential restitution", "-"),
    "spin": ("spin afterwards", "rad/s"),
    "restitution_rotational": ("rotational restitution", "-"),
}


def _columns(results: list[Impact]) -> Columns:
    shown = {name: (np.array([getattr(r, name) for r in results]), unit) for name, (_, unit) in _SHOWN.items()}
    return {"angle": (ANGLES, "deg")} | shown


def _plot(axes: Any, results: list[Impact], colour: Any, line: str, name: str) -> None:
    """One curve in as many panels as there are."""
    for axis, (column, (title, unit)) in zip(axes, _SHOWN.items()):
        axis.plot(ANGLES, [getattr(r, column) for r in results], line, color=colour, label=name)
        label(axis, "impact angle", "deg", title, unit)
    axes[0].set_ylim(0.0, 1.0)


PARTS: tuple[Callable[[Path, Curves], list[Row]], ...] = (
    solution, engine, sticking, head_on, energy, oblique, spinning, liquids,
)  # fmt: skip
