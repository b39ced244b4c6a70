"""The figure of a sweep: means against the first key that was changed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cfddem.case.compare import Points
from cfddem.case.input_errors import field_of
from cfddem.case.schema import Case
from cfddem.io.quantities import shown_unit
from cfddem.plotting.curves import BLUE, ORANGE, blank, label, legend, legend_below, save, shades

SHOWN = ("bed_height", "bed_voidage", "pressure_drop")
"""Measures in the figure."""

VELOCITY = "bed.inlet_velocity"
"""Key of a sweep beside which measured curves are drawn."""

MOST_LABELLED = 8
"""Largest number of curves with a legend."""


class Point(NamedTuple):
    """One finished run."""

    values: Mapping[str, Any]  # of the changed keys
    measures: Mapping[str, tuple[float, float, str]]  # mean, error, unit


def sweep_figure(points: Sequence[Point], path: Path, measured: Sequence[Points] = ()) -> bool:
    """Draw the means against the first key with numbers, one curve for each combination of the other keys.

    Where all keys have words, each word of the first key has its place, and its points are not joined.

    measured  curves against the inlet velocity, for a sweep of it
    returns   whether there was anything to draw
    """
    names = [name for name in SHOWN if points and all(name in each.measures for each in points)]
    if not names:
        return False
    keys = list(points[0].values)
    first = next((key for key in keys if _is_numeric(points, key)), keys[0])
    numeric, others = _is_numeric(points, first), [key for key in keys if key != first]
    groups: dict[str, list[Point]] = {}
    for each in points:
        group = ", ".join(f"{key.split('.')[-1]} = {each.values[key]}" for key in others)
        groups.setdefault(group, []).append(each)
    ticks = {value: k for k, value in enumerate(dict.fromkeys(str(each.values[first]) for each in points))}
    figure, panels = blank(1, len(names), width=4.2 * len(names), height=4.0)
    for name, panel in zip(names, panels):
        for (group, members), colour in zip(groups.items(), shades(len(groups))):
            x = [each.values[first] if numeric else ticks[str(each.values[first])] for each in members]
            mean, error = zip(*(each.measures[name][:2] for each in members))
            bars = [0.0 if math.isnan(each) else each for each in error]
            style = "o-" if numeric else "o"
            panel.errorbar(x, mean, yerr=bars, fmt=style, color=colour, capsize=2.0, label=group or None)
            if name == "bed_voidage" and numeric and not others:
                _draw_laws(panel, x, members)
        if first == VELOCITY:
            _draw_measured(panel, [each for each in measured if each.quantity == name])
        unit = shown_unit(points[0].measures[name][2])
        label(panel, first, unit_of(first), name.replace("_", " "), unit)
        if not numeric:
            panel.set_xticks(range(len(ticks)), list(ticks))
            panel.set_xlabel(first)
            panel.margins(x=0.2)
    if others and len(groups) <= MOST_LABELLED:
        legend_below(figure, panels[0])
    save(figure, path)
    return True


def _is_numeric(points: Sequence[Point], key: str) -> bool:
    """Whether all values of a key are numbers."""
    return all(isinstance(each.values[key], int | float) for each in points)


def _draw_measured(panel: Any, measured: Sequence[Points]) -> None:
    """Draw measured points with their errors."""
    for each in measured:
        bars = np.where(np.isfinite(each.error), each.error, 0.0)
        style = {"color": ORANGE, "markersize": 5.0, "capsize": 2.5, "zorder": 3}
        panel.errorbar(each.place, each.value, yerr=bars, fmt="s", label=f"measured: {each.name}", **style)
    if measured:
        legend(panel)


def _draw_laws(panel: Any, x: Sequence[Any], points: Sequence[Point]) -> None:
    """Draw the voidages by published laws that all points have."""
    laws = [name for name in points[0].measures if name.startswith("voidage by ")]
    for name, style in zip(laws, ("--", ":", "-.")):
        if all(name in each.measures for each in points):
            panel.plot(x, [each.measures[name][0] for each in points], style, color="0.4", label=name[11:])
    if laws:
        legend(panel)


def sample_figure(points: Sequence[Point], path: Path) -> bool:
    """Draw the means of runs with sampled values: a row for each measure, a column for each key.

    returns  whether there was anything to draw
    """
    names = [name for name in SHOWN if points and all(name in each.measures for each in points)]
    if not names:
        return False
    keys = list(points[0].values)
    figure, panels = blank(
        len(names), len(keys), width=0.6 + 3.4 * len(keys), height=0.6 + 2.8 * len(names), sharex="col", sharey="row"
    )
    for place, panel in enumerate(panels):
        name, key = names[place // len(keys)], keys[place % len(keys)]
        mean, error = zip(*(each.measures[name][:2] for each in points))
        bars = [0.0 if math.isnan(each) else each for each in error]
        panel.errorbar([each.values[key] for each in points], mean, yerr=bars, fmt="o", color=BLUE, capsize=2.0)
        label(panel, key, unit_of(key), name.replace("_", " "), shown_unit(points[0].measures[name][2]))
        panel.label_outer()
    save(figure, path)
    return True


def unit_of(key: str) -> str:
    """Unit of a key of a case, from its description."""
    found = re.search(r"\[([^\]]*)\]$", field_of(Case, key.split(".")) or "")
    return found[1] if found else "-"
