"""Loops over the faces near smooth walls: convection and viscous stress of cut momentum cells, and their stiff part."""

from __future__ import annotations

from cfddem.backend.compile import prange, threaded
from cfddem.fluid.momentum import carried, implicitness

FULL = 0.5
"""Share of a momentum cell below which its convection acts on so much fluid."""

EMPTY = 0.01
"""As `FULL`, for the change of the fluid that the cell holds."""


@threaded
def cut_transport(faces, velocity, flux, viscosity, density, central, rate):
    """Write div(eps mu grad u) - div(rho eps u u) per volume of the fluid on the faces of a component near walls.

    faces      `cfddem.fluid.near_walls.Faces` of the component
    velocity   padded component; flux (3, ...) eps u, times the aperture that `faces` has; viscosity eps mu of cells
    rate       written
    """
    shape, d = viscosity.shape, faces.axis
    steps = (1, shape[2], shape[1] * shape[2])
    u, mu, out = velocity.reshape(-1), viscosity.reshape(-1), rate.reshape(-1)
    flux, aperture = flux.reshape(3, -1), faces.aperture.reshape(3, -1)
    back = steps[d]
    for n in prange(faces.at.size):
        p = faces.at[n]
        here = u[p]
        stress = carried_away = growth = 0.0
        for e in range(3):
            step = steps[e]
            for side in range(2):
                sign = 2.0 * side - 1.0
                edge = p + side * step
                if e == d:
                    first, second = edge - step, edge
                    at_edge = mu[edge - step]
                else:
                    first, second = edge - back, edge
                    at_edge = 0.25 * (mu[edge] + mu[edge - back] + mu[edge - step] + mu[edge - step - back])
                m = 2 * e + side
                slope = faces.constant[n, m]
                for each in range(4):
                    slope += faces.weight[n, m, each] * u[faces.index[n, m, each]]
                stress += sign * faces.area[n, m] * at_edge * slope
                through = 0.5 * (aperture[e, first] * flux[e, first] + aperture[e, second] * flux[e, second])
                value = carried(through, u[edge - 2 * step], u[edge - step], u[edge], u[edge + step], central)
                carried_away += sign * faces.inverse[e] * (value - through * here)
                growth += sign * faces.inverse[e] * through
        at_face = 0.5 * (mu[p] + mu[p - back])
        pull = faces.wall_constant[n]
        for each in range(2):
            pull += faces.wall_weight[n, each] * u[faces.wall_index[n, each]]
        share = faces.share[n]
        convection = carried_away / max(share, FULL) + here * growth / max(share, EMPTY)
        out[p] = stress - at_face * pull - density * convection


@threaded
def hold_near_walls(faces, velocity, stage, inertia, resistance, step, new, mobility):
    """Take the stiff part of the stress near walls into a predicted component, implicitly, as `predict` takes drag.

    velocity    at the start of the step; stage: the mean of those whose stress was taken explicitly; padded components
    inertia     (2, n) of the faces: rho eps, and how much of a pressure gradient acts on the fluid
    resistance  (n,) stiff part of the stress over the velocity [kg/m3/s]
    new, mobility  padded component
    """
    old, explicit, new, mobility = velocity.reshape(-1), stage.reshape(-1), new.reshape(-1), mobility.reshape(-1)
    for n in prange(faces.at.size):
        p = faces.at[n]
        theta = implicitness(resistance[n] * step / inertia[0, n])
        loose = step * inertia[1, n] / mobility[p]
        held = loose + step * theta * resistance[n]
        new[p] = (loose * new[p] + step * resistance[n] * (explicit[p] - (1.0 - theta) * old[p])) / held
        mobility[p] *= loose / held
