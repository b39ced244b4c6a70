"""The fluid: volume-averaged incompressible flow on a coarse staggered grid.

grid         the box, its cells and solid cells, and values at points
cell_counts  how cells divide a box; nothing compiled
fields       declared fields of cells and faces, their checks, and where they have fluid
conditions   walls, inlets, outlets, periodic sides, and the times and regions in which they hold
boundaries   the conditions as known faces and values of ghosts; arrays of one side
halo         fills the ghosts of padded fields
momentum     the terms of the momentum balance (models A and B); predictor; rates that limit a step
viscosity    effective viscosity, with the sub-grid viscosity
pressure/    the pressure equation: conjugate gradients with a multigrid preconditioner; projection; closed regions
step_limit   limits of the fluid step; nothing compiled
solver       the fluid: its fields, their values in cells and at points, and the step
budgets      momentum, drag and energy of the step just made
scalar       temperature or a vapour in every cell: its step, its conditions (scalar_conditions), what it does at
             sides and walls (scalar_boundaries), its loops (scalar_loops)
"""
