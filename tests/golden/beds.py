"""Golden runs of coupled cases, and of the fluid alone."""

from __future__ import annotations

import numpy as np
from example_case import MIXTURE

from cfddem.features.energy import EnergyLedger
from cfddem.fluid.conditions import FreeSlip, Inlet, NoSlip, Outlet, Periodic, discs, rectangle
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from golden.building import SCENARIOS, TIGHT, coupled, go_on, kept_and_restored
from golden.registry import State, golden
from golden.states import collisions, counted, different, field_state, state_of

BEADS = """
[fluid]
density = 997.0
viscosity = 8.354e-4
[material.alumina]
density = 3585.9
youngs_modulus = 3.0e11
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.9
friction = 0.1
friction_lubricated = 0.05
roughness = 1.0e-6
[column]
width = 0.024
height = 0.048
cell = 0.006
sides = "free_slip"
[bed]
diameter = 3.087e-3
count = 400
seed = 1
start = "suspended"
initial_velocity = [0.02, 0.01, 0.03]
inlet_velocity = 0.157033
[laws]
drag = "wen_yu"
lubrication = "nijssen"
surface = "smeared"
[run]
until = 1.0
particle_step = 4.0e-5
fluid_step = 1.0e-3
reference_speed = 0.1
"""

SEEDS = """
[fluid]
density = 1.13
viscosity = 1.68144e-5
[material.seed]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.986
friction = 0.1
[material.wall]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
[column]
width = 0.0144
height = 0.0192
cell = 0.0024
material = "wall"
[bed]
material = "seed"
diameter = 1.2e-3
count = 500
seed = 1
start = "suspended"
inlet_velocity = [[0.0, 0.1], [0.1, 0.66]]
[laws]
drag = "beetstra"
lubrication = "none"
surface = "smeared"
self_disturbance_correction = false
[run]
until = 1.0
particle_step = 1.0e-5
fluid_step = 2.0e-4
reference_speed = 0.4
"""


@golden
def settling_sphere() -> State:
    return state_of(
        coupled(
            SCENARIOS / "beds" / "settling" / "case.toml",
            4,
            column__width=0.016,
            column__height=0.024,
            bed__positions=[[0.0083, 0.0079, 0.0171]],
            laws__history="none",
        )
    )


@golden
def packed_bed() -> State:
    small = {"column__width": 0.006, "column__height": 0.012, "bed__count": 450, "run__fluid_step": 0.002}
    small["laws__surface"] = "smeared"
    return state_of(coupled(SCENARIOS / "beds" / "packed_bed" / "case.toml", **small))


@golden
def liquid_bed() -> State:
    return state_of(coupled(BEADS))


@golden
def liquid_bed_all_forces() -> State:
    changes = {f"laws__{name}": True for name in ("lift", "torque", "viscous_stress")}
    return state_of(coupled(BEADS, laws__added_mass=0.5, **changes))


@golden
def liquid_bed_model_b() -> State:
    changes = {
        "laws__model": "B",
        "laws__mapping": "centroid",
        "laws__convection": "central",
        "laws__kernel_width": 0.0,
    }
    return state_of(coupled(BEADS, column__sides="periodic", **changes))


@golden
def liquid_bed_divided() -> State:
    return state_of(coupled(BEADS, column__sides="no_slip", laws__mapping="divided"))


@golden
def liquid_bed_counted() -> State:
    """Energies counted, collisions recorded."""
    simulation = coupled(BEADS, run__energy_budget=True, run__record_collisions=True)
    row = simulation.feature(EnergyLedger).row()
    ledger = {"ledger": np.array([row[name] for name in sorted(row)])}
    return state_of(simulation) | counted(simulation.particle_solver) | collisions(simulation.particle_solver) | ledger


@golden
def closed_box_in_layers() -> State:
    """A closed box and a viscosity that changes with height."""
    layers = [[0.0, 1e-3], [0.024, 5e-3]]
    return state_of(coupled(BEADS, column__ends="closed", bed__inlet_velocity=0.0, fluid__viscosity_profile=layers))


@golden
def periodic_fluid() -> State:
    return state_of(coupled(BEADS, column__sides="periodic", column__ends="periodic", bed__inlet_velocity=0.0))


@golden
def gas_bed_cylinder() -> State:
    """In a round column that is closed, whose corner cells are solid."""
    middle, places = 0.0072, (np.indices((10, 10, 6)).reshape(3, -1).T + 0.53) * 1.25e-3
    places = places[np.hypot(places[:, 0] - middle, places[:, 1] - middle) < middle - 0.61e-3]
    text = SEEDS.replace("count = 500", f"positions = {places.tolist()}").replace('"suspended"', '"placed"')
    closed = {"column__shape": "cylinder", "column__ends": "closed", "bed__inlet_velocity": 0.0}
    return state_of(coupled(text, bed__initial_velocity=[0.1, 0.2, -0.3], **closed))


@golden
def gas_bed_flat() -> State:
    flat = {"column__depth": 0.006, "column__cell": [0.0024, 0.006, 0.0024], "column__front": "periodic"}
    flat |= {"column__height": 0.0096, "bed__start": "packed"}
    jet = {"velocity": 1.0, "width": 0.003}
    return state_of(coupled(SEEDS, column__sides="no_slip", bed__jet=jet, bed__count=450, **flat))


@golden
def gas_bed_of_many() -> State:
    """So many that loops run on all threads and particles are sorted by place."""
    changes = {
        "column__height": 0.0144,
        "bed__start": "packed",
        "bed__count": 1150,
        "bed__initial_velocity": [0.3, 0.2, 0.1],
    }
    return state_of(coupled(SEEDS, **changes))


@golden
def gas_bed_sharp() -> State:
    return state_of(coupled(SEEDS, laws__surface="sharp", bed__start="packed"))


@golden
def mixture() -> State:
    steps = {"run__particle_step": 1e-5, "run__fluid_step": 3e-4}
    return state_of(coupled(MIXTURE, column__height=0.024, run__until=1.0, laws__surface="smeared", **steps))


@golden
def resumed() -> State:
    """A coupled run that is stopped, kept in a file and gone on with: the same bits as one that is not stopped."""
    straight = state_of(coupled(BEADS, 4))
    again = state_of(go_on(kept_and_restored(coupled(BEADS, 2)), 2))
    return again | different(again, straight)


@golden
def dry_case() -> State:
    """A case without a fluid."""
    text = SEEDS.split("[material.seed]", 1)[1].replace("inlet_velocity = [[0.0, 0.1], [0.1, 0.66]]", "")
    text = text.replace(
        'drag = "beetstra"\nlubrication = "none"\nsurface = "smeared"\nself_disturbance_correction = false',
        'contact = "hertz"',
    )
    return state_of(coupled("[material.seed]" + text, bed__initial_velocity=[0.1, 0.2, -0.3]))


@golden
def fluid_alone() -> State:
    """Through a hole in the floor around a solid block, with sub-grid viscosity, a source and a lid that slides."""
    block = rectangle((0.003, 0.002, 0.003), (0.006, 0.005, 0.006))
    inlet = Inlet(0.2, where=discs([(0.004, 0.004)], diameter=0.004))
    sides = {"x_low": NoSlip((0.0, 0.1, 0.05)), "x_high": FreeSlip(), "y_low": Periodic(), "y_high": Periodic()}
    grid = Grid.of_size((0.008, 0.008, 0.01), 0.001, solid=block)
    fluid = FluidSolver(
        grid,
        {**sides, "z_low": [NoSlip(), inlet], "z_high": Outlet()},
        density=1.2, viscosity=1.8e-5, scheme=Scheme(smagorinsky=0.1, tolerance=TIGHT), gravity=(0.0, 0.0, -9.81),
    )  # fmt: skip
    source = np.random.default_rng(6).normal(0.0, 1.0, (*grid.shape, 3)) * ~block(*grid.centres())[..., None]
    for _ in range(4):
        fluid.step(5e-4, source=source)
    return field_state(fluid)
