"""How a loop is compiled for a graphics processor (GPU): the third way, beside one thread and several.

It needs numba-cuda, `pip install 'cfddem[gpu]'`. What a loop does to one particle or one pair are the same functions as
on the processor; only the loop around them is another one.

    kernel   a loop that runs on the GPU, started from Python
    helper   a function that only kernels call
    device   a function that a kernel calls: every function is, when it is compiled for a kernel

The threads of a launch come in blocks (`Threads`). Numbers of all of them are reduced to one (`greatest_of_all`,
`sum_of_all`) within each block, and then by each block over all blocks; all threads wait for one another in between.

A product and the sum that it enters are rounded one after the other, as on the processor. So both give the same bits
where they call no functions but square roots.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from threading import current_thread
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise

try:
    from numba import cuda
except ImportError:  # later versions leave it to numba-cuda; see `name_of_gpu`
    cuda: Any = None  # type: ignore[no-redef]

BLOCK = 128
"""Threads of a block."""

SIMULATED = os.environ.get("NUMBA_ENABLE_CUDASIM", "0") not in ("", "0")
"""Whether kernels run in the simulator of the compiler, which needs no GPU: for tests."""


class _Template:
    """A loop or a function for the GPU before its slots are filled."""

    def __init__(self, function: Callable[..., Any], way: Callable[..., Any]) -> None:
        self.py_func, self.__name__, self.compiled_as = function, function.__name__, way


def kernel(function: Callable[..., Any]) -> Any:
    """A loop for the GPU as a template; `for_gpu` compiles it."""
    return _Template(function, _compiled)


def helper(function: Callable[..., Any]) -> Any:
    """A function that only loops for the GPU call, as a template."""
    return _Template(function, helper)


def _compiled(function: Callable[..., Any]) -> Any:
    settings = {} if SIMULATED else {"lto": False}  # see `_rounded_as_on_the_processor`
    return cuda.jit(function, **settings)


def device(function: Callable[..., Any]) -> Any:
    """A function that loops on the GPU call."""
    return function if SIMULATED else cuda.jit(device=True)(function)


def for_gpu(template: Any, choices: Mapping[str, Any]) -> Any:
    """The loop of a `kernel` for chosen laws; see :func:`cfddem.backend.law_set.specialise`."""
    return specialise(template, choices, way=lambda mark: mark if mark is _compiled else device)


def name_of_gpu() -> str:
    """The GPU that is used; InputError with what is missing where there is none."""
    if SIMULATED:
        return "simulated"
    if find_spec("numba_cuda") is None:
        raise InputError("gpu", True, "false where numba-cuda is missing", "pip install 'cfddem[gpu]'")
    try:
        return str(cuda.get_current_device().name)
    except Exception as failure:  # the driver, its library or the device is missing
        raise gpu_error(failure) from None


def gpu_error(failure: Exception) -> InputError:
    """A failure of driver, compiler or memory of the GPU as one line."""
    words = " ".join(str(failure).split()) or type(failure).__name__
    fault = words if len(words) <= 100 else f"{words[:100]} ..."
    remedy = "see nvidia-smi for driver, memory and other work; or take gpu = false"
    return InputError("gpu", fault, "one of NVIDIA with its driver and room for the run", remedy)


class DeviceArrays:
    """Arrays on the GPU by name; the memory of an array is used again for the next one of the same shape."""

    def __init__(self) -> None:
        self._arrays: dict[str, Any] = {}

    def sent(self, name: str, array: np.ndarray, changed: bool = True) -> Any:
        """The array on the GPU.

        changed  copy its values, also where there was one of this name and shape
        """
        before = self._arrays.get(name)
        there = self.room(name, array)
        if array.size and (changed or there is not before):
            there.copy_to_device(array)
        return there

    def room(self, name: str, array: np.ndarray) -> Any:
        """Memory on the GPU for an array that a loop writes before it reads it."""
        there = self._arrays.get(name)
        if there is None or there.shape != array.shape:
            self._arrays.pop(name, None)
            self._arrays[name] = there = cuda.device_array(array.shape, array.dtype)
        return there

    def receive(self, name: str, array: np.ndarray) -> None:
        """Write the values of the array on the GPU into one of the processor."""
        if array.size:
            self._arrays[name].copy_to_host(array)


def launch(loop: Any, rows: int, *arguments: Any) -> None:
    """Run a loop whose threads wait for one another: as many as it has rows, or as the GPU can hold at a time."""
    if SIMULATED:
        loop[1, 2](*arguments)
        return
    with _rounded_as_on_the_processor(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*Grid size")  # few rows need few threads
        compiled = loop.compile(tuple(loop.typeof_pyval(argument) for argument in arguments))
        blocks = min(compiled.max_cooperative_grid_blocks(BLOCK), max(1, -(-rows // BLOCK)), MOST_BLOCKS)
        loop[blocks, BLOCK](*arguments)


@contextmanager
def _rounded_as_on_the_processor() -> Iterator[None]:
    """Compile without instructions that round a product and a sum at once, for which the compiler has no option.

    To optimise once more while linking would make them again, and is switched off.
    """
    from numba.cuda.cudadrv import nvvm

    original = nvvm.compile_ir
    nvvm.compile_ir = partial(original, fma=False)
    try:
        yield
    finally:
        nvvm.compile_ir = original


# ---------------------------------------------------------------- within a kernel


MOST_BLOCKS = 4096
"""Of a launch that reduces numbers of all threads to one."""


def _simulated_wait() -> None:
    current_thread().syncthreads()  # type: ignore[attr-defined]


syncthreads: Any = _simulated_wait if SIMULATED or cuda is None else cuda.syncthreads
"""Wait for the other threads of the block."""


class Threads(NamedTuple):
    """The threads of a launch, as one of them sees them."""

    grid: Any  # all of them, which can wait for one another
    mine: int  # number of this one
    number: int  # of all of them
    lane: int  # number of this one in its block
    width: int  # of a block, a power of two
    block: int  # number of this block
    blocks: int
    tops: Any  # memory of the block, a number for each of its threads
    wholes: Any  # the same for integers
    tops_of_blocks: Any  # (number of reductions times `MOST_BLOCKS`), for all blocks
    wholes_of_blocks: Any  # the same for integers


@helper
def greatest_of_all(value, place, threads):
    """The largest of a number of each thread, not below 0; NaN if one of them is NaN.

    place  row of the memory of all blocks; between two calls with the same one all threads wait for one another
    """
    top = _greatest_of_block(value, threads)
    begin = place * MOST_BLOCKS
    if threads.lane == 0:
        threads.tops_of_blocks[begin + threads.block] = top
    threads.grid.sync()
    top = 0.0
    for block in range(threads.lane, threads.blocks, threads.width):
        other = threads.tops_of_blocks[begin + block]
        top = other if other > top or other != other else top
    return _greatest_of_block(top, threads)


@helper
def _greatest_of_block(value, threads):
    tops, lane, half = threads.tops, threads.lane, threads.width // 2
    tops[lane] = value
    syncthreads()
    while half > 0:
        if lane < half:
            other = tops[lane + half]
            tops[lane] = other if other > tops[lane] or other != other else tops[lane]
        syncthreads()
        half //= 2
    top = tops[0]
    syncthreads()
    return top


@helper
def sum_of_all(whole, place, threads):
    """The sum of an integer of each thread; see `greatest_of_all`."""
    total = _sum_of_block(whole, threads)
    begin = place * MOST_BLOCKS
    if threads.lane == 0:
        threads.wholes_of_blocks[begin + threads.block] = total
    threads.grid.sync()
    total = 0
    for block in range(threads.lane, threads.blocks, threads.width):
        total += threads.wholes_of_blocks[begin + block]
    return _sum_of_block(total, threads)


@helper
def _sum_of_block(whole, threads):
    wholes, lane, half = threads.wholes, threads.lane, threads.width // 2
    wholes[lane] = whole
    syncthreads()
    while half > 0:
        if lane < half:
            wholes[lane] += wholes[lane + half]
        syncthreads()
        half //= 2
    total = wholes[0]
    syncthreads()
    return total
