#!/usr/bin/python3
"""Links of the pages at the root and in docs: relative links lead to files, anchors to headings; every page of docs is at most two links
from docs/README.md; paths named by pages exist; names in the symbol table of the equations and in the glossary occur in the code, and
names after a file (`folder/file.cpp`: `name()`, `Class::name()`) in that file; every equation names a function;
every picture of docs is shown; decisions have the dates of their index.

usage: links.py SOURCE_DIR
"""
import pathlib
import re
import sys

ROOT_PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
TOPS = "tests|precompute|runtime|jobs|partition|deploy|docs"


def read_links(page):
    """(path, anchor) of every relative link; code is no text."""
    text = re.sub(r"^```.*?^```$|`[^`\n]*`", "", page.read_text(), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if not re.match(r"[a-z]+:", target):
            path, _, anchor = target.partition("#")
            yield (page.parent / path).resolve() if path else page.resolve(), anchor


def find_anchors(page):
    """The anchors of headings as GitHub makes them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    anchors = {}
    for heading in re.findall(r"^#+ +(.*)$", text, re.M):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        anchor = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        anchors[anchor] = anchors.get(anchor, 0) + 1
    return {anchor if k == 0 else f"{anchor}-{k}" for anchor, count in anchors.items() for k in range(count)}


def find_broken(source, pages):
    bad = []
    for page in pages:
        for path, anchor in read_links(page):
            place = path.relative_to(source) if path.is_relative_to(source) else path
            if not path.exists():
                bad.append(f"{page.relative_to(source)}: {place} does not exist")
            elif anchor and path.suffix == ".md" and anchor not in find_anchors(path):
                bad.append(f"{page.relative_to(source)}: {place} has no heading #{anchor}")
    return bad


def find_far(source, pages, hops=2):
    """Pages of docs that are more than so many links from docs/README.md."""
    near = {source / "docs/README.md"}
    for _ in range(hops):
        near |= {path for page in near if page.suffix == ".md" for path, _ in read_links(page) if path.is_file()}
    return [f"{page.relative_to(source)}: more than {hops} links from docs/README.md" for page in pages if page not in near]


def find_missing_paths(source, pages):
    """Paths in prose and commands that begin with a folder of the project; patterns and capital placeholders are left out."""
    bad = []
    for page in pages:
        for number, line in enumerate(page.read_text().splitlines(), 1):
            for path in re.findall(rf"(?<![\w/.-])((?:{TOPS})/[a-z_][\w./-]*)(?![\w./*-])", line):
                if not re.search(r"[A-Z]{3}", path) and not (source / path.rstrip("./")).exists():
                    bad.append(f"{page.relative_to(source)}:{number}: there is no {path}")
    return bad


def read_file_names(text):
    """(path, name) of every name that stands after a file: `folder/file.cpp`: `name()`, `Class::name()`."""
    for path, names in re.findall(rf"`((?:{TOPS})/[\w/.-]+\.(?:cpp|hpp|inl|h|py))`:((?:,?\s+`[\w:]+(?:\(\))?`)+)", text):
        for name in re.findall(r"`([^`]+)`", names):
            yield path, name


def find_missing_functions(source, pages):
    """Names after a file that the file does not contain; one that ends in () must be called or defined there."""
    bad = []
    for page in pages:
        for path, name in read_file_names(page.read_text()):
            pattern = rf"\b{re.escape(name.removesuffix('()'))}" + (r"\s*\(" if name.endswith("()") else r"\b")
            if (source / path).is_file() and not re.search(pattern, (source / path).read_text()):
                bad.append(f"{page.relative_to(source)}: {path} has no {name}")
    return bad


def find_homeless_equations(source):
    """Sections of the equations that name no function of a file."""
    sections = re.split(r"^## ", (source / "docs/equations.md").read_text(), flags=re.M)
    return [
        f"docs/equations.md: no function computes {section.splitlines()[0]}"
        for section in sections
        if re.match(r"E\d", section) and not any(name.endswith("()") for _, name in read_file_names(section))
    ]


def find_unknown_terms(source):
    """Symbols of the glossary that are not in the file, or in a header of the folder, of their row."""
    bad, rows = [], 0
    for symbols, path in re.findall(r"^\| (`[^|]*`) \|[^|]*\|[^|]*\| `([\w/.]+)` \|$", (source / "docs/glossary.md").read_text(), re.M):
        rows += 1
        place = source / path
        files = [place] if place.is_file() else sorted(place.glob("*.h*"))
        text = "\n".join(file.read_text() for file in files)
        bad += [] if files else [f"docs/glossary.md: there is no {path}"]
        bad += [
            f"docs/glossary.md: {path} has no {name}" for name in re.findall(r"`(\w+)`", symbols) if not re.search(rf"\b\w*{name}\b", text)
        ]
    return bad if rows >= 40 else [*bad, f"docs/glossary.md: {rows} rows are too few"]


def find_unknown_names(source):
    code = "\n".join(
        path.read_text()
        for top in ("runtime", "precompute", "jobs", "partition")
        for path in (source / top).rglob("*")
        if path.suffix in (".cpp", ".hpp")
    )
    table = re.search(r"^## Symbols\n(.*?)^## ", (source / "docs/equations.md").read_text(), re.M | re.S)[1]
    names = [name for row in table.splitlines() if row.startswith("|") for name in re.findall(r"`([A-Za-z_0-9:/]+)`", row.split("|")[4])]
    bad = [] if len(names) >= 15 else [f"docs/equations.md: {len(names)} names of symbols are too few"]
    for name in names:
        if "/" in name:
            bad += [] if (source / name).is_dir() else [f"docs/equations.md: there is no folder {name}"]
        elif not re.search(rf"\b{re.escape(name.split('::')[-1])}\b", code):
            bad.append(f"docs/equations.md: the code has no {name}")
    return bad


def find_unused_pictures(source, pages):
    shown = {path for page in pages for path, _ in read_links(page)}
    pictures = [path for path in sorted((source / "docs").rglob("*")) if path.suffix in {".png", ".svg"}]
    return [f"{path.relative_to(source)}: no page shows it" for path in pictures if path not in shown]


def find_undated(source):
    """Decisions without status and date below their title, or with another date in the index."""
    index = (source / "docs/decisions/README.md").read_text()
    dates = dict(re.findall(r"^\| \[([\w-]+)\][^|]*\| (\d{4}-\d\d-\d\d) \|", index, re.M))
    bad = []
    for page in sorted((source / "docs/decisions").glob("*.md")):
        found = re.match(r"# [^\n]+\n\n(?:Accepted|Proposed), (\d{4}-\d\d-\d\d)", page.read_text())
        if page.name != "README.md" and (not found or dates.get(page.stem) != found[1]):
            bad.append(f"docs/decisions/{page.name}: begins with status and date (Accepted, YYYY-MM-DD), as in README.md")
    return bad


def main():
    source = pathlib.Path(sys.argv[1]).resolve()
    docs = sorted((source / "docs").rglob("*.md"))
    pages = [*(source / name for name in ROOT_PAGES), *docs]
    bad = find_broken(source, pages) + find_far(source, docs) + find_unused_pictures(source, pages)
    current = [page for page in pages if page.name != "CHANGELOG.md"]
    bad += find_missing_paths(source, current) + find_missing_functions(source, current) + find_homeless_equations(source)
    bad += find_undated(source) + find_unknown_names(source) + find_unknown_terms(source)
    print("\n".join(bad) if bad else f"{len(pages)} pages: all links, anchors, paths and names exist")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
