#!/usr/bin/python3
"""docs/examples/tune: a slender bar is tuned to where beam theory says, and what cannot be tuned is refused.

usage: tune_test.py SOURCE_DIR BIN_DIR
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

SOURCE, BIN = pathlib.Path(sys.argv.pop(1)), pathlib.Path(sys.argv.pop(1))


def tune(folder, body, *arguments):
    material = {
        "young_modulus_pa": 200e9,
        "poisson_ratio": 0.3,
        "density_kg_m3": 7850,
        "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 1}},
    }
    job = {"body": body, "material": material, "band_hz": [20, 3000], "bank": "bar.hdf"}
    (folder / "bar.json").write_text(json.dumps(job))
    return subprocess.run(
        [SOURCE / "docs/examples/tune", folder / "bar.json", "--bin", BIN, "--out", folder / "tuned", *arguments],
        capture_output=True,
        text=True,
    )


class Tune(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def test_a_slender_bar_has_the_length_of_beam_theory(self):
        # Free bar of thickness h: f = 4.730041^2 / (2 pi L^2) sqrt(E / rho) h / sqrt(12) (Euler and Bernoulli).
        body = {"shape": "bar", "length_m": 0.4, "width_m": 0.008, "thickness_m": 0.004, "nodes": 1500}
        done = tune(self.folder, body, "--hz", "220", "--cents", "1")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        length = json.loads((self.folder / "tuned/tuned-220.json").read_text())["body"]["length_m"]
        wanted = math.sqrt(4.730041**2 / (2 * math.pi * 220) * math.sqrt(200e9 / 7850) * 0.004 / math.sqrt(12))
        self.assertLess(abs(length / wanted - 1), 1e-3)
        self.assertTrue((self.folder / "tuned/tuned-220.hdf").is_file())
        self.assertRegex(done.stdout, r"220 +0\.[0-9]+ +2(19\.9|20\.[01])")

    def test_what_has_no_length_or_no_pitch_is_refused(self):
        done = tune(self.folder, {"shape": "sphere", "radius_m": 0.1}, "--hz", "220")
        self.assertEqual(done.returncode, 1)
        self.assertIn("length_m", done.stderr)
        done = tune(self.folder, {"shape": "bar", "length_m": 0.4}, "--hz", "-220")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("--hz", done.stderr)
        done = tune(self.folder, {"shape": "bar", "length_m": 0.4, "nodes": 600}, "--hz", "440", "--rounds", "1")
        self.assertEqual(done.returncode, 1)
        self.assertIn("after 1 rounds", done.stderr)


if __name__ == "__main__":
    unittest.main()
