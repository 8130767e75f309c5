#!/usr/bin/python3
"""Meshes and banks shared by tests: made once per build by the CTest fixtures of tests/support/CMakeLists.txt.

usage: fixtures.py NAME     makes the fixture, unless it is there and made by the programs that are there now
       fixtures.py --list   names all, one a line, with the component that it needs

A test asks for its path:

    sys.path.insert(0, os.path.join(os.environ["CARILLON_SOURCE_DIR"], "tests/support"))
    import fixtures
    bank = fixtures.get("glass_plate.hdf")

A bank is a file that is only read: a test that changes it works on a copy (fixtures.copy). Tests of meshing and solving make their own.
"""
import fcntl
import json
import os
import pathlib
import shutil
import subprocess
import sys

PLATE = {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.004}
# File: recipe. A mesh: arguments of carillon-mesh. A bank: the job.
RECIPES = {
    "bar.msh": "--shape bar --length 0.2 --width 0.03 --thickness 0.01 --nodes 900".split(),
    # Analytic modes.
    "glass_plate.hdf": {"body": {"plate": PLATE, "grid": 24}, "material": "glass"},
    "small_plate.hdf": {"body": {"plate": PLATE, "grid": 8}, "material": "glass", "max_modes": 12},
    "aluminium_bar.hdf": {
        "body": {"plate": {"shape": "rectangle", "length_m": 0.3, "width_m": 0.04, "thickness_m": 0.008}, "grid": 24},
        "material": "aluminium",
    },
    "long_bar.hdf": {
        "body": {"plate": {"shape": "rectangle", "length_m": 0.6, "width_m": 0.04, "thickness_m": 0.008}, "grid": 24},
        "material": "aluminium",
        "band_hz": [20, 4000],
    },
    "brass_beam.hdf": {
        "body": {"beam": {"length_m": 0.3, "width_m": 0.05, "thickness_m": 0.008, "theory": "timoshenko"}},
        "material": "brass",
        "band_hz": [20, 8000],
        "max_modes": 30,
    },
    "mylar_drum.hdf": {
        "body": {"membrane": {"shape": "circle", "radius_m": 0.15, "lowest_hz": 150, "thickness_m": 0.00025}, "grid": 12},
        "material": {"from": "polyester film", "damping": {"internal_friction": {"tan_phi": 0.02}}},
        "band_hz": [20, 8000],
        "max_modes": 40,
    },
    # Solved by FEM.
    "free_bar.hdf": {
        "shapes": "exact",  # strains are derivatives of shapes
        "body": {"shape": "bar", "length_m": 0.4, "width_m": 0.01, "thickness_m": 0.006, "nodes": 12000},
        "material": {
            "young_modulus_pa": 70e9,
            "poisson_ratio": 0.33,
            "density_kg_m3": 2700,
            "damping": {"rayleigh": {"alpha1_s": 1e-8, "alpha2_per_s": 2}},
        },
    },
    "glass_bowl.hdf": {
        "body": {"shape": "bowl", "outer_radius_m": 0.06, "wall_m": 0.004, "nodes": 3000},
        "material": "glass",
        "max_modes": 60,
    },
    "hollow_box.hdf": {
        "body": {"shape": "hollow-box", "length_m": 0.12, "width_m": 0.08, "height_m": 0.05, "wall_m": 0.003, "nodes": 4000},
        "material": {
            "young_modulus_pa": 12.6e9,
            "poisson_ratio": 0.35,
            "density_kg_m3": 700,
            "damping": {"internal_friction": {"tan_phi": 0.01}},
        },
    },
    "wood_box.hdf": {
        "body": {"shape": "plate", "length_m": 0.06, "width_m": 0.05, "thickness_m": 0.04, "nodes": 500},
        "material": {
            "young_modulus_pa": 10e9,
            "poisson_ratio": 0.3,
            "density_kg_m3": 600,
            "damping": {"rayleigh": {"alpha1_s": 1e-6, "alpha2_per_s": 20}},
        },
    },
}


def find_component(recipe):
    """The component that a recipe needs (docs/components.md), or ""."""
    return "analytic" if isinstance(recipe, dict) and "shape" not in recipe["body"] else ""


def get_bin_dir():
    return pathlib.Path(os.environ.get("CARILLON_BIN_DIR") or pathlib.Path(__file__).resolve().parents[2] / "build/release/bin").resolve()


def copy(name, folder, as_name=None):
    """A modifiable copy in `folder`."""
    target = pathlib.Path(folder) / (as_name or name)
    shutil.copyfile(get(name), target)
    return target


def describe_programs(bin_dir):
    """Size and date of the programs that make the fixtures."""
    programs = (bin_dir / "carillon-mesh", bin_dir.parent / "libexec/carillon/carillon-precompute")
    return [[program.stat().st_size, program.stat().st_mtime_ns] for program in programs]


def get(name):
    """Path of a fixture, made if no CTest fixture has, as for scripts run by hand."""
    recipe = RECIPES[name]
    bin_dir = get_bin_dir()
    folder = bin_dir.parent / "fixtures"
    folder.mkdir(exist_ok=True)
    stamp = folder / f"{name}.made"
    made = json.dumps({"recipe": recipe, "programs": describe_programs(bin_dir)})
    with open(folder / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # tests run in parallel
        if stamp.exists() and stamp.read_text() == made and (folder / name).exists():
            return folder / name
        stamp.unlink(missing_ok=True)
        if isinstance(recipe, dict):
            (folder / f"{name}.json").write_text(json.dumps({**recipe, "bank": name}))
            words = [bin_dir / "carillon-precompute", "-q", f"{name}.json"]
        else:
            words = [bin_dir / "carillon-mesh", *recipe, "-q", "-o", name]
        done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode != 0:
            sys.exit(f"fixture {name}: {done.stdout}{done.stderr}")
        stamp.write_text(made)
    return folder / name


if __name__ == "__main__":
    if sys.argv[1:] == ["--list"]:
        print("\n".join(f"{name} {find_component(recipe)}".rstrip() for name, recipe in RECIPES.items()))
        sys.exit()
    if len(sys.argv) != 2 or sys.argv[1] not in RECIPES:
        sys.exit(f"usage: fixtures.py NAME     one of {', '.join(RECIPES)}")
    print(get(sys.argv[1]))
