#!/usr/bin/env python3
"""Counts of lines, folders, comments, casts, long functions and long files, of the working tree or of a commit.

usage: size.py [COMMIT]    prints the counts and the long functions and files of the product
       size.py --check     fails for functions above 80 lines and files above 600 lines in the product
"""
import pathlib
import re
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
from include_law import COMPONENTS, find_component

PRODUCT = ("runtime", "precompute", "partition", "jobs")
C_ENDINGS = {".cpp", ".hpp", ".inl", ".c", ".h"}
MAX_FUNCTION_LINES = 80
MAX_FILE_LINES = 600
COMMENT = {True: re.compile(r"(?:^|\s)//+[<!]?\s*(.*)"), False: re.compile(r"(?:^|\s)#(?!!)\s*(.*)")}


def read_sources(root, tops):
    """C, C++, Python and JavaScript; files without an ending where they are Python scripts. {path: lines}"""
    sources = {}
    for path in sorted(path for top in tops for path in (root / top).rglob("*")):
        if path.is_file() and path.suffix in {*C_ENDINGS, ".py", ".js", ""}:
            text = path.read_bytes().decode("utf-8", "replace")
            if path.suffix or re.match(r"#!.*python", text):
                sources[path.relative_to(root).as_posix()] = text.splitlines()
    return sources


def find_comments(path, lines):
    """The texts of `//` comments, or of `#` comments in Python."""
    comment = COMMENT[pathlib.PurePath(path).suffix in {*C_ENDINGS, ".js"}]
    return [match[1] for line in lines if (match := comment.search(line))]


def find_long_functions(root, paths):
    """[(lines, "path:name")] of the functions above the limit, by Universal Ctags."""
    command = ["ctags", "-x", "--_xformat=%{input}\t%n\t%{end}\t%N", "--languages=C,C++,Python"]
    command += ["--map-C++=+.inl", "--kinds-C=f", "--kinds-C++=f", "--kinds-Python=fm", "-L", "-"]
    rows = subprocess.run(command, cwd=root, input="\n".join(paths), capture_output=True, text=True, check=True).stdout.splitlines()
    spans = [(path, int(last) - int(first) + 1, name) for path, first, last, name in (row.split("\t") for row in rows) if last.isdigit()]
    return sorted(((count, f"{path}:{name}") for path, count, name in spans if count > MAX_FUNCTION_LINES), reverse=True)


def measure(root):
    product = read_sources(root, PRODUCT)
    tests = read_sources(root, ("tests",))
    pages = [path.read_text().splitlines() for path in [*root.glob("*.md"), *(root / "docs").rglob("*.md")]]
    comments = [text for path, lines in {**product, **tests}.items() for text in find_comments(path, lines)]
    with_what = sum(bool(re.search(r"\bwhat\b", text, re.I)) for text in comments)
    product_text = "\n".join(line for lines in product.values() for line in lines)
    functions = find_long_functions(root, product)
    files = sorted(((len(lines), path) for path, lines in product.items() if len(lines) > MAX_FILE_LINES), reverse=True)
    counts = {
        "lines of product": sum(map(len, product.values())),
        "lines of tests": sum(map(len, tests.values())),
        "lines of docs": sum(map(len, pages)),
        "folders with sources": len({"/".join(path.split("/")[:-1][:2]) for path in product}),
        "comment lines": len(comments),
        '  with "what", %': round(100 * with_what / max(1, len(comments)), 2),
        "  that begin with What, Whether, Where, How": sum(bool(re.match(r"(What|Whether|Where|How)\b", text)) for text in comments),
        '  "Deviations: none", "Source: none" or "own"': sum(
            bool(re.search(r"Deviations?: none|Sources?: (none|own)\b", text, re.I)) for text in comments
        ),
        "static_cast<std::size_t> in the product": product_text.count("static_cast<std::size_t>"),
        f"functions above {MAX_FUNCTION_LINES} lines": len(functions),
        f"files above {MAX_FILE_LINES} lines": len(files),
    }
    return counts, functions + files


def count_components(root):
    """{NAME: lines} of the components (docs/components.md); None: the core."""
    counts = dict.fromkeys([*COMPONENTS, None], 0)
    for path, lines in read_sources(root, PRODUCT).items():
        counts[find_component(path)] += len(lines)
    return counts


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    arguments = sys.argv[1:]
    if arguments == ["--check"]:
        faults = [f"{place}: {count} lines" for count, place in measure(root)[1]]
        print("\n".join(faults) if faults else "no long function or file")
        return 1 if faults else 0
    with tempfile.TemporaryDirectory() as folder:
        if arguments:
            archive = subprocess.run(["git", "archive", arguments[0]], cwd=root, capture_output=True, check=True).stdout
            subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
        counts, long = measure(pathlib.Path(folder) if arguments else root)
        components = count_components(pathlib.Path(folder) if arguments else root)
    counts |= {f"  of the component {name}" if name else "  of the core": count for name, count in components.items()}
    print("\n".join([f"{count:>8}  {name}" for name, count in counts.items()] + [f"{count:>8}  {place}" for count, place in long]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
