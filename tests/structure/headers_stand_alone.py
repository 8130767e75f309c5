#!/usr/bin/env python3
"""Every header of ours compiles by itself.   usage: headers_stand_alone.py SOURCE_DIR BUILD_DIR COMPILER"""
import json
import pathlib
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

source, build, compiler = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), sys.argv[3]

# The include folders of each folder of ours, from the build's own commands.
flags = {}
for command in json.loads((build / "compile_commands.json").read_text()):
    folder = pathlib.Path(command["file"]).parent
    words = shlex.split(command["command"])
    kept = []
    for i, word in enumerate(words):
        if word.startswith(("-I", "-D", "-std")):
            kept.append(word)
        elif word == "-isystem":
            kept += [word, words[i + 1]]
    flags.setdefault(folder, kept)


def check(header):
    if header.parent not in flags:
        return None
    result = subprocess.run([compiler, "-fsyntax-only", "-x", "c++", *flags[header.parent], str(header)], capture_output=True, text=True)
    return None if result.returncode == 0 else f"{header.relative_to(source)}: does not compile by itself\n{result.stderr[:600]}"


headers = [h for top in ("runtime", "precompute", "partition", "jobs") for h in sorted((source / top).rglob("*.hpp"))]
with ThreadPoolExecutor(2) as pool:
    failures = [message for message in pool.map(check, headers) if message]
print("\n".join(failures) if failures else f"{len(headers)} headers stand alone")
sys.exit(1 if failures or not headers else 0)
