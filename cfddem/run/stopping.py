"""Stop a run on SIGINT or SIGTERM between two steps."""

from __future__ import annotations

import signal
import threading
from types import TracebackType
from typing import Any

from cfddem.backend.communicator import Communicator


class StopRequest:
    """Catches SIGINT and SIGTERM inside a `with` block; true after the first one.

    A second signal acts as usual, so that a second Ctrl-C ends the process at once. Outside of the main thread no
    signal is caught.
    """

    def __init__(self) -> None:
        self.signal = 0  # number of the signal that was received; 0 before
        self._before: dict[int, Any] = {}

    def __bool__(self) -> bool:
        return self.signal != 0

    @property
    def name(self) -> str:
        """Name of the signal."""
        return signal.Signals(self.signal).name

    def agreed(self, communicator: Communicator) -> bool:
        """Whether a rank has received a signal; then all ranks take it for theirs."""
        found = communicator.largest([self.signal])
        if found:  # a signal that came during the call is found by the next one
            self.signal = found
        return bool(found)

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._before = {each: signal.signal(each, self._receive) for each in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, number: int, _: Any) -> None:
        self.signal = number
        signal.signal(number, self._before[number])
