#!/usr/bin/python3
"""carillon-bank export to GLB and import, from outside: the file against the bank by readers that share nothing with Carillon (Python, and
Assimp for the mesh), the schema of KHR_audio_rigid_bodies, and the sound of what comes back.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import pathlib
import struct
import tempfile
import unittest

import h5py
import numpy

from banks import BIN, calc_db, fixtures, render_blow, run

TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


class Glb:
    """A GLB file read by its specification; asserts what that says of headers, chunks, views and accessors."""

    def __init__(self, data):
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON" and size % 4 == 0
        self.json = json.loads(data[20 : 20 + size])
        at = 20 + size
        size, kind = struct.unpack_from("<I4s", data, at)
        assert kind == b"BIN\0" and size % 4 == 0 and at + 8 + size == len(data)
        self.binary = data[at + 8 :]
        length = self.json["buffers"][0]["byteLength"]
        assert len(self.binary) - 3 <= length <= len(self.binary)
        for view in self.json["bufferViews"]:
            assert view["buffer"] == 0 and view["byteLength"] >= 1 and view["byteOffset"] + view["byteLength"] <= length
        for index in range(len(self.json["accessors"])):
            self.read(index)

    def read(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        kind, width = numpy.dtype(TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        assert view["byteOffset"] % kind.itemsize == 0 and accessor["count"] * width * kind.itemsize <= view["byteLength"]
        values = numpy.frombuffer(self.binary, kind, accessor["count"] * width, view["byteOffset"])
        return values.reshape(-1, width) if width > 1 else values


class GlbTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.bank = fixtures.copy("glass_bowl.hdf", cls.folder, "bowl.hdf")
        cls.out = run(BIN / "carillon-bank", "export", cls.bank, "-o", "bowl.glb", "--up", "z", cwd=cls.folder).stdout
        cls.glb = Glb((cls.folder / "bowl.glb").read_bytes())
        with h5py.File(cls.bank) as bank:
            cls.vertices, cls.triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
            cls.freq_hz, cls.decay = bank["modes/corrected_frequency_hz"][:], bank["modes/corrected_decay"][:]
            cls.shape = bank["modes/shape"][:] * bank["modes/shape_scale"][:][None, :, None]
            cls.rigid = {key: bank["rigid"][key][()] for key in bank["rigid"]}
            cls.material = {key: bank["material"][key][()] for key in ("young_modulus_pa", "poisson_ratio", "density_kg_m3")}

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_the_mesh_is_the_surface_of_the_bank(self):
        root = self.glb.json
        self.assertEqual(root["asset"]["version"], "2.0")
        (primitive,) = root["meshes"][0]["primitives"]
        positions, normals = (self.glb.read(primitive["attributes"][key]) for key in ("POSITION", "NORMAL"))
        self.assertTrue(numpy.array_equal(positions, self.vertices.astype("f4")))
        self.assertTrue(numpy.array_equal(self.glb.read(primitive["indices"]).reshape(-1, 3), self.triangles))
        accessor = root["accessors"][primitive["attributes"]["POSITION"]]
        self.assertTrue(numpy.array_equal(numpy.float32(accessor["min"]), positions.min(axis=0)))
        self.assertTrue(numpy.array_equal(numpy.float32(accessor["max"]), positions.max(axis=0)))
        self.assertLess(abs(numpy.linalg.norm(normals, axis=1) - 1).max(), 1e-6)
        # Outward: along the sum of the triangles' own.
        own = numpy.zeros_like(self.vertices)
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        for k in range(3):
            numpy.add.at(own, self.triangles[:, k], numpy.cross(b - a, c - a))
        self.assertGreater((own * normals).sum(axis=1).min(), 0)
        # z of the body is y of glTF.
        x, y, z, w = root["nodes"][0]["rotation"]
        self.assertTrue(numpy.allclose([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], [0, 1, 0]))

    def test_assimp_reads_the_same_mesh(self):
        answer = run("assimp", "info", "bowl.glb", cwd=self.folder).stdout
        numbers = {
            line.split(":")[0].strip(): line.split(":")[1].split()[0]
            for line in answer.splitlines()
            if ":" in line and line.split(":")[1].split()
        }
        self.assertEqual(int(numbers["Faces"]), len(self.triangles))
        self.assertEqual(int(numbers["Vertices"]), len(self.vertices))

    def test_the_modes_are_those_of_the_bank(self):
        root = self.glb.json
        self.assertEqual(root["extensionsUsed"], ["KHR_audio_rigid_bodies"])
        self.assertNotIn("extensionsRequired", root)
        self.assertEqual(root["nodes"][0]["extensions"], {"KHR_audio_rigid_bodies": {"modalModel": 0}})
        (model,) = root["extensions"]["KHR_audio_rigid_bodies"]["modalModels"]
        self.assertLessEqual({"frequencies", "decayRates", "positions", "shapes", "indices", "material", "massProperties"}, set(model))
        kinds = {key: root["accessors"][model[key]] for key in ("frequencies", "decayRates", "positions", "shapes", "indices")}
        self.assertEqual(
            {key: kind["type"] for key, kind in kinds.items()},
            {"frequencies": "SCALAR", "decayRates": "SCALAR", "positions": "VEC3", "shapes": "VEC3", "indices": "SCALAR"},
        )
        self.assertIn(kinds["indices"]["componentType"], (5123, 5125))
        modes = model["extras"]["carillon"]["modes"]
        self.assertEqual(sorted(modes), list(range(len(self.freq_hz))))
        omega = 2 * numpy.pi * self.freq_hz[modes]
        damped = numpy.sqrt(omega**2 - self.decay[modes] ** 2) / (2 * numpy.pi)
        self.assertLess(abs(self.glb.read(model["frequencies"]) / damped - 1).max(), 1e-7)
        self.assertLess(abs(self.glb.read(model["decayRates"]) / self.decay[modes] - 1).max(), 1e-7)
        shapes = self.glb.read(model["shapes"]).reshape(len(modes), -1, 3)
        self.assertLess(abs(shapes - self.shape[:, modes].swapaxes(0, 1)).max() / abs(self.shape).max(), 1e-7)
        material = root["extensions"]["KHR_audio_rigid_bodies"]["acousticMaterials"][model["material"]]
        for key, own in (("youngsModulus", "young_modulus_pa"), ("poissonRatio", "poisson_ratio"), ("density", "density_kg_m3")):
            self.assertEqual(material[key], self.material[own])

    def test_the_mass_properties_are_those_of_the_bank(self):
        mass = self.glb.json["extensions"]["KHR_audio_rigid_bodies"]["modalModels"][0]["massProperties"]
        self.assertEqual(mass["mass"], self.rigid["mass_kg"])
        self.assertTrue(numpy.array_equal(mass["centerOfMass"], self.rigid["centre_m"]))
        x, y, z, w = mass["inertiaOrientation"]
        turn = numpy.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        inertia = turn @ numpy.diag(mass["inertiaDiagonal"]) @ turn.T
        self.assertLess(abs(inertia - self.rigid["inertia_kg_m2"]).max(), 1e-12)

    def test_what_comes_back_sounds_the_same(self):
        bank_tool = BIN / "carillon-bank"
        run(bank_tool, "import", "bowl.glb", "-o", "same.hdf", cwd=self.folder)
        run(bank_tool, "import", "--plain", "bowl.glb", "-o", "plain.hdf", cwd=self.folder)
        run(bank_tool, "check", "same.hdf", cwd=self.folder)
        run(bank_tool, "check", "plain.hdf", cwd=self.folder)
        point = self.vertices[numpy.argmax(self.vertices[:, 0])]
        sounds = [
            render_blow(self.folder, self.folder / name, point, (-1e-3, 0, 0), self.rigid["centre_m"])
            for name in ("bowl.hdf", "same.hdf", "plain.hdf")
        ]
        self.assertGreater(abs(sounds[0]).max(), 1e-4)
        self.assertTrue(numpy.array_equal(sounds[0], sounds[1]))
        # Frequencies of 24 bits: phases of 10 kHz differ by 2 pi 1e4 6e-8 after a second.
        self.assertLess(calc_db(sounds[2] - sounds[0], sounds[0]), -45)

    def test_fewer_modes_make_a_smaller_file(self):
        out = run(BIN / "carillon-bank", "export", self.bank, "-o", "few.glb", "--modes", "10", cwd=self.folder).stdout
        self.assertIn(f"10 of {len(self.freq_hz)} modes", out)
        self.assertLess((self.folder / "few.glb").stat().st_size, (self.folder / "bowl.glb").stat().st_size / 2)

    def test_mistakes_end_in_a_sentence(self):
        for words, said in (
            (["export", self.bank, "-o", "bowl.obj"], "rename the output, or give --format"),
            (["export", self.bank, "-o", "x.glb", "--points", "3"], "--points is for Faust"),
            (["export", "none.hdf", "-o", "x.glb"], "no such file"),
            (["import", self.bank, "-o", "x.hdf"], "not a GLB file"),
            (["import", "bowl.glb", "-o", "x.wav"], "a bank is an HDF5 file"),
            (["import", "bowl.glb", "-o", "bowl.glb"], "bowl.glb"),
        ):
            done = run(BIN / "carillon-bank", *words, cwd=self.folder, code=2)
            self.assertIn(said, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertFalse((self.folder / "x.glb").exists() or (self.folder / "x.hdf").exists())


if __name__ == "__main__":
    unittest.main()
