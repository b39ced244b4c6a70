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
# The history is a dictionary of columns, which makes a table:

# %%
import pandas

history = pandas.DataFrame(run.history).set_index("time")
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
# The fluid with its coordinates, all snapshots in one array, as xarray:

# %%
import numpy as np
import xarray

grid = run.grid
axes = {
    name: origin + width * (np.arange(count) + 0.5)
    for name, origin, width, count in zip("xyz", grid.origin, grid.spacing, grid.cells)
}
voidage = xarray.DataArray(
    np.stack([run.fluid("voidage", k) for k in range(len(run.times))]),
    dims=("time", "z", "y", "x"), coords={"time": run.times, **axes}, attrs={"units": run.unit("voidage")},
)  # fmt: skip
voidage.sizes

# %% [markdown]
# The mean over each layer, against height and time:

# %%
import matplotlib.pyplot as plt

layers = voidage.mean(("x", "y"))
figure, panel = plt.subplots(figsize=(6, 3.2), layout="constrained")
shown = panel.pcolormesh(layers.time, layers.z, layers.T, cmap="Blues_r", shading="nearest")
figure.colorbar(shown, label="voidage  [-]")
panel.set(xlabel="time  [s]", ylabel="z  [m]")
plt.show()

# %% [markdown]
# One particle through all snapshots:

# %%
one = run.track(17)
pandas.DataFrame({"time": one["time"], "z": one["position"][:, 2], "speed": np.linalg.norm(one["velocity"], axis=1)})
