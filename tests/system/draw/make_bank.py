"""Small mode banks without a solver, written with h5py after docs/bank-format.md: enough for pictures."""
import hashlib

import h5py
import numpy


def make_sphere(rings=24, sectors=36, radius=0.05):
    """Vertices and outward triangles of a sphere."""
    polar = numpy.pi * numpy.arange(1, rings) / rings
    around = 2 * numpy.pi * numpy.arange(sectors) / sectors
    p, a = numpy.meshgrid(polar, around, indexing="ij")
    points = numpy.stack([numpy.sin(p) * numpy.cos(a), numpy.sin(p) * numpy.sin(a), numpy.cos(p)], axis=-1).reshape(-1, 3)
    points = numpy.vstack([points, [[0, 0, 1], [0, 0, -1]]]) * radius
    top, bottom = len(points) - 2, len(points) - 1
    triangles = []
    for s in range(sectors):
        t = (s + 1) % sectors
        triangles.append((top, s, t))
        last = (rings - 2) * sectors
        triangles.append((bottom, last + t, last + s))
        for r in range(rings - 2):
            a0, b0, a1, b1 = r * sectors + s, r * sectors + t, (r + 1) * sectors + s, (r + 1) * sectors + t
            triangles += [(a0, a1, b1), (a0, b1, b0)]
    return points, numpy.array(triangles, dtype=numpy.int32)


def make_box(edges, cells=12):
    """Vertices and outward triangles of a box whose faces are grids."""
    points, triangles = [], []
    grid = numpy.linspace(-0.5, 0.5, cells + 1)
    for axis in range(3):
        for side in (-1, 1):
            u, v = numpy.meshgrid(grid, grid, indexing="ij")
            face = numpy.zeros((cells + 1, cells + 1, 3))
            face[..., axis] = 0.5 * side
            face[..., (axis + 1) % 3], face[..., (axis + 2) % 3] = u, v
            first = len(points)
            points.extend(face.reshape(-1, 3))
            for i in range(cells):
                for j in range(cells):
                    a, b = first + i * (cells + 1) + j, first + (i + 1) * (cells + 1) + j
                    quad = [(a, b, b + 1), (a, b + 1, a + 1)]
                    triangles += quad if side > 0 else [(p, r, q) for p, q, r in quad]
    points = numpy.array(points)
    places, merged = numpy.unique(numpy.round(points, 9), axis=0, return_inverse=True)
    return places * numpy.array(edges), merged.reshape(-1)[numpy.array(triangles)].astype(numpy.int32)


def write_bank(path, vertices, triangles, freq_hz, shapes):
    """shapes: (V, m, 3)."""
    scale = numpy.abs(shapes).max(axis=(0, 2)) / 32767
    with h5py.File(path, "w", userblock_size=4096) as bank:
        bank.attrs["version"] = "1.0"
        bank["mesh/vertices"] = numpy.asarray(vertices, dtype="<f8")
        bank["mesh/triangles"] = numpy.asarray(triangles, dtype="<i4")
        bank["modes/frequency_hz"] = numpy.asarray(freq_hz, dtype="<f8")
        bank["modes/shape_scale"] = scale
        bank["modes/shape"] = numpy.rint(shapes / scale[:, None]).astype("<i2")
        bank["rigid/centre_m"] = numpy.asarray(vertices).mean(axis=0)
        bank["solve/element"] = numpy.bytes_("T10")
        bank["solve/nodes"] = numpy.int64(12345)
    seal(path)


def seal(path):
    with open(path, "r+b") as file:
        rest = file.read()[4096:]
        text = f"CARILLON BANK 1.0\nlength {4096 + len(rest)}\n".encode().ljust(4032, b"\n")
        file.seek(0)
        file.write(text + hashlib.sha256(text + rest).hexdigest().encode())


def write_ball_bank(path, modes=4):
    vertices, triangles = make_sphere()
    x, y, z = (vertices / 0.05).T
    fields = [(x, -y, 0 * z), (y, x, 0 * z), (-x, -y, 2 * z), (x * (x * x - 3 * y * y), 0 * y, z)][:modes]
    shapes = numpy.stack([numpy.stack(field, axis=-1) for field in fields], axis=1)
    write_bank(path, vertices, triangles, [6937.2, 6937.2, 7349.3, 10500.0][:modes], shapes)


def write_box_bank(path, edges):
    vertices, triangles = make_box(edges)
    x, y, _ = (2 * vertices / numpy.array(edges)).T
    zero = 0 * x
    shapes = numpy.stack([numpy.stack([zero, zero, x * y], axis=-1), numpy.stack([zero, zero, x * x - 0.4], axis=-1)], axis=1)
    write_bank(path, vertices, triangles, [312.5, 570.0], shapes)
