r"""Budgets of the fluid: what has changed its momentum and its energy in the step just made.

**Energy** is the work of each term of the momentum balance.

The balance of a face, times the mean of its old and new velocity, is a balance of kinetic energy,

.. math:: \tfrac12\rho\,(\varepsilon_1 u_1^2 - \varepsilon_0 u_0^2)
          = \bar u\,h\,(\text{terms of momentum}) - \tfrac12\rho\,(\varepsilon_1-\varepsilon_0)\,u_0 u_1

to round-off. The last part belongs to convection. Convection, less the kinetic energy that the flow carries in and
out, is the dissipation of the scheme. Drag acts with the velocity u_theta of its implicit step; the rest of its work
is the dissipation of that step. Faces of an outlet count half, because half of their volume is outside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.fluid.boundaries import Side
from cfddem.fluid.grid import HIGH, LOW, Array, on_faces
from cfddem.fluid.momentum import implicitness
from cfddem.fluid.solver import FluidSolver


def drag_exchange(fluid: FluidSolver) -> Array:
    r"""Momentum that drag gave to the fluid over the last step, cell by cell (nz, ny, nx, 3) [N s].

    .. math:: \Delta m = h V\, W\,(\beta v - \beta u_d)

    with the weight W and the velocity u_d of `FluidSolver.drag_response`.

    A particle with its own coefficient b [kg/s], of which beta V is the sum, received the impulse
    h W b (u_d - v): summed over the particles of a cell this is the opposite of the momentum of the cell to
    round-off. h is the step just made, V the cell. Half the drag of a cell acts on each of its two faces; where a
    face is a wall or an inlet, that half is taken by what holds the face, and is counted here too.
    """
    fields, (weight, velocity) = fluid.fields, fluid.drag_response()
    push = np.moveaxis(fields.owned("drag_momentum"), 0, -1) - np.moveaxis(fields.owned("drag"), 0, -1) * velocity
    moved: Array = fluid.last_step * fluid.grid.cell_volume * weight * push * _held(fluid)[..., None]
    return moved


def momentum(fluid: FluidSolver) -> Array:
    """Momentum of the fluid, sum of rho eps u V over all faces with an unknown velocity (3,) [N s]."""
    return _momentum(fluid, fluid.fields.velocity, fluid.fields.mean_voidage)


def momentum_ledger(fluid: FluidSolver) -> dict[str, Array]:
    r"""Sources of the change of momentum in the last step, each (3,) [N s].

    change      of `momentum`
    drag        sum of `drag_exchange`
    particles   :math:`h \sum V p\,\nabla\varepsilon`, what model A takes from the fluid and gives to the particles
    source      of the user
    driving     of the mean pressure gradient of periodic sides
    boundaries  the rest: pressure, stress and flow at walls, inlets and outlets; zero in a periodic box
    """
    fields, total = fluid.fields, fluid.communicator.sum
    h, volume = fluid.last_step, fluid.grid.cell_volume
    before = _momentum(fluid, fields.other_velocity, fields.other_voidage)
    open_share = _held(fluid)
    share = open_share if fluid.model == "B" else open_share * fields.owned("centred_voidage")
    lines = {
        "change": momentum(fluid) - before,
        "drag": total(drag_exchange(fluid), axis=(0, 1, 2)),
        "particles": np.zeros(3) if fluid.model == "B" else _pressure_on_particles(fluid),
        "source": h * volume * total(fields.owned("source") * open_share, axis=(1, 2, 3)),
        "driving": h * volume * total(share) * fluid.boundaries.driving,
    }
    lines["boundaries"] = lines["change"] - sum(lines[name] for name in lines if name != "change")
    return lines


def _held(fluid: FluidSolver) -> Array:
    """Share of every cell that is open (nz, ny, nx)."""
    return np.asarray(fluid.open_cells * fluid.boundaries.cut.own_volume())


def _momentum(fluid: FluidSolver, velocity: Array, voidage: Array) -> Array:
    """Momentum (3,) of a padded velocity with a padded voidage [N s]."""
    grid, total = fluid.grid, np.zeros(3)
    for d in range(3):
        share = fluid.faces.solved[d] * fluid.boundaries.cut.momentum_share(d)
        faces = grid.inner_faces(on_faces(voidage, d) * velocity[d] * share, d)
        unique = np.moveaxis(faces, 2 - d, 0)[: fluid.boundaries.owned_faces(d)]
        total[d] = fluid.density * grid.cell_volume * fluid.communicator.sum(unique)
    return total


def _pressure_on_particles(fluid: FluidSolver) -> Array:
    """Momentum that model A takes from the fluid where the voidage varies, sum of h V p grad(eps) (3,) [N s]."""
    own, solved, force = fluid.fields.centred_voidage, fluid.faces.solved, np.zeros(3)
    for d in range(3):
        axis = 2 - d
        low = np.where(solved[d] > 0.0, on_faces(own, d), own)
        high = np.where(np.roll(solved[d], -1, axis) > 0.0, 0.5 * (own + np.roll(own, -1, axis)), own)
        pushed = fluid.communicator.sum(fluid.pressure * fluid.grid.inner(high - low))
        force[d] = fluid.last_step * fluid.face_areas[d] * pushed
    return force


def continuity_residual(fluid: FluidSolver) -> Array:
    """V d(eps)/dt + outflow of every open cell (nz, ny, nx) [m3/s], summed face by face, not by the solver."""
    total: Array = fluid.fields.owned("voidage_rate") * fluid.grid.cell_volume * fluid.boundaries.cut.own_volume()
    for d in range(3):
        total = total + np.diff(fluid.volume_flux(d), axis=2 - d) * fluid.face_areas[d]
    residual: Array = total * fluid.open_cells
    return residual


class Works(NamedTuple):
    """Energy that each term has given to the fluid in a step [J]."""

    kinetic: float  # change of the kinetic energy
    inflow: float  # of the pressure at inlets and outlets, and kinetic energy carried through them
    inlet_drag: float  # of the inlets, which hold their velocity against the drag of particles beside them
    driving: float  # of the mean pressure gradient of periodic sides
    solids: float  # of the pressure on the volume that moving particles displace
    model_b: float  # of the pressure on the particles' share of the volume, which model B gives to the fluid
    viscous: float  # of viscous stress
    convection: float  # of the convection scheme
    drag: float  # of drag, at the velocity with which it acts
    implicit: float  # of drag, beyond that
    source: float  # of other forces of particles


def works(fluid: FluidSolver) -> Works:
    """Work of each term in the step just made."""
    fields, volumes = fluid.fields, face_volumes(fluid)
    fluid.boundaries.fill_pressure(fields.pressure)
    start = fluid.viscous_force(fields.other_velocity, fields.other_voidage)
    end = fluid.viscous_force(fields.stage_velocity, fields.mean_voidage)
    stiff, sums = np.zeros_like(start), dict[str, float]()
    fluid.walls.add_held(fluid.density, fluid.last_step, stiff)
    for d in range(3):
        for name, work in _work_on_faces(fluid, d, 0.5 * (start[d] + end[d]), stiff[d]).items():
            sums[name] = sums.get(name, 0.0) + fluid.communicator.sum(work * volumes[d])
    pressed, brought, by_inlets = _at_sides(fluid)
    return Works(
        kinetic=sums["kinetic"],
        inflow=pressed + brought,
        inlet_drag=by_inlets,
        driving=sums["driving"],
        solids=sums["pressure"] - pressed,
        model_b=sums["model_b"],
        viscous=sums["viscous"],
        convection=sums["carried"] - brought,
        drag=sums["drag"],
        implicit=sums["implicit"],
        source=sums["source"],
    )


def kinetic_energy(fluid: FluidSolver) -> float:
    """Kinetic energy of the fluid [J]."""
    total, volumes = 0.0, face_volumes(fluid)
    for d in range(3):
        stored = on_faces(fluid.fields.mean_voidage, d) * fluid.fields.velocity[d] ** 2
        total += 0.5 * fluid.density * fluid.communicator.sum(stored * volumes[d])
    return total


def face_volumes(fluid: FluidSolver) -> Array:
    """Volume of each face that carries an unknown (3, ...) [m3]: of every face once, of an outlet half."""
    volumes = np.zeros_like(fluid.faces.solved)
    for d in range(3):
        faces = fluid.grid.inner_faces(volumes[d], d)
        faces[:] = fluid.grid.cell_volume
        ends = np.moveaxis(faces, 2 - d, 0)
        low, high = fluid.boundaries.halo.ends[d]
        ends[fluid.boundaries.owned_faces(d) :] = 0.0
        ends[0] *= 0.5 if low else 1.0
        ends[-1] *= 0.5 if high else 1.0
        volumes[d] *= fluid.boundaries.cut.momentum_share(d)
    return np.asarray(volumes * fluid.faces.solved)


def _work_on_faces(fluid: FluidSolver, d: int, stress: Array, stiff: Array) -> dict[str, Array]:
    """Work of each term per volume on the faces normal to d, padded [J/m3]; stress is the mean viscous force, stiff
    what of it was implicit [N/m3]."""
    fields, h, rho = fluid.fields, fluid.last_step, fluid.density
    old, new = fields.other_velocity[d], fields.velocity[d]
    mean = 0.5 * (old + new)
    stored, centred, ended = (
        on_faces(voidage, d) for voidage in (fields.stored_voidage, fields.centred_voidage, fields.mean_voidage)
    )
    explicit = 0.5 * (fields.start_force[d] + fields.stage_force[d])
    gradient = (fields.pressure - np.roll(fields.pressure, 1, 2 - d)) * fluid.inverse_spacing[d]
    driving = fluid.boundaries.driving[d]
    drag, acting = _drag(fluid, d)
    of_particles = fluid.model_b * (1.0 - centred)
    return {
        "kinetic": 0.5 * rho * (ended * new**2 - stored * old**2),
        "pressure": -h * centred * gradient * mean,
        "driving": h * centred * driving * mean,
        "model_b": h * of_particles * (driving - gradient) * mean,
        "viscous": h * (stress + stiff) * mean,
        "carried": h * (explicit - stress) * mean - 0.5 * rho * (ended - stored) * old * new,
        "drag": h * drag * acting,
        "implicit": h * drag * (mean - acting),
        "source": h * on_faces(fields.source[d], d) * mean,
    }


def _drag(fluid: FluidSolver, d: int) -> tuple[Array, Array]:
    """Force of drag on the fluid of each face [N/m3], and the velocity with which it acts [m/s]."""
    axis, fields, model_b = 2 - d, fluid.fields, fluid.model_b
    centred, face = fields.centred_voidage, on_faces(fields.centred_voidage, d)
    share = face / centred
    right = share * (share + model_b * (1.0 - share))
    share = face / np.roll(centred, 1, axis)
    left = share * (share + model_b * (1.0 - share))
    beta = 0.5 * (right * fields.drag[d] + left * np.roll(fields.drag[d], 1, axis))
    pull = 0.5 * (right * fields.drag_momentum[d] + left * np.roll(fields.drag_momentum[d], 1, axis))
    theta = implicitness.py_func(beta * fluid.last_step / (fluid.density * face))
    acting = theta * fields.velocity[d] + (1.0 - theta) * fields.other_velocity[d]
    return pull - beta * acting, acting


def _at_sides(fluid: FluidSolver) -> tuple[float, float, float]:
    """Work of the pressure at inlets and outlets, kinetic energy brought in, work of the inlets on drag [J]."""
    of_sides = [[np.zeros(0)] * 3]
    for side in fluid.boundaries.sides:
        inlet, outlet = np.isin(side.owner, side.inlets), _inner(side.outlet)
        of_sides.append([*_at_side(fluid, side, inlet, outlet)])
    pressed, brought, by_inlets = (float(fluid.communicator.sum(np.concatenate(faces))) for faces in zip(*of_sides))
    return pressed, brought, by_inlets


def _at_side(fluid: FluidSolver, side: Side, inlet: np.ndarray, outlet: np.ndarray) -> tuple[Array, Array, Array]:
    """The three numbers of `_at_sides` for each face of one side, of this rank."""
    fields, h, d = fluid.fields, fluid.last_step, side.axis
    cells = fluid.grid.cells[d]
    at_face, inside = (LOW + cells, LOW + cells - 1) if side.high else (LOW, LOW)

    def layer(field: Array, place: int) -> Array:
        return _inner(side.layer(field, place))

    old, new = layer(fields.other_velocity[d], at_face), layer(fields.velocity[d], at_face)
    mean = 0.5 * (old + new)
    voidage = layer(on_faces(fields.centred_voidage, d), at_face)
    cut = fluid.boundaries.cut
    apertures, volumes = (np.broadcast_to(share, fluid.grid.padded_shape) for share in (cut.of_faces(d), cut.volume))
    area = fluid.grid.face_area(d) * layer(apertures, at_face)
    flow = side.inward * voidage * mean * h * area  # volume that came in [m3]
    pressure = np.where(inlet, layer(fields.pressure, inside), _inner(side.pressure))
    pressed = (flow * pressure)[inlet | outlet]

    carries = inlet | outlet & (flow < 0.0)  # what flows back through an outlet comes from rest
    across = sum(layer(fields.velocity[e], inside) ** 2 for e in range(3) if e != d)
    energy = 0.5 * fluid.density * flow * (mean**2 + np.where(outlet, across, 0.0))
    brought = energy[carries]

    drag, momentum = layer(fields.drag[d], inside), layer(fields.drag_momentum[d], inside)
    theta = implicitness.py_func(drag * h / (fluid.density * layer(fields.centred_voidage, inside)))
    acting = theta * new + (1.0 - theta) * old
    work = 0.5 * h * fluid.grid.cell_volume * layer(volumes, inside) * (drag * acting - momentum) * acting
    return pressed, brought, work[inlet]


def _inner(plane: np.ndarray) -> np.ndarray:
    """A layer of cells, or the array of a side, without the ghost rows around it."""
    return plane[LOW:-HIGH, LOW:-HIGH]
