#!/usr/bin/python3
"""Meshes of carillon-mesh in other programs, for every shape, order and way of meshing: meshio counts the tetrahedra, Gmsh converts all of
them to C3D4 or C3D10, VTK (the reader of ParaView) opens the VTU, and our own reader finds the same sets in both formats.

usage: others_test.py BIN_DIR
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import meshio
import vtk

BIN = pathlib.Path(sys.argv[1]).resolve()
sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
from surfaces import format_off, make_box  # noqa: E402


def run(folder, *words):
    done = subprocess.run(list(map(str, words)), cwd=folder, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    return done.stdout


def count_in_deck(text, kind):
    """Elements of *ELEMENT blocks of this type."""
    count, is_inside = 0, False
    for line in text.splitlines():
        if line.startswith("*"):
            is_inside = line.upper().startswith("*ELEMENT") and f"TYPE={kind}" in line.upper().replace(" ", "")
        elif is_inside:
            count += 1
    return count


def count_in_vtk(path, kind):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    sets = {}
    for i in range(grid.GetPointData().GetNumberOfArrays()):
        array = grid.GetPointData().GetArray(i)
        if array.GetNumberOfComponents() == 1:
            sets[array.GetName()] = sum(array.GetValue(k) for k in range(array.GetNumberOfTuples()))
    return sum(grid.GetCellType(c) == kind for c in range(grid.GetNumberOfCells())), sets


def check(folder, name, *words):
    run(folder, BIN / "carillon-mesh", *words, "-q", "-o", "out.msh", "--json", "out.json")
    run(folder, BIN / "carillon-mesh", *words, "-q", "-o", "out.vtu")
    facts = json.loads((folder / "out.json").read_text())
    sets, tets, order = facts["node_sets"], facts["tets"], facts["order"]
    mesh = meshio.read(folder / "out.msh")
    found = sum(len(block.data) for block in mesh.cells if block.type == ("tetra" if order == 1 else "tetra10"))
    assert found == tets, f"{name}: meshio finds {found} of {tets} tetrahedra"
    run(folder, "gmsh", "out.msh", "-save", "-format", "inp", "-o", "gmsh.inp")
    # A row of ten nodes is one line.
    found = count_in_deck((folder / "gmsh.inp").read_text(), "C3D4" if order == 1 else "C3D10")
    assert found == tets, f"{name}: Gmsh writes {found} of {tets} tetrahedra"
    found, vtk_sets = count_in_vtk(folder / "out.vtu", 10 if order == 1 else 24)
    assert found == tets and vtk_sets == sets, f"{name}: VTK finds {found} of {tets} tetrahedra, sets {vtk_sets}"
    for file in "out.msh", "out.vtu":
        look = json.loads(run(folder, BIN / "carillon-mesh", file, "--look"))
        assert look["tets"] == tets and look["node_sets"] == sets, f"{name}: {file} has the sets {look['node_sets']}, not {sets}"


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        listed = run(folder, BIN / "carillon-mesh", "--help").partition("Shapes, their")[2].partition("Every body")[0]
        shapes = re.findall(r"^  ([a-z-]+) {2,}", listed, re.MULTILINE)
        assert len(shapes) >= 11, listed
        for shape in shapes:
            for order in 1, 2:
                check(folder, f"{shape}, order {order}", "--shape", shape, "--nodes", 600, "--order", order)
        check(folder, "straight", "--shape", "tube", "--nodes", 900, "--order", 2, "--straight")
        (folder / "box.off").write_text(format_off(*make_box(0.06, 0.04, 0.03)))
        for words in (
            ["--nodes", 800],
            ["--nodes", 800, "--order", 2],
            ["--method", "stuffing", "--nodes", 800],
            ["--facets", "--edge", 0.01],
        ):
            check(folder, f"surface {words}", "box.off", *words)
        check(folder, "wall", "box.off", "--wall", 0.002, "--edge", 0.008)
        print("meshes of", len(shapes), "shapes and of surfaces are the same in meshio, Gmsh and VTK")


main()
