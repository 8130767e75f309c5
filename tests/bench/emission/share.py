#!/usr/bin/python3
"""The share of the sound in the CPU time of carillon-simulate, by samples of perf: emission over emission and transient.

usage: share.py BIN_DIR [BODY...]       of BODIES; CARILLON_INSTRUCTIONS=avx2 or plain takes fewer instructions
"""
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "system/simulate"))
from jobs import ALUMINIUM, PROGRAM, STEEL, write_job

BAR = {"length_m": 0.2, "width_m": 0.02, "thickness_m": 0.01}
PLATE = {"length_m": 0.2, "width_m": 0.2, "thickness_m": 0.006, "nodes": 3000}
SHEET = {"shape": "rectangle", "length_m": 0.3, "width_m": 0.3, "thickness_m": 0.001, "cells": 24}
DISC = {"shape": "disc", "radius_m": 0.1, "thickness_m": 0.0003, "cells": 32}
BALL = {"sphere_m": 0.01, "mass_kg": 0.03, "position_m": [0.01, 0, 0.0102], "velocity_m_s": [0, 0, -2]}


def blow(*point_m):
    return {"impulses": [{"time_s": 0.001, "body": "b", "point_m": point_m, "impulse_n_s": [0, 0, -0.01]}]}


BODIES = {
    "plate, T4": ({"shape": {"plate": PLATE}, "element": "T4", "material": ALUMINIUM, "fixed": "x-min"}, blow(0, 0, 0.003)),
    "bar, T10": ({"shape": {"bar": BAR | {"nodes": 600}}, "material": ALUMINIUM, "fixed": "x-min"}, blow(0.1, 0, 0.005)),
    "small bar, T4": (
        {"shape": {"bar": BAR | {"nodes": 150}}, "element": "T4", "material": ALUMINIUM, "fixed": "x-min"},
        blow(0.1, 0, 0.005),
    ),
    "sheet": ({"sheet": SHEET, "material": STEEL, "fixed": "rim"}, blow(0, 0, 0)),
    "disc and ball": ({"sheet": DISC, "material": STEEL, "fixed": "rim"}, {"strikers": [BALL]}),
}
SOUND = ("emission::", "memmove", "memset")


def main():
    with tempfile.TemporaryDirectory(prefix="carillon-share-") as scratch:
        job, samples = pathlib.Path(scratch) / "job.json", pathlib.Path(scratch) / "samples"
        for name in sys.argv[2:] or BODIES:
            body, blows = BODIES[name]
            write_job(job, {"simulate": {"duration_s": 0.006, "bodies": [{"name": "b"} | body]} | blows, "sound": "sound.wav"})
            counts = [0, 0]
            for _ in range(3):
                subprocess.run(["perf", "record", "-F", "5000", "-q", "-o", samples, PROGRAM, "-q", job], check=True, capture_output=True)
                report = ["perf", "report", "-i", samples, "--stdio", "-F", "sample,symbol"]
                for line in subprocess.run(report, check=True, capture_output=True, text=True).stdout.splitlines():
                    count = line.split()[0] if line.strip() else ""
                    is_sound = any(word in line for word in SOUND)
                    if count.isdigit() and (is_sound or "transient::" in line):
                        counts[0 if is_sound else 1] += int(count)
            print(f"{name:14} {100 * counts[0] / sum(counts):5.1f} %  of {sum(counts)} samples", flush=True)


main()
