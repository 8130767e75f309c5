#!/usr/bin/env python3
"""Hard cases of many ranks, on a machine of two cores: the factorisation that they share, ranks without work, ranks that fail. Each takes
the bank of one rank as its measure.

usage: ranks.py CASE [--long]
"""
import json
import sys

import h5py
import numpy as np

from figure import hold, hold_refusal
from programs import BIN, STEEL, Folder, calc_distance, solve
from solids import join, make_box

SAME = 1e-9  # frequencies of two numbers of ranks, relative: the solver's tolerance


def one_element_a_rank():
    """Six and twelve elements, each on a rank of its own."""
    for cells, element in (([2, 1, 1], "T10"), ([1, 1, 1], "T4")):
        body = make_box(cells, [0.1, 0.02, 0.015])
        ranks = len(body.tets)
        alone = solve(body, element, max_modes=8, band_hz=(20, 60000))
        shared = solve(body, element, ranks=ranks, max_modes=8, band_hz=(20, 60000))
        hold("one_element_a_rank", calc_distance(shared.freq_hz, alone.freq_hz), SAME, f"{element}, {ranks} ranks against one", ranks)


def empty_ranks():
    """Three quarters of a bar are fixed, so the ranks there have no row."""
    body = make_box([24, 2, 1], [0.24, 0.02, 0.01])
    fixed = [{"box_m": {"min": [-1, -1, -1], "max": [0.1801, 1, 1]}}]
    alone = solve(body, "T10", fixed=fixed, max_modes=6, band_hz=(20, 60000))
    for ranks in (4, 8):
        shared = solve(body, "T10", ranks=ranks, fixed=fixed, max_modes=6, band_hz=(20, 60000))
        hold("empty_ranks", calc_distance(shared.freq_hz, alone.freq_hz), SAME, f"{ranks} ranks against one", ranks)


def fifty_parts():
    """Fifty bars that do not touch, on 8 ranks, and with --long on 64: more ranks than bars."""
    ranks = 64 if "--long" in sys.argv else 8
    body = join(*[make_box([2, 1, 1], [0.1 * (1 + 0.002 * i), 0.02, 0.01], (0, 0.1 * i, 0)) for i in range(50)])
    alone = solve(body, "T10", band_hz=(20, 8000))
    shared = solve(body, "T10", ranks=ranks, band_hz=(20, 8000))
    hold("fifty_parts", calc_distance(shared.freq_hz, alone.freq_hz), SAME, f"{ranks} ranks against one", ranks)
    hold("fifty_parts", abs(shared.bank["proof/rigid_per_component"] - 6).max(), 0, "rigid motions of each against six", ranks)


def make_job(folder):
    """A plate whose factorisation on four ranks takes hundreds of letters."""
    make_box([44, 44, 1], [0.3, 0.28, 0.004]).write(folder.path / "mesh.msh")
    damping = {"damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 1}}}
    job = {"mesh": "mesh.msh", "bank": "out.bank", "element": "T10", "band_hz": [20, 2000], "material": {**STEEL, **damping}}
    (folder.path / "job.json").write_text(json.dumps(job))


def read_frequencies(folder):
    with h5py.File(folder.path / "out.bank") as bank:
        return np.array(bank["modes/frequency_hz"])


def run_with_fault(folder, fault, rank, letter, *options):
    faults = {"LD_PRELOAD": BIN / "libfault.so", "CARILLON_FAULT": fault, "CARILLON_FAULT_RANK": rank, "CARILLON_FAULT_LETTER": letter}
    words = [word for name, value in faults.items() for word in ("-x", f"{name}={value}")]
    return folder.run(
        1, "/usr/bin/mpirun", "-np", 4, "--oversubscribe", "--bind-to", "none", *words, BIN / "carillon-precompute", "job.json", *options
    )


def dead_rank():
    """A rank dies while it shares a front: the run ends with a word, and what was saved before gives the same bank."""
    with Folder() as folder:
        make_job(folder)
        assert folder.run(1, "carillon-precompute", "job.json").code == 0
        alone = read_frequencies(folder)
        (folder.path / "out.bank").unlink()
        for rank, letter in ((3, 5), (0, 20)):
            outcome = run_with_fault(folder, "die", rank, letter, "--checkpoint", "state")
            assert outcome.code != 0 and "out.bank" not in folder.list(), outcome.text
            hold_refusal("dead_rank", outcome.text, ["signal 9"], f"rank {rank} dies at letter {letter}", 4)
        outcome = folder.run(4, "carillon-precompute", "job.json", "--checkpoint", "state")
        assert outcome.code == 0, outcome.text
        hold("dead_rank", calc_distance(read_frequencies(folder), alone), SAME, "after two deaths, against one rank", 4)


def memory_on_one_rank():
    """One rank of four gets no more memory while it shares a front: all end with the need in GB, no bank is left, none waits."""
    with Folder() as folder:
        make_job(folder)
        # Where the rank needs little more the factorisation still ends, and the search refuses; either names the need.
        for rank, letter in ((0, 1), (2, 2), (3, 4)):
            outcome = run_with_fault(folder, "memory", rank, letter)
            assert outcome.code != 0 and "out.bank" not in folder.list(), outcome.text
            lines = [line for line in outcome.text.splitlines() if "error:" in line]
            assert len(lines) == 1, outcome.text
            hold_refusal("memory_on_one_rank", lines[0], [" GB"], f"rank {rank} at letter {letter}", 4)


if __name__ == "__main__":
    globals()[sys.argv[1]]()
