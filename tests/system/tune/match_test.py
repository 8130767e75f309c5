#!/usr/bin/python3
"""carillon match: constants and losses of a rendered bar, deviations that hold, what cannot be resolved, bad input.

usage: match_test.py BIN_DIR [Match|Deviations]
"""
import csv
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom

import numpy
import scipy.io.wavfile

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "jobs/tune"), str(ROOT / "jobs/study")]
import constants
import solver
import sound

YOUNG, NU, ALPHA, TAN_PHI = 74.3e9, 0.345, 3.0, 0.0015  # of the body; the jobs of the tests start from others
SIZES = {"length_m": 0.25, "width_m": 0.035, "thickness_m": 0.009}
LOST, FALSE_HZ = (1, 4, 6), (1000.0, 3333.0, 5000.0, 8000.0)


def make_job(nodes, young=70e9, nu=0.33, **sizes):
    return {
        "body": {"shape": "bar", **SIZES, **sizes, "nodes": nodes},
        "material": {
            "young_modulus_pa": young,
            "poisson_ratio": nu,
            "density_kg_m3": 2700,
            "damping": {"caughey": {"powers": [0, 0.5], "coefficients": [ALPHA, TAN_PHI]}},
        },
        "bank": "bar.hdf",
    }


class Match(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keeper = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.keeper.name)
        cls.write("truth.json", make_job(12000, YOUNG, NU))
        cls.write("start.json", make_job(4000))
        strike = {"time_s": 0.1, "body": "bar", "point_m": [0.11, 0.012, 0.0045], "impulse_n_s": [0, 0, -0.02], "duration_s": 4e-5}
        scene = {"duration_s": 2.0, "bodies": [{"name": "bar", "bank": "bar.hdf", "fixed": True}], "strikes": [strike]}
        cls.write("scene.json", scene)
        cls.call("carillon-precompute", "-q", "truth.json", code=0)
        cls.call("carillon-render", "-q", "scene.json", "-o", "clean.wav", code=0)
        samples, rate = sound.read_wav(cls.folder / "clean.wav")
        first = sound.find_onsets(samples, rate)[0]
        level = numpy.sqrt((samples[first : first + round(0.3 * rate)] ** 2).mean())
        noisy = samples + 0.1 * level * numpy.random.default_rng(1).normal(size=len(samples))
        scipy.io.wavfile.write(cls.folder / "noisy.wav", round(rate), (2e4 * noisy).astype(numpy.int16))
        cls.found = json.loads(cls.call("carillon", "match", "start.json", "noisy.wav", "-o", "out", "--json", code=0).stdout)

    @classmethod
    def tearDownClass(cls):
        cls.keeper.cleanup()

    @classmethod
    def write(cls, name, content):
        (cls.folder / name).write_text(json.dumps(content) if not isinstance(content, str) else content)

    @classmethod
    def call(cls, program, *words, code, environment=None):
        done = subprocess.run(
            [str(BIN / program), *map(str, words)],
            cwd=cls.folder,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            timeout=200,
        )
        assert done.returncode == code, (done.returncode, done.stdout, done.stderr)
        return done

    def match(self, *words):
        return json.loads(self.call("carillon-tune", "match", *words, "--json", code=0).stdout)

    def check(self, found):
        young, nu = (found["constants"][name] for name in ("E", "nu"))
        self.assertLess(abs(young["value"] / YOUNG - 1), 1e-3)
        self.assertLess(abs(nu["value"] - NU), 2e-3)
        self.assertLess(abs(young["value"] - YOUNG), 2 * young["sd"])
        self.assertLess(abs(nu["value"] - NU), 2 * nu["sd"])
        self.assertFalse(found["is_wrong_shape"])

    def test_noisy_strike_gives_constants_and_losses(self):
        self.check(self.found)
        self.assertGreaterEqual(len(self.found["peaks"]), 10)
        alpha, tan_phi = self.found["law"]["caughey"]["coefficients"]
        self.assertLess(abs(tan_phi / TAN_PHI - 1), 0.05)
        self.assertLess(abs(alpha - ALPHA), 1.5)
        for peak in self.found["peaks"]:
            if 20 * math.pi < peak["decay_per_s"]:  # those of slower ones are below the noise
                continue
            decay = 0.5 * (ALPHA + TAN_PHI * 2 * math.pi * peak["hz"])
            self.assertLess(abs(peak["decay_per_s"] / decay - 1), 0.08)

    def test_material_file_is_that_of_other_commands(self):
        shown = json.loads(
            self.call(
                "carillon", "materials", "start matched", "--json", code=0, environment={"CARILLON_MATERIALS": "out/material.json"}
            ).stdout
        )["materials"][0]
        self.assertAlmostEqual(shown["young_modulus_pa"] / self.found["constants"]["E"]["value"], 1.0, 9)
        self.assertIn("noisy.wav", shown["elasticity_source"])
        xml.dom.minidom.parse(str(self.folder / "out/spectrum.svg"))

    def test_lost_and_false_peaks(self):
        with open(self.folder / "out/peaks.csv") as stream:
            rows = [[row["hz"], row["sd_hz"]] for row in csv.DictReader(stream)]
        rows = [row for k, row in enumerate(rows) if k not in LOST] + [[hz, 0.05] for hz in FALSE_HZ]
        self.write("spoilt.csv", "hz,sd_hz\n" + "".join(f"{hz},{sd}\n" for hz, sd in rows))
        found = self.match("start.json", "spoilt.csv", "--mass", "0.212625kg", "--tolerance", "1um")
        self.check(found)
        self.assertEqual(sorted(peak["hz"] for peak in found["peaks"] if peak["mode"] is None), list(FALSE_HZ))

    def test_one_peak_gives_young_alone(self):
        lowest = self.found["peaks"][0]["hz"]
        self.write("one.csv", f"hz,sd_hz\n{lowest},0.01\n")
        found = self.match("start.json", "one.csv", "-o", "one")
        young = found["constants"]["E"]
        self.assertLess(abs(young["value"] - YOUNG), 2 * young["sd"])
        self.assertEqual(found["constants"]["nu"], {"value": 0.33, "sd": None})
        self.assertIsNone(found["law"])

    def test_wrong_thickness_is_said_to_be_hidden(self):
        self.write("thick.json", make_job(4000, thickness_m=1.02 * SIZES["thickness_m"]))
        found = self.match("thick.json", "out/peaks.csv", "-o", "thick")
        note = next(note for note in found["notes"] if note.startswith("thickness_m and E are not distinguished"))
        power = float(note.split("thickness_m^")[1].split(" ")[0])
        self.assertLess(abs(power - 2), 0.1)
        true = YOUNG * SIZES["thickness_m"] ** power / 2700
        self.assertLess(abs(float(note.split("density = ")[1].split(" ")[0]) / true - 1), 1e-2)

    def test_wrong_shape_is_recognised_and_the_size_named(self):
        self.write("wide.json", make_job(4000, width_m=0.9 * SIZES["width_m"]))
        found = self.match("wide.json", "out/peaks.csv", "-o", "wide")
        self.assertTrue(found["is_wrong_shape"], found)
        self.assertTrue(any(note.startswith("width_m = ") for note in found["notes"]), found["notes"])

    def test_bad_input_is_one_line_with_the_place(self):
        self.write("letters.csv", "hz\n440\nabc\n")
        self.write("empty.csv", "hz\n")
        self.write("notes.wav", "no sound")
        self.write("short.csv", "hz,t60_s\n440,1e-300\n")
        self.write("long.csv", "hz\n" + "4" * 200000)
        whole = (self.folder / "noisy.wav").read_bytes()
        for name, content in (("cut.wav", whole[:30]), ("head.wav", whole[:44]), ("align.wav", whole[:32] + b"\0\0" + whole[34:])):
            (self.folder / name).write_bytes(content)
        (self.folder / "taken/peaks.csv").mkdir(parents=True)
        for words, says in (
            (["start.json", "letters.csv"], "letters.csv:3: hz is 'abc'"),
            (["start.json", "empty.csv"], "empty.csv: has no peaks"),
            (["start.json", "notes.wav"], "notes.wav: cannot be read as a WAV file"),
            (["start.json", "short.csv"], "short.csv:2: t60_s is 1e-300"),
            (["start.json", "long.csv"], "long.csv: cannot be read as a table"),
            (["start.json", "cut.wav"], "cut.wav: cannot be read as a WAV file"),
            (["start.json", "head.wav"], "head.wav: has no samples"),
            (["start.json", "align.wav"], "align.wav: cannot be read as a WAV file"),
            (["start.json", "noisy.wav", "-o", "taken"], "taken/peaks.csv: is a folder"),
            (["none.json", "noisy.wav"], "none.json: cannot read the job"),
            (["start.json", "noisy.wav", "--mass", "3"], "--mass"),
        ):
            done = self.call("carillon-tune", "match", *words, code=2)
            self.assertIn(says, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)


class Deviations(unittest.TestCase):
    """Noise drawn again at the level of peaks, on one solved body."""

    CASES = 200

    def test_truth_is_within_two_deviations(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "start.json").write_text(json.dumps(make_job(4000)))
            made = solver.Solver(BIN / "carillon-precompute", folder / "start.json")
            true_hz = made.solve(make_job(12000, YOUNG, NU) | {"max_modes": 18}).corrected_hz
            heard = numpy.array([0, 1, 3, 4, 5, 6, 8, 9, 11, 13, 14, 15, 16, 17])
            peaks = [sound.Peak(hz, 0.1 * hz / constants.TO_CENTS) for hz in true_hz[heard]]
            matcher = constants.Matcher(made, make_job(4000), peaks)
            _, model, _ = matcher.fit()
        inside, near = numpy.zeros(2), 0
        rng = numpy.random.default_rng(0)
        for _ in range(self.CASES):
            kept = rng.permutation(len(heard))[3:]
            real = true_hz[heard][kept] * numpy.exp(0.1 / constants.TO_CENTS * rng.normal(size=len(kept)))
            false = math.exp(1) ** rng.uniform(math.log(700), math.log(19000), 4)
            matcher.hear([sound.Peak(hz, 0.1 * hz / constants.TO_CENTS) for hz in sorted([*real, *false])])
            fit = matcher.fit_to(model)
            young, nu = math.exp(fit.x[0]), fit.x[1]
            is_near = abs(young / YOUNG - 1) < 1e-3 and abs(nu - NU) < 2e-3
            self.assertTrue(is_near or fit.chi2 > constants.WRONG_CHI2, fit)  # the others are refused
            near += is_near
            sd = numpy.sqrt(numpy.diag(fit.covariance))
            inside += [abs(fit.x[0] - math.log(YOUNG)) < 2 * sd[0], abs(nu - NU) < 2 * sd[1]]
        self.assertTrue((inside >= 0.95 * self.CASES).all(), inside)
        self.assertGreaterEqual(near, 0.98 * self.CASES)


if __name__ == "__main__":
    unittest.main()
