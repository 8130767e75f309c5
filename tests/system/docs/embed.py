#!/usr/bin/python3
"""Builds the project that docs/howto/embed-the-runtime.md shows, exactly as it stands there, and runs it on the pinned bank.

usage: embed.py SOURCE_DIR WORK_DIR
"""
import pathlib
import re
import shutil
import subprocess
import sys

source, work = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
page = (source / "docs/howto/embed-the-runtime.md").read_text()
shutil.rmtree(work, ignore_errors=True)
work.mkdir(parents=True)
for kind, name in (("cmake", "CMakeLists.txt"), ("cpp", "my_game.cpp")):
    (work / name).write_text(re.search(rf"^```{kind}\n(.*?)^```$", page, re.M | re.S)[1])
(work / "carillon").symlink_to(source)
# Without optimisation, as one who debugs a game builds it; all other builds of the tests optimise.
configure = ["cmake", "-S", work, "-B", work / "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS_DEBUG="]
subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
subprocess.run(["cmake", "--build", work / "build", "--target", "my_game", "-j", "2", "--", "--quiet"], check=True)
program = next(path for path in (work / "build").rglob("my_game") if path.is_file())
subprocess.run([program, source / "tests/unit/runtime/bank/pinned/version_1_0.hdf"], check=True)
