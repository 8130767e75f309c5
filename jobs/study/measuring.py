"""Runs programs and evaluates CPU seconds, medians, tables, ratios."""
import dataclasses
import functools
import math
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

from errors import RunError


@dataclasses.dataclass
class Cost:
    """Cost of one run. CPU: user + system time of the process and its children."""

    cpu_s: float
    wall_s: float


@functools.cache
def find_kernels():
    """(kernels, reason): OpenBLAS kernels for all measured programs. An OpenBLAS older than the processor selects kernels without AVX;
    carillon-precompute corrects that itself, other programs do not."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OPENBLAS_")}
    child = subprocess.run([sys.executable, "-c", ASK_KERNELS], env=environment, capture_output=True, text=True)
    if child.returncode != 0:
        return "", "OpenBLAS was not found"
    own = child.stdout.strip()
    fitting, rank = find_fitting_kernels(pathlib.Path("/proc/cpuinfo").read_text())
    if rank > KERNEL_RANKS.get(own.lower(), 9):
        return fitting, f"for all programs, matching the processor; OpenBLAS selects {own}"
    return own, "OpenBLAS's own choice"


ASK_KERNELS = """import ctypes
library = ctypes.CDLL("libopenblas.so.0")
library.openblas_get_corename.restype = ctypes.c_char_p
print(library.openblas_get_corename().decode())"""
# Rank by vector instructions: 2 is AVX2 with FMA; unlisted names are newer.
KERNELS_BY_RANK = (
    "generic katmai coppermine northwood prescott banias atom core2 penryn dunnington nehalem athlon opteron opteron_sse3 barcelona"
    " bobcat nano",
    "sandybridge bulldozer piledriver steamroller",
    "haswell zen excavator",
)
KERNEL_RANKS = {name: rank for rank, names in enumerate(KERNELS_BY_RANK) for name in names.split()}


def find_fitting_kernels(cpuinfo):
    """(kernels, rank) for a processor from the text of /proc/cpuinfo; ("", 0) if unknown."""
    fields = dict(line.split(":", 1) for line in cpuinfo.splitlines() if ":" in line)
    fields = {name.strip(): value.split() for name, value in fields.items()}
    flags = set(fields.get("flags", []))
    if {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"} <= flags:
        return "SkylakeX", 3
    if {"avx2", "fma"} <= flags:
        return ("Zen" if fields.get("vendor_id") == ["AuthenticAMD"] else "Haswell"), 2
    return "", 0


def make_environment():
    """Environment of all measured programs: one thread, MPI on any machine, the same OpenBLAS kernels."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("OPENBLAS_")}
    kernels, _ = find_kernels()
    if kernels:
        kept["OPENBLAS_CORETYPE"] = kernels
    return kept | {
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "OMP_WAIT_POLICY": "passive",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMPI_MCA_hwloc_base_binding_policy": "none",
        "OMPI_MCA_mpi_yield_when_idle": "1",
        "HWLOC_COMPONENTS": "-gl",
        "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1",  # as in carillon-precompute
    }


class Failed(RuntimeError):
    """A program with a non-zero exit code (negative: signal), and its last lines."""

    def __init__(self, program, code, lines):
        super().__init__(f"{program}: exit code {code}\n" + "".join(lines))
        self.program, self.code, self.lines = program, code, [line.strip() for line in lines if line.strip()]


def run_measured(command, cwd, environment=None, timeout_s=3600):
    """Runs the command without output. Raises Failed with its output."""
    with tempfile.TemporaryFile("w+") as log:
        start = time.monotonic()
        child = subprocess.Popen(
            [str(word) for word in command],
            cwd=cwd,
            stdout=log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=make_environment() | (environment or {}),
            start_new_session=True,
        )
        try:
            while True:
                pid, status, usage = os.wait4(child.pid, os.WNOHANG)
                if pid:
                    break
                if time.monotonic() - start > timeout_s:
                    os.killpg(child.pid, signal.SIGKILL)
                time.sleep(0.005)
        except BaseException:  # end the children of an interrupted study
            os.killpg(child.pid, signal.SIGKILL)
            raise
        wall = time.monotonic() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode != 0:
            log.seek(0)
            raise Failed(os.path.basename(str(command[0])), child.returncode, log.readlines()[-8:])
    return Cost(usage.ru_utime + usage.ru_stime, wall)


def run_part(command, cwd, what, environment=None, timeout_s=3600):
    """run_measured() for a part of a study. RunError with the error line and exit code of the program, else code 4."""
    try:
        return run_measured(command, cwd, environment, timeout_s)
    except Failed as error:
        said = [line for line in error.lines if "error" in line] or error.lines[-1:]
        if error.code in (2, 3) and said:
            raise RunError(error.code, f"{what}: {said[0]}") from None
        ended = f"{error.program} ended with exit code {error.code}"
        raise RunError(4, f"{what}: {ended}: {said[0]}" if said else f"{what}: {ended}") from None


def find_median(values):
    return statistics.median(values)


def find_spread(values):
    """Half the range / median."""
    return (max(values) - min(values)) / 2 / find_median(values) if len(values) > 1 else 0.0


def to_cents(freq_hz, true_hz):
    return 1200 * math.log2(freq_hz / true_hz)


def format_table(rows, is_markdown=False):
    """rows[0] is the head; first column left-aligned, others right-aligned."""
    widths = [max(len(str(row[i])) for row in rows) for i in range(len(rows[0]))]
    cells = [[str(c).ljust(w) if i == 0 else str(c).rjust(w) for i, (c, w) in enumerate(zip(row, widths))] for row in rows]
    if not is_markdown:
        return "\n".join(["  ".join(cells[0]), "  ".join("-" * w for w in widths), *("  ".join(row) for row in cells[1:])])
    rule = "|" + "|".join("---" if i == 0 else "--:" for i in range(len(widths))) + "|"
    return "\n".join(
        ["| " + " | ".join(str(c) for c in rows[0]) + " |", rule, *("| " + " | ".join(str(c) for c in row) + " |" for row in rows[1:])]
    )


def escape(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
