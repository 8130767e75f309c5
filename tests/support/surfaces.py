"""Surfaces of bodies as points and triangles, and as files."""

import math


def make_box(length_m, width_m, height_m):
    """(points, triangles): the bottom first, then the top, then the sides; two triangles each."""
    points = [(x, y, z) for z in (0, height_m) for y in (0, width_m) for x in (0, length_m)]
    corners = "031 023 457 476 015 054 267 273 046 062 137 175".split()
    return points, [tuple(int(corner) for corner in triangle) for triangle in corners]


def format_off(points, triangles):
    rows = ["%r %r %r" % point for point in points] + ["3 %d %d %d" % triangle for triangle in triangles]
    return "\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows]) + "\n"


def make_lathe(outline, around):
    """(points, triangles) of an outline [(radius, height)] turned about z, the solid on its left; open where it ends off the axis."""
    points, rows = [], []
    for radius, height in outline:
        count = around if radius > 0 else 1
        rows.append(range(len(points), len(points) + count))
        points += [(radius * math.cos(2 * math.pi * k / around), radius * math.sin(2 * math.pi * k / around), height) for k in range(count)]
    triangles = []
    for low, high in zip(rows, rows[1:]):
        for k in range(around):
            a, b, c, d = (row[i % len(row)] for row in (low, high) for i in (k, k + 1))
            triangles += [corners for corners in ((a, b, d), (a, d, c)) if len(set(corners)) == 3]
    return points, triangles


def refine(outline, edge):
    """The outline with pieces of at most `edge`."""
    fine = [outline[0]]
    for (r0, z0), (r1, z1) in zip(outline, outline[1:]):
        pieces = max(1, math.ceil(math.hypot(r1 - r0, z1 - z0) / edge))
        fine += [(r0 + i / pieces * (r1 - r0), z0 + i / pieces * (z1 - z0)) for i in range(1, pieces + 1)]
    return fine
