"""Dimensionless numbers."""

from __future__ import annotations

import math

from closures.registry import law


@law(
    "number",
    "Yang & Hunt, Phys. Fluids 18 (2006) 121506, doi:10.1063/1.2396925; Nijssen et al. (2023) eq. (2)",
)
def stokes(reduced_mass: float, speed: float, viscosity: float, reduced_radius: float) -> float:
    r"""Stokes number of a collision in a fluid: inertia of the particles over viscous resistance of the film.

    .. math:: St = \frac{m^* v}{6\pi\eta R^{*2}}

    reduced_mass    m*; the mass of the particle against a wall [kg]
    speed           v, relative speed [m/s]
    viscosity       eta, dynamic [Pa s]
    reduced_radius  R*; the radius of the particle against a wall [m]
    returns         St [-]

    Range: any. Against a fixed wall St = rho_p d v / (9 eta).

    >>> mass = math.pi / 6 * 6e-3**3 * 7800        # Gondret's steel sphere in silicone oil: St = 27
    >>> round(stokes(mass, 0.518, 965 * 1.036e-4, 3e-3))
    27
    """
    return reduced_mass * speed / (6.0 * math.pi * viscosity * reduced_radius**2)


@law("number", "Crowe et al., Multiphase Flows with Droplets and Particles (2011) ch. 4")
def reynolds(density: float, speed: float, diameter: float, viscosity: float) -> float:
    r"""Reynolds number of a sphere in a flow.

    .. math:: Re = \rho U d / \eta

    density    rho, of the fluid [kg/m3]
    speed      U, superficial slip speed [m/s]
    diameter   d, of the sphere [m]
    viscosity  eta, dynamic [Pa s]
    returns    Re [-]

    Range: any.

    >>> round(reynolds(965.0, 0.518, 6e-3, 965 * 1.036e-4))     # Gondret et al. (2002): Re = 30
    30
    """
    return density * speed * diameter / viscosity


@law("number", "Crowe et al., Multiphase Flows with Droplets and Particles (2011) ch. 4")
def archimedes(diameter: float, density: float, fluid_density: float, viscosity: float, gravity: float) -> float:
    r"""Archimedes number: buoyant weight of a sphere over viscous resistance.

    .. math:: Ar = \frac{g\,\rho_f(\rho_p-\rho_f)d^3}{\eta^2}

    diameter       d [m]
    density        rho_p, of the sphere [kg/m3]
    fluid_density  rho_f [kg/m3]
    viscosity      eta, dynamic [Pa s]
    gravity        g [m/s2]
    returns        Ar [-]; negative if the sphere is lighter than the fluid

    Range: any.

    >>> round(archimedes(1e-3, 2500.0, 1000.0, 1e-3, 9.81))
    14715
    """
    return gravity * fluid_density * (density - fluid_density) * diameter**3 / viscosity**2


@law("number", "Davis, Phys. Fluids 35 (2023), table I (there with the sphere radius in the numerator)")
def capillary(viscosity: float, speed: float, surface_tension: float) -> float:
    r"""Capillary number: viscous stress over capillary stress.

    .. math:: Ca = \eta v / \sigma

    viscosity        eta, dynamic [Pa s]
    speed            v [m/s]
    surface_tension  sigma [N/m]
    returns          Ca [-]

    Range: any.

    >>> capillary(1e-3, 0.072, 0.072)
    0.001
    """
    return viscosity * speed / surface_tension
