#!/usr/bin/env python3
"""Formatters and linters of Debian over all files of a kind: Python (black, pyflakes, lines of at most 140), shell (shellcheck), spelling.

usage: lint.py python|shell|spelling SOURCE_DIR        exit 1 and one line per place
       lint.py --self-test                             proves that each tool finds a fault
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

MAX_COLUMNS = 140  # as black's line-length in pyproject.toml
PYTHON = "/usr/bin/python3"  # Debian's modules belong to Debian's Python
TOPS = (".ci", "runtime", "precompute", "partition", "jobs", "tests", "deploy", "docs")
# Files made by programs, and inputs that are wrong on purpose.
NO_TEXT = re.compile(r"\.(msh|mesh|vtu|node|ele|svg|csv|jsonl|hdf)$|/corpus/|__pycache__")


def list_texts(root):
    for path in [*root.glob("*"), *(path for top in TOPS for path in sorted((root / top).rglob("*")))]:
        if path.is_file() and not path.is_symlink() and not NO_TEXT.search(path.as_posix()):
            try:
                yield path, path.read_text()
            except UnicodeDecodeError:
                continue


def is_python(path, text):
    return path.suffix == ".py" or re.match(r"#!.*python", text)


def is_shell(path, text):
    return path.suffix == ".sh" or re.match(r"#!.*/(env )?(ba)?sh\b", text)


def run(root, command, paths):
    """The lines that a tool prints; none where it finds nothing."""
    if not paths:
        return []
    done = subprocess.run([*command, *map(str, paths)], cwd=root, capture_output=True, text=True)
    lines = (done.stdout + done.stderr).splitlines()
    return lines if done.returncode else []


def find_long_lines(path, text):
    lines = enumerate(text.splitlines(), 1)
    return [f"{path}:{number}: {len(line)} columns, at most {MAX_COLUMNS}" for number, line in lines if len(line) > MAX_COLUMNS]


def check_python(root):
    files = [(path, text) for path, text in list_texts(root) if is_python(path, text)]
    paths = [path for path, _ in files]
    places = run(root, [PYTHON, "-m", "black", "--check", "--config", root / "pyproject.toml"], paths)
    places += run(root, [PYTHON, "-m", "pyflakes"], paths)
    return places + [place for path, text in files for place in find_long_lines(path, text)]


def check_shell(root):
    return run(
        root, ["shellcheck", "--external-sources", "--format=gcc"], [path for path, text in list_texts(root) if is_shell(path, text)]
    )


def check_spelling(root):
    return run(root, ["codespell", "--config", root / ".codespellrc"], [path for path, _ in list_texts(root)])


CHECKS = {"python": check_python, "shell": check_shell, "spelling": check_spelling}
FAULTS = {
    "python": {"jobs/plain.py": "x = {  }\n", "jobs/unused": "#!/usr/bin/python3\nimport os\n", "jobs/long.py": f"# {'long ' * 30}\n"},
    "shell": {"deploy/quotes": "#!/usr/bin/env bash\nrm $1\n"},
    "spelling": {"docs/page.md": "The len" "ght of a bar.\n", "runtime/x.cpp": "// Reci" "eved.\n"},
}


def test_self():
    source = pathlib.Path(__file__).resolve().parents[2]
    for kind, check in CHECKS.items():
        for name, text in FAULTS[kind].items():
            with tempfile.TemporaryDirectory() as folder:
                root = pathlib.Path(folder)
                for config in ("pyproject.toml", ".codespellrc"):
                    (root / config).write_text((source / config).read_text())
                os.makedirs((root / name).parent)
                (root / name).write_text("")
                assert check(root) == [], (kind, name, "an empty file is at fault")
                (root / name).write_text(text)
                assert any(name in line for line in check(root)), (kind, name, "its fault was not found")


def main():
    if sys.argv[1:] == ["--self-test"]:
        test_self()
        return 0
    places = CHECKS[sys.argv[1]](pathlib.Path(sys.argv[2]).resolve())
    print("\n".join(places) if places else "no fault")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
