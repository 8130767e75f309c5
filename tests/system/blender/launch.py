"""Blender for these tests: settings, files and the cache of banks in a temporary folder, and a count of solves."""
import os
import pathlib
import shutil
import subprocess
import tempfile


def start(script, addon, *words, has_window=False):
    """Runs a script in Blender with the arguments addon, folder, *words after "--"; returns its exit code, or 77 without Blender."""
    needed = ["blender", "xvfb-run"] if has_window else ["blender"]
    for name in needed:
        if not shutil.which(name):
            print(f"{name} is not installed")
            return 77
    screen = ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", "blender", "--enable-event-simulate"] if has_window else ["blender", "-b"]
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        bin_dir = count_solves(folder)
        (folder / "scripts/addons").mkdir(parents=True)
        environment = {
            **os.environ,
            "PATH": f"{bin_dir}:{os.environ['PATH']}",
            "BLENDER_USER_SCRIPTS": str(folder / "scripts"),
            "BLENDER_USER_CONFIG": str(folder / "config"),
            "XDG_CACHE_HOME": str(folder / "cache"),
            "TMPDIR": str(make_folder(folder / "tmp")),
        }
        command = [*screen, "--factory-startup", "-noaudio", "--python-exit-code", "1", "--python", script, "--", addon, place, *words]
        return subprocess.run(command, env=environment).returncode


def make_folder(folder):
    folder.mkdir()
    return folder


def count_solves(folder):
    """Programs of which carillon-precompute writes a line in `solves` for each run that is no question for its version."""
    own, programs = make_folder(folder / "bin"), pathlib.Path(os.environ["CARILLON_BIN_DIR"])
    shutil.copy(programs / "carillon", own)  # finds its companions in its own folder first
    for program in programs.glob("carillon-*"):
        if program.name != "carillon-precompute":
            (own / program.name).symlink_to(program)
    counter = own / "carillon-precompute"
    counter.write_text(
        f'#!/bin/sh\nif [ "$1" != --version ]; then\n  echo "$$" >> "{folder}/solves"\n'
        f'  [ ! -e "{folder}/slow" ] || exec sleep 60\nfi\nexec "{programs}/carillon-precompute" "$@"\n'
    )
    counter.chmod(0o755)
    return own
