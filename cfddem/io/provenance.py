"""The provenance of a run: versions, platform and random seed, enough to repeat it."""

from __future__ import annotations

import os
import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any

from cfddem import __version__


def provenance(seed: int | None = None) -> dict[str, Any]:
    """Versions of cfddem and its dependencies, Python, platform, processors, command and start time.

    seed     of the random numbers of the run
    returns  dict of plain values
    """
    return {
        "cfddem": __version__,
        "dependencies": _dependencies(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processors": os.cpu_count(),
        "command": [os.path.basename(sys.argv[0]), *sys.argv[1:]] if sys.argv else [],
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
    }


def _dependencies() -> dict[str, str]:
    """Installed version of each required package."""
    found = {}
    try:
        needed = requires("cfddem") or []
    except PackageNotFoundError:  # cfddem is used without being installed
        needed = []
    for requirement in needed:
        if "extra ==" in requirement:
            continue
        name = requirement.split(";")[0].split(">")[0].split("=")[0].split("<")[0].strip()
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
