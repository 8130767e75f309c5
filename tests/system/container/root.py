#!/usr/bin/python3
"""Builds the root of an image by debootstrap and the Dockerfile's own instructions, and uses it: a bank is made and read in it.

usage: root.py SOURCE_DIR SIDE FOLDER        exits 77 (skipped) without root or debootstrap
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys

source, side, folder = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
if os.geteuid() != 0 or not shutil.which("debootstrap"):
    print("SKIP: needs root and debootstrap (deploy/install container)")
    sys.exit(77)
work = folder / side
shutil.rmtree(work, ignore_errors=True)
subprocess.run([source / "deploy/container/root", side, work, "--base", folder / "base"], check=True)
root = work / "root"


def inside(*words):
    """In the root, as a container would: /proc and /dev are there, the variables of the image are set."""
    settings = [
        line.split(" ", 1)[1]
        for line in (source / f"deploy/container/{side}.Dockerfile").read_text().splitlines()
        if line.startswith("ENV ")
    ]
    inner = 'mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && exec chroot "$0" env -C /data "$@"'
    done = subprocess.run(
        ["unshare", "--mount", "--propagation", "private", "sh", "-c", inner, root, *" ".join(settings).split(), *words],
        capture_output=True,
        text=True,
        timeout=600,
        env={"PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root"},
    )
    assert done.returncode == 0, (words, done.stdout, done.stderr)
    return done.stdout


if side == "precompute":
    body = {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.004, "nodes": 400}
    material = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
    (root / "data/bar.json").write_text(json.dumps({"body": body, "material": material, "bank": "bar.hdf"}))
    inside("mpirun", "-np", "2", "carillon-precompute", "bar.json")
    print(inside("carillon-bank", "check", "bar.hdf"))
    print(inside("carillon", "--store", "/data/store", "submit", "bar.json", "--run"))
else:
    print(inside("carillon-render", "--version"))
    libraries = inside("sh", "-c", "ldd /usr/local/bin/carillon-*")
    assert "not found" not in libraries and "libmpi" not in libraries and "libpetsc" not in libraries, libraries
print(f"the root of {side} works")
shutil.rmtree(work)
