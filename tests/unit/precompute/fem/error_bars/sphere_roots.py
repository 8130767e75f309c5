#!/usr/bin/python3
"""Frequencies of free hollow spheres: roots of the exact frequency equations.

usage: sphere_roots.py INNER OUTER MODES DENSITY E NU

Prints `hertz,1e-8 n kind` for every mode from the lowest elastic one on, each as often as it occurs; n: degree, kind: S spheroidal, T
torsional.

Source: Lamb 1882, Proc. London Math. Soc. 13, 189; Eringen and Suhubi 1975, Elastodynamics vol. 2, section 8.14: no traction at both radii,
  displacements from spherical Bessel functions of both kinds.
"""
import sys

import numpy
import scipy.optimize
from scipy.special import spherical_jn, spherical_yn


def make_equation(n, kind, inner, outer, nu):
    """The determinant at k = omega outer / c_T, its columns scaled to one."""
    slow = numpy.sqrt((1 - 2 * nu) / (2 - 2 * nu))

    def determinant(k):
        rows = []
        for radius in (1.0, inner / outer):
            x = k * radius
            h = slow * x
            if kind == "T":
                rows.append([(n - 1) * z(n, x) - x * z(n + 1, x) for z in (spherical_jn, spherical_yn)])
                continue
            t11 = [(n * n - n - x * x / 2) * z(n, h) + 2 * h * z(n + 1, h) for z in (spherical_jn, spherical_yn)]
            t13 = [n * (n + 1) * ((n - 1) * z(n, x) - x * z(n + 1, x)) for z in (spherical_jn, spherical_yn)]
            t41 = [(n - 1) * z(n, h) - h * z(n + 1, h) for z in (spherical_jn, spherical_yn)]
            t43 = [(n * n - 1 - x * x / 2) * z(n, x) + x * z(n + 1, x) for z in (spherical_jn, spherical_yn)]
            rows.append(t11 if n == 0 else t11 + t13)
            if n > 0:
                rows.append(t41 + t43)
        matrix = numpy.array(rows)
        return numpy.linalg.det(matrix / numpy.linalg.norm(matrix, axis=0))

    return determinant


def find_modes(inner, outer, count, nu):
    top, step = 4.0, 0.01
    while True:
        modes = []
        for n in range(60):
            found = False
            for kind in "ST":
                if n == 0 and kind == "T":
                    continue
                equation = make_equation(n, kind, inner, outer, nu)
                at = numpy.arange(max(0.05, 0.1 * n - 0.2), top, step)
                values = [equation(k) for k in at]
                for i in range(len(at) - 1):
                    if values[i] * values[i + 1] < 0:
                        modes.append((scipy.optimize.brentq(equation, at[i], at[i + 1], xtol=1e-13, rtol=1e-13), n, kind))
                        found = True
            if not found and n > 3:
                break
        modes = sorted(m for m in modes for _ in range(2 * m[1] + 1))
        if len(modes) >= count:
            last = modes[count - 1]
            while count < len(modes) and modes[count] == last:
                count += 1
            return modes[:count]
        top *= 1.3


def main(arguments):
    if len(arguments) != 6:
        sys.exit(__doc__)
    inner, outer, count, density, young, nu = (float(a) for a in arguments)
    speed = numpy.sqrt(young / 2 / (1 + nu) / density)
    for k, n, kind in find_modes(inner, outer, int(count), nu):
        print(f"{k * speed / outer / 2 / numpy.pi:.9g},1e-8 {n} {kind}")


if __name__ == "__main__":
    main(sys.argv[1:])
