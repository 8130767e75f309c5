#!/usr/bin/env python3
"""Makes tests/unit/precompute/mesh/data: one small body in every format and encoding, written by programs that share no code with ours.

A box of 0.3 x 0.2 x 0.1 m, meshed by Gmsh with the groups: volume 7 (unnamed), surfaces "clamp" (x = 0) and 9 (x = 0.3, unnamed), curve
"rim", point "tip". Linear and quadratic. `truth1.txt`, `truth2.txt`: what Gmsh's own interface says the mesh is (corners of every
tetrahedron, nodes of every group), the oracle of the tests. TetGen's files are of its own mesh of the same box, made by TetGen itself.

Needs python3-gmsh, python3-meshio, python3-vtk9, tetgen (none of which Carillon needs). Run: /usr/bin/python3
tests/unit/precompute/mesh/make_fixtures.py
"""
import os
import subprocess

import gmsh
import meshio
import numpy as np
import vtkmodules.vtkIOXML as vtk_xml
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid

DATA = os.path.join(os.path.dirname(os.path.abspath(__file__)), "data")
GROUPS = {(0, 1): "tip", (1, 2): "rim", (2, 3): "clamp", (2, 9): "physical:9", (3, 7): "physical:7"}


def make_model():
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.CharacteristicLengthMin", 0.12)
    gmsh.option.setNumber("Mesh.CharacteristicLengthMax", 0.12)
    gmsh.model.occ.addBox(0, 0, 0, 0.3, 0.2, 0.1)
    gmsh.model.occ.synchronize()

    def inside(dim, *box):
        low, high = np.array(box[:3]) - 1e-6, np.array(box[3:]) + 1e-6
        return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*low, *high, dim)]

    for (dim, tag), name, box in (
        ((0, 1), "tip", (0.3, 0.2, 0.1, 0.3, 0.2, 0.1)),
        ((1, 2), "rim", (0, 0, 0.1, 0, 0.2, 0.1)),
        ((2, 3), "clamp", (0, 0, 0, 0, 0.2, 0.1)),
        ((2, 9), "", (0.3, 0, 0, 0.3, 0.2, 0.1)),
        ((3, 7), "", (0, 0, 0, 0.3, 0.2, 0.1)),
    ):
        gmsh.model.addPhysicalGroup(dim, inside(dim, *box), tag)
        if name:
            gmsh.model.setPhysicalName(dim, tag, name)
    gmsh.model.mesh.generate(3)


def write_truth(order):
    """Corner coordinates of each tetrahedron sorted, sorted by line, and the nodes of each group."""
    tags, coords, _ = gmsh.model.mesh.getNodes()
    where = dict(zip(tags, coords.reshape(-1, 3)))
    kind = 4 if order == 1 else 11
    _, nodes = gmsh.model.mesh.getElementsByType(kind)
    nodes = nodes.reshape(-1, 4 if order == 1 else 10)
    tets = sorted(sorted(tuple(where[t]) for t in row) for row in nodes)
    with open(f"{DATA}/truth{order}.txt", "w") as out:
        out.write(f"{len(tags)} {len(tets)} {nodes.shape[1]}\n")
        for tet in tets:
            out.write(" ".join(repr(float(v)) for x in tet for v in x) + "\n")
        for (dim, tag), name in sorted(GROUPS.items(), key=lambda item: item[1]):
            group, xyz = gmsh.model.mesh.getNodesForPhysicalGroup(dim, tag)
            points = sorted(set(tuple(x) for x in xyz.reshape(-1, 3)))
            out.write(f"{name} {len(points)}\n")
            for x in points:
                out.write(" ".join(repr(float(v)) for v in x) + "\n")
    index = {t: i for i, t in enumerate(tags)}
    cells = np.array([[index[t] for t in row] for row in nodes])
    if order == 2:
        cells[:, [8, 9]] = cells[:, [9, 8]]  # Gmsh to VTK
    clamp = np.zeros(len(tags), dtype=np.int32)
    for t in gmsh.model.mesh.getNodesForPhysicalGroup(2, 3)[0]:
        clamp[index[t]] = 3
    return coords.reshape(-1, 3), cells, clamp


def write_gmsh(order):
    for version, name in ((2.2, "22"), (4.1, "41")):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(f"{DATA}/gmsh{name}_{'binary' if binary else 'text'}_{order}.msh")
    gmsh.option.setNumber("Mesh.Binary", 0)


def write_views(order):
    """Post-processing data of every kind behind the mesh, by Gmsh itself: in binary files no line end comes before some of their end
    tags."""
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    kinds, elements, nodes = gmsh.model.mesh.getElements(3)
    elements, corners = elements[0], len(nodes[0]) // len(elements[0])
    data = {
        "NodeData": (tags, [[x] for x in xyz.reshape(-1, 3)[:, 0]]),
        "ElementData": (elements, [[0.5 * n, 2.0, 3.0] for n in range(len(elements))]),
        "ElementNodeData": (elements, [[0.1 * k for k in range(corners)] for _ in elements]),
    }
    gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
    for version, name in ((2.2, "22"), (4.1, "41")):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            path = f"{DATA}/gmsh{name}_views_{'binary' if binary else 'text'}_{order}.msh"
            gmsh.write(path)
            for kind, (where, values) in data.items():
                view = gmsh.view.add(kind)
                gmsh.view.addModelData(view, 0, gmsh.model.getCurrent(), kind, where, values)
                gmsh.view.write(view, path, append=True)
                gmsh.view.remove(view)
    gmsh.option.setNumber("Mesh.Binary", 0)


def write_parametric_and_parted(order):
    """The same mesh with parametric coordinates; then in two parts, with ghost elements. The last that is done to the model."""
    for parted in (False, True):
        gmsh.option.setNumber("Mesh.SaveParametric", 0 if parted else 1)
        if parted:
            gmsh.option.setNumber("Mesh.PartitionCreateGhostCells", 1)
            gmsh.option.setNumber("Mesh.PartitionCreateTopology", 1)
            gmsh.model.mesh.partition(2)
        for version, name in ((2.2, "22"), (4.1, "41")):
            for binary in (0, 1):
                gmsh.option.setNumber("Mesh.MshFileVersion", version)
                gmsh.option.setNumber("Mesh.Binary", binary)
                kind = "parted" if parted else "parametric"
                gmsh.write(f"{DATA}/gmsh{name}_{kind}_{'binary' if binary else 'text'}_{order}.msh")
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.option.setNumber("Mesh.SaveParametric", 0)


def write_periodic():
    """The box with one end as a copy of the other: a mesh of its own, so it is compared with its other encodings."""
    gmsh.clear()
    gmsh.model.occ.addBox(0, 0, 0, 0.3, 0.2, 0.1)
    gmsh.model.occ.synchronize()
    ends = [[tag for _, tag in gmsh.model.getEntitiesInBoundingBox(x - 1e-6, -1e-6, -1e-6, x + 1e-6, 0.21, 0.11, 2)] for x in (0.3, 0.0)]
    gmsh.model.mesh.setPeriodic(2, *ends, [1, 0, 0, 0.3, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    gmsh.model.mesh.generate(3)
    for version, name in ((2.2, "22"), (4.1, "41")):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(f"{DATA}/gmsh{name}_periodic_{'binary' if binary else 'text'}_1.msh")
    gmsh.option.setNumber("Mesh.Binary", 0)


def write_vtk(points, cells, clamp, order):
    grid = vtkUnstructuredGrid()
    pts = vtkPoints()
    pts.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(pts)
    table = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).astype(np.int64).ravel()
    array = vtkCellArray()
    array.SetCells(len(cells), numpy_to_vtkIdTypeArray(table, deep=True))
    grid.SetCells(10 if order == 1 else 24, array)
    for owner, values, name in (
        (grid.GetPointData(), clamp, "clamp"),
        (grid.GetCellData(), np.full(len(cells), 7, dtype=np.int32), "region"),
    ):
        data = numpy_to_vtk(values, deep=True)
        data.SetName(name)
        owner.AddArray(data)
    for name, mode, zlib, raw, wide, big in (
        ("ascii", "Ascii", 0, 0, 0, 0),
        ("inline", "Binary", 0, 0, 0, 0),
        ("inline64", "Binary", 0, 0, 1, 0),
        ("inline_zlib", "Binary", 1, 0, 0, 0),
        ("appended", "Appended", 0, 0, 0, 0),
        ("appended_zlib64", "Appended", 1, 0, 1, 0),
        ("raw", "Appended", 0, 1, 0, 0),
        ("raw_zlib", "Appended", 1, 1, 0, 0),
        ("raw64_big", "Appended", 0, 1, 1, 1),
    ):
        writer = vtk_xml.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(f"{DATA}/vtk_{name}_{order}.vtu")
        writer.SetInputData(grid)
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.SetCompressorTypeToZLib() if zlib else writer.SetCompressorTypeToNone()
        writer.SetEncodeAppendedData(0 if raw else 1)
        writer.SetHeaderTypeToUInt64() if wide else writer.SetHeaderTypeToUInt32()
        writer.SetByteOrderToBigEndian() if big else writer.SetByteOrderToLittleEndian()
        if zlib:
            writer.SetBlockSize(512)  # several blocks per array
        writer.Write()
    if order == 1:
        writer = vtk_xml.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(f"{DATA}/lz4.vtu")
        writer.SetInputData(grid)
        writer.SetCompressorTypeToLZ4()
        writer.Write()


def write_medit(points, cells, clamp, order):
    name, rows = ("Tetrahedra", {"medit": cells}) if order == 1 else ("TetrahedraP2", {})
    if order == 2:
        gmsh_rows = cells.copy()
        gmsh_rows[:, [8, 9]] = gmsh_rows[:, [9, 8]]
        backwards = np.hstack([cells[:, :4], cells[:, 9:3:-1]])
        rows = {"medit": cells, "medit_gmsh_order": gmsh_rows, "medit_ordering": backwards}
    for stem, row in rows.items():
        with open(f"{DATA}/{stem}_{order}.mesh", "w") as out:
            out.write(f"MeshVersionFormatted 2\n# comment\nDimension 3\n\nVertices\n{len(points)}\n")
            for x, ref in zip(points, clamp):
                out.write(" ".join(repr(float(v)) for v in x) + f" {ref}\n")
            if stem == "medit_ordering":
                edges = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
                weights = [[2 * (i == k) for k in range(4)] for i in range(4)] + [[int(k in e) for k in range(4)] for e in edges[::-1]]
                out.write("TetrahedraP2Ordering\n10\n" + "".join(" ".join(map(str, w)) + "\n" for w in weights))
            out.write(f"{name}\n{len(row)}\n")
            for tet in row:
                out.write(" ".join(str(i + 1) for i in tet) + " 7\n")
            out.write("End\n")


def write_meshio(points, cells, clamp, order):
    kind = "tetra" if order == 1 else "tetra10"
    mesh = meshio.Mesh(points, [(kind, cells)], point_data={"clamp": clamp}, cell_data={"region": [np.full(len(cells), 7, dtype=np.int32)]})
    for name, options in (("ascii", {"binary": False}), ("plain", {"compression": None}), ("zlib", {"compression": "zlib"})):
        mesh.write(f"{DATA}/meshio_{name}_{order}.vtu", file_format="vtu", **options)
    meshio.Mesh(points, [(kind, cells)]).write(f"{DATA}/meshio41_{order}.msh", file_format="gmsh", binary=True)
    if order == 1:
        meshio.Mesh(points, [(kind, cells)], point_data={"tetgen:ref": clamp}, cell_data={"tetgen:ref": [np.full(len(cells), 7)]}).write(
            f"{DATA}/meshio_1.node", file_format="tetgen"
        )


def write_tetgen():
    corners = [(x, y, z) for z in (0, 0.1) for x, y in ((0, 0), (0.3, 0), (0.3, 0.2), (0, 0.2))]
    facets = ((1, 2, 3, 4), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8))
    for order in (1, 2):
        stem = f"{DATA}/tetgen{order}"
        with open(stem + ".poly", "w") as out:
            out.write("8 3 0 1\n")
            for i, x in enumerate(corners):
                out.write(f"{i + 1} {x[0]} {x[1]} {x[2]} {4 if x[0] == 0 else 2}\n")
            out.write("6 1\n" + "".join(f"1 0 {i + 1}\n4 " + " ".join(map(str, f)) + "\n" for i, f in enumerate(facets)))
            out.write("0\n1\n1 0.15 0.1 0.05 7 -1\n")
        subprocess.run(["tetgen", f"-pqAa0.0005o{order}Q", stem + ".poly"], check=True, stdout=subprocess.DEVNULL)
        for unwanted in (".poly", ".1.face", ".1.edge", ".1.smesh"):
            if os.path.exists(stem + unwanted):
                os.remove(stem + unwanted)


os.makedirs(DATA, exist_ok=True)
make_model()
for order in (1, 2):
    gmsh.model.mesh.setOrder(order)
    parts = write_truth(order)
    write_gmsh(order)
    write_vtk(*parts, order)
    write_medit(*parts, order)
    write_meshio(*parts, order)
    if order == 1:
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.write(f"{DATA}/gmsh_1.mesh")
        gmsh.option.setNumber("Mesh.SaveAll", 0)
        write_views(order)
write_parametric_and_parted(2)
write_periodic()
gmsh.finalize()
write_tetgen()
