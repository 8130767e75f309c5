"""Runs and evaluation of a scaling study."""
import dataclasses
import json
import math
import os
import pathlib
import statistics

import measuring
from errors import InputError
from job_file import read_job

PHASES = ("read", "partition", "assemble", "factor", "solve", "orthogonalise", "errors", "air", "coupling", "write", "other")
QUICK_NODES = [600, 1200]


@dataclasses.dataclass(frozen=True, order=True)
class Case:
    nodes: int  # requested; 0: the mesh of the job
    ranks: int


class Study:
    def __init__(self, options, program):
        self.options = options
        self.program = program
        self.job_file = pathlib.Path(options.job)
        self.job = read_job(self.job_file)
        self.out = pathlib.Path(options.out)
        self.ranks = options.ranks or ([1, 2] if options.quick else [1, 2, 4])
        self.repeats = options.repeats or (1 if options.quick else 3)
        self.cores = len(os.sched_getaffinity(0))
        self.has_body = isinstance(self.job.get("body"), dict)
        self.runs = {}  # {Case: [record, ...]}
        self.check_job()
        self.sizes = self.find_sizes()
        self.cases = self.plan()
        try:
            self.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self.out}: cannot create folder: {error.strerror}") from None

    def check_job(self):
        if "accuracy_cents" in self.job:
            raise InputError(
                f'{self.job_file}: "accuracy_cents" chooses another mesh on every occasion; give "element" and the size of the mesh for a'
                " study"
            )
        if not self.has_body and "mesh" not in self.job:
            raise InputError(f'{self.job_file}: the job has neither "body" nor "mesh"')
        if not self.has_body and self.options.nodes:
            raise InputError(
                f'{self.job_file}: --nodes needs a job with a "body" (a shape or a surface): a mesh file cannot be meshed again'
            )

    def find_sizes(self):
        if not self.has_body:
            return [0]
        if self.options.nodes:
            return self.options.nodes
        if self.options.quick:
            return QUICK_NODES
        nodes = self.job["body"].get("nodes", 10000)
        if not isinstance(nodes, int) or nodes < 32:
            raise InputError(f'{self.job_file}: "body.nodes" is {nodes!r}: too few for a study; give 32 or more, or --nodes')
        return [nodes // 4, nodes // 2, nodes]

    def plan(self):
        """Cases: growth on one rank, strong scaling at the largest size, weak scaling from the second largest."""
        most = self.sizes[-1]
        self.strong = [Case(most, ranks) for ranks in self.ranks]
        self.growth = [Case(nodes, 1) for nodes in self.sizes]
        self.weak = []
        if self.has_body and len(self.ranks) > 1:
            base = max(self.sizes[-2] if len(self.sizes) > 1 else most // 2, 16)
            self.weak = [Case(base * ranks, ranks) for ranks in self.ranks]
        return sorted({*self.strong, *self.growth, *self.weak})

    def is_crowded(self, ranks):
        """True for more ranks than cores."""
        return ranks > self.cores

    def make_job(self, case):
        job = dict(self.job)
        if case.nodes:
            body = {key: value for key, value in job["body"].items() if key != "edge_m"} | {"nodes": case.nodes}
            if "surface" in body:
                body["surface"] = self.find_path(body["surface"])
            job["body"] = body
        else:
            job["mesh"] = self.find_path(job["mesh"])
        job.pop("resources", None)
        job["bank"] = f"{self.name(case)}.hdf"
        (self.out / f"{self.name(case)}.json").write_text(json.dumps(job, indent=1) + "\n")

    def find_path(self, path):
        if not isinstance(path, str):
            raise InputError(f"{self.job_file}: {path!r} is not a path")
        return str((self.job_file.resolve().parent / path).resolve())

    def name(self, case):
        return f"n{case.nodes}_r{case.ranks}" if case.nodes else f"mesh_r{case.ranks}"

    def run(self):
        for case in self.cases:
            self.make_job(case)
        if not self.weak and len(self.ranks) > 1:
            print('a mesh file cannot be meshed again: strong scaling only; give the job a "body" for weak scaling and growth', flush=True)
        for repeat in range(self.repeats):
            # Alternating order, so that other load affects all cases.
            for case in self.cases if repeat % 2 == 0 else reversed(self.cases):
                self.runs.setdefault(case, []).append(self.run_case(case))

    def run_case(self, case):
        name = self.name(case)
        command = ["mpirun", "-np", case.ranks, self.program, "-q", "--profile", f"{name}.json"]
        cost = measuring.run_part(command if case.ranks > 1 else command[3:], self.out, name, timeout_s=self.options.timeout)
        record = json.loads((self.out / f"{name}.hdf.resolved.json").read_text())["run"]
        record["cost"] = dataclasses.asdict(cost)
        print(
            (
                f"{self.describe(case)}: {3 * record['mesh']['free_nodes']:,} unknowns, {record['solver']['modes']} modes,"
                f" {cost.cpu_s:.2f} CPU s, {cost.wall_s:.2f} s"
            ),
            flush=True,
        )
        return record

    def describe(self, case):
        text = f"{case.ranks} rank{'' if case.ranks == 1 else 's'}{' (crowded)' if self.is_crowded(case.ranks) else ''}"
        return (f"{case.nodes:,} nodes, " if case.nodes else "") + text

    # --- evaluation

    def get_unknowns(self, case):
        return 3 * self.runs[case][0]["mesh"]["free_nodes"]

    def get_work(self, case):
        """{phase: {"flops", "messages", "bytes", "collectives", "collective_bytes"}}, all ranks."""
        return self.runs[case][0]["work"]

    def calc_median(self, case, find):
        return statistics.median(find(record) for record in self.runs[case])

    def calc_phase(self, case, phase):
        """(wall seconds, of these computing, inside MPI): means over ranks, medians over repeats."""
        wall = self.calc_median(case, lambda record: record["effort"][phase]["wall_seconds"]) / case.ranks
        inside = (
            self.calc_median(case, lambda record: min(record["effort"][phase]["mpi_seconds"], record["effort"][phase]["wall_seconds"]))
            / case.ranks
        )
        return wall, wall - inside, inside

    def calc_seconds(self, case):
        return sum(self.calc_phase(case, phase)[0] for phase in PHASES)

    def calc_cpu(self, case, phase):
        return self.calc_median(case, lambda record: record["effort"][phase]["cpu_seconds"])

    def calc_spread(self, case):
        return measuring.find_spread([record["cost"]["wall_s"] for record in self.runs[case]])

    def calc_share(self):
        """CPU / wall time of runs on one rank; below 1: other load, or disk waits."""
        ones = [case for case in self.cases if case.ranks == 1]
        return min((sum(self.calc_cpu(case, phase) for phase in PHASES) / self.calc_seconds(case) for case in ones), default=1.0)

    def is_repeatable(self):
        """True if all repeats of a case did the same work."""
        return all(len({json.dumps(record["work"], sort_keys=True) for record in records}) == 1 for records in self.runs.values())


def fit_power(x, y):
    """(p, largest factor between a value and the fit) of y = a x^p by least squares of logarithms; None without two sizes."""
    points = [(math.log(a), math.log(b)) for a, b in zip(x, y) if a > 0 and b > 0]
    if len({a for a, _ in points}) < 2:
        return None
    mean_x, mean_y = (statistics.fmean(column) for column in zip(*points))
    power = sum((a - mean_x) * (b - mean_y) for a, b in points) / sum((a - mean_x) ** 2 for a, _ in points)
    return power, math.exp(max(abs(b - mean_y - power * (a - mean_x)) for a, b in points))


LATENCY_S, BYTES_PER_S = 2e-6, 4e9  # conservative, between two ranks of one machine


@dataclasses.dataclass
class Limit:
    """Causes of the additional rank-seconds on p ranks."""

    lost: float  # seconds per rank above ideal scaling
    shares: dict  # {reason: seconds of all ranks}
    text: str


def find_limit(study, phase, case):
    """The main cause of non-ideal scaling of a phase on p ranks."""
    one = Case(case.nodes, 1)
    if one not in study.runs or case.ranks == 1:
        return None
    wall_1, compute_1, _ = study.calc_phase(one, phase)
    wall, compute, inside = study.calc_phase(case, phase)
    p = case.ranks
    work, work_1 = study.get_work(case)[phase], study.get_work(one)[phase]
    more = compute_1 * max(work["flops"] / work_1["flops"] - 1, 0) if work_1["flops"] > 0 else 0.0
    calls = work["messages"] + work["collectives"] * max(math.log2(p), 1)
    transfer = min(calls * LATENCY_S + (work["bytes"] + work["collective_bytes"]) / BYTES_PER_S, p * inside)
    slower = max(p * compute - compute_1 - more, 0.0)
    shares = {
        "more operations than on one rank": more,
        "slower computing: the ranks share the memory or the cores": slower,
        "messages": transfer,
        "waiting for other ranks": max(p * inside - transfer, 0.0),
    }
    lost = wall - wall_1 / p
    if wall < 0.005 or lost < 0.1 * wall:
        return Limit(lost, shares, "none: it scales" if wall >= 0.005 else "too short")
    return Limit(lost, shares, max(shares, key=shares.get))
