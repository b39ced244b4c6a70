# %% [markdown]
# # A user-defined law
#
# A drag law is a function of the Reynolds number and the voidage that returns the drag factor: the force on one sphere without the force of the mean pressure
# gradient, over that of Stokes for the superficial slip velocity.

# %%
import closures


@closures.law("drag", "own measurements", reynolds=(0.0, 300.0), voidage=(0.4, 1.0))
def my_drag(reynolds: float, voidage: float) -> float:
    """Drag of my own beads.

    .. math:: F = (1 + 0.15 Re^{0.687}) \\varepsilon^{-3.2}
    """
    return (1.0 + 0.15 * reynolds**0.687) * voidage**-3.2


closures.law_of(my_drag)

# %% [markdown]
# `check` compares a law with the limits that every law of its kind has. An empty list means that no problem was found:

# %%
closures.check(my_drag)

# %% [markdown]
# A law that gives the total force, which includes the pressure gradient, is found:


# %%
@closures.law("drag", "as printed, total force")
def as_printed(reynolds: float, voidage: float) -> float:
    return (1.0 + 0.15 * reynolds**0.687) * voidage**-5.2


[str(each) for each in closures.check(as_printed)]

# %% [markdown]
# Beside the built-in laws:

# %%
import matplotlib.pyplot as plt
import numpy as np

from closures.drag import di_felice, wen_yu

voidage = np.linspace(0.4, 1.0, 60)
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for law in (my_drag, di_felice, wen_yu):
    axes.semilogy(voidage, [law(20.0, each) for each in voidage], label=law.__name__)
axes.set(xlabel="voidage  [-]", ylabel="drag factor at Re = 20  [-]")
axes.legend()
plt.show()

# %% [markdown]
# The force balance of a bed, with each law:

# %%
from closures.balance import fluidising_velocity, terminal_velocity

glass_in_water = dict(diameter=1e-3, density=2500.0, fluid_density=998.0, viscosity=1e-3)
for law in (my_drag, di_felice):
    onset = fluidising_velocity(**glass_in_water, voidage=0.42, drag=law)
    alone = terminal_velocity(**glass_in_water, drag=law)
    print(f"{law.__name__}: minimum fluidisation {onset:.4f} m/s, terminal velocity {alone:.3f} m/s")

# %% [markdown]
# In a case, the function takes the place of a name: `Case(laws=dict(drag=my_drag), ...)`. The loops are compiled with it, once.
