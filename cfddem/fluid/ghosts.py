"""Loops over the sides of the box: what the ghosts beyond them hold.

A layer of cells parallel to a side is counted by its index along the axis of the side; places in it are counted by
the two remaining axes of an array, in their order.
"""

from __future__ import annotations

from cfddem.fluid.grid import HIGH, LOW
from cfddem.kernels import inline, kernel


@inline
def _place(axis, layer, a, b):
    """Indices k, j, i of a place in a layer."""
    if axis == 0:
        return a, b, layer
    return (a, layer, b) if axis == 1 else (layer, a, b)


@kernel
def continue_cells(fields, cells, periodic):
    """Ghosts of cell fields (m, nz, ny, nx): periodic, or the value of the nearest cell; one axis after the other."""
    for axis in range(3):
        n = cells[axis]
        planes = fields.shape[2 if axis == 2 else 1], fields.shape[2 if axis == 0 else 3]
        for ghost in range(n + LOW + HIGH):
            if LOW <= ghost < n + LOW:
                continue
            inside = LOW + (ghost - LOW) % n if periodic[axis] else min(max(ghost, LOW), n + LOW - 1)
            for m in range(fields.shape[0]):
                for a in range(planes[0]):
                    for b in range(planes[1]):
                        k, j, i = _place(axis, ghost, a, b)
                        kk, jj, ii = _place(axis, inside, a, b)
                        fields[m, k, j, i] = fields[m, kk, jj, ii]


@kernel
def fill_side(velocity, axis, high, n, wall, mirror, outlet):
    """Boundary face and ghosts of a velocity (3, nz, ny, nx) at one side of n cells.

    wall    (3, plane) given on the face [m/s]
    mirror  (plane) ghost = mirror * inside + 2 wall where it sticks, for tangential velocities
    outlet  (plane) whether the normal velocity is free
    """
    face, out = (n + LOW, 1) if high else (LOW, -1)
    last = n + LOW - 1 if high else LOW  # cell at the side, and the one before it
    before = max(last - 1, LOW) if high else min(last + 1, n + LOW - 1)
    size = velocity.shape[3 - axis]
    for a in range(mirror.shape[0]):
        for b in range(mirror.shape[1]):
            k, j, i = _place(axis, face, a, b)
            kk, jj, ii = _place(axis, face - out, a, b)
            at_face = velocity[axis, k, j, i] if outlet[a, b] else wall[axis, a, b]
            # Fluid that flows back through an outlet comes from rest: it brings no momentum.
            leaves = 0.0 if outlet[a, b] and at_face * out < 0.0 else 1.0
            velocity[axis, k, j, i] = at_face
            beyond = at_face * leaves if outlet[a, b] else 2.0 * at_face - velocity[axis, kk, jj, ii]
            for ghost in (face + out, face + 2 * out):
                if 0 <= ghost < size:
                    k, j, i = _place(axis, ghost, a, b)
                    velocity[axis, k, j, i] = beyond
            for component in range(3):
                if component == axis:
                    continue
                fixed = 2.0 * wall[component, a, b] if mirror[a, b] < 0.0 else 0.0
                for depth in range(HIGH if high else LOW):
                    k, j, i = _place(axis, last + out * (depth + 1), a, b)
                    kk, jj, ii = _place(axis, before if depth else last, a, b)
                    velocity[component, k, j, i] = mirror[a, b] * leaves * velocity[component, kk, jj, ii] + fixed
