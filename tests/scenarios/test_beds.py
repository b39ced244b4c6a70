"""Beds: evaluation of made-up runs with known results; short runs against published laws."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.analysis.bubbles import BubbleProfile
from cfddem.analysis.series import block_average
from cfddem.case.gallery import gallery, gallery_files
from cfddem.case.schema import Case
from cfddem.fluid.cell_counts import cell_counts
from cfddem.preflight.bed_estimate import estimate_bed, net_downward_forces
from cfddem.preflight.summary import preflight
from cfddem.run import history
from cfddem.run.simulation import Simulation
from closures.balance import fluidising_velocity
from closures.bed import expanded_voidage, exponent_richardson_zaki, terminal_reynolds_brown_lawler
from closures.drag import di_felice, ergun
from closures.numbers import archimedes
from scenarios.beds.defluidisation.study import onsets
from scenarios.beds.gas_bed import mueller, standard_bed, van_wachem
from scenarios.beds.sedimentation.study import NARROW, Settling, between_walls, exponent, in_periodic_box, vessel
from scenarios.beds.segregation.study import VELOCITIES, balance, mixture, separation, thresholds
from scenarios.beds.spouted_bed import bed as spout
from scenarios.beds.spouted_bed import profiles
from scenarios.validation.beds import (
    Means,
    RefinementBed,
    compared,
    frequency,
    gas,
    growing,
    instantaneous_drops,
    liquid,
    placed,
    variants,
)


@pytest.mark.parametrize(
    "name", ["gas-bed", "gas-bed-flat", "defluidisation", "sedimentation", "segregation", "spouted-bed"]
)
def test_no_bed_of_the_gallery_is_refused(name: str) -> None:
    assert preflight(gallery()[name]).status != "error"


def test_weights_of_measured_beds() -> None:
    """189.6 Pa and 39 g, as published with them."""
    assert buoyant_weight(mueller()) / mueller().column.floor_area == pytest.approx(189.6, rel=1e-3)
    bed = van_wachem()
    mass = bed.particle_count * bed.solid.density * math.pi / 6.0 * bed.bed.diameter**3
    assert mass == pytest.approx(0.039, rel=1e-2)


def test_standard_bed_is_as_described() -> None:
    """24 750 spheres at rest in the column, none deep in another or in a wall, up to 155.8 mm."""
    from scipy.spatial import cKDTree

    case = standard_bed()
    places, radius = np.array(case.bed.positions), 0.5 * case.bed.diameter
    assert case.particle_count == 24_750
    nearest = cKDTree(places).query(places, 2)[0][:, 1]
    assert nearest.min() > 1.98 * radius
    assert (np.minimum(places, np.array(case.column.size) - places) > 0.98 * radius).all()
    assert places[:, 2].max() == pytest.approx(0.1558, abs=1e-4)


def test_exponent_of_an_exact_power_law() -> None:
    known = [Settling(solids, 0.08 * (1.0 - solids) ** 3.2, 0.08) for solids in (0.05, 0.2, 0.4)]
    assert exponent(known) == pytest.approx((3.2, 0.08), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("cell", [NARROW["column.cell"], 5e-3 / 3.0])
def test_the_boundary_of_a_suspension_falls_as_its_drag_law_says(cell: float) -> None:
    """At a solid fraction of 0.2. With smeared surfaces it is 2 to 5 % slower: a dense layer lies over a gap there."""
    case = vessel()
    fluid = case.required_fluid
    law = fluidising_velocity(case.bed.diameter, 2560.0, fluid.density, fluid.viscosity, 0.8, di_felice)
    sharp, smeared = (
        between_walls(0.2, changes=NARROW | {"column.cell": cell, "laws.surface": surface}).velocity
        for surface in ("sharp", "smeared")
    )
    assert sharp == pytest.approx(law, rel=0.01)
    assert 0.95 * law < smeared < 0.98 * law


def exact_ramp() -> tuple[Case, dict[str, np.ndarray], float]:
    """Pressure drop by Ergun at voidage 0.42 up to the weight, then the weight; and the balance."""
    case = Case.from_toml(gallery_files()["defluidisation"], {"laws.drag": "ergun"})
    assert case.fluid is not None and not isinstance(case.bed.inlet_velocity, float)
    balance = fluidising_velocity(1.2e-3, 1000.0, case.fluid.density, case.fluid.viscosity, 0.42, ergun)
    times, speeds = np.array(case.bed.inlet_velocity).T
    time = np.linspace(0.0, times[-1], 300)
    velocity = np.interp(time, times, speeds)

    def pull(speed: np.ndarray) -> np.ndarray:
        numbers = case.fluid.density * speed * case.bed.diameter / case.fluid.viscosity  # type: ignore[union-attr]
        return np.array([number * ergun(number, 0.42) for number in numbers])

    weight = buoyant_weight(case) / case.column.floor_area
    drop = weight * np.minimum(pull(velocity) / pull(np.array([balance])), 1.0)
    return case, {"time": time, "pressure_drop": drop, "bed_voidage": np.full(300, 0.42)}, balance


def test_onset_of_an_exact_bed_is_the_balance() -> None:
    case, history, balance = exact_ramp()
    for onset in onsets(case, history):
        assert onset.balance == pytest.approx(balance, rel=1e-12)
        assert onset.velocity == pytest.approx(balance, rel=1e-6)


def test_spikes_and_bubbles_do_not_move_an_onset() -> None:
    """Single rows of noise in the packed bed, and a pressure drop that falls for a moment while the bed bubbles."""
    case, history, balance = exact_ramp()
    drop, weight = history["pressure_drop"], buoyant_weight(case) / case.column.floor_area
    drop[[2, 297]] = weight
    drop[148:153] = 0.5 * weight
    for onset in onsets(case, history):
        assert onset.velocity == pytest.approx(balance, rel=0.01)


def test_both_sides_of_the_threshold_are_run() -> None:
    """Published laws of expansion and the drag law of the run agree on who sinks at both velocities."""
    slow, fast = VELOCITIES
    assert len(thresholds(mixture())) == 3
    for threshold in (*thresholds(mixture()).values(), balance(mixture())):
        assert 1.2 * slow < threshold < fast / 1.15


def test_the_drag_law_of_equal_spheres_predicts_the_wrong_species() -> None:
    """Without the mean size around, large light pellets sink already in the slow stream, against the published law."""
    slow = VELOCITIES[0]
    equal = mixture(slow).with_(**{"laws.drag": "beetstra"})
    assert slow < min(thresholds(equal).values())
    assert net_downward_forces(mixture(slow), slow, estimate_bed(mixture(slow)).voidage)["pellets"] < -0.02
    assert net_downward_forces(equal, slow, estimate_bed(equal).voidage)["pellets"] > 0.02


def test_layers_of_equal_bulk_density_change_places() -> None:
    """At the threshold of Richardson and Zaki, with their voidages, both layers weigh the same."""
    case = mixture()
    velocity = thresholds(case)["Richardson-Zaki"]
    bulk = []
    for name, each in case.species.items():
        density = case.material_of(each).density
        reynolds = terminal_reynolds_brown_lawler(archimedes(each.diameter, density, 998.0, 1e-3, 9.81))
        terminal = reynolds * 1e-3 / (998.0 * each.diameter)
        voidage = expanded_voidage(velocity, terminal, exponent_richardson_zaki(reynolds, 0.0))
        assert voidage > 0.45, name
        bulk.append((1.0 - voidage) * (density - 998.0))
    assert bulk[0] == pytest.approx(bulk[1], rel=1e-9)


def test_separation_of_layers_of_a_mixture_and_upside_down() -> None:
    time = np.linspace(0.0, 1.0, 5)
    history = {"time": time, "mean_height_a": 0.01 + 0.0 * time, "mean_height_b": 0.025 + 0.0 * time}
    history["bed_height"] = np.full(5, 0.03)
    assert separation(history, ("a", "b"), 0.5) == pytest.approx(1.0, rel=1e-12)
    assert separation(history, ("b", "a"), 0.5) == pytest.approx(-1.0, rel=1e-12)
    assert separation(history | {"mean_height_b": history["mean_height_a"]}, ("a", "b"), 0.5) == 0.0


def test_the_spout_is_where_particles_go_up() -> None:
    """Spheres that rise within 30 mm of the middle and sink beside it; two snapshots of unequal speed."""
    width, generator = 0.28, np.random.default_rng(1)
    x, z = generator.uniform(0.0, width, 40_000), generator.uniform(0.0, 0.1, 40_000)
    inner = np.abs(x - 0.5 * width) < 0.028

    def particles(snapshot: int) -> dict[str, np.ndarray]:
        upward = np.where(inner, 1.0 + snapshot, -0.1)
        zero = np.zeros_like(x)
        return {"position": np.stack([x, zero, z], axis=1), "velocity": np.stack([zero, zero, upward], axis=1)}

    run = SimpleNamespace(times=np.array([0.0, 1.0, 2.0]), particles=particles)
    (profile,) = profiles(run, width, 1.0, heights=[0.05])  # type: ignore[arg-type]
    assert profile.spout_width == pytest.approx(0.056, rel=1e-12)
    assert np.nanmax(profile.speed) == pytest.approx(2.5, rel=1e-12)
    assert np.nanmin(profile.upward) == pytest.approx(-0.1, rel=1e-12)


def test_the_slice_of_the_spouted_bed_is_its_share_of_the_experiment() -> None:
    assert spout().particle_count / 175_800 == pytest.approx(spout().column.size[1] / 0.04, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("velocity", "above"), [*zip(VELOCITIES, ("pellets", "beads"))])
def test_species_sink_on_the_side_of_the_published_threshold(velocity: float, above: str) -> None:
    """Equal bulk densities of the layers at 0.082 to 0.088 m/s (Epstein & LeClair, Chem. Eng. Sci. 40, 1517)."""
    simulation = Simulation(mixture(velocity))
    simulation.until(2.0)
    row = history.row(simulation)
    below = next(name for name in simulation.case.species if name != above)
    assert row[f"mean_height_{above}"] - row[f"mean_height_{below}"] > 0.05 * row["bed_height"]


@pytest.mark.slow
def test_hindered_settling_follows_richardson_and_zaki() -> None:
    """Exponent within 10 % between solid fractions of 0.1 and 0.3, in water (Trans. Inst. Chem. Eng. 32, 35)."""
    found = [in_periodic_box(share, distance=20.0) for share in (0.1, 0.3)]
    reynolds = 1000.0 * found[0].terminal * 5e-4 / 8.9e-4
    assert exponent(found)[0] == pytest.approx(exponent_richardson_zaki(reynolds, 0.0), rel=0.1)


@pytest.mark.parametrize("bed", [liquid(), gas()], ids=["liquid", "gas"])
def test_refinement_changes_numbers_only(bed: RefinementBed) -> None:
    """Cells, step and contact modulus change, one cell across stays one, and the kernel keeps its width."""
    for changes, _ in variants(bed.case).values():
        changed = bed.case.with_(**changes)
        assert set(changes) <= {"column.cell", "run.particle_step"} | {
            f"material.{name}.contact_modulus" for name in changed.material
        }
        assert changed.laws.kernel_width == bed.case.laws.kernel_width
        counts = cell_counts(changed.column.size, changed.column.cell)
        before = cell_counts(bed.case.column.size, bed.case.column.cell)
        finer = "column.cell" in changes
        assert all(n == (b if b == 1 or not finer else 1.5 * b) for n, b in zip(counts, before))


def test_a_larger_deviation_is_seen() -> None:
    """Twice the fluctuations of pressure at the same mean: the ratio of deviations is 2, and the limit of 5 % fails."""
    time = np.linspace(0.0, 10.0, 1000)

    def means(size: float) -> Means:
        wave = size * np.sin(20.0 * time)
        return Means(block_average(1.0 + 0.0 * time), block_average(100.0 + wave), block_average(wave**2))

    rows = compared("bed", means(2.0), means(1.0), gusty=True)
    assert [row.verdict for row in rows] == ["holds", "holds", "FAILS"]
    assert rows[2].value == pytest.approx(2.0, rel=1e-9)


@pytest.mark.slow
def test_the_same_particles_in_finer_cells() -> None:
    """Every particle keeps its velocity, whatever its row; a bed that falls into the gas meets a larger pressure."""
    case = gas().case.with_(**{"bed.count": 1300, "column.width": 0.0144, "column.height": 0.0432})
    packed = Simulation(case).particles
    order = np.random.default_rng(1).permutation(1300)
    at_rest = {"position": packed.position[order], "velocity": np.zeros((1300, 3))}
    falling = at_rest | {"velocity": np.stack([order * 0.0, order * 0.0, -10.0 * at_rest["position"][:, 2]], axis=1)}
    finer = placed(case, falling, 1.5)
    assert finer.fluid is not None and finer.fluid.grid.cells == (6, 1, 18)
    assert np.array_equal(finer.particles.velocity[:, 2], -10.0 * finer.particles.position[:, 2])
    run = SimpleNamespace(times=np.array([0.0, 1.0]), particles=lambda snapshot: (at_rest, falling)[snapshot])
    drops = [instantaneous_drops(case, run, -1.0, factor) for factor in (1.0, 1.5)]  # type: ignore[arg-type]
    assert drops[1] == pytest.approx(drops[0], rel=0.05)
    assert drops[0][1] > 1.1 * drops[0][0]


def test_bubbles_that_do_not_grow_fail() -> None:
    """Larger from slab to slab holds; one that is as large as those below does not; slabs without any do not count."""
    number, error = np.array([1.0, 0.5, 0.2, 0.0]), np.full(4, 1e-4)
    larger, same = np.array([0.01, 0.02, 0.03, np.nan]), np.array([0.01, 0.02, 0.02, np.nan])
    assert growing(BubbleProfile(number, larger, error))[-1].verdict == "holds"
    assert growing(BubbleProfile(number, same, error))[-1].verdict == "FAILS"
    # a bed without bubbles shows nothing
    assert growing(BubbleProfile(np.zeros(4), np.full(4, np.nan), error))[-1].verdict == "FAILS"


def test_frequencies_of_a_flat_bed_are_compared_within_their_errors() -> None:
    """The digitised record holds six periods of 0.43 s: 2.5 Hz cannot be told from it, 4 Hz can."""
    time = np.arange(0.0, 10.0, 0.02)
    near, far = (frequency("pressure", 0.02, np.sin(2.0 * math.pi * hertz * time)) for hertz in (2.5, 4.0))
    assert near.reference == pytest.approx(2.31, abs=0.01) and near.value == pytest.approx(2.5, rel=0.01)
    assert (near.verdict, far.verdict) == ("holds", "FAILS")
    assert "6, error 0.16" in near.note
