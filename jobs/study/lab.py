"""Where a study is done: makes meshes, runs jobs in turn, measures CPU seconds, and keeps what was measured in OUT/work, so that a study
that was interrupted continues where it was. What is kept is found by the hash of the job, the bytes of its mesh, ranks, options and the
program."""
import dataclasses
import functools
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

import measuring
from errors import InputError, RunError


@dataclasses.dataclass(frozen=True)
class Mesh:
    path: pathlib.Path
    nodes: int
    elements: int
    cpu_s: float  # of meshing


@dataclasses.dataclass(frozen=True)
class Case:
    """A job to measure. job: without "bank", with absolute paths; options: solver options after "--"; environment: (name, value) pairs."""

    name: str
    job: dict = dataclasses.field(hash=False)
    ranks: int = 1
    options: tuple = ()
    environment: tuple = ()


@dataclasses.dataclass
class Solve:
    """Result of one case. cpu_s, wall_s: per repeat; cents and residuals: per mode, as in the bank."""

    cpu_s: list
    wall_s: list
    freq_hz: list
    algebraic_cents: list
    discretisation_cents: list
    residual: list
    corrected_hz: list  # in the order of freq_hz, not sorted
    corrected_cents: list
    nodes: int
    unknowns: int
    elements: int
    bank: pathlib.Path
    record: dict  # "run" of the resolved job: phases, solver, memory
    error: str = ""  # of a failed case that may fail; the lists are empty then

    @property
    def cpu(self):
        """Median CPU seconds."""
        return measuring.find_median(self.cpu_s)

    @property
    def spread(self):
        return measuring.find_spread(self.cpu_s)

    @property
    def bar_cents(self):
        """Error bars of the frequencies, algebraic and discretisation error together."""
        return [a + b for a, b in zip(self.algebraic_cents, self.discretisation_cents)]


@functools.cache
def calc_digest(path):
    """SHA-256 of a file, cached."""
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while piece := stream.read(1 << 20):
            digest.update(piece)
    return digest.hexdigest()


def calc_key(value):
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:24]


def write_whole(path, text):
    """Atomic write."""
    part = path.with_name(path.name + f".{os.getpid()}.part")
    part.write_text(text)
    os.replace(part, path)


def read_kept(path):
    """A kept JSON object; None if missing or invalid."""
    try:
        value = json.loads(path.read_text())
    except (OSError, ValueError):
        return None
    return value if isinstance(value, dict) else None


def add_possible_nodes(error, result):
    """The RunError with the node count of the file that the program wrote to --result."""
    return RunError(error.code, str(error), (read_kept(result) or {}).get("possible_nodes"))


class Lab:
    def __init__(self, out, programs, quick=False, repeats=None, surface=None, timeout_s=3600):
        """out: the report. programs: {name: path}, see programs.find_all(). repeats: of every case; default 1 if quick, else 2."""
        self.out, self.programs, self.quick = pathlib.Path(out).resolve(), programs, quick
        self.repeats = repeats or (1 if quick else 2)
        self.surface, self.timeout_s = surface, timeout_s
        self.meshes, self.runs = self.out / "work/meshes", self.out / "work/runs"
        try:
            for folder in (self.meshes, self.runs):
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot create folder: {error.strerror}; give another one with -o") from None
        self.measured_s = 0.0  # CPU seconds of this run

    def say(self, text):
        print(text, file=sys.stderr, flush=True)

    def find_program(self, name):
        if name not in self.programs:
            raise InputError(f"{name} is not next to carillon-study; give its folder with --bin")
        return self.programs[name]

    # --- meshes

    def make_mesh(self, words, change=None, name="", inputs=()):
        """carillon-mesh with these words, kept by their hash. change(path): alters a copy of that file, `name` says how; inputs: files that
        the words name."""
        program = self.find_program("carillon-mesh")
        words = [str(word) for word in words]
        key = calc_key([calc_digest(program), words, name, [calc_digest(path) for path in inputs]])
        mesh, note = self.meshes / f"{key}.msh", self.meshes / f"{key}.json"
        kept = read_kept(note)
        if not (kept and mesh.is_file()):
            part = self.meshes / f"{key}.{os.getpid()}.part.msh"
            try:
                if change:
                    base = self.make_mesh(words, inputs=inputs)
                    shutil.copyfile(base.path, part)
                    change(part)
                    kept = {"nodes": base.nodes, "elements": base.elements, "cpu_s": base.cpu_s}
                else:
                    files = ["--json", part.with_suffix(".json"), "--result", part.with_suffix(".result"), "-o", part]
                    cost = self.call([program, *words, "--quiet", *files], "carillon-mesh")
                    made = json.loads(part.with_suffix(".json").read_text())
                    kept = {"nodes": made["nodes"], "elements": made["tets"], "cpu_s": cost.cpu_s}
                os.replace(part, mesh)
            except RunError as error:
                raise add_possible_nodes(error, part.with_suffix(".result")) from None
            finally:
                for path in (part, part.with_suffix(".json"), part.with_suffix(".result")):
                    path.unlink(missing_ok=True)
            write_whole(note, json.dumps({"words": words, "change": name} | kept, indent=1) + "\n")
        return Mesh(mesh, kept["nodes"], kept["elements"], kept["cpu_s"])

    def call(self, command, what, environment=None, cwd=None):
        """One measured run. RunError with exit code and error line of the program."""
        return measuring.run_part(command, cwd or self.out, what, environment, self.timeout_s)

    # --- solves

    def measure(self, cases, repeats=None, may_fail=False, is_fresh=False):
        """{name: Solve}: every case `repeats` times, all cases in turn and every other time backwards, so that other load on
        the machine affects all of them. is_fresh: nothing that was kept is taken, for the machine may have another pace by now."""
        repeats = repeats or self.repeats
        keys = {case.name: self.find_key(case) for case in cases}
        if len(keys) != len(cases):
            raise ValueError("duplicate case name")
        find_kept = lambda case: None if is_fresh else read_kept(self.runs / keys[case.name] / "kept.json")
        kept = {case.name: find_kept(case) or {"cpu_s": [], "wall_s": []} for case in cases}
        rounds = [
            [case for case in cases if len(kept[case.name]["cpu_s"]) <= repeat and not kept[case.name].get("error")]
            for repeat in range(repeats)
        ]
        missing = sum(map(len, rounds))
        if missing < repeats * len(cases) and missing:
            self.say(f"{repeats * len(cases) - missing} of {repeats * len(cases)} solves are kept from before ({self.runs}); continuing")
        weights = {case.name: self.find_weight(case) for case in cases}
        left, spent, done = sum(weights[case.name] for cases_now in rounds for case in cases_now), 0.0, 0
        all_weight, begin = left, time.monotonic()
        for number, cases_now in enumerate(rounds):
            for case in cases_now if number % 2 == 0 else reversed(cases_now):
                if kept[case.name].get("error"):
                    continue
                self.run_case(case, keys[case.name], kept[case.name], may_fail)
                done, left = done + 1, left - weights[case.name]
                spent = time.monotonic() - begin
                seconds = kept[case.name]["cpu_s"][-1:] or [0.0]
                minutes = spent / max(all_weight - left, 1e-9) * max(left, 0.0) / 60
                self.say(f"{done}/{missing} {case.name}: {seconds[0]:.2f} CPU s; about {minutes:.1f} min left of these")
        return {case.name: self.make_solve(kept[case.name], keys[case.name], repeats) for case in cases}

    def find_key(self, case):
        job = dict(case.job)
        files = []
        if "mesh" in job:
            files.append(calc_digest(job.pop("mesh")))
        surface = job.get("body", {}).get("surface")
        if surface:
            files.append(calc_digest(surface))
        return calc_key([calc_digest(self.find_program("carillon-precompute")), job, files, case.ranks, case.options, case.environment])

    def find_weight(self, case):
        """A rough measure of the cost of a case."""
        mesh = case.job.get("mesh")
        return (os.path.getsize(mesh) if mesh else case.job.get("body", {}).get("nodes", 5000) * 100) ** 1.2

    def run_case(self, case, key, kept, may_fail):
        folder = self.runs / key
        folder.mkdir(exist_ok=True)
        bank, result = folder / "bank.hdf", folder / "result.json"
        result.unlink(missing_ok=True)
        write_whole(folder / "job.json", json.dumps(case.job | {"bank": "bank.hdf"}, indent=1) + "\n")
        program = [
            self.find_program("carillon-precompute"),
            "-q",
            "--result",
            result.name,
            "job.json",
            *(["--", *case.options] if case.options else []),
        ]
        try:
            cost = self.call(
                ["mpirun", "-np", case.ranks, *program] if case.ranks > 1 else program, case.name, dict(case.environment), folder
            )
        except RunError as error:
            if not may_fail or error.code not in (2, 3):
                raise add_possible_nodes(error, result) from None
            kept["error"] = str(error)
        else:
            if "modes" not in kept:
                kept |= self.read_bank(bank)
            kept["cpu_s"].append(cost.cpu_s)
            kept["wall_s"].append(cost.wall_s)
            self.measured_s += cost.cpu_s
        write_whole(folder / "kept.json", json.dumps(kept) + "\n")

    def read_bank(self, bank):
        """{"modes", "record", ...} of a fresh bank."""
        child = subprocess.run(
            [str(self.find_program("carillon-bank")), "info", "--json", str(bank)], capture_output=True, text=True, stdin=subprocess.DEVNULL
        )
        if child.returncode != 0:
            raise RunError(4, f"{bank}: {child.stderr.strip()}")
        content = json.loads(child.stdout)
        record = json.loads(pathlib.Path(f"{bank}.resolved.json").read_text())["run"]
        columns = (
            "frequency_hz algebraic_error_cents discretisation_error_cents residual corrected_frequency_hz corrected_error_cents"
        ).split()
        return {
            "modes": [[mode[column] for column in columns] for mode in content["modes"]],
            "record": record,
            "nodes": content["counts"]["nodes"],
            "elements": content["counts"]["tets"],
        }

    def make_solve(self, kept, key, repeats):
        if kept.get("error"):
            return Solve([], [], [], [], [], [], [], [], 0, 0, 0, self.runs / key / "bank.hdf", {}, kept["error"])
        columns = list(map(list, zip(*kept["modes"]))) or [[], [], [], [], [], []]
        return Solve(
            kept["cpu_s"][:repeats],
            kept["wall_s"][:repeats],
            *columns,
            kept["nodes"],
            3 * kept["record"]["mesh"]["free_nodes"],
            kept["elements"],
            self.runs / key / "bank.hdf",
            kept["record"],
        )
