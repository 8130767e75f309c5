#!/usr/bin/python3
"""Sensors on a free bar that is struck at its end, against Timoshenko's beam: shapes by a Ritz series, pulse by quadrature, rigid body by
Newton and Euler. Nothing of it is computed by the runtime.

usage: sensors_test.py     needs the fixture free_bar.hdf
"""
import os
import sys
import unittest

import numpy

sys.path.insert(0, os.path.join(os.environ["CARILLON_SOURCE_DIR"], "tests/support"))
import fixtures  # noqa: E402

import carillon  # noqa: E402

LENGTH, WIDTH, THICKNESS = 0.4, 0.01, 0.006
YOUNG, POISSON, DENSITY = 70e9, 0.33, 2700.0
RATE = 48000
MASS = DENSITY * LENGTH * WIDTH * THICKNESS
IMPULSE, CENTRE = 0.01, 0.005  # [N s], [s]


class Beam:
    """Bending of a free Timoshenko beam: frequencies [Hz], deflection w and slope psi of mass-normalised modes, by Legendre polynomials."""

    def __init__(self, degree=26, modes=12):
        area, inertia = WIDTH * THICKNESS, WIDTH * THICKNESS**3 / 12
        shear = YOUNG / (2 * (1 + POISSON)) * area * 10 * (1 + POISSON) / (12 + 11 * POISSON)  # Cowper 1966
        points, weights = numpy.polynomial.legendre.leggauss(2 * degree)
        self.degree = degree
        values, slopes = self.evaluate(points * LENGTH / 2)
        weights = weights * LENGTH / 2
        zero = numpy.zeros_like(values)
        bend = numpy.hstack([zero, slopes])
        angle = numpy.hstack([slopes, -values])
        moved, turned = numpy.hstack([values, zero]), numpy.hstack([zero, values])
        stiffness = YOUNG * inertia * bend.T @ (weights[:, None] * bend) + shear * angle.T @ (weights[:, None] * angle)
        mass = DENSITY * area * moved.T @ (weights[:, None] * moved) + DENSITY * inertia * turned.T @ (weights[:, None] * turned)
        factor = numpy.linalg.cholesky(mass)
        inverse = numpy.linalg.inv(factor)
        eigenvalues, vectors = numpy.linalg.eigh(inverse @ stiffness @ inverse.T)
        self.vectors = (inverse.T @ vectors)[:, 2 : 2 + modes]
        self.frequency_hz = numpy.sqrt(eigenvalues[2 : 2 + modes]) / (2 * numpy.pi)

    def evaluate(self, x):
        """Polynomials and their derivatives at x [m] from the middle: two arrays (points, degree + 1)."""
        legendre = numpy.polynomial.legendre
        unit = 2 * numpy.atleast_1d(x) / LENGTH
        slopes = numpy.stack([legendre.legval(unit, legendre.legder(row)) for row in numpy.eye(self.degree + 1)], 1)
        return legendre.legvander(unit, self.degree), slopes * 2 / LENGTH

    def deflect(self, x):
        return (self.evaluate(x)[0] @ self.vectors[: self.degree + 1])[0]

    def curve(self, x):
        """d psi / dx."""
        return (self.evaluate(x)[1] @ self.vectors[self.degree + 1 :])[0]


def pulse(duration_s, steps=20000):
    """Times from the centre [s] and force [1/s] of the pulse sin^1.5, of unit area."""
    x = (numpy.arange(steps) + 0.5) / steps
    force = numpy.sin(numpy.pi * x) ** 1.5
    return (x - 0.5) * duration_s, force / (force.mean() * duration_s)


def weigh(duration_s, omega):
    """Share of the impulse that a mode feels: the Fourier transform of the pulse."""
    time_s, force = pulse(duration_s)
    return numpy.array([(force * numpy.cos(w * time_s)).mean() * duration_s for w in numpy.atleast_1d(omega)])


class SensorsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.bank = carillon.Bank(fixtures.get("free_bar.hdf"))
        cls.beam = Beam()
        # The bending modes across the thickness: those with the largest deflection of the end along z.
        cls.struck_m = numpy.array([-LENGTH / 2 + 1e-4, 0.0, THICKNESS / 2])
        triangle, barycentric, cls.struck_m, _ = cls.bank.nearest(cls.struck_m)
        corners = cls.bank.triangles[triangle]
        along = numpy.abs(numpy.einsum("c,cmk->mk", barycentric, cls.bank.shapes()[corners])[:, 2]) * numpy.sqrt(MASS)
        cls.bending = numpy.flatnonzero(along > 1.0)[:7]

    def read(self, quantity, duration_s, seconds=0.3, direction=(0, 0, 1), rate_hz=None, **place):
        synth = carillon.Synthesiser(rate_hz=RATE)
        body = synth.add_body(self.bank, effects=["modal", "hertz_pulse"])
        sensor = synth.add_sensor(body, direction, quantity=quantity, rate_hz=rate_hz, **place)
        synth.strike(body, [0, 0, IMPULSE], point_m=self.struck_m, duration_s=duration_s, time_s=CENTRE)
        synth.process(int(seconds * RATE))
        self.assertEqual(synth.sensor_begin_s(sensor), 0.0)
        self.assertEqual(synth.sensor_lost(sensor), 0)
        return synth.read_sensor(sensor)

    def fit(self, samples, first_s, with_mean=False):
        """Amplitudes (modes, 2) of cos and sin from the pulse's centre on, and the mean."""
        frames = numpy.arange(int(first_s * RATE), len(samples))
        age_s = frames / RATE - CENTRE
        omega = 2 * numpy.pi * self.bank.frequency_hz
        decay = self.bank.decay_per_s
        omega_d = numpy.sqrt(omega**2 - decay**2)
        columns = []
        for d, w in zip(decay, omega_d):
            columns += [numpy.exp(-d * age_s) * numpy.cos(w * age_s), numpy.exp(-d * age_s) * numpy.sin(w * age_s)]
        columns.append(numpy.ones_like(age_s))
        found = numpy.linalg.lstsq(numpy.stack(columns, 1), samples[frames], rcond=None)[0]
        return found[:-1].reshape(-1, 2), found[-1]

    def test_a_point_far_from_the_body_is_refused(self):
        with self.assertRaisesRegex(ValueError, r"point_m is 4\..* m away from the body"):
            self.read("velocity", 1e-3, point_m=[0.0, 0.0, 5.0])

    def test_frequencies_are_those_of_the_beam(self):
        off = self.bank.frequency_hz[self.bending] / self.beam.frequency_hz[: len(self.bending)] - 1
        self.assertLess(numpy.abs(off).max(), 0.01)

    def test_residues_to_the_fifth_bending_mode(self):
        place = numpy.array([LENGTH / 4, 0.0, THICKNESS / 2])
        x = self.bank.nearest(place)[2][0]
        duration_s = 2e-4
        v = self.read("velocity", duration_s, point_m=place)
        amplitudes, mean = self.fit(v, CENTRE + duration_s)
        omega = 2 * numpy.pi * self.bank.frequency_hz[self.bending]
        read = amplitudes[self.bending, 0] / (IMPULSE * weigh(duration_s, omega))
        known = (self.beam.deflect(self.struck_m[0]) * self.beam.deflect(x))[: len(read)]
        self.assertLess(numpy.abs(read[:5] / known[:5] - 1).max(), 0.01, (read, known))
        # Newton and Euler: the mean after the blow is that of a rigid body.
        inertia = MASS * (LENGTH**2 + THICKNESS**2) / 12
        rigid = IMPULSE * (1 / MASS + self.struck_m[0] * x / inertia)
        self.assertLess(abs(mean / rigid - 1), 1e-6)

    def test_acceleration_through_the_blow(self):
        place = numpy.array([LENGTH / 4, 0.0, THICKNESS / 2])
        x = self.bank.nearest(place)[2][0]
        duration_s = 2e-3
        read = self.read("acceleration", duration_s, seconds=0.05, point_m=place)
        steps = 40  # per sample
        h = 1 / RATE / steps
        t = numpy.arange(len(read) * steps) * h
        u = (t - CENTRE) / duration_s + 0.5
        force = numpy.where((u > 0) & (u < 1), numpy.sin(numpy.pi * numpy.clip(u, 0, 1)) ** 1.5, 0.0)
        force *= IMPULSE / (force.sum() * h)
        inertia = MASS * (LENGTH**2 + THICKNESS**2) / 12
        known = force * (1 / MASS + self.struck_m[0] * x / inertia)
        for n, mode in enumerate(self.bending):
            residue = self.beam.deflect(self.struck_m[0])[n] * self.beam.deflect(x)[n]
            w, d = 2 * numpy.pi * self.bank.frequency_hz[mode], self.bank.decay_per_s[mode]
            wd = numpy.sqrt(w * w - d * d)
            answer = numpy.exp(-d * t) * numpy.sin(wd * t) / wd
            q = numpy.fft.irfft(numpy.fft.rfft(answer, 2 * len(t)) * numpy.fft.rfft(force, 2 * len(t)))[: len(t)] * h
            v = numpy.gradient(q, h)
            known += residue * (force - w * w * q - 2 * d * v)
        known = known[::steps][: len(read)]
        off = numpy.sqrt(numpy.mean((read - known) ** 2) / numpy.mean(known**2))
        self.assertLess(off, 0.015)

    def test_strain_is_the_curvature(self):
        faces = self.bank.vertices_m[self.bank.triangles]
        top = numpy.flatnonzero(numpy.all(numpy.abs(faces[:, :, 2] - THICKNESS / 2) < 1e-6, axis=1))
        centres = faces.mean(axis=1)
        duration_s, worst = 2e-4, 0.0
        omega = 2 * numpy.pi * self.bank.frequency_hz[self.bending]
        for aim in numpy.linspace(-0.15, 0.15, 11):
            triangle = int(top[numpy.argmin(numpy.hypot(centres[top, 0] - aim, centres[top, 1]))])
            strain = self.read("strain", duration_s, direction=(1, 0, 0), triangle=triangle)
            amplitudes, mean = self.fit(strain, CENTRE + duration_s)
            read = amplitudes[self.bending, 1] * omega / (IMPULSE * weigh(duration_s, omega))
            curvature = self.beam.curve(centres[triangle, 0])[: len(read)]
            known = -THICKNESS / 2 * curvature * self.beam.deflect(self.struck_m[0])[: len(read)]
            largest = numpy.max([numpy.abs(self.beam.curve(y)) for y in numpy.linspace(-0.2, 0.2, 81)], axis=0)
            scale = THICKNESS / 2 * largest * numpy.abs(self.beam.deflect(self.struck_m[0]))
            off = (read - known) / scale[: len(read)]
            worst = max(worst, numpy.abs(off[:5]).max())
            self.assertLess(abs(mean), 1e-9)
        print(f"{self.id()}: {100 * worst:.2f} %")
        self.assertLess(worst, 0.01)

    def test_a_slower_sensor_reads_the_same(self):
        place = [LENGTH / 4, 0, THICKNESS / 2]
        fast, slow = self.read("displacement", 4e-3, point_m=place), self.read("displacement", 4e-3, rate_hz=3200, point_m=place)
        self.assertLess(numpy.abs(slow - fast[:: RATE // 3200][: len(slow)]).max(), 2e-3 * numpy.ptp(fast))


if __name__ == "__main__":
    unittest.main()
