#!/usr/bin/python3
"""Draws small banks and a small scene, and checks the pictures against their content."""
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

import make_bank
from read_picture import count_like, read_png

PROGRAM = pathlib.Path(os.environ["CARILLON_BIN_DIR"]) / "carillon-draw"
AIR_BANK = pathlib.Path(__file__).parents[2] / "unit/runtime/bank/pinned/version_1_5.hdf"
faults = []


def expect(true, what):
    if not true:
        faults.append(what)
        print("FAULT:", what)


def run(*arguments, folder):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    return subprocess.run([PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, timeout=200, env=environment)


def run_in_process(*arguments, folder):
    """The same in this process, for errors before drawing."""
    program, before, errors = load("program"), (os.getcwd(), sys.argv), io.StringIO()
    os.chdir(folder)
    sys.argv = [str(PROGRAM), *arguments]
    try:
        with contextlib.redirect_stderr(errors):
            code = program.main()
    except SystemExit as end:
        code = end.code
    finally:
        os.chdir(before[0])
        sys.argv = before[1]
    return subprocess.CompletedProcess(arguments, code, "", errors.getvalue())


def split_panels(image, count):
    """Panels of a picture of directivity, without their labels, as carillon-draw arranges them."""
    columns, width, height = load("picture").choose_panels(count, 1.0)
    corners = [(index // columns * height, index % columns * width) for index in range(count)]
    return [image[y : y + height - 112, x : x + width] for y, x in corners]


def measure_ink(image):
    """Width and height of the coloured pixels: balloon and body, without the rings."""
    ink = numpy.ptp(image.astype(int), axis=2) > 40
    return numpy.ptp(numpy.flatnonzero(ink.any(axis=0))) + 1, numpy.ptp(numpy.flatnonzero(ink.any(axis=1))) + 1


def spoil(source, target, change):
    """A copy of a bank with `change` applied to its HDF5 part and a new checksum."""
    shutil.copy(folder / source, folder / target)
    with h5py.File(folder / target, "r+") as bank:
        change(bank)
    make_bank.seal(folder / target)


def load(name):
    """A module of the program."""
    sys.dont_write_bytecode = True
    if str(PROGRAM) not in sys.path:
        sys.path.insert(0, str(PROGRAM))
    return importlib.import_module(name)


def check_patterns():
    """Far patterns against closed forms: (-i)^(l + 1) / h_l of orders 0 to 2 and real harmonics, both written out."""
    draw = load("far_field")
    polar, azimuth = numpy.linspace(0, math.pi, 181), 2 * math.pi * numpy.arange(360) / 360
    x = numpy.sin(polar)[:, None] * numpy.cos(azimuth)
    y = numpy.sin(polar)[:, None] * numpy.sin(azimuth)
    z = numpy.cos(polar)[:, None] + 0 * azimuth
    third = math.sqrt(3 / (4 * math.pi))
    fifth = math.sqrt(15 / (4 * math.pi))
    harmonics = [math.sqrt(0.25 / math.pi) + 0 * x, third * y, third * z, third * x]
    harmonics += [fifth * x * y, fifth * y * z, math.sqrt(5 / (16 * math.pi)) * (3 * z * z - 1), fifth * x * z, fifth / 2 * (x * x - y * y)]
    for waves in (0.05, 1.3, 9.0):
        x0 = waves  # DLMF 10.49.6
        hankel = [-1j / x0, -(x0 + 1j) / x0**2, 1j * (x0**2 + 3j * x0 - 3) / x0**3]
        inverse = [(-1j) ** (l + 1) / (h * numpy.exp(1j * x0)) for l, h in enumerate(hankel)]
        for index, harmonic in enumerate(harmonics):
            alone = numpy.zeros(9, dtype=complex)
            alone[index] = 2 - 1j
            order = math.isqrt(index)
            wanted = (2 - 1j) * inverse[order] * harmonic
            found = draw.calc_far_pattern(alone, 2, waves, polar, azimuth)
            error = numpy.abs(found - wanted).max() / numpy.abs(wanted).max()
            expect(error < 1e-12, f"pattern of number {index} at kR {waves}: off by {error:.1e}")

    # High orders: on the axis only m = 0 contributes, sqrt((2 l + 1) / 4 pi); the squares of an order sum to (2 l + 1) / 4 pi.
    order = 60
    inverse = draw.calc_inverse_hankels(70.0, order)
    for l in (3, 20, 60):
        alone = numpy.zeros((order + 1) ** 2, dtype=complex)
        alone[l * l : (l + 1) ** 2] = 1.0
        top = draw.calc_far_pattern(alone, order, 70.0, polar, azimuth)[0] / inverse[l]
        expect(numpy.abs(top - math.sqrt((2 * l + 1) / (4 * math.pi))).max() < 1e-11, f"harmonics of order {l} on the axis")
        square = 0
        for m in range(2 * l + 1):
            alone[:] = 0
            alone[l * l + m] = 1
            square = square + numpy.abs(draw.calc_far_pattern(alone, order, 70.0, polar[40:42], azimuth[:5]) / inverse[l]) ** 2
        expect(numpy.abs(square - (2 * l + 1) / (4 * math.pi)).max() < 1e-10, f"Unsoeld's sum of the harmonics of order {l}")
    expect(numpy.isfinite(draw.calc_inverse_hankels(1e-3, 120)).all(), "orders that send nothing are no numbers")

    # ln |cos| over directions has standard deviation 1 along any axis: a null must not dominate.
    for number, (coefficient, order, wanted) in enumerate(
        [([1], 0, 0.0), ([0, 0, 1, 0], 1, 8.6859), ([0, 0, 0, 1], 1, 8.6859), ([0, 1, 0, 0], 1, 8.6859), ([0, 1, -2, 0.5], 1, 8.6859)]
    ):
        rings, sectors = draw.make_equal_areas(order)
        spread = draw.calc_levels(draw.calc_far_pattern(numpy.array(coefficient), order, 1.0, rings, sectors)).std()
        expect(abs(spread - wanted) < 0.1, f"spread of pattern {number}: {spread:.3f} dB, not {wanted}")
    expect(draw.calc_levels(0j * z) is None, "a mode that sends nothing has levels")

    # The closed surface: oriented outward, with the volume enclosed by its radii.
    for levels, volume in [(0 * z, 4 / 3 * math.pi), (-15 + 0 * z, 4 / 3 * math.pi / 8), (-15 * (1 - z), math.pi / 3)]:
        vertices, triangles, colour = load("directivity").make_balloon(levels, polar, azimuth)
        a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
        found = numpy.einsum("ij,ij->", a, numpy.cross(b, c)) / 6
        expect(abs(found / volume - 1) < 1e-3, f"balloon: volume {found:.4f}, not {volume:.4f}")
        expect(numpy.allclose(colour, 1 + levels.ravel() / 30), "balloon: the colour is another level than the radius")


def write_dipoles(bank):
    """Mode 1 a dipole along z, mode 2 one along x, mode 3 a monopole, mode 4 silent."""
    coefficient = numpy.zeros(bank["radiation/coefficient"].shape, "<i2")
    coefficient[[2, 4 + 3, 4 + 9]] = (0, 20000)
    bank["radiation/coefficient"][:] = coefficient
    bank["radiation/scale"][3] = 0.0


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    make_bank.write_ball_bank(folder / "ball.hdf")
    make_bank.write_box_bank(folder / "shelf.hdf", (0.3, 0.2, 0.005))

    # The first three modes: three bodies in three columns, purple at nodes and yellow at antinodes.
    done = run("modes", "ball.hdf", "-o", "modes.png", folder=folder)
    expect(done.returncode == 0, f"modes: exit code {done.returncode}: {done.stderr}")
    if done.returncode == 0:
        image = read_png(folder / "modes.png")
        height, width, _ = image.shape
        expect(width >= 1600 and height >= 500, f"modes: the picture has {width} x {height} pixels")
        for column in range(3):
            part = image[: height - 200, column * width // 3 : (column + 1) * width // 3]
            expect(part.std() > 20, f"modes: column {column} is blank")
            inked = (part.min(axis=2) < 235).mean()
            expect(0.15 < inked < 0.9, f"modes: the body of column {column} covers {inked:.0%}")
            expect(count_like(part, (253, 231, 37)) > 1000, f"modes: nothing moves much in column {column}")
        edges = numpy.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
        expect(edges.min() > 240, "modes: something is cut off at the edge of the picture")

    # Radiation patterns: a dipole along the vertical axis, a horizontal dipole, a monopole, none.
    check_patterns()
    shutil.copy(AIR_BANK, folder / "air.hdf")
    spoil("air.hdf", "dipoles.hdf", write_dipoles)
    done = run("directivity", "dipoles.hdf", "-o", "air.png", "--modes", "1,2,3,4", "--up", "z", folder=folder)
    expect(done.returncode == 0, f"directivity: exit code {done.returncode}: {done.stderr}")
    if done.returncode == 0:
        image = read_png(folder / "air.png")
        expect(image.shape[1] >= 1600, f"directivity: the picture is {image.shape[1]} pixels wide")
        panels = split_panels(image, 4)
        tall, wide, round_, silent = (measure_ink(panel) for panel in panels)
        expect(tall[1] > 1.3 * tall[0], f"directivity: a dipole along the axis up covers {tall[0]} x {tall[1]} pixels")
        expect(wide[0] > 1.15 * wide[1], f"directivity: a dipole across covers {wide[0]} x {wide[1]} pixels")
        expect(abs(round_[0] / round_[1] - 1) < 0.03, f"directivity: a monopole covers {round_[0]} x {round_[1]} pixels")
        expect(silent[0] < 0.5 * round_[0], f"directivity: a silent mode covers {silent[0]} x {silent[1]} pixels")

    # A ball falls on a shelf above the ground.
    poses = [[t, 0.0, 0.0, 0.5 - 4.9 * t * t, 1, 0, 0, 0] for t in numpy.linspace(0, 0.3, 40)]
    scene = {
        "up": "z",
        "ground": {"height_m": -0.05},
        "bodies": [
            {"name": "ball", "bank": "ball.hdf", "fixed": False, "poses": poses},
            {"name": "shelf", "bank": str(folder / "shelf.hdf"), "fixed": True, "poses": [[0, 0, 0, 0, 1, 0, 0, 0]]},
        ],
        "impulses": [{"time_s": 0.3, "body": "ball", "world_m": [0, 0, 0.005], "impulse_n_s": 0.4}],
    }
    (folder / "fall.json").write_text(json.dumps(scene))
    done = run("scene", "fall.json", "-o", "fall.png", folder=folder)
    expect(done.returncode == 0, f"scene: exit code {done.returncode}: {done.stderr}")
    if done.returncode == 0:
        image = read_png(folder / "fall.png")
        height, width, _ = image.shape
        expect(width >= 1600 and height >= 900, f"scene: the picture has {width} x {height} pixels")
        body = image[: height - 150]
        ball = count_like(body, (217, 107, 51))
        expect(ball > 5000, f"scene: the falling ball has {ball} pixels")
        expect(count_like(body, (242, 191, 26), 0.02) > 300, "scene: there is no path")
        expect(count_like(body, (204, 26, 41), 0.02) > 100, "scene: there is no contact")
        scene["impulses"] = []
        (folder / "fall.json").write_text(json.dumps(scene))
        run("scene", "fall.json", "-o", "silent.png", folder=folder)
        piped = subprocess.run([PROGRAM, "scene", "fall.json", "-o", "-"], cwd=folder, capture_output=True, timeout=200)
        expect(piped.stdout == (folder / "silent.png").read_bytes(), "scene: the picture on standard output is another one")
        expect(
            b"pixels" in piped.stderr and not (folder / "-").exists(), f"scene: what is printed in addition to a picture: {piped.stderr}"
        )
        expect(count_like(read_png(folder / "silent.png")[: height - 150], (204, 26, 41), 0.02) < 20, "scene: a contact without an impulse")

    # A mode that does not move the surface is drawn at rest.
    spoil("ball.hdf", "still.hdf", lambda bank: bank["modes/shape"].__setitem__(slice(None), 0))
    done = run("modes", "still.hdf", "-o", "still.png", "--modes", "1", folder=folder)
    expect(done.returncode == 0, f"modes at rest: exit code {done.returncode}: {done.stderr}")
    if done.returncode == 0:
        part = read_png(folder / "still.png")[:-200]
        expect(part.std() > 15, "modes at rest: the picture is blank")
        expect(count_like(part, (253, 231, 37)) < 100, "modes at rest: something moves")

    # Invalid input.
    spoil("ball.hdf", "nan.hdf", lambda bank: bank["mesh/vertices"].__setitem__((0, 0), numpy.nan))
    spoil("ball.hdf", "far.hdf", lambda bank: bank["mesh/vertices"].__setitem__((0, 0), 1e300))
    spoil("ball.hdf", "wild.hdf", lambda bank: bank["mesh/triangles"].__setitem__((0, 0), 10**6))
    spoil("ball.hdf", "point.hdf", lambda bank: bank["mesh/vertices"].__setitem__(slice(None), 0.0))
    spoil("ball.hdf", "endless.hdf", lambda bank: bank["modes/shape_scale"].__setitem__(0, numpy.inf))

    def replace(bank, key, value):
        del bank[key]
        bank[key] = value

    spoil("air.hdf", "order.hdf", lambda bank: bank["radiation/order"].__setitem__(0, 2))
    spoil("air.hdf", "high.hdf", lambda bank: bank["radiation/order"].__setitem__(0, -1))
    spoil("air.hdf", "slow.hdf", lambda bank: bank["radiation/sound_speed_ms"].__setitem__((), 0.0))
    spoil("air.hdf", "loud.hdf", lambda bank: bank["radiation/scale"].__setitem__(0, numpy.nan))
    spoil("air.hdf", "part.hdf", lambda bank: bank.__delitem__("radiation/coefficient"))
    spoil("ball.hdf", "few.hdf", lambda bank: replace(bank, "modes/shape", numpy.zeros((3, 4, 3), "<i2")))
    spoil("ball.hdf", "words.hdf", lambda bank: replace(bank, "modes/frequency_hz", numpy.array([b"a"] * 4)))
    spoil("ball.hdf", "flat.hdf", lambda bank: replace(bank, "mesh/triangles", numpy.zeros(9, "<i4")))
    (folder / "infinite.json").write_text(json.dumps(scene | {"ground": {"height_m": 1e999}}))
    (folder / "remote.json").write_text(
        json.dumps(scene | {"bodies": [{"name": "a", "bank": "ball.hdf", "fixed": True, "poses": [[0, 1e300, 0, 0, 1, 0, 0, 0]]}]})
    )
    (folder / "deep.json").write_text("[" * 100000)
    (folder / "escape.json").write_text(
        '{"bodies": [{"name": "\\u001b]0;x\\u0007\\u009b\\u202e", "bank": "ball.hdf", "fixed": true, "poses": []}]}'
    )
    (folder / "text.hdf").write_text("hello")
    data = (folder / "ball.hdf").read_bytes()
    (folder / "short.hdf").write_bytes(data[:-100])
    (folder / "newer.hdf").write_bytes(data.replace(b"CARILLON BANK 1.0", b"CARILLON BANK 3.0", 1))
    (folder / "packed.hdf").write_bytes(data.replace(b"CARILLON BANK 1.0", b"CARILLON BANK 2.0", 1))
    (folder / "broken.json").write_text('{\n  "bodies": [,]\n}')
    (folder / "empty.json").write_text('{"bodies": []}')
    (folder / "poor.json").write_text('{"bodies": [{"name": "a", "bank": "ball.hdf", "fixed": true, "poses": []}]}')
    (folder / "list.json").write_text("[]")
    (folder / "far.json").write_text('{"bodies": [{"name": "a", "bank": "absent.hdf", "fixed": true, "poses": [[0,0,0,0,1,0,0,0]]}]}')
    before = sorted(folder.iterdir())
    for arguments, words in [
        (["modes", "absent.hdf", "-o", "x.png"], ["absent.hdf", "No such file"]),
        (["modes", "text.hdf", "-o", "x.png"], ["text.hdf", "not a mode bank"]),
        (["modes", "short.hdf", "-o", "x.png"], ["short.hdf", "SHA-256"]),
        (["modes", "newer.hdf", "-o", "x.png"], ["newer.hdf", "version 3.0"]),
        (["modes", "packed.hdf", "-o", "x.png"], ["packed.hdf", "is missing"]),
        (["modes", "ball.hdf", "-o", "x.png", "--modes", "1,5"], ["no mode 5", "which has 4", "1 to 4"]),
        (["modes", "ball.hdf", "-o", "x.png", "--modes", "0"], ["no mode 0", "1 to 4"]),
        (["modes", "ball.hdf", "-o", "x.png", "--modes", "first"], ["'first'", "1 to 4"]),
        (["modes", "ball.hdf", "-o", "x.jpg"], ["x.jpg", ".png"]),
        (["modes", "ball.hdf", "-o", "nowhere/x.png"], ["nowhere", "no such folder"]),
        (["modes", "ball.hdf"], ["-o/--output", "--help"]),
        (["modes", "ball.hdf", "-o", "x.png", "--mode", "1"], ["--mode", "--help"]),
        (["directivity", "ball.hdf", "-o", "x.png"], ["ball.hdf", "no multipoles", "carillon-precompute --radiate", '"radiation": "bem"']),
        (["directivity", "absent.hdf", "-o", "x.png"], ["absent.hdf", "No such file"]),
        (["directivity", "air.hdf", "-o", "x.png", "--modes", "5"], ["no mode 5", "1 to 4"]),
        (["directivity", "order.hdf", "-o", "x.png"], ["order.hdf", "orders", "carillon-bank check"]),
        (["directivity", "high.hdf", "-o", "x.png"], ["high.hdf", "orders"]),
        (["directivity", "slow.hdf", "-o", "x.png"], ["slow.hdf", "speed of sound"]),
        (["directivity", "loud.hdf", "-o", "x.png"], ["loud.hdf", "finite"]),
        (["directivity", "part.hdf", "-o", "x.png"], ["part.hdf", "coefficient"]),
        (["scene", "absent.json", "-o", "x.png"], ["absent.json", "No such file"]),
        (["scene", "broken.json", "-o", "x.png"], ["broken.json", "line 2"]),
        (["scene", "empty.json", "-o", "x.png"], ["empty.json", "no bodies"]),
        (["scene", "poor.json", "-o", "x.png"], ["poor.json", "body 'a'", "poses"]),
        (["scene", "list.json", "-o", "x.png"], ["list.json", "not a trajectory"]),
        (["scene", "far.json", "-o", "x.png"], ["absent.hdf", "No such file"]),
        (["modes", "nan.hdf", "-o", "x.png"], ["nan.hdf", "finite"]),
        (["modes", "far.hdf", "-o", "x.png"], ["far.hdf", "finite"]),
        (["modes", "wild.hdf", "-o", "x.png"], ["wild.hdf", "vertex"]),
        (["modes", "point.hdf", "-o", "x.png"], ["point.hdf", "no extent"]),
        (["modes", "endless.hdf", "-o", "x.png"], ["endless.hdf", "mode 1"]),
        (["modes", "few.hdf", "-o", "x.png"], ["few.hdf", "fit"]),
        (["modes", "words.hdf", "-o", "x.png"], ["words.hdf", "numbers"]),
        (["modes", "flat.hdf", "-o", "x.png"], ["flat.hdf", "triangles"]),
        (["scene", "infinite.json", "-o", "x.png"], ["infinite.json", "finite"]),
        (["scene", "remote.json", "-o", "x.png"], ["remote.json", "too far"]),
        (["scene", "deep.json", "-o", "x.png"], ["deep.json"]),
        (["scene", "escape.json", "-o", "x.png"], ["escape.json", "\\u001b]0;x"]),
        (["scenes", "far.json", "-o", "x.png"], ["scenes", "--help"]),
    ]:
        done = run_in_process(*arguments, folder=folder)
        expect(done.returncode == 2, f"{arguments}: exit code {done.returncode}, not 2: {done.stderr}")
        expect(
            done.stderr.count("\n") == 1
            and not any(ord(letter) in [*range(10), *range(11, 32), *range(127, 160), 0x202E] for letter in done.stderr),
            f"{arguments}: not one printable line: {done.stderr!r}",
        )
        for word in words:
            expect(word in done.stderr, f"{arguments}: '{word}' is not in: {done.stderr}")
    expect(sorted(folder.iterdir()) == before, "a command that failed left a file behind")

print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
