#!/usr/bin/python3
"""A mesh in the parallel format gives the same bank as .vtu: on 1, 2 and 3 ranks, fixed nodes and regions included.

usage: parallel_format.py BIN_DIR
"""
import sys

import h5py
import meshio
import numpy

from runs import Folder, check, make_box, write_vtkhdf


def read_bank(path):
    """The arrays of a bank by HDF5 itself; the header is a user block."""
    arrays = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: arrays.__setitem__(name, item[()]) if isinstance(item, h5py.Dataset) else None)
    return arrays


folder = Folder(sys.argv[1])
with folder.scratch:
    nodes, tets = make_box((10, 4, 3), (0.1, 0.033, 0.021))
    random = numpy.random.default_rng(2)
    nodes += random.uniform(-4e-4, 4e-4, nodes.shape) * ((nodes > 0) & (nodes < nodes.max(axis=0)))  # no two frequencies alike
    side = (nodes[:, 0] == 0).astype("i4")
    random.shuffle(tets)  # the elements in no order at all
    write_vtkhdf(folder / "mesh.vtkhdf", nodes, tets, {"side": side})
    meshio.Mesh(nodes, [("tetra", tets)], point_data={"side": side}).write(folder / "mesh.vtu")
    for element in ("T4", "T10"):
        for more in ({}, {"fixed": "side:1"}):
            folder.write_job("mesh.vtu", bank="serial.bank", element=element, max_modes=10, band_hz=[20, 60000], **more)
            text, code = folder.run(2)
            check(code == 0, text)
            serial = read_bank(folder / "serial.bank")
            for ranks in (1, 2, 3):
                folder.write_job("mesh.vtkhdf", bank="parallel.bank", element=element, max_modes=10, band_hz=[20, 60000], **more)
                text, code = folder.run(ranks)
                check(code == 0, text)
                check("by all ranks" in text, f"the mesh was not read in parallel:\n{text}")
                parallel = read_bank(folder / "parallel.bank")
                check(
                    numpy.array_equal(parallel["mesh/vertices"], serial["mesh/vertices"]),
                    f"{element} {more}: vertices differ on {ranks} ranks",
                )
                check(
                    numpy.array_equal(parallel["mesh/triangles"], serial["mesh/triangles"]),
                    f"{element} {more}: triangles differ on {ranks} ranks",
                )
                a, b = parallel["modes/eigenvalue"], serial["modes/eigenvalue"]
                check(len(a) == len(b) == 10, f"{len(a)} and {len(b)} modes")
                worst = abs(numpy.sqrt(a / b) - 1).max()
                check(worst < 1e-9, f"{element} {more}: frequencies differ by {worst} on {ranks} ranks")
                print(f"{element} {more} {ranks} ranks: frequencies agree to {worst:.1e}")
