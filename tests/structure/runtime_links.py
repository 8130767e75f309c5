#!/usr/bin/env python3
"""The runtime's programs, its C library and its Python module load no MPI, PETSc, SLEPc, METIS, MUMPS, parallel HDF5 or GPL mesher, and no
physics engine.

usage: runtime_links.py BIN_DIR

Simbody comes with carillon-joints.so, for scenes with joints only. GMP stands for CGAL here. Debian's serial
HDF5 loads it as well, for its downloads (curl, GnuTLS); from there it is excused.
"""
import pathlib
import re
import subprocess
import sys

FORBIDDEN = re.compile(
    r"lib(mpi|open-rte|petsc|slepc|metis|dmumps|mumps|cholmod|CGAL|gmp|mpfr|openvdb|hdf5_openmpi|vtk|"
    r"umfpack|spqr|fftw|scotch|gsl|readline|SimTK|mujoco|Bullet|LinearMath)",
    re.I,
)


def list_libraries(file):
    """{name: path} of all loaded libraries."""
    lines = subprocess.run(["ldd", file], capture_output=True, text=True, check=True).stdout.splitlines()
    return {words[0]: words[2] if len(words) > 2 else words[0] for words in map(str.split, lines)}


bad = []
folder = pathlib.Path(sys.argv[1])
optional = [*folder.glob("carillon-samples"), *folder.parent.glob("python/carillon/_carillon*.so")]  # where they are built
optional += folder.parent.glob("runtime/bindings/c_api/libcarillon.so")
for name in ("carillon-bank", "carillon-render", "carillon-live", *optional):
    program = folder / name
    loaded = list_libraries(program)
    found = {library for library in loaded if FORBIDDEN.search(library)}
    for library, path in loaded.items():
        if library.startswith("libhdf5_serial."):
            found -= {other for other in list_libraries(path) if other.startswith("libgmp.")}
    print(f"{name}: {len(loaded)} libraries" + (f", forbidden: {', '.join(sorted(found))}" if found else ", none forbidden"))
    bad += found
sys.exit(1 if bad else 0)
