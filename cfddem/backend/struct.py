"""Named tuples that compiled loops take by reference: a structure of structures of arrays, read by names.

A loop takes a plain named tuple as one argument for each number in it, seven for an array, and hands all of them on to
each function that it calls. A loop on all threads refuses tuples in tuples. A `struct` is one address for both: its
members are read where they are used. No member changes while a loop runs, so the compiler may read it once.

    @struct
    class System(NamedTuple): ...

The named tuples among its members are read by reference, too. Loops over arrays that must not overlap need each array
as an argument of its own (`cfddem.particles.interactions.pair_loops`).
"""

from __future__ import annotations

import hashlib
from functools import partial
from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, models, register_model, typeof_impl, unbox

import closures.compiled as _cache_first  # noqa: F401  sets the compile cache before numba is loaded

Made = TypeVar("Made", bound=type)


class Struct(types.Type):  # type: ignore[misc]
    """Type of a named tuple that is taken by reference.

    made     its class
    members  types of its members
    """

    def __init__(self, made: type, members: tuple[types.Type, ...]) -> None:
        self.made, self.members = made, members
        digest = hashlib.sha256(", ".join(map(str, (made, *members))).encode()).hexdigest()[:16]
        super().__init__(name=f"{made.__name__[:20]}_{digest}")  # short: it becomes part of the names of functions

    @property
    def key(self) -> Any:
        """What tells it from other types."""
        return self.made, self.members


def struct(made: Made) -> Made:
    """Let compiled loops take instances of a class of named tuples by reference."""
    typeof_impl.register(made)(lambda value, context: _type_of(value, context))
    return made


def _type_of(value: Any, context: Any) -> types.Type:
    if hasattr(value, "_fields"):
        return Struct(type(value), tuple(_type_of(each, context) for each in value))
    return typeof_impl(value, context)


def _content(manager: Any, of: types.Type) -> Any:
    """What lies at the address of a structure, or of another member."""
    if not isinstance(of, Struct):
        return manager.lookup(of).get_value_type()
    return ir.LiteralStructType([_content(manager, each) for each in of.members])


@register_model(Struct)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    """The address of the members, which lie one after the other."""

    def __init__(self, manager: Any, of: Struct) -> None:
        super().__init__(manager, of, _content(manager, of).as_pointer())


@infer_getattr
class _Members(AttributeTemplate):  # type: ignore[misc]
    key = Struct

    def generic_resolve(self, of: Struct, name: str) -> types.Type | None:  # type: ignore[override]
        """Type of a member."""
        names = of.made._fields  # type: ignore[attr-defined]
        return of.members[names.index(name)] if name in names else None


@lower_getattr_generic(Struct)
def _read(context: Any, builder: Any, of: Struct, address: Any, name: str) -> Any:
    """A member: what it holds, or its address where it is a structure."""
    place = of.made._fields.index(name)  # type: ignore[attr-defined]
    member, inner = of.members[place], cgutils.gep_inbounds(builder, address, 0, place)
    if isinstance(member, Struct):
        return inner
    return impl_ret_borrowed(context, builder, member, _loaded(builder, inner))


def _loaded(builder: Any, address: Any) -> Any:
    """What is at an address, number by number, which does not change while loops run."""
    content = address.type.pointee
    if isinstance(content, ir.LiteralStructType | ir.ArrayType):
        value = ir.Constant(content, ir.Undefined)
        for n in range(len(content.elements) if isinstance(content, ir.LiteralStructType) else content.count):
            value = builder.insert_value(value, _loaded(builder, cgutils.gep_inbounds(builder, address, 0, n)), n)
        return value
    number = builder.load(address)
    number.set_metadata("invariant.load", builder.module.add_metadata([]))
    return number


@unbox(Struct)
def _taken(of: Struct, value: Any, c: Any) -> NativeValue:
    """Lay out the members of an instance for the time of a call."""
    address = cgutils.alloca_once(c.builder, _content(c.context.data_model_manager, of))
    failures: list[Any] = []
    releases: list[Any] = []
    _fill(of, value, address, c, failures, releases)
    failed = cgutils.false_bit
    for each in failures:
        failed = c.builder.or_(failed, each)

    def release() -> None:
        for each in reversed(releases):
            each()

    return NativeValue(address, is_error=failed, cleanup=release)


def _fill(of: Struct, value: Any, address: Any, c: Any, failures: list[Any], releases: list[Any]) -> None:
    for n, member in enumerate(of.members):
        item, inner = c.pyapi.tuple_getitem(value, n), cgutils.gep_inbounds(c.builder, address, 0, n)
        if isinstance(member, Struct):
            _fill(member, item, inner, c, failures, releases)
            continue
        native = c.unbox(member, item)
        c.builder.store(native.value, inner)
        failures.append(native.is_error)
        if native.cleanup is not None:
            releases.append(native.cleanup)
        if c.context.enable_nrt:
            releases.append(partial(c.context.nrt.decref, c.builder, member, native.value))
