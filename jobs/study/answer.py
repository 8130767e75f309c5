"""Output of `carillon study advise`: lines for the terminal and the JSON document."""

HOW = {
    "known": "against reference frequencies",
    "extrapolated": "against the extrapolated finest curved T10 of the study",
    "finer": "against a finer mesh, corrected for its own error",
    "bars": "by its error bars, divided by their usual overestimate",
}


def show(cents):
    return f"{cents:.2g}" if cents < 10 else f"{cents:.0f}"


def describe_setting(setting, target):
    element, _, mass = setting.element.partition(" ")
    size = "" if target.kind == "mesh" else f", {setting.nodes:,} nodes"
    sides = " with curved sides" if element == "T10" and target.is_round else ""
    return (
        f"{element}{sides}, {mass or 'consistent'} mass{size}, tolerance {setting.tolerance:g},"
        f" {setting.ranks} rank{'s' if setting.ranks > 1 else ''}"
    )


def describe_request(adviser, options):
    """Lines: the body, and the error and time that are asked for."""
    limits = ((options.cents, "cents"), (options.seconds, "CPU s"))
    notes = adviser.target.notes or [f"a {adviser.target.kind}, as the job has it"]
    asked = " and ".join(f"{value:g} {unit}" for value, unit in limits if value is not None)
    return [*(f"{adviser.target.name}: {note}" for note in notes), f"asked:     {asked}"]


def describe_prediction(adviser, found, remark):
    lines = describe_request(adviser, adviser.options)
    if remark:
        lines.append(f"           {remark}")
    if adviser.probe_cpu_s:
        tried = (
            "both elements"
            if adviser.target.kind == "mesh"
            else "coarse meshes of this body, up to {:,} nodes".format(adviser.probe.trials[-1].nodes)
        )
        lines.append(f"tried:     {tried}, {adviser.probe_cpu_s:.2f} CPU s")
    wall = f", {found.wall_s:.2g} s by the clock" if found.setting.ranks > 1 else ""
    lines.append(f"use:       {describe_setting(found.setting, adviser.target)}")
    lines.append(
        f"predicted: at most {show(found.cents)} cents, {found.cpu_s:.2g} CPU s{wall} (this machine takes {adviser.pace:.2f} times the"
        " study's seconds)"
    )
    return lines


def describe_estimate(adviser, found, options):
    memory = found["memory_bytes"]["1"] * 1e-9
    lines = describe_request(adviser, options)
    modes = f"{'' if found['modes']['how'] == 'counted' else 'about '}{found['modes']['count']} modes in the band"
    what = (
        "so many nodes take long to solve. The mesh has"
        if adviser.target.kind == "mesh"
        else "so thin a body takes long to mesh and to solve. Its coarsest mesh has"
    )
    lines.append(
        f"estimate:  {what} about {found['mesh']['nodes']:,} nodes (T10), {modes}, {found['cpu_seconds']:.0f} CPU s and"
        f" {memory:.1f} GB, without a solve"
    )
    if options.dry_run:
        lines.append("           cents are not predicted without a trial: leave --dry-run away for the trials")
    return lines


def is_met(outcome, options):
    return (options.cents is None or outcome.cents <= options.cents) and (options.seconds is None or outcome.cpu_s <= options.seconds)


def describe_outcome(outcome, options, found):
    lines = [
        (
            f"reached:   {show(outcome.cents)} cents (mode {outcome.mode} of {outcome.modes}), {HOW[outcome.how]}; error bars up to"
            f" {show(outcome.bar)} cents"
        ),
        (
            f"           {outcome.cpu_s:.2f} CPU s, {outcome.cpu_s / found.cpu_s:.2f} times the prediction, {outcome.wall_s:.2f} s by the"
            f" clock, {outcome.nodes:,} nodes"
        ),
    ]
    if options.cents is not None and outcome.cents > options.cents >= found.cents:
        lines.append(f"           more than was asked; ask for {show(0.7 * options.cents * options.cents / outcome.cents)} to be sure")
    if options.seconds is not None and outcome.cpu_s > options.seconds:
        lines.append("           more CPU seconds than were asked for")
    return lines


def make_document(adviser, found, remark, outcome, job, bank):
    options, setting = adviser.options, found.setting
    element, _, mass = setting.element.partition(" ")
    document = {
        "body": adviser.target.name,
        "kind": adviser.target.kind,
        "notes": adviser.target.notes,
        "asked": {"cents": options.cents, "cpu_seconds": options.seconds},
        "remark": remark or None,
        "setting": {
            "element": element,
            "mass": mass or "consistent",
            "nodes": setting.nodes,
            "tolerance": setting.tolerance,
            "ranks": setting.ranks,
        },
        "predicted": {"cents": found.cents, "cpu_seconds": found.cpu_s, "wall_seconds": found.wall_s},
        "probe_cpu_seconds": adviser.probe_cpu_s,
        "machine_pace": adviser.pace,
        "reached": None,
    }
    if outcome:
        document["reached"] = {
            "cents": outcome.cents,
            "mode": outcome.mode,
            "how": outcome.how,
            "worst_bar_cents": outcome.bar,
            "cpu_seconds": outcome.cpu_s,
            "wall_seconds": outcome.wall_s,
            "nodes": outcome.nodes,
            "modes": outcome.modes,
            "is_met": is_met(outcome, options),
        }
        document |= {"job": str(job), "bank": str(bank)}
    return document


def make_estimate_document(adviser, found):
    options = adviser.options
    return {
        "body": adviser.target.name,
        "kind": adviser.target.kind,
        "notes": adviser.target.notes,
        "asked": {"cents": options.cents, "cpu_seconds": options.seconds},
        "setting": {"element": "T10", "mass": "consistent", "nodes": found["mesh"]["nodes"], "ranks": 1},
        "predicted": {"cents": None, "cpu_seconds": found["cpu_seconds"], "wall_seconds": found["wall_seconds"]["1"]},
        "is_estimate": True,
        "reached": None,
    }
