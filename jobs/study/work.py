"""Records of the work of a study (operations, messages and bytes per phase), and comparison with them."""
import json
import os
import pathlib

import job_file
from errors import InputError, RunError

QUANTITIES = ("flops", "messages", "bytes", "collectives", "collective_bytes")
MAX_GROWTH = 0.05
FORMAT = 1


class HasGrown(RunError):
    def __init__(self, text):
        super().__init__(3, text)


def collect(study):
    """[{"nodes", "ranks", "unknowns", "modes", "work": {phase: {quantity: number}}}]."""
    return [
        {
            "nodes": case.nodes,
            "ranks": case.ranks,
            "unknowns": study.get_unknowns(case),
            "modes": study.runs[case][0]["solver"]["modes"],
            "work": study.get_work(case),
        }
        for case in study.cases
    ]


def write(path, study):
    text = json.dumps({"format": FORMAT, "job": study.job, "cases": collect(study)}, indent=1, sort_keys=True) + "\n"
    path = pathlib.Path(path)
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fresh.write_text(text)
        os.replace(fresh, path)
    except OSError as error:
        fresh.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot write the record: {error.strerror}") from None


def read(path):
    """A record of write(). InputError for missing parts."""
    remedy = f"record it again with --record {path}"
    record = job_file.parse(job_file.read_text(path, "record", remedy), path, remedy)
    if (
        not isinstance(record, dict)
        or record.get("format") != FORMAT
        or not isinstance(record.get("job"), dict)
        or not isinstance(record.get("cases"), list)
    ):
        raise InputError(f"{path}: not a record of a study; {remedy}")
    for number, case in enumerate(record["cases"], 1):
        if fault := find_fault(case):
            raise InputError(f"{path}: case {number} of the record {fault}; {remedy}")
    return record


def find_fault(case):
    """The fault of a case of a record; None if complete."""
    if not isinstance(case, dict):
        return "is not an object"
    for key in ("nodes", "ranks"):
        if type(case.get(key)) is not int:
            return f'has no whole number "{key}"'
    if not isinstance(case.get("work"), dict):
        return 'has no object "work"'
    for phase, work in case["work"].items():
        if not isinstance(work, dict):
            return f'has no object "{phase}" in "work"'
        for quantity in QUANTITIES:
            value = work.get(quantity)
            if type(value) not in (int, float) or not 0 <= value < float("inf"):
                return f'has no number "{quantity}" in "work", "{phase}"'
    return None


def compare(recorded, cases):
    """[(case, phase, quantity, recorded, now)] of all differences above MAX_GROWTH, worst first."""
    found = {(case["nodes"], case["ranks"]): case for case in cases}
    differences = []
    for old in recorded:
        new = found.get((old["nodes"], old["ranks"]))
        if new is None:
            raise InputError(
                f"the record has a case of {old['nodes']} nodes on {old['ranks']} ranks, and the study has none: take the options it was"
                " made with"
            )
        for phase in sorted({*old["work"], *new["work"]}):
            for quantity in QUANTITIES:
                before, now = (side["work"].get(phase, {}).get(quantity, 0) for side in (old, new))
                if now > before * (1 + MAX_GROWTH) or now < before * (1 - MAX_GROWTH):
                    differences.append((old, phase, quantity, before, now))
    return sorted(differences, key=lambda entry: -entry[4] / max(entry[3], 1))


def check(record, study, options):
    """Raises HasGrown for growth; prints reductions."""
    if record["job"] != study.job:
        raise InputError(f"{options.check}: the record is of another job than {study.job_file}; record it again with --record")
    differences = compare(record["cases"], collect(study))
    lines = {True: [], False: []}
    for case, phase, quantity, before, now in differences:
        change = f"{100 * (now / before - 1):+.1f} %" if before else "new"
        lines[now > before].append(
            f"  {case['nodes']} nodes, {case['ranks']} ranks, {phase}: {quantity} {before:.0f} -> {now:.0f} ({change})"
        )
    command = f"carillon-study scaling {options.job}{' --quick' if options.quick else ''} --record {options.check}"
    for given, flag in ((options.ranks, "--ranks"), (options.nodes, "--nodes")):
        if given:
            command += f" {flag} {','.join(map(str, given))}"
    if lines[False]:
        print("less work than recorded; record it:\n" + "\n".join(lines[False]), flush=True)
    if lines[True]:
        raise HasGrown(
            f"the work has grown by more than {100 * MAX_GROWTH:.0f} % against {options.check}:\n"
            + "\n".join(lines[True])
            + f"\nIf intended, record it in the same commit:\n  {command}"
        )
    print(f"{options.check}: the work is as recorded, within {100 * MAX_GROWTH:.0f} %", flush=True)
