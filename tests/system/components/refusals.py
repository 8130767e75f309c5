#!/usr/bin/python3
"""Requests for components that the build leaves out: one sentence with the option, exit code 2 (4 for a missing program), no output.

usage: refusals.py BIN_DIR NAME...     the components that are OFF
"""
import json
import pathlib
import shutil
import sqlite3
import subprocess
import sys
import tempfile

BIN = pathlib.Path(sys.argv[1]).resolve()
OFF = sys.argv[2:]
BANK = pathlib.Path(__file__).resolve().parents[3] / "tests/unit/runtime/bank/pinned/version_1_2.hdf"
BAR = {
    "body": {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.01, "nodes": 500},
    "material": "steel",
    "bank": "bar.hdf",
}
SHEET = "OFF\n4 2 0\n0 0 0\n0.1 0 0\n0.1 0.1 0.001\n0 0.1 0\n3 0 1 2\n3 0 2 3\n"
JOBS = {
    "AIR": [{**BAR, "radiation": "bem"}, {**BAR, "radiation": "auto"}],
    "NONLINEAR": [{**BAR, "nonlinear": {"modes": 5}}],
    "ANALYTIC": [{"body": {"beam": {"length_m": 0.3, "width_m": 0.05, "thickness_m": 0.008}}, "material": "brass", "bank": "beam.hdf"}],
}
SIMULATION = {"simulate": {"duration_s": 0.01, "bodies": [{**BAR["body"], "material": "steel"}]}}
SCENE = {
    "duration_s": 0.1,
    "bodies": [{"name": "body", "bank": str(BANK), "position_m": [0, 0, 0], "fixed": True}],
    "listener": {"position_m": [0, -1, 0], "ears": "hrtf"},
}
faults = []


def expect_refusal(name, *words, code=2):
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, timeout=100)
    option = f"-DCARILLON_{name}=ON"
    lines = [line for line in done.stderr.splitlines() if option in line]
    if done.returncode != code or len(lines) != 1 or f"component {name}" not in done.stderr:
        faults.append(f"{name}: {' '.join(map(str, words))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")


def write(name, content):
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))
    return name


with tempfile.TemporaryDirectory() as scratch:
    folder = pathlib.Path(scratch)
    for component, jobs in JOBS.items():
        for number, job in enumerate(jobs if component in OFF else []):
            file = write(f"{component}{number}.json", job)
            expect_refusal(component, BIN / "carillon-precompute", "-q", file)
            expect_refusal(component, BIN / "carillon-precompute", "--validate", file)
    store = ["--store", folder / "store"]
    if "SIMULATION" in OFF:
        file = write("simulation.json", SIMULATION)
        expect_refusal("SIMULATION", BIN / "carillon", *store, "validate", file, code=4)
    if "THIN_WALLS" in OFF:
        expect_refusal("THIN_WALLS", BIN / "carillon-mesh", write("sheet.off", SHEET), "--wall", "0.001", "-q", "-o", "sheet.msh")
    if "PAGE" in OFF:
        expect_refusal("PAGE", BIN / "carillon", "explore", BANK)
    if "EXCHANGE" in OFF:
        expect_refusal("EXCHANGE", BIN / "carillon-bank", "export", BANK, "-o", "body.glb")
        expect_refusal("EXCHANGE", BIN / "carillon-bank", "import", write("body.glb", ""), "-o", "body.hdf")
    if "SLURM" in OFF:
        file = write("bar.json", BAR)
        expect_refusal("SLURM", BIN / "carillon", *store, "submit", "--on", "slurm", file)
        expect_refusal("SLURM", BIN / "carillon", *store, "run", "--on", "slurm")
        # A job that another build has queued for Slurm is not queued again, and the profile of Slurm is checked here, too.
        for command in ("submit", "cancel"):
            subprocess.run([BIN / "carillon", *store, command, file], cwd=folder, check=True, capture_output=True)
        with sqlite3.connect(folder / "store/registry.sqlite") as registry:
            registry.execute("UPDATE jobs SET engine = 'slurm'")
        done = subprocess.run([BIN / "carillon", *store, "retry", file], cwd=folder, capture_output=True, text=True)
        listed = subprocess.run([BIN / "carillon", *store, "status", "--json"], cwd=folder, check=True, capture_output=True, text=True)
        states = [job["state"] for job in json.loads(listed.stdout)["jobs"]]
        if done.returncode != 1 or "-DCARILLON_SLURM=ON" not in done.stdout or states != ["cancelled"]:
            faults.append(f"SLURM: retry ended with {done.returncode}, {states}: {done.stdout}{done.stderr}")
        profile = write("profile.json", {"slurm": {"partitoin": "x"}})
        done = subprocess.run([BIN / "carillon", "--profile", profile, *store, "submit", file], cwd=folder, capture_output=True, text=True)
        if done.returncode != 2 or "profile.json:1" not in done.stderr or "partitoin" not in done.stderr:
            faults.append(f"SLURM: a bad profile ended with {done.returncode}: {done.stderr}")
    if "HEADS" in OFF:
        expect_refusal("HEADS", BIN / "carillon-render", write("scene.json", SCENE), "-o", "sound.wav")
    if "STUDIES" in OFF:
        expect_refusal("STUDIES", BIN / "carillon", "study", "advise", "bar", code=4)
    shutil.rmtree(folder / "store", ignore_errors=True)
    left = sorted(path.name for path in folder.iterdir() if path.suffix not in (".json", ".off", ".glb"))
    if left:
        faults.append(f"files were left: {left}")
print("\n".join(faults) or f"{len(OFF)} components are refused")
sys.exit(1 if faults else 0)
