"""Where the panels of a picture stand on the paper."""

from __future__ import annotations

from dataclasses import dataclass

_LEFT, _GAP, _BAR, _RIGHT, _BELOW, _ABOVE, _TITLE = 0.85, 0.12, 0.14, 0.75, 0.62, 0.5, 0.42
_WIDTH, _HEIGHT, _NARROWEST = 8.0, 6.0, 0.9
_SIDE_BY_SIDE = 0.9  # height over width of the bed from which panels stand in a row, not in a column


@dataclass(frozen=True)
class Layout:
    """Where panels and their colour bars stand on the paper [inch]."""

    figure: tuple[float, float]
    panel: tuple[float, float]
    boxes: tuple[tuple[float, float, float, float], ...]  # left, bottom, width, height: panel, bar, panel, bar ...

    @classmethod
    def of(cls, many: int, tall: float) -> Layout:
        """The layout for a number of panels whose height is `tall` times their width; no wider than 800 pixels show."""
        beside = _LEFT + _GAP + _BAR + _RIGHT
        columns = (2 if many > 1 else 1) if tall >= _SIDE_BY_SIDE else 1
        rows = -(-many // columns)
        width = min(_WIDTH / columns - beside, _HEIGHT / tall)
        height = width * tall
        if width < _NARROWEST:  # a very tall bed: rather a longer page than a strip
            width, height = _NARROWEST, _NARROWEST * tall
        step_x, step_y = max(width + beside, 3.4), height + _BELOW + _ABOVE
        page = (columns * step_x, rows * step_y + _TITLE)
        boxes = []
        for place in range(many):
            left = place % columns * step_x + _LEFT
            bottom = page[1] - _TITLE - (place // columns + 1) * step_y + _BELOW
            boxes += [(left, bottom, width, height), (left + width + _GAP, bottom, _BAR, height)]
        return cls(page, (width, height), tuple(boxes))
