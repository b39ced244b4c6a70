"""Figures of liquid beds: growth of waves by linear theory, waves of a run over height and time, speeds of impact."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfddem.analysis.fluctuations import Impacts, maxwellian_impact_speed
from cfddem.analysis.measures import bed_height
from cfddem.analysis.report import case_of, window_of
from cfddem.analysis.waves import LayerMap, Waves, layer_map, waves
from cfddem.io.reading import open_run
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, label, legend, panels, save
from cfddem.preflight.bed_waves import BedWaves

COUNT = 200
"""Wavelengths of a curve."""

BED = (0.1, 0.8)
"""Part of the bed height in which waves are sought."""


def growth_curves(found: BedWaves, output: Path) -> None:
    """Draw growth and speed of waves against wavelength.

    output  PNG
    """
    lengths = found.wavelengths(COUNT)
    figure, (left, right) = panels(2, width=9.6, height=3.9)
    several = found.agitated is not found.bed
    plain = [found.bed.wave(each) for each in lengths]
    in_mm = 1e3 * np.array(lengths)
    left.plot(in_mm, [each.growth for each in plain], color=GREY, linestyle="--", label="theory")
    left.plot(in_mm, [found.on_cells(found.bed, each).growth for each in lengths], color=BLUE, label="on the cells")
    right.plot(in_mm, [each.speed for each in plain], color=BLUE, label="without agitation")
    if several:
        agitated = [found.on_cells(found.agitated, each) for each in lengths]
        left.plot(in_mm, [each.growth for each in agitated], color=ORANGE, label="on the cells, agitated")
        right.plot(in_mm, [each.speed for each in agitated], color=ORANGE, label="agitated")
        legend(right)
    left.axhline(0.0, color=GREY, linewidth=0.8)
    lowest = min(found.on_cells(found.agitated, each).growth for each in lengths[COUNT // 4 :])
    left.set_ylim(bottom=max(lowest, -3.0 * max(each.growth for each in plain) - 1.0))
    legend(left)
    label(left, "wavelength", "mm", "growth rate", "1/s")
    label(right, "wavelength", "mm", "upward speed", "m/s")
    for axes in (left, right):
        axes.set_xlim(in_mm[0], in_mm[-1])
    save(figure, output)


def wave_map(folder: str | Path, output: str | Path | None = None) -> Path:
    """Draw the solid fraction of a run over time and height, with the speed of its waves.

    folder  of a run
    output  PNG; NAME-waves.png in the current folder if not given
    """
    run = open_run(folder)
    case = case_of(run)
    found = layer_map(run, case)
    begin, end = window_of(run, case)
    last = run.particles(-1)
    height = bed_height(last["position"], last["radius"])
    name = run.folder.resolve().name
    figure, axes = panels(1, width=8.0, height=4.2)
    draw_map(axes, found, waves(found, BED[0] * height, BED[1] * height, begin), (begin, end), name)
    output = Path(f"{name}-waves.png" if output is None else output)
    save(figure, output)
    return output


def draw_map(axes: object, found: LayerMap, wave: Waves, window: tuple[float, float], title: str = "") -> None:
    """Solid fraction over time and height; a line shows the speed of the waves."""
    from matplotlib.axes import Axes

    assert isinstance(axes, Axes)
    top = 1e3 * float(found.height[found.solid_fraction.max(axis=0) > 0.02].max(initial=found.height[0]))
    shades = axes.pcolormesh(
        found.time, 1e3 * found.height, found.solid_fraction.T, cmap="Blues", vmin=0.0,
        vmax=float(found.solid_fraction.max()), shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.figure.colorbar(shades, ax=axes, label="solid fraction  [-]")
    axes.set(xlim=(found.time[0], found.time[-1]), ylim=(1e3 * found.height[0], top))
    if np.isfinite(wave.speed) and wave.speed > 0.0:
        begin, passage = window[0], 0.7e-3 * top / wave.speed
        axes.plot([begin, begin + passage], [0.1 * top, 0.8 * top], color=ORANGE, linewidth=2.0)
        axes.text(
            0.01, 1.02, f"waves of {1e3 * wave.wavelength:.0f} mm, up at {wave.speed:.3f} m/s; "
            f"layers deviate by {wave.deviation:.3f}", transform=axes.transAxes, fontsize=9.5,
        )  # fmt: skip
    label(axes, "time", "s", "height", "mm")
    axes.set_title(title, loc="right", fontsize=11, fontweight="bold")
    axes.grid(False)


def draw_impacts(axes: object, found: Impacts, granular_temperature: float | None = None) -> None:
    """Distribution of the speeds of impact, and that of a Maxwellian gas with the granular temperature."""
    from matplotlib.axes import Axes

    assert isinstance(axes, Axes)
    axes.stairs(found.density, found.edges, color=BLUE, fill=True, alpha=0.4, label="run")
    if granular_temperature:
        speed = np.linspace(0.0, found.edges[-1], 200)
        axes.plot(speed, maxwellian_impact_speed(speed, granular_temperature), color=GREEN, label="Maxwellian")
    legend(axes)
    label(axes, "normal speed of approach", "m/s", "probability density", "s/m")
