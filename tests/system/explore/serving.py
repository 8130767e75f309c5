"""carillon explore --serve as a process of a test."""
import json
import os
import pathlib
import subprocess

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])


def start(*words, **options):
    """The process after its first response, and its output."""
    process = subprocess.Popen([BIN / "carillon", "--json", "explore", *words, "--serve"], stdout=subprocess.PIPE, text=True, **options)
    said = ""
    while not said.endswith("\n}\n"):
        line = process.stdout.readline()
        assert line, said
        said += line
    return process, json.loads(said)
