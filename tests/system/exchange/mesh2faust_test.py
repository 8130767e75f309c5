#!/usr/bin/python3
"""carillon mesh2faust, from outside: its library compiled by Faust, against closed forms of a bar and of Faust's filter; arguments and exit
codes of the program that it stands in for.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import math
import os
import pathlib
import re
import tempfile
import unittest

import h5py
import numpy
import scipy.signal

from banks import BIN, calc_db, run
from faust_test import compile_dsp, play

SIZE = (0.3, 0.03, 0.02)
YOUNG, POISSON, DENSITY, ALPHA, BETA = 70e9, 0.35, 2700.0, 5.0, 1e-7
CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
FACES = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (2, 4, 8, 6), (4, 3, 7, 8), (3, 1, 5, 7)]
RATE = 48000


def write_box(file, faces=FACES):
    text = "# a box\n" + "".join("v {} {} {}\n".format(*(a * b for a, b in zip(corner, SIZE))) for corner in CORNERS)
    file.write_text(text + "".join("f {} {} {} {}\n".format(*face) for face in faces))


class Mesh2FaustTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        os.environ["XDG_CACHE_HOME"] = str(cls.folder / "cache")  # one solve for all tests
        os.environ["XDG_DATA_HOME"] = str(cls.folder / "data")
        write_box(cls.folder / "bar.obj")
        cls.out = cls.make("bar", "--expos", 0, 1, 5, 6, 7, "--showfreqs").stdout
        cls.make("Cube.001", "--freqcontrol")  # as Blender names objects

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    @classmethod
    def call(cls, *words, code=0):
        return run(BIN / "carillon", "mesh2faust", *words, cwd=cls.folder, code=code)

    @classmethod
    def make(cls, name, *words):
        material = ["--material", YOUNG, POISSON, DENSITY, ALPHA, BETA]
        return cls.call(*material, "--infile", "bar.obj", "--name", name, "--nsynthmodes", 12, *words)

    def read(self, name):
        """(frequencies, T60s, gains of each position), line by line as readers of these files do."""
        text = (self.folder / f"{name}.lib").read_text()
        self.assertNotIn("e-", text)
        rows = {}
        for key, pattern in (
            ("freq", r"^modeFreqsUnscaled\(n\) = ba\.take\(n\+1,\(([^()]+)\)\);$"),
            ("t60", r"^modesT60s\(n\) = t60Scale \* ba\.take\(n\+1,\(([^()]+)\)\);$"),
            ("gain", r"^modesGains\(p,n\) = waveform\{([^{}]+)\},int\(p\*nModes\+n\) : rdtable"),
        ):
            rows[key] = numpy.array(list(map(float, re.search(pattern, text, re.M)[1].split(","))))
        self.assertIn(f"nModes = {len(rows['freq'])};", text)
        return rows["freq"], rows["t60"], rows["gain"].reshape(-1, len(rows["freq"]))

    def test_modes_are_those_of_the_bar(self):
        freq_hz, t60_s, gains = self.read("bar")
        self.assertEqual(gains.shape[0], 5)
        self.assertEqual([round(float(line), 1) for line in self.out.splitlines()[1:] if line], [round(f, 1) for f in freq_hz])
        self.assertTrue((numpy.diff(freq_hz) > 0).all() and freq_hz[0] >= 20 and freq_hz[-1] <= 10000)
        # Euler and Bernoulli's free bars in both directions, a little above; Rayleigh's correction of the longitudinal mode.
        speed = math.sqrt(YOUNG / DENSITY)
        for thickness in SIZE[1:]:
            bending = 4.730041**2 / (2 * math.pi * SIZE[0] ** 2) * thickness / math.sqrt(12) * speed
            self.assertLess(min(abs(freq_hz / bending - 0.98)), 0.02)
        inertia = (SIZE[1] ** 2 + SIZE[2] ** 2) / 12
        lengthwise = speed / (2 * SIZE[0]) * (1 - 0.5 * (POISSON * math.pi / SIZE[0]) ** 2 * inertia)
        self.assertLess(min(abs(freq_hz / lengthwise - 1)), 1e-3)
        omega = 2 * math.pi * freq_hz
        numpy.testing.assert_allclose(t60_s, math.log(1000) / (0.5 * (ALPHA + BETA * omega**2)), rtol=1e-3)
        # Each position has its largest gain at 1; corners of one box are alike.
        numpy.testing.assert_allclose(gains.max(axis=1), 1)
        self.assertLess(abs(gains - gains[0]).max(), 0.02)

    def test_gains_are_those_of_the_bank(self):
        freq_hz, _, gains = self.read("bar")
        job = {
            "body": {"surface": str(self.folder / "bar.obj"), "scale": 1.0},
            "material": {"from": "aluminium", "young_modulus_pa": YOUNG, "poisson_ratio": POISSON, "density_kg_m3": DENSITY},
            "band_hz": [20, 10000],
            "max_modes": 12,
            "shapes": "exact",
        }
        job["material"]["damping"] = {"rayleigh": {"alpha1_s": BETA, "alpha2_per_s": ALPHA}}
        (self.folder / "job.json").write_text(json.dumps(job))
        found = json.loads(run(BIN / "carillon", "--json", "bank-for", "job.json", cwd=self.folder).stdout)
        self.assertFalse(found["is_new"])  # a surface is solved once
        with h5py.File(found["bank"]) as file:
            vertices, shape = file["mesh/vertices"][:], file["modes/shape"][:] * file["modes/shape_scale"][:][None, :, None]
            played = file["modes/corrected_frequency_hz"][:]
            decay = file["modes/corrected_decay"][:]
        numpy.testing.assert_allclose(freq_hz, numpy.sqrt(played**2 - (decay / (2 * math.pi)) ** 2), rtol=1e-8)
        for row, corner in zip(gains, (0, 1, 5, 6, 7)):
            vertex = numpy.argmin(numpy.linalg.norm(vertices - numpy.multiply(CORNERS[corner], SIZE), axis=1))
            sizes = numpy.linalg.norm(shape[vertex], axis=1)
            numpy.testing.assert_allclose(row, sizes / sizes.max(), atol=1e-6)

    def answer(self, freq_hz, t60_s, gains, frames):
        """Impulse response of pm.modeFilter, as physmodels.lib has it."""
        impulse, sound = numpy.zeros(frames), numpy.zeros(frames)
        impulse[0] = 1
        for f, t60, gain in zip(freq_hz, t60_s, gains):
            radius = 0.001 ** (1 / (t60 * RATE))
            sound += gain * scipy.signal.lfilter([1, 0, -1], [1, -2 * radius * math.cos(2 * math.pi * f / RATE), radius**2], impulse)
        return sound / len(freq_hz)

    def test_faust_plays_it(self):
        freq_hz, t60_s, gains = self.read("bar")
        (self.folder / "a.dsp").write_text('struck = library("bar.lib").bar(nentry("[1] point", 0, 0, 4, 1), 0.5);\nprocess = struck;\n')
        compile_dsp(self.folder, "a.dsp")
        for point in (0, 4):
            expected = self.answer(freq_hz, 0.5 * t60_s, gains[point], 9600)
            self.assertLess(calc_db(play(self.folder, RATE, 9600, 1.0, point) - expected, expected), -100)

    def test_its_pitch_can_be_a_parameter(self):
        freq_hz, t60_s, gains = self.read("Cube.001")
        (self.folder / "a.dsp").write_text('struck = library("Cube.001.lib").Cube_001(3000, 0, 1.0);\nprocess = struck;\n')
        compile_dsp(self.folder, "a.dsp")
        scaled = 3000 * freq_hz / freq_hz[0]
        kept = scaled < RATE / 2 - 1
        self.assertFalse(kept.all())
        expected = self.answer(scaled[kept], t60_s[kept], gains[0][kept], 9600) * kept.sum() / len(kept)
        self.assertLess(calc_db(play(self.folder, RATE, 9600, 1.0) - expected, expected), -100)

    def test_positions_and_names(self):
        self.assertEqual(self.read("Cube.001")[2].shape[0], 8)  # all vertices
        self.assertIn("\nCube_001(freq,exPos,t60Scale) = ", (self.folder / "Cube.001.lib").read_text())
        self.call("--infile", "bar.obj", "--material", YOUNG, POISSON, DENSITY, "--lmexpos", 3, "--nfemmodes", 40, "--debug")
        self.assertEqual(self.read("modalModel")[2].shape, (3, 10))

    def test_errors_have_exit_codes_and_leave_no_file(self):
        write_box(self.folder / "open.obj", FACES[:-1])
        (self.folder / "bad.obj").write_text("v 0 0 0\nv 1 0 x\n")
        (self.folder / "empty.obj").write_text("f 1 2 3\n")
        (self.folder / "kept.lib").write_text("an earlier one")
        for words, expected in (
            ([], ["--infile"]),
            (["--infile", "none.obj"], ["none.obj"]),
            (["--infile", "open.obj"], ["open.obj", "open surface"]),
            (["--infile", "bad.obj"], ["bad.obj:2", "three numbers"]),
            (["--infile", "empty.obj"], ["empty.obj", "no vertices"]),
            (["--infile", "bar.stl"], ["bar.stl", ".obj"]),
            (["--infile", "bar.obj", "--expos", 8], ["--expos 8", "0 to 7"]),
            (["--infile", "bar.obj", "--expos", -1], ["--expos"]),
            (["--infile", "bar.obj", "--material", 1e9, 0.3], ["--material"]),
            (["--infile", "bar.obj", "--material", 1e9, 0.3, 1000, 1], ["--material", "alpha beta"]),
            (["--infile", "bar.obj", "--material", 1e9, 0.7, 1000], ["poisson_ratio", "0.7"]),
            (["--infile", "bar.obj", "--minmode", 900, "--maxmode", 800], ["--minmode 900 --maxmode 800"]),
            (["--infile", "bar.obj", "--maxmode", 300], ["no modes", "--maxmode"]),
            (["--infile", "bar.obj", "--name", "bar.obj/bar"], ["bar.obj"]),
        ):
            with self.subTest(words=words):
                if "--name" not in words:
                    words = [*words, "--name", "kept"]
                error = self.call(*words, code=2).stderr
                self.assertEqual(error.count("\n"), 1, error)
                for part in expected:
                    self.assertIn(part, error)
                self.assertEqual((self.folder / "kept.lib").read_text(), "an earlier one")


if __name__ == "__main__":
    unittest.main()
