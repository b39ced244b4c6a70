r"""Drag of every particle, by the drag law of the run, and the extra drag beside walls.

**Drag law.** It gives :math:`b = 3\pi\eta d\,\varepsilon F`. Model A adds to :math:`b(u-v)` the pressure gradient on
the volume of the particle, and most of this gradient is the drag of the particles themselves. Where it changes, at the
surface of a bed, the cells smear it over both sides. With sharp surfaces a particle there takes that of the drag which
it sees,

.. math:: b(u-v) + V\left(\frac{\varphi_i}{\varepsilon_i}\,r_i - \nabla p' - \overline{f/\varepsilon}\right),\qquad
          f = \overline{b(u-v)}/V_c

with r the drag over the volume of a particle, as a mean over the particles around each one
(:mod:`cfddem.coupling.seen_solids`). What the drag around has added to the pressure gradient of the cells is taken out
of it. In an even suspension the two are equal, and this is model A, as with smeared surfaces; in model B the force is
:math:`b(u-v)/\varepsilon`.

**Beside walls**, by the laws of :mod:`closures.wall_drag`,

.. math:: F = 6\pi\eta R\,\sum_w\left[(\lambda_n-1)\,nn + (\lambda_t-1)(1-nn)\right]\cdot(u-v)

over the nearest wall or all walls, with n the normal of the wall, less what the films of the particle solver apply.
Every flat or round face is a wall: a capped cylinder has three. The sum over walls is an approximation. At finite Re it
is added to the drag of the drag law: creeping flow near the wall, which is too much far from it.

It is implicit in every direction (:mod:`cfddem.coupling.transfer`). In a step in which a film takes over, the drag
towards the wall has the part R/h for as long as the film does not act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from inspect import signature
from typing import Any, Literal

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, bind_arguments, specialise
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles
from cfddem.particles.vectors import dot, flat, of_row
from cfddem.particles.walls.arrays import wall_arrays
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.nearest_point import nearest
from cfddem.particles.walls.wall import Wall
from closures.kinds import DRAG_ARGUMENTS
from closures.registry import Law, law_of
from closures.wall_drag import along_wall, film_along_wall, towards_wall

OWED = Field("drag_momentum", "N s", 3, "memory", meaning="of drag and its pressure, not received by the fluid yet")

drag_factor = Slot("drag_factor")


class Drag(FluidForce):
    """Drag over slip of every particle.

    law    drag law, or its function
    model  "A" or "B" of the fluid
    sharp  the kernel of the run, for sharp surfaces of beds in model A; None for smeared ones. The fluid then receives
           b (u - v) in the step, and what the pressure differs by a step later; in an even suspension this is nothing

    outside  how often the law was evaluated outside its range
    """

    name, lines = "drag", ("drag",)

    def __init__(self, law: Law | Callable[..., float], model: str = "A", sharp: FilterKernel | None = None) -> None:
        law = law if isinstance(law, Law) else law_of(law)
        self.law_name, self._kernel = law.name, sharp
        self.sharp, self._model_b = sharp is not None, model == "B"
        self.fields = (OWED,) if self.sharp else ()
        self._alone = np.zeros(0)  # conductance of the drag law alone
        self.needs_sizes = "diameter_ratio" in signature(law.function).parameters
        factor = bind_arguments(law.function, ", ".join(DRAG_ARGUMENTS), {name: name for name in DRAG_ARGUMENTS})
        self._loop = specialise(_conductances, {"drag_factor": factor})
        self._ranges = tuple(law.ranges.get(name, (0.0, math.inf)) for name in DRAG_ARGUMENTS)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip, and give the fluid what the last step has left."""
        conductance = self.conductance(terms.particles, terms.flow)
        terms.resist("drag", conductance)
        if self._kernel is not None:
            self._alone = conductance * terms.flow.narrowing
            terms.pull("drag", -terms.particles[OWED.name] / terms.step)

    def respond(self, terms: Any) -> None:
        """Put the pressure of the drag that a particle sees in the place of that of the drag in the cells around."""
        if self._kernel is None:
            return
        kernel, flow, volume = self._kernel, terms.flow, terms.cell_map.volume
        slip = terms.mean_slip("drag")
        drag, over_volume, rest = np.empty((3, *slip.shape))
        _drag_alone(slip, self._alone, volume, drag, over_volume)
        density = kernel.spread(terms.cell_map, drag) / kernel.grid.cell_volume
        in_cells = kernel.sample(terms.cell_map.stencil, terms.cell_map.radius, density / (1.0 - terms.solid))
        in_solids = terms.seen_solids.averaged(over_volume)
        _seen_less_that_of_cells(in_solids, in_cells, flow.voidage, flow.company, volume, rest)
        terms.push("drag", rest)
        np.multiply(rest, terms.step, out=terms.particles[OWED.name])

    def conductance(self, particles: Particles, flow: SampledFlow) -> Array:
        r"""Drag over slip of every particle (N,) [kg/s]: :math:`3\pi\eta d\,\varepsilon F`, in model B over eps."""
        conductance = np.empty(particles.count)
        outside, wrong = self._loop(
            particles.viscosity, particles.radius, flow.reynolds, flow.voidage, flow.diameter_ratio, self._ranges,
            self._model_b, conductance,
        )  # fmt: skip
        self.outside += int(outside)
        if wrong:
            share = 1.0 if self._model_b else flow.voidage
            self._require_drag(flow, conductance / (6.0 * math.pi * particles.viscosity * particles.radius * share))
        return conductance

    def _require_drag(self, flow: SampledFlow, factor: Array) -> None:
        """Refuse a law that pushes a particle against the flow or is not finite; a flow that is not finite is no fault
        of the law."""
        wrong = ~((factor >= 0.0) & (factor < np.inf)) & np.isfinite(flow.reynolds) & np.isfinite(flow.voidage)
        if wrong.any():  # local: every rank has its own particles
            n = int(np.argmax(wrong))  # local: the first on this rank
            at = f"it is {factor[n]:.3g} at Re = {flow.reynolds[n]:.3g}, voidage = {flow.voidage[n]:.3g}"
            raise InputError("laws.drag", self.law_name, "a law that is finite and not negative", at)


@threaded
def _drag_alone(slip, alone, volume, drag, over_volume):
    """Force of the drag law alone on every particle, and the same over its volume (N, 3) [N], [N/m3].

    slip   of the cells (N, 3) [m/s]
    alone  conductance of the drag law alone (N,) [kg/s]
    """
    for n in prange(len(drag)):
        for d in range(3):
            drag[n, d] = alone[n] * slip[n, d]
            over_volume[n, d] = drag[n, d] / volume[n]


@threaded
def _seen_less_that_of_cells(in_solids, in_cells, voidage, company, volume, rest):
    """Pressure of the drag that every particle sees, less that of the drag in the cells around it (N, 3) [N].

    in_solids, in_cells  drag over volume as it sees it, and drag over fluid as it gathers it (N, 3) [N/m3]
    company              share of the others in the solids of the cells around (N,) [-]
    """
    for n in prange(len(rest)):
        for d in range(3):
            of_solids = (1.0 - voidage[n]) / voidage[n] * in_solids[n, d]
            rest[n, d] = volume[n] * (of_solids - company[n] * in_cells[n, d])


@threaded
def _conductances(viscosity, radius, reynolds, voidage, ratio, ranges, model_b, conductance):
    """Drag over slip of every particle; returns how many flows are outside the range of the law, and how many numbers
    are negative or not finite."""
    numbers, voidages, ratios = ranges
    slowest, fastest = numbers
    densest, loosest = voidages
    smallest, largest = ratios
    outside = wrong = 0
    for n in prange(len(reynolds)):
        factor = drag_factor(reynolds[n], voidage[n], ratio[n])
        conductance[n] = factor
        beyond = reynolds[n] < slowest or reynolds[n] > fastest
        beyond = beyond or voidage[n] < densest or voidage[n] > loosest
        outside += 1 if beyond or ratio[n] < smallest or ratio[n] > largest else 0
        wrong += 0 if factor >= 0.0 and factor < math.inf else 1
    # In the same loop the compiler would evaluate all branches of a law.
    for n in prange(len(reynolds)):
        conductance[n] *= 6.0 * math.pi * viscosity[n] * radius[n] * (1.0 if model_b else voidage[n])
    return outside, wrong


# ---------------------------------------------------------------- beside walls


CLOSEST = 1e-4
"""Gap over the radius, at least; what grows further is in the films."""


SEEN = Field(
    "wall_drag_flow", "m/s", 3, "memory", np.nan, meaning="fluid velocity at the particle before the last fluid step"
)
"""NaN in inserted particles, which have seen none."""


class WallDrag(FluidForce):
    """Extra drag beside walls.

    walls   at rest; no meshes
    which   "nearest" or "all"
    film    whether films resist approach, which takes R/h out of the drag
    shear   whether they resist sliding
    """

    name, lines, fields = "wall_drag", ("drag",), (SEEN,)

    def __init__(
        self, walls: Sequence[Wall], which: Literal["nearest", "all"], *, film: bool, shear: bool = False
    ) -> None:
        for wall in walls:
            if isinstance(wall, Mesh) or wall.sweep() != 0.0:
                raise InputError("wall_drag", type(wall).__name__, "walls at rest that are no meshes")
        flat_walls = flat(wall_arrays(walls))
        self._surfaces, self._options = (flat_walls.kind, flat_walls.shape), (which == "all", film, shear)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip, by direction; beside slanting walls the fluid is foreseen to change as in the last step."""
        flow, before = _flow(terms), terms.particles[SEEN.name]
        terms.resist("drag", self.resistance(terms.particles, terms.step))
        if terms.last_step > 0.0:
            change = (terms.step / terms.last_step) * (flow - before)
            terms.foreseen = np.where(np.isnan(before), 0.0, 0.5 * change)  # drag sees the mean over the step

    def end(self, terms: ForceTerms) -> None:
        """Store the fluid velocity before the step."""
        terms.particles[SEEN.name][:] = _flow(terms)

    def resistance(self, particles: Particles, step: float = 0.0) -> Array:
        """Extra resistance of every particle over a step [s], by direction (N, 3, 3) [kg/s]."""
        tensor, way = np.empty((particles.count, 3, 3)), step * particles.velocity
        _beside(particles.position, particles.radius, particles.viscosity, way, self._surfaces, self._options, tensor)
        return tensor


def _flow(terms: ForceTerms) -> Array:
    """Velocity of the fluid at the particles before the step (N, 3) [m/s]."""
    return np.asarray(terms.flow.slip + terms.particles.velocity)


@inline
def _factors(gap, rise, film, shear):
    """What a wall adds to the drag factor towards it and along it, over a step in which the gap rises so much."""
    beyond = 1.0 if gap >= 1.0 else 0.0  # the share of the step in which no film acts
    if rise != 0.0:
        beyond = min(max((max(gap, gap + rise) - 1.0) / abs(rise), 0.0), 1.0)
    across = towards_wall(gap) - 1.0 + (beyond / max(gap, 1.0) if film else 1.0 / gap)
    along = along_wall(gap) - 1.0
    if shear:
        along -= film_along_wall(gap)
    return across, along


@inline
def _beside_one(place, radius, viscosity, way, surfaces, options, tensor):
    kind, shape = surfaces
    stokes, closest = 6.0 * math.pi * viscosity * radius, math.inf
    tensor[:] = 0.0
    for w in range(len(kind)):
        normal, distance, _, _, _, _ = nearest(kind, shape, w, place)
        gap = max(distance / radius - 1.0, CLOSEST)
        if not options[0] and gap >= closest:
            continue
        closest = gap
        across, along = _factors(gap, dot(way, normal) / radius, options[1], options[2])
        for d in range(3):
            for e in range(3):
                more = along * (d == e) + (across - along) * normal[d] * normal[e]
                tensor[d, e] = stokes * more + (tensor[d, e] if options[0] else 0.0)


@threaded
def _beside(position, radius, viscosity, way, surfaces, options, tensor):
    """Resistance of every particle on its way over a step [m]."""
    for n in prange(len(radius)):
        _beside_one(of_row(position, n), radius[n], viscosity[n], of_row(way, n), surfaces, options, tensor[n])
