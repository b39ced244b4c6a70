"""`cfddem validate drying`: fluidised beds that dry, and wet ones that are one piece until they are dry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from scenarios.beds import drying_bed
from scenarios.validation.heat.hot_bed import LAWS, SEED
from scenarios.validation.table import Curves, Progress, Row, in_parts


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts((stuck, drying), _draw, folder, progress)


def drying(curves: Curves) -> list[Row]:
    """The drying bed of the gallery, beside the balance of heat and water."""
    bed, expected = drying_bed.drying(drying_bed.case())
    rate, leaves, plateau = (
        bed.mean(series, 0.2, 0.5) for series in (bed.rate, bed.by_air, bed.temperature)
    )  # of the constant rate
    curves["drying bed"] = {
        "time": (bed.time, "s"), "water": (bed.water, "-"), "rate": (bed.rate, "kg/s"),
        "by air": (bed.by_air, "kg/s"), "temperature": (bed.temperature, "K"),
    }  # fmt: skip
    note = "seeds at the floor dry first, and the air then leaves unsaturated"
    return [
        Row("drying bed: rate over that of the air that leaves, 0.2 to 0.5 s", rate / leaves, 1.0, 0.01),
        Row("drying bed: rate over that of the balance, 0.2 to 0.5 s", rate / expected.rate, 1.0, 0.01),
        Row("drying bed: plateau, balance", plateau, expected.temperature, 0.3, "K"),
        Row("drying bed: end of drying over that of the balance", bed.end / expected.end, 1.0, 0.02, note=note),
        Row("drying bed: imbalance of heat, vapour and liquid", bed.imbalance, 0.0, 1e-9),
    ]


BOND = {"solid_fraction": 0.1, "youngs_modulus": 2e6, "tensile_strength": 1e6}
COUNT = 1500

STILL, DRY = (0.1, 0.25), (0.4, 0.5)
"""Windows in which the bed is wet, and dry [s]."""


def sticky_case(bonds: bool = False) -> Case:
    """Wet seeds whose bridges hold the bed at 2.5 times minimum fluidisation, in air of 350 K."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.0, "viscosity": 2.08e-5},
        "material": {"seed": SEED | {"restitution": 0.9, "roughness": 1e-6}},
        "column": {"width": 0.0144, "depth": 0.0108, "height": 0.0432, "cell": 0.0036, "sides": "free_slip"},
        "bed": {
            "diameter": 1.2e-3, "count": COUNT, "seed": 2, "start": "poured",
            "inlet_velocity": [[0.0, 0.0], [0.05, 0.8]],
        },
        "liquid": {"viscosity": 1e-3, "surface_tension": 0.06, "liquid_fraction": 1e-4}
        | ({"bond": BOND} if bonds else {}),
        "heat": {
            "heat_capacity": {"seed": 2000.0}, "particle_temperature": 350.0, "fluid_temperature": 350.0,
            "fluid_heat_capacity": 1010.0, "conductivity": 0.03,
        },
        "evaporation": {"vapour_fraction": 0.0},
        "laws": LAWS,
        "run": {"until": 0.5, "particle_step": 1e-5, "reference_speed": 0.3},
    }  # fmt: skip
    return Case(**values)


def history(case: Case, every: float = 0.02) -> dict[str, np.ndarray]:
    """Rows of the history of a bed."""
    simulation, rows = Simulation(case), []
    while simulation.time < case.run.until - 1e-9:
        simulation.until(simulation.time + every)
        rows.append(row(simulation))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def stuck(curves: Curves) -> list[Row]:
    """A wet bed that is one piece: it fluidises again when it is dry, and does not with solid bonds."""
    rows, dry, by_name = [], {}, {}
    joined = {"without bonds": (0.0, 0.033), "with bonds": (1.0, 0.07)}  # expected, and limit
    for name in joined:
        by_name[name] = columns = history(sticky_case(bonds=name == "with bonds"))
        units = {"time": "s", "granular_temperature": "m2/s2", "liquid_in_bridges": "m3", "largest_agglomerate": "-"}
        curves[f"dried bed, {name}"] = {column: (columns[column], unit) for column, unit in units.items()}
        time = columns["time"]
        still, end = ((time > begin + 1e-9) & (time < last + 1e-9) for begin, last in (STILL, DRY))
        motion, largest = columns["granular_temperature"], columns["largest_agglomerate"] / COUNT
        dry[name] = float(motion[end].mean())
        rows += [
            Row(f"bed while wet, {name}: granular temperature", float(motion[still].max()), 0.0, 1e-6, "m2/s2"),
            Row(f"bed while wet, {name}: largest agglomerate over all", float(largest[still].min()), 1.0, 0.07),
            Row(f"bed when dry, {name}: largest agglomerate over all", float(largest[-1]), *joined[name]),
            Row(f"bed, {name}: imbalance of liquid", float(columns["liquid_imbalance"].max()), 0.0, 1e-12),
        ]
    moves = min(dry["without bonds"] / 5e-4, 1.0)  # more than this passes, too
    bonded = dry["with bonds"] / dry["without bonds"]
    return [
        *rows,
        Row("bed when dry: granular temperature in 5e-4 m2/s2, at most 1", moves, 1.0, 0.0),
        Row("bed when dry: granular temperature with bonds over that without", bonded, 0.0, 0.02),
        Row("bed when dry: bonds per seed", float(by_name["with bonds"]["bond_count"][-1]) / COUNT),
    ]


def _draw(folder: Path, curves: Curves) -> None:
    """Liquid, motion and the largest agglomerate of a wet bed that dries, with and without bonds."""
    figure, axes = panels(3, width=11.0, height=4.0)
    for name, colour in (("without bonds", BLUE), ("with bonds", ORANGE)):
        run = {column: np.asarray(values) for column, (values, _) in curves[f"dried bed, {name}"].items()}
        time = 1e3 * run["time"]
        axes[0].plot(time, 1e9 * run["liquid_in_bridges"], color=colour, label=name)
        axes[1].semilogy(time, np.maximum(run["granular_temperature"], 1e-12), color=colour)
        axes[2].plot(time, run["largest_agglomerate"] / COUNT, color=colour)
        dry = time[run["liquid_in_bridges"] <= 1e-3 * run["liquid_in_bridges"].max()]
        for panel in axes if dry.size else ():
            panel.axvline(dry[0], color=GREY, ls=":", lw=1.0)
    label(axes[0], "time", "ms", "liquid in bridges", "mm3")
    label(axes[1], "time", "ms", "granular temperature", "m2/s2")
    label(axes[2], "time", "ms", "largest agglomerate over all seeds", "-")
    legend(axes[0])
    save(figure, folder / "drying.png")
