#!/usr/bin/python3
"""Differences of sounds (tests/bench/study/sounds.py) against closed forms: sines, noise, the sound of a body."""
import pathlib
import sys
import unittest

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tests/bench/study"), str(ROOT / "jobs/study")]
import sounds  # noqa: E402

RATE = 48000
TIME = np.arange(2 * RATE) / RATE


def make(pressure, rate=RATE):
    return sounds.Sound(rate, np.asarray(pressure, float).reshape(len(pressure), -1))


def make_sine(freq, peak_pa=1.0, rate=RATE):
    """A sine with a soft start and end: a line spectrum."""
    time = np.arange(2 * rate) / rate
    return peak_pa * np.sin(2 * np.pi * freq * time) * np.sin(np.pi * time / 2) ** 2


class Weighting(unittest.TestCase):
    def test_table_of_the_standard(self):
        for freq, db in ((31.623, -39.4), (100, -19.1), (1000, 0.0), (2511.9, 1.3), (10000, -2.5)):  # IEC 61672-1:2013, table 3
            self.assertAlmostEqual(20 * np.log10(sounds.calc_a_weight(freq)), db, delta=0.06)
        self.assertEqual(sounds.calc_a_weight(5.0), 0.0)
        self.assertEqual(sounds.calc_a_weight(22000.0), 0.0)


class Error(unittest.TestCase):
    def test_a_sine_next_to_another_counts_with_its_weight(self):
        reference = make_sine(1000)
        for freq, weight_db in ((1000, 0.0), (100, -19.1), (10000, -2.5)):
            error = sounds.calc_error_db(make(reference), make(reference + 0.01 * make_sine(freq)))
            self.assertAlmostEqual(error, -40 + weight_db, delta=0.1)

    def test_a_shift_of_phase(self):
        a, b = np.sin(2 * np.pi * 1000 * TIME), np.sin(2 * np.pi * 1000 * TIME + 0.02)
        self.assertAlmostEqual(sounds.calc_error_db(make(a), make(b)), 20 * np.log10(2 * np.sin(0.01)), delta=0.05)

    def test_nothing_differs(self):
        self.assertEqual(sounds.calc_error_db(make(make_sine(500)), make(make_sine(500))), -300.0)
        self.assertEqual(sounds.calc_error_db(make(np.zeros(9000)), make(np.zeros(9000))), -300.0)


class Distance(unittest.TestCase):
    def test_a_gain_is_its_own_distance(self):
        noise = np.random.default_rng(5).standard_normal(RATE)
        for gain_db in (0.5, 3.0, -6.0):
            other = noise * 10 ** (gain_db / 20)
            self.assertAlmostEqual(sounds.calc_distance(make(noise), make(other))[0], abs(gain_db), delta=1e-6)

    def test_one_of_two_equal_sines_is_lost(self):
        # Two steady sines in bands of their own: half the cells fall to the floor, 60 dB below, the other half stay. sqrt((60^2 + 0) / 2).
        time = np.arange(8 * RATE) / RATE
        soft = np.minimum(1.0, np.minimum(time, 8 - time) / 0.1)  # what begins at once is in all bands
        low, high = soft * np.sin(2 * np.pi * 1000 * time), soft * np.sin(2 * np.pi * 8000 * time)
        distance, outliers = sounds.calc_distance(make(low + high), make(low))
        self.assertAlmostEqual(distance, 60 / np.sqrt(2), delta=0.8)
        self.assertGreater(outliers, 0.98)

    def test_frames_that_are_off_are_counted(self):
        # 3 dB louder in a tenth of the time: as much of the frames, and 3 sqrt(0.1) dB on the whole.
        noise = np.random.default_rng(7).standard_normal(10 * RATE)
        other = noise * np.where((np.arange(len(noise)) >= 3 * RATE) & (np.arange(len(noise)) < 4 * RATE), 10 ** (3 / 20), 1.0)
        distance, outliers = sounds.calc_distance(make(noise), make(other))
        self.assertAlmostEqual(outliers, 0.1, delta=0.005)
        self.assertAlmostEqual(distance, 3 * np.sqrt(0.1), delta=0.02)

    def test_phases_do_not_count(self):
        a, b = np.sin(2 * np.pi * 1000 * TIME) * np.hanning(len(TIME)), np.cos(2 * np.pi * 1000 * TIME) * np.hanning(len(TIME))
        self.assertLess(sounds.calc_distance(make(a), make(b))[0], 0.01)
        self.assertGreater(sounds.calc_error_db(make(a), make(b)), 2.9)


class Loudness(unittest.TestCase):
    def test_level_of_a_sine(self):
        peak = sounds.REFERENCE_PA * np.sqrt(2)
        for freq, level in ((1000, 80.0), (100, 60.9)):
            sine = peak * 1e4 * np.sin(2 * np.pi * freq * TIME)
            self.assertAlmostEqual(sounds.calc_loudest_db(make(sine)), level, delta=0.1)

    def test_a_short_burst_is_softer_by_the_time_of_the_ear(self):
        steady = np.sin(2 * np.pi * 1000 * TIME)
        burst = np.where((TIME >= 0.5) & (TIME < 0.55), steady, 0.0)
        self.assertAlmostEqual(
            sounds.calc_loudest_db(make(burst)) - sounds.calc_loudest_db(make(steady)), 10 * np.log10(0.05 / 0.2), delta=0.1
        )

    def test_sones_double_every_ten_decibels(self):
        self.assertEqual(sounds.calc_sones(40.0), 1.0)
        self.assertAlmostEqual(sounds.calc_sones(70.0) / sounds.calc_sones(60.0), 2.0)

    def test_silence(self):
        self.assertEqual(sounds.calc_loudest_db(make(np.zeros(20000))), -300.0)


class Rates(unittest.TestCase):
    def test_a_sine_at_another_rate_is_the_same_sine(self):
        for rate in (96000, 44100, 24000):
            other = sounds.resample(make(make_sine(3000, rate=rate), rate), RATE)
            self.assertLess(sounds.calc_error_db(make(make_sine(3000)), other), -120.0)

    def test_what_a_lower_rate_cannot_hold_is_lost(self):
        whole = make_sine(1000) + make_sine(15000)
        lower = make_sine(1000, rate=24000)
        expected = 20 * np.log10(sounds.calc_a_weight(15000.0)) - 10 * np.log10(1 + sounds.calc_a_weight(15000.0) ** 2)
        self.assertAlmostEqual(sounds.calc_error_db(make(whole), make(lower, 24000)), expected, delta=0.05)


class Files(unittest.TestCase):
    def test_a_float_wav_is_read_and_others_are_refused(self):
        samples = np.array([[0.5, -0.25], [1e-7, 3.0]], "<f4")
        form = (
            (3).to_bytes(2, "little")
            + (2).to_bytes(2, "little")
            + RATE.to_bytes(4, "little")
            + (8 * RATE).to_bytes(4, "little")
            + (8).to_bytes(2, "little")
            + (32).to_bytes(2, "little")
        )
        body = b"WAVEfmt " + len(form).to_bytes(4, "little") + form + b"data" + samples.nbytes.to_bytes(4, "little") + samples.tobytes()
        data = b"RIFF" + len(body).to_bytes(4, "little") + body
        sound = sounds.read_wav(data)
        self.assertEqual(sound.rate_hz, RATE)
        np.testing.assert_array_equal(sound.pressure_pa, samples.astype(float))
        for bad in (b"", data[:30], data.replace(b"fmt \x10\0\0\0\x03", b"fmt \x10\0\0\0\x01")):
            self.assertRaises(ValueError, sounds.read_wav, bad)


class Verdict(unittest.TestCase):
    def test_what_is_audible(self):
        self.assertFalse(sounds.Difference(-41.0, 5.0, 2.0).is_audible)
        self.assertFalse(sounds.Difference(-10.0, 0.9, 0.9).is_audible)
        self.assertTrue(sounds.Difference(-10.0, 1.1, 0.0).is_audible)
        self.assertTrue(sounds.Difference(-10.0, 0.1, -1.1).is_audible)
        self.assertTrue(sounds.Difference(-10.0, 0.9, 0.0, 0.03).is_audible)


if __name__ == "__main__":
    unittest.main()
