#!/usr/bin/env python3
"""Every header of ours compiles by itself: what a source file of its own folder includes before anything else has done so in the build; the
others are compiled here.

usage: headers_stand_alone.py SOURCE_DIR BUILD_DIR COMPILER
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

source, build, compiler = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]

# The ways in which the files of each folder of ours are compiled, from the build's own commands. There may be several.
flags = {}
proven = set()
for command in json.loads((build / "compile_commands.json").read_text()):
    folder = pathlib.Path(command["file"]).parent
    words = shlex.split(command["command"])
    kept = []
    for i, word in enumerate(words):
        if word.startswith(("-I", "-D", "-std")):
            kept.append(word)
        elif word == "-isystem":
            kept += [word, words[i + 1]]
    if kept not in flags.setdefault(folder, []):
        flags[folder].append(kept)
    directive = re.search(r'^\s*#\s*(\w+)\s*"?([^"\n]*)', pathlib.Path(command["file"]).read_text(), re.M)
    if directive and directive.group(1) == "include" and (source / directive.group(2)).parent == folder:
        proven.add(source / directive.group(2))


def check(header):
    errors = ""
    for way in flags.get(header.parent, []):
        result = subprocess.run([compiler, "-fsyntax-only", "-x", "c++", *way, str(header)], capture_output=True, text=True)
        if result.returncode == 0:
            return None
        errors = result.stderr[:600]
    return f"{header.relative_to(source)}: does not compile by itself\n{errors}" if errors else None


headers = [h for top in ("runtime", "precompute", "partition", "jobs") for h in sorted((source / top).rglob("*.hpp"))]
others = [header for header in headers if header not in proven]
with ThreadPoolExecutor(2) as pool:
    failures = [message for message in pool.map(check, others) if message]
print("\n".join(failures) if failures else f"{len(headers)} headers stand alone, {len(headers) - len(others)} of them in the build")
sys.exit(1 if failures or not headers else 0)
