#!/usr/bin/python3
"""Fallbacks and orthogonality of the eigensolver with every set of OpenBLAS kernels supported by this processor: results must not depend on
their rounding.

usage: kernels.py TEST_RANKS
"""
import os
import re
import subprocess
import sys

NEEDS = {
    "Prescott": {"pni"},
    "Nehalem": {"sse4_2"},
    "Haswell": {"avx2", "fma"},
    "Zen": {"avx2", "fma"},
    "SkylakeX": {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"},
}

WANTED = ("BlockLanczos.stays_orthogonal", "Fallback.goes_to_mumps", "Fallback.resumes_from_a_checkpoint")

with open("/proc/cpuinfo") as file:
    flags = set(re.search(r"^flags\s*:(.*)$|\Z", file.read(), re.M).group(0).split())
for kernels in ["", *(name for name, needs in NEEDS.items() if needs <= flags)]:
    environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    if kernels:
        environment["OPENBLAS_CORETYPE"] = kernels
    run = subprocess.run([sys.argv[1], "--gtest_filter=Fallback.*:BlockLanczos.*"], env=environment, capture_output=True, text=True)
    passed = re.findall(r"\[       OK \] (\S+)", run.stdout)
    missing = [name for name in WANTED if not any(test.startswith(name) for test in passed)]
    print(f"{kernels or 'not named'}: {len(passed)} tests passed")
    if run.returncode != 0 or missing:
        sys.exit(f"missing: {missing}\n" + run.stdout[-5000:] + run.stderr[-2000:])
