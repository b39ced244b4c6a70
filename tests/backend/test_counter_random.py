"""Random numbers by counter: known answers of the generator, moments, and independence."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.backend.compile import serial
from cfddem.backend.counter_random import normal_numbers, philox


@serial
def words(counter, key):
    return philox(
        (np.uint64(counter[0]), np.uint64(counter[1]), np.uint64(counter[2]), np.uint64(counter[3])),
        (np.uint64(key[0]), np.uint64(key[1])),
    )


@pytest.mark.parametrize(
    "counter, key, answer",
    [
        ((0, 0, 0, 0), (0, 0), "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            "d16cfe09 94fdcceb 5001e420 24126ea1",
        ),
    ],
)
def test_words_are_the_published_answers(counter: tuple[int, ...], key: tuple[int, ...], answer: str) -> None:
    """Known-answer vectors of philox4x32-10, distributed with the authors' library Random123."""
    found = words(np.array(counter, np.uint64), np.array(key, np.uint64))
    assert " ".join(f"{int(word):08x}" for word in found) == answer


def drawn(seed: int, step: int, purpose: int = 0, count: int = 50_000) -> np.ndarray:
    """Four normal numbers of many particles."""
    names, numbers = np.arange(count), np.empty((count, 4))
    _fill(seed, names, step, purpose, numbers)
    return numbers


@serial
def _fill(seed, names, step, purpose, numbers):
    for n in range(len(names)):
        a, b, c, d = normal_numbers(seed, names[n], step, purpose)
        numbers[n, 0], numbers[n, 1], numbers[n, 2], numbers[n, 3] = a, b, c, d


def test_numbers_are_standard_normal_and_independent() -> None:
    """Mean, variance and kurtosis within four standard errors; no correlation between numbers, steps, seeds, uses."""
    first = drawn(1, 7)
    count = len(first)
    assert np.abs(first.mean(axis=0)).max() < 4.0 / np.sqrt(count)
    assert np.abs(first.var(axis=0) - 1.0).max() < 4.0 * np.sqrt(2.0 / count)
    assert np.abs((first**4).mean(axis=0) - 3.0).max() < 4.0 * np.sqrt(96.0 / count)
    others = [first[:, 1], drawn(1, 8)[:, 0], drawn(2, 7)[:, 0], drawn(1, 7, purpose=1)[:, 0], np.roll(first[:, 0], 1)]
    for other in others:
        assert abs(np.mean(first[:, 0] * other)) < 4.0 / np.sqrt(count)


def test_a_number_depends_on_its_key_alone() -> None:
    assert np.array_equal(drawn(3, 5, count=100), drawn(3, 5, count=1000)[:100])
