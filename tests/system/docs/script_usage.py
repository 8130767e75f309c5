#!/usr/bin/python3
"""The scripts of deploy/ print their usage, from any folder and through a link, and take no option for a name of a folder."""
import pathlib
import subprocess
import sys
import tempfile

deploy = pathlib.Path(sys.argv[1]) / "deploy"
with tempfile.TemporaryDirectory() as folder:
    for name in ("demo", "test", "install", "slurm/cluster"):
        link = pathlib.Path(folder) / f"a link to {name.replace('/', ' ')}"
        link.symlink_to(deploy / name)
        done = subprocess.run([link, "--help"], cwd=folder, capture_output=True, text=True, timeout=20)
        assert done.returncode == 0 and f"deploy/{name}" in done.stdout, (name, done)
    done = subprocess.run([deploy / "demo", "--quick"], cwd=folder, capture_output=True, text=True, timeout=20)
    assert done.returncode == 2 and "unknown option --quick" in done.stderr, done
    assert not (pathlib.Path(folder) / "--quick").exists()
