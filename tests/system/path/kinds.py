#!/usr/bin/python3
"""Kinds of modes by carillon-bank against closed forms at the same frequencies.

A free steel bar: Timoshenko's bending in both planes (Huang 1961), torsion (St Venant) and longitudinal motion (Rayleigh). A ball: Lamb's
breathing mode. A ring: its nodal diameters in and out of the plane (Love 1927). A plate: Leissa 1973, table C20. An irregular body: none.

usage: kinds.py BIN_DIR
"""
import csv
import io
import math
import pathlib
import re
import tempfile

import solver

E, NU, RHO = 200e9, 0.3, 7850


def find_roots(f, low, high, steps=20000):
    roots, last = [], f(low)
    for i in range(1, steps + 1):
        x = low + (high - low) * i / steps
        value = f(x)
        if last * value < 0:
            a, b = x - (high - low) / steps, x
            for _ in range(60):
                middle = (a + b) / 2
                a, b = (middle, b) if f(a) * f(middle) > 0 else (a, middle)
            roots.append((a + b) / 2)
        last = value
    return roots


def bending(length, width, height, high_hz):
    """Bending frequencies of a free bar along `height` [Hz]."""
    area, moment = width * height, width * height**3 / 12
    shear = 10 * (1 + NU) / (12 + 11 * NU) * E / (2 * (1 + NU))
    r2, s2 = moment / (area * length**2), E * moment / (shear * area * length**2)

    def find_b(hz):
        return math.sqrt(RHO * area * length**4 / (E * moment)) * 2 * math.pi * hz

    def residual(hz):
        b = find_b(hz)
        root = math.sqrt((r2 - s2) ** 2 + 4 / b**2)
        alpha, beta = (math.sqrt((sign * (r2 + s2) + root) / 2) for sign in (-1, 1))
        more = b / math.sqrt(1 - b * b * r2 * s2) * (b * b * r2 * (r2 - s2) ** 2 + 3 * r2 - s2)
        return 2 - 2 * math.cosh(b * alpha) * math.cos(b * beta) + more * math.sinh(b * alpha) * math.sin(b * beta)

    return find_roots(residual, 50, high_hz)


def solve(folder, name, job):
    """[(playback frequency [Hz], kind)]"""
    solver.solve(folder, name, material=solver.STEEL, **job)
    list_modes = lambda *words: solver.run(folder, "carillon-bank", "info", f"{name}.hdf", *words).stdout
    rows = list(csv.DictReader(io.StringIO(list_modes("--csv"))))
    info = solver.read_info(folder, name)
    assert [row["kind"] for row in rows] == [mode["kind"] for mode in info["modes"]]
    assert [float(row["frequency_hz"]) for row in rows] == info["frequencies_hz"]
    table = list_modes("--modes", 3)
    for row in rows[:3]:
        assert re.search(rf"  {re.escape(row['kind'])}$", table, re.M), table
    found = [(float(row["heard_frequency_hz"]), row["kind"]) for row in rows]
    print(f"{name}: " + "; ".join(f"{hz:.0f} {kind}" for hz, kind in found))
    return found


def expect(found, wanted, tolerance):
    """wanted: {kind: [Hz, ...]}, repeated for multiple modes."""
    for kind, frequencies in wanted.items():
        own = sorted(hz for hz, other in found if other == kind)
        assert len(own) == len(frequencies), (kind, own, frequencies)
        for hz, right in zip(own, sorted(frequencies)):
            assert abs(hz / right - 1) < tolerance, (kind, hz, right)


def count(n, what="node"):
    return f"{n} {what}" + ("" if n == 1 else "s")


with tempfile.TemporaryDirectory(prefix="carillon-kinds-") as scratch:
    folder = pathlib.Path(scratch)

    length, width, thickness, high = 0.3, 0.03, 0.012, 18000
    found = solve(
        folder,
        "bar",
        {"body": {"shape": "bar", "length_m": length, "width_m": width, "thickness_m": thickness, "nodes": 3000}, "band_hz": [20, high]},
    )
    wanted = {}
    for kind, sides in (("bending", (width, thickness)), ("lateral bending", (thickness, width))):
        for n, hz in enumerate(bending(length, *sides, high)):
            wanted[f"{kind}, {count(n + 2)}"] = [hz]
    ratio = thickness / width
    stiffness = width * thickness**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    polar = width * thickness * (width**2 + thickness**2) / 12
    speed = math.sqrt(E / (2 * (1 + NU)) * stiffness / (RHO * polar))
    for n in range(1, int(high * 2 * length / speed) + 1):
        wanted[f"torsion, {count(n)}"] = [n * speed / (2 * length)]
    for n in range(1, 3):
        slower = 1 - (n * math.pi * NU / length) ** 2 * (width**2 + thickness**2) / 24
        wanted[f"longitudinal, {count(n)}"] = [n * math.sqrt(E / RHO) / (2 * length) * slower]
    wanted = {kind: hz for kind, hz in wanted.items() if hz[0] < 0.97 * high}
    assert len(wanted) > 10, wanted
    expect(found, wanted, 0.03)
    assert sum(kind == "-" for _, kind in found) <= 0.1 * len(found), found

    radius = 0.2
    ratio2 = 2 * (1 - NU) / (1 - 2 * NU)  # squared ratio of wave speeds
    fast = math.sqrt(E * (1 - NU) / ((1 + NU) * (1 - 2 * NU)) / RHO)
    root = find_roots(lambda x: x * math.cos(x) - (1 - x * x * ratio2 / 4) * math.sin(x), 0.5, 3.1)[0]
    breathing = root * fast / (2 * math.pi * radius)
    found = solve(
        folder, "ball", {"body": {"shape": "sphere", "radius_m": radius, "nodes": 3000}, "band_hz": [0.9 * breathing, 1.1 * breathing]}
    )
    expect(found, {"breathing": [breathing]}, 0.01)
    assert all(kind in ("breathing", "-") for _, kind in found), found

    radius, thick = 0.1, 0.006
    found = solve(
        folder, "ring", {"body": {"shape": "ring", "radius_m": radius, "thickness_m": thick, "nodes": 4000}, "band_hz": [20, 3000]}
    )
    inertia = (thick / 4) ** 2  # of a round section, per area
    unit = math.sqrt(E * inertia / (RHO * radius**4)) / (2 * math.pi)
    wanted = {}
    for n in range(2, 5):
        flat = n * (n * n - 1) / math.sqrt(n * n + 1)
        up = n * (n * n - 1) / math.sqrt(n * n + 1 + NU)
        wanted[count(n, "diameter")] = [f * unit for f in (flat, flat, up, up)]
    expect(found, {kind: hz for kind, hz in wanted.items() if max(hz) < 2900}, 0.03)

    sides, thick = (0.3, 0.2), 0.002
    found = solve(
        folder,
        "plate",
        {"body": {"shape": "plate", "length_m": sides[0], "width_m": sides[1], "thickness_m": thick, "nodes": 6000}, "max_modes": 6},
    )
    unit = thick * math.sqrt(E / (12 * (1 - NU**2) * RHO)) / (2 * math.pi * sides[0] ** 2)
    lines = ("1 x 1", "2 x 0", "2 x 1", "0 x 2")
    factors = (20.128, 21.603, 46.654, 50.293, 58.201, 67.494)  # the last two are sums of 1 x 2 and 3 x 0, both without such lines
    expect(found, {f"plate bending, {one} lines": [f * unit] for one, f in zip(lines, factors)}, 0.02)
    expect(found, {"plate bending": [f * unit for f in factors[4:]]}, 0.02)
