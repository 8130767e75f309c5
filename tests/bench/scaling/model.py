"""How long carillon-precompute takes on p ranks, phase by phase: a model from measured times, sizes and message counts.

Every line of the model is a function here and a row of the table of assumptions in docs/reports/scaling.md. Pure; measure reads, runs and
draws.
Symbols: N unknowns, n = N / 3 nodes, p ranks, m modes, b columns per block, k basis size, s order (unknowns) of a separator.
"""
import dataclasses
import math

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
    """What is solved, and how. Measured at one size; grow() makes a finer mesh of the same body."""

    unknowns: float
    modes: float
    entries: float  # of the factor
    factor_flops: float  # of one factorisation
    factorisations: float
    right_sides: float  # all solves
    block: float  # columns per solve
    basis: float  # columns that a new block is made orthogonal to, at the end of a slice
    separator: float  # unknowns of the separator that halves the body
    surface_nodes: float
    file_bytes: float
    columns: float = 1000  # of all unknowns that are in memory at the peak: the basis, its copies, the modes
    shrink: float = 2 ** (-2 / 3)  # separators of a level over those of the level above
    neighbours: float = 14  # ranks that a rank has to do with
    groups: float = 12  # of separator nodes that a rank is near to
    more_flops: float = 0.0  # of a factorisation, per level of ranks: the separator last is no nested dissection
    more_entries: float = 0.0  # of L
    mass_entries_per_row: float = 1.0  # 1: lumped

    def grow(self, unknowns, entries_power, flops_power):
        """The body with that many unknowns: modes, band and so the Krylov space stay (they belong to the body); its faces, separators and
        surface grow as the area, N^(2/3)."""
        ratio = unknowns / self.unknowns
        area = ratio ** (2 / 3)
        return dataclasses.replace(
            self,
            unknowns=unknowns,
            entries=self.entries * ratio**entries_power,
            factor_flops=self.factor_flops * ratio**flops_power,
            separator=self.separator * area,
            surface_nodes=self.surface_nodes * area,
            file_bytes=self.file_bytes * ratio,
        )


@dataclasses.dataclass(frozen=True)
class Rates:
    """What the code reaches on the measuring machine, one rank. Seconds per unit of work, from the run on one rank."""

    dense_gflops: float  # of that machine, to carry the others over
    memory_gb_s: float
    read_s_per_unknown: float
    partition_s_per_unknown: float
    assemble_s_per_unknown: float
    factor_gflops: float
    front_gflops: float  # one large front on one rank
    solve_gflops: float
    orthogonalise_gflops: float
    write_s_per_value: float  # surface node x mode
    plan_s: float  # order of the separator, on every rank alike: plan_s ranks^plan_power
    plan_power: float


def find_levels(ranks):
    """Levels of the elimination tree above the ranks' own subtrees."""
    return max(0, math.ceil(math.log2(ranks)))


def find_fronts(body, ranks):
    """[(pivots, order)] of the largest front of each level above the subtrees, root first. A front other than the root has the separators
    around it for a border: in all about 2.5 times its pivots."""
    return [
        (body.separator * body.shrink**level, body.separator * body.shrink**level * (1.0 if level == 0 else 2.5))
        for level in range(find_levels(ranks))
    ]


def find_separator_unknowns(body, ranks):
    """Unknowns between the ranks: level l has 2^l separators."""
    return min(sum(body.separator * (2 * body.shrink) ** level for level in range(find_levels(ranks))), body.unknowns)


def find_halo_unknowns(body, ranks):
    """Unknowns that one rank gets from its neighbours for a product with K or M: every separator has two sides."""
    return 0.0 if ranks == 1 else 2 * find_separator_unknowns(body, ranks) / ranks


def count_meetings(body, ranks):
    """Fronts of the separator at which one rank meets others: one for two ranks, in the end those of all groups near it."""
    return 0 if ranks == 1 else min(ranks - 1, body.groups)


PROGRAM_BYTES = 9e7  # what a rank holds before it has a matrix
ORDERING_S_PER_NODE = 3e-6  # nested dissection by METIS, as the ranks order their interiors
PROJECTED_SHARE = 0.4  # of DGEMM's rate: what a dense symmetric eigensolver reaches
PROJECTED_TRIES = 1.7  # convergence tests of a slice, in units of the last: at 60, 80 and 100 % of the final basis


def count_projected_flops(body):
    """Dense eigenproblems of the basis' size with vectors, about 9 k^3 each; rank 0 solves them for all."""
    return PROJECTED_TRIES * 9 * body.basis**3


def count_front_flops(pivots, order):
    return pivots * order**2 - pivots**2 * order + pivots**3 / 3


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

    def calc(self, ranks, parallel_reading=True, spread_fronts=False):
        """{phase: (computing shared by all ranks, computing that does not shrink, messages)}, seconds on the critical path.

        spread_fronts: what is not built: a front of level l belongs to the p / 2^l ranks below it, which reach half of their rate together,
        in panels of 64 columns; and the separator is ordered by nested dissection, in time that grows with its size alone."""
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

        # Factor: the subtrees run side by side; above them one rank after the other, each front where it stands.
        fronts = find_fronts(body, p)
        top = sum(2**level * count_front_flops(*front) for level, front in enumerate(fronts))
        flops = body.factor_flops * (1 + body.more_flops * levels)
        shared = body.factorisations * max(flops - top, 0.0) / p / (1e9 * rates.factor_gflops * self.speed)
        path = sum(count_front_flops(*front) for front in fronts) / (1e9 * rates.front_gflops * self.speed)
        updates = sum(self.send_s(2, 8 * (order - pivots) ** 2 / 2) for pivots, order in fronts)
        plan = 0.0 if p == 1 else rates.plan_s * p**rates.plan_power * slow
        if spread_fronts:
            shares = [max(1.0, 0.5 * p / 2**level) for level in range(levels)]
            path = sum(count_front_flops(*front) / share for front, share in zip(fronts, shares)) / (1e9 * rates.front_gflops * self.speed)
            updates = sum(
                self.send_s(order / 64 * 2 * math.log2(2 * share), 8 * pivots * order / math.sqrt(share))
                for (pivots, order), share in zip(fronts, shares)
            )
            plan = ORDERING_S_PER_NODE * find_separator_unknowns(body, p) / 3 * slow
        out["factor"] = (shared, body.factorisations * path + plan, body.factorisations * updates)

        # Solve: L is read twice per block of columns; fronts on the path wait for one another twice, down and up.
        top_entries = sum(2**level * (pivots * order - pivots**2 / 2) for level, (pivots, order) in enumerate(fronts))
        own = max(body.entries * (1 + body.more_entries * levels) - top_entries, 0.0) / p
        shared = blocks * self.compute_s(4 * own * body.block, rates.solve_gflops, 16 * own)
        path_entries = sum(
            (pivots * order - pivots**2 / 2) / (shares[level] if spread_fronts else 1.0) for level, (pivots, order) in enumerate(fronts)
        )
        path = blocks * self.compute_s(4 * path_entries * body.block, rates.solve_gflops, 16 * path_entries)
        exchange = blocks * (
            2 * count_meetings(body, p) * machine.latency_s + sum(2 * self.send_s(1, small * order) for _, order in fronts)
        )
        out["solve"] = (shared, path, exchange)

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

    def calc_memory_bytes(self, ranks, spread_fronts=False):
        """Of the largest rank: MPI, PETSc and the program, its share of L and of the columns, the largest front above the subtrees and its
        child's."""
        body = self.body
        fronts = find_fronts(body, ranks)
        shares = [ranks / 2**level if spread_fronts else 1.0 for level in range(len(fronts))]
        largest = max((8 * order**2 / 2 / share for (_, order), share in zip(fronts, shares)), default=0.0)
        entries = body.entries * (1 + body.more_entries * find_levels(ranks))
        return PROGRAM_BYTES + 8 * entries / ranks + 8 * body.unknowns * body.columns / ranks + 2 * largest

    def count_messages(self, ranks):
        """{phase: (collective calls, point-to-point messages)} of a rank, for the check against counted ones."""
        p, body = ranks, self.body
        if p == 1:
            return {}
        blocks = body.right_sides / body.block
        meetings = count_meetings(body, p)
        return {
            "orthogonalise": (9 * blocks, 0),
            "solve": (0, blocks * meetings),
            "factor": (50 + 3 * body.factorisations, body.factorisations * (3 + 2 * meetings)),
        }

    def calc_work_s(self, ranks):
        """{phase: seconds of computing summed over the ranks}."""
        body, rates = self.body, self.rates
        work = {phase: ranks * shared + serial for phase, (shared, serial, _) in self.calc(ranks).items()}
        # The fronts off the path are work of other ranks; together the factor and a solve cost what they cost one rank.
        levels = find_levels(ranks)
        work["factor"] = body.factorisations * body.factor_flops * (1 + body.more_flops * levels) / (1e9 * rates.factor_gflops * self.speed)
        work["solve"] = 4 * body.entries * (1 + body.more_entries * levels) * body.right_sides / (1e9 * rates.solve_gflops * self.speed)
        return work


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
