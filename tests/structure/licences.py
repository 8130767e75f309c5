#!/usr/bin/env python3
"""docs/licences.md lists the shared libraries loaded by each program; NOTICES and that page list all libraries linked into the sound engine
of pages, and the header libraries of the include law.

usage: licences.py SOURCE_DIR BUILD_DIR [--page OBJECTS]      OBJECTS: the list of link inputs of carillon.wasm
"""
import fnmatch
import pathlib
import re
import subprocess
import sys
import tempfile

SOURCE, BUILD = map(pathlib.Path, sys.argv[1:3])
PAGE = (SOURCE / "docs/licences.md").read_text()
NOTICES = (SOURCE / "NOTICES").read_text()
FOLDERS = ("bin/carillon*", "libexec/carillon/*", "runtime/bindings/c_api/libcarillon.so", "python/carillon/_carillon*.so")
# The page's groups of programs.
GROUPS = {
    "all": lambda name: True,
    "banks": lambda name: name not in ("carillon-mesh", "carillon-joints.so", "libcarillon_mpi_profile.so"),
    "sound": lambda name: name in ("carillon-render", "carillon-samples", "carillon-live", "_carillon", "carillon-simulate"),
    "solver": lambda name: name in ("carillon-precompute", "carillon-worker", "carillon-simulate", "libcarillon_mpi_profile.so"),
}
# Link inputs of the engine and headers of its objects, with their names in the notices.
LINKED = {
    r"libc\.a|libc-.*\.a": "musl",
    r"libdlmalloc.*\.a": "dlmalloc",
    r"libcompiler_rt.*\.a": "compiler-rt",
    r"libc\+\+abi.*\.a": "libc++abi",
    r"libc\+\+(?!abi).*\.a": "libc++",
    r"libunwind.*\.a": "libunwind",
    r"lib(standalonewasm|noexit|stubs|al|jsmath).*\.a": "emscripten",
}
INCLUDED = {"Eigen": "Eigen", "fmt": "fmt", "hwy": "Highway", "rapidjson": "RapidJSON", "stb_image.h": "stb_image"}
# Header libraries of the include law (tests/structure/include_law.py).
HEADERS = {
    "rapidjson": "RapidJSON",
    "eigen": "Eigen",
    "cli": "CLI11",
    "cgal": "CGAL",
    "pybind11": "pybind11",
    "stb": "stb_image",
    "fmt": "fmt",
    "hwy": "Highway",
}
faults = []


def list_rows(text):
    """[(files, programs)] of the table of shared libraries."""
    table = text[text.index("| library | files |") :].split("\n\n")[0]
    return [
        (re.findall(r"`([^`]+)`", cells[1]), [word.strip(" `") for word in cells[3].split(",")])
        for cells in (line.strip("| ").split(" | ") for line in table.splitlines()[2:])
    ]


def find_stem(name):
    """Library name without version: libdb-5.3.so, libfmt.so.9, libHYPRE-2.26.0.so."""
    return re.sub(r"(-\d+(\.\d+)+)?\.so.*$", "", name)


def check_loaded():
    rows, seen, programs = list_rows(PAGE), set(), []
    for file in sorted(one for folder in FOLDERS for one in BUILD.glob(folder)):
        loaded = subprocess.run(["ldd", file], capture_output=True, text=True)
        if loaded.returncode != 0:
            continue  # a script
        name = re.sub(r"\.cpython.*", "", file.name)
        programs.append(name)
        for line in loaded.stdout.splitlines():
            if "=>" not in line or "not found" in line:
                continue
            stem = find_stem(line.split()[0])
            row = next((row for row in rows if any(fnmatch.fnmatchcase(stem, pattern) for pattern in row[0])), None)
            if row is None:
                faults.append(f"{name} loads {stem}, which docs/licences.md does not list")
            elif not any(word == name or (word in GROUPS and GROUPS[word](name)) for word in row[1]):
                faults.append(f"{name} loads {stem}; docs/licences.md has that for {', '.join(row[1])} only")
            seen.add(stem)
    for group in re.findall(r"\*\*(\w+)\*\*:", PAGE):
        if group not in GROUPS:
            faults.append(f"docs/licences.md has a group {group}, and this test none")
    for files, _ in rows if {"carillon-simulate", "carillon-live", "carillon-mesh", "carillon-joints.so"} <= set(programs) else []:
        for pattern in files:
            if not fnmatch.filter(seen, pattern):
                faults.append(f"docs/licences.md lists {pattern}, which no program loads")
    print(f"{len(programs)} programs and libraries load {len(seen)} libraries")


def check_headers():
    law = (SOURCE / "tests/structure/include_law.py").read_text()
    for library, name in HEADERS.items():
        if f'"{library}": [' in law:
            for what, text in (("NOTICES", NOTICES), ("docs/licences.md", PAGE)):
                if not re.search(rf"\b{re.escape(name)}\b", text):
                    faults.append(f"{what} does not name {name}")


def check_page(objects):
    """Links the engine again and lists all inputs of the linker."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["em++", f"@{objects}", "-O1", "-fwasm-exceptions", "-sSTANDALONE_WASM", "--no-entry", "-sALLOW_MEMORY_GROWTH"]
        words += ["-sEXPORTED_FUNCTIONS=_malloc,_free", "-Wl,--trace", "-o", f"{folder}/engine.wasm"]
        done = subprocess.run(words, capture_output=True, text=True, cwd=objects.parent)
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
    names = set()
    for archive in set(re.findall(r"([^/\s]+\.a)\(", done.stdout + done.stderr)):
        found = [name for pattern, name in LINKED.items() if re.fullmatch(pattern, archive)]
        names |= set(found)
        if not found:
            faults.append(f"carillon.wasm contains {archive}, which tests/structure/licences.py does not know")
    include = objects.parent / "include"
    for record in (objects.parent / "objects").glob("*.d"):
        for file in record.read_text().replace("\\\n", " ").split():
            path = objects.parent / file.rstrip(":")
            if path.is_relative_to(include):
                names.add(INCLUDED.get(path.relative_to(include).parts[0], path.name))
            elif "third_party" in path.parts:
                names.add(INCLUDED.get(path.name, path.name))
    for name in sorted(names | {"three.js"}):
        for what, text in (("NOTICES", NOTICES), ("docs/licences.md", PAGE)):
            if not re.search(rf"(?<![\w+]){re.escape(name)}(?![\w+])", text):
                faults.append(f"pages contain {name}, which {what} does not name")
    share = BUILD / "share/carillon"
    for file, source in {"web/NOTICES.txt": "NOTICES", "web/LICENSE.txt": "LICENSE"}.items():
        if not (share / file).is_file() or (share / file).read_bytes() != (SOURCE / source).read_bytes():
            faults.append(f"{file} is not {source}: what is published lacks it")
    print(f"pages contain {', '.join(sorted(names))}")


if "--page" in sys.argv:
    check_page(pathlib.Path(sys.argv[-1]))
else:
    check_loaded()
    check_headers()
print("\n".join(sorted(set(faults))))
sys.exit(1 if faults else 0)
