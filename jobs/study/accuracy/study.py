"""`carillon-study accuracy`: which sections, on which bodies, in which order."""
import importlib
import pathlib
import shlex

import programs
from accuracy import bodies, report
from accuracy.lab import Lab
from errors import InputError

# One module a section, each with study(lab, bodies) -> Section and PROGRAMS, the programs it starts.
SECTIONS = ("elements", "corrected", "walls", "solver", "banks", "air", "motion", "playing", "contact", "papers", "advice")


def add_command(commands, read_count):
    """The subcommand and its options."""
    one = commands.add_parser(
        "accuracy",
        help="what accuracy costs in time: elements, mesh, solver, bank and runtime, as error against CPU seconds",
        description=(
            "Measures errors against CPU seconds on bodies whose frequencies are known without any finite element, and on the hollow bunny;"
            " writes a report (report.md, report.html, and a CSV next to each picture and table). What was measured is kept in OUT/work: a"
            " study that was stopped continues where it was, and a section more costs that section only."
        ),
        epilog=f"Bodies: {', '.join(bodies.make_bodies())}. Sections: {', '.join(SECTIONS)}.",
    )
    one.add_argument("-o", "--out", metavar="REPORT", default="accuracy", help="where everything goes (default: accuracy)")
    one.add_argument(
        "--quick", action="store_true", help="small meshes, one repeat, unless given otherwise: a minute instead of half an hour"
    )
    one.add_argument("--on", nargs="+", metavar="BODY", help="these bodies only (default: all)")
    one.add_argument("--only", nargs="+", metavar="SECTION", help="these sections only (default: all)")
    one.add_argument("--repeats", type=read_count, help="of every case, all cases in turn (default: 2; with --quick 1)")
    one.add_argument(
        "--surface",
        metavar="FILE",
        default=bodies.BUNNY_SURFACE,
        help=f"the bunny's surface (default: {bodies.BUNNY_SURFACE}, of Debian's glmark2-data)",
    )
    one.add_argument("--timeout", type=programs.read_seconds, default=3600, help="seconds that one run may take (default: 3600)")
    one.add_argument("--write-advice", metavar="FILE", help="also write what carillon study advise predicts from, for its --advice")
    one.add_argument("--bin", metavar="FOLDER", help="where the programs are (default: next to this one)")
    one.add_argument(
        "--json", action="store_true", help="one JSON document on standard output: the report's path and what it says in words"
    )


def run(options):
    """Returns {"report": path, "findings": {section: [sentences]}}. Raises InputError, RunError."""
    chosen = list(dict.fromkeys(options.only or SECTIONS))
    for name in chosen:
        if name not in SECTIONS:
            raise InputError(f"--only {name}: there is no such section; choose among {', '.join(SECTIONS)}")
    chosen.sort(key=SECTIONS.index)  # the recommendation rests on what the others found
    on = bodies.choose(options.on, options.surface, options.quick)
    modules = {name: importlib.import_module(f"accuracy.{name}") for name in chosen}  # some need numpy
    advice = importlib.import_module("accuracy.advice") if options.write_advice else None
    found = programs.find_all(
        options.bin, [program for module in [*modules.values(), *filter(None, [advice])] for program in module.PROGRAMS]
    )
    if advice:
        advice.check_path(pathlib.Path(options.write_advice))  # before half an hour of work, not after it
    lab = Lab(options.out, found, options.quick, options.repeats, options.surface, options.timeout, options.on)
    if not options.on and len(on) < len(bodies.make_bodies()):
        lab.say(
            "--quick goes without the bunny, whose thin wall takes many nodes; --on bunny has it"
            if options.quick
            else (
                f"{options.surface} is not there: the study goes without the bunny; install glmark2-data, or give the surface with"
                " --surface"
            )
        )
    sections = []
    for number, (name, module) in enumerate(modules.items()):
        lab.say(f"section {number + 1} of {len(modules)}: {name}")
        sections.append(module.study(lab, on))
    words = [
        "carillon",
        "study",
        "accuracy",
        *(["--quick"] if options.quick else []),
        *(["--on", *options.on] if options.on else []),
        *(["--only", *options.only] if options.only else []),
        *(["--repeats", str(options.repeats)] if options.repeats else []),
        "-o",
        "REPORT",
    ]
    if advice:
        advice.write(lab, on, pathlib.Path(options.write_advice))
    page = report.write(lab, sections, shlex.join(words))
    return {"report": str(page), "findings": {section.name: section.findings for section in sections}}
