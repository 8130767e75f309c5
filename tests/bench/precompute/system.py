"""K and M of a body of linear tetrahedra, assembled independently of carillon: input of the rivals and reference for every answer.

File formats: system_file.hpp.
"""
import json
import re

import numpy
import scipy.sparse


def read_job(path):
    """The material of a job file: (Lame's lambda [Pa], mu [Pa], density [kg/m^3], mass kind, band [Hz])."""
    job = json.loads(re.sub(r"//[^\n]*", "", path.read_text()))
    if job["element"] != "T4":
        raise ValueError(f"{path}: the rivals' system is made of T4 only")
    material = job["material"]
    return material["lame_lambda_pa"], material["lame_mu_pa"], material["density_kg_m3"], job["mass"], job["band_hz"]


def assemble(nodes, tets, lame_lambda, lame_mu, density, mass):
    """nodes (n, 3) [m], tets (e, 4) -> K [N/m], M [kg], (3n, 3n) CSR. Zienkiewicz, Taylor, The finite element method, linear tetrahedron:
    gradients g_a of the shape functions are constant, K_ab = V (lambda g_a g_b' + mu g_b g_a' + mu (g_a . g_b) I);
    consistent mass rho V (1 + delta_ab) / 20, lumped rho V / 4."""
    edges = nodes[tets[:, 1:]] - nodes[tets[:, :1]]  # (e, 3, 3), rows are edges
    volume = abs(numpy.linalg.det(edges)) / 6
    inverse = numpy.linalg.inv(edges)  # columns are gradients of the nodes 1, 2, 3
    gradients = numpy.concatenate([-inverse.sum(axis=2)[:, None, :], inverse.transpose(0, 2, 1)], axis=1)  # (e, 4, 3)
    outer = numpy.einsum("eai,ebj->eabij", gradients, gradients)
    blocks = lame_lambda * outer + lame_mu * outer.transpose(0, 1, 2, 4, 3)
    blocks += lame_mu * numpy.einsum("eabkk->eab", outer)[..., None, None] * numpy.eye(3)
    blocks *= volume[:, None, None, None, None]
    dofs = 3 * tets[:, :, None] + numpy.arange(3)  # (e, 4, 3)
    rows = numpy.broadcast_to(dofs[:, :, None, :, None], blocks.shape)
    columns = numpy.broadcast_to(dofs[:, None, :, None, :], blocks.shape)
    n = 3 * len(nodes)
    stiffness = scipy.sparse.coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()
    if mass == "lumped":
        per_node = numpy.bincount(tets.ravel(), numpy.repeat(density * volume / 4, 4), len(nodes))
        return stiffness, scipy.sparse.diags(numpy.repeat(per_node, 3)).tocsr()
    weights = (density * volume / 20)[:, None, None] * (1 + numpy.eye(4))
    rows = numpy.broadcast_to(tets[:, :, None], weights.shape)
    columns = numpy.broadcast_to(tets[:, None, :], weights.shape)
    per_node = scipy.sparse.coo_matrix((weights.ravel(), (rows.ravel(), columns.ravel())), shape=(len(nodes), len(nodes)))
    return stiffness, scipy.sparse.kron(per_node, numpy.eye(3)).tocsr()


def read_mesh(path):
    """Reads a mesh with Gmsh: nodes (n, 3) used by tetrahedra, in the order of their tags, and linear tetrahedra (e, 4)."""
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 0)
        gmsh.open(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        _, corners = gmsh.model.mesh.getElementsByType(4)
    finally:
        gmsh.finalize()
    used, tets = numpy.unique(corners, return_inverse=True)
    place = numpy.argsort(tags)
    at = place[numpy.searchsorted(tags, used, sorter=place)]
    return points.reshape(-1, 3)[at], tets.reshape(-1, 4)


def scale(stiffness, mass, high_hz):
    """Scales to lambda = 1 at the upper end of the band and K of order one, as expected by absolute thresholds of solvers."""
    size = stiffness.diagonal().mean()
    return stiffness / size, mass * ((2 * numpy.pi * high_hz) ** 2 / size)


def write_matrix(path, matrix):
    matrix = matrix.tocsr()
    matrix.sort_indices()
    with open(path, "wb") as stream:
        numpy.array([matrix.shape[0], matrix.nnz], dtype=numpy.int64).tofile(stream)
        matrix.indptr.astype(numpy.int32).tofile(stream)
        matrix.indices.astype(numpy.int32).tofile(stream)
        matrix.data.astype(numpy.float64).tofile(stream)


def read_matrix(path):
    with open(path, "rb") as stream:
        n, count = numpy.fromfile(stream, numpy.int64, 2)
        first = numpy.fromfile(stream, numpy.int32, n + 1)
        column = numpy.fromfile(stream, numpy.int32, count)
        value = numpy.fromfile(stream, numpy.float64, count)
    return scipy.sparse.csr_matrix((value, column, first), shape=(n, n))


def write_answer(path, values, vectors):
    """values (k), vectors (n, k)."""
    with open(path, "wb") as stream:
        numpy.array([vectors.shape[0], len(values)], dtype=numpy.int64).tofile(stream)
        numpy.asarray(values, dtype=numpy.float64).tofile(stream)
        numpy.asarray(vectors.T, dtype=numpy.float64).tofile(stream)


def read_answer(path):
    with open(path, "rb") as stream:
        n, count = numpy.fromfile(stream, numpy.int64, 2)
        values = numpy.fromfile(stream, numpy.float64, count)
        vectors = numpy.fromfile(stream, numpy.float64, n * count).reshape(count, n).T
    order = numpy.argsort(values)
    return values[order], vectors[:, order]


def measure_answer(stiffness, mass, values, vectors, rigid=6):
    """Residuals ||K x - lambda M x|| / (lambda ||M x||) of the elastic modes, and max |X' M X - I| of all."""
    images = mass @ vectors
    residual = (
        numpy.linalg.norm(stiffness @ vectors - images * values, axis=0)[rigid:] / (values * numpy.linalg.norm(images, axis=0))[rigid:]
    )
    gram = vectors.T @ images
    norms = numpy.sqrt(numpy.diag(gram))
    return residual, abs(gram / numpy.outer(norms, norms) - numpy.eye(len(values))).max()
