"""Output folders, and the files of a design of carillon tune."""
import contextlib
import json
import os
import pathlib
import shutil

import numpy

import drawing
import grid
from errors import InputError

MESH = "body.msh"
FILES = ("job.json", MESH, "bank.hdf", "bank.hdf.resolved.json", "body.stl", "body.obj", "cut.stl", "profile.csv", "drawing.svg")
FILES += ("table.txt", "tune.json")


def check_outputs(paths):
    """InputError where a file cannot be written."""
    for path in paths:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; give another name with -o")
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it, or give another name with -o")
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise InputError(f"{path}: cannot be written: permission denied; give another name with -o")


@contextlib.contextmanager
def make_folder(name, files):
    """The path of an output folder for these files, made before the work; without it again where that fails. InputError."""
    path = pathlib.Path(name)
    is_new = not path.exists()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot create folder: {error.strerror}; give another one with -o") from None
    try:
        check_outputs(path / file for file in files)
        yield path
    except BaseException:
        if is_new:
            with contextlib.suppress(OSError):  # it is not empty
                path.rmdir()
        raise


def write_files(out, outcome, job_file, table):
    """Job, mesh, surfaces, drawing and bank of the last design."""
    body, p = outcome.body, outcome.last.p
    job = body.make_job(p, out) | {"bank": "again.hdf"}
    if "mesh" in job:
        job["mesh"] = MESH
    if "surface" in job.get("body", {}):
        job["body"]["surface"] = str((pathlib.Path(job_file).resolve().parent / job["body"]["surface"]).resolve())
    (out / "job.json").write_text(json.dumps(job, indent=1) + "\n")
    for ending in ("", ".resolved.json"):
        shutil.copyfile(f"{outcome.last.bank}{ending}", out / f"bank.hdf{ending}")
    before, after = body.get_surfaces(outcome.first, outcome.last)
    grid.write_stl(out / "body.stl", *after)
    grid.write_obj(out / "body.obj", *after)
    if before[1] is after[1]:
        grid.write_stl(out / "cut.stl", *grid.find_cut(before[0], *after))
    if body.profile:
        head, rows = body.profile(p)
        numpy.savetxt(out / "profile.csv", rows, fmt="%.4f", delimiter=",", header=head, comments="")
    drawing.draw(out / "drawing.svg", before, after, f"{pathlib.Path(job_file).stem}, tuned", table)
