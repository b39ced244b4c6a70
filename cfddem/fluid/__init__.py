"""The fluid: volume-averaged incompressible flow on a coarse staggered grid.

grid        the box, its cells and masks, and values at points
conditions  walls, inlets, outlets, periodic sides, and the times and regions in which they hold
boundaries  the same as known faces and ghost values
momentum    models A and B written out, one term a function; predictor
projection  what continuity asks of the pressure; corrector
pressure    the pressure equation: conjugate gradients with a multigrid preconditioner
viscosity   sub-grid viscosity
stability   the rates that limit a step
state       the fields and what they are at any point
checks      what is refused, in one line each
solver      the step
"""
