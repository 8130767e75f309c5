#!/usr/bin/python3
"""Fatal signals in the mesher are input errors with a reason, in carillon-mesh and in carillon-precompute, which starts it.

usage: guard_test.py BIN_DIR
"""
import json
import pathlib
import shutil
import resource
import signal
import subprocess
import sys
import tempfile
import unittest

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
BOX = (
    "OFF\n8 12 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n3 0 2 3\n3 0 3 1\n3 4 5 7\n3 4 7 6\n3 0 1 5\n3 0 5 4\n3 2 6 7\n3"
    " 2 7 3\n3 0 4 6\n3 0 6 2\n3 1 3 7\n3 1 7 5\n"
)
JOB = {
    "body": {"surface": "box.off", "nodes": 500},
    "bank": "box.hdf",
    "material": {
        "young_modulus_pa": 7e10,
        "poisson_ratio": 0.33,
        "density_kg_m3": 2700,
        "damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 5}},
    },
}


class Guard(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)
        (self.folder / "box.off").write_text(BOX)
        (self.folder / "box.json").write_text(json.dumps(JOB))

    def tearDown(self):
        self.temporary.cleanup()

    def send(self, number):
        """Starts a long mesh and sends the signal at the first progress message."""
        with subprocess.Popen(
            [BIN / "carillon-mesh", "box.off", "-o", "out.msh", "--nodes", "2000000"],
            cwd=self.folder,
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        ) as child:
            while "refining" not in child.stderr.readline():
                self.assertIsNone(child.poll())
            child.send_signal(number)
            said = child.stderr.read()
            return child.wait(), said

    def test_crash_message(self):
        for number in (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGABRT):
            code, said = self.send(number)
            self.assertEqual(code, 2, said)
            last = said.splitlines()[-1]
            self.assertTrue(last.startswith("carillon-mesh: box.off: the mesher crashed at the step 'refining'"), last)
            self.assertIn("--method stuffing", last)
            self.assertFalse((self.folder / "out.msh").exists())

    def test_time_limit_message(self):
        code, said = self.send(signal.SIGXCPU)
        self.assertEqual(code, 2)
        self.assertIn("box.off: the mesher was ended at the step 'refining' after 10012 s of processor time", said)

    def test_inherited_time_limit(self):
        limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (1, 100))
        done = subprocess.run(
            [BIN / "carillon-mesh", "box.off", "-o", "out.msh", "--nodes", "2000000", "-q"],
            cwd=self.folder,
            capture_output=True,
            text=True,
            preexec_fn=limit,
        )
        self.assertEqual((done.returncode, done.stdout), (4, ""), done.stderr)
        self.assertRegex(
            done.stderr,
            (
                r"^carillon-mesh: box.off: the mesher was ended at the step '[a-z ]+': the processor time that this process may use is over"
                r" \(ulimit -t\)\n$"
            ),
        )

    def test_no_other_files_or_output(self):
        # A box with a corner moved through its faces: CGAL fails and would write files to the working directory.
        points = [
            (0, 0, 0),
            (0.151621431, -0.0424084216, 0.0735708103),
            (0, 0.05, 0),
            (0.1, 0.05, 0),
            (0, 0, 0.03),
            (0.1, 0, 0.03),
            (0, 0.05, 0.03),
            (0.1, 0.05, 0.03),
        ]
        (self.folder / "box.off").write_text("OFF\n8 12 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in points) + BOX.split("\n", 10)[10])
        before = sorted(self.folder.iterdir())
        done = subprocess.run(
            [BIN / "carillon-mesh", "box.off", "-o", "out.msh", "--nodes", "200", "--quiet"],
            cwd=self.folder,
            capture_output=True,
            text=True,
        )
        self.assertEqual((done.returncode, done.stdout, len(done.stderr.splitlines())), (2, "", 1), done.stderr)
        self.assertIn("carillon-mesh: box.off: 200 nodes cannot be met", done.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before)

    def solve(self, script):
        """carillon-precompute next to a fake mesher."""
        bin_dir = self.folder / "bin"
        program = bin_dir / "carillon-precompute"
        for name in ("bin/carillon-precompute", "libexec/carillon/carillon-precompute"):  # the launcher and the solver
            copy = self.folder / name
            if not copy.exists():
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(BIN.parent / name, copy)
        (bin_dir / "carillon-mesh").write_text("#!/bin/sh\n" + script)
        (bin_dir / "carillon-mesh").chmod(0o755)
        done = subprocess.run([program, "box.json"], cwd=self.folder, capture_output=True, text=True, timeout=100)
        return done.returncode, done.stderr

    @unittest.skipUnless((BIN / "carillon-precompute").exists(), "carillon-precompute is not built")
    def test_job_with_dying_mesher(self):
        for number, name in ((11, "Segmentation fault"), (7, "Bus error"), (6, "Aborted")):
            code, said = self.solve(f"kill -{number} $$\n")
            self.assertEqual(code, 2, said)
            self.assertIn(f"by signal {number} ({name})", said)
            self.assertIn("box.off", said)
            self.assertIn("stuffing", said)
        code, said = self.solve("echo 'out of luck' >&2; kill -11 $$\n")
        self.assertIn("out of luck", said)
        # Killed by another process: another attempt may succeed.
        code, said = self.solve("kill -9 $$\n")
        self.assertEqual(code, 4, said)
        self.assertIn("ended from outside", said)
        # With and without an error message.
        code, said = self.solve(
            'while [ "$1" != --result ]; do shift; done\n'
            'echo \'{"kind": "bad-input", "message": "no good", "resumable": false}\' > "$2"; exit 2\n'
        )
        self.assertEqual((code, "no good" in said), (2, True))
        code, said = self.solve("exit 2\n")
        self.assertEqual((code, "gave no reason" in said), (2, True))


unittest.main()
