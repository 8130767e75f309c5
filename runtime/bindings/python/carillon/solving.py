"""Runs carillon-precompute as a process (MPI and PETSc are never loaded here)."""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import threading
import typing
import warnings

from . import _carillon
from ._carillon import Bank, InputError, SolveError, SystemError, find_bank
from .documents import write_json

PATIENCE_S = 5.0  # grace period of an interrupted solver
SOLVER = "carillon-precompute"


def find_program(name: str) -> str:
    """Finds a program in this installation, else in PATH. Raises SystemError."""
    prefixes = list(pathlib.Path(__file__).resolve().parents)[:-1]  # without the root: /bin belongs to the system
    own = next((prefix / "bin" / name for prefix in prefixes if (prefix / "bin" / name).is_file()), None)
    found = str(own) if own else shutil.which(name)
    if found is None:
        raise SystemError(f"{name} is not installed here (package carillon-precompute), or not in PATH")
    return found


def make_command(ranks: int) -> typing.List[str]:
    """The command that starts the solver on this number of ranks."""
    if ranks == 1:
        return [find_program(SOLVER)]
    return ["mpirun", "-np", str(ranks), "--bind-to", "none", "--oversubscribe", find_program(SOLVER)]


def make_environment(ranks: int) -> typing.Dict[bytes, bytes]:
    """Environment with one thread per rank, independent of an MPI run of this process."""
    entries = (entry.partition(b"=") for entry in _carillon._make_environment(is_alone=ranks == 1))
    environment = {name: value for name, _, value in entries}
    environment.update({b"OMP_NUM_THREADS": b"1", b"OPENBLAS_NUM_THREADS": b"1", b"HWLOC_COMPONENTS": b"-gl"})
    if os.geteuid() == 0:
        environment.update({b"OMPI_ALLOW_RUN_AS_ROOT": b"1", b"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": b"1"})
    return environment


def run(command: typing.List[str], ranks: int) -> typing.Tuple[int, str]:
    """Exit code and standard error of a command. An interrupt (Ctrl-C) also ends the command."""
    if shutil.which(command[0]) is None:
        raise SystemError(f"{command[0]} is not in PATH; install it (package openmpi-bin)")
    # An interrupt inside Popen() would leave the solver running: it is recorded and raised once the solver can be ended.
    interrupts: typing.List[int] = []
    handler = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None
    if handler is not None:
        signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    try:
        solver = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=make_environment(ranks)
        )
    finally:
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
    with solver:
        try:
            if interrupts:
                signal.raise_signal(signal.SIGINT)
            _, said = solver.communicate()
        except BaseException:
            solver.terminate()
            try:
                solver.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                solver.kill()
            raise
    return solver.returncode, said.decode(errors="backslashreplace")


def raise_error(result: dict, code: int, said: str) -> typing.NoReturn:
    """The exception described by a program's result file (docs/howto/jobs.md)."""
    kinds = {"bad-input": InputError, "no-solution": SolveError}
    lines = [line for line in said.splitlines() if line.strip(" -")]
    message = result.get("message") or (lines[-1] if lines else f"{SOLVER} ended with exit code {code} and without a message")
    raise kinds.get(result.get("kind"), SystemError)(message)


def solve(job: typing.Union[dict, str, os.PathLike], *, ranks: int = 1, bank: typing.Union[None, str, os.PathLike] = None) -> Bank:
    """Solves a job and returns its bank.

    job: a job file, or a job as a dict (docs/howto/make-a-bank.md) with paths relative to the current directory.
    ranks: number of MPI ranks.
    bank: the file to write; default: the job's "bank", else the bank is kept in memory only.
    Warnings of the solver become Python warnings. Raises InputError, SolveError or SystemError with the solver's message. Releases the
    GIL; Ctrl-C ends the solver.
    """
    if isinstance(ranks, bool) or not isinstance(ranks, int) or ranks < 1:
        raise InputError(f"ranks: {ranks!r}; give a whole number, 1 or more")
    with tempfile.TemporaryDirectory(prefix="carillon-solve-") as name:
        folder = pathlib.Path(name)
        if isinstance(job, dict):
            here, text, file = os.path.join(os.getcwd(), "job"), write_json(anchor(job), "job"), folder / "job"
            file.write_text(text, encoding="utf-8", errors="surrogateescape")
        else:
            here, text, file = os.fspath(job), "", pathlib.Path(job)
        kept = os.path.abspath(bank) if bank is not None else find_bank(here, text)
        written, result = kept or str(folder / "bank.hdf"), folder / "result"
        code, said = run(make_command(ranks) + [str(file), "-q", "--bank", written, "--result", str(result)], ranks)
        said = said.replace(str(file), here) if text else said
        if code != 0:
            read = json.loads(result.read_text(errors="backslashreplace")) if result.is_file() else {}
            if text and "message" in read:
                read["message"] = read["message"].replace(str(file), here)
            raise_error(read, code, said)
        for line in said.splitlines():
            if line.startswith(f"{SOLVER}: warning: "):
                warnings.warn(line.partition(" warning: ")[2], stacklevel=2)
        return Bank(written) if kept else Bank.parse(pathlib.Path(written).read_bytes())


def anchor(job: dict) -> dict:
    """The job with absolute paths, because it is solved from another folder."""

    def absolute(value: dict, *keys: str) -> dict:
        return {
            **value,
            **{key: os.path.abspath(value[key]) for key in keys if isinstance(value.get(key), (str, os.PathLike)) and value[key]},
        }

    job = absolute(job, "mesh", "bank")
    if isinstance(job.get("body"), dict):
        job["body"] = absolute(job["body"], "surface", "modes_csv")
    return job
