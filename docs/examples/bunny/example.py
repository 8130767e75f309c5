"""OSG02's bunny of two materials: a solve for the ceramic one, scaling of its bank for the metal one."""
import math
import sys

import h5py
import numpy

import measure
import stage as tools

SURFACE = "/usr/share/glmark2/models/bunny.obj"  # the Stanford bunny of Debian's glmark2-data
STIFFER = 12.5  # 4.98e10 and 2.56e10 Pa in place of 3.99e9 and 2.05e9; the density is the same
# OSG02 Table 1: base frequency and decay as printed, decay by the row's alphas at the frequency of its stiffness; the alphas.
PAPER = {"ceramic": (855.9, 19.5, 19.5, 1e-6, 10.0), "metal": (855.9, 19.5, 18.1, 1e-7, 0.0)}


def read_eigenvalues(file):
    with h5py.File(file) as bank:
        return bank["modes/eigenvalue"][:]


def play(stage):
    if not tools.pathlib.Path(SURFACE).is_file():
        sys.exit(f"{SURFACE}: the bunny is not there; install Debian's glmark2-data")
    nodes = 4000 if stage.quick else 37000
    shell = ("--height", 0.13, "--wall", 0.005, "--nodes", nodes)
    stage.run("the bunny's mesh", stage.bin / "carillon-mesh", "-q", SURFACE, *shell, "-o", "bunny.msh")
    quick = {"band_hz": [20, 6000]}
    stage.solve("ceramic.json", "ceramic", quick=quick)
    alpha1, alpha2 = PAPER["metal"][3:]
    edit = ("--stiffness", STIFFER, "--alphas", alpha1, alpha2)
    stage.run("the edit", stage.bin / "carillon-bank", "edit", "ceramic.hdf", "metal.hdf", *edit)
    unit, edited = (read_eigenvalues(stage.out / f"{name}.hdf") for name in PAPER)
    stage.expect("the edit multiplies every eigenvalue by 12.5", numpy.allclose(edited, STIFFER * unit, rtol=1e-12, atol=0))

    # A fresh solve of the metal bunny, on the coarse mesh of the short form.
    if stage.quick:
        stiff = {f"material.lame_{name}_pa": STIFFER * value for name, value in (("lambda", 3.99e9), ("mu", 2.05e9))}
        stage.solve("ceramic.json", "fresh", {**stiff, "band_hz": [20, 6000 * math.sqrt(STIFFER)]})
        fresh = read_eigenvalues(stage.out / "fresh.hdf")
        count = min(len(fresh), len(edited))
        off = abs(edited[:count] / fresh[:count] - 1).max()
        stage.expect(f"{count} eigenvalues of the edited bank are those of a fresh solve to 1e-7: {off:.1e}", off < 1e-7)

    scene = tools.read_json(stage.folder / "scene.json")
    rows = [
        ("bunny", "in the sound [Hz]", "OSG02 [Hz]", "corrected [Hz]", "decay [1/s]", "by its alphas", "OSG02 [1/s]", "corrected [1/s]")
    ]
    rate, samples, _ = stage.render("bunnies", scene)
    base = {}
    for name, (paper_hz, paper_decay, corrected, alpha1, alpha2) in PAPER.items():
        begin = next(strike["time_s"] for strike in scene["strikes"] if strike["body"] == name)
        ring = samples[int((begin + 0.02) * rate) : int((begin + 0.7) * rate)]
        hz = math.sqrt((unit if name == "ceramic" else edited)[0]) / (2 * math.pi)
        base[name] = measure.find_peak(ring, rate, hz, 0.01)
        decay = measure.calc_decay(ring, rate, base[name], 0.1 * base[name], 30.0)
        law = 0.5 * (alpha1 * (2 * math.pi * base[name]) ** 2 + alpha2)
        wanted = paper_hz * (1 if name == "ceramic" else math.sqrt(STIFFER))
        shown = (
            f"{base[name]:.1f}",
            f"{paper_hz:.1f}",
            f"{wanted:.0f}",
            f"{decay:.2f}",
            f"{law:.2f}",
            f"{paper_decay:.1f}",
            f"{corrected:.1f}",
        )
        rows.append((name, *shown))
        stage.compare(f"{name}: base frequency in the sound against its bank [Hz]", base[name], hz, 0.3)
        stage.compare(f"{name}: decay in the sound against its damping law [1/s]", decay, law, 5.0)
        if not stage.quick:
            stage.compare(f"{name}: base frequency against OSG02, whose mesh is not published [Hz]", base[name], wanted, 5.0)
    stage.compare("metal over ceramic in the sound: sqrt(12.5)", base["metal"] / base["ceramic"], math.sqrt(STIFFER), 0.1)
    print()
    stage.show("bunnies", rows)
