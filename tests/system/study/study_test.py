#!/usr/bin/python3
"""carillon-study scaling: output, comparison of work, bad input.

usage: study_test.py BIN_DIR
"""
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "jobs/study"))
sys.path.insert(0, str(ROOT / "tests/support"))
import fixtures
import job_file
import scaling

JOB = ROOT / "tests/system/study/job.json"


def call(folder, *words):
    return subprocess.run(
        [str(BIN / "carillon-study"), *map(str, words)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=200
    )


class Program(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keeper = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.keeper.name)
        cls.result = call(cls.folder, "scaling", JOB, "--quick", "-o", "out", "--record", "work.json")

    @classmethod
    def tearDownClass(cls):
        cls.keeper.cleanup()

    def test_report_has_tables_and_pictures_that_are_there(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)
        text = (self.folder / "out/report.md").read_text()
        for title in ("Strong scaling", "Weak scaling", "Growth with the mesh", "Messages"):
            self.assertIn(f"## {title}", text)
        for picture in ("strong.svg", "weak.svg", "growth.svg"):
            self.assertIn(f"({picture})", text)
            xml.dom.minidom.parse(str(self.folder / "out" / picture))

    def test_cases_agree_with_the_records_of_the_runs(self):
        with open(self.folder / "out/cases.csv") as stream:
            rows = list(csv.DictReader(stream))
        self.assertEqual({(row["nodes_asked"], row["ranks"]) for row in rows}, {("600", "1"), ("1200", "1"), ("1200", "2")})
        record = json.loads((self.folder / "out/n1200_r2.hdf.resolved.json").read_text())["run"]
        for row in rows:
            if (row["nodes_asked"], row["ranks"]) == ("1200", "2"):
                self.assertEqual(float(row["messages"]), record["work"][row["phase"]]["messages"])
                self.assertLessEqual(float(row["mpi_s"]), float(row["wall_s"]) + 1e-3)
        factor = [row for row in rows if row["phase"] == "factor" and row["ranks"] == "2"]
        self.assertGreater(int(factor[0]["messages"]), 0)

    def check(self, change):
        record = json.loads((self.folder / "work.json").read_text())
        change(record["cases"][-1]["work"])
        (self.folder / "changed.json").write_text(json.dumps(record))
        return call(self.folder, "scaling", JOB, "--quick", "-o", "out2", "--check", "changed.json")

    def test_work_as_recorded_is_well(self):
        result = self.check(lambda work: None)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("as recorded", result.stdout)

    def test_growth_above_five_per_cent_fails_and_names_the_command(self):
        def shrink(work):
            work["factor"]["flops"] /= 1.06
            work["solve"]["messages"] *= 2  # less than recorded is no failure
            work["errors"]["bytes"] /= 1.04  # and neither is this

        result = self.check(shrink)
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertIn("factor: flops", result.stderr)
        self.assertIn("--record changed.json", result.stderr)
        self.assertNotIn("errors: bytes", result.stderr)
        self.assertNotIn("solve: messages", result.stderr)
        self.assertIn("solve: messages", result.stdout)

    def test_mesh_file_gets_strong_scaling_only_and_says_so(self):
        fixtures.copy("bar.msh", self.folder)
        job = json.loads(job_file.strip_comments(JOB.read_text()))
        job.pop("body")
        (self.folder / "mesh.json").write_text("// a mesh file\n" + json.dumps(job | {"mesh": "bar.msh"}))
        result = call(self.folder, "scaling", "mesh.json", "--quick", "-o", "meshed")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("strong scaling only", result.stdout)
        text = (self.folder / "meshed/report.md").read_text()
        self.assertIn("strong scaling only", text)
        self.assertNotIn("## Weak", text)
        weak = call(self.folder, "scaling", "mesh.json", "--nodes", "500,1000", "-o", "meshed")
        self.assertEqual(weak.returncode, 2)
        self.assertIn("cannot be meshed again", weak.stderr)

    def test_bad_input_is_one_clear_error_and_starts_nothing(self):
        (self.folder / "list.json").write_text("[1]")
        (self.folder / "text.json").write_text('{"body": ')
        (self.folder / "empty.json").write_text("{}")
        (self.folder / "cents.json").write_text('{"body": {"shape": "bar"}, "accuracy_cents": 5}')
        os.mkfifo(self.folder / "pipe.json")
        (self.folder / "other_record.json").write_text('{"format": 1, "job": {}, "cases": []}')
        cases = {
            ("none.json",): "none.json",
            ("list.json",): "object",
            ("text.json",): "text.json:1",
            ("empty.json",): "neither",
            ("cents.json",): "accuracy_cents",
            ("pipe.json",): "regular file",
            (JOB, "--ranks", "0"): "ranks",
            (JOB, "--ranks", "two"): "whole numbers",
            (JOB, "--nodes", "3"): "nodes",
            (JOB, "--repeats", "0"): "repeats",
            (JOB, "--rank"): "rank",
            (JOB, "--check", "none.json"): "--record none.json",
            (JOB, "--check", "text.json"): "text.json:1",
            (JOB, "--record", "a", "--check", "b"): "exclude",
            (JOB, "--bin", "nowhere"): "--bin",
        }
        for words, expected in cases.items():
            result = call(self.folder, "scaling", *words, "-o", "bad")
            self.assertEqual(result.returncode, 2, f"{words}: {result.stdout}{result.stderr}")
            self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
            self.assertIn(expected, result.stderr, words)
            self.assertNotIn("CPU s", result.stdout)
        os.mkfifo(self.folder / "pipe_record.json")
        (self.folder / "deep.json").write_text("[" * 100000)
        (self.folder / "digits.json").write_text('{"format": ' + "1" * 5000 + "}")
        for record, expected in (("pipe_record.json", "regular file"), ("deep.json", "not valid JSON"), ("digits.json", "not valid JSON")):
            result = call(self.folder, "scaling", JOB, "-o", "bad", "--check", record)
            self.assertEqual((result.returncode, len(result.stderr.strip().splitlines())), (2, 1), result.stderr)
            self.assertIn(expected, result.stderr)
        result = call(self.folder, "scaling", JOB, "--quick", "--ranks", "1", "--nodes", "600", "-o", "bad", "--check", "other_record.json")
        self.assertEqual(result.returncode, 2)
        self.assertIn("another job", result.stderr)

    def test_record_that_lacks_something_is_one_clear_error_before_any_run(self):
        def drop(record, *keys):
            for key in keys[:-1]:
                record = record[key]
            del record[keys[-1]]

        def put(record, value, *keys):
            for key in keys[:-1]:
                record = record[key]
            record[keys[-1]] = value

        changes = {
            "not a record": lambda record: drop(record, "job"),
            '"nodes"': lambda record: drop(record, "cases", 1, "nodes"),
            '"ranks"': lambda record: put(record, "2", "cases", 1, "ranks"),
            "not an object": lambda record: put(record, 7, "cases", 1),
            '"work"': lambda record: drop(record, "cases", 1, "work"),
            '"solve"': lambda record: put(record, None, "cases", 1, "work", "solve"),
            '"flops"': lambda record: drop(record, "cases", 1, "work", "factor", "flops"),
            '"bytes"': lambda record: put(record, float("nan"), "cases", 1, "work", "factor", "bytes"),
        }
        for expected, change in changes.items():
            record = json.loads((self.folder / "work.json").read_text())
            change(record)
            (self.folder / "lacking.json").write_text(json.dumps(record))
            result = call(self.folder, "scaling", JOB, "--quick", "-o", "bad", "--check", "lacking.json")
            self.assertEqual((result.returncode, len(result.stderr.strip().splitlines())), (2, 1), expected + result.stderr)
            self.assertIn(expected, result.stderr)
            self.assertIn("--record lacking.json", result.stderr)
            self.assertNotIn("CPU s", result.stdout)

    def test_error_of_a_run_is_passed_on_with_its_code(self):
        job = json.loads(job_file.strip_comments(JOB.read_text()))
        (self.folder / "wrong.json").write_text(json.dumps(job | {"bnad_hz": [20, 100]}))
        result = call(self.folder, "scaling", "wrong.json", "--quick", "-o", "wrong")
        self.assertEqual(result.returncode, 2)
        self.assertIn("bnad_hz", result.stderr)

    def test_power_is_fitted(self):
        power, factor = scaling.fit_power([1, 2, 4, 8], [3 * x**1.5 for x in (1, 2, 4, 8)])
        self.assertAlmostEqual(power, 1.5, 12)
        self.assertAlmostEqual(factor, 1.0, 12)
        self.assertIsNone(scaling.fit_power([5, 5], [1, 2]))


if __name__ == "__main__":
    unittest.main()
