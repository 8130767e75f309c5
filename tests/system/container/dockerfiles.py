#!/usr/bin/python3
"""The Dockerfiles install by deploy/install and its lists and by nothing else, build by the words of the scripts, and copy what is there.

usage: dockerfiles.py SOURCE_DIR
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys

SOURCE = pathlib.Path(sys.argv[1])
SIDES = {"precompute": {"runtime", "precompute"}, "runtime": {"runtime"}}


def read(side):
    """(stage, instruction, text) of a Dockerfile, read independently of deploy/container/root."""
    stage, lines = "", []
    for line in (SOURCE / f"deploy/container/{side}.Dockerfile").read_text().splitlines():
        if line and not line.startswith("#"):
            word, text = line.split(" ", 1)
            stage = (text.split(" AS ") + ["image"])[1] if word == "FROM" else stage
            lines.append((stage, word, text))
    return lines


def words_of_scripts(side):
    """The commands behind `configure` and `build` of deploy/demo (deploy/environment), with the preset of the image."""
    preset = "release" if side == "precompute" else "runtime-only"
    demo = (SOURCE / "deploy/demo").read_text()
    options = re.search(r"^configure release (.+)$", demo, re.M)[1]
    assert "build release all" in demo
    return [f"cmake --preset {preset} {options}", f'cmake --build --preset {preset} -j "$jobs"']


def check(side, wanted):
    lines = read(side)
    installed = {}
    for stage, word, text in lines:
        assert not re.search(r"\b(apt|apt-get|dpkg|pip|curl|wget)\b", text), f"{side}: {text}: installs past deploy/install"
        if word == "FROM":
            assert re.fullmatch(r"debian:bookworm( AS build)?", text), text
        match = re.fullmatch(r"deploy/install (.+)", text) if word == "RUN" else None
        if match:
            installed[stage] = set(match[1].split())
        if word == "COPY" and not text.startswith("--from"):
            assert (SOURCE / shlex.split(text)[0]).exists(), text
        if word == "CMD":
            assert json.loads(text)[0].startswith("carillon"), text
    assert installed == {"build": wanted | {"build"}, "image": wanted}, (side, installed)
    for package_list in wanted | {"build"}:
        assert (SOURCE / f"deploy/packages/{package_list}.txt").is_file(), package_list
    build = " ".join(text for _, word, text in lines if word == "RUN")
    for command in words_of_scripts(side):
        assert command in build, f"{side}: the scripts build by '{command}', the image does not"
    presets = {preset["name"] for preset in json.loads((SOURCE / "CMakePresets.json").read_text())["configurePresets"]}
    assert set(re.findall(r"--preset (\S+)", build)) <= presets


def check_environment():
    """The variables of deploy/environment are set in the image."""
    text = (SOURCE / "deploy/environment").read_text()
    wanted = {
        name: value
        for line in re.findall(r"^\s*export (.*?)(?: *#.*)?$", text, re.M)
        for name, value in (pair.split("=", 1) for pair in line.split())
    }
    given = {
        name: value
        for _, word, line in read("precompute")
        if word == "ENV"
        for name, value in (pair.split("=", 1) for pair in line.split())
    }
    assert wanted and given == wanted, (wanted, given)


def check_root_script():
    """deploy/container/root reads the same instructions, and rejects unknown ones."""
    for side in SIDES:
        done = subprocess.run([SOURCE / "deploy/container/root", side, "--check"], capture_output=True, text=True, check=True)
        printed = [line.split(": ", 1)[1] for line in done.stdout.splitlines() if "debootstrap" not in line]
        assert printed == [f"{word} {text}" for _, word, text in read(side) if word != "FROM"], done.stdout
    assert subprocess.run([SOURCE / "deploy/container/root", "../x", "--check"], capture_output=True).returncode == 2


for name, sides in SIDES.items():
    check(name, sides)
check_environment()
check_root_script()
print("the images install and build as the scripts do")
