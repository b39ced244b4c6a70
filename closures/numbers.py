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


@law("number", "Nase, Vargas, Abatan & McCarthy, Powder Technol. 116 (2001) 214, doi:10.1016/S0032-5910(00)00398-3")
def granular_bond(surface_tension: float, contact_angle: float, reduced_radius: float, weight: float) -> float:
    r"""Granular Bond number: largest pull of a liquid bridge over the weight of a particle.

    .. math:: Bo_g = \frac{4\pi R^*\sigma\cos\theta}{m\,g}

    surface_tension  sigma [N/m]
    contact_angle    theta [rad]
    reduced_radius   R* [m]
    weight           m g, of the particle, without buoyancy in a gas [N]
    returns          Bo_g [-]; above about 1 bridges carry particles

    Range: any. Water between glass beads of 1 mm:

    >>> round(granular_bond(0.0728, 0.0, 0.25e-3, 2500.0 * math.pi / 6.0 * 1e-9 * 9.81), 1)
    17.8
    """
    return 4.0 * math.pi * reduced_radius * surface_tension * math.cos(contact_angle) / weight


@law("number", "Ennis, Tardos & Pfeffer, Powder Technol. 65 (1991) 257, doi:10.1016/0032-5910(91)80189-P; rederived")
def ennis_critical_stokes(restitution: float, film: float, roughness: float) -> float:
    r"""Critical Stokes number of two coated particles: slower ones stick by the viscosity of their films.

    .. math:: St^* = \left(1+\frac1e\right)\ln\frac{h_0}{h_a}

    restitution  e, dry [-]
    film         h_0, thickness of the liquid on each particle [m]
    roughness    h_a, height of the asperities on each particle, < h_0 [m]
    returns      St*, for the relative speed in :func:`stokes`; 0 for films that do not cover the asperities [-]

    Range: films of constant resistance A/h on the way in and out, no capillarity. Ennis writes
    St = 8 rho a u/(9 eta) with half the relative speed u, the same number.

    >>> round(ennis_critical_stokes(1.0, math.e, 1.0), 12)
    2.0
    """
    return (1.0 + 1.0 / restitution) * math.log(max(film / roughness, 1.0))
