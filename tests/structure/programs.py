#!/usr/bin/python3
"""Common to all programs: --version takes precedence, and outputs may go to standard output.

usage: programs.py SOURCE_DIR BIN_DIR"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SOURCE, BIN = map(pathlib.Path, sys.argv[1:3])
VERSION = re.search(r"project\(carillon VERSION (\S+)", (SOURCE / "CMakeLists.txt").read_text())[1]
PROGRAMS = [path for path in sorted(BIN.glob("carillon*")) if path.suffix != ".so" and os.access(path, os.X_OK)]
faults = []


def expect(true, what):
    if not true:
        faults.append(what)
        print("FAULT:", what)


def run(*words, text=True):
    return subprocess.run([str(word) for word in words], capture_output=True, text=text, timeout=100, cwd=folder)


with tempfile.TemporaryDirectory() as folder:
    for program in PROGRAMS:
        done = run(program, "--version")
        match = re.fullmatch(rf"{re.escape(program.name)} {re.escape(VERSION)}( \([0-9a-f]{{40}}(-dirty)?\))?\n", done.stdout)
        expect(done.returncode == 0 and done.stderr == "" and match, f"{program.name} --version: {done}")
    mpirun = (
        run("mpirun", "-np", 2, "--oversubscribe", BIN / "carillon-precompute", "--version")
        if (BIN / "carillon-precompute").exists()
        else None
    )
    expect(mpirun is None or mpirun.stdout.count("carillon-precompute") == 1, f"under mpirun: {mpirun}")
    bank = SOURCE / "tests/unit/runtime/bank/pinned/version_1_2.hdf"
    file = run(BIN / "carillon-bank", "edit", bank, "edited.hdf", "--density", "0.5")
    piped = run(BIN / "carillon-bank", "edit", bank, "-", "--density", "0.5", text=False)
    expect(file.returncode == 0 and piped.returncode == 0 and piped.stderr == b"", f"carillon-bank edit: {file} {piped.stderr}")
    expect(pathlib.Path(folder, "edited.hdf").read_bytes() == piped.stdout, "the bank on standard output is another one")
    if (BIN / "carillon-mesh").exists():
        words = ["--shape", "box", "--nodes", "500"]
        file = run(BIN / "carillon-mesh", *words, "-o", "box.msh", "-q")
        expect((file.returncode, file.stdout, file.stderr) == (0, "", ""), f"carillon-mesh -q: {file}")
        piped = run(BIN / "carillon-mesh", *words, "-o", "-", text=False)
        expect(pathlib.Path(folder, "box.msh").read_bytes() == piped.stdout, "the mesh on standard output is another one")
        expect(b"tetrahedra" in piped.stderr, f"the report of the mesh is not on standard error: {piped.stderr}")
    expect(not pathlib.Path(folder, "-").exists(), "a file named - was written")
sys.exit(1 if faults else 0)
