"""How values look in a notebook: tables, and spheres as a small drawing; and templates of pages.

>>> table("Run", [("time", "0.2 s")])
'<div><b>Run</b><table><tr><td>time</td><td>0.2 s</td></tr></table></div>'
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel

from cfddem.backend.errors import shown

MOST_DRAWN = 2000
"""Most spheres of a drawing; of more, those nearest to the viewer are drawn."""

SHADES = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725")
"""Colours of slow to fast spheres: viridis, which colour-blind readers can read."""

_WIDTH, _HEIGHT = 260.0, 300.0  # largest size of a drawing [pixels]


def table(title: str, rows: Iterable[Sequence[str]], after: str = "") -> str:
    """A table with a title.

    rows   texts of the cells, which are escaped
    after  HTML beside the table
    """
    lines = ("".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows)
    body = f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"
    if after:
        body = f'<div style="display: flex; gap: 24px; align-items: flex-start">{body}<div>{after}</div></div>'
    return f"<div><b>{html.escape(title)}</b>{body}</div>"


def spheres(position: np.ndarray, radius: np.ndarray, velocity: np.ndarray, size: Sequence[float] | None = None) -> str:
    """Spheres seen from the front, coloured by speed, as an SVG drawing; empty without spheres.

    position, radius, velocity  (n, 3), (n,), (n, 3) [m, m, m/s]
    size                        edges of the box in view (3,), from the origin [m]; that of the spheres if not given
    """
    if not len(position):
        return ""
    low = np.zeros(3) if size is not None else (position - radius[:, None]).min(axis=0)
    high = (position + radius[:, None]).max(axis=0)
    high = high if size is None else np.minimum(np.array(size), np.array([size[0], size[1], 1.4 * high[2]]))
    span = np.maximum(high - low, 2.0 * float(radius.max()))
    depth = 0 if span[0] < span[1] else 1
    scale = min(_WIDTH / span[1 - depth], _HEIGHT / span[2])
    order = np.argsort(-position[:, depth] if depth == 1 else position[:, depth], kind="stable")[-MOST_DRAWN:]
    speed = np.linalg.norm(velocity, axis=1)
    fastest = float(np.quantile(speed, 0.99)) or 1.0
    shade = np.minimum((len(SHADES) * speed / fastest).astype(int), len(SHADES) - 1)
    x = scale * (position[:, 1 - depth] - low[1 - depth])
    y = scale * (high[2] - position[:, 2])
    circles = "".join(
        f'<circle cx="{x[i]:.1f}" cy="{y[i]:.1f}" r="{scale * radius[i]:.1f}" fill="{SHADES[shade[i]]}"/>'
        for i in order.tolist()
    )
    width, height = scale * span[1 - depth], scale * span[2]
    axes = f"{'yx'[depth]} 0 to {span[1 - depth]:.3g} m, z to {span[2]:.3g} m"
    return (
        f'<svg width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.1f} {height:.1f}" '
        f'style="border: 1px solid #bbb; background: white" stroke="white" stroke-width="0.4">{circles}</svg>'
        f"<br><small>{axes}; dark: at rest, yellow: {fastest:.2g} m/s</small>"
    )


# ---------------------------------------------------------------- a case in a notebook


def model_html(model: BaseModel) -> str:
    """A table of a case, or a part of it, as HTML."""
    return table(getattr(model, "title", "") or type(model).__name__, _rows(model, ""))


def _rows(model: BaseModel, before: str) -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every key that differs from its default."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if name == "title" or value is None or (not field.is_required() and value == field.get_default()):
            continue
        inner = list(_parts(value, f"{before}{name}"))
        for key, part in inner:
            yield from _rows(part, f"{key}.")
        if not inner:
            yield f"{before}{name}", _text(value), field.description or ""


def _parts(value: Any, key: str) -> Iterator[tuple[str, BaseModel]]:
    """The tables in a value, each with its key."""
    if isinstance(value, BaseModel):
        yield key, value
    elif isinstance(value, Mapping):
        yield from ((f"{key}.{name}", model) for name, model in value.items() if isinstance(model, BaseModel))
    elif isinstance(value, tuple):
        yield from ((f"{key}[{k}]", model) for k, model in enumerate(value) if isinstance(model, BaseModel))


def _text(value: Any) -> str:
    if callable(value):
        return str(getattr(value, "__name__", "user-defined law"))
    return f"{value:g}" if isinstance(value, float) else str(shown(value))


@cache
def page_template(name: str) -> Any:
    """The template of a page, by the name of its file in `cfddem/plotting`."""
    from jinja2 import Environment, PackageLoader

    return Environment(loader=PackageLoader("cfddem", "plotting"), autoescape=True).get_template(name)
