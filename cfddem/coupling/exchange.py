r"""What fluid and particles do to each other over a fluid step; every conversion between the two stands here.

The force of the fluid on a particle of volume V and diameter d, at the velocity v in a fluid of velocity u:

.. math:: \text{model A:}\quad b(u-v) - V\nabla p' - \rho V g, \qquad b = 3\pi\eta d\,\varepsilon F
.. math:: \text{model B:}\quad \tfrac{1}{\varepsilon}\, b(u-v) - \rho V g

with F(Re, eps) the drag factor of the law chosen. A cell feels :math:`\beta = \sum b / V_{cell}`.

**Implicit on both sides.** Over a step h a particle of mass m also feels the mean of all its other forces f
(weight, contacts), known from the step before. With the drag taken between the ends of the step,

.. math:: J = h\,b^*(u - v^*),\qquad b^* = \frac{b}{1+\theta\lambda},\quad v^* = v + \theta\frac{hf}{m},\quad
          \lambda = \frac{hb}{m},\quad \theta=\frac{1+\lambda}{2+\lambda}

which is of second order for weak drag and never passes the fluid's velocity for strong. The fluid takes b* and v*
into its own implicit step; the impulse that it has then given, cell by cell, is the one that the particle gets, as
a constant force. What one side loses the other receives to round-off, whatever the stiffness of either.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.coupling import exchange_loops as loops
from cfddem.coupling.clocks import COURANT, crossing_rate
from cfddem.coupling.drag_loop import DragLoop
from cfddem.coupling.lift import lift_force, vorticity
from cfddem.coupling.own_wind import OwnWind
from cfddem.coupling.own_wind_tables import MODES
from cfddem.coupling.spin import turn_with_fluid
from cfddem.coupling.voidage import Footprint, Placement, Spreading
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Bodies
from closures.law import Law

NO_CHANGE = 1e-6
"""Two steps of the fluid that differ by less than this part are one."""

SETTLES = 0.01
"""By which part of its distance to the step in use the usual step of the fluid moves in every step."""

LEAST_VOIDAGE = 0.2
"""Below this no packing of spheres exists: particles overlap, or the kernel is too narrow for its cells."""


class Offer(NamedTuple):
    """What particles bring into a fluid step."""

    step: float  # [s]
    place: Placement
    voidage: Array  # (nz, ny, nx)
    drag_coefficient: Array  # beta* (nz, ny, nx) [kg/m3/s]
    drag_momentum: Array  # beta* v* (nz, ny, nx, 3) [N/m3]
    source: Array | None  # force on the fluid (nz, ny, nx, 3) [N/m3]
    resistance: Array  # b* (N,) [kg/s]
    target: Array  # v* (N, 3) [m/s]
    slip: Array  # u - v (N, 3) [m/s]
    explicit: Array  # forces known before the fluid's step: lift, viscous stress, added mass (N, 3) [N]
    screening: Array  # rate at which the drag of the others stops the fluid around (N,) [1/s]

    @property
    def fields(self) -> tuple[Array, Array, Array, Array | None]:
        """The arguments of the fluid's step after its length."""
        return self.voidage, self.drag_coefficient, self.drag_momentum, self.source


class Met(NamedTuple):
    """What every particle meets, without what it makes of it itself."""

    slip: Array  # u - v (N, 3) [m/s]
    wind: Array  # of its own, in what it sees (N, 3) [m/s]
    voidage: Array  # (N,)
    reynolds: Array  # of the slip (N,)
    others: Array  # number of others per volume (N,) [1/m3]


class Exchange:
    """Drag, pressure force and buoyancy between a fluid and its particles.

    fluid       the solver; its model, "A" or "B", holds for the exchange
    spreading   how particles spread over cells
    drag        card of a drag law; None for none
    added_mass  coefficient C of the added mass C rho V; 0 for none
    lift        of shear (Saffman-Mei) and of spin (Magnus)
    torque      of the fluid against spin relative to half its vorticity
    viscous_stress  V div(tau), in model A
    own_wind    take the velocity and the voidage that a lone particle itself makes out of what it meets
    """

    def __init__(
        self,
        fluid: FluidSolver,
        spreading: Spreading,
        drag: Law | None,
        *,
        added_mass: float = 0.0,
        own_wind: bool = True,
        lift: bool = False,
        torque: bool = False,
        viscous_stress: bool = False,
    ) -> None:
        self.fluid, self.spreading = fluid, spreading
        self.added_mass, self.lift, self.torque = float(added_mass), lift, torque
        self.viscous_stress = viscous_stress and fluid.model == "A"
        self.own_wind = OwnWind(spreading) if own_wind else None
        self.spin_work = 0.0  # kinetic energy that the last torque of the fluid has given to the particles [J]
        self.outside = 0  # how often the drag law was asked outside of its range
        self._law = DragLoop(drag)
        self._id = np.zeros(0, np.int64)  # whose rows the following are
        self._memory = np.zeros((0, 9))  # velocity, drag impulse and wind of the last step
        self._winds = np.zeros((0, MODES if own_wind else 0, 3))  # own winds [m/s]
        self._trail = [spreading.footprint(np.zeros((0, 3)), np.zeros(0))] * 2  # at the two steps before
        self._last_step = self._usual_step = 0.0

    # ------------------------------------------------------------ around one fluid step

    def offer(self, bodies: Bodies, step: float) -> Offer:
        """What the particles bring into the coming fluid step of a length [s]: volume, drag and momentum."""
        spreading, fluid = self.spreading, self.fluid
        self._follow(bodies)
        bodies.viscosity[:] = fluid.viscosity_at(bodies.position)
        place = spreading.place(self._where(bodies, step), bodies.radius)
        solid = spreading.solid_fraction(place)
        met = self._meet(bodies, place, solid)
        drag = self._resistance(bodies, met, self._diameter_ratio(bodies, place, solid))
        implicit, target, carried = np.empty(bodies.count), np.empty((bodies.count, 3)), np.empty((bodies.count, 4))
        loops.promise(
            drag, 1.0 / self.inertia(bodies), self._other_force(bodies), bodies.velocity, met.wind, step,
            implicit, target, carried,
        )  # fmt: skip
        fields = spreading.smooth(spreading.deposit(place, carried)) / fluid.grid.cell_volume
        aside = self._aside(bodies, place, met.slip)
        swept, lost = self._swept_along(bodies, met.slip, step)
        return Offer(
            step=step,
            place=place,
            voidage=1.0 - solid,
            drag_coefficient=fields[0],
            drag_momentum=np.moveaxis(fields[1:], 0, -1),
            source=self._returned(place, lost - aside),
            resistance=implicit,
            target=target,
            slip=met.slip,
            explicit=aside + swept,
            screening=drag * met.others / (fluid.density * met.voidage),
        )

    def answer(self, bodies: Bodies, offer: Offer, gravity: Array) -> None:
        """Leave in `bodies.applied` what the fluid, having made its step, does to every particle meanwhile.

        gravity  (3,) [m/s2]; weight and buoyancy are among the forces applied
        """
        place, fluid, spreading = offer.place, self.fluid, self.spreading
        weight, velocity, _ = fluid.drag_exchange()
        fields = np.moveaxis(np.concatenate([weight, weight * velocity], axis=-1), -1, 0)
        seen = spreading.gather(place.footprint, spreading.smooth(fields))
        pressure, drag = self._pressure_force(bodies, place), np.empty((bodies.count, 3))
        loops.settle(
            seen, offer.resistance, offer.target, pressure, offer.explicit, place.volume, bodies.mass,
            fluid.density, gravity, bodies.velocity, offer.slip, offer.step,
            self._memory, drag, bodies.applied, bodies.force,
        )  # fmt: skip
        if self.torque and fluid.viscous:
            curl = self._vorticity(place)
            self.spin_work = turn_with_fluid(bodies, curl, fluid.density, offer.step)
        if self.own_wind is not None and fluid.viscous:
            self.own_wind.advance(
                place, self._winds, drag, offer.slip, offer.screening, fluid.density, bodies.viscosity, offer.step
            )
        self._trail = [self._trail[-1], place.footprint]
        self._last_step = offer.step

    @property
    def drag_impulse(self) -> Array:
        """Impulse of drag on every particle in the last fluid step, as they stood in it (N, 3) [N s]."""
        return self._memory[:, 3:6]

    def inertia(self, bodies: Bodies) -> Array:
        """Mass and added mass of every particle (N,) [kg]; without end where nothing moves it."""
        with np.errstate(divide="ignore"):
            return 1.0 / bodies.inverse_mass

    def checkpoint(self) -> dict[str, Any]:
        """Copies of what the next step depends on beside fluid and particles."""
        return {
            "id": self._id.copy(),
            "memory": self._memory.copy(),
            "winds": self._winds.copy(),
            "trail": {str(n): each._asdict() for n, each in enumerate(self._trail)},
            "last_step": self._last_step,
            "usual_step": self._usual_step,
            "outside": self.outside,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `checkpoint()`."""
        self._id, self._memory, self._winds = (np.array(state[name]) for name in ("id", "memory", "winds"))
        kept = [state["trail"][name] for name in sorted(state["trail"])]
        self._trail = [Footprint(np.array(each["cells"]), np.array(each["weights"])) for each in kept]
        self._last_step, self._usual_step = float(state["last_step"]), float(state["usual_step"])
        self.outside = int(state["outside"])

    # ------------------------------------------------------------ terms

    def _where(self, bodies: Bodies, step: float) -> Array:
        r"""Where the fluid is to see the particles in a step h, :math:`x + (h - h_u)\,v` (N, 3) [m].

        The voidage moves over a step from where particles were seen in the last to where they are seen in this
        one. Between the two lies the last step of the particles, h_l, but h for the fluid; seen where they will be
        by h less the usual step h_u, both intervals are h. Otherwise particles would displace the fluid at h_l/h
        of their rate, a shock of pressure in a liquid. The usual step follows slowly.
        """
        usual = self._usual_step = self._usual_step or step
        if abs(step - usual) < NO_CHANGE * step:
            return bodies.position
        crossing = crossing_rate(bodies.velocity, self.fluid.grid.spacing)
        usual = min(usual, step + COURANT / max(crossing, 1e-300))  # nobody is seen cells away
        self._usual_step = usual + SETTLES * (step - usual)
        return self.spreading.wrapped(bodies.position + (step - usual) * bodies.velocity)

    def _aside(self, bodies: Bodies, place: Placement, slip: Array) -> Array:
        """Lift and viscous stress on every particle (N, 3) [N]."""
        fluid, spreading = self.fluid, self.spreading
        force = np.zeros_like(slip)
        if self.viscous_stress:
            force += place.volume[:, None] * spreading.gather(
                place.footprint, spreading.smooth(fluid.cell_viscous_force())
            )
        if self.lift and fluid.viscous:
            seen = self._vorticity(place)
            force += lift_force(slip, seen, bodies.spin, bodies.radius, fluid.density, bodies.viscosity)
        return force

    def _vorticity(self, place: Placement) -> Array:
        """Vorticity of the fluid around every particle (N, 3) [1/s]."""
        curl = vorticity(np.moveaxis(self.fluid.velocity, -1, 0), self.fluid.grid.spacing)
        return self.spreading.gather(place.footprint, self.spreading.smooth(curl))

    def _swept_along(self, bodies: Bodies, slip: Array, step: float) -> tuple[Array, Array]:
        r"""Force of the added mass, :math:`C\rho V(\dot u - \dot v)`; its second part is in the inertia already.

        returns  its first part (N, 3) [N]; what the fluid gets for both, as a force over the coming step (N, 3) [N]

        The acceleration is that of the step before: the fluid gets what the particles lost then.
        """
        if self.added_mass == 0.0 or self._last_step == 0.0:
            return np.zeros_like(slip), np.zeros_like(slip)
        before = self._memory[:, 6:]
        gained = np.where(np.isnan(before), 0.0, slip + bodies.velocity - before)  # newcomers have met nothing before
        swept = self._added(bodies) * gained / self._last_step
        return swept, self.under_way(bodies) / step - swept

    def _returned(self, place: Placement, force: Array) -> Array | None:
        """Force on the fluid, spread over cells (nz, ny, nx, 3) [N/m3]; None where there is none."""
        if not (self.added_mass or self.lift or self.viscous_stress):
            return None
        source = self.spreading.smooth(self.spreading.deposit(place, force)) / self.fluid.grid.cell_volume
        return np.ascontiguousarray(np.moveaxis(source, 0, -1))

    def under_way(self, bodies: Bodies) -> Array:
        """Momentum that added mass has taken from every particle and the fluid gets in the next step (N, 3) [N s]."""
        self._follow(bodies)
        moved: Array = self._added(bodies) * (bodies.velocity - self._memory[:, :3])
        return moved

    def _added(self, bodies: Bodies) -> Array:
        """Added mass of every particle (N, 1) [kg]; none where nothing moves it."""
        return np.where(bodies.inverse_mass > 0.0, self.inertia(bodies) - bodies.mass, 0.0)[:, None]

    def _meet(self, bodies: Bodies, place: Placement, solid: Array) -> Met:
        """What every particle meets, less what it makes of it itself."""
        spreading, fluid = self.spreading, self.fluid
        velocity = spreading.smooth(np.moveaxis(fluid.velocity, -1, 0))
        seen = spreading.gather(place.footprint, np.concatenate([velocity, solid[None]]))
        own = np.zeros(bodies.count) if self.own_wind is None else self.own_wind.solid(place)
        scalars, vectors = np.empty((3, bodies.count)), np.empty((2, bodies.count, 3))
        met = Met(*vectors, *scalars)
        loops.meet(
            seen, place.volume, bodies.radius, bodies.velocity, bodies.viscosity, self._winds, own, fluid.density, *met,
        )  # fmt: skip
        return met

    def _diameter_ratio(self, bodies: Bodies, place: Placement, solid: Array) -> Array:
        """Diameter of every particle over the Sauter mean around it (N,) [-]; 1 where the law does not ask.

        The Sauter mean is the volume of the particles around over the sum of theirs divided by the diameter.
        """
        if not self._law.knows_sizes:
            return np.ones(bodies.count)
        spreading, diameter = self.spreading, 2.0 * bodies.radius
        volume = place.volume
        surface = spreading.smooth(spreading.deposit(place, (volume / diameter)[:, None])) / self.fluid.grid.cell_volume
        around = spreading.gather(place.footprint, np.concatenate([solid[None], surface]))
        ratio: Array = diameter * around[:, 1] / around[:, 0]
        return ratio

    def _resistance(self, bodies: Bodies, met: Met, ratio: Array) -> Array:
        """Drag over slip, b (N,) [kg/s]; of the fluid's model."""
        factor, outside = self._law.factors(met.reynolds, met.voidage, ratio)
        self.outside += outside
        resistance: Array = 6.0 * math.pi * bodies.viscosity * bodies.radius * met.voidage * factor
        return resistance / met.voidage if self.fluid.model == "B" else resistance

    def _other_force(self, bodies: Bodies) -> Array:
        """Mean of all forces but drag over the step before (N, 3) [N]; at the start, those at hand."""
        if self._last_step == 0.0:
            return bodies.force
        force = np.empty((bodies.count, 3))
        loops.other_force(self._memory, bodies.velocity, self.inertia(bodies), self._last_step, force)
        return force

    def _pressure_force(self, bodies: Bodies, place: Placement) -> Array:
        r"""Force of the fluid's mean pressure, :math:`-V\nabla p'` of model A (N, 3) [N].

        The fluid has felt the voidage of the last three placements, 1/4, 1/2 and 1/4 of them; so do the particles.
        """
        if self.fluid.model == "B":
            return np.zeros((bodies.count, 3))
        spreading, force = self.spreading, np.empty((bodies.count, 3))
        gradient = spreading.smooth(self.fluid.cell_pressure_gradient())
        seen = (spreading.gather(footprint, gradient) for footprint in (*self._trail, place.footprint))
        loops.press(place.volume, *seen, force)
        return force

    def _follow(self, bodies: Bodies) -> None:
        """Bring what is remembered into the order of the particles now; newcomers were as they are.

        What they met before is not known: NaN.
        """
        if np.array_equal(bodies.id, self._id):
            return
        row = np.full(int(max(bodies.id.max(initial=-1), self._id.max(initial=-1))) + 1, -1)
        row[self._id] = np.arange(len(self._id))
        row = row[bodies.id]
        fresh = row < 0
        self._id, self._memory, self._winds = bodies.id.copy(), _taken(self._memory, row), _taken(self._winds, row)
        self._memory[fresh, :3], self._memory[fresh, 6:] = bodies.velocity[fresh], np.nan
        self._trail = [Footprint(*(_taken(each, row) for each in footprint)) for footprint in self._trail]
        here = self.spreading.footprint(bodies.position[fresh], bodies.radius[fresh])
        for footprint in self._trail:
            footprint.cells[fresh], footprint.weights[fresh] = here


def _taken(values: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Rows of an array; of zeros for the row -1."""
    taken: np.ndarray = np.concatenate([values, np.zeros((1, *values.shape[1:]), values.dtype)])[row]
    return taken
