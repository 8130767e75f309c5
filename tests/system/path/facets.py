#!/usr/bin/python3
"""A faceted cylinder is solved as the smooth one, for any triangulation. With ambiguous facets the error bars hold for the meshed body and,
with the doubt, for both. Turned bells: facets are ambiguous with few rings, not with many.

Truth: the free steel cylinder of radius 20 mm and length 200 mm, "cylinder-10" of
tests/unit/precompute/fem/error_bars/data/known_frequencies.csv (Fourier-Ritz, 7 digits). The prisms, and the bell of planes, are meshed
with "facets": true and solved on their own.

usage: facets.py BIN_DIR
"""
import math
import pathlib
import tempfile

from solver import STEEL, read_info, read_record, solve
from solver import run as run_program

data = pathlib.Path(__file__).resolve().parents[2] / "unit/precompute/fem/error_bars/data/known_frequencies.csv"
TRUTH = [float(line.split(",")[1]) for line in data.read_text().splitlines() if line.startswith("cylinder-10,")][:9]
RADIUS, LENGTH = 0.02, 0.2


def write_cylinder(path, sides, rings, quads):
    """An OBJ file of rings of quads or triangles, with polygonal ends."""
    points = [
        (RADIUS * math.cos(2 * math.pi * j / sides), RADIUS * math.sin(2 * math.pi * j / sides), LENGTH * i / rings)
        for i in range(rings + 1)
        for j in range(sides)
    ]
    faces = [tuple(range(sides, 0, -1)), tuple(range(rings * sides + 1, (rings + 1) * sides + 1))]
    for i in range(rings):
        for j in range(sides):
            a, b = i * sides + j + 1, i * sides + (j + 1) % sides + 1
            faces += [(a, b, b + sides, a + sides)] if quads else [(a, b, a + sides), (b, b + sides, a + sides)]
    path.write_text("".join("v %.12g %.12g %.12g\n" % p for p in points) + "".join("f " + " ".join(map(str, f)) + "\n" for f in faces))


def write_bell(path, sides, points):
    """An OBJ file in millimetres: both sides of a wall of 3 mm, a solid of revolution about y from a profile of `points` pieces."""
    outer = []
    for i in range(points + 1):
        s = i / points
        outer.append((30 * math.sin(s * math.pi / 2) ** 0.8 + 8 * s**4, 70 * math.cos(s * math.pi / 2)))
    inner = [(0, 67)]
    for i in range(1, points + 1):
        (r0, y0), (r1, y1) = outer[i - 1], outer[min(i + 1, points)]
        length = math.hypot(r1 - r0, y1 - y0)
        inner.append((max(outer[i][0] + 3 * (y1 - y0) / length, 0), outer[i][1] - 3 * (r1 - r0) / length))
    rings, lines = [], []
    for radius, y in outer + inner[::-1]:
        turns = [2 * math.pi * j / sides for j in range(sides if radius > 0 else 1)]
        rings.append([len(lines) + j + 1 for j in range(len(turns))])
        lines += ["v %.9g %.9g %.9g" % (radius * math.cos(turn), y, radius * math.sin(turn)) for turn in turns]
    for a, b in zip(rings, rings[1:]):
        for j in range(sides):
            corners = a[j % len(a)], a[(j + 1) % sides % len(a)], b[(j + 1) % sides % len(b)], b[j % len(b)]
            lines.append("f " + " ".join(map(str, dict.fromkeys(corners))))
    path.write_text("\n".join(lines) + "\n")


def run(folder, name, job, ranks=1):
    solve(folder, name, ranks, **{"material": STEEL, "band_hz": [20, 17800], **job})
    bank = read_info(folder, name)
    modes = bank["modes"]
    bars = [m["algebraic_error_cents"] + m["discretisation_error_cents"] for m in modes]
    return bank["frequencies_hz"], bars, [m["facet_error_cents"] for m in modes]


def add(bars, facets):
    return [b + f for b, f in zip(bars, facets)]


def cents(found, truth):
    return [1200 * math.log2(f / t) for f, t in zip(found, truth)]


def expect_inside(name, found, bars, truth, most=None):
    errors = cents(found, truth)
    print(f"{name:32} true error up to {max(map(abs, errors)):7.2f} cents, bars {min(bars):.2f} to {max(bars):.2f}")
    assert len(found) >= len(truth), (name, found)
    assert all(abs(e) <= b for e, b in zip(errors, bars)), (name, errors, bars)
    assert most is None or max(map(abs, errors)) <= most, (name, errors)


with tempfile.TemporaryDirectory(prefix="carillon-facets-") as scratch:
    folder = pathlib.Path(scratch)
    # Rings of quads, with the accuracy as the input.
    write_cylinder(folder / "lathe.obj", 24, 8, True)
    found, bars, facets = run(folder, "lathe", {"body": {"surface": "lathe.obj"}, "accuracy_cents": 5})
    expect_inside("24 sides, 5 cents asked", found, bars, TRUTH, 5)
    assert not any(facets), facets
    # Other triangulations of the same body, on meshes of one size: the same frequencies.
    all_found = []
    for sides, rings, quads in ((16, 1, True), (16, 32, False), (64, 4, True)):
        name = f"cut-{sides}-{rings}"
        write_cylinder(folder / f"{name}.obj", sides, rings, quads)
        found, bars, _ = run(folder, name, {"body": {"surface": f"{name}.obj", "nodes": 6000}})
        expect_inside(f"{sides} sides, {rings} rings", found, bars, TRUTH, 2)
        all_found.append(found)
    assert all(abs(c) < 1 for found in all_found for c in cents(found, all_found[0])), all_found
    # Ambiguous facets: the bars hold for the meshed body and, with the doubt, for the other one.
    for sides, is_round in ((8, False), (12, True)):
        name = f"either-{sides}"
        write_cylinder(folder / f"{name}.obj", sides, 4, True)
        found, bars, facets = run(folder, name, {"body": {"surface": f"{name}.obj", "nodes": 5000}})
        prism, own_bars, none = run(folder, f"{name}-prism", {"body": {"surface": f"{name}.obj", "facets": True, "nodes": 9000}})
        assert not any(none) and all(f > 0 for f in facets), (none, facets)
        meshed, other = (TRUTH, prism[:9]) if is_round else (prism[:9], TRUTH)
        expect_inside(f"{sides} sides against what was meshed", found, add(bars, own_bars if not is_round else [0] * 99), meshed)
        expect_inside(f"{sides} sides against the other", found, add(bars, facets), other)
        assert max(map(abs, cents(found, other))) > max(bars), "no bar contains the other body"
        # The same on more ranks and from a mesh file, which stores the doubt.
        run_program(folder, "carillon-mesh", f"{name}.obj", "--order", 2, "--nodes", 5000, "-o", f"{name}-file.msh")
        _, two, facets_two = run(folder, f"{name}-two", {"mesh": f"{name}-file.msh"}, ranks=2)
        assert all(abs(b / a - 1) < 1e-3 for a, b in zip(bars + facets, two + facets_two)), (bars, two, facets, facets_two)
    # The accuracy target applies to the bars; the doubt gives one warning.
    _, bars, facets = run(folder, "asked", {"body": {"surface": "either-12.obj"}, "accuracy_cents": 5})
    record = read_record(folder, "asked")["run"]
    assert record["accuracy"]["chosen"]["worst_cents"] <= 5 < max(facets) and record["accuracy"]["chosen"]["facet_cents"] > 5, record
    assert sum("facets in doubt" in text for text in record["warnings"]) == 1, record["warnings"]

    # A bell from a profile with few points, and with many.
    for points, sides in ((6, 64), (40, 256)):
        write_bell(folder / f"bell-{sides}.obj", sides, points)
    job = {"nodes": 9000, "scale": 0.001}
    coarse, bars, facets = run(folder, "bell-64", {"body": {"surface": "bell-64.obj", **job}, "max_modes": 10})
    fine, fine_bars, none = run(folder, "bell-256", {"body": {"surface": "bell-256.obj", **job}, "max_modes": 10})
    planes, plane_bars, none_too = run(folder, "planes", {"body": {"surface": "bell-64.obj", "facets": True, **job}, "max_modes": 10})
    assert not any(none + none_too) and all(f > 0 for f in facets) and max(facets) > 10, facets
    expect_inside("bell of 64 sides, as a smooth one", coarse, add(bars, fine_bars), fine)
    expect_inside("bell of 64 sides, as planes", coarse, add(add(bars, facets), plane_bars), planes)
    assert max(bars) < 1.5 * max(fine_bars), "finer facets of the same body leave the bar as it is"
