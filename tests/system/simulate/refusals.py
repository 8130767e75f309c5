#!/usr/bin/python3
"""An invalid job on one and two ranks: exit code 2, one error with file and line, no output files.
Other refusals: tests/unit/precompute/simulation.

usage: refusals.py BIN_DIR
"""
import pathlib
import tempfile

from jobs import make_bar, run, write_job

with tempfile.TemporaryDirectory(prefix="carillon-simulate-") as scratch:
    folder = pathlib.Path(scratch)
    job = make_bar(0.01)
    job["simulate"]["bodies"][0]["fixed"] = "x-mim"  # seen once the mesh is there, so on every rank
    write_job(folder / "job.json", job)
    for ranks, more in ((1, []), (1, ["--validate"]), (2, [])):
        done = run(folder, "-q", "job.json", *more, ranks=ranks)
        assert done.returncode == 2 and done.stdout == "", f"{ranks} {more}: {done}"
        errors = [line for line in done.stderr.splitlines() if "carillon-simulate: error:" in line]
        assert len(errors) == 1 and "did you mean 'x-min'" in errors[0], done.stderr
        place = errors[0].split("job.json:")
        assert len(place) == 2 and place[1].split(":")[0].isdigit(), errors[0]
        left = [path.name for path in folder.iterdir()]
        assert left == ["job.json"], left
