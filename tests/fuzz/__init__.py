"""Mutated case files, command lines, measured data and run folders: each is accepted, or refused in clear lines.

`python -m tests.fuzz --count 100000 --seed 1` makes the trials in worker processes. A trial depends on the seed and its
number only; `--only NUMBER` repeats one and shows what it tried.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import rooms  # noqa: F401  helpers of the tests are top-level modules
