#!/usr/bin/python3
"""Damages surfaces and meshes and runs the programs on them: none may crash, hang or write an invalid mesh.

usage: mutate.py --bin BIN_DIR [--surfaces N] [--first N] [--defer SECONDS...] [--meshes N] [--seed S] [--seconds LIMIT] [--keep FOLDER]

Surfaces (OBJ, OFF, text and binary STL, text and binary PLY of either byte order) go to `carillon-mesh SURFACE`, mostly with edges about as
long as the body is thick, which makes few nodes at once, now and then with --nodes, which searches for a count, --wall, --order 2, --method
stuffing or --facets; what it writes is read again. One in twenty is meshed by the program, the others by `test_meshes --surfaces`, which
does the same in processes that need not start. --first N begins with the Nth surface; --defer does those that take longer at the end.
Meshes (Gmsh 2.2 and 4.1, text and binary, with and without views; VTU, Medit, TetGen: the fixtures of tests/unit/precompute/mesh) go
through read_mesh and check_mesh in `test_meshes`, many in one process; where that ends, the files it had not answered for are given to it
one by one. With --keep the files at fault stay. The mutations follow the seed alone: --seed S --surfaces N damages the same N files on any
machine. After every 100 surfaces the counts so far are printed. Counts are printed; exit code 1 where there was a crash, a hang or a result
that is no mesh.

Under the sanitizers:

    cmake -B build/asan-mesh -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo \\
      -DCMAKE_CXX_FLAGS="-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer"
    cmake --build build/asan-mesh --target carillon-mesh test_meshes
    tests/system/mesher/mutate.py --bin build/asan-mesh/bin --surfaces 10000 --meshes 10000 --seed 4 --defer 0.15 0.5 --keep faults
"""
import argparse
import collections
import json
import math
import os
import pathlib
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE.parents[1] / "support"))
from surfaces import make_box  # noqa: E402

DATA = HERE.parents[1] / "unit/precompute/mesh/data"
ODD = [0.0, -0.0, 1e-42, 1e-310, -4.16e-19, 1e-12, 1e-7, 1e7, -1.07e8, 3e29, 1e31, float("nan"), float("inf"), 0.05, 0.1]
WORDS = [
    b"",
    b"nan",
    b"inf",
    b"-1",
    b"0",
    b"1e-42",
    b"1e300",
    b"99999999999",
    b"-9223372036854775808",
    b"2147483648",
    b"4294967295",
    b"0x10",
    b"1.5",
    b"#",
    b"3/3/3",
    b"\\",
    b"end_header",
    b"vertex",
    b"$EndNodes",
    b"<",
    b"\xff\xfe",
]


def box():
    return make_box(0.1, 0.05, 0.03)


def sphere(levels=2, radius=0.05):
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(levels):
        middles = {}

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                p = [points[a][c] + points[b][c] for c in range(3)]
                points.append(tuple(x / math.hypot(*p) for x in p))
                middles[key] = len(points) - 1
            return middles[key]

        faces = [
            t
            for a, b, c in faces
            for ab, bc, ca in [(middle(a, b), middle(b, c), middle(c, a))]
            for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    return [tuple(radius * x for x in p) for p in points], faces


def cylinder(sides=20, radius=0.03, length=0.1):
    ring = [(radius * math.cos(2 * math.pi * i / sides), radius * math.sin(2 * math.pi * i / sides)) for i in range(sides)]
    points = [(x, y, z) for z in (0, length) for x, y in ring] + [(0, 0, 0), (0, 0, length)]
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [(i, j, sides + j), (i, sides + j, sides + i), (2 * sides, j, i), (2 * sides + 1, sides + i, sides + j)]
    return points, faces


def torus(n=18, m=16, large=0.04, small=0.02):
    points = []
    for i in range(n):
        for j in range(m):
            r = large + small * math.cos(2 * math.pi * j / m)
            points.append((r * math.cos(2 * math.pi * i / n), r * math.sin(2 * math.pi * i / n), small * math.sin(2 * math.pi * j / m)))
    at = lambda i, j: (i % n) * m + j % m
    return points, [
        t
        for i in range(n)
        for j in range(m)
        for t in ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))
    ]


def two_boxes():
    points, faces = box()
    return points + [(x + 0.05, y + 0.02, z + 0.01) for x, y, z in points], faces + [tuple(v + 8 for v in f) for f in faces]


# Each with edge lengths [m] that give a hundred nodes or fewer.
BODIES = {box: 0.014, sphere: 0.02, cylinder: 0.016, torus: 0.014, two_boxes: 0.016}


def write(points, faces, kind):
    text = lambda p: " ".join(repr(float(x)) for x in p)
    if kind == "obj":
        return (
            "o body\n" + "".join(f"v {text(p)}\n" for p in points) + "".join("f " + " ".join(str(v + 1) for v in f) + "\n" for f in faces)
        ).encode()
    if kind == "off":
        return (
            f"OFF\n{len(points)} {len(faces)} 0\n"
            + "".join(text(p) + "\n" for p in points)
            + "".join(f"{len(f)} " + " ".join(map(str, f)) + "\n" for f in faces)
        ).encode()
    if kind == "stl":
        return (
            "solid body\n"
            + "".join(
                "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {text(points[v])}\n" for v in f) + "endloop\nendfacet\n"
                for f in faces
            )
            + "endsolid body\n"
        ).encode()
    if kind == "binary stl":
        return (
            bytes(80)
            + struct.pack("<I", len(faces))
            + b"".join(struct.pack("<12fH", 0, 0, 0, *(x for v in f for x in points[v]), 0) for f in faces)
        )
    head = (
        f"element vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\nelement face {len(faces)}\nproperty list"
        " uchar int vertex_indices\nend_header\n"
    )
    if kind == "ply":
        return (
            "ply\nformat ascii 1.0\n"
            + head
            + "".join(text(p) + "\n" for p in points)
            + "".join("3 " + " ".join(map(str, f)) + "\n" for f in faces)
        ).encode()
    order = "<" if "little" in kind else ">"
    return (
        (f"ply\nformat binary_{'little' if order == '<' else 'big'}_endian 1.0\n" + head).encode()
        + b"".join(struct.pack(order + "3f", *p) for p in points)
        + b"".join(struct.pack(order + "B3i", 3, *f) for f in faces)
    )


KINDS = ["obj", "off", "stl", "binary stl", "ply", "little ply", "big ply"]


def damage_shape(points, faces, random):
    """Damage that keeps the file valid but not the body, for repair and mesher."""
    points, faces = [list(p) for p in points], [list(f) for f in faces]
    for _ in range(random.choice([1, 1, 1, 2, 3, 6])):
        what = random.randrange(9)
        v, f = random.randrange(len(points)), random.randrange(len(faces)) if faces else None
        if what == 0:
            points[v][random.randrange(3)] = random.choice(ODD[:10] + ODD[-2:])
        elif what == 1:
            points[v] = list(points[random.randrange(len(points))])
        elif what == 2:
            points[v] = [x + random.choice([1e-42, 1e-12, 1e-9, 1e-6, 1e-3]) * random.uniform(-1, 1) for x in points[v]]
        elif what == 3:
            points[v] = [x + random.uniform(-0.1, 0.1) for x in points[v]]
        elif f is None:
            continue
        elif what == 4:
            faces[f][random.randrange(3)] = v
        elif what == 5:
            del faces[f]
        elif what == 6:
            faces[f].reverse()
        elif what == 7:
            faces.append(list(faces[f]))
        else:
            # One corner of one triangle: a slit.
            points.append([x + random.choice([0, 1e-42, 1e-10, 1e-5]) for x in points[faces[f][0]]])
            faces[f][0] = len(points) - 1
    return points, faces


def damage_bytes(data, random):
    data = bytearray(data)
    for _ in range(random.choice([1, 1, 1, 2, 4, 10])):
        what, at = random.randrange(8), random.randrange(max(len(data), 1))
        if not data:
            break
        if what == 0:
            data[at] = random.randrange(256)
        elif what == 1:
            data[at] ^= 1 << random.randrange(8)
        elif what == 2:
            del data[at : at + random.choice([1, 2, 4, 12, 50])]
        elif what == 3:
            data[at:at] = data[at - random.choice([1, 4, 12, 50]) : at]
        elif what == 4 and random.random() < 0.3:
            del data[at:]
        elif what == 5:
            value = random.choice([0, 1, -1, 255, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1, random.randrange(2**32)])
            put = (
                struct.pack(random.choice("<>") + random.choice("iq"), max(min(value, 2**31 - 1), -(2**31)))
                if random.random() < 0.7
                else struct.pack("<Q", value % 2**64)
            )
            data[at : at + len(put)] = put
        elif what == 6:
            put = struct.pack(random.choice("<>") + random.choice("fd"), random.choice([x for x in ODD if not abs(x) > 3e30]))
            data[at : at + len(put)] = put
        else:
            # A token.
            end = at
            while at > 0 and data[at - 1] > 32:
                at -= 1
            while end < len(data) and data[end] > 32:
                end += 1
            data[at:end] = random.choice(WORDS)
    return bytes(data)


class Campaign:
    # No leak detection, short allocation stacks and a small quarantine: half the time, and the same faults
    # are found.
    ASAN = "detect_leaks=0:allocator_may_return_null=1:malloc_context_size=3:quarantine_size_mb=32"

    def __init__(self, options):
        self.options = options
        self.bin = pathlib.Path(options.bin).resolve()
        self.counts = collections.Counter()
        self.faults = []
        self.slowest = self.cpu = 0.0
        self.environment = {**os.environ, "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1", "ASAN_OPTIONS": self.ASAN}
        self.empty = tempfile.TemporaryDirectory()  # where the programs stand: they leave nothing there
        self.reader = next((p for p in (self.bin / "test_meshes", self.bin.parent / "tests/system/mesher/test_meshes") if p.exists()), None)
        self.servers = {}
        if self.reader is None:
            sys.exit("mutate.py: test_meshes is not built")

    def run(self, words):
        """Exit code (None: time limit), output and CPU seconds, which the limit counts, so that machine load causes no false hangs."""
        begin = os.times()
        limit = math.ceil(self.options.seconds)
        try:
            done = subprocess.run(
                words,
                capture_output=True,
                timeout=60 * limit,
                env=self.environment,
                cwd=self.empty.name,
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit + 1, limit + 5)),
            )
            code, said = done.returncode, done.stderr.decode(errors="replace")
        except subprocess.TimeoutExpired:
            code, said = None, ""
        end = os.times()
        seconds = end.children_user + end.children_system - begin.children_user - begin.children_system
        self.take(seconds)
        return (None if seconds > self.options.seconds else code), said, seconds

    def take(self, seconds):
        self.slowest = max(self.slowest, seconds)
        self.cpu += seconds

    def ask(self, words, patience):
        """As run(), for carillon-mesh in a persistent process; with patience, SIGPROF after so many seconds."""
        if patience not in self.servers:
            self.servers[patience] = subprocess.Popen(
                [self.reader, "--surfaces", str(patience or self.options.seconds)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=self.environment,
                cwd=self.empty.name,
            )
        server = self.servers[patience]
        print(*words, sep="\t", file=server.stdin, flush=True)
        answer = server.stdout.readline()
        if not answer:
            sys.exit(f"mutate.py: test_meshes --surfaces ended, with code {server.wait()}")
        code, seconds, said = json.loads(answer)
        self.take(seconds)
        return (None if seconds > self.options.seconds or code == -signal.SIGALRM else code), said, seconds

    def fault(self, what, path, said):
        self.counts[what] += 1
        kept = path
        if self.options.keep:
            kept = pathlib.Path(self.options.keep) / f"{what.replace(' ', '-')}-{path.name}"
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, kept)
        self.faults.append(f"{what}: {kept}: {said.strip()[-600:]}")
        print(self.faults[-1], flush=True)

    def is_crash(self, code, said):
        return code is not None and (code not in (0, 2, 3, 4) or "Sanitizer" in said or "runtime error:" in said or "broke down" in said)

    def surfaces(self, folder):
        """Fast ones first, so that an interrupted campaign covers most of the files."""
        all_of_them = range(self.options.first, self.options.first + self.options.surfaces)
        numbers, late = all_of_them, []
        for patience in self.options.defer + [None]:
            for done, n in enumerate(numbers, 1):
                if not self.surface(folder, n, patience):
                    late.append(n)
                if done % 100 == 0:
                    print(
                        f"{done} of {len(numbers)} surfaces{' that took longer' if numbers is not all_of_them else ''}: {self.describe()}"
                        + (f"; {len(late)} left for later" if patience else ""),
                        flush=True,
                    )
            numbers, late = late, []

    def surface(self, folder, n, patience):
        """Makes and meshes surface n. False if it exceeds `patience` seconds, if given."""
        number = random.Random(f"surface {self.options.seed} {n}")
        kind = number.choice(KINDS)
        body = number.choice(list(BODIES))
        points, faces = body()
        if number.random() < 0.6:
            points, faces = damage_shape(points, faces, number)
        data = write(points, faces, kind)
        if number.random() < 0.6:
            data = damage_bytes(data, number)
        edge = BODIES[body] * number.choice([1, 1, 1.3])
        words = number.choice(
            7 * [[]]
            + 7 * [["--facets"]]
            + 5 * [["--close-holes", "1"]]
            + 3 * [["--order", "2"]]
            + 3 * [["--method", "stuffing"]]
            + [["--wall", "0.5"], ["--nodes", "200"], ["--nodes", "800", "--order", "2"], ["--nodes", "800", "--wall", "0.5"]]
        )
        if "--wall" in words:
            words = words[:-1] + [f"{float(words[-1]) * edge:.4g}"]
        if "--nodes" not in words:
            words = words + ["--edge", f"{edge:.4g}"]
        # One in twenty by the program itself, the others by a process that started once. Most of these remove the worst slivers alone: all
        # of them take nine tenths of the time of a coarse mesh.
        by_program, is_rough = number.random() < 0.05, number.random() < 0.85
        if by_program and patience:
            return False
        path, out = folder / f"surface{n}.{kind.split()[-1]}", folder / f"surface{n}.msh"
        path.write_bytes(data)
        if by_program:
            code, said, seconds = self.run([self.bin / "carillon-mesh", path, "-o", out, "--quiet", *words])
            if code == 0:
                code, said, _ = self.run([self.reader, out])
                code = 1 if code == 2 else code
        else:
            words = words + ["--slivers", "1"] if is_rough else words
            code, said, seconds = self.ask([path, out, *words], patience)
        if code == -signal.SIGPROF:
            path.unlink()
            out.unlink(missing_ok=True)
            return False
        shown = " ".join(words) + ": " + said
        for left in pathlib.Path(self.empty.name).iterdir():
            self.fault("surface leaves a file", path, f"{left.name}, {shown}")
            left.unlink()
        if code is None:
            self.fault("surface hangs", path, f"{seconds:.0f} s CPU, {shown}")
        elif code == 5 and said == "":
            self.counts["surfaces repaired only, of more than 50,000 nodes"] += 1
        elif code == 1 and "Sanitizer" not in said:
            self.fault("surface gives no mesh", path, shown)
        elif self.is_crash(code, said):
            self.fault("surface crashes", path, f"exit code {code}, {shown}")
        elif code == 0:
            self.counts["surfaces meshed"] += 1
        else:
            self.counts["surfaces ended by their limit of time" if "was ended at the step" in said else "surfaces refused"] += 1
            if code != 2 or len(said.strip().splitlines()) != 1 or path.name not in said:
                self.fault("surface refused unclearly", path, f"exit code {code}, {shown}")
        path.unlink()
        out.unlink(missing_ok=True)
        return True

    def meshes(self, folder):
        seeds = sorted(p for p in DATA.iterdir() if p.suffix in (".msh", ".vtu", ".mesh", ".node") and p.stat().st_size < 40000)
        batch = []
        for n in range(self.options.meshes):
            number = random.Random(f"mesh {self.options.seed} {n}")
            seed = number.choice(seeds)
            path = folder / f"mesh{n}{seed.suffix}"
            path.write_bytes(damage_bytes(seed.read_bytes(), number))
            if seed.suffix == ".node":
                other = seed.with_suffix(".ele").read_bytes()
                path.with_suffix(".ele").write_bytes(damage_bytes(other, number) if number.random() < 0.5 else other)
            batch.append(path)
            if len(batch) == 100 or n + 1 == self.options.meshes:
                self.read_meshes(batch)
                batch = []

    def read_meshes(self, batch):
        code, said, seconds = self.run([self.reader, *batch])
        one_by_one = code not in (0, 2) or self.is_crash(code, said)
        for path in batch:
            if one_by_one:
                code, said, seconds = self.run([self.reader, path])
                if code is None:
                    self.fault("mesh hangs", path, f"{seconds:.0f} s CPU")
                elif self.is_crash(code, said):
                    self.fault("mesh crashes", path, f"exit code {code}, {said}")
            lines = [line for line in said.splitlines() if line.startswith(f"{path}:") or line.startswith(f"{path.with_suffix('.ele')}:")]
            self.counts["meshes refused" if lines else "meshes read"] += 1
            path.unlink()
            path.with_suffix(".ele").unlink(missing_ok=True)

    def describe(self):
        return (
            ", ".join(f"{n} {what}" for what, n in sorted(self.counts.items()))
            + f"; the slowest run took {self.slowest:.1f} s of CPU, all {self.cpu:.0f} s"
        )


def main():
    parser = argparse.ArgumentParser(description="Damaged surfaces and meshes for the programs.")
    parser.add_argument("--bin", required=True)
    parser.add_argument("--surfaces", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument(
        "--defer",
        type=float,
        nargs="*",
        default=[],
        help="leave surfaces that take more CPU seconds than this, less than 1, for later; then this; ...",
    )
    parser.add_argument("--meshes", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=20, help="CPU seconds after which a run counts as a hang")
    parser.add_argument("--keep", help="a folder for the files at fault")
    options = parser.parse_args()
    campaign = Campaign(options)
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        campaign.surfaces(pathlib.Path(name))
        campaign.meshes(pathlib.Path(name))
    print(
        f"{options.surfaces} surfaces and {options.meshes} meshes, seed {options.seed}: {campaign.describe()} and"
        f" {time.monotonic() - begin:.0f} s by the clock"
    )
    return 1 if campaign.faults else 0


sys.exit(main())
