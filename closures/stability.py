r"""Linear stability of a uniform fluidised bed: growth rate and speed of plane waves.

The equations are those of an unresolved simulation with its kernel :math:`S = \exp(-k^2 s^2/2)`: the fluid sees the
solid fraction smoothed once, and the particles see the fluid velocity smoothed once. With sharp surfaces they see the
solid fraction smoothed twice, and a change r of the drag on the volume of a particle acts on them as the pressure
:math:`(\varphi/\varepsilon) S r`, in the place of :math:`(\varphi/\varepsilon) S^2 r` of the cells. With smeared ones
they see the solid fraction of cells of the height h, smoothed once and interpolated, :math:`S \exp(-k^2 h^2/12)`.

The equations contain model A, drag at the local voidage and slip, the inertia of the fluid, added mass and, for a given
granular temperature, solids pressure and viscosity by kinetic theory. The drag law is an argument, a function of
Reynolds number and voidage, as in :mod:`closures.balance`. Compiled loops do not call these functions.

Derivation: Anderson & Jackson, Ind. Eng. Chem. Fundam. 7 (1968) 12, extended by the kernel. For a disturbance
:math:`e^{ikx+\sigma t}` of the solid fraction, continuity gives both velocities and the fluid momentum gives the
pressure gradient; the particle momentum is then a quadratic equation for :math:`\sigma`.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from closures.balance import Drag
from closures.kinetic_theory import longitudinal_viscosity, solids_pressure


class Wave(NamedTuple):
    """Fastest-growing wave of a given wavelength."""

    growth: float  # growth rate; negative if the wave decays [1/s]
    speed: float  # upward speed relative to the particles at rest [m/s]


@dataclass(frozen=True)
class UniformBed:
    r"""A uniform bed of equal spheres, at rest on average, in an upward flow.

    voidage               eps of the uniform bed [-]
    diameter              d [m]
    density               rho_s, of the solid [kg/m3]
    fluid_density         rho_f [kg/m3]
    viscosity             eta, dynamic [Pa s]
    drag                  F(reynolds, voidage)
    gravity               g [m/s2]
    kernel                standard deviation s of the kernel; 0 for none [m]
    added_mass            coefficient C_m [-]
    granular_temperature  T; 0 for no solids pressure and viscosity [m2/s2]
    restitution           e, used with T only [-]
    cell                  height h of the cells, with smeared surfaces; None with sharp ones [m]
    """

    voidage: float
    diameter: float
    density: float
    fluid_density: float
    viscosity: float
    drag: Drag
    gravity: float = 9.81
    kernel: float = 0.0
    added_mass: float = 0.0
    granular_temperature: float = 0.0
    restitution: float = 0.9
    cell: float | None = None

    def resistance(self, voidage: float, slip: float) -> float:
        r"""Drag over slip, per volume of solid, :math:`18\,\eta\,\varepsilon F(Re, \varepsilon)/d^2` [kg/m3/s]."""
        reynolds = self.fluid_density * self.diameter * voidage * abs(slip) / self.viscosity
        return 18.0 * self.viscosity * voidage * self.drag(reynolds, voidage) / self.diameter**2

    def slip(self) -> float:
        r"""Mean slip velocity at which drag balances the buoyant weight [m/s].

        .. math:: \beta w/\phi = \varepsilon\,(\rho_s - \rho_f)\,g

        >>> from closures.drag import wen_yu
        >>> bed = UniformBed(0.64, 3.087e-3, 3585.9, 997.0, 8.354e-4, wen_yu)
        >>> round(0.64 * bed.slip(), 3)          # Ferreira et al. (2023) fluidise alumina with 0.157 m/s to 0.64
        0.157
        """
        return self._slip

    @cached_property
    def _slip(self) -> float:
        """Slip by bisection; one value for all waves of the bed."""
        wanted = self.voidage * (self.density - self.fluid_density) * self.gravity
        high = 1e-6
        while self.resistance(self.voidage, high) * high < wanted:
            high *= 2.0
        low = 0.0
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (middle, high) if self.resistance(self.voidage, middle) * middle < wanted else (low, middle)
        return 0.5 * (low + high)

    def wave(self, wavelength: float) -> Wave:
        """Growth rate and speed of a plane wave along the flow.

        wavelength  [m]
        returns     the faster-growing of the two solutions

        >>> from closures.drag import wen_yu
        >>> bed = UniformBed(0.64, 3.087e-3, 3585.9, 997.0, 8.354e-4, wen_yu, kernel=1.5 * 3.087e-3)
        >>> [round(value, 2) for value in bed.wave(0.032)], [round(value, 2) for value in bed.wave(0.048)]
        ([8.32, 0.11], [6.75, 0.16])
        """
        number = 2.0 * math.pi / wavelength
        smoothed = math.exp(-0.5 * (number * self.kernel) ** 2)
        slip, solid = self.slip(), 1.0 - self.voidage
        drag = self.resistance(self.voidage, slip)
        by_voidage = _slope(lambda voidage: self.resistance(voidage, slip), self.voidage, 1e-5)
        by_slip = _slope(lambda speed: self.resistance(self.voidage, speed), slip, 1e-5 * slip)
        stiffness, viscosity = self._of_the_particles(solid)
        around, swapped = self._seen(number, smoothed)

        def imbalance(rate: complex) -> complex:
            """Residual of the particle momentum, per volume of solid and amplitude of the solid fraction."""
            fluid_rate = rate + 1j * number * slip  # in the frame of the fluid
            fluid = smoothed * fluid_rate / (1j * number * self.voidage)
            particles = -rate / (1j * number * solid)
            passing = smoothed * fluid - particles
            force = (drag + by_slip * slip) * passing - by_voidage * around * slip
            pressed = swapped * solid / self.voidage * force
            carried = self.added_mass * self.fluid_density * (smoothed * fluid_rate * fluid - rate * particles)
            inertia = self.fluid_density * self.voidage * fluid_rate * fluid
            weight = smoothed * solid * drag * slip / self.voidage
            on_fluid = inertia + weight + smoothed * (drag * slip + solid * (force + pressed + carried))
            pressure = -on_fluid / self.voidage
            stress = 1j * number * stiffness / solid + number**2 * viscosity * particles / solid
            return self.density * rate * particles + smoothed * pressure - force - pressed - carried + stress

        rate = _faster_root(imbalance(0.0), imbalance(1.0), imbalance(-1.0))
        return Wave(rate.real, -rate.imag / number)

    def fastest(self, shortest: float = 0.0, longest: float = 0.0) -> tuple[float, Wave]:
        """The fastest-growing wavelength and its wave.

        shortest, longest  limits of the search; 2 and 200 diameters if not given [m]
        returns            wavelength [m], and its wave

        Without kernel and granular temperature the equations are ill-posed: the growth rate increases without bound for
        short waves, and the result is `shortest`.

        >>> from closures.drag import wen_yu
        >>> bed = UniformBed(0.64, 3.087e-3, 3585.9, 997.0, 8.354e-4, wen_yu, kernel=1.5 * 3.087e-3)
        >>> round(1e3 * bed.fastest()[0])                                  # mm
        32
        """
        low, high = math.log(shortest or 2.0 * self.diameter), math.log(longest or 200.0 * self.diameter)
        tried = [math.exp(low + (high - low) * step / 200.0) for step in range(201)]
        best = max(tried, key=lambda wavelength: self.wave(wavelength).growth)
        return best, self.wave(best)

    def _seen(self, number: float, smoothed: float) -> tuple[float, float]:
        """Part of a wave that particles see of the solid fraction, and of a change of the drag by the pressure that
        sharp surfaces put in the place of that of the cells."""
        if self.cell is None:
            return smoothed**2, smoothed - smoothed**2
        return smoothed * math.exp(-((number * self.cell) ** 2) / 12.0), 0.0

    def _of_the_particles(self, solid: float) -> tuple[float, float]:
        """Derivative of the solids pressure with solid fraction [Pa], and longitudinal viscosity [Pa s]."""
        if self.granular_temperature == 0.0:
            return 0.0, 0.0
        fluctuation = (self.granular_temperature, self.restitution)
        slope = _slope(lambda phi: solids_pressure(phi, self.density, *fluctuation), solid, 1e-6)
        return slope, longitudinal_viscosity(solid, self.density, self.diameter, *fluctuation)


def _slope(function, at: float, half: float) -> float:  # type: ignore[no-untyped-def]
    return float((function(at + half) - function(at - half)) / (2.0 * half))


def _faster_root(at_zero: complex, at_one: complex, at_minus_one: complex) -> complex:
    """Root with the larger real part of the quadratic function through these values at 0, 1 and -1."""
    square, linear = 0.5 * (at_one + at_minus_one) - at_zero, 0.5 * (at_one - at_minus_one)
    spread = cmath.sqrt(linear**2 - 4.0 * square * at_zero)
    return max(((-linear + sign * spread) / (2.0 * square) for sign in (1.0, -1.0)), key=lambda root: root.real)
