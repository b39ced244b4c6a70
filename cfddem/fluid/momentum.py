r"""Momentum of the fluid, averaged over volumes that hold many particles; voidage eps, velocity u between them.

Continuity, the same in both models, with the time derivative kept:

.. math:: \partial_t\varepsilon + \nabla\cdot(\varepsilon u) = 0

The pressure p' excludes gravity, :math:`p' = p - \rho\, g\cdot x`, so that a fluid at rest stays at rest to the
last bit. The viscous stress of both models is :math:`\tau = \mu(\nabla u + \nabla u^T - \tfrac23 \nabla\cdot u)`.

**Model A**: pressure and gravity are shared between the phases by volume.

.. math:: \partial_t(\rho\varepsilon u) + \nabla\cdot(\rho\varepsilon u u) = -\varepsilon\nabla p_A
          + \varepsilon\rho g + \nabla\cdot(\varepsilon\tau) + \beta_A(v-u) + s
          \quad\text{with}\quad -\varepsilon\nabla p_A + \varepsilon\rho g = -\varepsilon\nabla p_A'

**Model B**: the fluid carries the whole pressure gradient. Particles feel the buoyancy of the displaced weight,
:math:`-\rho V g`, and a larger drag; the fluid gets the reaction of the buoyancy, :math:`(1-\varepsilon)\rho g`.

.. math:: \partial_t(\rho\varepsilon u) + \nabla\cdot(\rho\varepsilon u u) = -\nabla p_B
          + \varepsilon\rho g + (1-\varepsilon)\rho g + \nabla\cdot(\varepsilon\tau) + \beta_B(v-u) + s
          \quad\text{with}\quad -\nabla p_B + \rho g = -\nabla p_B',\ \ \beta_B = \beta_A/\varepsilon

Here v is the velocity of the particles, s a source per volume. The coefficient beta [kg/m3/s] passed to the solver
is that of the model chosen. With uniform eps and no drag both give the same velocities, and
:math:`p_B' = \varepsilon p_A'`. Where eps varies, :math:`-\varepsilon\nabla p = -\nabla(\varepsilon p) +
p\nabla\varepsilon`: model A gives the second part to the particles, and a ledger of the fluid must count it.

In time (step h, from n to n+1) storage is centred, and convection and viscous stress follow Heun's two stages.
The pressure is the one that makes the new velocity satisfy continuity. Drag acts on
:math:`u_\theta = \theta u^{n+1} + (1-\theta)u^n` with :math:`\theta = (1+z)/(2+z)` and
:math:`z=\beta h/(\varepsilon\rho)`. It is of second order for small z, and fully implicit for large z. A velocity
relaxes by 1/(1 + z + z^2/2), never past its target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import inline, prange, serial, threaded, vector_inline
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import LOW, Array, Grid
from cfddem.fluid.step_limit import Rates

# ---------------------------------------------------------------- terms, one function each


@inline
def carried(flux, far_low, low, high, far_high, central):
    """Volume flux times the value it carries through a face: central, or upwind with the MC limiter."""
    upstream = low if flux > 0.0 else high
    ahead = high - low if flux > 0.0 else low - high
    behind = low - far_low if flux > 0.0 else high - far_high
    mean = 0.5 * (ahead + behind)
    steepest = min(0.5 * abs(mean), min(abs(ahead), abs(behind)))
    limited = steepest if mean > 0.0 else -steepest
    slope = 2.0 * limited if ahead * behind > 0.0 else 0.0
    return flux * (upstream + 0.5 * (central * ahead + (1.0 - central) * slope))


@inline
def stress(viscosity, low, high, inverse_across, cross_low, cross_high, inverse_along):
    """eps tau_de without its dilatation: gradient of u_d along e and of u_e along d; viscosity is eps mu."""
    return viscosity * ((high - low) * inverse_across + (cross_high - cross_low) * inverse_along)


@inline
def implicitness(stiffness):
    """theta of the drag; 1/2 for weak, 1 for stiff drag."""
    return (1.0 + stiffness) / (2.0 + stiffness)


@inline
def slip_weight(face_voidage, cell_voidage, model_b):
    r"""How strongly the drag of a cell acts on a face that it shares with a cell of other voidage.

    The flux eps (u - v) is continuous through the face, so the slip inside the cell is that of the face times
    w = eps_face/eps_cell. The pressure drop in that half of the momentum cell is drag/eps_cell (model A), acting
    on eps_face of the face: together w^2; in model B the drop is the drag itself: w. For smooth voidage both
    average to 1 to second order, and across a jump the pressure drop of a fixed bed is that of its two halves.
    """
    share = face_voidage / cell_voidage
    return share * (share + model_b * (1.0 - share))


# ---------------------------------------------------------------- loops


@inline
def strides(shape):
    """Distance of the next cell along x, y, z in a padded field of this shape that is laid out flat."""
    return 1, shape[2], shape[1] * shape[2]


@inline
def inside(k, shape, margin):
    """Where the inside faces of plane k, and so many layers of ghosts around them, begin in a flat field, and how many.

    The ghosts between two rows are among them: one long loop over a plane is faster than short ones over its rows.
    What it writes into these ghosts is not used.
    """
    edge, plane = (LOW - margin) * (shape[2] + 1), shape[1] * shape[2]
    return k * plane + edge, plane - 2 * edge


@serial
def line(field, start, count):
    """Part of a flat field: loops over lines indexed from zero are the ones that vectorise."""
    return field[start : start + count]


class Medium(NamedTuple):
    """What does not change in the momentum balance of a fluid."""

    density: float  # rho [kg/m3]
    inverse: Array  # 1/spacing along x, y, z (3,) [1/m]
    central: float  # 1 for central convection, 0 for the MC limiter
    model_b: float  # 1 for model B, 0 for model A


class Balance(NamedTuple):
    """What the momentum balance of a step is made of: padded faces (3, ...) and cells."""

    old: Array  # faces, velocity before the step [m/s]
    force_a: Array  # faces, results of `transport` at the start and in the stage [N/m3]
    force_b: Array
    pressure: Array  # p' [Pa]
    stored: Array  # voidage that is stored with the old velocity,
    centred: Array  # that of the middle of the step,
    voidage: Array  # and that stored with the new velocity
    drag: Array  # (3, ...) beta along each axis [kg/m3/s]
    drag_momentum: Array  # (3, ...) beta v [N/m3]
    source: Array  # (3, ...) [N/m3]
    driving: Array  # mean pressure fall (3,) [Pa/m]
    solved: Array  # faces, 1 where one carries an unknown


@threaded
def transport(stretches, velocity, cells, buried, medium, flux, expansion, rate):
    """rate = div(eps tau) - div(rho eps u u) on faces away from smooth walls; also writes flux and expansion.

    stretches  `FluidStretches`

    velocity, flux (eps u), rate (3, ...); cells, which are voidage and viscosity (eps mu [Pa s]), and expansion
    (2/3 eps mu div u) padded cell fields; buried (3, ...) is 1 on faces inside a solid mask, whose neighbours see a
    no-slip wall half way; medium `Medium`.
    """
    inverse, (voidage, viscosity) = medium.inverse, cells
    shape, step = voidage.shape, strides(voidage.shape)
    voidage, viscosity, expansion = voidage.reshape(-1), viscosity.reshape(-1), expansion.reshape(-1)
    velocity, flux = velocity.reshape(3, -1), flux.reshape(3, -1)
    buried, rate = buried.reshape(3, -1), rate.reshape(3, -1)
    moving = velocity, flux, viscosity, buried
    first, begins, counts = stretches.around  # the compiler cannot give tuples of arrays to threads
    for k in prange(shape[0]):
        for part in range(first[k], first[k + 1]):
            at, n = begins[part], counts[part]
            for d in range(3):
                here, before = line(voidage, at, n), line(voidage, at - step[d], n)
                out, u = line(flux[d], at, n), line(velocity[d], at, n)
                for i in range(n):
                    out[i] = 0.5 * (here[i] + before[i]) * u[i]
            out, effective_viscosity = line(expansion, at, n), line(viscosity, at, n)
            u0, u1 = line(velocity[0], at, n), line(velocity[0], at + step[0], n)
            v0, v1 = line(velocity[1], at, n), line(velocity[1], at + step[1], n)
            w0, w1 = line(velocity[2], at, n), line(velocity[2], at + step[2], n)
            for i in range(n):
                growth = (u1[i] - u0[i]) * inverse[0] + (v1[i] - v0[i]) * inverse[1] + (w1[i] - w0[i]) * inverse[2]
                out[i] = (2.0 / 3.0) * effective_viscosity[i] * growth
    first_whole, begins_whole, counts_whole = stretches.whole
    for k in prange(shape[0]):
        for part in range(first_whole[k], first_whole[k + 1]):
            at, n = begins_whole[part], counts_whole[part]
            for d in range(3):
                out, right, left = line(rate[d], at, n), line(expansion, at, n), line(expansion, at - step[d], n)
                for i in range(n):
                    out[i] = (left[i] - right[i]) * inverse[d]
                for e in range(3):
                    _balance(out, moving, at, step, medium, d, e)


@vector_inline
def _balance(out, moving, at, step, medium, along, across):
    """Add to a line of the component u_d the balance over its two momentum faces along e; v is u_e.

    Across the component (e != d) these faces lie around edges of the grid, between the cells right and left of the
    face and those below or above them; along it (e == d) they are the centres of the two cells, where the same
    differences of u = v give twice the stretching.

    moving         velocity, flux, viscosity and buried faces
    at             place of the line in flat fields
    step           distance of the next cell along x, y, z there
    along, across  the directions d and e
    """
    velocity, fluxes, viscosity, buried_faces = moving
    u, v, flux, buried = velocity[along], velocity[across], fluxes[across], buried_faces[along]
    d, e, inverse_d, inverse_e = step[along], step[across], medium.inverse[along], medium.inverse[across]
    density, central = medium.density, medium.central
    n = out.size
    u0, u1, u2 = line(u, at - 2 * e, n), line(u, at - e, n), line(u, at, n)
    u3, u4 = line(u, at + e, n), line(u, at + 2 * e, n)
    wall_low, wall_high = line(buried, at - e, n), line(buried, at + e, n)
    f_right, f_left = line(flux, at, n), line(flux, at - d, n)
    f_right_up, f_left_up = line(flux, at + e, n), line(flux, at - d + e, n)
    v_right, v_left = line(v, at, n), line(v, at - d, n)
    v_right_up, v_left_up = line(v, at + e, n), line(v, at - d + e, n)
    m_right, m_left = line(viscosity, at, n), line(viscosity, at - d, n)
    if e == d:
        shared, mirror = 0.0, 0.0
        m_right_down, m_left_down, m_right_up, m_left_up = m_left, m_left, m_right, m_right
    else:
        shared, mirror = 1.0, 1.0
        m_right_up, m_left_up = line(viscosity, at + e, n), line(viscosity, at - d + e, n)
        m_right_down, m_left_down = line(viscosity, at - e, n), line(viscosity, at - d - e, n)
    for i in range(n):
        centre = u2[i]
        inflow = carried(0.5 * (f_right[i] + f_left[i]), u0[i], u1[i], centre, u3[i], central)
        outflow = carried(0.5 * (f_right_up[i] + f_left_up[i]), u1[i], centre, u3[i], u4[i], central)
        # A face buried in solid holds zero; mirrored, it puts the no-slip wall half way.
        low, high = u1[i] - mirror * wall_low[i] * centre, u3[i] - mirror * wall_high[i] * centre
        edge = shared * (m_right[i] + m_left[i])
        m_low = 0.25 * (edge + (2.0 - shared) * (m_right_down[i] + m_left_down[i]))
        m_high = 0.25 * (edge + (2.0 - shared) * (m_right_up[i] + m_left_up[i]))
        pull_low = stress(m_low, low, centre, inverse_e, v_left[i], v_right[i], inverse_d)
        pull_high = stress(m_high, centre, high, inverse_e, v_left_up[i], v_right_up[i], inverse_d)
        out[i] += ((pull_high - pull_low) - density * (outflow - inflow)) * inverse_e


@threaded
def predict(stretches, balance, medium, step, weight_b, new, mobility):
    """Velocity after the step with the pressure as it is, and its mobility: velocity lost per pressure gradient.

    stretches      `FluidStretches`
    weight_b       of the second of both forces
    new, mobility  (3, ...) [m/s] and [m2 s/kg]
    """
    old, rate_a, rate_b, pressure, stored, centred, voidage, drag, drag_momentum, source, driving, solved = balance
    shape, steps = voidage.shape, strides(voidage.shape)
    voidage, centred, stored = voidage.reshape(-1), centred.reshape(-1), stored.reshape(-1)
    pressure, drag = pressure.reshape(-1), drag.reshape(3, -1)
    drag_momentum, source = drag_momentum.reshape(3, -1), source.reshape(3, -1)
    rate_a, rate_b, solved = rate_a.reshape(3, -1), rate_b.reshape(3, -1), solved.reshape(3, -1)
    old, new, mobility = old.reshape(3, -1), new.reshape(3, -1), mobility.reshape(3, -1)
    times, cells = (step, weight_b), (voidage, centred, stored, pressure)
    first, begins, counts = stretches.solved
    for k in prange(shape[0]):
        for part in range(first[k], first[k + 1]):
            at, n = begins[part], counts[part]
            for d in range(3):
                place = at, at - steps[d], d
                out, mobility_here = line(new[d], at, n), line(mobility[d], at, n)
                faces, drags = (old[d], rate_a[d], rate_b[d], solved[d]), (drag[d], drag_momentum[d])
                forces = *drags, source[d], driving[d]
                _predict_line(out, mobility_here, cells, faces, forces, place, medium, times)


@vector_inline
def _predict_line(out, mobility, cells, faces, forces, place, medium, times):
    """`predict` of a line of faces.

    out, mobility  of the line
    cells          voidage, centred and stored voidage, pressure
    faces, forces  along the direction: old velocity, both rates, solved; drag, drag momentum, source, driving
    place          of the line in flat fields, that of the cells before it, and the direction
    times          the step, and the weight of the second rate
    """
    (voidage, centred, stored, pressure), (old, rate_a, rate_b, solved) = cells, faces
    (drag, drag_momentum, source, driving), (at, below, d), (step, weight_b) = forces, place, times
    density, inverse, model_b, n = medium.density, medium.inverse[d], medium.model_b, out.size
    e_right, e_left = line(voidage, at, n), line(voidage, below, n)
    c_right, c_left = line(centred, at, n), line(centred, below, n)
    s_right, s_left = line(stored, at, n), line(stored, below, n)
    b_right, b_left = line(drag, at, n), line(drag, below, n)
    v_right, v_left = line(drag_momentum, at, n), line(drag_momentum, below, n)
    x_right, x_left = line(source, at, n), line(source, below, n)
    p_right, p_left = line(pressure, at, n), line(pressure, below, n)
    u, first, second, free = line(old, at, n), line(rate_a, at, n), line(rate_b, at, n), line(solved, at, n)
    for i in range(n):
        face = 0.5 * (c_right[i] + c_left[i])
        right, left = slip_weight(face, c_right[i], model_b), slip_weight(face, c_left[i], model_b)
        beta = 0.5 * (right * b_right[i] + left * b_left[i])
        beta_v = 0.5 * (right * v_right[i] + left * v_left[i])
        theta = implicitness(beta * step / (density * face))
        gradient = (p_right[i] - p_left[i]) * inverse
        share = face + model_b * (1.0 - face)
        momentum = (
            density * 0.5 * (s_right[i] + s_left[i]) * u[i]
            + step * ((1.0 - weight_b) * first[i] + weight_b * second[i])  # convection, viscous stress
            - step * share * gradient  # pressure, gravity within
            + step * share * driving
            + step * 0.5 * (x_right[i] + x_left[i])
            + step * (beta_v - (1.0 - theta) * beta * u[i])  # drag, its explicit part
        )
        inertia = density * 0.5 * (e_right[i] + e_left[i]) + step * theta * beta  # drag, its implicit part
        out[i] = momentum / inertia if free[i] > 0.0 else u[i]
        mobility[i] = free[i] * step * share / inertia


@inline
def half_of_drag(here, other, free, velocity, medium, step):
    """Half of the weight with which the drag of a cell acts on one of its faces, and u_theta there.

    here, other  voidage and drag of the cell, and of the one beyond the face
    velocity     of the face before and after the step
    """
    (voidage, drag), (old, new), density, model_b = here, velocity, medium.density, medium.model_b
    other_voidage, other_drag = other if free > 0.0 else here
    face = 0.5 * (voidage + other_voidage)
    own = slip_weight(face, voidage, model_b)
    beta = 0.5 * (own * drag + slip_weight(face, other_voidage, model_b) * other_drag)
    theta = implicitness(beta * step / (density * face))
    return 0.5 * own, theta * new + (1.0 - theta) * old


@threaded
def drag_seen(balance, new, medium, step, weight, mean):
    """Weight W and mean velocity u_d with which the drag of every cell has acted over a step: half on each face.

    weight, mean  padded (3, ...); only cells are written
    """
    old, voidage, drag, solved = balance.old, balance.centred, balance.drag, balance.solved
    shape, steps = voidage.shape, strides(voidage.shape)
    voidage, drag, solved = voidage.reshape(-1), drag.reshape(3, -1), solved.reshape(3, -1)
    old, new, weight, mean = old.reshape(3, -1), new.reshape(3, -1), weight.reshape(3, -1), mean.reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        e_here = line(voidage, at, n)
        for d in range(3):
            below, above = at - steps[d], at + steps[d]
            e_below, e_above = line(voidage, below, n), line(voidage, above, n)
            b_here, b_below, b_above = line(drag[d], at, n), line(drag[d], below, n), line(drag[d], above, n)
            free_low, free_high = line(solved[d], at, n), line(solved[d], above, n)
            old_low, old_high = line(old[d], at, n), line(old[d], above, n)
            new_low, new_high = line(new[d], at, n), line(new[d], above, n)
            out, out_seen = line(weight[d], at, n), line(mean[d], at, n)
            for i in range(n):
                here, below_it, above_it = (e_here[i], b_here[i]), (e_below[i], b_below[i]), (e_above[i], b_above[i])
                low, u_low = half_of_drag(here, below_it, free_low[i], (old_low[i], new_low[i]), medium, step)
                high, u_high = half_of_drag(here, above_it, free_high[i], (old_high[i], new_high[i]), medium, step)
                out[i] = low + high
                out_seen[i] = (low * u_low + high * u_high) / (low + high)


def in_cells(grid: Grid, faces: Array, counted: Array) -> Array:
    """Mean over the two faces of every cell (3, nz, ny, nx) of a padded field on faces.

    counted  1 for faces that count, 0 for those that take the value of the other one; padded
    """
    cells = np.empty_like(faces)
    _in_cells(faces, counted, cells)
    return grid.inner(cells)


@threaded
def _in_cells(faces, counted, cells):
    shape, steps = counted.shape[1:], strides(counted.shape[1:])
    faces, counted, cells = faces.reshape(3, -1), counted.reshape(3, -1), cells.reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        for d in range(3):
            low, high = line(faces[d], at, n), line(faces[d], at + steps[d], n)
            share_low, share_high = line(counted[d], at, n), line(counted[d], at + steps[d], n)
            out = line(cells[d], at, n)
            for i in range(n):
                number = max(share_low[i] + share_high[i], 1.0)
                out[i] = (low[i] * share_low[i] + high[i] * share_high[i]) / number


# ---------------------------------------------------------------- rates that limit the step
#
# Rates of a fluid that limit its step.


class FlowRates:
    """Finds the largest rates of a fluid.

    boundaries  of its grid
    density     rho [kg/m3]
    """

    def __init__(self, boundaries: Boundaries, density: float, communicator: Communicator) -> None:
        grid = boundaries.grid
        self._density, self._communicator, self._open = density, communicator, grid.open.astype(float)
        self._inverse_where_varied = 1.0 / np.array(grid.spacing) * [boundaries.varies_along(d) for d in range(3)]
        self._by_plane = np.zeros((3, grid.shape[0]))

    def of(self, velocity: Array, voidage: Array, effective_viscosity: Array) -> Rates:
        """Largest rates of a padded velocity, voidage, and voidage times viscosity [Pa s]."""
        flow = velocity, voidage, effective_viscosity, self._open
        largest_rates(flow, self._density, self._inverse_where_varied, *self._by_plane)
        return Rates(*(float(rate) for rate in self._communicator.largest(self._by_plane, axis=1)))


@threaded
def largest_rates(flow, density, inverse, advection, viscous, fluxes):
    """Write the largest rates of each plane of cells, in the units of `Rates`.

    flow  velocity, voidage, eps mu, and 1 in open cells

    The viscous rate of a cell combines its voidage with the largest viscosity among the cell and
    its six neighbours.
    """
    nz, ny, nx = flow[3].shape
    for k in prange(nz):
        largest = np.zeros((3, nx))  # of the cells at each place in a row
        for j in range(ny):
            _row_rates(k, j, flow, density, inverse, (largest[0], largest[1], largest[2]))
        advection[k], viscous[k], fluxes[k] = largest[0].max(), largest[1].max(), largest[2].max()  # local: a plane


@vector_inline
def _row_rates(k, j, flow, density, inverse, largest):
    """Raise the largest rates at every place in a row to those of row j in plane k."""
    (velocity, voidage, viscosity, open_cells), (advection, viscous, fluxes) = flow, largest
    n, b, c, i = fluxes.size, j + LOW, k + LOW, LOW
    u0, u1 = velocity[0, c, b, i : i + n], velocity[0, c, b, i + 1 : i + 1 + n]
    v0, v1 = velocity[1, c, b, i : i + n], velocity[1, c, b + 1, i : i + n]
    w0, w1 = velocity[2, c, b, i : i + n], velocity[2, c + 1, b, i : i + n]
    here, fluid, is_open = viscosity[c, b, i : i + n], voidage[c, b, i : i + n], open_cells[k, j]
    west, east = viscosity[c, b, i - 1 : i - 1 + n], viscosity[c, b, i + 1 : i + 1 + n]
    south, north = viscosity[c, b - 1, i : i + n], viscosity[c, b + 1, i : i + n]
    down, up = viscosity[c - 1, b, i : i + n], viscosity[c + 1, b, i : i + n]
    squares = 2.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for x in range(n):
        u, v, w = max(abs(u0[x]), abs(u1[x])), max(abs(v0[x]), abs(v1[x])), max(abs(w0[x]), abs(w1[x]))
        around = max(max(max(west[x], east[x]), max(south[x], north[x])), max(down[x], up[x]))
        stiffness = is_open[x] * max(here[x], around) * squares / (density * fluid[x])
        advection[x] = max(advection[x], u * inverse[0] + v * inverse[1] + w * inverse[2])
        viscous[x] = max(viscous[x], stiffness)
        fluxes[x] = max(fluxes[x], max(u, max(v, w)) * fluid[x])
