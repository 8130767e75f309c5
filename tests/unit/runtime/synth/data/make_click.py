#!/usr/bin/python3
"""Writes click.csv: the far pressure of a rigid sphere that a force of sin(pi t / tau)^1.5 of unit impulse accelerates, straight ahead.

In frequency, p r = i rho0 c0 U e^(-i k r) / (k h_1'(ka)) with U = F / (i omega m) and scipy's spherical Bessel functions (h_1 = j_1 - i
y_1); then back to time by an inverse FFT of a finely sampled force. t_s counts from the first moment that the sphere's surface nearest to
the listener can be
heard, (r - a) / c0 after the force begins.   usage: make_click.py > click.csv
"""
import numpy as np
from scipy.special import spherical_jn, spherical_yn

RHO, C = 1.21, 343.0
print("radius_m,mass_kg,duration_s,t_s,pressure_pa_m")
for radius, mass, tau in ((0.0124, 0.02, 60e-6), (0.002, 1e-4, 30e-6), (0.3, 10.0, 300e-6)):
    step, count = 2.5e-6 / 256, 1 << 21
    t = (np.arange(count) + 0.5) * step
    force = np.where(t < tau, np.sin(np.pi * np.minimum(t / tau, 1.0)) ** 1.5, 0.0)
    force /= force.sum() * step
    omega = 2 * np.pi * np.fft.rfftfreq(count, step)[1:]
    spectrum = np.fft.rfft(force)[1:] * step * np.exp(-1j * omega * step / 2)  # midpoints: half a step late
    k = omega / C
    slope = spherical_jn(1, k * radius, derivative=True) - 1j * spherical_yn(1, k * radius, derivative=True)
    answer = 1j * RHO * C * spectrum / (1j * omega * mass) * np.exp(-1j * k * radius) / (k * slope)
    pressure = np.fft.irfft(np.concatenate([[0], answer]), count) / step
    for i in range(0, 200):
        print(f"{radius:g},{mass:g},{tau:g},{i * 2.5e-6:.7g},{pressure[i * 256]:.10g}")
