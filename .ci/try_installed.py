"""Tries an installed package from an empty folder: every command, every case of the gallery, data files, a collision.

Every case is copied, checked, and run for a few steps with a fifth of its particles. It imports nothing of the
repository. It ends with exit code 1 and says what is missing or fails.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

PROGRAM = Path(sys.executable).parent / "cfddem"
NEEDED = (
    "cfddem/plotting/report.html", "cfddem/plotting/page.css", "cfddem/plotting/comparison.html",
    "scenarios/data/ghia1982_cavity.csv", "scenarios/data/gas_bed_24750.npz", "scenarios/beds/liquid_bed/README.md",
)  # fmt: skip
"""Files that are not Python, some of each kind."""


def call(*words: str) -> str:
    """Output of a command."""
    done = subprocess.run([str(PROGRAM), *words], capture_output=True, text=True, timeout=1800)
    if done.returncode:
        raise SystemExit(f"cfddem {' '.join(words)}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def few_steps(case: Path) -> list[str]:
    """Options for a short run of a case with a fifth of its particles."""
    values = tomllib.loads(case.read_text(encoding="utf-8"))
    end, bed = values["run"]["until"], values["bed"]
    settings = {"until": 2e-3 * end, "every": 1e-3 * end, "history_every": 5e-4 * end, "average_from": 1e-3 * end}
    given = {f"run.{key}": value for key, value in settings.items()}
    if "count" in bed and bed["count"] > 1:
        given["bed.count"] = bed["count"] // 5
    elif "height" in bed:
        given["bed.height"] = bed["height"] / 5
    return [word for key, value in given.items() for word in ("--set", f"{key}={value}")]


def main() -> None:
    """Try everything."""
    import cfddem
    from cfddem.cli.app import app

    assert "site-packages" in str(cfddem.__file__), f"{cfddem.__file__} is not the installed package"
    assert cfddem.__version__ == version("cfddem") == call("--version").strip(), "versions differ"
    for name in NEEDED:
        package, _, rest = name.partition("/")
        assert files(package).joinpath(rest).is_file(), f"{name} is not in the package"
    commands = sorted(name for name in app if not name.startswith("-"))
    for name in commands:
        assert f"cfddem {name}" in call(name, "--help"), name
    gallery = [line.split()[0] for line in call("new").splitlines()]
    for name in gallery:
        call("new", name)
        file = f"{name.replace('-', '_')}.toml"
        call("check", file, "--json")
        found = json.loads(call("run", file, "-o", name, "--json", *few_steps(Path(file))))
        assert found["status"] == "finished", name
    laws = json.loads(call("explain", "--json"))["laws"]
    rebound = json.loads(call("collide", "--material", "delrin", "--stokes", "100", "--velocity", "0.1", "--json"))
    assert abs(rebound["restitution"] - 0.8) < 0.05, rebound
    short = ("--set", "count=50", "--set", "start=suspended", "--set", "until=0.005", "--set", "average_from=0")
    call("run", "liquid_bed.toml", "-o", "bed", *short)
    call("report", "bed", "-o", "bed.html")
    assert Path("bed.html").stat().st_size > 50_000
    counted = f"{len(commands)} commands, {len(gallery)} cases started, {len(laws)} laws, a collision, a run, a report"
    print(f"cfddem {cfddem.__version__} on Python {sys.version.split()[0]}, numpy {version('numpy')}: {counted}")


main()
