"""Worker processes that make trials under limits of time and memory, and are replaced when they die or hang."""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from fuzz.trials import Surroundings, TooSlow, as_command, judge_command, perform


@dataclass(frozen=True)
class Limits:
    """Of one trial."""

    seconds: float = 20.0  # of processor time
    memory: float = 4.0  # address space [GB]
    niceness: int = 19
    compiles: bool = True  # otherwise a command ends where it would compile a loop
    patience: float = 6.0  # a worker that sleeps and is silent for so many times `seconds` is killed


@dataclass
class Outcome:
    """All trials together."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: dict[str, list[int]] = field(default_factory=dict)  # what happened -> numbers of the trials
    slowest: tuple[float, int] = (0.0, -1)  # [s], number

    def add(self, number: int, answer: str, seconds: float) -> bool:
        """Count an answer: accepted, refused, or the description of a fault; returns whether it is a new fault."""
        good = answer in ("accepted", "refused")
        self.counts[answer if good else "fault"] += 1
        new = not good and answer not in self.faults
        if not good:
            self.faults.setdefault(answer, []).append(number)
        self.slowest = max(self.slowest, (seconds, number))
        return new


def limit_memory(limits: Limits) -> None:
    """Limit the address space of this process."""
    most = int(limits.memory * 1024**3)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def limit_time(limits: Limits) -> None:
    """Let the operating system kill this process when its processor time is over."""
    most = math.ceil(limits.seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (most, most + 1))


def trial(around: Surroundings, seed: int, number: int, limits: Limits) -> str:
    """The answer of a trial, or what went wrong, in a few lines."""

    def too_slow(*_: Any) -> None:
        raise TooSlow

    signal.signal(signal.SIGPROF, too_slow)
    signal.setitimer(signal.ITIMER_PROF, limits.seconds)
    try:
        return perform(around, seed, number)
    except TooSlow:
        return f"hangs: longer than {limits.seconds:g} s"
    except BaseException as failure:
        return fault_of(failure)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def fault_of(failure: BaseException) -> str:
    """Kind of a failure and its innermost places in the package."""
    frames = [each for each in traceback.extract_tb(failure.__traceback__) if "/fuzz/" not in each.filename]
    places = [f"{Path(each.filename).name}:{each.lineno} {each.name}" for each in frames]
    return f"{type(failure).__name__}: {str(failure)[:300]}  at {' < '.join(places[::-1][:4])}"


def work(pipe: Any, home: str, seed: int, limits: Limits) -> None:
    """Make the trials whose numbers arrive, until None arrives."""
    os.nice(limits.niceness)
    logging.disable()
    around = Surroundings(Path(home), limits.compiles)
    limit_memory(limits)
    pipe.send(None)  # from here on time counts: to import the package takes long on a busy machine
    while (number := pipe.recv()) is not None:
        begun = time.process_time()
        most = math.ceil(begun + 3.0 * limits.seconds)  # of a compiled loop, which the limit of the trial does not end
        hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
        pipe.send((number, trial(around, seed, number, limits), time.process_time() - begun))


START = 600.0
"""How long a worker may take to import the package on a busy machine [s]."""


class Worker:
    """A process that makes one trial after the other."""

    def __init__(self, home: str, seed: int, limits: Limits) -> None:
        self._arguments = home, seed, limits
        self.begin()

    def begin(self) -> None:
        """Start the process."""
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=work, args=(other, *self._arguments), daemon=True)
        self.process.start()
        other.close()
        self.number: int | None = None
        self.since = time.monotonic() + START  # later once it is ready

    def answer(self) -> tuple[int, str, float] | None:
        """What it says: number, answer and time of a trial, or None once it is ready; EOFError if it has died."""
        said: tuple[int, str, float] | None = self.pipe.recv()
        if said is None:
            self.since = time.monotonic()
        return said

    @property
    def silent(self) -> float:
        """How long it has been silent [s]; 0 while it starts, and while it computes or waits for a processor."""
        if not self.process.is_alive():
            return 0.0  # the end of its pipe says so
        state = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()[0]
        return 0.0 if state == "R" else max(0.0, time.monotonic() - self.since)

    def send(self, number: int | None) -> None:
        """Give the worker a trial."""
        self.number, self.since = number, max(self.since, time.monotonic())
        self.pipe.send(number)

    def replace(self) -> str:
        """Kill the process and start another; returns how it ended."""
        died = self.process.exitcode
        self.process.kill()
        self.process.join()
        self.begin()
        return "does not answer" if died is None else f"dies with exit code {died}"


def many(
    seed: int, numbers: Iterable[int], workers: int, limits: Limits, seconds: float, home: str
) -> Iterator[tuple[int, str, float]]:
    """Number, answer and time of each trial, until all are made or the time is over.

    numbers  of the trials
    seconds  for all of them
    """
    end, waiting = time.monotonic() + seconds, iter(numbers)
    team = [Worker(home, seed, limits) for _ in range(workers)]
    busy = {each.pipe: each for each in team if _give(each, waiting)}
    while busy:
        for pipe in wait(list(busy), timeout=1.0):
            worker = busy[pipe]  # type: ignore[index]
            try:
                answer = worker.answer()
            except EOFError:
                worker.process.join(5)
                del busy[pipe]  # type: ignore[arg-type]
                assert worker.number is not None
                yield worker.number, f"worker {worker.replace()}", 0.0
            else:
                if answer is None:
                    continue
                yield answer
                del busy[pipe]  # type: ignore[arg-type]
            if time.monotonic() < end and _give(worker, waiting):
                busy[worker.pipe] = worker
        for pipe, worker in list(busy.items()):
            silent = worker.silent
            if silent > limits.patience * limits.seconds:
                del busy[pipe]
                assert worker.number is not None
                yield worker.number, f"worker {worker.replace()}", silent
                if time.monotonic() < end and _give(worker, waiting):
                    busy[worker.pipe] = worker
    for worker in team:
        worker.process.kill()


def _give(worker: Worker, waiting: Iterator[int]) -> bool:
    """Give a worker the next trial, if there is one."""
    number = next(waiting, None)
    if number is None:
        return False
    worker.send(number)
    return True


def real_command(around: Surroundings, seed: int, number: int, limits: Limits) -> tuple[str, float, list[str]]:
    """Answer, time and words of a trial made by the program in a process of its own."""
    with tempfile.TemporaryDirectory(dir=around.home) as folder:
        words = as_command(around, seed, number, Path(folder))
        begun = time.monotonic()
        home = Path(__file__).parents[2]
        environment = os.environ | {"PYTHONPATH": str(home), "NUMBA_NUM_THREADS": "1", "COLUMNS": "100"}
        try:
            done = subprocess.run(
                [sys.executable, "-m", "cfddem", *words], cwd=folder, env=environment, capture_output=True, text=True,
                errors="replace", timeout=limits.patience * limits.seconds, stdin=subprocess.DEVNULL,
                preexec_fn=lambda: (limit_memory(limits), limit_time(limits), os.nice(limits.niceness)),
            )  # fmt: skip
            assert done.returncode != -signal.SIGXCPU, f"hangs: longer than {limits.seconds:g} s"
            judge_command(done.returncode, done.stdout, done.stderr, max(map(len, words), default=0))
            answer = "accepted" if done.returncode == 0 else "refused"
        except subprocess.TimeoutExpired:
            answer = f"does not end in {limits.patience * limits.seconds:g} s of the clock; repeat it when it is quiet"
        except AssertionError as failure:
            answer = f"{failure}"[:600]
        return answer, time.monotonic() - begun, words
