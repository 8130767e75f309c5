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
    "hwy": ["hwy/"],
    "cli": ["CLI/"],
    "hdf5": ["hdf5", "H5"],
    "openssl": ["openssl/"],
    "eigen": ["Eigen/", "unsupported/Eigen/"],
    "sndfile": ["sndfile"],
    "mysofa": ["mysofa.h"],
    "cairo": ["cairo"],
    "portaudio": ["portaudio.h"],
    "bullet": ["btBulletDynamicsCommon.h", "BulletDynamics/"],
    "mujoco": ["mujoco/"],
    "carillon": ["carillon.h"],
    "metis": ["metis.h"],
    "mpi": ["mpi.h"],
    "petsc": ["petsc", "slepc"],
    "mumps": ["dmumps_c.h"],
    "cgal": ["CGAL/", "boost/"],
    "xml": ["pugixml.hpp"],
    "zlib": ["zlib.h"],
    "deflate": ["libdeflate.h"],
    "stb": ["stb_image.h"],
    "simbody": ["SimTKsimbody.h"],
    "sqlite": ["sqlite3.h"],
    "pybind11": ["pybind11/"],
}
# Folder or part of a folder: (folders of ours that it may include, libraries that it may include). std and POSIX are free everywhere.
# Parts of a folder stand in the order in which they may include each other: downwards is forbidden.
RULES = {
    "partition": (["runtime/base"], ["fmt", "metis"]),
    "runtime/base": ([], ["fmt", "hwy", "openssl", "rapidjson"]),
    "runtime/material": (["runtime/base"], ["fmt"]),
    "runtime/bank/packed": (["runtime/base"], ["deflate", "eigen", "fmt", "stb"]),
    "runtime/bank": (["runtime/base", "runtime/material"], ["eigen", "fmt", "hdf5"]),
    "runtime/bank/mounting": (["runtime/base", "runtime/material"], ["fmt"]),
    "runtime/events": (["runtime/base"], ["fmt"]),
    "runtime/acoustics/radiation": (["runtime/base", "runtime/bank"], []),
    "runtime/acoustics/head": (["runtime/base"], ["fmt", "mysofa"]),
    "runtime/acoustics/recording": (["runtime/base"], ["fmt"]),
    "runtime/exchange/gltf": (["runtime/base"], ["fmt"]),
    "runtime/exchange": (["runtime/base", "runtime/material", "runtime/bank", "runtime/acoustics"], ["cli", "eigen", "fmt", "hdf5"]),
    "runtime/synth/nonlinear": (["runtime/base", "runtime/bank"], ["fmt"]),
    "runtime/synth": (["runtime/base", "runtime/bank", "runtime/events", "runtime/acoustics"], []),
    "runtime/physics/geometry": (["runtime/base", "runtime/bank"], []),
    "runtime/physics/impact": (["runtime/base"], []),
    "runtime/physics/joints": (["runtime/base"], ["fmt", "simbody"]),
    "runtime/physics/rigid": (["runtime/base"], ["eigen", "fmt"]),
    # Only the parts of physics below it: shapes and impacts.
    "runtime/drive": (["runtime/base", "runtime/bank", "runtime/events", "runtime/physics"], []),
    "runtime/physics": (["runtime/base", "runtime/bank", "runtime/events", "runtime/drive"], ["fmt"]),
    "runtime/scene/effects": (["runtime/base", "runtime/bank", "runtime/events", "runtime/acoustics", "runtime/synth"], ["fmt"]),
    "runtime/scene": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/bank",
            "runtime/events",
            "runtime/acoustics",
            "runtime/synth",
            "runtime/drive",
            "runtime/physics",
        ],
        ["fmt"],
    ),
    "runtime/render/sound": (["runtime/base"], ["cairo", "eigen", "fmt"]),
    "runtime/render": (
        [
            "runtime/base",
            "runtime/bank",
            "runtime/events",
            "runtime/acoustics",
            "runtime/exchange",
            "runtime/synth",
            "runtime/physics",
            "runtime/scene",
        ],
        ["cli", "deflate", "fmt", "sndfile"],
    ),
    "runtime/render/live": (["runtime/base", "runtime/synth", "runtime/physics", "runtime/scene"], ["cli", "fmt", "portaudio"]),
    "runtime/render/samples": (["runtime/base", "runtime/material", "runtime/bank", "runtime/scene"], ["cli", "fmt"]),
    "runtime/bindings/c_api": (
        ["runtime/base", "runtime/bank", "runtime/events", "runtime/acoustics", "runtime/synth", "runtime/drive"],
        [],
    ),
    "runtime/bindings/engines/carillon": ([], ["bullet", "carillon", "mujoco", "simbody"]),
    "runtime/bindings/python": (
        [
            "runtime/base",
            "runtime/material",
            "runtime/bank",
            "runtime/events",
            "runtime/acoustics",
            "runtime/synth",
            "runtime/drive",
            "runtime/physics",
            "runtime/scene",
            "runtime/render",
        ],
        ["fmt", "pybind11"],
    ),
    "runtime/bindings/web": (
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
        ["fmt"],
    ),
    "precompute/job": (["runtime/base", "runtime/material"], ["fmt"]),
    "precompute/job/cost": (["runtime/material"], []),
    "precompute/comm": (["runtime/base"], ["fmt", "mpi"]),
    "precompute/mesh": (["runtime/base"], ["fmt", "xml", "zlib"]),
    "precompute/mesh/shapes": (["runtime/base"], ["fmt"]),
    "precompute/mesh/distributed": (["partition", "runtime/base", "precompute/comm"], ["eigen", "fmt"]),
    "precompute/mesh/parallel": (["runtime/base", "precompute/comm"], ["fmt"]),
    "precompute/mesh/vtkhdf": (["runtime/base"], ["fmt", "hdf5"]),
    "precompute/mesher": (["runtime/base", "runtime/exchange", "precompute/mesh"], ["cgal", "cli", "eigen", "fmt"]),
    "precompute/petsc/launch": (["runtime/base"], ["fmt"]),
    "precompute/petsc": (["runtime/base", "precompute/comm"], ["fmt", "mpi", "petsc"]),
    "precompute/petsc/profile": (["runtime/base"], ["mpi"]),
    "precompute/la": (["runtime/base", "precompute/comm", "precompute/petsc"], ["eigen", "mpi", "petsc"]),
    "precompute/fem": (
        ["runtime/base", "runtime/material", "precompute/job", "precompute/comm", "precompute/mesh", "precompute/petsc"],
        ["fmt", "mpi", "petsc"],
    ),
    "precompute/fem/error_bars": (
        ["runtime/base", "runtime/bank", "precompute/job", "precompute/comm", "precompute/mesh", "precompute/petsc", "precompute/la"],
        ["eigen", "fmt", "mpi", "petsc"],
    ),
    "precompute/ldlt": (["runtime/base", "partition", "precompute/comm", "precompute/petsc", "precompute/la"], ["fmt", "mpi", "petsc"]),
    "precompute/eigen": (
        ["runtime/base", "precompute/job", "precompute/comm", "precompute/petsc", "precompute/la", "precompute/ldlt"],
        ["eigen", "fmt", "mpi", "mumps", "petsc"],
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
        ["eigen", "fmt", "petsc"],
    ),
    "precompute/analytic": (
        ["runtime/base", "runtime/bank", "runtime/material", "precompute/job", "precompute/petsc", "precompute/la", "precompute/eigen"],
        ["eigen", "fmt", "petsc"],
    ),
    "precompute/air": (["runtime/base", "runtime/bank", "precompute/comm", "precompute/la"], ["eigen", "fmt"]),
    "precompute/run/io": (
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
        ["fmt", "mpi", "petsc"],
    ),
    "precompute/run": (
        [
            "partition",
            "runtime/base",
            "runtime/bank",
            "runtime/acoustics",
            "precompute/job",
            "precompute/comm",
            "precompute/mesh",
            "precompute/petsc",
            "precompute/fem",
            "precompute/ldlt",
            "precompute/eigen",
            "precompute/coupling",
            "precompute/analytic",
            "precompute/air",
        ],
        ["cli", "fmt", "hdf5", "mpi"],
    ),
    "precompute/simulation/transient": (
        ["partition", "runtime/base", "precompute/job", "precompute/comm", "precompute/mesh"],
        ["eigen", "fmt"],
    ),
    "precompute/simulation/emission": (
        ["runtime/base", "runtime/bank", "runtime/acoustics", "precompute/job", "precompute/comm"],
        ["fmt", "hdf5"],
    ),
    "precompute/simulation": (
        ["runtime/base", "runtime/bank", "runtime/render", "precompute/job", "precompute/comm", "precompute/mesh", "precompute/run"],
        ["cli", "fmt", "hdf5", "mpi"],
    ),
    "jobs/store/process": (["runtime/base"], ["fmt"]),
    "jobs/store": (["runtime/base", "runtime/material", "runtime/bank", "precompute/job"], ["fmt"]),
    "jobs/store/outcome": (["runtime/base"], ["fmt"]),
    "jobs/store/registry": (["runtime/base"], ["fmt", "sqlite"]),
    "jobs/front/report": (["runtime/base", "runtime/bank"], ["fmt"]),
    "jobs/front/explore": (["runtime/base", "runtime/material", "runtime/bank", "runtime/scene", "jobs/store"], ["fmt", "zlib"]),
    "jobs/front/hear": (["runtime/base", "runtime/material", "runtime/bank", "precompute/job", "jobs/store"], ["fmt"]),
    "jobs/front/cache": (["runtime/base", "precompute/job", "jobs/store"], ["fmt"]),
    "jobs/queue/attempt": (["runtime/base", "runtime/bank", "jobs/store", "jobs/front"], ["cli", "fmt"]),
    "jobs/queue/worker": (["runtime/base", "runtime/material", "precompute/petsc", "precompute/run"], ["cli", "fmt"]),
    "jobs/queue": (["runtime/base", "precompute/job", "jobs/store"], ["fmt"]),
    "jobs/queue/slurm": (["runtime/base", "precompute/job", "jobs/store"], ["fmt"]),
    "jobs/cli": (
        ["runtime/base", "runtime/material", "runtime/bank", "precompute/job", "jobs/store", "jobs/front", "jobs/queue"],
        ["cli", "fmt"],
    ),
}


def find_folder(path):
    """The folder of a part: runtime/physics of runtime/physics/rigid."""
    return "/".join(path.split("/")[:2])


def merge_parts():
    """LAW: {folder: (folders, libraries)} of all its parts together; PARTS: {folder: names of its parts in order, "." for itself}."""
    law, parts = {}, {}
    for path, (ours, libraries) in RULES.items():
        folder = find_folder(path)
        known = law.setdefault(folder, ([], []))
        known[0].extend(name for name in ours if name not in known[0])
        known[1].extend(name for name in libraries if name not in known[1])
        parts.setdefault(folder, []).append(path.removeprefix(folder).strip("/") or ".")
    for ours, _ in law.values():
        ours.sort(key=list(law).index)
    return law, parts


LAW, PARTS = merge_parts()
# Headers of parts that other folders may include, too: the part's whole content or named headers.
PUBLIC = {
    "runtime/bank": ["mounting/"],
    "runtime/acoustics": ["radiation/", "head/", "recording/"],
    "runtime/exchange": ["gltf/"],
    "runtime/physics": ["geometry/shape.hpp", "impact/", "joints/mechanism.hpp", "rigid/limits.hpp"],
    "runtime/scene": ["effects/effect_selector.hpp", "effects/table.hpp"],
    "runtime/render": ["sound/sound_store.hpp", "sound/spectrogram.hpp", "sound/wav_header.hpp"],
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
        "slurm/task.hpp",
    ],
}
# The only files that may include these libraries.
ONLY_IN = {
    "hdf5": re.compile(
        r"^((runtime/bank/[a-z0-9_]+|precompute/simulation/emission/surface_file|precompute/run/run_log|precompute/simulation/motion_file|"
        r"precompute/mesh/vtkhdf/main|runtime/exchange/to_sofa)\.cpp|runtime/bank/hdf5_id\.hpp)$"
    ),
    "cgal": re.compile(r"^precompute/mesher/[a-z0-9_]+\.(cpp|hpp)$"),
}
# Headers of components (docs/components.md) that others may include, too: the core is built without the rest of the component.
FACES = {
    "runtime/synth/nonlinear/mode_constants.hpp",
    "runtime/acoustics/head/head.hpp",
    "runtime/acoustics/head/sofa.hpp",
    "runtime/acoustics/head/sphere.hpp",
    "jobs/front/explore/explore.hpp",
    "jobs/front/explore/names.hpp",
    "jobs/front/explore/serve.hpp",
    "jobs/queue/slurm/inside.hpp",
    "jobs/queue/slurm/task.hpp",
}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


# The C library and POSIX: free everywhere. A header of C++ itself has neither a folder nor an ending.
SYSTEM = re.compile(
    r"^(sys/[a-z]+|unistd|fcntl|dirent|dlfcn|signal|pthread|poll|netinet/in|arpa/inet|termios|errno|limits|"
    r"stddef|stdint|stdlib|stdio|string|math|time|sched|spawn|immintrin|xmmintrin|wasm_simd128|pwd|malloc)\.h$"
)


def read_components(table):
    """{NAME: paths of folders and files} of deploy/cmake/Components.cmake."""
    return {name: paths.split() for name, paths in re.findall(r'^carillon_component\((\w+) "[^"]*"([^)]*)\)', table, re.M)}


COMPONENTS = read_components((pathlib.Path(__file__).resolve().parents[2] / "deploy/cmake/Components.cmake").read_text())


def find_component(path):
    """Name of the component of a file, None for the core. x_absent.cpp stands in for x.cpp."""
    path = path.replace("_absent.cpp", ".cpp")
    return next((name for name, own in COMPONENTS.items() if any(path == one or path.startswith(one + "/") for one in own)), None)


def library_of(path):
    for name, prefixes in LIBRARIES.items():
        if any(path.startswith(prefix) for prefix in prefixes):
            return name
    return None


def split(path):
    """(folder of LAW, part) of a file or header."""
    parent = str(pathlib.PurePosixPath(path).parent)
    folder = find_folder(parent)
    return (folder, parent.removeprefix(folder).strip("/") or ".") if parent in RULES else (None, None)


def find_breach(folder, part, target):
    """The rule that forbids an include of one of our headers, or None."""
    other, other_part = split(target)
    if other is None:
        return f"{target} is in no folder of the include law"
    if other == folder:
        order = PARTS[folder]
        if order.index(other_part) > order.index(part):
            return f"{folder}/{part} may not include {other}/{other_part} ({target})"
        return None
    path = folder if part == "." else f"{folder}/{part}"
    if other not in RULES[path][0]:
        return f"{path} may not include {other} ({target})"
    if other_part != "." and not target.removeprefix(other + "/").startswith(tuple(PUBLIC.get(other, []))):
        return f"{target} is private to {other}"
    return None


def find_breaches(files):
    """files: (path relative to the root, text) pairs -> list of messages."""
    breaches = []
    for path, text in files:
        folder, part = split(path)
        if folder is None:
            breaches.append(f"{path}: its folder is not in the include law; add it to tests/structure/include_law.py")
            continue
        libraries = RULES[str(pathlib.PurePosixPath(path).parent)][1]
        for number, line in enumerate(text.splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            bracket, target = match.groups()
            if bracket == '"':
                if breach := find_breach(folder, part, target):
                    breaches.append(f"{path}:{number}: {breach}")
                owner = find_component(target)
                if owner not in (None, find_component(path)) and target not in FACES:
                    breaches.append(f"{path}:{number}: {target} belongs to the component {owner}, and is not among its FACES")
                continue
            library = library_of(target)
            if library is None and ("/" in target or "." in target) and not SYSTEM.match(target):
                breaches.append(
                    f"{path}:{number}: <{target}> belongs to no library of the include law; name ours in quotes, add a new one to LIBRARIES"
                )
            elif library and library not in libraries:
                breaches.append(f"{path}:{number}: {pathlib.PurePosixPath(path).parent} may not include {library} ({target})")
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
        ("runtime/physics/impact/x.cpp", '#include "runtime/bank/bank.hpp"\n'),
        ("runtime/physics/rigid/x.cpp", "#include <SimTKsimbody.h>\n"),
        ("precompute/run/run_job.cpp", '#include "precompute/air/radiate.hpp"\n'),
        ("runtime/synth/model.cpp", '#include "runtime/acoustics/head/ear_filter.hpp"\n'),
    ]
    for one in bad:
        assert len(find_breaches([one])) == 1, one
    assert not find_breaches([("precompute/run/air.cpp", '#include "precompute/air/radiate.hpp"\n')])
    good = [("runtime/bank/x.cpp", '#include <hdf5.h>\n#include <vector>\n#include "runtime/base/error.hpp"\n// #include <mpi.h>\n')]
    assert not find_breaches(good)


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        self_test()
        sys.exit(0)
    found = find_breaches(read_tree(pathlib.Path(sys.argv[1])))
    print("\n".join(found) if found else "the include law holds")
    sys.exit(1 if found else 0)
