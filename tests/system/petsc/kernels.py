#!/usr/bin/python3
"""OpenBLAS kernels used by carillon-precompute, from the record of a run, against the configuration reported by OpenBLAS. The fitting
kernels are found from /proc/cpuinfo by functions of the bench, independent of the program."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"])
PROGRAM = pathlib.Path(os.environ["CARILLON_BIN_DIR"]) / "carillon-precompute"
sys.path.insert(0, str(ROOT / "jobs/study"))
import measuring

RULES = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS_CORETYPE", "CARILLON_DEFAULT_KERNELS"))}
KERNELS, WHY = measuring.find_kernels()


JOB = {
    "body": {"shape": "box", "nodes": 60},
    "element": "T4",
    "max_modes": 1,
    "bank": "box.hdf",
    "material": {
        "young_modulus_pa": 200e9,
        "poisson_ratio": 0.3,
        "density_kg_m3": 7850,
        "damping": {"internal_friction": {"tan_phi": 0.001}},
    },
}


def read_blas_line(environment, launcher=()):
    """(BLAS line of the record, kernels by OpenBLAS's configuration, standard output, standard error) of a small run."""
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "job.json").write_text(json.dumps(JOB))
        child = subprocess.run(
            [*launcher, PROGRAM, "job.json"], env=RULES | environment, capture_output=True, text=True, timeout=300, cwd=folder
        )
        if child.returncode != 0:
            raise RuntimeError(f"exit code {child.returncode}\n{child.stdout}{child.stderr}")
        record = json.loads(next(pathlib.Path(folder).glob("*.resolved.json")).read_text())
    line = record["run"]["versions"]["blas"]
    return line, re.search(r"NO_AFFINITY (\S+)", line).group(1), child.stdout, child.stderr


@unittest.skipUnless(KERNELS, WHY)
class Kernels(unittest.TestCase):
    def test_they_fit_the_processor(self):
        line, kernels, printed, warned = read_blas_line({})
        self.assertNotIn("BLAS", printed + warned)  # no warning
        self.assertEqual(kernels.lower(), KERNELS.lower())
        self.assertIn(f"kernels {kernels}, " + ("OpenBLAS's own choice" if "own choice" in WHY else "which fit this processor"), line)

    def test_they_fit_on_every_rank(self):
        line, kernels, printed, _ = read_blas_line({}, ("mpirun", "-np", "2"))
        self.assertIn("on 2 ranks", printed)
        self.assertEqual(kernels.lower(), KERNELS.lower())

    def test_the_users_choice_is_kept(self):
        for chosen in ("Nehalem", "Haswell"):
            line, kernels, printed, warned = read_blas_line({"OPENBLAS_CORETYPE": chosen})
            self.assertEqual("warning: OpenBLAS runs its kernels Nehalem" in warned, chosen == "Nehalem", warned)
            self.assertNotIn("kernels", printed)
            self.assertEqual(kernels, chosen)
            self.assertIn(f"kernels {chosen}, named by OPENBLAS_CORETYPE", line)
        self.assertEqual("would fit this processor" in line, KERNELS not in ("Haswell", "Zen"), line)

    def test_the_choice_of_an_outer_run_is_not_the_users(self):
        line, kernels, _, _ = read_blas_line({"CARILLON_DEFAULT_KERNELS": "Prescott"})
        self.assertEqual(kernels.lower(), KERNELS.lower())
        self.assertIn(f"kernels {kernels}, " + ("OpenBLAS's own choice" if "own choice" in WHY else "which fit this processor"), line)


if __name__ == "__main__":
    unittest.main()
