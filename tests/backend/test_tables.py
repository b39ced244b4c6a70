"""Tables of the terminal."""

from __future__ import annotations

from cfddem.backend.tables import WIDTH, table


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
