"""A bead falls through a liquid film onto a plate, rebounds, or sticks; the liquid's flow is computed.

What you'll learn: how much the film reduces the rebound, by which mechanism, and when.

>>> from scenarios.collisions.film_impact import impact
>>> result = impact(5.5e-3, "m5", film=0.45e-3, velocity=0.5, cells=5)
>>> result.outcome, round(result.restitution, 2)
('rebound', 0.74)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from inspect import signature
from time import process_time
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, RunFailed, nearest
from cfddem.case.materials import Material
from closures.film_impact import film_added_mass
from scenarios.collisions.film_impact.grid import Grid
from scenarios.collisions.film_impact.liquid import overfilled
from scenarios.collisions.film_impact.materials import GLASS, Liquid, liquid_named, touching_gap
from scenarios.collisions.film_impact.pressure import EXCHANGES, Bead
from scenarios.collisions.film_impact.result import ENERGIES, FilmImpact, Record
from scenarios.collisions.film_impact.solver import GridImpact, Settings
from scenarios.collisions.film_impact.surface import Tension
from scenarios.references.isph.impact import SmoothedImpact

METHODS = {"grid": 20, "isph": 5}
"""Method -> cells or layers of particles in the film, if not given."""

MOST_CELLS = 10_000_000
"""Of a grid; more need days and all of the memory."""

LONGEST = 30.0
"""A bead that has not left after this many times film/velocity has stuck."""

BOUNCES = 10
"""So has one that touches the plate this often."""


def impact(
    diameter: float = 5.5e-3,
    liquid: str | Liquid = "water",
    film: float = 0.4e-3,
    velocity: float = 0.5,
    *,
    method: str = "grid",
    solid: Material = GLASS,
    plate: Material = GLASS,
    viscosity: float | None = None,
    cells: int | None = None,
    gap_rule: str = "fixed",
    minimum_gap: float = 1e-6,
    cavitation: float | None = None,
    wetted_share: float | None = None,
    wetted_missing: float = 0.5,
    domain: float = 1.0,
    flip: float = 0.97,
    particles_per_side: int = 3,
    courant: float = 0.5,
    surface_tension: float = 0.0,
    contact_angle: float = 0.0,
    gravity: float = 9.81,
    progress: Callable[[GridImpact | SmoothedImpact], None] | None = None,
) -> FilmImpact:
    """Let a bead fall through a liquid film onto a plate.

    diameter            of the bead [m]
    liquid              "water" or "m5", or a Liquid
    film                depth of the film at rest [m]
    velocity            of the bead towards the plate where it meets the film [m/s]
    method              "grid": axisymmetric grid with liquid particles; "isph": smoothed particles in three dimensions,
                        the method of the paper at its coarsest resolution, with an error of about 6 %
    solid, plate        of the bead and of the plate; the dry restitution is the bead's
    viscosity           replaces that of the liquid, dynamic [Pa s]
    cells               in the depth of the film; 20 if not given, and 5 layers of particles with "isph"
    gap_rule            gap at which the solids touch: "fixed", the "roughness" of the solids, or "elastohydrodynamic"
    minimum_gap         of the rule "fixed" [m]
    cavitation          lowest pressure of the liquid, below 0, such as -1e5; without it, it holds any suction [Pa]
    wetted_share        guess of the wetted radius over sqrt(D (film - gap)) instead of the tracked one, for comparison
    wetted_missing      share of its volume that the outermost wetted column may lack
    domain              width of the domain, over the usual one; from about 0.8 on
    flip                share of its own velocity that a liquid particle keeps
    particles_per_side  of a cell, along radius and height
    courant             cells that the liquid may cross in a step
    surface_tension     of the liquid; 0 neglects it, as in the paper; water has 0.0728, M5 0.0192 [N/m]
    contact_angle       static, of bead and plate, within the liquid; 0 wets them [deg]
    gravity             towards the plate [m/s2]
    progress            called after every step
    returns             :class:`FilmImpact`

    >>> round(impact(liquid=Liquid(density=1e-3, viscosity=0.0), cells=5, gravity=0.0).restitution, 4)
    0.98
    """
    poured = liquid_named(liquid, viscosity)
    if method not in METHODS:
        raise InputError("method", method, nearest(method, METHODS))
    cells = METHODS[method] if cells is None else cells
    if method == "isph":
        _check_of_grid(cavitation=cavitation, wetted_share=wetted_share, wetted_missing=wetted_missing, domain=domain,
                       flip=flip, particles_per_side=particles_per_side, courant=courant,
                       surface_tension=surface_tension, contact_angle=contact_angle)  # fmt: skip
    _check(diameter=diameter, film=film, velocity=velocity, gravity=gravity, domain=domain, flip=flip, courant=courant)
    _check_film(film, diameter)
    _check_whole(cells=cells, particles_per_side=particles_per_side)
    gap = touching_gap(gap_rule, minimum_gap, poured.viscosity, velocity, diameter, (solid, plate))
    if not gap < film / cells:
        raise InputError("minimum_gap", gap, f"below a cell, {film / cells:g} m", "the film is too thin for this gap")
    if cavitation is not None and not (math.isfinite(cavitation) and cavitation < 0.0):
        raise InputError("cavitation", cavitation, "below 0 and finite", "it is a pressure relative to the air")
    settings = Settings(minimum_gap=gap, flip=flip, per_side=particles_per_side, missing=wetted_missing,
                        guessed=wetted_share, cavitation=cavitation, courant=courant,
                        tension=_tension(surface_tension, contact_angle))  # fmt: skip
    bead = Bead(0.5 * diameter, solid.density * math.pi / 6.0 * diameter**3, film, -velocity)
    of_liquid = (poured.density, poured.viscosity, solid.restitution, gravity, settings)
    if method == "isph":
        return integrate(SmoothedImpact(bead, film, cells, *of_liquid), velocity, solid.density, progress)
    run = GridImpact(grid_for(diameter, film, cells, domain), bead, film, *of_liquid)
    return integrate(run, velocity, solid.density, progress)


def _tension(sigma: float, angle: float) -> Tension | None:
    """Surface tension and contact angle, if there is one."""
    if not (math.isfinite(sigma) and sigma >= 0.0):
        raise InputError("surface_tension", sigma, "at least 0 and finite")
    if not 0.0 <= angle <= 180.0:
        raise InputError("contact_angle", angle, "between 0 and 180 degrees")
    if sigma == 0.0 and angle != 0.0:
        raise InputError("contact_angle", angle, "left out without surface_tension", "water has 0.0728 N/m")
    return Tension(sigma, math.radians(angle), math.radians(angle)) if sigma > 0.0 else None


def grid_for(diameter: float, film: float, cells: int, domain: float = 1.0) -> Grid:
    """The grid of an impact: 1.1 times the widest wetted radius and ten cells wide, five films high."""
    dx, wetted = film / cells, math.sqrt(2.0 * diameter * film)
    width = 1.1 * wetted + 10.0 * dx
    least = (wetted + dx) / width
    if domain < least:  # the bead would fill the domain and leave the liquid no surface
        limit = f"at least {math.ceil(1e3 * least) / 1e3:g} for this bead, film and number of cells"
        raise InputError("domain", domain, limit, "the wetted radius must fit into it")
    if domain * width / dx * 5 * cells > MOST_CELLS:
        limit = f"at most {MOST_CELLS / (5 * cells) * dx / width:.3g} for this bead, film and number of cells"
        raise InputError("domain", domain, limit, f"a grid has at most {MOST_CELLS:,} cells")
    return Grid(math.ceil(domain * width / dx), 5 * cells, dx)


def integrate(
    run: GridImpact | SmoothedImpact,
    velocity: float,
    density: float,
    progress: Callable[[GridImpact | SmoothedImpact], None] | None,
) -> FilmImpact:
    """Step until the bead passes the undisturbed surface again, or sticks."""
    begin, record, bead = process_time(), Record(run), run.bead
    while True:
        before = run.contacts, bead.velocity
        try:
            run.step()
        except np.linalg.LinAlgError as failure:
            where = f"t = {run.time:.3g} s, with the bead {bead.gap:.3g} m above the plate"
            raise RunFailed(f"{where}: {failure}; use a larger domain, or more cells") from failure
        record.add(*before)
        if progress is not None:
            progress(run)
        if bead.gap >= run.film and bead.velocity > 0.0:
            record.leave(run.film)
            break
        if _stuck(run, velocity):
            break
    return _result(run, record, density, process_time() - begin)


def sweep(
    velocities: Iterable[float], progress: Callable[[str], None] | None = None, **options: Any
) -> list[FilmImpact]:
    """Impacts at several velocities.

    velocities  [m/s]
    progress    called with a line before each
    options     of :func:`impact`
    """
    results = []
    for velocity in velocities:
        if progress is not None:
            progress(f"{options.get('diameter', 5.5e-3) * 1e3:g} mm at {velocity:g} m/s")
        results.append(impact(velocity=float(velocity), **options))
    return results


def _stuck(run: GridImpact | SmoothedImpact, velocity: float) -> bool:
    """Whether the bead has turned back before it left, stands still, or bounces without end."""
    fallen_back = run.contacts > 0 and run.bead.velocity <= 0.0 and run.bead.gap > 0.1 * run.film
    return fallen_back or run.contacts >= BOUNCES or run.time > LONGEST * run.film / velocity


def _result(run: GridImpact | SmoothedImpact, record: Record, density: float, seconds: float) -> FilmImpact:
    """The result from the end of the run and its record."""
    bead, history, speed = run.bead, record.history(), -record.p1.velocity
    rebounds, energy = math.isfinite(record.p4.velocity), 0.5 * bead.mass * speed**2
    energies = {name: float(history[name][-1]) / energy for name in ENERGIES}
    lost = 1.0 - 0.5 * bead.mass * bead.velocity**2 / energy
    lost += bead.mass * run.gravity * (run.film - bead.gap) / energy
    touching = int(np.argmax(history["time"] >= record.p2.time)) if run.contacts else -1
    later = history["time"] > record.p2.time + 1e-6
    on_bead, on_plate, weight = run.impulses
    momentum = run.liquid_energy()[2]
    rising = run.particles[:, 3] > 0.5 * max(bead.velocity, 1e-9)
    ratio = run.film / (2.0 * bead.radius)
    return FilmImpact(
        outcome="rebound" if rebounds else "stick",
        restitution=record.p4.velocity / speed if rebounds else 0.0,
        stokes=density * 2.0 * bead.radius * speed / (9.0 * run.viscosity) if run.viscosity else math.inf,
        film_ratio=ratio,
        added_mass=film_added_mass(run.density / density, ratio),
        minimum_gap=run.settings.minimum_gap,
        p1=record.p1,
        p2=record.p2,
        p3=record.p3,
        p4=record.p4,
        turned_speed=record.turned,
        turning_energy=run.turning if isinstance(run, GridImpact) else (math.nan, math.nan),
        fastest=float(-history["velocity"].min()),
        energies=energies,
        ledger_error=lost - sum(energies.values()),
        volume_error=overfilled(run.grid, run.particles, run.volume),
        momentum_error=(momentum + on_bead - on_plate - weight) / max(abs(on_bead), 1e-30),
        lowest_pressure=float(history["pressure_low"][later].min(initial=0.0)),
        highest_pressure=float(history["pressure_high"][: touching + 1].max(initial=0.0)),
        wetted_radius=float(history["wetted_radius"][touching]),
        mass_carried=run.density * float(run.volume[rising].sum()) if rebounds else 0.0,
        contacts=run.contacts,
        steps=run.steps,
        cells=round(run.film / run.grid.dx),
        seconds=seconds,
        warnings=_warnings(run),
        history=history,
        frames=record.frames,
    )


def _warnings(run: GridImpact | SmoothedImpact) -> tuple[str, ...]:
    """What the user of the result has to know."""
    if isinstance(run, GridImpact) and run.voids is not None and run.voids.unsettled:
        some = f"in {run.voids.unsettled} of {run.steps} steps the cells that cavitate were not found"
        return (
            f"{some} in {EXCHANGES} trials; the pressure may be below {run.voids.floor:g} Pa. Use a smaller courant.",
        )
    return ()


def _check(**given: float) -> None:
    """Check the numbers of an impact."""
    limits = {
        "velocity": (
            given["velocity"] > 0.0,
            "above 0 and finite",
            "a bead that does not fall never reaches the plate",
        ),
        "gravity": (given["gravity"] >= 0.0, "at least 0 and finite", ""),
        "flip": (0.0 <= given["flip"] <= 1.0, "between 0 and 1", ""),
        "courant": (0.0 < given["courant"] <= 1.0, "above 0 and at most 1", ""),
    }
    for name, value in given.items():
        holds, limit, remedy = limits.get(name, (value > 0.0, "above 0 and finite", ""))
        if not (holds and math.isfinite(value)):
            raise InputError(name, value, limit, remedy)


def _check_of_grid(**given: float | None) -> None:
    """Refuse options of the grid for another method."""
    for name, value in given.items():
        if value != signature(impact).parameters[name].default:
            raise InputError(name, value, 'left out with method = "isph"', "it is an option of the grid")


def _check_film(film: float, diameter: float) -> None:
    if film > 0.5 * diameter:
        raise InputError("film", film, f"at most the radius of the bead, {0.5 * diameter:g} m")


def _check_whole(**given: int) -> None:
    """Check the counts: cells in the film, particles in a cell."""
    for name, value in given.items():
        least, most = {"cells": (4, 100)}.get(name, (1, 6))
        if not (isinstance(value, int) and least <= value <= most):
            raise InputError(name, value, f"a whole number from {least} to {most}")
