"""Runs carillon-precompute under mpirun and checks its output files."""
import json
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy

STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}


class Folder:
    def __init__(self, bin_dir):
        self.bin = pathlib.Path(bin_dir).resolve()
        self.scratch = tempfile.TemporaryDirectory(prefix="carillon-failures-")
        self.path = pathlib.Path(self.scratch.name)

    def __truediv__(self, name):
        return self.path / name

    def list(self):
        return sorted(str(path.relative_to(self.path)) for path in self.path.rglob("*"))

    def write_job(self, mesh, name="job.json", bank="out.bank", **more):
        (self.path / name).write_text(json.dumps({"mesh": mesh, "bank": bank, "material": STEEL, **more}))

    def mesh(self, *arguments):
        subprocess.run([self.bin / "carillon-mesh", "--quiet", *map(str, arguments)], cwd=self.path, check=True, stdout=subprocess.DEVNULL)

    def command(self, ranks, before=(), job="job.json"):
        return ["mpirun", "-np", str(ranks), "--oversubscribe", "--bind-to", "none", *before, str(self.bin / "carillon-precompute"), job]

    def run(self, ranks, before=(), job="job.json", timeout_s=100, command=None):
        """Returns (exit code, both streams); a hang fails the test."""
        with subprocess.Popen(
            command or self.command(ranks, before, job),
            cwd=self.path,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as run:
            try:
                return run.communicate(timeout=timeout_s)[0], run.returncode
            except subprocess.TimeoutExpired:
                run.terminate()
                fail(f"the run hangs:\n{run.communicate()[0]}")

    def expect(self, ranks, code, words, **how):
        """Runs, and expects the exit code, one error message with all words, and unchanged files."""
        before = self.list()
        text, got = self.run(ranks, **how)
        check(got == code, f"exit code {got} instead of {code} on {ranks} ranks:\n{text}")
        check(text.count("carillon-precompute: error:") == 1, f"not one message on {ranks} ranks:\n{text}")
        for word in words:
            check(word in text, f"'{word}' is not in the message on {ranks} ranks:\n{text}")
        check(self.list() == before, f"files before {before}, after {self.list()}")
        return text


def fail(text):
    print(text)
    sys.exit(1)


def check(is_true, text):
    if not is_true:
        fail(text)


def list_ranks(mpirun):
    """Processes of carillon-precompute below mpirun, in starting order."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        try:
            if (
                int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1]) == mpirun
                and b"carillon-precompute" in (entry / "cmdline").read_bytes()
            ):
                found.append(int(entry.name))
        except (OSError, ValueError, IndexError):
            pass
    return sorted(found)


def is_running(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] not in ("Z", "X")
    except OSError:
        return False


def make_box(cells, size):
    """Nodes and tetrahedra (six per cell along a common diagonal) of a box."""
    nx, ny, nz = cells
    grid = numpy.stack(numpy.meshgrid(*(numpy.linspace(0, s, n + 1) for s, n in zip(size, cells)), indexing="ij"), axis=-1)
    number = numpy.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nx + 1, ny + 1, nz + 1)
    tets = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        at = numpy.zeros(3, int)
        corners = []
        for axis in (None, *order):
            if axis is not None:
                at[axis] = 1
            corners.append(number[at[0] : nx + at[0], at[1] : ny + at[1], at[2] : nz + at[2]].ravel())
        tets.append(numpy.stack(corners, axis=1))
    return grid.reshape(-1, 3), numpy.stack(tets, axis=1).reshape(-1, 4)


def add_mid_nodes(nodes, tets):
    """Ten-node tetrahedra: VTK's order of the edges."""
    edges = numpy.sort(tets[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]], axis=2)
    unique, place = numpy.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    return numpy.concatenate([nodes, nodes[unique].mean(axis=1)]), numpy.concatenate([tets, len(nodes) + place.reshape(-1, 6)], axis=1)


def write_vtkhdf(path, nodes, tets, point_data=None, regions=None):
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = (1, 0)
        root.attrs["Type"] = numpy.bytes_("UnstructuredGrid")
        root["NumberOfPoints"], root["NumberOfCells"], root["NumberOfConnectivityIds"] = [len(nodes)], [len(tets)], [tets.size]
        root["Points"], root["Connectivity"] = nodes, tets.ravel()
        root["Offsets"] = numpy.arange(len(tets) + 1) * tets.shape[1]
        root["Types"] = numpy.full(len(tets), {4: 10, 10: 24}[tets.shape[1]], "u1")
        for name, values in (point_data or {}).items():
            root[f"PointData/{name}"] = values
        if regions is not None:
            root["CellData/region"] = regions
