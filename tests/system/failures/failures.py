#!/usr/bin/python3
"""An error on one rank ends all ranks: one message, the right exit code, no files left behind, no hang.

usage: failures.py BIN_DIR bad_element|out_of_memory|rank_out_of_memory|killed_rank|disk|damaged_file
"""
import os
import random
import signal
import subprocess
import sys
import time

import numpy

from runs import Folder, add_mid_nodes, check, fail, is_running, list_ranks, make_box, write_vtkhdf


def bad_element(folder):
    """One element folded by its mid-side node: the file is well formed, and only the rank of that element detects it, during assembly."""
    nodes, tets = add_mid_nodes(*make_box((12, 3, 3), (0.12, 0.03, 0.03)))
    write_vtkhdf(folder / "good.vtkhdf", nodes, tets)
    # A mid-side node of the last cell is moved beyond the end of its edge: the surrounding elements fold.
    middle = tets[-1, 4]
    ends = nodes[tets[-1, :2]]
    nodes[middle] = ends[0] + 1.6 * (ends[1] - ends[0])
    write_vtkhdf(folder / "bad.vtkhdf", nodes, tets)
    folder.write_job("bad.vtkhdf", band_hz=[20, 20000], max_modes=2)
    folded = {str(e + 1) for e in numpy.flatnonzero((tets == middle).any(axis=1))}
    for ranks in (1, 2, 3):
        text = folder.expect(ranks, 2, ["bad.vtkhdf", "Jacobian"])
        named = text.split(" of the mesh (first node")[0].split()[-1]
        check(named in folded, f"element {named} is none of the folded {folded}")
    # The same with an element without volume, detected by the reader.
    nodes, tets = make_box((12, 3, 3), (0.12, 0.03, 0.03))
    extra = len(nodes)
    nodes = list(map(list, nodes)) + [[1, 0, 0], [1, 1, 0], [1, 0, 1], [1, 1, 1]]
    write_vtkhdf(folder / "bad.vtkhdf", numpy.array(nodes, float), numpy.vstack([tets, [[extra, extra + 1, extra + 2, extra + 3]]]))
    folder.expect(3, 2, ["bad.vtkhdf", f"without volume: {len(tets) + 1} "])


def out_of_memory(folder):
    """Under an address space limit the error states the need in GB beforehand; a small job runs under the same limit."""
    folder.mesh("--shape", "bar", "--length", 0.3, "--width", 0.1, "--thickness", 0.1, "--nodes", 60000, "--order", 2, "-o", "large.msh")
    folder.mesh("--shape", "bar", "--length", 0.3, "--width", 0.1, "--thickness", 0.1, "--nodes", 2000, "--order", 2, "-o", "small.msh")
    limit = ("prlimit", f"--as={1400 << 20}")
    folder.write_job("small.msh", bank="small.bank", band_hz=[20, 8000])
    text, code = folder.run(2, before=limit)
    check(code == 0, f"a small job fails under the limit:\n{text}")
    folder.write_job("large.msh", band_hz=[20, 8000])
    for ranks in (1, 2):
        started = time.monotonic()
        text = folder.expect(ranks, 4, ["GB"], before=limit)
        check("coarser" in text or "more ranks" in text or "memory" in text, f"no remedy is named:\n{text}")
        print(f"{ranks} ranks: {text.split('error:')[1].strip()} ({time.monotonic() - started:.1f} s)")


def rank_out_of_memory(folder):
    """A single rank runs out of memory, early or late: all ranks end, with one message."""
    folder.mesh("--shape", "bar", "--length", 0.3, "--width", 0.1, "--thickness", 0.1, "--nodes", 20000, "--order", 2, "-o", "bar.msh")
    folder.write_job("bar.msh", band_hz=[20, 8000])
    program = str(folder.bin / "carillon-precompute")
    for megabytes in (400, 560):
        command = [
            "mpirun",
            "--oversubscribe",
            "--bind-to",
            "none",
            "-np",
            "1",
            program,
            "job.json",
            ":",
            "-np",
            "1",
            "prlimit",
            f"--as={megabytes << 20}",
            program,
            "job.json",
        ]
        folder.expect(2, 4, ["emory" if megabytes == 400 else "GB"], command=command)


def killed_rank(folder):
    """A rank killed by the system (as when out of memory) ends the run; an older bank stays."""
    folder.mesh("--shape", "bar", "--length", 0.3, "--width", 0.1, "--thickness", 0.05, "--nodes", 30000, "--order", 2, "-o", "bar.msh")
    folder.write_job("bar.msh", band_hz=[20, 60000])
    (folder / "out.bank").write_text("an older bank")
    before = folder.list()
    for victim, phase, delay_s in ((1, "modes", 0.5), (0, "modes", 0.2), (1, "assemble", 0.0)):
        with subprocess.Popen(
            folder.command(2), cwd=folder.path, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as run:
            lines = []
            for line in run.stdout:
                lines.append(line)
                if line.startswith(phase):
                    break
            else:
                fail(f"phase {phase} was never reached:\n{''.join(lines)}")
            time.sleep(delay_s)
            ranks = list_ranks(run.pid)
            check(len(ranks) == 2, f"{ranks} below mpirun")
            os.kill(ranks[victim], signal.SIGKILL)
            try:
                text = run.communicate(timeout=60)[0]
            except subprocess.TimeoutExpired:
                run.kill()
                fail(f"mpirun waits for ever after rank {victim} was killed")
            check(run.returncode != 0, f"the run ended as if nothing had happened:\n{text}")
        for _ in range(100):
            if not any(map(is_running, ranks)):
                break
            time.sleep(0.1)
        check(not any(map(is_running, ranks)), "a rank keeps running")
        check(folder.list() == before, f"files before {before}, after {folder.list()}")
    check((folder / "out.bank").read_text() == "an older bank", "the older bank is gone")


def disk(folder):
    """The disk is full when the bank is written: an error, and no partial bank."""
    folder.mesh("--shape", "bar", "--length", 0.2, "--width", 0.05, "--thickness", 0.05, "--nodes", 6000, "--order", 2, "-o", "bar.msh")
    # A folder in place of the bank cannot be written, not even by root.
    folder.write_job("bar.msh", bank="taken", band_hz=[20, 20000])
    (folder / "taken").mkdir()
    folder.expect(2, 2, ["taken"])
    # A full disk of 96 KB: the job's few KB fit, the bank does not.
    small = folder / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", small], stderr=subprocess.DEVNULL).returncode != 0:
        print("no disk of 96 KB can be mounted here: the full disk was not tried")
        return
    try:
        folder.write_job("bar.msh", bank="small/out.bank", band_hz=[20, 20000])
        print(folder.expect(2, 4, ["out.bank"]).split("error:")[1].split("---")[0].strip())
    finally:
        subprocess.run(["umount", small])


def damaged_file(folder):
    """Truncated and corrupt files of the parallel format under mpirun: HDF5 may crash on them, the program must not."""
    nodes, tets = make_box((4, 2, 2), (0.04, 0.02, 0.02))
    write_vtkhdf(folder / "mesh.vtkhdf", nodes, tets)
    good = (folder / "mesh.vtkhdf").read_bytes()
    folder.write_job("mesh.vtkhdf", element="T4", max_modes=1)
    random.seed(5)
    (folder / "mesh.vtkhdf").write_bytes(good[: len(good) // 2])
    folder.expect(2, 2, ["mesh.vtkhdf"])
    (folder / "mesh.vtkhdf").write_bytes(good[:96] + bytes(random.randrange(256) for _ in range(2000)) + good[2096:])
    folder.expect(2, 2, ["mesh.vtkhdf"])


cases = {function.__name__: function for function in (bad_element, out_of_memory, rank_out_of_memory, killed_rank, disk, damaged_file)}
folder = Folder(sys.argv[1])
with folder.scratch:
    cases[sys.argv[2]](folder)
print(f"{sys.argv[2]}: as it should be")
