#!/usr/bin/python3
"""Functions of the bench: medians, tables, phases, pictures, against manual records."""
import pathlib
import subprocess
import sys
import unittest
import xml.dom.minidom


sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent), str(pathlib.Path(__file__).resolve().parents[3] / "jobs/study")]
import charts
import comparing
import measuring
import numpy
import scipy.sparse
import system
from errors import RunError


class Measuring(unittest.TestCase):
    def test_a_busy_child_is_charged_its_cpu_time_and_a_sleeping_one_is_not(self):
        busy = measuring.run_measured([sys.executable, "-c", "import time\nwhile time.process_time() < 0.4: pass"], ".")
        asleep = measuring.run_measured([sys.executable, "-c", "import time; time.sleep(0.5)"], ".")
        self.assertGreaterEqual(busy.cpu_s, 0.39)
        self.assertGreater(asleep.wall_s, 0.49)
        self.assertLess(asleep.cpu_s, asleep.wall_s - 0.49)  # on any machine: one thread cannot compute while it sleeps

    def test_the_children_of_a_child_count_too(self):
        cost = measuring.run_measured(["sh", "-c", f"{sys.executable} -c 'import time\nwhile time.process_time() < 0.4: pass'; true"], ".")
        self.assertGreaterEqual(cost.cpu_s, 0.39)

    def test_kernels_fit_the_processor(self):
        """Shortened flags of real processors: Sapphire Rapids, Zen 3, Zen 4, Haswell, Nehalem, and a non-x86 processor."""
        wide = "flags\t\t: fpu sse2 fma avx avx2 avx512f avx512dq avx512cd avx512bw avx512vl\n"
        for vendor, flags, kernels in (
            ("GenuineIntel", wide, "SkylakeX"),
            ("AuthenticAMD", "flags : sse2 fma avx avx2\n", "Zen"),
            ("AuthenticAMD", wide, "SkylakeX"),
            ("GenuineIntel", "flags : sse2 fma avx avx2\n", "Haswell"),
            ("GenuineIntel", "flags : sse2 ssse3\n", ""),
            ("ARM", "Features : fp asimd\n", ""),
        ):
            self.assertEqual(measuring.find_fitting_kernels(f"vendor_id\t: {vendor}\n{flags}")[0], kernels)

    def test_every_program_gets_the_kernels_that_the_bench_names(self):
        kernels, why = measuring.find_kernels()
        environment = measuring.make_environment()
        self.assertEqual(environment.get("OPENBLAS_CORETYPE", ""), kernels, why)
        if kernels:
            taken = subprocess.run(
                [sys.executable, "-c", measuring.ASK_KERNELS], env=environment, capture_output=True, text=True, check=True
            )
            self.assertEqual(taken.stdout.strip().lower(), kernels.lower())

    def test_the_last_output_of_a_failing_program_is_shown(self):
        with self.assertRaisesRegex(RuntimeError, "exit code 3\nno such mesh"):
            measuring.run_measured(["sh", "-c", "echo no such mesh >&2; exit 3"], ".")
        for command, code, text in (
            ("echo error: no such key; exit 2", 2, "^bar: error: no such key$"),
            ("echo error: no such key; exit 7", 4, "^bar: sh ended with exit code 7: error: no such key$"),
            ("kill -9 $$", 4, "^bar: sh ended with exit code -9$"),
        ):
            with self.assertRaisesRegex(RunError, text) as caught:
                measuring.run_part(["sh", "-c", command], ".", "bar")
            self.assertEqual(caught.exception.code, code)

    def test_median_and_spread(self):
        self.assertEqual(measuring.find_median([5.0, 1.0, 2.0]), 2.0)
        self.assertAlmostEqual(measuring.find_spread([9.0, 10.0, 12.0]), 0.15)
        self.assertEqual(measuring.find_spread([3.0]), 0.0)

    def test_phases_of_a_record_add_up_to_the_total(self):
        solver = {"seconds": {"analyse": 0.5, "factor": 1.5, "solve": 4.0, "iterate": 7.0, "check": 1.0}, "factorisations": 3}
        recorded = [
            {"name": "read", "seconds": 1.0, "cpu_seconds": 0.5},
            {"name": "modes", "seconds": 10.0, "cpu_seconds": 5.0},
            {"name": "prayer", "seconds": 9.0, "cpu_seconds": 0.25},
        ]
        phases = comparing.to_phases({"stations": recorded, "solver": solver}, 8.0)
        self.assertEqual(
            {name: value for name, value in phases.items() if value},
            {"read": 0.5, "factor": 1.0, "solve": 2.0, "orthogonalise": 2.0, "other": 2.5},
        )
        extras = comparing.find_extras({"stations": recorded, "solver": solver}, 8.0)
        self.assertEqual([row[1] for row in extras[1:]], ["0.50", "0.50", "0.00"])

    def test_different_numbers_of_frequencies_never_agree(self):
        self.assertEqual(comparing.compare_frequencies([100.0], [100.0, 200.0]), float("inf"))
        self.assertAlmostEqual(comparing.compare_frequencies([100.0, 200.2], [100.0, 200.0]), 0.001, 6)

    def test_modes_at_a_cut_of_corrected_frequencies_are_not_compared(self):
        bank = {"modes/frequency_hz": numpy.array([100.0, 200.0, 400.0])}
        self.assertEqual(comparing.find_complete_modes(bank), [100.0, 200.0, 400.0])
        bank |= {"proof/below_band_hz": numpy.array([90.0]), "proof/complete_below_hz": numpy.float64(200.0)}
        self.assertEqual(comparing.find_complete_modes(bank), [90.0, 100.0, 200.0])

    def test_a_wrong_answer_is_found(self):
        stiffness, mass = scipy.sparse.diags(numpy.arange(1.0, 9.0)), scipy.sparse.identity(8)
        values, vectors = numpy.arange(1.0, 9.0), numpy.eye(8)
        self.assertLess(max(map(numpy.max, system.measure_answer(stiffness, mass, values, vectors))), 1e-12)
        self.assertAlmostEqual(system.measure_answer(stiffness, mass, values * 1.001, vectors)[0].max(), 1e-3 / 1.001, 9)

    def test_the_table_gives_ratios_to_ours(self):
        entry = {"wall_s": [1.0], "peak_bytes": 10**9, "modes": 7, "residual": 1e-9, "frequency_error": 0.0}
        results = {"carillon1": entry | {"label": "ours", "cpu_s": [2.0, 2.0, 3.0]}, "slow": entry | {"label": "theirs", "cpu_s": [13.0]}}
        rows = comparing.make_rows(results, "carillon1")
        self.assertEqual([row[0] for row in rows[1:]], ["ours", "theirs"])
        self.assertEqual(rows[2][3], "6.50")
        self.assertEqual([row[2] for row in rows[1:]], ["25 %", "-"])  # one run has no spread
        self.assertIn("| theirs | 13.0 |", measuring.format_table(rows, True))

    def test_the_picture_is_well_formed_and_to_scale(self):
        picture = charts.draw_bars([("a & b", [("read", 1.0, 0.0), ("solve", 2.0, 1.0)]), ("half", [("solve", 2.0, 0.0)])], "t", "n")
        bars = [r for r in xml.dom.minidom.parseString(picture).getElementsByTagName("rect") if r.getElementsByTagName("title")]
        lengths = [float(bar.getAttribute("width")) for bar in bars]
        self.assertEqual([round(length / lengths[0], 3) for length in lengths], [1.0, 2.0, 1.0, 2.0])

    def test_a_page_without_markers_is_rejected(self):
        self.assertEqual(comparing.replace_between("x\n<!-- t -->\nold\n<!-- /t -->\n", "t", "new"), "x\n<!-- t -->\nnew\n<!-- /t -->\n")
        with self.assertRaises(ValueError):
            comparing.replace_between("x", "t", "new")

    def test_the_page_has_markers_for_all_generated_parts(self):
        page = (pathlib.Path(__file__).resolve().parents[3] / "docs/reports/performance.md").read_text()
        for name in ("table", "goals", "phases", "proof", "table-800", "goals-800"):
            self.assertIn("x", comparing.replace_between(page, name, "x"))


if __name__ == "__main__":
    unittest.main()
