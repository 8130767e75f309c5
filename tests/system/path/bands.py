#!/usr/bin/python3
"""Bands are of corrected frequencies, at both ends: bodies with known frequencies, and ends at random against a wider solve.

Truth: the ceramic ball of 50 mm (Lamb's equations); bending and torsion of the steel bar (as in known_answers_test.cpp).

usage: bands.py BIN_DIR
"""
import math
import pathlib
import random
import tempfile

import h5py

from solver import CERAMIC, STEEL, read_record, run, solve

BAR = {"shape": "bar", "length_m": 0.3, "width_m": 0.02, "thickness_m": 0.01}
BAR_HZ = [574.19, 1134.96, 1571.14, 3042.69, 3047.59, 3866.80, 4969.23]  # Timoshenko and Saint-Venant
BALL_HZ = [6937.16] * 5 + [7349.28] * 5  # ceramic, 50 mm: Lamb
BODIES = {
    "bar": (dict(BAR, nodes=700), 30000),
    "ball": ({"shape": "sphere", "radius_m": 0.05, "nodes": 600}, 60000),
    "plate": ({"shape": "plate", "length_m": 0.2, "width_m": 0.13, "thickness_m": 0.004, "nodes": 1200}, 30000),
    "tube": ({"shape": "tube", "length_m": 0.12, "outer_radius_m": 0.02, "wall_m": 0.002, "nodes": 2500}, 30000),
}


def cents(a, b):
    return abs(1200 * math.log2(a / b))


def solve_band(folder, name, **job):
    """(sorted (corrected, bar, mesh), "end_of_band", complete) of a bank without faults."""
    solve(folder, name, **job)
    run(folder, "carillon-bank", "check", f"{name}.hdf")
    with h5py.File(folder / f"{name}.hdf") as bank:
        names = ("corrected_frequency_hz", "corrected_error_cents", "frequency_hz")
        modes = [bank[f"modes/{what}"][:] for what in names] if len(bank["modes/frequency_hz"]) else []
        return sorted(zip(*modes)), read_record(folder, name)["run"].get("end_of_band", ""), bool(bank["solve/complete"][()])


def check_known(folder, name, truth_hz, **job):
    """Bands that begin or end between each known frequency and that of the mesh have the modes of the body, except those named."""
    wide = solve_band(folder, name, band_hz=[20, 2 * truth_hz[-1]], **job)[0]
    used = 0
    for k, (corrected, bar, mesh) in enumerate(wide[: len(truth_hz)]):
        assert cents(corrected, truth_hz[k]) <= bar, (name, k, corrected, truth_hz[k], bar)
        between = math.sqrt(mesh * max(corrected, truth_hz[k]))
        if mesh < 1.002 * max(corrected, truth_hz[k]) or any(cents(between, f) < 3 for f in truth_hz):
            continue
        used += 1
        above = solve_band(folder, name, band_hz=[between, 2 * truth_hz[-1]], **job)
        below = solve_band(folder, name, band_hz=[20, between], **job)
        for (modes, doubt, complete), wanted in (
            (above, [f for f in truth_hz if f > between]),
            (below, [f for f in truth_hz if f < between]),
        ):
            assert complete, (name, between)
            found = [f for f, _, _ in modes if f <= truth_hz[-1] * 1.05]
            if len(found) != len(wanted):  # only for modes within their bars of the end
                near = sum(cents(f, between) <= bar for f, bar, _ in modes)
                assert "may lie" in doubt and abs(len(found) - len(wanted)) <= max(near, 1), (name, between, found, wanted, doubt)
        assert all(f >= between for f, _, _ in above[0]) and all(f <= between for f, _, _ in below[0])
    print(f"{name:10} {used} ends between the body and the mesh")
    assert used >= 2, (name, used)


def check_random(folder, name, count, rng, **job):
    """The modes of a band are those of a wider solve, by their corrected frequencies."""
    body, top_hz = BODIES[name]
    job |= {"body": body, "material": STEEL}
    wide = [mode for mode in solve_band(folder, name, band_hz=[20, top_hz], **job)[0]]
    freq_hz = [f for f, _, _ in wide]
    last, moved = max(i for i, f in enumerate(freq_hz) if f < 0.7 * top_hz), 0
    for k in range(count):
        first = rng.randrange(last - 1)
        end = min(last, first + rng.randrange(1, 12))
        low, high = (math.sqrt(wide[i][0] * wide[i][2]) if k % 2 else rng.uniform(0.97, 1.03) * wide[i][0] for i in (first, end))
        if high < 1.001 * low:
            continue
        modes, _, complete = solve_band(folder, f"{name}-band", band_hz=[low, high], **job)
        wanted = [f for f in freq_hz if low <= f <= high]
        assert complete and len(modes) == len(wanted), (name, job, low, high, [f for f, _, _ in modes], wanted)
        assert all(cents(f, g) < 0.01 for (f, _, _), g in zip(modes, wanted)), (name, job, low, high)
        moved += len(wanted) != sum(low <= mesh <= high for _, _, mesh in wide)
    print(f"{name:10} {job['element']}, {job.get('mass', 'consistent')}: {moved} of {count} bands are others on the mesh")
    return moved


with tempfile.TemporaryDirectory(prefix="carillon-bands-") as scratch:
    folder = pathlib.Path(scratch)
    check_known(folder, "bar-t4", BAR_HZ[:3], body=dict(BAR, nodes=6000), material=STEEL, element="T4")
    check_known(folder, "bar-t10", BAR_HZ, body=dict(BAR, nodes=700), material=STEEL, element="T10")
    check_known(folder, "ball-t4", BALL_HZ, body={"shape": "sphere", "radius_m": 0.05, "nodes": 1500}, material=CERAMIC, element="T4")
    rng, moved = random.Random(5), 0
    for name in BODIES:
        for kind in ({"element": "T4"}, {"element": "T4", "mass": "lumped"}, {"element": "T10"}):
            moved += check_random(folder, name, 3, rng, **kind)
    assert moved >= 12, moved

    # The lowest modes of a band are counted from its lower end, once corrected; a band in which no mode is left has no bank of other modes.
    job = {"body": BODIES["bar"][0], "material": STEEL, "element": "T4"}
    all_hz = [f for f, _, _ in solve_band(folder, "all", band_hz=[20, 30000], **job)[0]]
    low = 0.5 * (all_hz[4] + all_hz[5])
    lowest, _, complete = solve_band(folder, "lowest", band_hz=[low, 30000], max_modes=3, **job)
    assert not complete and len(lowest) == 3 and all(f > low for f, _, _ in lowest), (low, lowest)
    assert cents(lowest[0][0], all_hz[5]) < 0.01, (lowest, all_hz)
    empty, _, complete = solve_band(folder, "empty", band_hz=[1.01 * all_hz[4], 0.99 * all_hz[5]], **job)
    assert complete and not empty, empty
    print("bands: of corrected frequencies at both ends")
