#!/usr/bin/env python3
"""The same matrices solved by others: K and M of `carillon-precompute --matrices`, by scipy's eigsh (ARPACK on SuperLU) and by Spectra (on
Eigen's L D L^T).

usage: cross.py CASE      holds the largest relative difference of a frequency of the band, from either, to 1e-8; the counts must be equal
"""
import itertools
import json
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np
import scipy.io
import scipy.sparse.linalg

import figure
from programs import BIN, SPRUCE, STEEL

CERAMIC = {"young_modulus_pa": 5.454e9, "poisson_ratio": 0.33, "density_kg_m3": 2700}
ALUMINIUM, RUBBER = {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700}, {
    "young_modulus_pa": 10e6,
    "poisson_ratio": 0.4999,
    "density_kg_m3": 1100,
}
DAMPING = {"damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 1}}}
BUNNY = "/usr/share/glmark2/models/bunny.obj"  # of Debian's glmark2-data


def write_two_halves(path, cells=(8, 2, 2), size_m=(0.3, 0.03, 0.02)):
    """A box of linear tetrahedra, six a cell along its diagonal, as Gmsh 2.2: region 1 is its first half along x, region 2 the other."""
    counts = [n + 1 for n in cells]
    nodes = list(itertools.product(*(range(n) for n in counts)))
    number = {node: i + 1 for i, node in enumerate(nodes)}
    tets = []
    for cell in itertools.product(*(range(n) for n in cells)):
        for axes in itertools.permutations(range(3)):
            corner, tet = list(cell), [number[cell]]
            for axis in axes:
                corner[axis] += 1
                tet.append(number[tuple(corner)])
            if axes not in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                tet[1], tet[2] = tet[2], tet[1]
            tets.append((1 if cell[0] < cells[0] // 2 else 2, tet))
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    lines += [f"{i + 1} " + " ".join(repr(size_m[d] * node[d] / cells[d]) for d in range(3)) for i, node in enumerate(nodes)]
    lines += ["$EndNodes", "$Elements", str(len(tets))]
    lines += [f"{e + 1} 4 2 {region} {region} {' '.join(map(str, tet))}" for e, (region, tet) in enumerate(tets)]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


# Of each body: element, band [Hz], and what else its job says. "write" writes the job's mesh, "mesh" are the words with which carillon-mesh
# makes it.
BODIES = {
    "matrices_bar": {
        "element": "T4",
        "band_hz": [20, 40e3],
        "body": {"shape": "bar", "length_m": 0.3, "width_m": 0.02, "thickness_m": 0.01, "nodes": 500},
    },
    "matrices_tube": {
        "element": "T10",
        "band_hz": [20, 9e3],
        "material": ALUMINIUM,
        "body": {"shape": "tube", "length_m": 0.3, "outer_radius_m": 0.0125, "wall_m": 0.001, "nodes": 800},
    },
    "matrices_sphere": {"element": "T10", "band_hz": [20, 58e3], "body": {"shape": "sphere", "radius_m": 0.05, "nodes": 900}},
    "matrices_plate": {
        "element": "T10",
        "band_hz": [20, 5e3],
        "body": {"shape": "plate", "length_m": 0.2, "width_m": 0.2, "thickness_m": 0.005, "nodes": 900},
    },
    "matrices_cube": {
        "element": "T4",
        "band_hz": [20, 58e3],
        "body": {"shape": "box", "length_m": 0.05, "width_m": 0.05, "height_m": 0.05, "nodes": 700},
    },
    "matrices_ring": {
        "element": "T10",
        "band_hz": [20, 20e3],
        "mass": "lumped",
        "body": {"shape": "tube", "length_m": 0.012, "outer_radius_m": 0.04, "wall_m": 0.01, "nodes": 900},
    },
    "matrices_bowl": {
        "element": "T10",
        "band_hz": [20, 20e3],
        "material": CERAMIC,
        "body": {"shape": "bowl", "outer_radius_m": 0.062, "wall_m": 0.004, "nodes": 1200},
    },
    "matrices_two_materials": {
        "element": "T10",
        "band_hz": [20, 20e3],
        "materials": {"1": STEEL, "2": ALUMINIUM},
        "write": write_two_halves,
    },
    "matrices_orthotropic": {
        "element": "T10",
        "band_hz": [20, 20e3],
        "material": SPRUCE,
        "body": {"shape": "box", "length_m": 0.085, "width_m": 0.065, "height_m": 0.05, "nodes": 700},
    },
    "matrices_near_incompressible": {
        "element": "T10",
        "band_hz": [20, 1.2e3],
        "material": RUBBER,
        "body": {"shape": "sphere", "radius_m": 0.05, "nodes": 900},
    },
    "matrices_fixed": {
        "element": "T10",
        "band_hz": [20, 20e3],
        "material": ALUMINIUM,
        "fixed": "x-min",
        "body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 900},
    },
    "matrices_bunny": {
        "element": "T4",
        "band_hz": [20, 20e3],
        "material": CERAMIC,
        "mesh": ["--height", 0.13, "--wall", 0.012, "--nodes", 1500],
    },
}


def run(folder, program, *words):
    done = subprocess.run([str(BIN / program), *map(str, words)], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert done.returncode == 0, f"{program}: {done.stderr}"
    return done.stdout


def write_job(folder, body):
    job = {"material": STEEL, "bank": "out.bank", "solver": {"tolerance": 1e-9}} | body
    if "write" in job:
        job.pop("write")(folder / "mesh.msh")
        job["mesh"] = "mesh.msh"
    elif "mesh" in job:
        run(folder, "carillon-mesh", BUNNY, "-o", "mesh.msh", *job["mesh"])
        job["mesh"] = "mesh.msh"
    if "materials" in job:
        del job["material"]
        job["materials"] = {region: material | DAMPING for region, material in job["materials"].items()}
    else:
        job["material"] = job["material"] | DAMPING
    (folder / "job.json").write_text(json.dumps(job))


def solve_by_scipy(stiffness, mass, modes, sigma):
    """The eigenvalues next to sigma, ascending, with a refined solve: SuperLU's pivots alone leave some 1e-11."""
    shifted = (stiffness - sigma * mass).tocsc()
    factor = scipy.sparse.linalg.splu(shifted)

    def solve(right):
        left = factor.solve(right)
        return left + factor.solve(right - shifted @ left)

    inverse = scipy.sparse.linalg.LinearOperator(stiffness.shape, matvec=solve, dtype=float)
    start = np.random.default_rng(1).standard_normal(stiffness.shape[0])
    return np.sort(
        scipy.sparse.linalg.eigsh(
            stiffness,
            k=modes,
            M=mass,
            sigma=sigma,
            OPinv=inverse,
            tol=1e-13,
            v0=start,
            ncv=min(3 * modes + 20, len(start)),
            return_eigenvectors=False,
        )
    )


def solve_by_spectra(folder, modes, sigma):
    return np.array([float(line) for line in run(folder, "others_spectra", "stiffness.mtx", "mass.mtx", modes, repr(float(sigma))).split()])


def find_difference(lambdas, band_hz, rigid, freq_hz):
    """Of the frequencies in the band, relative; infinite where they are not as many, or one above is not among the others. The others' list
    must reach beyond the band."""
    others = np.sqrt(np.maximum(lambdas, 0)) / (2 * np.pi)
    if (others < band_hz[0]).sum() != rigid or others[-1] <= band_hz[1]:
        return np.inf
    above = freq_hz[freq_hz > band_hz[1]]
    beyond = max((abs(others / hz - 1).min() for hz in above), default=0.0)
    others, freq_hz = (hz[(hz >= band_hz[0]) & (hz <= band_hz[1])] for hz in (others, freq_hz))
    return max(abs(others / freq_hz - 1).max(), beyond) if len(others) == len(freq_hz) else np.inf


def check(case):
    body = BODIES[case]
    with tempfile.TemporaryDirectory(prefix="carillon-cross-") as name:
        folder = pathlib.Path(name)
        write_job(folder, body)
        run(folder, "carillon-precompute", "-q", "job.json", "--matrices", ".")
        with h5py.File(folder / "out.bank") as bank:
            freq_hz = bank["modes/frequency_hz"][()]
            # Bands are of corrected frequencies: up to here they have all modes of the mesh.
            end_hz = bank["proof/complete_below_hz"][()] * (1 - 1e-9) if "proof/complete_below_hz" in bank else bank["proof/cut_hz"][-1]
        stiffness, mass = (scipy.io.mmread(folder / name).tocsc() for name in ("stiffness.mtx", "mass.mtx"))
        rigid = 0 if "fixed" in body else 6
        modes = len(freq_hz) + rigid + 20
        sigma = -0.3 * (2 * np.pi * freq_hz[0]) ** 2  # below all of them
        assert len(freq_hz) >= 8, f"{len(freq_hz)} modes prove little"
        for solver, lambdas in (
            ("scipy", solve_by_scipy(stiffness, mass, modes, sigma)),
            ("Spectra", solve_by_spectra(folder, modes, sigma)),
        ):
            figure.hold(
                case,
                find_difference(lambdas, [body["band_hz"][0], end_hz], rigid, freq_hz),
                1e-8,
                f"{solver}, {len(freq_hz)} modes of {stiffness.shape[0]} unknowns",
            )


if __name__ == "__main__":
    check(sys.argv[1])
