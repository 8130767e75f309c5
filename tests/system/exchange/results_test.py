#!/usr/bin/python3
"""Modes of other solvers as a bank: a bar by ccx, imported, against our own solve of the same mesh: frequencies within 0.5 cents, the
rendered level within 0.01 dB; one bank from metres and from millimetres; the same modes in a universal file, with masses and damping of
their own, and in a Nastran punch file, with and without masses of 1; damaged and cut files are named.

usage: results_test.py BIN_DIR
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import h5py
import meshio
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "path"))
import cae

BIN = pathlib.Path(sys.argv[1]).resolve()
YOUNG, POISSON, DENSITY = 210e9, 0.3, 7850.0
MODES = 10


def run(folder, *words, code=0):
    done = subprocess.run(list(map(str, words)), cwd=folder, capture_output=True, text=True, timeout=200)
    assert done.returncode == code, f"{words}: exit code {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout + done.stderr


def solve_ccx(folder, name, nodes, tets, length, stiffness, density):
    text = "*NODE\n" + "".join(f"{i}, {x:.12g}, {y:.12g}, {z:.12g}\n" for i, (x, y, z) in enumerate(length * nodes, 1))
    text += "*ELEMENT, TYPE=C3D10, ELSET=Body\n"
    for i, t in enumerate(tets + 1, 1):
        text += f"{i}, " + ", ".join(map(str, t[:7])) + ",\n" + ", ".join(map(str, t[7:])) + "\n"
    text += f"*MATERIAL, NAME=STEEL\n*ELASTIC\n{YOUNG * stiffness:.9g}, {POISSON}\n*DENSITY\n{DENSITY * density:.9g}\n"
    text += f"*SOLID SECTION, ELSET=Body, MATERIAL=STEEL\n*STEP\n*FREQUENCY\n{MODES + 6}\n*NODE FILE\nU\n*END STEP\n"
    (folder / f"{name}.inp").write_text(text)
    done = subprocess.run(
        ["ccx", name], cwd=folder, capture_output=True, text=True, timeout=200, env={"PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"}
    )
    assert done.returncode == 0 and "*ERROR" not in done.stdout, done.stdout[-2000:]


def read_bank(path):
    with h5py.File(path) as bank:
        modes = bank["modes"]
        return modes["frequency_hz"][:], modes["shape"][:] * modes["shape_scale"][:][None, :, None], bank["mesh/vertices"][:]


def measure_levels(folder, bank, freq_hz):
    """Level of each mode in the sound of a strike [dB], with a Hann window over the last two seconds."""
    scene = {
        "duration_s": 2.2,
        "sample_rate_hz": 48000,
        "bodies": [{"name": "bar", "bank": bank, "fixed": True}],
        "strikes": [
            {"time_s": 0.05, "body": "bar", "point_m": [0.1, 0.01, 0.005], "impulse_n_s": [0.01, -0.02, -0.03], "duration_s": 0.0001}
        ],
        "listener": {"position_m": [0.3, -0.8, 0.4]},
        "frequencies": "mesh",
        "output": {"gain": 1e-3, "format": "float"},
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    run(folder, BIN / "carillon-render", "scene.json", "-q", "-o", "out.wav")
    data = (folder / "out.wav").read_bytes()
    channels = int.from_bytes(data[22:24], "little")
    sound = numpy.frombuffer(data[data.index(b"data") + 8 :], "<f4").astype(float)[::channels][-96000:]
    time = numpy.arange(len(sound)) / 48000
    window = sound * numpy.hanning(len(sound))
    return numpy.array([20 * math.log10(abs(window @ numpy.exp(-2j * math.pi * f * time))) for f in freq_hz])


def check_comparison(folder):
    """Pairs, MAC and levels against numpy, on the common vertices of the two banks."""
    run(folder, BIN / "carillon-bank", "edit", "m.hdf", "fewer.hdf", "--modes", 4)
    found = json.loads(run(folder, BIN / "carillon-bank", "compare", "own.hdf", "m.hdf", "--json", "--picture", "mac.svg"))
    assert [(pair["first"], pair["second"]) for pair in found["pairs"]] == [(k, k) for k in range(MODES)], found["pairs"]
    own, other = read_bank(folder / "own.hdf"), read_bank(folder / "m.hdf")
    at = [int(numpy.abs(other[2] - v).max(axis=1).argmin()) for v in own[2]]
    for k, pair in enumerate(found["pairs"]):
        a, b = own[1][:, k].ravel(), other[1][at, k].ravel()
        mac = (a @ b) ** 2 / ((a @ a) * (b @ b))
        assert pair["mac"] > 0.999999 and mac > 0.999999 and abs(pair["level_db"]) < 0.01, pair
        assert abs(pair["cents"] - 1200 * math.log2(other[0][k] / own[0][k])) < 1e-9, pair
    mac = numpy.array(found["mac"])
    assert mac.shape == (MODES, MODES) and (mac - numpy.diag(mac.diagonal())).max() < 0.5
    picture = (folder / "mac.svg").read_text()
    assert picture.startswith("<svg") and picture.count("#c03020") == MODES
    said = run(folder, BIN / "carillon-bank", "compare", "own.hdf", "fewer.hdf")
    assert "4 pairs" in said and said.count("has no partner") == MODES - 4, said
    run(folder, BIN / "carillon-bank", "edit", "m.hdf", "twice.hdf", "--size", 2)
    said = run(folder, BIN / "carillon-bank", "compare", "own.hdf", "twice.hdf", code=2)
    assert "twice.hdf" in said and "same size" in said, said


def write_unv_modes(path, nodes, tets, modes, mass, viscous, hysteretic, last=3):
    """Datasets 55 of modes (frequency, displacement by node), shapes times the root of their modal mass, after the mesh."""
    text = cae.format_unv(nodes, tets)
    for k, (freq, shape) in enumerate(modes, 1):
        text += "    -1\n    55\n" + f"mode {k}\nNONE\nNONE\nNONE\nNONE\n" + "%10d" * 6 % (1, 2, last, 8, 2, 3 if last == 2 else 6) + "\n"
        text += "%10d" * 4 % (2, 4, 1, k) + "\n" + "%13.5E" * 4 % (freq, mass, viscous, hysteretic) + "\n"
        for node, u in sorted(shape.items()):
            values = [x * math.sqrt(mass) for x in u] + ([] if last == 2 else [0.1, 0.2, 0.3])
            text += "%10d\n" % node + "%13.5E" * len(values) % tuple(values) + "\n"
        text += "    -1\n"
    path.write_text(text)


def check_universal(folder, nodes, tets):
    points, modes = cae.read_frd(folder / "m.frd")
    expected = read_bank(folder / "m.hdf")
    levels = measure_levels(folder, "m.hdf", expected[0])
    for name, mass, viscous, hysteretic, last in ("a.unv", 4.0, 0.0, 0.0, 2), ("b.uff", 0.25, 1e-4, 2e-4, 3):
        write_unv_modes(folder / name, nodes, tets, modes, mass, viscous, hysteretic, last)
        run(folder, BIN / "carillon-bank", "import", name, "--material", "ccx steel", "-o", "unv.hdf")
        run(folder, BIN / "carillon-bank", "check", "unv.hdf")
        found = read_bank(folder / "unv.hdf")
        assert abs(1200 * numpy.log2(found[0] / expected[0])).max() < 0.02, name  # six digits
        with h5py.File(folder / "unv.hdf") as bank, h5py.File(folder / "m.hdf") as other:
            decay = bank["modes/decay"][:]
            wanted = (viscous + hysteretic / 2) * 2 * math.pi * found[0] if viscous else other["modes/decay"][:]
            assert abs(decay / wanted - 1).max() < 1e-9, name
        if viscous == 0:
            differ = abs(measure_levels(folder, "unv.hdf", found[0]) - levels)[levels > levels.max() - 60]
            assert differ.max() < 0.01, differ
    assert "imported from a universal file" in run(folder, BIN / "carillon-bank", "info", "unv.hdf")
    # The same body in millimetres, with forces in newtons, so masses in tonnes, and in millinewtons, so in kilograms.
    for force, share in (1.0, math.sqrt(1000)), (1000.0, 1.0):
        scaled = [(freq, {node: [share * x for x in u] for node, u in shape.items()}) for freq, shape in modes]
        write_unv_modes(folder / "mm.unv", 1000 * numpy.array(nodes), tets, scaled, 4.0, 0.0, 0.0, 2)
        metres, *here = ["%25.17E" * 3 % factors for factors in ((1, 1, 1), (1000, force, 1))]
        (folder / "mm.unv").write_text((folder / "mm.unv").read_text().replace(metres, here[0], 1))
        run(folder, BIN / "carillon-bank", "import", "mm.unv", "--material", "ccx steel", "-o", "mm.hdf")
        with h5py.File(folder / "mm.hdf") as bank, h5py.File(folder / "m.hdf") as other:
            assert abs(bank["rigid/mass_kg"][()] / other["rigid/mass_kg"][()] - 1) < 1e-5, force
        differ = abs(measure_levels(folder, "mm.hdf", read_bank(folder / "mm.hdf")[0]) - levels)[levels > levels.max() - 60]
        assert differ.max() < 0.01, (force, differ)
    twice = (folder / "b.uff").read_text()
    (folder / "twice.unv").write_text(twice + twice[twice.index("    -1\n    55\n") :])
    said = run(folder, BIN / "carillon-bank", "import", "twice.unv", "--material", "ccx steel", "-o", "x.hdf", code=2)
    assert "twice.unv: modes" in said and "are the same" in said, said
    first = min(modes, key=lambda mode: mode[0])
    write_unv_modes(folder / "pair.unv", nodes, tets, [*modes, (first[0], modes[1][1]), first], 1.0, 0.0, 0.0, 2)
    said = run(folder, BIN / "carillon-bank", "import", "pair.unv", "--material", "ccx steel", "-o", "x.hdf", code=2)
    assert "are the same" in said, said  # a mode of another shape at the same frequency lies between them
    text = (folder / "b.uff").read_text()
    first = text.index("    55\n")
    damages = {
        "complex": (text.replace("%10d" * 6 % (1, 2, 3, 8, 2, 6), "%10d" * 6 % (1, 3, 3, 8, 5, 6), 1), "complex modes"),
        "no_mass": (text.replace("%13.5E" % 0.25, "%13.5E" % 0, 1), "modal mass"),
        "no_mesh": (text[text.index("    -1\n    55\n") :], "before the nodes"),
        "no_modes": (text[: text.index("    -1\n    55\n")], "no modes"),
        "text": ("a letter\n" + text, "universal file"),
        "lost": (text[:first] + text[first:].replace("%10d\n" % 2, "%10d\n" % 999999, 1), "node 999999"),
        "hexahedron": (text.replace("%10d%10d" % (1, 118), "%10d%10d" % (1, 115), 1), "only tetrahedra"),
    }
    for name, (data, words) in damages.items():
        (folder / f"{name}.unv").write_text(data)
        said = run(folder, BIN / "carillon-bank", "import", f"{name}.unv", "--material", "ccx steel", "-o", "x.hdf", code=2)
        assert words in said and f"{name}.unv" in said, f"{name}: {said}"
    for cut in range(200, len(text) - 8, len(text) // 30):
        if text[:cut].endswith("    -1\n"):
            continue  # whole datasets
        (folder / "cut.unv").write_text(text[:cut])
        said = run(folder, BIN / "carillon-bank", "import", "cut.unv", "--material", "ccx steel", "-o", "x.hdf", code=2)
        assert "cut.unv" in said, f"{cut}: {said}"


def format_exponent(kind, value, digits=10):
    """A field of 18 columns: 1.0E-03, 1.0D-03 or 1.0-3."""
    text = "%.*E" % (digits, value)
    return (text if kind == "E" else text.replace("E", "D") if kind == "D" else text.replace("E-0", "-").replace("E+0", "+")).rjust(18)


def write_punch(path, modes, scales, exponent="E", extra=()):
    """Blocks of eigenvectors in SORT1, numbered in columns 73 to 80; extra: lines of other results between them."""
    lines = []
    for k, ((freq, shape), scale) in enumerate(zip(modes, scales), 1):
        lines += ["$TITLE   = BAR", "$SUBTITLE=", "$LABEL   =", "$EIGENVECTOR", "$REAL OUTPUT", "$SUBCASE ID =           1"]
        lines.append("$EIGENVALUE = %s  MODE = %5d" % (format_exponent(exponent, (2 * math.pi * freq) ** 2).strip(), k))
        for node, u in sorted(shape.items()):
            lines.append("%10d       G" % node + "".join(format_exponent(exponent, scale * x) for x in u))
            lines.append("-CONT-            " + "".join(format_exponent(exponent, x) for x in (0, 0.5, -1)))
        lines += ["         7       S" + format_exponent(exponent, 3.0) + " " * 36, "-CONT-" + " " * 66]  # a scalar point
        lines += extra
    path.write_text("".join("%-72s%8d\n" % (line, number) for number, line in enumerate(lines, 1)))


def check_punch(folder, nodes, tets):
    _, modes = cae.read_frd(folder / "m.frd")
    expected = read_bank(folder / "m.hdf")
    levels = measure_levels(folder, "m.hdf", expected[0])
    (folder / "model.bdf").write_text(cae.format_nastran(nodes, tets))
    half = len(nodes) // 2
    cards = (folder / "model.bdf").read_text().split("GRID*   ")
    (folder / "nodes.dat").write_text("".join("GRID*   " + card for card in cards[1:half]))
    (folder / "parts.bdf").write_text(
        cards[0] + "INCLUDE 'nodes.dat'\nGRID,900001,,9.,9.,9.\n" + "".join("GRID*   " + c for c in cards[half:])
    )
    import_ = ["import", "--material", "ccx steel", "-o", "pch.hdf", "--mesh"]
    forces = [
        "$TITLE   =",
        "$SPCF",
        "$REAL OUTPUT",
        "         1       G" + "      1.000000E+00" * 3,
        "-CONT-            " + "      1.000000E+00" * 3,
    ]
    peaks = [1 / max(abs(x) for u in shape.values() for x in u) for _, shape in modes]
    unit = [1.0] * len(modes)
    for name, mesh, scales, exponent, extra in (
        ("mass", "model.bdf", unit, "E", ()),
        ("none", "parts.bdf", unit, "", forces),
        ("max", "model.bdf", peaks, "D", ()),
    ):
        write_punch(folder / f"{name}.pch", modes, scales, exponent, extra)
        said = run(folder, BIN / "carillon-bank", *import_, mesh, f"{name}.pch")
        assert ("generalised masses" in said) == (name == "max"), said
        run(folder, BIN / "carillon-bank", "check", "pch.hdf")
        found = read_bank(folder / "pch.hdf")
        cents = abs(1200 * numpy.log2(found[0] / expected[0])).max()
        assert cents < 1e-4 and found[1].shape == expected[1].shape, f"{name}: {cents}"
        differ = abs(measure_levels(folder, "pch.hdf", found[0]) - levels)[levels > levels.max() - 60]
        assert differ.max() < 0.005, f"{name}: {differ}"
        print(f"{name}.pch: {cents:.1e} cents, levels within {differ.max():.4f} dB")
    said = run(folder, BIN / "carillon-bank", "info", "pch.hdf")
    assert "imported from a Nastran punch file" in said, said

    text, mesh = (folder / "mass.pch").read_text(), (folder / "model.bdf").read_text()
    first, second = text.index("$EIGENVALUE"), text.index("$TITLE", 10)
    is_tet = mesh.index("CTETRA")
    damages = {
        "sort2": (text[:first] + "$POINT ID =   1\n" + text[first:], mesh, "sort2.pch:7: eigenvectors by point (SORT2)"),
        "complex": (text.replace("$REAL OUTPUT          ", "$REAL-IMAGINARY OUTPUT", 1), mesh, "complex.pch:5: complex eigenvectors"),
        "subcases": (text[:second] + text[second:].replace("ID =           1", "ID =           2", 1), mesh, "modes of subcase 2"),
        "word": (text.replace("         2       G", "       two       G", 1), mesh, "word.pch:10: expected the number of a node"),
        "lost": (text.replace("         2       G", "    999999       G", 1), mesh, "node 999999 is not in lost.bdf"),
        "twice": (text.replace("         2       G", "         1       G", 1), mesh, "node 1 a second time"),
        "missing": (text.replace("         2       G", "         2       S", 1), mesh, f"of {len(nodes)} nodes"),
        "no_cont": (text.replace("-CONT-", "-CUNT-", 1), mesh, "no_cont.pch:9: expected a line -CONT-"),
        "value": (text.replace("EIGENVALUE = ", "EIGENVALUE = x", 1), mesh, "value.pch:7: expected an eigenvalue"),
        "forces": (text.replace("$EIGENVECTOR", "$SPCF       "), mesh, "no real eigenvectors"),
        "hexahedron": (text, mesh.replace("CTETRA", "CHEXA ", 1), "hexahedron.bdf:"),
        "system": (text, mesh[:is_tet] + "GRID,900002,3,1.,1.,1.\n" + mesh[is_tet:], "coordinate system 3"),
        "axes": (text, mesh[:is_tet] + "GRID,900002,,1.,1.,1.,4\n" + mesh[is_tet:], "coordinate system 4"),
        "no_end": (text, mesh.replace("ENDDATA\n", ""), "no_end.bdf:"),
        "undefined": (text, mesh.replace("GRID*                  2", "GRID*              77777", 1), "node 2 of this element"),
        "surface": (text, mesh.replace("CTETRA", "PLOTEL"), "no tetrahedra"),
    }
    for name, (data, model, words) in damages.items():
        (folder / f"{name}.pch").write_text(data)
        (folder / f"{name}.bdf").write_text(model)
        said = run(folder, BIN / "carillon-bank", "import", f"{name}.pch", "--mesh", f"{name}.bdf", *import_[1:3], "-o", "x.hdf", code=2)
        assert words in said, f"{name}: {said}"
    for cut in range(7, len(text) - 8, len(text) // 40):
        if cut % 81 == 0 and text[:cut].count("$EIGENVALUE") == text[:cut].count("       S  "):
            continue  # whole blocks
        (folder / "cut.pch").write_text(text[:cut])
        said = run(folder, BIN / "carillon-bank", *import_[:3], "--mesh", "model.bdf", "cut.pch", "-o", "x.hdf", code=2)
        assert "cut.pch" in said, f"{cut}: {said}"
    for words, said in (
        (["mass.pch"], "--mesh MODEL.bdf"),
        (["m.frd", "--mesh", "model.bdf"], "--mesh is for Nastran"),
        (["mass.pch", "--mesh", "nowhere.bdf"], "nowhere.bdf"),
    ):
        assert said in run(folder, BIN / "carillon-bank", "import", *words, "--material", "ccx steel", "-o", "x.hdf", code=2), words
    assert not (folder / "x.hdf").exists()


def check_refusals(folder):
    text = (folder / "m.frd").read_bytes()
    said = run(folder, BIN / "carillon-bank", "import", "m.frd", "-o", "x.hdf", code=2)
    assert "--material" in said, said
    said = run(folder, BIN / "carillon-bank", "import", "mm.frd", "--material", "steel", "-o", "x.hdf", code=2)
    assert "--unit mm-t-s" in said, said
    first = text.index(b" -4  DISP")
    damages = {
        "no_modes": (text[: text.index(b"    1PSTEP")] + b" 9999\n", "no modes"),
        "word": (text.replace(b" -1         2 ", b" -1       two ", 1), "word.frd:"),
        "hexahedron": (text.replace(b" -1         1    6", b" -1         1    1", 1), "only tetrahedra"),
        "binary": (text.replace(text[text.index(b"    2C") : text.index(b"\n", text.index(b"    2C"))], b"    2C      10      2"), "ASCII"),
        "lost_node": (text[:first] + text[first:].replace(b" -1         2 ", b" -1    999999 ", 1), "node 999999"),
    }
    for name, (data, words) in damages.items():
        (folder / f"{name}.frd").write_bytes(data)
        said = run(folder, BIN / "carillon-bank", "import", f"{name}.frd", "--material", "steel", "-o", "x.hdf", code=2)
        assert words in said and f"{name}.frd" in said, f"{name}: {said}"
    for cut in range(1, len(text) - 6, len(text) // 40):
        (folder / "cut.frd").write_bytes(text[:cut])
        said = run(folder, BIN / "carillon-bank", "import", "cut.frd", "--material", "steel", "-o", "x.hdf", code=2)
        assert "cut.frd:" in said, f"{cut}: {said}"
    assert not (folder / "x.hdf").exists()


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run(
            folder,
            BIN / "carillon-mesh",
            *"--shape bar --length 0.2 --width 0.02 --thickness 0.01 --nodes 900 --order 2 -q -o bar.msh".split(),
        )
        mesh = meshio.read(folder / "bar.msh")
        nodes, tets = mesh.points, numpy.vstack([block.data for block in mesh.cells if block.type == "tetra10"])
        solve_ccx(folder, "m", nodes, tets, 1, 1, 1)
        solve_ccx(folder, "mm", nodes, tets, 1e3, 1e-6, 1e-12)
        material = {
            "young_modulus_pa": YOUNG,
            "poisson_ratio": POISSON,
            "density_kg_m3": DENSITY,
            "damping": {"rayleigh": {"alpha2_per_s": 3}},
        }
        (folder / "steel.json").write_text(json.dumps({"materials": [{"name": "ccx steel", "group": "metal", **material}]}))

        os.environ["CARILLON_MATERIALS"] = str(folder / "steel.json")
        job = {
            "mesh": "bar.msh",
            "material": "ccx steel",
            "bank": "own.hdf",
            "max_modes": MODES,
            "shapes": "exact",
            "band_hz": [20, 100000],
        }
        (folder / "own.json").write_text(json.dumps(job))
        run(folder, BIN / "carillon-precompute", "-q", "own.json")
        said = run(folder, BIN / "carillon-bank", "import", "m.frd", "--material", "ccx steel", "-o", "m.hdf")
        assert "6 rigid modes were left out" in said and f"{MODES} modes" in said, said  # of MODES + 6
        run(folder, BIN / "carillon-bank", "import", "mm.frd", "--material", "ccx steel", "--unit", "mm-t-s", "-o", "mm.hdf")
        said = run(folder, BIN / "carillon-bank", "info", "m.hdf")
        assert "imported from CalculiX 2.20, accuracy unknown" in said, said
        run(folder, BIN / "carillon-bank", "check", "m.hdf")
        own, metres, millimetres = (read_bank(folder / f"{name}.hdf") for name in ("own", "m", "mm"))
        cents = 1200 * abs(numpy.log2(metres[0] / own[0])).max()
        assert len(metres[0]) == MODES and cents < 0.5, cents
        assert abs(metres[0] / millimetres[0] - 1).max() < 1e-6 and abs(metres[2] - millimetres[2]).max() < 1e-6
        assert abs(abs(metres[1]) - abs(millimetres[1])).max() < 1e-3 * abs(metres[1]).max()
        levels = measure_levels(folder, "own.hdf", own[0])
        is_heard = levels > levels.max() - 60
        for bank, modes in ("m.hdf", metres), ("mm.hdf", millimetres):
            differ = abs(measure_levels(folder, bank, modes[0]) - levels)[is_heard]
            assert is_heard.sum() >= 5 and differ.max() < 0.01, f"{bank}: {differ} dB"
        print(f"{cents:.3f} cents, levels within {differ.max():.4f} dB")
        check_comparison(folder)
        check_universal(folder, nodes, tets)
        check_punch(folder, nodes, tets)
        check_refusals(folder)


main()
