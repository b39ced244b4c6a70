# %% [markdown]
# # A collision and its film
#
# Two spheres approach each other in a liquid. The film between them takes up part of the energy; if the Stokes number is small, they do not rebound.

# %%
from scenarios.collisions.immersed_pair import MATERIALS, collide

result = collide(MATERIALS["steel_smooth"], stokes=60.0, velocity=0.1)
result

# %% [markdown]
# The gap during the collision. Solids begin to carry load at the minimum gap, which the pressure of the film or the roughness sets:

# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
axes.semilogy(1e3 * result.time, 1e6 * result.gap.clip(min=1e-9))
axes.axhline(1e6 * result.minimum_gap, color="#e07b00", linestyle="--", label="minimum gap")
axes.set(xlabel="time  [ms]", ylabel="gap  [µm]")
axes.legend()
plt.show()

# %% [markdown]
# The restitution against the Stokes number, and the measured trend: no rebound below a Stokes number of about 10, and the dry value at large ones.

# %%
import numpy as np

stokes = np.geomspace(5.0, 1000.0, 8)
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for name in ("steel_smooth", "delrin"):
    restitution = [collide(MATERIALS[name], stokes=float(each), velocity=0.1).restitution for each in stokes]
    axes.semilogx(stokes, restitution, "o-", label=name.replace("_", " "))
axes.set(xlabel="Stokes number  [-]", ylabel="restitution  [-]", ylim=(0, 1))
axes.legend()
plt.show()

# %% [markdown]
# The law of the minimum gap, as the registry has it:

# %%
import closures
from closures.minimum_gap import elastohydrodynamic

closures.law_of(elastohydrodynamic)
