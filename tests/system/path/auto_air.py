#!/usr/bin/python3
""" "radiation": "auto" uses boundary elements for flat bodies, and for compact ones whose radiation damping exceeds 0.3 of
the material damping; the log states the decision, the reason and the figures.

usage: auto_air.py BIN_DIR
"""
import pathlib
import re
import tempfile

import h5py
from solver import solve

CUBE = {"length_m": 0.15, "width_m": 0.15, "height_m": 0.15, "nodes": 800}
HOLLOW = {"shape": "hollow-box", **CUBE, "wall_m": 0.006}
LOSSY = {
    "young_modulus_pa": 70e9,
    "poisson_ratio": 0.33,
    "density_kg_m3": 2700,
    "damping": {"rayleigh": {"alpha1_s": 0, "alpha2_per_s": 500}},
}
LOSSLESS = LOSSY | {"damping": {"rayleigh": {"alpha1_s": 0, "alpha2_per_s": 0}}}
CASES = {  # body, material, boundary elements or sphere, message
    "solid": ({"shape": "box", **CUBE}, "acrylic", False, "roundness of 0.52, and the gains of a sphere suffice above 0.4"),
    "hollow": (HOLLOW, "aluminium", True, "modes would ring too long"),
    "hollow-lossy": (HOLLOW, LOSSY, False, "the gains of a sphere suffice"),
    "hollow-lossless": (HOLLOW, LOSSLESS, True, "up to inf times material damping"),
    "plate": (
        {"shape": "plate", "length_m": 0.3, "width_m": 0.2, "thickness_m": 0.01, "nodes": 800},
        "acrylic",
        True,
        "roundness of 0.02, below 0.4",
    ),
}


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for case, (body, material, is_solved, words) in CASES.items():
            radiation = {"method": "auto", "skin_nodes": 400}
            text = solve(folder, case, body=body, material=material, band_hz=[20, 12000], max_modes=6, radiation=radiation)
            line = next(line for line in text.splitlines() if "boundary elements: " in line)
            assert f"boundary elements: {'yes' if is_solved else 'no'}; " in line and words in line, f"{case}: {line}"
            with h5py.File(folder / f"{case}.hdf") as bank:
                assert ("radiation" in bank) == is_solved, case
                if case != "hollow":
                    continue
                ratio = float(re.search(r"up to ([0-9.]+) times material", line)[1])
                solved = (bank["radiation/decay"][:] / bank["modes/corrected_decay"][:]).max()
                assert 0.5 < ratio / solved < 2 and solved > 1, (ratio, solved)  # sphere estimate against the solved value
    print("auto_air: all cases hold")


if __name__ == "__main__":
    main()
