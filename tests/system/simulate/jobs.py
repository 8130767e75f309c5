"""Jobs of carillon-simulate, and how the tests start it."""
import copy
import json
import pathlib
import struct
import subprocess
import sys

import numpy

BIN = pathlib.Path(sys.argv[1]).resolve()
PROGRAM = str(BIN / "carillon-simulate")
ALUMINIUM = {
    "young_modulus_pa": 70e9,
    "poisson_ratio": 0.33,
    "density_kg_m3": 2700,
    "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}},
}
STEEL = ALUMINIUM | {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850}


def make_bar(duration_s=0.1, element="T10"):
    """A cantilever of 0.1 x 0.02 x 0.01 m, struck at its free end."""
    return {
        "simulate": {
            "duration_s": duration_s,
            "bodies": [
                {
                    "name": "bar",
                    "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}},
                    "element": element,
                    "material": copy.deepcopy(ALUMINIUM),
                    "fixed": "x-min",
                }
            ],
            "impulses": [{"time_s": 0.001, "body": "bar", "point_m": [0.05, 0, 0.005], "impulse_n_s": [0, 0, -0.001], "duration_s": 4e-4}],
            "microphones": [[0, 0, 0.5]],
        },
        "sound": "bar.wav",
        "record": "bar.record.json",
    }


def make_plate(held, cells=16, duration_s=0.15):
    """A square steel sheet of 0.3 x 0.3 x 0.001 m, held along its rim and struck softly in its middle."""
    return {
        "simulate": {
            "duration_s": duration_s,
            "bodies": [
                {
                    "name": "plate",
                    "sheet": {"shape": "rectangle", "length_m": 0.3, "width_m": 0.3, "thickness_m": 0.001, "cells": cells},
                    "material": copy.deepcopy(STEEL),
                    held: "rim",
                }
            ],
            "impulses": [{"time_s": 0.004, "body": "plate", "point_m": [0, 0, 0], "impulse_n_s": [0, 0, -2e-5], "duration_s": 8e-3}],
            "microphones": [[0, 0, 0.5]],
        },
        "sound": f"{held}.wav",
        "record": f"{held}.record.json",
    }


def write_job(file, job):
    file.write_text(json.dumps(job, indent=1))


def list_words(ranks, *words):
    launcher = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none"] if ranks > 1 else []
    return [*launcher, PROGRAM, *map(str, words)]


def run(folder, *words, ranks=1):
    return subprocess.run(list_words(ranks, *words), cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=200)


def read_sound(file):
    """(rate, first channel) of a WAV file of floats."""
    data = file.read_bytes()
    kind, channels, rate = struct.unpack_from("<HHI", data, 20)
    assert data[:4] == b"RIFF" and kind == 3, file
    begin = data.index(b"data") + 8
    return rate, numpy.frombuffer(data[begin:], dtype="<f4").reshape(-1, channels)[:, 0].astype(float)


def find_peak_hz(file, low_hz, high_hz, from_s, until_s=None):
    """The strongest line between two frequencies, placed by a parabola."""
    rate, sound = read_sound(file)
    sound = sound[round(from_s * rate) : until_s and round(until_s * rate)]
    level = numpy.log(abs(numpy.fft.rfft(sound * numpy.hanning(len(sound)), 1 << 19)) + 1e-300)
    step = rate / (1 << 19)
    at = int(low_hz / step) + int(level[int(low_hz / step) : int(high_hz / step)].argmax())
    below, middle, above = level[at - 1 : at + 2]
    assert middle > below and middle > above, f"{file}: there is no line between {low_hz} and {high_hz} Hz"
    return (at + 0.5 * (below - above) / (below - 2 * middle + above)) * step
