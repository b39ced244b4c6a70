"""`cfddem run --from`: a run that begins where another has ended, with other values of its case."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import call, parsed
from made_up_run import BED, made_up

from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.features.vapour import Vapour
from cfddem.io.reading import open_run
from cfddem.preflight.summary import preflight
from cfddem.run.check import check
from cfddem.run.resuming import branch_state
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation
from cfddem.studies.notebook import run_case
from scenarios.validation.heat.packed import lattice, packed

TINY = ("start=suspended", "bed.count=50", "run.until=0.01", "run.every=0.005", "run.average_from=0")


@pytest.fixture(scope="module")
def bed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bed in water, run to 0.01 s."""
    folder = tmp_path_factory.mktemp("runs") / "bed"
    done = call("run", "liquid-bed", "-o", str(folder), *(word for each in TINY for word in ("--set", each)))
    assert done.code == 0, done.err
    return folder


def test_without_a_change_it_goes_on_as_a_resumed_run(bed: Path, tmp_path: Path) -> None:
    """Bit for bit: contacts, films and flow are kept; the first row and snapshot are the last ones of the first run."""
    shutil.copytree(bed, tmp_path / "resumed")
    assert call("resume", str(tmp_path / "resumed"), "--until", "0.02").code == 0
    done = call("run", "--from", str(bed), "--set", "until=0.02", "-o", str(tmp_path / "branch"), "--json")
    assert parsed(done.out)["window"] == [pytest.approx(0.01), pytest.approx(0.02)]
    first, one, other = (open_run(each) for each in (bed, tmp_path / "resumed", tmp_path / "branch"))
    assert other.history["time"][0] == first.history["time"][-1] == pytest.approx(0.01)
    assert np.array_equal(other.particles(0)["position"], first.particles(-1)["position"])
    for name in ("position", "velocity", "spin"):
        assert np.array_equal(other.particles(-1)[name], one.particles(-1)[name]), name
    assert other.provenance["from"] == {"folder": str(bed), "time": pytest.approx(0.01)}


def test_a_changed_value_acts_and_the_branch_can_be_resumed(bed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "thick"
    changes = (
        "fluid.viscosity=0.003",
        "laws.agitation=free_spheres",
        "bed.inlet_velocity=0.06",
        "material.glass.restitution=0.5",
        "until=0.015",
    )
    done = call("run", "--from", str(bed), "-o", str(folder), *(word for each in changes for word in ("--set", each)))
    assert done.code == 0, done.err
    case = Case.from_toml(folder / "case.toml")
    assert (case.required_fluid.viscosity, case.solid.restitution) == (0.003, 0.5)
    resumed = Run.resume(folder, until=0.016)
    simulation = resumed.simulation
    assert np.unique(simulation.fluid.viscosity).tolist() == [0.003]
    assert np.unique(simulation.particles.viscosity).tolist() == [0.003]
    resumed.go()
    assert open_run(folder).history["time"][-1] == pytest.approx(0.016)


def test_the_flow_through_a_patch_can_change(tmp_path: Path) -> None:
    """It is the inlet velocity of a vessel: what leaves through the lid is what then enters."""
    inlet = ("patch.air.kind=inlet", "patch.air.shape=whole", "patch.air.velocity=0.045", "bed.inlet_velocity=0")
    words = [word for each in (*TINY, *inlet) for word in ("--set", each)]
    assert call("run", "liquid-bed", "-o", str(tmp_path / "bed"), *words).code == 0
    words = [word for each in ("patch.air.velocity=0.06", "until=0.011") for word in ("--set", each)]
    done = call("run", "--from", str(tmp_path / "bed"), "-o", str(tmp_path / "faster"), *words)
    assert done.code == 0, done.err
    run = open_run(tmp_path / "faster")
    leaving = (run.fluid("voidage") * run.fluid("velocity")[..., 2])[-1].mean()
    assert leaving == pytest.approx(0.06, rel=0.01)  # at the centres of cells


def test_a_jet_and_what_inlets_bring_can_change(tmp_path: Path) -> None:
    """Temperatures and vapour of what flows in, or back, are those of the new case."""
    more = {"fluid_fraction": 0.0, "diffusivity": 2.5e-5}
    case = packed(
        bed__positions=lattice(4e-3, (2, 2, 2)), bed__jet={"velocity": 1.0, "width": 5e-3},
        column__width=0.012, run__until=0.002, vapour=more,
    )  # fmt: skip
    Run.begin(case, tmp_path / "bed").go()
    changes = {
        "bed.jet.velocity": 2.0, "heat.inlet_temperature": 350.0, "heat.outlet_temperature": 320.0,
        "vapour.inlet_fraction": 0.01, "vapour.outlet_fraction": 0.02, "run.until": 0.004,
    }  # fmt: skip
    branch = Run.begin(case.with_(**changes), tmp_path / "other", origin=tmp_path / "bed")
    simulation = branch.simulation
    branch.go()
    assert simulation.fluid.whole("velocity")[0, ..., 2].max() > 1.2
    heat, vapour = simulation.feature(HeatExchange).cells, simulation.feature(Vapour).cells
    assert heat is not None and heat.value.max() > 310.0
    assert 1e-4 < vapour.value.max() < 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("bed.count=60", ["bed.count", "left as it is", "bed.inlet_velocity"]),
        ("material.glass.density=3000", ["material.glass.density", "left as it is", "friction"]),
        ("column.height=0.2", ["column.height", "from its beginning"]),
        ("fluid.viscosity=0.003", ["laws.agitation = 'none'", "--set laws.agitation=free_spheres"]),
        ("until=0.01", ["run.until = 0.01", "above 0.01", "time goes on"]),
    ],
)
def test_what_a_run_cannot_change_is_refused(bed: Path, tmp_path: Path, change: str, said: list[str]) -> None:
    folder = tmp_path / "other"
    until = () if "until" in change else ("--set", "until=0.02")
    done = call("run", "--from", str(bed), *until, "--set", change, "-o", str(folder))
    assert (done.code, done.out) == (2, "") and all(word in done.err for word in said), done.err
    assert not folder.exists()


def test_a_refusal_names_no_law_that_cannot_change(bed: Path, tmp_path: Path) -> None:
    """A name in the place of auto is no change, and an offer to change it would be refused next."""
    words = ("run", "--from", str(bed), "--set", "until=0.011", "-o", str(tmp_path / "other"), "--set")
    refused = call(*words, "laws.rolling_damping=0.5")
    assert refused.code == 2 and "laws.drag" in refused.err
    for key in ("laws.agitation", "laws.surface"):
        assert key not in refused.err
    changed = call(*words, "laws.surface=smeared")
    assert changed.code == 2 and "--set laws.surface=sharp" in changed.err
    named = call(*words, "laws.surface=sharp", "--set", "laws.agitation=free_spheres")
    assert named.code == 0, named.err


def test_a_case_beside_from_and_a_folder_without_a_run_are_refused(bed: Path, tmp_path: Path) -> None:
    assert "left out: the case is that of" in call("run", "liquid-bed", "--from", str(bed)).err
    assert call("run", "--from", str(tmp_path), "--set", "until=1").code == 2
    with pytest.raises(InputError, match="must be a run folder; it does not exist"):
        branch_state(Case.from_toml(bed / "case.toml"), tmp_path / "nowhere")


def test_what_is_no_case_is_named() -> None:
    for wrong in ("bed.toml", {"bed": {}}):
        for use in (
            check, preflight, Simulation,
            lambda case: Run.begin(case, Path("unwritten")), lambda case: run_case(case, Path("unwritten")),
        ):  # fmt: skip
            with pytest.raises(InputError, match=r"must be a Case; Case.from_toml\(path\) reads a file"):
                use(wrong)


def test_the_state_is_that_of_the_checkpoint_but_for_the_step(bed: Path) -> None:
    case = Case.from_toml(bed / "case.toml", {"run.until": 1.0})
    state = branch_state(case, bed)
    assert state["time"] == pytest.approx(0.01) and state["simulation"]["particle_step"] is None


def test_particles_that_the_first_run_has_fed_are_not_lost(tmp_path: Path) -> None:
    """The counters of feeds and outlets go on, and count from where the branch begins."""
    feed = "[[feed]]\ncorner = [0.0, 0.0, 0.04]\nsize = [0.02, 0.02, 0.02]\nrate = 10.0\n[run]"
    fed = {"fed_count": 60.0, "waiting_count": 0.0}
    run = made_up(tmp_path / "run", BED.replace("[run]", feed), **fed)
    found = report(run)
    assert found.ledger["particles_lost"] == 0.0
    assert "2000 at the start; 0 fed" in str(found)
