"""Sites of the sensitivities of a bank (docs/bank-format.md)."""
import numpy


def find_sites(vertices, triangles, vertex, normal):
    """(T, 3) the site of each corner: of those of its vertex, the one whose normal is nearest to the triangle's. vertex (S), normal (S, 3):
    of the sites; each vertex of a triangle has one."""
    corners = vertices[triangles]
    facing = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    order = numpy.argsort(vertex, kind="stable")
    first = numpy.searchsorted(vertex[order], triangles)
    best, most = order[numpy.minimum(first, len(order) - 1)], numpy.full(triangles.shape, -numpy.inf)
    for step in range(int(numpy.bincount(vertex).max())):
        site = order[numpy.minimum(first + step, len(order) - 1)]
        along = numpy.where(vertex[site] == triangles, (normal[site] * facing[:, None]).sum(axis=2), -numpy.inf)
        best, most = numpy.where(along > most, site, best), numpy.maximum(along, most)
    return best
