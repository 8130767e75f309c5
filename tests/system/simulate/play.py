#!/usr/bin/python3
"""carillon-render plays recorded surfaces of carillon-simulate: the same sound at the simulation's listener, for any common placement.

usage: play.py BIN_DIR
"""
import json
import math
import pathlib
import struct
import subprocess
import tempfile

import numpy
from jobs import BIN, make_bar, run, write_job


def read_channels(file):
    """(frames, channels) of a WAV file of floats."""
    data = file.read_bytes()
    channels = struct.unpack_from("<H", data, 22)[0]
    begin = data.index(b"data") + 8
    return numpy.frombuffer(data[begin:], dtype="<f4").reshape(-1, channels).astype(float)


def render(folder, scene, *words):
    (folder / "scene.json").write_text(json.dumps(scene))
    return subprocess.run([BIN / "carillon-render", "scene.json", *words], cwd=folder, capture_output=True, text=True)


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    job = make_bar(0.03) | {"surface": "bar.surface"}
    del job["simulate"]["microphones"]
    job["simulate"]["listener"] = {"position_m": [0.3, -1, 0.3], "look_at_m": [0, 0, 0]}
    write_job(folder / "job.json", job)
    done = run(folder, "-q", "job.json")
    assert done.returncode == 0, done
    wanted = read_channels(folder / "bar.wav")
    assert wanted.shape == (1440, 2) and abs(wanted[:, 0] - wanted[:, 1]).max() > 1e-3 * abs(wanted).max(), wanted.shape

    turn = math.radians(30)
    body = {"name": "bar", "recording": "bar.surface"}
    scene = {
        "duration_s": 0.03,
        "bodies": [body],
        "listener": job["simulate"]["listener"],
        "output": {"gain": 1, "format": "float", "fade_end": False},
    }
    place = {"position_m": [2, 1, 0.5], "rotation_deg": [0, 0, 30]}

    def put(x, y, z):
        return [2 + math.cos(turn) * x - math.sin(turn) * y, 1 + math.sin(turn) * x + math.cos(turn) * y, 0.5 + z]

    moved = {"bodies": [body | place], "listener": {"position_m": put(0.3, -1, 0.3), "look_at_m": put(0, 0, 0)}}
    for name, one in (("as it was simulated", scene), ("moved and turned", scene | moved)):
        done = render(folder, one, "-o", "out.wav", "--report", "report.json")
        assert done.returncode == 0 and "warning" not in done.stderr and "recorded surface" in done.stdout, done
        found = read_channels(folder / "out.wav")
        assert found.shape == wanted.shape, found.shape
        error_db = 10 * math.log10(((found - wanted) ** 2).sum() / (wanted**2).sum())
        print(f"{name}: {error_db:.1f} dB")
        assert error_db < -70, error_db
        shown = json.loads((folder / "report.json").read_text())["recordings"]
        assert len(shown) == 1 and shown[0]["receivers"] == 2 and not shown[0]["resampled"] and shown[0]["cpu_s"] > 0, shown

    done = render(folder, scene, "--plan")
    assert done.returncode == 0 and "bar: recorded surface, " in done.stdout and "heard at two free ears" in done.stdout, done
    # One clear error, and nothing is written.
    whole = (folder / "bar.surface").read_bytes()
    for bytes_, part in ((whole[:5000], "truncated"), (whole[:-1] + b"x", "damaged"), (b"text", "not a recorded surface")):
        (folder / "bar.surface").write_bytes(bytes_)
        done = render(folder, scene, "-o", "bad.wav")
        assert (
            done.returncode == 2 and part in done.stderr and len(done.stderr.splitlines()) == 1 and not (folder / "bad.wav").exists()
        ), done
    (folder / "bar.surface").unlink()
    done = render(folder, scene, "-o", "bad.wav")
    assert done.returncode == 2 and 'scene.json:1: the recording of body "bar"' in done.stderr and not (folder / "bad.wav").exists(), done
    # The played file is not overwritten.
    (folder / "bar.surface").write_bytes(whole)
    done = render(folder, scene, "-o", "out.wav", "--report", "bar.surface")
    assert done.returncode == 2 and 'recording of "bar"' in done.stderr and (folder / "bar.surface").read_bytes() == whole, done
