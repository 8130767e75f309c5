#!/usr/bin/env python3
"""Hard cases of `carillon sensitivity`: densities of a bank against solves of the cut body by numpy (elastic.py), closed forms, and the law
of similarity; the table against what it must refuse.

usage: cuts.py CASE
"""
import json
import sys

import numpy as np

import elastic
from figure import hold, hold_refusal
from programs import SPRUCE, STEEL, Folder
from solids import Solid, make_box, make_lattice, to_quadratic

CENTS = 600 / np.log(2)  # of a change of ln lambda


def find_elasticity(material):
    wood = material.get("orthotropic")
    if wood:
        return elastic.orthotropic(wood["young_modulus_pa"], wood["shear_modulus_pa"], wood["poisson_ratio"])
    return elastic.isotropic(material["young_modulus_pa"], material["poisson_ratio"])


class Map:
    """The group `sensitivity` of a bank, as docs/bank-format.md has it."""

    def __init__(self, bank):
        def get(key):
            return bank[f"sensitivity/{key}"]

        self.pairs, self.density = get("modes"), get("density") * get("scale")  # (C, 2), (S, C) cents per mm and m^2
        self.place, self.normal = bank["mesh/vertices"][get("vertex")], get("normal").astype(float)
        self.area, self.doubtful = get("area_m2").astype(float), get("doubtful") != 0
        self.count = len(get("by_parameter"))
        self.cents = 1200 * np.log2(bank["modes/frequency_hz"][: self.count])

    def calc_entries(self, depth_m):
        """(C) cents of a cut (S)."""
        return 1e3 * self.density.T @ (self.area * depth_m)

    def calc_after(self, depth_m):
        """(n) cents of the modes after the cut, ascending: eigenvalues of the whole matrix."""
        matrix = np.diag(self.cents)
        for (i, j), entry in zip(self.pairs, self.calc_entries(depth_m)):
            matrix[i, j] += entry
            matrix[j, i] = matrix[i, j]
        return np.linalg.eigvalsh(matrix)


def find_cents(solid, material, count, is_held=False):
    """(count) cents of the lowest elastic modes, by numpy; held at x = 0."""
    rigid = 0 if is_held else 6
    held = np.flatnonzero(to_quadratic(solid).nodes[:, 0] < 1e-9) if is_held else ()
    matrices = elastic.assemble(to_quadratic(solid), find_elasticity(material), material["density_kg_m3"])
    return 1200 * np.log2(elastic.find_frequencies(*matrices, count + rigid, 2e4, held)[rigid:])


def solve(solid, material=STEEL, count=10, **keys):
    """The Map of a body of ten-node elements, and its Outcome."""
    with Folder() as folder:
        outcome = folder.solve(
            to_quadratic(solid), "T10", material=material, band_hz=(1, 5e8), max_modes=count, sensitivities=count, shapes="exact", **keys
        )
        assert outcome.code == 0, outcome.text[-1500:]
        return Map(outcome.bank), outcome


def cut_top(solid, depth):
    """The box (from z = 0 to its top) with its top lower by depth(x, y), nodes below in proportion."""
    moved = solid.nodes.copy()
    height = moved[:, 2].max()
    moved[:, 2] *= 1 - depth(moved[:, 0], moved[:, 1]) / height
    return Solid(moved, solid.tets)


def find_top(found, depth):
    """(S) the same cut at the sites."""
    is_top = found.normal[:, 2] > 0.9
    return np.where(is_top, depth(found.place[:, 0], found.place[:, 1]), 0)


def calc_error(found, after, before):
    """(n) errors of changes, relative to the largest."""
    return np.abs(found - after) / np.abs(after - before).max()


def hold_cut(case, solid, depth, bound, part="", material=STEEL, count=9, is_held=False, **keys):
    """A cut of the top against numpy's solves of both bodies. The last mode is not one of a pair."""
    found, _ = solve(solid, material, count, **keys)
    after = find_cents(cut_top(solid, depth), material, count, is_held)
    before = find_cents(solid, material, count, is_held)
    hold(case, calc_error(found.calc_after(find_top(found, depth)), after, before).max(), bound, part)
    return found, after, before


def exact_pair():
    """The pairs of a square bar, cut aslant: both modes of each, by the eigenvalues of their matrix."""
    bar, width = make_box([16, 4, 4], [0.24, 0.02, 0.02]), 0.02
    found, _, before = hold_cut("exact_pair", bar, lambda x, y: 2e-5 * (1 + 0.5 * x / 0.24) * y / width, 0.03, "changes")
    pairs = [(int(i), int(j)) for i, j in found.pairs if i < j]
    assert pairs, "no pair has an off-diagonal column"
    split = [before[j] - before[i] for i, j in pairs]
    hold("exact_pair", max(split), 1e-4, "cents between the modes of a pair before the cut, by numpy")


def modes_that_cross():
    """Bending along y and along z 8 cents apart, which a cut turns round."""
    bar = make_box([16, 4, 4], [0.24, 0.02, 0.0201])
    found, after, _ = hold_cut("modes_that_cross", bar, lambda x, y: 0 * x + 2e-4, 0.03, "sorted changes", count=8)
    # The lower one lies across the thinner side: y before, z after. First order moves z alone.
    entries = found.calc_entries(find_top(found, lambda x, y: 0 * x + 2e-4))
    is_across_z = entries[:2] < -10
    hold("modes_that_cross", 0 if list(is_across_z) == [False, True] else 1, 0, "modes whose change is not that of their direction")
    crossed = found.cents[:2] + entries[:2]
    hold("modes_that_cross", np.abs(np.sort(crossed) - after[:2]).max() / np.abs(entries[1]), 0.03, "each by itself, sorted")


def fixed_rim():
    """A cantilever, thinner towards its free end: Euler and Bernoulli's bending, numpy's other modes; what is near the rim is doubtful."""
    length, height = 0.24, 0.008
    bar = make_box([24, 3, 2], [length, 0.012, height])
    depth = lambda x, y: 4e-5 * np.maximum(x / length - 0.25, 0)
    rim = [{"box_m": {"min": [-1e-6, -1, -1], "max": [1e-6, 1, 1]}}]
    found, _, _ = hold_cut("fixed_rim", bar, depth, 0.05, "against numpy", count=6, is_held=True, fixed=rim)
    # Mode 1 bends along z (the thinner side).
    x = np.linspace(0, 1, 20001)
    root = 1.8751040687119611
    ratio = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))
    w = np.cosh(root * x) - np.cos(root * x) - ratio * (np.sinh(root * x) - np.sin(root * x))
    bend = np.cosh(root * x) + np.cos(root * x) - ratio * (np.sinh(root * x) + np.sin(root * x))
    share = depth(length * x, 0) / height
    change = -CENTS * (np.trapz(3 * share * bend**2, x) / np.trapz(bend**2, x) - np.trapz(share * w**2, x) / np.trapz(w**2, x))
    first = found.calc_entries(find_top(found, depth))[0]
    hold("fixed_rim", abs(first / change - 1), 0.03, "first mode against Euler and Bernoulli")
    near = found.place[:, 0] < 0.011
    hold("fixed_rim", np.count_nonzero(near & ~found.doubtful), 0, "sites within an element of the rim that are not doubtful")
    hold("fixed_rim", np.mean(found.doubtful), 0.2, "share of the surface that is doubtful")


def hold_similarity(case, solid, bound, part, material=STEEL, **keys):
    """A body that is enlarged by d ln size has frequencies lower by as much, whatever its shape and material."""
    found, _ = solve(solid, material, **keys)
    outward = np.einsum("sx,sx->s", found.normal, found.place - found.place.mean(axis=0))
    change = found.calc_entries(-outward)[: found.count] / 2 / CENTS
    hold(case, np.abs(change + 1).max(), bound, part)
    return found


def incompressible_skin():
    """Where the volume hardly yields, the strain across the surface follows from those within it."""
    block = make_box([8, 6, 4], [0.08, 0.05, 0.03])
    for nu, bound in ((0.45, 0.05), (0.49, 0.05), (0.499, 0.05)):
        hold_similarity("incompressible_skin", block, bound, f"nu {nu:g}", STEEL | {"poisson_ratio": nu})


def thin_sheet():
    """A plate 500 times as long as thick, in one layer: bending is proportional to the thickness (Kirchhoff)."""
    height = 0.0006
    sheet = make_box([20, 12, 1], [0.3, 0.18, height])
    found, _ = solve(sheet, count=8)
    sides = np.where(np.abs(found.normal[:, 2]) > 0.9, 1e-3 * height / 2, 0)
    hold(
        "thin_sheet",
        np.abs(found.calc_entries(sides)[: found.count] / (-2 * CENTS * 1e-3) - 1).max(),
        0.03,
        "d ln f / d ln thickness less 1",
    )


def one_element_across():
    """A bar with one element across, tapered."""
    bar = make_box([24, 1, 1], [0.3, 0.014, 0.01])
    hold_cut("one_element_across", bar, lambda x, y: 3e-5 * (0.3 + 0.7 * x / 0.3), 0.2, count=8)


def coarse_wood():
    """Spruce, two elements across, E along the grain 23 times that across."""
    bar = make_box([16, 2, 2], [0.24, 0.03, 0.016])
    hold_cut("coarse_wood", bar, lambda x, y: 5e-5 * (1 - 0.5 * x / 0.24), 0.1, material=SPRUCE, count=8)


def inward_edge():
    """A step in a bar: the sites next to its inward edge are doubtful, a cut away from it is right."""
    x = np.linspace(0, 0.24, 25)
    bar = make_lattice(x, np.linspace(0, 0.02, 4), np.linspace(0, 0.016, 5))
    middle = bar.corners().mean(1)
    step = Solid(bar.nodes, bar.tets[~((middle[:, 0] > 0.12) & (middle[:, 2] > 0.008))])
    used, tets = np.unique(step.tets, return_inverse=True)
    step = Solid(step.nodes[used], tets.reshape(-1, 4))
    # On the top of the thick half: none at the step, most at the end.
    depth = lambda x, y: 1e-4 * np.maximum(0.09 - x, 0) / 0.09
    found, _ = solve(step, count=8)
    moved = step.nodes.copy()
    moved[:, 2] *= 1 - depth(moved[:, 0], 0) / 0.016
    after, before = (find_cents(solid, STEEL, 8) for solid in (Solid(moved, step.tets), step))
    top = np.where((found.normal[:, 2] > 0.9) & (found.place[:, 2] > 0.0159), depth(found.place[:, 0], 0), 0)
    hold("inward_edge", calc_error(found.calc_after(top), after, before).max(), 0.03, "away from the edge")
    away = np.maximum(np.abs(found.place[:, 0] - 0.12) / 0.01, np.abs(found.place[:, 2] - 0.008) / 0.004)
    hold("inward_edge", np.count_nonzero((away < 1.99) & ~found.doubtful), 0, "sites within two elements that are not doubtful")
    hold("inward_edge", away[found.doubtful].max(), 3, "elements to the farthest doubtful site")


def small_and_far():
    """A body of a millimetre, and one a hundred lengths from the origin: the same shape, the same cents per cut of the same share."""
    shape = [1.0, 0.3, 0.2]
    reference, _ = solve(make_box([8, 3, 2], shape))
    for part, size, origin in (("1 mm", 1e-3, 0.0), ("100 lengths away", 1.0, 100.0), ("1 mm, 100 lengths away", 1e-3, 0.1)):
        found, _ = solve(make_box([8, 3, 2], [size * a for a in shape], [origin] * 3))
        density = found.density * size**3
        error = np.abs(density - reference.density).max(axis=0) / np.abs(reference.density).max(axis=0)
        hold("small_and_far", error[: found.count].max(), 1e-3, part)


def through_the_wall():
    """Cuts as deep as the wall, and deep ones, of a bar and of a thin sheet."""
    bar = {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.008, "nodes": 1500}
    job = {"body": bar, "material": "steel", "max_modes": 6, "sensitivities": 6, "bank": "bar.hdf"}
    spot = ["--at", "0,0,0.004", "--radius", "15mm"]
    with Folder() as folder:
        (folder.path / "job.json").write_text(json.dumps(job))
        assert folder.run(1, "carillon-precompute", "-q", "job.json").code == 0
        for words, part in (([*spot, "--cut", "8mm"], "a spot"), (["--cut", "4mm"], "both sides")):
            outcome = folder.run(1, "carillon-tune", "sensitivity", "bar.hdf", *words)
            assert outcome.code == 2 and outcome.text.count("\n") == 1, outcome.text
            hold_refusal("through_the_wall", outcome.text, ["--cut", "no wall is left", "8 mm thick", "give at most 0."], part)
        for words, warned in (([*spot, "--cut", "0.5mm"], True), ([*spot, "--cut", "0.3mm"], False), (["--cut", "0.1mm"], False)):
            outcome = folder.run(1, "carillon-tune", "sensitivity", "bar.hdf", *words)
            assert outcome.code == 0, outcome.text
            hold(
                "through_the_wall", ("of the wall is cut" in outcome.text) != warned, 0, f"{' '.join(words[-2:])}: warnings too many or few"
            )


CASES = [
    exact_pair,
    modes_that_cross,
    fixed_rim,
    incompressible_skin,
    thin_sheet,
    one_element_across,
    coarse_wood,
    inward_edge,
    small_and_far,
    through_the_wall,
]

if __name__ == "__main__":
    {case.__name__: case for case in CASES}[sys.argv[1]]()
