#!/usr/bin/python3
"""Tables of keys in docs/howto are those that the programs print with --keys.

usage: keys.py SOURCE_DIR BIN_DIR            exit 1 if a table differs or is missing
       keys.py SOURCE_DIR BIN_DIR --write    writes the tables between <!-- begin keys NAME --> and <!-- end keys NAME -->
"""
import pathlib
import re
import subprocess
import sys

PROGRAMS = ("carillon-render", "carillon-precompute", "carillon-simulate")


def read_tables(binaries):
    """{title: rows} of all programs that are there."""
    programs = [binaries / name for name in PROGRAMS if (binaries / name).exists()]
    text = "".join(subprocess.run([program, "--keys"], check=True, capture_output=True, text=True).stdout for program in programs)
    return dict(re.findall(r"^# (.+)\n\n((?:\|.*\n)+)", text, re.M)), len(programs) == len(PROGRAMS)


def main():
    source, binaries = map(pathlib.Path, sys.argv[1:3])
    tables, is_complete = read_tables(binaries)
    shown, faults = set(), []
    for page in sorted((source / "docs/howto").glob("*.md")):

        def fill(match):
            shown.add(match[1])
            return f"<!-- begin keys {match[1]} -->\n{tables.get(match[1], match[2])}<!-- end keys {match[1]} -->"

        old = page.read_text()
        new = re.sub(r"<!-- begin keys (.+) -->\n(.*?)<!-- end keys \1 -->", fill, old, flags=re.S)
        if new != old and "--write" in sys.argv:
            page.write_text(new)
        elif new != old:
            faults.append(f"{page}: tables of keys differ from --keys; run {' '.join(sys.argv)} --write")
    faults += [f'docs/howto: no table of keys "{title}"' for title in tables if title not in shown]
    faults += [f'no program has the keys "{title}"' for title in shown if is_complete and title not in tables]
    print("\n".join(faults) or f"{len(shown)} tables")
    return bool(faults)


sys.exit(main())
