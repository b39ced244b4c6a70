"""Dry contacts: the benchmarks of Chung & Ooi, and restitution.

Chung, Y.C. & Ooi, J.Y. (2011), Granular Matter 13, 643: tests 1 to 5 and 7, parameters and curves as in
`scenarios/data/chung_ooi_*.csv`. A rigid plane is a wall a thousand times stiffer than the sphere.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from impacts import STEP, Pair, relative_velocity, rigid, rows, until_apart
from scipy.special import beta

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from closures import contact

GLASS = Material(density=2800, youngs_modulus=48e9, poisson=0.20, friction=0.35)
LIMESTONE = Material(density=2500, youngs_modulus=20e9, poisson=0.25, friction=0.35)
ALUMINIUM = Material(density=2699, youngs_modulus=70e9, poisson=0.30)
MAGNESIUM = Material(density=1800, youngs_modulus=40e9, poisson=0.35)
ALUMINA = Material(density=4000, youngs_modulus=380e9, poisson=0.23, friction=0.092, restitution=0.98)
IRON = Material(density=7000, youngs_modulus=100e9, poisson=0.25)
ALLOY = Material(density=2700, youngs_modulus=70e9, poisson=0.33, friction=0.092, restitution=0.98)
STEEL = Material(density=7850, youngs_modulus=208e9, poisson=0.30, friction=0.3)
POLYETHYLENE = Material(density=1400, youngs_modulus=1e9, poisson=0.40, friction=0.3)
COPPER = Material(density=8900, youngs_modulus=120e9, poisson=0.35, friction=0.4, restitution=0.5)


def on_plane(material: Material, radius: float, approach: float, **more: float) -> Pair:
    """A sphere that comes to a rigid plane."""
    return Pair((material, rigid(material)), (radius, radius), approach, wall=True, **more)  # type: ignore[arg-type]


HERTZ_CASES = {
    ("T1", "glass"): Pair((GLASS, GLASS), (0.01, 0.01), 20.0),
    ("T1", "limestone"): Pair((LIMESTONE, LIMESTONE), (0.01, 0.01), 20.0),
    ("T2", "Al alloy"): on_plane(ALUMINIUM, 0.1, 0.2),
    ("T2", "Mg alloy"): on_plane(MAGNESIUM, 0.1, 0.2),
}


@pytest.mark.parametrize("row", rows("chung_ooi_t1_t2_hertz_exact"), ids=lambda row: f"{row['test']} {row['material']}")
def test_elastic_impact_has_the_force_overlap_and_duration_of_hertz(row: dict[str, str]) -> None:
    """Tests 1 and 2: largest force, overlap and contact time within 0.5 % (sampled 1000 times a contact)."""
    pair = HERTZ_CASES[row["test"], row["material"]]
    step = pair.hertz_time / 1000.0
    run = pair.simulation()
    force, gap = [], []
    while not (len(gap) > 900 and gap[-1] > 0.0):
        run.advance(step)
        force.append(np.linalg.norm(run.particles.force[0]))
        gap.append(run.gap[0])
    past = gap[-1] / (gap[-1] - gap[-2])
    duration = (len(gap) - past) * step
    assert max(force) == pytest.approx(float(row["F_max [N]"]), rel=5e-3)
    assert -min(gap) == pytest.approx(1e-6 * float(row["delta_max [um]"]), rel=5e-3)
    assert duration == pytest.approx(1e-6 * float(row["t_contact [us]"]), rel=5e-3)


@pytest.mark.parametrize("material", [ALUMINA, IRON], ids=["Al oxide", "cast iron"])
@pytest.mark.parametrize("restitution", [0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0])
def test_sphere_rebounds_from_plane_with_the_given_restitution(material: Material, restitution: float) -> None:
    """Test 3 at the default step: e_out = e_in within 1e-3 for e >= 0.9 and 4e-3 down to 0.2 (its own limit: 0.01)."""
    dry = material.model_copy(update={"restitution": restitution, "friction": 0.0})
    pair = on_plane(dry, 2.5e-3, 3.9)
    run = until_apart(pair.simulation(), STEP * pair.hertz_time)
    assert -run.particles.velocity[0, 0] / 3.9 == pytest.approx(restitution, abs=restitution_limit(restitution))


def restitution_limit(restitution: float) -> float:
    """Error of a dry head-on rebound at 2 % of the Hertz time."""
    return 1e-3 if restitution >= 0.9 else 4e-3


@pytest.fixture(scope="module")
def oblique() -> dict[tuple[str, str], np.ndarray]:
    """Test 4 by series and observable: columns impact angle, published value, ours."""
    found: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
    for row in rows("chung_ooi_t4_oblique"):
        angle, value = float(row["impact_angle [deg]"]), float(row["value"])
        material = ALLOY if row["series"] == "Al_alloy" else ALUMINA
        across, along = 3.9 * math.cos(math.radians(angle)), 3.9 * math.sin(math.radians(angle))
        pair = on_plane(material, 2.5e-3, across, slide=along)
        run = until_apart(pair.simulation(), STEP * pair.hertz_time)
        velocity, spin = run.particles.velocity[0], run.particles.spin[0, 2]
        patch = velocity[1] + 2.5e-3 * spin
        ours = {
            "e_t [-]": velocity[1] / along,
            "omega_out [rad/s]": spin,
            "patch_rebound_angle [deg]": math.degrees(math.atan2(patch, -velocity[0])),
        }[row["observable"]]
        found.setdefault((row["series"], row["observable"]), []).append((angle, value, ours))
    return {key: np.array(value) for key, value in found.items()}


SPANS = {"omega_out [rad/s]": 617.0, "patch_rebound_angle [deg]": 92.0}
"""Range of the published curves: limits in per cent are of this range, those of e_t of its value."""


@pytest.mark.parametrize("observable", ["e_t [-]", "omega_out [rad/s]", "patch_rebound_angle [deg]"])
@pytest.mark.parametrize("series", ["Al_oxide", "Al_alloy", "Experiment"])
def test_oblique_impact_at_constant_speed(
    oblique: dict[tuple[str, str], np.ndarray], series: str, observable: str
) -> None:
    """Test 4: within 3 % of the published simulations and 5 % of Kharaz et al. (2001), angles of 10 degrees and more.

    The published simulations themselves are 7 % from the measured spin at 20 degrees: there the limit is 8 %.
    """
    limit = 0.03 if series != "Experiment" else 0.08 if observable == "omega_out [rad/s]" else 0.05
    angle, published, ours = oblique[series, observable].T
    steep = angle >= 9.8
    scale = SPANS.get(observable, np.abs(published[steep]))
    assert np.max(np.abs(ours - published)[steep] / scale) <= limit


def slide_at_constant_approach(
    material: Material, x: float, speed: float = 5.0, softness: float = 1.0, spring: str = "total"
) -> tuple[float, float]:
    """Test 5: rebound slip and spin of a sphere that arrives with v_t = x mu v_n; `softness` scales k_t."""
    radius, unit = 1e-5, material.friction * speed
    pair = on_plane(material, radius, speed, slide=x * unit)
    pair.rows["shear_modulus"] *= softness
    run = until_apart(pair.simulation(Laws(spring=spring)), STEP * pair.hertz_time)
    spin = radius * run.particles.spin[0, 2]
    return (run.particles.velocity[0, 1] + spin) / (material.friction * -run.particles.velocity[0, 0]), spin / unit


def lever(material: Material, speed: float) -> float:
    """Mean lever of friction over the radius, weighed by the normal force of an undamped impact.

    The lever of a sphere on a plane is the distance of its centre, radius - overlap. The mean overlap of Hertz'
    impact is B(7/5, 1/2)/2 = 0.8176 of the largest.
    """
    pair = on_plane(material, 1e-5, speed)
    largest = contact.hertz_largest_overlap(pair.reduced_mass, pair.stiffness, speed)
    return 1.0 - 0.5 * beta(1.4, 0.5) * largest / 1e-5


@pytest.mark.parametrize("material", [STEEL, POLYETHYLENE], ids=["steel", "polyethylene"])
@pytest.mark.parametrize("x", [7.5, 10.0, 13.0, 20.0])
def test_full_sliding_is_exact(material: Material, x: float) -> None:
    """Test 5: an elastic sphere that slides throughout leaves with slip x - 7 and spin -5.

    Within 0.1 % (limit: 1 %) where the overlap is small against the radius; at 5 m/s, where it is not (0.6 % of the
    radius in steel, 2.7 % in polyethylene), within 0.1 % of the same balance with the shorter lever.
    """
    slip, spin = slide_at_constant_approach(material, x, speed=5e-3)
    assert slip == pytest.approx(x - 7.0, abs=5e-3)
    assert spin == pytest.approx(-5.0, rel=1e-3)
    _, spin = slide_at_constant_approach(material, x)
    assert spin == pytest.approx(-5.0 * lever(material, 5.0), rel=1e-3)


def distances(series: str, material: Material, observable: str, **model: float) -> np.ndarray:
    """Columns x and distance of our Test 5 to a series of the file."""
    which = int(observable == "spin")
    chosen = [
        (float(row["x [-]"]), float(row["value [-]"]))
        for row in rows("chung_ooi_t5_oblique_constant_normal")
        if row["series"] == series and row["observable"] == observable
    ]
    return np.array([(x, abs(slide_at_constant_approach(material, x, **model)[which] - value)) for x, value in chosen])


@pytest.mark.parametrize(("observable", "span"), [("rebound_slip", 7.7), ("spin", 5.0)])
def test_oblique_impact_follows_finite_elements(observable: str, span: float) -> None:
    """Test 5, against the finite elements of Wu (in Chung & Ooi): 6.5 % of the range for x > 2.3, 1 % for x > 5.6.

    Below, where the stuck disc creeps inward from its edge, a Mindlin spring cannot follow: 11 % at x = 0.9.
    """
    x, distance = (distances("FEM", STEEL, observable)).T
    assert distance.max() <= 0.11 * span
    assert distance[x > 2.3].max() <= 0.065 * span
    assert distance[x > 5.6].max() <= 0.01 * span


@pytest.mark.parametrize(
    ("series", "material"), [("steel", STEEL), ("polyethylene", POLYETHYLENE)], ids=["steel", "PE"]
)
@pytest.mark.parametrize(("observable", "span"), [("rebound_slip", 9.0), ("spin", 5.0)])
def test_oblique_impact_at_constant_approach(series: str, material: Material, observable: str, span: float) -> None:
    """Test 5, against the published simulations: within 3 % of the range, with a third of Mindlin's stiffness.

    They stop sliding throughout at x = 5, the finite elements and Mindlin's full stiffness at 6: their tangential
    spring is softer than that of Test 4.
    """
    _, distance = distances(series, material, observable, softness=1.0 / 3.0, spring="rescaled").T
    assert distance.max() <= 0.03 * span


@pytest.mark.parametrize("material", [ALUMINIUM, COPPER], ids=["Al alloy", "copper"])
@pytest.mark.parametrize("angle", [10.0, 45.0, 70.0])
def test_mirrored_spins_do_nothing(material: Material, angle: float) -> None:
    """Test 7: surfaces that move together neither slide nor stick: v_t = 0, spin unchanged, rebound by e alone."""
    rough = material.model_copy(update={"friction": 0.4, "restitution": 0.5})
    spin = 0.2 * math.tan(math.radians(angle)) / 0.1
    pair = Pair((rough, rough), (0.1, 0.1), 0.4, spin=((0.0, 0.0, spin), (0.0, 0.0, -spin)))
    run = until_apart(pair.simulation(), STEP * pair.hertz_time)
    assert np.abs(run.particles.velocity[:, 1:]).max() <= 1e-14
    assert run.particles.spin[:, 2] == pytest.approx([spin, -spin], rel=1e-14)
    assert -relative_velocity(run)[0] / 0.4 == pytest.approx(0.5, abs=4e-3)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    restitution=st.floats(0.2, 1.0),
    modulus=st.floats(6.0, 11.5),
    stiffer=st.floats(0.0, 3.0),
    poisson=st.floats(0.0, 0.49),
    density=st.floats(500.0, 10000.0),
    heavier=st.floats(0.3, 3.0),
    size=st.floats(-5.0, -1.0),
    ratio=st.floats(-1.0, 1.0),
    mach=st.floats(-6.0, -2.0),
    phase=st.floats(0.0, 1.0),
    wall=st.booleans(),
)
@example(0.2, 9.0, 0.0, 0.3, 2500.0, 1.0, -3.0, 0.0, -4.0, 0.5, False)
@example(0.9, 9.0, 0.0, 0.3, 2500.0, 1.0, -3.0, 0.0, -4.0, 0.9, True)
def test_head_on_restitution_over_materials(
    restitution: float,
    modulus: float,
    stiffer: float,
    poisson: float,
    density: float,
    heavier: float,
    size: float,
    ratio: float,
    mach: float,
    phase: float,
    wall: bool,
) -> None:
    """The rebound of unlike solids has the given restitution, whatever they are and where in a step they touch.

    Tsuji, Tanaka & Ishida (1992): at 2 % of the Hertz time within 1e-3 for e >= 0.9 and 4e-3 down to 0.2.
    """
    first = Material(density=density, youngs_modulus=10**modulus, poisson=poisson, restitution=restitution)
    second = Material(density=density * heavier, youngs_modulus=10 ** (modulus + stiffer), poisson=0.3)
    speed = 10**mach * math.sqrt(first.youngs_modulus / density)
    pair = Pair((first, second), (10**size, 10 ** (size + ratio)), speed, wall=wall)
    step = STEP * pair.hertz_time
    pair.gap = phase * step * speed
    run = until_apart(pair.simulation(), step)
    rebound = abs(relative_velocity(run)[0]) / speed
    assert rebound == pytest.approx(restitution, abs=restitution_limit(restitution))
