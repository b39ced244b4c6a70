# %% [markdown]
# # Read a run into pandas and xarray

# %%
import cfddem

case = cfddem.gallery()["liquid-bed"].with_(
    **{"bed.count": 400, "column.height": 0.0125, "run.until": 0.15, "run.every": 0.01, "run.average_from": 0.1},
)
run = cfddem.run_case(case, "bed", overwrite=True)
run

# %% [markdown]
# The history is a dictionary of columns, which makes a table; `run.unit` has the unit of each:

# %%
import pandas

history = pandas.DataFrame(run.history).set_index("time")
print({name: run.unit(name) for name in ("bed_height", "pressure_drop")})
history[["bed_height", "bed_voidage", "pressure_drop", "largest_speed"]].tail()

# %% [markdown]
# One snapshot of the particles; vectors become three columns:

# %%
beads = run.particles(-1)
columns = {name: values for name, values in beads.items() if values.ndim == 1}
for name in ("position", "velocity"):
    columns |= {f"{name}_{axis}": beads[name][:, k] for k, axis in enumerate("xyz")}
table = pandas.DataFrame(columns).set_index("id")
table.describe().loc[["mean", "std", "min", "max"], ["position_z", "velocity_z", "radius"]]

# %% [markdown]
# The whole run as an xarray Dataset, with coordinates and units. Fields are read when they are asked for:

# %%
data = run.dataset()
data["voidage"]

# %% [markdown]
# The mean over each layer, against height and time:

# %%
import matplotlib.pyplot as plt

layers = data["voidage"].mean(("x", "y"))
figure, panel = plt.subplots(figsize=(6, 3.2), layout="constrained")
shown = panel.pcolormesh(layers.time, layers.z, layers.T, cmap="Blues_r", shading="nearest")
figure.colorbar(shown, label="voidage  [-]")
panel.set(xlabel="time  [s]", ylabel="z  [m]")
plt.show()

# %% [markdown]
# One particle through all snapshots:

# %%
import numpy as np

one = run.track(17)
pandas.DataFrame({"time": one["time"], "z": one["position"][:, 2], "speed": np.linalg.norm(one["velocity"], axis=1)})
