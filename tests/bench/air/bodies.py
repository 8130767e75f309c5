"""Bodies of the bench: from a ball to a plate of 2 mm, and the surfaces of those that are no shape of `carillon-mesh`."""
import importlib.util
import math
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent.parent
BUNNY = pathlib.Path("/usr/share/glmark2/models/bunny.obj")
NODES = 4000
TO_10_KHZ = {"band_hz": [20, 10000]}  # open bodies: some resonances of the air inside do not converge above


def make_lens(share):
    """The outside of a hollow lens 200 mm across and `share` as thick: points and triangles, counter-clockwise seen from outside."""
    angles = [math.pi * (i / 24 - 0.5) for i in range(25)]
    return make_lathe([(0.1 * math.cos(a), 0.1 * share * math.sin(a)) for a in angles], 48)


def make_bell():
    """The middle of the wall of a bell 160 mm across and 125 mm high, open at the bottom."""
    side = [(0.080, 0.000), (0.070, 0.012), (0.062, 0.028), (0.055, 0.048), (0.050, 0.070), (0.046, 0.092), (0.040, 0.108)]
    return make_lathe(side + [(0.030, 0.119), (0.016, 0.124), (0.0, 0.125)], 48)


def make_glass():
    """The middle of the wall of the bowl of a wine glass, 80 mm at the widest, 66 mm at the mouth and 98 mm high."""
    side = [(0.0, 0.0), (0.016, 0.003), (0.028, 0.012), (0.036, 0.025), (0.040, 0.040), (0.0395, 0.055), (0.037, 0.070)]
    return make_lathe(side + [(0.035, 0.084), (0.033, 0.098)], 48)


def make_lathe(profile, around):
    """The surface of revolution about z of a profile (r, z); closed where it begins and ends on the axis."""
    points, rings = [], []
    for r, z in profile:
        if r < 1e-9:
            rings.append([len(points)] * around)
            points.append((0.0, 0.0, z))
        else:
            rings.append([len(points) + j for j in range(around)])
            points += [(r * math.cos(2 * math.pi * j / around), r * math.sin(2 * math.pi * j / around), z) for j in range(around)]
    triangles = []
    for low, high in zip(rings, rings[1:]):
        for j in range(around):
            a, b, c, d = low[j], low[(j + 1) % around], high[(j + 1) % around], high[j]
            triangles += [t for t in ((a, b, c), (a, c, d)) if len(set(t)) == 3]
    return points, triangles


def write_obj(file, points, triangles):
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    file.write_text("\n".join(lines) + "\n")


def write_letter(file):
    """An E, 150 mm high, of strips of 30 x 10 mm."""
    spec = importlib.util.spec_from_file_location("outlines", ROOT / "docs/examples/letters/outlines.py")
    outlines = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(outlines)
    outlines.GRIDS["fine E"] = ["".join(3 * cell for cell in row) for row in outlines.GRIDS["E"] for _ in range(3)]
    outlines.write_medit(file, *outlines.make_mesh("fine E", 0.01))


def write_surfaces(folder):
    for name, surface in (("lens2", make_lens(0.5)), ("lens4", make_lens(0.25)), ("lens7", make_lens(0.14))):
        write_obj(folder / f"{name}.obj", *surface)
    write_obj(folder / "bell.obj", *make_bell())
    write_obj(folder / "glass.obj", *make_glass())
    write_letter(folder / "letter.mesh")


def make_shape(shape, **dimensions):
    return {"body": {"shape": shape, "nodes": NODES, **{f"{name}_m": size for name, size in dimensions.items()}}}


def make_wall(surface, wall_m, nodes=NODES):
    return {"body": {"surface": surface, "wall_m": wall_m, "nodes": nodes}}


def make_opening(wall_m, radius_m, degrees):
    return {"body": {"shape": "bowl", "outer_radius_m": radius_m, "wall_m": wall_m, "opening_angle_deg": degrees, "nodes": NODES}}


BODIES = {  # name: words, material, the job's body
    "ball": ("ball, hollow, 200 mm, wall 3 mm", "aluminium", make_shape("sphere", radius=0.1, wall=0.003)),
    "lens2": ("lens 2:1, hollow, 200 mm, wall 3 mm", "porcelain", make_wall("lens2.obj", 0.003)),
    "lens4": ("lens 4:1, hollow, 200 mm, wall 3 mm", "porcelain", make_wall("lens4.obj", 0.003)),
    "lens7": ("lens 7:1, hollow, 200 mm, wall 3 mm", "porcelain", make_wall("lens7.obj", 0.003)),
    "cylinder": ("cylinder 2:1, 160 mm long", "acrylic", {**make_shape("cylinder", length=0.16, radius=0.04), "max_modes": 30}),
    "cube": ("cube, hollow, 150 mm, wall 4 mm", "aluminium", make_shape("hollow-box", length=0.15, width=0.15, height=0.15, wall=0.004)),
    "block": ("cube, solid, 100 mm", "acrylic", {**make_shape("box", length=0.1, width=0.1, height=0.1), "max_modes": 20}),
    "cone": ("cone, solid, 120 mm high and across", "acrylic", {**make_shape("cone", radius=0.06, height=0.12), "max_modes": 25}),
    "bunny": ("bunny, hollow, 130 mm, wall 5 mm", "porcelain", {"body": {"surface": str(BUNNY), "height_m": 0.13, "wall_m": 0.005}}),
    "box3": ("box 3:2:1, hollow, 180 mm, wall 3 mm", "steel", make_shape("hollow-box", length=0.18, width=0.12, height=0.06, wall=0.003)),
    "box5": ("box 5:3:1, hollow, 200 mm, wall 3 mm", "steel", make_shape("hollow-box", length=0.2, width=0.12, height=0.04, wall=0.003)),
    "box8": ("box 8:6:1, hollow, 240 mm, wall 3 mm", "steel", make_shape("hollow-box", length=0.24, width=0.18, height=0.03, wall=0.003)),
    "brick": ("block 4:2:1, solid, 240 mm", "brick", make_shape("box", length=0.24, width=0.12, height=0.06)),
    "slab": ("slab 8:6:1, solid, 240 mm", "glass", make_shape("box", length=0.24, width=0.18, height=0.03)),
    "bar6": ("bar 6:1:1, 240 mm", "aluminium", make_shape("bar", length=0.24, width=0.04, thickness=0.04)),
    "bar10": ("bar 10:1:1, 300 mm", "steel", make_shape("bar", length=0.3, width=0.03, thickness=0.03)),
    "chime": ("bar of a glockenspiel, 300 x 30 x 10 mm", "steel", make_shape("bar", length=0.3, width=0.03, thickness=0.01)),
    "letter": ("letter E, 150 mm high, 10 mm thick", "aluminium", {"mesh": "letter.mesh"}),
    "bottle": ("ball with a mouth of 80 mm, 160 mm, wall 4 mm", "glass", {**make_opening(0.004, 0.08, 300), **TO_10_KHZ}),
    "bowl": ("bowl, 160 mm, wall 4 mm", "porcelain", make_opening(0.004, 0.08, 150)),
    "bell": ("bell, 160 mm, wall 6 mm", "bell bronze", make_wall("bell.obj", 0.006)),
    "glass": ("bowl of a wine glass, 98 mm, wall 1.5 mm", "glass", {**make_wall("glass.obj", 0.0015), **TO_10_KHZ}),
    "tube": (
        "tube, 300 mm, 25 mm across, wall 1.5 mm",
        "aluminium",
        {**make_shape("tube", length=0.3, outer_radius=0.0125, wall=0.0015), **TO_10_KHZ},
    ),
    "ring": ("ring, 200 mm, wire of 12 mm", "steel", make_shape("ring", radius=0.1, thickness=0.012)),
    "plate10": ("plate, 300 x 200 x 10 mm", "aluminium", make_shape("plate", length=0.3, width=0.2, thickness=0.01)),
    "plate2": ("plate, 300 x 200 x 2 mm", "steel", make_shape("plate", length=0.3, width=0.2, thickness=0.002)),
}
BODIES["bunny"][2]["body"]["nodes"] = 18000  # fewer do not resolve the wall
