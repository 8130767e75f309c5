#!/usr/bin/env python3
"""All headers compile by themselves, without the precompiled one; through ccache if installed.

usage: headers_stand_alone.py [-j N] SOURCE_DIR BUILD_DIR     BUILD_DIR: cmake --preset tidy, whose commands are those of single sources
"""
import argparse
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

parser = argparse.ArgumentParser(usage=__doc__)
parser.add_argument("source", type=lambda text: pathlib.Path(text).resolve())
parser.add_argument("build", type=pathlib.Path)
parser.add_argument("-j", dest="jobs", type=int, default=2)
options = parser.parse_args()

# Compile options of the files of each folder; there may be several sets.
ways = {}
for command in json.loads((options.build / "compile_commands.json").read_text()):
    words = shlex.split(command["command"])
    kept = []
    for i, word in enumerate(words):
        if word.startswith(("-I", "-D", "-std")):
            kept.append(word)
        elif word == "-isystem":
            kept += [word, words[i + 1]]
    known = ways.setdefault(pathlib.Path(command["file"]).parent, [])
    if kept not in known:
        known.append(kept)


launcher = ["ccache"] if shutil.which("ccache") else []
environment = os.environ | {"CCACHE_BASEDIR": str(options.source), "CCACHE_NOHASHDIR": "1"}
objects = tempfile.TemporaryDirectory()


def check(header):
    errors = "its folder has no compiled source"
    for way in ways.get(header.parent, []):
        out = pathlib.Path(objects.name) / f"{abs(hash(header))}.o"
        command = [*launcher, "clang++", "-c", "-o", out, "-Wno-pragma-once-outside-header", "-x", "c++", *way, header]
        result = subprocess.run(command, capture_output=True, text=True, env=environment)
        out.unlink(missing_ok=True)
        if result.returncode == 0:
            return None
        errors = result.stderr[:600]
    return f"{header.relative_to(options.source)}: does not compile by itself\n{errors}"


headers = [h for top in ("runtime", "precompute", "partition", "jobs") for h in sorted((options.source / top).rglob("*.hpp"))]
with ThreadPoolExecutor(options.jobs) as pool:
    failures = [message for message in pool.map(check, headers) if message]
print("\n".join(failures) or f"{len(headers)} headers stand alone")
sys.exit(1 if failures or not headers else 0)
