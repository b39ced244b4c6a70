"""Tries an installed package from an empty folder: every command, every case of the gallery, data files, a collision.

It imports nothing of the repository. It ends with exit code 1 and a list if something is missing.
"""

from __future__ import annotations

import json
import subprocess
import sys
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
    done = subprocess.run([str(PROGRAM), *words], capture_output=True, text=True, timeout=600)
    if done.returncode:
        raise SystemExit(f"cfddem {' '.join(words)}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


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
        call("check", f"{name.replace('-', '_')}.toml", "--json")
    laws = json.loads(call("explain", "--json"))
    rebound = json.loads(call("collide", "--material", "delrin", "--stokes", "100", "--velocity", "0.1", "--json"))
    assert abs(rebound["restitution"] - 0.8) < 0.05, rebound
    short = ("--set", "count=50", "--set", "start=suspended", "--set", "until=0.005", "--set", "average_from=0")
    call("run", "liquid_bed.toml", "-o", "bed", *short)
    call("report", "bed", "-o", "bed.html")
    assert Path("bed.html").stat().st_size > 50_000
    counted = f"{len(commands)} commands, {len(gallery)} cases, {len(laws)} laws, a collision, a run, a report"
    print(f"cfddem {cfddem.__version__} on Python {sys.version.split()[0]}, numpy {version('numpy')}: {counted}")


main()
