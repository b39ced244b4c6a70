"""Golden runs: small runs of all features, and their final states, which a change of the code must not alter.

`python -m tests.golden hashes [RUN ...]` prints a hash of the bits of each run, for two versions on one machine;
`python -m tests.golden freeze [RUN ...]` writes the states to `tests/data/golden`, which `test_golden.py` compares
with, for any machine. Freeze only what has changed on purpose.

Only `building` and `states` know how a run is made and how its state is read.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import rooms  # noqa: F401  helpers of the tests are top-level modules
