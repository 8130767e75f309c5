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
# folder: (folders of ours that it may include, libraries that it may include). std and POSIX are free everywhere. A folder includes its
# private parts (PARTS) and they include each other from left to right only.
LAW = {
    "partition": (["runtime/base"], ["fmt", "metis"]),
    "runtime/base": ([], ["rapidjson", "fmt", "openssl"]),
    "runtime/material": (["runtime/base"], ["fmt"]),
    "runtime/bank": (["runtime/base", "runtime/material"], ["fmt", "hdf5", "eigen", "deflate", "stb"]),
    "runtime/events": (["runtime/base"], ["fmt"]),
    "runtime/acoustics": (["runtime/base", "runtime/bank"], ["fmt", "mysofa"]),
    "runtime/exchange": (["runtime/base", "runtime/material", "runtime/bank", "runtime/acoustics"], ["fmt", "cli", "eigen"]),
    "runtime/synth": (["runtime/base", "runtime/bank", "runtime/events", "runtime/acoustics"], ["fmt"]),
    "runtime/physics": (["runtime/base", "runtime/bank", "runtime/events"], ["eigen", "fmt", "simbody"]),
    "runtime/scene": (
        ["runtime/base", "runtime/material", "runtime/bank", "runtime/events", "runtime/acoustics", "runtime/synth", "runtime/physics"],
        ["fmt"],
    ),
    "runtime/render": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/bank",
            "runtime/events",
            "runtime/acoustics",
            "runtime/synth",
            "runtime/physics",
            "runtime/scene",
        ],
        ["fmt", "cli", "sndfile", "eigen", "cairo", "portaudio"],
    ),
    "runtime/bindings": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/bank",
            "runtime/events",
            "runtime/acoustics",
            "runtime/synth",
            "runtime/scene",
            "runtime/render",
        ],
        ["fmt", "pybind11"],
    ),
    "precompute/job": (["runtime/base", "runtime/material"], ["fmt"]),
    "precompute/comm": (["runtime/base"], ["fmt", "mpi"]),
    "precompute/mesh": (["runtime/base", "partition", "precompute/comm"], ["fmt", "xml", "zlib", "mpi", "eigen", "hdf5"]),
    "precompute/mesher": (["runtime/base", "runtime/exchange", "precompute/mesh"], ["fmt", "cli", "eigen", "cgal"]),
    "precompute/petsc": (["runtime/base", "precompute/comm"], ["fmt", "mpi", "petsc"]),
    "precompute/la": (["runtime/base", "precompute/comm", "precompute/petsc"], ["mpi", "petsc", "eigen"]),
    "precompute/fem": (
        ["runtime/base", "runtime/bank", "precompute/job", "precompute/comm", "precompute/mesh", "precompute/petsc", "precompute/la"],
        ["fmt", "mpi", "petsc", "eigen"],
    ),
    "precompute/ldlt": (["runtime/base", "partition", "precompute/comm", "precompute/petsc", "precompute/la"], ["fmt", "mpi", "petsc"]),
    "precompute/eigen": (
        ["runtime/base", "precompute/job", "precompute/comm", "precompute/petsc", "precompute/la", "precompute/ldlt"],
        ["fmt", "mpi", "petsc", "mumps", "eigen"],
    ),
    "precompute/coupling": (
        [
            "runtime/base",
            "runtime/bank",
            "precompute/job",
            "precompute/comm",
            "precompute/mesh",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
            "precompute/eigen",
        ],
        ["fmt", "petsc", "eigen"],
    ),
    "precompute/analytic": (
        ["runtime/base", "runtime/bank", "runtime/material", "precompute/job", "precompute/petsc", "precompute/la", "precompute/eigen"],
        ["fmt", "petsc", "eigen"],
    ),
    "precompute/air": (["runtime/base", "runtime/bank", "precompute/comm", "precompute/la"], ["fmt", "eigen"]),
    "precompute/run": (
        [
            "runtime/base",
            "runtime/bank",
            "runtime/acoustics",
            "partition",
            "precompute/job",
            "precompute/comm",
            "precompute/mesh",
            "precompute/petsc",
            "precompute/la",
            "precompute/fem",
            "precompute/ldlt",
            "precompute/eigen",
            "precompute/coupling",
            "precompute/analytic",
            "precompute/air",
        ],
        ["fmt", "mpi", "petsc", "hdf5", "cli"],
    ),
    "precompute/simulation": (
        [
            "runtime/base",
            "runtime/bank",
            "runtime/acoustics",
            "runtime/render",
            "partition",
            "precompute/job",
            "precompute/comm",
            "precompute/mesh",
            "precompute/run",
        ],
        ["fmt", "cli", "mpi", "hdf5", "eigen"],
    ),
    "jobs/store": (["runtime/base", "runtime/material", "runtime/bank", "precompute/job"], ["fmt", "sqlite"]),
    "jobs/front": (["runtime/base", "runtime/material", "runtime/bank", "runtime/scene", "precompute/job", "jobs/store"], ["fmt", "zlib"]),
    "jobs/queue": (["runtime/base", "runtime/bank", "precompute/job", "jobs/store", "jobs/front"], ["fmt"]),
    "jobs/cli": (
        ["runtime/base", "runtime/material", "runtime/bank", "precompute/job", "jobs/store", "jobs/front", "jobs/queue"],
        ["fmt", "cli"],
    ),
}
# Private parts of folders, in the order in which they may be included; "." is the folder itself.
PARTS = {
    "runtime/bank": ["packed", ".", "mounting"],
    "runtime/acoustics": ["radiation", "head", "recording"],
    "runtime/exchange": ["gltf", "."],
    "runtime/synth": ["nonlinear", "."],
    "runtime/physics": ["geometry", "impact", "joints", "rigid", "."],
    "runtime/scene": ["effects", "."],
    "runtime/render": ["sound", ".", "live", "samples"],
    "runtime/bindings": ["c_api", "python", "web"],
    "precompute/job": [".", "cost"],
    "precompute/mesh": [".", "shapes", "distributed", "parallel", "vtkhdf"],
    "precompute/petsc": ["launch", ".", "profile"],
    "precompute/fem": [".", "error_bars"],
    "precompute/run": ["io", "."],
    "precompute/simulation": ["transient", "emission", "."],
    "jobs/store": ["process", ".", "outcome", "registry"],
    "jobs/front": ["report", "explore", "hear", "cache"],
    "jobs/queue": ["attempt", ".", "slurm"],
}
# Headers of parts that other folders may include, too: the part's whole content or named headers.
PUBLIC = {
    "runtime/bank": ["mounting/"],
    "runtime/acoustics": ["radiation/", "head/", "recording/"],
    "runtime/exchange": ["gltf/"],
    "runtime/physics": ["impact/impact.hpp", "impact/predict.hpp"],
    "runtime/scene": ["effects/effect_selector.hpp", "effects/table.hpp"],
    "runtime/render": ["sound/sound_store.hpp", "sound/spectrogram.hpp"],
    "precompute/job": ["cost/"],
    "precompute/mesh": ["shapes/shapes.hpp", "distributed/", "parallel/read_parallel.hpp"],
    "precompute/fem": ["error_bars/correct.hpp", "error_bars/error_bars.hpp"],
    "precompute/run": ["io/fingerprint.hpp", "io/progress_file.hpp"],
    "jobs/store": ["process/", "outcome/", "registry/registry.hpp", "registry/job_table.hpp"],
    "jobs/front": ["cache/cache.hpp", "explore/explore.hpp", "explore/serve.hpp", "hear/hear.hpp", "report/report.hpp"],
    "jobs/queue": [
        "attempt/attempt.hpp",
        "attempt/publish.hpp",
        "slurm/engine.hpp",
        "slurm/inside.hpp",
        "slurm/needs.hpp",
        "slurm/settings.hpp",
        "slurm/task.hpp",
    ],
}
# The only files that may include these libraries.
ONLY_IN = {
    "hdf5": re.compile(
        r"^((runtime/bank/[a-z0-9_]+|precompute/simulation/emission/surface_file|precompute/run/run_log|precompute/simulation/motion_file|"
        r"precompute/mesh/vtkhdf/main)\.cpp|runtime/bank/hdf5_id\.hpp)$"
    ),
    "cgal": re.compile(r"^precompute/mesher/[a-z0-9_]+\.(cpp|hpp)$"),
    "simbody": re.compile(r"^runtime/physics/joints/"),
    "portaudio": re.compile(r"^runtime/render/live/"),
    "sqlite": re.compile(r"^jobs/store/registry/"),
}
# Parts whose readers and meshers run without MPI.
WITHOUT_MPI = re.compile(r"^precompute/mesh/(shapes/)?[a-z0-9_]+\.[ch]pp$")
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


def split(path):
    """(folder of LAW, part) of a file or header."""
    parent = str(pathlib.PurePosixPath(path).parent)
    folder = max((name for name in LAW if parent == name or parent.startswith(name + "/")), key=len, default=None)
    if folder is None:
        return None, None
    part = parent.removeprefix(folder).strip("/") or "."
    return (folder, part) if part in PARTS.get(folder, ["."]) else (None, None)


def find_breach(path, folder, part, target):
    """What forbids an include of one of our headers, or None."""
    other, other_part = split(target)
    if other is None:
        return f"{target} is in no folder of the include law"
    if other == folder:
        order = PARTS.get(folder, ["."])
        if order.index(other_part) > order.index(part):
            return f"{folder}/{part} may not include {other}/{other_part} ({target})"
        return None
    if other not in LAW[folder][0]:
        return f"{folder} may not include {other} ({target})"
    if other_part != "." and not target.removeprefix(other + "/").startswith(tuple(PUBLIC.get(other, []))):
        return f"{target} is private to {other}"
    if other in ("partition", "precompute/comm") and WITHOUT_MPI.match(path):
        return f"{target} needs MPI or METIS, {path} must not"
    return None


def find_breaches(files):
    """files: (path relative to the root, text) pairs -> list of messages."""
    breaches = []
    for path, text in files:
        folder, part = split(path)
        if folder is None:
            breaches.append(f"{path}: its folder is not in the include law; add it to tests/structure/include_law.py")
            continue
        libraries = LAW[folder][1]
        for number, line in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            bracket, target = match.groups()
            if bracket == '"':
                if breach := find_breach(path, folder, part, target):
                    breaches.append(f"{path}:{number}: {breach}")
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
        ("precompute/mesh/x.cpp", '#include "precompute/fem/assemble.hpp"\n'),
        ("runtime/synth/x.cpp", "#include <precompute/petsc/session.hpp>\n"),
        ("runtime/synth/x.cpp", "#include <omp.h>\n"),
        ("runtime/scene/x.cpp", '#include "runtime/physics/rigid/space.hpp"\n'),
        ("runtime/physics/geometry/x.cpp", '#include "runtime/physics/rigid/space.hpp"\n'),
        ("runtime/physics/geometry/x.cpp", '#include "runtime/physics/world.hpp"\n'),
        ("precompute/mesh/x.cpp", '#include "partition/partition.hpp"\n'),
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
