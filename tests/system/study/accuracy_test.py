#!/usr/bin/python3
"""tests/bench/study/run from outside: rates, error bars and signs against theory, interruption, and bad input.

usage: accuracy_test.py BIN_DIR
"""
import csv
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
ROOT = pathlib.Path(__file__).resolve().parents[3]
STUDY = ROOT / "tests/bench/study"
sys.path[:0] = [str(STUDY), str(ROOT / "jobs/study")]
import bodies
import cents
import known
import mesh_file
import papers
import plots


def call(folder, *words, seconds=200):
    return subprocess.run(
        [str(STUDY / "run"), "--bin", str(BIN), *map(str, words)],
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=seconds,
    )


def read(path):
    with open(path) as stream:
        return list(csv.DictReader(stream))


class Study(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.keeper = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.keeper.name)
        cls.result = call(cls.folder, "--quick", "--on", "cube", "ring", "--only", "elements", "-o", "out")

    @classmethod
    def tearDownClass(cls):
        cls.keeper.cleanup()

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)
        self.out = self.folder / "out"

    def find_modes(self, body, element):
        """{nodes: [signed error of every mode in cents]}, and the elements of each mesh."""
        found = {}
        for row in read(self.out / f"elements-{body}-modes.csv"):
            if row["element"] == element:
                found.setdefault(int(row["nodes"]), []).append(float(row["error_cents"]))
        return found

    def test_report_is_whole(self):
        text = (self.out / "report.md").read_text()
        commands = [line.strip() for line in text.splitlines() if line.startswith("    tests/bench/study/run")]
        self.assertEqual(
            commands,
            [
                "tests/bench/study/run --quick --on cube ring --only elements -o REPORT",
                *(f"tests/bench/study/run --only elements --on {bodies} --quick -o REPORT" for bodies in ("cube", "ring", "cube ring")),
            ],
        )
        self.assertIn("## In words", text)
        for picture in ("elements-cube.svg", "elements-ring.svg"):
            self.assertIn(f"({picture})", text)
            xml.dom.minidom.parse(str(self.out / picture))
            self.assertTrue((self.out / picture.replace(".svg", ".csv")).is_file())
        page = (self.out / "report.html").read_text()
        self.assertEqual(page.count("<svg"), 2)
        self.assertNotIn('src="', page)

    def test_errors_in_the_csv_are_those_of_the_banks(self):
        """Independent reference from the paper: the cube's lowest pair is 2.85604469 c_T / a (Demarest 1971)."""
        shear = math.sqrt(200e9 / 2.6 / 7850)
        true_hz = 2.85604469 * shear / 0.05 / (2 * math.pi)
        points = {
            int(row["nodes"]): float(row["error_mode_1_cents"])
            for row in read(self.out / "elements-cube.csv")
            if row["element"] == "T10 straight"
        }
        found = {}
        for kept in (self.out / "work/runs").iterdir():
            record = json.loads((kept / "kept.json").read_text())
            job = json.loads((kept / "job.json").read_text())
            if job["element"] == "T10" and record["nodes"] in points and job["band_hz"][0] > 5000:
                found[record["nodes"]] = 1200 * math.log2(record["modes"][0][0] / true_hz)
        self.assertEqual(set(found), set(points))
        for nodes, value in found.items():
            self.assertAlmostEqual(points[nodes], value, delta=2e-3)

    def test_frequencies_of_t10_converge_with_the_fourth_power(self):
        rates = {(row["body"], row["element"]): float(row["rate_measured"]) for row in read(self.out / "elements-rates.csv")}
        self.assertGreater(rates["cube", "T10 straight"], 3.4)
        self.assertLess(rates["cube", "T10 straight"], 4.5)
        self.assertGreater(rates["cube", "T4 consistent"], 1.5)
        self.assertLess(rates["cube", "T4 consistent"], 2.5)
        self.assertLess(rates["ring", "T10 straight"], rates["ring", "T10 curved"])

    def test_consistent_mass_is_sharp_and_lumping_flattens(self):
        """Ritz: consistent elements on a flat body are never too low. Lumping T4 lowers every frequency."""
        consistent, lumped = self.find_modes("cube", "T4 consistent"), self.find_modes("cube", "T4 lumped")
        self.assertEqual(set(consistent), set(lumped))
        for nodes, errors in consistent.items():
            self.assertGreater(min(errors), -1e-3)
            self.assertTrue(all(low < high for low, high in zip(lumped[nodes], errors)))
        for errors in self.find_modes("cube", "T10 straight").values():
            self.assertGreater(min(errors), -1e-3)

    def test_finest_mesh_lies_within_its_own_error_bars(self):
        truths = known.read_known()
        looked = 0
        for kept in (self.out / "work/runs").iterdir():
            record, job = (json.loads((kept / name).read_text()) for name in ("kept.json", "job.json"))
            if job["element"] != "T10" or record["nodes"] < 1000:
                continue
            truth = truths["ring" if job["material"]["density_kg_m3"] == 8500 else "cube"]
            frequency, algebraic, body, *_ = record["modes"][0]
            self.assertLess(abs(cents.to_cents(frequency, truth.freq_hz[0])), algebraic + body)
            looked += 1
        self.assertGreaterEqual(looked, 3)

    def test_what_was_measured_is_kept_and_what_is_damaged_is_measured_again(self):
        shutil.rmtree(self.folder / "again", ignore_errors=True)
        shutil.copytree(self.out, self.folder / "again")
        runs = sorted((self.folder / "again" / "work" / "runs").iterdir())
        (runs[0] / "kept.json").write_text('{"cpu_s": [1')
        before = {run: (run / "kept.json").stat().st_mtime_ns for run in runs[1:]}
        result = call(self.folder, "--quick", "--on", "cube", "ring", "--only", "elements", "-o", "again")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("are kept from before", result.stderr)
        self.assertIn("1/1", result.stderr)
        self.assertEqual(before, {run: (run / "kept.json").stat().st_mtime_ns for run in runs[1:]})
        self.assertEqual(len(json.loads((runs[0] / "kept.json").read_text())["cpu_s"]), 1)

    def test_page_of_the_docs_is_renewed_from_a_report_and_a_second_time_changes_nothing(self):
        docs = self.folder / "docs"
        page = docs / "reports/accuracy.md"
        for folder in (docs / "images", page.parent):
            folder.mkdir(parents=True, exist_ok=True)
        whole = (ROOT / "docs/reports/accuracy.md").read_text()
        page.write_text(whole)
        update = [ROOT / "tests/bench/accuracy/update", self.out, docs]
        partial = subprocess.run(update, capture_output=True, text=True)
        self.assertEqual((partial.returncode, len(partial.stderr.splitlines())), (2, 1), partial.stderr)
        self.assertIn("lacks advice, air", partial.stderr)
        self.assertEqual(page.read_text(), whole)
        # The page of a study of one section.
        page.write_text(re.sub(r"<!-- accuracy:(?!elements)(\w+) -->.*?<!-- /accuracy:\1 -->\n", "", whole, flags=re.S))
        first = subprocess.run(update, capture_output=True, text=True)
        self.assertEqual(first.returncode, 0, first.stderr)
        text = page.read_text()
        # The section shows the findings and the pictures of this report, instead of those of all bodies.
        made = json.loads((self.out / "report.json").read_text())
        section = re.search(r"<!-- accuracy:elements -->\n(.*?)<!-- /accuracy:elements -->", text, re.S)[1]
        self.assertEqual(re.findall(r"\(\.\./images/accuracy-([\w-]+)\.svg\)", section), ["elements-cube", "elements-ring"])
        self.assertEqual([line[2:] for line in section.splitlines() if line.startswith("- ")], made["sections"][0]["findings"])
        self.assertTrue(any("semitone" in finding for finding in made["sections"][0]["findings"]))
        self.assertIn(f"\n{made['measured']}\n", text)
        self.assertIn(f"<!-- machine -->\n{made['machine']}\n", text)
        for picture in re.findall(r"\(\.\./(images/accuracy-elements[^)]*)\)", text):
            self.assertTrue((docs / picture).is_file() or (ROOT / "docs" / picture).is_file(), picture)
        for picture in ("elements-cube.svg", "elements-ring.svg"):
            self.assertEqual((docs / "images" / f"accuracy-{picture}").read_bytes(), (self.out / picture).read_bytes())
        subprocess.run(update, check=True, capture_output=True)
        self.assertEqual(page.read_text(), text)
        page.write_text("no place\n")
        third = subprocess.run(update, capture_output=True, text=True)
        self.assertEqual((third.returncode, len(third.stderr.splitlines())), (2, 1), third.stderr)
        self.assertEqual(page.read_text(), "no place\n")

    def test_corrected_frequencies_and_thin_walls_against_a_plate_that_is_known(self):
        result = call(self.folder, "--quick", "--on", "plate", "--only", "corrected", "walls", "-o", "walls")
        self.assertEqual(result.returncode, 0, result.stderr)
        read = lambda name: list(csv.DictReader((self.folder / "walls" / name).open()))
        for row in read("corrected-ratios.csv"):
            self.assertLess(float(row["ratio_of_medians"]), 0.75, row)
            self.assertLess(float(row["bars"]), 1, row)
            self.assertEqual(row["held"], row["modes"], row)
        rows = read("walls-plate.csv")
        self.assertEqual({row["way"] for row in rows}, {"thin wall", "volume", "regular mesh"})
        for row in rows:
            self.assertEqual(row["held"], row["modes"], row)
            self.assertLess(float(row["corrected_worst"]), float(row["worst"]), row)
        coarse, fine = [row for row in rows if row["way"] == "thin wall"]
        self.assertLess(float(fine["worst"]), float(coarse["worst"]))
        self.assertLess(float(fine["mesh_cpu_s"]), float(fine["cpu_s"]))
        text = (self.folder / "walls" / "report.md").read_text()
        self.assertIn("**Thin walls**", text)
        self.assertIn("`accuracy_cents`", text)

    def test_bad_input_is_one_clear_error_and_starts_nothing(self):
        (self.folder / "file").write_text("")
        empty = self.folder / "empty"
        empty.mkdir(exist_ok=True)
        cases = {
            ("--on", "cub"): "vibraphone",
            ("--only", "element"): "elements",
            ("--on", "bunny", "--surface", "none.obj"): "none.obj",
            ("--bin", empty): "--bin",
            ("-o", "file"): "cannot create folder",
            ("--repeats", "0"): "repeats",
            ("--fast",): "--fast",
            ("--timeout", "-1"): "above 0",
            ("--timeout", "nan"): "above 0",
            ("--write-advice", "empty"): "empty",
        }
        for words, expected in cases.items():
            result = call(self.folder, "--quick", *words)
            self.assertEqual((result.returncode, len(result.stderr.strip().splitlines())), (2, 1), f"{words}: {result.stderr}")
            self.assertIn(expected, result.stderr)
            self.assertFalse((self.folder / "accuracy").exists(), words)

    def test_the_air_is_nearer_the_truth_with_more_nodes_and_wave_numbers(self):
        result = call(self.folder, "--quick", "--only", "air", "-o", "air")
        self.assertEqual(result.returncode, 0, result.stderr)
        out = self.folder / "air"
        for table, costs in (("skins", "nodes of the skin"), ("errors", "wave numbers")):
            rows = read(out / f"air-{table}.csv")
            shown = [float(row["worst"]) for row in rows if row["worst"] != "-"]
            patterns = [float(row["pattern: median, dB"]) for row in rows[:-1]]
            self.assertEqual(patterns, sorted(patterns, reverse=True), table)
            self.assertLess(patterns[-1], -35)
            self.assertEqual(len(shown), len(rows) - 1)
            sizes = [int(row[costs].split()[0].replace(",", "")) for row in rows]
            self.assertEqual(sizes, sorted(set(sizes)), table)
        orders = [float(row["bytes a mode"]) for row in read(out / "air-orders.csv")]
        self.assertEqual(orders, sorted(orders))
        report = json.loads((out / "report.json").read_text())["sections"][0]
        self.assertEqual(len(report["findings"]), 3)
        xml.dom.minidom.parse(str(out / "air-price.svg"))

    def test_pitches_of_motion_are_nearer_the_truth_with_better_elements(self):
        result = call(self.folder, "--quick", "--only", "motion", "-o", "motion")
        self.assertEqual(result.returncode, 0, result.stderr)
        out = self.folder / "motion"
        cents = {row["element"]: abs(float(row["cents off"])) for row in read(out / "motion-elements.csv")}
        self.assertLess(cents["T10"], 40)
        self.assertGreater(cents["T4"], 200)
        sheets = [abs(float(row["cents off"])) for row in read(out / "motion-plates.csv") if row["as"] == "sheet"]
        self.assertEqual(sheets, sorted(sheets, reverse=True))
        self.assertLess(sheets[-1], 40)
        shares = [float(row["cents off"]) for row in read(out / "motion-steps.csv")]
        self.assertLess(max(shares) - min(shares), 0.2)
        (disc,) = read(out / "motion-coupling.csv")
        self.assertAlmostEqual(float(disc["gamma"]), 0.5008, delta=0.1)
        self.assertEqual(len(json.loads((out / "report.json").read_text())["sections"][0]["findings"]), 5)
        self.assertEqual([row["coupled modes"] for row in read(out / "motion-modes.csv")], ["1", "4", "12"])
        xml.dom.minidom.parse(str(out / "motion-price.svg"))

    def test_carillon_study_needs_only_the_standard_library(self):
        result = subprocess.run(
            ["/usr/bin/python3", "-S", str(BIN / "carillon-study"), "advise", "--help"], cwd=self.folder, capture_output=True, text=True
        )  # -S: only the standard library
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("--cents", result.stdout)

    def test_error_of_a_program_is_passed_on_with_its_code(self):
        fakes = self.folder / "fakes"
        fakes.mkdir(exist_ok=True)
        for name in ("carillon-mesh", "carillon-bank"):
            if not (fakes / name).exists():
                os.symlink(BIN / name, fakes / name)
        solver = fakes / "carillon-precompute"
        solver.write_text("#!/bin/sh\necho 'carillon-precompute: error: no luck today' >&2\nexit 3\n")
        solver.chmod(0o755)
        result = call(self.folder, "--quick", "--on", "cube", "--bin", fakes, "-o", "failed", "--only", "elements")
        self.assertEqual(result.returncode, 3)
        self.assertIn("no luck today", result.stderr.splitlines()[-1])
        self.assertFalse((self.folder / "failed/report.md").exists())


class Parts(unittest.TestCase):
    def test_front_is_what_nothing_cheaper_beats(self):
        self.assertEqual(plots.find_front([(3, 1), (1, 5), (2, 6), (4, 1), (2.5, 2)]), [(1, 5), (2.5, 2), (3, 1)])

    def test_extrapolation_finds_the_limit_of_a_power_law(self):
        edges = [0.4, 0.27, 0.2]
        truth, power = cents.extrapolate(edges, [[100 + 3 * h**3, 250 + 11 * h**3] for h in edges])
        self.assertAlmostEqual(power, 3, 4)
        self.assertAlmostEqual(truth.freq_hz[0], 100, 5)
        self.assertAlmostEqual(truth.freq_hz[1], 250, 5)
        self.assertTrue(all(doubt > 0 for doubt in truth.uncertainty))

    def test_uncertainty_of_a_limit_holds_where_meshes_scatter(self):
        edges = [0.4, 0.36, 0.33, 0.3, 0.27]
        scatter = [1.1, 0.85, 1.2, 0.9, 1.05]  # of the error; the two finest alone would put the limit elsewhere
        for order in (2.0, 3.0, 4.0):
            truth, _ = cents.extrapolate(
                edges, [[1000 + 400 * s * h**order, 2000 + 900 * s * h**order] for h, s in zip(edges, scatter)]
            )
            for found, exact, doubt in zip(truth.freq_hz, (1000, 2000), truth.uncertainty):
                self.assertLess(abs(found / exact - 1), doubt)

    def test_cost_of_a_cent_is_read_off_the_curve(self):
        points = [
            cents.Point("x", 1, 1, elements, seconds, 0, [-error])
            for elements, seconds, error in ((10, 1.0, 100.0), (20, 4.0, 25.0), (40, 16.0, 6.25))
        ]
        for level, seconds, how in ((50, 2.0, "measured"), (100, 1.0, "at most"), (200, 1.0, "at most"), (3.125, 32.0, "extrapolated")):
            cost = cents.find_cost(points, level)
            self.assertAlmostEqual(cost.cpu_s, seconds, 9)
            self.assertEqual(cost.how, how)
        self.assertIsNone(cents.find_cost(points, 0.1))
        self.assertEqual(
            [cents.is_known(cents.Truth((100.0, 200.0), (0.001, 0.01), ""), level) for level in (1, 10, 17.2, 17.3)],
            [False, False, False, True],
        )
        slow_start = [cents.Point("x", 1, 1, elements, 1.0 + elements * 1e-6, 0, [1000.0 / elements]) for elements in (10, 100, 1000)]
        self.assertGreater(cents.find_cost(slow_start, 0.1).cpu_s, 15)  # ten times the elements: more than ten times the seconds

    def test_dense_and_sparse_cross_where_their_times_are_equal(self):
        sizes = [100, 200, 400, 800]
        self.assertAlmostEqual(papers.find_crossing(sizes, [1e-9 * n**3 for n in sizes], [9e-5 * n for n in sizes]), 300, 6)
        self.assertIsNone(papers.find_crossing(sizes, [2, 3, 4, 5], [1, 1, 1, 1]))
        self.assertAlmostEqual(papers.find_nodes_below([(100, 80.0), (200, 20.0), (400, 5.0)], 40), 140, delta=5)
        self.assertIsNone(papers.find_nodes_below([(100, 80.0), (200, 20.0)], 10))

    def test_density_shifts_all_modes_alike(self):
        """Mode 1 becomes right, and differences between modes stay."""

        class Collect:
            def __init__(self):
                self.tables, self.words = {}, []

            def add_table(self, name, rows, caption, data=None, command=None):
                self.tables[name] = data

            def add_chart(self, *_):
                pass

            def conclude(self, text):
                self.words.append(text)

        section = Collect()
        cube = bodies.make_bodies()["cube"]
        papers.study_density(
            section,
            None,
            [(cube, None, {"T4 consistent": [cents.Point("T4 consistent", 500, 1500, 2000, 1.0, None, [120.0, 150.0, 90.0])]})],
        )
        rows = section.tables["density"][1:]
        self.assertEqual([round(row[5], 9) for row in rows], [0.0, 30.0, -30.0])
        self.assertAlmostEqual(
            rows[0][2], 2**0.2, 12
        )  # the frequency is 2^(120/1200) too high, and goes with the root of one over the density
        self.assertIn("25 to 25 %", section.words[0])

    def test_mapped_bodies_have_the_volume_of_the_true_ones(self):
        """Bowl: 2 pi/3 (R^3 - r^3) (cos 5 - cos 90); bar: width times the integral of its thickness, by the trapezoidal rule."""
        bowl = 2 * math.pi / 3 * (0.062**3 - 0.058**3) * math.cos(math.radians(5))
        count = 4000
        steps = [-0.18 + 0.36 * i / count for i in range(count + 1)]
        thickness = [0.0131825 - 0.0082301 * math.exp(-((x / 0.0875879) ** 4)) for x in steps]
        bar = 0.05 * 0.36 / count * (sum(thickness) - (thickness[0] + thickness[-1]) / 2)
        for name, volume in (("bowl", bowl), ("vibraphone", bar)):
            body = bodies.make_bodies()[name]
            with tempfile.TemporaryDirectory() as folder:
                path = pathlib.Path(folder) / "mesh.msh"
                subprocess.run(
                    [BIN / "carillon-mesh", *map(str, body.words), "--nodes", "9000", "-o", path], check=True, capture_output=True
                )
                mesh = mesh_file.MeshFile(path)
                body.change[1](mesh)
                found = 0.0
                for tet in mesh.tets:
                    a, b, c = ([mesh.nodes[tet[k]][i] - mesh.nodes[tet[0]][i] for i in range(3)] for k in (1, 2, 3))
                    found += (
                        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
                    ) / 6
                self.assertAlmostEqual(abs(found) / volume, 1, delta=0.01)


if __name__ == "__main__":
    unittest.main()
