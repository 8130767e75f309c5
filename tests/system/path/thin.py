#!/usr/bin/python3
"""Bodies that take long, most of them surfaces with thin walls, made on a lathe: --validate and advise answer within their patience, from
volume, area and thickness where a mesh would take longer, and say what was left out; with patience they mesh and count. A trial of
"accuracy_cents" takes the count that a thin wall needs.

usage: thin.py BIN_DIR
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile

BIN = pathlib.Path(sys.argv[1]).resolve()
GLASS = {"young_modulus_pa": 72e9, "poisson_ratio": 0.22, "density_kg_m3": 2500, "damping": {"internal_friction": {"tan_phi": 1e-3}}}


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


def make_plate(radius=0.13, thickness=0.006):
    return turn([(0.0, 0.0), (0.5 * radius, 0.0), (radius, 0.02), (radius, 0.02 + thickness), (0.5 * radius, thickness), (0.0, thickness)])


def make_cup(radius=0.02, height=0.012, wall=0.0016):
    """A cup whose thickness needs a little more than the nodes of a coarse trial."""
    return turn([(0.0, 0.0), (radius, 0.0), (radius, height), (radius - wall, height), (radius - wall, wall), (0.0, wall)])


def run(folder, program, *words):
    return subprocess.run(
        [str(BIN / program), *map(str, words)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=280
    )


def write_job(folder, body, more=None):
    """Without a body: of bar.msh."""
    (folder / "job.json").write_text(
        json.dumps(({"body": body} if body else {"mesh": "bar.msh"}) | {"material": GLASS, "bank": "bank.hdf"} | (more or {}))
    )


def look(folder, body, *words):
    write_job(folder, body)
    done = run(folder, "carillon-precompute", "--validate", "--json", *words, "job.json")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "reading" in done.stderr, f"nothing was said on the way: {done.stderr!r}"
    return json.loads(done.stdout)


with tempfile.TemporaryDirectory() as top:
    folder = pathlib.Path(top)
    (folder / "glass.obj").write_text(make_glass())
    (folder / "pot.obj").write_text(make_pot())
    (folder / "plate.obj").write_text(make_plate())
    (folder / "cup.obj").write_text(make_cup())
    arc = [math.radians(5 * i) for i in range(19)]
    (folder / "bowl.obj").write_text(turn([(0.03 * math.sin(a), 0.03 * (1 - math.cos(a))) for a in arc]))
    bodies = {"glass": {"surface": "glass.obj"}, "pot": {"surface": "pot.obj", "wall_m": 0.004}, "plate": {"surface": "plate.obj"}}
    for name, body in bodies.items():
        found = look(folder, body, "--patience", "0")
        assert found["mesh"]["how"] == "estimated", f"{name}: {found['mesh']}"
        assert any("--patience" in note for note in found["notes"]), found["notes"]
        assert 5e3 < found["mesh"]["nodes"] < 1e6 and found["unknowns"] == 3 * found["mesh"]["nodes"], found["mesh"]
        assert found["modes"]["count"] > 0 and found["cpu_seconds"] > 0 and found["memory_bytes"]["1"] > 1e7, found
        print(f"{name}: about {found['mesh']['nodes']} nodes, {found['modes']['count']} modes, {found['cpu_seconds']:.0f} CPU s")
    # A body that is meshed in time has what the mesher makes, and the estimate was right to a factor of two.
    small = {"surface": "plate.obj", "nodes": 45000}
    estimate, made = look(folder, small, "--patience", "0"), look(folder, {"surface": "pot.obj", "nodes": 3000}, "--patience", "1000000")
    assert 0.5 < estimate["mesh"]["nodes"] / 45000 < 2, estimate["mesh"]
    assert made["mesh"]["how"] == "made" and 0.85 < made["mesh"]["nodes"] / 3000 < 1.15, made["mesh"]
    assert made["factor"]["how"] == "analysed" and made["modes"]["how"] == "counted" and "notes" not in made, made
    # Without time for the count all but that is known, and it is said how to have it.
    uncounted = look(folder, {"surface": "pot.obj", "nodes": 3000}, "--patience", "1000000", "--count", "0")
    assert uncounted["factor"] == made["factor"] and uncounted["modes"]["how"] == "estimated", uncounted
    assert any("not counted" in note and "--count" in note for note in uncounted["notes"]), uncounted["notes"]
    # Shapes and mesh files: as many nodes as there will be, within a factor of two; of a file's modes nothing is known.
    bar = {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02}
    for body, nodes in ((bar | {"nodes": 20000}, 20000), (bar, 10000), (bar | {"edge_m": 0.005}, None)):
        far, near = look(folder, body, "--patience", "0"), look(folder, body, "--patience", "1000000", "--count", "0")
        assert (
            far["mesh"]["how"] == "estimated" and near["mesh"]["how"] == "made" and 0.5 < far["mesh"]["nodes"] / near["mesh"]["nodes"] < 2
        ), (far, near)
        assert nodes is None or far["mesh"]["nodes"] == nodes, far["mesh"]
        assert math.isclose(far["modes"]["estimate"], near["modes"]["estimate"], rel_tol=0.1) and any(
            "--patience" in note for note in far["notes"]
        ), (far, near)
    made = run(
        folder, "carillon-mesh", "--shape", "bar", "--length", 0.2, "--width", 0.03, "--thickness", 0.02, "--nodes", 8000, "-o", "bar.msh"
    )
    assert made.returncode == 0, made.stderr
    far, near = look(folder, None, "--patience", "0"), look(folder, None, "--patience", "1000000", "--count", "0")
    assert (
        far["mesh"]["how"] == "estimated" and far["modes"]["how"] == "unknown" and 0.5 < far["mesh"]["nodes"] / near["mesh"]["nodes"] < 2
    ), (far, near)
    # The mesher reports to programs what it knows: of the surface as it was read, of the repaired one, and which count it can meet.
    ended = run(
        folder,
        "carillon-mesh",
        "glass.obj",
        "--order",
        2,
        "--nodes",
        400,
        "--estimate",
        "--quiet",
        "--result",
        "mesh.result",
        "-o",
        "glass.msh",
    )
    rough = json.loads(dict(line.split(" ", 1) for line in ended.stderr.splitlines())["rough"])
    possible = json.loads((folder / "mesh.result").read_text())["possible_nodes"]
    assert ended.returncode == 2 and possible > 400 and 0.5 < rough["nodes"] / possible < 2, ended.stderr
    # A coarse trial that the thickness does not allow is made with the nodes that it needs, where the volume is meshed and not the skin.
    write_job(folder, {"surface": "cup.obj", "method": "delaunay"}, {"band_hz": [20, 12000], "accuracy_cents": 150})
    done = run(folder, "carillon-precompute", "job.json")
    assert done.returncode == 0 and "6000 nodes cannot be met" in done.stdout, done.stdout[-3000:] + done.stderr
    trials = json.loads((folder / "bank.hdf.resolved.json").read_text())["run"]["accuracy"]["trials"]
    assert (
        7000 < trials[0]["nodes"] < 14000 and trials[-1]["modes"] > 0 and abs(trials[0]["nodes"] / trials[0]["body_nodes"] - 1) < 0.11
    ), trials
    print(f"cup: {trials[0]['nodes']} nodes in the first trial, {trials[-1]['worst_cents']:.1f} cents at the end")
    # By extrusion any count will do, and finer ones follow it until the bars are met; an open sheet is meshed the same way.
    bowl = {"surface": "bowl.obj", "wall_m": 0.0012, "side": "middle"}
    for name, body, cents in (("thin cup", {"surface": "cup.obj"}, 150), ("bowl", bowl, 30)):
        write_job(folder, body, {"band_hz": [20, 12000], "accuracy_cents": cents})
        done = run(folder, "carillon-precompute", "job.json")
        assert done.returncode == 0 and "cannot be met" not in done.stdout, done.stdout[-3000:] + done.stderr
        trials = json.loads((folder / "bank.hdf.resolved.json").read_text())["run"]["accuracy"]["trials"]
        assert trials[-1]["modes"] > 0 and trials[-1]["worst_cents"] <= cents and trials[0]["nodes"] < 7000, trials
        print(f"{name}: {[t['nodes'] for t in trials]} nodes, {trials[-1]['worst_cents']:.1f} cents")
    # What can never be meshed is refused, patience or not.
    (folder / "job.json").write_text(json.dumps({"body": {"surface": "none.obj"}, "material": GLASS, "bank": "bank.hdf"}))
    refused = run(folder, "carillon-precompute", "--validate", "--patience", "0", "job.json")
    assert refused.returncode == 2 and "none.obj" in refused.stderr, refused.stderr
    # advise tries coarse meshes of the glass, whose wall is extruded, and answers with a forecast.
    advice = run(folder, "carillon-study", "advise", "glass.obj", "--cents", "20", "--dry-run", "--json")
    assert advice.returncode == 0, advice.stderr
    document = json.loads(advice.stdout)
    assert document["setting"]["nodes"] > 5000 and 0 < document["predicted"]["cents"] <= 20, document
    assert "looking at" in advice.stderr, advice.stderr
print("thin: well")
