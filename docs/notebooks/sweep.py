# %% [markdown]
# # A sweep
#
# The same case for several inlet velocities, one folder each; then a table and a figure.

# %%
from pathlib import Path

from cfddem.case.gallery import copy_from_gallery
from cfddem.studies.sweep import sweep

case = Path("liquid_bed.toml")
if not case.exists():
    copy_from_gallery("liquid-bed", case)
shared = {"bed.count": 400, "column.height": 0.0125, "run.until": 0.2, "run.average_from": 0.1, "run.every": 0.02}
sweep(case, {"bed.inlet_velocity": [0.025, 0.035, 0.045]}, Path("velocities"), overrides=shared)

# %% [markdown]
# Runs that have finished are kept: run the cell again, and nothing is computed twice. All runs as a table, with standard errors beside the means:

# %%
import cfddem

runs = cfddem.open_sweep("velocities")
runs[["bed.inlet_velocity", "status", "bed_height", "bed_height_error", "pressure_drop"]]

# %% [markdown]
# The units of its columns:

# %%
{name: runs.attrs["units"][name] for name in ("bed.inlet_velocity", "bed_height", "pressure_drop")}

# %% [markdown]
# Bed height with its error against the inlet velocity:

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
axes.errorbar(runs["bed.inlet_velocity"], runs["bed_height"], runs["bed_height_error"], marker="o", capsize=3)
axes.set(xlabel="inlet velocity  [m/s]", ylabel="bed height  [m]")
plt.show()

# %% [markdown]
# These runs are short, so that the page is quick. Means that last need runs of seconds: set `run.until` and `run.average_from` to what the bed needs.
