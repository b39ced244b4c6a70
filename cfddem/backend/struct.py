"""Named tuples that compiled loops take by reference: a structure of structures of arrays, read by names.

A loop takes a plain named tuple as one argument for each number in it, seven for an array, and hands all of them on to
each function that it calls. A loop on all threads refuses tuples in tuples. A `struct` is one address for both: its
members are read where they are used. No member changes while a loop runs, so the compiler may read it once.

    @struct
    class System(NamedTuple): ...

The named tuples among its members are read by reference, too, and those of numbers alone by value. Loops over arrays
that must not overlap need each array as an argument of its own (`cfddem.particles.interactions.pair_loops`).
"""

from __future__ import annotations

import hashlib
from functools import cache, partial
from numbers import Number
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

    python_class  its class
    members       types of its members
    """

    def __init__(self, python_class: type, members: tuple[types.Type, ...]) -> None:
        self.python_class, self.members = python_class, members
        digest = hashlib.sha256(", ".join(map(str, (python_class, *members))).encode()).hexdigest()[:16]
        # short: it becomes part of the names of functions
        super().__init__(name=f"{python_class.__name__[:20]}_{digest}")

    @property
    def key(self) -> Any:
        """What tells it from other types."""
        return self.python_class, self.members


def struct(python_class: Made) -> Made:
    """Let compiled loops take instances of a class of named tuples by reference."""
    typeof_impl.register(python_class)(lambda value, context: _type_of(value, context))
    return python_class


def _type_of(value: Any, context: Any, whole: bool = True) -> types.Type:
    """Type of a structure, or of a member where `whole` is not set: numbers without arrays are read by value."""
    if hasattr(value, "_fields") and (whole or not _of_numbers(value)):
        return Struct(type(value), tuple(_type_of(member, context, False) for member in value))
    return typeof_impl(value, context)


def _of_numbers(value: Any) -> bool:
    return all(map(_of_numbers, value)) if isinstance(value, tuple) else isinstance(value, Number)


def _content(manager: Any, of: types.Type) -> Any:
    """What lies at the address of a structure, or of another member."""
    if not isinstance(of, Struct):
        return manager.lookup(of).get_value_type()
    return ir.LiteralStructType([_content(manager, member) for member in of.members])


@register_model(Struct)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    """The address of the members, which lie one after the other."""

    def __init__(self, manager: Any, of: Struct) -> None:
        super().__init__(manager, of, cgutils.voidptr_t)


@cache
def _offset(context: Any, of: Struct, place: int) -> Any:
    """Bytes from the address of a structure to a member."""
    content = _content(context.data_model_manager, of)
    return cgutils.intp_t(content.get_element_offset(context.target_data, place))


def _member(context: Any, builder: Any, of: Struct, address: Any, place: int) -> Any:
    """Address of a member. It has no type where the member is a structure: the text of types grows with each level."""
    inner, member = builder.gep(address, [_offset(context, of, place)], inbounds=True), of.members[place]
    if isinstance(member, Struct):
        return inner
    return builder.bitcast(inner, _content(context.data_model_manager, member).as_pointer())


@infer_getattr
class _Members(AttributeTemplate):  # type: ignore[misc]
    key = Struct

    def generic_resolve(self, of: Struct, name: str) -> types.Type | None:  # type: ignore[override]
        """Type of a member."""
        names = of.python_class._fields  # type: ignore[attr-defined]
        return of.members[names.index(name)] if name in names else None


@lower_getattr_generic(Struct)
def _read(context: Any, builder: Any, of: Struct, address: Any, name: str) -> Any:
    """A member: what it holds, or its address where it is a structure."""
    place = of.python_class._fields.index(name)  # type: ignore[attr-defined]
    member, inner = of.members[place], _member(context, builder, of, address, place)
    if isinstance(member, Struct):
        return inner
    row = isinstance(member, types.Array) and member.ndim == 1 and member.layout == "C"
    value = _loaded_row(context, builder, member, inner) if row else _loaded(builder, inner)
    return impl_ret_borrowed(context, builder, member, value)


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


def _loaded_row(context: Any, builder: Any, member: types.Array, address: Any) -> Any:
    """An array with one axis: only what its type does not tell is read, as most of the text of a loop is such reads."""
    model, row = context.data_model_manager[member], address.type.pointee
    size = cgutils.intp_t(context.get_abi_sizeof(context.get_data_type(member.dtype)))
    strides = {"itemsize": size, "strides": ir.Constant(row.elements[model.get_field_position("strides")], [size])}
    names = [model.get_field_position(name) for name in ("meminfo", "data", "nitems", "shape")]
    parts = [ir.Constant(length, None) for length in row.elements]
    for name, number in strides.items():
        parts[model.get_field_position(name)] = number
    value = ir.Constant(row, parts)
    for place in names:
        value = builder.insert_value(value, _loaded(builder, cgutils.gep_inbounds(builder, address, 0, place)), place)
    return value


@unbox(Struct)
def _taken(of: Struct, value: Any, c: Any) -> NativeValue:
    """Lay out the members of an instance for the time of a call."""
    room = cgutils.alloca_once(c.builder, _content(c.context.data_model_manager, of))
    address = c.builder.bitcast(room, cgutils.voidptr_t)
    failures: list[Any] = []
    releases: list[Any] = []
    _fill(of, value, address, c, failures, releases)
    failed = cgutils.false_bit
    for failure in failures:
        failed = c.builder.or_(failed, failure)

    def release() -> None:
        for release_member in reversed(releases):
            release_member()

    return NativeValue(address, is_error=failed, cleanup=release)


def _fill(of: Struct, value: Any, address: Any, c: Any, failures: list[Any], releases: list[Any]) -> None:
    for n, member in enumerate(of.members):
        item, inner = c.pyapi.tuple_getitem(value, n), _member(c.context, c.builder, of, address, n)
        if isinstance(member, Struct):
            _fill(member, item, inner, c, failures, releases)
            continue
        failures.append(c.builder.call(_once(c, member, "take", _take), [item, inner]))
        if c.context.enable_nrt and c.context.data_model_manager[member].contains_nrt_meminfo():
            releases.append(partial(c.builder.call, _once(c, member, "release", _release), [inner]))


def _once(c: Any, member: types.Type, purpose: str, fill: Any) -> Any:
    """A function of the module that treats all members of a type: what each did would be most of the code of a loop."""
    kind = _content(c.context.data_model_manager, member).as_pointer()
    item, flag = c.pyapi.pyobj, cgutils.bool_t
    signature = ir.FunctionType(flag, [item, kind]) if fill is _take else ir.FunctionType(ir.VoidType(), [kind])
    function = cgutils.get_or_insert_function(c.builder.module, signature, f".{purpose}.{member}")
    if not function.blocks:
        function.linkage = "internal"
        function.attributes.add("noinline")
        fill(c.context, ir.IRBuilder(function.append_basic_block()), member, *function.args)
    return function


def _take(context: Any, builder: Any, member: types.Type, item: Any, address: Any) -> None:
    """Put what Python has at an address; returns whether it fails."""
    api = context.get_python_api(builder)
    native = api.to_native_value(member, item)
    builder.store(native.value, address)
    assert native.cleanup is None
    builder.ret(native.is_error)


def _release(context: Any, builder: Any, member: types.Type, address: Any) -> None:
    """Count one reference less."""
    context.nrt.decref(builder, member, builder.load(address))
    builder.ret_void()
