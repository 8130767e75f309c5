"""Programs started by a study: in a given folder, next to this program, or in PATH."""
import argparse
import json
import math
import os
import pathlib
import shutil
import signal
import sys

from errors import InputError, RunError, printable


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


def run_main(name, run, *words):
    """Exit code of run(arguments) of the program `name`; errors are one line, with --json also a document. words: as leave_run()."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        leave_run(*words)
        return run(sys.argv[1:])
    except InputError as error:
        code, text = 2, error
    except RunError as error:
        code, text = error.code, error
    except OSError as error:
        code, text = 4, error
    except KeyboardInterrupt:
        return 130
    if "--json" in sys.argv[1:]:
        print(json.dumps({"error": str(text), "exit_code": code}, indent=2))
    print(f"{name}: error: {printable(text)}", file=sys.stderr)
    return code
