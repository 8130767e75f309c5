"""Comparison of programs for the reports: phases of a run, tables of results, tables in pages."""
import json

from measuring import find_median, find_spread

PHASES = ("read", "partition", "assemble", "factor", "solve", "orthogonalise", "error bars", "write", "other")


PHASE_OF_RECORDED = {
    "mesh": "read",
    "read": "read",
    "partition": "partition",
    "assembly": "assemble",
    "assemble": "assemble",
    "errors": "error bars",
    "collect": "write",
    "bank": "write",
    "write": "write",
}


def to_phases(record, total_s):
    """CPU seconds {phase: s} of the `run` record of a resolved job, adding up to total_s; the rest is "other".

    CPU seconds of the record are over all ranks; those of "modes" are divided by the wall seconds of its parts."""
    seconds = dict.fromkeys(PHASES, 0.0)
    solver = record["solver"]["seconds"]
    for phase in record["stations"]:
        cpu_s = phase.get("cpu_seconds", phase["seconds"])
        if phase["name"] != "modes":
            seconds[PHASE_OF_RECORDED.get(phase["name"], "other")] += cpu_s
            continue
        share = cpu_s / max(phase["seconds"], 1e-9)
        parts = {"factor": solver.get("analyse", 0.0) + solver["factor"], "solve": solver["solve"]}
        for name, value in parts.items():
            seconds[name] += value * share
        seconds["orthogonalise"] += max(cpu_s - share * sum(parts.values()), 0.0)
    claimed = sum(value for name, value in seconds.items() if name != "other")
    seconds["other"] = max(total_s - claimed, 0.0)
    excess = max(claimed / total_s, 1.0)  # clocks of different resolution, and older records with wall seconds only
    return {name: value / excess for name, value in seconds.items()}


def find_extras(record, total_s):
    """Rows (part, CPU s, share of the run) of proof, checks and error bars, from to_phases()."""
    solver = record["solver"]["seconds"]
    phase = next(s for s in record["stations"] if s["name"] == "modes")
    share = phase.get("cpu_seconds", phase["seconds"]) / max(phase["seconds"], 1e-9)
    factorisations = max(record["solver"]["factorisations"], 1)
    ends = 1 if "first shift" in record["solver"].get("proof", "") else 2  # a low end is counted by the shift inside
    rows = [("part of the run", "CPU s", "share")]

    def add(name, cpu_s):
        rows.append((name, f"{cpu_s:.2f}", f"{100 * cpu_s / total_s:.1f} %"))

    add(
        f"proof: {ends} of {factorisations} factorisations, at the ends of the band",
        share * solver["factor"] * min(ends, factorisations) / factorisations,
    )
    add("residuals, orthonormality, canonical basis", share * solver["check"])
    add("error bars", to_phases(record, total_s)["error bars"])
    return rows


def find_complete_modes(bank):
    """Frequencies [Hz] on the mesh, ascending, from the lower end of the band up to which no mode of the mesh is missing. The band is of
    corrected frequencies: at its upper end some modes of the mesh are left out and higher ones kept, which no rival can know."""
    below = bank["proof/below_band_hz"][:].tolist() if "proof/below_band_hz" in bank else []
    complete_hz = bank["proof/complete_below_hz"][()] if "proof/complete_below_hz" in bank else float("inf")
    return below + [hz for hz in bank["modes/frequency_hz"][:].tolist() if hz <= complete_hz]


def compare_frequencies(reference_hz, other_hz):
    """Largest relative difference; infinite if the counts differ."""
    if len(reference_hz) != len(other_hz):
        return float("inf")
    return max((abs(a / b - 1) for a, b in zip(reference_hz, other_hz)), default=0.0)


def make_rows(results, ours):
    """results: {name: {"cpu_s": [...], "wall_s": [...], "peak_bytes": int, "modes": int, "residual": x, "frequency_error": x, "label":
    text}} -> rows of the table, fastest first, with the CPU time relative to `ours`."""
    base = find_median(results[ours]["cpu_s"])
    rows = [("program", "CPU s", "spread", "times ours", "wall s", "peak GB", "modes", "worst residual", "frequencies agree to")]
    for name, result in sorted(results.items(), key=lambda item: (not item[0].startswith("carillon"), find_median(item[1]["cpu_s"]))):
        cpu = find_median(result["cpu_s"])
        rows.append(
            (
                result["label"],
                f"{cpu:.1f}" if cpu >= 1 else f"{cpu:.2f}",
                f"{100 * find_spread(result['cpu_s']):.0f} %" if len(result["cpu_s"]) > 1 else "-",
                f"{cpu / base:.2f}",
                f"{find_median(result['wall_s']):.1f}",
                f"{result['peak_bytes'] / 1e9:.2f}",
                result["modes"],
                f"{result['residual']:.1e}",
                f"{result['frequency_error']:.0e}",
            )
        )
    return rows


def split_page(text, name):
    """Text before, between and after <!-- name --> and <!-- /name -->. ValueError without these marks."""
    start, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    before, found, rest = text.partition(start)
    between, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the page has no marks <!-- {name} -->")
    return before + start, between, end + after


def find_between(text, name):
    return split_page(text, name)[1]


def replace_between(text, name, content):
    before, _, after = split_page(text, name)
    return before + content.rstrip("\n") + "\n" + after


def read_json(path):
    with open(path) as stream:
        return json.load(stream)
