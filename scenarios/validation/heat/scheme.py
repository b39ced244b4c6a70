"""The temperature of the cells by itself: its order on a manufactured solution, and its heat in a closed box."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from cfddem.fluid.conditions import FreeSlip, Periodic
from cfddem.fluid.grid import Grid
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.scalar_conditions import ScalarSides
from cfddem.fluid.solver import FluidSolver
from scenarios.validation.table import Curves, Row

RHO_C, CONDUCTIVITY = 1200.0, 0.03


def scalar(fluid: FluidSolver, sides: ScalarSides, **changes: Any) -> Scalar:
    """A temperature that starts at 300 K."""
    properties = {"start": 300.0, "capacity": RHO_C, "conductivity": CONDUCTIVITY} | changes
    return Scalar(fluid, ScalarKind("temperature", "K", "temperature of the fluid", **properties), sides)


def fluid_of(cells: tuple[int, int, int], conditions: dict[str, Any], size: float = 0.01) -> FluidSolver:
    """Air in a box of cubic cells."""
    return FluidSolver(Grid(cells, (size,) * 3), conditions, density=1.2, viscosity=1.8e-5)


def manufactured_error(n: int, unlimited: bool) -> float:
    """L2 error of a manufactured temperature in a moving voidage, with exchange and diffusion.

    The voidage is a wave along x. The flux has its rate of change as divergence, and eddies.
    """
    length, end, steps = 1.0, 0.5, n
    k, h, beta, speed = 2.0 * math.pi / length, 0.5 / n, 3.0, 1.0
    periodic = dict.fromkeys(("x_low", "x_high", "z_low", "z_high"), Periodic())
    fluid = FluidSolver(
        Grid((n, 1, n), (length / n,) * 3), periodic | {"y_low": FreeSlip(), "y_high": FreeSlip()},
        density=1.0, viscosity=1e-3,
    )  # fmt: skip
    x, _, z = fluid.grid.centres()
    diffusivity, capacity = 0.02, 2.0

    def voidage(t: float) -> np.ndarray:
        return np.asarray(0.6 + 0.1 * np.cos(k * (x - speed * t)) + 0.0 * z)

    def exact(t: float) -> np.ndarray:
        return np.asarray(1.0 + np.sin(k * x - 2.0 * t) * np.cos(k * z + t))

    def flux(x: np.ndarray, z: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        eddy = 0.3
        along = 0.2 + 0.1 * speed * np.cos(k * (x - speed * t)) + eddy * np.sin(k * x) * np.cos(k * z)
        return along, 0.1 - eddy * np.cos(k * x) * np.sin(k * z)

    def source(t: float) -> np.ndarray:
        phase_x, phase_z = k * x - 2.0 * t, k * z + t
        sx, cx, sz, cz = np.sin(phase_x), np.cos(phase_x), np.sin(phase_z), np.cos(phase_z)
        eps, eps_x = voidage(t), -0.1 * k * np.sin(k * (x - speed * t))
        fx, fz = flux(x, z, t)
        carried = eps * (-2.0 * cx * cz - sx * sz) + fx * k * cx * cz - fz * k * sx * sz
        spread = eps * (-2.0 * k * k * sx * cz) + eps_x * k * cx * cz
        return np.asarray(capacity * (carried - diffusivity * spread))

    fluid.set_voidage(voidage(0.0))
    kind = ScalarKind("temperature", "K", "", 1.0, capacity, capacity * diffusivity, unlimited=unlimited)
    heat = Scalar(fluid, kind, ScalarSides(1.0))
    heat.value[:] = exact(0.0)
    for step in range(steps):
        t = step * h
        middle = t + 0.5 * h
        fluid._set_cells(fluid.fields.mean_voidage, voidage(middle))
        fluid.fields.owned("voidage_rate")[:] = (voidage(t + h) - voidage(t)) / h
        fluid.voidage[:] = voidage(t + h)
        for axis in (0, 2):
            at = fluid.grid.faces(axis)
            through = np.broadcast_arrays(flux(at[0], at[2], middle)[axis // 2] + 0.0 * at[0] + 0.0 * at[2])[0]
            fluid.face_velocity(axis)[:] = through
        fluid.boundaries.fill_velocity(fluid.fields.velocity)
        for axis in (0, 2):
            eps = 0.5 * (fluid.fields.mean_voidage + np.roll(fluid.fields.mean_voidage, 1, axis=2 - axis))
            fluid.fields.velocity[axis] /= eps
        fluid.last_step, fluid.time = h, t + h
        target = exact(middle) + source(middle) / beta
        heat.step(np.full(fluid.grid.shape, beta), beta * target)
    assert steps * h == end
    return float(np.sqrt(np.mean((heat.value - exact(end)) ** 2)))


def orders(curves: Curves) -> list[Row]:
    """Order of the temperature on a manufactured solution with moving voidage and exchange."""
    rows, cells = [], (16, 32, 64)
    for unlimited, name in ((True, "unlimited"), (False, "bounded")):
        errors = [manufactured_error(n, unlimited) for n in cells]
        least = min(math.log2(a / b) for a, b in pairwise(errors))
        if unlimited:
            least = min(least, 2.0)  # an order above 2 passes, too
        rows.append(Row(f"{name} scheme of a scalar: order in L2", least, 2.0, 0.1 if unlimited else None))
        curves[f"order/{name}"] = {"cells": (np.array(cells), "-"), "error": (np.array(errors), "-")}
    return rows


def moved(fluid: FluidSolver, random: np.random.Generator) -> np.ndarray:
    """A voidage near the present one, of the same sum."""
    change = random.random(fluid.grid.shape)
    change -= change.mean()
    return np.asarray(fluid.voidage + 0.1 * (0.6 + 0.2 * change - fluid.voidage))


def closed_box(steps: int) -> tuple[float, float, float]:
    """Heat of gas and solids in a closed box with moving voidage, which exchange it.

    returns  change of the heat over all of it [-], farthest that a temperature came out of the range at the start [K],
             and how much the gas has received [J]
    """
    fluid, random = fluid_of((4, 3, 5), {}), np.random.default_rng(2)
    fluid.set_voidage(0.6)
    fluid.set_velocity((0.0, 0.0, 0.0))
    heat, volume = scalar(fluid, ScalarSides(300.0)), fluid.grid.cell_volume
    heat.value[:] = 300.0 + 100.0 * random.random(fluid.grid.shape)
    solids, capacity, beta = 280.0 + 200.0 * random.random(fluid.grid.shape), 5e4, 2e5
    least, most = min(heat.value.min(), solids.min()), max(heat.value.max(), solids.max())
    start, content, outside = heat.content + volume * capacity * float(solids.sum()), heat.content, 0.0
    for _ in range(steps):
        fluid.step(1e-3, moved(fluid, random))
        share = beta / (1.0 + fluid.last_step * beta / capacity)
        temperature = heat.step(np.full(fluid.grid.shape, share), share * solids)
        solids += fluid.last_step * share / capacity * (temperature - solids)
        outside = max(outside, least - float(heat.value.min()), float(heat.value.max()) - most)
    end = heat.content + volume * capacity * float(solids.sum())
    return abs(end - start) / start, outside, heat.content - content


def conservation(curves: Curves) -> list[Row]:
    """Heat in a closed box over 10 000 steps."""
    lost, outside, _ = closed_box(10_000)
    return [
        Row("closed box, 10 000 steps: heat that is lost, over all", lost, 0.0, 1e-12),
        Row("closed box, 10 000 steps: temperature outside the range of the start", max(outside, 0.0), 0.0, 1e-9, "K"),
    ]
