#!/usr/bin/env python3
"""The runtime's programs load no MPI, PETSc, SLEPc, METIS, MUMPS, parallel HDF5 or GPL mesher.   usage: runtime_links.py BIN_DIR"""
import pathlib
import re
import subprocess
import sys

FORBIDDEN = re.compile(r"lib(mpi|open-rte|petsc|slepc|metis|dmumps|mumps|cholmod|CGAL|gmp|mpfr|openvdb|hdf5_openmpi|vtk|umfpack|spqr|fftw|scotch|gsl|readline)", re.I)
bad = []
for name in ("carillon-bank", "carillon-render"):
    program = pathlib.Path(sys.argv[1]) / name
    loaded = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    found = sorted({line.split()[0] for line in loaded.splitlines() if FORBIDDEN.search(line)})
    print(f"{name}: {len(loaded.splitlines())} libraries" + (f", forbidden: {', '.join(found)}" if found else ", none forbidden"))
    bad += found
sys.exit(1 if bad else 0)
