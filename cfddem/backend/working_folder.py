"""What a command reads of the folder in which it is started: files that are named to it, and nothing else."""

from __future__ import annotations

import os
from contextlib import chdir
from importlib import import_module
from pathlib import Path
from typing import Any

MATPLOTLIB, NUMBA = "matplotlibrc", ".numba_config.yaml"
"""Files in the working folder from which these packages take settings when they are imported."""


def ignore_settings_files() -> None:
    """Keep matplotlib and numba from reading settings in the working folder, which may be a run of somebody else.

    Settings of matplotlib can start LaTeX and name modules to import; those of numba change how loops are compiled.
    Settings of the user, in the home folder and in the environment, hold as ever.
    """
    for name, package in ((MATPLOTLIB, "matplotlib"), (NUMBA, "numba")):
        if os.path.exists(name):
            with chdir(Path(__file__).parent):
                imported: Any = import_module(package)
            if name == NUMBA:
                imported.core.config._config_fname = os.devnull  # read again whenever a loop is compiled
