#!/usr/bin/python3
"""carillon-bank export to SOFA, from outside: the convention's names by netCDF4, the pressures by scipy's functions and by microphones in a
scene of carillon-render.

Finds the programs in $CARILLON_BIN_DIR.
"""
import math
import pathlib
import tempfile
import unittest

import h5py
import netCDF4
import numpy
import scipy.special

from banks import BIN, calc_db, fixtures, hear_modes, make_radiating_plate, run

STRIKE_M = (0.13, 0.08, 0.01)
# FreeFieldDirectivityTF 1.1 of AES69-2022: mandatory attributes with their prescribed text; variables with dimensions and attributes.
ATTRIBUTES = {
    "Conventions": "SOFA",
    "Version": "2.1",
    "SOFAConventions": "FreeFieldDirectivityTF",
    "SOFAConventionsVersion": "1.1",
    "DataType": "TF",
    "RoomType": "free field",
    **dict.fromkeys(["Title", "DateCreated", "DateModified", "APIName", "APIVersion", "AuthorContact", "Organization", "License"]),
    **dict.fromkeys(["DatabaseName", "SourceType", "SourceManufacturer"]),
}
CARTESIAN = {"Type": "cartesian", "Units": "metre"}
VARIABLES = {
    "ListenerPosition": ("IC", CARTESIAN),
    "ListenerView": ("IC", CARTESIAN),
    "ListenerUp": ("IC", CARTESIAN),
    "ReceiverPosition": ("RCI", {"Type": "spherical", "Units": "degree, degree, metre"}),
    "SourcePosition": ("IC", {**CARTESIAN, "Reference": None}),
    "SourceView": ("IC", {**CARTESIAN, "Reference": None}),
    "SourceUp": ("IC", {**CARTESIAN, "Reference": None}),
    "EmitterPosition": ("ECI", CARTESIAN),
    "N": ("N", {"LongName": "frequency", "Units": "hertz"}),
    "Data.Real": ("MRN", {}),
    "Data.Imag": ("MRN", {}),
}


def calc_field(bank, directions, distance_m):
    """(receivers, modes): docs/bank-format.md#radiation by scipy; e^(-i omega t)."""
    air = bank["radiation"]
    k = 2 * math.pi * air["freq_hz"][:] / air["sound_speed_ms"][()]
    polar, azimuth = numpy.arccos(directions[:, 2]), numpy.arctan2(directions[:, 1], directions[:, 0])
    field, at = numpy.zeros((len(directions), len(k)), complex), 0
    for mode, order in enumerate(air["order"][:]):
        steps = air["coefficient"][at : at + (order + 1) ** 2] * air["scale"][mode]
        at += (order + 1) ** 2

        def hankel(l, x):
            return scipy.special.spherical_jn(l, x) + 1j * scipy.special.spherical_yn(l, x)

        for l in range(order + 1):
            radial = hankel(l, k[mode] * distance_m) / hankel(l, k[mode] * air["radius_m"][()])
            for m in range(-l, l + 1):
                plain = scipy.special.sph_harm(abs(m), l, azimuth, polar) * (-1) ** m  # without Condon and Shortley's phase
                real = plain.real if m == 0 else math.sqrt(2) * (plain.real if m > 0 else plain.imag)
                a, b = steps[l * l + l + m]
                field[:, mode] += (a + 1j * b) * radial * real
    return field


class SofaTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.bank = make_radiating_plate(cls.folder)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def export(self, name, *words, bank=None, code=0):
        return run(BIN / "carillon-bank", "export", bank or self.bank, "-o", name, *words, cwd=self.folder, code=code)

    def read(self, name):
        """Frequencies, receivers (R, 3) as unit vectors, distance, pressures (R, N)."""
        with netCDF4.Dataset(self.folder / name) as file:
            azimuth, elevation, distance = file["ReceiverPosition"][:, :, 0].data.T
            a, e = numpy.radians(azimuth), numpy.radians(elevation)
            units = numpy.stack([numpy.cos(e) * numpy.cos(a), numpy.cos(e) * numpy.sin(a), numpy.sin(e)], axis=1)
            self.assertEqual(numpy.ptp(distance), 0)
            return file["N"][:].data, units, distance[0], file["Data.Real"][0].data + 1j * file["Data.Imag"][0].data

    def test_it_has_the_names_of_the_convention(self):
        out = self.export("a.sofa").stdout
        with netCDF4.Dataset(self.folder / "a.sofa") as file:
            self.assertEqual(file.data_model, "NETCDF4")
            for name, text in ATTRIBUTES.items():
                found = file.getncattr(name)
                self.assertTrue(found == text if text else found, name)
            self.assertEqual({name: len(file.dimensions[name]) for name in "MECIS"}, {"M": 1, "E": 1, "C": 3, "I": 1, "S": 1})
            self.assertEqual(len(file.dimensions["R"]), 614)
            self.assertEqual(set(file.variables), set(VARIABLES))
            for name, (dimensions, attributes) in VARIABLES.items():
                self.assertEqual(file[name].dimensions, tuple(dimensions), name)
                for key, text in attributes.items():
                    self.assertTrue(file[name].getncattr(key) == text if text else file[name].getncattr(key), (name, key))
            self.assertTrue((numpy.diff(file["N"][:]) > 0).all())
        self.assertIn("614 receivers", out)
        dumped = run("ncdump", "-h", "a.sofa", cwd=self.folder).stdout
        self.assertIn("double Data.Real(M, R, N)", dumped)
        # Other programs may change it.
        with netCDF4.Dataset(self.folder / "a.sofa", "a") as file:
            file.Title = "another"

    def test_pressures_are_those_of_the_multipoles(self):
        self.export("a.sofa", "--step", 15, "--distance", 0.7)
        freq_hz, directions, distance_m, pressure = self.read("a.sofa")
        with h5py.File(self.bank) as bank:
            field = calc_field(bank, directions, distance_m)[:, numpy.argsort(bank["radiation/freq_hz"][:])]
            numpy.testing.assert_allclose(freq_hz, numpy.sort(bank["radiation/freq_hz"][:]), rtol=1e-12)
        self.assertGreater(len(freq_hz), 8)
        for mode in range(len(freq_hz)):
            self.assertLess(calc_db(abs(pressure[:, mode] - field[:, mode].conj()), abs(field[:, mode])), -110)

    def test_twelve_microphones_hear_the_file(self):
        self.export("a.sofa", "--strike", ",".join(map(str, STRIKE_M)))
        freq_hz, directions, distance_m, pressure = self.read("a.sofa")
        chosen = numpy.random.default_rng(5).choice(len(directions), 12, replace=False)
        with h5py.File(self.bank) as bank:
            order = numpy.argsort(bank["radiation/freq_hz"][:])
            centre = bank["radiation/centre_m"][:]
            travel_s = (distance_m - bank["radiation/radius_m"][()]) / bank["radiation/sound_speed_ms"][()]
            decay = (bank["modes/corrected_decay"][:] + bank["radiation/decay"][:])[order]
        microphones = centre + distance_m * directions[chosen]
        found, left_db = hear_modes(self.folder, self.bank, STRIKE_M, [0, 0, -1.0], microphones, freq_hz, decay)
        self.assertLess(left_db, -100)
        levels = 20 * numpy.log10(abs(found))
        self.assertGreater(numpy.ptp(levels), 40)
        for mode in range(len(freq_hz)):
            there = pressure[chosen, mode]
            factor = numpy.vdot(there, found[:, mode]) / numpy.vdot(there, there)
            self.assertLess(calc_db(abs(found[:, mode] - factor * there), abs(found[:, mode])), -100)
            # The blow's level and phase; what arrives was sent earlier, when the mode was louder.
            self.assertLess(abs(factor * math.exp(-decay[mode] * travel_s) - 1), 2e-3)

    def test_third_octaves_are_sums_of_squares(self):
        blow = ["--strike", ",".join(map(str, STRIKE_M))]
        self.export("modes.sofa", *blow)
        self.export("bands.sofa", *blow, "--bands")
        freq_hz, _, _, pressure = self.read("modes.sofa")
        band_hz, _, _, levels = self.read("bands.sofa")
        self.assertTrue((levels.imag == 0).all())
        self.assertLess(len(band_hz), len(freq_hz))
        self.assertEqual(len(band_hz), len(set(numpy.floor(10 * numpy.log10(freq_hz) + 0.5))))
        for band, centre in enumerate(band_hz):
            self.assertAlmostEqual(10 * math.log10(centre), round(10 * math.log10(centre)), 9)  # IEC 61260
            inside = (freq_hz >= centre / 10**0.05) & (freq_hz < centre * 10**0.05)
            expected = numpy.sqrt((abs(pressure[:, inside]) ** 2).sum(axis=1))
            numpy.testing.assert_allclose(levels[:, band].real, expected, rtol=1e-12)

    def test_a_blow_scales_the_modes(self):
        self.export("unit.sofa", "--step", 30)
        with h5py.File(self.bank) as bank:
            vertex = int(numpy.argmax(bank["mesh/vertices"][:] @ [1, 1, 1]))  # a corner of the upper side
            point = bank["mesh/vertices"][vertex]
            shape = bank["modes/shape"][vertex] * bank["modes/shape_scale"][:][:, None]
            order = numpy.argsort(bank["radiation/freq_hz"][:])
        inner = point - [1e-6, 1e-6, 0]  # belongs to the upper side alone
        self.export("blow.sofa", "--step", 30, "--strike", ",".join(map(repr, map(float, inner))))
        unit, blow = self.read("unit.sofa")[3], self.read("blow.sofa")[3]
        for column, mode in enumerate(order):
            ratio = numpy.vdot(unit[:, column], blow[:, column]) / numpy.vdot(unit[:, column], unit[:, column])
            self.assertAlmostEqual(ratio.real / -shape[mode, 2], 1, 3)
            self.assertLess(abs(ratio.imag), 1e-12)

    def test_what_cannot_be_is_refused(self):
        self.export("keep.sofa")
        bytes_before = (self.folder / "keep.sofa").read_bytes()
        for words, expected in (
            (["--distance", 0.1], ["plate.hdf", "0.1 m", "distance"]),
            (["--distance", "nan"], ["nan m"]),
            (["--step", 7], ["7 degrees", "divides 180"]),
            (["--step", 0.5], ["0.5 degrees"]),
            (["--bands"], ["--strike"]),
            (["--strike", "9,9,9"], ["plate.hdf", "not near the surface"]),
            (["--strike", "1,2"], ["--strike 1,2", "X,Y,Z"]),
            (["--points", 4], ["--points is for Faust"]),
            (["--modes", 4], ["--modes is for GLB and Faust"]),
            (["--up", "z"], ["--up is for GLB"]),
        ):
            with self.subTest(words=words):
                error = self.export("keep.sofa", *words, code=2).stderr
                self.assertEqual(error.count("\n"), 1, error)
                for part in expected:
                    self.assertIn(part, error)
        self.assertEqual((self.folder / "keep.sofa").read_bytes(), bytes_before)
        error = self.export("a.dsp", "--bands", code=2).stderr
        self.assertIn("--bands is for SOFA", error)
        silent = self.export("no.sofa", bank=fixtures.get("aluminium_bar.hdf"), code=2).stderr
        for part in ("aluminium_bar.hdf", "no multipoles", '"radiation": "bem"', "carillon-precompute --radiate"):
            self.assertIn(part, silent)
        self.assertFalse((self.folder / "no.sofa").exists())


if __name__ == "__main__":
    unittest.main()
