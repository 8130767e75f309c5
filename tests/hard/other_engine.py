#!/usr/bin/env python3
"""The same drop by Bullet and by our own physics: the same contacts make the same sound, live or from the file, and both engines agree on
the first hit.

usage: other_engine.py other_engine
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from figure import hold

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
CASE = "other_engine"
AXIS, ANGLE = np.array([0.6, 0.8, 0.0]), 0.5  # how the body is turned
MASS, SIDE, HEIGHT, RESTITUTION = 1.0, 0.1, 0.4, 0.5  # of write_cube_bank and of that drop


def run(*command, words=None):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, input=words)
    if done.returncode != 0:
        sys.exit(f"{command[0]} failed: {done.stdout}{done.stderr}")
    return done.stdout


def read_float_wav(file):
    """(frames, 2) of a WAV file of 32-bit floats."""
    data = file.read_bytes()
    at = data.index(b"data")
    size = int.from_bytes(data[at + 4 : at + 8], "little")
    return np.frombuffer(data[at + 8 : at + 8 + size], dtype="<f4").reshape(-1, 2)


def read_hits(file):
    """Start and impulse of every hit, whether a pulse or forces step by step (those that continue one belong to it)."""
    hits = []
    for event in map(json.loads, file.read_text().splitlines()[1:]):
        if "impulse" in event:
            hits.append([event["impulse"]["time_s"] - event["impulse"]["duration_s"] / 2, np.array(event["impulse"]["impulse_n_s"])])
        elif "force" in event:
            force = event["force"]
            total = np.array(force["impulse_n_s"]).reshape(-1, 3).sum(axis=0)
            if force.get("continues"):
                hits[-1][1] = hits[-1][1] + total
            else:
                hits.append([force["time_s"], total])
    return hits


def write_scene(file, **body):
    file.write_text(
        json.dumps(
            {
                "duration_s": 1.5,
                "ground": {"height_m": 0.0, "restitution": RESTITUTION},
                "listener": {"position_m": [0, -1, 0.4]},
                "effects": ["modal", "hertz_pulse", "contact_damping", "air_delay", "doppler", "two_ears"],
                "output": {"format": "float", "gain": 1e-3, "fade_end": False},
                "bodies": [{"name": "body", "bank": "cube.h5", "restitution": RESTITUTION, "friction": 0.4, **body}],
            }
        )
    )


def turn(v, angle):
    """v turned about AXIS (Rodrigues)."""
    return v * math.cos(angle) + np.cross(AXIS, v) * math.sin(angle) + AXIS * (AXIS @ v) * (1 - math.cos(angle))


def predict_first_hit():
    """Time and impulse of the lowest corner's hit by Newton's restitution and a contact that sticks, in the world: J = M^-1 (change of
    velocity)."""
    corners = [
        turn(np.array([x, y, z]), ANGLE) for x in (-SIDE / 2, SIDE / 2) for y in (-SIDE / 2, SIDE / 2) for z in (-SIDE / 2, SIDE / 2)
    ]
    arm = min(corners, key=lambda corner: corner[2])
    time = math.sqrt(2 * (HEIGHT + arm[2]) / 9.81)
    cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    mobility = np.eye(3) / MASS - cross @ cross / (MASS * SIDE * SIDE / 6)
    wanted = np.array([0.0, 0.0, (1 + RESTITUTION) * 9.81 * time])
    return time, np.linalg.solve(mobility, wanted)


def main():
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        run(BIN / "write_cube_bank", root / "cube.h5")
        half, turned = f" {SIDE / 2}" * 3, [math.cos(ANGLE / 2), *(math.sin(ANGLE / 2) * AXIS)]
        cube = f"body box {root / 'cube.h5'} {half} 0 0 {HEIGHT} {' '.join(map(str, turned))} 0 0 0 0 0 0 {RESTITUTION}"
        run(BIN / "engine_bullet", 2000, 1.5, root / "bullet.jsonl", root / "live.f32", words=cube)
        run(BIN / "engine_bullet", 2000, 1.5, root / "rigid.jsonl", root / "rigid.f32", 0, words=cube)  # no impacts with modes
        assert " 0 events lost" in run(BIN / "bullet_drop", root / "cube.h5", root / "example.f32")
        write_scene(root / "replay.json", position_m=[0, 0, HEIGHT])
        run(BIN / "carillon-render", "-q", root / "replay.json", "-o", root / "replay.wav", "--contacts", root / "bullet.jsonl")
        live = np.fromfile(root / "live.f32", dtype="<f4").reshape(-1, 2)[16:] * np.float32(1e-3)  # 16 frames: the latency
        replay = read_float_wav(root / "replay.wav")
        frames = min(len(live), len(replay))
        peak = np.abs(live).max()
        assert frames > 71000 and peak > 0
        hold(CASE, np.abs(live[:frames] - replay[:frames]).max() / peak, 1e-6, "Bullet live against its contacts file, over the peak")

        degrees = [math.degrees(angle) for angle in find_fixed_angles()]
        write_scene(root / "own.json", position_m=[0, 0, HEIGHT], rotation_deg=degrees)
        run(BIN / "carillon-render", "-q", root / "own.json", "-o", root / "own.wav", "--record", root / "own.jsonl")
        run(BIN / "carillon-render", "-q", root / "own.json", "-o", root / "again.wav", "--contacts", root / "own.jsonl")
        hold(
            CASE,
            float((root / "own.wav").read_bytes() != (root / "again.wav").read_bytes()),
            0.0,
            "our own contacts again, bytes that differ",
        )

        time, impulse = predict_first_hit()
        size = np.linalg.norm(impulse)
        for engine, max_s, most in (("rigid", 1.0 / 2000.0, 0.03), ("own", 2e-6, None)):
            hits = read_hits(root / f"{engine}.jsonl")
            assert len(hits) > 5, engine
            start, given = hits[0]
            hold(CASE, abs(start - time), max_s, f"{engine}: time of the first hit against the closed form [s]")
            there = turn(given, ANGLE)
            if engine == "rigid":
                hold(CASE, np.linalg.norm(there - impulse) / size, most, f"{engine}: its impulse against the closed form")
            else:
                # The body rings while it is struck: its corner yields and pushes back; an elastic rigid impact is the most that it can
                # get.
                assert there[2] > 0
                hold(
                    CASE,
                    max(0.0, there[2] / impulse[2] * (1 + RESTITUTION) / 2 - 1.0),
                    1e-3,
                    f"{engine}: its impulse beyond an elastic one",
                )


def find_fixed_angles():
    """The turn as angles about the fixed axes x, then y, then z, as a scene has it."""
    m = np.array([turn(axis, ANGLE) for axis in np.eye(3)]).T
    return math.atan2(m[2, 1], m[2, 2]), -math.asin(m[2, 0]), math.atan2(m[1, 0], m[0, 0])


if __name__ == "__main__":
    main()
