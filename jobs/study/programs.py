"""The programs that a study starts: given, next to this program, or on the way of commands."""
import argparse
import math
import os
import pathlib
import shutil
import sys

from errors import InputError


def read_seconds(text):
    """Of --timeout."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: give a number of seconds above 0")
    return value


# Prefixes of the variables that MPI launchers set for their ranks (runtime/base/environment.cpp).
OF_RUNS = ("OMPI_COMM_WORLD_", "OMPI_UNIVERSE_", "OMPI_FIRST_RANKS", "OMPI_NUM_APP", "OMPI_APP_CTX", "OMPI_FILE_LOCATION", "OMPI_COMMAND")
OF_RUNS += ("OMPI_ARGV", "OMPI_MCA_ess", "OMPI_MCA_pmix", "OMPI_MCA_orte_", "OMPI_MCA_initial_wdir", "PMIX_", "PMI_", "PRTE_")


def leave_run():
    """Takes child processes out of the MPI run of this process."""
    for name in [name for name in os.environ if name.startswith(OF_RUNS)]:
        del os.environ[name]


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
    """{name: path}. InputError names the first that is missing."""
    return {name: find_program(given, name) for name in sorted(set(names))}
