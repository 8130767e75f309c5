#!/usr/bin/python3
"""Spectrogram of carillon-simulate: visible line, identical bytes with any other outputs and number of ranks, refused file names.

usage: picture.py BIN_DIR
"""
import json
import pathlib
import sys
import tempfile

from jobs import find_peak_hz, make_bar, run, write_job

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "draw"))
from read_picture import read_png

# Where the levels are in the picture, and its frequencies from the lowest row to the top (runtime/render/sound/spectrogram.hpp).
LEFT, TOP, WIDTH, HEIGHT, LOWEST_HZ, HIGHEST_HZ = 112, 190, 1140, 620, 50, 24000


def check_refused(folder, job, *words, says):
    write_job(folder / "job.json", job)
    before = sorted(path.name for path in folder.iterdir())
    done = run(folder, "job.json", *words)
    assert done.returncode == 2 and "element" not in done.stdout, done
    assert done.stderr.count("error:") == 1 and all(word in done.stderr for word in says), done
    assert sorted(path.name for path in folder.iterdir()) == before, "a refused job leaves files"


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    job = make_bar(0.04, "T4") | {"spectrogram": "bar.png"}
    write_job(folder / "job.json", job)
    done = run(folder, "job.json")
    assert done.returncode == 0 and done.stderr == "" and "/bar.png\n" in done.stdout, done
    image = read_png(folder / "bar.png")
    assert image.shape == (900, 1400, 3), image.shape
    level = image[TOP : TOP + HEIGHT, LEFT : LEFT + WIDTH].astype(int).sum(axis=2)
    column = level[:, WIDTH // 2]
    row = (column == column.max()).nonzero()[0].mean()  # a short window has a broad line, of one colour over some rows
    low, high = (LOWEST_HZ * (HIGHEST_HZ / LOWEST_HZ) ** ((HEIGHT - y) / HEIGHT) for y in (row + 1, row))
    # Its window: at most a tenth of the sound, 128 of 1,920 samples, about the middle.
    half_s = 64 / 48000
    wanted = find_peak_hz(folder / "bar.wav", 500, 3000, 0.02 - half_s, 0.02 + half_s)
    print(f"the brightest row is {low:.1f} to {high:.1f} Hz; the line of the sound is at {wanted:.1f} Hz")
    # A row shows the bins that it covers, of which one has 48000 / 2048 Hz.
    assert low - 24 < wanted < high + 24, (low, wanted, high)

    # Next to a sound, alone under another name, on two ranks.
    job = make_bar(0.005, "T4") | {"spectrogram": "bar.png"}
    alone = {key: value for key, value in job.items() if key not in ("sound", "record")}
    pictures = []
    for one, words, name, ranks in (
        (job, [], "bar.png", 1),
        (alone | {"spectrogram": "other.png"}, [], "other.png", 1),
        (alone, ["--spectrogram", "two.png"], "two.png", 2),
    ):
        write_job(folder / "job.json", one)
        done = run(folder, "-q", "job.json", *words, ranks=ranks)
        assert done.returncode == 0 and done.stderr == "", done
        pictures.append((folder / name).read_bytes())
    assert pictures[0] == pictures[1] == pictures[2], "the picture depends on what else is written, or on ranks"

    for words in ([], ["--validate"]):
        check_refused(folder, job | {"spectrogram": "bar.wav"}, *words, says=["job.json:", "spectrogram", "would overwrite"])
    check_refused(folder, job | {"spectrogram": ""}, says=["job.json:", "spectrogram"])
    check_refused(folder, job, "--spectrogram", "job.json", says=["job.json", "spectrogram would overwrite"])
    (folder / "file").write_text("no folder")
    check_refused(folder, job | {"spectrogram": "file/bar.png"}, says=["file", "spectrogram", "folder"])

    # The prediction includes the memory for drawing.
    need = []
    for one in (job, {key: value for key, value in job.items() if key != "spectrogram"}):
        write_job(folder / "job.json", one)
        done = run(folder, "--validate", "--json", "job.json")
        need.append(json.loads(done.stdout)["memory_bytes"]["1"])
    assert need[0] - need[1] > 15e6, need
