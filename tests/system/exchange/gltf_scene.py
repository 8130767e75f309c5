"""Small scenes in glTF with the extensions of rigid bodies, their sound and their shapes, and what they mean, by numpy alone."""
import base64
import json
import struct

import numpy

AUDIO, PHYSICS, SHAPES = "KHR_audio_rigid_bodies", "KHR_physics_rigid_bodies", "KHR_implicit_shapes"
DENSITY = 2700.0
RAISE = numpy.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # y up to z up


def make_grid_box(size, cells=3):
    """Points (P, 3) and triangles (T, 3), outward, of a box about the origin."""
    points, triangles = {}, []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cells):
            for i in range(cells):
                for j in range(cells):
                    corners = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        at = [0, 0, 0]
                        at[axis], at[u], at[v] = side, i + di, j + dj
                        corners.append(points.setdefault(tuple(at), len(points)))
                    if side == 0:
                        corners.reverse()
                    triangles += [corners[:3], [corners[0], *corners[2:]]]
    return (numpy.array(list(points)) / cells - 0.5) * size, numpy.array(triangles)


def make_ball(radius, divisions=2):
    """The same of a sphere."""
    points, triangles = make_grid_box(numpy.ones(3), 2**divisions)
    return radius * points / numpy.linalg.norm(points, axis=1)[:, None], triangles


def calc_solid(points, triangles):
    """Volume, centre, and inertia about it at unit density."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    part = (a * numpy.cross(b, c)).sum(axis=1) / 6
    volume = part.sum()
    total = a + b + c
    centre = (part[:, None] * total).sum(axis=0) / 4 / volume
    second = sum((part[:, None, None] * x[:, :, None] * x[:, None, :]).sum(axis=0) for x in (a, b, c, total)) / 20
    about = second - volume * numpy.outer(centre, centre)
    return volume, centre, numpy.trace(about) * numpy.eye(3) - about


def make_rotation(q):
    x, y, z, w = numpy.array(q) / numpy.linalg.norm(q)
    return numpy.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


class Scene:
    """A scene under construction; add_... returns an index."""

    def __init__(self):
        self.buffer = b""
        self.json = {
            "asset": {"version": "2.0", "generator": "Carillon's tests"},
            "extensionsUsed": [AUDIO, PHYSICS, SHAPES],
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
            "bufferViews": [],
            "accessors": [],
            "extensions": {
                SHAPES: {"shapes": []},
                PHYSICS: {"physicsMaterials": []},
                AUDIO: {
                    "acousticMaterials": [
                        {"density": DENSITY, "youngsModulus": 7.2e10, "poissonRatio": 0.19, "alpha": 6.0, "beta": 1e-7},
                        {"density": 7850.0, "youngsModulus": 2e11, "poissonRatio": 0.29},
                    ],
                    "acousticSurfaces": [{"roughness": 3e-6, "material": 0}, {"roughness": 1e-5, "material": 1}],
                    "modalModels": [],
                },
            },
        }

    def add_accessor(self, values, kind):
        data = numpy.ascontiguousarray(values).tobytes()
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data)})
        self.buffer += data + bytes(-len(data) % 4)
        flat = values.reshape(len(values), -1)
        component = {"float32": 5126, "uint16": 5123}[str(values.dtype)]
        self.json["accessors"].append(
            {
                "bufferView": len(self.json["bufferViews"]) - 1,
                "componentType": component,
                "count": len(flat),
                "type": kind,
                "min": [float(x) for x in flat.min(axis=0)],
                "max": [float(x) for x in flat.max(axis=0)],
            }
        )
        return len(self.json["accessors"]) - 1

    def add_model(self, points, triangles, freq_hz, mass_kg=None, decay=None, inertia=None, **keys):
        """A model with smooth shapes; decays by the law of material 0, or given. `mass_kg`: of massProperties."""
        freq = numpy.array(freq_hz, dtype="f4")
        if decay is None:  # d = (alpha + beta omega^2) / 2, omega undamped
            omega2 = (2 * numpy.pi * freq.astype(float)) ** 2
            decay = 3 + 0.5e-7 * omega2
            for _ in range(20):
                decay = (6 + 1e-7 * (omega2 + decay**2)) / 2
        shapes = [numpy.cos((m + 2) * 20 * points[:, [1, 2, 0]]) + 0.1 * m for m in range(len(freq))]
        model = {
            "frequencies": self.add_accessor(freq, "SCALAR"),
            "decayRates": self.add_accessor(numpy.array(decay, dtype="f4"), "SCALAR"),
            "positions": self.add_accessor(points.astype("f4"), "VEC3"),
            "shapes": self.add_accessor(numpy.concatenate(shapes).astype("f4"), "VEC3"),
            "indices": self.add_accessor(triangles.astype("u2").ravel(), "SCALAR"),
            "material": 0,
            **keys,
        }
        if mass_kg is not None:
            model["massProperties"] = {"mass": mass_kg}
            if inertia is not None:
                model["massProperties"]["inertiaDiagonal"] = inertia
        models = self.json["extensions"][AUDIO]["modalModels"]
        models.append(model)
        return len(models) - 1

    def add_shape(self, kind, **sizes):
        shapes = self.json["extensions"][SHAPES]["shapes"]
        shapes.append({"type": kind, kind: sizes})
        return len(shapes) - 1

    def add_physics_material(self, **keys):
        materials = self.json["extensions"][PHYSICS]["physicsMaterials"]
        materials.append(keys)
        return len(materials) - 1

    def add_node(self, parent=None, audio=None, motion=None, shape=None, geometry=None, material=None, **keys):
        node, extensions = dict(keys), {}
        if audio is not None:
            extensions[AUDIO] = audio
        physics = {} if motion is None else {"motion": motion}
        if shape is not None or geometry is not None:
            physics["collider"] = {"geometry": geometry or {"shape": shape}}
            if material is not None:
                physics["collider"]["physicsMaterial"] = material
        if physics:
            extensions[PHYSICS] = physics
        if extensions:
            node["extensions"] = extensions
        nodes = self.json["nodes"]
        nodes.append(node)
        if parent is None:
            self.json["scenes"][0]["nodes"].append(len(nodes) - 1)
        else:
            nodes[parent].setdefault("children", []).append(len(nodes) - 1)
        return len(nodes) - 1

    def finish(self, uri=None):
        """The JSON, without empty parts."""
        root = json.loads(json.dumps(self.json))
        if self.buffer:
            root["buffers"] = [{"byteLength": len(self.buffer), **({"uri": uri} if uri else {})}]
        for key in ("bufferViews", "accessors"):
            if not root[key]:
                del root[key]
        for name, own in list(root["extensions"].items()):
            root["extensions"][name] = {key: value for key, value in own.items() if value}
            if not root["extensions"][name]:
                del root["extensions"][name]
        return root

    def write(self, file, external=False):
        """.glb; .gltf with a data URI, or with a .bin file next to it."""
        if file.suffix == ".glb":
            text = json.dumps(self.finish()).encode()
            text += b" " * (-len(text) % 4)
            binary = self.buffer + bytes(-len(self.buffer) % 4)
            chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
            file.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        elif external:
            file.with_suffix(".bin").write_bytes(self.buffer)
            file.write_text(json.dumps(self.finish(file.stem + ".bin")))
        else:
            uri = "data:application/octet-stream;base64," + base64.b64encode(self.buffer).decode()
            file.write_text(json.dumps(self.finish(uri), indent=1))
        return file

    def calc_global(self, number):
        """(4, 4) of a node, by its parents."""
        node = self.json["nodes"][number]
        if "matrix" in node:
            own = numpy.array(node["matrix"], dtype=float).reshape(4, 4).T
        else:
            own = numpy.eye(4)
            own[:3, :3] = make_rotation(node.get("rotation", [0, 0, 0, 1])) * numpy.array(node.get("scale", [1, 1, 1]))
            own[:3, 3] = node.get("translation", [0, 0, 0])
        for parent, other in enumerate(self.json["nodes"]):
            if number in other.get("children", []):
                return self.calc_global(parent) @ own
        return own

    def place(self, number, points):
        """Points of a node in the world with z up."""
        matrix = self.calc_global(number)
        return (points @ matrix[:3, :3].T + matrix[:3, 3]) @ RAISE.T
