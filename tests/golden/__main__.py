"""The command `python -m tests.golden`: hashes of golden runs, or their states frozen in files."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence

import numpy as np

from golden.every_run import RUNS
from golden.registry import FOLDER, State


def digest(state: State) -> str:
    """Hash of all bits of a state."""
    made = hashlib.sha256()
    for name in sorted(state):
        values = np.ascontiguousarray(state[name])
        made.update(f"{name} {values.dtype.str} {values.shape}".encode())
        made.update(values.tobytes())
    return made.hexdigest()


def main(words: Sequence[str]) -> int:
    """The command: hashes or freeze, and perhaps names of runs."""
    names = list(words[1:]) or list(RUNS)
    if not words or words[0] not in ("hashes", "freeze") or not set(names) <= set(RUNS):
        print(f"usage: python -m tests.golden hashes|freeze [RUN ...]\nruns: {', '.join(RUNS)}", file=sys.stderr)
        return 2
    for name in names:
        state = RUNS[name]()
        print(digest(state), name, flush=True)
        if words[0] == "freeze":
            FOLDER.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(FOLDER / f"{name}.npz", **state)  # type: ignore[arg-type]
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
