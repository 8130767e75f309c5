#!/usr/bin/python3
"""CPU seconds of `carillon-mesh --look` on CAE meshes of a million nodes (.inp, Nastran, UNV), of meshio on the same .inp file, and of
`carillon-bank import` on one and two modes of the Nastran mesh (.pch).

usage: readers.py BIN_DIR [NODES]
"""
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy

CORNERS = ((0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7))
EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def make_bar(nodes):
    """Points, and ten-node tetrahedra with numbers from 1: six in every cube of a lattice."""
    side = max(3, round((nodes / 8) ** (1 / 3)) // 2 * 2 + 1)
    n = (8 * (side - 1) + 1, side, side)
    lattice = numpy.stack(numpy.meshgrid(*map(numpy.arange, n), indexing="ij"), axis=-1)
    number = lambda p: (p[:, 0] * n[1] + p[:, 1]) * n[2] + p[:, 2] + 1
    low = lattice[0:-1:2, 0:-1:2, 0:-1:2].reshape(-1, 3)
    offsets = [2 * numpy.array([i, j, k]) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    tets = []
    for corners in CORNERS:
        x = [low + offsets[c] for c in corners]
        tets.append(numpy.stack([number(p) for p in x + [(x[a] + x[b]) // 2 for a, b in EDGES]], axis=1))
    return 5e-4 * lattice.reshape(-1, 3), numpy.concatenate(tets)


def write_files(folder, points, tets):
    rows, elements = list(enumerate(points.tolist(), 1)), list(enumerate(tets.tolist(), 1))
    with open(folder / "bar.inp", "w") as file:
        file.write("*NODE, NSET=All\n")
        file.writelines("%d, %.9g, %.9g, %.9g\n" % (i, *x) for i, x in rows)
        file.write("*ELEMENT, TYPE=C3D10, ELSET=Body\n")
        file.writelines("%d, " % i + ", ".join(map(str, t)) + "\n" for i, t in elements)
        file.write("*MATERIAL, NAME=S\n*ELASTIC\n2e11, .3\n*DENSITY\n7850\n*SOLID SECTION, ELSET=Body, MATERIAL=S\n")
    with open(folder / "bar.bdf", "w") as file:
        file.writelines("GRID,%d,,%.9g,%.9g,%.9g\n" % (i, *x) for i, x in rows)
        file.writelines(("CTETRA  %8d       1" + "%8d" * 6 + "+\n+       " + "%8d" * 4 + "\n") % (i, *t) for i, t in elements)
        file.write("PSOLID,1,1\nMAT1,1,2.e11,,.3,7850.\nENDDATA\n")
    with open(folder / "bar.unv", "w") as file:
        file.write("    -1\n  2411\n")
        file.writelines("%10d         1         1        11\n%25.16E%25.16E%25.16E\n" % (i, *x) for i, x in rows)
        file.write("    -1\n    -1\n  2412\n")
        order = (0, 4, 1, 5, 2, 6, 7, 8, 9, 3)
        head = "%10d       118         1         1         7        10\n" + "%10d" * 8 + "\n%10d%10d\n"
        file.writelines(head % (i, *(t[k] for k in order)) for i, t in elements)
        file.write("    -1\n")


def write_modes(path, points, count):
    """Eigenvectors of a punch file."""
    with open(path, "w") as file:
        for mode in range(1, count + 1):
            file.write("$TITLE   =\n$SUBTITLE=\n$LABEL   =\n$EIGENVECTOR\n$REAL OUTPUT\n$SUBCASE ID =           1\n")
            file.write("$EIGENVALUE = %14.7E  MODE = %5d\n" % (1e8 * mode, mode))
            shape = numpy.cos(mode * numpy.pi * points / points.max(axis=0))
            line = "%10d       G%18.6E%18.6E%18.6E%8d\n-CONT-            " + "%18.6E" * 3 % (0, 0, 0) + "%8d\n"
            file.writelines(line % (i, *x, 2 * i, 2 * i + 1) for i, x in enumerate(shape.tolist(), 1))


def measure(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    look = programs / "carillon-mesh"
    points, tets = make_bar(int(sys.argv[2]) if len(sys.argv) > 2 else 1_000_000)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_files(folder, points, tets)
        print(f"{len(points)} nodes, {len(tets)} tetrahedra of ten nodes")
        for ending in "inp", "bdf", "unv":
            print(f".{ending}  {measure([look, folder / f'bar.{ending}', '--look']):.2f} CPU s, with the check of the mesh")
        print(
            f"meshio {measure([sys.executable, '-c', 'import sys, meshio; meshio.read(sys.argv[1])', folder / 'bar.inp']):.2f} CPU s (.inp)"
        )
        for modes in 1, 2:
            write_modes(folder / "bar.pch", points, modes)
            words = ["import", folder / "bar.pch", "--mesh", folder / "bar.bdf", "--material", "steel", "-o", folder / "bar.hdf"]
            print(f".pch  {measure([programs / 'carillon-bank', *words]):.2f} CPU s with the mesh and the bank, modes: {modes}")


main()
