#!/usr/bin/python3
"""Solves cylinder, disc, ring and cone as bodies of a job, and compares frequencies, volume and inertia with known values.

Truth: a free solid cylinder of L = 2 R with nu = 0.3 (Fourier-Ritz, nine digits, omega R / c_T); a free thin disc (Kirchhoff's plate, nu =
0.3: roots of the frequency equation of the free edge, Leissa, NASA SP-160, 1969, chapter 2); a thin ring of round wire, in its plane (Hoppe
1871) and out of it (Michell 1889), in Love's Treatise, sections 293 and 294; a slender cone clamped at its base (Kirchhoff 1879: 8.7192 of
c r / 2 L^2) and a free one along its axis (tan kL = kL). Thin-body theories neglect shear and rotary inertia, a relative error of
about (h / R)^2, which sets the tolerances.

usage: round_shapes.py BIN_DIR
"""
import math
import pathlib
import tempfile

import solver

E, NU, RHO = 200e9, 0.3, 7850.0
C_T, C_BAR = math.sqrt(E / (2 * (1 + NU)) / RHO), math.sqrt(E / RHO)


def solve(folder, body, band, more=None):
    damping = {"internal_friction": {"tan_phi": 1e-3}}
    material = {"young_modulus_pa": E, "poisson_ratio": NU, "density_kg_m3": RHO, "damping": damping}
    solver.write_job(folder, body=body, band_hz=band, material=material, **(more or {}))
    assert solver.run(folder, "carillon-precompute", "-q", "job.json").stdout == ""
    return solver.read_info(folder)


def compare(name, found, truth, tolerance):
    assert len(found) == len(truth), (name, found, truth)
    worst = max(abs(f / t - 1) for f, t in zip(found, truth))
    print(f"{name:<28} {len(truth)} modes, worst {100 * worst:.3f} %, allowed {100 * tolerance:g} %")
    assert worst < tolerance, (name, found, truth)


def check_rigid(name, bank, volume, inertia, centre):
    """Volume, the principal moments of inertia over the mass about x, y, z, and the centre of mass."""
    rigid = bank["rigid"]
    assert abs(rigid["volume_m3"] / volume - 1) < 3e-4, (name, rigid, volume)
    for k in range(3):
        assert abs(rigid["inertia_kg_m2"][k][k] / rigid["mass_kg"] / inertia[k] - 1) < 1e-3, (name, k, rigid, inertia)
        assert abs(rigid["centre_m"][k] - centre[k]) < 1e-4 * volume ** (1 / 3), (name, rigid, centre)


with tempfile.TemporaryDirectory(prefix="carillon-round-") as scratch:
    folder = pathlib.Path(scratch)

    r, l = 0.05, 0.1
    hz = C_T / (2 * math.pi * r)
    truth = [math.pi / 2, 1.978402086, 1.978402086, 1.993804467, 1.993804467, 2.151059072, 2.151059072, 2.326302219, 2.33803277, 2.33803277]
    bank = solve(folder, {"shape": "cylinder", "length_m": l, "radius_m": r, "nodes": 3000}, [20, 2.4 * hz])
    compare("cylinder, L = 2 R", bank["frequencies_hz"], [hz * omega for omega in truth], 2e-3)
    check_rigid("cylinder", bank, math.pi * r * r * l, [r * r / 2, r * r / 4 + l * l / 12, r * r / 4 + l * l / 12], [0, 0, 0])

    r, h = 0.1, 0.002
    hz = math.sqrt(E * h * h / (12 * (1 - NU * NU) * RHO)) / r**2 / (2 * math.pi)
    bank = solve(folder, {"shape": "disc", "radius_m": r, "thickness_m": h, "nodes": 5000}, [20, 13 * hz])
    compare("disc, h = R / 50", bank["frequencies_hz"], [hz * x for x in (5.35833, 5.35833, 9.003137, 12.438988, 12.438988)], 1e-2)
    check_rigid("disc", bank, math.pi * r * r * h, [r * r / 4 + h * h / 12, r * r / 4 + h * h / 12, r * r / 2], [0, 0, 0])

    r, d = 0.1, 0.004
    hz = C_BAR * d / 4 / r**2 / (2 * math.pi)
    in_plane = lambda n: hz * n * (n * n - 1) / math.sqrt(n * n + 1)
    across = lambda n: hz * n * (n * n - 1) / math.sqrt(n * n + 1 + NU)
    bank = solve(folder, {"shape": "ring", "radius_m": r, "thickness_m": d, "nodes": 12000}, [20, 1.2 * in_plane(3)])
    compare("ring, d = R / 25", bank["frequencies_hz"], [across(2)] * 2 + [in_plane(2)] * 2 + [across(3)] * 2 + [in_plane(3)] * 2, 1e-2)
    a = d / 2
    check_rigid("ring", bank, 2 * math.pi**2 * r * a * a, [r * r / 2 + 5 * a * a / 8] * 2 + [r * r + 3 * a * a / 4], [0, 0, 0])

    r, l = 0.005, 0.1
    hz = 8.7192 * (r / 2) * C_BAR / l**2 / (2 * math.pi)
    bank = solve(folder, {"shape": "cone", "radius_m": r, "height_m": l, "nodes": 5000}, [20, 1.5 * hz], {"fixed": "base"})
    compare("cone, H = 20 R, fixed below", bank["frequencies_hz"], [hz, hz], 1e-2)
    check_rigid("cone", bank, math.pi * r * r * l / 3, [3 * r * r / 20 + 3 * l * l / 80] * 2 + [3 * r * r / 10], [0, 0, -l / 4])
    hz = 4.493409458 * C_BAR / l / (2 * math.pi)
    bank = solve(folder, {"shape": "cone", "radius_m": r, "height_m": l, "nodes": 5000}, [0.98 * hz, 1.02 * hz])
    compare("cone along its axis", [min(bank["frequencies_hz"], key=lambda f: abs(f - hz))], [hz], 5e-3)

    # A truncated cone in closed form: volume and centre; with equal radii it is the cylinder.
    a, b, l = 0.03, 0.01, 0.08
    bank = solve(folder, {"shape": "cone", "radius_m": a, "top_radius_m": b, "height_m": l, "nodes": 3000}, [20, 40000], {"max_modes": 1})
    volume, centre = math.pi * l / 3 * (a * a + a * b + b * b), l / 4 * (a * a + 2 * a * b + 3 * b * b) / (a * a + a * b + b * b) - l / 2
    assert abs(bank["rigid"]["volume_m3"] / volume - 1) < 3e-4 and abs(bank["rigid"]["centre_m"][2] - centre) < 1e-5, (
        bank["rigid"],
        volume,
        centre,
    )
    r, l = 0.05, 0.1
    hz = C_T / (2 * math.pi * r)
    bank = solve(folder, {"shape": "cone", "radius_m": r, "top_radius_m": r, "height_m": l, "nodes": 3000}, [20, 2.4 * hz])
    compare("cone of equal radii", bank["frequencies_hz"], [hz * omega for omega in truth], 2e-3)
