#!/usr/bin/python3
"""carillon-render for robot hearing: sensors, labels in both formats, and many scenes at once."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
RATE = 48000
BLOW_S = 0.1


def read_wav(file):
    """(rate, (frames, channels)) of a WAV file of 32-bit floats."""
    data = file.read_bytes()
    channels, rate = int.from_bytes(data[22:24], "little"), int.from_bytes(data[24:28], "little")
    begin = data.index(b"data") + 8
    return rate, numpy.frombuffer(data[begin:], "<f4").reshape(-1, channels).astype(float)


class HearingTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        subprocess.run([BIN / "write_cube_bank", cls.root / "cube.h5"], check=True)
        cls.scene = {
            "duration_s": 1.0,
            "ground": {"height_m": 0.0},
            "microphones": [[1.0, 0.0, 0.6]],
            "output": {"format": "float", "gain": 1e-3},
            "bodies": [
                {"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.3], "rotation_deg": [20, 30, 0]},
                {"name": "gong", "bank": "cube.h5", "position_m": [1, 0, 0.5], "fixed": True},
            ],
            "strikes": [{"time_s": BLOW_S, "body": "gong", "triangle": 2, "impulse_n_s": [0, 0, -0.01]}],
            "sensors": [
                {"name": "struck", "body": "gong", "triangle": 2, "direction": [0, 0, -1]},
                {"name": "falling", "body": "cube", "point_m": [0, 0, 0.05], "direction": [0, 0, 1], "quantity": "velocity"},
            ],
        }

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def write(self, name="scene.json", **changes):
        file = self.root / name
        file.write_text(json.dumps({**self.scene, **changes}))
        return file

    def render(self, *arguments, code=0):
        done = subprocess.run([BIN / "carillon-render", *map(str, arguments)], capture_output=True, text=True, timeout=60, cwd=self.root)
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stderr

    def test_a_click_is_on_the_frame_of_its_label(self):
        for rate in (None, 12800):
            changes = {} if rate is None else {"sensor_rate_hz": rate}
            self.render(self.write(**changes), "-o", "a.wav", "--labels", "a.npz")
            labels = numpy.load(self.root / "a.npz")
            hit = int(numpy.flatnonzero(labels["hit.body"] == 1)[0])
            self.assertEqual(int(labels["hit.frame"][hit]), round(BLOW_S * RATE))
            read_rate, read = read_wav(self.root / "a.sensors.wav")
            self.assertEqual(read_rate, rate or RATE)
            self.assertEqual(len(read), read_rate)
            begin = numpy.flatnonzero(numpy.abs(read[:, 0]) > 0.3 * numpy.abs(read[:, 0]).max())[0]
            self.assertLessEqual(abs(begin - labels["hit.time_s"][hit] * read_rate), 1.0)  # slower: of the low pass
            if rate is None:
                self.assertEqual(begin, numpy.argmax(numpy.abs(read[:, 0])))
                self.assertEqual(numpy.flatnonzero(read[:, 0])[0], labels["hit.frame"][hit])
        # The microphone hears it by the way of the sound later: its centre is 0.1 m away.
        sound = read_wav(self.root / "a.wav")[1][:, 0]
        onset = numpy.flatnonzero(numpy.abs(sound[: int(0.11 * RATE)]) > 0.02 * numpy.abs(sound).max())[0]
        self.assertLess(abs(onset - (BLOW_S + 0.1 / 343.0) * RATE), 4)

    def test_both_formats_hold_the_same(self):
        scene = self.write()
        self.render(scene, "-o", "b.wav", "--labels", "b.npz", "--record", "b.contacts.jsonl")
        self.render(scene, "-o", "b.wav", "--labels", "b.jsonl")
        labels = numpy.load(self.root / "b.npz")
        head, *rows = map(json.loads, (self.root / "b.jsonl").read_text().splitlines())
        self.assertEqual(head, {"carillon_labels": 1, "rate_hz": RATE, "frames": RATE, "bodies": ["cube", "gong"]})
        self.assertEqual([int(labels["rate_hz"]), int(labels["frames"])], [RATE, RATE])
        self.assertEqual([name.decode() for name in labels["bodies"]], ["cube", "gong"])
        for name in labels.files:
            table, _, column = name.partition(".")
            if column:
                listed = [row[table][column] for row in rows if table in row]
                numpy.testing.assert_array_equal(labels[name], numpy.array(listed, labels[name].dtype).reshape(labels[name].shape))
        self.assertGreater(len(labels["contact.id"]), 0)
        self.assertTrue(numpy.all(labels["contact.begin_s"] <= labels["contact.end_s"]))
        # Against the contacts file of the same run.
        recorded = [json.loads(line) for line in (self.root / "b.contacts.jsonl").read_text().splitlines()]
        touches = [line["contact"] for line in recorded if "contact" in line]
        self.assertEqual(len(touches), len(labels["touch.id"]))
        self.assertEqual({touch["id"] for touch in touches}, set(labels["contact.id"].tolist()))
        self.assertEqual(len([line for line in recorded if "motion" in line]), len(labels["pose.time_s"]))

    def test_simultaneous_pulses_in_pieces_stay_apart(self):
        lines = [{"carillon_contacts": 1, "bodies": [{"name": "cube", "triangles": 12}, {"name": "gong", "triangles": 12}]}]
        for piece in range(3):
            for triangle in (2, 4):  # as an impact at two points is recorded
                force = {"time_s": 0.2 + piece * 1e-3, "step_s": 1e-3, "body": 1, "other": -1, "triangle": triangle}
                force |= {"barycentric": [1, 0, 0], "impulse_n_s": [[0, 0, -1e-3 * triangle]], "continues": piece > 0}
                lines.append({"force": force})
        (self.root / "pieces.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        self.render(self.write(strikes=[]), "-o", "p.wav", "--labels", "p.npz", "--contacts", "pieces.jsonl")
        labels = numpy.load(self.root / "p.npz")
        self.assertEqual(labels["hit.triangle"].tolist(), [2, 4])
        numpy.testing.assert_allclose(labels["hit.impulse_n_s"][:, 2], [-6e-3, -12e-3], rtol=1e-6)
        numpy.testing.assert_allclose(labels["hit.time_s"], [0.2015, 0.2015], rtol=1e-6)

    def test_labels_are_of_newton_and_of_the_modes(self):
        self.render(self.write(), "-o", "c.wav", "--labels", "c.npz")
        labels = numpy.load(self.root / "c.npz")
        falls = labels["hit.body"] == 0
        self.assertTrue(numpy.all(labels["hit.effective_mass_kg"][~falls] == 0.0))  # held
        mass = labels["hit.effective_mass_kg"][falls]
        self.assertTrue(numpy.all((mass > 1 / 5.5 - 1e-9) & (mass <= 1.0 + 1e-9)), mass)  # 1 kg, (r x n)^2 at a corner is 4.5 I / m at most
        modes = labels["energy.modes_j"]
        self.assertEqual(modes.shape, (len(labels["energy.time_s"]), 2))
        self.assertLess(numpy.diff(labels["energy.time_s"]).max(), 0.0127)
        before = labels["energy.time_s"] < BLOW_S
        self.assertEqual(modes[before, 1].max(), 0.0)
        self.assertGreater(modes[~before, 1].max(), 0.0)

    def test_a_falling_body_reads_only_blows(self):
        self.render(self.write(gravity_m_s2=[0, 0, 0]), "-o", "d.wav", "--labels", "d.npz")
        self.assertEqual(numpy.abs(read_wav(self.root / "d.sensors.wav")[1][:, 1]).max(), 0.0)

    def test_many_scenes_and_one_that_fails(self):
        self.write("good.json")
        self.render("good.json", "-o", "alone.wav")
        runs = [{"scene": "good.json", "output": f"{i}.wav", "labels": f"{i}.npz"} for i in range(3)]
        runs.insert(1, {"scene": "missing.json", "output": "missing.wav"})
        (self.root / "manifest.json").write_text(json.dumps({"scenes": runs}))
        error = self.render("manifest.json", "--jobs", 2, code=2)
        self.assertIn("missing.json", error)
        self.assertIn("1 of 4 scenes failed", error)
        for i in range(3):
            for kind in (".wav", ".sensors.wav"):
                self.assertEqual((self.root / f"{i}{kind}").read_bytes(), (self.root / f"alone{kind}").read_bytes())
            self.assertIn("hit.frame", numpy.load(self.root / f"{i}.npz").files)
        self.assertFalse((self.root / "missing.wav").exists())
        runs[1] = {"scene": "good.json", "output": "0.wav"}
        (self.root / "twice.json").write_text(json.dumps({"scenes": runs}))
        self.assertIn("written twice", self.render("twice.json", "--jobs", 1, code=2))
        (self.root / "here").symlink_to(self.root)
        for more, words in (
            ({"output": "here/0.wav"}, "written twice"),
            ({"output": "0.sensors.wav"}, "0.sensors.wav is written twice"),
            ({"output": "0.flac"}, "0.sensors.wav is written twice"),
            ({"output": "0b.wav", "contacts": "0.npz"}, "is the contacts file that is played by files.json"),
            ({"output": "0b.wav", "report": "good.json"}, "is the scene of files.json"),
            ({"output": "0b.wav", "report": "files.json"}, "is the manifest"),
        ):
            (self.root / "files.json").write_text(json.dumps({"scenes": [runs[0], {"scene": "good.json", **more}]}))
            self.assertIn(words, self.render("files.json", "--jobs", 2, code=2))
        self.assertIn("--jobs", self.render("manifest.json", "--jobs", 2, "-o", "x.wav", code=2))
        self.assertIn('"scenes": is missing', self.render(self.write("s.json"), "--jobs", 2, code=2))

    def test_what_cannot_be_read_is_one_message(self):
        sensor = self.scene["sensors"][0]
        for change, words in (
            ({"body": "bell"}, "bell"),
            ({"quantity": "heat"}, "acceleration"),
            ({"triangle": 99}, "12; the first is 0"),
            ({"direction": [0, 0, 0]}, "direction"),
            ({"quantity": "strain", "triangle": 0}, "lies in the surface"),
            ({"point_m": [0, 0, 0]}, "either"),
        ):
            scene = self.write("bad.json", sensors=[{**sensor, **change}])
            message = self.render(scene, "-q", "-o", "bad.wav", code=2)
            self.assertIn(words, message)
            self.assertEqual(message.count("\n"), 1, message)
        self.assertIn("taken", self.render(self.write("bad.json", sensors=[sensor, sensor]), "-o", "x.wav", code=2))
        self.assertIn("-o", self.render(self.write(), "-o", "-", code=2))
        self.assertIn(".jsonl", self.render(self.write(), "-o", "x.wav", "--labels", "x.csv", code=2))
        self.assertIn("sensor_rate_hz", self.render(self.write("bad.json", sensors=[], sensor_rate_hz=100), "-o", "x.wav", code=2))


if __name__ == "__main__":
    unittest.main()
