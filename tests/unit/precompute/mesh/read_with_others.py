#!/usr/bin/env python3
"""read_with_others.py meshio|gmsh FILE.msh: what another reader finds in the file (volume, elements, misplaced mid nodes, node sets)."""
import sys

import numpy as np

# Mid nodes: the corner pairs in VTK's order (meshio) and in Gmsh's.
EDGES = {"meshio": ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)), "gmsh": ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3))}


def report(reader, x, cells):
    corners = x[cells[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6
    off = 0
    if cells.shape[1] == 10:
        for k, (i, j) in enumerate(EDGES[reader]):
            off += int((np.abs(x[cells[:, 4 + k]] - 0.5 * (corners[:, i] + corners[:, j])).max(axis=1) > 1e-12).sum())
    print(f"volume {volume:.6f} tets {len(cells)} mid-off {off}")


def main(reader, path):
    if reader == "meshio":
        import meshio

        mesh = meshio.read(path)
        cells = np.vstack([b.data for b in mesh.cells if b.type in ("tetra", "tetra10")])
        report(reader, mesh.points, cells)
        groups = np.concatenate([d for b, d in zip(mesh.cells, mesh.cell_data["gmsh:physical"]) if b.type in ("tetra", "tetra10")])
        for tag in np.unique(groups):
            print(f"group {tag} {(groups == tag).sum()}")
        return
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    gmsh.open(path)
    tags, coords, _ = gmsh.model.mesh.getNodes()
    index = {t: i for i, t in enumerate(tags)}
    kinds, _, nodes = gmsh.model.mesh.getElements(3)
    width = {4: 4, 11: 10}[kinds[0]]
    cells = np.array([index[t] for t in nodes[0]]).reshape(-1, width)
    report(reader, coords.reshape(-1, 3), cells)
    for dim, tag in gmsh.model.getPhysicalGroups(0):
        count = 0
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, tag):
            _, _, points = gmsh.model.mesh.getElements(0, entity)
            count += sum(len(p) for p in points)
        print(f"set {gmsh.model.getPhysicalName(dim, tag)} {count}")
    # Gmsh exports only elements in groups.
    gmsh.write(path + ".exported.msh")
    gmsh.open(path + ".exported.msh")
    print(f"exported {sum(len(e) for e in gmsh.model.mesh.getElements(3)[1])}")
    for line in gmsh.logger.get():
        if line.startswith(("Error", "Warning")):
            print(line)
    gmsh.finalize()


main(*sys.argv[1:])
