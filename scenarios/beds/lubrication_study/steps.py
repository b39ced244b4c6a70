"""Whether the bed of the lubrication study depends on its time steps.

The same beds are run from the same seeds with a tenth of the fluid step, a third of the particle step, and
a tenth of both. A fluid step has at most 50 particle steps: the particle step is cut to a third at a third of the fluid
step, with which the run of the whole particle step is made, too, so that one step is changed at a time. Runs are kept
as folders: interrupted runs are continued, and finished runs are not repeated.
"""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.io.reading import open_run
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.step_estimate import estimate_steps
from scenarios.beds.lubrication_study.study import SEEDS, Outcome, Setting, bed, change, mean, outcome
from scenarios.validation.kept_runs import finished, taken
from scenarios.validation.table import Progress, Row

SMOOTH = Setting("smooth", 3.5e-3, 1.0e5)
STIFFER = Setting("smooth", 3.5e-3, 4.0e5)
BARE = Setting("no film", 3.5e-3, 1.0e5)


class Steps(NamedTuple):
    """Divisors of the default steps."""

    particle: int
    fluid: int


class Comparison(NamedTuple):
    """A bed with longer steps against the same bed with shorter ones."""

    words: str
    setting: Setting
    longer: Steps
    shorter: Steps
    limits: dict[str, float]  # largest relative difference of a measure of an outcome
    errors: float = 2.0  # standard errors of the paired difference, where they are larger than the limit


LAG = {"collisions": 0.05, "granular_temperature": 0.08}
CROWD = {"collisions": 0.04, "stokes": 0.04, "granular_temperature": 0.04}
BED = {"collisions": 0.05, "stokes": 0.05, "solids_meet": 0.05}
COMPARISONS = (
    Comparison("fluid step over a tenth of it", SMOOTH, Steps(1, 1), Steps(1, 10), LAG),
    Comparison("fluid step over a tenth of it", BARE, Steps(1, 1), Steps(1, 10), LAG),
    Comparison("particle step over a third of it", SMOOTH, Steps(1, 3), Steps(3, 3), CROWD),
    Comparison("particle step over a third of it", STIFFER, Steps(1, 3), Steps(3, 3), CROWD),
    Comparison("both steps over a tenth of them", SMOOTH, Steps(1, 1), Steps(10, 10), BED, 0.0),
)

NAMES = {
    "collisions": "collisions of a sphere",
    "stokes": "median Stokes number",
    "solids_meet": "share of collisions in which solids meet",
    "granular_temperature": "granular temperature",
}


def study(folder: Path, progress: Progress, hours: float = math.inf) -> list[Row]:
    """Run the missing beds, each on one thread, and return the table of those there are.

    Several processes may share the folder. From then on, this process runs on one thread.

    hours  after which no further run begins
    """
    use_threads(1)
    home, end = folder / "runs", monotonic() + 3600.0 * hours
    for comparison, seed in itertools.product(COMPARISONS, SEEDS):
        for steps in (comparison.longer, comparison.shorter):
            if monotonic() <= end:
                run(home, comparison.setting, steps, seed, progress)
    return table(home)


def run(home: Path, setting: Setting, steps: Steps, seed: int, progress: Progress) -> None:
    """Run one bed unless it is finished or another process runs it."""
    case, name = bed(setting, seed), name_of(setting, steps, seed)
    usual = estimate_steps(case, estimate_bed(case))
    changes = {"run.particle_step": usual.particle / steps.particle, "run.fluid_step": usual.fluid / steps.fluid}
    with taken(home, name) as mine:
        if mine:
            finished(case, home, name, progress, changes)


def name_of(setting: Setting, steps: Steps, seed: int) -> str:
    """Folder of a run."""
    return f"{setting.name}-{steps.particle}-{steps.fluid}-seed{seed}"


def table(home: Path) -> list[Row]:
    """The rows of the comparisons, each of those seeds that are finished with both steps."""
    rows = []
    for comparison in COMPARISONS:
        sides = [
            (_outcome(home, comparison.setting, comparison.longer, seed),
             _outcome(home, comparison.setting, comparison.shorter, seed))
            for seed in SEEDS
        ]  # fmt: skip
        pairs = [(longer, shorter) for longer, shorter in sides if longer and shorter]
        if pairs:
            rows += [_row(comparison, measure, limit, pairs) for measure, limit in comparison.limits.items()]
    return rows


def _row(comparison: Comparison, measure: str, limit: float, pairs: list[tuple[Outcome, Outcome]]) -> Row:
    """Ratio of the means; the limit is no less than some standard errors of the difference seed by seed."""
    longer, shorter = zip(*pairs)
    changed = change(longer, shorter, measure)
    values = (mean(side, measure).value for side in (longer, shorter))
    return Row(
        f"{comparison.setting.spheres}, {comparison.setting.modulus:.0e} Pa: {NAMES[measure]}, {comparison.words}",
        1.0 + float(changed.value), 1.0, float(np.fmax(limit, comparison.errors * changed.error)),
        note="{:.4g} and {:.4g} in SI units; standard error of the paired difference ".format(*values)
        + f"{changed.error:.2g} over {changed.seeds} seeds",
    )  # fmt: skip


def _outcome(home: Path, setting: Setting, steps: Steps, seed: int) -> Outcome | None:
    folder = home / name_of(setting, steps, seed)
    if not (folder / "run.json").exists() or (run := open_run(folder)).status != "finished":
        return None
    return outcome(run, bed(setting, seed))
