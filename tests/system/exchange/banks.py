"""Banks for these tests, and the sound of a scene with one blow."""
import json
import os
import pathlib
import subprocess
import sys

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])


def run(*words, cwd=None, code=0):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, cwd=cwd, timeout=300)
    assert done.returncode == code, (words, done.returncode, done.stdout, done.stderr)
    return done


def make_bank(folder, name, body, **job):
    """The path of a bank of a body that no other test has."""
    job = {"body": body, "material": "glass", "shapes": "exact", "bank": f"{name}.hdf", **job}
    (folder / f"{name}.json").write_text(json.dumps(job))
    run(BIN / "carillon-precompute", "-q", f"{name}.json", cwd=folder)
    return folder / f"{name}.hdf"


def make_radiating_plate(folder):
    plate = {"shape": "plate", "length_m": 0.3, "width_m": 0.2, "thickness_m": 0.01, "nodes": 1000}
    return make_bank(folder, "plate", plate, material="aluminium", band_hz=[100, 4000], radiation="bem")


def take_modes(folder, name, count):
    """A copy of a fixture with its lowest modes alone, that may be changed."""
    run(BIN / "carillon-bank", "edit", fixtures.get(name), name, "--modes", count, "--keep", "lowest", cwd=folder)
    return folder / name


def read_wav(file):
    """(frames, channels) in float64 of a WAV of floats or 16, 24 or 32 bits; and the rate."""
    data = file.read_bytes()
    assert data[:4] == b"RIFF" and data[8:12] == b"WAVE"
    at, kind = 12, {}
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        kind[data[at : at + 4]] = data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    form = kind[b"fmt "]
    code, channels = int.from_bytes(form[0:2], "little"), int.from_bytes(form[2:4], "little")
    rate, bits = int.from_bytes(form[4:8], "little"), int.from_bytes(form[14:16], "little")
    if code == 0xFFFE:
        code = int.from_bytes(form[24:26], "little")
    raw = kind[b"data"]
    if code == 3:
        values = numpy.frombuffer(raw, "<f4").astype(float)
    elif bits == 24:
        wide = numpy.frombuffer(raw, "u1").reshape(-1, 3)
        values = (wide.astype(numpy.int32) @ [1 << 8, 1 << 16, 1 << 24]).astype(numpy.int32) / 2.0**31
    else:
        values = numpy.frombuffer(raw, f"<i{bits // 8}") / 2.0 ** (bits - 1)
    return values.reshape(-1, channels), rate


def render_blow(folder, bank, point, impulse, centre, seconds=1.0, rate=48000):
    """Pressure [Pa] at 1 m from `centre` after an ideal blow, without the way through the air."""
    scene = {
        "duration_s": seconds,
        "sample_rate_hz": rate,
        "gravity_m_s2": [0, 0, 0],
        "bodies": [{"name": "body", "bank": str(bank), "fixed": True, "effects": ["modal"]}],
        "strikes": [{"time_s": 0.0, "body": "body", "point_m": list(map(float, point)), "impulse_n_s": list(map(float, impulse))}],
        "microphones": [[float(centre[0]) + 1.0, float(centre[1]), float(centre[2])]],
        "output": {"gain": 1.0, "format": "float", "fade_end": False},
        "quality": {"silence_pa": 1e-15},
    }
    (folder / "blow.json").write_text(json.dumps(scene))
    run(BIN / "carillon-render", "blow.json", "-o", "blow.wav", cwd=folder)
    return read_wav(folder / "blow.wav")[0][:, 0]


def hear_modes(folder, bank, point, impulse, microphones, freq_hz, decay, rate=48000, gain=1e-4):
    """(microphones, modes): pressures [Pa] of the modes at time 0, by a fit to what microphones hear of a blow; what it leaves [dB]."""
    scene = {
        "duration_s": 1.2,
        "sample_rate_hz": rate,
        "gravity_m_s2": [0, 0, 0],
        "bodies": [{"name": "body", "bank": str(bank), "fixed": True, "effects": ["modal", "air_delay", "directivity"]}],
        "strikes": [{"time_s": 0.0, "body": "body", "point_m": list(map(float, point)), "impulse_n_s": impulse}],
        "microphones": numpy.asarray(microphones).tolist(),
        "output": {"gain": gain, "format": "float", "fade_end": False},
        "quality": {"silence_pa": 1e-15},
    }
    (folder / "modes.json").write_text(json.dumps(scene))
    run(BIN / "carillon-render", "-q", "modes.json", "-o", "modes.wav", cwd=folder)
    heard = read_wav(folder / "modes.wav")[0] / gain
    first = rate // 50  # the sound has arrived everywhere
    time_s = numpy.arange(first, len(heard)) / rate
    swing = numpy.exp((-decay + 1j * numpy.sqrt((2 * numpy.pi * freq_hz) ** 2 - decay**2)) * time_s[:, None])
    basis = numpy.concatenate([swing.real, -swing.imag], axis=1)
    fitted, *_ = numpy.linalg.lstsq(basis, heard[first:], rcond=None)
    modes = len(freq_hz)
    return (fitted[:modes] + 1j * fitted[modes:]).T, calc_db(basis @ fitted - heard[first:], heard[first:])


def calc_db(difference, whole):
    return 20.0 * numpy.log10(max(1e-30, numpy.sqrt(numpy.mean(difference**2))) / numpy.sqrt(numpy.mean(whole**2)))
