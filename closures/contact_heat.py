"""Conduction between two spheres, or a sphere and a wall: through the contact, its asperities, and the gas around it.

A wall is a sphere of infinite radius. A conductance G gives the heat G (T_j - T_i) per time.
"""

from __future__ import annotations

import math

from closures.registry import law

_BATCHELOR = "Batchelor & O'Brien, Proc. R. Soc. Lond. A 355 (1977) 313-333; doi 10.1098/rspa.1977.0100"
_RONG = "Rong & Horio, 2nd Int. Conf. CFD in the Minerals and Process Industries, Melbourne (1999) 65-70"
_BAHRAMI = "Bahrami, Yovanovich & Culham, Int. J. Heat Mass Transf. 49 (2006) 3691; doi 10.1016/j.ijheatmasstransfer.2006.02.021"  # noqa: E501  # fmt: skip
_VAN_LEW = "Van Lew, PhD thesis, University of California, Los Angeles (2016), eqs. (3.25) to (3.27)"
_BEAULIEU = "Beaulieu, PhD thesis, Polytechnique Montreal (2020); publications.polymtl.ca/4757"

_NODES = (0.0950125098376374, 0.2816035507792589, 0.4580167776572274, 0.6178762444026438,
          0.7554044083550030, 0.8656312023878318, 0.9445750230732326, 0.9894009349916499)  # fmt: skip
_WEIGHTS = (0.1894506104550685, 0.1826034150449236, 0.1691565193950025, 0.1495959888165767,
            0.1246289712555339, 0.0951585116824928, 0.0622535239386479, 0.0271524594117541)  # fmt: skip
# Gauss-Legendre quadrature of 16 points, its positive half


@law("contact_heat", "harmonic mean, as in " + _BATCHELOR)
def harmonic_conductivity(first: float, second: float) -> float:
    r"""Conductivity of two half spaces in contact.

    .. math:: k_h = \frac{2 k_i k_j}{k_i + k_j}

    first, second  k, of the two solids [W/m/K]
    returns        k_h [W/m/K]

    Range: any.

    >>> harmonic_conductivity(42.0, 42.0)
    42.0
    """
    return 2.0 * first * second / (first + second)


@law("contact_heat", _BATCHELOR)
def contact_conductance(conductivity: float, contact_radius: float) -> float:
    r"""Conductance of two solids through a circle of contact.

    .. math:: G = 2 k_h a = \frac{4 k_i k_j}{k_i + k_j}\,a

    conductivity    k_h, from :func:`harmonic_conductivity` [W/m/K]
    contact_radius  a [m]
    returns         G [W/K]

    Range: a much smaller than the radii; time longer than that of conduction across the circle.

    The rate of the contact test of MFIX, G / (m c), is 0.01027998 1/s:

    >>> calorie = 4.1868
    >>> k = harmonic_conductivity(0.131453, 0.002008) * calorie * 100.0
    >>> capacity = 4.0 / 3.0 * math.pi * 0.15**3 * 0.42 * 0.191204 * calorie
    >>> round(contact_conductance(k, intersection_radius(1.5e-3, 1.8e-3, 1.33e-7)) / capacity, 6)
    0.01028
    """
    return 2.0 * conductivity * contact_radius


@law("contact_heat", "Johnson, Contact Mechanics (1985) eq. (4.22)")
def hertz_radius(force: float, reduced_modulus: float, reduced_radius: float) -> float:
    r"""Radius of the circle of a Hertz contact that carries a force.

    .. math:: a = \left(\frac{3 F R^*}{4 E^*}\right)^{1/3}

    With the modulus of the real solids it is the real circle, also where the contact of a run is softened, as long as
    the force is that of the real contact: in a bed at rest, not in a collision.

    force            F, normal [N]
    reduced_modulus  E*, of the real solids [Pa]
    reduced_radius   R* [m]
    returns          a [m]

    Range: a << R*, elastic solids.

    >>> round(hertz_radius(0.05, 109e9, 1.6e-3) * 1e6, 2)
    8.2
    """
    return float((0.75 * force * reduced_radius / reduced_modulus) ** (1.0 / 3.0))


@law("contact_heat", "geometry of two spheres")
def intersection_radius(first: float, second: float, overlap: float) -> float:
    r"""Radius of the circle in which two overlapping spheres intersect.

    .. math:: a^2 = \frac{\delta (2 R_i - \delta)(2 R_j - \delta)(2 R_i + 2 R_j - \delta)}{4 (R_i + R_j - \delta)^2}

    first    R_i [m]
    second   R_j; infinite for a wall [m]
    overlap  delta, >= 0 [m]
    returns  a [m]

    Range: overlap below the smaller radius; larger ones count as that.

    >>> round(intersection_radius(1.5e-3, 1.8e-3, 1.33e-7) * 1e6, 3)
    14.752
    """
    overlap = min(overlap, min(first, second))
    if second == math.inf:
        return math.sqrt(overlap * (2.0 * first - overlap))
    distance = first + second - overlap
    product = overlap * (2.0 * first - overlap) * (2.0 * second - overlap) * (2.0 * (first + second) - overlap)
    return math.sqrt(product) / (2.0 * distance)


@law("contact_heat", _RONG)
def lens_conductance(first: float, second: float, gap: float, lens: float, least_gap: float) -> float:
    r"""Conductance of the gas between two spheres, over the conductivity of the gas.

    .. math:: \frac{G}{k_g} = \int_{r_a}^{r_o} \frac{2\pi r\,dr}{\max(h(r), s)}, \qquad
              h = D - \sqrt{R_i^2 - r^2} - \sqrt{R_j^2 - r^2}

    first      R_i [m]
    second     R_j; infinite for a wall [m]
    gap        D - R_i - R_j, negative for an overlap [m]
    lens       thickness of the gas around the larger sphere that conducts, over its radius, 0.2 by Rong and Horio [-]
    least_gap  s, smallest distance of the two surfaces; 4e-10 m by Rong and Horio [m]
    returns    G / k_g [m]

    Range: any; 0 where the gas around the larger sphere does not reach the smaller one. r_a is the radius of the
    contact, r_o where the surface of the gas meets the smaller sphere. Quadrature of 16 points in the logarithm of the
    distance, within 1e-6.

    The rate of the gap test of MFIX, G / (m c), is 0.0401067 1/s:

    >>> capacity = 4.0 / 3.0 * math.pi * 0.15**3 * 0.42 * 0.191204
    >>> round(lens_conductance(1.5e-3, 1.8e-3, 1.8e-4, 0.2, 4e-10) * 100.0 * 1.239e-4 / capacity, 4)
    0.0401
    """
    small, large = min(first, second), max(first, second)
    thickness = lens * (small if large == math.inf else large)
    if gap >= thickness:
        return 0.0
    if large == math.inf:  # the height of the sphere above the wall is that of the gas
        outer = small**2 - max(small + gap - thickness, 0.0) ** 2
        reduced = small
    else:
        distance = small + large + gap
        along = ((large + thickness) ** 2 - small**2 + distance**2) / (2.0 * distance)
        outer = (large + thickness) ** 2 - along**2
        if along < distance - small or outer <= 0.0:
            return 0.0
        if distance - along < 0.0:  # beyond the equator of the smaller sphere
            outer = small**2
        reduced = small * large / (small + large)
    outer = min(outer, small**2 * (1.0 - 1e-12))
    base, begin, total = gap, 0.0, 0.0  # distance where the quadrature begins, and r^2 there
    if gap < least_gap:
        base = least_gap
        begin = min(intersection_radius(small, large, least_gap - gap) ** 2, outer)
        contact = intersection_radius(small, large, -gap) ** 2 if gap < 0.0 else 0.0
        total = max(begin - contact, 0.0) / least_gap
    low, high = math.log(base), math.log(base + (outer - begin) / (2.0 * reduced))
    for k in range(16):
        node = _NODES[k] if k < 8 else -_NODES[k - 8]
        weight = _WEIGHTS[k] if k < 8 else _WEIGHTS[k - 8]
        near = math.exp(0.5 * (low + high) + 0.5 * (high - low) * node)
        beyond = (near - base) * 2.0 * reduced
        square = min(begin + beyond, outer)
        height = base + beyond / (math.sqrt(small**2 - begin) + math.sqrt(small**2 - square))
        if large != math.inf:
            height += beyond / (math.sqrt(large**2 - begin) + math.sqrt(large**2 - square))
        total += 0.5 * (high - low) * weight * 2.0 * reduced * near / height
    return math.pi * total


@law("contact_heat", _BAHRAMI)
def jump_distance(accommodation: float, other: float, heat_ratio: float, free_path: float, prandtl: float) -> float:
    r"""Gas parameter M: by how much the jump of temperature at two surfaces widens a gap.

    .. math:: M = \left(\frac{2-\alpha_i}{\alpha_i} + \frac{2-\alpha_j}{\alpha_j}\right)
              \frac{2\gamma}{1+\gamma}\,\frac{\Lambda}{Pr}

    accommodation, other  alpha, thermal accommodation coefficients of the two surfaces [-]
    heat_ratio            gamma, ratio of the specific heats of the gas [-]
    free_path             Lambda, mean free path of the gas [m]
    prandtl               Pr of the gas [-]
    returns               M [m]

    Range: any.

    >>> round(jump_distance(0.7, 0.7, 1.0, 68e-9, 1.85e-5 * 1006.0 / 0.027) * 1e9)
    366
    """
    slip = (2.0 - accommodation) / accommodation + (2.0 - other) / other
    return slip * 2.0 * heat_ratio / (1.0 + heat_ratio) * free_path / prandtl


@law("contact_heat", _BAHRAMI + ", for a gap of two equal spheres; here with the distance of spheres that do not touch")
def macro_gap_conductance(first: float, second: float, gap: float, contact_radius: float, jump: float) -> float:
    r"""Conductance of the gas between the surfaces of two spheres, over the conductivity of the gas.

    .. math:: \frac{G}{k_g} = \frac{\pi}{2}\left[S\ln\frac{S}{S-A} - A\right], \quad
              A = 2\sqrt{R^2-a^2}, \quad S = 2R - a^2/R + h + M

    first           R_i [m]
    second          R_j; infinite for a wall [m]
    gap             h; an overlap counts as 0 [m]
    contact_radius  a; 0 without contact [m]
    jump            M, from :func:`jump_distance` [m]
    returns         G / k_g [m]

    Range: h + M > 0. R is the harmonic mean of the two radii. A wall is the plane of symmetry of two spheres 2 (h + M)
    apart, with twice their conductance: the integral over the gas below the sphere, exactly.

    Two spheres of 6.4 mm in air (Beaulieu 2020), and the wall that is their plane of symmetry:

    >>> pair = macro_gap_conductance(3.2e-3, 3.2e-3, 0.0, 0.0, 3.66e-7)
    >>> round(pair * 1e3, 1), round(macro_gap_conductance(3.2e-3, math.inf, 0.0, 0.0, 1.83e-7) / pair, 9)
    (88.2, 2.0)
    """
    at_wall = first == math.inf or second == math.inf
    radius = min(first, second) if at_wall else 2.0 * first * second / (first + second)
    width = (2.0 if at_wall else 1.0) * (max(gap, 0.0) + jump)
    contact_radius = min(contact_radius, radius)
    across = 2.0 * math.sqrt(radius**2 - contact_radius**2)
    # S - A without cancellation
    rest = (contact_radius**2 / radius) ** 2 / (2.0 * radius - contact_radius**2 / radius + across) + width
    total = across + rest
    return (math.pi if at_wall else 0.5 * math.pi) * (total * math.log(total / rest) - across)


@law("contact_heat", _BEAULIEU)
def solid_layer_resistance(radius: float, contact_radius: float, conductivity: float) -> float:
    r"""Resistance of a sphere to the heat that goes on through the gas.

    .. math:: R = \frac{\pi r / 4}{k\,\pi (r^2 - a^2)}

    radius          r [m]
    contact_radius  a [m]
    conductivity    k, of the solid [W/m/K]
    returns         R [K/W]

    Range: a < r.

    >>> round(solid_layer_resistance(3.2e-3, 0.0, 42.0), 3)
    1.86
    """
    return 0.25 * radius / (conductivity * (radius**2 - contact_radius**2))


@law("contact_heat", _VAN_LEW + "; plastic contact of asperities by Yovanovich (1981)")
def asperity_conductance(
    conductivity: float, contact_radius: float, pressure_ratio: float, roughness: float, slope: float
) -> float:
    r"""Conductance of the asperities in a Hertz contact.

    .. math:: G = \frac{\pi k_h a^2}{1.184}\,\frac{m}{\sigma}\left(\frac{P_0}{H}\right)^{0.96}

    Yovanovich's h = 1.25 k_h (m/sigma) (P/H)^0.95, integrated over the pressure of a Hertz contact; 1.184 is
    (1 + 0.96/2) / 1.25.

    conductivity    k_h, from :func:`harmonic_conductivity` [W/m/K]
    contact_radius  a [m]
    pressure_ratio  P_0 / H, largest pressure 3 F / (2 pi a^2) over the microhardness [-]
    roughness       sigma = sqrt(sigma_i^2 + sigma_j^2) [m]
    slope           m = sqrt(m_i^2 + m_j^2), mean slope of the asperities [-]
    returns         G [W/K]

    Range: P_0 / H below about 1; the circle of contact is that of smooth spheres.

    >>> round(1.0 / asperity_conductance(42.0, 8.2e-6, 0.12, 27e-9, 0.079))
    349
    """
    return math.pi * conductivity * contact_radius**2 / 1.184 * slope / roughness * float(pressure_ratio**0.96)


@law("contact_heat", _BAHRAMI)
def micro_gap_conductance(contact_radius: float, pressure_ratio: float, roughness: float, jump: float) -> float:
    r"""Conductance of the gas between the asperities of a contact, over the conductivity of the gas.

    .. math:: \frac{G}{k_g} = \frac{\pi a^2}{2\sqrt2\,\sigma a_2}\,
              \ln\left(1+\frac{a_2}{a_1+M/(2\sqrt2\,\sigma)}\right), \quad
              a_1 = \mathrm{erfc}^{-1}\frac{2P_0}{H}, \quad a_2 = \mathrm{erfc}^{-1}\frac{0.03P_0}{H} - a_1

    contact_radius  a [m]
    pressure_ratio  P_0 / H, as in :func:`asperity_conductance` [-]
    roughness       sigma [m]
    jump            M, from :func:`jump_distance` [m]
    returns         G / k_g [m]

    Range: P_0 < H / 2; a_1 is 0 above, and the conductance 0 from P_0 = H on, where no gap is left.

    >>> round(micro_gap_conductance(8.2e-6, 0.12, 27e-9, 3.66e-7) * 1e6)
    445
    """
    if not 0.0 < pressure_ratio < 1.0:
        return 0.0
    near = max(inverse_erfc(2.0 * pressure_ratio), 0.0)
    width = inverse_erfc(0.03 * pressure_ratio) - near
    scale = 2.0 * math.sqrt(2.0) * roughness
    return math.pi * contact_radius**2 / (scale * width) * math.log(1.0 + width / (near + jump / scale))


@law("contact_heat", "Newton's method for the logarithm of erfc")
def inverse_erfc(value: float) -> float:
    r"""Inverse of the complementary error function.

    .. math:: \mathrm{erfc}\,x = y

    value    y, 0 < y < 2 [-]
    returns  x [-]

    Range: 0 < y < 2.

    >>> round(inverse_erfc(math.erfc(0.3)), 12), round(inverse_erfc(math.erfc(-1.2)), 12)
    (0.3, -1.2)
    >>> round(inverse_erfc(math.erfc(5.0)), 10)
    5.0
    """
    tail = min(value, 2.0 - value)
    x = math.sqrt(-math.log(tail)) if tail < 0.3 else 1.0 - tail
    for _ in range(12):
        present = math.erfc(x)
        x += present * math.log(present / tail) * 0.5 * math.sqrt(math.pi) * math.exp(x * x)
    return x if value <= 1.0 else -x


# ---------------------------------------------------------------- radiation
#
# Heat that a sphere exchanges with its surroundings by radiation.


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
