#!/usr/bin/python3
"""Runs stopped by SIGUSR1 or SIGTERM exit with 85; the same command resumes, with output identical to an uninterrupted run.

usage: resume.py BIN_DIR
"""
import os
import pathlib
import signal
import subprocess
import tempfile
import time

from jobs import list_words, make_bar, run, write_job

FILES = ("bar.wav", "bar.vtkhdf", "bar.surface")


def find_ranks(folder):
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            if words[0].endswith(b"carillon-simulate") and os.readlink(entry / "cwd") == str(folder):
                found.append(int(entry.name))
        except OSError:
            pass
    return found


def stop(folder, number, ranks):
    """Starts a run and sends a signal after its second save."""
    words = list_words(ranks, "job.json", "--checkpoint", "state", "--checkpoint-every", "0.2")
    process = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(3000):
        if (folder / "state").exists() or process.poll() is not None:
            break
        time.sleep(0.01)
    if number == signal.SIGUSR1:
        process.send_signal(number)  # mpirun passes it on
    else:
        os.kill(find_ranks(folder)[0], number)
    out, err = process.communicate(timeout=100)
    assert process.returncode == 85, f"{process.returncode}: {out}{err}"
    assert err.count("the same command resumes") == 1, err
    assert (folder / "state").exists() and not any((folder / file).exists() for file in ("bar.wav", "bar.vtkhdf")), list(folder.iterdir())


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch).resolve()
    job = make_bar(0.1) | {"motion": "bar.vtkhdf", "surface": "bar.surface"}
    # It lands on the floor as well.
    job["simulate"]["obstacles"] = [{"plane": {"point_m": [0, 0, -0.00501], "normal": [0, 0, 1]}}]
    job["simulate"]["motion_hz"] = 1000
    write_job(folder / "job.json", job)
    whole = run(folder, "-q", "job.json")
    assert whole.returncode == 0, whole
    wanted = {file: (folder / file).read_bytes() for file in FILES}
    for number, ranks in ((signal.SIGUSR1, 1), (signal.SIGTERM, 1), (signal.SIGUSR1, 2)):
        for file in FILES:
            (folder / file).unlink()
        stop(folder, number, ranks)
        done = run(folder, "job.json", "--checkpoint", "state", ranks=ranks)
        assert done.returncode == 0 and "resumed at" in done.stdout, done
        for file in FILES:
            assert (folder / file).read_bytes() == wanted[file], f"{file} after {number!r} on {ranks} ranks differs"
        assert not (folder / "state").exists(), "the checkpoint stays after the end"
        left = sorted(path.name for path in folder.iterdir())
        assert left == sorted([*FILES, "job.json", "bar.record.json"]), left

    # A checkpoint of another job, and a damaged one.
    for file in FILES:
        (folder / file).unlink()
    stop(folder, signal.SIGUSR1, 1)
    write_job(folder / "job.json", job | {"sound": "other.wav"})
    done = run(folder, "job.json", "--checkpoint", "state")
    assert done.returncode == 2 and "of another job" in done.stderr, done
    state = (folder / "state").read_bytes()
    write_job(folder / "job.json", job)
    middle = len(state) // 2
    flipped = state[:middle] + bytes([state[middle] ^ 1]) + state[middle + 1 :]
    for damaged in (state[:middle], state[:10], flipped, b"no checkpoint " * 100):
        (folder / "state").write_bytes(damaged)
        done = run(folder, "job.json", "--checkpoint", "state")
        assert done.returncode == 2 and done.stderr.count("error:") == 1 and "checkpoint" in done.stderr, done
