"""How the surface between the ranks grows: a mesh cut by METIS into many parts, and counted as precompute/ldlt/separator.cpp sees it."""
import ctypes
import ctypes.util

import numpy


def cut(tets, nodes, parts):
    """METIS_PartMeshDual, elements that share a face being neighbours. tets (e, 4) -> part of each node (n)."""
    metis = ctypes.CDLL(ctypes.util.find_library("metis") or "libmetis.so.5")
    index = numpy.int32
    count = lambda value: ctypes.byref(ctypes.c_int32(value))
    pointers = 4 * numpy.arange(len(tets) + 1, dtype=index)
    corners = numpy.ascontiguousarray(tets, dtype=index).ravel()
    of_tet, of_node = numpy.zeros(len(tets), index), numpy.zeros(nodes, index)
    address = lambda array: array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))
    code = metis.METIS_PartMeshDual(
        count(len(tets)),
        count(nodes),
        address(pointers),
        address(corners),
        None,
        None,
        count(3),
        count(parts),
        None,
        None,
        count(0),
        address(of_tet),
        address(of_node),
    )
    if code != 1:
        raise RuntimeError(f"METIS: code {code}")
    return of_node


def find_edges(tets):
    """(edges, 2), each once, low node first."""
    pairs = numpy.concatenate([tets[:, [a, b]] for a in range(4) for b in range(a + 1, 4)])
    return numpy.unique(numpy.sort(pairs, axis=1), axis=0)


class Separator:
    """Of two neighbours on different ranks the one on the higher rank belongs to the separator; nodes that are near the same ranks form a
    group."""

    def __init__(self, edges, of_node):
        parts = of_node[edges]
        across = parts[:, 0] != parts[:, 1]
        is_inside = numpy.ones(len(of_node), bool)
        is_inside[numpy.where(parts[:, 0] > parts[:, 1], edges[:, 0], edges[:, 1])[across]] = False
        self.parts = int(of_node.max()) + 1
        self.nodes = numpy.flatnonzero(~is_inside)
        number = numpy.cumsum(~is_inside) - 1
        self.near = [set() for _ in self.nodes]  # ranks that have inner neighbours of the node
        self.links = [[] for _ in self.nodes]
        for a, b in ((0, 1), (1, 0)):
            chosen = ~is_inside[edges[:, a]] & is_inside[edges[:, b]]
            for node, part in zip(number[edges[chosen, a]], of_node[edges[chosen, b]]):
                self.near[node].add(int(part))
            chosen = ~is_inside[edges].any(axis=1)
            for node, other in zip(number[edges[chosen, a]], number[edges[chosen, b]]):
                self.links[node].append(int(other))
        pairs = numpy.unique(numpy.sort(parts[across], axis=1), axis=0)
        self.neighbours = float(numpy.bincount(pairs.ravel(), minlength=self.parts).mean())
        self.groups = {frozenset(ranks) for ranks in self.near}
        self.groups_near_a_part = sum(map(len, self.groups)) / self.parts

    def write(self, path):
        """For time_planning.cpp."""
        numbers = [len(self.nodes), self.parts]
        for lists in (self.links, self.near):
            for items in lists:
                numbers += [len(items), *sorted(items)]
        numpy.array(numbers, numpy.int32).tofile(path)
