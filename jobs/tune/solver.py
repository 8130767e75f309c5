"""Solves a job with carillon-precompute in a temporary folder and reads its bank; follows modes from one solve to another."""
import concurrent.futures
import dataclasses
import io
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

import h5py
import numpy
import scipy.optimize
import scipy.spatial

import job_file
import measuring
from errors import InputError, RunError

# What decides the frequencies; the air, large motion, queue and files of a job do not.
KEYS = (
    "mesh",
    "mesh_scale",
    "shape",
    "body",
    "accuracy_cents",
    "material",
    "materials",
    "band_hz",
    "max_modes",
    "element",
    "mass",
    "fixed",
    "solver",
)
BAR_SHARES = {0: 1 / 2, 1: 1 / 4}  # of the mesh's bar, by modes/correction: docs/bank-format.md
MAX_VERTICES = 2000  # sampled to compare shapes


@dataclasses.dataclass(frozen=True)
class Sites:
    """Sensitivities of a bank (docs/bank-format.md), modes numbered as in the Solution. S sites, C columns."""

    columns: numpy.ndarray  # (C, 2) i, i: mode i; i, j: off-diagonal entry of a pair
    density: numpy.ndarray  # (S, C) cents per mm and m^2
    vertex: numpy.ndarray  # (S)
    normal: numpy.ndarray  # (S, 3)
    area_m2: numpy.ndarray  # (S)
    doubtful: numpy.ndarray  # (S) bool


@dataclasses.dataclass(frozen=True)
class Solution:
    """A solved body of m modes, in ascending order of corrected_hz, and V surface vertices."""

    freq_hz: numpy.ndarray  # (m) of the mesh
    corrected_hz: numpy.ndarray  # (m) of the body
    bar_cents: numpy.ndarray  # (m) of corrected_hz; inf: unknown
    decay_per_s: numpy.ndarray  # (m)
    shapes: numpy.ndarray  # (m, V, 3) kg^-1/2
    vertices: numpy.ndarray  # (V, 3) m
    mass_kg: float
    volume_m3: float
    job: dict  # as resolved: the material in numbers
    triangles: numpy.ndarray  # (T, 3)
    sites: Sites | None = None  # of solve(sensitivities=...)
    kinds: tuple = ()  # (m) as carillon-bank info names them; "" if unknown


class Solver:
    """job_file: for messages and relative paths."""

    def __init__(self, program, job_file, timeout_s=3600):
        self.program, self.job_file, self.timeout_s = program, pathlib.Path(job_file), timeout_s
        self.solves = 0
        measuring.run_part([program, "--validate", self.job_file.resolve()], self.job_file.resolve().parent, self.job_file)

    def solve(self, job, sensitivities=0, keep=None, is_whole=False):
        """The Solution of a job, with sensitivities and kinds of so many modes. keep: path of its bank. is_whole: of all keys of the job,
        not of those alone that decide the frequencies. RunError of the solver."""
        job = (
            job | {"bank": "bank.hdf"}
            if is_whole
            else {key: job[key] for key in KEYS if key in job} | {"shapes": "exact", "bank": "bank.hdf"}
        )
        if sensitivities:
            if job.get("materials"):
                raise InputError(f"{self.job_file}: has several materials; tune a body of one")
            job["sensitivities"] = sensitivities
        base = self.job_file.resolve().parent
        if "mesh" in job:
            job["mesh"] = str(base / job["mesh"])
        if "surface" in job.get("body", {}):
            job["body"] = job["body"] | {"surface": str(base / job["body"]["surface"])}
        with tempfile.TemporaryDirectory(prefix="carillon-tune-") as name:
            folder = pathlib.Path(name)
            (folder / "job.json").write_text(json.dumps(job))
            measuring.run_part([self.program, "-q", "job.json"], folder, self.job_file, timeout_s=self.timeout_s)
            self.solves += 1
            solution = read_bank(folder / "bank.hdf", self.job_file)
            if sensitivities:
                solution = dataclasses.replace(solution, kinds=self.find_kinds(folder / "bank.hdf"))
            if keep:
                for ending in ("", ".resolved.json"):
                    shutil.copyfile(f"{folder / 'bank.hdf'}{ending}", f"{keep}{ending}")
            return solution

    def find_kinds(self, bank):
        """The kinds of its modes in the order of Solution."""
        command = [self.program.with_name("carillon-bank"), "info", "--json", bank]
        done = subprocess.run(command, capture_output=True, text=True, env=measuring.make_environment())
        if done.returncode != 0:
            raise RunError(4, f"{self.job_file}: {done.stderr.strip()}")
        modes = sorted(json.loads(done.stdout)["modes"], key=lambda mode: mode["corrected_frequency_hz"])
        return tuple(mode.get("kind") or "" for mode in modes)

    def solve_all(self, jobs):
        """Their Solutions, as many at once as there are cores."""
        with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            return list(pool.map(self.solve, jobs))


def read_job(path):
    """The object of a job, the short form of a shape as a body. InputError."""
    job = job_file.read_job(path)
    short = job.get("shape")
    if isinstance(short, dict) and len(short) == 1 and "body" not in job:
        [(name, sizes)] = short.items()
        if isinstance(sizes, dict):  # else carillon-precompute says what is wrong
            job = {key: value for key, value in job.items() if key != "shape"} | {"body": {"shape": name} | sizes}
    return job


def find_origin(provenance):
    """(job, [edits]): the job that a packed or edited bank was computed from, and its edits since."""
    edits = []
    while "of" in provenance:
        if "edits" in provenance:
            edits.append(provenance["edits"])
        provenance = provenance["of"]
    return provenance, edits


def run_program(words, is_text=True):
    """Its standard output. InputError with its message."""
    done = subprocess.run([str(word) for word in words], capture_output=True, text=is_text)
    if done.returncode != 0:
        error = done.stderr if is_text else done.stderr.decode(errors="replace")
        raise InputError(error.strip().removeprefix(f"{pathlib.Path(words[0]).name}: "))
    return done.stdout


def open_bank(path, program):
    """An HDF5 file of a bank, unpacked by `program`, carillon-bank, where it is packed. InputError."""
    try:
        is_packed = path.read_bytes()[:17].startswith(b"CARILLON BANK 2.")
        return h5py.File(io.BytesIO(run_program([program, "unpack", path, "-"], is_text=False)) if is_packed else path, "r")
    except OSError as error:
        raise InputError(f"{path}: cannot be read as a bank: {error}; give one of carillon-precompute") from None


def read_bank(path, job_file):
    """The Solution in a bank of exact shapes; `<bank>.resolved.json` lies next to it. InputError if it has no shapes."""
    job = json.loads(pathlib.Path(f"{path}.resolved.json").read_text())
    with h5py.File(path) as bank:
        modes = bank["modes"]
        if "shape" not in modes or "corrected_frequency_hz" not in modes:
            raise InputError(f"{job_file}: this body has no mesh; give a job with a mesh, a shape or a surface")
        corrected = modes["corrected_frequency_hz"][:]
        order = numpy.argsort(corrected)
        mesh_bars, shares = modes["discretisation_error_cents"][:], modes["correction"][:]
        # The bar of the k-th frequency may be that of its neighbours. Where the bank has none of the modes themselves: the shorter one.
        own = mesh_bars * numpy.array([BAR_SHARES.get(int(reason), numpy.inf) for reason in shares])
        bars = numpy.fmin(modes["corrected_error_cents"][:], own)
        if "sensitivity/own_error_cents" in bank:
            stated = bank["sensitivity/own_error_cents"][:]
            bars[: len(stated)] = stated
        shapes = numpy.moveaxis(modes["shape"][:].astype(float), 1, 0) * modes["shape_scale"][:][:, None, None]
        return Solution(
            modes["frequency_hz"][:][order],
            corrected[order],
            bars[order],
            modes["corrected_decay"][:][order],
            shapes[order],
            bank["mesh/vertices"][:],
            float(bank["rigid/mass_kg"][()]),
            float(bank["rigid/volume_m3"][()]),
            job,
            bank["mesh/triangles"][:],
            read_sites(bank["sensitivity"], order) if "sensitivity" in bank else None,
        )


def read_sites(group, order):
    """Sites; order: (m) modes of the bank in that of the Solution."""
    place = numpy.argsort(order)
    return Sites(
        place[group["modes"][:]],
        group["density"][:] * group["scale"][:],
        group["vertex"][:],
        group["normal"][:].astype(float),
        group["area_m2"][:].astype(float),
        group["doubtful"][:] > 0,
    )


def compare(first, second):
    """(m, m') modal assurance criteria (Allemang and Brown 1982) of the modes of two Solutions, 1 for equal shapes. Vertices of different
    meshes are compared at equal places of the two bounding boxes."""
    chosen = numpy.linspace(0, len(first.vertices) - 1, min(len(first.vertices), MAX_VERTICES)).astype(int)
    other = chosen
    if len(first.vertices) != len(second.vertices):
        places = [(v - v.min(axis=0)) / numpy.maximum(numpy.ptp(v, axis=0), 1e-12) for v in (first.vertices, second.vertices)]
        other = scipy.spatial.cKDTree(places[1]).query(places[0][chosen])[1]
    rows = [(s.shapes[:, at].reshape(len(s.shapes), -1)) for s, at in ((first, chosen), (second, other))]
    rows = [row / numpy.linalg.norm(row, axis=1, keepdims=True) for row in rows]
    return (rows[0] @ rows[1].T) ** 2


def follow(first, second):
    """(m) for each mode of a Solution the mode of another with its shape, by compare(), each taken once. `second` needs as many modes or
    more."""
    return scipy.optimize.linear_sum_assignment(-compare(first, second))[1]
