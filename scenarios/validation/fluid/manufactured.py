"""A manufactured solution of the averaged equations with a moving voidage and drag, for both models."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np

from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from scenarios.validation.fluid.flows import ALL_PERIODIC, rms


class Manufactured:
    """Smooth periodic fields in (0, 2 pi)^2 that satisfy continuity with a moving voidage, and the source they need.

    eps = 0.6 + 0.15 sin(x - t) cos(z);  eps u = (1 + 0.15 sin(x - t) cos(z) + a, b) with (a, b) free of divergence.
    Derivatives in the source are eighth-order differences of these formulas: independent of the solver's own.
    """

    density, viscosity, model = 1.3, 0.07, "A"

    def voidage(self, x, z, t):
        return 0.6 + 0.15 * np.sin(x - t) * np.cos(z)

    def flux(self, x, z, t):
        swirl = np.cos(0.7 * t)
        return (
            1.0 + 0.15 * np.sin(x - t) * np.cos(z) + 0.4 * swirl * np.sin(x) * np.cos(z),
            -0.4 * swirl * np.cos(x) * np.sin(z) + 0.2,
        )

    def velocity(self, x, z, t):
        e = self.voidage(x, z, t)
        fx, fz = self.flux(x, z, t)
        return fx / e, fz / e

    def pressure(self, x, z, t):
        return np.sin(x + 0.5 * t) * np.cos(z) + 0.3 * np.cos(2 * z - t)

    def drag(self, x, z, t):
        return 4.0 * (1.2 + np.sin(x) * np.sin(z + t))

    def particles(self, x, z, t):
        return 0.5 * np.cos(x + t) + 0 * z, 0.3 * np.sin(z - t) + 0 * x

    @staticmethod
    def slope(f, at, h=0.02):
        weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
        return sum(w * (f(at + n * h) - f(at - n * h)) for n, w in enumerate(weights, start=1)) / h

    def source(self, x, z, t):
        """Source per volume that makes these fields a solution."""
        dx = lambda f, x, z, t: self.slope(lambda s: f(s, z, t), x)  # noqa: E731
        dz = lambda f, x, z, t: self.slope(lambda s: f(x, s, t), z)  # noqa: E731
        u = [lambda x, z, t, c=c: self.velocity(x, z, t)[c] for c in range(2)]
        e = self.voidage

        def stress(a, b):
            def component(x, z, t):
                gradient = [[dx(u[c], x, z, t), dz(u[c], x, z, t)] for c in range(2)]
                value = gradient[a][b] + gradient[b][a]
                if a == b:
                    value = value - 2 / 3 * (gradient[0][0] + gradient[1][1])
                return e(x, z, t) * self.viscosity * value

            return component

        share = e(x, z, t) if self.model == "A" else 1.0
        gradient = (dx(self.pressure, x, z, t), dz(self.pressure, x, z, t))
        total = []
        for c in range(2):
            storage = self.slope(lambda s, c=c: self.density * e(x, z, s) * u[c](x, z, s), t)
            convection = self.density * (
                dx(lambda x, z, t, c=c: e(x, z, t) * u[c](x, z, t) * u[0](x, z, t), x, z, t)
                + dz(lambda x, z, t, c=c: e(x, z, t) * u[c](x, z, t) * u[1](x, z, t), x, z, t)
            )
            viscous = dx(stress(c, 0), x, z, t) + dz(stress(c, 1), x, z, t)
            drag = self.drag(x, z, t) * (self.particles(x, z, t)[c] - u[c](x, z, t))
            total.append(storage + convection - viscous + share * gradient[c] - drag)
        return total


def error(n: int, steps: int, until: float = 0.4, model: str = "A") -> tuple[float, float, np.ndarray]:
    """Run the solver on n by n cells for a number of steps, without the limiter.

    returns  error of the velocity in L2, of the pressure, and the velocity along x on its faces
    """
    case = Manufactured()
    case.model = model
    h, step = 2 * np.pi / n, until / steps
    fluid = FluidSolver(
        Grid((n, 1, n), (h, h, h)), ALL_PERIODIC, density=case.density, viscosity=case.viscosity,
        model=model, convection="central", voidage=0.5, tolerance=1e-10,
    )  # fmt: skip
    x, _, z = fluid.grid.centres()

    def cells(f, t):
        return np.broadcast_to(f(x, z, t), fluid.grid.shape)

    def vectors(f, t):
        pair = [np.broadcast_to(c, fluid.grid.shape) for c in f(x, z, t)]
        return np.stack([pair[0], np.zeros(fluid.grid.shape), pair[1]], axis=-1)

    def start(component):
        return lambda x, y, z: case.velocity(x, z, 0.0)[component] + 0 * y

    before, after = (cells(case.voidage, t) for t in (-step / 2, step / 2))
    fluid.set_voidage(after, before, step)
    fluid.set_velocity((start(0), 0.0, start(1)))
    for k in range(steps):
        middle = (k + 0.5) * step
        beta = cells(case.drag, middle)
        fluid.step(
            step, cells(case.voidage, (k + 1.5) * step), beta,
            beta[..., None] * vectors(case.particles, middle), vectors(case.source, middle),
        )  # fmt: skip
    xf, _, zf = fluid.grid.faces(0)
    velocity = fluid.face_velocity(0) - case.velocity(xf, zf, until)[0]
    pressure = fluid.pressure - case.pressure(x, z, until - step / 2)
    return rms(velocity), rms(pressure - pressure.mean()), fluid.face_velocity(0).copy()
