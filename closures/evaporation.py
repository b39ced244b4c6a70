"""Evaporation of water from a wet sphere or a drop into humid air: saturation, diffusion, rate, wet bulb."""

from __future__ import annotations

import math

from closures.registry import law

GAS_CONSTANT = 8.314462618
"""Molar gas constant, CODATA 2018 [J/mol/K]."""

WATER, AIR = 18.01528e-3, 28.9647e-3
"""Molar masses of water and dry air [kg/mol]."""

_REYNOLDS = "Reynolds, Thermodynamic Properties in SI, Stanford University (1979), as in MFIX"
_MARRERO = "Marrero & Mason, J. Phys. Chem. Ref. Data 1 (1972) 3; Mills, Basic Heat and Mass Transfer (1998) 947"
_SPALDING = "Spalding, 4th Symp. (Int.) on Combustion (1953) 847; Sirignano, Fluid Dynamics and Transport of Droplets"

_COEFFICIENTS = (-7.419242, 0.297221, -0.1155286, 8.68563e-3, 1.094098e-3, -4.39993e-3, 2.520658e-3, -5.218684e-4)


@law("evaporation", _REYNOLDS, temperature=(273.15, 647.286))
def saturation_pressure(temperature: float) -> float:
    r"""Pressure of saturated water vapour.

    .. math:: \ln\frac{p}{22.089\,\mathrm{MPa}} = \left(\frac{647.286}{T} - 1\right)
              \sum_{i=1}^{8} a_i\,(0.01\,(T - 338.15))^{i-1}

    temperature  T [K]
    returns      p [Pa]

    Range: 273.15 K to the critical point, 647.286 K; used down to some kelvin below for supercooled water.

    The boiling point at 101 325 Pa is 373.15 K:

    >>> round(saturation_pressure(373.15), -2), round(saturation_pressure(293.15))
    (101300.0, 2338)
    """
    x, total, power = 0.01 * (temperature - 338.15), 0.0, 1.0
    for k in range(8):
        total += _COEFFICIENTS[k] * power
        power *= x
    return 22.089e6 * math.exp((647.286 / temperature - 1.0) * total)


@law("evaporation", _MARRERO, temperature=(280.0, 1070.0))
def vapour_diffusivity(temperature: float, pressure: float) -> float:
    r"""Diffusivity of water vapour in air.

    .. math:: D = 1.87\cdot10^{-10}\,T^{2.072}\,\frac{101325\,\mathrm{Pa}}{p} \quad (T < 450\,\mathrm{K}), \qquad
              2.75\cdot10^{-9}\,T^{1.632}\,\frac{101325\,\mathrm{Pa}}{p} \quad \text{above}

    temperature  T [K]
    pressure     p [Pa]
    returns      D [m2/s]

    Range: 280 to 1070 K.

    >>> round(vapour_diffusivity(298.15, 101325.0) * 1e6, 1)
    25.1
    """
    of_temperature = 1.87e-10 * temperature**2.072 if temperature < 450.0 else 2.75e-9 * temperature**1.632
    return float(of_temperature * 101325.0 / pressure)


@law("evaporation", "fit to steam tables, whose values are from memory", temperature=(273.15, 373.15))
def latent_heat(temperature: float) -> float:
    r"""Latent heat of the evaporation of water.

    .. math:: L = 2500.9 - 2.345\,\theta - 0.001\,\theta^2\ \mathrm{kJ/kg}, \qquad \theta = T - 273.15\,\mathrm{K}

    temperature  T [K]
    returns      L [J/kg]

    Range: 0 to 100 C, within 0.1 % of 2500.9, 2441.7, 2382.0 and 2256.4 kJ/kg at 0, 25, 50 and 100 C.

    >>> round(latent_heat(298.15) * 1e-3, 1), round(latent_heat(373.15) * 1e-3, 1)
    (2441.7, 2256.4)
    """
    above = temperature - 273.15
    return 2.5009e6 - 2345.0 * above - above**2


@law("evaporation", "mixture of ideal gases")
def vapour_fraction(vapour_pressure: float, pressure: float) -> float:
    r"""Share by mass of water vapour in humid air.

    .. math:: Y = \frac{p_v M_v}{p_v M_v + (p - p_v) M_a}

    vapour_pressure  p_v [Pa]
    pressure         p, of the mixture [Pa]
    returns          Y [-]

    Range: 0 <= p_v <= p.

    Saturated air of 30 C (MFIX, dem-tests/evaporation: 0.026482, with slightly different molar masses):

    >>> round(vapour_fraction(saturation_pressure(303.15), 101325.0), 4)
    0.0265
    """
    return vapour_pressure * WATER / (vapour_pressure * WATER + (pressure - vapour_pressure) * AIR)


@law("evaporation", "mixture of ideal gases")
def vapour_pressure(share: float, pressure: float) -> float:
    r"""Partial pressure of water vapour in humid air: the inverse of :func:`vapour_fraction`.

    .. math:: p_v = p\,\frac{Y / M_v}{Y / M_v + (1 - Y) / M_a}

    share     Y, share by mass of the vapour [-]
    pressure  p, of the mixture [Pa]
    returns   p_v [Pa]

    Range: 0 <= Y <= 1.

    >>> round(vapour_pressure(vapour_fraction(2000.0, 101325.0), 101325.0), 6)
    2000.0
    """
    moles = share / WATER
    return pressure * moles / (moles + (1.0 - share) / AIR)


@law("evaporation", _SPALDING)
def stefan_drive(at_surface: float, in_gas: float) -> float:
    r"""Driving force of evaporation with the flow of the vapour itself.

    .. math:: \frac{\dot m}{\pi d\,Sh\,\rho D} = \ln(1 + B) = \ln\frac{1 - Y_\infty}{1 - Y_s}

    at_surface  Y_s, share by mass of the vapour at the surface, saturated [-]
    in_gas      Y, share by mass in the gas [-]
    returns     the logarithm; negative where vapour condenses [-]

    Range: Y_s < 1.

    >>> round(stefan_drive(0.0161, 0.0131), 5)
    0.00304
    """
    return math.log((1.0 - in_gas) / (1.0 - at_surface))


@law("evaporation", "Musser, PhD thesis, West Virginia University (2011), as in MFIX dem-tests/evaporation")
def dilute_drive(saturation: float, partial: float, gas_temperature: float, density: float) -> float:
    r"""Driving force of evaporation of little vapour: the difference of concentration, at the temperature of the gas.

    .. math:: \frac{\dot m}{\pi d\,Sh\,\rho D} = \frac{M_v\,(p_s - p_v)}{R\,T_g\,\rho}

    saturation       p_s, pressure of the saturated vapour at the surface [Pa]
    partial          p_v, of the vapour in the gas [Pa]
    gas_temperature  T_g [K]
    density          rho, of the gas [kg/m3]
    returns          the driving force; negative where vapour condenses [-]

    Range: p_s far below the pressure.

    >>> round(dilute_drive(2604.0, 2124.0, 303.15, 1.156), 5)
    0.00297
    """
    return WATER * (saturation - partial) / (GAS_CONSTANT * gas_temperature * density)


@law("drying", "falling-rate period of a film that covers a part of the surface")
def wet_share(volume: float, area: float, full_thickness: float) -> float:
    r"""Share of the surface of a sphere that is wet.

    .. math:: s = \min\left(1, \frac{V}{A\,t_f}\right)

    volume          V, of the liquid [m3]
    area            A, of the sphere [m2]
    full_thickness  t_f, thickness of a film that covers all; 0: any liquid covers all [m]
    returns         s [-]

    Range: any.

    >>> wet_share(1e-12, 1e-6, 2e-6)
    0.5
    """
    if volume <= 0.0:
        return 0.0
    return min(1.0, volume / (area * full_thickness)) if full_thickness > 0.0 else 1.0


@law("evaporation", "balance of heat and mass, e.g. Mills, Basic Heat and Mass Transfer")
def wet_bulb_temperature(gas_temperature: float, vapour_share: float, pressure: float, ratio: float) -> float:
    r"""Temperature at which the heat from the gas evaporates what diffuses away.

    .. math:: T_g - T_w = \frac{Sh\,\rho D}{Nu\,k}\,L(T_w)\,\ln\frac{1 - Y}{1 - Y_s(T_w)}

    gas_temperature  T_g [K]
    vapour_share     Y, share by mass of the vapour in the gas [-]
    pressure         p [Pa]
    ratio            Sh rho D / (Nu k): 1 / (c_p Le) where Nu and Sh are in the ratio of k and rho c_p D [kg K/J]
    returns          T_w [K]

    Range: 273 to 373 K.

    Air of 30 C and 50 % humidity at Le = 0.87 and rest:

    >>> round(wet_bulb_temperature(303.15, 0.013135, 101325.0, 1.0 / (1017.0 * 0.87)) - 273.15, 1)
    21.7
    """
    low, high = 200.0, gas_temperature + 50.0  # above that of the gas where vapour condenses
    for _ in range(60):
        middle = 0.5 * (low + high)
        at_surface = vapour_fraction(min(saturation_pressure(middle), 0.999 * pressure), pressure)
        if gas_temperature - middle > ratio * latent_heat(middle) * stefan_drive(at_surface, vapour_share):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
