#!/usr/bin/python3
"""--validate against runs: equal mode counts, predicted memory between one and two times the peak, and the same errors for jobs that a run
rejects before solving.

usage: validate.py BIN_DIR
"""
import json
import os
import pathlib
import tempfile

import h5py
import solver

STEEL = solver.STEEL | {"damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}}}
BAR = {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02, "nodes": 3000}
JOBS = {
    "bar": {"body": BAR, "band_hz": [20, 60000]},
    "few of many": {"body": BAR, "band_hz": [20, 60000], "max_modes": 12},
    "fixed": {"body": BAR, "fixed": [{"node_set": "x-min"}]},
    "plate, linear and lumped": {
        "body": {"shape": "plate", "length_m": 0.3, "width_m": 0.2, "thickness_m": 0.004, "nodes": 6000},
        "element": "T4",
        "mass": "lumped",
    },
    "bowl": {"body": {"shape": "bowl", "outer_radius_m": 0.05, "wall_m": 0.004, "nodes": 6000}},
    "no mode": {"body": BAR, "band_hz": [20, 200]},
    "dense": {"body": BAR | {"nodes": 60}, "band_hz": [20, 60000]},
}


def run(folder, *words, ranks=1, code=0):
    return solver.run(folder, "carillon-precompute", *words, ranks=ranks, code=code)


def write_job(folder, job):
    job = {"material": STEEL, "bank": "bank.hdf"} | job
    solver.write_job(folder, **{key: value for key, value in job.items() if value is not None})


def check_predictions(folder, name, job):
    write_job(folder, job)
    result = run(folder, "--validate", "--json", "job.json")
    assert not (folder / "bank.hdf").exists(), f"{name}: a validation wrote a bank"
    predicted = json.loads(result.stdout)
    assert predicted["ok"] is True
    for ranks in (1, 2, 4):
        run(folder, "-q", "job.json", ranks=ranks)
        record = json.loads((folder / "bank.hdf.resolved.json").read_text())["run"]
        peak, bound = sum(record["peak_bytes_by_rank"]), predicted["memory_bytes"][str(ranks)]
        assert peak <= bound <= 2 * peak, f"{name}, {ranks} ranks: {peak / 1e6:.0f} MB, and {bound / 1e6:.0f} MB were predicted"
        with h5py.File(folder / "bank.hdf") as bank:
            # Counted on the mesh: the bank may have modes above the band's end on the mesh, whose corrected frequencies are below it.
            modes = int((bank["modes/frequency_hz"][()] <= bank["solve/band_hz"][1]).sum())
        assert predicted["modes"] == predicted["modes"] | {
            "count": modes,
            "how": "counted",
        }, f"{name}: {predicted['modes']}, {modes} in the bank"
        mesh = {key: record["mesh"][key] for key in ("nodes", "tets", "components", "fixed_nodes")}
        assert predicted["mesh"] == predicted["mesh"] | mesh, f"{name}: {predicted['mesh']} and {mesh}"
        assert predicted["unknowns"] == 3 * record["mesh"]["free_nodes"]
    assert predicted["cpu_seconds"] > 0 and predicted["wall_seconds"]["2"] <= predicted["wall_seconds"]["1"]
    for file in ("bank.hdf", "bank.hdf.resolved.json"):
        (folder / file).unlink()


BAD = {
    "no mesh file": {"mesh": "none.msh"},
    "unknown key": {"body": BAR, "bnad_hz": [20, 100]},
    "no such node set": {"body": BAR, "fixed": [{"node_set": "nowhere"}]},
    "no such region": {"body": BAR, "materials": [STEEL | {"region": "handle"}], "material": None},
    "a folder for a bank": {"body": BAR, "bank": "folder"},
    "dense and too large": {"body": BAR, "solver": {"method": "dense"}},
    "a mesh that is none": {"mesh": "text.msh"},
    "a pipe for a mesh": {"mesh": "pipe.msh"},
    "an empty band": {"body": BAR, "band_hz": [100, 20]},
}


def find_error(result):
    return [line for line in result.stderr.splitlines() if "carillon-precompute: error:" in line]


def check_refusals(folder):
    (folder / "folder").mkdir()
    (folder / "text.msh").write_text("no mesh\n")
    os.mkfifo(folder / "pipe.msh")
    for name, job in BAD.items():
        write_job(folder, job)
        solved, looked = run(folder, "-q", "job.json", code=2), run(folder, "--validate", "--json", "job.json", code=2)
        assert len(find_error(looked)) == 1 and find_error(looked) == find_error(
            solved
        ), f"{name}:\n{find_error(solved)}\n{find_error(looked)}"
        said = json.loads(looked.stdout)
        assert said["ok"] is False and said["code"] == 2 and said["error"] in looked.stderr, f"{name}: {said}"
        assert not list(folder.glob("bank.hdf*"))


def check_words(folder):
    write_job(folder, JOBS["bar"])
    several = run(folder, "--validate", "job.json", ranks=2, code=2)
    assert "without mpirun" in several.stderr, several.stderr
    alone = run(folder, "--json", "job.json", code=2)
    assert "--validate" in alone.stderr, alone.stderr
    people = run(folder, "--validate", "job.json")
    assert "counted by inertia" in people.stdout and "ranks" in people.stdout, people.stdout
    write_job(folder, {"body": {key: value for key, value in BAR.items() if key != "nodes"}, "accuracy_cents": 5})
    trial = run(folder, "--validate", "--json", "job.json")
    assert "trial" in " ".join(json.loads(trial.stdout)["notes"]), trial.stdout + trial.stderr


with tempfile.TemporaryDirectory() as top:
    for name, job in JOBS.items():
        check_predictions(pathlib.Path(top), name, job)
        print(f"{name}: well", flush=True)
    check_refusals(pathlib.Path(top))
    check_words(pathlib.Path(top))
print("validate: ok")
