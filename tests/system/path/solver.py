"""Starts of the programs by the scripts of this folder, whose first argument is the folder of the programs."""
import json
import math
import pathlib
import subprocess
import sys

BIN = pathlib.Path(sys.argv[1]).resolve()
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
CERAMIC = {"lame_lambda_pa": 3.99e9, "lame_mu_pa": 2.05e9, "density_kg_m3": 2700, "damping": {"rayleigh": {}}}
GLASS = {"young_modulus_pa": 72e9, "poisson_ratio": 0.22, "density_kg_m3": 2500, "damping": {"internal_friction": {"tan_phi": 1e-3}}}


def run(folder, program, *words, ranks=1, code=0, **options):
    """The finished program; any exit code passes with code=None."""
    launcher = ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none"] if ranks > 1 else []
    command = [*launcher, str(BIN / program), *map(str, words)]
    done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=280, **options)
    if code is not None:
        assert done.returncode == code, f"{program} {words}: exit code {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done


def write_job(folder, name="job", **job):
    (folder / f"{name}.json").write_text(json.dumps({"bank": f"{name}.hdf"} | job))


def solve(folder, name="job", ranks=1, code=0, **job):
    """Both streams of a solve into NAME.hdf."""
    write_job(folder, name, **job)
    done = run(folder, "carillon-precompute", f"{name}.json", ranks=ranks, code=code)
    return done.stdout + done.stderr


def read_info(folder, name="job"):
    return json.loads(run(folder, "carillon-bank", "info", "--json", f"{name}.hdf").stdout)


def read_record(folder, name="job"):
    return json.loads((folder / f"{name}.hdf.resolved.json").read_text())


def write_sphere(path, radius, rings=48):
    """A latitude-longitude sphere as an OFF file."""
    points, faces, around = [(0, 0, radius)], [], 2 * rings
    for i in range(1, rings):
        for j in range(around):
            polar, azimuth = math.pi * i / rings, 2 * math.pi * j / around
            points.append(
                (radius * math.sin(polar) * math.cos(azimuth), radius * math.sin(polar) * math.sin(azimuth), radius * math.cos(polar))
            )
    points.append((0, 0, -radius))
    at = lambda i, j: 1 + (i - 1) * around + j % around
    for j in range(around):
        faces += [(0, at(1, j), at(1, j + 1)), (len(points) - 1, at(rings - 1, j + 1), at(rings - 1, j))]
        for i in range(1, rings - 1):
            faces += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
    path.write_text(
        f"OFF\n{len(points)} {len(faces)} 0\n"
        + "".join("%.9g %.9g %.9g\n" % p for p in points)
        + "".join("3 %d %d %d\n" % f for f in faces)
    )
