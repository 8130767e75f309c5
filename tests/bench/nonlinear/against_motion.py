#!/usr/bin/python3
"""A nonlinear bank against full-order motion: one sheet under the same blows, soft to hard, by carillon-render and
carillon-simulate.

usage: tests/bench/nonlinear/against_motion.py [--bin BIN_DIR] [--out FOLDER] [--modes N] [--quick]

The sheet is hinged along its border, which does not move. Its bank has T10 elements, one layer of them, and holds the nodes of the border
in the middle of the thickness; the simulation has mid-edge (Morley) bending and constant-strain membranes: the two share no element and no
integrator. Both have the same Rayleigh damping, and the same force: a raised cosine, which the scene makes of 64 short strikes. What is
compared are velocities at three places of the surface, so that no radiation is between them: the simulation's vertices, and banks whose
gains are the modes' shapes there.

Printed for each blow: the deepest dent; glide, from the pitch of the lowest mode in the first 0.1 s to that in the last; centroid of the
power and level over the whole, 0.5 s; CPU seconds. A figure that misses its limit (20 cents, 10 %, 2 dB) is marked, and the exit code is
then 1. --modes: coupled ones of the bank. --quick: one blow on coarse meshes, with wider limits. Runs of carillon-simulate that --out
already has are not made again.
"""
import argparse
import hashlib
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

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "docs/examples"))
import measure  # noqa: E402

LENGTH_M, WIDTH_M, THICKNESS_M = 0.3, 0.22, 0.001
MATERIAL = {
    "young_modulus_pa": 200e9,
    "poisson_ratio": 0.3,
    "density_kg_m3": 7850,
    "damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 6}},
}
POINT_M = (0.05, 0.037)
BLOW_S, MIDDLE_S = 2e-3, 2e-3
MOTION_HZ = 24000
PITCH_S = 0.1  # a pitch is that of so long
PICKUPS_M = ((0.062, -0.041), (-0.093, 0.027), (0.011, 0.071))
SIDES = {1: "plus", -1: "minus"}
SMALL = 1e-3  # of a gain, which may not be more than a surface could send
PIECES = 64  # strikes of the scene that make one blow
BLOWS = {"soft": 0.005, "medium": 0.05, "hard": 0.2}  # N s
FULL = {"cells": 32, "nodes": 16000, "modes": 50, "duration_s": 0.51, "blows": BLOWS, "limits": (20.0, 10.0, 2.0)}
QUICK = {"cells": 16, "nodes": 2500, "modes": 12, "duration_s": 0.23, "blows": {"medium": 0.05}, "limits": (40.0, 20.0, 3.0)}


def run(options, *words):
    """CPU seconds of a program."""
    before = os.times()
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = subprocess.run([options.bin / words[0], *words[1:]], cwd=options.out, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"against_motion.py: {' '.join(words)} failed: {done.stderr.strip() or done.stdout.strip()}")
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def make_hinge():
    """The nodes of the border in the middle of the thickness: it does not move, and turns freely."""
    boxes, far, thin = [], 1.0, THICKNESS_M / 10
    for axis, half in ((0, LENGTH_M / 2), (1, WIDTH_M / 2)):
        for side in (-half, half):
            low, high = [-far, -far, -thin], [far, far, thin]
            low[axis], high[axis] = side - 1e-6, side + 1e-6
            boxes.append({"box_m": {"min": low, "max": high}})
    return boxes


def make_bank(options, plan):
    """CPU seconds of the solve of sheet.hdf."""
    job = {
        "body": {"shape": "plate", "length_m": LENGTH_M, "width_m": WIDTH_M, "thickness_m": THICKNESS_M, "nodes": plan["nodes"]},
        "material": MATERIAL,
        "fixed": make_hinge(),
        "band_hz": [20, 9000],
        "nonlinear": {"modes": plan["modes"], "below_hz": 5000},
        "shapes": "exact",
        "bank": "sheet.hdf",
    }
    (options.out / "sheet.json").write_text(json.dumps(job, indent=1) + "\n")
    return run(options, "carillon-precompute", "sheet.json")


def make_grid(vertices, shape):
    """(x, y, (nx, ny, modes) values of the upper side) of (vertices, modes) values at the vertices of a plate."""
    upper = vertices[:, 2] > 0.49 * THICKNESS_M
    places, shape = numpy.round(vertices[upper], 9), shape[upper]
    x, y = numpy.unique(places[:, 0]), numpy.unique(places[:, 1])
    grid = numpy.full((len(x), len(y), shape.shape[1]), numpy.nan)
    grid[numpy.searchsorted(x, places[:, 0]), numpy.searchsorted(y, places[:, 1])] = shape
    assert numpy.isfinite(grid).all(), "the upper side of the bank is not a grid"
    return x, y, grid


def interpolate(knots, at):
    """(places, knots) weights of cubic polynomials through the four knots around each place."""
    weights = numpy.zeros((len(at), len(knots)))
    for row, place in enumerate(at):
        first = min(max(numpy.searchsorted(knots, place) - 2, 0), len(knots) - 4)
        four = knots[first : first + 4]
        for k in range(4):
            others = numpy.delete(four, k)
            weights[row, first + k] = numpy.prod((place - others) / (four[k] - others))
    return weights


def simulate(options, plan, name, impulse):
    """CPU seconds of the simulation whose motion is NAME.vtkhdf."""
    job = {
        "simulate": {
            "duration_s": plan["duration_s"],
            "bodies": [
                {
                    "name": "sheet",
                    "sheet": {
                        "shape": "rectangle",
                        "length_m": LENGTH_M,
                        "width_m": WIDTH_M,
                        "thickness_m": THICKNESS_M,
                        "cells": plan["cells"],
                    },
                    "material": MATERIAL,
                    "hinged": "rim",
                }
            ],
            "impulses": [
                {"time_s": MIDDLE_S, "body": "sheet", "point_m": [*POINT_M, 0], "impulse_n_s": [0, 0, -impulse], "duration_s": BLOW_S}
            ],
            "motion_hz": MOTION_HZ,
        },
        "motion": f"{name}.vtkhdf",
        "record": f"{name}.record.json",
    }
    file, text = options.out / f"{name}.json", json.dumps(job, indent=1) + "\n"
    if not ((options.out / f"{name}.vtkhdf").exists() and file.exists() and file.read_text() == text):
        file.write_text(text)
        run(options, "carillon-simulate", "-q", f"{name}.json")
    return json.loads((options.out / f"{name}.record.json").read_text())["cpu_seconds"]


def read_motion(options, name):
    """(velocities (frames, pickups) of the simulation along z, deepest dent in thicknesses)"""
    with h5py.File(options.out / f"{name}.vtkhdf") as file:
        frames = len(file["VTKHDF/Steps/Values"])
        places = file["VTKHDF/Points"][:].reshape(frames, -1, 3)
    rest, height = numpy.round(places[0].astype(float), 6), places[:, :, 2].astype(float)
    x, y = numpy.unique(rest[:, 0]), numpy.unique(rest[:, 1])
    order = numpy.argsort(numpy.searchsorted(x, rest[:, 0]) * len(y) + numpy.searchsorted(y, rest[:, 1]))
    grid = height[:, order].reshape(frames, len(x), len(y))
    at = numpy.array(PICKUPS_M)
    moved = numpy.einsum("fij,pi,pj->fp", grid, interpolate(x, at[:, 0]), interpolate(y, at[:, 1]), optimize=True)
    return differentiate(moved), abs(height).max() / THICKNESS_M


def differentiate(columns):
    """By time, of columns sampled at MOTION_HZ that begin at rest, without an error of phase or level below half of it; the end fades."""
    fade = int(0.008 * MOTION_HZ)
    columns = columns.copy()
    columns[-fade:] *= (0.5 + 0.5 * numpy.cos(numpy.pi * (numpy.arange(fade) + 1) / fade))[:, None]
    omega = 2j * numpy.pi * numpy.fft.rfftfreq(len(columns), 1 / MOTION_HZ)
    return numpy.fft.irfft(omega[:, None] * numpy.fft.rfft(columns, axis=0), len(columns), axis=0)


def seal(file):
    """As docs/bank-format.md has it."""
    lines = []
    with h5py.File(file) as bank:

        def add(name, item):
            if isinstance(item, h5py.Dataset) and not name.startswith("VTKHDF"):
                lines.append(" ".join(map(str, ["field", name, item.dtype.str, item.size and item.id.get_offset(), *item.shape])))

        bank.visititems(add)
        lines.insert(0, "CARILLON BANK " + bank.attrs["version"])
    data = bytearray(file.read_bytes())
    lines.insert(1, f"length {len(data)}")
    data[:4032] = "\n".join(lines).encode().ljust(4032, b"\n")
    data[4032:4096] = hashlib.sha256(data[:4032] + data[4096:]).hexdigest().encode()
    file.write_bytes(data)


def make_pickups(options):
    """Banks PICKUP-plus.hdf and PICKUP-minus.hdf, whose gains are shapes along z at the pickups where they are positive and, the other way,
    where they are negative: the difference of what they sound is the velocity there. The programs scale gains where they correct
    frequencies; that is undone."""
    for pickup, point in enumerate(PICKUPS_M):
        for sign, side in SIDES.items():
            file = options.out / f"{pickup}-{side}.hdf"
            shutil.copyfile(options.out / "sheet.hdf", file)
            with h5py.File(file, "r+") as bank:
                vertices, triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
                x, y, grid = make_grid(vertices, bank["modes/shape"][:, :, 2] * bank["modes/shape_scale"][:])
                shape = numpy.einsum("i,j,ijm->m", interpolate(x, point[:1])[0], interpolate(y, point[1:])[0], grid, optimize=True)
                sides = vertices[triangles[:, 1:]] - vertices[triangles[:, :1]]
                area = numpy.linalg.norm(numpy.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2
                scale = [
                    calc_gain(w, area)
                    for w in (bank["modes/eigenvalue"][:] ** 0.5, 2e0 * numpy.pi * bank["modes/corrected_frequency_hz"][:])
                ]
                bank["modes/radiation_gain"][:] = SMALL * numpy.maximum(sign * shape, 0) * scale[0] / scale[1]
            seal(file)


def calc_gain(omega, area):
    """A pulsating sphere's of this surface, but for a factor (E5)."""
    return omega / numpy.sqrt(1 + (omega / 343) ** 2 * area / (4 * numpy.pi))


def render(options, plan, name, impulse):
    """(rate, velocities (samples, pickups) along z, CPU seconds of one rendering)"""
    times = (numpy.arange(PIECES) + 0.5) / PIECES
    weights = (1 - numpy.cos(2 * numpy.pi * times)) / PIECES
    strikes = [
        {
            "time_s": MIDDLE_S + (t - 0.5) * BLOW_S,
            "body": "sheet",
            "point_m": [*POINT_M, THICKNESS_M / 2],
            "impulse_n_s": [0, 0, -impulse * w],
            "duration_s": 2 * BLOW_S / PIECES,
        }
        for t, w in zip(times, weights)
    ]
    scene = {
        "duration_s": plan["duration_s"],
        "strikes": strikes,
        "microphones": [[0, 0, 1]],
        "radiation": "osg02",
        "effects": ["modal", "hertz_pulse", "nonlinear"],
        "output": {"gain": 1e-2, "format": "float", "fade_end": False},
    }
    velocities = []
    for pickup in range(len(PICKUPS_M)):
        parts = []
        for side in SIDES.values():
            text = json.dumps({**scene, "bodies": [{"name": "sheet", "bank": f"{pickup}-{side}.hdf", "fixed": True}]}, indent=1)
            (options.out / f"{name}-scene.json").write_text(text + "\n")
            seconds = run(
                options, "carillon-render", f"{name}-scene.json", "-o", f"{name}.wav", "--report", f"{name}-report.json", "--quiet"
            )
            report = json.loads((options.out / f"{name}-report.json").read_text())
            rate, samples = measure.read_wav(options.out / f"{name}.wav")
            parts.append(samples[:, 0] / report["gain_per_pa"] / SMALL)
        velocities.append(parts[0] - parts[1])
    return rate, numpy.transpose(velocities), seconds


def calc_centroid(velocities, rate):
    """Of the power of all pickups [Hz], up to what both sides have."""
    freq = numpy.fft.rfftfreq(len(velocities), 1 / rate)
    power = (abs(numpy.fft.rfft(velocities * numpy.hanning(len(velocities))[:, None], axis=0)) ** 2).sum(axis=1)
    power[freq > MOTION_HZ / 2] = 0
    return (freq * power).sum() / power.sum()


def find_pitch(velocities, rate, first_hz):
    """Of the lowest mode [Hz]: the strongest peak up to a fourth above it."""
    return measure.find_peaks(velocities, rate, 0.9 * first_hz, 1.35 * first_hz, 1)[0][0]


def describe(velocities, rate, plan, first_hz):
    """(glide in cents, centroid in Hz, level in dB re 1 m/s)"""
    heard = velocities[: int((plan["duration_s"] - 0.01) * rate)]
    begin, count = int((MIDDLE_S + BLOW_S / 2) * rate), int(PITCH_S * rate)
    early, late = (find_pitch(part, rate, first_hz) for part in (heard[begin : begin + count], heard[-count:]))
    return 1200 * numpy.log2(early / late), calc_centroid(heard, rate), 10 * numpy.log10((heard**2).mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--modes", type=int)
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    options.bin = options.bin.resolve()
    plan = dict(QUICK if options.quick else FULL)
    plan["modes"] = options.modes or plan["modes"]
    with tempfile.TemporaryDirectory() as folder:
        options.out = (options.out or pathlib.Path(folder)).resolve()
        options.out.mkdir(parents=True, exist_ok=True)
        sys.exit(compare(options, plan))


def compare(options, plan):
    solve_s = make_bank(options, plan)
    make_pickups(options)
    with h5py.File(options.out / "sheet.hdf") as file:
        freq_hz, coupled = file["modes/corrected_frequency_hz"][:], len(file["nonlinear/modes"])
    first_hz = calc_first_hz()
    print(
        f"bank: {coupled} coupled modes of {len(freq_hz)}, {solve_s:.1f} CPU s; lowest {freq_hz[0]:.2f} Hz, closed form {first_hz:.2f} Hz;"
        f" simulation: {plan['cells']} cells\n"
        "| blow | impulse, N s | dent, thicknesses | glide, cents: simulation, bank | centroid, Hz: simulation, bank"
        " | level, dB: bank - simulation | CPU s: simulation, bank |\n"
        "|---|--:|--:|--:|--:|--:|--:|"
    )
    missed = []
    for name, impulse in plan["blows"].items():
        simulate_s = simulate(options, plan, name, impulse)
        motion, dent = read_motion(options, name)
        true_glide, true_centroid, true_level = describe(motion, MOTION_HZ, plan, first_hz)
        rate, velocities, render_s = render(options, plan, name, impulse)
        glide, centroid, level = describe(velocities, rate, plan, first_hz)
        off = (abs(glide - true_glide), abs(100 * (centroid / true_centroid - 1)), abs(level - true_level))
        marks = ["" if value <= limit else " MISSED" for value, limit in zip(off, plan["limits"])]
        print(
            f"| {name} | {impulse:g} | {dent:.2f} | {true_glide:.1f}, {glide:.1f}{marks[0]} | {true_centroid:.0f}, {centroid:.0f}"
            f" ({100 * (centroid / true_centroid - 1):+.1f} %){marks[1]} | {level - true_level:+.2f}{marks[2]}"
            f" | {simulate_s:.1f}, {render_s:.1f} |",
            flush=True,
        )
        missed += [f"{name} {what}" for what, mark in zip(("glide", "centroid", "level"), marks) if mark]
    return f"missed: {', '.join(missed)}" if missed else 0


def calc_first_hz():
    """Of the hinged plate (Kirchhoff)."""
    stiffness = MATERIAL["young_modulus_pa"] * THICKNESS_M**3 / (12 * (1 - MATERIAL["poisson_ratio"] ** 2))
    return math.pi / 2 * math.sqrt(stiffness / (MATERIAL["density_kg_m3"] * THICKNESS_M)) * (LENGTH_M**-2 + WIDTH_M**-2)


if __name__ == "__main__":
    main()
