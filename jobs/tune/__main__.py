"""carillon-tune: bodies matched to recordings, and tuned to wished frequencies.

    carillon-tune match JOB.json SOUND.wav|PEAKS.csv [-o FOLDER] [--mass 0.2126kg] [--tolerance 0.05mm]
    carillon-tune tune JOB.json --partials 1,4,10 --fundamental 185 --wall 3mm [-o FOLDER]
    carillon-tune sensitivity BANK [--cut 0.1mm] [--at X,Y,Z --radius 10mm] [-o map.csv|png|glb]

Exit codes: 0 done, 2 bad input, 3 a solve failed, 4 system error, 5 tuned as far as possible, wishes not reached.
"""
import argparse
import json
import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: threads gain nothing on matrices of this size

try:
    import match
    import sensitivity
    import tune
except ImportError as error:
    print(f"carillon-tune: error: {error}; install python3-numpy, python3-scipy and python3-h5py", file=sys.stderr)
    sys.exit(4)
import programs
from errors import Parser

VERSION = "unknown"  # set by the build


def make_parser():
    parser = Parser(prog="carillon-tune", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"carillon-tune {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    match.add_command(commands)
    sensitivity.add_command(commands)
    tune.add_command(commands)
    return parser


def run(arguments):
    options = make_parser().parse_args(arguments)
    text, document = options.run(options)
    print(json.dumps(document, indent=2) if options.json else text)
    return document.get("exit_code", 0)


if __name__ == "__main__":
    sys.exit(programs.run_main("carillon-tune", run))
