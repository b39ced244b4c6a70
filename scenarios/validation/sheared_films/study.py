"""Viscosity of a sheared suspension by films alone: at three time steps, and beside published curves.

Spheres of 100 um whose contacts lose nothing but by friction, if they have any: films and friction must dissipate all
the work. Nothing else resists, so the viscosity is that of films and contacts alone.

What is exact for the integrator: a force at an instant acts over the half kicks around it, and an impulse between the
first half kick and the drift. The layer that is held moves at a constant speed, so their work on it is this speed times
both half kicks and the impulses. A spring pushes two spheres apart in the first half kick, and the film stops them
before they move. The spring stores nothing of this work and the film takes all of it again: both leave it out.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from scenarios.validation.particles.granular_beds import SUSPENDED, suspension
from scenarios.validation.table import Curves, Progress, Row, in_parts, worst

SOLID_FRACTIONS = (0.3, 0.4, 0.5, 0.55)
STEPS = (1.0 / 16.0, 1.0, 4.0)
"""Time steps over that which is recommended."""

FRICTION = 0.5
"""Of the spheres of the runs with friction."""

LONG = 2.0
"""Strain of the runs that are compared with published curves; the second half counts."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, _draw, folder, progress)


def steps(curves: Curves) -> list[Row]:
    """Viscosity at a sixteenth of the recommended time step, at it and at four times that."""
    rows, balance = [], []
    for solid_fraction in SOLID_FRACTIONS:
        runs = {size: sheared(solid_fraction, steps_in_one=size) for size in STEPS}
        points = [(size, run.viscosity, runs[1.0].viscosity) for size, run in runs.items()]
        limit = 0.03 * runs[1.0].viscosity
        rows.append(worst(f"at {solid_fraction:g}: viscosity of films, against the recommended step", points, limit))
        balance += [(size, float(run.dissipated), 1.0) for size, run in runs.items()]
    return [*rows, worst("dissipated by films over work that is not stored", balance, 2e-3)]


def published(curves: Curves) -> list[Row]:
    """Viscosity after a long strain, beside published curves."""
    runs = {share: sheared(share, strain=LONG) for share in SOLID_FRACTIONS}
    fractions = np.array([run.solid_fraction for run in runs.values()])
    values = np.array([run.viscosity for run in runs.values()])
    curves["viscosity"] = {"solid_fraction": (fractions, "-"), "films": (values, "-")}
    rows = []
    for name, run in runs.items():
        at, value = run.solid_fraction, 1.0 + run.viscosity
        rows += [
            Row(f"at {name:g}: fluid and films, against Krieger & Dougherty", value, krieger_dougherty(at)),
            Row(f"at {name:g}: fluid and films, against Morris & Boulay", value, morris_boulay(at)),
            Row(f"at {name:g}: part of sliding and rolling in the work", float(run.sliding)),
        ]
    return rows


def friction(curves: Curves) -> list[Row]:
    """What friction of contacts adds, beside the frictional suspensions of Boyer, Guazzelli & Pouliquen (2011)."""
    rows = []
    for name in (0.4, 0.5):
        run = sheared(name, strain=LONG, solid=SMOOTH.model_copy(update={"friction": FRICTION}))
        rows += [
            Row(f"at {name:g}, friction {FRICTION:g}: fluid, films and contacts, against Boyer et al.",
                1.0 + run.viscosity, boyer(run.solid_fraction)),
            Row(f"at {name:g}, friction {FRICTION:g}: part of friction in the work", run.rubbed),
            Row(f"at {name:g}, friction {FRICTION:g}: dissipated over work that is not stored", run.dissipated, 1.0),
        ]  # fmt: skip
    return rows


def conditions(curves: Curves) -> list[Row]:
    """What the size of the box, the roughness and the reach of the films change at a solid fraction of 0.5."""
    usual = sheared(0.5, strain=LONG).viscosity
    changed = {
        "1200 spheres": sheared(0.5, strain=LONG, count=1200),
        "ten times the roughness": sheared(0.5, strain=LONG, solid=SMOOTH.model_copy(update={"roughness": 1e-6})),
        "a tenth of the roughness": sheared(0.5, strain=LONG, solid=SMOOTH.model_copy(update={"roughness": 1e-8})),
        "half the reach of films": sheared(0.5, strain=LONG, cutoff_ratio=0.5),
        "a quarter of the reach of films": sheared(0.5, strain=LONG, cutoff_ratio=0.25),
    }
    return [Row(f"at 0.5, {name}: viscosity of films", run.viscosity, usual) for name, run in changed.items()]


def _draw(folder: Path, curves: Curves) -> None:
    """Viscosity against solid fraction."""
    figure, axes = panels()
    at = np.linspace(0.25, 0.57, 100)
    axes.plot(at, [krieger_dougherty(share) for share in at], color=GREY, label="Krieger & Dougherty (1959)")
    axes.plot(at, [morris_boulay(share) for share in at], color=ORANGE, label="Morris & Boulay (1999)")
    viscosity = curves["viscosity"]
    films = np.asarray(viscosity["films"][0])
    axes.plot(viscosity["solid_fraction"][0], 1.0 + films, "o", color=BLUE, label="fluid and films")
    axes.set_yscale("log")
    label(axes, "solid fraction", "-", "relative viscosity", "-")
    legend(axes)
    save(figure, folder / "sheared_films.png")


PARTS: tuple[Callable[[Curves], list[Row]], ...] = (steps, published, friction, conditions)


# ---------------------------------------------------------------- suspensions whose films resist sliding and rolling


SMOOTH = SUSPENDED.model_copy(update={"friction": 0.0, "restitution": 1.0, "contact_modulus": 1e7})
"""The spheres of `suspension`, softer, without friction and damping."""

VISCOSITY, SPEED = 0.05, 0.2
"""Of the fluid [Pa s] and of the upper plate [m/s]: a Stokes number of 0.1."""

CLOSE_PACKING = 0.64
"""Solid fraction of a random close packing of equal spheres."""

MORRIS_BOULAY_PACKING, MORRIS_BOULAY_FACTOR = 0.68, 0.1
"""phi_m and K_s of the fit of Morris & Boulay (1999)."""


class Sheared(NamedTuple):
    """What was measured over a strain."""

    dissipated: float  # by films and friction, over the work that is not stored [-]
    sliding: float  # part of films that slide and roll in the work [-]
    rubbed: float  # part of friction in the work [-]
    stored: float  # in motion and contacts, over the work [-]
    viscosity: float  # over that of the fluid [-]
    solid_fraction: float  # between the plates [-]
    step: float  # [s]


class _Work(NamedTuple):
    """Of many steps."""

    done: float  # by what moves the upper layer [J]
    way: float  # of the upper layer [m]
    taken_back: float  # by films from springs, before the spheres moved [J]


def sheared(
    solid_fraction: float, motions: str = "full", press: float = 0.0, strain: float = 0.5, count: int = 400,
    steps_in_one: float = 1.0, cutoff_ratio: float = Laws().cutoff_ratio, solid: Material = SMOOTH,
) -> Sheared:  # fmt: skip
    """Shear a suspension between two layers of its own spheres, and measure over the second half of the strain.

    motions  that films resist
    press    if given, the upper layer is a free lid under this pressure and half as much traction; else held [Pa]
    strain   of the whole run [-]
    count    of spheres, with the layers
    steps_in_one  time step over that which is recommended [-]
    cutoff_ratio  reach of films over the reduced radius [-]
    solid         material of the spheres; its friction dissipates, too
    """
    suspended, upper = suspension(count, solid_fraction, fixed=True, viscosity=VISCOSITY)
    spheres, (width, depth, _) = suspended.particles, suspended.box
    if press > 0.0:
        spheres.inverse_mass[upper] = 1.0 / spheres.mass[upper]
        spheres.inverse_inertia[upper] = 2.5 / (spheres.mass[upper] * spheres.radius[upper] ** 2)
        spheres.applied[upper] = np.array([0.5, 0.0, -1.0]) * press * width * depth / int(upper.sum())
    else:
        spheres.velocity[upper, 0] = SPEED
    laws = Laws(film=True, film_motions=motions, cutoff_ratio=cutoff_ratio)
    run = ParticleSolver(
        spheres,
        pair_table([solid]),
        laws=laws,
        box=(width, depth, None),
        settings=SolverSettings(energies=True, check_steps=False),
    )
    lid = run.particles.id[upper]
    height = _height(run, lid)
    step = steps_in_one * run.recommended_step(SPEED)
    steps = round(0.5 * strain * height / SPEED / step)
    _shear(run, lid, step, steps)
    before, start = dict(zip(run.energies.channels, run.energies.totals.copy())), _stored(run)  # type: ignore[union-attr]
    work = _shear(run, lid, step, steps)
    after = dict(zip(run.energies.channels, run.energies.totals))  # type: ignore[union-attr]
    lost = {name: after[name] - before[name] for name in after}
    sliding = lost.get("film_shear", 0.0)
    stored = _stored(run) - start
    height, rate = _height(run, lid), work.way / (steps * step)
    volume = width * depth * height
    plates = np.isin(run.particles.id, lid) | (run.particles.inverse_mass == 0.0)
    inner = run.particles.volume.sum() - 0.5 * run.particles.volume[plates].sum()
    return Sheared(
        (lost["film"] + sliding + lost["friction"] - work.taken_back) / (work.done - stored),
        sliding / work.done, lost["friction"] / work.done, stored / work.done,
        work.done / (steps * step) / (volume * (rate / height) ** 2 * VISCOSITY),
        float(inner / volume), step,
    )  # fmt: skip


def _height(run: ParticleSolver, lid: np.ndarray) -> float:
    """Distance of the mean heights of the two layers [m]."""
    upper = np.isin(run.particles.id, lid)
    lower = (run.particles.inverse_mass == 0.0) & ~upper
    return float(run.particles.position[upper, 2].mean() - run.particles.position[lower, 2].mean())


def _stored(run: ParticleSolver) -> float:
    """Kinetic energy of what moves freely, and energy of contacts [J]."""
    free = run.particles.copy(run.particles.inverse_mass > 0.0)
    assert run.energies is not None
    return kinetic_energy(free) + sum(run.energies.springs(run))


def _shear(run: ParticleSolver, lid: np.ndarray, step: float, steps: int) -> _Work:
    """Advance. The work on a layer that is held follows from the contact forces and impulses on it."""
    done = way = impulse = taken_back = 0.0
    for _ in range(steps):
        force, lists, before = _force_on(run, lid), run.lists.made, _half_kick(run, step)
        run.advance(step)
        upper = np.isin(run.particles.id, lid)
        moved = run.particles.work_displacement[upper]
        way += float(moved[:, 0].mean())
        if run.particles.inverse_mass[upper].any():
            done += float((run.particles.applied[upper] * moved).sum())
        else:
            # a new list of pairs has forgotten the last impulses, which hardly change in a step
            impulse = _impulse_on(run, lid) if run.lists.made == lists else impulse
            done -= SPEED * (0.5 * step * (force + _force_on(run, lid)) + impulse)
        taken_back += _taken_back(run, before, step)
    return _Work(done, way, taken_back)


def _force_on(run: ParticleSolver, lid: np.ndarray) -> float:
    """Contact force on the upper layer along the shear [N]."""
    return float(run.particles.force[np.isin(run.particles.id, lid), 0].sum())


def _impulse_on(run: ParticleSolver, lid: np.ndarray) -> float:
    """Impulse of all films on the upper layer in the last step, along the shear [N s]."""
    upper, edges = np.isin(run.particles.id, lid), run.edges
    impulse = edges.impulse[:, 0] + edges.film_push[:, 0]
    impulse += edges.shear_impulse[:, 0] if "shear_impulse" in edges else 0.0
    sign = upper[edges.first].astype(float) - upper[edges.second]
    return float(sign @ impulse)


def _half_kick(run: ParticleSolver, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ids, half a kick of contacts [N s], and velocity after half a kick of all forces; of what moves freely."""
    free = run.particles.copy(run.particles.inverse_mass > 0.0)
    kick = 0.5 * step * free.force
    velocity = free.velocity + free.inverse_mass[:, None] * kick
    order = np.argsort(free.id)
    return free.id[order], (kick - 0.5 * step * free.applied)[order], velocity[order]


def _taken_back(run: ParticleSolver, before: tuple[np.ndarray, np.ndarray, np.ndarray], step: float) -> float:
    """Work of springs in the first half kick at the speed that films took before the spheres moved [J]."""
    ids, kick, velocity = before
    order = np.argsort(run.particles.id)
    moved = run.particles.displacement[order][np.isin(run.particles.id[order], ids)]
    return float((kick * (velocity - moved / step)).sum())


# ---------------------------------------------------------------- published curves


def krieger_dougherty(solid_fraction: float) -> float:
    """Relative viscosity, (1 - phi/0.64)^-1.6: Krieger & Dougherty, Trans. Soc. Rheol. 3 (1959) 137.

    The intrinsic viscosity is Einstein's 2.5, and the maximum the random close packing of equal spheres.

    >>> round(krieger_dougherty(0.5), 2)
    11.38
    """
    return float((1.0 - solid_fraction / CLOSE_PACKING) ** (-2.5 * CLOSE_PACKING))


def morris_boulay(solid_fraction: float) -> float:
    r"""Relative viscosity by the fit of Morris & Boulay, J. Rheol. 43 (1999) 1213, doi:10.1122/1.551021.

    .. math:: \eta_r = 1 + \frac{2.5\,\phi}{1-\phi/\phi_m} + K_s\left(\frac{\phi/\phi_m}{1-\phi/\phi_m}\right)^2

    The constants phi_m = 0.68 and K_s = 0.1 are those of the Couette case of twoFluidsNBSuspensionFoam, a program for
    suspensions by F. Municchi; the paper itself has not been read.

    >>> round(morris_boulay(0.5), 2)
    6.49
    """
    filled = solid_fraction / MORRIS_BOULAY_PACKING
    ratio = filled / (1.0 - filled)
    return 1.0 + 2.5 * MORRIS_BOULAY_PACKING * ratio + MORRIS_BOULAY_FACTOR * ratio**2


def boyer(solid_fraction: float) -> float:
    r"""Relative viscosity of real, frictional spheres: Boyer, Guazzelli & Pouliquen, PRL 107 (2011) 188301.

    .. math:: \eta_r = 1 + \frac{2.5\,\phi}{1-\phi/\phi_m} + \mu_c\left(\frac{\phi}{\phi_m-\phi}\right)^2,\quad
        \mu_c = \mu_1 + \frac{\mu_2-\mu_1}{1+I_0\,\phi^2(\phi_m-\phi)^{-2}}

    The form is that of twoFluidsNBSuspensionFoam; the constants phi_m = 0.585, mu_1 = 0.32, mu_2 = 0.7 and I_0 = 0.005
    are those of another program that cites the paper. The paper itself has not been read.

    >>> round(boyer(0.5), 1)
    31.9
    """
    most, low, high, number = 0.585, 0.32, 0.7, 0.005
    ratio = solid_fraction / (most - solid_fraction)
    return 1.0 + 2.5 * most * ratio + (low + (high - low) / (1.0 + number * ratio**2)) * ratio**2
