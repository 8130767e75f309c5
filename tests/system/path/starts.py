#!/usr/bin/python3
"""Starts of solvers: individually by ranks of an MPI run, together with different jobs, and without a network.

A program of one rank started by a rank (hear, submit, bank-for, validate, the Python module) is not a rank of that run. Solvers started in
it by the user form one run and must have the same job. Reference: a free bar's is proportional to 1 / length^2.

usage: starts.py BIN_DIR
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
PYTHON = BIN.parent / "python"  # the module, if built
LENGTHS_M = (0.2, 0.3)


def make_job(length_m, **changes):
    body = {"shape": "bar", "length_m": length_m, "width_m": 0.03, "thickness_m": 0.012, "nodes": 600}
    return {"body": body, "material": "steel", "max_modes": 1, **changes}


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="carillon-starts-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.temporary = self.folder / "tmp"
        self.temporary.mkdir()
        self.environment = os.environ | {
            "PATH": f"{BIN}:/usr/bin:/bin",
            "HOME": str(self.folder),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "TMPDIR": str(self.temporary),
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
        }
        for rank, length_m in enumerate(LENGTHS_M):
            self.write(f"{rank}/job.json", make_job(length_m, bank="bank.hdf"))

    def write(self, name, content):
        file = self.folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(content if isinstance(content, str) else json.dumps(content))

    def run_it(self, *words, code=0):
        done = subprocess.run(
            [str(word) for word in words], cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=120
        )
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def run_ranks(self, script, code=0):
        """Output of two ranks, each a shell with its own folder RANK."""
        script = f"rank=$OMPI_COMM_WORLD_RANK; {script}"
        done = self.run_it("mpirun", "-np", 2, "--bind-to", "none", "/bin/sh", "-c", script, code=code)
        return done.stdout + done.stderr

    def read_hz(self, bank):
        said = self.run_it("carillon-bank", "info", "--json", bank).stdout
        return json.loads(said)["corrected_frequencies_hz"][0]

    def check_ratio(self, banks):
        first, second = (self.read_hz(bank) for bank in banks)
        self.assertAlmostEqual(first / second, (LENGTHS_M[1] / LENGTHS_M[0]) ** 2, delta=0.08)


class InAnMpiRun(Case):
    def test_ranks_with_jobs_of_their_own_are_refused(self):
        self.write("short.json", make_job(0.2, bank="short.hdf"))
        self.write("long.json", make_job(0.3, bank="long.hdf"))
        script = '[ $rank = 0 ] && job=short || job=long; carillon-precompute -q $job.json; echo "code $?"'
        said = self.run_ranks(script)
        self.assertEqual(said.count("code 2"), 2, said)
        self.assertEqual(said.count("different jobs"), 1, said)
        self.assertIn("short.json", said)
        self.assertIn("long.json", said)
        self.assertEqual(list(self.folder.glob("*.hdf*")), [])

    def test_one_job_with_two_banks_is_refused(self):
        self.write("1/job.json", make_job(LENGTHS_M[0], bank="bank.hdf"))
        said = self.run_ranks("cd $rank; carillon-precompute -q job.json", code=2)
        self.assertIn("different banks to write", said)
        said = self.run_ranks("carillon-precompute -q 0/job.json --bank $rank.hdf", code=2)
        self.assertIn("different banks to write", said)
        self.assertEqual(list(self.folder.rglob("*.hdf*")), [])

    def test_one_bank_by_two_names_is_one(self):
        (self.folder / "link").symlink_to(self.folder / "0")
        self.run_ranks("[ $rank = 0 ] && cd 0 || cd link; carillon-precompute -q job.json")
        self.assertTrue((self.folder / "0/bank.hdf").is_file())

    def test_other_work_is_refused(self):
        for word in ("--validate", "--at 0,0,0", "--matrices here", "--no-such-option"):
            said = self.run_ranks(f'[ $rank = 0 ] && word="" || word="{word}"; carillon-precompute -q 0/job.json $word', code=2)
            self.assertIn("different work", said)
        self.assertFalse((self.folder / "0/bank.hdf").exists())

    def test_what_rank_0_alone_writes_may_differ(self):
        self.run_ranks("carillon-precompute -q 0/job.json --progress $rank.jsonl --result $rank.result")
        self.assertTrue((self.folder / "0/bank.hdf").is_file())

    def test_simulations_of_their_own_are_refused(self):
        for rank in (0, 1):
            bar = {"name": "bar", "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}}}
            job = {"simulate": {"duration_s": 0.001 * (rank + 1), "bodies": [bar | {"material": "steel"}]}, "record": "record.json"}
            self.write(f"{rank}/simulation.json", job)
        said = self.run_ranks("carillon-simulate -q $rank/simulation.json", code=2)
        self.assertIn("different jobs", said)
        said = self.run_ranks("carillon-simulate -q 0/simulation.json --record $rank.json", code=2)
        self.assertIn("different record to write", said)
        self.assertEqual(list(self.folder.glob("*.json")), [])

    def test_a_rank_validates_and_submits_by_itself(self):
        said = self.run_ranks("cd $rank; carillon validate job.json >said 2>/dev/null && grep -c ': ok' said")
        self.assertEqual(said.split(), ["1", "1"])
        self.run_ranks(
            "cd $rank; carillon --store store submit job.json --run >/dev/null && carillon --store store get job.json --to own.hdf"
        )
        self.check_ratio([self.folder / "0/own.hdf", self.folder / "1/own.hdf"])

    def test_a_rank_has_banks_of_its_own(self):
        for rank, length_m in enumerate(LENGTHS_M):
            self.write(f"{rank}/body.json", make_job(length_m))
        self.run_ranks("cd $rank; carillon bank-for -q body.json >bank")
        self.check_ratio((self.folder / f"{rank}/bank").read_text().strip() for rank in (0, 1))

    def test_a_rank_hears(self):
        self.run_ranks(
            f"[ $rank = 0 ] && l={LENGTHS_M[0]} || l={LENGTHS_M[1]}\n"
            "carillon hear --shape bar --length $l --width 0.03 --thickness 0.012 -q -o heard-$rank >said-$rank 2>&1"
        )
        self.check_ratio(self.folder / f"heard-{rank}/bar-steel.hdf" for rank in (0, 1))

    @unittest.skipUnless(list(PYTHON.glob("carillon/_carillon*.so")), "a build without the Python module")
    def test_a_rank_solves_in_python(self):
        self.write(
            "own.py",
            "import json, os, sys, carillon\n"
            "rank = os.environ['OMPI_COMM_WORLD_RANK']\n"
            "bank = carillon.solve(f'{rank}/job.json', ranks=int(sys.argv[1]), bank=f'{sys.argv[1]}-{rank}.hdf')\n",
        )
        self.environment["PYTHONPATH"] = str(PYTHON)
        for ranks in (1, 2):
            self.run_ranks(f"/usr/bin/python3 own.py {ranks}")
            self.check_ratio(self.folder / f"{ranks}-{rank}.hdf" for rank in (0, 1))


def may_unshare():
    return subprocess.run(["unshare", "-rn", "true"], stderr=subprocess.DEVNULL).returncode == 0


@unittest.skipUnless(may_unshare(), "user namespaces are forbidden here")
class WithoutANetwork(Case):
    def check(self, *words):
        self.run_it("unshare", "-rn", *words)
        self.assertEqual(list(self.temporary.iterdir()), [])

    def test_one_rank_needs_none(self):
        self.check("carillon-precompute", "-q", "0/job.json")
        self.assertGreater(self.read_hz(self.folder / "0/bank.hdf"), 0)
        self.check("carillon-precompute", "--validate", "0/job.json")
        self.check("carillon", "validate", "0/job.json")
        self.check("carillon", "hear", "--shape", "bar", "-q", "-o", "heard")
        self.check("carillon", "--store", "store", "submit", "0/job.json", "--run")

    def test_a_scene_without_banks_needs_none(self):
        body = {
            "name": "bar",
            "material": "steel",
            "shape": {"bar": {"length_m": 0.2, "width_m": 0.03, "thickness_m": 0.012, "nodes": 600}},
        }
        scene = {"duration_s": 0.1, "bodies": [body | {"fixed": True}], "listener": {"position_m": [0, -1, 0]}}
        scene["strikes"] = [{"time_s": 0.01, "body": "bar", "point_m": [0, 0, 0.006], "mallet": "hard-wood"}]
        self.write("scene.json", scene)
        self.check("carillon-render", "scene.json", "-q", "-o", "sound.wav")

    def test_a_simulation_needs_none(self):
        bar = {"name": "bar", "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}}, "material": "steel"}
        self.write("simulation.json", {"simulate": {"duration_s": 0.001, "bodies": [bar]}, "record": "record.json"})
        self.check("carillon-simulate", "-q", "simulation.json")


if __name__ == "__main__":
    unittest.main()
