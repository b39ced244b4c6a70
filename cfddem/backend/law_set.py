"""Compile loops for the laws of a run.

A loop that calls laws which the user chooses is written once, as a template: it calls a :class:`Slot` where a law
goes. :func:`specialise` copies the template, and every helper that it calls and that has slots, with the chosen laws in
place of the slots, and compiles the copy. Laws are inlined, so a user's law costs what a built-in law costs.

    drag_factor = Slot("drag_factor")                       # in the module of the loop

    @threaded
    def factors(reynolds, voidage, factor):
        for n in prange(len(factor)):
            factor[n] = drag_factor(reynolds[n], voidage[n])

    loop = specialise(factors, {"drag_factor": callable_in_loops(law)})     # once a run

Constants are slots, too: `if FILM:` leaves out what a run does not have before it is compiled.

Compiled copies are kept on disk. The name of a copy contains a fingerprint of all that was put into its slots: the
bytecode and constants of the functions, and of the functions and values that they refer to. A change of a law's
source, also in a user's file, therefore compiles its loops again; changes of the package's own files are seen
by the folder of the cache (:mod:`closures.compiled`). Limits: what a law reads through containers or attributes of
objects is not part of the fingerprint, and the compiler refuses most of it.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba import float64, types

from cfddem.backend.compile import either, inline, part, renamed, threaded, threaded_part, vector_part
from cfddem.backend.errors import InputError
from closures.check import first_cause
from closures.compiled import is_exposed


class Slot:
    """A place in a template where a law or a constant of the run goes.

    name  key of the choice in `specialise`
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.name} is a slot for a law; call the loop that specialise() returns")


def specialise(
    template: Any, choices: Mapping[str, Any], threads: bool = False, way: Callable[[Any], Any] | None = None
) -> Any:
    """The loop of a template for chosen laws; equal choices give the same loop.

    template  compiled by `inline`, `serial`, `threaded` or `either`
    choices   slot name -> function compiled by `inline`, template, or constant
    threads   compile loops marked `either` for all threads
    way       mark of a function -> how it is compiled, for another processor
    """
    return _Specialiser(choices, way or (_on_all_threads if threads else _as_marked)).of(template)


_COPIES: dict[tuple[Any, str], Any] = {}
_ON_ALL_THREADS = {either: threaded, part: threaded_part, vector_part: threaded_part}


def _as_marked(mark: Any) -> Any:
    return mark


def _on_all_threads(mark: Any) -> Any:
    return _ON_ALL_THREADS.get(mark, mark)


class _Specialiser:
    """Copies the functions of one template; each once."""

    def __init__(self, choices: Mapping[str, Any], way: Callable[[Any], Any]) -> None:
        self.choices, self.way = choices, way
        self._done: dict[int, Any] = {}

    def of(self, template: Any) -> Any:
        """The copy of a function."""
        key = id(template)
        if key not in self._done:
            self._done[key] = template  # a function that calls itself
            self._done[key] = self._copy(template)
        return self._done[key]

    def _copy(self, template: Any) -> Any:
        plain = _plain(template)
        bound = {}
        for name in _names(plain.__code__):
            value = plain.__globals__.get(name)
            if isinstance(value, Slot):
                value = self.choices.get(value.name, value)  # empty slots are behind an `if` that is not compiled
                bound[name] = self.of(value) if _is_compiled(value) else value
            elif (_is_compiled(value) or self._is_called(value)) and (copy := self.of(value)) is not value:
                bound[name] = copy
        mark = getattr(template, "compiled_as", inline)
        how = self.way(mark)
        if not bound and how is mark:
            return template
        tag = _digest([how.__name__, *(f"{name}={fingerprint(bound[name])}" for name in sorted(bound))])
        if (plain, tag) not in _COPIES:
            copy = how(renamed(plain, f"{plain.__name__}_{tag}", bound))
            copy.tag = tag
            _COPIES[plain, tag] = copy
        return _COPIES[plain, tag]

    def _is_called(self, value: Any) -> bool:
        """Whether a plain function is a law that loops call by its name, and that this processor needs a copy of."""
        return self.way(inline) is not inline and isinstance(value, FunctionType) and is_exposed(value)


def callable_in_loops(law: Callable[..., Any]) -> Any:
    """A plain function of numbers as loops call it; helper functions that it calls are compiled, too.

    Compiled once, until the function or anything that it refers to changes.
    """
    if _is_compiled(law) or hasattr(law, "py_func"):
        return law
    assert isinstance(law, FunctionType)
    return _compiled_law(law, fingerprint(law))


@lru_cache(maxsize=256)
def _compiled_law(law: FunctionType, mark: str) -> Any:
    """The compiled twin of a function with this fingerprint.

    The cache on disk imports the module of each function that it loads, and the user's may not be there in the next
    run: the twin belongs to this module.
    """
    helpers = {
        name: callable_in_loops(value)
        for name in _names(law.__code__)
        if isinstance(value := law.__globals__.get(name), FunctionType) and value is not law and not is_exposed(value)
    }
    twin = renamed(law, law.__name__, helpers)
    twin.__module__ = __name__
    return inline(twin)


def bind_arguments(
    law: Callable[..., Any], arguments: str, sources: Mapping[str, str], result: str = "{}", values: int = 1
) -> Any:
    """A law with named arguments as a template calls it.

    law        takes some of the names of `sources`, in any order
    arguments  of the template's call, for instance "contact, row"
    sources    name -> where the template has it, for instance {"overlap": "contact.overlap"}
    result     what to make of the value
    values     how many numbers it returns
    errors     InputError for an argument that the template does not have, and for a user's law that does not compile
    """
    taken = list(inspect.signature(law).parameters)
    for name in taken:
        if name not in sources:
            raise InputError(f"argument of {law.__name__}", name, f"one of {', '.join(sources)}")
    if not (law.__module__ or "").startswith(("cfddem.", "closures.")):
        check_compiles("law", law, values)
    call = result.format(f"law({', '.join(sources[name] for name in taken)})")
    return compile_source(f"def adapter({arguments}):\n    return {call}\n", law=callable_in_loops(law))


def compile_source(source: str, how: Callable[..., Any] = inline, **names: Any) -> Any:
    """The function of a source text, compiled.

    how    inline, or another way to compile
    names  what the function can refer to
    """
    scope: dict[str, Any] = {"__name__": __name__}
    exec(source, scope)
    function: FunctionType = next(value for value in scope.values() if isinstance(value, FunctionType))
    function.__globals__.update(names)
    return how(function)


def check_compiles(key: str, law: Callable[..., Any], values: int = 1) -> None:
    """Refuse a user's law that cannot be compiled or does not return numbers, by its name, file and line.

    key     for which the law is chosen, as in a case
    values  how many numbers it returns
    """
    loop = callable_in_loops(law)
    if not hasattr(loop, "compile"):  # compilation is switched off
        return
    code = _plain(law).__code__
    place = "" if code.co_filename.startswith("<") else f" ({code.co_filename}:{code.co_firstlineno})"
    taken = (float64,) * len(inspect.signature(law).parameters)
    try:
        loop.compile(taken)
        returned = loop.overloads[taken].signature.return_type
    except Exception as refusal:
        raise InputError(key, law.__name__, "a law that can be compiled", first_cause(refusal) + place) from None
    kinds = getattr(returned, "types", (returned,))  # of a tuple
    if (values == 1 and kinds != (returned,)) or len(kinds) != values or not all(map(_is_number, kinds)):
        limit = "a law that returns a number" if values == 1 else f"a law that returns {values} numbers"
        raise InputError(key, law.__name__, limit, f"it returns {_in_words(returned)}{place}")


def _is_number(kind: Any) -> bool:
    return isinstance(kind, types.Float | types.Integer | types.Boolean)


def _in_words(kind: Any) -> str:
    """What a law returns, by the compiler's name of its type."""
    if isinstance(kind, types.BaseTuple):
        return f"{len(kind)} values"
    kind = types.unliteral(kind)
    names = {types.none: "nothing", types.unicode_type: "a string", types.float64: "a number"}
    return names.get(kind, f"a value of type {kind}")


def fingerprint(value: Any) -> str:
    """Hash of a value, or of a function with all that it refers to."""
    return _digest(_parts(value, set()))


def _parts(value: Any, visited: set[int]) -> Iterator[str]:
    if isinstance(value, FunctionType) or hasattr(value, "py_func"):
        plain = _plain(value)
        has_file = not plain.__code__.co_filename.startswith("<")
        if hasattr(value, "tag") and has_file:  # the tag tells copies apart
            yield f"{plain.__module__}.{plain.__name__}"
            return
        yield plain.__name__ if "<" in plain.__name__ else plain.__qualname__
        if id(plain) in visited:
            return
        visited.add(id(plain))
        yield from _code_parts(plain.__code__)
        for referred in (*(plain.__defaults__ or ()), *(cell.cell_contents for cell in plain.__closure__ or ())):
            yield from _parts(referred, visited)
        names = _names(plain.__code__)
        for name in names:
            if name in plain.__globals__:
                yield name
                yield from _referred(plain.__globals__[name], names, visited)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}{_digest([value.tobytes().hex()])}"
    elif isinstance(value, tuple | list):
        for element in value:
            yield from _parts(element, visited)
    elif value is None or isinstance(value, bool | int | float | complex | str | bytes | np.generic):
        yield repr(value)
    else:
        name = getattr(value, "__qualname__", type(value).__qualname__)
        yield f"{getattr(value, '__module__', '')}.{name}"


def _referred(value: Any, names: list[str], visited: set[int]) -> Iterator[str]:
    """Parts of a global value; of a module those attributes that the function may use."""
    if not isinstance(value, ModuleType):
        yield from _parts(value, visited)
    elif value.__name__.partition(".")[0] not in sys.stdlib_module_names | {"numpy"}:
        for name in names:
            if hasattr(value, name):
                yield f"{value.__name__}.{name}"
                yield from _parts(getattr(value, name), visited)


def _code_parts(code: CodeType) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_names, code.co_varnames))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_parts(constant)
        else:
            yield repr(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)


def _names(code: CodeType) -> list[str]:
    """Names that a function's code may look up, those of its inner functions included."""
    inner = [name for constant in code.co_consts if isinstance(constant, CodeType) for name in _names(constant)]
    return list(dict.fromkeys([*code.co_names, *inner]))


def _plain(function: Any) -> FunctionType:
    return getattr(function, "py_func", function)  # type: ignore[no-any-return]


def _is_compiled(value: Any) -> bool:
    return hasattr(value, "compiled_as")


def _digest(parts: Any) -> str:
    digest = hashlib.sha256()
    for text in parts:
        digest.update(text.encode() + b"\n")
    return digest.hexdigest()[:12]
