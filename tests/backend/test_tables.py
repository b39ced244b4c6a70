"""Tables of the terminal."""

from __future__ import annotations

import io
import sys

import pytest

from cfddem.backend.tables import NARROWEST, WIDTH, line_width, table


def test_columns_are_as_wide_as_asked_and_numbers_end_at_the_right() -> None:
    head, row = table([("law", "1.2", "Pa")], ("law", "run", "unit"), right=(1,), widths=(40, 10), indent=2)
    assert head == f"  {'law':<40} {'run':>10} unit"
    assert row == f"  {'law':<40} {'1.2':>10} Pa"


def test_text_stays_as_it_is() -> None:
    """No markup, no emoji, no colour: names of laws and keys have brackets and colons."""
    assert table([("wall[0]", "[bold]x[/bold] :smile: 1.5 m")]) == ["wall[0] [bold]x[/bold] :smile: 1.5 m"]


def test_long_cells_go_on_below_and_nothing_is_lost() -> None:
    words = " ".join(f"word{n}" for n in range(60))
    lines = table([("name", words, "3.5")], right=(2,), indent=4)
    assert max(map(len, lines)) <= WIDTH
    assert sorted(word for line in lines for word in line.split()) == sorted(["name", *words.split(), "3.5"])
    assert table([]) == []


@pytest.mark.parametrize(("columns", "width"), [(120, WIDTH), (80, 80), (20, NARROWEST)])
def test_lines_are_as_wide_as_the_terminal_and_nothing_is_cut_off(
    columns: int, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    assert line_width() == WIDTH  # not a terminal
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys, "stdout", Terminal())
    assert line_width() == width
    row = ("bed voidage from pressure", "0.6198 +- at least 0.0018", "drifts by +0.018; middle of the bed; and so on")
    lines = table([row], widths=(28, 28), indent=2)
    assert max(map(len, lines)) <= width
    assert sorted(word for line in lines for word in line.split()) == sorted(" ".join(row).split())
