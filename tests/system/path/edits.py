#!/usr/bin/python3
"""An edited bank equals a fresh solve of the edited body: density, stiffness, size and damping of a steel bar, T10, alone
and together.

usage: edits.py BIN_DIR
"""
import pathlib
import tempfile

import h5py
import numpy as np
from solver import run, write_job

BAND = [20.0, 19000.0]


def solve(folder, name, density=1.0, stiffness=1.0, size=1.0, damping=None):
    size_words = f"--length {0.3 * size} --width {0.02 * size} --thickness {0.013 * size}".split()
    run(folder, "carillon-mesh", "--shape", "bar", *size_words, "--nodes", 700, "--order", 2, "-o", f"{name}.msh")
    times = (stiffness / density) ** 0.5 / size
    job = {
        "mesh": f"{name}.msh",
        "band_hz": [f * times for f in BAND],
        "solver": {"tolerance": 1e-11},
        "material": {
            "young_modulus_pa": 200e9 * stiffness,
            "poisson_ratio": 0.3,
            "density_kg_m3": 7850 * density,
            "damping": damping or {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 2.5}},
        },
    }
    write_job(folder, name, **job)
    run(folder, "carillon-precompute", f"{name}.json")


def read(file):
    with h5py.File(file) as h:
        bank = {
            name: h[name][()]
            for name in (
                "mesh/vertices",
                "mesh/triangles",
                "modes/eigenvalue",
                "modes/decay",
                "modes/radiation_gain",
                "modes/shape_scale",
                "rigid/mass_kg",
                "rigid/centre_m",
                "rigid/inertia_kg_m2",
            )
        }
        bank["phi"] = h["modes/shape"][()] * bank["modes/shape_scale"][None, :, None]
        return bank


def compare(folder, what, edited, fresh):
    a, b = read(folder / edited), read(folder / fresh)
    assert len(a["modes/eigenvalue"]) == len(b["modes/eigenvalue"]) > 10, what
    assert np.array_equal(a["mesh/triangles"], b["mesh/triangles"])
    for name in ("modes/eigenvalue", "modes/decay", "rigid/mass_kg"):
        np.testing.assert_allclose(a[name], b[name], rtol=1e-9, err_msg=f"{what}: {name}")
    size = np.abs(b["mesh/vertices"]).max()
    np.testing.assert_allclose(a["mesh/vertices"], b["mesh/vertices"], atol=1e-12 * size)
    np.testing.assert_allclose(a["rigid/centre_m"], b["rigid/centre_m"], atol=1e-9 * size)
    np.testing.assert_allclose(a["rigid/inertia_kg_m2"], b["rigid/inertia_kg_m2"], atol=1e-9 * np.abs(b["rigid/inertia_kg_m2"]).max())
    # Shapes are stored in 16 bits: tolerance of one and a half steps.
    for name in ("modes/shape_scale", "modes/radiation_gain"):
        np.testing.assert_allclose(a[name], b[name], rtol=1e-9, err_msg=f"{what}: {name}")
    for m in range(a["phi"].shape[1]):
        x, y = a["phi"][:, m].ravel(), b["phi"][:, m].ravel()
        y = y * np.sign(x @ y)
        assert (x @ y) ** 2 / ((x @ x) * (y @ y)) > 1 - 1e-8, f"{what}: mode {m} has another shape"
        assert np.abs(x - y).max() < 1.5 * b["modes/shape_scale"][m], f"{what}: mode {m}"
    print(
        f"{what}: {len(a['modes/eigenvalue'])} modes, frequencies to"
        f" {np.abs(a['modes/eigenvalue'] / b['modes/eigenvalue'] - 1).max() / 2:.1e}, gains to"
        f" {np.abs(a['modes/radiation_gain'] / b['modes/radiation_gain'] - 1).max():.1e}"
    )


FRICTION = {"internal_friction": {"tan_phi": 0.004}}
with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    solve(folder, "base")
    solve(folder, "friction", damping=FRICTION)
    for what, base, change, damping in (
        ("density x 0.37", "base", {"density": 0.37}, None),
        ("stiffness x 2.9", "base", {"stiffness": 2.9}, None),
        ("size x 1.7", "base", {"size": 1.7}, None),
        ("all", "base", {"density": 3.1, "stiffness": 0.4, "size": 0.21}, None),
        ("size x 0.5, friction", "friction", {"size": 0.5}, FRICTION),
        ("other alphas", "friction", {"density": 1.3}, {"rayleigh": {"alpha1_s": 3e-8, "alpha2_per_s": 11.0}}),
    ):
        options = [part for key, value in change.items() for part in (f"--{key}", repr(value))]
        if base == "friction" and "rayleigh" in damping:
            options += ["--alphas", "3e-8", "11"]
        (folder / "edited.hdf").unlink(missing_ok=True)
        run(folder, "carillon-bank", "edit", f"{base}.hdf", "edited.hdf", *options)
        run(folder, "carillon-bank", "check", "edited.hdf")
        solve(folder, "fresh", damping=damping, **change)
        compare(folder, what, "edited.hdf", "fresh.hdf")
