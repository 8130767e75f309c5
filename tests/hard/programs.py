"""Runs carillon-precompute on a hard case, as a user would: files in, exit code, words and bank out. CARILLON_BIN_DIR says where the
programs are."""
import json
import math
import os
import pathlib
import subprocess
import tempfile

import h5py
import numpy as np

BIN = pathlib.Path(os.environ.get("CARILLON_BIN_DIR", "build/release/bin")).resolve()
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850}
SPRUCE = {
    "orthotropic": {
        "young_modulus_pa": [10.8e9, 0.84e9, 0.46e9],
        "shear_modulus_pa": [0.69e9, 0.032e9, 0.66e9],
        "poisson_ratio": [0.372, 0.435, 0.467],
    },
    "density_kg_m3": 400,
}
TIMEOUT_S = 330 * int(os.environ.get("CARILLON_PATIENCE", "1"))  # of one run: a longer run counts as hung


class Outcome:
    """code, text (both streams), and of a run that ended well: freq_hz, the bank as a dictionary of arrays, the record next to it."""

    def __init__(self, code, text):
        self.code, self.text, self.freq_hz, self.bank, self.record = code, text, None, {}, {}

    def warnings(self):
        return [line for line in self.text.splitlines() if "warning:" in line]


class Folder:
    """A folder of its own for one job; use with `with`."""

    def __enter__(self):
        self.temporary = tempfile.TemporaryDirectory(prefix="carillon-hard-")
        self.path = pathlib.Path(self.temporary.name)
        return self

    def __exit__(self, *ignored):
        self.temporary.cleanup()

    def run(self, ranks, *command):
        words = [str(BIN / command[0]), *map(str, command[1:])]
        if ranks > 1:
            words = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none", *words]
        done = subprocess.run(
            words, cwd=self.path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=TIMEOUT_S
        )
        return Outcome(done.returncode, done.stdout)

    def solve(self, solid, element, ranks=1, material=STEEL, band_hz=(20, 20000), **keys):
        """The job of `solid` (a Solid, or None where mesh.msh is there) with further keys of the job file."""
        if solid is not None:
            solid.write(self.path / "mesh.msh")
        damping = {"damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 1}}}
        job = {"mesh": "mesh.msh", "bank": "out.bank", "element": element, "band_hz": list(band_hz), **keys}
        if "materials" not in job:
            job["material"] = {**material, **damping}
        else:
            job["materials"] = {name: {**m, **damping} for name, m in job["materials"].items()}
        (self.path / "job.json").write_text(json.dumps(job, indent=1))
        outcome = self.run(ranks, "carillon-precompute", "job.json")
        if outcome.code == 0:
            check = self.run(1, "carillon-bank", "check", "out.bank")
            assert check.code == 0, check.text
            with h5py.File(self.path / "out.bank") as bank:
                bank.visititems(lambda name, item: outcome.bank.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
            outcome.freq_hz = outcome.bank["modes/frequency_hz"]
            # The band is of corrected frequencies: up to here the bank has all modes of the mesh.
            below_hz = outcome.bank.get("proof/complete_below_hz")
            if below_hz is not None:
                outcome.freq_hz = outcome.freq_hz[outcome.freq_hz < below_hz]
            outcome.record = json.loads((self.path / "out.bank.resolved.json").read_text())
            for name, array in outcome.bank.items():
                assert np.issubdtype(np.asarray(array).dtype, np.number) is False or np.isfinite(array).all(), f"{name} is not finite"
        return outcome

    def list(self):
        return sorted(path.name for path in self.path.iterdir())


def solve(solid, element, **options):
    """The outcome of a job that has to end well."""
    with Folder() as folder:
        outcome = folder.solve(solid, element, **options)
        assert outcome.code == 0, f"exit code {outcome.code}: {outcome.text[-1500:]}"
        return outcome


def refuse(solid, element, code=2, **options):
    """The message of a job that has to be refused: this exit code, one line of error, nothing left behind."""
    with Folder() as folder:
        outcome = folder.solve(solid, element, **options)
        lines = [line for line in outcome.text.splitlines() if "error:" in line]
        assert outcome.code == code, f"exit code {outcome.code}: {outcome.text[-1500:]}"
        assert len(lines) == 1, outcome.text
        assert folder.list() == ["job.json", "mesh.msh"], folder.list()
        return lines[0]


def calc_distance(freq_hz, truth_hz):
    """The greatest relative distance between frequencies; infinite where their numbers differ."""
    if len(freq_hz) != len(truth_hz) or len(freq_hz) == 0:
        return math.inf
    return float(np.abs(np.asarray(freq_hz) / np.asarray(truth_hz) - 1).max())
