"""Surfaces for the mesher's bench and hard cases: rough scans, a coil with a thin tail, a pot with narrow rims. numpy only."""
import numpy as np


def read_obj(path):
    """Points and triangles (fans of the polygons) of a Wavefront file."""
    points, triangles = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
            triangles += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
    return weld(np.array(points), np.array(triangles))


def weld(points, triangles):
    """Points at one place become one, triangles without area go."""
    points, number = np.unique(points, axis=0, return_inverse=True)
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles.T
    return points, triangles[(a != b) & (b != c) & (c != a)]


def write_obj(path, points, triangles):
    with open(path, "w") as out:
        out.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points)
        out.writelines(f"f {a} {b} {c}\n" for a, b, c in triangles + 1)


def divide(points, triangles, times=1):
    """Every triangle into four, `times` over."""
    for _ in range(times):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, number = np.unique(edges, axis=0, return_inverse=True)
        middle = len(points) + number.reshape(-1, 3)
        points = np.vstack([points, points[edges].mean(axis=1)])
        (a, b, c), (ab, bc, ca) = triangles.T, middle.T
        triangles = np.vstack([np.transpose(t) for t in ([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca])])
    return points, triangles


def roughen(points, triangles, roughness, seed=1, holes=0):
    """As a scanner leaves it: each point off its place, along a random direction, by `roughness` times its mean edge in the mean square,
    and `holes` triangles missing."""
    rng = np.random.default_rng(seed)
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    mean = np.bincount(edges[:, 0], lengths, len(points)) / np.maximum(np.bincount(edges[:, 0], minlength=len(points)), 1)
    points = points + roughness * mean[:, None] * rng.standard_normal(points.shape)
    keep = np.ones(len(triangles), bool)
    keep[rng.choice(len(triangles), holes, replace=False)] = False
    return points, triangles[keep]


def make_coil(around=28, along=420, turns=2.6):
    """A body curled up like a dragon's: a tube along a spiral, 20 mm thick at most, that ends in a thin tail; 130 mm across."""
    t = np.linspace(0, 1, along)
    angle, far = 2 * np.pi * turns * t, 0.055 - 0.03 * t
    centre = np.column_stack([far * np.cos(angle), 0.075 * t, far * np.sin(angle)])
    radius = 0.001 + 0.009 * np.minimum(1, 6 * t) * (1 - t) ** 0.7 + 0.001 * np.sin(40 * t) * t * (1 - t)
    tangent = np.gradient(centre, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    side = np.cross(tangent, [0, 1, 0])
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(side, tangent)
    turn = 2 * np.pi * np.arange(around) / around
    rings = centre[:, None] + radius[:, None, None] * (np.cos(turn)[:, None] * side[:, None] + np.sin(turn)[:, None] * up[:, None])
    points = np.vstack([rings.reshape(-1, 3), centre[:1] - 0.001 * tangent[:1], centre[-1:] + 0.001 * tangent[-1:]])
    i, j = (g.reshape(-1) for g in np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij"))
    k = (j + 1) % around
    a, b, c, d = i * around + j, i * around + k, (i + 1) * around + k, (i + 1) * around + j
    j = np.arange(around)
    k = (j + 1) % around
    first, last = np.full(around, len(points) - 2), np.full(around, len(points) - 1)
    ends = [np.column_stack([first, k, j]), np.column_stack([last, (along - 1) * around + j, (along - 1) * around + k])]
    return points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), *ends])


def make_lathe(profile, around):
    """The body of revolution around y of a profile (r, y) from pole to pole, sides anticlockwise seen from outside."""
    profile = np.asarray(profile, float)
    turn = 2 * np.pi * np.arange(around) / around
    rings = np.stack(
        [np.outer(profile[1:-1, 0], np.cos(turn)), np.repeat(profile[1:-1, 1:2], around, 1), np.outer(profile[1:-1, 0], -np.sin(turn))], -1
    )
    n = len(profile) - 2
    points = np.vstack([rings.reshape(-1, 3), [[0, profile[0, 1], 0], [0, profile[-1, 1], 0]]])
    triangles = []
    for j in range(around):
        k = (j + 1) % around
        triangles += [[n * around, k, j], [n * around + 1, (n - 1) * around + j, (n - 1) * around + k]]
        for i in range(n - 1):
            a, b, c, d = i * around + j, i * around + k, (i + 1) * around + k, (i + 1) * around + j
            triangles += [[a, b, c], [a, c, d]]
    return points, np.array(triangles)


def make_pot(around=32):
    """A pot, solid, whose foot, rim and lid end in steps of 1 to 2 mm: closed sharp edges that lie closer to each other than the elements
    of a mesh of 10,000 nodes are long."""
    belly = [[0.05 + 0.018 * np.sin(np.pi * s), 0.004 + 0.066 * s] for s in np.linspace(0, 1, 13)]
    lid = [[0.046 * np.cos(0.5 * np.pi * s), 0.073 + 0.02 * np.sin(0.5 * np.pi * s)] for s in np.linspace(0, 0.85, 8)]
    knob = [[0.009, 0.0955], [0.012, 0.1005], [0.010, 0.106], [0.004, 0.1085]]
    profile = [
        [0, 0.001],
        [0.04, 0.001],
        [0.042, 0],
        [0.046, 0],
        [0.046, 0.0015],
        *belly,
        [0.052, 0.0715],
        [0.052, 0.073],
        *lid,
        *knob,
        [0, 0.109],
    ]
    return make_lathe(profile, around)
