#!/usr/bin/python3
"""Memory predicted by carillon-simulate --validate against the peak of the run, and a mesh too large for --patience.

usage: predict.py BIN_DIR
"""
import json
import os
import pathlib
import subprocess
import tempfile

from jobs import list_words, make_bar, make_plate, run, write_job


def measure_bytes(folder, *words):
    """Peak memory of a run."""
    process = subprocess.Popen(list_words(1, "-q", "job.json", *words), cwd=folder, stdin=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0, status
    return 1024 * used.ru_maxrss


def predict(folder, *words):
    done = run(folder, "--validate", "--json", "job.json", *words)
    assert done.returncode == 0, done
    return json.loads(done.stdout)


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    thick = make_bar(0.4, "T4")
    thick["simulate"]["bodies"][0]["shape"] = {"bar": {"length_m": 0.4, "width_m": 0.2, "thickness_m": 0.2, "nodes": 40}}
    thick["simulate"]["impulses"][0]["point_m"] = [0.2, 0, 0.1]
    thick["simulate"] |= {"sample_rate_hz": 192000, "microphones": [[0, 0.01 * m, 0.5] for m in range(16)]}
    fine = make_bar(0.0005)
    fine["simulate"]["bodies"][0]["shape"]["bar"]["nodes"] = 10000
    fine["simulate"]["impulses"] = []
    fine["simulate"]["bodies"][0]["velocity_m_s"] = [0, 0, 1]
    everything = {"spectrogram": "bar.png", "motion": "bar.vtkhdf", "surface": "bar.surface"}
    said = {}
    for name, job, words in (
        ("sixteen microphones", thick, []),
        ("and a checkpoint", thick, ["--checkpoint", "state"]),
        ("all files", make_bar(0.02) | everything, []),
        ("many nodes", fine, []),
        ("a sheet", make_plate("fixed", 16, 0.02), []),
    ):
        write_job(folder / "job.json", job)
        said[name] = predict(folder, *words)
        saves = ["--checkpoint-every", "0.1"] if words else []
        took = measure_bytes(folder, *words, *saves)
        memory = said[name]["memory_bytes_a_rank"]
        print(f"{name}: {memory / 1e6:.0f} MB said, {took / 1e6:.0f} MB taken")
        assert took <= memory < 3 * took + 100e6, (name, memory, took)
        assert said[name]["memory_bytes"]["1"] == memory, said[name]
    # The time includes the sound, most of it for such a small body.
    assert said["sixteen microphones"]["sound_cpu_seconds"] > 0.3 * said["sixteen microphones"]["cpu_seconds"], said

    # Five million nodes: scaled from a coarser mesh.
    fine["simulate"]["bodies"][0]["shape"]["bar"]["nodes"] = 5000000
    write_job(folder / "job.json", fine)
    large = predict(folder, "--patience", "1")
    assert 2.5e6 < large["nodes"] < 1e7 and "--patience" in large["note"], large
    assert large["memory_bytes_a_rank"] > 1e9 and large["step_s"] < 0.3 * said["many nodes"]["step_s"], large
    (folder / "mesh.msh").write_bytes(b" " * 20000000)
    fine["simulate"]["bodies"][0] |= {"mesh": "mesh.msh"}
    del fine["simulate"]["bodies"][0]["shape"]
    write_job(folder / "job.json", fine)
    done = run(folder, "--validate", "job.json", "--patience", "1")
    assert done.returncode == 2 and "--patience 10 or more" in done.stderr and "job.json:" in done.stderr, done
    # --patience is an option of --validate alone.
    done = run(folder, "job.json", "--patience", "1")
    assert done.returncode == 2 and "--validate" in done.stderr, done
