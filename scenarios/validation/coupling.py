"""Particles and fluid together: a sphere that settles, packed beds, conservation, and liquid beds.

References: the terminal velocities and equations of motion of the drag laws; Mordant & Pinton (2000) and
ten Cate et al. (2002); MFIX DEM06; Ergun; the weight of the bed; published laws of bed expansion.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from cfddem.case.schema import Case
from cfddem.coupling.forces.drag import OWED
from cfddem.fluid import budgets
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from cfddem.preflight.expansion import SCATTER, expansions
from cfddem.run.simulation import Simulation
from scenarios.beds.liquid_bed import study as liquid_bed
from scenarios.beds.packed_bed import study as packed_bed
from scenarios.beds.settling import study as settling
from scenarios.references import history_force
from scenarios.validation.table import Curves, Progress, Row, in_parts, numbers, reference, worst

REYNOLDS = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
CELLS = (2.0, 4.0, 10.0)
PLACES = (0.5, 0.25, 0.0)
"""Centre of a cell, a quarter off, and a corner."""

COUPLED = ("E1", "E3")
"""Cases of ten Cate et al. that also run over a floor on a grid, the slowest part of the landings."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts(PARTS, _draw, folder, progress)


def terminal_velocities(curves: Curves) -> list[Row]:
    """One sphere in cells of 2 to 10 diameters, at several positions in the cell: its terminal velocity."""
    rows = []
    with_own, without = [], []
    for reynolds in REYNOLDS:
        falls = [settling.fall(reynolds, cell, place=place) for cell in CELLS for place in PLACES]
        limit = 0.05 if reynolds < 0.1 else 0.02
        points = [(fall.cell, fall.velocity, 1.0) for fall in falls]
        rows.append(worst(f"one sphere, Re {reynolds:g}: terminal velocity over that of the drag law", points, limit))
        with_own.append(max((fall.velocity for fall in falls), key=lambda v: abs(v - 1.0)))
        without.append(settling.fall(reynolds, 4.0, self_disturbance=False).velocity)
        rows.append(
            Row(f"one sphere, Re {reynolds:g}: without self-disturbance correction", without[-1], 1.0, note="cell 4 d")
        )
    curves["terminal"] = {
        "reynolds": (np.array(REYNOLDS), "-"),
        "velocity": (np.array(with_own), "-"),
        "uncorrected": (np.array(without), "-"),
    }
    return rows


def released(curves: Curves) -> list[Row]:
    """Spheres released in a liquid, against the equation of motion of their drag law and experiments."""
    rows = []
    bead, measured = settling.mordant(), numbers("mordant2000_glass_0p5mm")
    endless, fastest = settling.unbounded(bead, "brown_lawler"), measured["U_terminal"][0]
    plain = bead.with_(**{"laws.history": "none"})
    cases = [("Mordant", bead, endless, fastest), ("Mordant without history force", plain, endless, fastest)]
    for name, oil in _oils().items():
        cases.append((f"ten Cate {name}", settling.ten_cate(oil.density, oil.viscosity), oil.endless, oil.fastest))
    for name, case, endless, experiment in cases:
        times, speeds = settling.release(case)
        exact = settling.equation_of_motion(case, times)
        curves[f"release/{name.replace(' ', '_')}"] = {
            "time": (times, "s"), "speed": (speeds, "m/s"), "equation": (exact, "m/s"),
        }  # fmt: skip
        gap = float(np.abs(speeds - exact).max()) / exact[-1]
        rows.append(Row(f"{name}: largest deviation from the equation of motion, over the final speed", gap, 0.0, 0.01))
        rows.append(Row(f"{name}: terminal velocity over u_inf", speeds[-1] / endless, 1.0, 0.02))
        note = "no walls" if case.laws.history != "none" else "no history force, no walls"
        rows.append(Row(f"{name}: largest speed over measured", float(speeds.max()) / experiment, 1.0, note=note))
        if case.laws.drag == bead.laws.drag:
            late = np.argmax(speeds >= 0.95 * speeds[-1])
            reached = np.interp(0.95 * speeds[-1], speeds[late - 1 : late + 1], times[late - 1 : late + 1])
            limit = None if case is plain else 0.12
            rows.append(Row(f"{name}: 95 % time over measured", reached / measured["tau95"][0], 1.0, limit, note=note))
    return rows


def remembered(curves: Curves) -> list[Row]:
    """The history force of given motions, against direct convolutions with its kernel."""
    steady, steps = history_force.turning(100_000), (10, 100, 1000, 9999, 99_999)
    modelled = history_force.modelled(steady)[list(steps)]
    exact = history_force.convolved(steady, "present", steps)
    points = [(float(at), history_force.difference(*pair), 0.0) for at, *pair in zip(steps, modelled, exact)]
    title = "history force, slip that turns at constant speed, 1e5 steps: deviation from the convolution"
    rows = [worst(title, points, 2e-3, note="steps of 2 % of t_c")]
    impulses = history_force.around_impact()
    deviations = [abs(impulse.package - impulse.quadrature) for impulse in impulses]
    title = "history force around an impact at St 152: impulse over that of the fall, deviation from quadrature"
    rows.append(
        Row(title, max(deviations), 0.0, 1e-4, note=f"of {sum(impulse.quadrature for impulse in impulses):.4f}")
    )
    motions = {
        "0.5 mm glass from rest in water": {0.0: history_force.from_rest()},
        "slip that oscillates by 0.8 of its mean": {x: history_force.oscillating(x) for x in (0.1, 1.0, 10.0)},
        "steel that rebounds from a wall in oil at St 27": {0.0: history_force.rebounding()},
        "agitated slip": {float(seed): history_force.agitated(seed) for seed in (1, 2, 3, 4)},
    }
    readings: dict[str, Literal["present", "past"]] = {
        "at the present slip": "present", "at the earlier slip": "past",
    }  # fmt: skip
    note = "root mean square, over that of the force"
    for name, group in motions.items():
        forces = {at: history_force.modelled(motion) for at, motion in group.items()}
        for words, reading in readings.items():
            points = [
                (at, history_force.difference(forces[at], history_force.convolved(motion, reading)), 0.0)
                for at, motion in group.items()
            ]
            rows.append(worst(f"history force, {name}: deviation from the kernel {words}", points, note=note))
    return rows


def landings(curves: Curves) -> list[Row]:
    """The sphere of ten Cate et al. falls to the floor of their box, with the extra drag beside walls."""
    rows = []
    for case, oil in _oils().items():
        for walls in settling.WALLS:
            name = f"ten Cate {case}, drag beside walls: {walls}"
            gaps, speeds = settling.land(oil.density, oil.viscosity, walls, 1e-4)
            exact = settling.landing_ode(oil.density, oil.viscosity, walls, gaps)
            curves[f"landing/{case}_{walls}"] = {
                "gap": (gaps, "m"), "speed": (speeds, "m/s"), "equation": (exact, "m/s"),
            }  # fmt: skip
            away = np.abs(speeds - exact) / oil.endless
            rows.append(
                Row(f"{name}: largest deviation from the equation of motion, over u_inf", away.max(), 0.0, 0.01)
            )
            last = away[gaps < 2.0 * settling.RADIUS].max()
            rows.append(Row(f"{name}: the same in the last diameter over the floor", last, 0.0, 0.05))
            rows.append(Row(f"{name}: largest speed over measured", speeds.max() / oil.fastest, 1.0))
        for cell in (4.0, 2.0) if case in COUPLED else ():
            name = f"ten Cate {case} over a floor, coupled run, cells of {cell:g} d"
            gaps, speeds = settling.land_on_grid(oil.density, oil.viscosity, cell)
            exact = settling.landing_ode(oil.density, oil.viscosity, "nearest", gaps, floor_alone=True)
            away = float(np.abs(speeds - exact).max()) / oil.endless
            rows.append(Row(f"{name}: largest deviation from the equation of motion, over u_inf", away, 0.0, 0.01))
    return rows


class Oil(NamedTuple):
    """One of the oils of ten Cate et al., and their sphere in it."""

    density: float  # [kg/m3]
    viscosity: float  # [Pa s]
    endless: float  # terminal velocity without walls [m/s]
    fastest: float  # largest speed measured in the box [m/s]


def _oils() -> dict[str, Oil]:
    """Oils by the name of their case; where the largest speed is not printed, by its ratio to u_inf."""
    listed, oils = reference("tencate2002_cases"), {}
    for row, case in enumerate(listed["case"]):
        density, viscosity, endless, ratio = (
            float(listed[name][row]) for name in ("rho_f [kg/m3]", "mu_f [Pa s]", "u_inf [m/s]", "u_max_over_u_inf [-]")
        )
        printed = listed["u_max [m/s]"][row]
        fastest = float(printed) if printed[0].isdigit() else ratio * endless
        oils[case] = Oil(density, viscosity, endless, fastest)
    return oils


def dem06(curves: Curves) -> list[Row]:
    """MFIX DEM06: a particle in a steady gas stream at fixed velocity."""
    times, velocity, exact = settling.in_held_gas()
    curves["dem06"] = {"time": (times, "s"), "velocity": (velocity, "m/s"), "exact": (exact, "m/s")}
    return [Row("DEM06: velocity at 0.35 s over the exact one", velocity[-1] / exact[-1], 1.0, 1e-3)]


def packed(curves: Curves) -> list[Row]:
    """Packed beds over four decades of Re, and the Ergun test of a coupled code."""
    rows = []
    for drag in ("ergun", "wen_yu", "di_felice"):
        case = packed_bed.case(**{"laws.drag": drag})
        drops = [packed_bed.flow_through(case, velocity) for velocity in np.geomspace(1.5e-3, 15.0, 5)]
        points = [(drop.reynolds, drop.measured / drop.formula, 1.0) for drop in drops]
        rows.append(worst(f"packed bed, {drag}, Re 0.01 to 100: pressure drop over the formula", points, 0.01))
    listed = numbers("cfdem_ergun_test_dp")
    points = []
    for velocity, expected in list(zip(listed["U_superficial"], listed["dp_ergun"]))[::3]:
        drop = packed_bed.flow_through(packed_bed.case(), float(velocity), slab=(0.0, 1.0))
        points.append((velocity, drop.measured * 0.0156 / expected, 1.0))
    rows.append(worst("Ergun test of a coupled code: pressure drop", points, 0.02))
    return rows


def conserved(curves: Curves) -> list[Row]:
    """A stirred periodic box over 1000 fluid steps."""
    simulation = Simulation(STIRRED)
    particles, fluid = simulation.particles, simulation.fluid
    particles.velocity[:] = np.random.default_rng(7).normal(0.0, 0.02, particles.velocity.shape) + 0.01
    simulation.particle_solver.refresh()
    scale = float((particles.mass * np.linalg.norm(particles.velocity, axis=1)).sum())
    drift, start = [], _momentum(simulation)
    volume = float((4.0 / 3.0 * math.pi * particles.radius**3).sum())
    for _ in range(1000):
        simulation.step()
        drift.append(float(np.abs(_momentum(simulation) - start).max()) / scale)
    curves["momentum"] = {"drift": (np.array(drift), "-")}
    solids = float((1.0 - fluid.voidage).sum()) * fluid.grid.cell_volume / volume
    return [
        Row("periodic box, 1000 steps: change of momentum over sum of m|v|", max(drift), 0.0, 1e-10),
        Row("periodic box: deposited volume over that of the particles", solids, 1.0, 1e-12),
    ]


def _momentum(simulation: Simulation) -> np.ndarray:
    """Momentum of particles and fluid, less what the fluid receives in the next step (3,) [N s]."""
    particles = simulation.particles
    of_particles: np.ndarray = (particles.mass[:, None] * particles.velocity).sum(axis=0)
    return of_particles + budgets.momentum(simulation.fluid) - particles[OWED.name].sum(axis=0)


def liquid_beds(curves: Curves) -> list[Row]:
    """Beads of alumina and of alginate fluidised by water."""
    rows = []
    for material, study in liquid_bed.STUDIES.items():
        beds = [liquid_bed.fluidise(study, velocity) for velocity in study.velocities]
        for bed in beds:
            name = f"{material} in water, {bed.velocity:g} m/s"
            rows.append(Row(f"{name}: pressure drop over buoyant weight", bed.drop_over_weight, 1.0, 0.01))
            rows.append(_expansion(name, bed, expansions(study.case(bed.velocity)).scattered))
            rows.append(Row(f"{name}: voidage against the drag law's own balance", bed.voidage, bed.balance))
        velocities = [bed.velocity for bed in beds]
        exponent = liquid_bed.exponent(velocities, [bed.voidage for bed in beds])
        of_balance = liquid_bed.exponent(velocities, [bed.balance for bed in beds])
        name = f"{material} in water: exponent over that of"
        rows.append(Row(f"{name} Richardson-Zaki", exponent / beds[0].exponent, 1.0, 0.1))
        rows.append(Row(f"{name} the drag law's own balance", exponent / of_balance, 1.0, 0.1))
        curves[f"liquid_bed/{material}"] = {
            "velocity": (np.array([bed.velocity for bed in beds]), "m/s"),
            "voidage": (np.array([bed.voidage for bed in beds]), "-"),
            "expected": (np.array([bed.expected for bed in beds]), "-"),
        }
    return rows


def _expansion(name: str, bed: liquid_bed.FluidisedBed, scattered: bool) -> Row:
    """The voidage against the mean of the published laws that hold, or against their range where they scatter."""
    if not scattered:
        return Row(f"{name}: voidage against mean of published laws", bed.voidage, bed.expected, SCATTER[0])
    nearest = min(max(bed.voidage, bed.lowest), bed.highest)
    note = f"published laws: {bed.lowest:.3f} to {bed.highest:.3f}"
    return Row(f"{name}: voidage against the range of published laws", bed.voidage, nearest, SCATTER[0], note=note)


STIRRED = Case.from_text(
    "",
    overrides={
        "fluid": {"density": 1000.0, "viscosity": 1e-3},
        "material.sand": {"density": 2500.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": 0.01, "height": 0.02, "cell": 0.0025, "sides": "periodic", "ends": "periodic"},
        "bed": {"diameter": 1e-3, "count": 1200, "start": "suspended"},
        "laws": {"gravity": (0.0, 0.0, 0.0)},
        "run": {"until": 1.0, "reference_speed": 0.1, "fluid_step": 1e-4},
    },
)

PARTS = (terminal_velocities, released, remembered, landings, dem06, packed, conserved, liquid_beds)


def _draw(folder: Path, curves: Curves) -> None:
    """Terminal velocities with and without self-disturbance correction; a release; bed expansion."""
    figure, axes = panels(3, width=11.0)
    terminal = curves["terminal"]
    axes[0].semilogx(terminal["reynolds"][0], terminal["uncorrected"][0], "o-", color=GREY, label="uncorrected")
    axes[0].semilogx(
        terminal["reynolds"][0], terminal["velocity"][0], "s-", color=BLUE, label="corrected,\nworst of nine"
    )
    axes[0].axhline(1.0, color="black", linewidth=0.5)
    label(axes[0], "Reynolds number", "-", "terminal velocity over that of the drag law", "-")
    legend(axes[0], loc="upper right", title="self-disturbance")
    fall = curves["release/Mordant"]
    axes[1].plot(fall["time"][0], fall["speed"][0], color=BLUE, label="run")
    axes[1].plot(fall["time"][0], fall["equation"][0], ":", color=ORANGE, label="equation of motion")
    label(axes[1], "time", "s", "speed of fall", "m/s")
    legend(axes[1])
    for material, colour, marker in (("alumina", BLUE, "o"), ("alginate", ORANGE, "s")):
        beds = curves[f"liquid_bed/{material}"]
        axes[2].loglog(beds["voidage"][0], beds["velocity"][0], f"{marker}-", color=colour, label=material)
        axes[2].loglog(beds["expected"][0], beds["velocity"][0], ":", color=colour, label="mean of published laws")
    axes[2].set_xticks([0.55, 0.6, 0.7, 0.8], ["0.55", "0.6", "0.7", "0.8"])
    axes[2].set_yticks([0.01, 0.03, 0.1, 0.3], ["0.01", "0.03", "0.1", "0.3"])
    axes[2].minorticks_off()
    label(axes[2], "voidage", "-", "superficial velocity", "m/s")
    legend(axes[2])
    save(figure, folder / "coupling.png")
