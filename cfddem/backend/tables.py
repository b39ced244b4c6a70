"""Tables of the terminal: the one place that lays them out, as lines of text or in colour.

>>> table([("bed height", "0.043 m"), ("regime", "bubbling")], indent=2)
['  bed height 0.043 m', '  regime     bubbling']
"""

from __future__ import annotations

import io
import shutil
import sys
from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

WIDTH = 100
"""Widest line [characters]."""

NARROWEST = 72
"""Lines are not made narrower than this on a narrow terminal [characters]."""


def line_width() -> int:
    """Width of a printed line: that of the terminal, within limits; WIDTH where output goes elsewhere [characters]."""
    if sys.stdout is None or not sys.stdout.isatty():
        return WIDTH
    return max(NARROWEST, min(WIDTH, shutil.get_terminal_size().columns))


def table(
    rows: Iterable[Sequence[str]],
    headings: Sequence[str] = (),
    *,
    right: Collection[int] = (),
    widths: Sequence[int] = (),
    gap: int = 1,
    indent: int = 0,
) -> list[str]:
    """A table as lines; where it is wider than the line, cells continue below.

    right   numbers of the columns that end at the right
    widths  least width of the first columns
    gap     spaces between columns
    indent  spaces before each line
    """
    from rich.console import Console

    wide = line_width()
    columns = grid(rows, headings, right=right, widths=widths if wide == WIDTH else (), gap=gap)
    if not columns.columns:
        return []
    page = Console(file=io.StringIO(), width=wide - indent, color_system=None, legacy_windows=False, record=False)
    page.print(columns)
    return [f"{' ' * indent}{line}".rstrip() for line in page.file.getvalue().splitlines()]  # type: ignore[attr-defined]


def grid(
    rows: Iterable[Sequence[str | Text]],
    headings: Sequence[str] = (),
    *,
    right: Collection[int] = (),
    widths: Sequence[int] = (),
    gap: int = 1,
) -> Table:
    """A table for a console of rich; arguments as of :func:`table`. Cells are text without markup."""
    from rich.table import Table
    from rich.text import Text

    listed = [[Text(cell) if isinstance(cell, str) else cell for cell in row] for row in rows]
    count = max(map(len, [headings, *listed]), default=0)
    columns = Table(
        box=None, padding=(0, gap, 0, 0), pad_edge=False, show_header=bool(headings), header_style="bold",
        highlight=False,
    )  # fmt: skip
    for place in range(count):
        columns.add_column(
            Text(headings[place]) if headings else "", justify="right" if place in right else "left",
            no_wrap=place in right, overflow="fold", min_width=widths[place] if place < len(widths) else None,
        )  # fmt: skip
    for row in listed:
        columns.add_row(*row)
    return columns
