"""The line of a page that says when, at which commit, on which machine and by which command its figures were measured."""
import datetime
import os
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = ("runtime", "precompute", "partition", "jobs", ":!*.json")
LINE = re.compile(r"^Measured \d{4}-\d\d-\d\d, commit \w+(-dirty)?, .+, by `[^`]+`\.$", re.M)


def ask_git(*words):
    """Empty outside git."""
    return subprocess.run(["git", "-C", ROOT, *words, "--", *PROGRAMS], capture_output=True, text=True).stdout.strip()


def describe(command):
    """The line for figures measured now. The commit is the last one that changed a program, "-dirty" where programs differ from it."""
    names = re.findall(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.M)
    commit = ask_git("log", "-1", "--first-parent", "--format=%h", "--abbrev=10") or "unknown"
    dirty = "-dirty" if ask_git("status", "--porcelain") else ""
    machine = f"{names[0] if names else 'processor without a name'}, {len(os.sched_getaffinity(0))} cores"
    return f"Measured {datetime.date.today()}, commit {commit}{dirty}, {machine}, by `{command}`."


def put(page, line):
    """The text of a page with its line replaced."""
    return LINE.sub(lambda _: line, page, count=1)
