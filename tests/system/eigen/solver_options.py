#!/usr/bin/python3
"""What follows "--": every type of SLEPc's eigensolver and every option ends in the same proven bank, or in one error with exit code 2 that
names the option and the remedy; nothing hangs. Real runs on a bar with 21 modes."""
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

# Types and options that leave the answer what it is: (options, ranks).
WORK = [
    ("-eps_type blocklanczos", 1),
    ("-eps_type krylovschur", 1),
    ("-eps_type arnoldi", 1),
    ("-eps_type lanczos", 1),
    ("-eps_type subspace", 1),
    ("-eps_type gd", 1),
    ("-eps_type jd", 1),
    ("-eps_type lapack", 1),
    ("-eps_type arnoldi", 2),
    ("-eps_type subspace", 2),
    ("-eps_type gd", 2),
    ("-eps_type jd", 2),
    ("-eps_type lapack", 2),
    ("-eps_type lanczos -eps_lanczos_reorthog selective", 1),
    ("-eps_ncv 5", 1),
    ("-eps_mpd 10", 1),
    ("-eps_type krylovschur -eps_ncv 45", 1),
    ("-eps_type krylovschur -eps_mpd 12", 1),
    ("-eps_type arnoldi -eps_ncv 40", 1),
    ("-eps_tol 1e-4", 1),
    ("-eps_tol 1e-14", 1),
    ("-eps_conv_abs", 1),
    ("-eps_purify 1", 1),
    ("-eps_blocklanczos_block_size 5", 1),
    ("-bv_type vecs", 1),
    ("-st_ksp_type gmres -st_ksp_rtol 1e-12", 1),
    ("-st_ksp_converged_reason", 1),
    ("-eps_type gd -eps_gd_blocksize 4", 1),
]
# Those that cannot: (options, words of the message).
REFUSED = [
    ("-eps_type nonsense", ["-eps_type nonsense", "no such type", "blocklanczos", "krylovschur"]),
    ("-eps_type", ["names no type", "krylovschur"]),
    ("-eps_type lobpcg", ["-eps_type lobpcg", "lowest", "krylovschur"]),
    ("-eps_type rqcg", ["-eps_type rqcg", "lowest"]),
    ("-eps_type power", ["-eps_type power", "one mode at a time", "krylovschur"]),
    ("-eps_type ciss", ["-eps_type ciss", "contour"]),
    ("-eps_nev 3", ["-eps_nev", "max_modes"]),
    ("-eps_interval 0,1", ["-eps_interval", "band_hz"]),
    ("-eps_smallest_real", ["-eps_smallest_real", "band_hz"]),
    ("-eps_target 0", ["-eps_target", "solver.factorisation"]),
    ("-st_shift 0", ["-st_shift", "solver.factorisation"]),
    ("-st_type shift", ["-st_type", "solver.factorisation"]),
    ("-st_pc_type lu", ["-st_pc_type", "solver.factorisation"]),
    ("-eps_non_hermitian", ["-eps_non_hermitian", "symmetric"]),
    ("-eps_max_it 1", ["-eps_max_it 1", "Without the options"]),
    ("-eps_ncv abc", ["-eps_ncv abc", "abc has no integer value"]),
    ("-eps_type krylovschur -eps_ncv 5", ["-eps_ncv 5", "ncv must be at least nev"]),
    ("-st_ksp_type nonsense", ["-st_ksp_type nonsense"]),
    ("-eps_blocklanczos_block_size 0", ["block_size 0", "blocks of 0 columns"]),
    ("-eps_typ krylovschur", ["-eps_typ", "not used"]),
    ("-eps_krylovschur_restart 0.3", ["-eps_krylovschur_restart", "not used"]),
]


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

    def test_what_works_gives_the_same_proven_bank(self):
        self.assertEqual(len(self.wanted), 21)
        for options, ranks in WORK:
            with self.subTest(options=options, ranks=ranks):
                folder = Folder()
                done = folder.run(options, ranks)
                self.assertEqual(done.returncode, 0, done.stderr)
                numpy.testing.assert_allclose(folder.frequencies(), self.wanted, rtol=1e-8)
                check = subprocess.run(
                    [BIN / "carillon-bank", "check", folder.file / "bar.hdf"], capture_output=True, text=True, timeout=TIMEOUT_S
                )
                self.assertEqual(check.returncode, 0, check.stdout + check.stderr)

    def test_what_does_not_is_one_error_with_code_2(self):
        for options, words in REFUSED:
            with self.subTest(options=options):
                folder = Folder()
                done = folder.run(options)
                self.assertEqual(done.returncode, 2, done.stderr)
                self.assertEqual(done.stderr.count("error:"), 1, done.stderr)
                for word in words:
                    self.assertIn(word, done.stderr)
                self.assertNotIn("nodes wanted", done.stderr)  # it is not the body's fault
                self.assertEqual([file.name for file in folder.file.iterdir()], ["job.json"])

    def test_on_two_ranks_it_is_one_error_as_well(self):
        for options in ("-eps_type nonsense", "-eps_max_it 1", "-eps_type krylovschur -eps_ncv 5"):
            done = Folder().run(options, 2)
            self.assertEqual(done.stderr.count("carillon-precompute: error:"), 1, done.stderr)
            self.assertEqual(done.returncode, 2, done.stderr)

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
        self.assertIn("not used", Folder().run("-mumps_ordering amd").stderr)

    def test_what_shows_shows(self):
        view = Folder().run("-eps_type krylovschur -eps_view -eps_ncv 44").stdout
        self.assertIn("type: krylovschur", view)
        self.assertRegex(view, r"number of column vectors \(ncv\): 44")
        self.assertRegex(view, r"maximum dimension of projected problem \(mpd\): 44")
        self.assertIn("type: sinvert", view)
        self.assertRegex(Folder().run("-eps_monitor").stdout, r"\d+ EPS nconv=21")
        self.assertRegex(Folder().run("-eps_type gd -eps_monitor").stdout, r"\d+ EPS nconv=\d+ first unconverged value")
        self.assertIn("-eps_krylovschur_restart", Folder().run("-eps_type krylovschur -help").stdout)

    def test_a_looser_tolerance_takes_fewer_solves(self):
        """By the record in the bank; the residuals are still held to the job's tolerance."""
        folder = Folder()
        self.assertEqual(folder.run("-eps_type krylovschur -eps_tol 1e-1 -eps_ncv 24").returncode, 0)
        loose = folder.solver()["solves"]
        self.assertEqual(folder.run("-eps_type krylovschur -eps_tol 1e-13 -eps_ncv 24").returncode, 0)
        self.assertLess(loose, folder.solver()["solves"])


if __name__ == "__main__":
    unittest.main()
