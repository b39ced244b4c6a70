# %% [markdown]
# # A first bed
#
# Glass beads of 1 mm, fluidised by water: check the case, run it, look at it.

# %%
import cfddem

case = cfddem.Case(
    title="Glass beads in water",
    fluid=dict(density=998.0, viscosity=1e-3),
    material=dict(
        glass=dict(
            density=2500.0, youngs_modulus=6e10, contact_modulus=2e5, poisson=0.25, restitution=0.9, friction=0.2
        )
    ),
    column=dict(width=0.010, height=0.0125, cell=0.0025, sides="free_slip"),
    bed=dict(diameter=1e-3, count=400, start="suspended", inlet_velocity=0.037),
    laws=dict(drag="di_felice", lubrication="nijssen"),
    run=dict(until=0.3, every=0.02, average_from=0.15, particle_step=2.6e-5, reference_speed=0.05),
)
case

# %% [markdown]
# All numbers are in SI units. The check shows what to expect, before anything is run:

# %%
cfddem.check(case)

# %% [markdown]
# The run writes a folder. A bar shows its progress, and which loop is being compiled when a case is run for the first time.

# %%
run = cfddem.run_case(case, "first-bed", overwrite=True)
run

# %% [markdown]
# Measures over time are columns of the history:

# %%
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(run.history["time"], 1e3 * run.history["bed_height"])
left.set(xlabel="time  [s]", ylabel="bed height  [mm]")
right.plot(run.history["time"], run.history["pressure_drop"])
right.set(xlabel="time  [s]", ylabel="pressure drop  [Pa]")
plt.show()

# %% [markdown]
# After settling, the pressure drop carries the buoyant weight of the beads over the floor of the column:

# %%
import math

weight = 400 * math.pi / 6 * 1e-9 * (2500.0 - 998.0) * 9.81 / 0.010**2
late = run.history["time"] > 0.15
print(f"pressure drop {run.history['pressure_drop'][late].mean():.1f} Pa, weight over floor {weight:.1f} Pa")

# %% [markdown]
# To advance a simulation step by step, create it without a folder:

# %%
simulation = cfddem.Simulation(case)
simulation.until(0.01)
simulation
