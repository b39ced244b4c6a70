"""The run folder of each rank: rank 0 writes for all, the others write nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from cfddem.backend.communicator import Communicator
from cfddem.io.quantities import Quantities
from cfddem.io.writer import RunFolder


class UnwrittenFolder(RunFolder):
    """A run folder whose writes do nothing."""

    def __init__(self, folder: Path, about: dict[str, Any], case_text: str, quantities: Quantities) -> None:
        self.folder, self.about, self.case_text = folder, about, case_text
        self.quantities = {block: dict(names) for block, names in quantities.items()}
        self.snapshots, self._history = [], {}

    def _nothing(self, *arguments: Any, **named: Any) -> None:
        """Rank 0 does it."""

    write_snapshot = write_index = append_history = flush_history = write_checkpoint = _nothing
    note = drop_after = finish = _nothing


def folder_of_ranks(communicator: Communicator, make: Callable[[], RunFolder]) -> RunFolder:
    """The folder that rank 0 makes, and one without writing on the other ranks; where rank 0 fails, all fail.

    make  called on rank 0
    """
    made: list[RunFolder] = []

    def described() -> tuple[Path, dict[str, Any], str, Quantities]:
        made.append(make())
        return made[0].folder, made[0].about, made[0].case_text, made[0].quantities

    about = communicator.by_first(described)
    return made[0] if made else UnwrittenFolder(*about)
