"""Beds of several species: amounts, sizes, initial arrangement, drag, and checks of their input."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_case import MIXTURE

from cfddem import open_run
from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.particle_properties import particle_properties
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import estimate_bed, net_downward_forces
from cfddem.preflight.summary import preflight
from cfddem.run.build import parts_of
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation
from closures.drag_resolved import beetstra, beetstra_polydisperse


def mixture(**given: Any) -> Case:
    return Case.from_text(MIXTURE, "bed.toml", {name.replace("__", "."): value for name, value in given.items()})


def test_a_mixture_written_and_read_again_is_equal() -> None:
    case = mixture()
    assert Case.from_text(case.to_toml()) == case
    coarser = case.with_(**{"bed.species.beads.diameter": 1.5e-3})
    assert coarser.bed.species["beads"].diameter == 1.5e-3 and coarser.bed.diameter > case.bed.diameter
    assert Case.from_text(coarser.to_toml()) == coarser


def test_the_diameter_of_a_mixture_is_its_sauter_mean() -> None:
    case = mixture(bed__species__pellets__spread=0.0)
    volume = 200 * 1e-3**3 + 40 * 2e-3**3
    assert case.bed.diameter == pytest.approx(volume / (200 * 1e-3**2 + 40 * 2e-3**2), rel=1e-12)
    assert case.particle_count == 240
    assert case.solid_density == pytest.approx((200 * 1e-9 * 2500.0 + 40 * 8e-9 * 1500.0) / volume, rel=1e-12)


def test_fractions_are_of_the_volume_of_a_poured_bed() -> None:
    case = Case.from_text(MIXTURE.replace("count = 200", "fraction = 0.25").replace("count = 40", "fraction = 0.75"),
                          "bed.toml", {"bed.height": 0.012})  # fmt: skip
    grains = particle_properties(case)
    volumes = np.bincount(grains.species, math.pi / 6.0 * grains.diameter**3)
    assert volumes.sum() == pytest.approx(0.58 * 0.012**3, rel=0.03)
    assert volumes / volumes.sum() == pytest.approx([0.25, 0.75], abs=0.01)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bed.count": 7}, "--set bed.count = 7: must be left out where species are given"),
        ({"bed.diameter": 1e-3}, "--set bed.diameter = 0.001: must be left out where species are given"),
        ({"bed.material": "glass"}, "bed.material = 'glass': must be left out where species are given"),
        ({"bed.species.beads.material": "glas"}, "bed.species.beads.material = 'glas': must be one of glass, plastic"),
        ({"bed.species.beads.fraction": 0.5}, "bed.species.beads.fraction = 0.5: must be left out where bed.height"),
        ({"bed.species.beads.cuont": 3}, "bed.species.beads.cuont = 3: must be one of"),
        ({"bed.species.beads.diameter": -1.0}, "bed.species.beads.diameter = -1.0: must be above 0"),
        ({"bed.height": 0.01}, "bed.toml:27: bed.species.beads.fraction: must be given"),
        (
            {"bed.species.sand/gravel": {"diameter": 1e-3, "count": 3, "material": "glass"}},
            "bed.species.sand/gravel = 'sand/gravel': must be made of letters, digits, _ and -",
        ),
        ({"bed.arrangement": "layerd"}, "did you mean 'layers'"),
        (
            {"bed.species.beads.sizes": [[1e-3, 1.0]]},
            "bed.species.beads.diameter = 0.001: must be left out where sizes",
        ),
    ],
    ids=str,
)
def test_an_input_error_in_a_species_names_key_and_limit(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refusal:
        Case.from_text(MIXTURE, "bed.toml", given)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_species_without_diameter_is_reported_with_its_line() -> None:
    text = MIXTURE.replace("diameter = 1e-3\n", "")
    line = 1 + text.split("\n").index("[bed.species.beads]")
    with pytest.raises(InputError, match=rf"bed.toml:{line}: bed.species.beads.diameter: must be given"):
        Case.from_text(text, "bed.toml")


def test_sizes_from_a_table_have_the_given_volume_shares() -> None:
    sizes = [[1e-3, 0.2], [1.5e-3, 0.5], [2e-3, 0.3]]
    case = Case.from_text(
        MIXTURE.replace("diameter = 1e-3", f"sizes = {sizes}").replace("count = 200", "count = 20000")
    )
    beads = particle_properties(case).diameter[:20_000]
    volumes = np.array([(beads[beads == d] ** 3).sum() for d, _ in sizes])
    assert volumes / volumes.sum() == pytest.approx([share for _, share in sizes], abs=0.015)
    sauter = 1.0 / sum(share / d for d, share in sizes)
    assert case.bed.species["beads"].diameter == pytest.approx(sauter, rel=1e-12)
    assert (beads**3).mean() * math.pi / 6.0 == pytest.approx(case.bed.species["beads"].mean_volume, rel=0.02)


@pytest.mark.parametrize("distribution", ["normal", "log_normal"])
def test_the_spread_is_the_standard_deviation_over_the_mean(distribution: str) -> None:
    """Tails beyond three standard deviations are cut off, which lowers the spread by 1.5 %."""
    given = {"count": 100_000, "spread": 0.2, "distribution": distribution}
    case = mixture(**{f"bed__species__beads__{name}": value for name, value in given.items()})
    beads = particle_properties(case).diameter[:100_000]
    assert beads.mean() == pytest.approx(1e-3, rel=2e-3)
    assert beads.std() / beads.mean() == pytest.approx(0.2, rel=0.03)
    assert math.pi / 6.0 * (beads**3).mean() == pytest.approx(case.bed.species["beads"].mean_volume, rel=0.01)
    assert (beads**3).mean() / (beads**2).mean() == pytest.approx(case.bed.species["beads"].sauter_diameter, rel=0.01)


def test_net_forces_on_the_species_cancel_at_the_voidage_in_balance() -> None:
    case = mixture()
    known = estimate_bed(case)
    assert 0.42 < known.voidage < 1.0
    forces = net_downward_forces(case, known.inlet, known.voidage)
    excess = {name: abs(case.material_of(each).density - 1000.0) for name, each in case.species.items()}
    left = [forces[name] * excess[name] * case.volumes[name] for name in forces]
    assert abs(sum(left)) < 1e-6 * sum(map(abs, left))
    assert max(map(abs, forces.values())) > 0.01


def test_a_drag_law_for_equal_spheres_gets_a_warning_in_a_mixture() -> None:
    assert not any(each.key == "laws.drag" for each in preflight(mixture()).issues)
    reported = [each for each in preflight(mixture(laws__drag="beetstra")).issues if each.key == "laws.drag"]
    assert "equal spheres" in reported[0].reason and "beetstra_polydisperse" in reported[0].remedy


def test_a_mixture_of_one_species_equals_a_bed_of_one_kind() -> None:
    """The same particles at the same positions, to the last bit."""
    alone = Case.from_text(
        MIXTURE[: MIXTURE.index("[bed.species.beads]")]
        + 'material = "plastic"\ndiameter = 2e-3\nspread = 0.05\ncount = 40\n'
        + MIXTURE[MIXTURE.index("[laws]") :],
        "bed.toml",
        {"bed.start": "packed"},
    )
    text = MIXTURE.replace('[bed.species.beads]\nmaterial = "glass"\ndiameter = 1e-3\ncount = 200\n', "")
    named = Case.from_text(text, "bed.toml", {"bed.start": "packed"})
    one, other = parts_of(alone).particle_solver.particles, parts_of(named).particle_solver.particles
    for name in one.fields:
        assert np.array_equal(one[name], other[name], equal_nan=True), name
    assert np.array_equal(other.species, np.zeros(40))
    assert buoyant_weight(alone) == buoyant_weight(named)


@pytest.mark.parametrize("start", ["suspended", "poured"])
def test_layers_lie_one_above_the_other_at_the_start(start: str) -> None:
    case = mixture(bed__arrangement="layers", bed__start=start, fluid=None)
    particles = parts_of(case).particle_solver.particles
    species = particle_properties(case).species[particles.id]
    height = [float(np.median(particles.position[species == kind, 2])) for kind in (0, 1)]
    assert height[1] > height[0] + 1.5e-3
    assert np.array_equal(particles.density, np.where(species == 0, 2500.0, 1500.0))
    mixed = parts_of(case.with_(**{"bed.arrangement": "mixed"})).particle_solver.particles
    means = [mixed.position[particle_properties(case).species[mixed.id] == kind, 2].mean() for kind in (0, 1)]
    assert abs(means[1] - means[0]) < 0.25 * mixed.position[:, 2].max()


def test_drag_uses_the_diameter_over_the_local_sauter_mean() -> None:
    """In a homogeneous mixture the local mean equals the overall one, apart from scatter and the sphere itself."""
    case = mixture(
        column__sides="periodic", column__ends="periodic", column__height=0.012, bed__species__pellets__spread=0
    )
    parts = parts_of(case.with_(**{"bed.species.beads.count": 300}))
    particles, coupling = parts.particle_solver.particles, parts.coupling
    assert coupling is not None
    place = coupling.kernel.map_particles(particles.position, particles.radius)
    cells = coupling.flow.deposited(particles, place)
    flow = coupling.flow.sample(particles, place, cells, cells.solid)
    ratio = flow.diameter_ratio
    sauter = (particles.radius**3).sum() / (particles.radius**2).sum() * 2.0
    for diameter in (1e-3, 2e-3):
        assert ratio[particles.radius == 0.5 * diameter].mean() == pytest.approx(diameter / sauter, rel=0.1)
    reynolds, voidage = np.full(particles.count, 20.0), np.full(particles.count, 0.7)
    resistance = coupling.forces["drag"].conductance(particles, flow._replace(reynolds=reynolds, voidage=voidage))
    for row in (0, particles.count - 1):
        factor = beetstra_polydisperse(20.0, 0.7, ratio[row])
        stokes = 3.0 * math.pi * 1e-3 * 2.0 * particles.radius[row]
        assert resistance[row] == pytest.approx(stokes * 0.7 * factor, rel=1e-12)
        assert not math.isclose(factor, beetstra(20.0, 0.7), rel_tol=0.05)


def test_spheres_of_one_size_see_their_own_diameter_while_they_move() -> None:
    """Both sums of the Sauter mean are of the same positions, though the voidage is the mean over the fluid step."""
    run = Simulation(mixture(bed__species__pellets__diameter=1e-3, bed__species__pellets__spread=0.0))
    run.step()
    run.particles.velocity[:, 2] = 0.2
    terms = run.coupling.prepare(run.particles, 1e-3)
    assert np.abs(1.0 - run.fluid.voidage - terms.solid).max() > 1e-3  # they have moved
    assert run.coupling.flow.sizes
    assert np.abs(terms.flow.diameter_ratio - 1.0).max() < 1e-12


def test_a_run_records_species_and_resumes_to_the_same_bits(tmp_path: Path) -> None:
    case = mixture()
    Run.begin(case, tmp_path / "whole").go()
    Run.begin(
        case.with_(**{"run.until": 0.004, "run.every": 0.004, "run.history_every": 0.002}), tmp_path / "parts"
    ).go()
    Run.resume(tmp_path / "parts", until=0.012).go()
    whole, parts = open_run(tmp_path / "whole"), open_run(tmp_path / "parts")
    last, other = whole.particles(), parts.particles()
    assert all(np.array_equal(last[name], other[name]) for name in last)
    assert np.array_equal(last["species"], np.repeat([0, 1], [200, 40]))
    volume, height = last["radius"].astype(float) ** 3, last["position"][:, 2].astype(float)
    for kind, name in enumerate(("beads", "pellets")):
        mine = last["species"] == kind
        mean = (volume[mine] * height[mine]).sum() / volume[mine].sum()
        assert whole.history[f"mean_height_{name}"][-1] == pytest.approx(mean, rel=1e-5)
        assert whole.unit(f"mean_height_{name}") == "m"
    assert "mean_height_pellets" in report(tmp_path / "whole").measures
