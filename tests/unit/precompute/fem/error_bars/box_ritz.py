#!/usr/bin/python3
"""Frequencies of elastic boxes, meshless: Rayleigh-Ritz with products of Legendre polynomials.

usage: box_ritz.py LX LY LZ MODES DENSITY E NU [--fix-x] [--degrees NX NY NZ]
       box_ritz.py LX LY LZ MODES DENSITY E1 E2 E3 G12 G23 G13 NU12 NU23 NU13 [--fix-x] [--degrees NX NY NZ]

Prints `hertz,relative change when three degrees are taken away from each direction`, all modes from the lowest elastic one on. --fix-x
fixes the face of the lowest x.

Method: displacements are sums of P_a(x) P_b(y) P_c(z), a < NX and so on; a free box allows all polynomials. Its three mirror planes split
  the problem into eight (four if a face is fixed). Zeros of Legendre polynomials cluster at the ends as 1/n^2, so a dozen of them across a
  strip resolve the edge layer of torsion.
Source: Demarest 1971, J. Acoust. Soc. Am. 49, 768; Visscher, Migliori, Bell, Reinert 1991, J. Acoust. Soc. Am. 90, 2154.
"""
import itertools
import sys

import numpy
import scipy.linalg
from numpy.polynomial import legendre

VOIGT = {(0, 0): 0, (1, 1): 1, (2, 2): 2, (1, 2): 3, (2, 1): 3, (0, 2): 4, (2, 0): 4, (0, 1): 5, (1, 0): 5}


def calc_elasticity(constants):
    """C, 6 x 6, Voigt's order xx yy zz yz xz xy."""
    if len(constants) == 2:
        e, nu = constants
        constants = [e] * 3 + [e / 2 / (1 + nu)] * 3 + [nu] * 3
    e1, e2, e3, g12, g23, g13, nu12, nu23, nu13 = constants
    compliance = numpy.diag([1 / e1, 1 / e2, 1 / e3, 1 / g23, 1 / g13, 1 / g12])
    for i, j, value in ((0, 1, -nu12 / e1), (1, 2, -nu23 / e2), (0, 2, -nu13 / e1)):
        compliance[i, j] = compliance[j, i] = value
    return numpy.linalg.inv(compliance)


def make_basis(count, length, fixed):
    """The integrals (f g), (f' g), (f' g') of the basis along one direction, and the parities of its functions."""
    points, weights = legendre.leggauss(count + 2)
    values = legendre.legvander(points, count) * numpy.sqrt(numpy.arange(count + 1) + 0.5)
    slopes = numpy.array([legendre.legval(points, legendre.legder(row)) for row in numpy.diag(numpy.sqrt(numpy.arange(count + 1) + 0.5))]).T
    if fixed:  # P_n + P_(n-1) is zero at -1
        scale = 1 / numpy.sqrt(numpy.arange(count + 1) + 0.5)
        values, slopes = ((v * scale)[:, 1:] + (v * scale)[:, :-1] for v in (values, slopes))
    else:
        values, slopes = values[:, :count], slopes[:, :count]
    slopes = slopes * 2 / length
    weights = weights[:, None] * length / 2
    return [values.T @ (weights * values), slopes.T @ (weights * values), slopes.T @ (weights * slopes)], numpy.arange(count) % 2


def solve(lengths, modes, density, elasticity, fixed, degrees):
    bases = [make_basis(degrees[k], lengths[k], fixed and k == 0) for k in range(3)]
    found = []
    for parity in itertools.product((0,) if fixed else (0, 1), (0, 1), (0, 1)):
        # functions of component k along direction d
        chosen = [
            [
                numpy.arange(degrees[d]) if fixed and d == 0 else numpy.flatnonzero(bases[d][1] == (parity[d] + (d == k)) % 2)
                for d in range(3)
            ]
            for k in range(3)
        ]
        stiffness, mass = [], []
        for k in range(3):
            stiffness.append([])
            mass.append([])
            for l in range(3):

                def integrate(p, q):
                    """of d/dp (function of k) times d/dq (function of l)"""
                    product = numpy.ones((1, 1))
                    for d in range(3):
                        ff, fg, gg = bases[d][0]
                        matrix = gg if p == d == q else fg if p == d else fg.T if q == d else ff
                        product = numpy.kron(product, matrix[numpy.ix_(chosen[k][d], chosen[l][d])])
                    return product

                stiffness[k].append(
                    sum(
                        elasticity[VOIGT[k, p], VOIGT[l, q]] * integrate(p, q)
                        for p in range(3)
                        for q in range(3)
                        if elasticity[VOIGT[k, p], VOIGT[l, q]] != 0
                    )
                )
                mass[k].append(density * integrate(-1, -1) if k == l else numpy.zeros_like(stiffness[k][l]))
        k_all, m_all = numpy.block(stiffness), numpy.block(mass)
        values = scipy.linalg.eigh(k_all, m_all, eigvals_only=True, subset_by_index=[0, min(modes + 5, len(k_all) - 1)])
        found += list(values)
    found = numpy.sort(found)[0 if fixed else 6 :][:modes]
    return numpy.sqrt(found) / 2 / numpy.pi


def main(arguments):
    degrees = None
    if "--degrees" in arguments:
        at = arguments.index("--degrees")
        degrees = [int(a) for a in arguments[at + 1 : at + 4]]
        del arguments[at : at + 4]
    fixed = "--fix-x" in arguments
    numbers = [float(a) for a in arguments if a != "--fix-x"]
    if len(numbers) not in (7, 14):
        sys.exit(__doc__)
    lengths, modes, density, elasticity = numbers[:3], int(numbers[3]), numbers[4], calc_elasticity(numbers[5:])
    degrees = degrees or [26, 22, 8]
    fine = solve(lengths, modes, density, elasticity, fixed, degrees)
    coarse = solve(lengths, modes, density, elasticity, fixed, [d - 3 for d in degrees])
    for f, c in zip(fine, coarse):
        print(f"{f:.9g},{max(c / f - 1, 1e-9):.2g}")


if __name__ == "__main__":
    main(sys.argv[1:])
