#!/usr/bin/python3
"""Energy errors above 1e-6: the step that the program recommends reaches 1e-6. Quadratic convergence, in two scenes.

usage: book.py BIN_DIR
"""
import json
import pathlib
import tempfile

from jobs import STEEL, make_bar, run, write_job

GOAL = 1e-6


def make_ball_on_sheet():
    """A steel ball on a thin steel sheet."""
    sheet = {"shape": "rectangle", "length_m": 0.3, "width_m": 0.3, "thickness_m": 0.0002, "cells": 12}
    ball = {"sphere_m": 0.01, "mass_kg": 0.02, "position_m": [0.01, 0.02, 0.0102], "velocity_m_s": [0, 0, -5]}
    return {
        "simulate": {
            "duration_s": 0.005,
            "bodies": [{"name": "sheet", "sheet": sheet, "material": STEEL, "hinged": "rim"}],
            "strikers": [ball],
        },
        "record": "book.record.json",
    }


def make_bar_on_floor():
    """A bar thrown flat on a floor."""
    job = make_bar(0.003, "T4")
    del job["simulate"]["impulses"], job["simulate"]["bodies"][0]["fixed"], job["sound"]
    job["simulate"]["bodies"][0] |= {"position_m": [0, 0, 0.0052], "velocity_m_s": [0, 0, -20]}
    job["simulate"]["obstacles"] = [{"plane": {"point_m": [0, 0, 0]}}]
    return job | {"record": "book.record.json"}


def simulate(folder, job, step_s=None):
    """The record, and the output lines that recommend a step."""
    job = json.loads(json.dumps(job))
    if step_s:
        job["simulate"]["step_s"] = step_s
    write_job(folder / "job.json", job)
    done = run(folder, "job.json")
    assert done.returncode == 0 and done.stderr == "", done
    record = json.loads((folder / "book.record.json").read_text())
    assert step_s is None or record["step_s"] <= step_s, (record["step_s"], step_s)
    return record, [line for line in done.stdout.splitlines() if "expected to close" in line]


with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    for name, job in (("ball on a sheet", make_ball_on_sheet()), ("bar on a floor", make_bar_on_floor())):
        first, lines = simulate(folder, job)
        assert first["book_error"] > GOAL and 0 < first["closing_step_s"] < first["step_s"], first
        assert len(lines) == 1 and f'"step_s": {first["closing_step_s"]:.2e} ' in lines[0], lines
        quarter, _ = simulate(folder, job, first["step_s"] / 3.99)
        falls = first["book_error"] / quarter["book_error"]
        closed, lines = simulate(folder, job, first["closing_step_s"])
        print(
            f"{name}: {first['book_error']:.2e} at {first['step_s']:.3g} s, a quarter of the step makes it {falls:.1f} times smaller;"
            f" {closed['book_error']:.2e} at {closed['step_s']:.3g} s"
        )
        assert 10 < falls < 30, falls  # 16 by the square; 4 and 64 by the powers next to it
        assert closed["book_error"] < GOAL and closed["closing_step_s"] is None and not lines, (closed, lines)
