#!/usr/bin/python3
"""carillon-simulate: frequencies against closed forms, energy book, bit-identical output on any number of ranks.

usage: bar.py BIN_DIR
"""
import json
import math
import pathlib
import subprocess
import tempfile

import h5py
from jobs import ALUMINIUM, BIN, find_peak_hz, make_bar, make_plate, read_sound, run, write_job


def calc_cantilever_hz(young_pa, density, poisson, length, thickness):
    """First bending of Timoshenko's cantilever, from Euler's by Southwell's rule for shear and rotation: 1/f^2 = 1/f_B^2 + 1/f_S^2."""
    euler = 1.875104068711961**2 / (2 * math.pi) * thickness / length**2 * math.sqrt(young_pa / (12 * density))
    shear = math.sqrt(5 / 6 * young_pa / (2 * (1 + poisson)) / density) / (4 * length)
    return (euler**-2 + shear**-2) ** -0.5


def check_run(folder, name, job, ranks=1):
    write_job(folder / f"{name}.json", job)
    done = run(folder, "-q", f"{name}.json", ranks=ranks)
    assert done.returncode == 0 and done.stdout == "" and done.stderr == "", f"{name}: {done}"
    record = json.loads((folder / f"{name}.record.json").read_text())
    assert 0 <= record["book_error"] < 1e-6, f"{name}: the book is off by {record['book_error']}"
    assert record["ranks"] == ranks and record["books"][-1]["work_j"] > 0, record
    rate, sound = read_sound(folder / f"{name}.wav")
    frames = round(job["simulate"]["duration_s"] * rate)
    assert rate == 48000 and len(sound) == frames and abs(sound).max() > 0, f"{name}: {rate} Hz, {len(sound)} samples"
    return record


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    # Slender, hence beam-like; and the modes of the same mesh by carillon-precompute, to less than a cent.
    job = make_bar()
    shape = {"length_m": 0.2, "width_m": 0.02, "thickness_m": 0.01, "nodes": 300}
    job["simulate"]["bodies"][0]["shape"] = {"bar": shape}
    job["simulate"]["impulses"][0]["point_m"] = [0.1, 0, 0.005]
    check_run(folder, "bar", job)
    found = find_peak_hz(folder / "bar.wav", 150, 300, 0.003)
    wanted = calc_cantilever_hz(70e9, 2700, 0.33, 0.2, 0.01)
    body = {"body": {"shape": "bar"} | shape, "element": "T10", "mass": "lumped", "fixed": "x-min", "band_hz": [20, 2000]}
    write_job(folder / "modes.json", body | {"material": ALUMINIUM, "bank": "modes.hdf"})
    subprocess.run([BIN / "carillon-precompute", "-q", "modes.json"], cwd=folder, check=True)
    with h5py.File(folder / "modes.hdf") as bank:
        mode = min(bank["modes/frequency_hz"][:], key=lambda hz: abs(hz - found))
    print(f"cantilever: {found:.3f} Hz; {mode:.3f} Hz by its modes, {wanted:.3f} Hz as a beam")
    assert abs(found / mode - 1) < 5e-4, (found, mode)
    # The clamp prevents lateral contraction, unlike beam theory, and the mesh is coarse.
    assert abs(found / wanted - 1) < 0.02, (found, wanted)
    # Square plates of side a: omega a^2 sqrt(rho h / D) = 2 pi^2 hinged, 35.985 clamped (Leissa 1969), from below as cells get smaller.
    unit = math.sqrt(200e9 * 0.001**2 / (12 * (1 - 0.3**2) * 7850)) / (2 * math.pi * 0.3**2)
    for held, factor, most in (("hinged", 2 * math.pi**2, 0.015), ("fixed", 35.985, 0.05)):
        check_run(folder, held, make_plate(held))
        found = find_peak_hz(folder / f"{held}.wav", 40, 130, 0.012)
        print(f"{held} plate: {found:.2f} Hz, {factor * unit:.2f} Hz wanted")
        assert -most < found / (factor * unit) - 1 < 0.003, (held, found, factor * unit)

    # A bar falls on a driven sheet: contact, supports and damping are bit-identical on any number of ranks.
    job = make_bar(0.008)
    job["simulate"]["bodies"][0] |= {"position_m": [0, 0, 0.006]}
    del job["simulate"]["bodies"][0]["fixed"]
    job["simulate"]["bodies"].append(
        {
            "name": "sheet",
            "sheet": {"shape": "rectangle", "length_m": 0.2, "width_m": 0.1, "thickness_m": 0.001, "cells": 8},
            "material": make_plate("fixed")["simulate"]["bodies"][0]["material"],
            "fixed": "x-min",
            "drive": [{"node_set": "x-max", "path": [[0, 0, 0, 0], [0.004, 0, 0, 0.001], [0.008, 0, 0, 0]]}],
        }
    )
    job["simulate"]["gravity_m_s2"] = [0, 0, -9.81]
    sounds = []
    for ranks in (1, 2, 4):
        check_run(folder, "bar", job, ranks)
        sounds.append((folder / "bar.wav").read_bytes())
    assert sounds[0] == sounds[1] == sounds[2], "the sound depends on the number of ranks"

    done = run(folder, "--validate", "--json", "bar.json")
    assert done.returncode == 0 and done.stderr == "", done
    predicted = json.loads(done.stdout)
    record = json.loads((folder / "bar.record.json").read_text())
    assert predicted["step_s"] == float(f"{record['step_s']:.6g}") and predicted["elements"] == record["elements"], (predicted, record)
    assert predicted["seconds"] > 0 and predicted["memory_bytes_a_rank"] > 1e6 and predicted["longest_step_s"] > predicted["step_s"]
