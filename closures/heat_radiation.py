"""Heat that a sphere exchanges with its surroundings by radiation."""

from __future__ import annotations

from closures.registry import law

STEFAN_BOLTZMANN = 5.670374e-8
"""Constant of Stefan and Boltzmann, CODATA 2018 [W/m2/K4]."""

_MUSSER = "Musser, PhD thesis, West Virginia University (2011), as in MFIX des_thermo_rad.f"


@law("heat_radiation", "Stefan's law for a grey sphere in large surroundings")
def radiation_coefficient(emissivity: float, temperature: float, surroundings: float) -> float:
    r"""Coefficient of heat transfer of a grey surface by radiation.

    .. math:: h = \varepsilon\,\sigma\,(T_e^2 + T^2)(T_e + T), \qquad q = h\,(T_e - T) = \varepsilon\sigma(T_e^4 - T^4)

    emissivity    epsilon of the surface [-]
    temperature   T, of the surface [K]
    surroundings  T_e, of what it sees [K]
    returns       h [W/m2/K]

    Range: grey surfaces, and surroundings much larger than the sphere.

    >>> round(radiation_coefficient(1.0, 300.0, 300.0), 2)
    6.12
    """
    return emissivity * STEFAN_BOLTZMANN * (surroundings**2 + temperature**2) * (surroundings + temperature)


@law("heat_radiation", _MUSSER)
def local_surroundings(voidage: float, gas: float, particles: float) -> float:
    r"""Temperature of the surroundings of a particle in a suspension.

    .. math:: T_e = \varepsilon_g T_g + (1 - \varepsilon_g)\,\bar T_p

    voidage    epsilon_g, near the particle [-]
    gas        T_g, of the gas, or of what is seen through it [K]
    particles  mean temperature of the particles near it [K]
    returns    T_e [K]

    Range: any.

    >>> local_surroundings(0.9, 400.0, 300.0)
    390.0
    """
    return voidage * gas + (1.0 - voidage) * particles
