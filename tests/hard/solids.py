"""Meshes for hard cases: lattices of tetrahedra, and what spoils them. Serial, numpy only; no code of the programs under test."""
import itertools

import numpy as np

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])  # of the mid-side nodes 4..9


class Solid:
    """nodes (N, 3) [m]; tets (E, 4) or (E, 10), corners positively oriented; regions (E)."""

    def __init__(self, nodes, tets, regions=None):
        self.nodes = np.array(nodes, float).reshape(-1, 3)
        self.tets = np.array(tets, int)
        self.regions = np.zeros(len(self.tets), int) if regions is None else np.array(regions, int)

    def copy(self):
        return Solid(self.nodes, self.tets, self.regions)

    def corners(self):
        return self.nodes[self.tets[:, :4]]

    def volumes(self):
        x = self.corners()
        return np.einsum("ei,ei->e", x[:, 1] - x[:, 0], np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 0])) / 6

    def find_dihedrals(self):
        """(E, 6) the dihedral angles [deg]."""
        x = self.corners()
        faces = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]
        normals = np.stack([np.cross(x[:, f[1]] - x[:, f[0]], x[:, f[2]] - x[:, f[0]]) for f in faces], 1)
        pairs = list(itertools.combinations(range(4), 2))
        # The sine keeps the digits that the cosine of a small angle has lost.
        cosine = -np.stack([np.einsum("ei,ei->e", normals[:, a], normals[:, b]) for a, b in pairs], 1)
        sine = np.stack([np.linalg.norm(np.cross(normals[:, a], normals[:, b]), axis=1) for a, b in pairs], 1)
        return np.degrees(np.arctan2(sine, cosine))

    def write(self, path):
        """Gmsh 2.2, every digit."""
        kind = 4 if self.tets.shape[1] == 4 else 11
        # Gmsh has the mid nodes of the last two edges the other way round.
        order = list(range(4)) if kind == 4 else [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
        with open(path, "w") as out:
            out.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(self.nodes)}\n")
            out.writelines(f"{i + 1} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in enumerate(self.nodes.tolist()))
            out.write(f"$EndNodes\n$Elements\n{len(self.tets)}\n")
            out.writelines(
                f"{e + 1} {kind} 2 {region} {region} {' '.join(str(n + 1) for n in tet)}\n"
                for e, (tet, region) in enumerate(zip(self.tets[:, order].tolist(), self.regions.tolist()))
            )
            out.write("$EndElements\n")


def make_lattice(x, y, z, mirror=None):
    """The planes x, y, z [m] as cells of six tetrahedra that share a diagonal, mirrored from cell to cell so that faces match; `mirror(i,
    j, k)` says otherwise which of the three axes of a cell are turned round."""
    x, y, z = (np.asarray(a, float) for a in (x, y, z))
    count = [len(a) for a in (x, y, z)]
    nodes = np.array([[a, b, c] for a in x for b in y for c in z])
    number = np.arange(len(nodes)).reshape(count)
    tets = []
    for i, j, k in itertools.product(*(range(n - 1) for n in count)):
        turned = np.array(mirror(i, j, k) if mirror else (i % 2, j % 2, k % 2))
        for axes in itertools.permutations(range(3)):
            at, tet = turned.copy(), []
            tet.append(number[tuple(np.array([i, j, k]) + at)])
            for axis in axes:
                at[axis] = 1 - turned[axis]
                tet.append(number[tuple(np.array([i, j, k]) + at)])
            tets.append(tet)
    return orient(Solid(nodes, tets))


def make_box(cells, size, origin=(0, 0, 0)):
    return make_lattice(*(origin[d] + size[d] * np.arange(cells[d] + 1) / cells[d] for d in range(3)))


def orient(solid):
    """Every element positive."""
    turned = solid.volumes() < 0
    solid.tets[turned] = solid.tets[turned][:, [0, 2, 1, 3] + ([6, 5, 4, 7, 9, 8] if solid.tets.shape[1] == 10 else [])]
    return solid


def to_quadratic(solid):
    """Mid-side nodes in the middle of the edges."""
    pairs = np.sort(solid.tets[:, EDGES], axis=2).reshape(-1, 2)
    unique, inverse = np.unique(pairs, axis=0, return_inverse=True)
    tets = np.hstack([solid.tets, len(solid.nodes) + inverse.reshape(-1, 6)])
    return Solid(np.vstack([solid.nodes, solid.nodes[unique].mean(1)]), tets, solid.regions)


def of_order(solid, order):
    return to_quadratic(solid) if order == 2 else solid


def join(*solids):
    """Several bodies in one file, sharing nothing."""
    first = np.cumsum([0] + [len(s.nodes) for s in solids])
    return Solid(
        np.vstack([s.nodes for s in solids]),
        np.vstack([s.tets + n for s, n in zip(solids, first)]),
        np.concatenate([s.regions for s in solids]),
    )


def merge(solid, tolerance=1e-9):
    """Nodes in the same place become one."""
    key = np.round(solid.nodes / (tolerance * np.ptp(solid.nodes, axis=0).max())).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return Solid(solid.nodes[first], inverse.reshape(-1)[solid.tets], solid.regions)


def burst(solid):
    """Every element gets nodes of its own."""
    return Solid(solid.nodes[solid.tets.ravel()], np.arange(solid.tets.size).reshape(solid.tets.shape), solid.regions)


def make_slivers(cells, size, angle_deg, planes):
    """A box with a layer of slivers on each lattice plane x = planes[i]: the squares there are cut along one diagonal on one side and along
    the other on the other side, and a sliver lies between. The nodes of the plane are shifted by turns so that the least dihedral angle is
    angle_deg."""
    planes = sorted(planes)

    def mirror(i, j, k):
        return (i % 2, (j + sum(p <= i for p in planes)) % 2, k % 2)

    grid = [size[d] * np.arange(cells[d] + 1) / cells[d] for d in range(3)]
    box = make_lattice(*grid, mirror)
    number = np.arange(len(box.nodes)).reshape([c + 1 for c in cells])
    tets = []
    for p in planes:
        for j, k in itertools.product(range(cells[1]), range(cells[2])):
            tets.append([number[p, j, k], number[p, j + 1, k + 1], number[p, j + 1, k], number[p, j, k + 1]])
    flat = box.nodes.copy()

    def build(shift):
        solid = Solid(flat, np.vstack([box.tets, tets]))
        for n, p in enumerate(planes):
            for j, k in itertools.product(range(cells[1] + 1), range(cells[2] + 1)):
                # On its left the plane is cut along the diagonals between nodes of even (j + n + k).
                solid.nodes[number[p, j, k], 0] += -shift if (j + n + k) % 2 == 0 else shift
        return solid

    low, high = 0.0, 0.05 * size[0] / cells[0]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if orient(build(middle)).find_dihedrals().min() < angle_deg else (low, middle)
    return orient(build(high))


def make_caps(solid, tets, height):
    """Each of `tets` becomes four, by a node over the middle of its first face at `height` times its own; the one below is a cap."""
    nodes, out, regions = list(solid.nodes), list(solid.tets), list(solid.regions)
    for e in tets:
        a, b, c, d = solid.tets[e]
        n = len(nodes)
        nodes.append((1 - height) * solid.nodes[[b, c, d]].mean(0) + height * solid.nodes[a])
        out[e] = [n, b, c, d]
        out += [[a, n, c, d], [a, b, n, d], [a, b, c, n]]
        regions += [solid.regions[e]] * 3
    return Solid(nodes, out, regions)


def make_needles(solid, edges, part):
    """Each of `edges` (pairs of nodes of which no two touch one element) gets a node at `part` of its length from its first end; all
    elements about it become two, one of them with an edge that short."""
    nodes, tets, regions = list(solid.nodes), solid.tets.tolist(), list(solid.regions)
    for a, b in edges:
        n = len(nodes)
        nodes.append((1 - part) * solid.nodes[a] + part * solid.nodes[b])
        for e in range(len(tets)):
            if a in tets[e] and b in tets[e]:
                tets.append([n if v == a else v for v in tets[e]])
                tets[e] = [n if v == b else v for v in tets[e]]
                regions.append(regions[e])
    return Solid(nodes, tets, regions)


def find_apart_edges(solid, most):
    """Up to `most` edges, no two of which touch one element."""
    taken, edges = set(), []
    about = {}
    for e, tet in enumerate(solid.tets.tolist()):
        for v in tet:
            about.setdefault(v, set()).add(e)
    for tet in solid.tets.tolist():
        for i, j in EDGES:
            a, b = tet[i], tet[j]
            near = about[a] | about[b]
            if not near & taken:
                edges.append((a, b))
                taken |= near
                if len(edges) == most:
                    return edges
    return edges
