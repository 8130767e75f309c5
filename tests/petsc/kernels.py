#!/usr/bin/python3
"""Which kernels of OpenBLAS carillon-precompute runs on, by what it says itself; OpenBLAS's own word (its configuration, in the same line) is the
witness. What fits the processor comes from /proc/cpuinfo, by the bench's functions, which share nothing with the program."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

ROOT = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"])
PROGRAM = pathlib.Path(os.environ["CARILLON_BIN_DIR"]) / "carillon-precompute"
sys.path.insert(0, str(ROOT / "jobs/study"))
import measuring

RULES = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS_CORETYPE", "CARILLON_KERNELS"))}
KERNELS, WHY = measuring.find_kernels()


def read_blas_line(environment, launcher=()):
    """(line, kernels by OpenBLAS's configuration) of a run that ends at once, for its job is not there."""
    child = subprocess.run([*launcher, PROGRAM, "/no/such/job.json"], env=RULES | environment, capture_output=True, text=True, timeout=60)
    if child.returncode != 2 or child.stderr.count("error:") != 1:
        raise RuntimeError(f"exit code {child.returncode}\n{child.stdout}{child.stderr}")
    line = next(line for line in child.stdout.splitlines() if "BLAS:" in line)
    return line, re.search(r"NO_AFFINITY (\S+)", line).group(1)


@unittest.skipUnless(KERNELS, WHY)
class Kernels(unittest.TestCase):
    def test_they_fit_the_processor(self):
        line, kernels = read_blas_line({})
        self.assertEqual(kernels.lower(), KERNELS.lower())
        self.assertIn(f"kernels {kernels}, " + ("OpenBLAS's own choice" if "own choice" in WHY else "which fit this processor"), line)

    def test_every_rank_starts_again(self):
        line, kernels = read_blas_line({}, ("mpirun", "-np", "2"))
        self.assertIn("on 2 ranks", line)
        self.assertEqual(kernels.lower(), KERNELS.lower())

    def test_the_users_choice_is_kept(self):
        for chosen in ("Nehalem", "Haswell"):
            line, kernels = read_blas_line({"OPENBLAS_CORETYPE": chosen})
            self.assertEqual(kernels, chosen)
            self.assertIn(f"kernels {chosen}, named by OPENBLAS_CORETYPE", line)
        self.assertEqual("would fit this processor" in line, KERNELS not in ("Haswell", "Zen"), line)

    def test_it_starts_again_once(self):
        """A second start that finds the kernels as old as before goes on with them."""
        line, kernels = read_blas_line({"CARILLON_KERNELS_BEFORE": "Prescott"})
        self.assertIn(f"kernels {kernels}, " + ("which fit" if "own choice" in WHY else "older than this processor"), line)


if __name__ == "__main__":
    unittest.main()
