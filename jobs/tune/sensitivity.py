"""carillon sensitivity: change of each frequency of a bank by removed material, and by the constants of the material."""
import argparse
import csv
import io
import json
import math
import pathlib
import struct

import numpy
import scipy.spatial

import programs
import results
import skin
import solver
from errors import InputError
from quantities import LENGTH_UNITS, read_quantity
from sites import find_sites

FIRST_ORDER = 0.05  # share of the wall that first order allows to cut
COARSE_CENTS = 10.0  # bar of a mode whose changes are off by some 10 % (docs/reports/tune.md)


def read_point(text):
    try:
        point = numpy.array([float(word) for word in text.split(",")])
    except ValueError:
        point = numpy.array([])
    if point.shape != (3,) or not numpy.isfinite(point).all():
        raise argparse.ArgumentTypeError(f"{text!r}: give three coordinates in metres, like 0.1,0,0.02")
    return point


def add_command(commands):
    words = commands.add_parser(
        "sensitivity",
        help="change of each frequency by removed material and by the constants of the material",
        description='Changes of the lowest modes in cents, of a bank whose job has "sensitivities": 30. With --at: by a spot whose depth '
        "falls smoothly to 0 at the radius; otherwise by a cut of the whole surface, with the places where a cut lowers and raises most.",
    )
    words.add_argument("bank", metavar="BANK", type=pathlib.Path)
    words.add_argument("--cut", type=read_quantity(LENGTH_UNITS), default=1e-4, metavar="0.1mm", help="depth of the cut (default: 0.1mm)")
    words.add_argument("--at", type=read_point, metavar="X,Y,Z", help="centre of a spot in metres, mesh axes; the nearest surface is taken")
    words.add_argument(
        "--radius", type=read_quantity(LENGTH_UNITS), metavar="10mm", help="radius of the spot (default: a tenth of the body)"
    )
    words.add_argument("--mode", type=int, default=1, metavar="K", help="mode of the picture and of the GLB file (default: 1)")
    words.add_argument(
        "-o",
        "--output",
        type=pathlib.Path,
        action="append",
        default=[],
        metavar="FILE",
        help="also write FILE: .csv (densities of all modes over the surface), .png (picture of a mode), .glb (coloured body); repeatable",
    )
    words.add_argument("--bin", metavar="FOLDER", help="folder of carillon-bank and carillon-draw (default: next to this program)")
    words.add_argument("--json", action="store_true", help="print one JSON document")
    words.set_defaults(run=run)


class Map:
    """Sites S of a bank with densities of n modes; docs/bank-format.md, sensitivities."""

    def __init__(self, path, program):
        rows = list(csv.DictReader(io.StringIO(solver.run_program([program, "info", "--csv", "--modes", "100000", path]))))
        with solver.open_bank(path, program) as bank:
            if "sensitivity" not in bank:
                raise InputError(f'{path}: has no sensitivities; compute it again with "sensitivities": 30 in its job')
            group = bank["sensitivity"]
            self.by_parameter = group["by_parameter"][:]
            self.sites = solver.read_sites(group, numpy.arange(len(bank["modes/eigenvalue"])))
            self.skin = skin.Skin(bank["mesh/vertices"][:], bank["mesh/triangles"][:], self.sites)
            self.parameters = json.loads(group["parameters"][()].rstrip(b"\0") or "[]")
            bars = bank["modes/corrected_error_cents"][:]
            bars[: len(group["by_parameter"])] = group.get("own_error_cents", bars)[: len(group["by_parameter"])]
            self.bar_cents = numpy.where(numpy.isfinite(bars), bars, numpy.inf)
            self.poisson_ratio = float(bank["material/poisson_ratio"][()])
            job, edits = solver.find_origin(json.loads(bank["provenance"][()].rstrip(b"\0")))
        body = job.get("body", {})
        thickness_m = body.get("wall_m", body.get("thickness_m"))
        self.thickness_m = thickness_m and thickness_m * math.prod(edit.get("size_scale", 1.0) for edit in edits)
        self.place = self.skin.place
        self.count = len(self.by_parameter)
        self.freq_hz = numpy.array([float(row["heard_frequency_hz"]) for row in rows])[: self.count]
        self.mesh_hz = numpy.array([float(row["frequency_hz"]) for row in rows])[: self.count]
        self.kind = [row["kind"] for row in rows][: self.count]

    def calc_changes(self, depth_m):
        """(n) cents, to first order; of modes within 1 % by the eigenvalues of their matrix."""
        entry = self.sites.density.T @ (self.sites.area_m2 * depth_m * 1e3)
        changes = entry[: self.count].copy()
        cents = 1200 * numpy.log2(self.mesh_hz / self.mesh_hz[0])
        first = 0
        while first < self.count:
            last = first + 1
            while last < self.count and self.mesh_hz[last] < 1.01 * self.mesh_hz[last - 1]:
                last += 1
            matrix = numpy.diag(cents[first:last])
            for (i, j), value in zip(self.sites.columns, entry):
                if first <= i and j < last:
                    matrix[i - first, j - first] += value
                    matrix[j - first, i - first] = matrix[i - first, j - first]
            changes[first:last] = numpy.linalg.eigvalsh(matrix) - cents[first:last]
            first = last
        return changes

    def list_constants(self):
        """[name, (n) d ln f / d ln constant]; of Poisson's ratios d ln f / d nu."""
        found = [(name.removesuffix("_pa").removesuffix("_kg_m3"), self.by_parameter[:, i]) for i, name in enumerate(self.parameters)]
        if "poisson_ratio" in self.parameters:  # nu = E / 2 G - 1
            by_nu = self.by_parameter[:, self.parameters.index("poisson_ratio")]
            found.insert(2, ("shear_modulus", -(1 + self.poisson_ratio) * by_nu))
        is_face = self.find_faces()
        if is_face.any():
            found.append(("thickness", self.calc_by_thickness(is_face)))
        return found

    def find_faces(self):
        """(S) sites with another side at the distance of the job's thickness; not those of rims."""
        if not self.thickness_m:
            return numpy.zeros(len(self.place), bool)
        inside = self.place - self.thickness_m * self.sites.normal
        distance, other = scipy.spatial.cKDTree(self.place).query(inside, k=min(4, len(self.place)))  # an edge has several sites
        is_opposite = (self.sites.normal[:, None] * self.sites.normal[other]).sum(axis=2) < -0.8
        return ((distance < 0.35 * self.thickness_m) & is_opposite).any(axis=1)

    def calc_by_thickness(self, is_face):
        """(n) d ln f / d ln thickness, half of it on each side."""
        share = 1e-4
        depth = numpy.where(is_face, 0.5 * share * self.thickness_m, 0.0)
        return -self.calc_changes(depth) * math.log(2) / 1200 / share

    def check_mesh(self):
        """A warning about modes that the mesh has not resolved, or none."""
        coarse = [k for k in range(self.count) if self.bar_cents[k] > COARSE_CENTS]
        if not coarse:
            return []
        names = ", ".join(str(k + 1) for k in coarse[:8]) + (", ..." if len(coarse) > 8 else "")
        one = len(coarse) == 1
        return [
            f"warning: the mesh is coarse for mode{'' if one else 's'} {names}: bars of up to {self.bar_cents[coarse].max():.0f} cents,"
            ' changes may be off by 10 % and more; compute the bank again with "accuracy_cents": 5, or two elements across the wall'
        ]

    def check_cut(self, depth, cut_m):
        """A warning about the first order, or none. InputError where nothing would be left."""
        share = self.skin.check_share(depth, f"--cut {1e3 * cut_m:g}mm", FIRST_ORDER)
        if share <= FIRST_ORDER:
            return []
        most = f"{1e3 * cut_m * FIRST_ORDER / share:.2g} mm"
        return [
            f"warning: {100 * share:.0f} % of the wall is cut, where first order is off by as much; give at most {most}, or solve again"
        ]


def show_place(place):
    return "(" + ", ".join(f"{x:.4g}" for x in place) + ")"


def list_spot(found, changes, out):
    out.append(f"{'mode':>5} {'Hz':>10} {'bar':>6}  {'cents':>8}  kind")
    for k in range(found.count):
        out.append(f"{k + 1:>5} {found.freq_hz[k]:>10.2f} {found.bar_cents[k]:>6.1f}  {changes[k]:>+8.2f}  {found.kind[k]}")


def list_whole(found, changes, constants, out):
    trusted = numpy.flatnonzero(~found.sites.doubtful)
    out.append(f"{'mode':>5} {'Hz':>10} {'bar':>6}  {'cents':>8}  {'lowered most at [m]':<34}{'raised most at [m]':<34}kind")
    for k in range(found.count):
        density = found.sites.density[trusted, k]
        low, high = (show_place(found.place[trusted[i]]) for i in (density.argmin(), density.argmax()))
        out.append(
            f"{k + 1:>5} {found.freq_hz[k]:>10.2f} {found.bar_cents[k]:>6.1f}  {changes[k]:>+8.2f}  {low:<34}{high:<34}{found.kind[k]}"
        )
    width = max(len(name) for name, _ in constants) + 2
    note = "cents by 1 % of a constant (Poisson's ratios: by 0.01); shear modulus: at constant Young's modulus"
    out += ["", note, f"{'mode':>5}" + "".join(f"{name:>{width}}" for name, _ in constants)]
    for k in range(found.count):
        out.append(f"{k + 1:>5}" + "".join(f"{12 / math.log(2) * values[k]:>+{width}.2f}" for _, values in constants))


def write_csv(found, path):
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow("x_m y_m z_m nx ny nz area_m2 doubtful".split() + [f"mode_{k + 1}_cent_per_mm_m2" for k in range(found.count)])
        for s in range(len(found.sites.vertex)):
            fixed = [*found.place[s], *found.sites.normal[s], found.sites.area_m2[s]]
            numbers = [f"{x:.8g}" for x in fixed] + [int(found.sites.doubtful[s])]
            table.writerow(numbers + [f"{x:.6g}" for x in found.sites.density[s, : found.count]])


def choose_colours(density, doubtful):
    """(S, 3) linear RGB: blue lowers, white does not matter, red raises, grey is doubtful."""
    most = numpy.abs(density[~doubtful]).max(initial=0.0)
    share = numpy.clip(density / most, -1, 1) if most > 0 else numpy.zeros_like(density)
    ends = numpy.where(share[:, None] < 0, [0.05, 0.2, 0.6], [0.6, 0.03, 0.06])
    colours = 0.95 + numpy.abs(share[:, None]) * (ends - 0.95)
    colours[doubtful] = 0.35
    return colours


def write_glb(found, mode, path):
    """The body as glTF 2.0 with vertex colours."""
    arrays = [
        (found.place.astype("<f4"), "VEC3", 5126, 34962),
        (found.sites.normal.astype("<f4"), "VEC3", 5126, 34962),
        (choose_colours(found.sites.density[:, mode], found.sites.doubtful).astype("<f4"), "VEC3", 5126, 34962),
        (
            find_sites(found.skin.vertices, found.skin.triangles, found.sites.vertex, found.sites.normal).astype("<u4").reshape(-1),
            "SCALAR",
            5125,
            34963,
        ),
    ]
    views, accessors, binary = [], [], b""
    for values, kind, component, target in arrays:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes, "target": target})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind})
        binary += values.tobytes()
    accessors[0] |= {"min": arrays[0][0].min(axis=0).tolist(), "max": arrays[0][0].max(axis=0).tolist()}
    name = f"mode {mode + 1}, {found.freq_hz[mode]:.1f} Hz"
    root = {
        "asset": {"version": "2.0", "generator": "carillon sensitivity"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.7}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(root).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(binary))
    path.write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def run(arguments):
    wrong = [path for path in arguments.output if path.suffix.lower() not in (".csv", ".png", ".glb")]
    if wrong:
        raise InputError(f"{wrong[0]}: the output ends in {wrong[0].suffix or 'nothing'}; give a .csv, .png or .glb file")
    results.check_outputs(arguments.output)
    if arguments.radius and arguments.at is None:
        raise InputError("--radius is of a spot; give its centre with --at X,Y,Z")
    found = Map(arguments.bank, programs.find_program(arguments.bin, "carillon-bank"))
    if not 1 <= arguments.mode <= found.count:
        raise InputError(f"--mode {arguments.mode}: {arguments.bank} has sensitivities of the modes 1 to {found.count}")
    out = []
    if arguments.at is not None:
        size = numpy.linalg.norm(numpy.ptp(found.place, axis=0))
        radius = arguments.radius or 0.1 * size
        nearest, depth = found.skin.make_spot(arguments.at, radius, arguments.cut)
        touched = depth > 0
        if touched.sum() < 8:
            raise InputError(
                f"--radius {radius:g}: the spot has {touched.sum()} vertices of the surface; give a larger one or a finer mesh"
            )
        volume = (found.sites.area_m2 * depth).sum()
        out.append(
            f"a spot of {1e3 * arguments.cut:g} mm at {show_place(found.place[nearest])} m, radius {1e3 * radius:g} mm: "
            f"{1e9 * volume:.3g} mm3 removed"
        )
        if (touched & found.sites.doubtful).any():
            out.append("warning: the spot is near an inward edge or fixed nodes, where the changes are 40 to 90 % too low")
        out += found.check_cut(depth, arguments.cut)
        changes, constants = found.calc_changes(depth), []
        list_spot(found, changes, out)
    else:
        out.append(f"{1e3 * arguments.cut:g} mm removed from the whole surface, {1e4 * found.sites.area_m2.sum():.4g} cm2")
        depth = numpy.full(len(found.sites.area_m2), arguments.cut)
        out += found.check_cut(depth, arguments.cut)
        changes, constants = found.calc_changes(depth), found.list_constants()
        list_whole(found, changes, constants, out)
    for path in arguments.output:
        if path.suffix.lower() == ".csv":
            write_csv(found, path)
        elif path.suffix.lower() == ".glb":
            write_glb(found, arguments.mode - 1, path)
        else:
            draw = programs.find_program(arguments.bin, "carillon-draw")
            solver.run_program([draw, "sensitivities", arguments.bank, "-o", path, "--modes", arguments.mode])
        out.append(str(path))
    out += found.check_mesh()
    rows = [
        {
            "mode": k + 1,
            "hz": found.freq_hz[k],
            "kind": found.kind[k],
            "cents": changes[k],
            "bar_cents": float(found.bar_cents[k]) if math.isfinite(found.bar_cents[k]) else None,
        }
        | {name: values[k] for name, values in constants}
        for k in range(found.count)
    ]
    notes = [line.removeprefix("warning: ") for line in out if line.startswith("warning: ")]
    return "\n".join(out), {"cut_m": arguments.cut, "modes": rows, "notes": notes}
