#!/usr/bin/python3
"""Jobs that cannot be simulated: exit code 2, one error that names file and line, and no file more than before.

usage: refusals.py BIN_DIR
"""
import copy
import pathlib
import tempfile

from jobs import make_bar, make_plate, run, write_job


def change(**keys):
    return lambda job: job["simulate"].update(keys)


def change_body(**keys):
    return lambda job: job["simulate"]["bodies"][0].update(keys)


def change_material(**keys):
    return lambda job: job["simulate"]["bodies"][0]["material"].update(keys)


def drive(*rows, node_set="x-max"):
    return change_body(drive=[{"node_set": node_set, "path": list(rows)}])


def strip(job):
    del job["sound"], job["record"]


def shift_blow(job):
    job["simulate"]["impulses"][0]["point_m"] = [0, 0, 1]


def misspell_blow(job):
    job["simulate"]["impulses"][0]["body"] = "bra"


def double(job):
    job["simulate"]["bodies"].append(copy.deepcopy(job["simulate"]["bodies"][0]))


BALL = {"sphere_m": 0.01, "mass_kg": 0.1, "position_m": [0, 0, 0.012]}
SHEET = make_plate("fixed")["simulate"]["bodies"][0]["sheet"]
# name: (change, words, whether the message names a line)
BAD = {
    "unknown key": (change(duraton_s=1), "did you mean", True),
    "overlapping striker": (change(strikers=[BALL]), "deep in body", True),
    "overlapping floor": (change(obstacles=[{"plane": {"point_m": [0, 0, 0]}}]), "deep in obstacle", True),
    "faster than sound": (drive([0, 0, 0, 0], [0.001, 0, 0, 1]), "faster than sound", True),
    "path that does not begin at rest": (drive([0, 0, 0, 1], [0.1, 0, 0, 1]), "[t, 0, 0, 0]", True),
    "fixed and driven": (drive([0, 0, 0, 0], [0.1, 0, 0, 0.001], node_set="x-min"), "follows a path", True),
    "negative modulus": (change_material(young_modulus_pa=-1), "greater than 0", True),
    "no such node set": (change_body(fixed="x-mim"), "did you mean 'x-min'", True),
    "empty box": (change_body(fixed=[{"box_m": {"min": [9, 9, 9], "max": [9, 9, 9]}}]), "no node lies in the box", True),
    "no output": (strip, "nothing is to be written", False),
    "unknown body": (misspell_blow, 'did you mean "bar"', True),
    "blow in the air": (shift_blow, "from the surface", True),
    "two of a name": (double, "two bodies", True),
    "sheet and shape": (change_body(sheet=SHEET), "give one", True),
    "element of a sheet": (lambda job: (job["simulate"]["bodies"][0].pop("shape"), change_body(sheet=SHEET)(job)), "for solids", True),
    "hinged solid": (change_body(hinged="x-max"), "for sheets", True),
    "step of nothing": (change(step_s=0), "out of range", True),
}

with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    for name, (spoil, words, has_line) in BAD.items():
        job = make_bar(0.01)
        spoil(job)
        write_job(folder / "job.json", job)
        for more in ([], ["--validate"]):
            if more and name == "no output":
                continue
            done = run(folder, "-q", "job.json", *more)
            assert done.returncode == 2 and done.stdout == "", f"{name} {more}: {done}"
            errors = [line for line in done.stderr.splitlines() if "carillon-simulate: error:" in line]
            assert len(errors) == 1 and words in errors[0], f"{name}: {done.stderr}"
            place = errors[0].split("job.json:")
            assert len(place) == 2 and place[1].split(":")[0].isdigit() == has_line, f"{name}: {errors[0]}"
        left = [path.name for path in folder.iterdir()]
        assert left == ["job.json"], f"{name}: {left}"

    # Groups that overlap on a sheet, and a step that is longer than stable, which is only a limit.
    job = make_plate("fixed", cells=4, duration_s=0.002)
    job["simulate"]["bodies"][0]["hinged"] = "x-min"
    write_job(folder / "job.json", job)
    done = run(folder, "-q", "job.json")
    assert done.returncode == 2 and "is hinged here" in done.stderr and "job.json:" in done.stderr, done
    del job["simulate"]["bodies"][0]["hinged"]
    del job["simulate"]["impulses"]
    job["simulate"]["step_s"] = 1e-3
    write_job(folder / "job.json", job)
    done = run(folder, "-q", "job.json")
    assert done.returncode == 0, done
