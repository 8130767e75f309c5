"""carillon-study: scaling of a job with its mesh and with ranks, and mesh settings for a given accuracy.

    carillon-study scaling JOB.json [-o FOLDER] [--ranks 1,2,4] [--nodes 2500,5000,10000] [--repeats 3]
    carillon-study scaling JOB.json --quick --record FILE | --check FILE
    carillon-study advise BODY --cents 5 [--seconds 10]

Exit codes: 0 done, 2 bad input, 3 the work has grown, 4 system error.
"""
import argparse
import contextlib
import json
import sys

import advise
import programs
import report
import scaling
import work
from errors import InputError, Parser

VERSION = "unknown"  # set by the build


def read_numbers(name, least):
    def read(text):
        try:
            numbers = sorted({int(word) for word in text.split(",")})
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r}: give whole numbers separated by commas, like 1,2,4")
        if numbers[0] < least:
            raise argparse.ArgumentTypeError(f"{numbers[0]}: {name} are {least} or more")
        return numbers

    return read


def read_count(text):
    numbers = read_numbers("repeats", 1)(text)
    if len(numbers) != 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give one number")
    return numbers[0]


def make_parser():
    parser = Parser(prog="carillon-study", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"carillon-study {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    one = commands.add_parser(
        "scaling",
        help="strong and weak scaling, growth with the mesh, and what limits each phase",
        description='Solves a job on several numbers of ranks and, where the job has a "body", on meshes of several sizes; writes a report '
        '(report.md, cases.csv and SVG pictures). A job with a "mesh" file has one mesh, and gets strong scaling only.',
    )
    one.add_argument("job", metavar="JOB.json", help="a job of carillon-precompute")
    one.add_argument("-o", "--out", metavar="FOLDER", default="study", help="output folder (default: study)")
    one.add_argument(
        "--ranks", type=read_numbers("ranks", 1), metavar="1,2,4", help="numbers of ranks (default: 1,2,4); more than the cores are marked"
    )
    one.add_argument(
        "--nodes",
        "--sizes",
        dest="nodes",
        type=read_numbers("nodes", 8),
        metavar="N,N,N",
        help="meshes of the body; the largest serves for strong scaling (default: a quarter, half and all of the job's)",
    )
    one.add_argument("--repeats", type=read_count, help="repeats of every case, all cases in turn (default: 3)")
    one.add_argument("--quick", action="store_true", help="meshes of 600 and 1200 nodes, 1 and 2 ranks, one repeat, unless given otherwise")
    one.add_argument("--record", metavar="FILE", help="write the work per phase (operations, messages, bytes) to this file")
    one.add_argument(
        "--check", metavar="FILE", help="compare the work per phase with this file, and fail if it has grown by more than 5 %%"
    )
    one.add_argument("--timeout", type=programs.read_seconds, default=3600, help="limit of one run in seconds (default: 3600)")
    one.add_argument("--bin", metavar="FOLDER", help="folder of carillon-precompute (default: next to this program)")
    one.add_argument(
        "--json",
        action="store_true",
        help="print one JSON document: path of the report and work of every case; other output goes to standard error",
    )
    advise.add_command(commands)
    return parser


def run(arguments):
    options = make_parser().parse_args(arguments)
    if options.command == "advise":
        return advise.run(options)
    if not options.json:
        run_study(options)
        return 0
    with contextlib.redirect_stdout(sys.stderr):
        made = run_study(options)
    print(json.dumps({"report": str((made.out / "report.md").resolve()), "cases": work.collect(made)}, indent=2))
    return 0


def run_study(options):
    if options.record and options.check:
        raise InputError("--record and --check exclude each other: one writes what the other reads")
    recorded = work.read(options.check) if options.check else None
    made = scaling.Study(options, programs.find_program(options.bin))
    made.run()
    report.write(made)
    print(f"{made.out / 'report.md'}", flush=True)
    if options.record:
        work.write(options.record, made)
        print(f"{options.record}: the work of {len(made.cases)} cases", flush=True)
    if recorded is not None:
        work.check(recorded, made, options)
    return made


if __name__ == "__main__":
    sys.exit(programs.run_main("carillon-study", run, "study"))
