"""Structured meshes of T10 elements, and meshes moved along given fields; Gmsh 2.2 files, STL and OBJ of surfaces."""
import itertools

import numpy
import scipy.sparse
import scipy.sparse.linalg

EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))  # of Gmsh's tetrahedron of ten nodes, in the order of its mid-side nodes
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))  # corners, outwards


def make_grid(cells, is_round=False):
    """Grid of (n0, n1, n2) cells of six tetrahedra, each cell the mirror image of its neighbours: with even numbers the mesh is symmetric
    about the middle planes, so modes of different symmetry never mix. is_round: the ends of axis 0 are joined.
    Returns places (N, 3) in 0 .. 1 and tets (E, 10)."""
    cells = numpy.array(cells)
    count = 2 * cells + 1
    number = numpy.arange(count.prod()).reshape(count)
    if is_round:
        number[-1] = number[0]
    places = numpy.stack(numpy.meshgrid(*(numpy.linspace(0, 1, n) for n in count), indexing="ij"), -1).reshape(-1, 3)
    tets = []
    first = numpy.stack(numpy.meshgrid(*(numpy.arange(n) for n in cells), indexing="ij"), -1).reshape(-1, 3)
    odd = first % 2  # mirrored along these axes
    for order in itertools.permutations(range(3)):
        corners = numpy.zeros((4, 3), int)
        for step, axis in enumerate(order):
            corners[step + 1 :, axis] = 2
        local = numpy.concatenate([corners, [(corners[a] + corners[b]) // 2 for a, b in EDGES]])
        at = 2 * first[:, None] + numpy.where(odd[:, None] == 1, 2 - local, local)
        tets.append(number[at[..., 0], at[..., 1], at[..., 2]])
    return places, numpy.concatenate(tets)


def tidy(nodes, tets):
    """Merges nodes at one place, drops tets without volume and unused nodes, turns inverted tets: (old numbers (N), tets)."""
    size = numpy.ptp(nodes, axis=0).max()
    _, first, same = numpy.unique(numpy.round(nodes / size * 1e9).astype(numpy.int64), axis=0, return_index=True, return_inverse=True)
    tets = first[same.ravel()][tets]
    tets = tets[[len(set(tet[:4])) == 4 for tet in tets]]
    # Edges that have become one have one node: the nearest to their middle.
    ends = numpy.sort(tets[:, numpy.array(EDGES)], axis=2).reshape(-1, 2)
    middles = tets[:, 4:].reshape(-1)
    away = numpy.linalg.norm(nodes[middles] - nodes[ends].mean(axis=1), axis=1)
    _, edge = numpy.unique(ends, axis=0, return_inverse=True)
    order = numpy.lexsort((middles, numpy.round(away / size * 1e9), edge.ravel()))
    _, begin = numpy.unique(edge.ravel()[order], return_index=True)
    tets[:, 4:] = middles[order[begin]][edge.ravel()].reshape(-1, 6)
    inverted = numpy.linalg.det(nodes[tets[:, 1:4]] - nodes[tets[:, :1]]) < 0
    tets[inverted] = tets[inverted][:, (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)]
    used, tets = numpy.unique(tets, return_inverse=True)
    return used, tets.reshape(-1, 10)


def find_surface(tets):
    """Outer triangles (T, 3), four for each face of six nodes, outwards."""
    middle = {frozenset(edge): 4 + number for number, edge in enumerate(EDGES)}
    faces = [(*f, *(middle[frozenset((f[k], f[(k + 1) % 3]))] for k in range(3))) for f in FACES]
    every = numpy.concatenate([tets[:, face] for face in faces])
    _, first, count = numpy.unique(numpy.sort(every[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    a, b, c, ab, bc, ca = every[first[count == 1]].T
    return numpy.concatenate([numpy.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def spread(nodes, tets, fixed, values):
    """Values (fixed nodes, k) continued smoothly to all nodes, (N, k): weighted means over the edges of the mesh."""
    pairs = numpy.unique(
        numpy.sort(numpy.concatenate([tets[:, list(pair)] for pair in itertools.combinations(range(10), 2)]), axis=1), axis=0
    )
    weight = 1 / numpy.maximum(numpy.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1), 1e-12) ** 2
    graph = scipy.sparse.coo_matrix((weight, pairs.T), shape=(len(nodes),) * 2)
    graph = (graph + graph.T).tocsr()
    laplace = (scipy.sparse.diags(numpy.asarray(graph.sum(axis=1)).ravel()) - graph).tocsc()
    inside = numpy.setdiff1d(numpy.arange(len(nodes)), fixed)
    result = numpy.zeros((len(nodes), values.shape[1]))
    result[fixed] = values
    if len(inside):
        result[inside] = scipy.sparse.linalg.splu(laplace[inside][:, inside]).solve(-laplace[inside][:, fixed] @ values)
    return result


def fade(share):
    """Depth of a spot at a share of its radius, over that in its middle."""
    return numpy.where(share < 1, (1 - numpy.minimum(share, 1) ** 2) ** 2, 0.0)


def write_msh(path, nodes, tets):
    with open(path, "w") as file:
        file.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(nodes)}\n")
        file.writelines(f"{i} {x:.17g} {y:.17g} {z:.17g}\n" for i, (x, y, z) in enumerate(nodes.tolist(), 1))
        file.write(f"$EndNodes\n$Elements\n{len(tets)}\n")
        file.writelines(f"{i} 11 2 1 1 {' '.join(map(str, tet))}\n" for i, tet in enumerate((tets + 1).tolist(), 1))
        file.write("$EndElements\n")


def write_stl(path, points, triangles):
    """Binary STL in mm, as workshops and printers read it."""
    corners = 1e3 * points[triangles]
    normal = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= numpy.maximum(numpy.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    rows = numpy.zeros(len(triangles), dtype=[("v", "<f4", (4, 3)), ("a", "<u2")])
    rows["v"] = numpy.concatenate([normal[:, None], corners], axis=1)
    with open(path, "wb") as file:
        file.write(b"mm".ljust(80) + numpy.uint32(len(triangles)).tobytes() + rows.tobytes())


def write_obj(path, points, triangles):
    used, corners = numpy.unique(triangles, return_inverse=True)
    with open(path, "w") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points[used].tolist())
        file.writelines(f"f {a} {b} {c}\n" for a, b, c in (corners.reshape(-1, 3) + 1).tolist())


def find_cut(before, after, triangles):
    """The material between two positions (N, 3) of a surface: points (2 N, 3), closed triangles."""
    moved = numpy.linalg.norm(after - before, axis=1) > 1e-7
    cut = triangles[moved[triangles].any(axis=1)]
    edges = {(a, b) for t in cut.tolist() for a, b in zip(t, t[1:] + t[:1])}
    n = len(before)
    walls = [w for a, b in edges if (b, a) not in edges for w in ((b, a, a + n), (b, a + n, b + n))]
    return numpy.concatenate([before, after]), numpy.concatenate([cut, cut[:, ::-1] + n, numpy.array(walls, int).reshape(-1, 3)])
