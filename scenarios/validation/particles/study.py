"""The particle engine: MFIX' cases of one sphere, oblique impacts, a bed at rest, slopes, a hopper, many films.

One sphere: MFIX DEM01, DEM02 and DEM04 (Garg et al. 2012) against their exact solutions; Kharaz, Gorham & Salman
(2001) against their measurements. A bed must come to rest and press on its floor with its weight; a slope must
keep its angle under water; a hopper follows Beverloo et al. (1961); films never raise kinetic energy. The
poured beds have rolling friction, because without it particles would roll indefinitely.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from scenarios.validation.particles import few_spheres, granular_beds
from scenarios.validation.sheared_films.study import krieger_dougherty, sheared
from scenarios.validation.table import Curves, Progress, Row, in_parts, reference, worst

ANGLE = 9.0
"""Impacts of Kharaz et al. have a limit at this angle and above; below it e_t divides two small numbers [deg]."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, _draw, folder, progress)


def falling(curves: Curves) -> list[Row]:
    """DEM01 and DEM02: a sphere falls on a spring."""
    fall = few_spheres.DROP_HEIGHT - few_spheres.BALL_RADIUS
    points = []
    for stiffness in (1e4, 2.5e4, 5e4, 1e5):
        for restitution in (0.6, 0.8, 1.0):
            time, height = few_spheres.drop(stiffness, restitution, 0.6)
            exact = few_spheres.drop_exactly(stiffness, restitution, time)
            points.append((stiffness, float(np.abs(height - exact).max()) / fall, 0.0))
    apexes = []
    for restitution, until in ((0.6, 0.93), (0.9, 1.8)):
        time, height = few_spheres.drop(5e6, restitution, until, samples=2000)
        curves[f"dem02/restitution_{restitution}"] = {"time": (time, "s"), "height": (height, "m")}
        top = (height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])
        for bounce, apex in enumerate(height[1:-1][top][:3], 1):
            hard = few_spheres.BALL_RADIUS + fall * restitution ** (2 * bounce)
            apexes.append((restitution, apex / hard, 1.0))
    return [
        worst("DEM01: error of the path over the fall", points, 1e-3),
        worst("DEM02: apex over that of a hard sphere", apexes, 0.01),
    ]


def rolling(curves: Curves) -> list[Row]:
    """DEM04: a sliding sphere begins to roll."""
    runs = {(mu, linear): few_spheres.slide(mu, linear) for mu in (0.2, 0.4, 0.6, 0.8, 1.0) for linear in (False, True)}
    ends = [(mu, run["time"], 2.0 / 7.0) for (mu, _), run in runs.items()]

    def kept(when: str) -> list[tuple[float, float, float]]:
        return [
            (mu, run[f"{motion}, {when}"], 5.0 / 7.0) for (mu, _), run in runs.items() for motion in ("speed", "spin")
        ]

    return [
        worst("DEM04: end of sliding, mu g t/u0", ends, 6e-3 * 2.0 / 7.0),
        worst("DEM04: u/u0 and omega r/u0 at the end of sliding", kept("end of sliding"), 5e-3 * 5.0 / 7.0),
        worst("DEM04: u/u0 and omega r/u0, rolling", kept("rolling"), 5e-4 * 5.0 / 7.0),
    ]


def oblique(curves: Curves) -> list[Row]:
    """Kharaz et al.: oblique impacts of aluminium oxide."""
    columns = reference("kharaz2001_oblique_experiment")
    measured = list(zip(columns["observable"], map(float, columns["impact_angle [deg]"]), map(float, columns["value"])))
    rows = []
    spans = {"e_t": None, "com_rebound_angle [deg]": 57.5, "omega_out [rad/s]": 613.0}
    limits = {"e_t": 0.05, "com_rebound_angle [deg]": 0.05, "omega_out [rad/s]": 0.08}
    for observable, span in spans.items():
        points = [
            (angle, few_spheres.strike(angle)[observable], value)
            for name, angle, value in measured
            if name == observable
        ]
        angle, ours, theirs = np.array(sorted(points)).T
        name, _, unit = observable.partition(" [")
        unit = unit.rstrip("]") or "-"
        curves[f"kharaz/{name}"] = {"angle": (angle, "deg"), "model": (ours, unit), "measured": (theirs, unit)}
        scaled = [(at, o / (span or t), t / (span or t)) for at, o, t in zip(angle, ours, theirs)]
        over = "its value" if span is None else "its range"
        title = f"Kharaz, {name} over {over}"
        rows.append(worst(f"{title}, {ANGLE:g} deg and more", [p for p in scaled if p[0] >= ANGLE], limits[observable]))
        rows.append(worst(f"{title}, below", [p for p in scaled if p[0] < ANGLE]))
    return rows


def resting(curves: Curves) -> list[Row]:
    """A poured bed lies still and presses on its floor."""
    rows = []
    for count, width in ((400, 8e-3), (2000, 12e-3)):
        name = f"bed of {count}"
        try:
            bed = granular_beds.rest(count, width, 0.05)
        except RunFailed as failure:
            rows.append(Row(f"{name}: kinetic over poured energy", np.nan, 0.0, 1e-7, note=str(failure)))
            continue
        curves[f"rest_{count}"] = {
            "energy_over_poured": (bed.energy / bed.poured, "-"),
            "floor_over_weight": (bed.weight, "-"),
        }
        rows += [
            Row(f"{name}: time to rest", bed.settled, unit="s"),
            Row(f"{name}: largest kinetic over poured energy", float(bed.energy.max() / bed.poured), 0.0, 1e-7),
            Row(f"{name}: mean force on the floor over weight", float(bed.weight.mean()), 1.0, 1e-3),
        ]
    return rows


def slopes(curves: Curves) -> list[Row]:
    """A tilted bed, dry and under water."""
    rows = []
    for friction in (0.2, 0.5):
        angles = {}
        for name, film, onset in (("dry", False, "film"), ("wet", True, "film"), ("wet_overlap", True, "overlap")):
            angles[name], tilt, speed = granular_beds.slope(friction, film, onset)
            curves[f"slope/friction_{friction}_{name}"] = {"angle": (tilt, "deg"), "speed": (speed, "m/s")}
        rows.append(Row(f"slope, mu {friction}: under water against dry", angles["wet"], angles["dry"], 2.0, "deg"))
        rolls, _, _ = granular_beds.slope(friction, False, rolling_friction=0.3)
        rows.append(Row(f"slope, mu {friction}: with rolling friction of 0.3", rolls, angles["dry"], unit="deg"))
        rows.append(
            Row(f"slope, mu {friction}: friction at overlap only", angles["wet_overlap"], angles["dry"], unit="deg")
        )
    return rows


def hopper(curves: Curves) -> list[Row]:
    """Discharge of a hopper."""
    flow, beverloo = granular_beds.hopper(5000, 8.0, 0.4)
    note = "three packings give 0.86 to 0.88"
    return [Row("hopper, hole of 8 d: discharge over Beverloo", flow / beverloo, 1.0, 0.15, note=note)]


def films(curves: Curves) -> list[Row]:
    """Many films at once."""
    alone = {step: granular_beds.films_alone(0.5, 60, step, count=400) for step in (5e-9, 1e-7, 5e-7, 5e-6)}
    gains = [
        (step, max(0.0, float(np.max(run.energy[1:] / run.energy[:-1])) - 1.0), 0.0) for step, run in alone.items()
    ]
    crowd, under_lid = granular_beds.shear(0.5, 10_000), granular_beds.shear(0.6, 20_000, press=20.0)
    curves["shear"] = {"energy": (crowd.energy, "J")}
    return [
        worst("films alone: rise of kinetic energy, to 20 film times", [p for p in gains if p[0] < 2e-7], 0.0),
        worst(
            "films alone: rise, 100 and 1000 film times a step",
            [p for p in gains if p[0] > 2e-7],
            1e-15,
            note="rounding, where the spheres are at rest relative to each other",
        ),
        worst("films alone: change of momentum", [(s, run.momentum, 0.0) for s, run in alone.items()], 1e-13),
        Row("sheared at 0.5 in 1 Pa s: smallest gap over h_min", crowd.smallest_gap, 1.0, 1.0),
        Row("sheared at 0.5 in 1 Pa s: largest speed over that of the plate", crowd.speed),
        Row("settling and sheared at 0.6 under a lid: smallest gap over h_min", under_lid.smallest_gap, 1.0, 1.0),
        Row("settling and sheared at 0.6 under a lid: largest speed", 0.02 * under_lid.speed, unit="m/s"),
    ]


def sliding_films(curves: Curves) -> list[Row]:
    """Films that resist sliding and rolling: slopes and remainder of the law, and a sheared suspension."""
    gaps, ratios = (1e-4, 1e-3), (1.0, 0.5, 2.0)
    slopes = []
    for ratio in ratios:
        near, far = (np.array(few_spheres.resistance(gap, ratio)) for gap in gaps)
        lead = np.array(few_spheres.leading(ratio))
        slopes += [(ratio, slope, 1.0) for slope in (near - far) / math.log(10.0) / lead]
    exact, lead = np.array(few_spheres.resistance(0.05)), np.array(few_spheres.leading(1.0))
    left = exact - [1.0, 0.0, 0.0, 0.0, 1.0, 0.0] - lead * math.log(20.0)
    names = ("Y^A_11", "-Y^A_12", "-Y^B_11", "Y^B_12", "Y^C_11", "Y^C_12")
    rows = [worst("slope of the exact resistance against ln(1/xi) over that of the law, 1e-4 to 1e-3 R", slopes, 0.01)]
    rows += [Row(f"{name} at 0.05 R less Stokes' and the film's", value) for name, value in zip(names, left)]
    cases = {"at 0.4": (0.4, 0.0), "at 0.5": (0.5, 0.0), "under a lid": (0.5, 20.0)}
    for name, (fraction, press) in cases.items():
        full = sheared(fraction, "full", press)
        curve = krieger_dougherty(full.solid_fraction)
        note = f"Krieger & Dougherty at {full.solid_fraction:.2f}, with the fluid itself; films alone here"
        rows += [
            Row(f"sheared {name}, sliding films: dissipated over work", full.dissipated, 1.0, 0.01),
            Row(f"sheared {name}: part of sliding and rolling in the work", full.sliding),
            Row(f"sheared {name}: relative viscosity of all films", full.viscosity, curve, note=note),
        ]
        if press == 0.0:
            normal = sheared(fraction, "normal").viscosity
            rows.append(Row(f"sheared {name}: relative viscosity of normal films", normal))
    return rows


SLOPES = {"dry": "dry", "wet": "under water", "wet_overlap": "under water,\nfriction\nat overlap"}


def _draw(folder: Path, curves: Curves) -> None:
    """Spin and rebound of Kharaz' spheres; slopes that begin to flow."""
    figure, axes = panels(3, width=11.0)
    shown = (("e_t", "tangential restitution", "-"), ("omega_out", "spin after the impact", "rad/s"))
    for place, (name, words, unit) in enumerate(shown):
        part = curves[f"kharaz/{name}"]
        axes[place].plot(part["angle"][0], part["measured"][0], "o", color=GREY, label="Kharaz et al. 2001")
        axes[place].plot(part["angle"][0], part["model"][0], color=BLUE, label="cfddem")
        label(axes[place], "impact angle", "deg", words, unit)
        legend(axes[place])
    for name, colour, dashes in (("dry", BLUE, "-"), ("wet", GREY, "--"), ("wet_overlap", ORANGE, ":")):
        part = curves[f"slope/friction_0.5_{name}"]
        axes[2].plot(part["angle"][0], 1e3 * np.asarray(part["speed"][0]), color=colour, ls=dashes, label=SLOPES[name])
    label(axes[2], "tilt", "deg", "mean speed", "mm/s")
    legend(axes[2], loc="upper left")
    save(figure, folder / "particles.png")


PARTS: tuple[Callable[[Curves], list[Row]], ...] = (
    falling,
    rolling,
    oblique,
    resting,
    slopes,
    hopper,
    films,
    sliding_films,
)
