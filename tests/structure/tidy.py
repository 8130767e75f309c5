#!/usr/bin/env python3
"""clang-tidy (.clang-tidy, and clang's own warnings) over the product's sources, by the compile commands of a build.

usage: tidy.py [-j N] SOURCE_DIR BUILD_DIR [FOLDER...]        folders: runtime jobs ..., default all; exit 1 and one line per place
"""
import argparse
import concurrent.futures
import json
import pathlib
import re
import resource
import shlex
import subprocess
import sys
import tempfile

TOPS = ("runtime", "partition", "jobs", "precompute")
PLACE = re.compile(r"(.+?:\d+:\d+): (?:warning|error): (.+)")


def read_commands(source, build, folders):
    """Compile commands of the sources below the folders for clang: no launcher, no precompiled header, no -Werror."""
    chosen = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        path = pathlib.Path(entry["file"])
        if not any(path.is_relative_to(source / folder) for folder in folders):
            continue
        words = shlex.split(entry["command"])
        words = words[1:] if pathlib.Path(words[0]).name == "ccache" else words
        command = re.sub(r"-Winvalid-pch |-include \S*/cmake_pch\.hxx |-Werror |-Wno-error=\S+ ", "", shlex.join(words))
        chosen.setdefault(str(path), {"directory": entry["directory"], "file": str(path), "command": command})
    return chosen


def find_places(folder, path):
    done = subprocess.run(["clang-tidy", "-p", folder, "--quiet", path], capture_output=True, text=True)
    places = [f"{match[1]}: {match[2]}" for match in map(PLACE.match, done.stdout.splitlines()) if match]
    return places or ([f"{path}: clang-tidy failed: {done.stderr.strip()[-400:]}"] if done.returncode else [])


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("source", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("folders", nargs="*", default=TOPS)
    parser.add_argument("-j", dest="jobs", type=int, default=2)
    options = parser.parse_args()
    commands = read_commands(options.source, options.build, options.folders)
    if not commands:
        sys.exit(f"{options.build}: no compile commands of {' '.join(options.folders)}")
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        (pathlib.Path(folder) / "compile_commands.json").write_text(json.dumps(list(commands.values())))
        places = {place for found in pool.map(lambda path: find_places(folder, path), commands) for place in found}
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print("\n".join(sorted(places)) if places else "no fault")
    print(f"{len(commands)} sources, {used.ru_utime + used.ru_stime:.0f} CPU s")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
