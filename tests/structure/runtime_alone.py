#!/usr/bin/env python3
"""Builds and tests the runtime in a mount namespace in which MPI, PETSc, SLEPc, METIS, MUMPS, CGAL and OpenVDB do not exist.

The runtime is configured there again, at the path of the full build, whose outputs it reuses: ninja rebuilds those with another command or
other inputs. Reused outputs must not have read, and programs must not load, files of those packages. Each program then runs some of its
tests; all tests run on the same bytes in the full build.

With --from-nothing, or if the full build does not use ninja, everything is compiled and all tests of the runtime run there; likewise
without permission for mount namespaces (an ordinary container), with the packages visible and the same checks of read and loaded files.

usage: runtime_alone.py SOURCE_DIR BUILD_DIR WORK_DIR [--from-nothing]        WORK_DIR is removed at the end
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
import ctest
import namespaces

HIDDEN = re.compile(
    r"^(libopenmpi|openmpi|mpi-default|libpetsc|petsc|libslepc|slepc|libmetis|libmumps|libptscotch|libscotch|libscalapack|libhypre|"
    r"libhdf5-openmpi|libhdf5-mpi|libcgal|libopenvdb|libsuitesparse)"
)
# Also dependencies of light libraries: stay visible.
SHARED = re.compile(r"/lib(blas|lapack|openblas|hwloc|event|gomp)")
LEFT_OUT = "structure|docs|bench"


def installed():
    out = subprocess.run(["dpkg-query", "-W", "-f=${Package} ${db:Status-Status}\n"], capture_output=True, text=True, check=True).stdout
    return [line.split()[0] for line in out.splitlines() if line.endswith(" installed") and HIDDEN.match(line)]


def hide(packages):
    """Empties, in this namespace, all headers, libraries, programs and pkg-config files of the packages."""
    files = subprocess.run(["dpkg", "-L", *packages], capture_output=True, text=True, check=True).stdout.splitlines()
    roots = set()
    for name in files:
        path = pathlib.Path(name)
        # Folders owned by a hidden package are covered by an empty file system.
        if (
            path.is_dir()
            and re.search(r"/(petscdir|slepcdir|CGAL|openvdb|openmpi|mumps_seq|petsc|slepc|hdf5/openmpi)$", name)
            and not path.is_symlink()
        ):
            roots.add(name)
    roots = {root for root in roots if not any(root.startswith(other + "/") for other in roots)}
    for root in sorted(roots):
        subprocess.run(["mount", "-t", "tmpfs", "none", root], check=True)
    hidden = 0
    for name in files:
        path = pathlib.Path(name)
        if (
            not re.search(r"(/bin/|/include/|/pkgconfig/|/cmake/|\.so|\.a$)", name)
            or SHARED.search(name)
            or any(name.startswith(r + "/") for r in roots)
        ):
            continue
        real = path.resolve()
        if real.is_file() and str(real) != "/dev/null":
            if subprocess.run(["mount", "--bind", "/dev/null", str(real)], capture_output=True).returncode == 0:
                hidden += 1
    print(f"hidden: {len(roots)} folders and {hidden} files of {len(packages)} packages", flush=True)


def read_settings(build):
    """Settings of the full build that affect compilation."""
    kept = r"CMAKE_(BUILD_TYPE|COMPILE_WARNING_AS_ERROR|(C|CXX)_(COMPILER|FLAGS|COMPILER_LAUNCHER)):[A-Z]+=.*"
    return [f"-D{line}" for line in (build / "CMakeCache.txt").read_text().splitlines() if re.fullmatch(kept, line)]


def configure(source, build, settings):
    subprocess.run(
        ["cmake", "-S", source, "-B", build, "-G", "Ninja", "-DCARILLON_PRECOMPUTE=OFF", "-DCARILLON_TESTS=ON", *settings],
        check=True,
        stdout=subprocess.DEVNULL,
    )


def take_over(whole, build):
    """Copies outputs present in the full build, with time stamps and ninja's log. Returns the copies.

    Identical files written by CMake, such as unity sources, get the same time stamp.
    """
    for path in build.rglob("*"):
        equal = whole / path.relative_to(build)
        if path.is_file() and equal.is_file() and equal.read_bytes() == path.read_bytes():
            shutil.copystat(equal, path)
    lines = subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], capture_output=True, text=True, check=True).stdout.splitlines()
    outputs = [name for name, _, rule in (line.rpartition(": ") for line in lines) if rule not in ("phony", "RERUN_CMAKE")]
    taken = [name for name in outputs if not name.startswith("/") and (whole / name).is_file()]
    for name in [*taken, ".ninja_log", ".ninja_deps"]:
        (build / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(whole / name, build / name, follow_symlinks=False)
    # Dependency files of custom commands, such as WebAssembly, are not listed as outputs.
    if (whole / "CMakeFiles/d").is_dir():
        shutil.copytree(whole / "CMakeFiles/d", build / "CMakeFiles/d", dirs_exist_ok=True)
    return taken


def find_sample(build):
    """A regular expression of sample tests: one of each suite if each case is a test, and all scripts but those that need a browser."""
    sample = {}
    for test in ctest.list_tests(build, "-LE", LEFT_OUT + "|web"):
        program = test["command"][0]
        is_case = any(word.startswith("--gtest_filter") for word in test["command"])
        sample.setdefault((program, test["name"].rsplit(".", 1)[0]) if is_case else test["name"], test["name"])
    return "^(" + "|".join(map(re.escape, sample.values())) + ")$", len(sample)


def run_tests(build, *choice, every=1):
    """every: runs one in so many cases of GoogleTest programs that are a single test."""
    return subprocess.run(
        ["ctest", "--test-dir", build, "-j2", "--output-on-failure", "--no-tests=error", "-LE", LEFT_OUT, *choice],
        env={**os.environ, "GTEST_TOTAL_SHARDS": str(every), "GTEST_SHARD_INDEX": "0"},
    ).returncode


def find_traces(build):
    """Files of hidden packages read by the compiler or loaded by a program."""
    forbidden = re.compile(
        r"/(openmpi|petscdir|slepcdir|CGAL|openvdb|mumps_seq)/|/(mpi|metis|dmumps_c)\.h$|"
        r"lib(mpi|petsc|slepc|metis|dmumps|openvdb|CGAL)[_.-]"
    )
    read = subprocess.run(["ninja", "-C", build, "-t", "deps"], capture_output=True, text=True, check=True).stdout.split()
    assert len(read) > 1000, "ninja does not report what was read"
    loaded = []
    for program in (build / "bin").iterdir():
        loaded += subprocess.run(["ldd", program], capture_output=True, text=True).stdout.split()
    return sorted({name for name in read + loaded if forbidden.search(name)})


def build_and_test(source, build, whole=None):
    """In `build`; `whole`: full build to reuse."""
    configure(source, build, read_settings(whole) if whole else ["-DCMAKE_BUILD_TYPE=Release"])
    taken = take_over(whole, build) if whole else []
    subprocess.run(["cmake", "--build", build, "--", "--quiet"], check=True)
    if whole:
        same = sum((build / name).stat().st_mtime_ns == (whole / name).stat().st_mtime_ns for name in taken)
        print(f"{same} files of the whole build serve as they are, {len(taken) - same} were made again", flush=True)
    traces = find_traces(build)
    print(
        (
            "\n".join(traces)
            if traces
            else "no compiled file read, and no program loads, a file of MPI, PETSc, SLEPc, METIS, MUMPS, CGAL or OpenVDB"
        ),
        flush=True,
    )
    if traces or not whole:
        return run_tests(build) or len(traces) > 0
    pattern, count = find_sample(build)
    print(f"{count} tests, one of each suite or in twenty cases", flush=True)
    return run_tests(build, "-R", pattern, every=20)


def test_hidden(source, build, work, whole):
    """Inside the namespace. `whole`: mount point of the full build, while the runtime's own is at its path; None: from nothing."""
    hide(installed())
    # The headers must be unusable.
    for header, name in (("mpi.h", "MPI_Comm"), ("petsc.h", "PetscInt"), ("metis.h", "idx_t")):
        probe = subprocess.run(
            ["g++", "-x", "c++", "-", "-fsyntax-only", "-I/usr/lib/x86_64-linux-gnu/openmpi/include"],
            input=f"#include <{header}>\nint x = sizeof({name});",
            text=True,
            capture_output=True,
        )
        if probe.returncode == 0:
            print(f"{header} can still be used; the namespace proves nothing")
            return 1
    if not whole:
        return build_and_test(source, work)
    subprocess.run(["mount", "--bind", build, whole], check=True)
    subprocess.run(["mount", "--bind", work, build], check=True)
    os.chdir(build)
    return build_and_test(source, build, whole)


def main():
    source, build, work = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
    from_nothing = sys.argv[4:] == ["--from-nothing"] or not (build / "build.ninja").exists()
    if os.environ.get("CARILLON_INSIDE"):
        return test_hidden(source, build, work, None if from_nothing else pathlib.Path(os.environ["CARILLON_INSIDE"]))
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    namespace = namespaces.find_mount_namespace()
    try:
        if not namespace:
            print("no mount namespace can be made here: building in plain sight, and looking at what was read and what is loaded")
            return build_and_test(source, work)
        with tempfile.TemporaryDirectory(prefix="carillon-whole-") as whole:
            return subprocess.run([*namespace, sys.executable, *sys.argv], env={**os.environ, "CARILLON_INSIDE": whole}).returncode
    finally:
        shutil.rmtree(work, ignore_errors=True)


sys.exit(main())
