"""A case written as TOML and read again is equal, whatever its keys are changed to; None is never lost."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from functools import cache
from typing import Any, Literal

import pytest
from example_case import MIXTURE, TEXT
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery_files, overrides
from cfddem.case.input_errors import sections_of
from cfddem.case.schema import Case
from cfddem.cli.explain_pages import key_lines, matching

GALLERY = gallery_files()
SAMPLE = ("liquid-bed", "segregation", "settling", "wet-bed")


def sections(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A section of a case and all sections within it."""
    yield model
    for field in model.model_fields.values():
        for each in sections_of(field):
            yield from sections(each)


def fields_of(model: BaseModel, table: str = "") -> dict[str, FieldInfo]:
    """Every key of a case that is not a table, by its dotted name."""
    found: dict[str, FieldInfo] = {}
    for name, field in type(model).model_fields.items():
        value, key = getattr(model, name), f"{table}{name}"
        inner = {"": value} if isinstance(value, BaseModel) else value if isinstance(value, dict) else {}
        inner = dict(enumerate(value)) if isinstance(value, tuple) and sections_of(field) else inner
        tables = {each: part for each, part in inner.items() if isinstance(part, BaseModel)}
        for each, part in tables.items():
            found |= fields_of(part, f"{key}.{each}." if each != "" else f"{key}.")
        if not sections_of(field):
            found[key] = field
    return found


def read_again(case: Case) -> Case:
    return Case.from_text(case.to_toml())


@cache
def cases() -> dict[str, Case]:
    return {
        "text": Case.from_text(TEXT),
        "mixture": Case.from_text(MIXTURE),
        **{name: Case.from_toml(GALLERY[name]) for name in SAMPLE},
    }


def test_a_key_that_can_be_none_has_no_other_default() -> None:
    """TOML has no null: a key that is not written reads back as its default. Such a key needs a word instead."""
    lost = [
        f"{section.__name__}.{name}"
        for section in set(sections(Case))
        for name, field in section.model_fields.items()
        if type(None) in typing.get_args(field.annotation) and field.get_default(call_default_factory=True) is not None
        and not field.is_required()
    ]  # fmt: skip
    assert not lost


@pytest.mark.parametrize("name", ["text", "mixture", *SAMPLE])
def test_none_is_refused_or_read_back_for_every_key(name: str) -> None:
    case, accepted = cases()[name], []
    for key in fields_of(case):
        try:
            changed = case.with_(**{key: None})
        except InputError:
            continue
        accepted.append(key)
        assert read_again(changed) == changed, key
    assert {"laws.drag", "run.every", "column.depth"} <= set(accepted)


def test_no_drag_has_a_word_in_python_files_and_on_the_command_line() -> None:
    case = Case.from_text(TEXT)
    none = case.with_(**{"laws.drag": None})
    assert none.laws.drag_law is None and case.laws.drag_law is not None
    assert 'drag = "none"' in none.to_toml()
    written = TEXT.replace('drag = "di_felice"', 'drag = "none"')
    for same in (read_again(none), Case.from_text(written), Case.from_text(TEXT, "a", overrides(["laws.drag=none"]))):
        assert same == none and same.laws.drag_law is None
    assert "none (no drag)" in " ".join(key_lines(matching("laws.drag")))


def values_of(field: FieldInfo) -> st.SearchStrategy[Any]:
    """Values of the types of a key; limits may refuse some of them."""
    found: list[st.SearchStrategy[Any]] = []
    numbers = st.floats(0.0, 2.0) | st.floats(-1e6, 1e6) | st.sampled_from([1e-3, 0.01, 0.1, 0.25, 1.0, 3.0])
    plain = {float: numbers, int: st.integers(0, 3000), bool: st.booleans(), type(None): st.none()}

    def add(annotation: Any) -> None:
        if annotation in plain:
            found.append(plain[annotation])
        elif annotation is str:
            found.append(st.sampled_from(["none", "auto", "hertz", "beetstra", "zuber", "glass"]) | st.text(max_size=9))
        elif typing.get_origin(annotation) is Literal:
            found.append(st.sampled_from(typing.get_args(annotation)))
        elif typing.get_origin(annotation) is tuple and (parts := typing.get_args(annotation))[-1] is float:
            found.append(st.tuples(*[numbers] * len(parts)))
        elif typing.get_origin(annotation) is not dict:
            for each in typing.get_args(annotation):
                add(each)

    add(field.annotation)
    return st.one_of(found)


@settings(deadline=None, max_examples=60, derandomize=True, database=None)
@given(st.data())
def test_a_case_with_random_keys_is_read_back_as_it_was_written(data: st.DataObject) -> None:
    case = cases()[data.draw(st.sampled_from(sorted(cases())))]
    fields = fields_of(case)
    for _ in range(8):
        key = data.draw(st.sampled_from(sorted(fields)))
        try:
            case = case.with_(**{key: data.draw(values_of(fields[key]))})
        except InputError:
            continue
        assert read_again(case) == case, key
