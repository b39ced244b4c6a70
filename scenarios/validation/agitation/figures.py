"""Figure of agitation: what the unresolved model gives over the resolved runs.

`python -m scenarios.validation.agitation.figures TABLE.json OUTPUT.png` draws the table of `cfddem validate agitation`.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

from cfddem.plotting.curves import BLUE, GREEN, ORANGE, blank, label, legend, save

POINT = re.compile(r"density ratio ([\d.]+), solid fraction ([\d.]+)(?:, Re_m (\d+))?: (.*)")
QUANTITIES = ("granular temperature", "anisotropy", "collision rate")
MARKS = {"1.03": ("o", BLUE), "2.5": ("s", ORANGE), "3.6": ("D", GREEN), "7": ("^", "black")}
"""Marker and colour of each density ratio."""


def figure(rows: list[dict[str, Any]], path: Path) -> None:
    """Ratio of the unresolved to the resolved value against the solid fraction; hollow points were fitted."""
    drawn, axes = blank(1, len(QUANTITIES), width=9.0, height=4.0, sharey=True)
    for each, quantity in zip(axes, QUANTITIES):
        each.axhspan(0.7, 1.3, color="#eeeeee", zorder=0)
        each.axhline(1.0, color="black", lw=1.0)
        each.set_xlim(0.15, 0.57)
        each.set_yscale("log")
        each.set_yticks([0.5, 0.7, 1.0, 1.3, 1.7], ["0.5", "0.7", "1", "1.3", "1.7"])
        each.minorticks_off()
        label(each, "solid fraction", "-", "unresolved over resolved" if each is axes[0] else "", "-", quantity)
    axes[1].set_ylabel("")
    axes[2].set_ylabel("")
    for row in rows:
        if found := POINT.match(row["quantity"]):
            marker, colour = MARKS[found[1]]
            face = "white" if row["verdict"] == "report" else colour
            panel, place = axes[QUANTITIES.index(found[4])], (float(found[2]), row["value"])
            panel.plot(*place, marker, color=colour, mfc=face, mew=1.6, ms=8)
            if found[3]:
                panel.annotate(f"$Re_m$ {found[3]}", place, (6, -3), textcoords="offset points", fontsize="small")
    for ratio, (marker, colour) in MARKS.items():
        axes[0].plot([], [], marker, color=colour, ms=8, label=f"density ratio {ratio}")
    axes[0].plot([], [], "o", color="black", mfc="white", mew=1.6, ms=8, label="hollow: fitted")
    legend(axes[0], loc="upper left")
    save(drawn, path)


if __name__ == "__main__":
    figure(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))["rows"], Path(sys.argv[2]))
