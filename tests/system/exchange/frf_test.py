#!/usr/bin/python3
"""Frequency response functions: universal files (dataset 58) of banks, read here by the columns of the format, against the sum over modes
by numpy within 1e-6; then a body with other frequencies, decays and levels, measured with noise and written here in ASCII and in binary,
against the bank: cents, decay, level and MAC of each mode are those put in. Damaged and cut files are named.
"""
import json
import math
import pathlib
import sys
import tempfile

import h5py
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from banks import BIN, fixtures, run  # noqa: E402

MOTIONS = {8: 0, 11: 1, 12: 2}


def bank_program(folder, *words, code=0):
    done = run(BIN / "carillon-bank", *words, cwd=folder, code=code)
    return done.stdout + done.stderr


def read_uff(path):
    """Nodes of dataset 2411; of each dataset 58 its columns, frequencies and values."""
    nodes, functions = {}, []
    lines = path.read_text().splitlines()
    marks = [i for i, line in enumerate(lines) if line == "    -1"]
    for begin, end in zip(marks[::2], marks[1::2]):
        number, body = int(lines[begin + 1]), lines[begin + 2 : end]
        if number == 2411:
            for head, place in zip(body[::2], body[1::2]):
                nodes[int(head[:10])] = [float(place[25 * k : 25 * k + 25]) for k in range(3)]
        if number != 58:
            continue
        kind, size, axes = body[5], body[6], body[7:11]
        assert int(kind[:5]) == 4 and int(size[:10]) == 6 and int(size[20:30]) == 1 and int(axes[0][:10]) == 18 and int(axes[2][:10]) == 13
        values = [float(line[20 * k : 20 * k + 20]) for line in body[11:] for k in range(len(line) // 20)]
        value = numpy.array(values[::2]) + 1j * numpy.array(values[1::2])
        assert len(value) == int(size[10:20])
        functions.append(
            {
                "response": (int(kind[41:51]), int(kind[51:55])),
                "reference": (int(kind[66:76]), int(kind[76:80])),
                "motion": MOTIONS[int(axes[1][:10])],
                "hz": float(size[30:43]) + float(size[43:56]) * numpy.arange(len(value)),
                "value": value,
            }
        )
    return nodes, functions


class Body:
    """A bank by h5py, as it is played."""

    def __init__(self, path):
        with h5py.File(path) as bank:
            modes = bank["modes"]
            has = "corrected_frequency_hz" in modes
            hz, decay = (
                (modes["corrected_frequency_hz"][:], modes["corrected_decay"][:]) if has else (modes["frequency_hz"][:], modes["decay"][:])
            )
            order = numpy.argsort(hz, kind="stable")
            self.hz, self.decay = hz[order], decay[order]
            self.shapes = (modes["shape"][:] * modes["shape_scale"][:][None, :, None])[:, order]
            self.vertices, self.triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
            self.is_free = bank["solve/rigid_modes"][()] == 6
            self.mass, self.centre, self.inertia = (bank[f"rigid/{name}"][()] for name in ("mass_kg", "centre_m", "inertia_kg_m2"))

    def respond(self, at, along, force_at, force_along, hz, order):
        """Sum over the modes, and the rigid body. at, force_at: (point, shapes) each."""
        omega = 2 * numpy.pi * hz[:, None]
        residue = (at[1] @ along) * (force_at[1] @ force_along)
        value = (residue / ((2 * numpy.pi * self.hz) ** 2 - omega**2 + 2j * self.decay * omega)).sum(axis=1)
        if self.is_free:
            spin = numpy.linalg.solve(self.inertia, numpy.cross(force_at[0] - self.centre, force_along))
            value -= along @ (force_along / self.mass + numpy.cross(spin, at[0] - self.centre)) / omega[:, 0] ** 2
        return value * (1j * omega[:, 0]) ** order


def find_axis(direction):
    return math.copysign(1, direction) * numpy.eye(3)[abs(direction) - 1]


def check_export(folder, name):
    """Points at vertices, and in the middle of a triangle."""
    body = Body(fixtures.get(name))
    middle = body.triangles[len(body.triangles) // 3]
    size = abs(body.shapes[:, :2]).max(axis=2)
    first = size[:, 0].argmax()
    is_far = numpy.linalg.norm(body.vertices - body.vertices[first], axis=1) > 0.05
    places = [(body.vertices[v], body.shapes[v]) for v in (first, (size[:, 1] * is_far).argmax())]
    places.append((body.vertices[middle].mean(axis=0), body.shapes[middle].mean(axis=0)))
    word = lambda point: "--points=" + ",".join(repr(float(x)) for x in point)
    for quantity, strike in ("acceleration", None), ("velocity", 1), ("displacement", 2):
        words = [word(place[0]) for place in places[:2]] + ["--quantity", quantity, "--spacing", "2.5", "--to", "3000"]
        if strike:
            words.append(word(places[strike][0]).replace("points", "strike"))
        said = bank_program(folder, "export", fixtures.get(name), "-o", "h.uff", *words)
        assert "6 functions of 1200 lines, 2.5 to 3000 Hz" in said and ("rigid body" in said) == body.is_free, said
        nodes, functions = read_uff(folder / "h.uff")
        assert len(functions) == 6 and len(nodes) == (3 if strike == 2 else 2), nodes
        of_node = {node: min(places, key=lambda place: abs(place[0] - x).max()) for node, x in nodes.items()}
        assert max(abs(of_node[node][0] - x).max() for node, x in nodes.items()) < 1e-9
        for k, f in enumerate(functions):
            assert f["response"] == (k // 3 + 1, k % 3 + 1) and f["motion"] == {"displacement": 0, "velocity": 1}.get(quantity, 2), f
            assert f["reference"][0] == {None: 1, 1: 2, 2: 3}[strike], f["reference"]
            wanted = body.respond(
                of_node[f["response"][0]],
                find_axis(f["response"][1]),
                of_node[f["reference"][0]],
                find_axis(f["reference"][1]),
                f["hz"],
                f["motion"],
            )
            if not wanted.any():
                assert name == "mylar_drum.hdf" and f["response"][1] != 3 and not f["value"].any(), f
                continue
            differ = abs(f["value"] - wanted).max() / abs(wanted).max()
            each = (abs(f["value"] - wanted) / (abs(wanted) + 1e-6 * abs(wanted).max())).max()
            assert differ < 1e-9 and each < 1e-6, f"{name}, {quantity}, {k}: {differ}, {each}"


def format_function(response, reference, hz, value, form, ordinate, unit="m/s^2", binary=None, even=True):
    """A dataset 58 in numbers of a form (5: single, 6: double), or 58b with bytes of order '<' or '>'."""
    size = len(hz) * (8 if form == 5 else 16)
    text = "    -1\n" + (
        "    58b%6d%6d%12d%12d%6d%6d%12d%12d\n" % (1 if binary == "<" else 2, 2, 11, size, 0, 0, 0, 0) if binary else "    58\n"
    )
    text += "measured\nNONE\n01-Dec-26 12:00:00\nNONE\nNONE\n"
    text += "%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n" % (4, 1, 0, 0, "NONE", *response, "NONE", *reference)
    text += "%10d%10d%10d%13.5E%13.5E%13.5E\n" % (form, len(hz), even, hz[0] * even, (hz[1] - hz[0]) * even, 0)
    for kind, label, units in (18, "Frequency", "Hz"), (ordinate, "Motion", unit), (13, "Force", "N"), (0, "NONE", "NONE"):
        text += "%10d%5d%5d%5d %-20s %-20s\n" % (kind, 0, 0, 0, label, units)
    pairs = numpy.stack([value.real, value.imag], axis=1)
    if binary:
        return text.encode() + pairs.astype(binary + ("f4" if form == 5 else "f8")).tobytes() + b"    -1\n"
    number = "%13.5E" if form == 5 else "%20.12E"
    rows = [(number * 2 % tuple(pair)) if even else "%13.5E" % f + number * 2 % tuple(pair) for f, pair in zip(hz, pairs)]
    per_line = (3 if form == 5 else 2) if even else (2 if form == 5 else 1)
    text += "".join("".join(rows[i : i + per_line]) + "\n" for i in range(0, len(rows), per_line))
    return (text + "    -1\n").encode()


def check_comparison(folder):
    name, draw = "free_bar.hdf", numpy.random.default_rng(1)
    bank = fixtures.get(name)
    body, real = Body(bank), Body(bank)
    count = 11  # modes below 4 kHz, two of them 5 Hz apart
    shift, decay, level = draw.uniform(-40, 40, len(body.hz)), draw.uniform(0.7, 1.5, len(body.hz)), draw.uniform(0.7, 1.4, len(body.hz))
    shift[5:7] = 10, 10
    real.hz, real.decay = body.hz * 2 ** (shift / 1200), body.decay * decay
    real.shapes = body.shapes * numpy.sqrt(level)[None, :, None]
    ends = body.vertices[:, 0] / abs(body.vertices[:, 0]).max()
    struck = int(numpy.argmin(abs(ends - 0.93) + 40 * abs(body.vertices[:, 1] - body.vertices[:, 1].max())))
    seen = [int(numpy.argmin(abs(ends - x) + 40 * abs(body.vertices[:, 2] - body.vertices[:, 2].max()))) for x in (-0.9, -0.3, 0.4, 0.8)]
    hz = 20 + 0.5 * numpy.arange(8001)
    cases = {
        # form, ordinate, unit, factor, bytes, even, noise
        "double": (6, 12, "m/s^2", 1.0, None, True, 0.0),
        "mobility": (5, 11, "m/s", 1.0, None, True, 0.0),
        "g": (6, 12, "g", 1 / 9.80665, None, False, 0.0),
        "uneven": (5, 8, "m", 1.0, None, False, 0.0),
        "little": (5, 12, "m/s^2", 1.0, "<", True, 0.0),
        "big": (6, 12, "m/s^2", 1.0, ">", True, 1e-3),
    }
    for case, (form, ordinate, unit, factor, order, even, noise) in cases.items():
        out = b"    -1\n   164\n         2mm                           2\n" + b"%25.16E%25.16E%25.16E\n%25.16E\n    -1\n" % (
            1e3,
            1,
            1,
            273.15,
        )
        out += b"    -1\n    15\n"
        for node, vertex in zip((100, 1, 2, 3, 4), [struck, *seen]):
            out += b"%10d%10d%10d%10d" % (node, 0, 0, 8) + b"%13.5E%13.5E%13.5E\n" % tuple(1e3 * body.vertices[vertex])
        out += b"    -1\n"
        for node, vertex in enumerate(seen, 1):
            for direction, force in (2, -2), (-3, 3):
                value = real.respond(
                    (body.vertices[vertex], real.shapes[vertex]),
                    find_axis(direction),
                    (body.vertices[struck], real.shapes[struck]),
                    find_axis(force),
                    hz,
                    MOTIONS[ordinate],
                )
                if noise:
                    value += noise * abs(value).max() * (draw.normal(size=len(hz)) + 1j * draw.normal(size=len(hz)))
                out += format_function((node, direction), (100, force), hz, factor * value, form, ordinate, unit, order, even)
        (folder / f"{case}.uff").write_bytes(out)
        found = json.loads(bank_program(folder, "compare", bank, f"{case}.uff", "--modes", count, "--json", "--picture", "h.svg"))
        pairs = {pair["first"]: pair for pair in found["pairs"]}
        seen_modes = [m for m in range(count) if abs(body.shapes[struck, m, 1:]).max() > 0.05 * abs(body.shapes[:, m]).max()]
        assert len(seen_modes) >= 9 and {5, 6} < set(seen_modes) and set(pairs) >= set(seen_modes), (case, seen_modes, found)
        worst = numpy.zeros(4)
        for m in seen_modes:
            pair = pairs[m]
            differ = [
                abs(pair["cents"] - shift[m]),
                abs(pair["second_decay_per_s"] / real.decay[m] - 1),
                abs(pair["level_db"] - 20 * math.log10(level[m])),
                1 - pair["mac"],
            ]
            worst = numpy.maximum(worst, differ)
        print(f"{case}: {len(seen_modes)} modes; cents, decay, dB, 1 - MAC within " + " ".join(f"{x:.1e}" for x in worst))
        assert (worst < ([0.05, 0.05, 0.3, 0.02] if noise else [2e-3, 1e-3, 0.05, 0.01])).all(), (case, worst)
    picture = (folder / "h.svg").read_text()
    assert picture.startswith("<svg") and picture.count('class="pair"') == len(found["pairs"])
    said = bank_program(folder, "compare", bank, "double.uff", "--modes", 3, "--within", 45)
    assert "pairs from 8 functions" in said and "measured" in said, said
    # Without positions: cents and decays alone.
    start = (folder / "double.uff").read_bytes()
    (folder / "bare.uff").write_bytes(start[start.index(b"    -1\n    58\n") :])
    found = json.loads(bank_program(folder, "compare", bank, "bare.uff", "--modes", count, "--json"))
    assert "position" in found["unknown"] and len(found["pairs"]) >= 9, found
    assert all(pair["mac"] is None and abs(pair["cents"] - shift[pair["first"]]) < 0.02 for pair in found["pairs"]), found
    # Our own functions: no distance.
    bank_program(
        folder, "export", bank, "-o", "own.uff", "--points=0.19,0.005,0.003", "--points=-0.1,0.005,0.003", "--spacing", 0.5, "--to", 4000
    )
    found = json.loads(bank_program(folder, "compare", bank, "own.uff", "--json"))
    assert len(found["pairs"]) >= 5 and max(abs(pair["cents"]) for pair in found["pairs"]) < 0.01, found
    assert max(abs(pair["level_db"]) for pair in found["pairs"]) < 0.02, found
    return bank


def check_refusals(folder, bank):
    text = (folder / "mobility.uff").read_bytes()
    binary = (folder / "little.uff").read_bytes()
    damages = {
        "word": (
            text.replace(b"         4         1    0", b"         x         1    0", 1).replace(
                b"    4         1    0", b"    x         1    0", 1
            ),
            "word.uff:",
        ),
        "none": (text.replace(b"    4         1    0", b"    1         1    0"), "no frequency response functions"),
        "time": (text.replace(b"        18    0", b"        17    0", 1), "an abscissa of type 17"),
        "pressure": (text.replace(b"        11    0", b"        15    0", 1), "an ordinate of type 15"),
        "volts": (text.replace(b"        13    0", b"         0    0", 1), "a reference of type 0"),
        "count": (text.replace(b"      8001         1", b"   8000001         1", 1), "announces 8000001 lines"),
        "real": (text.replace(b"         5      8001", b"         2      8001", 1), "real numbers"),
        "lines": (text.replace(b"  5.00000E-01", b"  5.10000E-01", 1), "function 2 has other frequencies"),
        "letter": (b"a letter\n" + text, "letter.uff:1: a dataset begins"),
        "vax": (binary.replace(b"    58b     1     2", b"    58b     1     1", 1), "only IEEE numbers"),
        "high": (text.replace(b"  2.00000E+01", b"  2.00000E+06"), "no mode within the measured band"),
    }
    for name, (data, words) in damages.items():
        (folder / f"{name}.uff").write_bytes(data)
        said = bank_program(folder, "compare", bank, f"{name}.uff", "--picture", "x.svg", code=2)
        assert words in said and f"{name}.uff" in said, f"{name}: {said}"
    for data in text, binary:
        for cut in range(11, len(data) - 7, len(data) // 15):
            (folder / "cut.uff").write_bytes(data[:cut])
            said = bank_program(folder, "compare", bank, "cut.uff", "--picture", "x.svg", code=2)
            assert "cut.uff" in said, f"{cut}: {said}"
    for words, said in (
        (["export", bank, "-o", "x.uff"], "--strike X,Y,Z"),
        (["export", bank, "-o", "x.uff", "--points", "9,9,9"], "not near the surface"),
        (["export", bank, "-o", "x.uff", "--strike", "0,0,0", "--spacing", "1e5"], "--spacing"),
        (["export", bank, "-o", "x.glb", "--to", "100"], "--to is for UFF"),
        (["compare", bank, bank, "--within", "5"], "--within is for measured"),
        (["compare", bank, "double.uff", "--picture", "x.png"], "ends in .svg"),
    ):
        assert said in bank_program(folder, *words, code=2), words
    assert not (folder / "x.uff").exists() and not (folder / "x.svg").exists()


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for bank in "free_bar.hdf", "mylar_drum.hdf":
            check_export(folder, bank)
        check_refusals(folder, check_comparison(folder))


main()
