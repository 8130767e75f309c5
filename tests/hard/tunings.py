#!/usr/bin/env python3
"""Hard cases of `carillon tune`: crossing and degenerate modes, wishes out of reach, thin and fixed bodies. The written mesh is solved
again by numpy (elastic.py).

usage: tunings.py CASE
"""
import json
import sys

import h5py
import numpy as np
import scipy.sparse.linalg
import scipy.spatial

import elastic
from figure import hold, hold_refusal
from programs import STEEL, Folder
from solids import Solid, make_box, to_quadratic

DAMPING = {"damping": {"internal_friction": {"tan_phi": 0.0005}}}
ALUMINIUM = {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700}
PLANK = {
    "body": {"shape": "bar", "length_m": 0.36, "width_m": 0.05, "thickness_m": 0.0132},
    "material": ALUMINIUM | DAMPING,
    "bank": "plank.hdf",
}
RIM = [{"box_m": {"min": [-1e-6, -1, -1], "max": [1e-6, 1, 1]}}]
SAME = 1e-7  # relative difference of a frequency of the bank and of numpy


def tune(folder, job, *words, code=0):
    """The document of a tuning into `out`, or the line of its error."""
    (folder.path / "job.json").write_text(json.dumps(job))
    outcome = folder.run(1, "carillon-tune", "tune", "job.json", *words, "-o", "out", "--json")
    assert outcome.code == code, outcome.text[-1500:]
    assert "NaN" not in outcome.text and "Infinity" not in outcome.text
    return json.JSONDecoder().raw_decode(outcome.text)[0]


def read_mesh(path):
    """The Solid of a Gmsh 2.2 file of ten-node tetrahedra."""
    lines = path.read_text().splitlines()
    first = lines.index("$Nodes") + 2
    nodes = np.array([[float(a) for a in line.split()[1:]] for line in lines[first : lines.index("$EndNodes")]])
    first = lines.index("$Elements") + 2
    rows = [line.split() for line in lines[first : lines.index("$EndElements")]]
    tets = np.array([[int(a) - 1 for a in row[-10:]] for row in rows if row[1] == "11"])
    return Solid(nodes, tets[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]])  # Gmsh has the last two edges the other way round


def solve(solid, material, count, is_held=False):
    """(count) frequencies [Hz] of the lowest elastic modes, ascending, and their shapes (N, 3, count), by numpy."""
    stiffness, mass = elastic.assemble(
        solid, elastic.isotropic(material["young_modulus_pa"], material["poisson_ratio"]), material["density_kg_m3"]
    )
    free = np.repeat(solid.nodes[:, 0] > 1e-9, 3) if is_held else np.ones(stiffness.shape[0], bool)
    rigid = 0 if is_held else 6
    values, vectors = scipy.sparse.linalg.eigsh(stiffness[free][:, free], count + rigid, mass[free][:, free], sigma=-1e6, tol=1e-12)
    order = np.argsort(values)[rigid:]
    shapes = np.zeros((len(free), count))
    shapes[free] = vectors[:, order]
    return np.sqrt(values[order]) / 2 / np.pi, shapes.reshape(-1, 3, count)


def read_hz(folder):
    """Frequencies of the mesh and of the body [Hz] in the bank of a tuning."""
    with h5py.File(folder.path / "out/bank.hdf") as bank:
        return bank["modes/frequency_hz"][:], bank["modes/corrected_frequency_hz"][:]


def hold_mesh(case, folder, material, count, bound=SAME, is_held=False):
    """Frequencies of the bank against numpy's of the mesh next to it; returns these, and the Solid."""
    solid = read_mesh(folder.path / "out/body.msh")
    hz, _ = solve(solid, material, count, is_held)
    hold(case, np.abs(read_hz(folder)[0][:count] / hz - 1).max(), bound, "bank against numpy on the tuned mesh")
    return hz, solid


def torsion_crosses():
    """A vibraphone bar from flat: the first torsion passes the second bending mode. Kinds by numpy's shapes, not by names."""
    with Folder() as folder:
        done = tune(folder, PLANK, "--partials", "1,4,10", "--fundamental", "185", "--wall", "3mm")
        solid = read_mesh(folder.path / "out/body.msh")
        hz, shapes = solve(solid, ALUMINIUM, 8)
        mesh_hz, body_hz = read_hz(folder)
        _, mirror = scipy.spatial.cKDTree(solid.nodes).query(solid.nodes * [1, -1, 1])
        lift, squares = shapes[:, 2], (shapes**2).sum((0, 1))
        is_bending = (lift * lift[mirror]).sum(0) > 0.5 * squares
        bending = hz[is_bending][:3]
        after = [mesh_hz[np.argmin(np.abs(body_hz - mode["after_hz"]))] for mode in done["modes"]]
        hold("torsion_crosses", np.abs(np.array(after) / bending - 1).max(), SAME, "tuned modes against numpy's bending modes")
        hold("torsion_crosses", max(abs(mode["off_cents"]) for mode in done["modes"]), 0.2, "cents off")


def wish_above_flat():
    """A bar that would have to be thicker: nothing is cut, and the bound in the way is named."""
    with Folder() as folder:
        done = tune(folder, PLANK, "--hz", "700", code=5)
        hold_refusal("wish_above_flat", done["obstacle"], ["bending 1", "no material can be added"])
        hold("wish_above_flat", max(done["parameters"].values()), 1e-6, "deepest cut [m]")


def wall_reached():
    """A bar that would have to be thinner than its wall may be."""
    with Folder() as folder:
        done = tune(folder, PLANK, "--hz", "300", "--wall", "11mm", code=5)
        hold_refusal("wall_reached", done["obstacle"], ["bending 1", "the minimum wall is reached"])
        profile = np.loadtxt(folder.path / "out/profile.csv", delimiter=",", skiprows=1)
        hold("wall_reached", 11 - profile[:, 2].min(), 1e-4, "mm less than the wall")
        hold_mesh("wall_reached", folder, ALUMINIUM, 3)


def local_minimum():
    """1 : 2 : 10 at 300 Hz from a flat bar: the search ends, says why, and hands out the best bar."""
    with Folder() as folder:
        done = tune(folder, PLANK, "--partials", "1,2,10", "--fundamental", "300", "--wall", "3mm", code=5)
        hold_refusal("local_minimum", done["obstacle"], ["stays", "cents off"])
        sums = [sum(mode[key] ** 2 for mode in done["modes"]) for key in ("off_cents", "off_before_cents")]
        hold("local_minimum", sums[0] / sums[1], 1, "sum of squares over that of the flat bar")
        hold("local_minimum", done["solves"], 45, "solves")
        hold_mesh("local_minimum", folder, ALUMINIUM, 3, 1e-4)  # quadrature in a groove as deep as wide


def write_bar(folder, cells, size, **keys):
    """The job of a bar with a mesh of its own."""
    to_quadratic(make_box(cells, size)).write(folder.path / "bar.msh")
    return {"mesh": "bar.msh", "material": STEEL | DAMPING, "bank": "bar.hdf", **keys}


def pair_at_rest():
    """The pair of a square bar has no beat: nothing is cut."""
    with Folder() as folder:
        done = tune(folder, write_bar(folder, [16, 4, 4], [0.24, 0.02, 0.02]), "--close-pairs", "1", "--knots", "20")
        hold("pair_at_rest", max(done["parameters"].values()), 0, "deepest cut [m]")
        hold("pair_at_rest", done["solves"], 1, "solves")
        hold("pair_at_rest", abs(done["modes"][0]["off_cents"]), 1e-3, "beat [cents]")


def beat_of_a_bar():
    """A bar 0.1 mm thicker than wide: its beat closed by cuts, and left where they may not be deep enough."""
    with Folder() as folder:
        job = write_bar(folder, [16, 4, 4], [0.24, 0.02, 0.0201])
        tune(folder, job, "--close-pairs", "1", "--knots", "20", "--most", "0.8mm", "--cents", "0.1")
        hz, _ = hold_mesh("beat_of_a_bar", folder, STEEL, 2)
        hold("beat_of_a_bar", 1200 * np.log2(hz[1] / hz[0]), 0.1, "beat left, by numpy [cents]")
        done = tune(folder, job, "--close-pairs", "1", "--knots", "20", "--most", "1um", code=5)
        hold_refusal("beat_of_a_bar", done["obstacle"], ["pair 1 keeps", "first order leaves"], "1 um at most")


def fixed_body():
    """A removal map of a cantilever: the fixed face stays fixed."""
    with Folder() as folder:
        job = write_bar(folder, [16, 4, 2], [0.2, 0.03, 0.01], fixed=RIM)
        flat, _ = solve(to_quadratic(make_box([16, 4, 2], [0.2, 0.03, 0.01])), STEEL, 3, True)
        wish = flat[0] * 2 ** (-20 / 1200)
        done = tune(folder, job, "--map", "--hz", f"{wish:.6f}", "--modes", "mode 1", "--knots", "40")
        _, solid = hold_mesh("fixed_body", folder, STEEL, 3, is_held=True)
        hold("fixed_body", abs(done["modes"][0]["off_cents"]), 0.2, "cents off")
        hold("fixed_body", np.abs(np.sort(solid.nodes[:, 0])[:45]).max(), 1e-12, "m by which fixed nodes leave their plane")


def lower_two(folder, job, by_cents, *words):
    """The map that lowers the two lowest modes by the given cents."""
    (folder.path / "probe.json").write_text(json.dumps(job | {"max_modes": 4}))
    assert folder.run(1, "carillon-precompute", "-q", "probe.json").code == 0
    with h5py.File(folder.path / "bar.hdf") as bank:
        body = np.sort(bank["modes/corrected_frequency_hz"][:])
    wishes = ",".join(f"{hz * 2 ** (-cents / 1200):.6f}" for hz, cents in zip(body, by_cents))
    return tune(folder, job, "--map", "--hz", wishes, "--modes", "mode 1,mode 2", *words)


def sheet_in_one_layer():
    """A plate of 1 mm in one layer, two modes lowered by different cents."""
    with Folder() as folder:
        job = write_bar(folder, [12, 8, 1], [0.2, 0.13, 0.001])
        done = lower_two(folder, job, (30, 10), "--most", "0.2mm", "--wall", "0.6mm")
        hold("sheet_in_one_layer", max(abs(mode["off_cents"]) for mode in done["modes"]), 0.2, "cents off")
        _, solid = hold_mesh("sheet_in_one_layer", folder, STEEL, 4)
        columns = np.unique(np.round(solid.nodes[:, :2], 5), axis=0, return_inverse=True)[1].ravel()
        thick = np.array([np.ptp(solid.nodes[columns == k, 2]) for k in range(columns.max() + 1)])
        hold("sheet_in_one_layer", (1e-3 - thick[thick > 1e-5].min()) / 4e-4, 1, "deepest cut over what may go")


def pair_to_split():
    """The exactly equal modes of a square bar are to lie 8 cents apart."""
    with Folder() as folder:
        job = write_bar(folder, [16, 4, 4], [0.24, 0.02, 0.02])
        done = lower_two(folder, job, (10, 2), "--knots", "20")
        hold("pair_to_split", max(abs(mode["off_cents"]) for mode in done["modes"]), 0.2, "cents off")
        hz, _ = hold_mesh("pair_to_split", folder, STEEL, 2)
        hold("pair_to_split", abs(1200 * np.log2(hz[1] / hz[0]) - 8), 0.4, "cents between them less 8, by numpy")


def impossible_wishes():
    """Two wishes for one mode, a kind that the body has not, and a mode above all that are solved."""
    with Folder() as folder:
        for words, words_of_error, part in (
            (["--hz", "500,501", "--modes", "bending 1,bending 1"], ["two wishes mean one mode", "--modes"], "one mode twice"),
            (["--hz", "500", "--modes", "n=7"], ["n=7", "not among the lowest", "bending"], "a kind that is not there"),
            (["--hz", "500", "--wall", "20mm"], ["--wall", "13.2 mm"], "a wall thicker than the body"),
        ):
            done = tune(folder, PLANK, *words, code=2)
            hold_refusal("impossible_wishes", done["error"], words_of_error, part)


CASES = [
    torsion_crosses,
    wish_above_flat,
    wall_reached,
    local_minimum,
    pair_at_rest,
    beat_of_a_bar,
    fixed_body,
    sheet_in_one_layer,
    pair_to_split,
    impossible_wishes,
]

if __name__ == "__main__":
    {case.__name__: case for case in CASES}[sys.argv[1]]()
