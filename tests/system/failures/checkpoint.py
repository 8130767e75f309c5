#!/usr/bin/python3
"""A stopped or killed run resumes from its checkpoint, on another number of ranks, with the bank of an uninterrupted run.

usage: checkpoint.py BIN_DIR stops|slices|kills|damage|disk|accuracy|replaced
"""
import json
import os
import random
import re
import signal
import subprocess
import sys
import time

import h5py
import numpy

from runs import Folder, check, fail, is_running, list_ranks

STOPPED = 85
EQUAL = 1e-9


def read_frequencies(folder, bank):
    with h5py.File(folder / bank, "r") as file:
        check("proof" in file and len(file["proof/cut_hz"]) >= 2, "the bank has no proof")
        return file["modes/frequency_hz"][:]


def heed(text):
    """Removes warnings about missing damping and the coarse mesh."""
    return "\n".join(line for line in text.splitlines() if '"damping" is zero' not in line and "frequencies can be wrong by" not in line)


def check_bank(folder, bank, expected, name):
    checked = subprocess.run([folder.bin / "carillon-bank", "check", bank], cwd=folder.path, capture_output=True, text=True)
    check(checked.returncode == 0, f"{name}: {checked.stdout}{checked.stderr}")
    found = read_frequencies(folder, bank)
    check(len(found) == len(expected), f"{name}: {len(found)} modes, not {len(expected)}")
    worst = numpy.max(numpy.abs(found / expected - 1)) if len(expected) else 0.0
    check(worst <= EQUAL, f"{name}: a frequency differs by {worst:.1e}")
    return worst


class Body:
    """A job, its bank without interruption, and its output."""

    def __init__(self, folder, name="job.json", ranks=1, **more):
        self.folder, self.job = folder, name
        folder.write_job("body.msh", name=name, bank="out.bank", **more)
        started = time.monotonic()
        text, code = folder.run(ranks, job=name, timeout_s=200)
        self.seconds = time.monotonic() - started
        check(code == 0, text)
        self.expected = read_frequencies(folder, "out.bank")
        (folder / "out.bank").unlink()

    def command(self, ranks, *more):
        return [
            "mpirun",
            "-np",
            str(ranks),
            "--oversubscribe",
            "--bind-to",
            "none",
            str(self.folder.bin / "carillon-precompute"),
            self.job,
            "--checkpoint",
            "state",
            *map(str, more),
        ]

    def resume(self, ranks, name, *more):
        text, code = self.folder.run(ranks, command=self.command(ranks, *more), timeout_s=200)
        check(code == 0, f"{name}: exit code {code}:\n{text}")
        worst = check_bank(self.folder, "out.bank", self.expected, name)
        check(not (self.folder / "state").exists(), f"{name}: the checkpoint stays")
        check(not list(self.folder.path.glob(".*.new")), f"{name}: a temporary file stays")
        (self.folder / "out.bank").unlink()
        return text, worst

    def stop(self, ranks, line, delay_s, number=signal.SIGUSR1, at_rank=None, *more):
        """Starts a run, waits for a line matching `line` plus a delay, and sends the signal. Returns (text, exit code)."""
        with subprocess.Popen(
            self.command(ranks, *more),
            cwd=self.folder.path,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as run:
            lines = []
            for said in run.stdout:
                lines.append(said)
                if re.search(line, said):
                    break
            else:
                fail(f"'{line}' was never said:\n{''.join(lines)}")
            time.sleep(delay_s)
            processes = list_ranks(run.pid)
            try:
                os.kill(run.pid if at_rank is None else processes[at_rank], number)
            except (ProcessLookupError, IndexError):
                pass
            try:
                rest = run.communicate(timeout=100)[0]
            except subprocess.TimeoutExpired:
                run.kill()
                fail(f"the run does not stop:\n{''.join(lines)}")
        for _ in range(100):
            if not any(map(is_running, processes)):
                break
            time.sleep(0.1)
        check(not any(map(is_running, processes)), "ranks keep running")
        return "".join(lines) + rest, run.returncode


def make_plate(folder, nodes=9000):
    folder.mesh("--shape", "plate", "--length", 0.3, "--width", 0.21, "--thickness", 0.01, "--nodes", nodes, "--order", 2, "-o", "body.msh")


def stops(folder):
    """Stopped early, halfway and late, on 1, 2, 3 ranks in turn, and resumed on others."""
    make_plate(folder)
    body = Body(folder, band_hz=[20, 45000])
    print(f"{len(body.expected)} modes, {body.seconds:.1f} s")
    was_stopped = 0
    for number, (ranks, line, delay_s, then) in enumerate(
        (
            (1, "read ", 0.0, 2),
            (2, "assemble", 0.0, 3),
            (3, "counting the modes", 0.0, 1),
            (2, "factorising", 0.1, 1),
            (1, "factorising", 0.5, 3),
            (2, "0 of", 0.2, 2),
            (3, "0 of", 0.8, 2),
            (1, "residuals and orth", 0.0, 2),
            (2, "errors ", 0.0, 1),
        )
    ):
        text, code = body.stop(ranks, line, delay_s)
        name = f"{ranks} ranks, {delay_s} s after '{line}'"
        check(code in (STOPPED, 0), f"{name}: exit code {code}:\n{text}")
        if code == 0:  # finished before the signal
            check_bank(folder, "out.bank", body.expected, name)
            (folder / "out.bank").unlink()
            continue
        was_stopped += 1
        check(text.count("stopped by SIGUSR1") == 1, f"{name}:\n{text}")
        check(not (folder / "out.bank").exists(), f"{name}: there is a bank")
        has_saved = (folder / "state").exists()
        resumed, worst = body.resume(then, f"{name}, then {then}")
        check(not has_saved or "resumes from state" in resumed, f"{name}: the checkpoint was not used:\n{resumed}")
        check("warning" not in heed(resumed), resumed)
        print(f"{name}, then {then}: {'resumed' if has_saved else 'from the start'}, frequencies equal to {worst:.1e}")
    check(was_stopped >= 6, f"only {was_stopped} runs were stopped")
    # Several interruptions until the bank is complete, on all numbers of ranks; a single process without mpirun, by SIGTERM.
    for turn in range(4):
        text, code = body.stop(1 + turn % 3, "modes     ", 0.1 + 0.1 * turn)
        check(code in (STOPPED, 0), text)
        if code == 0:  # the rest took less than that
            check_bank(folder, "out.bank", body.expected, f"stop {turn + 1} of four")
            (folder / "out.bank").unlink()
    if code == STOPPED:
        body.resume(2, "after four stops")
    with subprocess.Popen(
        [folder.bin / "carillon-precompute", "job.json", "--checkpoint", "state"],
        cwd=folder.path,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as run:
        said = ""
        for line in run.stdout:
            said += line
            if re.search("[0-9] of [0-9]+ modes", line):
                break
        run.terminate()
        said += run.communicate(timeout=100)[0]
    check(run.returncode == STOPPED and "stopped by SIGTERM" in said, f"exit code {run.returncode}:\n{said}")
    check((folder / "state").exists(), "nothing was saved")
    body.resume(2, "after SIGTERM")


def slices(folder):
    """More modes than one slice: stopped in the first, between slices, and in the last."""
    folder.mesh("--shape", "bar", "--length", 0.2, "--width", 0.1, "--thickness", 0.1, "--nodes", 3500, "--order", 1, "-o", "body.msh")
    body = Body(folder, element="T4", band_hz=[20, 110000], ranks=2)
    check(len(body.expected) > 420, f"{len(body.expected)} modes fit into one slice")
    print(f"{len(body.expected)} modes, {body.seconds:.1f} s")
    stops_made = 0
    for ranks, line in ((1, r" 0 of"), (2, r"[1-9]\d* of"), (3, r"[3-7]\d\d of"), (1, r"[5-7]\d\d of"), (2, r"[67]\d\d of")):
        text, code = body.stop(ranks, line, 0.0)
        check(code in (STOPPED, 0), text)
        check("warning" not in heed(text), text)
        if code == 0:
            break
        stops_made += 1
    print(f"{stops_made} stops")
    if code == 0:
        check_bank(folder, "out.bank", body.expected, "slices")
    else:
        body.resume(2, "slices")
    check(stops_made >= 3, "the run was stopped too seldom")


def kills(folder):
    """kill -9 at any moment while it is saved again and again, on changing numbers of ranks."""
    make_plate(folder)
    body = Body(folder, band_hz=[20, 45000])
    generator = random.Random(9)
    used = 0
    for turn in range(8):
        ranks = 1 + turn % 3
        text, code = body.stop(
            ranks,
            "modes     ",
            generator.uniform(0.0, 0.8 * body.seconds),
            signal.SIGKILL,
            generator.randrange(ranks),
            "--checkpoint-every",
            0.2,
        )
        check("warning" not in heed(text), f"a killed run left what the next one could not use:\n{text}")
        used += "resumes from state" in text
        if code == 0:
            check_bank(folder, "out.bank", body.expected, f"turn {turn}")
            (folder / "out.bank").unlink()
    print(f"{used} of 8 runs resumed from what a killed one had saved")
    check(used >= 3, "checkpoints were hardly used")
    body.resume(2, "after all kills")


def catch_checkpoint(folder, body):
    """The largest checkpoint seen during a run; empty if none was seen."""
    with subprocess.Popen(
        body.command(1, "--checkpoint-every", 0), cwd=folder.path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as run:
        whole = b""
        while run.poll() is None:
            try:
                seen = (folder / "state").read_bytes()
                whole = seen if len(seen) > len(whole) else whole
            except OSError:
                pass
        check(run.returncode == 0, run.stdout.read())
    return whole


def damage(folder):
    """Truncated, altered, of another job, mesh or program, or another kind of file: one line of warning, and the bank is right."""
    folder.mesh("--shape", "plate", "--length", 0.3, "--width", 0.21, "--thickness", 0.02, "--nodes", 1500, "--order", 2, "-o", "body.msh")
    body = Body(folder, band_hz=[20, 30000])
    whole = b""
    for _ in range(20):  # the solve is short; on a busy machine a checkpoint may appear and vanish between two polls
        seen = catch_checkpoint(folder, body)
        whole = seen if len(seen) > len(whole) else whole
        (folder / "out.bank").unlink()
        if len(whole) > 100000:
            break
    check(len(whole) > 100000, "no checkpoint was seen")
    (folder / "state").write_bytes(whole)
    text, _ = body.resume(3, "whole")
    check("resumes from" in text and "warning" not in heed(text), text)
    generator = random.Random(3)
    cases = [("cut", length) for length in (0, 1, 24, 255, 256, 257, 4095, 4096, len(whole) - 1, *generator.sample(range(len(whole)), 6))]
    cases += [
        ("flipped", place)
        for place in (
            0,
            30,
            40,
            70,
            100,
            161,
            170,
            178,
            186,
            194,
            202,
            215,
            230,
            260,
            300,
            4000,
            len(whole) - 1,
            *generator.sample(range(len(whole)), 10),
        )
    ]
    silent = 0
    for kind, place in cases:
        if kind == "cut":
            spoilt = whole[:place]
        else:
            spoilt = bytearray(whole)
            spoilt[place] ^= 1 << generator.randrange(8)
        (folder / "state").write_bytes(spoilt)
        text, _ = body.resume(1, f"{kind} at {place}")
        said = text.count("warning: state: the checkpoint is not resumed from, because")
        check(said <= 1 and heed(text).count("warning") == said, text)
        silent += said == 0
        check(said == 1 or (kind == "flipped" and place < 4096), f"{kind} at {place}: nothing was said:\n{text}")
        if said:
            check((folder / "state.aside").read_bytes() == bytes(spoilt), "it was not set aside")
    check(silent <= 1, f"{silent} flipped bytes were not seen")  # one may lie in the padding before the columns
    # Two ranks, with damage in the part read by the second only.
    spoilt = bytearray(whole)
    spoilt[-5] ^= 64
    (folder / "state").write_bytes(spoilt)
    text, _ = body.resume(2, "damage of the second rank")
    check("because it is damaged" in text, text)
    # Checkpoint of another job, mesh, program.
    for change, words in ((dict(band_hz=[20, 29000]), "another job"), (dict(band_hz=[20, 30000], mass="lumped"), "another job")):
        other = Body(folder, name="other.json", **change)
        (folder / "state").write_bytes(whole)
        text, _ = other.resume(2, words)
        check(f"because it is of {words}" in text, text)
    folder.mesh("--shape", "plate", "--length", 0.3, "--width", 0.21, "--thickness", 0.021, "--nodes", 1500, "--order", 2, "-o", "body.msh")
    other = Body(folder, band_hz=[20, 30000])
    (folder / "state").write_bytes(whole)
    text, _ = other.resume(2, "another mesh")
    check("because it is of another mesh" in text, text)
    # Not a regular file.
    (folder / "state").mkdir()
    text, code = folder.run(2, command=body.command(2))
    check(code == 2 and text.count("carillon-precompute: error:") == 1, text)
    (folder / "state").rmdir()
    os.mkfifo(folder / "state")
    text, code = folder.run(2, command=body.command(2))
    check(code == 2 and text.count("carillon-precompute: error:") == 1, text)
    (folder / "state").unlink()
    for name in ("body.msh", "job.json", "out.bank"):
        command = body.command(2)
        command[-1] = name
        before = (folder / name).read_bytes() if (folder / name).exists() else None
        text, code = folder.run(2, command=command)
        check(code == 2 and "would overwrite" in text, text)
        check(before is None or (folder / name).read_bytes() == before, f"{name} was touched")


def disk(folder):
    """Disk full: a warning, the older checkpoint stays, the solve continues."""
    make_plate(folder)
    body = Body(folder, band_hz=[20, 45000])
    limit = 16_000_000  # bytes: more than the bank and MPI's own files, less than the basis
    for ranks in (1, 2):
        command = body.command(ranks, "--checkpoint-every", 0)
        at = command.index(str(folder.bin / "carillon-precompute"))
        text, code = folder.run(ranks, command=[*command[:at], "prlimit", f"--fsize={limit}", *command[at:]], timeout_s=200)
        check(code == 0, f"exit code {code}:\n{text}")
        check(text.count("the checkpoint cannot be saved") >= 1, text)
        check_bank(folder, "out.bank", body.expected, "limit")
        check(not list(folder.path.glob(".*.new")), "a temporary file stays")
        (folder / "out.bank").unlink()
    small = folder / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", small], stderr=subprocess.DEVNULL).returncode != 0:
        print("no disk of 2 MB can be mounted here: the limit on files stood in for it")
        return
    try:
        for ranks in (1, 2):
            command = body.command(ranks, "--checkpoint-every", 0)
            command[command.index("state")] = "small/state"
            text, code = folder.run(ranks, command=command, timeout_s=200)
            check(code == 0 and "the checkpoint cannot be saved" in text, f"exit code {code}:\n{text}")
            check_bank(folder, "out.bank", body.expected, "full disk")
            (folder / "out.bank").unlink()
            check(not list(small.iterdir()), f"{list(small.iterdir())} stays")
    finally:
        subprocess.run(["umount", small])


def replaced(folder):
    """A user with write access to the folder replaces the temporary file by a link: its target is not written."""
    folder.mesh("--shape", "plate", "--length", 0.3, "--width", 0.21, "--thickness", 0.02, "--nodes", 1500, "--order", 2, "-o", "body.msh")
    body = Body(folder, band_hz=[20, 30000])
    victim = folder / "victim"
    victim.write_text("important")
    for ranks in (1, 2, 3):
        command = [
            "env",
            f"LD_PRELOAD={folder.bin / 'replace_name.so'}",
            f"CARILLON_TEST_VICTIM={victim}",
            *body.command(ranks, "--checkpoint-every", 0),
        ]
        text, code = folder.run(ranks, command=command, timeout_s=200)
        check(victim.read_text() == "important", f"{ranks} ranks wrote through the link:\n{text}")
        check(code == 0 and "the checkpoint cannot be saved: " in text, f"exit code {code}:\n{text}")
        check((folder / ".state.new.taken").exists(), "nothing was replaced")
        check(not os.path.lexists(folder / "state") and not os.path.lexists(folder / ".state.new"), "a link stays")
        check_bank(folder, "out.bank", body.expected, f"{ranks} ranks")
        (folder / "out.bank").unlink()
        (folder / ".state.new.taken").unlink()
    # A pre-existing link is not a checkpoint; one in place of the temporary file is removed.
    for name in ("state", ".state.new"):
        (folder / name).symlink_to(victim)
        text, code = folder.run(2, command=body.command(2, "--checkpoint-every", 0), timeout_s=200)
        check(code == 0 and victim.read_text() == "important", f"exit code {code}:\n{text}")
        check_bank(folder, "out.bank", body.expected, name)
        (folder / "out.bank").unlink()


def accuracy(folder):
    """With "accuracy_cents" a run resumes the trial in which it was stopped."""
    job = {
        "body": {"shape": "plate", "length_m": 0.3, "width_m": 0.21, "thickness_m": 0.02},
        "bank": "out.bank",
        "band_hz": [20, 12000],
        "accuracy_cents": 10,
        "material": {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}},
    }
    body = Body.__new__(Body)
    body.folder, body.job = folder, "job.json"
    (folder / "job.json").write_text(json.dumps(job))
    text, code = folder.run(1, timeout_s=200)
    check(code == 0, text)
    trials = text.count("assemble ")
    check(trials >= 2, text)
    body.expected = read_frequencies(folder, "out.bank")
    (folder / "out.bank").unlink()
    with subprocess.Popen(
        body.command(2, "--checkpoint-every", 0), cwd=folder.path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as run:
        said, seen = "", 0
        for line in run.stdout:
            said += line
            seen += line.startswith("assemble ")
            if seen == trials and re.search("[0-9] of [0-9]+ modes", line):
                break
        run.send_signal(signal.SIGUSR1)
        said += run.communicate(timeout=100)[0]
    check(run.returncode in (STOPPED, 0), said)
    if run.returncode == STOPPED:
        text, worst = body.resume(1, "accuracy")
        check("resumes from state" in text and "warning" not in heed(text), text)
        print(f"stopped in trial {seen} of {trials}; frequencies equal to {worst:.1e}")


case = sys.argv[2]
globals()[case](Folder(sys.argv[1]))
