"""A bed of 8849 steel spheres that is heated from above for 4000 s, beside the measurement of Beaulieu (2020).

The hot plate is the wall at the end of x. Temperatures are means of the spheres within a diameter of the depth, and
within two diameters of the axis of the box. The packing is not known but for its porosity: how many spheres touch the
hot plate, 0.46 of its area here, matters most. Before the bed was turned they cover 0.53, and the largest differences
are 1.03, 0.54 and 0.32 K. The curves of the measurement's error in the thesis are 2.2 K away.

`python -m scenarios.validation.heated_bed FILE` makes `scenarios/data/heated_bed_8849.npz` anew, in minutes.
The box was filled from the side: z is up while it is filled. Friction is low in this part, 0.2, which gives the
measured porosity of 42 %; with the friction of the inputs, 0.7, a slow filling is too loose. A lid comes down and
levels the surface at the height of that porosity. Then gravity acts along -x, with the friction of the inputs.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import erfc, erfcx

from cfddem import Material, ParticleSolver, Plane, make_particles, pair_table
from cfddem.case.schema import Case
from cfddem.particles.interactions.laws import Laws
from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from cfddem.run.simulation import Simulation
from scenarios.validation.table import Curves, Progress, Row, in_parts, reference, worst

TIMES = (*range(250, 3751, 250), 3950)
"""Times at which temperatures are compared [s]."""

LIMITS = {4.0: 1.0, 6.0: 0.7, 7.3: 0.7}
"""Largest difference by depth below the hot plate [cm], [K]."""

ERROR = 2.2
"""Of the measurement, by the curves of the thesis [K]."""

ZERO, COLD, HOT = 273.15, 20.0, 53.0

AIR = {"gas_conductivity": 0.027, "prandtl": 1.85e-5 * 1006.0 / 0.027, "heat_ratio": 1.0, "free_path": 68e-9}
ROUGH = {
    "contact": "rough",
    "microhardness": {"steel": 3e9, "plate": 1.8e9},
    "slope": {"steel": 0.056, "plate": 0.056},
    "surface_roughness": {"steel": 19e-9, "plate": 0.1e-9},
}
LAWS: Mapping[str, dict[str, Any]] = {
    "rough contacts, gas to half a diameter": {**AIR, **ROUGH, "gap": "rarefied", "lens": 1.0},
    "rough contacts, gas to a tenth of a diameter": {**AIR, **ROUGH, "gap": "rarefied", "lens": 0.2},
    "rough contacts, gas around contacts alone": {**AIR, **ROUGH, "gap": "rarefied", "lens": 1e-6},
    "ideal Hertz contacts, no gas": {},
    "ideal Hertz contacts, lens of gas": {**AIR, "gap": "lens"},
}
"""Keys of [contact_heat] by name; the limits are those of the first. Spheres up to half a diameter apart conduct
through the gas in Zhou, Yu & Zulli, Powder Technol. 197 (2010) 102."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    return in_parts((rough, others), _draw, folder, progress)


def case_of(laws: Mapping[str, Any]) -> Case:
    """The case, with keys of [contact_heat]."""
    with resources.as_file(resources.files("scenarios").joinpath("data", f"heated_bed_{COUNT}.npz")) as path:
        places = np.load(path)["position"]
    heat: dict[str, Any] = {
        "held": True,
        "conductivity": {"steel": 42.0, "plate": 250.0},
        "heat_capacity": {"steel": 464.0},
        "particle_temperature": ZERO + COLD,
        "wall": {"x_high": {"temperature": ZERO + HOT}},
        **laws,
    }
    values: dict[str, Any] = {
        "material": {"steel": STEEL, "plate": PLATE},
        "column": {"width": LENGTH, "depth": DEPTH, "height": HEIGHT, "cell": 0.02, "material": "plate"},
        "bed": {"material": "steel", "diameter": DIAMETER, "positions": tuple(map(tuple, places.tolist()))},
        "laws": {"gravity": (-9.81, 0.0, 0.0)},
        "run": {"until": 4000.0, "fluid_step": 10.0, "reference_speed": 0.1},
        "contact_heat": heat,
    }
    return Case(**values)


def temperatures(laws: Mapping[str, Any], times: tuple[float, ...] = TIMES) -> dict[float, np.ndarray]:
    """Temperature by depth [cm] at some times (n,) [C]."""
    simulation = Simulation(case_of(laws))
    place = simulation.particles.position
    at_axis = (np.abs(place[:, 1:] - (0.5 * DEPTH, 0.5 * HEIGHT)) < 2.0 * DIAMETER).all(axis=1)  # local: two axes
    at = {depth: at_axis & (np.abs(LENGTH - 0.01 * depth - place[:, 0]) < DIAMETER) for depth in LIMITS}
    by_depth: dict[float, list[float]] = {depth: [] for depth in LIMITS}
    for time in times:
        simulation.until(time)
        for depth, inside in at.items():
            by_depth[depth].append(float(simulation.particles.temperature[inside].mean()) - ZERO)  # local: one process
    return {depth: np.array(values) for depth, values in by_depth.items()}


def measured(depth: float) -> np.ndarray:
    """Means of the measured points within 150 s of `TIMES`, after 3900 s for the last (n,) [C]."""
    table = reference("beaulieu2020_heated_bed")
    columns = [np.array(table[name], float) for name in ("depth [cm]", "time [s]", "temperature [C]")]
    rows = (np.array(table["kind"]) == "measured") & (columns[0] == depth)
    time, value = columns[1][rows], columns[2][rows]
    near = [(time > 3900.0) if at == TIMES[-1] else (np.abs(time - at) <= 150.0) for at in TIMES]
    return np.array([value[nearest].mean() for nearest in near])  # local: of a table


def slab(time: np.ndarray, depth: float, diffusivity: float, lag: float) -> np.ndarray:
    """Temperature of a deep slab that a plate heats from t = 0, at a depth [m] (n,) [C].

    lag  resistance between plate and slab, as the thickness of so much slab [m]
    """
    reach = 2.0 * np.sqrt(diffusivity * time)
    near, far = depth / reach, depth / reach + 0.5 * reach / lag
    return np.asarray(COLD + (HOT - COLD) * (erfc(near) - np.exp(-(near**2)) * erfcx(far)))


def as_slab(by_depth: Mapping[float, np.ndarray]) -> tuple[float, float, float]:
    """The slab nearest to temperatures by depth [cm] at `TIMES`: its diffusivity [m2/s], its lag [m], and the largest
    difference [K]."""
    time = np.array(TIMES, float)

    def apart(numbers: np.ndarray) -> float:
        deviations = (slab(time, 0.01 * depth, *np.exp(numbers)) - values for depth, values in by_depth.items())
        return float(np.abs(np.concatenate(list(deviations))).max())  # local: of a few curves

    starts = [np.log([3e-7, lag]) for lag in (1e-4, 3e-3)]
    best = min((minimize(apart, start, method="Nelder-Mead") for start in starts), key=lambda result: result.fun)
    return (*np.exp(best.x).tolist(), float(best.fun))


def rough(curves: Curves) -> list[Row]:
    """Rough contacts and gas, at three depths beside the measurement."""
    name = next(iter(LAWS))
    by_depth = temperatures(LAWS[name])
    curves["rough"] = {"time": (np.array(TIMES, float), "s")} | {
        f"at {depth:g} cm": (values, "degC") for depth, values in by_depth.items()
    }
    rows = []
    for depth, values in by_depth.items():
        points = list(zip(TIMES, values, measured(depth)))
        rows.append(worst(f"{name}: at {depth:g} cm", points, LIMITS[depth], unit="degC"))
        rows.append(
            worst(f"the same, beside the error of the measurement: at {depth:g} cm", points, ERROR, unit="degC")
        )
    return rows


def others(curves: Curves) -> list[Row]:
    """Other laws beside the measurement; gas around contacts alone beside the simulation of the thesis, too."""
    rows = []
    for name in list(LAWS)[1:]:
        by_depth = temperatures(LAWS[name])
        curves[name] = {f"at {depth:g} cm": (values, "degC") for depth, values in by_depth.items()}
        rows += [
            worst(f"{name}: at {depth:g} cm", zip(TIMES, values, measured(depth)), unit="degC")
            for depth, values in by_depth.items()
        ]
        if "alone" in name:
            rows += [
                worst(f"{name}, against the simulation of the thesis: at {depth:g} cm", points, unit="degC")
                for depth, points in _beside_the_thesis(by_depth).items()
            ]
    return rows


def _beside_the_thesis(by_depth: Mapping[float, np.ndarray]) -> dict[float, list[tuple[float, float, float]]]:
    """Time [s], temperature here and simulated in the thesis [C], by depth."""
    table = reference("beaulieu2020_heated_bed")
    kind = np.array(table["kind"]) == "simulated"
    depth, time, value = (
        np.array(table[heading], float)[kind] for heading in ("depth [cm]", "time [s]", "temperature [C]")
    )
    result = {}
    for at, values in by_depth.items():
        there = np.interp(time[depth == at], TIMES, values)
        result[at] = list(zip(time[depth == at].tolist(), there.tolist(), value[depth == at].tolist()))
    return result


def _draw(folder: Path, curves: Curves) -> None:
    """Temperatures against time, at three depths."""
    figure, axes = panels()
    for depth, colour in zip(LIMITS, (BLUE, ORANGE, GREY)):
        axes.plot(TIMES, measured(depth), "o", color=colour, label=f"{depth:g} cm below the plate, Beaulieu (2020)")
        axes.plot(TIMES, curves["rough"][f"at {depth:g} cm"][0], color=colour)
        axes.plot(TIMES, curves["ideal Hertz contacts, no gas"][f"at {depth:g} cm"][0], ":", color=colour)
    label(axes, "time", "s", "temperature", "degC")
    legend(axes)
    save(figure, folder / "heated_bed.png")


# ---------------------------------------------------------------- the packing of the heated bed


COUNT, DIAMETER, DENSITY = 8849, 6.4e-3, 7747.0
LENGTH, DEPTH, HEIGHT = 0.2, 0.1, 0.1047
"""Of the closed box along x, y and z; the porosity is 42 % [m]."""

LID_SPEED, AT_REST = 0.05, 0.3
"""Speed of the lid [m/s], and time in which the bed comes to rest after it was turned [s]."""

STEEL = {"density": DENSITY, "youngs_modulus": 200e9, "contact_modulus": 50e6, "poisson": 0.29, "restitution": 0.8}
PLATE = {"density": 2700.0, "youngs_modulus": 100e9, "contact_modulus": 50e6, "poisson": 0.33, "restitution": 0.8}
"""Steel spheres and walls; 50 MPa in contacts, as in the example of lethe."""


def _solids(friction: float) -> list[Material]:
    return [Material(**material, friction=friction, rolling_friction=0.02) for material in (STEEL, PLATE)]


def poured() -> np.ndarray:
    """Places of the spheres after filling (N, 3) [m]."""
    case = Case(
        material={"steel": STEEL | {"friction": 0.2}, "plate": PLATE | {"friction": 0.2}},
        column={"width": LENGTH, "depth": DEPTH, "height": 0.25, "cell": 0.02, "material": "plate"},
        bed={"material": "steel", "diameter": DIAMETER, "count": COUNT},
        run={"until": 1.0, "reference_speed": 0.5},
    )  # type: ignore[arg-type]  # tables as mappings
    return np.asarray(Simulation(case).particles.position)


def _walls(lid: float, speed: float) -> list[Plane]:
    """The box, with a lid at a height [m] that comes down with a speed [m/s]."""
    return [
        Plane(material=1),
        Plane(point=(0.0, 0.0, lid), normal=(0.0, 0.0, -1.0), velocity=(0.0, 0.0, -speed), material=1),
        Plane(normal=(1.0, 0.0, 0.0), material=1),
        Plane(point=(LENGTH, 0.0, 0.0), normal=(-1.0, 0.0, 0.0), material=1),
        Plane(normal=(0.0, 1.0, 0.0), material=1),
        Plane(point=(0.0, DEPTH, 0.0), normal=(0.0, -1.0, 0.0), material=1),
    ]


def closed_and_turned(place: np.ndarray) -> np.ndarray:
    """Places in the closed box, at rest under gravity along -x (N, 3) [m]."""
    top = float(place[:, 2].max()) + 0.5 * DIAMETER + 1e-5  # local: one process
    spheres = make_particles(place, 0.5 * DIAMETER, DENSITY)
    walls = _walls(top, LID_SPEED)
    lying = ParticleSolver(spheres, pair_table(_solids(0.2)), walls=walls, gravity=(0.0, 0.0, -9.81))
    step = lying.recommended_step(0.3)
    steps = math.ceil((top - HEIGHT) / LID_SPEED / step)
    lying.advance((top - HEIGHT) / LID_SPEED / steps, steps)
    upright = ParticleSolver(
        make_particles(lying.particles.position, 0.5 * DIAMETER, DENSITY), pair_table(_solids(0.7)),
        walls=_walls(HEIGHT, 0.0), laws=Laws(rolling="constant_torque"), gravity=(-9.81, 0.0, 0.0),
    )  # fmt: skip
    upright.advance(step, round(AT_REST / step))
    return np.asarray(upright.particles.position)


if __name__ == "__main__":
    np.savez_compressed(sys.argv[1], position=closed_and_turned(poured()))
