#!/usr/bin/python3
"""The tests that a change can reach, by the include law: prints the names for `ctest -R`, and why on standard error.

usage: changed.py SOURCE_DIR BUILD_DIR [REF]     the working tree against REF (default: the last commit; after it, HEAD~1)
       changed.py --self-test

A changed source of a folder reaches the folders that may include it, and so on (tests/structure/include_law.py). Those folders' unit tests
run, and every script that names a program of such a folder, itself or through a module that it imports. A changed test runs, as do the
scripts that import it. Of all these the tests of part basic are taken; a test whose own file has changed is taken from every part.
"""
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path += [str(HERE), str(HERE.parent / "support")]
import ctest
import include_law

TOPS = ("runtime", "partition", "precompute", "jobs")
SOLVER = ["precompute/run", "precompute/mesher"]
# Programs, and the folders whose code runs when they run: of their main, and of programs that they start.
PROGRAMS = {
    "carillon-render": ["runtime/render"],
    "carillon-live": ["runtime/render"],
    "carillon-bank": ["runtime/exchange"],
    "carillon-samples": ["runtime/render"],
    "carillon-mesh": ["precompute/mesher"],
    "carillon-precompute": ["precompute/run"],
    "carillon-simulate": ["precompute/simulation"],
    "carillon-draw": ["precompute/run"],
    "carillon-study": ["jobs/study", *SOLVER],
    "carillon-tune": ["jobs/tune", *SOLVER],
    "carillon": ["jobs/cli", "precompute/simulation", "runtime/render", *SOLVER],
    "import carillon": ["runtime/bindings", *SOLVER],
    "share/carillon/web": ["runtime/bindings"],
    "share/carillon/world": ["runtime/bindings"],
}
# How things are built reaches everything.
ALL = re.compile(
    r"(CMakeLists\.txt|CMakePresets\.json|deploy/(cmake|packages)/.*|deploy/(install|environment)|tests/(CMakeLists\.txt|support/.*))"
)


def find_folder(path):
    """The folder of the include law that a file belongs to, or None: the longest one that contains it."""
    return max((folder for folder in include_law.LAW if path.startswith(folder + "/")), key=len, default=None)


def find_reached(folders):
    """The folders, and all that may include one of them, directly or not."""
    reached = set(folders)
    while True:
        more = {folder for folder, (ours, _) in include_law.LAW.items() if reached.intersection(ours)} - reached
        if not more:
            return reached
        reached |= more


def find_imported(script, scripts):
    """The script, and the modules in `scripts` ({name: paths}) that it imports, directly or not."""
    found, waiting = set(), [script]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            for name in re.findall(r"^\s*(?:import|from) (\w+)", path.read_text(errors="replace"), re.M):
                waiting += scripts.get(name, [])
    return found


def find_programs(text):
    """The folders of the programs that a script names."""
    named = [folders for name, folders in PROGRAMS.items() if re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", text)]
    return {folder for folders in named for folder in folders}


def choose(changed, tests, source):
    """{name: reason} of the tests that the changed files, paths from the root, can reach.

    tests: [{"name", "part", "sources": paths from the root that the test is made of}]
    """
    reached = find_reached({folder for path in changed if path.startswith(TOPS) and (folder := find_folder(path))})
    everything = [path for path in changed if ALL.fullmatch(path)]
    scripts = {}
    for path in (source / "tests").rglob("*.py"):
        scripts.setdefault(path.stem, []).append(path)
    chosen = {}
    for test in tests:
        own = set(test["sources"]).intersection(changed)
        used = set()
        for name in test["sources"]:
            text = (source / name).read_text(errors="replace")
            if name.endswith(".cpp"):
                headers = re.findall(r'#include "([^"]+)"', text)
                own |= {header for header in headers if header in changed and header.startswith("tests/")}
                used |= {find_folder(path) for path in [name.removeprefix("tests/unit/"), *headers]}
            else:
                parts = find_imported(source / name, scripts)
                own |= {str(part.relative_to(source)) for part in parts}.intersection(changed)
                used |= set().union(*(find_programs(part.read_text(errors="replace")) for part in parts))
        if own:
            chosen[test["name"]] = min(own)
        elif test["part"] != "basic":
            continue
        elif everything:
            chosen[test["name"]] = everything[0]
        elif test["name"].startswith(("structure.", "docs.")):
            chosen[test["name"]] = "every change"
        elif hit := used.intersection(reached):
            chosen[test["name"]] = min(hit)
    return chosen


def read_tests(build, source):
    """The tests that CTest knows, for choose()."""
    hard = {path: path.read_text() for path in (source / "tests/hard").glob("*.cpp")}
    tests = []
    for test in ctest.list_tests(build):
        part = next((label.removeprefix("part.") for label in test["labels"] if label.startswith("part.")), "")
        sources = []
        for word in test["command"]:
            if word.startswith("--sources="):
                sources += word.removeprefix("--sources=").split(",")
            elif word.startswith(f"{source}/") and pathlib.Path(word).is_file() and not word.startswith(f"{source}/build"):
                sources.append(word.removeprefix(f"{source}/"))
            elif match := re.fullmatch(r"--gtest_filter=(\w+)\.(\w+)", word):
                sources += [str(path.relative_to(source)) for path, text in hard.items() if f"TEST({match[1]}, {match[2]})" in text]
        tests.append({"name": test["name"], "part": part, "sources": sources})
    return tests


def read_changed(source, ref):
    """Paths that differ from the commit, and files that git does not know yet."""

    def git(*words):
        return subprocess.run(["git", "-C", source, *words], capture_output=True, text=True, check=True).stdout.splitlines()

    new = git("ls-files", "--others", "--exclude-standard")
    if ref:
        return git("diff", "--name-only", ref) + new
    return (git("diff", "--name-only", "HEAD") + new) or git("diff", "--name-only", "HEAD~1")


def self_test():
    source = HERE.parents[1]
    tests = [
        {"name": "bank", "part": "basic", "sources": ["tests/unit/runtime/bank/pack_test.cpp"]},
        {"name": "comm.np2", "part": "basic", "sources": ["tests/unit/precompute/comm/exchange_test.cpp"]},
        {"name": "comm.np3", "part": "ranks", "sources": ["tests/unit/precompute/comm/exchange_test.cpp"]},
        {"name": "host.program", "part": "basic", "sources": ["tests/system/host/program_test.py"]},
        {"name": "structure.size", "part": "basic", "sources": ["tests/structure/size.py"]},
    ]

    def names(*changed):
        return set(choose(changed, tests, source))

    assert names("runtime/bank/pack.cpp") == {"bank", "host.program", "structure.size"}
    assert names("precompute/comm/communicator.cpp") == {"comm.np2", "structure.size"}
    assert names("tests/unit/precompute/comm/exchange_test.cpp") == {"comm.np2", "comm.np3", "structure.size"}
    assert names("docs/tutorial.md") == {"structure.size"}
    assert names("deploy/cmake/Carillon.cmake") == {"bank", "comm.np2", "host.program", "structure.size"}
    assert find_reached({"runtime/base"}) >= {"runtime/bank", "precompute/run", "jobs/cli"}
    assert "runtime/base" not in find_reached({"runtime/scene"})


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    source, build = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    changed = read_changed(source, sys.argv[3] if len(sys.argv) == 4 else "")
    chosen = choose(changed, read_tests(build, source), source)
    for name, reason in sorted(chosen.items()):
        print(f"{name}: {reason}", file=sys.stderr)
    print(f"{len(changed)} changed files reach {len(chosen)} tests", file=sys.stderr)
    print("^(" + "|".join(re.escape(name) for name in sorted(chosen)) + ")$")


if __name__ == "__main__":
    sys.exit(main())
