#!/usr/bin/python3
"""--progress, and the operation counts of the record.

Messages are counted independently by the preloaded library of tests/bench/scaling.

usage: progress.py BIN_DIR
"""
import json
import os
import pathlib
import tempfile

import solver
from solver import BIN

STEEL = solver.STEEL | {"damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}}}
BAR = {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02}
PHASES = ["read", "partition", "assemble", "rigid", "analyse", "count", "factor", "iterate", "check", "errors", "collect", "write", "done"]


def run(folder, ranks, *words, code=0, **variables):
    return solver.run(folder, "carillon-precompute", *words, ranks=ranks, code=code, env=os.environ | variables)


def write_job(folder, **keys):
    body = BAR if "accuracy_cents" in keys else BAR | {"nodes": 3000}
    solver.write_job(folder, **{"body": body, "material": STEEL, "bank": "bar.hdf"} | keys)


def read_lines(file):
    return [json.loads(line) for line in file.read_text().splitlines()]


def check_lines(lines, modes, name):
    percents = [line["percent"] for line in lines]
    assert percents == sorted(percents), f"{name}: progress decreases: {percents}"
    assert all(0 <= percent < 100 for percent in percents[:-1]), f"{name}: {percents}"
    seconds = [line["seconds"] for line in lines]
    assert seconds == sorted(seconds), f"{name}: {seconds}"
    last = lines[-1]
    assert (last["phase"], last["percent"]) == ("done", 100), f"{name}: {last}"
    assert last["modes_done"] == last["modes_wanted"] == modes, f"{name}: {last}, and the bank has {modes} modes"
    assert all(line["modes_done"] <= line.get("modes_wanted", 0) for line in lines), f"{name}: {lines}"


def read_record(folder):
    return json.loads((folder / "bar.hdf.resolved.json").read_text())["run"]


def try_runs(folder):
    write_job(folder, band_hz=[20, 60000])
    file = folder / "progress.jsonl"
    for ranks in (1, 2):
        run(folder, ranks, "job.json", "--progress", "progress.jsonl")
    lines = read_lines(file)
    ends = [i for i, line in enumerate(lines) if line["phase"] == "done"]
    assert len(ends) == 2 and ends[1] == len(lines) - 1, f"the second run does not append to the first: {ends} of {len(lines)}"
    modes = read_record(folder)["solver"]["modes"]
    assert modes > 20
    for part in (lines[: ends[0] + 1], lines[ends[0] + 1 :]):
        check_lines(part, modes, "bar")
        phases = [line["phase"] for line in part]
        missing = [phase for phase in PHASES if phase not in phases]
        assert not missing, f"no line for {missing}"
        firsts = [phases.index(phase) for phase in PHASES]
        assert firsts == sorted(firsts), phases


def try_trials(folder):
    write_job(folder, accuracy_cents=60)
    run(folder, 1, "job.json", "--progress", "trials.jsonl")
    lines = read_lines(folder / "trials.jsonl")
    check_lines(lines, read_record(folder)["solver"]["modes"], "accuracy_cents")


def try_bad_files(folder):
    write_job(folder)
    (folder / "folder").mkdir()
    os.mkfifo(folder / "pipe")
    bank = (folder / "bar.hdf").read_bytes()
    job = (folder / "job.json").read_bytes()
    for name in ("none/progress.jsonl", "folder", "pipe", "job.json", "bar.hdf", "./bar.hdf.resolved.json", ""):
        for ranks in (1, 2):
            result = run(folder, ranks, "job.json", "--progress", name, code=2)
            if name != "":
                errors = [line for line in result.stderr.splitlines() if "carillon-precompute: error" in line]
                assert len(errors) == 1 and name.removeprefix("./") in errors[0] and "--progress" in errors[0], result.stderr
            assert "modes      " not in result.stdout, f"--progress '{name}' is found out after the solve began"
    assert (folder / "bar.hdf").read_bytes() == bank and (folder / "job.json").read_bytes() == job


def sum_messages(folder, ranks):
    calls = size = 0
    for rank in range(ranks):
        for line in (folder / f"messages.{rank}").read_text().splitlines():
            kind, number, number_bytes = line.split()[:3]
            if kind == "send":
                calls, size = calls + int(number), size + float(number_bytes)
    return calls, size


def try_work(folder):
    """Two runs of a job have equal counts; the factor's operations are as planned, and messages as counted independently."""
    write_job(folder, band_hz=[20, 60000])
    records = []
    preload = {"LD_PRELOAD": str(BIN / "libcount_messages.so"), "CARILLON_MESSAGES": str(folder / "messages")}
    for variables in ({}, preload):
        run(folder, 3, "job.json", "--profile", **variables)
        records.append(read_record(folder))
    assert records[0]["work"] == records[1]["work"], "two runs of a job did different work"
    work, solver = records[0]["work"], records[0]["solver"]
    planned = solver["factorisations"] * solver["factor_flops"]
    assert (
        planned <= work["factor"]["flops"] <= 1.05 * planned
    ), f"{work['factor']['flops']} operations in the factor, and {planned} planned"
    columns = 4 * solver["factor_entries"] * solver["solves"]
    assert 0.9 * columns <= work["solve"]["flops"] <= 1.1 * columns, f"{work['solve']['flops']} operations in solves, and {columns} planned"
    assert work["orthogonalise"]["flops"] > 0 and work["partition"]["messages"] > 0
    ours = sum(phase["messages"] for phase in work.values()), sum(phase["bytes"] for phase in work.values())
    run(folder, 3, "job.json")
    unprofiled = read_record(folder)["work"]
    assert all(phase == {"flops": work[name]["flops"]} for name, phase in unprofiled.items()), "messages are counted without --profile"
    assert ours == sum_messages(folder, 3), f"messages and bytes: {ours} in the record, {sum_messages(folder, 3)} counted"


with tempfile.TemporaryDirectory() as name:
    for test in (try_runs, try_trials, try_bad_files, try_work):
        test(pathlib.Path(name))
print("progress and work: ok")
