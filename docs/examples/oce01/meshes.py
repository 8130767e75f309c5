"""Meshes of bodies that have no shape of the jobs: lattices of cells, each of six tetrahedra of ten nodes, as Gmsh files."""
import itertools
import math
import pathlib

EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))  # of Gmsh's tetrahedron of ten nodes, in the order of its mid-side nodes
BAR_LENGTH, BAR_WIDTH = 0.36, 0.05
BAR_HEIGHT, UNDERCUT, REACH = 0.0131825, 0.0082301, 0.0875879  # so that the first bending modes are 1 : 4 : 10


def write_lattice(file, cells, find_place):
    """cells: along each axis. find_place(s, t, u): the place [m] of three parameters from 0 to 1. Neighbouring cells mirror each other, so
    that the mesh has no handedness; mid-side nodes lie where their parameters are half-way."""
    number, places, tets = {}, [], []

    def find_node(doubled):
        if doubled not in number:
            number[doubled] = len(places) + 1
            places.append(find_place(*(doubled[k] / (2 * cells[k]) for k in range(3))))
        return number[doubled]

    for cell in itertools.product(*map(range, cells)):
        for order in itertools.permutations(range(3)):
            at = [2 * (c + c % 2) for c in cell]
            corners = [tuple(at)]
            for k in order:
                at[k] += -2 if cell[k] % 2 else 2
                corners.append(tuple(at))
            swaps = sum(order[a] > order[b] for a in range(3) for b in range(a + 1, 3)) + sum(c % 2 for c in cell)
            if swaps % 2:
                corners[2], corners[3] = corners[3], corners[2]
            middles = [tuple((x + y) // 2 for x, y in zip(corners[a], corners[b])) for a, b in EDGES]
            tets.append([find_node(q) for q in corners + middles])
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(places))]
    lines += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(places, 1)]
    lines += ["$EndNodes", "$Elements", str(len(tets))]
    lines += [f"{i} 11 2 0 1 {' '.join(map(str, tet))}" for i, tet in enumerate(tets, 1)] + ["$EndElements", ""]
    pathlib.Path(file).write_text("\n".join(lines))


def write_box(file, cells, size_m):
    """Centred on the origin."""
    write_lattice(file, cells, lambda *at: tuple(size * (share - 0.5) for size, share in zip(size_m, at)))


def write_vibraphone(file, cells):
    """A bar along x that is undercut from below."""

    def find_place(s, t, u):
        x = BAR_LENGTH * (s - 0.5)
        thickness = BAR_HEIGHT - UNDERCUT * math.exp(-((x / REACH) ** 4))
        return x, BAR_WIDTH * (t - 0.5), BAR_HEIGHT / 2 - thickness * (1 - u)

    write_lattice(file, cells, find_place)


def write_bar_with_nodes(file, size_m, node):
    """A bar along x of 12 cells, of which the third and the ninth boundary lie at the share `node` from its ends."""

    def find_place(s, t, u):
        k = 12 * s
        share = node * k / 3 if k <= 3 else node + (1 - 2 * node) * (k - 3) / 6 if k <= 9 else 1 - node * (12 - k) / 3
        return size_m[0] * (share - 0.5), size_m[1] * (t - 0.5), size_m[2] * (u - 0.5)

    write_lattice(file, (12, 1, 1), find_place)
