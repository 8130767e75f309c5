#!/usr/bin/python3
"""Frequencies of free elastic bodies of revolution, meshless: Fourier series around, Rayleigh-Ritz across.

usage: revolution_ritz.py MODES DENSITY E NU R1 Z1 R2 Z2 R3 Z3 R4 Z4 [--degrees N M]
       revolution_ritz.py MODES DENSITY E NU --torus R RADIUS [--degrees N M]

The cross-section is the quadrilateral of four corners (r, z), anticlockwise, the second in degree M from the first side 1-2 (degree N) to
the side 3-4; or a disc around (R, 0). Prints `hertz,relative change when two degrees are taken away,waves around`, all modes from the
lowest elastic one on, those that come in pairs twice.

Method: u_r and u_z go as cos n phi, u_phi as sin n phi; in the cross-section all three are sums of products of Legendre polynomials in the
  coordinates of the square that is mapped to it (of monomials in the disc), integrated by Gauss's rule.
Source: Gladwell and Vijay 1975, J. Sound Vib. 42, 387 (Fourier-Ritz); Leissa 2005, J. Sound Vib. 283, 725 (three-dimensional Ritz of shells
  of revolution).
"""
import sys

import numpy
import scipy.linalg
from numpy.polynomial import legendre


def make_quadrilateral(corners, degrees):
    """Values and derivatives by r and z of the functions at points, (functions, points), the points' r, and weights."""
    n, m = degrees
    x, wx = legendre.leggauss(n + 4)
    y, wy = legendre.leggauss(m + 4)
    x, y = (g.reshape(-1) for g in numpy.meshgrid(x, y, indexing="ij"))
    weights = numpy.outer(wx, wy).reshape(-1)
    shape = numpy.array([(1 - x) * (1 - y), (1 + x) * (1 - y), (1 + x) * (1 + y), (1 - x) * (1 + y)]) / 4
    by_x = numpy.array([-(1 - y), 1 - y, 1 + y, -(1 + y)]) / 4
    by_y = numpy.array([-(1 - x), -(1 + x), 1 + x, 1 - x]) / 4
    r, z = corners.T @ shape
    (r_x, z_x), (r_y, z_y) = corners.T @ by_x, corners.T @ by_y
    jacobian = r_x * z_y - r_y * z_x

    def evaluate(degree, at):
        functions = numpy.diag(numpy.sqrt(numpy.arange(degree) + 0.5))
        return (
            numpy.array([legendre.legval(at, row) for row in functions]),
            numpy.array([legendre.legval(at, legendre.legder(row)) for row in functions]),
        )

    (p, p_x), (q, q_y) = evaluate(n, x), evaluate(m, y)
    product = lambda a, b: (a[:, None] * b[None]).reshape(n * m, -1)
    value, d_x, d_y = product(p, q), product(p_x, q), product(p, q_y)
    return value, (d_x * z_y - d_y * z_x) / jacobian, (d_y * r_x - d_x * r_y) / jacobian, r, weights * jacobian


def make_disc(far, radius, degrees):
    degree = degrees[0]
    s, ws = legendre.leggauss(degree + 6)
    s, ws = (s + 1) / 2, ws / 2
    count = 2 * degree + 12
    angle = 2 * numpy.pi * numpy.arange(count) / count
    s, angle = (g.reshape(-1) for g in numpy.meshgrid(s, angle, indexing="ij"))
    weights = numpy.repeat(ws, count) * s * radius**2 * 2 * numpy.pi / count
    x, y = s * numpy.cos(angle), s * numpy.sin(angle)
    values, by_x, by_y = [], [], []
    for a in range(degree):
        for b in range(degree - a):
            f, g = legendre.Legendre.basis(a), legendre.Legendre.basis(b)
            values.append(f(x) * g(y))
            by_x.append(f.deriv()(x) * g(y) / radius)
            by_y.append(f(x) * g.deriv()(y) / radius)
    return numpy.array(values), numpy.array(by_x), numpy.array(by_y), far + radius * x, weights


def solve_waves(n, section, density, e, nu, count):
    """Eigenvalues of the modes with n waves around, equal for the rotated functions (sin for cos)."""
    value, by_r, by_z, r, weights = section
    lame, shear = e * nu / (1 + nu) / (1 - 2 * nu), e / 2 / (1 + nu)
    f = len(value)
    zero = numpy.zeros_like(value)
    over_r = value / r
    strains = [  # columns (u_r, u_phi, u_z): rr, phi phi, zz, phi z, r z, r phi
        (by_r, zero, zero),
        (over_r, n * over_r, zero),
        (zero, zero, by_z),
        (zero, by_z, -n * over_r),
        (by_z, zero, by_r),
        (-n * over_r, by_r - over_r, zero),
    ]
    strains = [numpy.vstack(parts) for parts in strains]
    weights = weights * r
    trace = strains[0] + strains[1] + strains[2]
    stiffness = lame * (trace * weights) @ trace.T
    for k, b in enumerate(strains):
        stiffness += (2 * shear if k < 3 else shear) * (b * weights) @ b.T
    mass = numpy.kron(numpy.eye(3), density * (value * weights) @ value.T)
    parts = [numpy.arange(3 * f)]
    if n == 0:  # torsion decouples
        parts = [numpy.r_[0:f, 2 * f : 3 * f], numpy.arange(f, 2 * f)]
    found = []
    for part in parts:
        k, m = stiffness[numpy.ix_(part, part)], mass[numpy.ix_(part, part)]
        found += list(scipy.linalg.eigh(k, m, eigvals_only=True, subset_by_index=[0, min(count, len(part)) - 1]))
    return numpy.sort(found)


def solve(make, degrees, modes, material):
    section = make(degrees)
    found = []
    for n in range(60):
        values = solve_waves(n, section, *material, modes // 2 + 8)
        largest = values[-1]
        values = values[values > 1e-9 * largest] if n > 1 else values[2:] if n == 0 else values[2:]
        found += [(v, n) for v in values for _ in range(1 if n == 0 else 2)]
        found.sort()
        # Beyond some n the lowest mode rises with n.
        if n > 3 and len(found) >= modes and values[0] > found[modes - 1][0]:
            break
    return [(numpy.sqrt(v) / 2 / numpy.pi, n) for v, n in found[:modes]]


def main(arguments):
    degrees = (18, 8)
    if "--degrees" in arguments:
        at = arguments.index("--degrees")
        degrees = tuple(int(a) for a in arguments[at + 1 : at + 3])
        del arguments[at : at + 3]
    is_torus = "--torus" in arguments
    numbers = [float(a) for a in arguments if a != "--torus"]
    if len(numbers) != (6 if is_torus else 12):
        sys.exit(__doc__)
    modes, material = int(numbers[0]), numbers[1:4]
    if is_torus:
        make = lambda d: make_disc(numbers[4], numbers[5], d)
    else:
        corners = numpy.array(numbers[4:]).reshape(4, 2)
        make = lambda d: make_quadrilateral(corners, d)
    fine = solve(make, degrees, modes, material)
    coarse = solve(make, tuple(max(d - 2, 2) for d in degrees), modes, material)
    for (f, n), (c, _) in zip(fine, coarse):
        print(f"{f:.9g},{max(c / f - 1, 1e-9):.2g},{n}")


if __name__ == "__main__":
    main(sys.argv[1:])
