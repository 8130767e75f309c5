#!/usr/bin/python3
"""carillon study advise: what it predicts against closed forms, and from outside: the errors that its banks have against known frequencies,
and bad input.

usage: advise_test.py BIN_DIR
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "jobs/study"))
import bodies
import forecast

CUBE = {
    "body": {"shape": "box", "length_m": 0.05, "width_m": 0.05, "height_m": 0.05},
    "band_hz": [5000, 200000],
    "max_modes": 17,
    "material": {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}},
}


def call(folder, *words):
    return subprocess.run(
        [str(BIN / "carillon"), "study", "advise", *map(str, words)],
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=200,
    )


def find_worst(bank, body):
    done = subprocess.run([str(BIN / "carillon-bank"), "info", "--json", str(bank)], capture_output=True, text=True, check=True)
    freq_hz = json.loads(done.stdout)["frequencies_hz"]
    return max(abs(1200 * math.log2(f / true)) for f, true in zip(freq_hz, bodies.make_bodies()[body].truth.freq_hz, strict=True))


def make_samples(error, cpu, sizes=(500, 1000, 2000, 4000)):
    return [forecast.Sample(n, 3 * n, 20, error(n), 4 * error(n), cpu(n)) for n in sizes]


class Forecasts(unittest.TestCase):
    def test_curve_of_a_power_is_followed_between_and_beyond_its_samples(self):
        error = lambda n: 100 * (n / 500) ** -1.2
        curve = forecast.Curve("T10", make_samples(error, lambda n: 0.2 * (n / 500) ** 1.2))
        for nodes in (300, 500, 700, 3000, 16000):
            self.assertAlmostEqual(curve.predict_cpu(nodes) / (0.2 * (nodes / 500) ** 1.2), 1, 9)
        for nodes in (300, 500, 700, 3000, 4000):
            self.assertAlmostEqual(curve.predict_cents(nodes) / error(nodes), 1, 9)
        self.assertTrue(error(16000) < curve.predict_cents(16000) < 1.5 * error(16000))  # no better than the power beyond the samples
        nodes = curve.find_nodes(18)
        self.assertAlmostEqual(error(nodes), 18 * forecast.GOAL, delta=0.05)
        self.assertEqual(curve.find_nodes(1000), 500)
        self.assertIsNone(curve.find_nodes(1e-4))
        self.assertAlmostEqual(0.2 * (curve.find_affordable(3.0) / 500) ** 1.2, 3.0, delta=0.01)
        self.assertIsNone(curve.find_affordable(0.1))

    def test_error_that_is_small_by_chance_promises_nothing(self):
        samples = make_samples(lambda n: {500: 90, 1000: 2, 2000: 30, 4000: 8}[n], lambda n: n / 1000)
        curve = forecast.Curve("T4", samples)
        self.assertEqual(curve.predict_cents(1000), 30)
        self.assertGreaterEqual(curve.find_nodes(10), 2000)

    def test_stranger_is_predicted_from_two_trials(self):
        """A body whose errors and bars obey one power: two meshes predict it to half as much again and never less, whatever the study's
        ratio of bars to errors."""
        rows = [
            {
                "element": "T10",
                "nodes": n,
                "unknowns": 3 * n,
                "modes": 10,
                "cpu_s": n / 1000,
                "worst_cents": 4000 / n,
                "bar_cents": ratio * 4000 / n,
            }
            for n in (500, 1000, 2000, 4000)
            for ratio in (1.5, 9)
        ]
        advice = forecast.Advice({"bodies": {"a": rows[::2], "b": rows[1::2]}})
        error = lambda n: 50 * (n / 1000) ** (-4 / 3)
        trial = lambda n: forecast.Trial(n, 3 * n, [1000 * 2 ** (error(n) / 1200)], [3 * error(n)], n / 500, 0.0)
        probe = forecast.Probe(advice, "T10", lambda element, nodes, modes: nodes / 500)
        probe.trials = [trial(1000), trial(3000)]
        curve = probe.make_curve()
        for nodes in (1000, 3000, 6000, 12000):
            self.assertTrue(0.95 <= curve.predict_cents(nodes) / error(nodes) <= 1.5, (nodes, curve.predict_cents(nodes), error(nodes)))
        self.assertAlmostEqual(curve.predict_cpu(12000) / (12000 / 500), 1, 1)
        self.assertTrue(0.95 <= probe.judge(trial(9000)) / error(9000) <= 1.5)

    def test_tolerance_leaves_a_hundredth_of_what_is_asked(self):
        for cents in (0.001, 0.1, 1, 5, 100):
            tolerance = forecast.find_tolerance(cents)
            self.assertTrue(600 * math.log2(1 + tolerance) <= 0.0101 * cents or tolerance == forecast.STRICTEST_TOLERANCE)
            self.assertLessEqual(tolerance, forecast.LOOSEST_TOLERANCE)


class Program(unittest.TestCase):
    def setUp(self):
        self.keeper = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.keeper.name)

    def tearDown(self):
        self.keeper.cleanup()

    def ask(self, *words):
        done = call(self.folder, *words, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_bodies_of_the_study_come_to_what_was_asked(self):
        for body, cents in (("bar", 20), ("cube", 5)):
            answer = self.ask(body, "--cents", cents)
            worst = find_worst(answer["bank"], body)
            self.assertLessEqual(worst, cents, body)
            self.assertAlmostEqual(answer["reached"]["cents"], worst, 6)
            self.assertEqual((answer["reached"]["how"], answer["reached"]["is_met"]), ("known", True))
            self.assertLessEqual(answer["predicted"]["cents"], cents)
            self.assertGreater(
                answer["reached"]["cpu_seconds"], 0
            )  # How near the predicted seconds come is for tests/bench/accuracy/advise to say.
            job = json.loads(pathlib.Path(answer["job"]).read_text())
            self.assertEqual((job["element"], job["solver"]["tolerance"]), (answer["setting"]["element"], answer["setting"]["tolerance"]))

    def test_stranger_comes_to_what_was_asked(self):
        (self.folder / "cube.json").write_text("// a user's cube\n" + json.dumps(CUBE | {"element": "T4"}))
        answer = self.ask("cube.json", "--cents", 5)
        self.assertLessEqual(find_worst(answer["bank"], "cube"), 5)
        self.assertGreater(answer["reached"]["worst_bar_cents"], answer["reached"]["cents"])
        self.assertEqual((answer["kind"], answer["reached"]["how"]), ("shape", "bars"))
        self.assertTrue(any("element" in note for note in answer["notes"]))

    def test_seconds_buy_accuracy_and_dry_run_runs_nothing(self):
        answer = [self.ask("cube", "--seconds", seconds, "--dry-run") for seconds in (2, 8)]
        self.assertGreater(answer[0]["predicted"]["cents"], answer[1]["predicted"]["cents"])
        self.assertTrue(all(t["predicted"]["cpu_seconds"] <= t["asked"]["cpu_seconds"] and t["reached"] is None for t in answer))
        self.assertFalse(list(self.folder.glob("advice/*.hdf")))
        both = self.ask("cube", "--cents", 0.05, "--seconds", 2, "--dry-run")
        self.assertIn("0.05 cents", both["remark"])
        self.assertGreater(both["predicted"]["cents"], 0.05)

    def test_study_writes_what_advise_predicts_from(self):
        done = subprocess.run(
            [str(ROOT / "tests/bench/study/run"), "--bin", str(BIN), "--quick", "--on", "cube", "--only", "advice", "-o", "report"],
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=250,
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        made = json.loads((self.folder / "report/advice.json").read_text())
        self.assertTrue(made["is_quick"])
        rows = [row for row in made["bodies"]["cube"] if row["element"] == "T10"]
        answer = self.ask("cube", "--cents", math.ceil(rows[-1]["worst_cents"]), "--dry-run", "--advice", "report/advice.json")
        self.assertLessEqual(answer["setting"]["nodes"], rows[-1]["nodes"])
        text = (self.folder / "report/report.md").read_text()
        for default in ("element", "mass", "nodes of a body", "solver.tolerance", "solver.method", "solver.factorisation", "ranks"):
            self.assertRegex(text, rf"\| {default} +\|")

    def test_bad_input_is_one_clear_error(self):
        os.mkfifo(self.folder / "pipe.json")
        (self.folder / "both.json").write_text(json.dumps({"body": {}, "mesh": "a.msh"}))
        (self.folder / "list.json").write_text("[]")
        (self.folder / "a.txt").write_text("hello")
        (self.folder / "a.msh").write_text("$MeshFormat")
        (self.folder / "empty.json").write_text("{}")
        (self.folder / "old.json").write_text('{"format": 0}')
        (self.folder / "wrong.json").write_text(json.dumps(CUBE | {"bnad_hz": [1, 2]}))
        (self.folder / "lost.json").write_text(json.dumps({"mesh": "gone.msh"}))
        (self.folder / "none.advice").write_text('{"format": 1, "bodies": {}}')
        (self.folder / "zero.advice").write_text('{"format": 1, "bodies": {}, "calibration": {"job": {}, "cpu_s": 0}}')
        (self.folder / "few.advice").write_text('{"format": 1, "bodies": {}, "calibration": {"job": {}, "cpu_s": 1}}')
        cases = {
            ("bar",): "--cents",
            ("bar", "--cents", "0"): "above 0",
            ("bar", "--cents", "-3"): "above 0",
            ("bar", "--cents", "nan"): "above 0",
            ("bar", "--cents", "five"): "above 0",
            ("bar", "--seconds", "inf"): "above 0",
            ("bra", "--cents", "5"): 'did you mean "bar"',
            ("none.json", "--cents", "5"): "no such file",
            ("pipe.json", "--cents", "5"): "regular file",
            ("both.json", "--cents", "5"): "both",
            ("list.json", "--cents", "5"): "object",
            ("empty.json", "--cents", "5"): "neither",
            ("a.txt", "--cents", "5"): "ending",
            ("bar", "--cents", "5", "--wall", "0.1"): "--wall",
            ("bar", "--cents", "5", "--advice", "old.json"): "--write-advice",
            ("bar", "--cents", "5", "--advice", "nothing.json"): "nothing.json",
            ("bar", "--cents", "5", "--bin", "nowhere"): "--bin",
            ("box", "--cents", "5", "--band", "5,2"): "20,20000",
            ("bar", "--cents", "1e-7"): "give --cents",
            ("bar", "--seconds", "0.001"): "give --seconds",
            ("a.msh", "--cents", "5", "--check"): "--check",
            ("wrong.json", "--cents", "5"): "bnad_hz",
            (".", "--cents", "5"): "regular file",
            ("bar", "--cents", "5", "--check"): "--check",
            ("lost.json", "--cents", "5"): "gone.msh",
            ("bar", "--cents", "5", "--advice", "none.advice"): "calibration",
            ("bar", "--cents", "5", "--advice", "zero.advice"): "not a positive number",
            ("box", "--cents", "5", "--advice", "few.advice"): "too few",
            ("wrong.json", "--cents", "50", "-o", "."): "-o",
        }
        for words, expected in cases.items():
            done = call(self.folder, *words)
            self.assertEqual(done.returncode, 2, f"{words}: {done.stdout}{done.stderr}")
            errors = [line for line in done.stderr.splitlines() if "error" in line]
            self.assertEqual(len(errors), 1, done.stderr)
            self.assertIn(expected, errors[0], words)
            self.assertNotIn("Traceback", done.stderr)
            self.assertFalse(list(self.folder.glob("advice/*.hdf")), words)
        self.assertEqual(call(self.folder, "bra", "--cents", "5", "-o", "other").returncode, 2)
        self.assertFalse((self.folder / "other").exists())
        self.assertEqual(json.loads((self.folder / "wrong.json").read_text()), CUBE | {"bnad_hz": [1, 2]})


if __name__ == "__main__":
    unittest.main()
