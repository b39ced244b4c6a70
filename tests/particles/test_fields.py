"""Declared fields: rows keep their values through sorting, inserting and removing, and checkpoints are complete."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

import cfddem
from cfddem.backend.errors import InputError
from cfddem.model.fields import Field, Table
from cfddem.particles.state import PARTICLE_FIELDS, Particles, make_particles

FIELDS = (
    Field("id", dtype=np.int64),
    Field("position", "m", 3, snapshot=True),
    Field("start", "m", 3, "memory", lambda table, rows: table.position[rows]),
    Field("modes", "m/s", (2, 3), "memory"),
    Field("sampled", "m/s", 3, "memory", np.nan),
    Field("force", "N", 3, "scratch"),
)


def table(count: int = 5, first: int = 0) -> Table:
    """Rows with values that name their id and their component."""
    ids = first + np.arange(count)
    made = Table(FIELDS, count, {"id": ids, "position": ids[:, None] + np.array([0.0, 0.1, 0.2])})
    made.modes = ids[:, None, None] + np.arange(6).reshape(2, 3) / 10.0
    made.force = ids[:, None]
    return made


def consistent(rows: Table) -> bool:
    """Whether every row holds the values of its id."""
    ids = rows.id
    there = (rows.position == ids[:, None] + np.array([0.0, 0.1, 0.2])).all()
    return bool(there and (rows.modes == ids[:, None, None] + np.arange(6).reshape(2, 3) / 10.0).all())


def test_values_go_with_their_row() -> None:
    rows = table()
    rows.reorder(np.array([3, 1, 0, 4, 2]))
    assert rows.id.tolist() == [3, 1, 0, 4, 2] and consistent(rows)
    some = rows.copy(rows.id > 1)
    assert some.id.tolist() == [3, 4, 2] and consistent(some) and some.rows == 3
    some.position[:] = 0.0
    assert consistent(rows)
    assert rows.append(table(2, first=7)).tolist() == [5, 6]
    assert rows.id.tolist() == [3, 1, 0, 4, 2, 7, 8] and consistent(rows) and rows.rows == 7


def test_inserted_rows_start_at_initial_values() -> None:
    """A number, or a function of what is known of the row."""
    rows, fresh = table(), Table(FIELDS[:2], 2, {"id": [8, 9], "position": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]})
    rows.append(fresh)
    assert (rows.start[5:] == fresh.position).all() and (rows.start[:5] == rows.position[:5]).all()
    assert np.isnan(rows.sampled[5:]).all() and (rows.modes[5:] == 0.0).all() and (rows.force[5:] == 0.0).all()


def test_a_field_declared_later_starts_at_its_initial_value() -> None:
    rows, age = table(), Field("age", "s", initial=2.0)
    assert (rows.declare(age) == 2.0).all() and rows.age.shape == (5,)
    rows.age += np.arange(5)
    assert rows.declare(age).tolist() == [2.0, 3.0, 4.0, 5.0, 6.0]
    rows.reset("age")
    assert (rows.age == 2.0).all()


def test_an_assignment_changes_the_rows_and_keeps_the_array() -> None:
    """Loops and views hold the array itself."""
    rows = table()
    array = rows.position
    rows.position = 1.0
    rows.position += 1.0
    assert rows.position is array and (array == 2.0).all()
    with pytest.raises(AttributeError, match="Table has no field 'positon'; declare it first"):
        rows.positon = 1.0
    with pytest.raises(AttributeError, match="has no field 'age'"):
        _ = rows.age


def test_a_checkpoint_restores_all_but_scratch() -> None:
    rows, other = table(), table(3, first=50)
    other.restore(rows.checkpoint())
    assert consistent(other) and other.id.tolist() == rows.id.tolist() and other.rows == 5
    assert (other.force == 0.0).all() and "force" not in rows.checkpoint()
    assert rows.snapshot().keys() == {"position"}


def test_a_checkpoint_of_other_fields_is_refused_with_their_names() -> None:
    rows, longer = table(), table()
    longer.declare(Field("age", "s"))
    with pytest.raises(InputError, match=r"age.*fields that this run declares"):
        rows.restore(longer.checkpoint())
    with pytest.raises(InputError, match="must be one that holds age"):
        longer.restore(rows.checkpoint())


@pytest.mark.parametrize("name", ["two words", "_hidden", "volume", "rows"])
def test_a_name_that_cannot_be_an_attribute_is_refused(name: str) -> None:
    particles = make_particles(np.zeros((1, 3)), 1e-3, 2500.0)
    with pytest.raises(InputError, match=r"Field\.name"):
        particles.declare(Field(name))


def test_a_field_is_declared_in_one_way_only() -> None:
    with pytest.raises(InputError, match="field 'position': must be declared once"):
        table().declare(Field("position", "mm", 3))


def test_particles_have_unit_and_meaning_for_every_field() -> None:
    assert all(field.unit and field.meaning for field in PARTICLE_FIELDS)
    with pytest.raises(InputError, match="checkpoint"):
        Particles(PARTICLE_FIELDS, 0).restore({"position": np.zeros((2, 3))})


PER_ROW = {"particles.id", "self.particles.id", "particles.count", "self.particles.count"}
"""Sizes that only an array with one row for each particle has."""


def test_no_object_keeps_an_array_by_particle_outside_of_the_table() -> None:
    """An attribute of coupling or run that is made with the number of particles would not be sorted or inserted."""
    found = []
    for room in ("coupling", "run"):
        for path in (Path(cfddem.__file__).parent / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Assign) and any(_is_attribute(target) for target in node.targets):
                    sizes = {ast.unparse(each) for each in ast.walk(node.value) if isinstance(each, ast.Attribute)}
                    makes = any(isinstance(each, ast.Call) and _makes_array(each) for each in ast.walk(node.value))
                    if sizes & PER_ROW and makes:
                        found.append(f"{path.name}:{node.lineno}")
    assert not found


def _is_attribute(target: ast.expr) -> bool:
    return isinstance(target, ast.Attribute) and ast.unparse(target.value) == "self"


def _makes_array(call: ast.Call) -> bool:
    return ast.unparse(call.func) in {"np.zeros", "np.empty", "np.full", "np.ones"} or ".copy" in ast.unparse(call.func)
