#!/usr/bin/python3
"""Runs the demo's main job with coarse meshes and looks at what it leaves: words of the table, banks, sound, pictures.

usage: demo.py SOURCE_DIR BIN_DIR WORK_DIR
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import wave

import numpy

source, bin_dir, work = (pathlib.Path(word) for word in sys.argv[1:4])
shutil.rmtree(work, ignore_errors=True)
run = subprocess.run(
    [source / "deploy/chute/run", "--bin", bin_dir, "--out", work, "--quick"], capture_output=True, text=True, stdin=subprocess.DEVNULL
)
print(run.stdout[-6000:], run.stderr[-2000:])
assert run.returncode == 0, run.returncode
for words in (
    "855.9 Hz",
    "19.5 1/s",
    "real time",
    "peak memory",
    "first five frequencies",
    "bunny_t4",
    "bunny_t10",
    "shelf_wood",
    "chute.wav",
    "T4, lumped mass",
):
    assert words in run.stdout, words
ours = [float(hz) for hz in re.findall(r"^  ours, .*?([0-9.]+) Hz", run.stdout, re.M)]
corrected = [float(hz) for hz in re.findall(r"^        corrected for its mesh +([0-9.]+) Hz", run.stdout, re.M)]
assert len(ours) == 2 and 700 < ours[1] < ours[0] < 1400, ours  # coarse T4 is stiffer than coarse T10
# Stated frequencies are those played, not the mesh's; the base frequency is repeated at the end.
info = [
    json.loads(
        subprocess.run([bin_dir / "carillon-bank", "info", "--json", work / f"bunny_{kind}.hdf"], check=True, capture_output=True).stdout
    )
    for kind in ("t4", "t10")
]
heard = [min(mode["heard"]["frequency_hz"] for mode in bank["modes"]) for bank in info]
assert len(corrected) == 2 and all(abs(said - hz) < 0.06 for said, hz in zip(corrected, heard)), (corrected, heard)
assert abs(min(info[1]["corrected_frequencies_hz"]) - heard[1]) < 1e-6 and abs(ours[1] - heard[1]) > 0.5, (ours, heard)
assert f"{heard[1]:.1f} Hz, played; by T4" in run.stdout[-400:], run.stdout[-400:]

with wave.open(str(work / "chute.wav")) as sound:
    assert (sound.getnchannels(), sound.getframerate(), sound.getsampwidth()) == (2, 48000, 3), sound.getparams()
    raw = numpy.frombuffer(sound.readframes(sound.getnframes()), dtype=numpy.uint8).reshape(-1, 2, 3)
samples = (
    (raw[..., 0].astype(numpy.int32) << 8 | raw[..., 1].astype(numpy.int32) << 16 | raw[..., 2].astype(numpy.int32) << 24) >> 8
) / 2.0**23
assert len(samples) == 6 * 48000, len(samples)
assert abs(20 * numpy.log10(abs(samples).max()) + 1.0) < 0.01, abs(samples).max()  # the peak stands at -1 dBFS: loud, and not clipped
assert abs(samples).max(axis=0).min() > 0.1, "both ears hear it"
report = json.loads((work / "chute-report.json").read_text())
struck = {body["name"]: body["impulses"] for body in report["per_body"]}
assert all(count > 0 for count in struck.values()) and len(struck) == 7, struck  # all seven bodies sound
trajectory = json.loads((work / "chute-trajectory.json").read_text())
names = [body["name"] for body in trajectory["bodies"]]
pairs = {tuple(sorted((names[hit["body"]], names[hit["other"]]))) for hit in trajectory["impulses"] if hit["other"] >= 0}
meet = {pair for pair in pairs if all(name.startswith("bunny") for name in pair)}
assert len({name for pair in meet for name in pair}) == 4, meet  # every bunny strikes another one
assert {name for pair in pairs for name in pair if name.endswith("shelf")} == set(names[4:]), pairs
# The shelves end as shelves on a wall do, and not after a minute; every mode decays faster than its material makes it.
for body in report["per_body"]:
    if not body["name"].endswith("shelf"):
        assert "supports" not in body, body["name"]
        continue
    supports = body["supports"]
    assert "y-max on brick wall, screwed" in supports["text"], supports["text"]
    assert all(after > before for after, before in zip(supports["decay_per_s"], supports["decay_before_per_s"])), body["name"]
    if body["name"] == "aluminium shelf":
        before, now = (numpy.log(1000) / supports[key][0] for key in ("decay_before_per_s", "decay_per_s"))
        print(f"aluminium shelf: {supports['frequencies_hz'][0]:.1f} Hz, T60 {now:.2f} s instead of {before:.1f} s")
        assert before > 60 and 0.8 < now < 2.5, (before, now)
for picture in ("chute-spectrogram.png", "bunny-modes.png", "chute-path.png"):
    bytes_ = (work / picture).read_bytes()
    assert bytes_[:8] == b"\x89PNG\r\n\x1a\n" and len(bytes_) > 30000, picture

# The books of energy of the same scene: nothing gains any between hits.
subprocess.run(
    [bin_dir / "carillon-render", "scene.json", "-o", "audited.wav", "--report", "audited.json", "--audit", "--quiet"], cwd=work, check=True
)
energy = json.loads((work / "audited.json").read_text())["energy"]
print(energy)
gained = max(energy["rise_j"], energy["hit_rise_j"])
assert energy["largest_kinetic_j"] > 0.1 and gained <= 1e-7 * energy["largest_kinetic_j"] + 1e-9 * energy["weight_n"], energy
assert energy["modes_rise"] <= 1e-9, energy
assert abs(energy["difference_j"]) < 1e-3 * energy["start_j"], energy  # conservation of energy
assert (work / "audited.wav").read_bytes() == (work / "chute.wav").read_bytes(), "keeping books changed the sound"
