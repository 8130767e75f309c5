"""Frequencies of tetrahedral bodies by an assembly of our own and LAPACK or ARPACK: an oracle that shares no code with the programs under
test.

T4 and T10, by quadrature; consistent mass, or lumped by HRZ (Hinton, Rock and Zienkiewicz 1976). C is (6, 6) in Voigt's order xx
yy zz yz xz xy. Where the rounding of K is too much for the truth, `refine_frequencies` takes the strain energy element by element in long
double, K being only its guide.
"""
import itertools

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from solids import EDGES


def isotropic(young, nu):
    lame, mu = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
    c = np.diag([2 * mu] * 3 + [mu] * 3)
    c[:3, :3] += lame
    return c


def orthotropic(young, shear, nu):
    """young E1 E2 E3, shear G12 G23 G13, nu nu12 nu23 nu13."""
    s = np.diag([1 / young[0], 1 / young[1], 1 / young[2], 1 / shear[1], 1 / shear[2], 1 / shear[0]])
    s[0, 1] = s[1, 0] = -nu[0] / young[0]
    s[1, 2] = s[2, 1] = -nu[1] / young[1]
    s[0, 2] = s[2, 0] = -nu[2] / young[0]
    return np.linalg.inv(s)


def find_rule(n=4):
    """Barycentric points (q, 4) and weights (q) of the collapsed Gauss-Jacobi rule: exact to degree 2 n - 1."""
    from scipy.special import roots_jacobi

    rules = [roots_jacobi(n, power, 0) for power in (2, 1, 0)]
    points, weights = [], []
    for (a, wa), (b, wb), (c, wc) in itertools.product(*(list(zip(*r)) for r in rules)):
        u, v, w = ((t + 1) / 2 for t in (a, b, c))
        x, y, z = u, v * (1 - u), w * (1 - u) * (1 - v)
        points.append([1 - x - y - z, x, y, z])
        weights.append(wa * wb * wc)
    weights = np.array(weights)
    return np.array(points), weights / weights.sum()


def calc_shape(points, order):
    """N (q, n) and d N / d L (q, n, 4)."""
    if order == 1:
        return points, np.broadcast_to(np.eye(4), (len(points), 4, 4))
    value = np.zeros((len(points), 10))
    slope = np.zeros((len(points), 10, 4))
    for i in range(4):
        value[:, i] = points[:, i] * (2 * points[:, i] - 1)
        slope[:, i, i] = 4 * points[:, i] - 1
    for m, (a, b) in enumerate(EDGES):
        value[:, 4 + m] = 4 * points[:, a] * points[:, b]
        slope[:, 4 + m, a], slope[:, 4 + m, b] = 4 * points[:, b], 4 * points[:, a]
    return value, slope


def assemble(solid, c, density, lumped=False):
    """K and M, sparse; `c` and `density` per element or for all. Mid-side nodes may be off the middle of their edges."""
    tets, order = solid.tets, 1 if solid.tets.shape[1] == 4 else 2
    count, n = tets.shape
    x = solid.nodes[tets]
    points, weights = find_rule()
    value, inner = calc_shape(points, order)
    c = np.broadcast_to(c, (count, 6, 6))
    density = np.broadcast_to(density, count)
    stiffness = np.zeros((count, 3 * n, 3 * n))
    scalar = np.zeros((count, n, n))
    for q, weight in enumerate(weights):
        step = inner[q][:, 1:] - inner[q][:, :1]  # (n, 3): by L1..L3, L0 being the rest
        jacobian = np.einsum("enr,nl->elr", x, step)
        volume = weight * np.linalg.det(jacobian) / 6
        g = np.einsum("erl,nl->enr", np.linalg.inv(jacobian), step)
        b = np.zeros((count, 6, n, 3))
        b[:, 0, :, 0], b[:, 1, :, 1], b[:, 2, :, 2] = g[..., 0], g[..., 1], g[..., 2]
        b[:, 3, :, 1], b[:, 3, :, 2] = g[..., 2], g[..., 1]
        b[:, 4, :, 0], b[:, 4, :, 2] = g[..., 2], g[..., 0]
        b[:, 5, :, 0], b[:, 5, :, 1] = g[..., 1], g[..., 0]
        b = b.reshape(count, 6, 3 * n)
        stiffness += volume[:, None, None] * (b.transpose(0, 2, 1) @ (c @ b))
        scalar += volume[:, None, None] * np.outer(value[q], value[q])
    if lumped:
        diagonal = np.einsum("eii->ei", scalar)
        whole = scalar.sum(axis=(1, 2))
        scalar = np.eye(n) * (diagonal * (whole / diagonal.sum(1))[:, None])[:, None]
    mass = density[:, None, None] * np.einsum("eij,kl->eikjl", scalar, np.eye(3)).reshape(count, 3 * n, 3 * n)
    rows = (3 * tets[:, :, None] + np.arange(3)).reshape(count, 3 * n)
    i, j = np.repeat(rows, 3 * n, axis=1).ravel(), np.tile(rows, (1, 3 * n)).ravel()
    size = 3 * len(solid.nodes)
    return tuple(scipy.sparse.csc_matrix((m.ravel(), (i, j)), (size, size)) for m in (stiffness, mass))


def find_frequencies(stiffness, mass, count, high_hz, held=()):
    """The `count` lowest frequencies [Hz] at all, the zeros among them, near the band that ends at high_hz."""
    keep = (
        np.setdiff1d(np.arange(stiffness.shape[0]), (3 * np.asarray(held, int)[:, None] + np.arange(3)).ravel())
        if len(held)
        else slice(None)
    )
    k, m = stiffness[keep][:, keep], mass[keep][:, keep]
    if k.shape[0] <= 600:
        values = scipy.linalg.eigh(k.toarray(), m.toarray(), eigvals_only=True, driver="gvd")[:count]
    else:
        shift = -1e-3 * (2 * np.pi * high_hz) ** 2
        values = np.sort(scipy.sparse.linalg.eigsh(k, count, m, sigma=shift, which="LM", return_eigenvectors=False, tol=1e-13))
    return np.sqrt(np.maximum(values, 0)) / (2 * np.pi)


class Strain:
    """What `assemble` calls K, never assembled: forces (3 N, m) of displacements (3 N, m), in long double and of differences within each
    element, so that nearly rigid motions of stiff elements cost no digits."""

    def __init__(self, solid, c):
        self.tets = solid.tets
        x = solid.corners().astype(np.longdouble)
        a, b, d = (x[:, i] - x[:, 0] for i in (1, 2, 3))
        normals = np.stack([np.cross(b, d), np.cross(d, a), np.cross(a, b)], 1)
        six_volumes = (a * normals[:, 0]).sum(1)
        slope = normals / six_volumes[:, None, None]  # (e, 3, 3): rows are the gradients of L1..L3
        self.gradient = np.concatenate([-slope.sum(1, keepdims=True), slope], 1)
        points, weights = find_rule()
        self.inner = calc_shape(points, 1 if self.tets.shape[1] == 4 else 2)[1]
        self.weights = weights.astype(np.longdouble)[:, None] * (six_volumes / 6)
        self.c = np.broadcast_to(c, (len(self.tets), 6, 6)).astype(np.longdouble)

    def multiply(self, u):
        nodal = u.reshape(-1, 3, u.shape[1])
        moved = nodal[self.tets] - nodal[self.tets[:, :1]]  # (e, n, 3, m)
        force = np.zeros_like(moved)
        for inner, weight in zip(self.inner, self.weights):
            g = np.einsum("nl,elr->enr", inner, self.gradient)
            h = np.einsum("enr,endm->edrm", g, moved)
            strain = np.stack(
                [h[:, 0, 0], h[:, 1, 1], h[:, 2, 2], h[:, 1, 2] + h[:, 2, 1], h[:, 0, 2] + h[:, 2, 0], h[:, 0, 1] + h[:, 1, 0]], 1
            )
            stress = np.einsum("eij,ejm->eim", self.c, strain) * weight[:, None, None]
            tensor = stress[:, [[0, 5, 4], [5, 1, 3], [4, 3, 2]]]
            force += np.einsum("enr,edrm->endm", g, tensor)
        out = np.zeros_like(nodal)
        np.add.at(out, self.tets, force)
        return out.reshape(u.shape)


def refine_frequencies(solid, c, density, lumped, count, band_hz):
    """The frequencies [Hz] within the band, of the `count` lowest at all, without the rounding of K and of its factors: inverse iteration
    on each mode, written as a correction whose residual is of `Strain`, until its Rayleigh quotient stands still."""
    k, m = assemble(solid, c, density, lumped)
    exact, m_long = Strain(solid, c), m.tocoo()

    def multiply_mass(x):
        out = np.zeros_like(x)
        np.add.at(out, m_long.row, m_long.data.astype(np.longdouble)[:, None] * x[m_long.col])
        return out

    low, high = ((2 * np.pi * f) ** 2 for f in band_hz)
    values, modes = scipy.sparse.linalg.eigsh(k, count, m, sigma=-1e-3 * high, which="LM", tol=1e-13)
    assert values.max() > high, "the band holds more modes than were asked for"
    x = modes[:, (values >= low) & (values <= high)].astype(np.longdouble)
    before = np.zeros(x.shape[1])
    for _ in range(10):
        kx, mx = exact.multiply(x), multiply_mass(x)
        quotient = (x * kx).sum(0) / (x * mx).sum(0)
        if np.abs(before / quotient - 1).max() < 1e-13:
            break
        for j, value in enumerate(quotient):
            factor = scipy.sparse.linalg.splu((k - float(value) * (1 - 1e-3) * m).tocsc())
            x[:, j] -= factor.solve((kx[:, j] - value * mx[:, j]).astype(float))
        before = quotient
    else:
        raise AssertionError("the modes of the truth do not settle")
    size = np.sqrt((x * mx).sum(0))
    assert np.abs(x.T @ mx / np.outer(size, size) - np.eye(len(size))).max() < 1e-6, "two modes of the truth have become one"
    return np.sqrt(np.sort(quotient).astype(float)) / (2 * np.pi)
