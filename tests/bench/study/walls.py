"""Section: thin-wall elements. An extruded sheet against the volume mesh and the regular mesh of the same body."""
import math

import bodies
import elements
import plots
from corrected import Compared, compare
from lab import Case
from section import Section
from errors import RunError

PROGRAMS = elements.PROGRAMS
WALL, VOLUME, REGULAR = "thin wall", "volume", "regular mesh"
SIZES = {WALL: ((2500, 5000, 10000, 20000), (1500, 4000)), VOLUME: ((10000, 20000, 40000), (6000,))}  # nodes (all, quick)
T10 = bodies.find_kind("T10 curved")


def calc_bowl(u, v):
    """(point of the middle surface, normal)."""
    polar, turn = bodies.BOWL_FROM + v * (bodies.BOWL_TO - bodies.BOWL_FROM), -2 * math.pi * u  # outward triangles
    normal = math.sin(polar) * math.cos(turn), math.sin(polar) * math.sin(turn), math.cos(polar)
    return [bodies.BOWL_RADIUS * x for x in normal], normal


def calc_tube(u, v):
    normal = math.cos(2 * math.pi * u), math.sin(2 * math.pi * u), 0.0
    return [0.012 * normal[0], 0.012 * normal[1], 0.505 * v], normal


def calc_plate(u, v):
    return [0.1 * u, 0.1 * v, 0.0], (0.0, 0.0, 1.0)


# By body: middle surface, wall [m], facets around and along, closed around?
SHEETS = {
    "tube": (calc_tube, 0.001, 48, 48, True),
    "plate": (calc_plate, 0.01, 8, 8, False),
    "bowl": (calc_bowl, bodies.BOWL_WALL, 64, 16, True),
}


def make_sheet(name, level):
    """Points offset by `level` wall thicknesses from the middle surface, and their triangles."""
    place, wall, across, along, is_closed = SHEETS[name]
    columns = across if is_closed else across + 1
    points = []
    for j in range(along + 1):
        for i in range(columns):
            middle, normal = place(i / across, j / along)
            points.append([x + level * wall * n for x, n in zip(middle, normal)])
    at = lambda i, j: j * columns + i % columns
    faces = []
    for j in range(along):
        for i in range(across):
            faces += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
    return points, faces


def make_solid(name):
    """Both faces of the wall and its rims."""
    high, faces = make_sheet(name, 0.5)
    low, _ = make_sheet(name, -0.5)
    sides = {(a, b) for t in faces for a, b in zip(t, t[1:] + t[:1])}
    n = len(high)
    closed = faces + [tuple(n + v for v in reversed(t)) for t in faces]
    for a, b in sorted(sides):
        if (b, a) not in sides:
            closed += [(b, a, n + a), (b, n + a, n + b)]
    return high + low, closed


def write_surface(path, surface):
    points, faces = surface
    lines = [f"v {x:.12g} {y:.12g} {z:.12g}" for x, y, z in points] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def make_mesh(lab, words, file, nodes):
    """Mesh of about so many nodes, or of the nearest count that the mesher suggests; None if that is far off."""
    for _ in range(2):
        try:
            return lab.make_mesh([*words, "--nodes", nodes], inputs=(file,))
        except RunError as error:
            if not error.possible_nodes or error.possible_nodes > 2 * nodes:
                return None
            nodes = error.possible_nodes
    return None


def make_meshes(lab, body):
    """[(method, Mesh)] without the sizes that a method cannot mesh."""
    folder = lab.out / "work/surfaces"
    sheet = write_surface(folder / f"{body.name}-sheet.obj", make_sheet(body.name, 0.0))
    solid = write_surface(folder / f"{body.name}-solid.obj", make_solid(body.name))
    made = []
    for way, words, file in ((WALL, [sheet, "--wall", SHEETS[body.name][1]], sheet), (VOLUME, [solid, "--method", "delaunay"], solid)):
        for nodes in SIZES[way][lab.quick]:
            mesh = make_mesh(lab, [*words, "--order", 2], file, nodes)
            if mesh:
                made.append((way, mesh))
            else:
                lab.say(f"{body.name}, {way}, {nodes} nodes: left out, since its elements cannot be so few")
    for nodes in lab.get_sizes(body, T10):
        made.append((REGULAR, body.make_mesh(lab, T10 if body.round else bodies.find_kind("T10 straight"), nodes)))
    return made


def study_body(section, lab, body):
    meshes = make_meshes(lab, body)
    cases = {}
    for way, mesh in meshes:
        cases[mesh.path] = (way, mesh, Case(f"{body.name}, {way}, {mesh.nodes} nodes", body.make_job(mesh, T10)))
    solves = lab.measure([case for _, _, case in cases.values()])
    found = []
    for way, mesh, case in cases.values():
        one = compare(T10, solves[case.name], body.truth, mesh.cpu_s)
        if one:
            found.append((way, mesh, one))
    draw(section, lab, body, found)
    return found


def draw(section, lab, body, found):
    panels = []
    for title, find in (("median of the band", Compared.find_median), ("worst of the band", Compared.find_worst)):
        curves = {}
        for way in (WALL, VOLUME, REGULAR):
            own = sorted(((one.cpu_s, *find(one)) for name, _, one in found if name == way))
            curves[way] = [(cpu, mesh) for cpu, mesh, _ in own]
            if way == WALL:
                curves[f"{way}, corrected"] = [(cpu, corrected) for cpu, _, corrected in own]
        panels.append(
            plots.Panel(
                title,
                "CPU seconds, mesh included",
                "error, cents",
                {name: points for name, points in curves.items() if points},
                levels=list(elements.LEVELS),
            )
        )
    rows = [("way", "nodes", "mesh, CPU s", "in all, CPU s", "median, cents", "worst", "corrected: median", "worst", "within their bars")]
    data = [("body", "way", "nodes", "mesh_cpu_s", "cpu_s", "median", "worst", "corrected_median", "corrected_worst", "held", "modes")]
    for way, mesh, one in found:
        (median, corrected_median), (worst, corrected_worst) = one.find_median(), one.find_worst()
        held, modes = one.count_held(), len(one.mesh)
        errors = (median, worst, corrected_median, corrected_worst)
        rows.append((way, f"{one.nodes:,}", f"{mesh.cpu_s:.2f}", f"{one.cpu_s:.2f}", *(f"{x:.2g}" for x in errors), f"{held} of {modes}"))
        data.append((body.name, way, one.nodes, mesh.cpu_s, one.cpu_s, *errors, held, modes))
    command = lab.make_command("walls", "--on", body.name)
    section.add_chart(
        body.name,
        plots.draw_panels(
            panels, f"{body.name}: {body.summary}", "thin-wall elements, the volume mesher's, and a regular mesh of the shape"
        ),
        f"{body.name[0].upper()}{body.name[1:]}: errors against CPU seconds with the mesh, by the way in which it was made.",
        data,
        command,
    )
    section.add_table(f"{body.name}-meshes", rows, "The same as numbers.", data, command)


def conclude(section, results):
    """Cost of ten cents by thin-wall elements and by the volume mesher, where both reach it."""
    parts = []
    for body, found in results:
        costs = {}
        for way in (WALL, VOLUME):
            within = [one for name, _, one in found if name == way and one.find_worst()[1] <= 10]
            if within:
                costs[way] = min(within, key=lambda one: one.cpu_s)
        if WALL in costs:
            wall = costs[WALL]
            volume = f"{costs[VOLUME].cpu_s:.1f} s with {costs[VOLUME].nodes:,} nodes" if VOLUME in costs else "none of those measured"
            parts.append(f"{body.name} {wall.cpu_s:.1f} CPU s with {wall.nodes:,} nodes (elements of the volume: {volume})")
        else:
            nearest = min((one for name, _, one in found if name == WALL), key=lambda one: one.find_worst()[1])
            parts.append(f"{body.name} not (nearest: {nearest.find_worst()[1]:.2g} cents, {nearest.cpu_s:.1f} CPU s)")
    section.conclude(f"**Thin walls**: the worst corrected frequency within ten cents, the mesh included: {'; '.join(parts)}.")


def study(lab, chosen):
    section = Section("walls", "Thin walls", lab.make_command("walls"))
    thin = [body for body in chosen if body.name in SHEETS]
    if not thin:
        section.say(f"None of these bodies is a thin wall; {', '.join(SHEETS)} are.")
        return section
    section.say(
        "The thin ones among the bodies whose truth is known, as a user has them: an open surface in facets with a thickness, extruded"
        " (`carillon-mesh sheet.obj --wall T`), and the closed surface of the same body, meshed by its volume (`--method delaunay`). The"
        " regular mesh of the parametric shape is what no surface file leads to. T10, curved. Cents as in the section before; CPU seconds"
        " of `carillon-mesh` and `carillon-precompute` together."
    )
    results = [(body, study_body(section, lab, body)) for body in thin]
    conclude(section, results)
    return section
