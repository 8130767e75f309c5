#!/usr/bin/python3
"""Reads surface and shapes of a packed bank by the words of docs/bank-format.md alone: no line of Carillon's reader is used. Slow; for
small banks.

usage: decode.py PACKED.hdf UNPACKED.hdf     fails unless `carillon-bank unpack` finds the same
"""
import pathlib
import struct
import sys
import zlib

import numpy as np

NEIGHBOURS, MOST_OF_BUCKET, WIDEST = 10, 16, 26


def unfold(numbers):
    return (numbers >> 1) ^ -(numbers & 1)


class Reader:
    def __init__(self, data):
        self.data, self.at = data, 0

    def get(self, form):
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values[0] if len(values) == 1 else np.array(values)

    def get_block(self, size):
        length = self.get("I")
        block = zlib.decompress(self.data[self.at : self.at + length])
        self.at += length
        assert len(block) == size, (len(block), size)
        return np.frombuffer(block, np.uint8).astype(np.int64)

    def get_numbers(self, count):
        numbers = np.zeros(count, np.int64)
        for plane in range(self.get("B")):
            numbers |= self.get_block(count) << (8 * plane)
        return numbers

    def get_across(self, vertices, count):
        """(vertices, count): the first number of all vertices, the second of all ..."""
        return unfold(self.get_numbers(vertices * count)).reshape(count, vertices).T

    def finish(self):
        assert self.at == len(self.data), f"{len(self.data) - self.at} bytes are left"


class SurfaceDecoder:
    """Places and triangles in the order of the traversal."""

    def __init__(self, reader):
        form, self.levels, count, triangles, seeds = (int(x) for x in reader.get("BBIII"))
        assert form == 1
        self.origin_m, self.step_m = reader.get("ddd"), reader.get("d")
        corners = triangles + 2 * seeds
        fours = reader.get_block((corners + 3) // 4)
        self.symbols = iter(np.stack([(fours >> (2 * k)) & 3 for k in range(4)], axis=1).ravel()[:corners].tolist())
        self.others = iter(reader.get_numbers(reader.get("I")).tolist())
        self.added = unfold(reader.get_numbers(3 * count)).reshape(3, count).T
        self.level = reader.get_block(count)
        self.places, self.used = np.zeros((count, 3), np.int64), 0
        self.edges, self.oldest = [], 0  # [from, to, third corner, is open]
        self.leaving, self.entering = {}, {}
        self.triangles = np.array([self.next_triangle() for _ in range(triangles)])
        assert self.used == count and next(self.symbols, None) is None and next(self.others, None) is None

    def add_vertex(self, predicted):
        self.places[self.used] = predicted + self.added[self.used]
        self.used += 1
        return self.used - 1

    def find_other(self):
        return self.used - 1 - next(self.others)

    def next_triangle(self):
        while self.oldest < len(self.edges) and not self.edges[self.oldest][3]:
            self.oldest += 1
        if self.oldest == len(self.edges):
            triangle = [self.begin_corner() for _ in range(3)]
        else:
            a, b, c, _ = self.edges[self.oldest]
            triangle = [b, a, self.cross(a, b, c)]
        for k in range(3):
            self.pass_edge(triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3])
        return triangle

    def begin_corner(self):
        if next(self.symbols) == 0:
            return self.add_vertex(self.places[self.used - 1] if self.used > 0 else 0)
        return self.find_other()

    def cross(self, a, b, c):
        corner = next(self.symbols)
        if corner == 0:
            return self.add_vertex(self.places[a] + self.places[b] - self.places[c])
        if corner == 1:
            return self.edges[self.leaving[b][-1]][1]
        return self.edges[self.entering[a][-1]][0] if corner == 2 else self.find_other()

    def pass_edge(self, a, b, c):
        met = [edge for edge in self.leaving.get(b, []) if self.edges[edge][1] == a]
        if met:
            self.edges[met[-1]][3] = False
            self.leaving[b].remove(met[-1])
            self.entering[a].remove(met[-1])
        else:
            self.leaving.setdefault(a, []).append(len(self.edges))
            self.entering.setdefault(b, []).append(len(self.edges))
            self.edges.append([a, b, c, True])

    def sort(self):
        """Places, triangles and levels with vertices in the order of the file."""
        shift, places = 0, self.places - self.places.min(axis=0)
        while places.max() >> shift >= 1 << 19:
            shift += 1
        key = sum((((places[:, c] >> shift) >> bit) & 1) << (3 * bit + c) for c in range(3) for bit in range(19))
        order = np.lexsort((np.arange(self.used), key, self.level))
        moved = np.argsort(order)
        return self.places[order], moved[self.triangles], self.level[order]


def restore_order(reader, triangles):
    count = len(triangles)
    number, first = np.cumsum(unfold(reader.get_numbers(count))), reader.get_block(count)
    reader.finish()
    before = np.empty_like(triangles)
    before[number] = np.stack([triangles[np.arange(count), (k + first) % 3] for k in range(3)], axis=1)
    return before


def mix(cell):
    """runtime/bank/packed/neighbours.cpp."""
    x, y, z = (int(value) & 0xFFFFFFFF for value in cell)
    value = (x * 0x9E3779B1) & 0xFFFFFFFF
    value = ((value ^ (value >> 15) ^ y) * 0x85EBCA77) & 0xFFFFFFFF
    value = ((value ^ (value >> 13) ^ z) * 0xC2B2AE3D) & 0xFFFFFFFF
    return value ^ (value >> 16)


class Search:
    def __init__(self, known, shift):
        self.known, self.shift, self.grids = known, shift, {}
        self.last = (1 << (len(known) - 1).bit_length()) - 1

    def find(self, place):
        for shift in range(self.shift, WIDEST + 1):
            if shift not in self.grids:
                cells, buckets = self.known >> shift, {}
                for v, cell in enumerate(cells):
                    buckets.setdefault(mix(cell) & self.last, []).append(v)
                self.grids[shift] = (cells, buckets)
            cells, buckets = self.grids[shift]
            low, near = (place - ((1 << shift) >> 1)) >> shift, []
            for k in range(8):
                cell = low + np.array([k & 1, k >> 1 & 1, k >> 2])
                near += [v for v in buckets.get(mix(cell) & self.last, [])[:MOST_OF_BUCKET] if (cells[v] == cell).all()]
            if len(near) >= NEIGHBOURS:
                squares = (((self.known[near] - place) >> max(shift - 10, 0)) ** 2).sum(axis=1)
                return np.array(near)[np.argsort(squares, kind="stable")[:NEIGHBOURS]]
        return np.arange(NEIGHBOURS)


def calc_stencil(offsets):
    """Weights of value (K) and gradient (3, K), and offsets in units of their mean distance."""
    x = offsets / np.linalg.norm(offsets, axis=1).mean()
    covariance = 1 / (1 + 0.09 * ((x[:, None] - x[None]) ** 2).sum(axis=-1)) + 100 * (1 + x @ x.T) + 1e-4 * np.eye(NEIGHBOURS)
    at_vertex = 1 / (1 + 0.09 * (x**2).sum(axis=1))
    slopes = (0.18 * at_vertex**2 + 100)[:, None] * x
    return np.linalg.solve(covariance, at_vertex + 100), np.linalg.solve(covariance, slopes).T, x


def read_residuals(reader, vertices, count):
    if reader.get("B") == 0:
        return reader.get_across(vertices, count)
    counts, total = reader.get_numbers(vertices), reader.get("I")
    gaps, values = reader.get_numbers(total), unfold(reader.get_numbers(total))
    rows, i = np.zeros((vertices, count)), 0
    for row, own in zip(rows, counts):
        places = np.cumsum(gaps[i : i + own] + 1) - 1
        row[places] = values[i : i + own]
        i += own
    return rows


def read_shapes(reader, places, level, scale):
    form, modes, levels = (int(x) for x in reader.get("BIB"))
    assert form == 1 and modes == len(scale) and levels == level.max() + 1
    step = np.array([reader.get("f") for _ in range(modes)])
    x = np.zeros((len(places), 3, modes))
    for number in range(levels):
        first, end = np.searchsorted(level, [number, number + 1])
        r, g, d = reader.get("fff")
        search = Search(places[:first], reader.get("B")) if number > 0 else reader.get("B") and None
        kinds = reader.get_block(end - first)
        fits, has_residual, shares = kinds & 3, (kinds & 4) != 0, 2.0 ** (-0.5 * (kinds >> 3))
        gradients = iter(reader.get_across(int((fits > 0).sum()), 27))
        differences = iter(reader.get_across(int((fits == 2).sum()), 90))
        residuals = iter(read_residuals(reader, int(has_residual.sum()), 3 * modes))
        for v in range(first, end):
            fit, share = fits[v - first], shares[v - first]
            if number > 0:
                neighbours = search.find(places[v])
                of_value, of_gradient, offset = calc_stencil((places[neighbours] - places[v]).astype(float))
                rows = x[neighbours]
                value, gradient = np.einsum("k,kcm->cm", of_value, rows), np.einsum("jk,kcm->jcm", of_gradient, rows)
                unit = share / np.sqrt(1 + (rows**2).sum(axis=(1, 2)).mean())
                x[v] = value
                if fit > 0:
                    x[v] += np.einsum("jtf,jfm->tm", next(gradients).reshape(3, 3, 3) * g * unit, gradient)
                if fit == 2:
                    left = rows - value - np.einsum("kj,jcm->kcm", offset, gradient)
                    x[v] += np.einsum("ktf,kfm->tm", next(differences).reshape(NEIGHBOURS, 3, 3) * d * unit, left)
            if has_residual[v - first]:
                x[v] += share * r * next(residuals).reshape(modes, 3).T
    reader.finish()
    return np.clip(np.rint(x * (step / scale)), -32767, 32767).transpose(0, 2, 1)


def compare(packed_file, unpacked_file):
    """(vertices, share of the integers of shapes that differ, and by how much at most) from what `carillon-bank unpack` wrote."""
    import h5py

    with h5py.File(packed_file) as packed, h5py.File(unpacked_file) as unpacked:
        reader = Reader(packed["mesh/packed"][:].tobytes())
        surface = SurfaceDecoder(reader)
        reader.finish()
        places, triangles, level = surface.sort()
        if "mesh/packed_order" in packed:
            triangles = restore_order(Reader(packed["mesh/packed_order"][:].tobytes()), triangles)
        assert (triangles == unpacked["mesh/triangles"][:]).all(), "triangles differ"
        assert (surface.origin_m + surface.step_m * places == unpacked["mesh/vertices"][:]).all(), "vertices differ"
        shape = read_shapes(Reader(packed["modes/packed_shape"][:].tobytes()), places, level, packed["modes/shape_scale"][:])
        differences = np.abs(shape - unpacked["modes/shape"][:])
        return len(places), float((differences > 0).mean()), float(differences.max())


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    vertices, share, most = compare(*map(pathlib.Path, sys.argv[1:]))
    print(f"{vertices} vertices: {100 * share:.3f} % of the integers of shapes differ, by {most:.0f} at most")
    sys.exit(0 if most <= 1 and share < 0.01 else 1)


if __name__ == "__main__":
    main()
