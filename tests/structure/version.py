#!/usr/bin/env python3
"""One version: CMakeLists.txt, CITATION.cff and the first heading of CHANGELOG.md.

usage: version.py SOURCE_DIR
"""
import pathlib
import re
import sys

PLACES = {"CMakeLists.txt": r"^project\(carillon VERSION (\S+) ", "CITATION.cff": r"^version: (\S+)$", "CHANGELOG.md": r"^## (\S+)$"}
source = pathlib.Path(sys.argv[1])
found = {name: re.search(pattern, (source / name).read_text(), re.M)[1] for name, pattern in PLACES.items()}
print(", ".join(f"{name}: {version}" for name, version in found.items()))
sys.exit(0 if len(set(found.values())) == 1 else 1)
