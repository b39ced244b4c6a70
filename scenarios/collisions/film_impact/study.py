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
from time import process_time
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.materials import Material
from cfddem.case.settings import Settings, takes
from closures.film_impact import film_added_mass
from scenarios.collisions.film_impact.grid import Grid
from scenarios.collisions.film_impact.liquid import overfilled
from scenarios.collisions.film_impact.materials import GLASS, Liquid, liquid_named, touching_gap
from scenarios.collisions.film_impact.pressure import EXCHANGES, Bead
from scenarios.collisions.film_impact.result import ENERGIES, FilmImpact, Record
from scenarios.collisions.film_impact.solver import GridImpact
from scenarios.collisions.film_impact.solver import Settings as Solver
from scenarios.collisions.film_impact.surface import Tension
from scenarios.references.isph.impact import SmoothedImpact

CELLS = {"grid": 20, "isph": 5}
"""Method -> cells or layers of particles in the film, if not given."""

MOST_CELLS = 10_000_000
"""Of a grid; more need days and all of the memory."""

LONGEST = 30.0
"""A bead that has not left after this many times film/velocity has stuck."""

BOUNCES = 10
"""So has one that touches the plate this often."""


class Fall(Settings):
    """A bead that falls through a liquid film onto a plate."""

    by_place: ClassVar[int] = 4

    diameter: float = Field(5.5e-3, gt=0, description="of the bead [m]")
    liquid: str | Liquid = Field("water", description='"water" or "m5"; in Python also a Liquid')
    film: float = Field(0.4e-3, gt=0, description="depth of the film at rest [m]")
    velocity: float = Field(0.5, gt=0, description="of the bead towards the plate where it meets the film [m/s]")
    method: Literal["grid", "isph"] = Field(
        "grid",
        description='"grid": axisymmetric grid with liquid particles; "isph": smoothed particles in three dimensions, '
        "the method of the paper at its coarsest resolution, with an error of about 6 %",
    )
    solid: Material = Field(GLASS, description="of the bead, with the dry restitution")
    plate: Material = Field(GLASS, description="of the plate")
    viscosity: float | None = Field(None, ge=0, description="replaces that of the liquid, dynamic [Pa s]")
    cells: int | None = Field(
        None, ge=4, le=100,
        description='in the depth of the film; 20 if not given, and 5 layers of particles with "isph"',
    )  # fmt: skip
    gap_rule: Literal["fixed", "roughness", "elastohydrodynamic"] = Field(
        "fixed",
        description='gap at which the solids touch: "fixed", the "roughness" of the solids, or "elastohydrodynamic"',
    )
    minimum_gap: float = Field(1e-6, gt=0, description='of the rule "fixed" [m]')
    cavitation: float | None = Field(
        None, lt=0,
        description="lowest pressure of the liquid relative to the air, such as -1e5; without it, it holds any suction "
        "[Pa]",
    )  # fmt: skip
    wetted_share: float | None = Field(
        None,
        description="guess of the wetted radius over sqrt(D (film - gap)) instead of the tracked one, for comparison",
    )
    wetted_missing: float = Field(
        0.5, ge=0, description="share of its volume that the outermost wetted column may lack"
    )
    domain: float = Field(1.0, gt=0, description="width of the domain, over the usual one; from about 0.8 on")
    flip: float = Field(0.97, ge=0, le=1, description="share of its own velocity that a liquid particle keeps")
    particles_per_side: int = Field(3, ge=1, le=6, description="of a cell, along radius and height")
    courant: float = Field(0.5, gt=0, le=1, description="cells that the liquid may cross in a step")
    surface_tension: float = Field(
        0.0, ge=0, description="of the liquid; 0 neglects it, as in the paper; water has 0.0728, M5 0.0192 [N/m]"
    )
    contact_angle: float = Field(
        0.0, ge=0, le=180, description="static, of bead and plate, within the liquid; 0 wets them [deg]"
    )
    gravity: float = Field(9.81, ge=0, description="towards the plate [m/s2]")
    progress: Callable[[GridImpact | SmoothedImpact], None] | None = Field(None, description="called after every step")

    @model_validator(mode="after")
    def _go_together(self) -> Fall:
        if self.method == "isph":
            for name in OF_GRID:
                if getattr(self, name) != type(self).model_fields[name].default:
                    limit = 'left out with method = "isph"'
                    raise InputError(name, getattr(self, name), limit, "it is an option of the grid")
        if self.film > 0.5 * self.diameter:
            raise InputError("film", self.film, f"at most the radius of the bead, {0.5 * self.diameter:g} m")
        if self.surface_tension == 0.0 and self.contact_angle != 0.0:
            remedy = "water has 0.0728 N/m"
            raise InputError("contact_angle", self.contact_angle, "left out without surface_tension", remedy)
        return self

    def settings(self, liquid: Liquid, cells: int) -> Solver:
        """Numbers of the method."""
        rule = self.gap_rule, self.minimum_gap
        gap = touching_gap(*rule, liquid.viscosity, self.velocity, self.diameter, (self.solid, self.plate))
        if not gap < self.film / cells:
            limit = f"below a cell, {self.film / cells:g} m"
            raise InputError("minimum_gap", gap, limit, "the film is too thin for this gap")
        angle = math.radians(self.contact_angle)
        return Solver(
            minimum_gap=gap, flip=self.flip, per_side=self.particles_per_side, missing=self.wetted_missing,
            guessed=self.wetted_share, cavitation=self.cavitation, courant=self.courant,
            tension=Tension(self.surface_tension, angle, angle) if self.surface_tension > 0.0 else None,
        )  # fmt: skip


OF_GRID = (
    "cavitation", "wetted_share", "wetted_missing", "domain", "flip", "particles_per_side", "courant",
    "surface_tension", "contact_angle",
)  # fmt: skip
"""What only the grid has."""


@takes(Fall)
def impact(fall: Fall) -> FilmImpact:
    """Let a bead fall through a liquid film onto a plate.

    >>> round(impact(liquid=Liquid(density=1e-3, viscosity=0.0), cells=5, gravity=0.0).restitution, 4)
    0.98
    """
    liquid, cells = liquid_named(fall.liquid, fall.viscosity), fall.cells or CELLS[fall.method]
    diameter, film, velocity, density = fall.diameter, fall.film, fall.velocity, fall.solid.density
    bead = Bead(0.5 * diameter, density * math.pi / 6.0 * diameter**3, film, -velocity)
    numbers = fall.settings(liquid, cells)
    of_liquid = (liquid.density, liquid.viscosity, fall.solid.restitution, fall.gravity, numbers)
    run = (
        SmoothedImpact(bead, film, cells, *of_liquid)
        if fall.method == "isph"
        else GridImpact(grid_for(diameter, film, cells, fall.domain), bead, film, *of_liquid)
    )
    return integrate(run, velocity, density, fall.progress)


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
