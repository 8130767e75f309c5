#!/usr/bin/python3
"""Starts the cluster of the other tests. Exit code 77 (skipped) without Slurm.

usage: start.py DIR
"""
import pathlib
import shutil
import subprocess
import sys

folder = pathlib.Path(sys.argv[1])
script = pathlib.Path(__file__).resolve().parents[3] / "deploy/slurm/cluster"
if not shutil.which("sbatch"):
    print("SKIP: Slurm is not installed; deploy/install slurm")
    sys.exit(77)
subprocess.run([script, "stop", folder], check=True)
shutil.rmtree(folder, ignore_errors=True)
sys.exit(subprocess.run([script, "start", folder, "--cpus", "2", "--memory-mb", "6000"]).returncode)
