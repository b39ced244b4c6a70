"""Linear stability of uniform beds, against another solution of the same equations.

Reference: the linear equations of both phases as a generalised eigenvalue problem of four unknowns, without the
elimination of `closures.stability`.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eig

from closures.drag import di_felice, wen_yu
from closures.kinetic_theory import longitudinal_viscosity, solids_pressure
from closures.stability import UniformBed, Wave

DIAMETER = 3.087e-3
ALUMINA = {"diameter": DIAMETER, "density": 3585.9, "fluid_density": 997.0, "viscosity": 8.354e-4}


def alumina(**changes: float) -> UniformBed:
    """Alumina beads in water at 25 degrees, as fluidised by Ferreira et al. (2023), at a voidage of 0.64."""
    return UniformBed(**({"voidage": 0.64, "drag": wen_yu} | ALUMINA | changes))  # type: ignore[arg-type]


def eigenvalue(bed: UniformBed, wavelength: float) -> complex:
    """Growth rate with the largest real part, of the unknowns solid fraction, both velocities, and pressure."""
    k, w, eps, phi = 2j * math.pi / wavelength, bed.slip(), bed.voidage, 1.0 - bed.voidage
    s = math.exp(-0.5 * (2.0 * math.pi / wavelength * bed.kernel) ** 2)
    once = 1.0 if bed.cell is None else math.exp(-((2.0 * math.pi / wavelength * bed.cell) ** 2) / 12.0)
    seen, taken = (s**2, s) if bed.cell is None else (s * once, s**2)
    beta, h = bed.resistance(eps, w), 1e-6
    by_eps = (bed.resistance(eps + h, w) - bed.resistance(eps - h, w)) / (2.0 * h)
    by_w = (bed.resistance(eps, w + h) - bed.resistance(eps, w - h)) / (2.0 * h)
    c, rho, fluid = bed.added_mass * bed.fluid_density, bed.density, bed.fluid_density
    slope = viscosity = 0.0
    if bed.granular_temperature:
        of = (bed.density, bed.granular_temperature, bed.restitution)
        slope = (solids_pressure(phi + h, *of) - solids_pressure(phi - h, *of)) / (2.0 * h)
        viscosity = longitudinal_viscosity(phi, bed.density, bed.diameter, *of[1:])
    force = np.array([-by_eps * seen * w, -(beta + by_w * w), s * (beta + by_w * w), 0.0])  # per volume of solid
    other = phi / eps * (taken - s**2) * force  # the pressure of the drag that a particle sees, less that of the cells
    a, b = np.zeros((4, 4), complex), np.zeros((4, 4), complex)  # a x = sigma b x, x = phi, v, u, p
    a[0] = [0.0, -k * phi, 0.0, 0.0]
    b[0, 0] = 1.0
    a[1] = [k * w * s, 0.0, -k * eps, 0.0]  # of the fluid: eps' = -s phi'
    b[1, 0] = -s
    a[2] = force + other + np.array([-k * slope / phi, 0.0, c * s * k * w, -s * k])
    a[2, 1] += viscosity * k**2 / phi
    b[2] = [0.0, rho + c, -c * s, 0.0]
    a[3] = -s * phi * (force + other + np.array([0.0, 0.0, c * s * k * w, 0.0]))
    a[3] -= np.array([s * beta * w * (1.0 + phi / eps), 0.0, 0.0, eps * k])
    a[3, 2] -= fluid * eps * k * w
    b[3] = [0.0, -s * phi * c, fluid * eps + s * phi * c * s, 0.0]
    found = eig(a, b, right=False)
    finite = found[np.isfinite(found) & (np.abs(found) < 1e6)]
    return complex(finite[np.argmax(finite.real)])


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"kernel": 1.5 * DIAMETER},
        {"kernel": 1.5 * DIAMETER, "added_mass": 1.33},
        {"kernel": 1.5 * DIAMETER, "added_mass": 1.33, "cell": 0.004},
        {"kernel": DIAMETER, "granular_temperature": 1.5e-3},
        {"kernel": DIAMETER, "drag": di_felice, "voidage": 0.7, "added_mass": 0.5, "granular_temperature": 2e-4},
    ],
)
def test_growth_and_speed_are_those_of_the_full_equations(changes: dict[str, float]) -> None:
    bed = alumina(**changes)
    for wavelength in (0.02, 0.032, 0.048, 0.1):
        expected = eigenvalue(bed, wavelength)
        wave = bed.wave(wavelength)
        assert wave.growth == pytest.approx(expected.real, rel=1e-4, abs=1e-3)
        assert wave.speed == pytest.approx(-expected.imag * wavelength / (2.0 * math.pi), rel=1e-4)


def test_without_a_kernel_the_shortest_wave_grows_fastest() -> None:
    """The equations of two fluids without particle pressure are ill-posed."""
    growth = [alumina().wave(length).growth for length in (0.03, 0.02, 0.01, 0.005)]
    assert growth == sorted(growth) and growth[-1] > 90.0
    assert alumina().fastest(shortest=0.005)[0] == pytest.approx(0.005)


def test_a_granular_temperature_makes_short_waves_decay() -> None:
    """Cold, the bed breaks up at 30 mm; at 1.5e-3 m2/s2 this wave decays."""
    cold, warm = (alumina(kernel=1.5 * DIAMETER, granular_temperature=each) for each in (0.0, 1.5e-3))
    assert cold.wave(0.03).growth > 8.0 and warm.wave(0.03).growth < -5.0
    length, wave = cold.fastest()
    assert 0.028 < length < 0.036 and isinstance(wave, Wave)


def test_a_dilute_limit_moves_waves_with_the_kinematic_speed() -> None:
    """Long waves run at the speed of kinematic waves, of which the flux of solids at a fixed total flux is the law."""
    bed = alumina()
    eps, w, h = bed.voidage, bed.slip(), 1e-4

    def solid_flux(solid: float) -> float:
        total = eps * w  # superficial, with the particles at rest on average
        other = alumina(voidage=1.0 - solid)
        return solid * (total - (1.0 - solid) * other.slip())

    kinematic = (solid_flux(1.0 - eps + h) - solid_flux(1.0 - eps - h)) / (2.0 * h)
    assert bed.wave(50.0).speed == pytest.approx(kinematic, rel=0.01)
