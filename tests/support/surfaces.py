"""Surfaces of bodies as points and triangles, and as files."""


def make_box(length_m, width_m, height_m):
    """(points, triangles): the bottom first, then the top, then the sides; two triangles each."""
    points = [(x, y, z) for z in (0, height_m) for y in (0, width_m) for x in (0, length_m)]
    corners = "031 023 457 476 015 054 267 273 046 062 137 175".split()
    return points, [tuple(int(corner) for corner in triangle) for triangle in corners]


def format_off(points, triangles):
    rows = ["%r %r %r" % point for point in points] + ["3 %d %d %d" % triangle for triangle in triangles]
    return "\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows]) + "\n"
