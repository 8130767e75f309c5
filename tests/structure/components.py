#!/usr/bin/env python3
"""docs/components.md against deploy/cmake/Components.cmake and the tree; and what a build without components compiles.

usage: components.py SOURCE_DIR                    exit 1 and one line a fault; lines of code within a tenth
       components.py SOURCE_DIR --update           writes the lines of code
       components.py SOURCE_DIR --built BUILD_DIR  exit 1 and one line for each source of a component that is OFF and is compiled
"""
import json
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from include_law import COMPONENTS, find_component
from size import count_components

ROW = re.compile(r"^\| `CARILLON_(\w+)` \| `component\.(\w+)` \| [^|]+ \| ([^|]+) \| ([\d,]+) \| \[[^|]*\]\(([^)#|]+)[^|]*\) \|$", re.M)
CORE = re.compile(r"^\| core \| - \| [^|]+ \| [^|]+ \| ([\d,]+) \|", re.M)


def find_faults(page, source):
    lines = count_components(source)
    rows = {name: rest for name, *rest in ROW.findall(page)}
    faults = [f"no row for {name}" for name in set(COMPONENTS) - set(rows)]
    faults += [f"CARILLON_{name} is no option of Components.cmake" for name in set(rows) - set(COMPONENTS)]
    written = {None: (CORE.search(page) or ["", "0"])[1]}
    for name in set(rows) & set(COMPONENTS):
        label, folders, written[name], link = rows[name]
        if label != name.lower():
            faults.append(f"{name}: the label is component.{name.lower()}")
        for folder in re.findall(r"`([a-z_0-9/]+)`", folders):
            if find_component(folder + "/x") != name and not any(path.startswith(folder + "/") for path in COMPONENTS[name]):
                faults.append(f"{name}: {folder} is not its folder")
        if not (source / "docs" / link).is_file():
            faults.append(f"{name}: there is no page {link}")
    for name, count in written.items():
        if abs(int(count.replace(",", "")) - lines[name]) > 0.1 * lines[name]:
            faults.append(f"{name or 'core'}: {lines[name]} lines, not {count}; run tests/structure/components.py . --update")
    return [f"docs/components.md: {fault}" for fault in sorted(faults)]


def update(page, source):
    lines = count_components(source)
    page = ROW.sub(lambda row: row[0].replace(f"| {row[4]} |", f"| {round(lines[row[1]], -1):,} |"), page)
    return CORE.sub(lambda row: row[0].replace(f"| {row[1]} |", f"| {round(lines[None], -1):,} |"), page)


def find_compiled(source, build):
    """Sources of OFF components in the build: compiled alone, or in a unit that includes them."""
    cache = (build / "CMakeCache.txt").read_text()
    off = {name for name in COMPONENTS if re.search(rf"^CARILLON_{name}:BOOL=OFF$", cache, re.M)}
    sources = set()
    for command in json.loads((build / "compile_commands.json").read_text()):
        file = pathlib.Path(command["file"])
        names = re.findall(r'^#include "(.+)"', file.read_text(), re.M) if build / "units" in file.parents else [str(file)]
        for path in map(pathlib.Path, names):
            root = next((root for root in (build, source) if root in path.parents), pathlib.Path())  # the build has generated sources
            sources.add(str(path.relative_to(root)))
    return [
        f"{path} is compiled without {find_component(path)}"
        for path in sorted(sources)
        if find_component(path) in off and not path.endswith("_absent.cpp")
    ]


def main():
    source = pathlib.Path(sys.argv[1])
    path = source / "docs/components.md"
    if sys.argv[2:3] == ["--built"]:
        faults = find_compiled(source.resolve(), pathlib.Path(sys.argv[3]).resolve())
    else:
        if sys.argv[2:] == ["--update"]:
            path.write_text(update(path.read_text(), source))
        faults = find_faults(path.read_text(), source)
    print("\n".join(faults) if faults else f"{len(COMPONENTS)} components")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
