#!/usr/bin/python3
"""Frequencies of the undercut vibraphone bar without any finite-element mesh: the rows "vibraphone" of jobs/study/known.csv.

usage: ritz_bar.py [ALONG ACROSS THROUGH]      degrees of the polynomials, default 48 15 5; compared with 44 13 4

Method: Rayleigh-Ritz with products of Legendre polynomials (Demarest 1971; Visscher et al. 1991) in coordinates that map the bar to a cube:
x = L/2 u, y = b/2 v, z = h0/2 - h(x) (1 - w)/2 with u, v, w in [-1, 1]. Integrals by Gauss-Legendre quadrature. The bar is its own mirror
image in x and in y, so that four problems are solved, one for each parity. Prints f_hz and the relative difference to the coarser basis.
"""
import sys

import numpy
import scipy.linalg
from numpy.polynomial import legendre

LENGTH, WIDTH, H0, DEPTH, REACH = 0.36, 0.05, 0.0131825, 0.0082301, 0.0875879  # m; thickness h(x) = H0 - DEPTH exp(-(x / REACH)^4)
YOUNG, POISSON, DENSITY = 70e9, 0.33, 2700.0


def tabulate(degree, points):
    """Values and derivatives of the normalised Legendre polynomials, (degree + 1, points) each."""
    scale = numpy.sqrt(numpy.arange(degree + 1) + 0.5)[:, None]
    unit = numpy.eye(degree + 1)
    values = numpy.array([legendre.legval(points, row) for row in unit]) * scale
    slopes = numpy.array([legendre.legval(points, legendre.legder(row)) for row in unit]) * scale
    return values, slopes


def calc_matrices(along, across, through, parity_x, parity_y):
    """K and M of one symmetry class. parity: 0 when the transverse displacement is even in that coordinate."""
    points = (
        numpy.polynomial.legendre.leggauss(2 * along + 24),
        numpy.polynomial.legendre.leggauss(across + 2),
        numpy.polynomial.legendre.leggauss(through + 2),
    )
    (u, wu), (v, wv), (w, ww) = points
    x = LENGTH / 2 * u
    bump = DEPTH * numpy.exp(-((x / REACH) ** 4))
    h, dh = H0 - bump, 4 * x**3 / REACH**4 * bump
    # d/dx at fixed z is 2/L d/du + (1 - w) h'/h d/dw.
    tables = [tabulate(degree, p[0]) for degree, p in zip((along, across, through), points)]
    blocks = []  # of each displacement component: the exponents it may have
    for component in range(3):
        odd_x = parity_x ^ (component == 0)
        odd_y = parity_y ^ (component == 1)
        blocks.append([(i, j, k) for i in range(odd_x, along + 1, 2) for j in range(odd_y, across + 1, 2) for k in range(through + 1)])

    # Integrals over u carry h and its slope; those over v and w are small constant matrices.
    def across_matrices(table, weights):
        values, slopes = table
        return {(a, b): (p * weights) @ q.T for a, p in (("v", values), ("d", slopes)) for b, q in (("v", values), ("d", slopes))}

    yv = across_matrices(tables[1], wv)
    values, slopes = tables[2]
    ramp = (1 - w) * slopes  # (1 - w) d/dw: what dw/dx multiplies
    parts = {"v": values, "d": slopes, "r": ramp}
    zv = {(a, b): (p * ww) @ q.T for a, p in parts.items() for b, q in parts.items()}
    pu, du = tables[0]
    jac = LENGTH / 2 * WIDTH / 2 * h / 2

    def along_matrix(a, b, weight):
        return (({"v": pu, "d": du}[a]) * (wu * jac * weight)) @ ({"v": pu, "d": du}[b]).T

    # Every derivative of a basis function is a sum of separable terms: (weight over u, kind in u, kind in v, kind in w).
    one = numpy.ones_like(u)
    gradient = {
        0: [(2 / LENGTH * one, "d", "v", "v"), (dh / h, "v", "v", "r")],
        1: [(2 / WIDTH * one, "v", "d", "v")],
        2: [(2 / h, "v", "v", "d")],
    }

    def integrate(terms_a, rows, terms_b, columns):
        total = numpy.zeros((len(rows), len(columns)))
        ri, rj, rk = (numpy.array(c) for c in zip(*rows))
        ci, cj, ck = (numpy.array(c) for c in zip(*columns))
        for wa, ua, va, za in terms_a:
            for wb, ub, vb, zb in terms_b:
                total += (
                    along_matrix(ua, ub, wa * wb)[numpy.ix_(ri, ci)] * yv[(va, vb)][numpy.ix_(rj, cj)] * zv[(za, zb)][numpy.ix_(rk, ck)]
                )
        return total

    mu, lam = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
    plain = [(one, "v", "v", "v")]
    rows = []
    masses = []
    for a in range(3):
        row = []
        for b in range(3):
            block = lam * integrate(gradient[a], blocks[a], gradient[b], blocks[b]) + mu * integrate(
                gradient[b], blocks[a], gradient[a], blocks[b]
            )
            if a == b:
                block = block + mu * sum(integrate(gradient[c], blocks[a], gradient[c], blocks[b]) for c in range(3))
            row.append(block)
        rows.append(row)
        masses.append(DENSITY * integrate(plain, blocks[a], plain, blocks[a]))
    return numpy.block(rows), scipy.linalg.block_diag(*masses)


def solve(along, across, through, parity_x, parity_y, count):
    stiffness, mass = calc_matrices(along, across, through, parity_x, parity_y)
    values = scipy.linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, count + 3))
    hz = numpy.sqrt(numpy.maximum(values, 0)) / 2 / numpy.pi
    return hz[hz > 1.0][:count]


def main():
    degrees = [int(word) for word in sys.argv[1:]] or [48, 15, 5]
    found = []
    for parity_x in (0, 1):
        for parity_y in (0, 1):
            fine, coarse = (
                solve(*(d - less for d, less in zip(degrees, lesser)), parity_x, parity_y, 8) for lesser in ((0, 0, 0), (4, 2, 1))
            )
            found += [
                (f, abs(c / f - 1), f"{'odd' if parity_x else 'even'} along, {'odd' if parity_y else 'even'} across")
                for f, c in zip(fine, coarse)
            ]
    for f, difference, parity in sorted(found):
        print(f"{f:.9g},{difference:.1e},{parity}")


if __name__ == "__main__":
    main()
