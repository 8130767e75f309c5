#!/usr/bin/python3
"""docs/examples/measure.py on sounds whose frequencies and decays are known by construction; reading of WAV files.

usage: measure_test.py SOURCE_DIR
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest
import wave

import numpy

SOURCE = pathlib.Path(sys.argv.pop(1))
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "docs/examples"))
import measure

RATE = 48000


def ring(seconds, *modes):
    """Sum of modes (Hz, decay, amplitude)."""
    t = numpy.arange(int(seconds * RATE)) / RATE
    return sum(a * numpy.exp(-d * t) * numpy.sin(2 * numpy.pi * f * t + 0.3) for f, d, a in modes)


class Measure(unittest.TestCase):
    def test_a_tone_between_two_lines_of_the_spectrum_is_found_to_a_thousandth_of_a_cent(self):
        for hz in (59.937, 440.123, 8123.456):
            found = measure.find_peak(ring(2.0, (hz, 0.0, 0.5)), RATE, hz * 1.005)
            self.assertLess(abs(1200 * numpy.log2(found / hz)), 1e-3 if hz > 100 else 0.05)

    def test_damped_tones_are_found_to_a_tenth_of_a_cent(self):
        peaks = measure.find_peaks(ring(1.0, (587.33, 3.0, 1.0), (1575.4, 9.0, 0.3), (2970.1, 20.0, 0.2)), RATE, count=3)
        for (found, _), hz in zip(peaks, (587.33, 1575.4, 2970.1)):
            self.assertLess(abs(1200 * numpy.log2(found / hz)), 0.1)
        self.assertEqual(max(level for _, level in peaks), 0.0)

    def test_the_strongest_are_kept_and_side_lobes_are_no_peaks(self):
        sound = ring(1.0, (500.0, 0.0, 1.0), (900.0, 0.0, 0.1), (2000.0, 0.0, 1e-5))
        self.assertEqual([round(hz) for hz, _ in measure.find_peaks(sound, RATE, count=2)], [500, 900])
        self.assertEqual([round(hz) for hz, _ in measure.find_peaks(sound, RATE, low_hz=600, count=1)], [900])
        levels = dict((round(hz), level) for hz, level in measure.find_peaks(sound, RATE, count=2))
        self.assertAlmostEqual(levels[900], -20.0, delta=0.05)

    def test_decays_are_found_next_to_a_louder_neighbour(self):
        for d in (0.7, 15.0, 60.0):
            sound = ring(1.5, (600.0, d, 0.1), (1300.0, 2.0, 1.0))
            self.assertAlmostEqual(measure.calc_decay(sound, RATE, 600.0, 200.0), d, delta=0.01 * d)

    def test_silence_has_no_peak_and_a_click_no_decay(self):
        with self.assertRaises(SystemExit):
            measure.find_peak(numpy.zeros(4800), RATE, 440.0)
        with self.assertRaises(SystemExit):
            measure.calc_decay(ring(0.5, (600.0, 5000.0, 1.0)), RATE, 600.0, 200.0)

    def test_files_of_16_and_24_bits_are_read_and_looked_at(self):
        sound = ring(0.5, (700.0, 0.0, 0.5))
        with tempfile.TemporaryDirectory() as folder:
            for width in (2, 3):
                file = pathlib.Path(folder) / f"{width}.wav"
                steps = numpy.round(sound * (1 << (8 * width - 1))).astype(numpy.int64)
                both = numpy.stack([steps, -steps], axis=1).reshape(-1)
                with wave.open(str(file), "wb") as out:
                    out.setparams((2, width, RATE, 0, "NONE", ""))
                    out.writeframes(b"".join(int(x).to_bytes(width, "little", signed=True) for x in both))
                rate, read = measure.read_wav(file)
                self.assertEqual((rate, read.shape), (RATE, (len(sound), 2)))
                numpy.testing.assert_allclose(read[:, 0], sound, atol=1.0 / (1 << (8 * width - 1)))
                numpy.testing.assert_allclose(read[:, 1], -read[:, 0])
            done = subprocess.run([SOURCE / "docs/examples/measure.py", file, "--count", "1"], capture_output=True, text=True)
            self.assertEqual((done.returncode, done.stdout.split()[0]), (0, "700.00"), done)


if __name__ == "__main__":
    unittest.main()
