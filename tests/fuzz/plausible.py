"""Command lines of all commands with mostly valid options: a valid line, and likely values of more options."""

from __future__ import annotations

import random
import re
import typing
from pathlib import Path
from typing import Any

from fuzz.mutations import ODD_WORDS, harmless

LINES = """
new
new liquid-bed -o other.toml
check bed.toml
check liquid-bed
stability liquid-bed
run bed.toml -o out --set until=0.01
run --from bed --set until=3 -o out
resume bed --until 3.0
sweep bed.toml --over seed=1..3 -o out
sweep bed.toml --vary inlet_velocity=0.04..0.06 --runs 4 -o out
sweep bed.toml --sensitivity morris --vary inlet_velocity=0.04..0.06 --vary laws.drag=wen_yu,ergun --runs 4 -o out
sweep bed.toml --over seed=1..3 --write-jobs -o out
calibrate bed.toml --match points.csv --vary fluid.viscosity=5e-4..2e-3 -o out
calibrate --collide glass --match rebounds.csv --vary restitution=0.7..1 --set velocity=0.1 --trials 2 -o out
report bed
report bed --data points.csv
compare bed bed
view bed --history
view bed --waves
export bed --to csv -o out
collide --stokes 30 --velocity 0.1 --material delrin
collide --stokes 5,50 --velocity 0.1 --against wall --csv out.csv
collide --velocity 0.1 --data rebounds.csv
wet-wall --velocity 0.6 --film 2e-4 --solver equations
three-spheres --stokes 12 --theta12 30 --solver equations
wet-pair --stokes 1.2 --angle 60 --solver equations
film-impact --diameter 5.5e-3 --liquid m5 --film 0.45e-3 --velocity 0.5 --cells 5
validate binary-collision
validate wet-beds --hours 1
bench dem
bench bed --bridges
explain
explain di_felice
explain heat
schema report
doctor --quick
"""
"""Valid lines, at least one for each command."""

NUMBERS = (0.0, 1e-6, 1e-3, 0.01, 0.05, 0.1, 0.3, 0.5, 0.9, 1.0, 2.0, 5.0, 10.0, 45.0, 60.0, 100.0, 1e3, 1e4, 1e6)
RARE_NUMBERS = (-1.0, -0.0, 1e-30, 1e-300, 1e30, 1e300, float("nan"), float("inf"), 5e-324, 89.999999, 90.0, 180.0)
COUNTS = (0, 1, 2, 3, 4, 5, 8, 10, 16, 50)
RARE_COUNTS = (-1, -5, 100, 10**9, 10**30)
FILES = ("points.csv", "rebounds.csv", "bed.toml", "bed", "out", "out.png", "out.gif", "out.html", "out.md", "new.csv")
WORDS = (
    "glass", "delrin", "steel_rough", "water", "wall", "sphere", "full", "frozen", "normal", "film", "overlap", "drift",
    "verlet", "all", "none", "drag", "drag,history", "liquid-bed", "settling", "sobol", "latin", "morris", "speed",
    "species", "spheres", "voidage", "bubbles", "csv", "vtu", "netcdf", "dem", "fluid", "1..10", "5,6", "bed",
    "report", "case", "equations", "particles", "zero", "constant", "davis", "m5", "grid",
)  # fmt: skip
SETTINGS = (
    "bed.count=100", "inlet_velocity=0.06", "until=0.01", "bed.seed=3", "laws.drag=wen_yu", "fluid.viscosity=0.002",
    "start=suspended", "average_from=0", "bed.diameter=1e-3", "laws.agitation=none", "run.every=0.1",
    "wall.0.radius=0.02", "column.cell=0.004", "laws.lubrication=nijssen_full", "material.glass.friction=0.3",
    "run.until_error.bed_height=0.01", "column.sides=periodic", "title=x", "bed.positions=[[0.01,0.01,0.01]]",
    "bed.inlet_velocity=[[0,0.01],[1,0.05]]", "velocity=0.1", "gravity=9.81", "restitution=0.8",
)  # fmt: skip
RANGES = (
    "inlet_velocity=0.03..0.05", "bed.seed=1..3", "fluid.viscosity=1e-3..2e-3 log", "laws.drag=wen_yu,ergun",
    "roughness=1e-7..1e-6 log", "bed.diameter=1e-3,2e-3", "restitution=0.5..1", "bed.count=100..200",
)  # fmt: skip


def plausible_words(chance: random.Random) -> list[str]:
    """A valid line with a few more options of its command, and some of its words replaced."""
    words = chance.choice([line.split() for line in LINES.strip().splitlines()])
    arguments = [each for each in _arguments(words[0]) if each.names[0].startswith("--")]
    for _ in range(chance.choice((0, 1, 1, 2, 3, 5))):
        each = chance.choice(arguments) if arguments else None
        if each is None:
            break
        name = chance.choice(each.names)
        words += [name] if each.hint is bool else [name, likely_value(chance, name, each.hint, each.parameter.help)]
    if chance.random() < 0.15 and len(words) > 1:
        place = chance.randrange(1, len(words))
        if not words[place].startswith("-"):
            words[place] = chance.choice([*FILES, *WORDS, *SETTINGS, *map(str, NUMBERS)])
    return [harmless(word) for word in words]


def _arguments(command: str) -> list[Any]:
    from cfddem.cli.app import app

    return list(app[command].assemble_argument_collection())


def likely_value(chance: random.Random, name: str, hint: Any, text: str | None) -> str:
    """A value that an option may expect; rarely one that it does not."""
    if chance.random() < 0.06:
        return str(chance.choice([*ODD_WORDS, *WORDS]))
    kinds = {
        hint,
        *typing.get_args(hint),
        *(each for inner in typing.get_args(hint) for each in typing.get_args(inner)),
    }
    if name in ("--set", "--over", "--vary"):
        return chance.choice(SETTINGS if name == "--set" else RANGES)
    if Path in kinds:
        return chance.choice(FILES)
    if int in kinds:
        return str(chance.choice(COUNTS if chance.random() < 0.8 else RARE_COUNTS))
    if float in kinds:
        return repr(chance.choice(NUMBERS if chance.random() < 0.85 else RARE_NUMBERS))
    quoted = re.findall(r'"([\w-]+)"', text or "") + re.findall(r"\b([a-z_]{4,}), |\bor ([a-z_]{4,})", text or "")
    listed = [word for each in quoted for word in ([each] if isinstance(each, str) else each) if word]
    return chance.choice(listed if listed and chance.random() < 0.7 else list(WORDS))
