"""Coarse letters as tetrahedra: outlines of a few four-sided pieces on a grid, thickened by one layer.

Each four-sided piece is cut along its shorter diagonal, each prism over a triangle into three tetrahedra by the numbers of its corners,
which makes neighbours fit (Dompierre and others, "How to subdivide pyramids, prisms and hexahedra into tetrahedra", 1999).
"""

GRIDS = {  # a square piece for every #; letters are five squares high
    "T": ("#####", "..#..", "..#..", "..#..", "..#.."),
    "H": ("#...#", "#...#", "#####", "#...#", "#...#"),
    "E": ("####", "#...", "###.", "#...", "####"),
    "N": ("#...#", "#...#", "#...#", "#...#", "#...#"),
    "D": ("#", "#", "#", "#", "#"),
}


def make_squares(rows):
    """Counter-clockwise corners of the squares, (0, 0) at the bottom left."""
    return [
        [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        for y, row in enumerate(reversed(rows))
        for x, cell in enumerate(row)
        if cell == "#"
    ]


def make_strip(left, right):
    """Pieces between two lists of points; the strip goes along them, `left` on its left."""
    return [[right[i], right[i + 1], left[i + 1], left[i]] for i in range(len(left) - 1)]


def make_pieces(letter):
    pieces = make_squares(GRIDS[letter])
    if letter == "N":  # the diagonal, two squares wide: from (1, 5), (1, 4), (1, 3) down to (4, 2), (4, 1), (4, 0)
        lines = [[(1 + i, top - i) for i in range(4)] for top in (5, 4, 3)]
        pieces += make_strip(lines[0], lines[1]) + make_strip(lines[1], lines[2])
    if letter == "D":
        outer = [(1, 5), (2, 5), (3.2, 4.7), (4, 3.7), (4, 2.5), (4, 1.3), (3.2, 0.3), (2, 0), (1, 0)]
        inner = [(1, 4), (2, 4), (2.6, 3.8), (3, 3.3), (3, 2.5), (3, 1.7), (2.6, 1.2), (2, 1), (1, 1)]
        pieces += make_strip(outer, inner)
    return pieces


def calc_volume(a, b, c, d):
    u, v, w = ([q[k] - a[k] for k in range(3)] for q in (b, c, d))
    return (u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])) / 6


def make_mesh(letter, square_m):
    """(points, tetrahedra) of a letter that stands upright in x and z, one square thick in y, its box about the origin."""
    corners, triangles = {}, []
    for piece in make_pieces(letter):
        a, b, c, d = (corners.setdefault(point, len(corners)) for point in piece)
        (xa, ya), (xb, yb), (xc, yc), (xd, yd) = piece
        if (xc - xa) ** 2 + (yc - ya) ** 2 <= (xd - xb) ** 2 + (yd - yb) ** 2:
            triangles += [(a, b, c), (a, c, d)]
        else:
            triangles += [(a, b, d), (b, c, d)]
    width = max(x for x, _ in corners)
    points = [(square_m * (x - width / 2), square_m * y, square_m * (z - 2.5)) for y in (-0.5, 0.5) for x, z in corners]
    tetrahedra = []
    for triangle in triangles:
        first = triangle.index(min(triangle))
        a, b, c = triangle[first:] + triangle[:first]
        d, e, f = (corner + len(corners) for corner in (a, b, c))
        cut = [(a, b, c, f), (a, b, f, e), (a, e, f, d)] if b < c else [(a, b, c, e), (a, e, c, f), (a, e, f, d)]
        tetrahedra += [t if calc_volume(*(points[i] for i in t)) > 0 else (t[1], t[0], t[2], t[3]) for t in cut]
    return points, tetrahedra


def write_medit(file, points, tetrahedra):
    lines = [
        "MeshVersionFormatted 2",
        "Dimension 3",
        "Vertices",
        str(len(points)),
        *(f"{x:.17g} {y:.17g} {z:.17g} 0" for x, y, z in points),
        "Tetrahedra",
        str(len(tetrahedra)),
        *(" ".join(str(i + 1) for i in t) + " 0" for t in tetrahedra),
        "End",
    ]
    file.write_text("\n".join(lines) + "\n")
