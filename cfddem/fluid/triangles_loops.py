"""Loops over the triangles of a closed surface: signed distances of points, and triangles that pass through others.

Triangles lie in a tree of boxes, whose nodes stand in the order of a walk through it: after a node comes its first
child, and `skip` is the node after all that it holds. Only the last nodes hold triangles.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, prange, serial, threaded

BLOCK = 64
"""Points that one thread takes together."""

AT_CORNER = 1e-9
"""Weight of a corner of a triangle below which a point lies on the edge opposite [-]."""


@threaded
def signed_distances(points, corners, normals, tree, distance):
    """Write the distance of points from the nearest triangle, positive on the side against its normal.

    points    (N, 3) [m]
    corners   (T, 3, 3) [m]
    normals   (T, 7, 3) of a triangle, of its edges after corners 0, 1, 2 and of its corners
    tree      `cfddem.fluid.triangles.Tree`
    distance  (N,) [m], written
    """
    for block in prange((len(points) + BLOCK - 1) // BLOCK):
        _of_block(points, block * BLOCK, corners, normals, tree, distance)


@inline
def _of_block(points, start, corners, normals, tree, distance):
    """The distances of neighbouring points: the search for each begins at the triangle nearest to the one before."""
    nearest = 0
    for n in range(start, min(start + BLOCK, len(points))):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        least, side = _nearest(corners, normals, nearest, x, y, z)
        node = 0
        while node < len(tree.skip):
            if _to_box(tree.box, node, x, y, z) >= least:
                node = tree.skip[node]
                continue
            for t in range(tree.first[node], tree.last[node]):
                square, across = _nearest(corners, normals, t, x, y, z)
                if square < least:
                    least, side, nearest = square, across, t
            node += 1
        distance[n] = np.copysign(np.sqrt(least), -side)


@inline
def _to_box(box, node, x, y, z):
    """Square of the distance of a point from the box of a node."""
    dx = max(box[node, 0] - x, x - box[node, 3], 0.0)
    dy = max(box[node, 1] - y, y - box[node, 4], 0.0)
    dz = max(box[node, 2] - z, z - box[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@inline
def _nearest(corners, normals, t, x, y, z):
    """Square of the distance from a triangle, and how far the point is on the side of the normal of what is nearest."""
    ax, ay, az = corners[t, 0, 0], corners[t, 0, 1], corners[t, 0, 2]
    ux, uy, uz = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay, corners[t, 1, 2] - az
    vx, vy, vz = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay, corners[t, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    area = uu * vv - uv * uv
    s, t2 = (vv * pu - uv * pv) / area, (uu * pv - uv * pu) / area  # weights of corners 1 and 2
    if s < 0.0 or t2 < 0.0 or s + t2 > 1.0:  # beyond an edge: the nearest of the three edges
        best, s_best, t_best = np.inf, 0.0, 0.0
        for edge in range(3):
            if edge == 0:
                along = min(max(pu / uu, 0.0), 1.0)
                s, t2 = along, 0.0
            elif edge == 1:
                along = min(max((pv - pu - uv + uu) / (uu - 2.0 * uv + vv), 0.0), 1.0)
                s, t2 = 1.0 - along, along
            else:
                along = min(max(1.0 - pv / vv, 0.0), 1.0)
                s, t2 = 0.0, 1.0 - along
            dx, dy, dz = px - s * ux - t2 * vx, py - s * uy - t2 * vy, pz - s * uz - t2 * vz
            square = dx * dx + dy * dy + dz * dz
            if square < best:
                best, s_best, t_best = square, s, t2
        s, t2 = s_best, t_best
    dx, dy, dz = px - s * ux - t2 * vx, py - s * uy - t2 * vy, pz - s * uz - t2 * vz
    feature = _feature(1.0 - s - t2, s, t2)
    across = dx * normals[t, feature, 0] + dy * normals[t, feature, 1] + dz * normals[t, feature, 2]
    return dx * dx + dy * dy + dz * dz, across


@inline
def _feature(first, second, third):
    """Row of the normals, by weights of the corners: 0 within a triangle, 1 to 3 on edges, 4 to 6 on corners."""
    on_first, on_second, on_third = first < AT_CORNER, second < AT_CORNER, third < AT_CORNER
    if on_second and on_third:
        return 4
    if on_first and on_third:
        return 5
    if on_first and on_second:
        return 6
    if on_third:
        return 1
    if on_first:
        return 2
    if on_second:
        return 3
    return 0


@serial
def first_crossing(corners, names, tree):
    """The first pair of triangles without a common corner of which one edge passes through the other; -1, -1 if none.

    names  (T, 3) numbers of the corners
    """
    for a in range(len(corners)):
        x, y, z = corners[a, :, 0], corners[a, :, 1], corners[a, :, 2]
        low = (min(x[0], x[1], x[2]), min(y[0], y[1], y[2]), min(z[0], z[1], z[2]))
        high = (max(x[0], x[1], x[2]), max(y[0], y[1], y[2]), max(z[0], z[1], z[2]))
        node = 0
        while node < len(tree.skip):
            if _apart(tree.box, node, low, high):
                node = tree.skip[node]
                continue
            for b in range(tree.first[node], tree.last[node]):
                if a != b and not _touch(names, a, b):
                    for edge in range(3):
                        if _passes(corners, a, edge, b):
                            return a, b
            node += 1
    return -1, -1


@inline
def _apart(box, node, low, high):
    """Whether the box of a node has nothing in common with another."""
    along_x = box[node, 0] > high[0] or box[node, 3] < low[0]
    along_y = box[node, 1] > high[1] or box[node, 4] < low[1]
    return along_x or along_y or box[node, 2] > high[2] or box[node, 5] < low[2]


@inline
def _touch(names, a, b):
    """Whether two triangles have a common corner."""
    for i in range(3):
        for j in range(3):
            if names[a, i] == names[b, j]:
                return True
    return False


@inline
def _passes(corners, a, edge, b):
    """Whether an edge of triangle a passes through triangle b, not only along its edge."""
    after = (edge + 1) % 3
    px, py, pz = corners[a, edge, 0], corners[a, edge, 1], corners[a, edge, 2]
    qx, qy, qz = corners[a, after, 0] - px, corners[a, after, 1] - py, corners[a, after, 2] - pz
    least, along = _through((px, py, pz), (qx, qy, qz), corners, b)
    return least > 0.0 and 0.0 < along < 1.0


@inline
def _through(begin, way, corners, b):
    """Where a straight line passes through triangle b: the least of its senses about the edges, negative outside, and
    the share of its way. Neighbours of one edge find the same number for it: no line slips between them."""
    (px, py, pz), (qx, qy, qz) = begin, way
    ax, ay, az = corners[b, 0, 0] - px, corners[b, 0, 1] - py, corners[b, 0, 2] - pz
    bx, by, bz = corners[b, 1, 0] - px, corners[b, 1, 1] - py, corners[b, 1, 2] - pz
    cx, cy, cz = corners[b, 2, 0] - px, corners[b, 2, 1] - py, corners[b, 2, 2] - pz
    u = qx * (cy * bz - cz * by) + qy * (cz * bx - cx * bz) + qz * (cx * by - cy * bx)
    v = qx * (ay * cz - az * cy) + qy * (az * cx - ax * cz) + qz * (ax * cy - ay * cx)
    w = qx * (by * az - bz * ay) + qy * (bz * ax - bx * az) + qz * (bx * ay - by * ax)
    total = u + v + w
    if total == 0.0:  # along the plane of the triangle
        return -1.0, 0.0
    least = min(u, v, w) if total > 0.0 else -max(u, v, w)
    hx, hy, hz = (u * ax + v * bx + w * cx), (u * ay + v * by + w * cy), (u * az + v * bz + w * cz)
    return least, (hx * qx + hy * qy + hz * qz) / (total * (qx * qx + qy * qy + qz * qz))


@threaded
def crossings(begin, end, corners, tree, crossed):
    """Write whether the straight lines between places (N, 3) pass through any triangle, its edges included."""
    for n in prange(len(begin)):
        crossed[n] = _is_crossed(begin, end, n, corners, tree)


@inline
def _is_crossed(begin, end, n, corners, tree):
    """Whether one line passes through any triangle."""
    px, py, pz = begin[n, 0], begin[n, 1], begin[n, 2]
    qx, qy, qz = end[n, 0], end[n, 1], end[n, 2]
    low = (min(px, qx), min(py, qy), min(pz, qz))
    high = (max(px, qx), max(py, qy), max(pz, qz))
    node = 0
    while node < len(tree.skip):
        if _apart(tree.box, node, low, high):
            node = tree.skip[node]
            continue
        for b in range(tree.first[node], tree.last[node]):
            least, along = _through((px, py, pz), (qx - px, qy - py, qz - pz), corners, b)
            if least >= 0.0 and 0.0 <= along <= 1.0:
                return True
        node += 1
    return False
