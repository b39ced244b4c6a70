"""Wet collisions: three spheres (Davis 2023), pairs (Punch et al. 2023), thick films (Singh et al.), and walls."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import save
from closures.restitution import singh
from scenarios.collisions.three_spheres import validation as three_spheres_validation
from scenarios.collisions.three_spheres.study import simulate_three_spheres
from scenarios.collisions.three_spheres.validation import first_above, of
from scenarios.collisions.wet_pair import study as wet_pair
from scenarios.collisions.wet_pair.study import TRANSITION_PRESSURES, collide_wet
from scenarios.collisions.wet_wall import validation as wet_wall_validation
from scenarios.validation.table import Curves, Progress, Row, reference, worst, write_histories

exact_pair = partial(collide_wet, solver="equations")
HEAD_ON_CRITICAL = {
    ("static", "constant"): 1.193,
    ("static", "zero"): 1.217,
    ("deforming", "constant"): 1.196,
    ("deforming", "zero"): 1.214,
}
"""Stokes number above which a pair bounces head-on: converged solutions of the published equations."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    rows: list[Row] = []
    curves: Curves = {}
    for part in PARTS:
        progress((part.__doc__ or "").splitlines()[0])
        rows += part(folder, curves)
    write_histories(folder / "wet.h5", curves)
    return rows


def pairs(_: Path, __: Curves) -> list[Row]:
    """Wet pair: converged solutions of the equations of Punch et al. (2023)."""
    data = reference("wet_pair_converged")
    restitutions, spins = [], []
    for place, bridge in enumerate(data["bridge"]):
        stokes, angle, friction, e, omega = (
            float(data[name][place])
            for name in ("stokes [-]", "angle [deg]", "friction [-]", "restitution [-]", "spin [rad/s]")
        )
        run = exact_pair(stokes, angle, bridge=bridge, cut=data["cut"][place], friction=friction)
        restitutions.append((stokes, run.restitution, e))
        if not math.isnan(omega):
            spins.append((stokes, run.spin / omega, 1.0))
    rows = [worst("wet pair: restitution", restitutions, 0.003), worst("wet pair: spin, ratio", spins, 0.01)]
    for (bridge, cut), critical in HEAD_ON_CRITICAL.items():

        def bounces(stokes: float, bridge: str = bridge, cut: str = cut) -> bool:
            return exact_pair(stokes, bridge=bridge, cut=cut, duration=50.0).restitution > 0.0

        rows.append(
            Row(f"{bridge} bridge, {cut} below h_min: critical St_n", first_above(bounces, 0.9, 1.5), critical, 0.01)
        )
    return [*rows, *other_films(), *soft_and_hard()]


def other_films() -> list[Row]:
    """Other tangential films, a capillary force, and the largest spin."""
    peak = max((exact_pair(stokes, 60.0).spin, stokes) for stokes in np.arange(0.70, 1.2, 0.01))
    return [
        Row("60 deg, St 1.2, film of Nase: spin", exact_pair(1.2, 60.0, tangential="nase").spin, 12.3, 0.123, "rad/s"),
        Row(
            "60 deg, St 0.5, no tangential film: restitution",
            exact_pair(0.5, 60.0, tangential="none").restitution,
            0.117,
            0.003,
        ),
        Row(
            "60 deg, St 0.5, capillary force: restitution",
            exact_pair(0.5, 60.0, capillary=True).restitution,
            0.0716,
            0.003,
        ),
        Row("60 deg: largest spin", peak[0], 8.84, 0.0884, "rad/s"),
        Row("60 deg: St_n of the largest spin; the text says about 1.5", peak[1], 1.5),
    ]


def soft_and_hard() -> list[Row]:
    """Soft contact of the wet pair against the hard contact of the three spheres without the third."""
    restitutions, spins = [], []
    for stokes in (0.5, 0.8, 1.0, 1.2, 1.4, 2.0, 4.0):
        soft = exact_pair(stokes, 60.0)
        film, diameter = 270e-6, 25.4e-3
        hard = simulate_three_spheres(
            stokes,
            60.0,
            film_ratio=film / diameter,
            minimum_gap=soft.minimum_gap / film,
            restitution=0.9,
            spheres=2,
            solver="equations",
        )
        leaves = of(hard, "separate t", 12)
        spin = float(np.interp(leaves, hard.history["time"], hard.history["spin1"])) * soft.velocity / film
        restitutions.append((stokes, soft.restitution / hard.restitution12, 1.0))
        spins.append((stokes, soft.spin / spin, 1.0))
    return [
        worst("soft over hard contact, 60 deg: restitution", restitutions, 0.01),
        worst("soft over hard contact, 60 deg: spin", spins, 0.02),
    ]


ENGINE: tuple[dict[str, Any], ...] = (
    *({"stokes": 2.0, "angle": 45.0, "friction": 0.05, "bridge": b, "cut": c} for b, c in TRANSITION_PRESSURES),
    *({"stokes": stokes, "angle": 60.0} for stokes in (0.5, 0.8, 1.0, 1.2, 4.0)),
    {"stokes": 1.2, "angle": 60.0, "tangential": "nase"},
    {"stokes": 0.5, "angle": 60.0, "capillary": True},
)
"""Collisions that are also run in the particle engine."""


def engine_pairs(_: Path, __: Curves) -> list[Row]:
    """Wet pair: the particle engine, with its contact and a liquid bridge, against the polar equations."""
    restitutions, differences, spins, times = [], [], [], []
    for impact in ENGINE:
        polar, engine = exact_pair(**impact), collide_wet(**impact)
        restitutions.append((impact["stokes"], engine.restitution / polar.restitution, 1.0))
        differences.append((impact["stokes"], engine.restitution, polar.restitution))
        spins.append((impact["stokes"], engine.spin / polar.spin, 1.0))
        times.append(
            (impact["stokes"], (engine.separation_time or math.nan) / (polar.separation_time or math.nan), 1.0)
        )
    return [
        worst("particle engine over polar equations: restitution", restitutions, 0.01),
        worst("particle engine: restitution against the polar equations", differences, 0.005),
        worst("particle engine over polar equations: spin", spins, 0.01),
        worst("particle engine over polar equations: time of separation", times, 0.005),
    ]


def thick_films(_: Path, __: Curves) -> list[Row]:
    """Thick films: the law of Singh et al. is the lower of its two planes and has no jump."""
    jumps = []
    for ratio in (0.05, 0.1, 0.143):
        stokes = math.exp((0.86 - 0.06 * math.log(ratio)) / 0.16)  # where the planes meet
        jumps.append((ratio, singh(stokes * (1.0 + 1e-12), ratio), singh(stokes * (1.0 - 1e-12), ratio)))
    rounded = min(0.17 * 500.0**0.17 * 0.1**-0.16, 0.4 * 500.0**0.01 * 0.1**-0.22)
    return [
        worst("thick film: law on both sides of the boundary of its planes", jumps, 1e-12),
        Row("thick film, St 500, 0.1: rounded prefactors over exact", rounded / singh(500.0, 0.1), 1.0),
    ]


def pair_figures(folder: Path, curves: Curves) -> list[Row]:
    """Wet pair: restitution and spin against the Stokes number."""
    stokes, angles = np.linspace(0.1, 4.0, 79), (0.0, 15.0, 30.0, 45.0, 60.0)
    by_film = {
        kind: {a: np.array([exact_pair(st, a, *kind).restitution for st in stokes]) for a in angles}
        for kind in TRANSITION_PRESSURES
    }
    save(wet_pair.films(stokes, by_film), folder / "wet_pair_restitution.png")
    by_friction = {
        mu: {a: np.array([exact_pair(st, a, friction=mu).spin for st in stokes]) for a in angles[1:]}
        for mu in (0.0, 0.05)
    }
    save(wet_pair.spins(stokes, by_friction), folder / "wet_pair_spin.png")
    options: dict[str, dict[str, Any]] = {
        "Davis": {},
        "Nase": {"tangential": "nase"},
        "none": {"tangential": "none"},
        "Davis, capillary pull": {"capillary": True},
    }
    low = np.linspace(0.1, 2.0, 77)
    by_option = {
        name: np.array([exact_pair(st, 60.0, **more).restitution for st in low]) for name, more in options.items()
    }
    save(wet_pair.tangential(low, by_option), folder / "wet_pair_tangential.png")
    for kind, curve in by_film.items():
        columns: dict[str, tuple[Any, str]] = {f"restitution_{a:g}_deg": (values, "-") for a, values in curve.items()}
        curves["wet_pair/" + "_".join(kind)] = {"stokes": (stokes, "-"), **columns}
    return []


PARTS: tuple[Callable[[Path, Curves], list[Row]], ...] = (
    *three_spheres_validation.PARTS,
    pairs,
    engine_pairs,
    thick_films,
    pair_figures,
    *wet_wall_validation.PARTS,
)
