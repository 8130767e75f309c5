#!/usr/bin/python3
"""One job with every instruction set of this processor: the same modes, error bars and radiation, to rounding.

usage: instructions.py BIN_DIR
"""
import os
import pathlib
import tempfile

import h5py
import numpy as np

import solver

SETS = {"plain": "", "sse4": "sse4_1", "avx2": "avx2", "avx512": "avx512dq"}  # flag of /proc/cpuinfo
BODY = {"shape": "bowl", "outer_radius_m": 0.05, "wall_m": 0.005, "opening_angle_deg": 120}
# Largest relative difference. Kernels of the air and of the error bars have single precision.
ALLOWED = {
    "modes/eigenvalue": 1e-9,
    "modes/corrected_frequency_hz": 1e-6,
    "modes/discretisation_error_cents": 1e-3,
    "radiation/decay": 1e-4,
    "radiation/added_mass": 1e-4,
}


def solve(folder, job, instructions):
    """The datasets of ALLOWED in the bank."""
    solver.write_job(folder, **job, material="steel")
    solver.run(folder, "carillon-precompute", "-q", "job.json", env={**os.environ, "CARILLON_INSTRUCTIONS": instructions})
    with h5py.File(folder / "job.hdf") as bank:
        return {key: bank[key][:] for key in ALLOWED if key in bank}


def main():
    flags = pathlib.Path("/proc/cpuinfo").read_text().split()
    sets = [name for name, flag in SETS.items() if not flag or flag in flags]
    jobs = [
        {"body": {**BODY, "nodes": 1200}, "element": "T4", "band_hz": [20, 8000], "radiation": "bem"},
        {"body": {**BODY, "nodes": 4000}, "element": "T10", "band_hz": [20, 30000]},
    ]
    with tempfile.TemporaryDirectory() as name:
        for job in jobs:
            best, *others = [solve(pathlib.Path(name), job, one) for one in reversed(sets)]
            for bank, instructions in zip(others, reversed(sets[:-1])):
                assert bank.keys() == best.keys()
                for key, values in bank.items():
                    difference = np.max(np.abs(values / best[key] - 1))
                    print(f"{job['element']}, {instructions} against {sets[-1]}: {key} {difference:.2g}, {values.size} values")
                    assert difference <= ALLOWED[key] and values.size > 0


main()
