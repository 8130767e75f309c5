#!/usr/bin/env python3
"""docs/architecture.md against the tree: a row for each folder, the folders that it may use as in the include law, its main type or
function in one of its headers; and every source file that this page and docs/walks.md name.

usage: architecture.py SOURCE_DIR             exit 1 and one line per fault
       architecture.py SOURCE_DIR --update    writes the column "may use" of the rows that there are
"""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from include_law import LAW

SEPARATE = {"jobs/study", "jobs/tune"}  # Python programs, outside the law
ROW = re.compile(r"^\| `([a-z_/]+)` \| ([^|]*) \| ([^|]*) \| ([^|]*) \|$", re.M)
WORDS_AT_MAX = 14


def list_allowed(folder):
    top = folder.split("/")[0] + "/"
    names = [name.removeprefix(top) for name in LAW[folder][0]] if folder in LAW else []
    return ", ".join(names) or "-"


def find_faults(page, source):
    rows = {row[0]: row[1:] for row in ROW.findall(page)}
    faults = [f"no row for {folder}" for folder in {*LAW, *SEPARATE} - set(rows)]
    faults += [f"{folder} is no folder of the include law" for folder in set(rows) - set(LAW) - SEPARATE]
    for folder, (duty, kind, allowed) in rows.items():
        if folder in LAW and allowed != list_allowed(folder):
            faults.append(f"{folder} may use: {list_allowed(folder)}; run tests/structure/architecture.py . --update")
        if len(duty.split()) > WORDS_AT_MAX:
            faults.append(f"{folder}: its responsibility has more than {WORDS_AT_MAX} words")
        headers = "".join(path.read_text() for path in (source / folder).rglob("*.h*"))
        for name in re.findall(r"`(\w+)(?:\(\))?`", kind):
            if not re.search(rf"\b{name}\b", headers):
                faults.append(f"{folder}: no header there has {name}")
    return [f"docs/architecture.md: {fault}" for fault in sorted(faults)]


def find_missing_files(page, source):
    """Names of sources stand with their path, without precompute/, or after another file of the same folder."""
    missing, folder = [], source
    for name in re.findall(r"`([a-z_0-9/]+\.[ch]pp)`", page):
        found = next((path for path in (source / name, source / "precompute" / name, folder / name) if path.is_file()), None)
        missing += [] if found else [f"docs/architecture.md, docs/walks.md: there is no {name}"]
        folder = found.parent if found else folder
    return missing


def update(page):
    return ROW.sub(lambda row: f"| `{row[1]}` | {row[2]} | {row[3]} | {list_allowed(row[1]) if row[1] in LAW else row[4]} |", page)


def main():
    source = pathlib.Path(sys.argv[1])
    path = source / "docs/architecture.md"
    if sys.argv[2:] == ["--update"]:
        path.write_text(update(path.read_text()))
    faults = find_faults(path.read_text(), source) + find_missing_files(path.read_text() + (source / "docs/walks.md").read_text(), source)
    print("\n".join(faults) if faults else f"{len(LAW) + len(SEPARATE)} folders as in the include law")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
