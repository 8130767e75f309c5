#!/usr/bin/python3
"""Installs what has been built, builds docs/examples/embed against what was installed alone, and runs both programs on the
pinned bank: they must hear the same.

usage: installed_package.py SOURCE_DIR BUILD_DIR WORK_DIR
"""
import pathlib
import re
import shutil
import subprocess
import sys

source, build, work = (pathlib.Path(word) for word in sys.argv[1:4])
shutil.rmtree(work, ignore_errors=True)
work.mkdir(parents=True)


def run(*command, **options):
    return subprocess.run([str(word) for word in command], check=True, text=True, **options)


quiet = {"stdout": subprocess.DEVNULL}
prefix = work / "installed"
run("cmake", "--install", build, "--prefix", prefix, **quiet)

# Nothing but the C interface is visible.
library = next(prefix.glob("lib*/**/libcarillon.so"))
symbols = re.findall(r" T (\w+)$", run("nm", "-D", "--defined-only", library, capture_output=True).stdout, re.M)
wrong = [name for name in symbols if not name.startswith("carillon_")]
if wrong or "carillon_process" not in symbols:
    sys.exit(f"{library}: visible beside the interface, or missing from it: {wrong[:5] or 'carillon_process'}")

example = shutil.copytree(source / "docs/examples/embed", work / "example")  # where no header of the sources can be found by chance
run("cmake", "-S", example, "-B", work / "example-build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}",
    "-DCMAKE_C_FLAGS=-std=c99 -pedantic -Wall -Wextra -Werror", "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror", **quiet)
run("cmake", "--build", work / "example-build", "--", "--quiet")
bank = source / "tests/bank/pinned/version_1_0.hdf"
heard = {}
for program in ("strike_c", "strike_cpp"):
    line = run(work / "example-build" / program, bank, capture_output=True).stdout
    print(program, line.strip())
    heard[program] = re.fullmatch(r"(\d+) modes, peak (\S+) Pa at the left ear\n", line).groups()
if heard["strike_c"][0] != heard["strike_cpp"][0] or not all(float(peak) > 0 for _, peak in heard.values()):
    sys.exit("the two programs do not play the same bank")
lines = []
for program in ("slide_c", "edit_cpp"):
    line = run(work / "example-build" / program, bank, capture_output=True).stdout
    print(program, line.strip())
    lines.append(re.fullmatch(r"peak (\S+) Pa, (\S+) Pa after the edit; (\d+) -> (\d+) Hz(?:; 0 underruns)?\n", line).groups())
if lines[0][2:] != lines[1][2:]:
    sys.exit("the two programs do not edit the same bank")
line = run(work / "example-build/click_c", bank, capture_output=True).stdout
print("click_c", line.strip())
if not re.fullmatch(r"triangle \d+ of \d+, peak \S+ Pa at the left ear\n", line):
    sys.exit("a click does not strike")
bad = subprocess.run([work / "example-build/strike_c", __file__], capture_output=True, text=True)
if bad.returncode != 1 or "installed_package.py" not in bad.stderr:
    sys.exit(f"no clear error for a file that is no bank: {bad.stderr}")
