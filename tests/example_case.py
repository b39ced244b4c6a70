"""A case that tests take apart: beads in water, as a user would write them."""

TEXT = """# Alumina beads fluidised by water: a slice of the bed of Ferreira et al., Powder Technol. 426 (2023) 118652.
# The experiment: 72 400 beads in a column of 100 mm; here 2 000 of them between frictionless sides.
title = "Liquid-fluidised bed of alumina beads"

[fluid]                        # water
density = 997.0                # kg/m3
viscosity = 8.354e-4           # Pa s

[material.alumina]
density = 3585.9               # kg/m3
youngs_modulus = 3.0e11        # Pa, of the real solid: the film feels it
contact_modulus = 1.0e7        # Pa, softened, so that larger steps are stable
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
until = 3.0                    # s; 20 s for means within a per cent
every = 0.05                   # s
average_from = 1.5             # s
reference_speed = 0.1          # m/s, fastest collisions
"""
