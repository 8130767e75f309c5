#!/usr/bin/env python3
"""carillon-render from outside: a cube with known modes falls, the WAV is read by Python's wave module and looked at with numpy."""
import json
import math
import os
import pathlib
import struct
import subprocess
import tempfile
import unittest
import wave

import numpy as np

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
SOURCE = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"])
MODES_HZ = [820.0, 1730.0, 2950.0, 4410.0, 7020.0]  # of write_cube_bank


def render(*arguments):
    return subprocess.run([BIN / "carillon-render", *map(str, arguments)], capture_output=True, text=True, timeout=200)


def read_wav(file):
    """(rate, bytes per sample, (samples, 2) array of full scale 1)"""
    with wave.open(str(file)) as wav:
        assert wav.getnchannels() == 2
        width = wav.getsampwidth()
        raw = np.frombuffer(wav.readframes(wav.getnframes()), dtype=np.uint8).reshape(-1, width)
        value = sum(raw[:, i].astype(np.int64) << (8 * i) for i in range(width))
        value = np.where(value >= 1 << (8 * width - 1), value - (1 << (8 * width)), value)
        return wav.getframerate(), width, value.reshape(-1, 2) / float(1 << (8 * width - 1))


class RenderProgram(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        subprocess.run([BIN / "write_cube_bank", cls.root / "cube.h5"], check=True)
        (cls.root / "drop.json").write_text((SOURCE / "tests/host/scenes/drop.json").read_text())
        cls.run_ = render(cls.root / "drop.json", "-o", cls.root / "drop.wav", "--spectrogram", cls.root / "drop.png", "--trajectory",
                          cls.root / "path.json", "--report", cls.root / "report.json")
        assert cls.run_.returncode == 0, cls.run_.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def scene(self, name, **changes):
        """A cube that falls on the floor for half a second, changed."""
        scene = {"duration_s": 0.5, "ground": {"height_m": 0.0}, "listener": {"position_m": [0, -1, 0.2]},
                 "bodies": [{"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15], "rotation_deg": [20, 30, 0]}]}
        scene.update(changes)
        file = self.root / name
        file.write_text(json.dumps(scene, indent=1))
        return file

    def assert_refused(self, run, code, *words):
        self.assertEqual(run.returncode, code, run.stderr)
        self.assertTrue(run.stderr.startswith("carillon-render: "), run.stderr)
        for word in words:
            self.assertIn(word, run.stderr)

    def test_the_spectrum_has_its_peaks_at_the_frequencies_of_the_bank(self):
        rate, width, sound = read_wav(self.root / "drop.wav")
        self.assertEqual((rate, width, len(sound)), (48000, 3, 72000))
        spectrum = np.abs(np.fft.rfft(sound[:, 0] * np.hanning(len(sound)), 1 << 19))
        frequency = np.fft.rfftfreq(1 << 19, 1 / rate)
        for expected in MODES_HZ:
            near = (frequency > expected - 150) & (frequency < expected + 150)
            found = frequency[near][np.argmax(spectrum[near])]
            # Falling at about 3 m/s, seen from the side, the cube keeps its pitch to 0.3 %.
            self.assertLess(abs(found - expected), 0.003 * expected)
            self.assertGreater(spectrum[near].max(), 20 * np.median(spectrum[near]))

    def test_the_file_peaks_at_minus_one_decibel_and_both_ears_differ(self):
        _, _, sound = read_wav(self.root / "drop.wav")
        self.assertAlmostEqual(20 * math.log10(np.abs(sound).max()), -1.0, places=3)
        self.assertGreater(np.abs(sound[:, 0] - sound[:, 1]).max(), 0.01)

    def test_nothing_sounds_before_the_first_contact(self):
        rate, _, sound = read_wav(self.root / "drop.wav")
        path = json.loads((self.root / "path.json").read_text())
        first = min(i["time_s"] - i["duration_s"] / 2 for i in path["impulses"])
        self.assertGreater(first, 0.1)
        self.assertEqual(np.abs(sound[: int(first * rate)]).max(), 0.0)
        self.assertGreater(np.abs(sound[int(first * rate): int((first + 0.02) * rate)]).max(), 0.001)

    def test_the_trajectory_has_bodies_paths_and_impulses(self):
        path = json.loads((self.root / "path.json").read_text())
        self.assertEqual([b["name"] for b in path["bodies"]], ["cube", "shelf"])
        self.assertEqual([b["fixed"] for b in path["bodies"]], [False, True])
        self.assertTrue(pathlib.Path(path["bodies"][0]["bank"]).samefile(self.root / "cube.h5"))
        self.assertEqual(path["ground"], {"height_m": 0.0})
        poses = np.array(path["bodies"][0]["poses"])
        self.assertEqual(poses.shape[1], 8)
        self.assertLessEqual(len(poses), 302)
        self.assertTrue((np.diff(poses[:, 0]) > 0).all())
        self.assertAlmostEqual(poses[-1, 0], 1.5, places=3)
        # Free fall at the beginning: z = 0.4 - 0.5 t - 9.81 t^2 / 2.
        early = poses[poses[:, 0] < 0.1]
        np.testing.assert_allclose(early[:, 3], 0.4 - 0.5 * early[:, 0] - 4.905 * early[:, 0] ** 2, atol=2e-4)
        np.testing.assert_allclose(np.linalg.norm(poses[:, 4:], axis=1), 1.0, atol=1e-6)
        for impulse in path["impulses"]:
            self.assertLess(abs(impulse["world_m"][2]), 0.02)  # the floor is at 0
            self.assertGreater(impulse["impulse_n_s"], 0.0)

    def test_the_report_and_the_printed_figures_agree(self):
        report = json.loads((self.root / "report.json").read_text())
        self.assertEqual((report["bodies"], report["modes"]), (2, 10))
        self.assertGreater(report["contacts"], 0)
        self.assertEqual(report["impulses_refused"], 0)
        self.assertGreater(report["peak_pa"], 0.0)
        self.assertAlmostEqual(report["gain_per_pa"] * report["peak_pa"], 10 ** (-1 / 20), places=4)
        for word in ("bodies             2", "modes sounding     10", f"contacts           {report['contacts']}", "real-time factor", "peak ", "dB re 20 uPa"):
            self.assertIn(word, self.run_.stdout)
        self.assertIn("physics: 100 %", self.run_.stderr)
        self.assertIn("sound: 100 %", self.run_.stderr)

    def test_the_picture_is_a_png(self):
        png = (self.root / "drop.png").read_bytes()
        self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">II", png[16:24]), (1400, 900))

    def test_the_same_scene_gives_the_same_bytes(self):
        scene = self.scene("again.json")
        for name in ("one.wav", "two.wav"):
            self.assertEqual(render(scene, "-o", self.root / name, "-q").returncode, 0)
        self.assertEqual((self.root / "one.wav").read_bytes(), (self.root / "two.wav").read_bytes())

    def test_formats_and_rates_are_as_asked(self):
        scene = self.scene("formats.json")
        for arguments, expected in ((["--format", "pcm16"], (48000, 2)), (["--rate", "44100"], (44100, 3)), (["--rate", "8000", "--format", "pcm16"], (8000, 2))):
            run = render(scene, "-o", self.root / "format.wav", *arguments)
            self.assertEqual(run.returncode, 0, run.stderr)
            rate, width, sound = read_wav(self.root / "format.wav")
            self.assertEqual((rate, width), expected)
            self.assertEqual(len(sound), rate // 2)
        run = render(scene, "-o", self.root / "float.wav", "--format", "float")
        data = (self.root / "float.wav").read_bytes()
        self.assertEqual(struct.unpack("<H", data[20:22])[0], 3)  # IEEE float
        at = data.index(b"data")
        sound = np.frombuffer(data[at + 8: at + 8 + struct.unpack("<I", data[at + 4: at + 8])[0]], dtype="<f4")
        self.assertTrue(np.isfinite(sound).all())
        self.assertAlmostEqual(20 * math.log10(np.abs(sound).max()), -1.0, places=3)

    def test_a_given_gain_keeps_the_level_in_pascals(self):
        scene = self.scene("gain.json", output={"gain": 0.01})
        run = render(scene, "-o", self.root / "gain.wav", "--report", self.root / "gain-report.json")
        self.assertEqual(run.returncode, 0, run.stderr)
        peak_pa = json.loads((self.root / "gain-report.json").read_text())["peak_pa"]
        _, _, sound = read_wav(self.root / "gain.wav")
        self.assertAlmostEqual(np.abs(sound).max() / 0.01 / peak_pa, 1.0, places=3)

    def test_a_gain_that_would_clip_is_reduced_with_a_warning(self):
        run = render(self.scene("loud.json", output={"gain": 1e6}), "-o", self.root / "loud.wav")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("warning: the gain 1e+06 would clip", run.stderr)
        _, _, sound = read_wav(self.root / "loud.wav")
        self.assertLess(np.abs(sound).max(), 0.9)

    def test_a_scene_without_contacts_gives_a_silent_file_and_says_so(self):
        run = render(self.silent_scene(), "-o", self.root / "silent.wav", "--spectrogram", self.root / "silent.png")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("the file is silent", run.stdout)
        _, _, sound = read_wav(self.root / "silent.wav")
        self.assertEqual(len(sound), 24000)
        self.assertEqual(np.abs(sound).max(), 0.0)

    def silent_scene(self):
        scene = json.loads(self.scene("silent.json").read_text())
        del scene["ground"]
        (self.root / "silent.json").write_text(json.dumps(scene))
        return self.root / "silent.json"

    def test_bad_inputs_are_refused_before_anything_is_written(self):
        out = self.root / "never.wav"
        scene = self.scene("bad-bank.json", bodies=[{"name": "cube", "bank": "missing.h5"}])
        self.assert_refused(render(scene, "-o", out), 2, "bad-bank.json", '"cube"', "missing.h5")
        (self.root / "text.h5").write_text("not a bank")
        scene = self.scene("text-bank.json", bodies=[{"name": "cube", "bank": "text.h5"}])
        self.assert_refused(render(scene, "-o", out), 2, "text.h5")
        scene = self.scene("key.json", grond={"height_m": 0})
        self.assert_refused(render(scene, "-o", out), 2, "key.json:", "grond", "ground")
        self.assert_refused(render(self.root / "nowhere.json", "-o", out), 2, "nowhere.json")
        self.assert_refused(render(self.root, "-o", out), 2, str(self.root))
        scene = self.scene("overlap.json", bodies=[{"name": n, "bank": "cube.h5", "position_m": [x, x, 1], "rotation_deg": [x * 300, 0, 0]}
                                                for n, x in (("one", 0), ("two", 0.03))])
        self.assert_refused(render(scene, "-o", out), 2, "overlap.json", "one", "two")
        self.assertFalse(out.exists())

    def test_bad_outputs_are_found_before_the_simulation(self):
        scene = self.scene("outputs.json", duration_s=500)  # would take minutes
        self.assert_refused(render(scene, "-o", self.root), 2, "folder")
        self.assert_refused(render(scene, "-o", scene), 2, "overwrite the scene")
        self.assert_refused(render(scene, "-o", self.root / "cube.h5"), 2, 'overwrite the bank of "cube"')
        self.assert_refused(render(scene, "-o", self.root / "x.wav", "--report", self.root / "x.wav"), 2, "overwrite the WAV file")
        self.assert_refused(render(scene, "-o", self.root / "outputs.json" / "x.wav"), 2, "outputs.json")
        self.assert_refused(render(scene, "-o", self.root / "x.wav", "--spectrogram", "/proc/no/x.png"), 2, "/proc/no")
        self.assertFalse((self.root / "x.wav").exists())

    def test_a_wrong_command_line_is_explained(self):
        scene = self.scene("line.json")
        for arguments, word in (([scene], "--output"), ([scene, "-o", self.root / "x.wav", "--rate", "5"], "--rate"),
                                ([scene, "-o", self.root / "x.wav", "--format", "mp3"], "--format"), ([scene, "-o", self.root / "x.wav", "--lout"], "--lout")):
            run = render(*arguments)
            self.assertEqual(run.returncode, 2)
            self.assertIn(word, run.stderr)
        self.assertEqual(render("--help").returncode, 0)

    def test_nothing_is_left_behind(self):
        leftovers = [f.name for f in self.root.iterdir() if f.name.startswith(".") or "tmp" in f.name]
        self.assertEqual(leftovers, [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
