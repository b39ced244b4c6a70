"""The trials: what is tried, and what counts as a clear answer."""

from __future__ import annotations

import contextlib
import io
import json
import random
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from fuzz.mutations import mutate_folder, mutated_case, mutated_table, mutated_words
from fuzz.plausible import plausible_words

CODES = (0, 1, 2, 3, 130, 143)
"""Documented exit codes."""

LONGEST_LINE = 600
KINDS = {"case": 0.62, "words": 0.12, "data": 0.16, "folder": 0.1}
"""Share of each kind of trial."""

PLAUSIBLE = 2 * 10**9
"""Trials with numbers from this one on are command lines with mostly valid options."""

COMPUTING = ("calibrate", "collide", "film-impact", "three-spheres", "wet-pair", "wet-wall")
"""Commands that may compute for longer than a trial."""

REBOUNDS = "stokes [-], restitution [-], error [-]\n20, 0.1, 0.02\n100, 0.7, 0.02\n400, 0.85, 0.02\n"

TABLES = [
    "time [s], bed height [mm], error [mm]\n0.0, 40.1, 0.4\n0.5, 41.2, 0.4\n1.0, 40.7, 0.5\n",
    "# a comment\nheight [mm], voidage [-]\n5, 0.45\n15, 0.52\n25, 0.61\n",
    "pressure drop [Pa]\n130\n131\n129\n",
    "velocity [mm/s], bed height [mm], bed height error [mm]\n30, 39.5, 0.3\n50, 40.1, 0.3\n",
]

COMMANDS = """
check bed.toml
check bed.toml --json --set seed=3
check bed.toml --strict
check liquid-bed --set inlet_velocity=0.04 --set start=suspended
stability liquid-bed --set agitation=free_spheres
stability bed.toml --json
new
new liquid-bed -o other.toml
explain
explain di_felice
explain hertz --json
report bed
report bed --json
report bed --data points.csv --json
compare bed bed --json
view bed --history
view bed --snapshot 0 --show voidage
export bed --to csv -o out
resume bed --until 3.0
sweep bed.toml --over seed=1..3 --set until=0.01 -o out
calibrate bed.toml --match points.csv --vary fluid.viscosity=5e-4..2e-3 -o out
run bed.toml -o out --set until=0.01 --threads 1
collide --stokes 30 --velocity 0.1 --material delrin
wet-wall --velocity 0.6 --film 2e-4
wet-pair --stokes 1.2 --angle 60
validate wrong
bench wrong
"""


class Started(BaseException):
    """A command that was accepted and would now compute for long."""


class TooSlow(BaseException):
    """A trial that took longer than its limit."""


class Surroundings:
    """What trials share: valid inputs, names of keys and options, a run folder to be damaged.

    home      folder for the trials
    compiles  whether commands compile loops; otherwise they end there
    """

    def __init__(self, home: Path, compiles: bool = True) -> None:
        from disturbed_runs import WET
        from example_case import MIXTURE, TEXT
        from made_up_run import BED, made_up
        from test_case_walls import HOPPER

        from cfddem.case.gallery import gallery_files
        from cfddem.case.schema import Case
        from cfddem.io import checkpoint
        from cfddem.io.reading import open_run

        self.home, self.compiles = home, compiles
        self.texts = [TEXT, MIXTURE, HOPPER, WET, BED, *(path.read_text() for path in gallery_files().values())]
        tables = {name: part["properties"] for name, part in Case.model_json_schema()["$defs"].items()}
        self.keys = sorted({name for properties in tables.values() for name in properties})
        self.case_keys = sorted({f"{table}.{key}" for text in self.texts for table, key in _keys(text)})
        self.lines = [line.split() for line in COMMANDS.strip().splitlines()]
        self.options = sorted({word for line in self.lines for word in line if word.startswith("-")})
        self.options += ["--help", "--version", "--ranks", "--jobs", "--colour", "--plot", "--write-jobs", "--port"]
        self.run_folder = home / "run"
        if not self.run_folder.exists():
            made_up(self.run_folder, BED, rows=41)
            checkpoint.write(self.run_folder, {"time": 2.0, "overrides": {}, "simulation": {"steps": 3}})
        self.run = open_run(self.run_folder)


def _keys(text: str) -> Any:
    """Table and name of the keys of a case file."""
    for table, keys in tomllib.loads(text).items():
        if isinstance(keys, dict):
            yield from ((table, key) for key in keys)


def chance_of(seed: int, number: int) -> random.Random:
    """Random numbers of a trial."""
    return random.Random(f"{seed} {number}")


def kind_of(chance: random.Random, number: int) -> str:
    """The kind of a trial."""
    return "plausible" if number >= PLAUSIBLE else chance.choices(list(KINDS), list(KINDS.values()))[0]


def perform(around: Surroundings, seed: int, number: int) -> str:
    """Make one trial in an empty folder; returns `accepted` or `refused`.

    errors  AssertionError for an answer that is not clear, or whatever the program raises
    """
    chance = chance_of(seed, number)
    kind = kind_of(chance, number)
    with tempfile.TemporaryDirectory(dir=around.home) as folder, contextlib.chdir(folder):
        return TRIALS[kind](around, chance)


def described(around: Surroundings, seed: int, number: int) -> str:
    """What a trial tries."""
    chance = chance_of(seed, number)
    kind = kind_of(chance, number)
    if kind == "case":
        return f"case\n{mutated_case(chance, around.texts, around.keys).decode(errors='replace')[:6000]}"
    if kind == "data":
        return f"data\n{mutated_table(chance, TABLES).decode(errors='replace')[:2000]}"
    if kind == "plausible":
        return f"plausible {plausible_words(chance)}"
    if kind == "words":
        return f"words {mutated_words(chance, around.lines, around.options, around.case_keys)}"
    with tempfile.TemporaryDirectory(dir=around.home) as folder:
        shutil.copytree(around.run_folder, Path(folder) / "bed")
        return f"folder {mutate_folder(chance, Path(folder) / 'bed')}"


# ---------------------------------------------------------------- kinds


def case_trial(around: Surroundings, chance: random.Random) -> str:
    """A mutated case file is read and checked."""
    from cfddem.case.schema import Case
    from cfddem.preflight.summary import preflight

    Path("bed.toml").write_bytes(mutated_case(chance, around.texts, around.keys))

    def check() -> None:
        made = preflight(Case.from_toml(Path("bed.toml")))
        assert made.status in ("ok", "warning", "error")
        assert max(map(len, made.lines())) <= 100, "a line of the check is wider than 100 characters"

    answer = refused_or_accepted(check)
    assert [each.name for each in Path().iterdir()] == ["bed.toml"], "reading and checking must write nothing"
    return answer


def data_trial(around: Surroundings, chance: random.Random) -> str:
    """Mutated measured data are read and put beside a run."""
    from cfddem.analysis.measured import compared_at
    from cfddem.analysis.report import case_of
    from cfddem.case.compare import CaseData, points_of

    Path("points.csv").write_bytes(mutated_table(chance, TABLES))
    column = chance.choice([None, None, None, "voidage", "bed height", "eror"])

    def score() -> None:
        points = points_of("points", CaseData(file="points.csv", column=column, relative_error=0.1))
        compared_at(around.run, case_of(around.run), points, 1.0).score()

    return refused_or_accepted(score)


def folder_trial(around: Surroundings, chance: random.Random) -> str:
    """A damaged run folder is read, reported, exported and prepared for a restart."""
    from cfddem.analysis.report import report
    from cfddem.analysis.report_text import lines
    from cfddem.io import checkpoint
    from cfddem.io.export import export
    from cfddem.io.reading import open_run
    from cfddem.io.writer import RunFolder
    from cfddem.run.resuming import case_to_continue

    folder = Path("bed")
    shutil.copytree(around.run_folder, folder)
    mutate_folder(chance, folder)

    def read() -> None:
        run = open_run(folder)
        assert repr(run).startswith("RunData(")
        for name in run.fluid_fields:
            run.fluid(name, 0)
        run.particles(-1), run.history, run.collisions, run.times

    def resume() -> None:
        case_to_continue(folder, checkpoint.newest(folder), None)
        RunFolder.reopen(folder)

    steps: list[Callable[[], Any]] = [
        read, lambda: lines(report(folder)), lambda: export(folder, "csv", Path("out")), resume,
    ]  # fmt: skip
    answers = {refused_or_accepted(step) for step in chance.sample(steps, 2)}
    return "refused" if "refused" in answers else "accepted"


def words_trial(around: Surroundings, chance: random.Random) -> str:
    """A mutated command line, in this process; commands that would compute for long are stopped when they begin."""
    words = mutated_words(chance, around.lines, around.options, around.case_keys)
    Path("bed.toml").write_text(around.texts[0])
    Path("points.csv").write_text(TABLES[0])
    shutil.copytree(around.run_folder, "bed")
    code, out, err = called(words, around.compiles)
    judge_command(code, out, err, max(map(len, words), default=0))
    return "accepted" if code == 0 else "refused"


def plausible_trial(around: Surroundings, chance: random.Random) -> str:
    """A command line with mostly valid options, in this process."""
    words = plausible_words(chance)
    Path("bed.toml").write_text(around.texts[0])
    Path("points.csv").write_text(TABLES[0])
    Path("rebounds.csv").write_text(REBOUNDS)
    shutil.copytree(around.run_folder, "bed")
    try:
        code, out, err = called(words, around.compiles)
    except TooSlow:
        if words[0] in COMPUTING:  # it compiles loops, or computes what it was asked for
            return "accepted"
        raise
    judge_command(code, out, err, max(map(len, words), default=0))
    if "--json" in words and out.strip() and not {"--help", "--version", "--schema"} & set(words):
        assert json.loads(out)["schema"].startswith("cfddem/"), "no object with a schema"
    return "accepted" if code == 0 else "refused"


TRIALS: dict[str, Callable[[Surroundings, random.Random], str]] = {
    "case": case_trial, "words": words_trial, "data": data_trial, "folder": folder_trial, "plausible": plausible_trial,
}  # fmt: skip


# ---------------------------------------------------------------- verdicts


def refused_or_accepted(step: Callable[[], Any]) -> str:
    """Whether a step ends, or is refused in clear lines."""
    from cfddem.backend.errors import CfddemError
    from cfddem.case.input_errors import MOST

    try:
        step()
    except CfddemError as refusal:
        said = str(refusal).splitlines()
        assert 1 <= len(said) <= MOST + 3, f"{len(said)} lines"
        assert all(said) and max(map(len, said)) <= LONGEST_LINE, "an empty or long line"
        assert refusal.exit_code in CODES[1:], f"exit code {refusal.exit_code}"
        return "refused"
    return "accepted"


def called(words: list[str], compiles: bool = True) -> tuple[int, str, str]:
    """Exit code and output of a command in this process."""
    from cfddem.cli.app import main

    out, err, code = io.StringIO(), io.StringIO(), 0
    stop = mock.Mock(side_effect=Started)
    patches = {
        "cfddem.run.runner.Simulation": stop, "cfddem.studies.sweep.on_this_machine": stop, "os.execv": stop,
        "cfddem.plotting.browser.browse": stop, "cfddem.cli.validation.run": stop,
        "cfddem.cli.validation.measure": stop,
        "cfddem.plotting.scene.window": stop, "scenarios.benchmarks.fluid_box.bench": stop,
        "scenarios.beds.wet_bed.study.bench": stop, "scenarios.benchmarks.scaling.bench": stop,
        "scenarios.benchmarks.table.bench": stop, "cfddem.cli.information.subprocess.run": stop,
        "scenarios.benchmarks.dense_bed.bench": stop, "scenarios.beds.gas_bed.study.bench": stop,
        "sys.argv": ["cfddem", *words],
    }  # fmt: skip
    if not compiles:
        compilation = "cfddem.backend.compile._Compilation"
        patches |= {f"{compilation}.on_start": stop, f"{compilation}.on_end": mock.Mock()}
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        for name, substitute in patches.items():
            stack.enter_context(mock.patch(name, substitute))
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        except Started:
            pass
    return code, out.getvalue(), err.getvalue()


def judge_command(code: int, out: str, err: str, longest_word: int = 0) -> None:
    """A documented exit code; a refusal says why in lines that name the program; no traceback.

    longest_word  of the command [characters]; a message may repeat it
    """
    assert code in CODES, f"exit code {code}\n{err[-2000:]}"
    assert "Traceback" not in out + err, err[-3000:]
    said = [line for line in err.splitlines() if line.strip()]
    strange = [
        line for line in said if re.search(r"Warning: |Error: |Exception", line) and not line.startswith("cfddem: ")
    ]
    assert not strange, "\n".join(strange[:5])
    if code in (2, 3):
        named = any(line.startswith("cfddem: ") for line in said)
        assert named or '"status": "error"' in out or "error" in out, err[-500:] or "silent"
        assert len(said) <= 40 and max(map(len, said), default=0) <= 2 * (LONGEST_LINE + longest_word), (
            "too much is said"
        )


def as_command(around: Surroundings, seed: int, number: int, folder: Path) -> list[str]:
    """The words of a trial as a real command, whose files are written to a folder."""
    chance = chance_of(seed, number)
    kind = kind_of(chance, number)
    if kind == "case":
        (folder / "bed.toml").write_bytes(mutated_case(chance, around.texts, around.keys))
        return ["check", "bed.toml"]
    shutil.copytree(around.run_folder, folder / "bed")
    (folder / "bed.toml").write_text(around.texts[0])
    if kind == "data":
        (folder / "points.csv").write_bytes(mutated_table(chance, TABLES))
        return ["report", "bed", "--data", "points.csv", "--json"]
    if kind == "folder":
        mutate_folder(chance, folder / "bed")
        return chance.choice(
            [["report", "bed"], ["view", "bed", "--history"], ["export", "bed", "--to", "csv"], ["resume", "bed"]]
        )
    (folder / "points.csv").write_text(TABLES[0])
    words = mutated_words(chance, around.lines, around.options, around.case_keys)
    computes = {"run", "sweep", "calibrate", "validate", "bench", "--web", "--window", "--ranks"}
    return ["check", *words[1:]] if computes & set(words) else words
