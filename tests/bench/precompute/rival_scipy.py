#!/usr/bin/python3
"""scipy's eigsh (ARPACK, shift-invert) with SuperLU tuned for symmetric matrices.

usage: rival_scipy.py K.csr M.csr MODES SIGMA TOLERANCE ANSWER PHASES.json
"""
import json
import os
import sys

import scipy.sparse.linalg

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import system


def main():
    stiffness_file, mass_file, modes, sigma, tolerance, answer, phases = sys.argv[1:8]
    modes, sigma, tolerance = int(modes), float(sigma), float(tolerance)
    seconds, last, solves = {}, [0.0], [0]

    def end(name):
        now = sum(os.times()[:2])
        seconds[name] = seconds.get(name, 0.0) + now - last[0]
        last[0] = now

    stiffness, mass = system.read_matrix(stiffness_file), system.read_matrix(mass_file)
    end("read")
    factor = scipy.sparse.linalg.splu(
        (stiffness - sigma * mass).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )

    def solve(right):
        end("orthogonalise")
        solves[0] += 1
        left = factor.solve(right)
        end("solve")
        return left

    inverse = scipy.sparse.linalg.LinearOperator(stiffness.shape, matvec=solve, dtype=float)
    end("factor")
    values, vectors = scipy.sparse.linalg.eigsh(stiffness, k=modes, M=mass, sigma=sigma, OPinv=inverse, tol=tolerance)
    end("orthogonalise")
    system.write_answer(answer, values, vectors)
    end("write")
    with open("/proc/self/status") as stream:
        peak = next(1024 * int(line.split()[1]) for line in stream if line.startswith("VmHWM"))
    with open(phases, "w") as stream:
        json.dump({"cpu_seconds": seconds, "peak_bytes": peak, "solves": solves[0], "factor_entries": int(factor.L.nnz)}, stream)


if __name__ == "__main__":
    main()
