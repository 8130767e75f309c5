"""carillon tune: removes material, or changes keys of a job, until a body has the wished frequencies."""
import json
import math
import pathlib
import resource
import tempfile

import numpy

import measuring
import programs
import recut
import results
import shapes
import steps
import targets
from errors import InputError
from quantities import LENGTH_UNITS, read_quantity
from solver import Solver, read_job

NOT_REACHED = 5  # exit code
CENTS, MOST_M, TOLERANCE_M = 0.2, 5e-4, 2e-5  # defaults
WISHES = {"--partials", "--fundamental", "--hz", "--bell", "--modes", "--apart", "--cents"}
# What may be removed or changed, and the options that each takes.
WAYS = {
    "--close-pairs": {"--keep", "--most", "--wall", "--knots", "--remove", "--map", "--cents", "--tolerance"},
    "--map": WISHES | {"--most", "--wall", "--knots", "--remove", "--tolerance"},
    "--outline": WISHES | {"--wall", "--knots", "--remove", "--tolerance"},
    "--free": WISHES | {"--tolerance"},
    "--cuts": set(),
    "": WISHES | {"--wall", "--knots", "--remove", "--tolerance"},
}


def add_command(commands):
    parser = commands.add_parser(
        "tune",
        help="material removed, or keys of a job changed, until modes have the wished frequencies",
        description="Tunes the body of a job: a bar by an undercut, any body by a removal map or sizes of its job, a bell by its outline. "
        "Writes the new job, meshes of the body and of the cut, a drawing in mm, the bank and a table. Exit code 5: not reached; the table "
        "says which mode and bound are in the way, and the files are the best that was found.",
    )
    parser.set_defaults(run=run)
    add, length = parser.add_argument, read_quantity(LENGTH_UNITS)
    add("job", metavar="JOB.json", help="a job of carillon-precompute")
    add("-o", "--out", metavar="FOLDER", default="tuned", help="output folder (default: tuned)")
    add("--partials", metavar="1,4,10", help="ratios to the fundamental; with weights 1,4,10:0.5")
    add("--fundamental", metavar="HZ|NOTE", help="frequency of ratio 1, like 220 or A3 (A4 is 440 Hz)")
    add("--hz", metavar="HZ|NOTE,...", help="frequencies or notes, like 2637,E8:0.5")
    add("--bell", choices=sorted(targets.BELLS), help="five partials of a church bell around the prime, the fundamental")
    add(
        "--modes",
        metavar="KIND N,...",
        help='the modes of these frequencies: "bending 1,torsion 1", "n=2", "mode 3" (default: bending 1, bending 2, ... of a bar that is '
        "undercut, else the nearest)",
    )
    add(
        "--apart", metavar="KIND:CENTS", action="append", default=[], help="modes of this kind stay so far from every wish, like torsion:50"
    )
    add("--close-pairs", metavar="N,...", help="close the beats of these pairs of modes, 1 is the lowest, by local cuts of least volume")
    add("--keep", metavar="N,...", help="with --close-pairs: modes whose frequencies stay")
    add("--free", metavar="KEY=LOW:HIGH,...", help="keys of the job to change within these values, like body.wall_m=0.002:0.004")
    add("--map", action="store_true", help="a removal map: local cuts anywhere on the surface")
    add(
        "--outline",
        metavar="FILE.csv",
        help="a body of revolution about z in place of the job's: rows of r, z, thickness in mm (r, z: the middle of the wall), turned at "
        "knots along the outline",
    )
    add(
        "--cuts",
        metavar="CUTS.json",
        help="no wishes: removes the spots that the page of carillon explore has written, and solves again; also of a bank",
    )
    add(
        "--remove",
        default="",
        metavar="SIDE",
        help="where material goes: z-min (default) or z-max of a bar; inside (default) or outside of an outline; outer, inner or all "
        "(default) of a map",
    )
    add("--wall", type=length, metavar="LENGTH", help="least wall left, like 3mm (default: a quarter of the thickness)")
    add("--most", type=length, metavar="LENGTH", help="deepest local cut (default: 0.5mm)")
    add("--knots", type=int, metavar="N", help="depths along half of a bar (default: 6), along an outline (8); of a map: cuts (42)")
    add("--cents", type=float, help="largest distance from a wish (default: 0.2)")
    add("--tolerance", type=length, metavar="LENGTH", help="of the milling, for the guarantee (default: 0.02mm)")
    add("--bin", metavar="FOLDER", help="folder of carillon-precompute (default: next to this program)")
    add("--json", action="store_true", help="print the result as one JSON document")


def check_ways(options):
    """InputError for options that contradict each other."""
    given = {
        name
        for name in {*WAYS, *WISHES, "--keep", "--most", "--wall", "--knots", "--remove", "--tolerance"} - {""}
        if getattr(options, name[2:].replace("-", "_")) not in (None, "", [], False)
    }
    way = next((name for name in WAYS if name in given), "")
    if wrong := sorted(given - WAYS[way] - {way}):
        raise InputError(f"{wrong[0]} has no effect on {f'a tuning by {way}' if way else 'an undercut bar'}; leave one of them out")
    if options.hz and options.fundamental:
        raise InputError("--fundamental has no effect on --hz, which gives frequencies; leave one of them out")


def run(options):
    """(text, document) of the command."""
    cents = CENTS if options.cents is None else options.cents
    if not 0.001 <= cents <= 100:
        raise InputError("--cents: between 0.001 and 100")
    if options.knots is not None and not 1 <= options.knots <= 400:
        raise InputError("--knots: between 1 and 400")
    check_ways(options)
    if options.cuts:
        return recut.run(options)
    job = read_job(options.job)
    wall, tolerance = options.wall, options.tolerance or TOLERANCE_M
    say = (lambda text: None) if options.json else (lambda text: print(text, flush=True))
    solver = Solver(programs.find_program(options.bin), options.job)
    with results.make_folder(options.out, results.FILES) as out, tempfile.TemporaryDirectory(prefix="carillon-tune-") as name:
        folder = pathlib.Path(name)
        aparts = [targets.read_apart(text) for text in options.apart]
        search = steps.Search(solver, [], aparts, cents, folder, say)
        mesher = programs.find_program(options.bin, "carillon-mesh")
        if options.close_pairs or options.map:
            mesh = shapes.read_mesh(job, options.job, folder, mesher)
            body = shapes.make_map(job, mesh, options.knots or 42, options.most or MOST_M, options.remove or "all", wall)
            make_body, start_p = lambda fineness: body, numpy.zeros(len(body.names))
        elif options.outline:
            rows, knots = shapes.read_outline(options.outline), options.knots or 8
            make_body = lambda fineness: shapes.make_lathe(job, rows, fineness, knots, options.remove or "inside", wall)
            start_p = numpy.zeros(knots)
        elif options.free:
            limits = shapes.read_limits(options.free, job)
            make_mesh = lambda changed: shapes.read_mesh(changed, options.job, folder, mesher)
            make_body = lambda fineness: shapes.Keys(job, limits, fineness, make_mesh)
            start_p = numpy.log([job["body"][name.removeprefix("body.")] for name in limits])
        else:
            knots = options.knots or 6
            make_body = lambda fineness: shapes.make_undercut(job, fineness, knots, options.remove or "z-min", wall)
            start_p = numpy.zeros(knots)
        if options.close_pairs:
            outcome = search.close(body, read_counts(options.close_pairs), read_counts(options.keep))
        else:
            search.set_wishes(targets.read_wishes(options, "" if options.map or options.free or options.outline else "bending"))
            outcome = search.tune(make_body, start_p)
        return report(options, outcome, search.wishes, tolerance, solver, out)


def read_counts(text):
    """[int] of numbers from 1; InputError."""
    try:
        numbers = [int(word) for word in text.split(",")] if text else []
    except ValueError:
        numbers = [0]
    if min(numbers, default=1) < 1 or len(set(numbers)) != len(numbers):
        raise InputError(f"{text!r}: give different numbers from 1, like 1,2")
    return numbers


def report(options, outcome, wishes, tolerance, solver, out):
    last, body = outcome.last, outcome.body
    values, by_p = body.show(last.p)
    rates = outcome.jacobian / by_p
    milling = numpy.abs(rates[:, body.is_length]).sum(axis=1) * tolerance
    names = [wish.mode for wish in wishes] or [f"pair at {hz:.1f} Hz" for hz in last.hz]
    sure = numpy.abs(last.off_cents) + milling + (last.bars if wishes else 0)
    columns = {
        "before_hz": outcome.first.hz,
        "wish_hz": numpy.array([wish.hz for wish in wishes] or last.hz),
        "after_hz": last.hz,
        "off_before_cents": outcome.first.off_cents,
        "off_cents": last.off_cents,
        "bar_cents": last.bars,
        "milling_cents": milling,
        "guarantee_cents": sure,
    }
    modes = [{"mode": name or last.solution.kinds[last.groups[k][0]]} for k, name in enumerate(names)]
    for k, mode in enumerate(modes):
        mode |= {key: float(column[k]) for key, column in columns.items()} | {"cents_per_unit": rates[k].tolist()}
    rows = [["mode", "before Hz", "wish Hz", "after Hz", "off before", "off", "bar", "milling", "guarantee"]]
    rows += [[mode["mode"], *(f"{mode[key]:{'+' if 'off' in key else ''}.2f}" for key in columns)] for mode in modes]
    units = numpy.where(body.is_length, 1e-4, 0.01 * values)
    depths = [["parameter", "value", *(f"cents, {mode['mode']}" for mode in modes)]]
    for k, (name, value) in enumerate(zip(body.names, values)):
        if value > 1e-6 or body.smooth:
            shown = f"{1e3 * value:.3f} mm" if body.is_length[k] else f"{value:.6g}"
            depths.append([name, shown, *(f"{units[k] * row[k]:+.2f}" for row in rates)])
    table = measuring.format_table(rows)
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu_s = sum(one.ru_utime + one.ru_stime for one in used)
    text = [
        table,
        "off, bar, milling, guarantee in cents: from the wish (of pairs: beats); of the body's true frequency; for +-"
        f"{1e3 * tolerance:g} mm everywhere; the sum of the three",
        "",
        measuring.format_table(depths),
        "cents: for 0.1 mm more" + ("" if body.is_length.all() else ", of other values 1 %"),
        f"{solver.solves} solve{'s' if solver.solves != 1 else ''}, {cpu_s:.1f} CPU s",
    ]
    if not outcome.reached:
        text.append(f"not reached: {outcome.obstacle}")
    lines = table.splitlines()
    results.write_files(out, outcome, options.job, [lines[0], *lines[2:]])
    (out / "table.txt").write_text("\n".join(text) + "\n")
    for mode in modes:  # JSON has no infinity: an unknown bar
        mode |= {key: mode[key] if math.isfinite(mode[key]) else None for key in columns}
    document = {
        "exit_code": 0 if outcome.reached else NOT_REACHED,
        "modes": modes,
        "parameters": dict(zip(body.names, values.tolist())),
        "obstacle": outcome.obstacle,
        "solves": solver.solves,
        "cpu_seconds": cpu_s,
        "steps": [{"mesh": mesh, "off_cents": off, "parameters": p} for mesh, off, p in outcome.steps],
    }
    (out / "tune.json").write_text(json.dumps(document, indent=1) + "\n")
    text.append(", ".join(str(path) for path in sorted(out.iterdir())))
    return "\n".join(text), document
