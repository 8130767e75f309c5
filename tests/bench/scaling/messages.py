"""Reads what count_messages.c wrote: messages and computing by phase, which follows from the functions on the way to each call."""
import bisect
import collections
import subprocess

# The first rule whose text stands in the name of a function on the way, from the innermost outwards, says the phase.
RULES = (
    ("ldlt::Factor::solve", "solve"),
    ("ldlt::solve_columns", "solve"),
    ("ldlt::(anonymous namespace)::Solver", "solve"),
    ("ldlt::", "factor"),
    ("MumpsFactor", "factor"),
    ("fem::assemble", "assemble"),
    ("fem::Assembl", "assemble"),
    ("calc_rigid_body", "assemble"),
    ("mesh::distribute", "partition"),
    ("parallel_mesh::", "read"),
    ("partition::", "partition"),
    ("error_bars::", "error bars"),
    ("mesh::", "read"),
    ("calc_surface_modes", "write"),
    ("gather", "write"),
    ("write_outputs", "write"),
    ("collect_bank", "write"),
    ("eigen::", "orthogonalise"),
)


def read_symbols(program):
    """(addresses ascending, names) of the program's functions."""
    text = subprocess.run(["nm", "-C", "--defined-only", program], capture_output=True, text=True, check=True).stdout
    symbols = sorted(
        (int(address, 16), name) for address, kind, name in (line.split(" ", 2) for line in text.splitlines()) if kind in "tTwWu"
    )
    return [address for address, _ in symbols], [name for _, name in symbols]


def find_function(symbols, address):
    addresses, names = symbols
    at = bisect.bisect_right(addresses, address) - 1
    return names[at] if at >= 0 else "?"


def find_phase(names):
    """names: from the innermost function outwards."""
    if any("ldlt::Factor::factorise" in name for name in names):
        return "factor"  # the solve that measures its error, too
    if any("ldlt::make_plan" in name for name in names):
        return "plan"  # order, fronts, mapping
    for name in names:
        for text, phase in RULES:
            if text in name:
                return phase
    return "other"


def read_rank(path, symbols):
    """{phase: {"compute_s": CPU seconds between calls, "mpi_s": CPU seconds inside, kind: [calls, bytes], ...}} of one rank."""
    phases = collections.defaultdict(lambda: {"compute_s": 0.0, "mpi_s": 0.0})
    with open(path) as stream:
        for line in stream:
            kind, calls, size, inside_s, before_s, *way = line.split()
            # A return address lies behind the call.
            entry = phases[find_phase([find_function(symbols, int(address, 16) - 1) for address in way])]
            entry["compute_s"] += float(before_s)
            entry["mpi_s"] += float(inside_s)
            if kind != "wait":
                sums = entry.setdefault(kind, [0, 0.0])
                sums[0] += int(calls)
                sums[1] += float(size)
    return dict(phases)
