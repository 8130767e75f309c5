#!/usr/bin/python3
"""Corrected frequencies from the job to the sound: a scene plays them or the mesh's, as selected; lists too short for error
bars are marked in the log, the bank and its report, without numbers.

usage: frequencies.py BIN_DIR
"""
import json
import math
import pathlib
import re
import tempfile
import wave

import h5py
import numpy
import solver

STEEL = {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {"alpha2_per_s": 2}}}
BAR = {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 700}


def run(folder, code, program, *words):
    done = solver.run(folder, program, *words, code=code)
    return done.stdout + done.stderr


def solve(folder, name, **more):
    said = solver.solve(folder, name, **{"body": BAR, "material": STEEL, "element": "T4"} | more)
    with h5py.File(folder / f"{name}.hdf") as bank:
        return said, {key: values[()] for key, values in bank["modes"].items() if "frequency" in key or "error" in key or "decay" in key}


def measure(folder, name, freq_hz):
    """Amplitude of each frequency in the last second of the WAV, with a Hann window."""
    with wave.open(str(folder / f"{name}.wav")) as file:
        rate, channels = file.getframerate(), file.getnchannels()
        sound = numpy.frombuffer(file.readframes(file.getnframes()), "<i2").reshape(-1, channels).sum(axis=1)[-rate:]
    time = numpy.arange(rate) / rate
    return [abs(numpy.sum(sound * numpy.hanning(rate) * numpy.exp(-2j * math.pi * f * time))) for f in freq_hz]


def check_sound(folder):
    _, modes = solve(folder, "bar", band_hz=[20, 1000])  # a single mode, so others cannot be shifted
    mesh, corrected = modes["frequency_hz"][0], modes["corrected_frequency_hz"][0]
    assert mesh - corrected > 10, f"{mesh} and {corrected} Hz cannot be separated here"
    scene = {
        "duration_s": 1.5,
        "sample_rate_hz": 48000,
        "bodies": [{"name": "bar", "bank": "bar.hdf", "fixed": True}],
        "strikes": [{"time_s": 0.1, "body": "bar", "point_m": [0.15, 0, 0.006], "impulse_n_s": [0, 0, -0.01], "duration_s": 0.0005}],
        "listener": {"position_m": [0, 1, 1], "look_at_m": [0, 0, 0]},
        "output": {"format": "pcm16"},
    }
    for name, more in ("unsaid", {}), ("corrected", {"frequencies": "corrected"}), ("mesh", {"frequencies": "mesh"}):
        (folder / f"{name}.json").write_text(json.dumps(scene | more))
        run(folder, 0, "carillon-render", f"{name}.json", "-o", f"{name}.wav")
        of_mesh, of_corrected = measure(folder, name, (mesh, corrected))
        played, other = (of_mesh, of_corrected) if name == "mesh" else (of_corrected, of_mesh)
        assert played > 100 * other > 0, f"{name}: {of_mesh:.3g} at {mesh:.2f} Hz, {of_corrected:.3g} at {corrected:.2f} Hz"
    assert (folder / "unsaid.wav").read_bytes() == (folder / "corrected.wav").read_bytes()
    (folder / "wrong.json").write_text(json.dumps(scene | {"frequencies": "true"}))
    said = run(folder, 2, "carillon-render", "wrong.json", "-o", "wrong.wav")
    assert "wrong.json" in said and '"frequencies"' in said and '"corrected", "mesh"' in said, said
    assert not (folder / "wrong.wav").exists()
    print(f"sound: {mesh:.2f} Hz of the mesh, {corrected:.2f} Hz corrected")


def check_short_list(folder):
    _, modes = solve(folder, "long", mass="lumped", band_hz=[20, 9000])
    mesh = modes["frequency_hz"]
    assert len(mesh) > 4 and numpy.all(numpy.isfinite(modes["corrected_error_cents"]))
    for count in (1,):
        name = f"short-{count}"
        said, modes = solve(folder, name, mass="lumped", band_hz=[20, (mesh[count - 1] + mesh[count]) / 2])
        assert "frequencies have no error bars" in said, said
        assert len(modes["frequency_hz"]) == count
        assert numpy.all(numpy.isposinf(modes["corrected_error_cents"])), modes
        assert numpy.all(numpy.isposinf(modes["discretisation_error_cents"])), modes
        run(folder, 0, "carillon-bank", "check", f"{name}.hdf")
        said = run(folder, 0, "carillon-bank", "info", f"{name}.hdf")
        assert "inf" not in said.replace("info", ""), said
        said = json.loads(run(folder, 0, "carillon-bank", "info", f"{name}.hdf", "--json"))
        assert "Infinity" not in json.dumps(said)
        run(folder, 0, "carillon", "report", f"{name}.hdf", "-o", f"{name}-report", "--no-pictures")
        page = (folder / f"{name}-report" / "report.html").read_text()
        shown = json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL).group(1))["bank"]
        assert shown["modes"]["corrected_cents"] == shown["modes"]["body_cents"] == [None] * count, shown["modes"]
        assert "not all of them have an estimate against the body" in shown["accuracy"], shown["accuracy"]
    # A band of corrected frequencies looks further on so coarse a mesh: there are enough modes for bars.
    _, modes = solve(folder, "wider", mass="lumped", band_hz=[20, (mesh[2] + mesh[3]) / 2])
    assert len(modes["frequency_hz"]) > 3 and numpy.all(numpy.isfinite(modes["corrected_error_cents"])), modes
    # The lowest modes of a longer list are unaffected: more modes are computed, then cut.
    _, modes = solve(folder, "cut", mass="lumped", band_hz=[20, 9000], max_modes=2)
    assert len(modes["frequency_hz"]) == 2 and numpy.all(numpy.isfinite(modes["corrected_error_cents"])), modes
    print(f"short lists: {len(mesh)} modes have bars, 1 has none, 2 of more have some")


def check_damped(folder):
    """No warning for error bars within half the width of a resonance, which are inaudible."""
    for name, tan_phi in ("ringing", 0.01), ("dead", 1.2):
        material = STEEL | {"damping": {"internal_friction": {"tan_phi": tan_phi}}}
        said, modes = solve(folder, name, material=material, band_hz=[20, 9000], element="T10", body=BAR | {"nodes": 250})
        wide = [
            cents > max(50, 1200 * math.log2(1 + decay / (2 * math.pi * hz)))
            for hz, decay, cents in zip(*(modes[f"corrected_{key}"] for key in ("frequency_hz", "decay", "error_cents")))
        ]
        counted = re.search(r"frequencies can be wrong by .*; (\d+) of (\d+) modes", said)
        assert [int(n) for n in counted.groups()] == [sum(wide), len(wide)] if counted else not any(wide), (said, wide)
        assert any(wide) == (name == "ringing") and max(modes["corrected_error_cents"]) > 50, modes
    print("damped: bars within the width of their resonances are not warned of")


with tempfile.TemporaryDirectory(prefix="carillon-frequencies-") as scratch:
    check_sound(pathlib.Path(scratch))
    check_short_list(pathlib.Path(scratch))
    check_damped(pathlib.Path(scratch))
