"""Error of sensitivities: cuts of spots against new solves. Needs jobs/tune and jobs/study on the path."""
import numpy

import grid
import shapes

DEPTH_M = 1e-5
SURE_CENTS = 5.0  # bar of a mode that counts, as of a mesh of accuracy_cents 5
LEAST = 0.05  # of the largest change: what smaller ones are compared with


def measure_spot(solve, body, p, radius_m, at_m):
    """(nodes, relative errors (n) of the modes with bars up to SURE_CENTS) of a spot DEPTH_M deep around a point of the surface, in
    addition to the depths p of a shapes.Moved. solve: function of a job to its Solution with sensitivities."""
    nodes = body.place(p)
    triangles = grid.find_surface(body.tets)
    normal, _ = shapes.find_normals(nodes, triangles)
    surface = numpy.unique(triangles)
    near = surface[numpy.linalg.norm(nodes[surface] - at_m, axis=1).argmin()]
    corners = nodes[triangles]
    facing = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    one_side = triangles[facing @ normal[near] > 0.5 * numpy.linalg.norm(facing, axis=1)]
    normal, _ = shapes.find_normals(nodes, one_side)  # an edge moves on this side alone
    share = numpy.linalg.norm(nodes[surface] - nodes[near], axis=1) / radius_m
    depth = numpy.where(normal[surface] @ normal[near] > 0.5, grid.fade(share), 0)
    field = grid.spread(nodes, body.tets, surface, -depth[:, None] * normal[surface])
    one = numpy.ones(1)
    spot = shapes.Moved(body.job, nodes, body.tets, field[None], ["spot"], -one, one, one, numpy.eye(1), mesh=body.mesh)
    found, cut = (solve(spot, depth_m * one) for depth_m in (0.0, DEPTH_M))
    state = type("State", (), {"solution": found, "p": 0 * one})()
    before, after = (1200 * numpy.log2(numpy.sort(solved.freq_hz) / found.freq_hz.min()) for solved in (found, cut))
    matrix = numpy.diag(1200 * numpy.log2(found.freq_hz / found.freq_hz.min()))
    for (i, j), entry in zip(found.sites.columns, DEPTH_M * shapes.calc_entries(spot, state)[:, 0]):
        matrix[i, j] += entry
        matrix[j, i] = matrix[i, j]
    true = after - before
    error = numpy.abs(numpy.linalg.eigvalsh(matrix) - after)
    sure = found.bar_cents[numpy.argsort(found.freq_hz)] <= SURE_CENTS
    return len(nodes), error[sure] / numpy.maximum(numpy.abs(true[sure]), LEAST * numpy.abs(true[sure]).max(initial=0.0))
