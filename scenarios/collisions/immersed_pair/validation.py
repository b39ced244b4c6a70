"""Binary collisions: the figures of Nijssen et al. (2023), redrawn with public data and correlations.

Nijssen, Ottens & Padding, Powder Technol. 413 (2023) 118017, figures 2 to 5. Each part computes curves for
`histories.h5` and the figures, and rows for the table. The data of Yang & Hunt (2006) were published as figures only;
the comparison uses their statements, Legendre's fit and Gondret's trajectory instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.material_pairs import pair_table
from closures.contact import hertz_largest_overlap, hertz_stiffness
from closures.restitution import critical_stokes, immersed, legendre, stop_gap
from scenarios.collisions.bouncing_sphere.study import (
    FAST,
    ROUGHNESS,
    SLOW,
    bounce,
    collision,
    mean_speeds,
    shares_of_loss,
    speed_after_contact,
)
from scenarios.collisions.immersed_pair import checks, figures
from scenarios.collisions.immersed_pair.checks import CUTOFF, DRY, SPEED, WATER
from scenarios.collisions.immersed_pair.measured import compare_points
from scenarios.collisions.immersed_pair.study import MATERIALS, collide
from scenarios.validation.table import Curves, Progress, Row, in_parts, numbers, worst

GLYCEROL_80 = 60.1e-3  # 80 % by weight at 20 C [Pa s]
CLASSES: dict[str, tuple[str, float, tuple[float, float, float]]] = {
    "low": ("steel_smooth", GLYCEROL_80, (10.0, 20.0, 24.9)),
    "middle": ("delrin", WATER, (40.0, 100.0, 200.0)),
    "high": ("steel_smooth", WATER, (500.0, 1000.0, 2400.0)),
}
"""Figure 5: material, viscosity [Pa s], and the lowest, shown and highest normal Stokes number."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, figures.draw, folder, progress)


def compare_data(folder: Path, path: Path) -> Row:
    """A row and a figure for measured restitutions of head-on collisions of Delrin at the speed of the target."""
    comparison = compare_points(path, lambda **point: collide(MATERIALS["delrin"], velocity=SPEED, **point),
                          folder / f"measured_{path.stem}.png").comparison  # fmt: skip
    points = comparison.points
    rows = zip(points.place, comparison.computed, points.value)
    return worst(f"measured {points.quantity}, {points.name}: {comparison.score()['verdict']}", rows)


def gap_histories(curves: Curves) -> list[Row]:
    """Figure 2: gap histories of Delrin."""
    delrin, stops = MATERIALS["delrin"], {}
    for stokes in (1, 2, 5, 10, 15, 17, 20, 30, 100):
        result = collide(delrin, velocity=SPEED, stokes=stokes, trajectory="full")
        stops[stokes] = result.stop_gap or math.nan
        curves[f"figure_2/stokes_{stokes}"] = {
            "time": (result.time, "s"),
            "gap": (result.gap, "m"),
            "normal_speed": (result.history["normal_speed"], "m/s"),
            "minimum_gap": (result.minimum_gap, "m"),
            "cutoff_gap": (CUTOFF, "m"),
            "approach_speed": (SPEED, "m/s"),
        }
    untouched = [(stokes, stops[stokes] / stop_gap(stokes, CUTOFF), 1.0) for stokes in (1, 2, 5)]
    touched = [(15, stops[15] / CUTOFF, 0.064), (17, stops[17] / CUTOFF, 0.447)]
    return [
        worst("Delrin, St 1 to 5: h_stop/(h_co exp(-St))", untouched, 1e-3),
        Row("Delrin, St 10, stops after contact: h_stop/h_min", stops[10] / delrin.roughness, 2.0, 0.05),
        worst("Delrin, St 15 and 17, stops after contact: h_stop/R*", touched, 1e-3),
    ]


def restitution(curves: Curves) -> list[Row]:
    """Figure 3: restitution of four materials."""
    stokes = np.unique(np.concatenate([np.linspace(16.0, 30.0, 15), np.geomspace(5.0, 3000.0, 50)]))
    fit = numbers("immersed_correlation_curves")
    rows: list[Row] = []
    fitted: list[tuple[float, float, float]] = []
    closed: list[tuple[float, float, float]] = []
    for name, material in MATERIALS.items():
        ways: list[dict[str, Any]] = [{"velocity": SPEED}, {"velocity": 0.3}, {"viscosity": WATER}]
        values = np.array([[collide(material, stokes=st, **way).restitution for st in stokes] for way in ways])
        form, deep = _closed_form(material, stokes)
        curves[f"figure_3/{name}"] = {
            "stokes": (stokes, "-"),
            "restitution": (values[0], "-"),
            "restitution_lowest": (values.min(axis=0), "-"),
            "restitution_highest": (values.max(axis=0), "-"),
            "closed_form": (form, "-"),
        }
        closed += [(st, e, c) for st, e, c, ok in zip(stokes, values[0], form, deep) if ok and e > 0.0]
        added_mass = stokes * (1.0 + 0.5 * 1000.0 / material.density)
        fitted += [(st, e / DRY, legendre(mass, 1.0)) for st, e, mass in zip(stokes, values[0], added_mass)]
        onset = critical_stokes(DRY, CUTOFF, material.roughness)
        rows.append(Row(f"{name}: St_c; literature 5 to 20", onset))
    curves["figure_3/legendre_2006"] = {
        "stokes_with_added_mass": (fit["St"], "-"),
        "restitution_ratio": (fit["legendre_e_over_edry"], "-"),
    }
    slow = [(st, collide(m, velocity=SPEED, stokes=st).restitution, 0.0) for m in MATERIALS.values() for st in (5, 8)]
    return [
        worst("no rebound at St 5 and 8: e", slow, 0.05),
        worst("e/e_dry against Legendre's fit, 20 < St < 50", [point for point in fitted if 20 < point[0] < 50]),
        worst("e/e_dry against Legendre's fit, 50 to 500", [point for point in fitted if 50 <= point[0] <= 500], 0.1),
        worst("e/e_dry against 1 above St 500", [(st, e, 1.0) for st, e, _ in fitted if st > 500], 0.07),
        worst("e against the closed form, overlap above 15 h_min", closed, 1e-3),
        *rows,
    ]


def _closed_form(material: Material, stokes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closed form of e at a fixed speed, and where the contact is deep enough for it to hold."""
    row = pair_table([material])[0, 0]
    mass = material.density * math.pi / 12.0 * 12.7e-3**3
    depth = hertz_largest_overlap(mass, hertz_stiffness(float(row["contact_modulus"]), CUTOFF), SPEED)
    gaps = np.array([checks.film_gap(material, SPEED, st) for st in stokes])
    return np.array([immersed(st, DRY, CUTOFF, gap) for st, gap in zip(stokes, gaps)]), depth > 15.0 * gaps


def roughness(curves: Curves) -> list[Row]:
    """Figure 4: roughness of Delrin."""
    delrin, sweep = MATERIALS["delrin"], np.geomspace(1e-9, 3e-5, 46)
    plateau = []
    for stokes in (20, 30, 50, 100, 200, 1000):
        limit = checks.film_gap(_rough(delrin, 0.0), SPEED, stokes)
        heights = np.sort(np.append(sweep, limit))
        runs = [collide(_rough(delrin, height), velocity=SPEED, stokes=stokes).restitution for height in heights]
        there = runs[int(np.searchsorted(heights, limit))]
        curves[f"figure_4/stokes_{stokes}"] = {
            "roughness": (heights, "m"),
            "restitution": (runs, "-"),
            "elastohydrodynamic_gap": (limit, "m"),
            "restitution_there": (there, "-"),
        }
        plateau += [(stokes, e, there) for e, height in zip(runs, heights) if height < limit]
    return [worst("Delrin, roughness below h_eps: e at h_eps", plateau, 1e-3)]


def _rough(material: Material, height: float) -> Material:
    return material.model_copy(update={"roughness": height})


def oblique(curves: Curves) -> list[Row]:
    """Figure 5: oblique rebound in three classes of the normal Stokes number."""
    angles = np.array([1, 2, 3, 4, 5, 6, 8, 10, 12, 15, *range(20, 75, 5)], float)
    for name, (material, viscosity, span) in CLASSES.items():
        columns: dict[str, tuple[object, str]] = {"impact_angle": (angles, "deg")}
        for onset, label, stokes in (
            ("film", "lowest", span[0]),
            ("film", "shown", span[1]),
            ("film", "highest", span[2]),
            ("overlap", "shown", span[1]),
        ):
            runs = [
                collide(MATERIALS[material], viscosity=viscosity, stokes=stokes, angle=angle, friction_onset=onset)
                for angle in angles
            ]
            slip = [run.restitution_tangential * math.tan(math.radians(a)) for run, a in zip(runs, angles)]
            for reading in ("striker", "relative"):
                values = np.array([getattr(run, f"rebound_angle_{reading}") for run in runs])
                columns[f"{onset}_{label}_angle_{reading}"] = (values, "deg")
            columns[f"{onset}_{label}_restitution_tangential"] = ([run.restitution_tangential for run in runs], "-")
            columns[f"{onset}_{label}_tangential_over_normal_speed"] = (slip, "-")
        columns["stokes_lowest_shown_highest"] = (span, "-")
        curves[f"figure_5/{name}"] = columns
    wanted = [
        (span[1], collide(MATERIALS[material], viscosity=viscosity, stokes=span[1], angle=30.0).friction_used, friction)
        for (material, viscosity, span), friction in zip(CLASSES.values(), (0.02, 0.20, 0.11))
    ]
    onsets = {
        onset: collide(MATERIALS["delrin"], viscosity=WATER, stokes=100.0, angle=10.0, friction_onset=onset)
        for onset in ("film", "overlap")
    }
    return [
        worst("friction, oblique, three classes", wanted, 0.0),
        Row(
            "Delrin, St_n 100, 10 deg: e_t, friction at overlap; ref. film",
            onsets["overlap"].restitution_tangential,
            onsets["film"].restitution_tangential,
        ),
        *_with_sliding_films(),
    ]


def _with_sliding_films() -> list[Row]:
    """What films that resist sliding and rolling change in the classes of figure 5, against normal films."""
    rows = []
    for name, (material, viscosity, span) in CLASSES.items():
        for angle in (20.0, 60.0):
            setting: dict[str, Any] = {"viscosity": viscosity, "stokes": span[1], "angle": angle}
            full, normal = (
                collide(MATERIALS[material], film_motions=motions, **setting) for motions in ("full", "normal")
            )
            rows.append(
                Row(
                    f"{name} St, {angle:.0f} deg: e_t with sliding films; ref. normal films",
                    full.restitution_tangential,
                    normal.restitution_tangential,
                )
            )
    return rows


def gondret(curves: Curves) -> list[Row]:
    """Gondret's steel sphere at St = 27: with film, contact and weight alone, and with drag, added mass and history."""
    measured = numbers("gondret2002_st27_trajectory")
    curves["gondret_2002/measured"] = {"time": (measured["t"], "s"), "gap": (measured["gap"], "m")}
    highest, rows = 1e3 * measured["gap"].max(), []
    for name, forces in SURROUNDINGS.items():
        time, gap = bounce(surroundings=forces)
        curves[f"gondret_2002/{name}"] = {"time": (time, "s"), "gap": (gap, "m")}
        apex = 1e3 * gap[time > 0.0].max()
        rows.append(Row(f"Gondret, St 27: apex, {name.replace('_', ' ')}", apex, highest, unit="mm"))
    for name, share in shares_of_loss(collision()).items():
        rows.append(Row(f"Gondret, St 27: share of the loss until the apex, {name}", share))
    time, gap = (curves["gondret_2002/film_alone"][name][0] for name in ("time", "gap"))
    rebound, early = np.where(time > 0.0, gap, 0.0), (measured["t"][0], measured["t"][1])
    model_speed = speed_after_contact(time, gap, *early)
    measured_speed = speed_after_contact(measured["t"], measured["gap"], *early)
    return [
        *rows,
        Row(
            "Gondret, St 27: time of the apex",
            1e3 * time[rebound.argmax()],
            1e3 * measured["t"][measured["gap"].argmax()],
            unit="ms",
        ),
        Row("Gondret, St 27: speed after 1.7 ms / U", model_speed / SLOW.speed, measured_speed / SLOW.speed),
        Row("Gondret, St 27: e at h_co; 0.43 to 0.49", immersed(27.0, DRY, 3e-3, 3e-7), 0.46),
    ]


def speeds_after_contact(curves: Curves) -> list[Row]:
    """Gondret's spheres: mean speeds after contact, with and without history force, and with rougher spheres."""
    rows = []
    for stokes, fall in ((27, SLOW), (152, FAST)):
        for words, name, rougher in (
            ("drag and added mass", "and_drag_and_added_mass", 1.0),
            ("and history force", "and_history_force", 1.0),
            ("and ten times the roughness", "and_history_force", 10.0),
        ):
            path = bounce(fall.windows[-1][1], SURROUNDINGS[name], fall, rougher * ROUGHNESS)
            for (begin, end), speed, measured in zip(fall.windows, mean_speeds(*path, fall), fall.measured):
                title = f"Gondret, St {stokes}, {words}: speed from {1e3 * begin:.1f} to {1e3 * end:.1f} ms / U"
                rows.append(Row(title, speed, measured))
    return rows


SURROUNDINGS: dict[str, tuple[str, ...]] = {
    "film_alone": (),
    "and_drag_and_added_mass": ("drag", "added_mass"),
    "and_history_force": ("drag", "added_mass", "history"),
    "and_drag_beside_the_wall": ("drag", "added_mass", "history", "wall_drag"),
}
"""Forces of the fluid around Gondret's sphere; weight, film and contact always act."""

PARTS: tuple[Callable[[Curves], list[Row]], ...] = (
    gap_histories,
    restitution,
    roughness,
    oblique,
    gondret,
    speeds_after_contact,
    checks.walls,
    checks.readings,
    checks.film_zone,
    checks.tables,
    checks.integrators,
    checks.oblique,
)
