"""Laws chosen by the user: by name from the registry, an installed package or a file, or as a function."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from importlib.util import module_from_spec, spec_from_file_location
from numbers import Real
from pathlib import Path

from cfddem.backend.errors import InputError, nearest, shown
from closures import registry
from closures.kinds import ARGUMENTS, BUILT_IN, DRAG_ARGUMENTS, arguments_of
from closures.registry import Law, is_built_in, law_of

OF_THE_PAIR_LOOP = ("minimum_gap", "lubrication")
"""Kinds of law that the pair loop calls."""


def chosen(kind: str, law: str | Callable[..., float]) -> Law:
    """Registry entry of a law chosen by its name or passed as a function.

    kind  a key of `BUILT_IN`
    """
    entry = _named(kind, law) if isinstance(law, str) else _user_defined(kind, law)
    if not _can_be_called(kind, entry):
        loop = "pair loop" if kind in OF_THE_PAIR_LOOP else "coupling"
        taken = ", ".join(inspect.signature(entry.function).parameters)
        remedy = f"it takes {taken}; {arguments_of(kind)}"
        raise InputError(kind, entry.name, f"a law of kind {kind!r} that the {loop} can call", remedy)
    return entry


def _can_be_called(kind: str, entry: Law) -> bool:
    """Whether the caller of laws of this kind has all arguments that this one takes."""
    if kind not in ARGUMENTS:
        return True
    may, must = ARGUMENTS[kind]
    return entry.kind == kind and set(must) <= set(inspect.signature(entry.function).parameters) <= set(may)


def called_by_name(law: Callable[..., float], names: Sequence[str], numbers: Sequence[float]) -> float:
    """Value of a law that takes some of these arguments, in any order."""
    values = dict(zip(names, numbers))
    return law(**{name: values[name] for name in inspect.signature(law).parameters})


class NotInstalled(str):
    """Name of a law in the case of a finished run that this machine does not have."""


def drag_by_name(law: Law, diameter_ratio: float = 1.0) -> Callable[[float, float], float]:
    """A drag law as a function of Reynolds number and voidage, whatever the order of its arguments.

    diameter_ratio  diameter over the Sauter mean diameter, for laws that use it [-]
    returns         function; it raises InputError where a user's law fails or is not finite
    """
    if is_built_in(law.function) and law.arguments == DRAG_ARGUMENTS[:2]:
        return law.function

    @wraps(law.function)
    def factor(reynolds: float, voidage: float) -> float:
        try:
            value = called_by_name(law.function, DRAG_ARGUMENTS, (reynolds, voidage, diameter_ratio))
        except Exception as failure:  # whatever a user's function raises
            if is_built_in(law.function):
                raise
            raise _not_finite(law, f"it fails ({failure})", reynolds, voidage) from None
        if is_built_in(law.function):
            return value
        if not isinstance(value, Real):
            raise _not_finite(law, f"it returns {value!r}, which is not a number,", reynolds, voidage)
        if math.isfinite(reynolds) and not math.isfinite(value):
            raise _not_finite(law, f"it is {value:g}", reynolds, voidage)
        return value

    return factor


def _not_finite(law: Law, result: str, reynolds: float, voidage: float) -> InputError:
    remedy = f"{result} at Re = {reynolds:.3g}, voidage = {voidage:.3g}"
    return InputError("laws.drag", law.name, "a law that is finite in the bed and beside it", remedy)


def _named(kind: str, name: str) -> Law:
    registry.load_built_in_laws()
    laws = registry.REGISTRY[kind]
    failures = {} if name in laws else registry.load_package_laws()
    if name not in laws:
        choices = [*BUILT_IN[kind], *(law.name for law in laws.values() if _can_be_called(kind, law))]
        remedy = "cfddem explain lists all laws; name the file of one of your own with --laws FILE.py"
        undeclared = [file.name for file in imported_laws() if hasattr(sys.modules[file.stem], name)]
        if undeclared:
            remedy = f'in {undeclared[0]}, put @closures.law("{kind}", source) before the function of this name'
        elif imported_laws():
            remedy += f"; {', '.join(file.name for file in imported_laws())} declares none of this name"
        lost = [f"the package {package} could not be loaded: {reason}" for package, reason in failures.items()]
        remedy = "; ".join([remedy, *lost])
        raise InputError(kind, shown(name), nearest(name, dict.fromkeys(choices)), remedy)
    return laws[name]


def _user_defined(kind: str, function: Callable[..., float]) -> Law:
    try:
        return law_of(function)
    except KeyError as failure:
        raise InputError(kind, None, "a law", str(failure.args[0])) from None


# ---------------------------------------------------------------- a file of laws
#
# A file of the user that declares laws: executed where a command names it, and nowhere else.

_IMPORTED: dict[str, Path] = {}
"""Files of laws that have been executed, by the names of their modules."""


def imported_laws() -> list[Path]:
    """Files of laws that have been executed, in order; processes that make runs for this one execute them, too."""
    return [file for name, file in _IMPORTED.items() if name in sys.modules]


def import_laws(files: Iterable[Path]) -> None:
    """Execute Python files, so that their laws are known; once in a process.

    errors  InputError if one is no Python file, or fails
    """
    for file in files:
        _import(file)


def _import(file: Path) -> None:
    if file.suffix != ".py" or not file.stem.isidentifier() or not file.is_file():
        raise InputError("--laws", str(file), "an existing Python file, such as my_laws.py")
    loaded = sys.modules.get(file.stem)
    if loaded is not None and getattr(loaded, "__file__", None) == str(file.resolve()):
        return
    if loaded is not None or file.stem in sys.stdlib_module_names:
        raise InputError("--laws", str(file), "a file with a name of its own", "another module has its name; rename it")
    spec = spec_from_file_location(file.stem, file.resolve())
    assert spec is not None and spec.loader is not None
    module = sys.modules[file.stem] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as failure:
        del sys.modules[file.stem]
        limit = "a file that can be executed"
        raise InputError("--laws", str(file), limit, f"{type(failure).__name__}: {failure}") from failure
    _IMPORTED[file.stem] = file.resolve()
