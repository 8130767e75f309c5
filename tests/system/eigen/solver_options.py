#!/usr/bin/python3
"""Methods and options of the solver from outside: both methods, and MUMPS, give the same proven bank; options of the eigensolver and
unused options are one error with exit code 2. Runs on a bar with 21 modes."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import h5py
import numpy

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
JOB = {
    "body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.01, "nodes": 700},
    "bank": "bar.hdf",
    "material": {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7800, "damping": {"rayleigh": {"alpha1_s": 1e-8}}},
}
TIMEOUT_S = 100


class Folder:
    def __init__(self, **more):
        self.path = tempfile.TemporaryDirectory()
        self.file = pathlib.Path(self.path.name)
        (self.file / "job.json").write_text(json.dumps(JOB | more))

    def __del__(self):
        self.path.cleanup()

    def run(self, options="", ranks=1):
        launcher = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none"] if ranks > 1 else []
        return subprocess.run(
            [*launcher, BIN / "carillon-precompute", "job.json", "-q", *(["--", *options.split()] if options else [])],
            cwd=self.file,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )

    def frequencies(self):
        with h5py.File(self.file / "bar.hdf") as bank:
            return bank["modes/frequency_hz"][:]

    def solver(self):
        return json.loads((self.file / "bar.hdf.resolved.json").read_text())["run"]["solver"]


class SolverOptions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.plain = Folder()
        done = cls.plain.run()
        assert done.returncode == 0, done.stderr
        cls.wanted = cls.plain.frequencies()

    def expect_error(self, folder, options, words, ranks=1):
        done = folder.run(options, ranks)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(done.stderr.count("carillon-precompute: error:"), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)
        self.assertEqual([file.name for file in folder.file.iterdir()], ["job.json"])

    def test_methods_and_factorisations_give_the_same_proven_bank(self):
        self.assertEqual(len(self.wanted), 21)
        for solver in ({"method": "block-lanczos"}, {"method": "krylov-schur"}, {"factorisation": "mumps"}):
            for ranks in (1, 2):
                with self.subTest(solver=solver, ranks=ranks):
                    folder = Folder(solver=solver)
                    done = folder.run(ranks=ranks)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    numpy.testing.assert_allclose(folder.frequencies(), self.wanted, rtol=1e-8)
                    check = subprocess.run(
                        [BIN / "carillon-bank", "check", folder.file / "bar.hdf"], capture_output=True, text=True, timeout=TIMEOUT_S
                    )
                    self.assertEqual(check.returncode, 0, check.stdout + check.stderr)

    def test_options_of_the_eigensolver_name_both_methods(self):
        for options in ("-eps_type arnoldi", "-eps_type", "-eps_ncv 5", "-st_type shift"):
            for ranks in (1, 2):
                with self.subTest(options=options, ranks=ranks):
                    self.expect_error(Folder(), options, [options.split()[0], "block-lanczos", "krylov-schur"], ranks)

    def test_an_unknown_method_names_those_there_are(self):
        for word in ("arnoldi", "subspace", "jd"):
            self.expect_error(Folder(solver={"method": word}), "", [word, "block-lanczos", "krylov-schur"])
        self.expect_error(Folder(solver={"factorisation": "cholmod"}), "", ["cholmod", "ldlt", "mumps"])

    def test_an_unused_option_is_an_error(self):
        self.expect_error(Folder(), "-log_veiw", ["-log_veiw", "not used"])
        self.expect_error(Folder(), "-mumps_ordering amd", ["-mumps_ordering", "not used"])

    def test_orderings_of_mumps_give_the_same_bank(self):
        entries = {}
        for name in ("amd", "amf", "pord", "qamd"):
            folder = Folder(solver={"factorisation": "mumps"})
            done = folder.run(f"-mumps_ordering {name}")
            self.assertEqual(done.returncode, 0, done.stderr)
            numpy.testing.assert_allclose(folder.frequencies(), self.wanted, rtol=1e-8)
            self.assertEqual(folder.solver()["ordering"], name.upper())
            entries[name] = folder.solver()["factor_entries"]
        self.assertNotEqual(entries["amd"], entries["pord"])
        for ranks in (1, 2):
            done = Folder(solver={"factorisation": "mumps"}).run("-mumps_ordering metis", ranks)
            self.assertEqual((done.returncode, done.stderr.count("carillon-precompute: error:")), (2, 1), done.stderr)
            self.assertIn("take one of amd, amf, pord, qamd", done.stderr)

    def test_petsc_prints_its_log(self):
        self.assertIn("PETSc Performance Summary", Folder().run("-log_view").stdout)


if __name__ == "__main__":
    unittest.main()
