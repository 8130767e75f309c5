#!/usr/bin/python3
"""Ambisonics of carillon-render, held against the encoder and the decoder of libspatialaudio.

usage: ambisonics_test.py REFERENCE, the program of ambisonics.cpp. Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy
import scipy.io.wavfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
REFERENCE = sys.argv.pop()
EAR_M = numpy.array([0.3, -0.2, 0.4])
# Azimuth and elevation of the source in the frame of the listener [rad].
DIRECTIONS = [(0, 0), (1.1, 0), (-1.9, 0.3), (math.pi, 0), (0.4, 1.2), (-0.7, -0.9), (2.5, 0.6), (0.2, -math.pi / 2)]


def run(*words, code=0, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=100, **options)
    assert done.returncode == code, (words, done)
    return done


def calc_db(difference, whole):
    return 10.0 * numpy.log10(max(1e-40, numpy.mean(difference**2)) / numpy.mean(whole**2))


class AmbisonicsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.bank = fixtures.get("aluminium_bar.hdf")
        with h5py.File(cls.bank) as bank:
            cls.centre_m = bank["rigid/centre_m"][:]

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def render(self, listener, body_m=(0, 0, 0), **changed):
        """(frames, channels) [Pa]."""
        scene = {
            "duration_s": 0.2,
            "gravity_m_s2": [0, 0, 0],
            "bodies": [{"name": "bar", "bank": str(self.bank), "fixed": True, "position_m": list(map(float, body_m))}],
            "strikes": [{"time_s": 0.01, "body": "bar", "point_m": [0.02, 0.01, 0.004], "impulse_n_s": [0, 0, -0.05]}],
            "output": {"gain": 1e-3, "format": "float", "fade_end": False},
            **listener,
            **changed,
        }
        (self.folder / "scene.json").write_text(json.dumps(scene))
        run(BIN / "carillon-render", "-q", "scene.json", "-o", "a.wav", cwd=self.folder)
        samples = scipy.io.wavfile.read(self.folder / "a.wav")[1].astype(float)
        return samples.reshape(len(samples), -1)

    def hear(self, order, facing=(0, 1, 0), **more):
        return {"listener": {"position_m": EAR_M.tolist(), "facing": list(facing), "ears": "ambisonic", "order": order, **more}}

    def put(self, azimuth, elevation, distance_m=2.0):
        """Position of a body that a listener who faces +y hears from there."""
        ahead, left, up = math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)
        return EAR_M + distance_m * numpy.array([-left, ahead, up]) - self.centre_m

    def find_gains(self, order, azimuth, elevation):
        return numpy.array(list(map(float, run(REFERENCE, order, repr(azimuth), repr(elevation)).stdout.split())))

    def test_channels_are_those_of_libspatialaudio(self):
        for order in (1, 2, 3):
            for azimuth, elevation in DIRECTIONS if order == 3 else DIRECTIONS[2:4]:
                with self.subTest(order=order, azimuth=azimuth, elevation=elevation):
                    sound = self.render(self.hear(order), self.put(azimuth, elevation))
                    gains = self.find_gains(order, azimuth, elevation)
                    self.assertEqual(sound.shape[1], len(gains))
                    self.assertLess(calc_db(sound - sound[:, :1] * gains, sound[:, 0]), -110)

    def test_first_channel_is_a_microphone_there(self):
        body_m = self.put(0.8, 0.3)
        sound = self.render(self.hear(1), body_m)
        point = self.render({"microphones": [EAR_M.tolist()]}, body_m)
        self.assertLess(calc_db(sound[:, :1] - point, point), -120)
        # A fixed choice of effects does not leave the direction out.
        sound = self.render(self.hear(1), body_m, effects=["modal", "air_delay"])
        self.assertGreater(abs(sound[:, 0] - sound[:, 1]).max(), 0.1 * abs(sound[:, 0]).max())

    def test_frame_turns_with_the_listener(self):
        straight = self.render(self.hear(3), self.put(1.1, 0.2))
        # Facing +x: a body that was 1.1 rad left of +y is 1.1 + pi / 2 left of +x.
        turned = self.render(self.hear(3, facing=(1, 0, 0)), self.put(1.1, 0.2))
        gains = self.find_gains(3, 1.1 + math.pi / 2, 0.2)
        self.assertLess(calc_db(turned - straight[:, :1] * gains, straight[:, 0]), -110)

    def test_decoder_of_libspatialaudio_finds_the_energy_and_the_direction(self):
        levels = []
        for azimuth, elevation in DIRECTIONS:
            sound = self.render(self.hear(1), self.put(azimuth, elevation))
            (self.folder / "a.f32").write_bytes(sound.astype("<f4").tobytes())
            rows = numpy.array([line.split() for line in run(REFERENCE, "cube", self.folder / "a.f32").stdout.splitlines()], dtype=float)
            levels.append(10 * numpy.log10(rows[:, 0].sum() / (sound[:, 0] ** 2).sum()))
            at = numpy.stack(
                [numpy.cos(rows[:, 2]) * numpy.cos(rows[:, 1]), numpy.cos(rows[:, 2]) * numpy.sin(rows[:, 1]), numpy.sin(rows[:, 2])]
            )
            source = [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
            loudest = at @ rows[:, 0] / rows[:, 0].sum()
            self.assertGreater(loudest @ source / numpy.linalg.norm(loudest), 0.999)
        self.assertLess(max(levels) - min(levels), 0.1)

    def test_ground_sends_a_second_direction(self):
        azimuth, elevation = -0.9, 0.35
        body_m = self.put(azimuth, elevation)
        ground = {"ground": {"height_m": -0.5, "reflection": 0.7}, "effects": {"on": ["ground_reflection"]}}
        sound = self.render(self.hear(2), body_m, **ground)
        direct = self.render({"microphones": [EAR_M.tolist()]}, body_m)
        both = self.render({"microphones": [EAR_M.tolist()]}, body_m, **ground)
        source = body_m + self.centre_m
        down = math.atan2(2 * -0.5 - source[2] - EAR_M[2], math.hypot(source[0] - EAR_M[0], source[1] - EAR_M[1]))
        expected = direct * self.find_gains(2, azimuth, elevation) + (both - direct) * self.find_gains(2, azimuth, down)
        self.assertGreater(calc_db(both - direct, direct), -20)
        self.assertLess(calc_db(sound - expected, both), -100)

    def test_direction_follows_a_walk(self):
        start, speed, rows = numpy.array([-1.5, 0.6, 0.1]), numpy.array([14.0, 1.0, 3.0]), numpy.linspace(-0.1, 0.3, 41)
        path = [[float(t), *map(float, start + speed * t)] for t in rows]
        listener = {"listener": {"path": path, "facing": [0, 1, 0], "ears": "ambisonic", "order": 3}}
        sound = self.render(listener)
        time_s = numpy.arange(len(sound)) / 48000
        to = self.centre_m - (start + speed * time_s[:, None])
        ahead, left, up = to[:, 1], -to[:, 0], to[:, 2]
        length = numpy.linalg.norm(to, axis=1)
        x, y, z = ahead / length, left / length, up / length
        # Closed forms of single channels, AmbiX.
        for channel, gain in (
            (1, y),
            (2, z),
            (3, x),
            (6, 1.5 * z**2 - 0.5),
            (8, math.sqrt(0.75) * (x**2 - y**2)),
            (15, math.sqrt(0.625) * x * (x**2 - 3 * y**2)),
        ):
            self.assertLess(calc_db(sound[:, channel] - gain * sound[:, 0], sound[:, 0]), -65, channel)
        self.assertGreater(numpy.ptp(y), 1.5)


if __name__ == "__main__":
    unittest.main()
