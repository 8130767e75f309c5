"""Command line of carillon-draw."""
import argparse
import errno
import json
import math
import os
import pathlib
import sys

from common import STANDARD_OUTPUT, InputError, SystemError_, printable
from display import open_display
from inputs import Bank, Motion, Multipoles, Sensitivities, Trajectory


def parse_factor(text):
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0 < factor <= 1e9:
        raise InputError(f"--exaggerate {text}: not a factor; give a number above 0 and up to 1e9, 1 for none")
    return factor


def parse_moments(text):
    if not (text.isdecimal() and 1 <= int(text) <= 24):
        raise InputError(f"--moments {text}: not a number of pictures; give an integer from 1 to 24")
    return int(text)


def check_motion_outputs(arguments):
    if arguments.output is None and arguments.frames is None:
        raise InputError("motion: no output; give -o OUT.png, --frames DIR, or both")
    folder = arguments.frames
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: a file; give the name of a folder")
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: not empty; give an empty or new folder")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"{folder.absolute().parent}: no such folder; make it first")


def parse_modes(text, bank):
    count = len(bank.freq_hz)
    if count == 0:
        raise InputError(f"{bank.path}: the bank has no modes to draw; compute one with a wider band_hz")
    if text is None:
        return list(range(1, min(3, count) + 1))
    numbers = []
    for word in text.split(","):
        if not word.strip().isdigit():
            raise InputError(f"--modes {text}: '{word}' is not a mode number; give numbers from 1 to {count}, such as 1,2,3")
        number = int(word)
        if not 1 <= number <= count:
            raise InputError(f"--modes {text}: no mode {number} in {bank.path}, which has {count}; give numbers from 1 to {count}")
        numbers.append(number)
    if len(numbers) > 12:
        raise InputError(f"--modes {text}: {len(numbers)} modes are too many for one picture; give at most 12")
    return numbers


def check_output(path):
    if path == STANDARD_OUTPUT:
        if sys.stdout.isatty():
            raise InputError("-: standard output is a terminal; redirect it to a file or another program")
        return
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: not a PNG name; use one that ends in .png, or - for standard output")
    if path.is_dir():
        raise InputError(f"{path}: a folder; give the name of a file")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: no such folder; make it first")


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise InputError(f"{message}; see {self.prog} --help")


def make_parser(version):
    parser = Parser(prog="carillon-draw", description="Draws mode banks, simulated scenes and simulations.")
    parser.add_argument("--version", action="version", version=f"carillon-draw {version}")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="modes|sensitivities|directivity|scene|motion", parser_class=Parser
    )
    modes_words = commands.add_parser("modes", help="modes of a bank as deformed bodies", allow_abbrev=False)
    directivity_words = commands.add_parser("directivity", help="far-field level of each mode by direction", allow_abbrev=False)
    sensitivity_words = commands.add_parser(
        "sensitivities", help="where removed material raises or lowers the frequency of each mode", allow_abbrev=False
    )
    modes_words.add_argument("bank", metavar="BANK")
    sensitivity_words.add_argument("bank", metavar="BANK", help='of a job with "sensitivities"')
    directivity_words.add_argument("bank", metavar="BANK", help="with multipoles, as carillon-precompute --radiate writes it")
    for command in (modes_words, sensitivity_words, directivity_words):
        command.add_argument("-o", "--output", required=True, type=pathlib.Path, metavar="OUT.png")
        command.add_argument("--modes", metavar="1,2,3", help="mode numbers, from 1 [the first three]")
        command.add_argument("--up", choices="xyz", default="y", help="axis of the mesh that points up [y]")
    scene_words = commands.add_parser("scene", help="bodies of a simulated scene along their paths", allow_abbrev=False)
    scene_words.add_argument("trajectory", metavar="TRAJECTORY.json", help="written by carillon-render --trajectory")
    scene_words.add_argument("-o", "--output", required=True, type=pathlib.Path, metavar="OUT.png")
    motion_words = commands.add_parser("motion", help="deforming bodies of carillon-simulate", allow_abbrev=False)
    motion_words.add_argument("motion", metavar="MOTION.vtkhdf", help="written by carillon-simulate --motion")
    motion_words.add_argument("-o", "--output", type=pathlib.Path, metavar="OUT.png", help="moments side by side")
    motion_words.add_argument("--moments", default="6", metavar="N", help="number of moments, from the first frame to the last [6]")
    motion_words.add_argument("--exaggerate", default="1", metavar="F", help="factor of the displacements from the first frame [1]")
    motion_words.add_argument("--colour", choices=["speed", "displacement"], default="speed", help="quantity shown by colours [speed]")
    motion_words.add_argument("--up", choices="xyz", default="z", help="axis that points up [z]")
    motion_words.add_argument("--frames", type=pathlib.Path, metavar="DIR", help="write all frames to this folder, 00001.png and so on")
    for command in (modes_words, sensitivity_words, directivity_words, scene_words, motion_words):
        command.add_argument("--result", type=pathlib.Path, metavar="FILE", help="write the outcome to this file, a JSON object")
    return parser


def run(version):
    arguments = make_parser(version).parse_args()

    if arguments.output is not None:
        check_output(arguments.output)
    if arguments.command == "motion":
        check_motion_outputs(arguments)
        moments, factor = parse_moments(arguments.moments), parse_factor(arguments.exaggerate)
        frames_of = Motion(arguments.motion)
    elif arguments.command == "scene":
        trajectory = Trajectory(arguments.trajectory)
    else:
        bank = Bank(arguments.bank)
        air = Multipoles(bank) if arguments.command == "directivity" else None
        densities = Sensitivities(bank) if arguments.command == "sensitivities" else None
        numbers = parse_modes(arguments.modes, bank)
        if densities and max(numbers) > densities.count:
            raise InputError(f"{bank.path}: has sensitivities of the {densities.count} lowest modes, and not of mode {max(numbers)}")
    open_display()
    import picture  # VTK needs the display

    if arguments.command == "modes":
        import modes as drawing

        image = drawing.draw_modes(bank, numbers, "xyz".index(arguments.up))
    elif arguments.command == "sensitivities":
        import sensitivities as drawing

        image = drawing.draw_sensitivities(bank, densities, numbers, "xyz".index(arguments.up))
    elif arguments.command == "directivity":
        import directivity as drawing

        image = drawing.draw_directivity(bank, air, numbers, "xyz".index(arguments.up))
    elif arguments.command == "motion":
        import motion as drawing

        up = "xyz".index(arguments.up)
        image = drawing.draw_moments(frames_of, moments, up, arguments.colour, factor) if arguments.output is not None else None
        if arguments.frames is not None:
            count, width, height = drawing.write_frames(frames_of, arguments.frames, up, arguments.colour, factor)
            out = sys.stderr if arguments.output == STANDARD_OUTPUT else sys.stdout
            print(f"{printable(arguments.frames)}: {count} frames of {width} x {height} pixels", file=out)
        if image is None:
            return
    else:
        import scene as drawing

        image = drawing.draw_scene(trajectory)
    picture.write_png(image, arguments.output)
    piped = arguments.output == STANDARD_OUTPUT
    print(
        f"{'standard output' if piped else printable(arguments.output)}: {image.shape[1]} x {image.shape[0]} pixels",
        file=sys.stderr if piped else sys.stdout,
    )


def find_result_file(words):
    """The file of --result, even for an invalid command line; None if absent."""
    for word, following in zip(words, [*words[1:], None]):
        if word == "--result":
            return following
        if word.startswith("--result="):
            return word.partition("=")[2]
    return None


def write_result(file, kind, message):
    """Writes the outcome atomically (runtime/base/result.hpp). Write errors are ignored: the exit code has the outcome too."""
    if not file:
        return
    temporary = f"{file}.tmp.{os.getpid()}"
    try:
        with open(temporary, "x", encoding="utf-8") as out:
            json.dump({"kind": kind, **({"message": message} if message else {}), "resumable": False}, out)
        os.replace(temporary, file)
    except OSError:
        pass


def describe_error(error):
    """Kind, message and exit code of an exception."""
    if isinstance(error, InputError):
        return "bad-input", str(error), 2
    if isinstance(error, MemoryError):
        return "memory", "out of memory; close other programs", 4
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "disk-full", str(error), 4
    if isinstance(error, (SystemError_, ImportError, OSError)):
        return "system", str(error), 4
    # Unexpected values.
    return "bad-input", f"cannot be drawn ({type(error).__name__}: {error}); run carillon-bank check on its banks", 2


def main(version="unknown"):
    file = find_result_file(sys.argv[1:])
    try:
        run(version)
    except Exception as error:
        kind, message, code = describe_error(error)
        print(f"carillon-draw: {printable(message)}", file=sys.stderr)
        write_result(file, kind, message)
        return code
    write_result(file, "done", "")
    return 0
