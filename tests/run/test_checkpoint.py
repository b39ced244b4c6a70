"""Checkpoints: bit for bit, two kept, damaged ones skipped with a warning."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from cfddem.backend.errors import InputError, RunFailed
from cfddem.io import checkpoint
from cfddem.io.checkpoint import newest, write
from cfddem.particles.collision_events import COLLISION

ODD = np.array([np.nan, -np.nan, -0.0, np.inf, 5e-324, 1.0 + 2.0**-52, -1e308])


def state(number: int = 0) -> dict:
    generator = np.random.default_rng(number)
    generator.random(3)
    return {
        "time": 0.1 + 0.2,
        "steps": 2**70 + number,
        "case": "größe = 1\n",
        "nothing": None,
        "flag": True,
        "list": [1, 0.1, "a"],
        "random": generator.bit_generator.state,
        "particles": {
            "position": generator.standard_normal((50, 3)),
            "odd": ODD,
            "id": np.arange(50),
            "empty": np.zeros((0, 3)),
        },
        "pairs": {
            "first": np.arange(5, dtype=np.int32),
            "sliding": np.array([True, False]),
            "scalar": np.float64(1 / 3),
        },
        "rows": np.zeros(3, COLLISION),
    }


def same(left: object, right: object) -> bool:
    """Equal in type and in every bit, NaN included."""
    if isinstance(left, dict):
        return isinstance(right, dict) and [*left] == [*right] and all(same(left[k], right[k]) for k in left)
    if isinstance(left, np.ndarray | np.generic):
        right_array = np.asarray(right)
        return (
            left.dtype == right_array.dtype
            and np.shape(left) == right_array.shape
            and np.ascontiguousarray(left).tobytes() == np.ascontiguousarray(right).tobytes()  # type: ignore[arg-type]
        )
    return type(left) is type(right) and left == right


def damage(path: Path, place: int) -> None:
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)


def test_a_state_is_restored_bit_for_bit(tmp_path):
    write(tmp_path, state())
    assert same(state(), newest(tmp_path))


def test_a_random_generator_continues(tmp_path):
    generator = np.random.default_rng(5)
    generator.random(11)
    write(tmp_path, {"random": generator.bit_generator.state})
    other = np.random.default_rng()
    other.bit_generator.state = newest(tmp_path)["random"]
    assert np.array_equal(other.random(9), generator.random(9))


def test_two_are_kept_and_h5py_opens_them(tmp_path):
    for number in range(5):
        write(tmp_path, state(number))
    kept = sorted((tmp_path / "checkpoint").iterdir())
    assert [path.name for path in kept] == ["00000003.h5", "00000004.h5"]
    with h5py.File(kept[1]) as file:
        assert np.array_equal(file["particles/position"][:], state(4)["particles"]["position"])


@pytest.mark.parametrize("how", ["flipped", "truncated", "emptied", "head"])
def test_a_damaged_checkpoint_is_reported_and_the_previous_one_used(tmp_path, caplog, how):
    for number in range(2):
        path = write(tmp_path, state(number))
    content = path.read_bytes()
    if how in ("flipped", "head"):
        damage(path, 20 if how == "head" else len(content) // 2)
    else:
        path.write_bytes(content[: 0 if how == "emptied" else -1])
    assert same(state(0), newest(tmp_path))
    assert "00000001.h5" in caplog.text and "checksum" in caplog.text and len(caplog.records) == 1


def test_every_flipped_bit_is_detected(tmp_path):
    """Single bits throughout the file: head, numbers, structure."""
    write(tmp_path, state(0))
    path = write(tmp_path, state(1))
    size = path.stat().st_size
    for place in [*range(0, 120, 7), *range(512, size, size // 60)]:
        damage(path, place)
        assert newest(tmp_path)["steps"] == 2**70, place
        damage(path, place)
    assert newest(tmp_path)["steps"] == 2**70 + 1


def test_a_damaged_checkpoint_does_not_replace_a_good_one(tmp_path):
    for number in range(2):
        path = write(tmp_path, state(number))
    damage(path, 2000)
    write(tmp_path, state(2))
    assert [each.name for each in sorted((tmp_path / "checkpoint").iterdir())] == ["00000000.h5", "00000002.h5"]


def test_without_a_good_checkpoint_the_error_names_the_remedy(tmp_path):
    with pytest.raises(InputError, match="run the case again"):
        newest(tmp_path)
    for number in range(2):
        damage(write(tmp_path, state(number)), 3000)
    with pytest.raises(RunFailed, match=r"all checkpoints are damaged \(1\)"):  # the first was not kept
        newest(tmp_path)


def test_a_checkpoint_of_a_newer_format_is_refused_and_not_skipped(tmp_path, monkeypatch):
    write(tmp_path, state(0))
    with monkeypatch.context() as later:
        later.setattr(checkpoint, "FORMAT", 9)
        write(tmp_path, state(1))
    with pytest.raises(InputError, match=rf"00000001\.h5: format = 9: must be {checkpoint.FORMAT}; .*newer version"):
        newest(tmp_path)


def test_a_checkpoint_of_an_earlier_format_is_refused_with_a_remedy(tmp_path, monkeypatch):
    with monkeypatch.context() as earlier:
        earlier.setattr(checkpoint, "FORMAT", 1)
        write(tmp_path, state(0))
    remedy = r"earlier version of cfddem; run .*case\.toml again"
    with pytest.raises(InputError, match=rf"format = 1: must be {checkpoint.FORMAT}; .*{remedy}"):
        newest(tmp_path)


@pytest.mark.parametrize("value", [object(), np.array([object()]), {1, 2}, np.array(["text"])])
def test_a_value_that_cannot_be_stored_is_named(tmp_path, value):
    with pytest.raises(InputError, match=r"state\.pair\.thing"):
        write(tmp_path, {"pair": {"thing": value}})
    assert not list((tmp_path / "checkpoint").iterdir())
