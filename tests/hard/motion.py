#!/usr/bin/env python3
"""Hard cases of carillon-simulate: files in, exit code, words and sound out. The truth is an assembly by numpy (elastic.py), a closed form,
or the same run on another number of ranks.

usage: motion.py CASE
"""
import json
import re
import sys

import numpy as np
import scipy.linalg

import elastic
import solids
from figure import hold, hold_refusal
from programs import Folder

PLASTIC = {
    "young_modulus_pa": 1e8,
    "poisson_ratio": 0.3,
    "density_kg_m3": 1100,
    "damping": {"rayleigh": {"alpha1_s": 0, "alpha2_per_s": 0}},
}
BOX = {"bar": {"length_m": 0.06, "width_m": 0.02, "thickness_m": 0.02, "nodes": 40}}


def simulate(folder, name, ranks=1, **keys):
    """The Outcome of a job, and its record where it ended well."""
    (folder.path / f"{name}.json").write_text(json.dumps({"simulate": keys, "sound": f"{name}.wav", "record": f"{name}.record.json"}))
    outcome = folder.run(ranks, "carillon-simulate", "-q", f"{name}.json")
    if outcome.code == 0:
        outcome.record = json.loads((folder.path / f"{name}.record.json").read_text())
    return outcome


def find_error(outcome, code):
    """The one line of error of a run that must fail."""
    assert outcome.code == code, f"exit code {outcome.code}: {outcome.text[-1500:]}"
    (line,) = [line for line in outcome.text.splitlines() if "error:" in line]
    return line


def find_longest_step_s(solid, held):
    """2 / omega of the fastest motion of linear tetrahedra with lumped mass."""
    stiffness, mass = elastic.assemble(solid, elastic.isotropic(1e8, 0.3), 1100, lumped=True)
    free = np.setdiff1d(np.arange(stiffness.shape[0]), (3 * np.asarray(held)[:, None] + np.arange(3)).ravel())
    scale = 1 / np.sqrt(mass.diagonal()[free])
    dense = stiffness.toarray()[np.ix_(free, free)] * scale[:, None] * scale
    return 2 / np.sqrt(scipy.linalg.eigvalsh(dense, subset_by_index=[len(free) - 1] * 2)[0])


def sliver():
    """One cap in a box: flat, it would set the step for all and is refused by its number; less flat, it sets the step, which holds."""
    box = solids.make_box([4, 2, 2], [0.04, 0.02, 0.02])
    held = np.flatnonzero(box.nodes[:, 0] < 1e-9)
    group = [{"box_m": {"min": [-1e-6, -1, -1], "max": [1e-6, 1, 1]}}]
    blow = {"time_s": 1e-3, "body": "box", "point_m": [0.04, 0.01, 0.01], "impulse_n_s": [1e-5, 0, -1e-5]}
    inside = int(np.argmin(np.linalg.norm(box.corners().mean(1) - [0.025, 0.01, 0.01], axis=1)))
    for height, is_refused in ((1e-3, True), (0.02, True), (0.3, False)):
        spoilt = solids.orient(solids.make_caps(box, [inside], height))
        with Folder() as folder:
            spoilt.write(folder.path / "box.msh")
            body = {"name": "box", "mesh": "box.msh", "element": "T4", "material": PLASTIC, "fixed": group}
            outcome = simulate(folder, "cap", duration_s=0.01, bodies=[body], impulses=[blow])
            part = f"cap of {height:g} of its height"
            if is_refused:
                line = find_error(outcome, 2)
                hold_refusal("sliver", line, ["body 'box'", "is a sliver: it allows a step of", "mesh"], part)
                named = int(re.search(r"element (\d+)", line)[1])
                # The cap itself is the flattest of all.
                flattest = int(np.argmin(spoilt.volumes())) + 1
                hold("sliver", abs(named - flattest), 0, f"{part}, elements between the one named and the flattest")
                assert folder.list() == ["box.msh", "cap.json"], folder.list()
            else:
                assert outcome.code == 0, outcome.text
                hold("sliver", outcome.record["step_s"] / find_longest_step_s(spoilt, held), 0.95, f"{part}, step over the limit by numpy")
                hold("sliver", outcome.record["book_error"], 1e-6, f"{part}, energy book")


def inversion():
    """A bar is driven together until an element turns inside out: before its length is gone the run ends in words, the same on two ranks,
    and leaves nothing."""
    seconds, way, length = 2e-3, 0.07, 0.06
    body = {"name": "bar", "shape": BOX, "element": "T4", "material": PLASTIC, "fixed": "x-min"}
    body["drive"] = [{"node_set": "x-max", "path": [[0, 0, 0, 0], [seconds, -way, 0, 0]]}]
    lines = []
    for ranks in (1, 2):
        with Folder() as folder:
            line = find_error(simulate(folder, "bar", ranks, duration_s=3e-3, bodies=[body]), 3)
            assert folder.list() == ["bar.json"], folder.list()
        hold_refusal(
            "inversion", line, ["body 'bar', element ", "is turned inside out at ", " s, step ", "weaker blow"], f"{ranks} ranks", ranks
        )
        lines.append(line)
    hold("inversion", lines[0] != lines[1], 0, "words that differ on two ranks")
    # The path is 10 x^3 - 15 x^4 + 6 x^5 of the way; at the latest an element is inside out when all of the length is.
    x = np.linspace(0, 1, 100001)
    gone = seconds * x[np.argmax(way * (10 * x**3 - 15 * x**4 + 6 * x**5) > length)]
    hold(
        "inversion",
        float(re.search(r"inside out at ([0-9.e-]+) s", lines[0])[1]) / gone,
        1,
        "time at the end over that when no length is left",
    )


def same_bytes():
    """Two bars and a ball bounce on each other and on the floor, for 100,000 steps, on one, two and four ranks."""
    block = {"bar": {"length_m": 0.02, "width_m": 0.01, "thickness_m": 0.01, "nodes": 20}}
    material = PLASTIC | {"young_modulus_pa": 1e9, "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 1}}}
    bodies = [
        {"name": name, "shape": block, "element": "T4", "material": material, "position_m": place, "velocity_m_s": [0, 0, -1]}
        for name, place in (("lower", [0, 0, 0.0055]), ("upper", [0.003, 0.001, 0.0165]))
    ]
    ball = {"sphere_m": 0.004, "mass_kg": 2e-3, "position_m": [0.004, 0, 0.027], "velocity_m_s": [0, 0, -1]}
    world = {"gravity_m_s2": [0, 0, -9.81], "obstacles": [{"plane": {"point_m": [0, 0, 0], "normal": [0, 0, 1]}}], "strikers": [ball]}
    sounds, steps = [], []
    for ranks in (1, 2, 4):
        with Folder() as folder:
            outcome = simulate(folder, "blocks", ranks, duration_s=0.1, step_s=1e-6, bodies=bodies, microphones=[[0, 0, 0.5]], **world)
            assert outcome.code == 0, outcome.text
            assert outcome.record["ranks"] == ranks
            steps.append(outcome.record["steps"])
            sounds.append((folder.path / "blocks.wav").read_bytes())
            hold("same_bytes", outcome.record["book_error"], 1e-5, f"energy book on {ranks} ranks", ranks)
    assert min(steps) >= 100000 and np.frombuffer(sounds[0][-4000:], "<f4").any(), steps
    for ranks, sound in zip((2, 4), sounds[1:]):
        hold(
            "same_bytes",
            len(sound) != len(sounds[0]) or sum(a != b for a, b in zip(sound, sounds[0])),
            0,
            f"bytes that differ on {ranks} ranks",
            ranks,
        )


if __name__ == "__main__":
    globals()[sys.argv[1]]()
