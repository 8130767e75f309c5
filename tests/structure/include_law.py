#!/usr/bin/env python3
"""The include law: which folder may include what. Arrows go from heavy to light; anything not listed is forbidden.

usage: include_law.py SOURCE_DIR        exit 1 and one line per breach
       include_law.py --self-test       proves that a breach is found
"""
import pathlib
import re
import sys

# Third-party headers, by prefix of the include path, and the name the table below uses for them.
LIBRARIES = {
    "json": ["json/"],
    "rapidjson": ["rapidjson/"],
    "fmt": ["fmt/"],
    "cli": ["CLI/"],
    "hdf5": ["hdf5", "H5"],
    "openssl": ["openssl/"],
    "eigen": ["Eigen/", "unsupported/Eigen/"],
    "sndfile": ["sndfile"],
    "mysofa": ["mysofa.h"],
    "cairo": ["cairo"],
    "portaudio": ["portaudio.h"],
    "metis": ["metis.h"],
    "mpi": ["mpi.h"],
    "petsc": ["petsc", "slepc"],
    "mumps": ["dmumps_c.h"],
    "cholmod": ["cholmod.h", "suitesparse/"],
    "cgal": ["CGAL/", "boost/"],
    "xml": ["pugixml.hpp"],
    "zlib": ["zlib.h"],
    "deflate": ["libdeflate.h"],
    "stb": ["stb_image.h"],
    "simbody": ["SimTKsimbody.h"],
    "sqlite": ["sqlite3.h"],
    "pybind11": ["pybind11/"],
}
# folder: (folders of ours that it may include, libraries that it may include). std and POSIX are free everywhere.
LAW = {
    "runtime/base": ([], ["rapidjson", "fmt", "openssl"]),
    "runtime/codec": (["runtime/base"], ["eigen", "fmt", "deflate", "stb"]),
    "runtime/gltf": (["runtime/base"], ["fmt"]),
    "runtime/material": (["runtime/base"], ["fmt"]),
    "runtime/version": ([], ["fmt"]),
    "runtime/bank": (["runtime/base", "runtime/codec", "runtime/material", "runtime/version"], ["json", "fmt", "hdf5"]),
    "runtime/support": (["runtime/base", "runtime/material", "runtime/bank"], ["fmt"]),
    "runtime/events": (["runtime/base"], ["fmt"]),
    "runtime/radiation": (["runtime/base", "runtime/bank"], []),
    "runtime/head": (["runtime/base"], ["fmt", "mysofa"]),
    "runtime/recording": (["runtime/base"], ["fmt"]),
    "runtime/sound": (["runtime/base"], ["fmt", "eigen", "cairo"]),
    "runtime/nonlinear": (["runtime/base", "runtime/bank"], ["fmt"]),
    "runtime/exchange": (
        ["runtime/base", "runtime/gltf", "runtime/material", "runtime/version", "runtime/bank", "runtime/support", "runtime/radiation"],
        ["fmt", "cli", "eigen"],
    ),
    "runtime/synth": (["runtime/base", "runtime/bank", "runtime/events", "runtime/radiation", "runtime/head", "runtime/nonlinear"], []),
    "runtime/effect_selection": (
        ["runtime/base", "runtime/bank", "runtime/events", "runtime/radiation", "runtime/head", "runtime/synth"],
        ["fmt"],
    ),
    "runtime/abi": (
        ["runtime/base", "runtime/bank", "runtime/support", "runtime/events", "runtime/radiation", "runtime/head", "runtime/synth"],
        [],
    ),
    "runtime/impact": (["runtime/base"], []),
    "runtime/shape": (["runtime/base", "runtime/bank"], []),
    "runtime/joints": (["runtime/base"], ["fmt", "simbody"]),
    "runtime/rigid": (["runtime/base", "runtime/impact", "runtime/joints", "runtime/shape"], ["eigen", "fmt"]),
    "runtime/contact": (
        ["runtime/base", "runtime/bank", "runtime/events", "runtime/impact", "runtime/joints", "runtime/shape", "runtime/rigid"],
        ["fmt"],
    ),
    "runtime/host": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/version",
            "runtime/bank",
            "runtime/support",
            "runtime/events",
            "runtime/impact",
            "runtime/joints",
            "runtime/radiation",
            "runtime/head",
            "runtime/recording",
            "runtime/sound",
            "runtime/synth",
            "runtime/effect_selection",
            "runtime/contact",
        ],
        ["fmt", "cli", "sndfile"],
    ),
    "runtime/live": (
        [
            "runtime/base",
            "runtime/version",
            "runtime/events",
            "runtime/synth",
            "runtime/effect_selection",
            "runtime/contact",
            "runtime/host",
        ],
        ["fmt", "cli", "portaudio"],
    ),
    "runtime/python": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/version",
            "runtime/bank",
            "runtime/support",
            "runtime/events",
            "runtime/radiation",
            "runtime/head",
            "runtime/synth",
            "runtime/effect_selection",
            "runtime/host",
            "runtime/sound",
        ],
        ["fmt", "pybind11"],
    ),
    "runtime/samples": (
        ["runtime/base", "runtime/material", "runtime/version", "runtime/bank", "runtime/events", "runtime/host", "runtime/sound"],
        ["fmt", "cli"],
    ),
    "runtime/web": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/bank",
            "runtime/support",
            "runtime/events",
            "runtime/radiation",
            "runtime/synth",
            "runtime/effect_selection",
            "runtime/host",
        ],
        ["fmt"],
    ),
    "partition": (["runtime/base", "precompute/mesh", "precompute/comm"], ["fmt", "mpi", "metis", "eigen"]),
    "jobs/process": (["runtime/base"], ["fmt"]),
    "jobs/outcome": (["runtime/base", "jobs/process"], ["fmt"]),
    "jobs/store": (["runtime/base", "runtime/bank", "runtime/material", "precompute/job", "jobs/process"], ["fmt", "json"]),
    "jobs/registry": (["runtime/base", "jobs/process", "jobs/outcome", "jobs/store"], ["fmt", "sqlite"]),
    "jobs/attempt": (["runtime/base", "runtime/bank", "jobs/process", "jobs/outcome", "jobs/store", "jobs/report"], ["fmt"]),
    "jobs/queue": (
        ["runtime/base", "precompute/cost", "jobs/process", "jobs/outcome", "jobs/store", "jobs/registry", "jobs/attempt"],
        ["fmt"],
    ),
    "jobs/report": (["runtime/base", "runtime/bank", "runtime/support"], ["fmt", "json"]),
    "jobs/cache": (["runtime/base", "precompute/job", "jobs/process", "jobs/store"], ["fmt"]),
    "jobs/explore": (
        ["runtime/base", "runtime/bank", "runtime/material", "runtime/version", "runtime/host", "jobs/process", "jobs/report"],
        ["fmt", "json", "zlib"],
    ),
    "jobs/hear": (
        [
            "runtime/base",
            "runtime/bank",
            "runtime/material",
            "runtime/support",
            "precompute/job",
            "jobs/explore",
            "jobs/process",
            "jobs/report",
        ],
        ["fmt"],
    ),
    "jobs/slurm": (
        ["runtime/base", "precompute/cost", "jobs/process", "jobs/outcome", "jobs/store", "jobs/registry", "jobs/attempt", "jobs/queue"],
        ["fmt"],
    ),
    "jobs/cli": (
        [
            "runtime/base",
            "runtime/bank",
            "runtime/material",
            "runtime/version",
            "precompute/job",
            "jobs/cache",
            "jobs/explore",
            "jobs/hear",
            "jobs/process",
            "jobs/store",
            "jobs/registry",
            "jobs/attempt",
            "jobs/queue",
            "jobs/slurm",
            "jobs/report",
        ],
        ["fmt", "cli", "json"],
    ),
    "precompute/job": (["runtime/base", "runtime/material"], ["fmt", "json"]),
    "precompute/cost": (["runtime/material", "precompute/job"], []),
    "precompute/mesh": (["runtime/base"], ["fmt", "xml", "zlib"]),
    "precompute/shapes": (["runtime/base", "precompute/mesh"], ["fmt"]),
    "precompute/mesher": (
        ["runtime/base", "runtime/gltf", "runtime/version", "precompute/mesh", "precompute/shapes"],
        ["fmt", "cli", "eigen", "cgal"],
    ),
    "precompute/comm": (["runtime/base"], ["fmt", "mpi"]),
    "precompute/launch": (["runtime/base"], ["fmt"]),
    "precompute/mpi_profile": (["runtime/base", "precompute/petsc"], ["mpi"]),
    "precompute/petsc": (["runtime/base", "precompute/comm", "precompute/launch"], ["fmt", "mpi", "petsc"]),
    "precompute/fem": (
        ["runtime/base", "precompute/job", "partition", "precompute/mesh", "precompute/comm", "precompute/petsc"],
        ["fmt", "mpi", "petsc"],
    ),
    "precompute/estimate": (
        [
            "runtime/base",
            "runtime/bank",
            "precompute/job",
            "partition",
            "precompute/mesh",
            "precompute/comm",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
        ],
        ["fmt", "mpi", "petsc", "eigen"],
    ),
    "precompute/vtkhdf": (["runtime/base"], ["fmt", "hdf5"]),
    "precompute/parallel_mesh": (["runtime/base", "partition", "precompute/mesh", "precompute/comm"], ["fmt"]),
    "precompute/la": (["runtime/base", "precompute/comm", "precompute/petsc"], ["mpi", "petsc", "eigen"]),
    "precompute/ldlt": (["runtime/base", "partition", "precompute/comm", "precompute/petsc", "precompute/la"], ["fmt", "mpi", "petsc"]),
    "precompute/eigen": (
        ["runtime/base", "precompute/cost", "precompute/comm", "precompute/petsc", "precompute/la", "precompute/ldlt"],
        ["fmt", "mpi", "petsc", "mumps", "eigen"],
    ),
    "precompute/analytic": (
        ["runtime/base", "runtime/bank", "runtime/material", "precompute/job", "precompute/petsc", "precompute/la", "precompute/eigen"],
        ["fmt", "petsc", "eigen"],
    ),
    "precompute/condense": (
        [
            "runtime/base",
            "runtime/bank",
            "partition",
            "precompute/mesh",
            "precompute/comm",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
            "precompute/eigen",
        ],
        ["fmt", "petsc", "eigen"],
    ),
    "precompute/emission": (["runtime/base", "runtime/bank", "runtime/recording", "precompute/job", "precompute/comm"], ["fmt", "hdf5"]),
    "precompute/bem": (["runtime/base", "runtime/bank", "precompute/comm", "precompute/la"], ["fmt", "eigen"]),
    "precompute/transient": (
        ["runtime/base", "precompute/job", "partition", "precompute/mesh", "precompute/comm"],
        ["fmt", "mpi", "eigen"],
    ),
    "precompute/io": (
        [
            "runtime/base",
            "runtime/version",
            "runtime/bank",
            "precompute/job",
            "partition",
            "precompute/comm",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
            "precompute/eigen",
        ],
        ["fmt", "json", "mpi", "petsc"],
    ),
    "precompute/run": (
        [
            "runtime/base",
            "runtime/version",
            "runtime/bank",
            "runtime/radiation",
            "precompute/job",
            "partition",
            "precompute/mesh",
            "precompute/shapes",
            "precompute/comm",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
            "precompute/parallel_mesh",
            "precompute/estimate",
            "precompute/ldlt",
            "precompute/eigen",
            "precompute/analytic",
            "precompute/bem",
            "precompute/condense",
            "precompute/cost",
            "precompute/io",
        ],
        ["fmt", "json", "mpi", "petsc", "hdf5"],
    ),
    "precompute/simulate": (
        [
            "runtime/base",
            "runtime/version",
            "runtime/bank",
            "runtime/sound",
            "precompute/job",
            "precompute/mesh",
            "precompute/comm",
            "precompute/io",
            "precompute/run",
            "precompute/transient",
            "precompute/emission",
        ],
        ["fmt", "cli", "mpi", "hdf5"],
    ),
    "precompute": (["runtime/base", "runtime/version", "precompute/petsc", "precompute/run"], ["fmt", "cli", "mpi"]),
}
# Finer than folders: the only files that may include these.
ONLY_IN = {
    "hdf5": re.compile(
        r"^((runtime/bank/[a-z0-9_]+|precompute/emission/surface_file|precompute/run/run_log|precompute/simulate/motion_file|"
        r"precompute/vtkhdf/main)\.cpp|runtime/bank/hdf5_id\.hpp)$"
    ),
    "cgal": re.compile(r"^precompute/mesher/[a-z0-9_]+\.(cpp|hpp)$"),
}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


# The C library and POSIX: free everywhere. A header of C++ itself has neither a folder nor an ending.
SYSTEM = re.compile(
    r"^(sys/[a-z]+|unistd|fcntl|dirent|dlfcn|signal|pthread|poll|netinet/in|termios|errno|limits|"
    r"stddef|stdint|stdlib|stdio|string|math|time|sched|spawn|immintrin|xmmintrin|wasm_simd128|pwd|malloc)\.h$"
)


def library_of(path):
    for name, prefixes in LIBRARIES.items():
        if any(path.startswith(prefix) for prefix in prefixes):
            return name
    return None


def find_breaches(files):
    """files: (path relative to the root, text) pairs -> list of messages."""
    breaches = []
    for path, text in files:
        folder = str(pathlib.PurePosixPath(path).parent)
        if folder not in LAW:
            breaches.append(f"{path}: folder {folder} is not in the include law; add it to tests/structure/include_law.py")
            continue
        ours, libraries = LAW[folder]
        for number, line in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            bracket, target = match.groups()
            if bracket == '"':
                target_folder = str(pathlib.PurePosixPath(target).parent)
                if target_folder != folder and target_folder not in ours:
                    breaches.append(f"{path}:{number}: {folder} may not include {target_folder} ({target})")
                continue
            library = library_of(target)
            if library is None and ("/" in target or "." in target) and not SYSTEM.match(target):
                breaches.append(
                    f"{path}:{number}: <{target}> belongs to no library of the include law; name ours in quotes, add a new one to LIBRARIES"
                )
            elif library and library not in libraries:
                breaches.append(f"{path}:{number}: {folder} may not include {library} ({target})")
            elif library in ONLY_IN and not ONLY_IN[library].match(path):
                breaches.append(f"{path}:{number}: {library} is kept to {ONLY_IN[library].pattern}")
    return breaches


def read_tree(root):
    for top in ("runtime", "precompute", "partition", "jobs"):
        for path in sorted((root / top).rglob("*")):
            if path.suffix in (".cpp", ".hpp", ".h", ".c", ".cc", ".hh", ".inl", ".ipp"):
                yield path.relative_to(root).as_posix(), path.read_text()


def self_test():
    bad = [
        ("runtime/synth/x.cpp", "#include <mpi.h>\n"),
        ("runtime/bank/x.hpp", "#include <hdf5.h>\n"),
        ("runtime/bank/x.cpp", '#include "precompute/mesh/tet_mesh.hpp"\n'),
        ("runtime/new/x.cpp", ""),
        ("precompute/job/x.cpp", "  #  include  <petscmat.h>\n"),
        ("precompute/mesh/x.cpp", '#include "precompute/fem/a.hpp"\n'),
        ("runtime/synth/x.cpp", "#include <precompute/petsc/session.hpp>\n"),
        ("runtime/synth/x.cpp", "#include <omp.h>\n"),
    ]
    for one in bad:
        assert len(find_breaches([one])) == 1, one
    good = [("runtime/bank/x.cpp", '#include <hdf5.h>\n#include <vector>\n#include "runtime/base/error.hpp"\n// #include <mpi.h>\n')]
    assert not find_breaches(good)


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        self_test()
        sys.exit(0)
    found = find_breaches(read_tree(pathlib.Path(sys.argv[1])))
    print("\n".join(found) if found else "the include law holds")
    sys.exit(1 if found else 0)
