#!/usr/bin/python3
"""carillon-simulate ended by a signal or an error: message with the reason, no remaining files except those of a checkpoint.

usage: ends.py BIN_DIR
"""
import os
import pathlib
import signal
import subprocess
import tempfile
import time

from jobs import list_words, make_bar, run, write_job


def list_files(folder):
    return sorted(path.name for path in folder.iterdir())


def stop(folder, number, *words):
    """Sends a signal after the first frame."""
    process = subprocess.Popen(
        list_words(1, "job.json", *words), cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    frames = folder / "bar.vtkhdf.frames"
    while process.poll() is None and not (frames.exists() and frames.stat().st_size > 0):
        time.sleep(0.01)
    process.send_signal(number)
    out, err = process.communicate(timeout=100)
    assert process.returncode == 128 + number, f"{process.returncode}: {out}{err}"
    name = signal.Signals(number).name
    assert err.count(f"carillon-simulate: stopped by {name}; ") == 1 and "precompute" not in err and "bank" not in err, err


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch).resolve()
    os.environ["TMPDIR"] = scratch + "-tmp"  # outside `folder`: holds MPI's own files
    pathlib.Path(os.environ["TMPDIR"]).mkdir()
    job = make_bar(5) | {"motion": "bar.vtkhdf", "surface": "bar.surface", "spectrogram": "bar.png"}
    write_job(folder / "job.json", job)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        stop(folder, number)
        assert list_files(folder) == ["job.json"], (number, list_files(folder))
    # Before the first checkpoint.
    stop(folder, signal.SIGINT, "--checkpoint", "state")
    assert list_files(folder) == ["job.json"], list_files(folder)

    # An error during the run: a blow that inverts elements.
    job["simulate"]["impulses"][0]["impulse_n_s"] = [0, 0, -50]
    write_job(folder / "job.json", job)
    for words in ([], ["--checkpoint", "state"]):
        done = run(folder, "-q", "job.json", *words)
        assert done.returncode == 3 and done.stderr.count("error:") == 1, done
        assert list_files(folder) == ["job.json"], list_files(folder)
    # After a checkpoint its files stay.
    done = run(folder, "-q", "job.json", "--checkpoint", "state", "--checkpoint-every", "0")
    assert done.returncode == 3, done
    assert list_files(folder) == ["bar.surface.part", "bar.vtkhdf.frames", "job.json", "state"], list_files(folder)
    subprocess.run(["rm", "-r", os.environ["TMPDIR"]], check=True)
