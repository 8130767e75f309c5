#!/usr/bin/python3
"""CAE meshes against CalculiX: a bar from a .inp file, free, clamped and of two materials, by ccx and by carillon-precompute, within 0.5
cents and a MAC of 0.999999; the same bank in millimetres and tonnes, from included files, from UNV and from Nastran.

usage: cae.py BIN_DIR
"""
import math
import pathlib
import subprocess
import tempfile

import h5py
import meshio
import numpy
from solver import BIN, run, write_job

STEEL, ALUMINIUM = (210e9, 0.3, 7850.0), (70e9, 0.33, 2700.0)
MODES = 12
CENTS, MAC = 0.5, 0.999999
UNITS = {"m": (1.0, 1.0, 1.0), "mm": (1e3, 1e-6, 1e-12)}  # lengths, moduli, densities


def make_mesh(folder):
    """Nodes of a bar in metres and its ten-node tetrahedra, mid nodes in the order of VTK, which is that of C3D10 and CTETRA."""
    run(folder, "carillon-mesh", *"--shape bar --length 0.2 --width 0.02 --thickness 0.01 --nodes 1900 --order 2 -q -o bar.msh".split())
    mesh = meshio.read(folder / "bar.msh")
    return mesh.points, numpy.vstack([block.data for block in mesh.cells if block.type == "tetra10"])


def find_root(nodes):
    return numpy.flatnonzero(nodes[:, 0] <= nodes[:, 0].min() + 1e-9) + 1


def format_material(name, values, unit):
    young, poisson, density = values
    _, stiffness, mass = UNITS[unit]
    return f"*MATERIAL, NAME={name}\n*Elastic\n{young * stiffness:.12g}, {poisson}\n*DENSITY\n{density * mass:.12g}\n"


def format_deck(nodes, tets, unit="m", supports=False, halves=False, nodes_file=None):
    """A deck of CalculiX. nodes_file: for the nodes, included."""
    points = "*NODE, NSET=Nall\n" + "".join(f"{i}, {x:.12g}, {y:.12g}, {z:.12g}\n" for i, (x, y, z) in enumerate(UNITS[unit][0] * nodes, 1))
    if nodes_file:
        nodes_file.parent.mkdir(exist_ok=True)
        nodes_file.write_text(points)
        points = f"*INCLUDE, INPUT={nodes_file.parent.name}/{nodes_file.name}\n"
    rows = [", ".join(map(str, t[:7] + 1)) + ",\n" + ", ".join(map(str, t[7:] + 1)) for t in tets]
    is_left = nodes[tets[:, :4], 0].mean(axis=1) < nodes[:, 0].mean()
    left, right = (numpy.flatnonzero(side) + 1 for side in (is_left, ~is_left))
    text = f"*HEADING\nbar\n{points}*ELEMENT, TYPE=C3D10, ELSET=Body\n" + "".join(f"{i}, {row}\n" for i, row in enumerate(rows, 1))
    text += "*NSET, NSET=Root\n" + "".join(f"{node},\n" for node in find_root(nodes))
    for name, members in ("Left", left), ("Right", right):
        text += f"*ELSET, ELSET={name}\n" + "".join(f"{member},\n" for member in members)
    text += format_material("Steel", STEEL, unit)
    if halves:
        text += format_material("Aluminium", ALUMINIUM, unit)
        text += "*SOLID SECTION, ELSET=LEFT, MATERIAL=STEEL\n*SOLID SECTION, ELSET=RIGHT, MATERIAL=ALUMINIUM\n"
    else:
        text += "*Solid  Section, elset=BODY, material=STEEL\n"
    if supports:
        text += "*BOUNDARY\nROOT, 1, 3\n"
    return text + f"*STEP\n*FREQUENCY\n{MODES + (0 if supports else 6)}\n*NODE FILE\nU\n*END STEP\n"


def format_nastran(nodes, tets):
    """Nodes in fields of 16 columns, elements in fields of 8, the material between commas."""
    text = "SPC = 7\nBEGIN BULK\n"
    for i, x in enumerate(nodes, 1):
        text += "GRID*   %16d%16s%16.10g%16.10g\n*       %16.10g\n" % (i, "", *x)
    for i, tet in enumerate(tets + 1, 1):
        text += "CTETRA  %8d%8d" % (i, 4) + "".join("%8d" % n for n in tet[:6]) + "+\n+       " + "".join("%8d" % n for n in tet[6:]) + "\n"
    text += "PSOLID,4,2\n" + "MAT1,2,%g,,%g,%g\n" % STEEL
    text += "".join(f"SPC1,7,123456,{n}\n" for n in find_root(nodes))
    return text + "ENDDATA\n"


def format_unv(nodes, tets):
    text = (
        "    -1\n   164\n         1SI                          2\n"
        + "%25.17E" * 3 % (1, 1, 1)
        + "\n"
        + "%25.17E\n" % 273.15
        + "    -1\n    -1\n  2411\n"
    )
    for i, x in enumerate(nodes, 1):
        text += "%10d%10d%10d%10d\n" % (i, 1, 1, 11) + ("%25.16E" * 3 % tuple(x)).replace("E", "D") + "\n"
    text += "    -1\n    -1\n  2412\n"
    for i, t in enumerate(tets + 1, 1):
        round_base = (t[0], t[4], t[1], t[5], t[2], t[6], t[7], t[8], t[9], t[3])
        text += ("%10d" * 6 + "\n" + "%10d" * 8 + "\n" + "%10d" * 2 + "\n") % (i, 118, 1, 1, 7, 10, *round_base)
    root = find_root(nodes)
    text += "    -1\n    -1\n  2467\n" + "%10d" * 8 % (1, 0, 0, 0, 0, 0, 0, len(root)) + "\nRoot\n"
    for pair in numpy.array_split(root, math.ceil(len(root) / 2)):
        text += "".join("%10d%10d%10d%10d" % (7, n, 0, 0) for n in pair) + "\n"
    return text + "    -1\n"


def read_frd(path):
    """Nodes by number; of each mode that is not rigid the frequency [Hz] and the displacement of the nodes."""
    points, modes, block = {}, [], None
    for line in path.read_text().splitlines():
        if line.startswith("    2C"):
            block = points
        elif line.startswith("    1PGK"):
            modes.append((math.sqrt(max(float(line.split()[1]), 0)) / (2 * math.pi), {}))
        elif line.startswith(" -4"):
            block = modes[-1][1] if line.split()[1] == "DISP" else None
        elif line.startswith(" -3"):
            block = None
        elif line.startswith(" -1") and block is not None:
            block[int(line[3:13])] = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(3)]
    return points, [mode for mode in modes if mode[0] > 1]


def solve_ccx(folder, name, deck):
    (folder / f"{name}.inp").write_text(deck)
    environment = {"PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(["ccx", name], cwd=folder, capture_output=True, text=True, timeout=200, env=environment)
    assert done.returncode == 0 and "*ERROR" not in done.stdout, done.stdout[-2000:]
    return read_frd(folder / f"{name}.frd")


def solve(folder, name, mesh, **job):
    """Vertices [m], frequencies of the mesh [Hz], shapes (vertices, modes, 3)."""
    write_job(folder, name, **{"mesh": mesh, "band_hz": [20, 1e5], "max_modes": MODES, "shapes": "exact", "material": "file"} | job)
    run(folder, "carillon-precompute", "-q", f"{name}.json")
    with h5py.File(folder / f"{name}.hdf") as bank:
        modes = bank["modes"]
        return bank["mesh/vertices"][:], modes["frequency_hz"][:], modes["shape"][:] * modes["shape_scale"][:][None, :, None]


def compare(name, ours, theirs):
    """Against ccx, in metres."""
    vertices, hz, shapes = ours
    points, modes = theirs
    cents = 1200 * numpy.abs(numpy.log2(hz / [mode[0] for mode in modes[:MODES]]))
    assert len(hz) == MODES and cents.max() < CENTS, f"{name}: {cents} cents"
    numbers = list(points)
    places = numpy.array([points[n] for n in numbers])
    at = [int(numpy.abs(places - v).max(axis=1).argmin()) for v in vertices]
    assert numpy.abs(places[at] - vertices).max() < 1e-6
    worst = 1.0
    for k, (_, shape) in enumerate(modes[:MODES]):
        a, b = shapes[:, k].ravel(), numpy.array([shape[numbers[i]] for i in at]).ravel()
        worst = min(worst, (a @ b) ** 2 / ((a @ a) * (b @ b)))
    assert worst > MAC, f"{name}: MAC {worst}"
    print(f"{name}: {cents.max():.3f} cents, 1 - MAC {1 - worst:.1e}")


def expect_same(name, ours, wanted, bound=1e-7):
    hz = abs(ours[1] / wanted[1] - 1).max()
    shapes = min(
        ((ours[2][:, k].ravel() @ wanted[2][:, k].ravel()) / (wanted[2][:, k].ravel() @ wanted[2][:, k].ravel())) ** 2 for k in range(MODES)
    )
    assert hz < bound and abs(shapes - 1) < max(1e-4, 10 * bound), f"{name}: frequencies differ by {hz}, shapes by {shapes - 1}"


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        nodes, tets = make_mesh(folder)
        free = solve_ccx(folder, "free", format_deck(nodes, tets))
        clamped = solve_ccx(folder, "clamped", format_deck(nodes, tets, supports=True))
        halves = solve_ccx(folder, "halves", format_deck(nodes, tets, halves=True))
        of_free = solve(folder, "of_free", "free.inp")
        of_clamped = solve(folder, "of_clamped", "clamped.inp", fixed="*BOUNDARY")
        of_halves = solve(folder, "of_halves", "halves.inp")
        compare("free", of_free, free)
        compare("clamped", of_clamped, clamped)
        compare("two materials", of_halves, halves)
        # Node sets and element sets by name.
        expect_same("by set", solve(folder, "by_set", "free.inp", fixed="Root"), of_clamped)
        (young, poisson, density), loss = ALUMINIUM, {"internal_friction": {"tan_phi": 1e-3}}
        right = {"young_modulus_pa": young, "poisson_ratio": poisson, "density_kg_m3": density, "damping": loss}
        expect_same("by region", solve(folder, "by_region", "halves.inp", materials={"Right": right}), of_halves)
        # One bank from millimetres, from included files, and with the unit of the job.
        (folder / "mm.inp").write_text(format_deck(nodes, tets, "mm", supports=True))
        expect_same("mm", solve(folder, "of_mm", "mm.inp", fixed="*BOUNDARY"), of_clamped)
        expect_same("mesh_scale", solve(folder, "of_scale", "mm.inp", fixed="*BOUNDARY", mesh_scale=0.001), of_clamped)
        (folder / "joined.inp").write_text(format_deck(nodes, tets, supports=True, nodes_file=folder / "parts" / "nodes.inc"))
        expect_same("included", solve(folder, "of_joined", "joined.inp", fixed="*BOUNDARY"), of_clamped)
        # The same body in other formats, of ours and of Gmsh.
        (folder / "bar.bdf").write_text(format_nastran(nodes, tets))
        expect_same("Nastran", solve(folder, "of_bdf", "bar.bdf", fixed="SPC"), of_clamped)
        steel = {"young_modulus_pa": STEEL[0], "poisson_ratio": STEEL[1], "density_kg_m3": STEEL[2], "damping": loss}
        (folder / "bar.unv").write_text(format_unv(nodes, tets))
        expect_same("UNV", solve(folder, "of_unv", "bar.unv", fixed="Root", material=steel), of_clamped)
        for ending in "inp", "unv", "bdf":
            command = ["gmsh", "bar.msh", "-save", "-format", ending, "-o", f"gmsh.{ending}"]
            subprocess.run(command, cwd=folder, capture_output=True, check=True, timeout=60)
            # Gmsh writes Nastran's coordinates with six digits.
            expect_same(f"Gmsh's {ending}", solve(folder, f"of_gmsh_{ending}", f"gmsh.{ending}", material=steel), of_free, 1e-4)
        if (BIN / "carillon").exists():
            said = run(folder, "carillon", "hear", "mm.inp", "-o", "sound").stdout
            assert "Steel" in said and "*BOUNDARY" in said and "mm, t, s" in said, said


if __name__ == "__main__":
    main()
