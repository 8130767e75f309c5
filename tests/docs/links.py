#!/usr/bin/python3
"""Every relative link and picture of the pages at the root and in docs exists, and every name in the code column of the symbol table occurs in the code.

usage: links.py SOURCE_DIR
"""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])
bad = []
pages = [*(source / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")), *sorted((source / "docs").rglob("*.md"))]
for page in pages:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text()):
        if not re.match(r"[a-z]+:", target) and not (page.parent / target).exists():
            bad.append(f"{page.relative_to(source)}: {target} does not exist")

code = "\n".join(path.read_text() for top in ("runtime", "precompute", "jobs", "partition") for path in (source / top).rglob("*") if path.suffix in (".cpp", ".hpp"))
table = re.search(r"^## Symbols\n(.*?)^## ", (source / "docs/equations.md").read_text(), re.M | re.S)[1]
names = [name for row in table.splitlines() if row.startswith("|") for name in re.findall(r"`([A-Za-z_0-9:/]+)`", row.split("|")[4])]
for name in names:
    word = name.split("::")[-1]
    if "/" in name:
        if not (source / name).is_dir():
            bad.append(f"docs/equations.md: there is no folder {name}")
    elif not re.search(rf"\b{re.escape(word)}\b", code):
        bad.append(f"docs/equations.md: the code has no {name}")
print("\n".join(bad) if bad else f"{len(pages)} pages, {len(names)} names of symbols: all there")
sys.exit(1 if bad or len(names) < 15 else 0)
