"""How long carillon-precompute takes on p ranks, phase by phase: a model from measured times, sizes and message counts.

Every line of the model is a function here and a row of the table of assumptions in docs/reports/scaling.md. Pure; measure reads, runs and
draws.
Symbols: N unknowns, n = N / 3 nodes, p ranks, m modes, b columns per block, k basis size. The tree of fronts is in fronts.py.
"""
import dataclasses
import math

import fronts

CASES = ("good", "expected", "poor")
PHASES = ("read", "partition", "assemble", "factor", "solve", "orthogonalise", "write")


@dataclasses.dataclass(frozen=True)
class Machine:
    """Rates of one rank while all ranks of its node work."""

    name: str
    dense_gflops: float  # DGEMM
    memory_gb_s: float
    latency_s: float  # one message
    transfer_gb_s: float
    disk_gb_s: float  # parallel file system, all ranks together


# A cluster node of two 32-core processors, one rank a core: DGEMM at the clock that all cores hold together, 300 GB/s of memory and one
# 100 Gbit/s link shared by 64 ranks; 2 us between any two nodes.
CLUSTER = Machine(
    "64 ranks a node, 100 Gbit/s", dense_gflops=30.0, memory_gb_s=300 / 64, latency_s=2e-6, transfer_gb_s=12.5 / 64, disk_gb_s=5.0
)


@dataclasses.dataclass(frozen=True)
class Body:
    """Problem and solver options. Measured at one size; grow() makes a finer mesh of the same body."""

    unknowns: float
    modes: float
    entries: float  # of the factor
    factor_flops: float  # of one factorisation
    factorisations: float
    right_sides: float  # all solves
    block: float  # columns per solve
    basis: float  # columns that a new block is made orthogonal to, at the end of a slice
    tree: fronts.Tree  # the fronts above the ranks' own subtrees
    surface_nodes: float
    file_bytes: float
    columns: float = 1000  # of all unknowns that are in memory at the peak: the basis, its copies, the modes
    halo: float = 4.0  # unknowns that a rank gets for a product with K or M, over its own to the power of 2/3
    neighbours: float = 14  # ranks that a rank has to do with
    more_flops: float = 0.0  # of a factorisation on many ranks: the tree of all ranks is not the order of one rank
    mass_entries_per_row: float = 1.0  # 1: lumped

    def grow(self, unknowns, entries, factor_flops, tree):
        """The body with that many unknowns, whose factor was counted: modes, band and so the Krylov space stay (they belong to the body);
        its surface grows as the area, N^(2/3)."""
        ratio = unknowns / self.unknowns
        return dataclasses.replace(
            self,
            unknowns=unknowns,
            entries=entries,
            factor_flops=factor_flops,
            tree=tree,
            surface_nodes=self.surface_nodes * ratio ** (2 / 3),
            file_bytes=self.file_bytes * ratio,
        )


@dataclasses.dataclass(frozen=True)
class Rates:
    """Rates of the code on the measuring machine, one rank. Seconds per unit of work, from the run on one rank."""

    dense_gflops: float  # of that machine, to carry the others over
    memory_gb_s: float
    read_s_per_unknown: float
    partition_s_per_unknown: float
    assemble_s_per_unknown: float
    order_s_per_node: float  # elimination order, fronts and plan, on one rank
    cut_s_per_node: float  # one level of vertex separators
    factor_gflops: float
    solve_gflops: float
    orthogonalise_gflops: float
    write_s_per_value: float  # surface node x mode


def find_levels(ranks):
    """Levels of the elimination tree above the ranks' own subtrees."""
    return max(0, math.ceil(math.log2(ranks)))


def find_halo_unknowns(body, ranks):
    """Unknowns that one rank gets from its neighbours for a product with K or M."""
    return 0.0 if ranks == 1 else min(body.halo * (body.unknowns / ranks) ** (2 / 3), body.unknowns)


LARGEST_GATHERED = 1e6  # nodes of a part that one rank cuts: partition/dissect.hpp
CLUSTERS = 64  # of a rank, at least 1,024 in all: the vertices of the quotient graph
CLUSTER_TRIES = 2  # of the quotient graph the best of eight bisections is taken, of a part the best of four separators
MAPPING_S_PER_RANK = 4.5e-4  # every rank maps all shared fronts: count_mapping, 0.45 s at 1,024 ranks of 5.7 million unknowns
PROGRAM_BYTES = 9e7  # memory of a rank without a matrix
FACTOR_CALLS = 14  # collective calls of a factorisation, before and after its fronts
PLAN_CALLS = 100  # of an order and its plan, once
PROJECTED_SHARE = 0.4  # of DGEMM's rate: what a dense symmetric eigensolver reaches
PROJECTED_TRIES = 1.7  # convergence tests of a slice, in units of the last: at 60, 80 and 100 % of the final basis


def count_projected_flops(body):
    """Dense eigenproblems of the basis' size with vectors, about 9 k^3 each; rank 0 solves them for all."""
    return PROJECTED_TRIES * 9 * body.basis**3


class Model:
    def __init__(self, body, rates, machine):
        self.body, self.rates, self.machine = body, rates, machine
        self.speed = machine.dense_gflops / rates.dense_gflops  # a rate of the code changes with the processor as DGEMM does

    def reduce_s(self, ranks, size):
        """Allreduce of `size` bytes: log2(p) steps there and back for short ones, each byte twice over the wire for long ones."""
        return 0.0 if ranks == 1 else 2 * find_levels(ranks) * self.machine.latency_s + 2 * size / (1e9 * self.machine.transfer_gb_s)

    def send_s(self, messages, size):
        return messages * self.machine.latency_s + size / (1e9 * self.machine.transfer_gb_s)

    def compute_s(self, flops, gflops, size):
        """A step is bound by arithmetic or by memory, whichever takes longer."""
        return max(flops / (1e9 * gflops * self.speed), size / (1e9 * self.machine.memory_gb_s))

    def calc_ordering_s(self, ranks):
        """Cutting, ordering, planning: the quotient graph on rank 0, a part of at most a million nodes on one rank, its halves on two, and
        so on, so all levels take what two do; leaves side by side; the mapping on every rank."""
        rates, nodes = self.rates, self.body.unknowns / 3
        if ranks == 1:
            return rates.order_s_per_node * nodes / self.speed
        quotient = 0.0
        if nodes > LARGEST_GATHERED:
            halvings = math.ceil(math.log2(nodes / LARGEST_GATHERED))
            quotient = CLUSTER_TRIES * halvings * max(1024, CLUSTERS * ranks) * rates.cut_s_per_node
        cuts = 2 * min(nodes, LARGEST_GATHERED) * rates.cut_s_per_node
        return (quotient + cuts + rates.order_s_per_node * nodes / ranks + MAPPING_S_PER_RANK * ranks) / self.speed

    def calc(self, ranks, parallel_reading=True, case="expected"):
        """{phase: (computing shared by all ranks, computing that does not shrink, messages)}, seconds on the critical path.

        case, of the factorisation and the solves: good: ranks of a front do not wait for one another, and half of what is sent arrives
        while they compute. expected: they wait, and nothing is hidden. poor: in addition, shared fronts run at half the rate."""
        body, rates, machine, p = self.body, self.rates, self.machine, ranks
        n = body.unknowns
        levels = find_levels(p)
        blocks = body.right_sides / body.block
        small = 8 * body.block
        slow = 1 / self.speed
        out = {}

        # Reading and cutting: on rank 0 (METIS), or by blocks of the file with recursive bisection (about 70 collective steps a level) and
        # the elements sent to their ranks once.
        if parallel_reading and p > 4:
            out["read"] = (
                rates.read_s_per_unknown * n / p * slow,
                0.0,
                body.file_bytes / (1e9 * machine.disk_gb_s) + self.send_s(4 * p, 3 * body.file_bytes / p),
            )
            out["partition"] = (
                rates.partition_s_per_unknown * n / p * slow,
                0.0,
                70 * levels * self.reduce_s(p, 8 * p) + self.send_s(2 * p, 2 * body.file_bytes / p),
            )
        else:
            out["read"] = (0.0, rates.read_s_per_unknown * n * slow, 0.0)
            out["partition"] = (0.0, rates.partition_s_per_unknown * n * slow, self.send_s(p - 1, body.file_bytes * (p - 1) / p))
        halo = find_halo_unknowns(body, p)
        out["assemble"] = (
            rates.assemble_s_per_unknown * n / p * slow,
            0.0,
            0.0 if p == 1 else self.send_s(body.neighbours, 8 * 9 * 15 * halo / 3),
        )

        # Factor: operations on the path, what the fullest rank receives, the order once.
        tree, hidden = body.tree, 0.5 if case == "good" else 1.0
        flops = self.count_flops(p)
        even = body.factorisations * flops / p / (1e9 * rates.factor_gflops * self.speed)
        path = 1.0 if p == 1 else fronts.find_path(p) if case == "good" else fronts.find_gang(p)
        if case == "poor":
            path *= 1 + min(fronts.count_shared(tree, p)[0] / flops, 1.0)
        received = hidden * self.send_s(*fronts.count_factor_messages(tree, p)) if p > 1 else 0.0
        out["factor"] = (even, (path - 1) * even + self.calc_ordering_s(p), body.factorisations * received)

        # Solve: L is read twice per block of columns. Where panels of a front wait for one another, one column of tiles is busy.
        solve_s = lambda entries: blocks * self.compute_s(4 * entries * body.block, rates.solve_gflops, 16 * entries)
        own = body.entries / p
        slowest = (fronts.FULLEST - 1) * own if p > 1 else 0.0
        if case != "good":
            for one in tree.list_levels(p):
                slowest += fronts.count_entries(one.pivots, one.order) * max(1 / math.sqrt(one.group) - 1 / one.group, 0.0)
        messages, size = fronts.count_solve_messages(tree, p)
        exchange = fronts.count_solve_path(tree, p) * machine.latency_s + hidden * self.send_s(messages, size * body.block / fronts.COLUMNS)
        out["solve"] = (solve_s(own), solve_s(slowest), blocks * exchange if p > 1 else 0.0)

        # Orthogonalise: per block one recurrence and one pass against the whole basis (half of its final size on average), Ritz vectors at
        # the end; nine sums over the ranks a block; M z needs the halo when M is not diagonal. The projected problem is rank 0's.
        flops = blocks * 4 * n * (body.basis / 2) * body.block + 2 * n * body.basis * body.modes
        shared = self.compute_s(flops / p, rates.orthogonalise_gflops, 0.0)
        projected = count_projected_flops(body) / (1e9 * PROJECTED_SHARE * rates.dense_gflops * self.speed)
        sums = blocks * (8 * self.reduce_s(p, small * body.block) + self.reduce_s(p, small * body.basis / 2)) + self.reduce_s(
            p, 8 * body.basis * body.modes
        )
        products = 0.0 if body.mass_entries_per_row <= 1 or p == 1 else blocks * 4 * self.send_s(body.neighbours, small * halo)
        out["orthogonalise"] = (shared, projected, sums + products)

        # Write: the surface's values go to rank 0, which packs and writes them.
        values = body.surface_nodes * body.modes
        out["write"] = (0.0, rates.write_s_per_value * values * slow, 0.0 if p == 1 else self.send_s(p, 24 * values * (p - 1) / p))
        return out

    def calc_seconds(self, ranks, **options):
        return {phase: sum(parts) for phase, parts in self.calc(ranks, **options).items()}

    def count_flops(self, ranks):
        return self.body.factor_flops * (1 + self.body.more_flops if ranks > 1 else 1.0)

    def calc_memory_bytes(self, ranks):
        """Of the largest rank: MPI, PETSc and the program, its columns, its share of L and of the fronts."""
        body = self.body
        return PROGRAM_BYTES + 8 * body.unknowns * body.columns / ranks + fronts.count_peak_bytes(body.tree, ranks, body.entries)

    def count_messages(self, ranks):
        """{phase: (collective calls, point-to-point messages)} of a rank, for the check against counted ones."""
        p, body = ranks, self.body
        if p == 1:
            return {}
        blocks = body.right_sides / body.block
        factor, solve = fronts.count_factor_messages(body.tree, p)[0], fronts.count_solve_messages(body.tree, p)[0]
        return {
            "orthogonalise": (9 * blocks, 0),
            "solve": (0, blocks * solve),
            "factor": (PLAN_CALLS + FACTOR_CALLS * body.factorisations, body.factorisations * (factor + solve)),
        }

    def calc_work_s(self, ranks):
        """{phase: seconds of computing summed over the ranks}."""
        body, rates = self.body, self.rates
        work = {phase: ranks * shared + serial for phase, (shared, serial, _) in self.calc(ranks).items()}
        work["factor"] = body.factorisations * self.count_flops(ranks) / (1e9 * rates.factor_gflops * self.speed)
        work["factor"] += rates.order_s_per_node * body.unknowns / 3 / self.speed
        work["solve"] = 4 * body.entries * body.right_sides / (1e9 * rates.solve_gflops * self.speed)
        return work


COUNTED = ("path", "gang", "entries", "messages", "bytes", "solve messages", "solve bytes", "solve path", "memory")


def compare(tree, row):
    """{what: model over count} of a row of count_mapping's table."""
    ranks = round(row["ranks"])
    messages, size = fronts.count_factor_messages(tree, ranks)
    solve_messages, solve_size = fronts.count_solve_messages(tree, ranks)
    pairs = (
        (fronts.find_path(ranks), row["path"]),
        (fronts.find_gang(ranks), row["gang"]),
        (fronts.FULLEST, row["fullest"]),
        (messages, row["messages"]),
        (size, 1e6 * row["megabytes"]),
        (solve_messages, row["solve_messages"]),
        (solve_size, 1e3 * row["solve_kilobytes"]),
        (fronts.count_solve_path(tree, ranks), row["solve_path_messages"]),
        (fronts.count_peak_bytes(tree, ranks, row["entries"]), 1e6 * row["peak_megabytes"]),
    )
    return {what: predicted / counted for what, (predicted, counted) in zip(COUNTED, pairs)}


def find_limit(model, phase, ranks, **options):
    """Which of the three parts of a phase is the largest: "shared", "serial" or "messages"."""
    parts = model.calc(ranks, **options)[phase]
    return ("shared", "serial", "messages")[max(range(3), key=lambda i: parts[i])]


def fit_power(sizes, values):
    """a of values ~ sizes^a, least squares in logarithms."""
    x = [math.log(size) for size in sizes]
    y = [math.log(value) for value in values]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    return sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
