#!/usr/bin/python3
"""Writes data/spheres.csv: the far field of a sphere whose surface moves radially as U P_l(cos theta), from scipy's Bessel functions.

far_factor = |p| r / (rho0 c0 U a |P_l(cos theta)|) = 1 / (ka |h_l'(ka)|), h_l = j_l - i y_l.   usage: make_spheres.py > data/spheres.csv
"""
from scipy.special import spherical_jn, spherical_yn

print("l,ka,far_factor")
for l in range(5):
    for ka in (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20):
        slope = spherical_jn(l, ka, derivative=True) - 1j * spherical_yn(l, ka, derivative=True)
        print(f"{l},{ka:g},{1 / (ka * abs(slope)):.12g}")
