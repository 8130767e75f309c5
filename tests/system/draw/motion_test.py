#!/usr/bin/python3
"""Simulates a struck bar, draws its motion, and compares outline and colour of the pictures with the projected points of the file."""
import contextlib
import importlib
import io
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy

from read_picture import count_like, read_png

PROGRAMS = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
YELLOW = (253, 231, 37)  # the largest speed
FACTOR = 400
JOB = {
    "simulate": {
        "duration_s": 0.001,
        "bodies": [
            {
                "name": "bar",
                "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}},
                "material": {
                    "young_modulus_pa": 70e9,
                    "poisson_ratio": 0.33,
                    "density_kg_m3": 2700,
                    "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}},
                },
                "fixed": "x-min",
            }
        ],
        "impulses": [{"time_s": 1e-4, "body": "bar", "point_m": [0.05, 0, 0.005], "impulse_n_s": [0, 0, -0.001]}],
        "motion_hz": 2000,
    },
    "motion": "bar.vtkhdf",
}
faults = []


def expect(true, what):
    if not true:
        faults.append(what)
        print("FAULT:", what)


def run(*arguments):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    return subprocess.run(
        [PROGRAMS / "carillon-draw", "motion", *arguments], cwd=folder, capture_output=True, text=True, timeout=200, env=environment
    )


def load_program():
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(PROGRAMS / "carillon-draw"))
    return importlib.import_module("program")


def run_here(program, arguments):
    """Exit code and standard error of the program in this process: starting Python for each invalid input would dominate the test."""
    sys.argv = ["carillon-draw", "motion", *arguments]
    with contextlib.redirect_stderr(io.StringIO()) as errors:
        code = program.main()
    return code, errors.getvalue()


def project(points):
    """Across and up in the picture: parallel, from 28 degrees to the right of -y, 34 degrees above the plane z = 0."""
    azimuth, elevation = math.radians(28), math.radians(34)
    right = numpy.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    toward = numpy.array([math.sin(azimuth) * math.cos(elevation), -math.cos(azimuth) * math.cos(elevation), math.sin(elevation)])
    return points @ numpy.array([right, numpy.cross(toward, right)]).T


def find_outline(image):
    """Bounding box of the non-white pixels above the time: left, right, top, bottom."""
    ink = image.min(axis=2) < 200
    columns, rows = numpy.flatnonzero(ink.any(axis=0)), numpy.flatnonzero(ink.any(axis=1))
    return numpy.array([columns[0], columns[-1] + 1, rows[0], rows[-1] + 1], float)


def check_frames(times_s, points, speed):
    images = [read_png(folder / f"film/{number + 1:05d}.png") for number in range(len(times_s))]
    expect(len({image.shape for image in images}) == 1, "frames differ in size")
    expect(images[0].shape[0] % 2 == 0 and images[0].shape[1] % 2 == 0, f"frames of {images[0].shape} pixels are odd: no film of them")
    rest = points[0]
    wanted = []
    for place in points:
        seen = project(rest + FACTOR * (place - rest))
        wanted.append([seen[:, 0].min(), seen[:, 0].max(), -seen[:, 1].max(), -seen[:, 1].min()])
    wanted = numpy.array(wanted)
    found = numpy.array([find_outline(image[:-150]) for image in images])
    # All frames share scale and position: both follow from the width at rest.
    pixel = (wanted[0, 1] - wanted[0, 0]) / (found[0, 1] - found[0, 0])
    shift = found[0, [0, 2]] - wanted[0, [0, 2]] / pixel
    error = numpy.abs(found - (wanted / pixel + shift[[0, 0, 1, 1]])).max()
    moved = numpy.ptp(wanted / pixel, axis=0).max()
    expect(moved > 20, f"the outline moves by {moved:.1f} pixels: nothing is tested")
    expect(error < 3, f"outlines are off by {error:.1f} pixels")
    print(f"outlines: off by at most {error:.2f} pixels, where they move by {moved:.1f}")

    fastest = int(speed.max(axis=1).argmax())
    yellow = [count_like(image[:-150], YELLOW) for image in images]
    expect(yellow[0] == 0, f"a bar at rest has {yellow[0]} pixels of the largest speed")
    expect(yellow[fastest] > 100, f"frame {fastest + 1}, the fastest, has {yellow[fastest]} pixels of the largest speed")


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    (folder / "bar.json").write_text(json.dumps(JOB))
    subprocess.run([PROGRAMS / "carillon-simulate", "bar.json"], cwd=folder, check=True, timeout=200, stdout=subprocess.DEVNULL)
    with h5py.File(folder / "bar.vtkhdf") as file:
        root = file["VTKHDF"]
        times_s = root["Steps/Values"][:]
        points = root["Points"][:].astype(float).reshape(len(times_s), -1, 3)
        speed = root["PointData/speed"][:].reshape(len(times_s), -1)
    expect(numpy.abs(times_s - numpy.arange(3) / 2000).max() < 1e-12, f"times of the frames are {times_s}")
    expect(not numpy.signbit(times_s).any(), "the first frame is at -0 s")

    done = run("bar.vtkhdf", "-o", "strip.png", "--moments", "3", "--frames", "film", "--exaggerate", str(FACTOR))
    expect(done.returncode == 0, f"exit code {done.returncode}: {done.stderr}")
    if done.returncode == 0:
        expect(len(list((folder / "film").iterdir())) == len(times_s), "there are other frames than in the file")
        check_frames(times_s, points, speed)
        image = read_png(folder / "strip.png")
        third = image.shape[1] // 3
        expect(image.shape[1] == 1860, f"the strip is {image.shape[1]} pixels wide")
        first, last = (count_like(image[:-150, side], YELLOW) for side in (slice(third), slice(-third, None)))
        expect(first == 0 and last > 100, f"the strip has {first} and {last} pixels of the largest speed")

    # Invalid input.
    data = (folder / "bar.vtkhdf").read_bytes()
    (folder / "cut.vtkhdf").write_bytes(data[: len(data) // 2])
    (folder / "text.vtkhdf").write_text("hello")
    h5py.File(folder / "other.vtkhdf", "w").close()
    shutil.copy(folder / "bar.vtkhdf", folder / "nan.vtkhdf")
    with h5py.File(folder / "nan.vtkhdf", "r+") as file:
        file["VTKHDF/Points"][-1, 0] = numpy.nan
    before = sorted(folder.rglob("*"))
    os.chdir(folder)
    program = load_program()
    for arguments, words in [
        (["absent.vtkhdf", "-o", "x.png"], ["absent.vtkhdf", "No such file"]),
        (["cut.vtkhdf", "-o", "x.png"], ["cut.vtkhdf", "truncated"]),
        (["text.vtkhdf", "-o", "x.png"], ["text.vtkhdf", "not an HDF5 file"]),
        (["other.vtkhdf", "-o", "x.png"], ["other.vtkhdf", "not a motion", "carillon-simulate --motion"]),
        (["nan.vtkhdf", "--frames", "new"], ["nan.vtkhdf", "frame 3", "finite"]),
        (["bar.vtkhdf"], ["-o OUT.png", "--frames"]),
        (["bar.vtkhdf", "-o", "x.png", "--frames", "film"], ["film", "not empty"]),
        (["bar.vtkhdf", "-o", "x.png", "--moments", "0"], ["--moments 0", "1 to 24"]),
        (["bar.vtkhdf", "-o", "x.png", "--exaggerate", "nan"], ["--exaggerate nan", "above 0"]),
        (["bar.vtkhdf", "-o", "x.png", "--colour", "stress"], ["--colour", "speed", "displacement"]),
    ]:
        code, message = run_here(program, arguments)
        expect(code == 2, f"{arguments}: exit code {code}, not 2: {message}")
        expect(message.count("\n") == 1, f"{arguments}: not one line: {message!r}")
        for word in words:
            expect(word in message, f"{arguments}: '{word}' is not in: {message}")
    os.chdir("/")
    expect(sorted(folder.rglob("*")) == before, "a command that failed left a file behind")

print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
