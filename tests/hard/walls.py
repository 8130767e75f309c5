#!/usr/bin/env python3
"""Hard walls: sheets and thin bodies that are extruded (carillon-mesh --wall). Every case ends with the right body and frequencies within a
bound, or in a refusal that names the place.

usage: walls.py CASE
       walls.py record     solves the references again: walls_references.json

References: closed forms, Ritz, and the same body as a solid in elements of the volume mesher or in finer elements. These solves take a
minute, so their frequencies are in walls_references.json.
"""
import json
import math
import pathlib
import sys

import numpy as np

from figure import hold, hold_refusal
from programs import STEEL, Folder, calc_distance

REFERENCES = pathlib.Path(__file__).with_name("walls_references.json")
FOLD_ANGLES_DEG, FOLD_WALL_M = (175, 90, 60, 40), 0.003
TUB_M, TUB_WALL_M = (0.06, 0.05, 0.03), 0.002
HOLES_WALL_M = 0.002
BOX_M, BOX_WALL_M = (0.04, 0.03, 0.02), 0.002


def make_grid(place, nu, nv, skip=lambda i, j: False):
    """place(u, v) over nu x nv quads in two triangles each: points and triangles."""
    points = [place(i / nu, j / nv) for j in range(nv + 1) for i in range(nu + 1)]
    faces = []
    for j in range(nv):
        for i in range(nu):
            if not skip(i, j):
                a = j * (nu + 1) + i
                faces += [(a, a + 1, a + nu + 2), (a, a + nu + 2, a + nu + 1)]
    return points, faces


def join(*parts):
    points, faces = [], []
    for p, f in parts:
        faces += [tuple(i + len(points) for i in t) for t in f]
        points += p
    return points, faces


def make_plate(side):
    return make_grid(lambda u, v: (side * u, side * v, 0), 3, 3)


def make_fold(angle_deg, wide=0.04, long=0.08):
    half = math.radians(angle_deg) / 2
    return make_grid(lambda u, v: (abs(2 * v - 1) * wide * math.cos(half), (2 * v - 1) * wide * math.sin(half), long * u), 4, 8)


def make_bracket(angle_deg, wall, wide=0.04, long=0.08):
    """The solid between both sides of the wall on make_fold(): a prism over six corners."""
    half = math.radians(angle_deg) / 2
    along, across = np.array([math.cos(half), math.sin(half)]), np.array([-math.sin(half), math.cos(half)])
    tip, end = wall / 2 / math.sin(half), wide * along
    corners = [(-tip, 0), *(end + sign * wall / 2 * across for sign in (1, -1)), (tip, 0)]
    corners += [(x, -y) for x, y in (corners[2], corners[1])]
    points = [(x, y, z) for z in (0, long) for x, y in corners]
    caps = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = caps + [tuple(6 + i for i in t[::-1]) for t in caps]
    for i in range(6):
        j = (i + 1) % 6
        faces += [(j, i, 6 + i), (j, 6 + i, 6 + j)]
    return points, faces


def write(folder, name, surface):
    points, faces = surface
    lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in points] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (folder.path / name).write_text("\n".join(lines) + "\n")


def make_box(size):
    points = [tuple(size[k] * (i >> k & 1) for k in range(3)) for i in range(8)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return points, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def mesh(folder, surface, *words):
    """surface: None for a shape among the words."""
    if surface is not None:
        write(folder, "sheet.obj", surface)
        words = ("sheet.obj", *words)
    return folder.run(1, "carillon-mesh", *words, "-o", "mesh.msh", "--json", "report.json")


def solve(surface, *words, **keys):
    """Frequencies of the body that carillon-mesh makes, and its report."""
    with Folder() as folder:
        made = mesh(folder, surface, *words)
        assert made.code == 0, made.text
        outcome = folder.solve(None, "T10", **keys)
        assert outcome.code == 0, outcome.text[-1500:]
        report = json.loads((folder.path / "report.json").read_text())
        report["bars"] = outcome.bank["modes/discretisation_error_cents"]
        return outcome.freq_hz, report


def list_references():
    """Name: surface, words of carillon-mesh, keys of the job."""
    solid = ("--method", "delaunay", "--order", 2, "--edge")
    references = {
        f"fold of {angle} degrees": (make_bracket(angle, FOLD_WALL_M), (*solid, 0.0018), {"band_hz": (20, 60000), "max_modes": 8})
        for angle in FOLD_ANGLES_DEG
    }
    references["box without a lid"] = (make_tub_skins(*TUB_M, TUB_WALL_M), (*solid, 0.002), {"band_hz": (20, 40000), "max_modes": 6})
    sides = [word for name, side in zip(("length", "width", "height"), BOX_M) for word in (f"--{name}", side)]
    shape = ("--shape", "hollow-box", *sides, "--wall", BOX_WALL_M, "--order", 2, "--nodes", 200000)
    references["closed box"] = (None, shape, {"band_hz": (20, 40000), "max_modes": 9})
    references["tube with holes"] = (
        make_tube_with_holes(),
        ("--wall", HOLES_WALL_M, "--edge", 0.0025),
        {"band_hz": (20, 8000), "max_modes": 4},
    )
    return references


def record():
    found = {}
    for name, (surface, words, keys) in list_references().items():
        found[name] = [float(f"{hz:.9g}") for hz in solve(surface, *words, **keys)[0]]
        print(name, found[name])
    REFERENCES.write_text(json.dumps(found, indent=1) + "\n")


def get_reference(name):
    """Frequencies [Hz] of one of list_references()."""
    return np.array(json.loads(REFERENCES.read_text())[name])


def refuse(case, surface, words, *options):
    with Folder() as folder:
        made = mesh(folder, surface, *options)
        assert made.code == 2 and folder.list() == ["sheet.obj"], f"exit code {made.code}: {made.text}"
        hold_refusal(case, made.text, ["sheet.obj", *words], " ".join(map(str, options)))


def sheet():
    # Free steel plate 200 x 200 x 5 mm: 404.797, 594.1203, 735.4314 Hz (Legendre-Ritz in three dimensions, 8e-6).
    for side in ("middle", "outside", "inside"):
        freq_hz, report = solve(make_plate(0.2), "--wall", 0.005, "--side", side, "--edge", 0.01, band_hz=(20, 1000))
        hold("sheet", calc_distance(freq_hz[:3], [404.797, 594.1203, 735.4314]), 2e-3, f"plate, the surface is the {side}, against Ritz")
        hold("sheet", abs(report["volume_m3"] / 2e-4 - 1), 1e-12, f"its volume, the surface is the {side}")
    # Rayleigh's motions without extension of a free tube; its own error is of the order of the wall over the radius.
    radius, wall, long = 0.03, 0.0005, 0.1
    turn = 2 * math.pi
    tube = make_grid(lambda u, v: (radius * math.cos(turn * u), radius * math.sin(turn * u), long * v), 32, 4)
    freq_hz, report = solve(tube, "--wall", wall, band_hz=(20, 2000))
    speed = STEEL["young_modulus_pa"] / (12 * (1 - STEEL["poisson_ratio"] ** 2) * STEEL["density_kg_m3"])
    theory = [math.sqrt(speed * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)) * wall / radius**2 / turn for n in (2, 3)]
    hold("sheet", abs(freq_hz[0] / theory[0] - 1), 1.5e-2, "tube from 32 facets, two waves around, against Rayleigh")
    hold("sheet", abs(freq_hz[1] / freq_hz[0] - 1), 1e-3, "the pair's distance")
    hold("sheet", abs(report["volume_m3"] / (turn * radius * wall * long) - 1), 5e-4, "the tube's volume")


def make_tub(long, wide, high):
    """A box without a lid, two triangles a side."""
    points = [(x, y, z) for z in (0, high) for x, y in ((0, 0), (long, 0), (long, wide), (0, wide))]
    faces = [(0, 2, 1), (0, 3, 2)]
    for i in range(4):
        j = (i + 1) % 4
        faces += [(i, j, 4 + j), (i, 4 + j, 4 + i)]
    return points, faces


def make_tub_skins(long, wide, high, wall):
    """Both sides of the wall inside make_tub(), and the rim between them: closed."""
    outer, faces = make_tub(long, wide, high)
    inner = [(min(max(x, wall), long - wall), min(max(y, wall), wide - wall), z if z > 0 else wall) for x, y, z in outer]
    points, faces = outer + inner, faces + [tuple(8 + i for i in t[::-1]) for t in faces]
    for i in range(4):
        j = (i + 1) % 4
        faces += [(4 + i, 4 + j, 12 + j), (4 + i, 12 + j, 12 + i)]
    return points, faces


def corners():
    # Three mitres meet in a corner; with a rim folded outwards they go to both sides.
    size, wall = TUB_M, TUB_WALL_M
    tub = make_tub(*size)
    for side, edges in (("outside", size), ("inside", [size[0] + 2 * wall, size[1] + 2 * wall, size[2] + wall])):
        hollow = (edges[0] - 2 * wall) * (edges[1] - 2 * wall) * (edges[2] - wall)
        volume = edges[0] * edges[1] * edges[2] - hollow
        freq_hz, report = solve(tub, "--wall", wall, "--side", side, "--edge", 0.003, band_hz=(20, 40000), max_modes=6)
        # The wall ends at the rim at right angles, so that one inside the surface is as high as it.
        rim = wall * (2 * (edges[0] + edges[1]) - 4 * wall) * (size[2] + (wall if side == "inside" else 0) - edges[2])
        hold("corners", abs(report["volume_m3"] / (volume + rim) - 1), 1e-9, f"box without a lid, volume, the surface is the {side}")
        if side == "outside":
            solid = get_reference("box without a lid")
            parts = np.abs(1200 * np.log2(freq_hz / solid)) / report["bars"]
            hold("corners", parts.max(), 1, "distance from the solid over the error bar")
            hold("corners", calc_distance(freq_hz, solid), 2e-2, "against the solid in elements of the volume mesher")
    points, faces = tub
    rim = 0.01
    points = points + [(x + (rim if x > 0 else -rim), y + (rim if y > 0 else -rim), size[2]) for x, y, z in points[4:]]
    for i in range(4):
        j = (i + 1) % 4
        faces = faces + [(4 + i, 4 + j, 8 + j), (4 + i, 8 + j, 8 + i)]
    area = size[0] * size[1] + 2 * (size[0] + size[1]) * size[2] + (size[0] + 2 * rim) * (size[1] + 2 * rim) - size[0] * size[1]
    for thickness in (0.0015, 0.003):
        with Folder() as folder:
            made = mesh(folder, (points, faces), "--wall", thickness, "--side", "middle")
            assert made.code == 0, made.text
            report = json.loads((folder.path / "report.json").read_text())
            hold("corners", abs(report["volume_m3"] / (area * thickness) - 1), 1e-9, f"tray with a rim, {thickness * 1000:g} mm, volume")
            hold("corners", report["straightened_tets"], 0, f"tray with a rim, {thickness * 1000:g} mm, folded elements")


def closed_box():
    # Elements in the mitres of folds are as fine as elsewhere: otherwise finer meshes converge to another body.
    keys = {"band_hz": (20, 40000), "max_modes": 9}
    words = ("--wall", BOX_WALL_M, "--method", "extrude", "--nodes", 60000)
    freq_hz, report = solve(make_box(BOX_M), *words, **keys)
    far = np.abs(1200 * np.log2(freq_hz / get_reference("closed box")))
    hold("closed_box", (far / report["bars"]).max(), 1, "distance from the lattice of a known shape over the error bar")
    hold("closed_box", calc_distance(freq_hz, get_reference("closed box")), 1.1e-2, "the same distance")


def one_sided():
    turn, n, across, points, faces = 2 * math.pi, 60, 4, [], []
    for i in range(n):
        a = turn * i / n
        for j in range(across + 1):
            w = 0.01 * (2 * j / across - 1)
            far = 0.05 + w * math.cos(a / 2)
            points.append((far * math.cos(a), far * math.sin(a), w * math.sin(a / 2)))
    at = lambda i, j: i * (across + 1) + j if i < n else across - j
    for i in range(n):
        for j in range(across):
            faces += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
    refuse("one_sided", (points, faces), ["is one-sided", "Moebius", "at (", "modeller"], "--wall", 0.002)


def wall_0_1_mm():
    # Kirchhoff, nu 0.3: lambda^2 = 13.46819, 19.59614, 24.27020, 34.80089 twice.
    side, wall = 0.1, 1e-4
    stiffness = STEEL["young_modulus_pa"] * wall**2 / (12 * 0.91 * STEEL["density_kg_m3"])
    theory = np.array([13.46819, 19.59614, 24.27020, 34.80089, 34.80089]) / (2 * np.pi * side**2) * stiffness**0.5
    freq_hz, report = solve(make_plate(side), "--wall", wall, "--nodes", 60000, band_hz=(5, 130))
    hold("wall_0_1_mm", calc_distance(freq_hz[:5], theory), 2e-2, f"edges of {report['edge_per_wall']:.0f} walls, against theory")
    hold("wall_0_1_mm", report["straightened_tets"], 0, "elements made straight-sided")


def folds():
    wall = FOLD_WALL_M
    for angle in FOLD_ANGLES_DEG:
        freq_hz, report = solve(make_fold(angle), "--wall", wall, "--edge", 0.003, band_hz=(20, 60000), max_modes=8)
        hold("folds", abs(report["volume_m3"] / (2 * 0.04 * 0.08 * wall) - 1), 1e-9, f"{angle} degrees, volume")
        solid = get_reference(f"fold of {angle} degrees")
        # A sharp inner corner is singular: the sharper, the slower the error falls. The bars have to contain it.
        parts = np.abs(1200 * np.log2(freq_hz / solid)) / report["bars"]
        hold("folds", parts.max(), 1, f"{angle} degrees, distance from the solid over the error bar")
        if angle >= 90:
            hold("folds", calc_distance(freq_hz, solid), 1.5e-2, f"{angle} degrees, against the solid in elements of the volume mesher")
    refuse("folds", make_fold(5), ["cannot be mitred at (", "folded there to 5 degrees", "29 are the least"], "--wall", wall)


def walls_that_touch():
    turn = 4 * math.pi
    spiral = make_grid(
        lambda u, v: ((0.02 + 0.003 * u) * math.cos(turn * u), (0.02 + 0.003 * u) * math.sin(turn * u), 0.04 * v), 96, 6
    )  # 1.5 mm between its turns
    refuse("walls_that_touch", spiral, ["runs into itself at (", "closer there than the wall is thick"], "--wall", 0.002)
    with Folder() as folder:
        made = mesh(folder, spiral, "--wall", 0.001)
        hold("walls_that_touch", made.code, 0, "exit code with a wall that leaves a gap")
    blade = make_grid(lambda u, v: (0.1 * u, 0.047, 0.1 * v - 0.05), 3, 3)
    refuse("walls_that_touch", join(make_plate(0.1), blade), ["runs into itself at ("], "--wall", 0.002)


def walls_that_branch():
    plate = make_grid(lambda u, v: (0.1 * u, 0.1 * v, 0), 4, 4)
    post = make_grid(lambda u, v: (0.1 * u, 0.05, 0.05 * v), 4, 2)
    refuse("walls_that_branch", join(plate, post), ["T-junction", "0.05, 0)", "modeller"], "--wall", 0.002)


def make_tube_with_holes():
    """A tube of 60 x 100 mm with six holes of 8 mm, 4 mm from the rim."""
    turn = 2 * math.pi
    return make_grid(
        lambda u, v: (0.03 * math.cos(turn * u), 0.03 * math.sin(turn * u), 0.1 * v), 48, 24, lambda i, j: j in (1, 2) and i % 8 < 2
    )


def holes_at_a_rim():
    radius, long, wall, turn = 0.03, 0.1, HOLES_WALL_M, 2 * math.pi
    freq_hz, report = solve(make_tube_with_holes(), "--wall", wall, "--edge", 0.005, band_hz=(20, 8000), max_modes=4)
    area = turn * radius * long - 6 * (turn * radius / 24) * (long / 12)
    hold("holes_at_a_rim", abs(report["volume_m3"] / (area * wall) - 1), 2e-3, "volume")
    hold("holes_at_a_rim", calc_distance(freq_hz, get_reference("tube with holes")), 1e-2, "against edges half as long")


if __name__ == "__main__":
    globals()[sys.argv[1]]()
