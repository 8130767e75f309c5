#!/usr/bin/env python3
"""Builds and tests the runtime in a mount namespace in which MPI, PETSc, SLEPc, METIS, MUMPS, CGAL and OpenVDB do not exist.

Where the machine allows no mount namespace (an ordinary container), the same build runs with everything in sight, and then no compiled file may have
read, and no program may load, a file of those packages.

usage: runtime_alone.py SOURCE_DIR BUILD_DIR
"""
import os
import pathlib
import re
import subprocess
import sys

HIDDEN = re.compile(r"^(libopenmpi|openmpi|mpi-default|libpetsc|petsc|libslepc|slepc|libmetis|libmumps|libptscotch|libscotch|libscalapack|libhypre|"
                    r"libhdf5-openmpi|libhdf5-mpi|libcgal|libopenvdb|libsuitesparse)")
# An ordinary machine has these of some of the packages above as dependencies of light libraries; hiding them would not be fair.
SHARED = re.compile(r"/lib(blas|lapack|openblas|hwloc|event|gomp)")


def installed():
    out = subprocess.run(["dpkg-query", "-W", "-f=${Package} ${db:Status-Status}\n"], capture_output=True, text=True, check=True).stdout
    return [line.split()[0] for line in out.splitlines() if line.endswith(" installed") and HIDDEN.match(line)]


def hide(packages):
    """Empties, inside this namespace only, every header, library, program and pkg-config file of the packages."""
    files = subprocess.run(["dpkg", "-L", *packages], capture_output=True, text=True, check=True).stdout.splitlines()
    roots = set()
    for name in files:
        path = pathlib.Path(name)
        # Folders that belong to a hidden package as a whole are covered by an empty file system: three levels below /usr are enough.
        if path.is_dir() and re.search(r"/(petscdir|slepcdir|CGAL|openvdb|openmpi|mumps_seq|petsc|slepc|hdf5/openmpi)$", name) and not path.is_symlink():
            roots.add(name)
    roots = {root for root in roots if not any(root.startswith(other + "/") for other in roots)}
    for root in sorted(roots):
        subprocess.run(["mount", "-t", "tmpfs", "none", root], check=True)
    hidden = 0
    for name in files:
        path = pathlib.Path(name)
        if not re.search(r"(/bin/|/include/|/pkgconfig/|/cmake/|\.so|\.a$)", name) or SHARED.search(name) or any(name.startswith(r + "/") for r in roots):
            continue
        real = path.resolve()
        if real.is_file() and str(real) != "/dev/null":
            if subprocess.run(["mount", "--bind", "/dev/null", str(real)], capture_output=True).returncode == 0:
                hidden += 1
    print(f"hidden: {len(roots)} folders and {hidden} files of {len(packages)} packages", flush=True)


def build_and_test(source, build):
    subprocess.run(["cmake", "-S", source, "-B", build, "-G", "Ninja", "-DCARILLON_PRECOMPUTE=OFF", "-DCMAKE_BUILD_TYPE=Release"], check=True,
                   stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", build, "--", "--quiet"], check=True)
    return subprocess.run(["ctest", "--test-dir", build, "-j2", "--output-on-failure", "-LE", "structure|docs"]).returncode


def find_traces(build):
    """Files of hidden packages that a compile read or a program loads."""
    forbidden = re.compile(r"/(openmpi|petscdir|slepcdir|CGAL|openvdb|mumps_seq)/|/(mpi|metis|dmumps_c)\.h$|lib(mpi|petsc|slepc|metis|dmumps|openvdb|CGAL)[_.-]")
    read = subprocess.run(["ninja", "-C", build, "-t", "deps"], capture_output=True, text=True, check=True).stdout.split()
    loaded = []
    for program in (pathlib.Path(build) / "bin").iterdir():
        loaded += subprocess.run(["ldd", program], capture_output=True, text=True).stdout.split()
    return sorted({name for name in read + loaded if forbidden.search(name)})


def main():
    source, build = sys.argv[1:3]
    if os.environ.get("CARILLON_INSIDE") != "1":
        flags = ["-m"] if os.geteuid() == 0 else ["-r", "-m"]
        if subprocess.run(["unshare", *flags, "true"], capture_output=True).returncode == 0:
            return subprocess.run(["unshare", *flags, "--propagation", "private", sys.executable, *sys.argv], env={**os.environ, "CARILLON_INSIDE": "1"}).returncode
        print("no mount namespace can be made here: building in plain sight, and looking at what was read and what is loaded")
        failed = build_and_test(source, build)
        traces = find_traces(build)
        print("\n".join(traces) if traces else "no compiled file read, and no program loads, a file of MPI, PETSc, SLEPc, METIS, MUMPS, CGAL or OpenVDB")
        return 1 if failed or traces else 0
    hide(installed())
    # The tree is hidden for real: the compiler can use no type of these headers.
    for header, name in (("mpi.h", "MPI_Comm"), ("petsc.h", "PetscInt"), ("metis.h", "idx_t")):
        probe = subprocess.run(["g++", "-x", "c++", "-", "-fsyntax-only", "-I/usr/lib/x86_64-linux-gnu/openmpi/include"],
                               input=f"#include <{header}>\nint x = sizeof({name});", text=True, capture_output=True)
        if probe.returncode == 0:
            print(f"{header} can still be used; the namespace proves nothing")
            return 1
    return build_and_test(source, build)


sys.exit(main())
