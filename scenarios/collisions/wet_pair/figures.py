"""Figures of the wet pair: restitution and spin against the Stokes number, for each film, angle and friction."""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, blank, label, legend, panels, shades

Curve = dict[float, np.ndarray]
TITLES = {
    ("static", "constant"): "static bridge, constant below $h_{min}$",
    ("static", "zero"): "static bridge, nothing below $h_{min}$",
    ("deforming", "constant"): "deforming bridge, constant below $h_{min}$",
    ("deforming", "zero"): "deforming bridge, nothing below $h_{min}$",
}


def films(stokes: np.ndarray, curves: dict[tuple[str, str], Curve]) -> Any:
    """Restitution of four films at five angles, as in figure 8 of Punch et al. (2023)."""
    figure, panel = blank(2, 2, width=10.0, height=7.2, sharex=True, sharey=True)
    for axes, (kind, curve) in zip(panel, curves.items()):
        for (angle, values), colour in zip(curve.items(), shades(len(curve))):
            axes.plot(stokes, values, color=colour, label=f"{angle:g} deg")
        axes.set(xlim=(0, stokes[-1]), ylim=(0, 1))
        label(axes, "Stokes number  $St_n$", "-", "restitution  $e_n$", "-", TITLES[kind])
        axes.label_outer()
    legend(panel[0], loc="upper left")
    return figure


def spins(stokes: np.ndarray, curves: dict[float, Curve]) -> Any:
    """Spin after the collision without and with friction, as in figure 12 of Punch et al. (2023)."""
    figure, panel = panels(len(curves), width=9.6, height=4.2, sharey=True)
    for axes, (friction, curve) in zip(panel, curves.items()):
        for (angle, values), colour in zip(curve.items(), shades(len(curve))):
            axes.plot(stokes, values, color=colour, label=f"{angle:g} deg")
        axes.set(xlim=(0, stokes[-1]), ylim=(0, None))
        label(axes, "Stokes number  $St_n$", "-", r"spin  $\omega$", "rad/s", rf"friction  $\mu$ = {friction:g}")
    panel[1].set_ylabel("")
    legend(panel[0], loc="upper right")
    return figure


def tangential(stokes: np.ndarray, curves: dict[str, np.ndarray]) -> Any:
    """Restitution at 60 degrees for each film across the line of centres, as in figure 14 of Punch et al. (2023)."""
    figure, axes = panels(width=8.0, height=4.4)
    for (name, values), colour in zip(curves.items(), (BLUE, ORANGE, GREY, GREEN, RED)):
        axes.plot(stokes, values, color=colour, label=name)
    axes.set(xlim=(0, stokes[-1]), ylim=(0, 0.8))
    label(axes, "Stokes number  $St_n$", "-", "restitution  $e_n$", "-", "Impact at 60 degrees, watched for 1 s")
    legend(axes, loc="upper left")
    return figure
