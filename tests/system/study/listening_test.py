#!/usr/bin/python3
"""tests/bench/study/run --only banks playing contact on a small bar: what it finds must follow from arithmetic that it does not use.

usage: listening_test.py BIN_DIR"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
STUDY = pathlib.Path(__file__).resolve().parents[3] / "tests/bench/study"


def read(folder, name):
    with open(folder / f"{name}.csv", newline="") as stream:
        return list(csv.DictReader(stream))


class Listening(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.out = pathlib.Path(cls.folder.name) / "report"
        done = subprocess.run(
            [STUDY / "run", "--bin", BIN, "--quick", "--on", "bar", "--only", "banks", "playing", "contact", "--json", "-o", cls.out],
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        if done.returncode != 0:
            raise AssertionError(done.stderr[-2000:])
        cls.findings = json.loads(done.stdout)["findings"]

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_a_bit_of_a_shape_is_worth_six_decibels(self):
        rows = {int(row["bits"]): row for row in read(self.out, "banks-bar-bits")}
        errors = {bits: float(row["error_dba"]) for bits, row in rows.items() if bits < 16}
        for coarse, fine in ((4, 8), (8, 12)):
            self.assertAlmostEqual((errors[coarse] - errors[fine]) / (fine - coarse), 6.02, delta=1.5)
        self.assertLess(int(rows[8]["bank_bytes"]), int(rows[12]["bank_bytes"]))
        self.assertAlmostEqual(int(rows[12]["bank_bytes"]), int(rows[16]["bank_bytes"]), delta=1000)  # but for what the provenance says

    def test_the_kernel_is_the_closed_form(self):
        rows = read(self.out, "playing-kernel")
        self.assertIn("plain", [row["instructions"] for row in rows])
        for row in rows:  # 24 bits: -144 dB for each rounding
            self.assertLess(float(row["error_dba"]), -100.0, row)
            self.assertGreater(float(row["error_dba"]), -200.0, row)

    def test_every_knob_has_its_default_and_its_reference(self):
        for key in ("silence_pa", "modes", "sample_rate_hz", "planner_db", "quiet_db", "contact_step_s"):
            rows = read(self.out, f"playing-{key}")
            self.assertGreaterEqual(len(rows), 2, key)
            self.assertEqual(rows[0]["audible"], "", key)
            self.assertTrue(any(f"`{key}`" in text for text in self.findings["playing"]), key)
        self.assertGreater(
            float(read(self.out, "playing-silence_pa")[-1]["error_dba"]), -60.0
        )  # silence at 1 mPa is heard, or the knob turns nothing

    def test_effects_that_are_left_out_are_missed(self):
        rows = {row["effects"]: row for row in read(self.out, "playing-effects")}
        self.assertIn("auto", rows)
        self.assertGreater(float(rows["without hertz_pulse"]["error_dba"]), -40.0)

    def test_a_finer_step_is_dearer_and_the_loosest_is_near_to_the_closed_form(self):
        rows = {float(row["contact_step_s"]): row for row in read(self.out, "contact-contact_step_s")}
        errors = {step: float(row["error"]) for step, row in rows.items()}
        self.assertLess(max(errors.values()), 1e-4)  # a top turns fast, and so takes short steps whatever the longest may be
        self.assertGreater(float(rows[1e-4]["cpu_ms_per_s"]), float(rows[2e-3]["cpu_ms_per_s"]))
        self.assertLess(float(read(self.out, "contact-triangles")[-1]["error"]), 0.01)
        self.assertTrue(any("`modes_in_impacts`" in text for text in self.findings["contact"]))


if __name__ == "__main__":
    unittest.main()
