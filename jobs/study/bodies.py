"""Bodies of the study: geometry, material, reference frequencies, and meshes of all kinds and sizes."""
import dataclasses
import math
import pathlib

import known
import mesh_file
from lab import Case
from errors import InputError

BUNNY_SURFACE = "/usr/share/glmark2/models/bunny.obj"  # of Debian's glmark2-data, which the demo installs


@dataclasses.dataclass(frozen=True)
class Kind:
    """An element type of the study."""

    name: str
    element: str
    mass: str
    curved: bool = False


KINDS = (
    Kind("T4 consistent", "T4", "consistent"),
    Kind("T4 lumped", "T4", "lumped"),
    Kind("T10 straight", "T10", "consistent"),
    Kind("T10 curved", "T10", "consistent", True),
)


def find_kind(name):
    return next(kind for kind in KINDS if kind.name == name)


def isotropic(young, poisson, density, alpha1=1e-7, alpha2=1.0):
    return {
        "young_modulus_pa": young,
        "poisson_ratio": poisson,
        "density_kg_m3": density,
        "damping": {"rayleigh": {"alpha1_s": alpha1, "alpha2_per_s": alpha2}},
    }


STEEL, ALUMINIUM = isotropic(200e9, 0.3, 7850.0), isotropic(70e9, 0.33, 2700.0)
CHIME = isotropic(68.3518e9, 0.329801, 2700.0)  # OSG02 Table 1
CERAMIC = {
    "lame_lambda_pa": 3.99e9,
    "lame_mu_pa": 2.05e9,
    "density_kg_m3": 2700.0,
    "damping": {"rayleigh": {"alpha1_s": 1e-6, "alpha2_per_s": 10.0}},
}  # OSG02 Table 1


@dataclasses.dataclass(frozen=True)
class Body:
    """words: for carillon-mesh; change: (name, function of a MeshFile that moves its nodes) or None."""

    name: str
    summary: str
    material: dict
    words: tuple
    modes: int
    round: bool  # has curved faces, which a straight T10 does not represent
    change: tuple | None = None
    truth: known.Truth | None = None  # None: the finest curved T10 is the reference
    surface: bool = False

    def get_kinds(self):
        """Straight and curved T10 are equal on flat bodies."""
        return [kind for kind in KINDS if self.round or kind.name != "T10 curved"]

    def make_mesh(self, lab, kind, nodes):
        """A Mesh of this kind with about `nodes` nodes."""
        words, inputs = list(self.words), ()
        if self.surface:
            words, inputs = [lab.surface, *words], (lab.surface,)
        if kind.element == "T10":
            words += ["--order", 2]
        # The straight mesh is the curved one with mid-side nodes moved to the edges.
        is_straight = kind.element == "T10" and not kind.curved and self.round
        names = ([self.change[0]] if self.change else []) + (["straight"] if is_straight else [])

        def change(path):
            mesh = mesh_file.MeshFile(path)
            if self.change:
                self.change[1](mesh)
            if is_straight:
                mesh.straighten()
            mesh.write(path)

        return lab.make_mesh([*words, "--nodes", nodes], change if names else None, ", ".join(names), inputs)

    def find_band(self):
        """The band for all meshes, far above the highest known mode because coarse meshes are too high by octaves; max_modes limits it."""
        highest = self.truth.freq_hz[-1] if self.truth else 6000.0
        lowest = self.truth.freq_hz[0] if self.truth else 600.0
        return [lowest / 4, 8 * highest]

    def make_job(self, mesh, kind, **more):
        """A job of carillon-precompute on this mesh; more: other keys, such as solver."""
        return {
            "mesh": str(mesh.path),
            "material": self.material,
            "element": kind.element,
            "mass": kind.mass,
            "band_hz": self.find_band(),
            "max_modes": self.modes,
        } | more

    def make_case(self, lab, kind, nodes, ranks=1, name="", **more):
        """The Case of one mesh of one kind. name: suffix of its name."""
        mesh = self.make_mesh(lab, kind, nodes)
        return Case(f"{self.name}, {kind.name}, {nodes} nodes{', ' + name if name else ''}", self.make_job(mesh, kind, **more), ranks)


# Hemispherical bowl, middle radius 60 mm, 4 mm thick, polar angle from 5 to 90 degrees, mapped from a tube.
BOWL_RADIUS, BOWL_WALL, BOWL_FROM, BOWL_TO = 0.06, 0.004, math.radians(5), math.radians(90)
BOWL_LENGTH, BOWL_TUBE = BOWL_RADIUS * (BOWL_TO - BOWL_FROM), 0.0423


def bend_to_bowl(mesh):
    def find_parameters(x, y, z):
        return (
            BOWL_FROM + (x / BOWL_LENGTH + 0.5) * (BOWL_TO - BOWL_FROM),
            BOWL_RADIUS + math.hypot(y, z) - (BOWL_TUBE - BOWL_WALL / 2),
            math.atan2(z, y),
        )

    def find_place(polar, radius, azimuth):
        return radius * math.sin(polar) * math.cos(azimuth), radius * math.sin(polar) * math.sin(azimuth), radius * math.cos(polar)

    mesh.move(find_parameters, find_place, (0.0, 0.0, 2 * math.pi))


# The undercut bar whose bending modes are 1 : 4 : 10: flat above, thickness H0 - DEPTH exp(-(x/REACH)^4).
VIBRAPHONE_H0, VIBRAPHONE_DEPTH, VIBRAPHONE_REACH = 0.0131825, 0.0082301, 0.0875879


def undercut(mesh):
    def find_place(x, y, z):
        thickness = VIBRAPHONE_H0 - VIBRAPHONE_DEPTH * math.exp(-((x / VIBRAPHONE_REACH) ** 4))
        return x, y, VIBRAPHONE_H0 / 2 - thickness * (0.5 - z / VIBRAPHONE_H0)

    mesh.move(lambda x, y, z: (x, y, z), find_place)


def shape(name, **lengths):
    return ("--shape", name, *(word for key, value in lengths.items() for word in (f"--{key.replace('_', '-')}", repr(value))))


def make_bodies():
    """{name: Body}, in the order of the report."""
    truths = known.read_known()
    bodies = [
        Body("bar", "aluminium bar, 300 x 30 x 12 mm", ALUMINIUM, shape("bar", length=0.3, width=0.03, thickness=0.012), 16, False),
        Body(
            "tube",
            "aluminium chime, 505 mm long, radius 12.5 mm, wall 1 mm",
            CHIME,
            shape("tube", length=0.505, outer_radius=0.0125, wall=0.001),
            7,
            True,
        ),
        Body("sphere", "solid steel ball, radius 50 mm", STEEL, shape("sphere", radius=0.05), 27, True),
        Body("plate", "thick steel plate, 100 x 100 x 10 mm", STEEL, shape("plate", length=0.1, width=0.1, thickness=0.01), 15, False),
        Body("cube", "steel cube, 50 mm", STEEL, shape("box", length=0.05, width=0.05, height=0.05), 17, False),
        Body(
            "ring",
            "thick brass ring, radii 30 and 40 mm, 12 mm long",
            isotropic(100e9, 0.34, 8500.0),
            shape("tube", length=0.012, outer_radius=0.04, wall=0.01),
            24,
            True,
        ),
        Body(
            "bowl",
            "hemispherical ceramic bowl, middle radius 60 mm, 4 mm thick, open at the pole",
            isotropic(72e9, 0.22, 2700.0),
            shape("tube", length=BOWL_LENGTH, outer_radius=BOWL_TUBE, wall=BOWL_WALL),
            10,
            True,
            change=("bowl", bend_to_bowl),
        ),
        Body(
            "vibraphone",
            "undercut aluminium bar, 360 x 50 mm, bending modes 1 : 4 : 10",
            ALUMINIUM,
            shape("bar", length=0.36, width=0.05, thickness=VIBRAPHONE_H0),
            16,
            True,
            change=("undercut", undercut),
        ),
        Body(
            "bunny",
            "hollow ceramic bunny, 130 mm tall, wall 5 mm",
            CERAMIC,
            ("--height", "0.13", "--wall", "0.005"),
            15,
            True,
            surface=True,
        ),
    ]
    return {body.name: dataclasses.replace(body, truth=truths.get(body.name)) for body in bodies}


def choose(names, surface, quick=False):
    """The bodies of --on, all of them without it: a list. InputError names those there are. The bunny needs its surface, and many nodes of
    T10: quick takes it only by its name."""
    bodies = make_bodies()
    for name in names or []:
        if name not in bodies:
            raise InputError(f"--on {name}: no such body; choose among {', '.join(bodies)}")
    chosen = [bodies[name] for name in dict.fromkeys(names or bodies)]
    has_surface = pathlib.Path(surface).is_file()
    if names and not has_surface and any(body.surface for body in chosen):
        raise InputError(f"--on bunny: {surface} does not exist; install glmark2-data, or give the bunny's surface with --surface")
    return [body for body in chosen if not body.surface or (has_surface and (names or not quick))]
