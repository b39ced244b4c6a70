"""Figures of the film impact: the flow at P1 to P4, motion and energy, and restitution beside fit and film laws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, RED, blank, label, legend, panels, save, shades
from closures.restitution import singh
from scenarios.collisions.film_impact.materials import LIQUIDS, laws_of
from scenarios.collisions.film_impact.result import FilmImpact, Frame, Record
from scenarios.collisions.film_impact.solver import GridImpact
from scenarios.collisions.film_impact.study import impact
from scenarios.references.isph.impact import SmoothedImpact

TITLES = {
    "P1": "P1: meets the film", "P2": "P2: strikes the plate", "P3": "P3: has turned", "P4": "P4: leaves the film",
}  # fmt: skip
STYLES = {
    "fit": (GREY, ":"),
    "static bridge": (RED, "--"),
    "deforming bridge": (ORANGE, "-."),
    "immersed film": (GREEN, "--"),
    "deforming bridge and added mass": (BLUE, "--"),
    "reduced model": (BLUE, "-"),
}
"""Colour and line of each law."""

Case = tuple[float, str, float]
"""Diameter, liquid, depth of the film [m]."""


def draw_moments(path: Path, result: FilmImpact, diameter: float) -> None:
    """The bead in the film at the moments P1 to P4 that it has reached, with the pressure of the liquid."""
    count, (radial, vertical) = len(result.frames), result.frames["P1"].liquid.shape
    high = 0.5 + count * (0.5 + 1.75 * vertical / radial)
    figure, axes = blank(count, 1, width=9.0, height=high, layout="compressed", sharex=True, sharey=True)
    for axis, (name, frame) in zip(axes, sorted(result.frames.items())):
        _draw_frame(figure, axis, frame, 0.5 * diameter)
        axis.set_title(f"{TITLES[name]}, {frame.time * 1e3:.3f} ms", loc="left", fontweight="bold", fontsize=11)
        axis.set_ylabel("height  [mm]")
    axes[-1].set_xlabel("radius  [mm]")
    figure.draw_without_rendering()  # ticks depend on the layout, and the layout on the ticks
    save(figure, path, 130)


def _draw_frame(figure: Any, axis: Any, frame: Frame, radius: float) -> None:
    """One frame, mirrored at the axis: pressure in kPa on the liquid cells, liquid particles, and the bead."""
    shown = np.where(frame.liquid, frame.pressure / 1e3, np.nan)
    most = max(float(np.nanpercentile(np.abs(shown[frame.liquid]), 95.0)), 1e-3)
    shown = np.concatenate([shown[::-1], shown])
    wide, high = len(shown) * frame.dx * 500.0, shown.shape[1] * frame.dx * 1e3
    image = axis.imshow(
        shown.T, origin="lower", extent=(-wide, wide, 0.0, high), cmap="RdBu_r", vmin=-most, vmax=most, aspect="equal"
    )
    figure.colorbar(image, ax=axis, label="pressure  [kPa]", extend="both", shrink=0.85)
    r, z = frame.particles[::4].T * 1e3
    axis.plot(np.concatenate([-r, r]), np.concatenate([z, z]), ",", color="#333333", alpha=0.5)
    across = np.linspace(-radius, radius, 400)
    under = frame.gap + radius - np.sqrt(radius**2 - across**2)
    axis.fill_between(across * 1e3, under * 1e3, 10.0 * radius * 1e3, color="#d9d9d9", zorder=3)
    axis.plot(across * 1e3, under * 1e3, color="#555555", lw=1.0, zorder=4)
    axis.set(xlim=(-wide, wide), ylim=(0.0, high * 0.5))
    axis.grid(False)


def draw_motion(path: Path, slow: FilmImpact, fast: FilmImpact) -> None:
    """Speed of the bead against its height, and the energy of the liquid, of a slow and a fast impact."""
    figure, (left, middle, right) = panels(3, width=11.0, height=4.4)
    for result, colour in ((slow, BLUE), (fast, ORANGE)):
        history, speed = result.history, -result.p1.velocity
        name = f"{speed:g} m/s"
        left.plot(history["gap"] * 1e6, np.abs(history["velocity"]) / speed, color=colour, label=name)
        end = result.p4.time if np.isfinite(result.p4.time) else history["time"][-1]
        energy = history["liquid_kinetic"] / history["liquid_kinetic"].max()
        middle.plot(history["time"] / end, energy, color=colour, label=name)
    for name, colour in (("contact", GREY), ("viscous", BLUE), ("impulsive", ORANGE), ("liquid_kinetic", GREEN)):
        share = fast.energies[name] / max(fast.history[name][-1], 1e-30)
        right.plot(fast.history["time"] * 1e3, fast.history[name] * share, color=colour, label=name.replace("_", " "))
    label(left, "height of the lowest point", "um", "speed over that at P1", "-", "Motion: P1, P2, P3, P4")
    label(
        middle, "time over that of P4", "-", "kinetic energy of the liquid, over its peak", "-", "Energy of the liquid"
    )
    label(right, "time", "ms", "energy over that of the bead", "-", f"Where it goes, {-fast.p1.velocity:g} m/s")
    for axis in (left, middle, right):
        legend(axis)
    save(figure, path)


def draw_energies(path: Path, pairs: dict[str, tuple[FilmImpact, FilmImpact]]) -> None:
    """Kinetic energy of the liquid over time from its highest value, with smoothed particles and on the grid."""
    figure, axes = panels(2, width=11.0, height=4.6, sharey=True)
    for regime, axis in enumerate(axes, 1):
        chosen = {name: pair for name, pair in pairs.items() if pair[1].regime == regime}
        for (name, (smoothed, on_grid)), colour in zip(chosen.items(), (BLUE, ORANGE, GREEN)):
            for result, line, shown in ((on_grid, "-", name), (smoothed, "--", None)):
                time, energy = result.history["time"], result.history["liquid_kinetic"]
                since = (time - time[energy.argmax()]) / (result.p4.time - result.p2.time)
                axis.plot(since, energy / energy.max(), line, color=colour, label=shown)
        axis.plot([], [], "--", color=GREY, label="with smoothed particles")
        time_axis = "time since the highest energy, over that from P2 to P4"
        label(axis, time_axis, "-", "kinetic energy of the liquid, over its highest", "-", f"Regime {regime}")
        axis.set_xlim(-0.5, 1.0)
        legend(axis, loc="upper right")
    axes[1].set_ylabel("")
    save(figure, path)


def draw_restitution(path: Path, cases: dict[Case, list[FilmImpact]]) -> None:
    """Restitution against the Stokes number at each film ratio, beside the fit and the bracket of the added mass."""
    figure, axis = panels(width=8.6, height=5.2)
    for (case, results), colour in zip(cases.items(), shades(len(cases))):
        diameter, liquid, _ = case
        stokes = np.array([result.stokes for result in results])
        name = f"{diameter * 1e3:g} mm, {liquid}, $\\gamma$ = {results[0].film_ratio:.3f}"
        axis.plot(stokes, [result.restitution for result in results], "o", color=colour, label=name)
        line = np.geomspace(stokes[0], stokes[-1], 60)
        axis.plot(line, [singh(number, results[0].film_ratio) for number in line], color=colour, lw=1.2)
    axis.set_xscale("log")
    label(axis, "Stokes number", "-", "restitution", "-", "Resolved (points) and the fit of Singh et al. (lines)")
    legend(axis, loc="lower right")
    save(figure, path)


def draw_tension(path: Path, cases: dict[Case, dict[float | None, list[FilmImpact]]]) -> None:
    """Restitution without surface tension and with it, at each contact angle."""
    figure, axes = panels(len(cases), width=11.0, height=4.4, sharey=True)
    for axis, ((diameter, liquid, _), results) in zip(axes, cases.items()):
        for (angle, of_angle), (colour, mark) in zip(results.items(), ((GREY, "o-"), (BLUE, "s--"), (ORANGE, "^--"))):
            name = "no surface tension" if angle is None else f"surface tension, {angle:g} degrees"
            axis.plot(
                [-r.p1.velocity for r in of_angle], [r.restitution for r in of_angle], mark, color=colour, label=name
            )
        label(axis, "velocity", "m/s", "restitution", "-", f"{diameter * 1e3:g} mm, {liquid}")
    for axis in axes[1:]:
        axis.set_ylabel("")
    legend(axes[-1], loc="lower right")
    save(figure, path)


def draw_laws(path: Path, cases: dict[Case, list[FilmImpact]]) -> None:
    """The same impacts by laws of thin films."""
    chosen = [case for case in cases if case[0] in (8e-3, 2.8e-3) or case[1] == "m5"]
    figure, axes = panels(len(chosen), width=11.0, height=4.6, sharey=True)
    for axis, case in zip(axes, chosen):
        diameter, liquid, film = case
        speeds = np.array([-impact.p1.velocity for impact in cases[case]])
        laws = [laws_of(diameter, LIQUIDS[liquid], film, float(speed)) for speed in speeds]
        for name, (colour, line) in STYLES.items():
            axis.plot(speeds, [law[name] for law in laws], line, color=colour, label=name)
        axis.plot(speeds, [impact.restitution for impact in cases[case]], "o", color="#222222", label="resolved")
        label(axis, "velocity", "m/s", "restitution", "-", f"{diameter * 1e3:g} mm, {liquid}")
        axis.set_ylim(0.4, 1.0)
    for axis in axes[1:]:
        axis.set_ylabel("")
    legend(axes[0], loc="lower right")
    save(figure, path)


# ---------------------------------------------------------------- a movie of an impact


FRAMES, FRAMES_PER_SECOND = 30, 12
"""Frames in the time in which the bead would fall through the film at constant speed, and how fast they are shown."""

MOST = 150
"""Frames after which the movie ends, of a bead that sticks."""

AFTER_CONTACT = 8
"""Steps after contact that have a frame each: the suction lasts for microseconds."""

LINEAR, HIGHEST = 1.0, 1e4
"""Pressure up to which the colours are linear, and that at their ends [kPa]."""


def movie(
    path: Path,
    diameter: float = 8e-3,
    liquid: str = "water",
    film: float = 0.4e-3,
    velocity: float = 1.0,
    **options: Any,
) -> FilmImpact:
    """Compute an impact, and write its movie.

    path     of the movie, a GIF
    options  of :func:`~scenarios.collisions.film_impact.impact`, as the other arguments
    returns  the result of the impact
    """
    if path.suffix.lower() != ".gif":
        raise InputError("movie", str(path), "a file that ends in .gif")
    frames: list[Frame] = []
    turning: list[int] = []

    def keep(run: GridImpact | SmoothedImpact) -> None:
        turning.extend([run.steps] * (run.contacts > 0 and len(turning) < AFTER_CONTACT))
        due = run.time * velocity / film >= (len(frames) - len(turning)) / FRAMES
        if len(frames) < MOST and (due or turning[-1:] == [run.steps]):
            frames.append(Record(run).frame())

    result = impact(diameter, liquid, film, velocity, progress=keep, **options)
    _write(path, frames, 0.5 * diameter, f"{diameter * 1e3:g} mm, {liquid}, {velocity:g} m/s")
    return result


def _write(path: Path, frames: list[Frame], radius: float, name: str) -> None:
    """Draw the frames, and write them as a GIF."""
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import SymLogNorm

    figure, (axis,) = blank(1, 1, width=7.2, height=2.6, layout="compressed")
    first = frames[0]
    wide, high = len(first.liquid) * first.dx * 1e3, first.liquid.shape[1] * first.dx * 1e3
    image = axis.imshow(
        _shown(first).T, origin="lower", extent=(-wide, wide, 0.0, high), cmap="RdBu_r",
        norm=SymLogNorm(LINEAR, vmin=-HIGHEST, vmax=HIGHEST), interpolation="nearest",
    )  # fmt: skip
    figure.colorbar(image, ax=axis, label="pressure  [kPa]", ticks=[-1e4, -100, -1, 1, 100, 1e4], shrink=0.9)
    across = np.linspace(-radius, radius, 400) * 1e3
    axis.set_facecolor("#dde6dd")
    axis.grid(False)
    axis.set(xlim=(-wide, wide), ylim=(0.0, 0.7 * high), xlabel="radius  [mm]", ylabel="height  [mm]")
    clock = axis.set_title("", loc="left")
    beads: list[PolyCollection] = []

    def draw(number: int) -> list[object]:
        frame = frames[number]
        for bead in beads:
            bead.remove()
        under = 1e3 * (frame.gap + radius) - np.sqrt((1e3 * radius) ** 2 - across**2)
        beads[:] = [axis.fill_between(across, under, 1e4 * radius, color="#a8a8a8", edgecolor="#444444", zorder=3)]
        image.set_data(_shown(frame).T)
        clock.set_text(f"{name}: {frame.time * 1e3:.3f} ms")
        return [image, clock, *beads]

    draw(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # or the panel would move from frame to frame
    FuncAnimation(figure, draw, frames=len(frames)).save(path, PillowWriter(fps=FRAMES_PER_SECOND), dpi=100)  # type: ignore[arg-type]


def _shown(frame: Frame) -> np.ndarray:
    """Pressure in kPa in the liquid cells, mirrored at the axis; NaN elsewhere."""
    pressure = np.where(frame.liquid, frame.pressure / 1e3, np.nan)
    return np.concatenate([pressure[::-1], pressure])
