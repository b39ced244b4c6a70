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

In time (step h, from n to n+1) storage is centred, convection and viscous stress follow Heun's two stages,
the pressure is the one that makes the new velocity satisfy continuity, and drag acts on
:math:`u_\theta = \theta u^{n+1} + (1-\theta)u^n` with :math:`\theta = (1+z)/(2+z)` and
:math:`z=\beta h/(\varepsilon\rho)`: second order for small z, fully implicit for large z; a velocity relaxes by
1/(1 + z + z^2/2), never past its target.
"""

from __future__ import annotations

from cfddem.backend.compile import inline, prange, serial, threaded
from cfddem.fluid.grid import LOW, UNIT

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


@serial
def row(field, k, j, start, count):
    """Cells start ... start + count of a row: loops over rows indexed from zero are the ones that vectorise."""
    return field[k, j, start : start + count]


@threaded
def transport(velocity, voidage, viscosity, buried, density, inverse, central, flux, expansion, rate):
    """rate = div(eps tau) - div(rho eps u u) on every face of the box; also writes flux and expansion.

    velocity, flux (eps u), rate (3, ...); voidage, viscosity (eps mu [Pa s]), expansion (2/3 eps mu div u)
    padded cell fields; buried (3, ...) is 1 on faces inside a solid mask, whose neighbours see a no-slip wall half
    way; inverse 1/spacing along x, y, z [1/m].
    """
    pz, py, px = voidage.shape
    for k in prange(1, pz):
        for j in range(1, py):
            n = px - 1
            for d in range(velocity.shape[0]):
                dk, dj, di = UNIT[d]
                here, before = row(voidage, k, j, 1, n), row(voidage, k - dk, j - dj, 1 - di, n)
                out, u = row(flux[d], k, j, 1, n), row(velocity[d], k, j, 1, n)
                for i in range(n):
                    out[i] = 0.5 * (here[i] + before[i]) * u[i]
            if k < pz - 1 and j < py - 1:
                n = px - 2
                out, effective_viscosity = row(expansion, k, j, 1, n), row(viscosity, k, j, 1, n)
                u0, u1 = row(velocity[0], k, j, 1, n), row(velocity[0], k, j, 2, n)
                v0, v1 = row(velocity[1], k, j, 1, n), row(velocity[1], k, j + 1, 1, n)
                w0, w1 = row(velocity[2], k, j, 1, n), row(velocity[2], k + 1, j, 1, n)
                for i in range(n):
                    growth = (u1[i] - u0[i]) * inverse[0] + (v1[i] - v0[i]) * inverse[1] + (w1[i] - w0[i]) * inverse[2]
                    out[i] = (2.0 / 3.0) * effective_viscosity[i] * growth
    # The high boundary face of a direction is the low face of the first ghost cell: one more than cells.
    for k in prange(LOW, pz - LOW):
        n = px - 2 * LOW
        for j in range(LOW, py - LOW):
            for d in range(velocity.shape[0]):
                dk, dj, di = UNIT[d]
                out = row(rate[d], k, j, LOW, n)
                right, left = row(expansion, k, j, LOW, n), row(expansion, k - dk, j - dj, LOW - di, n)
                for i in range(n):
                    out[i] = (left[i] - right[i]) * inverse[d]
                for e in range(velocity.shape[0]):
                    _balance(
                        out, velocity[d], velocity[e], flux[e], viscosity, buried[d], k, j, n, d, e,
                        density, inverse[e], inverse[d], central,
                    )  # fmt: skip


@serial
def _balance(out, u, v, flux, viscosity, buried, k, j, n, d, e, density, inverse_e, inverse_d, central):
    """Add to a row of the component u_d the balance over its two momentum faces along e; v is u_e.

    Across the component (e != d) these faces lie around edges of the grid, between the cells right and left of the
    face and those below or above them; along it (e == d) they are the centres of the two cells, where the same
    differences of u = v give twice the stretching.
    """
    dk, dj, di = UNIT[d]
    ek, ej, ei = UNIT[e]
    u0, u1 = row(u, k - 2 * ek, j - 2 * ej, LOW - 2 * ei, n), row(u, k - ek, j - ej, LOW - ei, n)
    u2, u3 = row(u, k, j, LOW, n), row(u, k + ek, j + ej, LOW + ei, n)
    u4 = row(u, k + 2 * ek, j + 2 * ej, LOW + 2 * ei, n)
    wall_low, wall_high = row(buried, k - ek, j - ej, LOW - ei, n), row(buried, k + ek, j + ej, LOW + ei, n)
    f_right, f_left = row(flux, k, j, LOW, n), row(flux, k - dk, j - dj, LOW - di, n)
    f_right_up = row(flux, k + ek, j + ej, LOW + ei, n)
    f_left_up = row(flux, k - dk + ek, j - dj + ej, LOW - di + ei, n)
    v_right, v_left = row(v, k, j, LOW, n), row(v, k - dk, j - dj, LOW - di, n)
    v_right_up = row(v, k + ek, j + ej, LOW + ei, n)
    v_left_up = row(v, k - dk + ek, j - dj + ej, LOW - di + ei, n)
    m_right, m_left = row(viscosity, k, j, LOW, n), row(viscosity, k - dk, j - dj, LOW - di, n)
    if e == d:
        shared, mirror = 0.0, 0.0
        m_right_down, m_left_down, m_right_up, m_left_up = m_left, m_left, m_right, m_right
    else:
        shared, mirror = 1.0, 1.0
        m_right_up = row(viscosity, k + ek, j + ej, LOW + ei, n)
        m_left_up = row(viscosity, k - dk + ek, j - dj + ej, LOW - di + ei, n)
        m_right_down = row(viscosity, k - ek, j - ej, LOW - ei, n)
        m_left_down = row(viscosity, k - dk - ek, j - dj - ej, LOW - di - ei, n)
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
def predict(
    old, rate_a, rate_b, weight_b, pressure, stored, centred, voidage, drag, drag_momentum, source, driving, solved,
    density, step, inverse, model_b, new, mobility,
):  # fmt: skip
    """Velocity after the step with the pressure as it is, and its mobility: velocity lost per pressure gradient.

    old, new, mobility (3, ...) velocities [m/s] and [m2 s/kg]; rate_a, rate_b (3, ...) results of `transport`, the
    second counting weight_b; pressure p' [Pa]; stored, centred, voidage: that stored with the old velocity, that of
    the middle of the step, that stored with the new velocity; drag beta [kg/m3/s], drag_momentum beta v and source
    [N/m3], cell fields; driving mean pressure fall [Pa/m]; solved (3, ...) 1 where a face carries an unknown.
    """
    pz, py, px = voidage.shape
    n = px - 2 * LOW
    for k in prange(LOW, pz - LOW):
        for j in range(LOW, py - LOW):
            for d in range(old.shape[0]):
                dk, dj, di = UNIT[d]
                e_right, e_left = row(voidage, k, j, LOW, n), row(voidage, k - dk, j - dj, LOW - di, n)
                c_right, c_left = row(centred, k, j, LOW, n), row(centred, k - dk, j - dj, LOW - di, n)
                s_right, s_left = row(stored, k, j, LOW, n), row(stored, k - dk, j - dj, LOW - di, n)
                b_right, b_left = row(drag, k, j, LOW, n), row(drag, k - dk, j - dj, LOW - di, n)
                v = drag_momentum[d]
                v_right, v_left = row(v, k, j, LOW, n), row(v, k - dk, j - dj, LOW - di, n)
                x = source[d]
                x_right, x_left = row(x, k, j, LOW, n), row(x, k - dk, j - dj, LOW - di, n)
                p_right, p_left = row(pressure, k, j, LOW, n), row(pressure, k - dk, j - dj, LOW - di, n)
                first, second = row(rate_a[d], k, j, LOW, n), row(rate_b[d], k, j, LOW, n)
                u, out, mobility_row = (
                    row(old[d], k, j, LOW, n),
                    row(new[d], k, j, LOW, n),
                    row(mobility[d], k, j, LOW, n),
                )
                free = row(solved[d], k, j, LOW, n)
                for i in range(n):
                    face = 0.5 * (c_right[i] + c_left[i])
                    right, left = slip_weight(face, c_right[i], model_b), slip_weight(face, c_left[i], model_b)
                    beta = 0.5 * (right * b_right[i] + left * b_left[i])
                    beta_v = 0.5 * (right * v_right[i] + left * v_left[i])
                    theta = implicitness(beta * step / (density * face))
                    gradient = (p_right[i] - p_left[i]) * inverse[d]
                    share = face + model_b * (1.0 - face)
                    momentum = (
                        density * 0.5 * (s_right[i] + s_left[i]) * u[i]
                        + step * ((1.0 - weight_b) * first[i] + weight_b * second[i])  # convection, viscous stress
                        - step * share * gradient  # pressure, gravity within
                        + step * share * driving[d]
                        + step * 0.5 * (x_right[i] + x_left[i])
                        + step * (beta_v - (1.0 - theta) * beta * u[i])  # drag, its explicit part
                    )
                    inertia = density * 0.5 * (e_right[i] + e_left[i]) + step * theta * beta  # drag, its implicit part
                    out[i] = momentum / inertia if free[i] > 0.0 else u[i]
                    mobility_row[i] = free[i] * step * share / inertia


@threaded
def drag_seen(old, new, voidage, drag, solved, density, step, model_b, weight, seen):
    """Weight W and velocity u_d with which the drag of every cell has acted over a step: half on each face."""
    nz, ny, nx, dimensions = weight.shape
    for k in prange(nz):
        for j in range(ny):
            for i in range(nx):
                c, b, a = k + LOW, j + LOW, i + LOW
                own_voidage, own_drag = voidage[c, b, a], drag[c, b, a]
                for d in range(dimensions):
                    dk, dj, di = UNIT[d]
                    total, carried_velocity = 0.0, 0.0
                    for side in range(2):
                        # The face is the low face of cell f; the neighbour across it is n.
                        fk, fj, fi = c + side * dk, b + side * dj, a + side * di
                        nk, nj, ni = c + (2 * side - 1) * dk, b + (2 * side - 1) * dj, a + (2 * side - 1) * di
                        other_voidage, other_drag = voidage[nk, nj, ni], drag[nk, nj, ni]
                        if solved[d, fk, fj, fi] == 0.0:
                            other_voidage, other_drag = own_voidage, own_drag
                        face = 0.5 * (own_voidage + other_voidage)
                        own = slip_weight(face, own_voidage, model_b)
                        beta = 0.5 * (own * own_drag + slip_weight(face, other_voidage, model_b) * other_drag)
                        theta = implicitness(beta * step / (density * face))
                        u = theta * new[d, fk, fj, fi] + (1.0 - theta) * old[d, fk, fj, fi]
                        total += 0.5 * own
                        carried_velocity += 0.5 * own * u
                    weight[k, j, i, d] = total
                    seen[k, j, i, d] = carried_velocity / total
