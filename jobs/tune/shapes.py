"""What a tuning may change: each body is a function of a few parameters, with a mesh and a derivative of its frequencies.

A Moved body has one mesh whose nodes move along fixed fields, X = X0 + sum p_k F_k, p_k being depths in m. So shapes of modes stay
comparable vertex by vertex, and the derivatives follow from the sensitivities of the bank with the normal part of F_k
(docs/equations.md, E7a).
"""
import dataclasses
import math
import pathlib
import re

import numpy
import scipy.interpolate
import scipy.spatial

import grid
import mesh_file
import measuring
from errors import InputError

EDGES_ALONG = 24  # elements along a bar on the coarse mesh
END_SHARE = 0.46  # of the length: the cut ends there
MAX_SHARE = 0.3  # largest step, of the depth that may go
LATHE_CELLS = 20  # elements along an outline on the coarse mesh
KEY_NODES = 16000  # of a body without a number of nodes, on the fine mesh
KEY_STEPS = (0.03, 0.3)  # of the logarithm of a key: half the difference of two meshes; largest in a search


@dataclasses.dataclass(frozen=True)
class Moved:
    """nodes (N, 3) m, tets (E, 10), fields (K, N, 3), names (K) of the parameters, low, high and step (K) m. smooth: parameters are
    neighbours in their order, and a design is better without jumps between them."""

    job: dict
    nodes: numpy.ndarray
    tets: numpy.ndarray
    fields: numpy.ndarray
    names: list
    low: numpy.ndarray
    high: numpy.ndarray
    step: numpy.ndarray
    marks: numpy.ndarray  # (K, K) parameters to depths at the places of the names
    smooth: bool = False
    is_remeshed = False  # derivatives are exact to first order
    mesh: object = None  # the MeshFile whose node sets stay
    volumes: numpy.ndarray | None = None  # (K) m^2, of material for each m of depth
    profile: object = None  # function of p to a table [mm] of the new section: head, rows
    floor: str = "no material can be added there"
    ceiling: str = "the minimum wall is reached there"

    def place(self, depths_m):
        return self.nodes + numpy.tensordot(depths_m, self.fields, 1)

    @property
    def is_length(self):
        return numpy.ones(len(self.names), bool)

    def show(self, p):
        """Depths at the places of the names, and what they change for each unit of p."""
        return self.marks @ p, numpy.ones(len(p))

    def get_surfaces(self, _first, last):
        """((positions, triangles) before, after) of two States."""
        triangles = grid.find_surface(self.tets)
        return (self.nodes, triangles), (self.place(last.p), triangles)

    def make_job(self, depths_m, folder, name="body.msh"):
        path = pathlib.Path(folder) / name
        if self.mesh is None:
            grid.write_msh(path, self.place(depths_m), self.tets)
        else:
            self.mesh.nodes = self.place(depths_m).tolist()
            self.mesh.write(path)
        dropped = ("body", "accuracy_cents", "shape", "mesh_scale")
        return {key: value for key, value in self.job.items() if key not in dropped} | {"mesh": str(path.resolve())}

    def find_nodes(self, solution, depths_m):
        """(S) nodes of the sites of a Solution."""
        apart, node = scipy.spatial.cKDTree(self.place(depths_m)).query(solution.vertices[solution.sites.vertex])
        if apart.max() > 1e-6 * numpy.ptp(self.nodes, axis=0).max():
            raise InputError("the bank has vertices that the mesh has not")
        return node

    def calc_velocities(self, solution, depths_m):
        """(K, S) outward motion of the sites of a Solution for each parameter."""
        return numpy.einsum("ksx,sx->ks", self.fields[:, self.find_nodes(solution, depths_m)], solution.sites.normal)

    def leave_doubtful(self, solution, depths_m):
        """This map without the cuts that reach doubtful sites: fixed nodes stay where they are, and derivatives are right. InputError where
        none is left."""
        if self.mesh is None or not solution.sites.doubtful.any():
            return self
        doubtful = self.find_nodes(solution, depths_m)[solution.sites.doubtful]
        reaches = (self.fields[:, doubtful] != 0).any(axis=(1, 2))
        if reaches.all():
            raise InputError("every cut reaches a fixed face or an inward edge; give smaller ones, by more --knots")
        high = numpy.where(reaches, 0, self.high)
        return dataclasses.replace(self, high=high, step=numpy.maximum(high, 1e-9))


def calc_entries(body, state):
    """(C, K) cents for each unit of a parameter, for the columns of the sensitivities of a State."""
    sites = state.solution.sites
    return -1e3 * ((body.calc_velocities(state.solution, state.p) * sites.area_m2) @ sites.density).T


def calc_jacobian(body, state, groups):
    """(groups, K) cents for each unit of a parameter: the mean of the modes of each group, which off-diagonal entries do not change."""
    entries = calc_entries(body, state)
    of = {int(i): c for c, (i, j) in enumerate(state.solution.sites.columns) if i == j}
    return numpy.array([numpy.mean([entries[of[m]] for m in group], axis=0) for group in groups])


def find_splines(knots, spacing, along):
    """(knots, ...) cubic B-splines centred at k * spacing. They are positive with the sum 1 or less: where all coefficients lie between two
    bounds, the depth does too."""
    u = numpy.abs(along / spacing - numpy.arange(knots).reshape(-1, *(1 for _ in numpy.shape(along))))
    return numpy.where(u < 1, 2 / 3 - u**2 + u**3 / 2, (2 - numpy.minimum(u, 2)) ** 3 / 6)


def make_undercut(job, fineness, knots=6, side="z-min", wall_m=None):
    """The bar of a job, cut from one side by knots along its length. fineness: of the mesh, 1 is coarse."""
    body = job.get("body", {})
    sizes = [body.get(key) for key in ("length_m", "width_m")] + [body.get("thickness_m", body.get("height_m"))]
    if body.get("shape") not in ("bar", "plate", "box") or not all(sizes):
        raise InputError('an undercut needs "body": {"shape": "bar", "length_m": ..., "width_m": ..., "thickness_m": ...}')
    length, width, thickness = sizes
    if length < max(width, thickness):
        raise InputError("an undercut runs along x: length_m must be the largest size")
    if job.get("fixed"):
        raise InputError('an undercut moves the mesh of a free bar; leave out "fixed"')
    if side not in ("z-min", "z-max"):
        raise InputError(f"--remove {side}: a bar is cut from z-min or z-max")
    wall = thickness / 4 if wall_m is None else wall_m
    if not 0 < wall < thickness:
        raise InputError(f"--wall: between 0 and the thickness of {1e3 * thickness:g} mm")
    edge = length / EDGES_ALONG
    cells = [EDGES_ALONG, max(2, 2 * round(width / edge / 2)), max(1, round(0.8 * thickness / edge))]
    cells = [2 * max(1, round(fineness * cells[0] / 2)), 2 * max(1, round(fineness * cells[1] / 2)), max(1, round(fineness * cells[2]))]
    places, tets = grid.make_grid(cells)
    used, tets = grid.tidy(places, tets)
    places = places[used] - 0.5
    nodes = places * [length, width, thickness]
    spacing = END_SHARE * length / (knots + 1)
    up = 1 if side == "z-min" else -1

    def find_bases(x):
        """Mirrored at the middle."""
        right, left = find_splines(knots, spacing, x), find_splines(knots, spacing, -x)
        return right + numpy.where(numpy.arange(knots)[:, None] > 0, left, 0)

    bases = find_bases(nodes[:, 0])
    fields = numpy.zeros((knots, len(nodes), 3))
    fields[:, :, 2] = up * bases * (0.5 - up * places[:, 2])
    top = numpy.full(knots, thickness - wall)
    at = numpy.arange(knots) * spacing
    names = [f"{1e3 * x:.1f} mm from the middle" for x in at]
    marks = find_bases(at).T

    def calc_profile(p):
        x = numpy.arange(0, round(500 * length) + 1) * 1e-3
        return "from_middle_mm,depth_mm,left_mm", 1e3 * numpy.stack([x, find_bases(x).T @ p, thickness - find_bases(x).T @ p], axis=1)

    low, step = numpy.zeros(knots), MAX_SHARE * top
    return Moved(job, nodes, tets, fields, names, low, top, step, marks, smooth=True, profile=calc_profile)


def read_mesh(job, job_file, folder, mesher):
    """The MeshFile of a job: its mesh, or its body meshed by carillon-mesh with elements of ten nodes. InputError."""
    base = pathlib.Path(job_file).resolve().parent
    if "mesh" in job:
        mesh = mesh_file.MeshFile(base / job["mesh"])
        mesh.nodes = (job.get("mesh_scale", 1.0) * numpy.array(mesh.nodes)).tolist()
    else:
        body = dict(job.get("body", {}))
        words = [str(base / body.pop("surface"))] if "surface" in body else []
        for key, value in body.items():
            word = f"--{re.sub('_(m|deg)$', '', key).replace('_', '-')}"
            words += [word] if value is True else [] if value is False else [word, str(value)]
        path = pathlib.Path(folder) / "start.msh"
        measuring.run_part([mesher, *words, "--order", "2", "-q", "-o", path], folder, job_file)
        mesh = mesh_file.MeshFile(path)
    if not mesh.tets or len(mesh.tets[0]) != 10:
        raise InputError(f"{job_file}: a map needs a mesh of ten-node tetrahedra: carillon-mesh ... --order 2")
    return mesh


def find_normals(points, triangles):
    """Unit normals (N, 3) at the vertices of a surface, weighted by area, and areas (N); 0 off the surface."""
    corners = points[triangles]
    product = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    normal, area = numpy.zeros_like(points), numpy.zeros(len(points))
    for k in range(3):
        numpy.add.at(normal, triangles[:, k], product / 3)
        numpy.add.at(area, triangles[:, k], numpy.linalg.norm(product, axis=1) / 3)
    return normal / numpy.maximum(numpy.linalg.norm(normal, axis=1, keepdims=True), 1e-30), area


def find_wall(points, triangles, at, inwards):
    """Way (n) from points `at` along `inwards` to the other side of the body; inf if none."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    result = numpy.full(len(at), numpy.inf)
    for number, (origin, ray) in enumerate(zip(at, inwards)):  # Moeller and Trumbore 1997
        side = numpy.cross(ray, c - a)
        size = numpy.einsum("tx,tx->t", b - a, side)
        size = numpy.where(numpy.abs(size) < 1e-30, 1e-30, size)
        from_a = origin - a
        u = numpy.einsum("tx,tx->t", from_a, side) / size
        across = numpy.cross(from_a, b - a)
        v = across @ ray / size
        way = numpy.einsum("tx,tx->t", c - a, across) / size
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (way > 1e-6)
        result[number] = way[hit].min(initial=numpy.inf)
    return result


def make_map(job, mesh, cuts, most_m, side="all", wall_m=None):
    """Local cuts, evenly spread over one side of a mesh, at most most_m deep; each fades to its neighbours. side: outer or inner surfaces
    look away from the middle of the body, or towards it."""
    nodes, tets = numpy.array(mesh.nodes), numpy.array(mesh.tets)
    triangles = grid.find_surface(tets)
    normal, area = find_normals(nodes, triangles)
    surface = numpy.unique(triangles)
    looks = numpy.einsum("nx,nx->n", normal, nodes - (nodes.min(axis=0) + nodes.max(axis=0)) / 2)
    allowed = surface if side == "all" else surface[(looks[surface] > 0) == (side == "outer")]
    if side not in ("all", "outer", "inner") or not len(allowed):
        raise InputError(f"--remove {side}: outer, inner or all")
    chosen = [allowed[0]]
    away = numpy.linalg.norm(nodes[allowed] - nodes[chosen[0]], axis=1)
    for _ in range(min(cuts, len(allowed)) - 1):
        chosen.append(allowed[away.argmax()])
        away = numpy.minimum(away, numpy.linalg.norm(nodes[allowed] - nodes[chosen[-1]], axis=1))
    chosen = numpy.array(chosen)
    radius = 2 * away.max()
    share = numpy.linalg.norm(nodes[surface] - nodes[chosen][:, None], axis=2) / radius
    depth = numpy.where(normal[chosen] @ normal[surface].T > 0.5, grid.fade(share), 0)
    depth[:, ~numpy.isin(surface, allowed)] = 0
    depth /= depth.sum(axis=0).max()
    walls = find_wall(nodes, triangles, nodes[chosen], -normal[chosen])
    left = numpy.where(numpy.isfinite(walls), walls, 0)
    high = numpy.clip(left - (left / 4 if wall_m is None else wall_m), 0, most_m)
    moves = -depth[:, :, None] * normal[surface]
    fields = grid.spread(nodes, tets, surface, moves.transpose(1, 0, 2).reshape(len(surface), -1))
    fields = fields.reshape(len(nodes), len(chosen), 3).transpose(1, 0, 2)
    names = ["({:.1f}, {:.1f}, {:.1f}) mm".format(*(1e3 * nodes[c])) for c in chosen]
    marks = depth[:, numpy.searchsorted(surface, chosen)].T
    step = numpy.maximum(high, 1e-9)
    return Moved(job, nodes, tets, fields, names, numpy.zeros(len(chosen)), high, step, marks, mesh=mesh, volumes=depth @ area[surface])


class Keys:
    """Keys of a job's body, like body.wall_m, within limits; parameters are logarithms of their values, in which frequencies are nearly
    linear. The body is meshed again for each value; fineness scales body.nodes with its square. The motion of the surface is the difference
    of two meshes, of a larger and a smaller value; nothing is solved for it."""

    profile = None
    smooth, is_remeshed, floor, ceiling = False, True, "its least value is reached", "its largest value is reached"

    def __init__(self, job, limits, fineness, mesh):
        """mesh: function of a job to its MeshFile."""
        self.job, self.names, self.mesh, self.fineness = job, list(limits), mesh, fineness
        self.low, self.high = numpy.log(numpy.array(list(limits.values()))).T
        self.step = numpy.full(len(self.names), KEY_STEPS[1])
        self.is_length = numpy.array([name.endswith("_m") for name in self.names])

    def leave_doubtful(self, _solution, _p):
        return self

    def get_surfaces(self, first, last):
        return tuple((state.solution.vertices, state.solution.triangles) for state in (first, last))

    def show(self, p):
        """Values of parameters, and what they change for each unit of p."""
        return numpy.exp(p), numpy.exp(p)

    def make_job(self, p, _folder=None):
        values, _ = self.show(p)
        job = {key: value for key, value in self.job.items() if key != "accuracy_cents"}
        job["body"] = job["body"] | {name.removeprefix("body."): float(value) for name, value in zip(self.names, values)}
        if "edge_m" not in job["body"]:
            job["body"]["nodes"] = int(job["body"].get("nodes", KEY_NODES) * (self.fineness / 2) ** 2)
        return job

    def calc_velocities(self, solution, p):
        """As Moved.calc_velocities()."""
        points, normal = solution.vertices[solution.sites.vertex], solution.sites.normal
        rows = []
        for k in range(len(p)):
            ways = []
            for step in (KEY_STEPS[0], -KEY_STEPS[0]):
                mesh = self.mesh(self.make_job([*p[:k], p[k] + step, *p[k + 1 :]]))
                ways.append(find_way(points, normal, numpy.array(mesh.nodes), grid.find_surface(numpy.array(mesh.tets))))
            rows.append((ways[0] - ways[1]) / (2 * KEY_STEPS[0]))
        return numpy.array(rows)


def find_way(points, normal, nodes, triangles):
    """(S) distances along the normals from points of one surface to another, near and of about the same direction. The chord between two
    points of a sphere is at right angles to the sum of their normals, so the place of the nearest triangle hardly matters."""
    corners = nodes[triangles]
    other = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    other /= numpy.maximum(numpy.linalg.norm(other, axis=1, keepdims=True), 1e-30)
    centre = corners.mean(axis=1)
    size = numpy.ptp(nodes, axis=0).max()  # sides of an edge are far apart in the six numbers compared
    tree = scipy.spatial.cKDTree(numpy.concatenate([centre, size * other], axis=1))
    chosen = tree.query(numpy.concatenate([points, size * normal], axis=1))[1]
    mean = normal + other[chosen]
    return numpy.einsum("sx,sx->s", centre[chosen] - points, mean) / numpy.einsum("sx,sx->s", normal, mean)


def read_limits(text, job):
    """{key: (low, high)} of 'body.wall_m=0.002:0.004,...' InputError."""
    limits = {}
    for word in text.split(","):
        name, _, values = word.partition("=")
        name = name.strip()
        at = job.get("body", {}).get(name.removeprefix("body.")) if name.startswith("body.") else None
        try:
            low, high = (float(value) for value in values.split(":"))
        except ValueError:
            raise InputError(f"--free {word!r}: give a key and its limits, like body.wall_m=0.002:0.004") from None
        if isinstance(at, bool) or not isinstance(at, (int, float)) or not name.endswith(("_m", "_deg")):
            raise InputError(f"--free {name}: the job has no such size of a body, like body.wall_m")
        if name in limits:
            raise InputError(f"--free {name}: is given twice")
        if not 0 < low <= at <= high < math.inf or low == high:
            raise InputError(f"--free {word}: the value of the job, {at:g}, is not within the limits, above 0")
        limits[name] = (low, high)
    return limits


def read_outline(path):
    """(n, 3) m: r, z of the middle of the wall and its thickness, along the outline; CSV in mm with that head. InputError."""
    try:
        rows = numpy.loadtxt(path, delimiter=",", skiprows=1, ndmin=2) * 1e-3
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {error}; give rows of r, z, thickness in mm below a head") from None
    if rows.shape[1:] != (3,) or len(rows) < 4 or not numpy.isfinite(rows).all():
        raise InputError(f"{path}: give at least four rows of r, z, thickness in mm")
    if (rows[:, 0] < 0).any() or (rows[:, 2] <= 0).any() or (numpy.linalg.norm(numpy.diff(rows[:, :2], axis=0), axis=1) <= 0).any():
        raise InputError(f"{path}: r is 0 or more, the thickness above 0, and no two rows are the same place")
    return rows


def make_lathe(job, rows, fineness, knots=8, side="inside", wall_m=None):
    """A body of revolution about z from an outline (n, 3), turned on one side: depths at knots along the outline, cubic B-splines."""
    along = numpy.concatenate([[0], numpy.cumsum(numpy.linalg.norm(numpy.diff(rows[:, :2], axis=0), axis=1))])
    # Level at the axis: otherwise the wall would have a hole or an overlap there.
    ends = [(1, [way, 0.0]) if r == 0 else "not-a-knot" for r, way in ((rows[0, 0], 1.0), (rows[-1, 0], -1.0))]
    curve = scipy.interpolate.CubicSpline(along, rows[:, :2], bc_type=tuple(ends))
    thickness = scipy.interpolate.PchipInterpolator(along, rows[:, 2])
    length = along[-1]
    around = 2 * numpy.pi * rows[:, 0].max()
    edge = max(2 * rows[:, 2].mean(), length / LATHE_CELLS)
    cells = [4 * max(4, round(fineness * around / edge / 4)), 2 * max(4, round(fineness * length / edge / 2)), max(1, round(fineness / 2))]
    places, tets = grid.make_grid(cells, is_round=True)
    s = places[:, 1] * length
    tangent = curve(s, 1)
    normal = numpy.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / numpy.linalg.norm(tangent, axis=1, keepdims=True)
    if numpy.mean(normal[:, 0]) < 0:
        normal = -normal  # away from the axis
    turn = 2 * numpy.pi * places[:, 0]
    wall = thickness(s)
    flat = curve(s) + normal * (wall * (places[:, 2] - 0.5))[:, None]
    flat[flat[:, 0] < 1e-9 * length, 0] = 0

    def revolve(r_z):
        return numpy.stack([r_z[..., 0] * numpy.cos(turn), r_z[..., 0] * numpy.sin(turn), r_z[..., 1]], axis=-1)

    nodes = revolve(flat)
    used, tets = grid.tidy(nodes, tets)
    nodes = nodes[used]
    # The narrow wedges around the axis have straight edges: curved ones would fold them.
    ends, middles = tets[:, numpy.array(grid.EDGES)], tets[:, 4:]
    reaches = (flat[used, 0] <= 0)[ends].sum(axis=2) == 1
    nodes[middles[reaches]] = nodes[ends[reaches]].mean(axis=1)
    spacing = length / max(knots - 1, 1)
    at = numpy.arange(knots) * spacing
    bases = find_splines(knots, spacing, s)
    if side not in ("inside", "outside"):
        raise InputError(f"--remove {side}: an outline is turned inside or outside")
    way = normal * (1 - places[:, 2])[:, None] if side == "inside" else -normal * places[:, 2][:, None]
    way[flat[:, 0] <= 0, 0] = 0
    fields = revolve(bases[:, :, None] * way)[:, used]
    least = numpy.array([thickness(numpy.clip(numpy.linspace(x - 2 * spacing, x + 2 * spacing, 33), 0, length)).min() for x in at])
    high = least - (least / 4 if wall_m is None else wall_m)
    if not (high > 0).all():
        raise InputError("--wall: the outline is thinner than this")
    names = [f"{1e3 * x:.1f} mm along the outline" for x in at]
    marks = find_splines(knots, spacing, at).T

    def calc_profile(p):
        x = numpy.linspace(0, length, 4 * len(rows))
        cut = find_splines(knots, spacing, x).T @ p
        across = curve(x, 1)[:, ::-1] * [1, -1] / numpy.linalg.norm(curve(x, 1), axis=1, keepdims=True)
        across *= numpy.sign(across[:, 0].mean())
        middle = curve(x) + across * (cut / 2 * (1 if side == "inside" else -1))[:, None]
        return "r_mm,z_mm,thickness_mm", 1e3 * numpy.column_stack([middle, thickness(x) - cut])

    low, step = numpy.zeros(knots), MAX_SHARE * high
    return Moved(job, nodes, tets, fields, names, low, high, step, marks, smooth=True, profile=calc_profile)
