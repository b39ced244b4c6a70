"""Functions that are compiled into the loops that call them, and by themselves to nothing.

The compiler makes each function ready to run, with machine code and an entry from Python, also one that only other
compiled functions call. Most functions of a loop are such parts of it, so most machine code would never run. A
`Linked` function stays in the language of the compiler until a loop that Python calls, a `Called` one, takes it over.

These classes replace parts of the compiler that its documentation does not describe. With a version that lacks one of
them everything is compiled in the usual way: more slowly, to the same numbers.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding import Linkage
from llvmlite.binding.ffi import lib
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.environment import lookup_environment


class _WithoutAddresses:
    """Stands for the machine code where there is none."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """What a function reads from Python has no address yet; it is set with that of the loop."""


class _Code(JITCodeLibrary):  # type: ignore[misc]
    """Code that is linked and optimised once, where it is whole: not in each function before it is linked, too."""

    def _optimize_functions(self, module: Any) -> None:
        if not hasattr(self._codegen, "_data_layout"):
            super()._optimize_functions(module)  # type: ignore[no-untyped-call]
            return
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Link and optimise."""
        self._linking_libraries = [_Alone(part) if _is_inlined(part) else part for part in _callers_first(self)]
        super().finalize()  # type: ignore[no-untyped-call]


class _LinkedCode(_Code):
    """Code of a function without machine code."""

    inlined = False
    """Whether it becomes part of each loop that calls it, which is optimised as a whole."""

    @property
    def codegen(self) -> Any:
        """Where addresses are set."""
        return _WithoutAddresses

    def finalize(self) -> None:
        """Link and optimise what is not part of a whole."""
        if self.inlined:
            self._finalize_final_module()
        else:
            super().finalize()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = "linkonce_odr"  # one of several definitions, left out where nothing calls it
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        if self.inlined and self._shared_module is None:  # for loops on all threads, whose pieces are of other classes
            self._shared_module = self._final_module.clone()
            for part in _callers_first(self):
                self._shared_module.link_in(_Alone(part)._get_module_for_linking(), preserve=True)
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function: none."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0


class _Alone:
    """An inlined function without those that it calls, which are linked beside it, each once."""

    def __init__(self, library: Any) -> None:
        self._library, self._reload_init = library, library._reload_init

    def _get_module_for_linking(self) -> Any:
        return self._library._final_module if _is_inlined(self._library) else self._library._get_module_for_linking()


def _is_inlined(library: Any) -> bool:
    return getattr(library, "inlined", False)


def _callers_first(library: Any) -> list[Any]:
    """What a function calls, and what its inlined parts call: the linker takes only what has been called before."""
    visited, callees_first = {library}, list[Any]()

    def follow(caller: Any) -> None:
        for callee in caller._linking_libraries:
            if callee not in visited:
                visited.add(callee)
                if _is_inlined(callee):
                    follow(callee)
                callees_first.append(callee)

    follow(library)
    return callees_first[::-1]


class _CalledCode(_Code):
    """Code of a loop that Python calls, with that of all functions in it."""

    def _finalize_specific(self) -> None:
        super()._finalize_specific()  # type: ignore[no-untyped-call]
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)  # type: ignore[no-untyped-call]
            if environment is not None:
                self._codegen.set_env(variable.name, environment)  # type: ignore[attr-defined]


class Linked(Compiler):  # type: ignore[misc]
    """Compiles a function for other compiled functions."""

    def __init__(self, typing: Any, target: Any, library: Any, args: Any, result: Any, flags: Any, *more: Any) -> None:
        code = _LinkedCode(target.codegen(), "linked")  # type: ignore[no-untyped-call]
        code.inlined = bool(flags.forceinline)
        super().__init__(typing, target, code, args, result, flags, *more)  # type: ignore[no-untyped-call]


class Called(Compiler):  # type: ignore[misc]
    """Compiles a loop that Python calls."""

    def __init__(self, typing: Any, target: Any, library: Any, *more: Any) -> None:
        code = _CalledCode(target.codegen(), "called")  # type: ignore[no-untyped-call]
        code.enable_object_caching()  # type: ignore[no-untyped-call]
        super().__init__(typing, target, code, *more)  # type: ignore[no-untyped-call]


REPLACED = (
    "codegen",
    "get_pointer_to_function",
    "_optimize_functions",
    "_finalize_final_module",
    "_finalize_dynamic_globals",
    "_finalize_specific",
    "_ensure_finalized",
    "_get_module_for_linking",
    "finalize",
)
"""What `JITCodeLibrary` must have for the classes above."""


def is_supported(library: type) -> bool:
    """Whether the code libraries of this version of the compiler have all parts that are replaced here."""
    return all(hasattr(library, name) for name in REPLACED)


def ways(library: type) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of functions that other compiled functions call, and of loops that Python calls."""
    linked, called = (Linked, Called) if is_supported(library) else (Compiler, Compiler)
    part = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": linked}
    return part, {"error_model": "numpy", "no_cfunc_wrapper": True, "pipeline_class": called}


def compare_quickly(settings: type) -> None:
    """Compare settings of a compilation by those that are set, and hash them by their kind.

    The compiler does both thousands of times for each loop, with all settings and their defaults: a tenth of its time.
    """
    compared: Any = settings.__eq__

    def equals(one: Any, other: Any) -> Any:
        if type(one) is not type(other) or not (hasattr(one, "_values") and hasattr(one, "options")):
            return compared(one, other)
        options, ours, theirs = one.options, one._values, other._values
        return ours == theirs or all(
            ours.get(name, options[name].default) == theirs.get(name, options[name].default)
            for name in ours.keys() | theirs.keys()
        )

    def hashed(one: Any) -> int:
        return hash(type(one))  # the compiler, too, gives all of a kind the same

    settings.__eq__, settings.__hash__ = equals, hashed  # type: ignore[method-assign, assignment]


def report_no_locks(lock: Any) -> None:
    """Take from the lock around LLVM what the compiler calls each time that it is taken and given back.

    Each of 60 000 calls of LLVM for a loop is reported to a clock for every function that is being compiled: a
    twentieth of its time.
    """
    for called in list(getattr(lock, "_cblist", ())):
        if called[0].__module__ == COMPILER_CONTEXT:
            lock.unregister(*called)


COMPILER_CONTEXT = "numba.core.base"
"""Where the compiler registers its reports of the lock."""

PART, CALLED = ways(JITCodeLibrary)
if is_supported(JITCodeLibrary):
    from numba.core.targetconfig import TargetConfig

    compare_quickly(TargetConfig)
    report_no_locks(getattr(lib, "_lock", None))

INLINE: dict[str, Any] = {**PART, "forceinline": True, "_nrt": False}
"""Small functions that are always inlined, and count no references: they own no arrays."""
