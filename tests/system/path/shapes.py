#!/usr/bin/python3
"""Shapes in the bank of a job: packed if they are large, as they are on demand; the same modes both ways.

usage: shapes.py BIN_DIR
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy

BIN = pathlib.Path(sys.argv[1])
BODIES = {
    "solved": {"body": {"shape": "plate", "length_m": 0.2, "width_m": 0.15, "thickness_m": 0.004, "nodes": 5000}},
    "known": {"body": {"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.004}, "grid": 32}},
}


def run(folder, *words, code=0):
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, (words, done.returncode, done.stdout, done.stderr)
    return done.stdout + done.stderr


def make_bank(folder, name, code=0, **job):
    (folder / "job.json").write_text(json.dumps({"material": "glass", "bank": f"{name}.hdf"} | job))
    return folder / f"{name}.hdf", run(folder, BIN / "carillon-precompute", "job.json", code=code)


def is_packed(bank):
    with h5py.File(bank) as file:
        assert ("modes/packed_shape" in file) != ("modes/shape" in file)
        return "modes/packed_shape" in file


def check_body(folder, name, job):
    exact, _ = make_bank(folder, f"{name}-exact", shapes="exact", **job)
    packed, said = make_bank(folder, name, **job)
    assert not is_packed(exact) and is_packed(packed) and "shapes packed, error at most -60." in said, said
    assert packed.stat().st_size < exact.stat().st_size / 3
    assert "ok      original     error at most -60." in run(folder, BIN / "carillon-bank", "check", packed, "--original", exact)
    with h5py.File(exact) as a, h5py.File(packed) as b:
        for array in ("modes/frequency_hz", "modes/decay", "modes/radiation_gain", "modes/shape_scale"):
            assert numpy.array_equal(a[array][:], b[array][:]), array
        wanted = [json.loads(file["provenance"][()])["shapes"] for file in (a, b)]
        assert wanted == ["exact", "packed"], wanted
    few, said = make_bank(folder, f"{name}-few", max_modes=5, **job)
    assert not is_packed(few) and "exact shapes" in said, said


def check_strain(folder):
    """A gauge on packed shapes is not exact, and an accelerometer is."""
    for bank, quantity, warns in (("solved", "strain", True), ("solved", "acceleration", False), ("solved-exact", "strain", False)):
        scene = {
            "bodies": [{"name": "plate", "bank": f"{bank}.hdf"}],
            "strikes": [{"body": "plate", "time_s": 0, "point_m": [0.1, 0.07, 0.002], "impulse_n_s": [0, 0, -0.01]}],
            "sensors": [{"name": "gauge", "body": "plate", "point_m": [0, 0, 0.002], "direction": [1, 0, 0], "quantity": quantity}],
            "duration_s": 0.1,
        }
        (folder / "scene.json").write_text(json.dumps(scene))
        said = run(folder, BIN / "carillon-render", "scene.json", "-o", "sound.wav")
        assert ('the shapes of "plate" are packed' in said) == warns, (bank, quantity, said)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    for body, job in BODIES.items():
        check_body(folder, body, job)
    check_strain(folder)
    _, said = make_bank(folder, "bad", code=2, shapes="small", **BODIES["known"])
    assert 'job.json:1: "shapes"' in said and 'none of "packed", "exact"' in said and not (folder / "bad.hdf").exists(), said
