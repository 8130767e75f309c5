"""Piles of wood boxes that ring, for the benchmarks of this folder: the starts of bench_piles."""
import json
import math
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]
ENVIRONMENT = ROOT / "deploy/environment"  # how mpirun starts as any user on a machine of any size
sys.path.insert(0, str(ROOT / "tests/support"))
import fixtures  # noqa: E402


def run(*command, folder):
    done = subprocess.run(
        ["bash", "-c", '. "$0"; exec "$@"', ENVIRONMENT, *map(str, command)],
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    if done.returncode != 0:
        sys.exit(f"{sys.argv[0]}: {command[0]} failed: {done.stdout}{done.stderr}".strip())
    return done.stdout


def write_bank(bin_dir, folder):
    """box.hdf, of a box of 6 x 5 x 4 cm."""
    os.environ["CARILLON_BIN_DIR"] = str(bin_dir)
    fixtures.copy("wood_box.hdf", folder, "box.hdf")


def write_scene(folder, name, count, seconds, quality={}):
    """From a grid of two by two, layer above layer, each turned about (0.6, 0, 0.8)."""
    bodies = []
    for i in range(count):
        angle = 0.5 * (0.3 + 0.7 * i)
        bodies.append(
            {
                "name": f"box {i}",
                "bank": "box.hdf",
                "restitution": 0.3,
                "friction": 0.4,
                "position_m": [0.045 * (1 if i % 2 else -1), 0.045 * (1 if i // 2 % 2 else -1), 0.06 + 0.09 * (i // 4)],
                "quaternion": [math.cos(angle), 0.6 * math.sin(angle), 0.0, 0.8 * math.sin(angle)],
            }
        )
    scene = {
        "duration_s": seconds,
        "ground": {"height_m": 0.0, "restitution": 0.3, "friction": 0.4},
        "bodies": bodies,
        "listener": {"position_m": [0, -1, 0.3]},
        "quality": quality,
    }
    (folder / name).write_text(json.dumps(scene, indent=1))
    return name


def write_into(page, mark, table):
    """Puts a table between the marks of a page."""
    text = page.read_text()
    begin, end = f"<!-- begin {mark} -->\n", f"<!-- end {mark} -->"
    if begin not in text or end not in text:
        sys.exit(f"{page}: the marks '{begin.strip()}' and '{end}' are missing")
    page.write_text(text[: text.index(begin) + len(begin)] + table + text[text.index(end) :])
