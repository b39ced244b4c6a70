"""A measure that a user declares: one function, and it appears in the history, the report, the sweep and the export.

The how-to page docs/how-to/measure.md shows the same code.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from disturbed_runs import TINY
from in_process_ranks import on_ranks

from cfddem import measure, open_run
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.plotting.report_page import page
from cfddem.run import history
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

SHORT = TINY.replace("until = 0.024", "until = 0.008")


@pytest.fixture(autouse=True)
def only_built_in_measures() -> Iterator[None]:
    """Measures of a test do not appear in the runs of other tests."""
    known = dict(history.MEASURES)
    yield
    history.MEASURES.clear()
    history.MEASURES.update(known)


def mean_speed(simulation: Simulation) -> float:
    """Mean speed of the particles."""
    return float(np.linalg.norm(simulation.particles.velocity, axis=1).mean())


@pytest.mark.usefixtures("no_pictures")
def test_a_declared_function_appears_in_history_report_and_page(tmp_path: Path) -> None:
    measure("m/s")(mean_speed)
    run = Run.begin(Case.from_text(SHORT), tmp_path / "run")
    run.go()
    seen = open_run(tmp_path / "run")
    assert seen.history["mean_speed"][-1] == mean_speed(run.simulation) > 0.0
    assert seen.quantity("mean_speed") == ("m/s", "mean speed of the particles", "measure")
    with h5py.File(tmp_path / "run" / "history.h5") as file:
        assert file["mean_speed"].attrs["unit"] == "m/s"
    history.forget("mean_speed")  # the report needs the files only
    result = report(tmp_path / "run")
    window = seen.history["time"] >= result.window[0]
    assert result.measures["mean_speed"].mean == pytest.approx(seen.history["mean_speed"][window].mean())
    assert any(line.startswith("  mean speed") and "m/s" in line for line in lines(result))
    assert "mean speed of the particles" in page(tmp_path / "run", tmp_path / "page.html").read_text()


def test_a_measure_can_be_limited_to_some_cases() -> None:
    measure("m/s", when=lambda case: case.fluid is None)(mean_speed)
    wet = Case.from_text(SHORT)
    dry = wet.with_(**{"fluid": None, "bed.inlet_velocity": 0.0})
    assert "mean_speed" not in history.all_columns(wet)
    assert "mean_speed" in history.all_columns(dry)


def test_a_run_is_resumed_with_the_measures_it_began_with(tmp_path: Path) -> None:
    measure("m/s")(mean_speed)
    Run.begin(Case.from_text(SHORT), tmp_path / "run").go()
    history.forget("mean_speed")
    with pytest.raises(InputError, match=r"measures = \['mean_speed'\]: must be the same .*; resume the run from"):
        Run.resume(tmp_path / "run", until=0.01)
    assert open_run(tmp_path / "run").status == "finished"
    measure("m/s")(mean_speed)
    Run.resume(tmp_path / "run", until=0.01).go()
    assert len(open_run(tmp_path / "run").history["mean_speed"]) == 11


def test_a_measure_of_one_process_is_refused_where_ranks_resume_a_run(tmp_path: Path) -> None:
    """By its name, as at the start of a run; the folder stays as it was."""
    measure("m/s")(mean_speed)
    Run.begin(Case.from_text(SHORT), tmp_path / "run").go()
    with pytest.raises(InputError, match="measure = 'mean_speed': must be right on several ranks"):
        on_ranks(2, lambda communicator: Run.resume(tmp_path / "run", until=0.01, communicator=communicator))
    assert open_run(tmp_path / "run").status == "finished"
    Run.resume(tmp_path / "run", until=0.009).go()


def test_the_name_of_a_built_in_measure_is_refused() -> None:
    def bed_height(simulation: Simulation) -> float:
        return 0.0

    with pytest.raises(InputError, match="measure = 'bed_height': must be a new name"):
        measure("m")(bed_height)


def test_a_measure_is_one_number_and_has_a_unit(tmp_path: Path) -> None:
    @measure("m/s")
    def rising(simulation):
        """Velocities, which are many numbers."""
        return simulation.particles.velocity[:, 2]

    with pytest.raises(InputError, match=r"measure rising = \(\d+,\): must be one number"):
        Run.begin(Case.from_text(SHORT), tmp_path / "run").go()
    history.forget("rising")
    measure("m")(lambda simulation: "high")
    with pytest.raises(InputError, match="measure <lambda> = 'high': must be one number; return a float"):
        history.MEASURES["<lambda>"].values(None)
    for wrong in ([[1.0], [1.0, 2.0]], "3.5", "words " * 100):
        measure("m")(lambda simulation, wrong=wrong: wrong)
        with pytest.raises(InputError, match=r"measure <lambda> = .*: must be one number") as failure:
            history.MEASURES["<lambda>"].values(None)
        assert len(str(failure.value)) < 200
    history.forget("<lambda>")
    with pytest.raises(InputError, match="measure = 'unitless': must be declared with its unit"):

        @measure
        def unitless(simulation):
            return 1.0
