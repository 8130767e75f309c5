"""Meshes of bodies without a shape in carillon-mesh, by moving the nodes of a parametric mesh.

Reads and writes two formats of Gmsh (its reference manual, "MSH file format"): that of carillon-mesh, 4.1, binary, one block of nodes; and
2.2, text."""
import array
import pathlib
import struct

from errors import InputError, RunError

TET_NODES = {4: 4, 11: 10}
EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))  # of Gmsh's tetrahedron of ten nodes, in the order of its mid-side nodes


def find_section(content, name):
    place = content.find(b"\n$" + name + b"\n")
    if place < 0:
        raise RunError(4, f"the mesh has no ${name.decode()}")
    return place + len(name) + 3


class MeshFile:
    """A mesh in memory. nodes: [[x, y, z]]; tets: [(4 or 10 indices)], mid-side nodes in Gmsh's order. InputError for other formats."""

    def __init__(self, path):
        try:
            self.content = bytearray(pathlib.Path(path).read_bytes())
        except OSError as error:
            raise InputError(f"{path}: cannot read the mesh: {error.strerror}") from None
        self.lines = []
        head = bytes(self.content[:40]).split()
        if head[:3] == [b"$MeshFormat", b"2.2", b"0"]:
            self.read_text(path)
            return
        if head[:3] != [b"$MeshFormat", b"4.1", b"1"]:
            raise InputError(f"{path}: is no mesh of carillon-mesh, nor one of Gmsh 2.2 in text; save it with gmsh -format msh22")
        start = find_section(self.content, b"Nodes")
        blocks, count = struct.unpack_from("<QQ", self.content, start)
        if blocks != 1:
            raise InputError(f"{path}: has {blocks} blocks of nodes, not one as of carillon-mesh; save it with gmsh -format msh22")
        self.coordinates = start + 32 + 12 + 8 + 8 * count  # header, entity, number in the block, tags
        flat = struct.unpack_from(f"<{3 * count}d", self.content, self.coordinates)
        self.nodes = [list(flat[3 * i : 3 * i + 3]) for i in range(count)]
        self.tets = self.read_tets(find_section(self.content, b"Elements"))

    def read_text(self, path):
        self.lines = self.content.decode(errors="replace").splitlines()
        try:
            self.first = self.lines.index("$Nodes") + 2
            rows = [line.split() for line in self.lines[self.first : self.first + int(self.lines[self.first - 1])]]
            self.names = [row[0] for row in rows]
            self.nodes = [[float(x) for x in row[1:4]] for row in rows]
            place = {name: number for number, name in enumerate(self.names)}
            start = self.lines.index("$Elements") + 2
            elements = [line.split() for line in self.lines[start : start + int(self.lines[start - 1])]]
            tets = [(TET_NODES.get(int(row[1])), row) for row in elements]
            self.tets = [tuple(place[name] for name in row[-width:]) for width, row in tets if width]
        except (ValueError, IndexError, KeyError) as error:
            raise InputError(f"{path}: is no whole mesh of Gmsh 2.2: {error}; save it again") from None

    def read_tets(self, place):
        (blocks,) = struct.unpack_from("<Q", self.content, place)
        place += 32
        tets = []
        for _ in range(blocks):
            _, _, kind, count = struct.unpack_from("<iiiQ", self.content, place)
            place += 20
            width = 1 + (TET_NODES[kind] if kind in TET_NODES else 1)
            words = array.array("Q", bytes(self.content[place : place + 8 * width * count]))
            place += 8 * width * count
            if kind in TET_NODES:
                tets += [tuple(node - 1 for node in words[width * i + 1 : width * (i + 1)]) for i in range(count)]
        return tets

    def move(self, find_parameters, find_place, periods=(0.0, 0.0, 0.0)):
        """Corners from (x, y, z) to find_place(find_parameters(x, y, z)), mid-side nodes to the place of their corners' mean parameters:
        onto the true surface if a parameter is constant on it. periods: of the parameters, 0: not periodic."""
        parameters = [find_parameters(*node) for node in self.nodes]
        corners = {corner for tet in self.tets for corner in tet[:4]}
        for corner in corners:
            self.nodes[corner] = list(find_place(*parameters[corner]))
        for tet in self.tets:
            for (a, b), middle in zip(EDGES, tet[4:]):
                mean = []
                for first, second, period in zip(parameters[tet[a]], parameters[tet[b]], periods):
                    way = second - first
                    mean.append(first + (way - period * round(way / period) if period else way) / 2)
                self.nodes[middle] = list(find_place(*mean))

    def straighten(self):
        """Moves mid-side nodes to the middle of their edges."""
        for tet in self.tets:
            for (a, b), middle in zip(EDGES, tet[4:]):
                self.nodes[middle] = [(self.nodes[tet[a]][k] + self.nodes[tet[b]][k]) / 2 for k in range(3)]

    def write(self, path):
        if self.lines:
            end = self.first + len(self.nodes)
            self.lines[self.first : end] = [f"{name} {x:.17g} {y:.17g} {z:.17g}" for name, (x, y, z) in zip(self.names, self.nodes)]
            pathlib.Path(path).write_text("\n".join(self.lines) + "\n")
            return
        struct.pack_into(f"<{3 * len(self.nodes)}d", self.content, self.coordinates, *(x for node in self.nodes for x in node))
        pathlib.Path(path).write_bytes(self.content)
