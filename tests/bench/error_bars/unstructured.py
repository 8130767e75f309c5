#!/usr/bin/python3
"""Meshes of strips and plates with triangles in no order, in layers: what lattices and the program's own shapes do not try.

usage: unstructured.py FOLDER BODY [ACROSSxLAYERS]...        BODY: strip-thin, ..., plate-thin, ruler, plate, bar, slender-bar of
                                                             tests/unit/precompute/fem/error_bars/bodies.cpp

Writes FOLDER/BODY-ACROSSxLAYERS.msh: about ACROSS triangles' edges across the body. For  error_bars --body BODY --element T10 --mesh
FILE.msh
"""
import os
import sys

import numpy
import scipy.spatial

EDGES_M = {
    "strip-thin": (0.3, 0.03, 0.001),
    "strip-thick": (0.3, 0.03, 0.003),
    "strip-nu0": (0.2, 0.025, 0.002),
    "strip-nu045": (0.1, 0.01, 0.001),
    "strip-spruce": (0.3, 0.04, 0.003),
    "strip-fixed": (0.2, 0.02, 0.001),
    "plate-thin": (0.1, 0.09, 0.002),
    "ruler": (0.3, 0.025, 0.001),
    "plate": (0.2, 0.2, 0.005),
    "bar": (0.3, 0.03, 0.012),
    "slender-bar": (0.3, 0.02, 0.01),
}


def make_triangles(length, width, edge, random):
    """Rows of points, moved about, within a rim of equal steps."""
    along, across = max(1, round(length / edge)), max(1, round(width / edge))
    points = [(x, y) for x in numpy.linspace(0, length, along + 1) for y in (0, width)]
    points += [(x, y) for y in numpy.linspace(0, width, across + 1)[1:-1] for x in (0, length)]
    rows, columns = max(1, round(width / (0.81 * edge))), int(length / (0.93 * edge))
    for row in range(1, rows):
        for column in range(columns):
            x = (column + (0.5 if row % 2 else 1)) * length / (columns + 0.5) + random.uniform(-0.17, 0.17) * edge
            y = row * width / rows + random.uniform(-0.14, 0.14) * edge
            if min(x, length - x, y, width - y) > 0.28 * edge:
                points.append((x, y))
    points = numpy.array(points)
    triangles = scipy.spatial.Delaunay(points).simplices
    a, b, c = (points[triangles[:, i]].T for i in range(3))
    return points, triangles[abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]) > 2e-4 * edge**2]


def write_mesh(path, edges_m, across, layers):
    length, width, thickness = edges_m
    points, triangles = make_triangles(length, width, width / across, numpy.random.default_rng(10 * across + layers))
    nodes = numpy.array(
        [(x - length / 2, y - width / 2, thickness * (layer / layers - 0.5)) for layer in range(layers + 1) for x, y in points]
    )
    tets = []
    for layer in range(layers):
        low, high = layer * len(points), (layer + 1) * len(points)
        for triangle in numpy.sort(triangles):
            tets += [[*(low + triangle[: k + 1]), *(high + triangle[k:])] for k in range(3)]
    tets = numpy.array(tets)
    corners = nodes[tets]
    a, b, c = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
    turned = numpy.einsum("ij,ij->i", numpy.cross(a, b), c) < 0
    tets[turned] = tets[turned][:, [0, 2, 1, 3]]
    with open(path, "w", encoding="ascii") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(nodes)}\n")
        file.writelines(f"{i + 1} {x:.17g} {y:.17g} {z:.17g}\n" for i, (x, y, z) in enumerate(nodes))
        file.write(f"$EndNodes\n$Elements\n{len(tets)}\n")
        file.writelines(f"{i + 1} 4 2 0 1 {' '.join(str(n + 1) for n in tet)}\n" for i, tet in enumerate(tets))
        file.write("$EndElements\n")


def main(arguments):
    if len(arguments) < 2 or arguments[1] not in EDGES_M:
        sys.exit(__doc__)
    folder, body = arguments[:2]
    os.makedirs(folder, exist_ok=True)
    for size in arguments[2:] or ["2x1", "4x1", "7x1", "3x2", "6x2", "5x3"]:
        across, layers = (int(part) for part in size.split("x"))
        path = f"{folder}/{body}-{size}.msh"
        write_mesh(path, EDGES_M[body], across * 3 if body.startswith("plate") else across, layers)
        print(path)


if __name__ == "__main__":
    main(sys.argv[1:])
