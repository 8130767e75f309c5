#!/usr/bin/env python3
"""Hard meshes: bad elements, broken topology, extreme sizes. Every case ends with the right frequencies within a bound, or in a clear
refusal.

usage: meshes.py CASE
The truth is elastic.py (an assembly of its own, LAPACK and ARPACK) on the same mesh or on the sound one, or theory where it is named.
"""
import json
import pathlib
import sys

import numpy as np

import elastic
from figure import hold, hold_refusal
from programs import STEEL, Folder, calc_distance, refuse, solve
from solids import (
    Solid,
    burst,
    find_apart_edges,
    join,
    make_box,
    make_caps,
    make_lattice,
    make_needles,
    make_slivers,
    merge,
    of_order,
    to_quadratic,
)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "bench/mesher"))
import surfaces  # noqa: E402

C = elastic.isotropic(STEEL["young_modulus_pa"], STEEL["poisson_ratio"])
BAR = [0.1, 0.02, 0.01]
X_MIN = {"box_m": {"min": [-1e-9, -1, -1], "max": [1e-9, 1, 1]}}
VARIANTS = [
    ("T4", "consistent", 1, {}),
    ("T10", "consistent", 2, {}),
    ("T10", "lumped", 3, {}),
    ("T4", "lumped", 1, {"fixed": X_MIN}),
    ("T10", "consistent", 1, {"fixed": X_MIN, "solver": {"method": "krylov-schur"}}),
    ("T10", "consistent", 1, {"solver": {"method": "dense"}}),
]


def find_truth(solid, element, mass, count, zeros=6, held=None, high_hz=20000):
    body = of_order(solid, 1 if element == "T4" else 2)
    k, m = elastic.assemble(body, C, STEEL["density_kg_m3"], mass == "lumped")
    fixed = np.flatnonzero(body.nodes[:, 0] <= 1e-9) if held else ()
    zeros = 0 if held else zeros
    return elastic.find_frequencies(k, m, count + zeros, high_hz, fixed)[zeros:]


def hold_variants(case, solid, bound, truth=None, zeros=6, variants=None, band_hz=(20, 20000), tag=""):
    """Every variant of element, mass, ranks and method against the truth of `truth` (the body itself)."""
    for element, mass, ranks, keys in variants or VARIANTS:
        outcome = solve(solid, element, ranks=ranks, mass=mass, band_hz=band_hz, **keys)
        expected = find_truth(truth or solid, element, mass, len(outcome.freq_hz), zeros, "fixed" in keys, band_hz[1])
        method = keys.get("solver", {}).get("method", "")
        hold(
            case,
            calc_distance(outcome.freq_hz, expected),
            bound,
            " ".join(filter(None, [tag, element, mass, "held" if "fixed" in keys else "", method])),
            ranks,
        )


def slivers():
    for angle, planes in ((0.1, [8]), (0.01, [3, 6, 9, 12, 15])):  # 1 % and 5 % of the elements
        body = make_slivers([16, 2, 1], BAR, angle, planes)
        assert abs(body.find_dihedrals().min() / angle - 1) < 1e-3
        hold_variants("slivers", body, 1e-8, tag=f"{angle} degrees", variants=VARIANTS if angle == 0.1 else VARIANTS[:3])
    # And the body is what it was: quadratic elements hardly notice.
    clean, with_slivers = solve(make_box([16, 2, 1], BAR), "T10"), solve(make_slivers([16, 2, 1], BAR, 0.1, [8]), "T10")
    hold("slivers", calc_distance(with_slivers.freq_hz[:2], clean.freq_hz[:2]), 5e-3, "against a mesh without")
    hold_refusal("slivers", with_slivers.text, ["warning", "sliver", "0.1"])


def caps():
    box = make_box([8, 2, 1], BAR)
    for height, bound in ((1e-2, 1e-9), (1e-5, 1e-7)):
        hold_variants("caps", make_caps(box, [5, 50, 70], height), bound, tag=f"height {height:g}", variants=VARIANTS[:4])
    hold(
        "caps",
        calc_distance(solve(make_caps(box, [5, 50, 70], 1e-5), "T10").freq_hz[:3], solve(box, "T10").freq_hz[:3]),
        1e-4,
        "against a mesh without",
    )


def needles():
    box = make_box([8, 2, 1], BAR)
    edges = find_apart_edges(box, 3)
    for part, bound in ((1e-2, 1e-9), (1e-5, 1e-7)):
        hold_variants("needles", make_needles(box, edges, part), bound, tag=f"edge {part:g}", variants=VARIANTS[:4])


def graded_sizes():
    steps = np.concatenate([[0], np.cumsum(1000 ** (np.arange(9) / 8))])
    steps /= steps[-1]
    hold_variants(
        "graded_sizes",
        make_lattice(0.1 * steps, 0.02 * np.array([0, 0.5, 1]), [0, 0.01]),
        1e-8,
        tag="along",
        variants=VARIANTS[:4],
        band_hz=(20, 60000),
    )
    few = steps[[0, 2, 4, 6, 9]]
    hold_variants(
        "graded_sizes", make_lattice(0.1 * few, 0.02 * few, 0.01 * few), 1e-8, tag="to a corner", variants=VARIANTS[:3], band_hz=(20, 60000)
    )


def duplicate_nodes():
    box = make_box([8, 2, 1], BAR)
    hold_variants("duplicate_nodes", burst(box), 1e-10, truth=box, tag="every element apart", variants=VARIANTS[:4])
    hold_variants("duplicate_nodes", burst(to_quadratic(box)), 1e-10, truth=box, tag="ten nodes each", variants=VARIANTS[1:2])
    single = burst(box)
    single.nodes = single.nodes.astype(np.float32).astype(float) + np.random.default_rng(1).uniform(-1e-8, 1e-8, single.nodes.shape)
    hold_variants("duplicate_nodes", single, 1e-4, truth=box, tag="single precision", variants=VARIANTS[:2])


def shared_point():
    two = merge(join(make_box([2, 2, 2], [0.02] * 3), make_box([2, 2, 2], [0.02] * 3, (0.02, 0.02, 0.02))))
    hold_variants("shared_point", two, 1e-9, zeros=9, band_hz=(20, 60000), variants=[v for v in VARIANTS if not v[3]])
    hold_refusal("shared_point", solve(two, "T10").text, ["warning", "point", "3 motions without stiffness"])


def non_manifold_edge():
    two = merge(join(make_box([2, 2, 2], [0.02] * 3), make_box([2, 2, 2], [0.02] * 3, (0.02, 0.02, 0))))
    for element, ranks in (("T4", 1), ("T10", 3)):
        hold_refusal("non_manifold_edge", refuse(two, element, ranks=ranks), ["mesh.msh", "edge", "nodes", "thicken"], element, ranks)


def inverted_elements():
    box = make_box([8, 2, 1], BAR)
    some = box.copy()
    some.tets[::7] = some.tets[::7][:, [0, 2, 1, 3]]
    hold_variants("inverted_elements", some, 1e-10, truth=box, tag="numbered inside out", variants=VARIANTS[:4])
    hold_refusal("inverted_elements", solve(some, "T4").text, ["warning", "inside out"], "numbered inside out")
    tangled = make_box([4, 4, 4], [0.04] * 3)
    tangled.nodes[np.argmin(np.abs(tangled.nodes - 0.02).sum(1))] += [0.013, 0.003, 0.001]
    for ranks in (1, 2):
        hold_refusal(
            "inverted_elements",
            refuse(tangled, "T10", ranks=ranks),
            ["mesh.msh", "elements", "inverted", "mesh the body again"],
            "tangled",
            ranks,
        )


def zero_volume():
    box = make_box([8, 2, 1], BAR)
    flat = Solid(np.vstack([box.nodes, box.nodes[box.tets[0][:3]].mean(0)]), np.vstack([box.tets, [[*box.tets[0][:3], len(box.nodes)]]]))
    for element, ranks in (("T4", 2), ("T10", 1)):
        hold_refusal(
            "zero_volume", refuse(flat, element, ranks=ranks), ["mesh.msh", "1 element without volume", "97", "remove it"], element, ranks
        )
    twice = box.copy()
    twice.tets[3, 2] = twice.tets[3, 1]
    hold_refusal("zero_volume", refuse(twice, "T4"), ["mesh.msh", "repeated node", "4"], "a repeated node")


def lone_node():
    box = make_box([8, 2, 1], BAR)
    more = box.copy()
    more.nodes = np.vstack([[[5, 5, 5]], more.nodes, [[-3, 0, 0]]])
    more.tets = more.tets + 1
    hold_variants("lone_node", more, 1e-10, truth=box, variants=VARIANTS[:4])
    hold_refusal("lone_node", solve(more, "T4").text, ["warning", "2 nodes", "no element"])


def one_element():
    one = Solid([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], [[0, 1, 2, 3]])
    for element, count in (("T4", 6), ("T10", 24)):
        for mass in ("consistent", "lumped"):
            outcome = solve(one, element, mass=mass, band_hz=(20, 1e6))
            assert len(outcome.freq_hz) == count
            hold("one_element", calc_distance(outcome.freq_hz, find_truth(one, element, mass, count)), 1e-11, f"{element} {mass}")
    hold_refusal("one_element", refuse(one, "T4", ranks=2), ["mesh.msh", "1 tetrahedr", "2 ranks", "at most 1"], "two ranks", 2)


def two_components():
    two = join(make_box([4, 2, 1], BAR), make_box([4, 2, 1], [0.08, 0.02, 0.012], (0, 0.1, 0)))
    hold_variants("two_components", two, 1e-9, zeros=12, variants=[v for v in VARIANTS if "fixed" not in v[3]], band_hz=(20, 40000))
    outcome = solve(two, "T10")
    hold("two_components", abs(outcome.bank["proof/rigid_per_component"] - [6, 6]).max(), 0, "rigid motions of each against six")


def fifty_components():
    many = join(*[make_box([2, 1, 1], [0.1 * (1 + 0.002 * i), 0.02, 0.01], (0, 0.1 * i, 0)) for i in range(50)])
    for ranks in (1, 3):
        outcome = solve(many, "T10", ranks=ranks, band_hz=(20, 8000))
        truth = np.sort(
            np.concatenate(
                [find_truth(make_box([2, 1, 1], [0.1 * (1 + 0.002 * i), 0.02, 0.01]), "T10", "consistent", 4) for i in range(50)]
            )
        )
        hold("fifty_components", calc_distance(outcome.freq_hz, truth[truth <= 8000]), 1e-9, "T10", ranks)
        hold("fifty_components", abs(outcome.bank["proof/rigid_per_component"] - 6).max(), 0, "rigid motions of each against six", ranks)


def one_element_walls():
    # Free steel plate 200 x 200 x 5 mm, one element thick: 404.797, 594.1203, 735.4314 Hz (Legendre-Ritz in three dimensions, 8e-6).
    outcome = solve(make_box([12, 12, 1], [0.2, 0.2, 0.005]), "T10", ranks=2, band_hz=(20, 1000))
    hold("one_element_walls", calc_distance(outcome.freq_hz[:3], [404.797, 594.1203, 735.4314]), 1.5e-2, "T10", 2)
    # T4 lock; what the bank then says of its own error has to cover it.
    coarse = solve(make_box([12, 12, 1], [0.2, 0.2, 0.005]), "T4", band_hz=(20, 6000))
    error = 1200 * np.log2(coarse.freq_hz[0] / 404.797)
    hold("one_element_walls", error / coarse.bank["modes/discretisation_error_cents"][0], 10, "T4, true error over the estimate")


def count_stiffless(outcome):
    return sum("without stiffness" in line for line in outcome.warnings())


def wire():
    # Euler and Bernoulli: f = beta^2 d / (2 pi L^2 sqrt 12) sqrt(E / rho), beta = (n + 1/2) pi; shear and inertia are 1e-5 of it here.
    length, side = 1.0, 1e-4
    speed = (STEEL["young_modulus_pa"] / STEEL["density_kg_m3"]) ** 0.5
    theory = np.repeat([((n + 0.5) * np.pi) ** 2 * speed * side / (2 * np.pi * 12**0.5 * length**2) for n in range(1, 21)], 2)
    for cells, bound in ((50, 4e-2), (200, 3e-3)):
        outcome = solve(make_box([cells, 1, 1], [length, side, side]), "T10", ranks=2 if cells == 50 else 1, max_modes=4)
        hold("wire", calc_distance(outcome.freq_hz, theory[16:20]), bound, f"{cells} cells against theory")
        hold("wire", count_stiffless(outcome), 0, f"{cells} cells, slow modes taken for parts without stiffness")
        hold("wire", outcome.bank["modes/residual"].max(), 1e-5, f"{cells} cells, residual")
    # 0.1 Hz is lost in rounding: the band begins where it is not, a warning says so, and the modes are right from there.
    outcome = solve(make_box([200, 1, 1], [length, side, side]), "T10", band_hz=(0.1, 97))
    hold_refusal("wire", outcome.text, ["warning", "the band begins at", "cannot be resolved in double precision"], "a band from 0.1 Hz")
    begin_hz = outcome.bank["solve/band_hz"][0]
    hold("wire", begin_hz, 2.5, "where a band from 0.1 Hz begins [Hz]")
    hold("wire", calc_distance(outcome.freq_hz, theory[theory > begin_hz]), 1e-2, "a band from 0.1 Hz against theory")


def plate():
    # Kirchhoff, nu 0.3: lambda^2 = 13.46819, 19.59614, 24.27020, 34.80089 twice.
    side, thick = 0.2, 0.0002
    stiffness = STEEL["young_modulus_pa"] * thick**2 / (12 * 0.91 * STEEL["density_kg_m3"])
    theory = np.array([13.46819, 19.59614, 24.27020, 34.80089, 34.80089]) / (2 * np.pi * side**2) * stiffness**0.5
    outcome = solve(make_box([16, 16, 1], [side, side, thick]), "T10", band_hz=(5, 60))
    hold("plate", calc_distance(outcome.freq_hz[:5], theory), 2e-2, "T10 against theory")
    hold("plate", outcome.bank["modes/residual"].max(), 1e-5, "residual")


def hold_size(case, side):
    for element, mass, ranks, keys in VARIANTS[1:3]:
        base = solve(make_box([3, 3, 3], [0.05] * 3), element, mass=mass, band_hz=(1e3, 60e3))
        outcome = solve(make_box([3, 3, 3], [side] * 3), element, mass=mass, ranks=ranks, band_hz=(0.05 / side * 1e3, 0.05 / side * 60e3))
        hold(case, calc_distance(outcome.freq_hz * side, base.freq_hz * 0.05), 1e-9, f"{element} {mass}: frequency times size", ranks)


def body_1_mm():
    hold_size("body_1_mm", 1e-3)
    hold_refusal("body_1_mm", solve(make_box([3, 3, 3], [1e-3] * 3), "T10").text, ["warning", "no mode in the band"])


def body_100_m():
    hold_size("body_100_m", 100.0)
    hold_refusal("body_100_m", solve(make_box([3, 3, 3], [100.0] * 3), "T4").text, ["warning", "173", "millimetres", "below the band"])


def millimetres_as_metres():
    for ranks, size, high_hz in ((1, [100, 20, 10], 200), (2, [300, 40, 15], 200), (1, [300, 200, 2], 25)):
        outcome = solve(make_box([4, 2, 1], size), "T10", ranks=ranks, band_hz=(20, high_hz))
        hold(
            "millimetres_as_metres",
            count_stiffless(outcome),
            0,
            f"{size[0]} x {size[2]} mm, slow modes taken for parts without stiffness",
            ranks,
        )
        hold_refusal(
            "millimetres_as_metres", outcome.text, ["warning", "fundamental", "below the band", "millimetres"], f"{size[0]} mm", ranks
        )


def far_from_origin():
    near = make_box([8, 2, 1], BAR)
    for place, bound in (((1e6, -1e6, 1e6), 1e-8), ((1e3, 0, 0), 1e-10)):
        far = make_box([8, 2, 1], BAR, place)
        hold_variants("far_from_origin", far, bound, truth=near, tag=f"{place[0]:g} m", variants=VARIANTS[:3])
        a, b = (solve(body, "T10").bank for body in (near, far))
        hold(
            "far_from_origin",
            np.abs(
                b["rigid/inertia_kg_m2"] / np.abs(a["rigid/inertia_kg_m2"]).max()
                - a["rigid/inertia_kg_m2"] / np.abs(a["rigid/inertia_kg_m2"]).max()
            ).max(),
            100 * bound,
            f"{place[0]:g} m: inertia",
        )
        hold("far_from_origin", np.abs(b["modes/radiation_gain"] / a["modes/radiation_gain"] - 1).max(), 1e-6, f"{place[0]:g} m: radiation")
        hold(
            "far_from_origin",
            np.abs(b["mesh/vertices"] - (a["mesh/vertices"] + place)).max(),
            2 * np.spacing(place[0]),
            f"{place[0]:g} m: vertices stay where they were [m]",
        )
    hold_refusal(
        "far_from_origin", solve(make_box([8, 2, 1], BAR, (1e10, 0, 0)), "T4").text, ["warning", "from the origin", "rounded"], "1e10 m"
    )


def mesh_surface(folder, points, triangles, *options):
    """The mesher's report of a surface; the mesh is mesh.msh in the folder."""
    surfaces.write_obj(folder.path / "body.obj", points, triangles)
    outcome = folder.run(1, "carillon-mesh", "body.obj", "-o", "mesh.msh", "--json", "report.json", "-q", *options)
    assert outcome.code == 0, outcome.text
    return json.loads((folder.path / "report.json").read_text()), outcome.text


def make_ball(radius, times):
    """An octahedron's faces divided, the points on the sphere."""
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    triangles = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(times):
        points, triangles = surfaces.divide(points, triangles)
        points /= np.linalg.norm(points, axis=1)[:, None]
    return radius * points, triangles


def noisy_scan():
    # A steel ball, R = 50 mm, ten modes.
    ball = make_ball(0.05, 5)
    truth = None
    for roughness, bound in ((0.0, 0), (0.2, 0.005), (0.35, 0.01)):
        scan = surfaces.roughen(*ball, roughness, holes=30 if roughness else 0)
        with Folder() as folder:
            report, text = mesh_surface(folder, *scan, "--nodes", 9000, "--order", 2)
            outcome = folder.solve(None, "T10", band_hz=(20, 60000), max_modes=10)
            assert outcome.code == 0, outcome.text
        if truth is None:
            truth = outcome.freq_hz
            continue
        tag = f"noise of {roughness} edges"
        hold("noisy_scan", calc_distance(outcome.freq_hz, truth), bound, f"{tag}, against the surface without")
        hold("noisy_scan", 9 - report["min_dihedral_deg"], 0, f"{tag}, degrees that the worst angle lacks of 9")
        hold_refusal("noisy_scan", text, ["scan", "smoothed", "--facets"], tag)


def narrow_rims():
    points, triangles = surfaces.make_pot()
    for nodes in (8000, 15000):
        with Folder() as folder:
            report, _ = mesh_surface(folder, points, triangles, "--nodes", nodes, "--facets")
        volume = np.einsum("ij,ij->i", points[triangles[:, 0]], np.cross(points[triangles[:, 1]], points[triangles[:, 2]])).sum() / 6
        hold("narrow_rims", abs(report["nodes"] / nodes - 1), 0.1, f"{nodes} nodes, how far off the count")
        hold("narrow_rims", abs(report["volume_m3"] / volume - 1), 0.015, f"{nodes} nodes, volume")


def thin_tip():
    # A cone of 20 degrees whose tip is a ball of 0.5 mm; elements of 4 mm.
    half = np.radians(10)
    tip = [[0.0005 * np.cos(a), 0.15 + 0.0005 * np.sin(a)] for a in np.linspace(half, np.pi / 2, 6)]
    foot = tip[0][0] + (tip[0][1]) * np.tan(half)
    points, triangles = surfaces.make_lathe([[0, 0], [foot, 0], *tip[:-1], [0, tip[-1][1]]], 48)
    height = points[:, 1].max()
    for words in ([], ["--method", "stuffing"]):
        with Folder() as folder:
            report, text = mesh_surface(folder, points, triangles, "--nodes", 3000, *words)
        lost = 1 - (report["box_high_m"][1] - report["box_low_m"][1]) / height
        if words:
            hold_refusal("thin_tip", text, ["three cells", "error bars"], "stuffing")
        else:
            hold("thin_tip", lost, 0.01, "part of the height that the default mesh lacks")


if __name__ == "__main__":
    globals()[sys.argv[1]]()
