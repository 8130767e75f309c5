#!/usr/bin/env python3
"""A type's name means one thing wherever two namespaces meet: in any folder whose files may include headers of both (include_law.py).

usage: type_names.py SOURCE_DIR        exit 1 and one line per name that stands for two types, or per allowed one that no longer does
       type_names.py --self-test       proves that a duplicate is found
"""
import collections
import itertools
import pathlib
import re
import sys

import include_law

# Names that two namespaces may share, with the reason. The list only shrinks: one that is not needed any more is an error.
SOLVER = "an impact, the space of bodies and its sweeps each have their own view of it; files of the contact solver name the namespace"
JOB = "as a job describes it, and as it is made or handed to the solver"
BANK = "as it is computed, and as it stands in a bank"
OWN = "each is private to its library; the one folder that includes both names the namespace"
ALLOWED = {
    ("Body", "impact", "rigid::sweeps"): SOLVER,
    ("Books", "impact", "rigid"): SOLVER,
    ("Contact", "impact", "rigid"): SOLVER,
    ("Functions", "impact::dense", "rigid::sweeps"): SOLVER,
    ("Options", "impact", "rigid"): SOLVER,
    ("Range", "base", "rigid::sweeps"): SOLVER,
    ("Side", "impact", "shape"): SOLVER,
    ("Body", "job", "run"): JOB,
    ("Body", "job", "shapes"): JOB,
    ("Factorisation", "eigen", "job"): JOB,
    ("Material", "bank", "material"): BANK,
    ("Method", "eigen", "job"): JOB,
    ("Counts", "eigen", "bank"): BANK,
    ("Counts", "shapes", "bank"): BANK,
    ("Proof", "eigen", "bank"): BANK,
    ("RigidBody", "fem", "bank"): BANK,
    ("Supports", "fem", "bank"): BANK,
    ("Body", "mesher", "shapes"): OWN,
    ("Body", "run", "shapes"): OWN,
    ("Counts", "eigen", "shapes"): OWN,
    ("Launcher", "attempt", "queue"): OWN,
    ("Lock", "process", "store"): OWN,
    ("Options", "attempt", "report"): OWN,
    ("RunOptions", "queue", "base"): OWN,
    ("RunOptions", "run", "base"): OWN,
    ("Shape", "fem", "shapes"): OWN,
    ("Solid", "estimate", "fem"): OWN,
    ("Surface", "estimate", "io"): OWN,
    ("Surface", "estimate", "mesh"): OWN,
    ("Surface", "io", "mesh"): OWN,
}
NAMESPACE = re.compile(r"^namespace carillon::([a-z_:]+) \{")
TYPE = re.compile(r"^(?:template\s*<.*>\s*)?(?:struct|class|enum class|enum)\s+(?:alignas\(\w+\)\s+)?(\w+)\s*(?:final\s*)?(?::[^:].*)?\{")
ALIAS = re.compile(r"^using (\w+) = (?!(?:\w+::)*\1;)")


def find_types(text):
    """(namespace, name) of all types that a header declares at namespace level; an alias of the same name declares none."""
    namespace = None
    for line in text.splitlines():
        if match := NAMESPACE.match(line):
            namespace = match[1]
        elif namespace and (match := TYPE.match(line) or ALIAS.match(line)):
            yield namespace, match[1]


def find_meetings():
    """Pairs of folders of which some folder may include both."""
    pairs = set()
    for folder, (others, _) in include_law.LAW.items():
        pairs.update(itertools.combinations(sorted({folder, *others}), 2))
    return pairs


def find_duplicates(files):
    """files: (path relative to the root, text) pairs of headers -> {(name, place, place)}; a place is a folder and a namespace."""
    places = collections.defaultdict(set)
    for path, text in files:
        folder = str(pathlib.PurePosixPath(path).parent)
        for namespace, name in find_types(text):
            places[name].add((folder, namespace))
    meetings = find_meetings()
    duplicates = set()
    for name, found in places.items():
        for a, b in itertools.combinations(sorted(found), 2):
            if a[1] != b[1] and (a[0] == b[0] or (a[0], b[0]) in meetings):
                duplicates.add((name, a[1], b[1]))
    return duplicates


def find_faults(duplicates, allowed):
    faults = [
        f"{name} is a type of {a} and of {b}, which meet: give one a name of its own" for name, a, b in sorted(duplicates - allowed.keys())
    ]
    return faults + [
        f"{name} of {a} and {b} is no duplicate any more: take it off the list" for name, a, b in sorted(allowed.keys() - duplicates)
    ]


def self_test():
    a = ("runtime/bank/x.hpp", "namespace carillon::bank {\nstruct Body {\n  struct Inner {\n")
    b = ("runtime/synth/x.hpp", "namespace carillon::synth {\nclass Body final : public X {\nusing Vec3 = base::Vec3;\n")
    c = ("precompute/mesher/x.hpp", "namespace carillon::mesher {\nenum class Body {\nusing Vec3 = std::array<double, 3>;\n")
    duplicate = ("Body", "bank", "synth")
    assert find_duplicates([a, b, c]) == {duplicate}, find_duplicates([a, b, c])
    assert len(find_faults({duplicate}, {})) == 1
    assert not find_faults({duplicate}, {duplicate: "reason"})
    assert len(find_faults(set(), {duplicate: "reason"})) == 1


def main():
    if sys.argv[1:] == ["--self-test"]:
        self_test()
        return 0
    files = ((path, text) for path, text in include_law.read_tree(pathlib.Path(sys.argv[1])) if path.endswith(".hpp"))
    faults = find_faults(find_duplicates(files), ALLOWED)
    print("\n".join(faults) if faults else "no name stands for two types that meet")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
