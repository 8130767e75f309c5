#!/usr/bin/python3
"""Peak memory of each rank of carillon-precompute on 1, 2 and 4 ranks, and how near it comes to 1 / ranks above a floor.

usage: memory.py BIN_DIR [--mesh FILE | --nodes N] [--ranks 1 2 4] [--element T4|T10] [--max-modes N] [--band LOW HIGH] [--limit RATIO]

The floor is the peak of the same job on a mesh of some hundred nodes, on as many ranks: MPI, PETSc, the program and its libraries. Without
--mesh a solid bar of --nodes nodes (100000) is made. The table's last column is (peak - floor) of the fullest rank over (peak - floor on
one rank) / ranks: 1 is perfect. With --limit the exit code is 1 if that column exceeds it. Peaks are VmHWM, as the kernel counts it: pages
shared between the ranks count in each of them.
"""
import argparse
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile


def measure_rank():
    """Runs the rest of the command line and writes its peak to FOLDER/RANK."""
    folder, command = pathlib.Path(sys.argv[2]), sys.argv[3:]
    code = subprocess.run(command).returncode
    (folder / os.environ["OMPI_COMM_WORLD_RANK"]).write_text(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
    sys.exit(code)


def find_peaks(program, job, ranks):
    """Peak of each rank [MB], and the phases with their peaks of the fullest rank."""
    with tempfile.TemporaryDirectory(prefix="carillon-memory-") as folder:
        command = [
            "mpirun",
            "-np",
            str(ranks),
            "--oversubscribe",
            "--bind-to",
            "none",
            sys.executable,
            __file__,
            "--rank",
            folder,
            str(program),
            str(job),
        ]
        run = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if run.returncode != 0:
            sys.exit(f"{' '.join(command)} fails:\n{run.stdout}")
        peaks = [int((pathlib.Path(folder) / str(rank)).read_text()) / 1024 for rank in range(ranks)]
    return peaks, run.stdout


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n")[0])
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--mesh", type=pathlib.Path)
    parser.add_argument("--nodes", type=int, default=100000)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--element", default="T10")
    parser.add_argument("--max-modes", type=int)
    parser.add_argument("--band", type=float, nargs=2, default=[20, 20000])
    parser.add_argument("--limit", type=float)
    parser.add_argument("--job", default="{}", help="further keys of the job, as JSON")
    options = parser.parse_args()
    program = options.bin.resolve() / "carillon-precompute"
    with tempfile.TemporaryDirectory(prefix="carillon-memory-") as scratch:
        folder = pathlib.Path(scratch)

        def make_bar(nodes, name):
            order = "2" if options.element == "T10" else "1"
            subprocess.run(
                [
                    options.bin.resolve() / "carillon-mesh",
                    *f"--shape bar --length 0.6 --width 0.12 --thickness 0.12 --nodes {nodes} --order {order}".split(),
                    "-o",
                    folder / name,
                    "--quiet",
                ],
                check=True,
                stdout=subprocess.DEVNULL,
            )
            return folder / name

        def write_job(mesh, name):
            job = {
                "mesh": str(mesh),
                "bank": str(folder / f"{name}.hdf"),
                "element": options.element,
                "band_hz": options.band,
                "material": {"young_modulus_pa": 5e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {}}},
                **json.loads(options.job),
            }
            if options.max_modes:
                job["max_modes"] = options.max_modes
            (folder / f"{name}.json").write_text(json.dumps(job))
            return folder / f"{name}.json"

        large = write_job(options.mesh.resolve() if options.mesh else make_bar(options.nodes, "large.msh"), "large")
        small = write_job(make_bar(300, "small.msh"), "small")
        print(f"{'ranks':>5} {'floor MB':>9} {'peak of each rank MB':<40} {'above floor':>11} {'times ranks / one rank':>22}")
        alone = None
        worst = 0.0
        for ranks in options.ranks:
            floor = max(find_peaks(program, small, ranks)[0])
            peaks, text = find_peaks(program, large, ranks)
            above = max(peaks) - floor
            alone = alone or above * ranks
            ratio = above * ranks / alone
            worst = max(worst, ratio)
            print(f"{ranks:5d} {floor:9.0f} {' '.join(f'{peak:.0f}' for peak in peaks):<40} {above:11.0f} {ratio:22.2f}", flush=True)
            for line in text.splitlines():
                if re.search(r"peak|nodes|modes", line):
                    print(f"      | {line}")
        if options.limit and worst > options.limit:
            sys.exit(f"the fullest rank holds {worst:.2f} times its share; the limit is {options.limit}")


if sys.argv[1:2] == ["--rank"]:
    measure_rank()
else:
    main()
