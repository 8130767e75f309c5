"""Base class: a temporary folder with a store, and calls of carillon."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
MATERIAL = {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7800, "damping": {"rayleigh": {"alpha1_s": 1e-7}}}
ALUMINIUM = {
    "young_modulus_pa": 7e10,
    "poisson_ratio": 0.33,
    "density_kg_m3": 2700,
    "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}},
}


def make_job(**changes):
    job = {
        "body": {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.005, "nodes": 300},
        "material": dict(MATERIAL),
        "band_hz": [20, 6000],
    }
    job.update(changes)
    return job


def make_simulation(duration_s=0.002, **changes):
    """A short bar, clamped at one end and struck at the other."""
    job = {
        "simulate": {
            "duration_s": duration_s,
            "bodies": [
                {
                    "name": "bar",
                    "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}},
                    "material": dict(ALUMINIUM),
                    "fixed": "x-min",
                }
            ],
            "impulses": [{"time_s": 0.0002, "body": "bar", "point_m": [0.05, 0, 0.005], "impulse_n_s": [0, 0, -0.001]}],
        },
        "sound": "bar.wav",
    }
    job.update(changes)
    return job


class Bench(unittest.TestCase):
    wrapper = []  # command prefix
    parent = None  # parent of the folder; None: default

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="carillon-jobs-", dir=self.parent))
        self.addCleanup(self.clean)
        self.store = self.folder / "store"
        self.environment = {
            **os.environ,
            "XDG_DATA_HOME": str(self.folder / "data"),
            "XDG_CONFIG_HOME": str(self.folder / "config"),
            "PATH": "/usr/bin:/bin",
        }

    def clean(self):
        for path, folders, _ in os.walk(self.folder):
            os.chmod(path, 0o755)
        shutil.rmtree(self.folder)

    def write(self, name, job):
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(job if isinstance(job, str) else json.dumps(job))
        return file

    def make_bar_mesh(self, name="bar.msh"):
        """The body of make_job() as a mesh file."""
        mesh = self.folder / name
        size = "--shape bar --length 0.2 --width 0.02 --thickness 0.005 --nodes 300".split()
        subprocess.run([BIN / "carillon-mesh", "--quiet", *size, "-o", mesh], check=True)
        return mesh

    def command(self, *words):
        return [*self.wrapper, str(BIN / "carillon"), *map(str, words), "--store", str(self.store)]

    def run_it(self, *words, code=0, **options):
        done = subprocess.run(
            self.command(*words),
            capture_output=True,
            text=True,
            errors="surrogateescape",
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            timeout=options.pop("timeout", 360),
            **options,
        )
        if code is not None:
            self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def ask(self, *words, code=0):
        """The JSON document of a command."""
        return json.loads(self.run_it(*words, "--json", code=code).stdout)

    def refuse(self, *words, says, code=2):
        """Expects an error with these words and without control characters."""
        done = self.run_it(*words, code=code, timeout=120)
        for word in says if isinstance(says, (list, tuple)) else [says]:
            self.assertIn(word, done.stderr)
        self.assertFalse([c for c in done.stderr if ord(c) < 32 and c != "\n"], repr(done.stderr))
        return done
