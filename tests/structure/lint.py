#!/usr/bin/env python3
"""Debian's formatters and linters over all files of a kind: Python (black, pyflakes, at most 140 columns), shell (shellcheck), spelling
(codespell, with the retired words of retired_words.txt).

usage: lint.py python|shell|spelling SOURCE_DIR        exit 1 and one line per place
"""
import pathlib
import re
import subprocess
import sys

MAX_COLUMNS = 140  # as black's line-length in pyproject.toml
PYTHON = "/usr/bin/python3"  # Debian's modules belong to Debian's Python
TOPS = (".ci", "runtime", "precompute", "partition", "jobs", "tests", "deploy", "docs")
# Generated files, intentionally invalid inputs, lists of retired words.
NO_TEXT = re.compile(r"\.(msh|mesh|vtu|node|ele|svg|csv|jsonl|hdf)$|/corpus/|__pycache__|/retired_words\.txt$")


def list_texts(root):
    for path in [*root.glob("*"), *(path for top in TOPS for path in sorted((root / top).rglob("*")))]:
        if path.is_file() and not path.is_symlink() and not NO_TEXT.search(path.as_posix()):
            try:
                yield path, path.read_text()
            except UnicodeDecodeError:
                continue


def run(root, command, paths):
    """The lines that a tool prints if it fails."""
    done = subprocess.run([*command, *map(str, paths)], cwd=root, capture_output=True, text=True)
    return (done.stdout + done.stderr).splitlines() if done.returncode else []


def check_python(root):
    files = [(path, text) for path, text in list_texts(root) if path.suffix == ".py" or re.match(r"#!.*python", text)]
    paths = [path for path, _ in files]
    places = run(root, [PYTHON, "-m", "black", "--check", "--config", root / "pyproject.toml"], paths)
    places += run(root, [PYTHON, "-m", "pyflakes"], paths)
    lines = [(path, number, len(line)) for path, text in files for number, line in enumerate(text.splitlines(), 1)]
    return places + [f"{path}:{number}: {length} columns, at most {MAX_COLUMNS}" for path, number, length in lines if length > MAX_COLUMNS]


def check_shell(root):
    paths = [path for path, text in list_texts(root) if path.suffix == ".sh" or re.match(r"#!.*/(env )?(ba)?sh\b", text)]
    return run(root, ["shellcheck", "--external-sources", "--format=gcc"], paths)


def check_spelling(root):
    dictionaries = ["-D", "-", "-D", "tests/structure/retired_words.txt"]
    return run(root, ["codespell", "--config", ".codespellrc", *dictionaries], [path for path, _ in list_texts(root)])


def main():
    checks = {"python": check_python, "shell": check_shell, "spelling": check_spelling}
    places = checks[sys.argv[1]](pathlib.Path(sys.argv[2]).resolve())
    print("\n".join(places) if places else "no fault")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
