r"""Energy of the fluid: what every term of its momentum balance has done in a step.

The balance of a face, times the mean of its old and new velocity, is a balance of kinetic energy,

.. math:: \tfrac12\rho\,(\varepsilon_1 u_1^2 - \varepsilon_0 u_0^2)
          = \bar u\,h\,(\text{terms of momentum}) - \tfrac12\rho\,(\varepsilon_1-\varepsilon_0)\,u_0 u_1

to round-off. The last part belongs to convection: with it, and less what the flow carries in and out, what is left
of convection is the dissipation of the scheme. Drag acts with the velocity u_theta of its implicit step; what it
does beyond that is the dissipation of that step. Faces of an outlet count half, as half of their volume is outside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.fluid.grid import HIGH, LOW, Array
from cfddem.fluid.momentum import transport
from cfddem.fluid.solver import FluidSolver


class Works(NamedTuple):
    """Energy that each term has given to the fluid in a step [J]."""

    kinetic: float  # change of the kinetic energy
    inflow: float  # by the pressure at inlets and outlets, and kinetic energy carried through them
    held: float  # by what holds an inlet against the drag of particles beside it
    driving: float  # by the mean pressure gradient of periodic sides
    solids: float  # by the pressure, where the particles' volume makes room or takes it
    model_b: float  # by the pressure on the particles' share of the volume, which model B gives to the fluid
    viscous: float  # by viscous stress
    convection: float  # by the scheme of convection
    drag: float  # by drag, at the velocity with which it acts
    implicit: float  # by drag, beyond that
    source: float  # by other forces of particles


def face_volumes(fluid: FluidSolver) -> Array:
    """Volume of each face that carries an unknown (3, ...) [m3]: of every face once, of an outlet half."""
    volumes = np.zeros_like(fluid._solved)
    for d in range(3):
        faces = fluid.grid.inner_faces(volumes[d], d)
        faces[:] = fluid.grid.cell_volume
        ends = np.moveaxis(faces, 2 - d, 0)
        if fluid.boundaries.periodic[d]:
            ends[-1] = 0.0
        else:
            ends[[0, -1]] *= 0.5
    return np.asarray(volumes * fluid._solved)


def works(fluid: FluidSolver, volumes: Array) -> Works:
    """What the terms have done in the step just made.

    volumes  :func:`face_volumes`
    """
    h, rho = fluid._last_step, fluid.density
    fluid.boundaries.fill_pressure(fluid._pressure)
    before, after = _stress(fluid, fluid._other, fluid._other_mean), _stress(fluid, fluid._stage, fluid._mean_voidage)
    sums = dict.fromkeys(("kinetic", "pressure", "driving", "model_b", "viscous", "carried", "drag", "implicit"), 0.0)
    sums["source"] = 0.0
    for d in range(3):
        axis, volume = 2 - d, volumes[d]
        old, new = fluid._other[d], fluid._velocity[d]
        mean = 0.5 * (old + new)
        stored, centred, ended = (
            _on_faces(each, axis) for each in (fluid._stored, fluid._centred, fluid._mean_voidage)
        )
        stress = 0.5 * (before[d] + after[d])
        rate = 0.5 * (fluid._rate_a[d] + fluid._rate_b[d])
        gradient = (fluid._pressure - np.roll(fluid._pressure, 1, axis)) * fluid._inverse[d]
        driving = fluid.boundaries.driving[d]
        drag, acting = _drag(fluid, d, old, new)
        share = fluid._model_b * (1.0 - centred)
        found = {
            "kinetic": 0.5 * rho * (ended * new**2 - stored * old**2),
            "pressure": -h * centred * gradient * mean,
            "driving": h * centred * driving * mean,
            "model_b": h * share * (driving - gradient) * mean,
            "viscous": h * stress * mean,
            "carried": h * (rate - stress) * mean - 0.5 * rho * (ended - stored) * old * new,
            "drag": h * drag * acting,
            "implicit": h * drag * (mean - acting),
            "source": h * _on_faces(fluid._source[d], axis) * mean,
        }
        for name, each in found.items():
            sums[name] += float((each * volume).sum())
    pressed, brought, held = _at_ends(fluid, h)
    return Works(
        kinetic=sums["kinetic"],
        inflow=pressed + brought,
        held=held,
        driving=sums["driving"],
        solids=sums["pressure"] - pressed,
        model_b=sums["model_b"],
        viscous=sums["viscous"],
        convection=sums["carried"] - brought,
        drag=sums["drag"],
        implicit=sums["implicit"],
        source=sums["source"],
    )


def kinetic_energy(fluid: FluidSolver, volumes: Array) -> float:
    """Kinetic energy of the fluid [J].

    volumes  :func:`face_volumes`
    """
    total = 0.0
    for d in range(3):
        stored = _on_faces(fluid._mean_voidage, 2 - d) * fluid._velocity[d] ** 2
        total += 0.5 * fluid.density * float((stored * volumes[d]).sum())
    return total


def _on_faces(cells: Array, axis: int) -> Array:
    return np.asarray(0.5 * (cells + np.roll(cells, 1, axis)))


def _stress(fluid: FluidSolver, velocity: Array, voidage: Array) -> Array:
    """div(eps tau) on the faces (3, ...) [N/m3]."""
    fluid._thicken(velocity, voidage)
    force = np.zeros_like(velocity)
    transport(
        velocity, voidage, fluid._thickness, fluid._buried, 0.0, fluid._inverse, 0.0, fluid._flux, fluid._expansion,
        force,
    )  # fmt: skip
    return force


def _drag(fluid: FluidSolver, d: int, old: Array, new: Array) -> tuple[Array, Array]:
    """Force of drag on the fluid of each face [N/m3], and the velocity with which it acts [m/s]."""
    axis, centred = 2 - d, fluid._centred
    face = _on_faces(centred, axis)
    share = face / centred
    right = share * (share + fluid._model_b * (1.0 - share))
    share = face / np.roll(centred, 1, axis)
    left = share * (share + fluid._model_b * (1.0 - share))
    beta = 0.5 * (right * fluid._drag + left * np.roll(fluid._drag, 1, axis))
    pull = 0.5 * (right * fluid._drag_momentum[d] + left * np.roll(fluid._drag_momentum[d], 1, axis))
    stiffness = beta * fluid._last_step / (fluid.density * face)
    theta = (1.0 + stiffness) / (2.0 + stiffness)
    acting = theta * new + (1.0 - theta) * old
    return pull - beta * acting, acting


def _at_ends(fluid: FluidSolver, h: float) -> tuple[float, float, float]:
    """Work of the pressure at inlets and outlets, kinetic energy brought in, and work of what holds the inlets [J]."""
    pressed = brought = held = 0.0
    inner = (slice(LOW, -HIGH),) * 2
    for side in fluid.boundaries.sides:
        inlet = np.isin(side.owner, side.inlets)
        outlet = side.outlet[inner]
        if not (inlet.any() or outlet.any()):
            continue
        d, cells = side.axis, fluid.grid.cells[side.axis]
        at_face, inside = (LOW + cells, LOW + cells - 1) if side.high else (LOW, LOW)

        def layer(field: Array, place: int, axis: int = d) -> Array:
            return np.asarray(np.take(field, place, 2 - axis)[inner])

        old, new = layer(fluid._other[d], at_face), layer(fluid._velocity[d], at_face)
        mean = 0.5 * (old + new)
        voidage = layer(_on_faces(fluid._centred, 2 - d), at_face)
        flow = side.inward * voidage * mean * h * fluid.grid.face_area(d)  # volume that came in [m3]
        pressure = np.where(inlet, layer(fluid._pressure, inside), side.pressure[inner])
        open_here = inlet | outlet
        pressed += float((flow * pressure)[open_here].sum())
        carries = open_here & (inlet | (flow < 0.0))  # what flows back through an outlet comes from rest
        across = sum(layer(fluid._velocity[e], inside) ** 2 for e in range(3) if e != d)
        brought += float((0.5 * fluid.density * flow * (mean**2 + np.where(outlet, across, 0.0)))[carries].sum())
        drag, momentum = layer(fluid._drag, inside), layer(fluid._drag_momentum[d], inside)
        stiffness = drag * h / (fluid.density * layer(fluid._centred, inside))
        theta = (1.0 + stiffness) / (2.0 + stiffness)
        acting = theta * new + (1.0 - theta) * old
        work = 0.5 * h * fluid.grid.cell_volume * (drag * acting - momentum) * acting
        held += float(work[inlet].sum())
    return pressed, brought, held
