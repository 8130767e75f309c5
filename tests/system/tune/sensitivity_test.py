#!/usr/bin/python3
"""carillon sensitivity against new solves of a thinner bar and of other materials, and its files.

usage: sensitivity_test.py BIN_DIR
"""
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import surfaces

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
STEEL = {"young_modulus_pa": 2e11, "poisson_ratio": 0.29, "density_kg_m3": 7850, "damping": {"internal_friction": {"tan_phi": 2e-4}}}
WOOD = {
    "orthotropic": {
        "young_modulus_pa": [11e9, 0.9e9, 0.5e9],
        "shear_modulus_pa": [0.7e9, 0.04e9, 0.75e9],
        "poisson_ratio": [0.4, 0.45, 0.4],
    },
    "density_kg_m3": 430,
    "damping": {"internal_friction": {"tan_phi": 8e-3}},
}
BAR = {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 4000}


class Sensitivity(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="carillon-sensitivity-")
        cls.folder = pathlib.Path(cls.scratch.name)
        cls.solve("bar", sensitivities=20)
        cls.solve("wood", BAR, WOOD, sensitivities=8, band_hz=[20, 6000])

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @classmethod
    def solve(cls, name, body=BAR, material=STEEL, **more):
        """Frequencies of the mesh."""
        job = {"body": body, "material": material, "band_hz": [20, 15000], "bank": f"{name}.hdf"} | more
        (cls.folder / f"{name}.json").write_text(json.dumps(job))
        subprocess.run([BIN / "carillon-precompute", "-q", f"{name}.json"], cwd=cls.folder, check=True, stderr=subprocess.DEVNULL)
        with h5py.File(cls.folder / f"{name}.hdf") as bank:
            return bank["modes/frequency_hz"][:]

    def run_command(self, *words, code=0):
        done = subprocess.run([BIN / "carillon", "sensitivity", *map(str, words)], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout if code == 0 else done.stderr

    def ask(self, *words):
        return json.loads(self.run_command(*words, "--json"))["modes"]

    def compare(self, stated, above, below, step, median=0.01, worst=0.05):
        """stated: d ln f / d parameter; above, below: frequencies at the parameter +- step."""
        error = self.find_error(stated, above, below, step)
        self.assertLess(numpy.median(error), median)
        self.assertLess(error.max(), worst)

    def find_error(self, stated, above, below, step):
        """Relative to a mode's own derivative, or to 5 % of the largest."""
        true = numpy.log(above / below) / (2 * step)
        return numpy.abs(numpy.array(stated) - true) / numpy.maximum(numpy.abs(true), 0.05 * numpy.abs(true).max())

    def test_constants_and_thickness_are_those_of_new_solves(self):
        modes = self.ask("bar.hdf")
        thick, thin = (self.solve("moved", BAR | {"thickness_m": 0.012 * share}) for share in (1.005, 0.995))
        self.compare([mode["thickness"] for mode in modes], thick[: len(modes)], thin[: len(modes)], 0.005)
        high, low = (self.solve("moved", material=STEEL | {"poisson_ratio": nu}) for nu in (0.295, 0.285))
        self.compare([mode["poisson_ratio"] for mode in modes], high[: len(modes)], low[: len(modes)], 0.005, 1e-3, 1e-2)
        for mode in modes:
            self.assertEqual((mode["young_modulus"], mode["density"], mode["size"]), (0.5, -0.5, -1.0))

    def test_moved_and_turned_bodies_keep_their_frequencies_and_enlarged_ones_fall(self):
        # d ln f is 0 for a translation and a rotation of the surface and -1 per d ln size, for any body: here random hexahedra.
        for seed, material, bound in ((1, STEEL, 0.02), (2, STEEL, 0.02), (3, WOOD, 0.06)):
            place, change = self.read_motions(seed, material)
            size = numpy.ptp(place, axis=0).max()
            numpy.testing.assert_allclose(change(place), -1.0, atol=bound)
            for axis in numpy.eye(3):
                numpy.testing.assert_allclose(change(size * axis), 0.0, atol=bound)
                if material is STEEL:  # turning the surface of wood turns it against the grain
                    numpy.testing.assert_allclose(change(numpy.cross(axis, place)), 0.0, atol=bound)

    def read_motions(self, seed, material):
        """Sites (S, 3) [m] about their mean of a random convex hexahedron; function from motions of the sites [m] to changes of ln f."""
        random = numpy.random.default_rng(seed)
        points, triangles = surfaces.make_box(0.1, 0.06, 0.03)
        points = points @ (numpy.eye(3) + random.uniform(-0.3, 0.3, (3, 3)))
        points /= 1.0 + (points @ random.uniform(-3.0, 3.0, 3))[:, None]  # a projection keeps planes
        (self.folder / "random.off").write_text(surfaces.format_off([tuple(point) for point in points.tolist()], triangles))
        body = {"surface": "random.off", "facets": True, "nodes": 10000}
        self.solve("random", body, material, sensitivities=10, shapes="exact", max_modes=10, band_hz=[20, 60000])
        with h5py.File(self.folder / "random.hdf") as bank:
            group = bank["sensitivity"]
            place = bank["mesh/vertices"][:][group["vertex"][:]]
            inward = -group["normal"][:] * group["area_m2"][:][:, None]
            density = group["density"][:, : len(group["by_parameter"])] * group["scale"][: len(group["by_parameter"])]
        self.assertEqual(density.shape[1], 10)
        return place - place.mean(axis=0), lambda motion: math.log(2) / 1200 * 1e3 * density.T @ (inward * motion).sum(axis=1)

    def test_moduli_of_wood_are_those_of_new_solves(self):
        modes = self.ask("wood.hdf")
        for key, place, name in (("young_modulus_pa", 0, "young_modulus_pa.1"), ("shear_modulus_pa", 0, "shear_modulus_pa.12")):
            ends = []
            for share in (1.01, 0.99):
                values = list(WOOD["orthotropic"][key])
                values[place] *= share
                changed = WOOD | {"orthotropic": WOOD["orthotropic"] | {key: values}}
                ends.append(self.solve("moved", material=changed, band_hz=[20, 6000])[: len(modes)])
            self.compare([mode[name] for mode in modes], *ends, 0.01, 1e-3, 1e-2)

    def test_files_hold_the_densities(self):
        self.run_command("bar.hdf", "-o", "map.csv", "-o", "map.glb", "-o", "map.png", "--mode", "2")
        table = numpy.genfromtxt(self.folder / "map.csv", delimiter=",", names=True)
        with h5py.File(self.folder / "bar.hdf") as bank:
            group = bank["sensitivity"]
            count = len(group["by_parameter"])
            density = group["density"][:, :count] * group["scale"][:count]
            triangles = len(bank["mesh/triangles"])
        self.assertEqual(len(table), len(density))
        numpy.testing.assert_allclose(table["mode_2_cent_per_mm_m2"], density[:, 1], rtol=1e-4, atol=1e-6 * numpy.abs(density).max())
        sides = 2 * (0.3 * 0.03 + 0.3 * 0.012 + 0.03 * 0.012)
        self.assertAlmostEqual(table["area_m2"].sum(), sides, delta=1e-6 * sides)
        data = (self.folder / "map.glb").read_bytes()
        magic, version, length, size, kind = struct.unpack("<4sIII4s", data[:20])
        self.assertEqual((magic, version, length, kind), (b"glTF", 2, len(data), b"JSON"))
        root = json.loads(data[20 : 20 + size])
        self.assertEqual([one["count"] for one in root["accessors"]], [len(density)] * 3 + [3 * triangles])
        self.assertEqual((self.folder / "map.png").read_bytes()[:4], b"\x89PNG")

    def test_a_mesh_with_one_element_across_is_warned_of(self):
        """Where the warning is missing, changes are right; the modes it names are wrong by more than those."""
        body = {"shape": "bar", "length_m": 0.3, "width_m": 0.014, "thickness_m": 0.01}
        for name, mesh, warned in (("coarse", {"nodes": 400}, True), ("fine", {"nodes": 8000}, False)):
            moved = [self.solve("moved", body | mesh | {"thickness_m": 0.01 * share}, max_modes=6)[:6] for share in (1.005, 0.995)]
            self.solve(name, body | mesh, max_modes=8, sensitivities=6)
            document = json.loads(self.run_command(f"{name}.hdf", "--json"))
            error = self.find_error([mode["thickness"] for mode in document["modes"]][:6], *moved, 0.005)
            self.assertEqual(any("accuracy_cents" in note for note in document["notes"]), warned, document["notes"])
            self.assertEqual(error.max() > 0.05, warned, error)

    def test_a_spot_changes_modes_where_they_move_or_bend(self):
        # In the middle the first bending mode bends most: less material lowers it; at the end it only moves: less raises it.
        middle, end = (self.ask("bar.hdf", "--at", f"{x},0,0.006", "--radius", "14mm")[0]["cents"] for x in self.find_middle_and_end())
        self.assertLess(middle, -0.05)
        self.assertGreater(end, 0.05)

    def find_middle_and_end(self):
        with h5py.File(self.folder / "bar.hdf") as bank:
            along = bank["mesh/vertices"][:, 0]
        return 0.5 * (along.min() + along.max()), along.max()

    def test_bad_input_is_one_clear_error(self):
        self.solve("plain")
        for words, expected in (
            (("plain.hdf",), '"sensitivities": 30'),
            (("none.hdf",), "no such file"),
            (("bar.hdf", "-o", "map.txt"), "give a .csv, .png or .glb"),
            (("bar.hdf", "-o", "map.csv", "-o", "none/map.glb"), "there is no folder none"),
            (("bar.hdf", "--mode", "99"), "modes 1 to"),
            (("bar.hdf", "--cut", "2"), "unit"),
            (("bar.hdf", "--radius", "1mm"), "--at"),
            (("bar.hdf", "--at", "0,0", "--radius", "1mm"), "three coordinates"),
            (("bar.hdf", "--at", "0,0,0", "--radius", "1um"), "finer mesh"),
        ):
            error = self.run_command(*words, code=2)
            self.assertIn(expected, error)
            self.assertEqual(len(error.strip().splitlines()), 1, error)
        self.assertFalse((self.folder / "map.csv").exists())

    def test_edited_size_is_that_of_a_new_solve(self):
        words = [BIN / "carillon-bank", "edit", "bar.hdf", "large.hdf", "--size", "2"]
        subprocess.run(words, cwd=self.folder, check=True, capture_output=True)
        find = lambda bank, cut: json.loads(self.run_command(bank, "--cut", cut, "--json"))["modes"]
        for small, large in zip(find("bar.hdf", "0.1mm"), find("large.hdf", "0.2mm")):
            self.assertAlmostEqual(large["cents"], small["cents"], delta=1e-4 * abs(small["cents"]))
            self.assertAlmostEqual(large["thickness"], small["thickness"], delta=1e-3 * abs(small["thickness"]))


if __name__ == "__main__":
    unittest.main(verbosity=2)
