#!/usr/bin/python3
"""The radiation of a bank in a GLB file, CARILLON_multipoles: its schema, its numbers against h5py, and what microphones hear around the
bank that `import --plain` makes of the file.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import os
import pathlib
import re
import tempfile
import unittest

import h5py
import jsonschema
import numpy

from banks import BIN, calc_db, hear_modes, make_radiating_plate, run
from glb_test import Glb


class MultipolesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.bank = make_radiating_plate(cls.folder)
        run(BIN / "carillon-bank", "export", cls.bank, "-o", "plate.glb", cwd=cls.folder)
        cls.glb = Glb((cls.folder / "plate.glb").read_bytes())
        (cls.model,) = cls.glb.json["extensions"]["KHR_audio_rigid_bodies"]["modalModels"]
        cls.own = cls.model["extensions"]["CARILLON_multipoles"]

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_it_fits_its_schema(self):
        page = (pathlib.Path(os.environ["CARILLON_SOURCE_DIR"]) / "docs/gltf-multipoles.md").read_text()
        schema = json.loads(re.search(r"```json schema\n(.*?)```", page, re.S)[1])
        validator = jsonschema.Draft202012Validator(schema)
        validator.check_schema(schema)
        validator.validate(self.own)
        (example,) = json.loads(re.search(r"```json\n(.*?)```", page, re.S)[1])["extensions"]["KHR_audio_rigid_bodies"]["modalModels"]
        validator.validate(example["extensions"]["CARILLON_multipoles"])
        self.assertFalse(validator.is_valid({**self.own, "orders": [121]}))
        self.assertEqual(self.glb.json["extensionsUsed"], ["KHR_audio_rigid_bodies", "CARILLON_multipoles"])

    def test_the_numbers_are_those_of_the_bank(self):
        modes = self.model["extras"]["carillon"]["modes"]
        with h5py.File(self.bank) as bank:
            air = {key: value[()] for key, value in bank["radiation"].items()}
        first = numpy.concatenate([[0], numpy.cumsum((air["order"] + 1) ** 2)])
        self.assertEqual(self.own["orders"], air["order"][modes].tolist())
        self.assertEqual(self.own["center"], air["centre_m"].tolist())
        for key, name in (
            ("radius", "radius_m"),
            ("validRadius", "nearest_m"),
            ("airDensity", "air_density_kg_m3"),
            ("speedOfSound", "sound_speed_ms"),
        ):
            self.assertEqual(self.own[key], air[name])
        own = numpy.concatenate([air["scale"][m] * air["coefficient"][first[m] : first[m + 1]] for m in modes])
        self.assertTrue(numpy.array_equal(self.glb.read(self.own["coefficients"]), own.astype("f4")))
        self.assertTrue(numpy.array_equal(self.glb.read(self.own["decayRates"]), air["decay"][modes].astype("f4")))
        self.assertTrue(numpy.array_equal(self.glb.read(self.own["errors"]), air["error_db"][modes].astype("f4")))

    def test_twelve_microphones_hear_what_comes_back(self):
        run(BIN / "carillon-bank", "import", "--plain", "plate.glb", "-o", "plain.hdf", cwd=self.folder)
        run(BIN / "carillon-bank", "check", "plain.hdf", cwd=self.folder)
        directions = numpy.random.default_rng(7).normal(size=(12, 3))
        found = []
        for name, decays in (("plate.hdf", "modes/corrected_decay"), ("plain.hdf", "modes/decay")):
            with h5py.File(self.folder / name) as bank:
                order = numpy.argsort(bank["radiation/freq_hz"][:])
                freq_hz = bank["radiation/freq_hz"][:][order]
                decay = (bank[decays][:] + bank["radiation/decay"][:])[order]
                places = (
                    bank["radiation/centre_m"][:]
                    + directions / numpy.linalg.norm(directions, axis=1)[:, None] * numpy.linspace(0.4, 3, 12)[:, None]
                )
            pressure, left_db = hear_modes(self.folder, self.folder / name, (0.13, 0.08, 0.01), [0, 0, -1.0], places, freq_hz, decay)
            self.assertLess(left_db, -95)
            found.append((freq_hz, decay, pressure))
        self.assertGreater(len(found[0][0]), 8)
        self.assertLess(abs(found[1][0] / found[0][0] - 1).max(), 1e-7)
        self.assertLess(abs(found[1][1] / found[0][1] - 1).max(), 1e-6)
        self.assertGreater(numpy.ptp(20 * numpy.log10(abs(found[0][2]))), 40)
        for mode in range(len(found[0][0])):
            own, back = found[0][2][:, mode], found[1][2][:, mode]
            self.assertLess(calc_db(abs(back - own), abs(own)), -100)


if __name__ == "__main__":
    unittest.main()
