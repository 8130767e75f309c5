#!/usr/bin/python3
"""A run stopped by a signal leaves no partial bank, temporary file or process, in any phase.

Starts a run on several ranks, waits for the log line of a phase, and sends a signal to mpirun or to one rank.

usage: interrupt.py BIN_DIR
"""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "failures"))
from runs import is_running, list_ranks
from solver import BIN, STEEL, run, write_job, write_sphere


def find_mentions(folder):
    """Processes with the folder in their command line."""
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if str(folder).encode() in (entry / "cmdline").read_bytes() and is_running(entry.name):
                found.append(int(entry.name))
        except OSError:
            pass
    return found


def interrupt(folder, temporary, job, ranks, phase, delay_s, number, at_rank):
    before = sorted(path.relative_to(folder) for path in folder.rglob("*"))
    command = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none", str(BIN / "carillon-precompute"), job]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | {"TMPDIR": str(temporary)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    lines = []
    for line in process.stdout:
        lines.append(line)
        if line.startswith(phase):
            break
    else:
        sys.exit(f"phase {phase} was never reached:\n{''.join(lines)}")
    time.sleep(delay_s)
    processes = list_ranks(process.pid)
    assert len(processes) == ranks, (processes, ranks)
    os.kill(processes[at_rank] if at_rank is not None else process.pid, number)
    started = time.monotonic()
    rest = process.communicate(timeout=60)[0]
    took_s = time.monotonic() - started
    text = "".join(lines) + rest
    name = f"{signal.Signals(number).name} to {'mpirun' if at_rank is None else f'rank {at_rank}'} in \"{phase}\""
    assert process.returncode != 0, f"{name}: the run ended as if nothing had happened:\n{text}"
    if at_rank is not None:
        assert process.returncode == 128 + number, f"{name}: exit code {process.returncode}:\n{text}"
    for _ in range(100):
        if not any(map(is_running, processes)):
            break
        time.sleep(0.1)
    assert not any(map(is_running, processes)), f"{name}: ranks keep running"
    after = sorted(path.relative_to(folder) for path in folder.rglob("*"))
    assert after == before, f"{name}: files before {before}, after {after}"
    left = list(temporary.glob("carillon-mesh-*"))
    assert not left, f"{name}: {left} stays"
    for _ in range(50):  # neither is a program started by a rank
        if not (others := find_mentions(folder)):
            break
        time.sleep(0.1)
    assert not others, f"{name}: {others} keeps running"
    assert text.count("stopped by") <= 1, text
    print(f"{name}: ended after {took_s:.1f} s with code {process.returncode}")


# Temporary files go to a folder of this test, since other tests mesh concurrently.
with tempfile.TemporaryDirectory(prefix="carillon-interrupt-") as scratch, tempfile.TemporaryDirectory() as own:
    folder, temporary = pathlib.Path(scratch), pathlib.Path(own)
    size = "--shape bar --length 0.3 --width 0.1 --thickness 0.05 --nodes 30000 --order 2".split()
    run(folder, "carillon-mesh", *size, "-o", "bar.msh", "--quiet")
    write_job(folder, "bar", mesh="bar.msh", band_hz=[20, 60000], material=STEEL)
    (folder / "bar.hdf").write_text("an older bank")
    for phase, delay_s, number, at_rank in (
        ("read", 0.0, signal.SIGTERM, None),
        ("assemble", 0.05, signal.SIGINT, None),
        ("modes", 1.0, signal.SIGTERM, None),
        ("modes", 0.5, signal.SIGTERM, 1),
        ("modes", 0.3, signal.SIGINT, 0),
        ("partition", 0.0, signal.SIGTERM, 1),
    ):
        interrupt(folder, temporary, "bar.json", 2, phase, delay_s, number, at_rank)
    assert (folder / "bar.hdf").read_text() == "an older bank"
    # While the mesher runs: it is ended too, and its folder removed.
    write_sphere(folder / "ball.off", 0.05, 40)
    write_job(folder, "ball", body={"surface": "ball.off", "nodes": 200000}, material=STEEL)
    interrupt(folder, temporary, "ball.json", 2, "read", 0.5, signal.SIGTERM, 0)
    interrupt(folder, temporary, "ball.json", 1, "read", 0.5, signal.SIGTERM, None)
