#!/usr/bin/python3
"""A run stopped by a signal leaves no partial bank, temporary file or process, in any phase.

Starts a run on several ranks, waits for the log line of a phase, and sends a signal to mpirun or to one rank.

usage: interrupt.py BIN_DIR
"""
import json
import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "failures"))
from runs import STEEL, is_running, list_ranks

bin_dir = pathlib.Path(sys.argv[1]).resolve()


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
    command = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none", str(bin_dir / "carillon-precompute"), job]
    run = subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | {"TMPDIR": str(temporary)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    lines = []
    for line in run.stdout:
        lines.append(line)
        if line.startswith(phase):
            break
    else:
        sys.exit(f"phase {phase} was never reached:\n{''.join(lines)}")
    time.sleep(delay_s)
    processes = list_ranks(run.pid)
    assert len(processes) == ranks, (processes, ranks)
    os.kill(processes[at_rank] if at_rank is not None else run.pid, number)
    started = time.monotonic()
    rest = run.communicate(timeout=60)[0]
    took_s = time.monotonic() - started
    text = "".join(lines) + rest
    name = f"{signal.Signals(number).name} to {'mpirun' if at_rank is None else f'rank {at_rank}'} in \"{phase}\""
    assert run.returncode != 0, f"{name}: the run ended as if nothing had happened:\n{text}"
    if at_rank is not None:
        assert run.returncode == 128 + number, f"{name}: exit code {run.returncode}:\n{text}"
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
    print(f"{name}: ended after {took_s:.1f} s with code {run.returncode}")


# Temporary files go to a folder of this test, since other tests mesh concurrently.
with tempfile.TemporaryDirectory(prefix="carillon-interrupt-") as scratch, tempfile.TemporaryDirectory() as own:
    folder, temporary = pathlib.Path(scratch), pathlib.Path(own)
    subprocess.run(
        [
            bin_dir / "carillon-mesh",
            *"--shape bar --length 0.3 --width 0.1 --thickness 0.05 --nodes 30000 --order 2".split(),
            "-o",
            "bar.msh",
            "--quiet",
        ],
        cwd=folder,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    (folder / "bar.json").write_text(json.dumps({"mesh": "bar.msh", "bank": "bar.hdf", "band_hz": [20, 60000], "material": STEEL}))
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
    rings = 40
    points = (
        [(0, 0, 0.05)]
        + [
            (
                0.05 * math.sin(math.pi * i / rings) * math.cos(math.pi * j / rings),
                0.05 * math.sin(math.pi * i / rings) * math.sin(math.pi * j / rings),
                0.05 * math.cos(math.pi * i / rings),
            )
            for i in range(1, rings)
            for j in range(2 * rings)
        ]
        + [(0, 0, -0.05)]
    )
    at = lambda i, j: 1 + (i - 1) * 2 * rings + j % (2 * rings)
    faces = [(0, at(1, j), at(1, j + 1)) for j in range(2 * rings)] + [
        (len(points) - 1, at(rings - 1, j + 1), at(rings - 1, j)) for j in range(2 * rings)
    ]
    for i in range(1, rings - 1):
        for j in range(2 * rings):
            faces += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
    (folder / "ball.off").write_text(
        f"OFF\n{len(points)} {len(faces)} 0\n"
        + "".join("%.9g %.9g %.9g\n" % p for p in points)
        + "".join("3 %d %d %d\n" % f for f in faces)
    )
    (folder / "ball.json").write_text(json.dumps({"body": {"surface": "ball.off", "nodes": 200000}, "bank": "ball.hdf", "material": STEEL}))
    interrupt(folder, temporary, "ball.json", 2, "read", 0.5, signal.SIGTERM, 0)
    interrupt(folder, temporary, "ball.json", 1, "read", 0.5, signal.SIGTERM, None)
