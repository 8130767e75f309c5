#!/usr/bin/python3
"""carillon hear from outside: a ball against Lamb's theory, sounds against the modes that they are made of, sweeps against fresh solves and
scaling laws, and the mistakes of a newcomer.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import math
import os
import pathlib
import random
import signal
import struct
import subprocess
import tempfile
import time
import unittest
import wave

import numpy

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])


def find_processes(entry):
    """Processes with "NAME=value" in their environment."""
    found = []
    for file in pathlib.Path("/proc").glob("[0-9]*/environ"):
        try:
            if entry.encode() in file.read_bytes().split(b"\0"):
                found.append(file.parent.name)
        except OSError:
            continue  # ended, or of another user
    return found


def make_ball(radius, levels):
    """OFF: an octahedron divided `levels` times, its points on the sphere."""
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        middles, finer = {}, []

        def middle(a, b):
            key = min(a, b), max(a, b)
            if key not in middles:
                p = [(x + y) / 2 for x, y in zip(points[a], points[b])]
                points.append(tuple(x / math.dist(p, (0, 0, 0)) for x in p))
                middles[key] = len(points) - 1
            return middles[key]

        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    lines = [f"OFF\n{len(points)} {len(faces)} 0"]
    lines += [" ".join(f"{radius * x:.9g}" for x in p) for p in points] + ["3 %d %d %d" % f for f in faces]
    return "\n".join(lines) + "\n"


def make_cup(scale=1.0, sides=32, rows=8):
    """OBJ: a cylinder with a bottom and no lid, 80 mm high."""
    lines, at = [], lambda i, j: 1 + j * sides + i % sides
    for j in range(rows + 1):
        for i in range(sides):
            turn = 2 * math.pi * i / sides
            lines.append(f"v {scale * 0.035 * math.cos(turn)} {scale * 0.08 * j / rows} {scale * 0.035 * math.sin(turn)}")
    lines.append("v 0 0 0")
    for j in range(rows):
        for i in range(sides):
            lines += [f"f {at(i, j)} {at(i + 1, j + 1)} {at(i + 1, j)}", f"f {at(i, j)} {at(i, j + 1)} {at(i + 1, j + 1)}"]
    lines += [f"f {len(lines[: sides * (rows + 1)]) + 1} {at(i, 0)} {at(i + 1, 0)}" for i in range(sides)]
    return "\n".join(lines) + "\n"


def make_box_of_faces(size, jitter):
    """A box of six faces with separate corners, each displaced by up to `jitter`, and a distant unused point."""
    points, triangles, chance = [(5.0, 0.0, 0.0)], [], random.Random(1)
    for axis in range(3):
        for side in (0, 1):
            u, v = [(axis + 1) % 3, (axis + 2) % 3][:: 1 if side else -1]
            for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)):
                point = [0.0] * 3
                point[axis], point[u], point[v] = side * size[axis], i * size[u], j * size[v]
                points.append(tuple(x + chance.uniform(-jitter, jitter) for x in point))
            first = len(points) - 4
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in points] + ["3 %d %d %d" % t for t in triangles]
    return "\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows]) + "\n"


def make_rod(sides=12, rows=4):
    """OBJ: a prism of 12 sides, 40 mm thick and 200 mm long: planes, or samples of a cylinder."""
    lines = [
        "v %.9g %.9g %.9g" % (0.02 * math.cos(2 * math.pi * i / sides), 0.2 * j / rows, 0.02 * math.sin(2 * math.pi * i / sides))
        for j in range(rows + 1)
        for i in range(sides)
    ]
    lines += ["f " + " ".join(str(1 + i) for i in range(sides))]
    lines += ["f " + " ".join(str(sides * (rows + 1) - i) for i in range(sides))]
    for j in range(rows):
        for i in range(sides):
            a, b = 1 + j * sides + i, 1 + j * sides + (i + 1) % sides
            lines.append(f"f {a} {a + sides} {b + sides} {b}")
    return "\n".join(lines) + "\n"


def make_glb(off):
    """A GLB file of the triangles of an OFF text."""
    words = off.split()
    points, faces = int(words[1]), int(words[2])
    numbers = words[4 : 4 + 3 * points]
    corners = words[4 + 3 * points :]
    binary = struct.pack(f"<{3 * points}f", *map(float, numbers))
    binary += b"".join(struct.pack("<3I", *map(int, corners[4 * f + 1 : 4 * f + 4])) for f in range(faces))
    content = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [{"buffer": 0, "byteLength": 12 * points}, {"buffer": 0, "byteOffset": 12 * points, "byteLength": 12 * faces}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": points, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * faces, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<III", 2, 28 + len(text) + len(binary), len(text))
    return b"glTF" + header + b"JSON" + text + struct.pack("<I", len(binary)) + b"BIN\0" + binary


def read_wave(path):
    """(rate, samples of both ears in the middle) of a WAV of 24 bits."""
    with wave.open(str(path)) as file:
        rate, channels, raw = file.getframerate(), file.getnchannels(), file.readframes(file.getnframes())
        assert file.getsampwidth() == 3
    bytes_ = numpy.frombuffer(raw, "u1").reshape(-1, 3).astype(numpy.int32)
    values = bytes_[:, 0] | bytes_[:, 1] << 8 | bytes_[:, 2] << 16
    return rate, (values - ((values & 0x800000) << 1)).reshape(-1, channels) / 2.0**23


class Hear(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory(prefix="carillon-hear-")
        self.folder = pathlib.Path(self.scratch.name)
        self.addCleanup(self.scratch.cleanup)

    def call(self, *words, code=0):
        run = subprocess.run(
            [str(BIN / "carillon"), *map(str, words)],
            cwd=self.folder,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            timeout=200,
            env=os.environ | {"HOME": str(self.folder)},
        )
        self.assertEqual(run.returncode, code, f"{words}: {run.stdout}{run.stderr}")
        return run.stdout if code == 0 else run.stderr

    def hear(self, *words):
        return json.loads(self.call("--json", "hear", *words))

    def refuse(self, *words, contains=(), code=2):
        before = sorted(self.folder.rglob("*.wav"))
        said = self.call("hear", "-q", *words, code=code).strip()
        self.assertEqual(len(said.splitlines()), 1, said)
        for word in contains:
            self.assertIn(word, said)
        self.assertEqual(sorted(self.folder.rglob("*.wav")), before)

    def test_a_ball_in_millimetres_sounds_as_lamb_says(self):
        (self.folder / "ball.off").write_text(make_ball(200, 4))
        heard = self.hear("ball.off", "--material", "steel")
        self.assertIn("millimetres", " ".join(heard["assumed"]))
        self.assertTrue(all(abs(x - 0.4) < 4e-3 for x in heard["extent_m"]), heard["extent_m"])
        sound = heard["sounds"][0]
        # The lowest torsional modes, twice five: tan eta = eta (12 - eta^2) / (12 - 5 eta^2), eta = omega R / c_t = 2.50113.
        speed = math.sqrt(200e9 / (2 * 1.29) / 7850)
        expected = 2.50113 * speed / (2 * math.pi * 0.2)
        for mode in sound["modes"][:5]:
            cents = abs(1200 * math.log2(mode["freq_hz"] / expected))
            self.assertLess(cents, 5)
            self.assertLess(cents, mode["error_cents"])
            self.assertAlmostEqual(mode["t60_s"] * mode["freq_hz"] * 2e-4 * math.pi / math.log(1000), 1, delta=1e-3)
        rate, samples = read_wave(sound["wav"])
        self.assertEqual((rate, samples.shape[1]), (48000, 2))
        self.assertTrue(0.5 < numpy.abs(samples).max() < 1 and numpy.all(numpy.isfinite(samples)))
        # The strongest line of the sound is a mode of the table.
        spectrum = numpy.abs(numpy.fft.rfft(samples[: 2 * rate, 0] * numpy.hanning(2 * rate)))
        strongest = numpy.argmax(spectrum) / 2
        self.assertLess(min(abs(strongest - mode["freq_hz"]) for mode in sound["modes"]), 2)
        self.assertTrue(pathlib.Path(sound["spectrogram"]).read_bytes().startswith(b"\x89PNG"))
        self.assertIn('"title": "ball"', pathlib.Path(heard["page"]).read_text())
        scene = json.loads(pathlib.Path(sound["scene"]).read_text())
        self.assertEqual(len(scene["strikes"]), 4)
        self.assertLess(heard["seconds"], 60)

    def test_a_box_of_faces_that_do_not_quite_meet_under_a_long_name_is_the_box(self):
        name = "x" * 230 + ".off"
        (self.folder / name).write_text(make_box_of_faces((0.1, 0.06, 0.02), 1e-7))
        heard = self.hear(name, "--material", "steel")
        self.assertIn("1 point of the file belongs to no element", " ".join(heard["assumed"]))
        self.assertLess(len(heard["sounds"][0]["name"].encode()), 200)
        mode = heard["sounds"][0]["modes"][0]
        self.assertLess(abs(1200 * math.log2(mode["freq_hz"] / 8803.2)), mode["error_cents"])  # reference: 20,000 nodes without seams

    def test_a_glb_is_in_metres_and_sounds_as_the_same_off(self):
        off = make_ball(0.25, 3)
        (self.folder / "ball.off").write_text(off)
        (self.folder / "game.glb").write_bytes(make_glb(off))
        game, plain = self.hear("game.glb", "--material", "glass"), self.hear("ball.off", "--material", "glass")
        self.assertIn("glTF is in metres", " ".join(game["assumed"]))
        for one, other in zip(game["sounds"][0]["modes"], plain["sounds"][0]["modes"]):
            self.assertLess(abs(1200 * math.log2(one["freq_hz"] / other["freq_hz"])), 1)
        whole = (self.folder / "game.glb").read_bytes()
        (self.folder / "cut.glb").write_bytes(whole[: len(whole) // 2])
        self.refuse("cut.glb", contains=("cut.glb", "truncated"))
        (self.folder / "bent.glb").write_bytes(whole.replace(b'[{"mesh": 0}]', b'[{"skin": 0}]'))
        self.refuse("bent.glb", contains=("bent.glb", "bones"))

    def test_one_solve_serves_all_that_scales(self):
        (self.folder / "ball.off").write_text(make_ball(1, 3))
        heard = self.hear("ball.off", "--material", "brass,titanium,glass", "--height", "0.4,0.8")
        sounds = {sound["name"]: sound for sound in heard["sounds"]}
        self.assertEqual(list(sounds), [f"ball-{name}-{height}m" for name in ("brass", "titanium", "glass") for height in ("0.4", "0.8")])
        # brass and titanium have one Poisson's ratio, glass another.
        self.assertEqual(sum(not sound["is_scaled"] for sound in heard["sounds"]), 2)
        first = lambda name: sounds[name]["modes"][0]["freq_hz"]
        self.assertAlmostEqual(first("ball-brass-0.4m") / first("ball-brass-0.8m"), 2, delta=1e-6)
        speed = lambda young, density: math.sqrt(young / density)
        self.assertAlmostEqual(first("ball-titanium-0.4m") / first("ball-brass-0.4m"), speed(110e9, 4500) / speed(100e9, 8500), delta=1e-6)
        ball = lambda young, poisson, density: 2.50113 * speed(young / (2 + 2 * poisson), density) / (2 * math.pi * 0.2)
        for name, constants in (("brass", (100e9, 0.34, 8500)), ("glass", (72e9, 0.22, 2500))):
            self.assertLess(abs(1200 * math.log2(first(f"ball-{name}-0.4m") / ball(*constants))), 8)
        for sound in heard["sounds"]:
            self.assertTrue(pathlib.Path(sound["wav"]).stat().st_size > 40000, sound["wav"])

    def test_an_open_cup_needs_a_wall_and_has_a_sound_then(self):
        (self.folder / "cup.obj").write_text(make_cup())
        self.refuse("cup.obj", contains=("cup.obj", "open surface (1 border)", "--wall"))
        heard = self.hear("cup.obj", "--wall", "0.003", "--material", "porcelain", "--mallet", "soft-felt", "-o", "tea")
        self.assertEqual(heard["sounds"][0]["name"], "cup-porcelain")
        self.assertGreater(heard["sounds"][0]["mode_count"], 3)
        self.assertEqual(pathlib.Path(heard["folder"]), self.folder.resolve() / "tea")
        hard = self.hear("cup.obj", "--wall", "0.003", "--material", "porcelain", "--mallet", "steel", "-o", "hard")
        brightness = []
        for one in (heard, hard):
            rate, samples = read_wave(one["sounds"][0]["wav"])
            spectrum = numpy.abs(numpy.fft.rfft(samples[: rate // 2, 0])) ** 2
            brightness.append(numpy.sum(spectrum * numpy.fft.rfftfreq(rate // 2, 1 / rate)) / numpy.sum(spectrum))
        self.assertGreater(brightness[1], 1.2 * brightness[0], "steel is brighter than felt")

    def test_facets_in_doubt_stand_next_to_the_error_bars_and_can_be_settled(self):
        (self.folder / "rod.obj").write_text(make_rod())
        wish = ("rod.obj", "--scale", 1)
        said = self.call("hear", "-q", *wish, "-o", "smooth", "--accuracy", 20)  # applies to the bars, without facets in doubt
        for words in ("+-facets", "facets may be planes", "--facets declares planes"):
            self.assertIn(words, said)
        info = subprocess.run([BIN / "carillon-bank", "info", "--json", self.folder / "smooth/rod-steel.hdf"], capture_output=True)
        smooth = sorted(json.loads(info.stdout)["modes"], key=lambda mode: mode["corrected_frequency_hz"])
        self.assertTrue(all(mode["facet_error_cents"] > 10 > mode["corrected_error_cents"] for mode in smooth[:6]), smooth[:6])
        planes = self.hear(*wish, "-o", "planes", "--facets")["sounds"][0]
        self.assertEqual({mode["facet_cents"] for mode in planes["modes"]} | {planes["facet_cents"]}, {0})
        for one, other in zip(smooth[:6], planes["modes"]):
            cents = abs(1200 * math.log2(one["corrected_frequency_hz"] / other["freq_hz"]))
            self.assertGreater(cents, one["corrected_error_cents"], "the prism is another body")
            self.assertLess(cents, one["corrected_error_cents"] + one["facet_error_cents"] + other["error_cents"])
        self.refuse("--shape", "bar", "--facets", contains=("--facets is for surfaces",))
        (self.folder / "rod.msh").write_text("")
        self.refuse("rod.msh", "--facets", contains=("--facets is for surfaces", "carillon-mesh"))

    def test_shapes_wood_and_accuracy(self):
        heard = self.hear("--shape", "bar", "--length", 0.3, "--width", 0.03, "--thickness", 0.012, "--material", "oak", "--accuracy", 10)
        sound = heard["sounds"][0]
        self.assertLessEqual(sound["worst_cents"], 10)
        # Bending of a slender beam along the grain, E 13.5 GPa; shear of wood takes some of it.
        beam = 4.73004**2 / (2 * math.pi * 0.3**2) * math.sqrt(13.5e9 * 0.012**2 / 12 / 760)
        self.assertTrue(0.85 * beam < sound["modes"][0]["freq_hz"] < beam, (sound["modes"][0], beam))

    def test_it_says_what_it_takes_for_granted(self):
        (self.folder / "ball.off").write_text(make_ball(0.3, 3))
        said = self.call("hear", "-q", "ball.off")
        for words in ("taken for metres", "material: steel (none given)", "body: solid", "a preview", "T60 [s]", "ball-steel.wav"):
            self.assertIn(words, said)
        (self.folder / "unit.off").write_text(make_ball(1, 3))
        self.assertIn("a normalised size", self.call("hear", "-q", "unit.off"))

    def test_mistakes_end_in_a_sentence_with_the_remedy(self):
        (self.folder / "ball.off").write_text(make_ball(50, 2))
        (self.folder / "far.off").write_text(make_ball(5e6, 2))
        (self.folder / "tiny.off").write_text(make_ball(0.001, 3))
        self.refuse("none.obj", contains=("none.obj", "no such file"))
        (self.folder / "empty.glb").write_bytes(b"")
        self.refuse("empty.glb", contains=("empty.glb", "the file is empty", "export it again"))
        self.refuse(".", contains=(".: a folder",))
        for name, words in (
            ("s.json", "a scene (play it: carillon-render"),
            ("b.hdf", "by its name a bank"),
            ("c.3ds", "convert other formats first"),
        ):
            (self.folder / name).write_text("{}")
            self.refuse(name, contains=(name, words, ".obj, .stl"))
        self.refuse(contains=("give an object",))
        self.refuse("ball.off", "--material", "steele", contains=("--material", 'did you mean "steel"?'))
        self.refuse("ball.off", "--mallet", "hammer", contains=("--mallet", "soft-felt"))
        self.refuse("ball.off", "--wall", "0.05", contains=("thicker than half the body", "0.1 m"))
        self.refuse("ball.off", "--wall", "3", contains=("thicker than half the body", "3 mm are --wall 0.003"))
        (self.folder / "cup.obj").write_text(make_cup())
        self.refuse("cup.obj", "--wall", "0.2", contains=("thicker than half the body", "thinner one (metres)"))
        self.refuse("ball.off", "--accuracy", "1e-5", contains=("--accuracy", "0.001 to 1200"))
        self.refuse("ball.off", "-o", "/proc/none", contains=("/proc/none",), code=4)
        self.refuse("ball.off", "--wall", "-1", contains=("--wall",))
        self.refuse("ball.off", "--wall", "1e-7", contains=("thinner than a 5000th", "metres"))
        self.refuse("ball.off", "--height", "0", contains=("--height",))
        self.refuse("ball.off", "--height", "1e9", contains=("1e+09 m across", "--height"))
        self.refuse("ball.off", "--scale", "1e-9", contains=("--scale",))
        self.refuse("ball.off", "--height", "0.1", "--scale", "0.001", contains=("exclude each other",))
        self.refuse("ball.off", "--length", "1", contains=("--length", "--shape"))
        self.refuse("ball.off", "--material", "steel,steel", contains=("given twice",))
        self.refuse("far.off", contains=("far.off", "--height"))
        self.refuse("tiny.off", "--scale", "1", "--material", "alumina", contains=("no mode from 20 to 20000 Hz", "larger"))
        self.refuse("--shape", "bar", "--scale", "1", contains=("--scale",))
        self.refuse("--shape", "barr", contains=("barr",))
        (self.folder / "text.obj").write_text("hello\n")
        self.refuse("text.obj", contains=("text.obj",))
        # A refused run leaves no folder.
        self.assertFalse(
            [f for f in self.folder.iterdir() if f.name in ("empty-sound", "ball-sound", "far-sound", "text-sound", "cup-sound")]
        )

    def test_a_mesh_in_millimetres_is_asked_about(self):
        subprocess.run(
            [BIN / "carillon-mesh", "--shape", "sphere", "--radius", "100", "--nodes", "500", "-o", "b.msh", "-q"], cwd=self.folder
        )
        self.refuse("b.msh", contains=("b.msh", "200 m across", "--scale", "0.001 for millimetres"))
        heard = self.hear("b.msh", "--scale", "0.001", "--material", "cork")
        self.assertTrue(all(abs(x - 0.2) < 0.02 for x in heard["extent_m"]), heard["extent_m"])
        self.refuse("b.msh", "--accuracy", "10", contains=("--accuracy", "a surface or a shape"))

    def test_one_run_writes_to_a_folder(self):
        words = [BIN / "carillon", "hear", "-q", "--shape", "bowl", "--material", "glass", "-o", "out"]
        with subprocess.Popen(words, cwd=self.folder, env=os.environ | {"HOME": str(self.folder)}) as first:
            while not (self.folder / "out").exists():
                time.sleep(0.005)
            self.refuse("--shape", "bowl", "--material", "oak", "-o", "out", contains=("out", "another `carillon hear`"))
            self.assertEqual(first.wait(200), 0)
        self.assertTrue((self.folder / "out/bowl-glass.wav").exists())

    def test_an_interrupt_leaves_whole_files_and_nothing_else(self):
        (self.folder / "ball.off").write_text(make_ball(0.3, 4))
        temporary = self.folder / "tmp"
        temporary.mkdir()
        words = [BIN / "carillon", "hear", "ball.off", "--material", "oak"]
        environment = os.environ | {"HOME": str(self.folder), "TMPDIR": str(temporary)}
        with subprocess.Popen(words, cwd=self.folder, env=environment, stderr=subprocess.PIPE, text=True) as run:
            for line in run.stderr:
                if "computing the modes" in line:
                    break
            run.send_signal(signal.SIGINT)
            run.stderr.read()
            self.assertEqual(run.wait(30), -signal.SIGINT)
        self.assertEqual(sorted(f.name for f in (self.folder / "ball-sound").iterdir()), ["ball-oak.json", "ball.msh"])
        # Open MPI may leave empty folders.
        self.assertFalse([f for f in temporary.rglob("*") if not f.is_dir() or f.name.startswith("carillon-")])
        self.assertFalse(find_processes(f"TMPDIR={temporary}"))
        subprocess.run([BIN / "carillon-mesh", "ball-sound/ball.msh", "--look"], cwd=self.folder, check=True, stdout=subprocess.DEVNULL)

    def test_materials_are_listed_and_a_file_of_your_own_adds_to_them(self):
        listed = json.loads(self.call("--json", "materials"))["materials"]
        self.assertGreaterEqual(len(listed), 30)
        for entry in listed:
            self.assertTrue(entry["loss_source"] and entry["elasticity_source"], entry)
        self.assertIn("along the grain", self.call("materials", "oak"))
        oak = json.loads(self.call("--json", "materials", "oak"))["materials"][0]
        self.assertEqual([len(oak["orthotropic"][key]) for key in ("young_modulus_pa", "shear_modulus_pa", "poisson_ratio")], [3, 3, 3])
        self.assertIn("did you mean", self.call("materials", "ook", code=2))
        own = self.folder / ".config/carillon/materials.json"
        own.parent.mkdir(parents=True)
        own.write_text('{"materials": [{"name": "my bronze", "from": "bronze", "density_kg_m3": 8700}]}')
        listed = json.loads(self.call("--json", "materials", "my-bronze"))["materials"]
        self.assertEqual((listed[0]["density_kg_m3"], listed[0]["place"]), (8700, f"{own}:1"))
        own.write_text('{"materials": [{"name": "my bronze", "from": "bronse"}]}')
        self.assertIn(f"{own}:1", self.call("materials", code=2))


if __name__ == "__main__":
    unittest.main()
