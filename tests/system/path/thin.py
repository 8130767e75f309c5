#!/usr/bin/python3
"""Surfaces with thin walls, made on a lathe: --validate, advise, and trials of "accuracy_cents" with the node count that a thin wall needs.

usage: thin.py BIN_DIR
"""
import json
import math
import pathlib
import tempfile

import solver
from solver import GLASS, read_record, run


def write_hollow_box(size, wall):
    """OBJ of both sides of the wall of a closed box."""
    lines, faces = [], [
        (1, 3, 2),
        (2, 3, 4),
        (5, 6, 7),
        (6, 8, 7),
        (1, 2, 5),
        (2, 6, 5),
        (3, 7, 4),
        (4, 7, 8),
        (1, 5, 3),
        (3, 5, 7),
        (2, 4, 6),
        (4, 8, 6),
    ]
    for inset in (0, wall):
        corners = [[s - inset if k >> i & 1 else inset for i, s in enumerate(size)] for k in range(8)]
        lines += [f"v {x:g} {y:g} {z:g}" for x, y, z in corners]
    for a, b, c in faces:
        lines += [f"f {a} {b} {c}", f"f {c + 8} {b + 8} {a + 8}"]
    return "\n".join(lines) + "\n"


def turn(profile, sides=48):
    """OBJ of a closed profile [(radius, height)] about the y axis, from pole to pole; its first and last radius are 0."""
    lines, rows = [], []
    for radius, height in profile:
        rows.append(len(lines) + 1)
        if radius == 0:
            lines.append(f"v 0 {height} 0")
        else:
            lines += [
                f"v {radius * math.cos(2 * math.pi * k / sides)} {height} {radius * math.sin(2 * math.pi * k / sides)}"
                for k in range(sides)
            ]
    faces = []
    for (a, (radius, _)), (b, (next_radius, _)) in zip(zip(rows, profile), zip(rows[1:], profile[1:])):
        for k in range(sides):
            m = (k + 1) % sides
            if radius == 0:
                faces.append((a, b + k, b + m))
            elif next_radius == 0:
                faces.append((a + k, b, a + m))
            else:
                faces += [(a + k, b + k, b + m), (a + k, b + m, a + m)]
    return "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in faces]) + "\n"


def make_glass(height=0.11, radius=0.035, wall=0.0012, steps=24):
    """The bowl of a wine glass, a solid of its wall's thickness: down the outside, up the inside."""
    outer = [
        (radius * math.sin(math.pi / 2 * min(1.0, 1.3 * t + 1e-9)) if t > 0 else 0.0, height * (1 - math.cos(math.pi / 2 * t)))
        for t in (i / steps for i in range(steps + 1))
    ]
    inner = [(max(r - wall, 0.0) if r > wall else 0.0, h + wall * (1 - h / height)) for r, h in outer]
    inner = [point for i, point in enumerate(inner) if point[0] > 0 or i == 0]
    return turn(list(outer) + list(reversed(inner)))


def make_pot(radius=0.06, height=0.09, steps=16):
    """A full body of revolution to be hollowed by wall_m."""
    return turn(
        [(0.0, 0.0)]
        + [
            (radius * math.sin(math.pi * (i + 0.5) / (steps + 1)), height * (1 - math.cos(math.pi * (i + 0.5) / (steps + 1))) / 2)
            for i in range(steps + 1)
        ]
        + [(0.0, height)]
    )


def make_cup(radius=0.02, height=0.012, wall=0.0016):
    """A cup whose thickness needs a little more than the nodes of a coarse trial."""
    return turn([(0.0, 0.0), (radius, 0.0), (radius, height), (radius - wall, height), (radius - wall, wall), (0.0, wall)])


def write_job(folder, body, **more):
    solver.write_job(folder, body=body, material=GLASS, **more)


with tempfile.TemporaryDirectory() as top:
    folder = pathlib.Path(top)
    (folder / "glass.obj").write_text(make_glass())
    (folder / "pot.obj").write_text(make_pot())
    (folder / "cup.obj").write_text(make_cup())
    arc = [math.radians(5 * i) for i in range(19)]
    (folder / "bowl.obj").write_text(turn([(0.03 * math.sin(a), 0.03 * (1 - math.cos(a))) for a in arc]))
    write_job(folder, {"surface": "pot.obj", "wall_m": 0.004, "nodes": 9000})
    done = run(folder, "carillon-precompute", "--validate", "--json", "job.json")
    made = json.loads(done.stdout)
    assert 0.85 < made["mesh"]["nodes"] / 9000 < 1.15, made["mesh"]
    assert made["factor"]["how"] == "analysed" and made["modes"]["how"] == "counted" and "notes" not in made, made
    # The mesher reports the node count that it can meet.
    words = ["--order", 2, "--nodes", 400, "--quiet", "--result", "mesh.result", "-o", "glass.msh"]
    ended = run(folder, "carillon-mesh", "glass.obj", *words, code=2)
    possible = json.loads((folder / "mesh.result").read_text())["possible_nodes"]
    assert possible > 400, ended.stderr
    # A coarse trial below the minimum of the thickness uses the node count that the mesher suggests.
    write_job(folder, {"surface": "cup.obj", "method": "delaunay"}, band_hz=[20, 12000], accuracy_cents=150)
    done = run(folder, "carillon-precompute", "job.json")
    assert "6000 nodes cannot be met" in done.stdout, done.stdout[-3000:] + done.stderr
    trials = read_record(folder)["run"]["accuracy"]["trials"]
    assert (
        7000 < trials[0]["nodes"] < 14000 and trials[-1]["modes"] > 0 and abs(trials[0]["nodes"] / trials[0]["body_nodes"] - 1) < 0.11
    ), trials
    print(f"cup: {trials[0]['nodes']} nodes in the first trial, {trials[-1]['worst_cents']:.1f} cents at the end")
    # The count that the mesher is sure of is eight times that: one between is found first.
    (folder / "box.obj").write_text(write_hollow_box((0.08, 0.06, 0.04), 0.002))
    write_job(folder, {"surface": "box.obj"}, max_modes=6, band_hz=[20, 20000], accuracy_cents=100)
    done = run(folder, "carillon-precompute", "job.json")
    assert "6000 nodes cannot be met on this body; 12000 are tried" in done.stdout, done.stdout[-3000:] + done.stderr
    trials = read_record(folder)["run"]["accuracy"]["trials"]
    assert trials[0]["nodes"] < 15000 and trials[-1]["worst_cents"] <= 100, trials
    print(f"hollow box: {[t['nodes'] for t in trials]} nodes, {trials[-1]['worst_cents']:.1f} cents")
    # Extrusion meets any count, and finer trials follow until the bars are met; the same for an open sheet.
    bowl = {"surface": "bowl.obj", "wall_m": 0.0012, "side": "middle"}
    for name, body, cents in (("thin cup", {"surface": "cup.obj"}, 150), ("bowl", bowl, 30)):
        write_job(folder, body, band_hz=[20, 12000], accuracy_cents=cents)
        done = run(folder, "carillon-precompute", "job.json")
        assert "cannot be met" not in done.stdout, done.stdout[-3000:] + done.stderr
        trials = read_record(folder)["run"]["accuracy"]["trials"]
        assert trials[-1]["modes"] > 0 and trials[-1]["worst_cents"] <= cents and trials[0]["nodes"] < 7000, trials
        print(f"{name}: {[t['nodes'] for t in trials]} nodes, {trials[-1]['worst_cents']:.1f} cents")
    # A missing surface is refused.
    write_job(folder, {"surface": "none.obj"})
    refused = run(folder, "carillon-precompute", "--validate", "job.json", code=2)
    assert "none.obj" in refused.stderr, refused.stderr
    # advise solves coarse meshes of the glass, whose wall is extruded, and prints a forecast.
    advice = run(folder, "carillon-study", "advise", "glass.obj", "--cents", "20", "--dry-run", "--json")
    document = json.loads(advice.stdout)
    assert document["setting"]["nodes"] > 5000 and 0 < document["predicted"]["cents"] <= 20, document
    assert "predicting the cost of glass.obj" in advice.stderr, advice.stderr
print("thin: ok")
