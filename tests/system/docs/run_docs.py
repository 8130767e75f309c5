#!/usr/bin/python3
"""Runs the shell commands of a page of the docs, in order, in an empty folder: what the docs show works.

usage: run_docs.py PAGE.md BIN_DIR

Blocks fenced as ```sh are run with `bash -e`; blocks fenced as ```json NAME, ```python NAME or ```text NAME are written to the file NAME
first, in the order in which they stand. Blocks of another kind (```console) or without a name are shown, not run. Inside a page,
`carillon-...` is the build under test.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

page, bin_dir = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
blocks = re.findall(r"^```(\w+)(?: +(\S+))?\n(.*?)^```$", page.read_text(), re.M | re.S)
environment = {**os.environ, "PATH": f"{bin_dir}:/usr/bin:/bin:{os.environ['PATH']}"}
ran = 0
with tempfile.TemporaryDirectory(prefix="carillon-docs-") as folder:
    environment["XDG_CACHE_HOME"] = f"{folder}/.cache"
    for kind, name, text in blocks:
        if kind in ("json", "python", "text") and name:
            target = pathlib.Path(folder) / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text)
        elif kind == "sh":
            result = subprocess.run(["bash", "-euo", "pipefail", "-c", text], cwd=folder, env=environment, stdin=subprocess.DEVNULL)
            ran += 1
            if result.returncode != 0:
                print(f"{page}: this block fails with exit code {result.returncode}:\n{text}")
                sys.exit(1)
print(f"{page.name}: {ran} blocks ran")
sys.exit(0 if ran else 1)
