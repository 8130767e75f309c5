#!/usr/bin/python3
"""Sound files of carillon-render, decoded by flac, opusdec and ffmpeg to what was rendered.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy
import scipy.io.wavfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
ODD_S = 0.50101  # an odd number of frames, and no whole block of a codec


def run(*words, **options):
    return subprocess.run([str(word) for word in words], capture_output=True, timeout=100, **options)


def calc_db(difference, whole):
    return 10.0 * numpy.log10(numpy.mean(difference**2) / numpy.mean(whole**2))


class SoundsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.scene = {
            "duration_s": ODD_S,
            "gravity_m_s2": [0, 0, 0],
            "bodies": [{"name": "bar", "bank": str(fixtures.get("aluminium_bar.hdf")), "fixed": True}],
            "strikes": [{"time_s": 0.02, "body": "bar", "point_m": [0.02, 0.01, 0.004], "impulse_n_s": [0, 0, -0.05], "duration_s": 5e-4}],
            "listener": {"position_m": [0.4, -1, 0.2], "look_at_m": [0, 0, 0]},
        }

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def render(self, name, *words, code=0, **changed):
        scene = {**self.scene, **changed}
        if "microphones" in scene:
            scene.pop("listener")
        (self.folder / "scene.json").write_text(json.dumps(scene))
        done = run(BIN / "carillon-render", "-q", "scene.json", "-o", name, *words, cwd=self.folder)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stderr.decode()

    def decode(self, *words):
        done = run(*words, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def read(self, name, kind="s32le", **options):
        """(frames, channels) by ffmpeg: whole numbers, or floats in double."""
        channels = int(json.loads(self.probe(name))["streams"][0]["channels"])
        raw = self.decode("ffmpeg", "-v", "error", "-i", name, "-f", kind, "-")
        return numpy.frombuffer(raw, "<i4" if kind == "s32le" else "<f8").reshape(-1, channels)

    def probe(self, name):
        return self.decode("ffprobe", "-v", "error", "-show_streams", "-of", "json", name)

    def test_flac_has_the_samples_of_the_wav(self):
        for form, microphones in (("pcm16", 1), ("pcm24", 2), ("pcm24", 8)):
            with self.subTest(form=form, microphones=microphones):
                places = {"microphones": [[0.1 * i, -1.0, 0.1] for i in range(microphones)]}
                self.render("a.wav", "--format", form, **places)
                self.render("a.flac", "--format", form, **places)
                self.decode("flac", "-s", "-t", "--warnings-as-errors", "a.flac")  # the checksum of the samples, too
                sign = ["--endian=little", "--sign=signed"]
                raw = self.decode("flac", "-s", "-d", "-c", "--force-raw-format", *sign, "a.flac")
                data = (self.folder / "a.wav").read_bytes()
                self.assertEqual(raw, data[data.index(b"data") + 8 :][: len(raw)])
                self.assertEqual(len(raw), round(48000 * ODD_S) * microphones * int(form[3:]) // 8)
                self.assertTrue(numpy.array_equal(self.read("a.flac"), self.read("a.wav")))
                stream = json.loads(self.probe("a.flac"))["streams"][0]
                self.assertEqual((stream["sample_rate"], int(stream["duration_ts"])), ("48000", round(48000 * ODD_S)))

    def test_rates_of_flac(self):
        for rate in (8000, 12345, 192000):
            self.render("a.wav", "--rate", rate)
            self.render("a.flac", "--rate", rate)
            self.assertTrue(numpy.array_equal(self.read("a.flac"), self.read("a.wav")), rate)

    def test_opus_and_vorbis_have_the_sound(self):
        self.render("a.wav", "--format", "float")
        whole = self.read("a.wav", "f64le")
        self.render("a.opus")
        raw = self.decode("opusdec", "--quiet", "--float", "--rate", "48000", "a.opus", "-")
        heard = numpy.frombuffer(raw, "<f4").reshape(-1, 2).astype(float)
        self.assertEqual(heard.shape, whole.shape)
        self.assertLess(calc_db(heard - whole, whole), -20.0)
        self.render("a.ogg")
        heard = self.read("a.ogg", "f64le")
        self.assertEqual(heard.shape, whole.shape)
        self.assertLess(calc_db(heard - whole, whole), -20.0)
        for name, codec in (("a.opus", "opus"), ("a.ogg", "vorbis")):
            self.assertEqual(json.loads(self.probe(name))["streams"][0]["codec_name"], codec)
            self.assertLess((self.folder / name).stat().st_size, 0.2 * (self.folder / "a.wav").stat().st_size)

    def test_more_than_two_channels_have_an_extensible_header(self):
        for form, microphones in (("pcm16", 3), ("pcm24", 2), ("pcm24", 16), ("pcm32", 5), ("float", 1), ("float", 4)):
            with self.subTest(form=form, microphones=microphones):
                self.render("a.wav", "--format", form, microphones=[[0.1 * i, -1.0, 0.1] for i in range(microphones)])
                data = (self.folder / "a.wav").read_bytes()
                tag = int.from_bytes(data[20:22], "little")
                self.assertEqual(tag, 0xFFFE if microphones > 2 else 3 if form == "float" else 1)
                rate, samples = scipy.io.wavfile.read(self.folder / "a.wav")
                samples = samples.reshape(len(samples), -1)
                self.assertEqual((rate, samples.shape), (48000, (round(48000 * ODD_S), microphones)))
                theirs = self.read("a.wav", "f64le") * {"int16": 2.0**15, "int32": 2.0**31, "float32": 1.0}[str(samples.dtype)]
                self.assertTrue(numpy.array_equal(samples, theirs))
                stream = json.loads(self.probe("a.wav"))["streams"][0]
                self.assertFalse(microphones > 2 and stream.get("channel_layout"), "microphones are no loudspeakers")

    def test_what_a_codec_does_not_have_is_refused(self):
        nine = {"microphones": [[0.1 * i, -1.0, 0.1] for i in range(9)]}
        for name, words, changed, expected in (
            ("a.mp3", [], {}, [".wav, .flac, .opus or .ogg"]),
            ("a", [], {}, [".wav, .flac, .opus or .ogg"]),
            ("a.flac", ["--format", "float"], {}, ["16 or 24 bits", "--format pcm24"]),
            ("a.flac", [], {"output": {"format": "pcm32"}}, ["16 or 24 bits"]),
            ("a.flac", [], nine, ["at most 8 channels", "9", ".wav"]),
            ("a.flac", ["--rate", "88201"], {}, ["88201", "multiple of 10"]),
            ("a.opus", ["--rate", "44100"], {}, ["44100", "--rate 48000"]),
            ("a.opus", [], nine, ["one or two channels", "9"]),
            ("a.ogg", [], nine, ["one or two channels", "9"]),
            ("a.ogg", ["--format", "pcm16"], {}, ["no sample format"]),
        ):
            with self.subTest(name=name, words=words):
                (self.folder / name).unlink(missing_ok=True)
                error = self.render(name, *words, code=2, **changed)
                for part in [name, *expected]:
                    self.assertIn(part, error)
                self.assertFalse((self.folder / name).exists())


if __name__ == "__main__":
    unittest.main()
