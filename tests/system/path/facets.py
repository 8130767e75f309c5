#!/usr/bin/python3
"""A cylinder made of facets is the cylinder, however it is cut; where the facets may be the body, the error bars contain both.

Truth: the free steel cylinder of radius 20 mm and length 200 mm, "cylinder-10" of tests/unit/precompute/estimate/data/known_frequencies.csv
(Fourier-Ritz, 7 digits). The prisms are meshed with carillon-mesh --facets and solved on their own.

usage: facets.py BIN_DIR
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile

bin_dir = pathlib.Path(sys.argv[1]).resolve()
data = pathlib.Path(__file__).resolve().parents[2] / "unit/precompute/estimate/data/known_frequencies.csv"
TRUTH = [float(line.split(",")[1]) for line in data.read_text().splitlines() if line.startswith("cylinder-10,")][:9]
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
RADIUS, LENGTH = 0.02, 0.2


def write_cylinder(path, sides, rings, quads):
    """An OBJ file of rings of quads or triangles, ends of one polygon each."""
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


def run(folder, name, job, ranks=1, code=0):
    (folder / f"{name}.json").write_text(json.dumps({"bank": f"{name}.hdf", "material": STEEL, "band_hz": [20, 17800], **job}))
    done = subprocess.run(
        ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none", bin_dir / "carillon-precompute", f"{name}.json"],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == code, f"{name}: exit code {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
    if code:
        return done.stdout + done.stderr
    bank = json.loads(
        subprocess.run(
            [bin_dir / "carillon-bank", "info", "--json", f"{name}.hdf"], cwd=folder, capture_output=True, text=True, check=True
        ).stdout
    )
    return bank["frequencies_hz"], [m["algebraic_error_cents"] + m["discretisation_error_cents"] for m in bank["modes"]]


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
    expect_inside("24 sides, 5 cents asked", *run(folder, "lathe", {"body": {"surface": "lathe.obj"}, "accuracy_cents": 5}), TRUTH, 5)
    # Other cuts of the same body, on meshes of one size: the same frequencies.
    all_found = []
    for sides, rings, quads in ((16, 1, True), (16, 32, False), (64, 4, True)):
        name = f"cut-{sides}-{rings}"
        write_cylinder(folder / f"{name}.obj", sides, rings, quads)
        found, bars = run(folder, name, {"body": {"surface": f"{name}.obj", "nodes": 6000}})
        expect_inside(f"{sides} sides, {rings} rings", found, bars, TRUTH, 2)
        all_found.append(found)
    assert all(abs(c) < 1 for found in all_found for c in cents(found, all_found[0])), all_found
    # Facets that may be the body: the bars contain the cylinder and the prism.
    for sides in (8, 12):
        name = f"either-{sides}"
        write_cylinder(folder / f"{name}.obj", sides, 4, True)
        found, bars = run(folder, name, {"body": {"surface": f"{name}.obj", "nodes": 5000}})
        expect_inside(f"{sides} sides against the cylinder", found, bars, TRUTH)
        subprocess.run(
            [bin_dir / "carillon-mesh", f"{name}.obj", "--facets", "--order", "2", "--nodes", "9000", "-o", f"{name}.msh"],
            cwd=folder,
            check=True,
            capture_output=True,
        )
        prism, own_bars = run(folder, f"{name}-prism", {"mesh": f"{name}.msh"})
        expect_inside(f"{sides} sides against the prism", found, bars, prism[:9])
        # More ranks, the same bars; and the mesh file carries the doubt as well.
        subprocess.run(
            [bin_dir / "carillon-mesh", f"{name}.obj", "--order", "2", "--nodes", "5000", "-o", f"{name}-file.msh"],
            cwd=folder,
            check=True,
            capture_output=True,
        )
        _, two = run(folder, f"{name}-two", {"mesh": f"{name}-file.msh"}, ranks=2)
        assert all(abs(b / a - 1) < 1e-3 for a, b in zip(bars, two)), (bars, two)
    text = run(folder, "asked", {"body": {"surface": "either-12.obj"}, "accuracy_cents": 5}, code=3)
    assert "may be planes or samples of a smooth surface" in text, text
    assert not (folder / "asked.hdf").exists()
