#!/usr/bin/python3
"""Bodies with known modes, through the programs: figure 2 of van den Doel and Pai 1996 from the job to the rendered sound; banks of
every kind pass the check and are played, struck and dropped; the queue computes them; invalid input gets one error.

usage: known_bodies.py BIN_DIR SOURCE_DIR
"""
import csv
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy

BIN, SOURCE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
DATA = SOURCE / "tests/unit/precompute/analytic/data"
SQUARE = {"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 1, "lowest_hz": 500, "density_kg_m2": 0.25}}
FIGURE_2 = {"body": SQUARE, "material": {"damping": {"internal_friction": {"tan_phi": 1e-8}}}, "max_modes": 400, "bank": "square.hdf"}
KINDS = {
    "string": {"string": {"length_m": 0.65, "lowest_hz": 110, "diameter_m": 0.0008}},
    "bar": {"beam": {"length_m": 0.3, "width_m": 0.03, "thickness_m": 0.008}},
    "rod": {"beam": {"length_m": 0.3, "diameter_m": 0.01, "ends": ["clamped", "sliding"], "theory": "timoshenko"}},
    "drum": {"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 110, "thickness_m": 0.00025}},
    "l_drum": {"membrane": {"shape": "L", "side_m": 0.2, "lowest_hz": 300, "thickness_m": 0.00025}},
    "kite": {
        "membrane": {
            "shape": "polygon",
            "corners_m": [[0, 0], [0.4, 0.1], [0.3, 0.4], [0.1, 0.2]],
            "tension_n_m": 2000,
            "density_kg_m2": 0.3,
        }
    },
    "plate": {
        "plate": {
            "shape": "rectangle",
            "length_m": 0.3,
            "width_m": 0.2,
            "thickness_m": 0.003,
            "edges": ["clamped", "free", "free", "hinged"],
        }
    },
    "disc": {"plate": {"shape": "circle", "radius_m": 0.15, "thickness_m": 0.003}},
    "table": {"modes_csv": "table.csv", "mass_kg": 0.4, "size_m": [0.1, 0.1, 0.1]},
}
MATERIALS = {"drum": "polyester film", "l_drum": "polyester film", "kite": "polyester film"}
TABLE = "frequency_hz,t60_s,0 0 0.05,0 0 -0.05\n880,1.5,2,-1\n440,3,1,0.5\n"


def run(folder, *words, code=0):
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"},
    )
    assert done.returncode == code, f"{words}: exit code {done.returncode}, not {code}\n{done.stdout}{done.stderr}"
    return done


def write(folder, name, value):
    (folder / name).write_text(value if isinstance(value, str) else json.dumps(value))
    return name


def read_wav(path):
    """Float samples, (n, channels), and the rate: 32-bit float WAV."""
    data = path.read_bytes()
    at, rate, channels = 12, 0, 0
    while True:
        name, size = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        if name == b"fmt ":
            channels, rate = int.from_bytes(data[at + 10 : at + 12], "little"), int.from_bytes(data[at + 12 : at + 16], "little")
        if name == b"data":
            return rate, numpy.frombuffer(data[at + 8 : at + 8 + size], "<f4").reshape(-1, channels).astype(float)
        at += 8 + size + size % 2


def render(folder, point, name):
    scene = {
        "duration_s": 4,
        "radiation": "vddp96",
        "bodies": [{"name": "square", "bank": "square.hdf", "fixed": True}],
        "strikes": [{"time_s": 0.01, "body": "square", "point_m": [*point, 0], "impulse_n_s": [0, 0, -0.001]}],
        "microphones": [[0.5, 0.5, 1]],
        "output": {"format": "float", "fade_end": False},
    }
    write(folder, f"{name}.json", scene)
    run(folder, BIN / "carillon-render", f"{name}.json", "-o", f"{name}.wav", "--quiet")
    rate, samples = read_wav(folder / f"{name}.wav")
    return rate, samples[rate // 10 :, 0]


def list_lines(point, modes=400):
    """{half-waves squared: sum of the amplitudes of degenerate modes}, in closed form."""
    pairs = sorted(((m * m + n * n, m, n) for m in range(1, 60) for n in range(1, 60)))[:modes]
    lines = {}
    for square, m, n in pairs:
        psi = 2 * math.sin(m * math.pi * point[0]) * math.sin(n * math.pi * point[1])
        lines[square] = lines.get(square, 0.0) + psi / math.sqrt(square / 2)
    return lines


def measure_line(samples, rate, freq_hz):
    """Amplitude at one frequency under a Blackman-Harris window."""
    n = len(samples)
    t = numpy.arange(n)
    window = sum(a * numpy.cos(2 * math.pi * k * t / (n - 1)) for k, a in enumerate((0.35875, -0.48829, 0.14128, -0.01168)))
    return 2 * abs(numpy.sum(samples * window * numpy.exp(-2j * math.pi * freq_hz / rate * t))) / window.sum()


def check_figure_2(folder):
    write(folder, "square.json", FIGURE_2)
    run(folder, BIN / "carillon-precompute", "-q", "square.json")
    found = list(csv.DictReader(run(folder, BIN / "carillon-precompute", "square.json", "--at", "0.1,0.1,0").stdout.splitlines()))
    table = list(csv.DictReader((DATA / "square_membrane_fig2.csv").open()))
    assert len(found) == len(table) == 400
    scale = math.sqrt(0.25)  # phi is mass-normalised: Psi over the root of the mass
    by_name = {row["name"]: row for row in found}
    for row in table:  # nine digits, and full precision of the half-waves that it lists
        m, n = int(row["m"]), int(row["n"])
        one = by_name[f"({m}, {n})"]
        hz = 500 * math.sqrt((m * m + n * n) / 2)
        psi = 2 * math.sin(0.1 * math.pi * m) * math.sin(0.1 * math.pi * n)
        assert abs(float(one["frequency_hz"]) / hz - 1) < 1e-9
        assert abs(float(one["phi_z"]) * scale * 500 / float(one["frequency_hz"]) - psi * 500 / hz) < 1e-9
        assert abs(float(one["amplitude"]) * scale * 2 * math.pi * 500 - abs(psi) * 500 / hz) < 1e-9
        assert abs(float(row["f_Hz (f11=500)"]) / hz - 1) < 5e-9 and abs(float(row["a=Psi/omega (x f11*2pi)"]) - psi * 500 / hz) < 1e-9


def check_rendered_lines(folder):
    rate, samples = render(folder, (0.1, 0.1), "figure")
    lines = list_lines((0.1, 0.1))
    loudest = max(map(abs, lines.values()))
    audible = [square for square in sorted(lines) if abs(lines[square]) > 1e-3 * loudest][:40]
    assert len(audible) == 40
    levels = {square: measure_line(samples, rate, 500 * math.sqrt(square / 2)) for square in audible}
    reference = max(levels.values()) / max(abs(lines[square]) for square in audible)
    worst = max(abs(20 * math.log10(levels[square] / reference / abs(lines[square]))) for square in audible)
    print(f"the first 40 lines of the rendered sound: within {worst:.3f} dB")
    assert worst < 0.5, worst


def check_brightness(folder):
    """Centroids of the modes' energies against known ones, rising towards the edge; centroid of the rendered sound against that of its
    lines, in which degenerate modes add with their signs."""
    before = 0.0
    for row in list(csv.reader((DATA / "square_membrane_brightness.csv").open()))[1:]:
        point = float(row[0]), float(row[1])
        table = run(folder, BIN / "carillon-precompute", "square.json", "--at", f"{point[0]},{point[1]},0").stdout
        modes = [(float(one["frequency_hz"]), float(one["amplitude"]) ** 2) for one in csv.DictReader(table.splitlines())]
        known = sum(hz * energy for hz, energy in modes) / sum(energy for _, energy in modes)
        assert abs(known - float(row[2])) < 6e-5 and known > before, (known, row[2], before)
        before = known
        if any(abs(80 * x - round(80 * x)) > 1e-9 for x in point):
            continue  # between surface points of the bank
        lines = list_lines(point)
        wanted = sum(a * a * 500 * math.sqrt(s / 2) for s, a in lines.items()) / sum(a * a for a in lines.values())
        rate, samples = render(folder, point, "bright")
        power = abs(numpy.fft.rfft(samples * numpy.hanning(len(samples)))) ** 2
        centroid = (power * numpy.fft.rfftfreq(len(samples), 1 / rate)).sum() / power.sum()
        print(f"struck at {point}: modes {known:.0f} Hz, sound {centroid:.0f} Hz, wanted {wanted:.0f} Hz")
        assert abs(centroid / wanted - 1) < 0.01, (centroid, wanted)


def check_kinds(folder):
    write(folder, "table.csv", TABLE)
    bodies, strikes = [], []
    for at, (name, body) in enumerate(KINDS.items()):
        job = {"body": body, "band_hz": [20, 3000], "max_modes": 30, "bank": f"{name}.hdf"}
        if name != "table":
            job["material"] = MATERIALS.get(name, "steel")
        write(folder, f"{name}.json", job)
        run(folder, BIN / "carillon-precompute", "-q", f"{name}.json")
        text = run(folder, BIN / "carillon-bank", "check", f"{name}.hdf").stdout
        assert f"{name}.hdf: valid" in text, text
        assert ("by enumeration" in text) == (name != "table"), text
        assert "1 tets" not in text
        again = json.loads((folder / f"{name}.hdf.resolved.json").read_text())
        assert list(again["run"]["mode_names"]) and again["run"]["theory"], again["run"]
        vertex = [0.15, 0.1, 0.0] if name in ("kite", "plate") else [0.1, 0.0, 0.0] if name != "table" else [0, 0, 0.05]
        if name == "l_drum":
            vertex = [0.1, 0.1, 0.0]
        bodies.append({"name": name, "bank": f"{name}.hdf", "fixed": True, "position_m": [at, 0, 0]})
        impulse = [0, 0, -0.001] if name != "string" else [0, 0.0005, -0.0005]
        strikes.append({"time_s": 0.02 + 0.05 * at, "body": name, "point_m": vertex, "impulse_n_s": impulse, "duration_s": 0.0002})
    write(folder, "all.json", {"duration_s": 1, "bodies": bodies, "strikes": strikes})
    run(folder, BIN / "carillon-render", "all.json", "-o", "all.wav", "--report", "all-report.json", "--quiet")
    report = json.loads((folder / "all-report.json").read_text())
    assert report["resets"] == 0 and report["impulses_refused"] == 0
    for one in report["per_body"]:
        assert one["peak_pa_at_1m"] > 0, one
    # A free bar falls on the ground like any other body.
    drop = {
        "duration_s": 1,
        "ground": {},
        "bodies": [{"name": "bar", "bank": "bar.hdf", "position_m": [0, 0, 0.3], "rotation_deg": [5, 10, 0]}],
    }
    write(folder, "drop.json", drop)
    run(folder, BIN / "carillon-render", "drop.json", "-o", "drop.wav", "--report", "drop-report.json", "--quiet")
    report = json.loads((folder / "drop-report.json").read_text())
    assert report["contacts"] > 0 and report["peak_pa"] > 0 and report["resets"] == 0


def check_queue(folder):
    store = folder / "store"
    carillon = (BIN / "carillon", "--store", store)
    run(folder, *carillon, "submit", "bar.json", "table.json", "--run")
    for name in ("bar", "table"):
        run(folder, *carillon, "get", f"{name}.json", "--to", f"{name}-got.hdf")
        assert f"{name}-got.hdf: valid" in run(folder, BIN / "carillon-bank", "check", f"{name}-got.hdf").stdout
    assert "done" in run(folder, *carillon, "status").stdout
    write(folder, "table.csv", TABLE + "1320,1,1,1\n")
    assert "table" in run(folder, *carillon, "explain", "table.json").stdout
    run(folder, *carillon, "get", "table.json", code=1)
    run(folder, *carillon, "verify")
    write(folder, "table.csv", TABLE)
    for name, modes in (("bar", None), ("table", 2)):
        answer = json.loads(run(folder, BIN / "carillon-precompute", "--validate", "--json", f"{name}.json").stdout)
        assert answer["ok"] and answer["modes"]["how"] == "counted" and answer["memory_bytes"]["1"] > 1e6
        bank = json.loads(run(folder, BIN / "carillon-bank", "info", "--json", f"{name}.hdf").stdout)
        assert answer["modes"]["count"] == len(bank["frequencies_hz"]) and (modes is None or modes == answer["modes"]["count"])


def check_refusals(folder):
    polygon = lambda corners: {"membrane": {"shape": "polygon", "corners_m": corners, "tension_n_m": 100, "density_kg_m2": 0.3}}
    string = lambda **keys: {"string": {"length_m": 1, "mass_kg_m": 1e-3, **keys}}
    csv_job = {"modes_csv": "bad.csv", "mass_kg": 1, "size_m": [1, 1, 1]}
    head = "frequency_hz,decay_per_s,gain\n"
    cases = [
        (string(tension_n=0), None, "tension_n"),
        (string(lowest_hz=1e-9), None, "modes up to"),
        ({"string": {"length_m": 1e9, "tension_n": 1, "mass_kg_m": 1}}, None, "length_m"),
        ({"beam": {"length_m": 1e4, "diameter_m": 1e-6}}, None, "modes up to"),
        ({"beam": {"length_m": 100, "diameter_m": 0.01, "theory": "timoshenko"}}, None, "euler-bernoulli"),
        ({"membrane": {"shape": "rectangle", "length_m": 1, "width_m": 1, "tension_n_m": 1e-9, "density_kg_m2": 1}}, None, "modes up to"),
        ({"membrane": {"shape": "circle", "radius_m": 1, "tension_n_m": 1e-9, "density_kg_m2": 1}}, None, "half-waves"),
        ({"membrane": {"shape": "L", "side_m": 1, "tension_n_m": 1e-6, "density_kg_m2": 1}}, None, "max_modes"),
        ({"plate": {"shape": "rectangle", "length_m": 9, "width_m": 9, "thickness_m": 0.001}}, None, "max_modes"),
        (polygon([[0, 0], [1, 1], [1, 0], [0, 1]]), None, "cross"),
        (polygon([[0, 0], [1, 0], [2, 0]]), None, "corners_m"),
        (polygon([[0, 0], [1, 0], [1, 0], [0, 1]]), None, "one point"),
        (polygon([[0, 0], [1, 0]]), None, "three corners"),
        (csv_job, "", "no mode"),
        (csv_job, head + "440,nan,1\n", "bad.csv:2"),
        (csv_job, head + "440,-1,1\n", "bad.csv:2"),
        (csv_job, "frequency_hz,gain\n440,1\n", "bad.csv:1"),
        (csv_job, "frequency_hz,decay_per_s,0 0 0,0 0 0\n440,1,1,2\n", "bad.csv:1"),
        (csv_job, None, "bad.csv"),
    ]
    for body, table, words in cases:
        for old in ("bad.csv", "bad.hdf"):
            (folder / old).unlink(missing_ok=True)
        if table is not None:
            write(folder, "bad.csv", table)
        write(folder, "bad.json", {"body": body, "material": "steel", "bank": "bad.hdf"})
        done = run(folder, BIN / "carillon-precompute", "-q", "bad.json", code=2)
        errors = [line for line in done.stderr.splitlines() if line.strip()]
        assert len(errors) == 1 and words in errors[0] and ("bad.json" in errors[0] or "bad.csv" in errors[0]), (body, errors)
        assert not (folder / "bad.hdf").exists() and not (folder / "bad.hdf.resolved.json").exists()
    # Clockwise corners and tables in any order are valid.
    write(
        folder, "bad.json", {"body": polygon([[0, 0], [0, 0.1], [0.1, 0]]), "material": "polyester film", "max_modes": 3, "bank": "bad.hdf"}
    )
    run(folder, BIN / "carillon-precompute", "-q", "bad.json")
    run(folder, BIN / "carillon-precompute", "bar.json", "--matrices", "matrices", code=2)
    run(folder, BIN / "carillon-precompute", "bar.json", "--", "-mumps_ordering", "amd", code=2)


def main():
    with tempfile.TemporaryDirectory(prefix="carillon-known-") as name:
        folder = pathlib.Path(name)
        for check in (check_figure_2, check_rendered_lines, check_brightness, check_kinds, check_queue, check_refusals):
            check(folder)
            print(f"{check.__name__}: ok", flush=True)


if __name__ == "__main__":
    main()
