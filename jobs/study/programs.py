"""Programs started by a study: in a given folder, next to this program, or in PATH."""
import argparse
import math
import os
import pathlib
import shutil
import sys

from errors import InputError


def read_seconds(text):
    """Type of --timeout."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: give a number of seconds above 0")
    return value


def leave_run(*words):
    """Inside an MPI run, replaces this process by `carillon` with these words and the arguments; its children start outside the run."""
    if not {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}.isdisjoint(os.environ):
        os.execv(find_program(None, "carillon"), ["carillon", *words, *sys.argv[1:]])


def find_program(given, name="carillon-precompute"):
    if given:
        candidates = [pathlib.Path(given) / name]
    else:
        sibling = pathlib.Path(sys.argv[0]).resolve().parent / name
        found = shutil.which(name)
        candidates = [sibling] + ([pathlib.Path(found)] if found else [])
    for candidate in candidates:
        if os.access(candidate, os.X_OK) and candidate.is_file():
            return candidate.resolve()
    raise InputError(f"{name} is not at {candidates[0]}; give its folder with --bin")


def find_all(given, names):
    """{name: path}. InputError for the first missing program."""
    return {name: find_program(given, name) for name in sorted(set(names))}
