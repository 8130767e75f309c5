"""Far fields of multipoles."""
import math

import numpy

FLOOR_DB = -120.0  # minimum far level


def calc_inverse_hankels(x, order):
    """(-i)^(l + 1) / h_l(x) for l = 0 .. order: the far field of a multipole on the sphere. Stable upward recurrence of h_l
    (DLMF 10.51.1) in ratios, so that overflow becomes 0."""
    ratio = 1 / x - 1j  # h_1 / h_0
    inverse = [x * numpy.exp(-1j * x)]  # h_0 = -i e^(ix) / x
    for l in range(1, order + 1):
        inverse.append(-1j * inverse[-1] / ratio)
        ratio = (2 * l + 1) / x - 1 / ratio
    return numpy.array(inverse)


def calc_far_pattern(coefficient, order, waves, polar, azimuth):
    """sum of a_lm (-i)^(l + 1) / h_l(kR) Y_lm over l <= order, |m| <= l: the far pressure times k r e^(-ikr) (runtime/bank/multipoles.hpp),
    in the directions polar x azimuth. coefficient: a_lm at l^2 + l + m. waves: kR > 0. Y_lm: real, orthonormal, cos m phi for m >= 0,
    sin |m| phi for m < 0 (docs/equations.md E10), by the recurrence of the normalised associated Legendre functions."""
    inverse = calc_inverse_hankels(waves, order)
    x, sine = numpy.cos(polar), numpy.sin(polar)
    rings, around = [], []  # the pattern is the sum over m of one times the other
    diagonal = numpy.full(len(polar), math.sqrt(0.25 / math.pi))  # P_mm, the sine included
    for m in range(order + 1):
        before, here, factor = numpy.zeros_like(x), diagonal, 0.0
        cosines, sines = numpy.zeros(len(polar), dtype=complex), numpy.zeros(len(polar), dtype=complex)
        for l in range(m, order + 1):
            middle = l * l + l
            cosines += coefficient[middle + m] * inverse[l] * here
            sines += coefficient[middle - m] * inverse[l] * here
            following = math.sqrt((4 * (l + 1) ** 2 - 1) / ((l + 1) ** 2 - m * m))
            before, here, factor = here, following * (x * here - factor * before), 1 / following
        norm = math.sqrt(2) if m else 1.0
        rings += [norm * cosines, norm * sines]
        around += [numpy.cos(m * azimuth), numpy.sin(m * azimuth)]
        diagonal = diagonal * sine * math.sqrt((2 * m + 3) / (2 * m + 2))
    rings, around = numpy.array(rings).T, numpy.array(around)
    return rings.real @ around + 1j * (rings.imag @ around)


def calc_levels(pattern):
    """Levels in dB relative to the largest, at least FLOOR_DB; None for a silent pattern."""
    size = numpy.abs(pattern)
    if not size.max() > 0:
        return None
    return 20 * numpy.log10(numpy.maximum(size / size.max(), 10 ** (FLOOR_DB / 20)))


def make_equal_areas(order):
    """Polar angles and azimuths of directions of equal solid angle, for means of a pattern of this order. None is in a null of symmetric
    bodies, where levels are unbounded and one direction would dominate. The spread of a dipole is exact to 0.1 dB."""
    rings = max(720, 8 * order)
    return numpy.arccos(1 - (2 * numpy.arange(rings) + 1) / rings), math.pi * (numpy.arange(2 * rings) + 0.382) / rings
