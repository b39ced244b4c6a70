"""Case texts for tests: beads in water as a user would write them, and a mixture."""

TEXT = """# Alumina beads fluidised by water: a slice of the bed of Ferreira et al., Powder Technol. 426 (2023) 118652.
# The experiment: 72 400 beads in a column of 100 mm; here 2 000 of them between frictionless sides.
title = "Liquid-fluidised bed of alumina beads"

[fluid]                        # water
density = 997.0                # kg/m3
viscosity = 8.354e-4           # Pa s

[material.alumina]
density = 3585.9               # kg/m3
youngs_modulus = 3.0e11        # Pa, of the real solid; films use it
contact_modulus = 1.0e7        # Pa, softer contacts allow larger time steps
poisson = 0.3
restitution = 0.9
friction = 0.1
friction_lubricated = 0.05
roughness = 1.0e-6             # m

[column]
width = 0.040                  # m
height = 0.160                 # m
cell = 0.008                   # m
sides = "free_slip"

[bed]
diameter = 3.087e-3            # m
count = 2000
seed = 1
inlet_velocity = 0.157033      # m/s, superficial

[laws]
drag = "di_felice"
lubrication = "nijssen"

[run]
until = 3.0                    # s; 20 s for averages within one per cent
every = 0.05                   # s
average_from = 1.5             # s
reference_speed = 0.1          # m/s, highest collision speed
"""

GLASS = """
[material.glass]
density = 2420.0
youngs_modulus = 6.0e10
contact_modulus = 1.0e7
poisson = 0.25
restitution = 0.9
friction = 0.3
"""
"""A material of beads, to be put into the text of a case."""

MIXTURE = """
title = "Glass beads and larger, lighter pellets"
[fluid]
density = 1000.0
viscosity = 1e-3
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 2e6
poisson = 0.25
restitution = 0.9
friction = 0.3
[material.plastic]
density = 1500.0
youngs_modulus = 2e9
contact_modulus = 2e6
poisson = 0.3
restitution = 0.8
friction = 0.2
[column]
width = 0.012
height = 0.042
cell = 0.003
[bed]
start = "suspended"
inlet_velocity = 0.05
[bed.species.beads]
material = "glass"
diameter = 1e-3
count = 200
[bed.species.pellets]
material = "plastic"
diameter = 2e-3
spread = 0.05
count = 40
[laws]
drag = "beetstra_polydisperse"
lubrication = "none"
[run]
until = 0.012
every = 0.004
history_every = 0.002
reference_speed = 0.1
"""
