"""carillon tune --cuts: a body without given spots of material, solved again."""
import json
import pathlib
import tempfile

import numpy
import scipy.optimize

import grid
import job_file
import measuring
import programs
import results
import shapes
import skin
import solver
import steps
from errors import InputError

MOST_SHARE = 0.5  # of the wall, to advise where nothing is left
MAX_CUTS = 2000
REMEDY = 'give {"cuts": [[x, y, z, radius, depth], ...]} in metres, as the page of carillon explore writes it'


def read_cuts(path):
    """(n, 5) m: centre, radius and depth of each spot. InputError."""
    document = job_file.parse(job_file.read_text(path, "list of cuts", REMEDY), path, REMEDY)
    rows = document.get("cuts") if isinstance(document, dict) else None
    try:
        cuts = numpy.array(rows, float)
    except (TypeError, ValueError):
        cuts = numpy.zeros(0)
    if cuts.ndim != 2 or cuts.shape[1:] != (5,) or not numpy.isfinite(cuts).all() or (cuts[:, 3:] <= 0).any():
        raise InputError(f"{path}: has no cuts, or one that is no five numbers, radius and depth above 0; {REMEDY}")
    if len(cuts) > MAX_CUTS:
        raise InputError(f"{path}: has {len(cuts)} cuts; at most {MAX_CUTS}")
    return cuts


def solve_cut(run, job, mesh, cuts, cuts_file, folder):
    """The Outcome of a body before and after."""
    nodes, tets = numpy.array(mesh.nodes), numpy.array(mesh.tets)
    none = numpy.zeros(0)
    whole = shapes.Moved(job, nodes, tets, numpy.zeros((0, *nodes.shape)), [], none, none, none, numpy.zeros((0, 0)), mesh=mesh)
    modes = job.get("sensitivities") or 1
    before = run.solve(whole.make_job(none, folder), modes, folder / "before.hdf")
    surface = skin.Skin(before.vertices, before.triangles, before.sites)
    depth = sum(surface.make_spot(cut[:3], cut[3], cut[4])[1] for cut in cuts)
    if not depth.any():
        raise InputError(f"{cuts_file}: no node of the mesh is within these spots; give larger ones or a finer mesh")
    share = surface.check_share(depth, str(cuts_file), MOST_SHARE)
    moves, at = numpy.zeros_like(nodes), whole.find_nodes(before, none)
    moves[at] = surface.calc_motion(depth)[before.sites.vertex]
    outside = numpy.unique(grid.find_surface(tets))
    field = grid.spread(nodes, tets, outside, moves[outside])
    one = numpy.ones(1)
    body = shapes.Moved(job, nodes, tets, field[None], ["all cuts"], 0 * one, one, one, one[:, None], mesh=mesh)
    after = run.solve(body.make_job(one, folder), job.get("sensitivities") or 0, folder / "after.hdf", is_whole=True)
    _, modes = scipy.optimize.linear_sum_assignment(-solver.compare(before, after))
    groups = [[int(mode)] for mode in modes]
    cents = 1200 * numpy.log2(after.corrected_hz[modes] / before.corrected_hz[: len(modes)])
    first = steps.State(0 * one, before, [[m] for m in range(len(modes))], 0 * cents, folder / "before.hdf")
    last = steps.State(one, after, groups, cents, folder / "after.hdf")
    return steps.Outcome(first, last, body, None, True, "", []), share, float(depth @ before.sites.area_m2)


def describe(outcome, share, volume_m3):
    """(table, document) of an Outcome."""
    first, last = outcome.first, outcome.last
    kinds = (*last.solution.kinds, *[""] * len(last.groups))
    modes = [
        {"mode": k + 1, "kind": kinds[group[0]], "before_hz": before, "after_hz": after, "cents": cents, "bar_cents": bar}
        for k, (group, before, after, cents, bar) in enumerate(
            zip(last.groups, first.hz.tolist(), last.hz.tolist(), last.off_cents.tolist(), last.bars.tolist())
        )
    ]
    rows = [["mode", "kind", "before Hz", "after Hz", "cents", "bar"]]
    for mode in modes:
        numbers = [
            f"{mode[key]:{form}}" for key, form in (("before_hz", ".2f"), ("after_hz", ".2f"), ("cents", "+.3f"), ("bar_cents", ".2f"))
        ]
        rows.append([str(mode["mode"]), mode["kind"] or "-", *numbers])
    note = f"{1e9 * volume_m3:.3g} mm3 removed, at most {100 * share:.2g} % of the wall; bar: cents, of each frequency"
    return measuring.format_table(rows), {"exit_code": 0, "modes": modes, "volume_m3": volume_m3, "share_of_wall": share}, note


def read_job(path, folder, binaries):
    """(job, file) of a job file, or of a bank: a file of the job inside, with paths from where the bank lies."""
    try:
        with open(path, "rb") as file:
            is_bank = file.read(13) == b"CARILLON BANK"
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}; give a job or a bank") from None
    if not is_bank:
        return solver.read_job(path), path
    with solver.open_bank(pathlib.Path(path), programs.find_program(binaries, "carillon-bank")) as bank:
        job = json.loads(bank["provenance"][()].rstrip(b"\0")) if "provenance" in bank else {}
    job, edits = solver.find_origin(job)
    if edits:
        raise InputError(f"{path}: was edited since its body was computed; give a job of the body as it is now")
    if "body" not in job and "mesh" not in job:
        raise InputError(f"{path}: says no body or mesh that it was computed from; give its job")
    base = pathlib.Path(path).resolve().parent
    if "mesh" in job:
        places = [base / job["mesh"], base / results.MESH]
        job["mesh"] = str(next((place for place in places if place.is_file()), places[0]))
        if not places[0].is_file() and not places[1].is_file():
            raise InputError(f"{path}: its mesh is not at {places[0]}; give the job in place of the bank")
    chosen = job.get("run", {}).get("accuracy", {}).get("chosen", {})
    if "body" in job and "body_nodes" in chosen:
        job["body"]["nodes"] = chosen["body_nodes"]
    if "surface" in job.get("body", {}):
        job["body"]["surface"] = str(base / job["body"]["surface"])
    job.pop("run", None)
    made = folder / f"{pathlib.Path(path).stem}.json"
    made.write_text(json.dumps(job))
    return job, made


def run(options):
    """(text, document) of carillon tune --cuts."""
    cuts = read_cuts(options.cuts)
    with results.make_folder(options.out, results.FILES) as out, tempfile.TemporaryDirectory(prefix="carillon-tune-") as name:
        folder = pathlib.Path(name)
        job, file = read_job(options.job, folder, options.bin)
        run = solver.Solver(programs.find_program(options.bin), file)
        mesh = shapes.read_mesh(job, file, folder, programs.find_program(options.bin, "carillon-mesh"))
        outcome, share, volume_m3 = solve_cut(run, job, mesh, cuts, options.cuts, folder)
        table, document, note = describe(outcome, share, volume_m3)
        lines = table.splitlines()
        results.write_files(out, outcome, options.job, [lines[0], *lines[2:], note])
    (out / "table.txt").write_text(f"{table}\n{note}\n")
    return "\n".join([table, note, ", ".join(str(path) for path in sorted(out.iterdir()))]), document
