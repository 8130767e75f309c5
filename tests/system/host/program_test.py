#!/usr/bin/env python3
"""carillon-render as a program: a cube with known modes falls; the WAV is read with Python's wave module and analysed with numpy.

One program on the same scene and bank; longer than most files."""
import json
import math
import os
import pathlib
import resource
import signal
import struct
import subprocess
import tempfile
import unittest
import wave

import h5py
import numpy as np
import scipy.io.wavfile

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
        (cls.root / "drop.json").write_text((SOURCE / "tests/unit/runtime/scene/scenes/drop.json").read_text())
        cls.run_ = render(
            cls.root / "drop.json",
            "-o",
            cls.root / "drop.wav",
            "--spectrogram",
            cls.root / "drop.png",
            "--trajectory",
            cls.root / "path.json",
            "--report",
            cls.root / "report.json",
        )
        assert cls.run_.returncode == 0, cls.run_.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def scene(self, name, **changes):
        """A cube that falls on the floor for half a second, with changed keys."""
        scene = {
            "duration_s": 0.5,
            "ground": {"height_m": 0.0},
            "listener": {"position_m": [0, -1, 0.2]},
            "bodies": [{"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15], "rotation_deg": [20, 30, 0]}],
        }
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
        # Between the first two hits, since several hits interfere.
        ringing = sound[int(0.22 * rate) : int(0.32 * rate), 0]
        spectrum = np.abs(np.fft.rfft(ringing * np.hanning(len(ringing)), 1 << 19))
        frequency = np.fft.rfftfreq(1 << 19, 1 / rate)
        for expected in MODES_HZ:
            near = (frequency > expected - 150) & (frequency < expected + 150)
            found = frequency[near][np.argmax(spectrum[near])]
            # Rising at about 1.5 m/s, seen from the side: pitch within 0.1 %.
            self.assertLess(abs(found - expected), 0.001 * expected)
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
        self.assertGreater(np.abs(sound[int(first * rate) : int((first + 0.02) * rate)]).max(), 0.001)

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
        # Free fall: z = 0.4 - 0.5 t - 9.81 t^2 / 2.
        early = poses[poses[:, 0] < 0.1]
        np.testing.assert_allclose(early[:, 3], 0.4 - 0.5 * early[:, 0] - 4.905 * early[:, 0] ** 2, atol=2e-4)
        np.testing.assert_allclose(np.linalg.norm(poses[:, 4:], axis=1), 1.0, atol=1e-6)
        for impulse in path["impulses"]:
            self.assertLess(abs(impulse["world_m"][2]), 0.02)  # floor height 0
            self.assertGreater(impulse["impulse_n_s"], 0.0)

    def test_the_report_and_the_printed_figures_agree(self):
        report = json.loads((self.root / "report.json").read_text())
        self.assertEqual((report["bodies"], report["modes"]), (2, 10))
        self.assertGreater(report["contacts"], 0)
        self.assertEqual(report["impulses_refused"], 0)
        self.assertGreater(report["peak_pa"], 0.0)
        self.assertAlmostEqual(report["gain_per_pa"] * report["peak_pa"], 10 ** (-1 / 20), places=4)
        for word in (
            "bodies             2",
            "modes sounding     10",
            f"contacts           {report['contacts']}",
            "real-time factor",
            "peak ",
            "dB re 20 uPa",
        ):
            self.assertIn(word, self.run_.stdout)
        self.assertIn("physics: 100 %", self.run_.stderr)
        self.assertIn("sound: 100 %", self.run_.stderr)

    def test_the_picture_is_a_png(self):
        png = (self.root / "drop.png").read_bytes()
        self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">II", png[16:24]), (1400, 900))

    def test_other_file_formats_are_refused_and_quiet_is_quiet(self):
        for name in ("out.mp3", "out.aiff", "out"):
            run = render(self.scene("named.json"), "-o", self.root / name)
            self.assertEqual(run.returncode, 2)
            self.assertRegex(run.stderr, rf"{name}: .*\.wav")
            self.assertFalse((self.root / name).exists())
        run = render(self.scene("named.json"), "-o", self.root / "quiet.WAV", "--report", self.root / "quiet.json", "-q")
        self.assertEqual((run.returncode, run.stdout, run.stderr), (0, "", ""))
        self.assertTrue((self.root / "quiet.WAV").exists())
        subprocess.run(
            [BIN / "carillon-bank", "edit", self.root / "cube.h5", self.root / "large.h5", "--size", "2"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        scene = {"bodies": [{"name": "cube", "bank": "large.h5", "position_m": [0, 0, 0.3]}]}
        run = render(self.scene("large.json", **scene), "-o", self.root / "large.wav")
        self.assertRegex(run.stdout, r"cube +no modes above \d{4,5} Hz")

    def test_the_same_scene_gives_the_same_bytes(self):
        scene = self.scene("again.json")
        for name in ("one.wav", "two.wav"):
            self.assertEqual(render(scene, "-o", self.root / name, "-q").returncode, 0)
        self.assertEqual((self.root / "one.wav").read_bytes(), (self.root / "two.wav").read_bytes())

    def test_formats_and_rates_are_as_requested(self):
        scene = self.scene("formats.json")
        cases = [
            (["--format", "pcm16"], (48000, 2)),
            (["--rate", "44100"], (44100, 3)),
            (["--rate", "8000", "--format", "pcm16"], (8000, 2)),
            (["--format", "pcm32"], (48000, 4)),
        ]
        for arguments, expected in cases:
            run = render(scene, "-o", self.root / "format.wav", *arguments)
            self.assertEqual(run.returncode, 0, run.stderr)
            rate, width, sound = read_wav(self.root / "format.wav")
            self.assertEqual((rate, width), expected)
            self.assertEqual(len(sound), (rate + 1) // 2)
            self.assertAlmostEqual(20 * math.log10(np.abs(sound).max()), -1.0, places=2)

    def test_an_invalid_rate_and_a_file_limit_are_reported(self):
        scene = self.scene("limits.json")
        run = render(scene, "-o", self.root / "limits.wav", "--rate", "47999.5")
        self.assertEqual(run.returncode, 2)
        self.assertIn("must be a whole number from 8000 to 192000, and is '47999.5'", run.stderr)
        limit = ["prlimit", "--fsize=20000", BIN / "carillon-render", scene, "-o", self.root / "limits.wav"]
        run = subprocess.run(limit, capture_output=True, text=True, check=False)
        self.assertEqual(run.returncode, 4, run.stderr)
        self.assertIn("File too large", run.stderr)
        self.assertFalse((self.root / "limits.wav").exists())

    def test_radiation_selects_the_gains(self):
        levels = {}
        for kind in ("osg02", "sphere"):
            scene = self.scene(f"{kind}.json", radiation=kind, output={"gain": 1e-6})
            run = render(scene, "-o", self.root / f"{kind}.wav", "--format", "float", "-q")
            self.assertEqual(run.returncode, 0, run.stderr)
            data = (self.root / f"{kind}.wav").read_bytes()
            sound = np.frombuffer(data[data.index(b"data") + 8 :], dtype="<f4").reshape(-1, 2)[:, 0]
            spectrum, frequency = np.abs(np.fft.rfft(sound * np.hanning(len(sound)))), np.fft.rfftfreq(len(sound), 1 / 48000)
            levels[kind] = [spectrum[abs(frequency - hz) < 0.05 * hz].max() for hz in MODES_HZ]
        with h5py.File(self.root / "cube.h5") as bank:
            osg02 = bank["modes/radiation_gain"][()]
        # Cube of side s, phi = a (1 + 0.07 corner): it translates and slightly breathes. At its first mode, ka = 1, it is louder than the
        # flow of its volume alone, s^2 0.07 a . (1, 2, 4), softer than the sum of the flows through both sides (rho0 omega flow / 4 pi).
        a, hz = np.array([0.4, 0.7, 1.1]), MODES_HZ[0]
        per_flow = 1.21 * hz / 2 / np.hypot(1, 2 * np.pi * hz / 343 * np.sqrt(6 * 0.01 / (4 * np.pi)))
        ratio = levels["sphere"][0] / levels["osg02"][0] * osg02[0] / per_flow
        self.assertGreater(ratio, 0.01 * 0.07 * a @ [1, 2, 4])
        self.assertLess(ratio, 0.01 * 2 * (1 + 0.07 * 3.5) * a.sum())
        self.assert_refused(render(self.scene("kind.json", radiation="sfere"), "-o", self.root / "x.wav"), 2, "radiation", "sphere")

    def test_a_plan_lists_effects_and_reasons_and_makes_no_sound(self):
        bodies = [
            {"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15], "rotation_deg": [20, 30, 0]},
            {"name": "shelf", "bank": "cube.h5", "fixed": True, "position_m": [3, 0, 0.5], "effects": {"on": ["acceleration_noise"]}},
        ]
        scene = self.scene("plan.json", bodies=bodies)
        run = render(scene, "--plan", "-q")
        self.assertEqual(run.returncode, 0, run.stderr)
        rows = {}
        for line in run.stdout.splitlines():
            if not line.startswith(" "):
                name = line.split(",")[0].split(":")[0]
            else:
                rows[name, line.split()[0]] = line
        for effect, words in {"modal": "audible, ", "doppler": "changes while it sounds", "hertz_pulse": "difference without it"}.items():
            self.assertIn(words, rows["cube", effect])
            self.assertRegex(rows["cube", effect], r"^  \w+ +on ")
        for body, effect, words in (
            ("cube", "rolling", "mm/s"),
            ("shelf", "modal", "no event for this body"),
            ("shelf", "doppler", "body and listener are at rest"),
            ("shelf", "acceleration_noise", "set by the scene"),
        ):
            self.assertIn(words, rows[body, effect])
        self.assert_refused(render(scene, "--plan", "-o", self.root / "x.wav"), 2, "--plan", "no sound")
        run = render(scene)
        self.assertEqual(run.returncode, 2)
        self.assertIn("--output is required", run.stderr)
        self.assertFalse((self.root / "x.wav").exists())

    def test_disabled_effects_do_no_work(self):
        bodies = [
            {"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15], "rotation_deg": [20, 30, 0]},
            {"name": "far", "bank": "cube.h5", "fixed": True, "position_m": [5, 0, 3]},
        ]
        scene = self.scene("off.json", bodies=bodies, effects={"off": ["doppler", "acceleration_noise", "contact_damping"]})
        run = render(scene, "-o", self.root / "off.wav", "--report", self.root / "off-report.json", "-q")
        self.assertEqual(run.returncode, 0, run.stderr)
        report = json.loads((self.root / "off-report.json").read_text())
        on = 0
        for body in report["per_body"]:
            self.assertEqual(len(body["effects"]), 14)
            for name, effect in body["effects"].items():
                if not effect["on"]:
                    self.assertEqual(effect["units"], 0, f"{body['name']} {name}")
                on += effect["on"] and effect["units"] > 0
        self.assertGreaterEqual(on, 3)
        cube, far = (body["effects"] for body in report["per_body"])
        self.assertFalse(any(effect["on"] for effect in far.values()))
        self.assertEqual(cube["doppler"]["why"], "set by the scene")
        self.assertTrue(cube["modal"]["on"])

    def test_microphones_paths_and_effects_are_rendered(self):
        for name, channels in (("microphones", 5), ("walk", 2)):
            (self.root / f"{name}.json").write_text((SOURCE / f"tests/unit/runtime/scene/scenes/{name}.json").read_text())
            run = render(self.root / f"{name}.json", "-o", self.root / f"{name}.wav", "--report", self.root / f"{name}-report.json", "-q")
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(json.loads((self.root / f"{name}-report.json").read_text())["channels"], channels)
            _, samples = scipy.io.wavfile.read(self.root / f"{name}.wav")  # above two channels an extensible header
            self.assertEqual(samples.shape, (24000, channels))
            self.assertTrue((abs(samples).max(axis=0) > 0).all())

    def test_a_gain_that_would_clip_is_reduced_with_a_warning(self):
        run = render(self.scene("loud.json", output={"gain": 1e6}), "-o", self.root / "loud.wav")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("warning: the gain 1e+06 would clip", run.stderr)
        _, _, sound = read_wav(self.root / "loud.wav")
        self.assertLess(np.abs(sound).max(), 0.9)

    def test_a_scene_without_contacts_is_silent_with_a_note(self):
        run = render(self.silent_scene(), "-o", self.root / "silent.wav", "--spectrogram", self.root / "silent.png")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("the file is silent", run.stdout)
        _, _, sound = read_wav(self.root / "silent.wav")
        self.assertEqual(len(sound), 24000)
        self.assertEqual(np.abs(sound).max(), 0.0)

    def test_a_strike_needs_no_physics(self):
        scene = self.scene(
            "struck.json",
            bodies=[{"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 0]}],
            strikes=[{"time_s": 0.1, "body": "cube", "point_m": [-0.05, -0.05, -0.05], "impulse_n_s": [0, 0, 2e-3]}],
        )
        files = ["--trajectory", self.root / "struck-path.json", "--report", self.root / "struck-report.json"]
        run = render(scene, "-o", self.root / "struck.wav", *files)
        self.assertEqual(run.returncode, 0, run.stderr)
        report, path = (json.loads((self.root / name).read_text()) for name in ("struck-report.json", "struck-path.json"))
        self.assertEqual((report["contacts"], report["impulses_played"], report["physics_steps"]), (1, 1, 0))
        self.assertEqual(path["bodies"][0]["poses"], [[0, 0, 0, 0, 1, 0, 0, 0]])
        self.assertEqual((path["impulses"][0]["other"], path["impulses"][0]["world_m"]), (-1, [-0.05, -0.05, -0.05]))

    def test_energy_balances_and_is_printed(self):
        scene = self.scene("books.json", duration_s=1.0)
        self.assertEqual(render(scene, "-o", self.root / "books-without.wav", "-q").returncode, 0)
        run = render(scene, "-o", self.root / "books.wav", "--report", self.root / "books-report.json", "--audit")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual((self.root / "books.wav").read_bytes(), (self.root / "books-without.wav").read_bytes())
        books = json.loads((self.root / "books-report.json").read_text())["energy"]
        with h5py.File(self.root / "cube.h5") as bank:
            mass_kg = float(bank["rigid/mass_kg"][()])
        self.assertAlmostEqual(
            books["start_j"] / (mass_kg * 9.81 * 0.15), 1.0, delta=1e-6
        )  # released at rest with its centre at that height
        self.assertGreater(books["max_modes_j"], 1e-6 * books["start_j"])
        self.assertGreater(books["lost_j"], 0.5 * books["start_j"])
        self.assertLess(abs(books["motion_j"] + books["modes_j"] + books["lost_j"] - books["start_j"]), 0.01 * books["start_j"])
        self.assertLess(books["difference_j"], 0.01 * books["start_j"])
        self.assertTrue(0.0 < books["radiated_j"] < books["lost_j"], books)
        for line in (
            "energy books       at the start ",
            "  motion           ",
            "  modes            ",
            "  lost             ",
            "  lifted           ",
            "  radiated         ",
            "depth              ",
            "  pushes           ",
            "hits               ",
            "impacts with modes ",
        ):
            self.assertIn("\n" + line, run.stdout)
        audit = json.loads((self.root / "books-report.json").read_text())["depth_and_hits"]
        self.assertEqual((audit["deepest"]["body"], audit["deepest"]["other"]), ("cube", None))
        self.assertGreater(audit["deepest"]["depth_m"], 0.0)
        self.assertGreater(audit["longest_impact_s"], 0.0)

    def test_radiated_energy_is_the_share_of_radiation_damping(self):
        # An ideal impulse J at the corner (-, -, -) gives each of the five modes (1.1 J)^2 / 2.
        # The radiated share is 2 pi g^2 / (rho c d), at most 1.
        strike = {"time_s": 0.1, "body": "cube", "point_m": [-0.05, -0.05, -0.05], "impulse_n_s": [0, 0, 2e-3]}
        given_j, decay_per_s = 5 * (1.1 * 2e-3) ** 2 / 2, 12.0
        for gain in (0.3, 3.0, 300.0):
            subprocess.run([BIN / "write_cube_bank", self.root / "radiates.h5", str(gain), str(decay_per_s)], check=True)
            scene = self.scene(
                "radiates.json",
                radiation="osg02",
                duration_s=1.0,
                bodies=[{"name": "cube", "bank": "radiates.h5", "fixed": True, "position_m": [0, 0, 0]}],
                strikes=[strike],
            )
            run = render(scene, "-o", self.root / "radiates.wav", "--report", self.root / "radiates-report.json", "--audit", "-q")
            self.assertEqual(run.returncode, 0, run.stderr)
            radiated_j = json.loads((self.root / "radiates-report.json").read_text())["energy"]["radiated_j"]
            expected_j = given_j * min(1.0, 2 * math.pi * gain**2 / (1.21 * 343 * decay_per_s))
            # The loss of a jump is summed over samples: at most half a sample too long, or d / rate of the energy.
            self.assertLess(radiated_j, (1 + decay_per_s / 48000) * expected_j)
            self.assertGreater(radiated_j, (1 - decay_per_s / 48000) * expected_j)

    def test_mallets_are_solved_reported_and_replayed_to_the_same_bytes(self):
        def strike(**mallet):
            return {"body": "cube", "point_m": [0.01, 0.02, 0.05], "mallet": {"mass_kg": 0.02, "speed_m_s": 1.5, **mallet}}

        strikes = [
            {"time_s": 0.2, **strike(radius_m=0.01, young_modulus_pa=2e9)},
            {"time_s": 0.1, **strike(felt={"stiffness_n_m_p": 1e8})},
            {"time_s": 0.3, "body": "cube", "triangle": 3, "impulse_n_s": [0, 0, 1.5]},
        ]
        fixed = [{"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 0]}]
        scene = self.scene("mallets.json", bodies=fixed, strikes=strikes)
        run = render(
            scene,
            "-o",
            self.root / "mallets.wav",
            "--report",
            self.root / "mallets-report.json",
            "--record",
            self.root / "mallets.jsonl",
            "--trajectory",
            self.root / "mallets-path.json",
        )
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("mallet             at 0.1 s on cube: ", run.stdout)
        self.assertIn('1.5 N s on "cube" with a "duration_s" of 0 puts ', run.stderr)
        report = json.loads((self.root / "mallets-report.json").read_text())
        self.assertEqual((report["impulses"], len(report["warnings"])), (3, 1))
        felt, hard = report["mallets"]
        self.assertEqual((felt["time_s"], hard["time_s"]), (0.1, 0.2))
        self.assertGreater(felt["contact_s"], hard["contact_s"])
        for blow in (felt, hard):
            self.assertAlmostEqual(blow["before_j"], 0.0225, places=9)
            self.assertAlmostEqual(sum(blow[part] for part in ("after_j", "motion_j", "modes_j", "lost_j")), blow["before_j"], delta=1e-6)
        self.assertGreater(len(json.loads((self.root / "mallets-path.json").read_text())["impulses"]), 3)
        replay = self.scene("mallets-again.json", bodies=fixed)
        run = render(replay, "-o", self.root / "mallets-again.wav", "--contacts", self.root / "mallets.jsonl")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual((self.root / "mallets.wav").read_bytes(), (self.root / "mallets-again.wav").read_bytes())
        strikes[0]["mallet"]["direction"] = [0, 0, 1]
        self.assert_refused(
            render(self.scene("away.json", bodies=fixed, strikes=strikes), "-o", self.root / "away.wav"),
            2,
            "away.json:",
            "towards the surface",
        )

    def test_equal_strikes_are_equal_without_variation(self):
        def hear(name, **changes):
            strikes = [
                {"time_s": t, "body": "cube", "point_m": [0.01, 0.02, 0.05], "impulse_n_s": [0, 0, -0.01], "duration_s": 2e-4}
                for t in (0.1, 1.1, 2.1, 3.1)
            ]
            scene = self.scene(
                name,
                duration_s=4.1,
                effects=["modal", "hertz_pulse"],
                output={"gain": 1e-3, "format": "pcm32"},
                strikes=strikes,
                **{"bodies": [{"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 0]}], **changes},
            )
            run = render(scene, "-o", self.root / f"{name}.wav")
            self.assertEqual(run.returncode, 0, run.stderr)
            return read_wav(self.root / f"{name}.wav")[2][4800:]

        def compare(pressure):  # level of each strike relative to the first, dB
            first = pressure[:47000]
            return [
                10 * np.log10(np.sum((pressure[n : n + 47000] - first) ** 2) / np.sum(first**2) + 1e-30) for n in (48000, 96000, 144000)
            ]

        self.assertLess(max(compare(hear("equal.json"))), -90)  # residue of earlier strikes
        varied = hear("varied.json", variation=1)
        self.assertGreater(min(compare(varied)), -30)
        self.assertLess(max(compare(varied)), 0)
        np.testing.assert_array_equal(varied, hear("again.json", variation=1))
        body = {"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 0], "variation": 0.1}
        self.assertLess(max(compare(hear("less.json", bodies=[body]))), min(compare(varied)))
        for wrong in (-0.1, 1.5, "much"):
            self.assert_refused(
                render(self.scene("vary.json", variation=wrong), "-o", self.root / "vary.wav"), 2, "vary.json:", "variation"
            )

    def test_a_strike_joins_the_contacts_of_the_physics_in_order_of_time(self):
        scene = self.scene(
            "struck-drop.json", strikes=[{"time_s": t, "body": "cube", "triangle": 3, "impulse_n_s": [0, 0, 1e-3]} for t in (0.4, 0.01)]
        )
        run = render(scene, "-o", self.root / "struck-drop.wav", "--trajectory", self.root / "struck-drop-path.json", "-q")
        self.assertEqual(run.returncode, 0, run.stderr)
        impulses = json.loads((self.root / "struck-drop-path.json").read_text())["impulses"]
        times = [i["time_s"] for i in impulses]
        # Found by start time; overlapping pulses have their middles in another order.
        self.assertTrue(all(b >= a - 0.5 * max(i["duration_s"] for i in impulses) for a, b in zip(times, times[1:])))
        self.assertEqual(times[0], 0.01)
        self.assertGreater(len(times), 2)

    def silent_scene(self):
        scene = json.loads(self.scene("silent.json").read_text())
        del scene["ground"]
        (self.root / "silent.json").write_text(json.dumps(scene))
        return self.root / "silent.json"

    def test_a_recording_replays_to_the_same_bytes_without_physics(self):
        # Two moving bodies, a fixed one and a strike are all restored from the file.
        scene = self.scene(
            "recorded.json",
            bodies=[
                {
                    "name": "cube",
                    "bank": "cube.h5",
                    "position_m": [0, 0, 0.15],
                    "rotation_deg": [20, 30, 0],
                    "angular_velocity_rad_s": [3, 1, 2],
                },
                {"name": "other", "bank": "cube.h5", "position_m": [0.3, 0, 0.1], "rotation_deg": [5, 30, 0]},
                {"name": "shelf", "bank": "cube.h5", "position_m": [-0.3, 0, 0.5], "fixed": True},
            ],
            strikes=[{"time_s": 0.05, "body": "shelf", "triangle": 2, "impulse_n_s": [0, 0, 0.01], "duration_s": 3e-4}],
        )
        file = self.root / "recorded.jsonl"
        run = render(scene, "-o", self.root / "recorded.wav", "--record", file, "--trajectory", self.root / "recorded_path.json")
        self.assertEqual(run.returncode, 0, run.stderr)
        # Audible physics: in the replay, the scene drops its cubes from elsewhere, without strikes.
        moved = json.loads(scene.read_text())
        moved["bodies"][0]["position_m"] = [0, 0, 0.4]
        del moved["strikes"]
        other = self.scene("moved.json", **moved)
        run = render(
            other,
            "--contacts",
            file,
            "-o",
            self.root / "replayed.wav",
            "--record",
            self.root / "again.jsonl",
            "--trajectory",
            self.root / "replayed_path.json",
            "--report",
            self.root / "replayed_report.json",
        )
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual((self.root / "replayed.wav").read_bytes(), (self.root / "recorded.wav").read_bytes())
        self.assertEqual((self.root / "again.jsonl").read_bytes(), file.read_bytes())
        self.assertEqual(
            json.loads((self.root / "replayed_path.json").read_text()), json.loads((self.root / "recorded_path.json").read_text())
        )
        self.assertEqual(json.loads((self.root / "replayed_report.json").read_text())["physics_steps"], 0)
        # Every line is plain JSON of the documented kinds.
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        self.assertEqual(lines[0]["events"], len(lines) - 1)
        self.assertEqual(
            {key for line in lines[1:] for key in line},
            {"mark", "force", "motion", "contact"} | {key for line in lines[1:] for key in line if key == "impulse"},
        )

    def test_a_handwritten_contacts_file_matches_a_strike(self):
        # One impulse on a fixed body equals the same strike in the scene.
        strike = {"time_s": 0.05, "triangle": 2, "impulse_n_s": [0, 0, 0.01], "duration_s": 3e-4}
        body = {"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.5], "fixed": True}
        struck = self.scene("struck.json", bodies=[body], strikes=[{**strike, "body": "cube"}])
        silent = self.scene("silent_by_itself.json", bodies=[body])
        self.assertEqual(render(struck, "-o", self.root / "struck.wav", "--record", self.root / "struck.jsonl").returncode, 0)
        triangles = json.loads((self.root / "struck.jsonl").read_text().splitlines()[0])["bodies"][0]["triangles"]
        time = json.loads([line for line in (self.root / "struck.jsonl").read_text().splitlines() if "impulse" in line][0])["impulse"][
            "time_s"
        ]
        header = {"carillon_contacts": 1, "bodies": [{"name": "cube", "triangles": triangles}]}
        hand = self.root / "hand.jsonl"
        hand.write_text(
            json.dumps(header)
            + "\n\n"
            + json.dumps({"impulse": {**strike, "body": 0, "time_s": time, "barycentric": [1 / 3, 1 / 3, 1 / 3]}})
            + "\n"
        )
        run = render(silent, "--contacts", hand, "-o", self.root / "hand.wav")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertEqual((self.root / "hand.wav").read_bytes(), (self.root / "struck.wav").read_bytes())

    def test_contacts_of_another_surface_are_refused(self):
        scene = self.scene("sized.json")
        file = self.root / "sized.jsonl"
        run = render(scene, "-o", self.root / "sized.wav", "--record", file)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertNotIn("warning", run.stderr)
        bank = BIN / "carillon-bank"
        subprocess.run(
            [bank, "edit", self.root / "cube.h5", self.root / "twice.h5", "--size", "2"], check=True, capture_output=True, timeout=60
        )
        subprocess.run(
            [bank, "edit", self.root / "cube.h5", self.root / "stiff.h5", "--stiffness", "2"], check=True, capture_output=True, timeout=60
        )
        body = json.loads(scene.read_text())["bodies"][0]
        wav = self.root / "sized_again.wav"
        twice = self.scene("twice.json", bodies=[{**body, "bank": "twice.h5", "position_m": [0, 0, 1]}])
        self.assert_refused(
            render(twice, "--contacts", file, "-o", wav), 2, "sized.jsonl", '"cube"', "0.1 x 0.1 x 0.1 m", "0.2 x 0.2 x 0.2 m"
        )
        self.assertFalse(wav.exists())
        stiff = self.scene("stiff.json", bodies=[{**body, "bank": "stiff.h5"}])
        run = render(stiff, "--contacts", file, "-o", wav)  # another material, the same surface
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertNotIn("warning", run.stderr)
        # The same size, with other triangle numbers.
        lines = file.read_text().splitlines(keepends=True)
        header = json.loads(lines[0])
        header["bodies"][0]["order_m"][1] += 0.001
        file.write_text(json.dumps(header) + "\n" + "".join(lines[1:]))
        self.assert_refused(render(scene, "--contacts", file, "-o", wav), 2, "sized.jsonl", "a different surface")
        # A file without sizes plays with a warning.
        for key in ("size_m", "order_m"):
            del header["bodies"][0][key]
        file.write_text(json.dumps(header) + "\n" + "".join(lines[1:]))
        run = render(twice, "--contacts", file, "-o", wav, "--report", self.root / "sized_report.json")
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("warning: " + str(file), run.stderr)
        self.assertIn("size_m", json.loads((self.root / "sized_report.json").read_text())["warnings"][0])

    def test_a_ground_in_other_units_is_a_warning(self):
        wav = self.root / "ground.wav"
        run = render(
            self.scene("soil.json", ground={"height_m": 0, "young_modulus_pa": 5e7, "density_kg_m3": 1800}, duration_s=0.05), "-o", wav
        )
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertNotIn("warning", run.stderr)
        run = render(self.scene("newtons.json", ground={"height_m": 0, "young_modulus_pa": 30000}, duration_s=0.05), "-o", wav)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("newtons.json:", run.stderr)
        self.assertIn("MPa", run.stderr)
        for value in (30, 1e-300, 1e300, 1e14):
            self.assert_refused(
                render(self.scene("no_ground.json", ground={"height_m": 0, "young_modulus_pa": value}), "-o", wav),
                2,
                "no_ground.json:",
                "young_modulus_pa",
            )

    def test_invalid_contacts_files_are_refused_and_named(self):
        scene = self.scene("bad_contacts.json", quality={"modes_in_impacts": False})
        file = self.root / "bad.jsonl"
        wav = self.root / "bad_contacts.wav"
        self.assertEqual(render(scene, "-o", self.root / "good.wav", "--record", file).returncode, 0)
        good = file.read_text()

        def refuse(text, *words):
            file.write_text(text)
            self.assert_refused(render(scene, "--contacts", file, "-o", wav), 2, "bad.jsonl", *words)
            self.assertFalse(wav.exists())

        lines = good.splitlines(keepends=True)
        refuse(good[: len(good) // 2])
        refuse("".join(lines[:-1]), "a part of the file is missing")
        refuse(good.replace('"cube"', '"sphere"', 1), '"sphere"', '"cube"')
        refuse(good.replace('"triangles": ', '"triangles": 1', 1), "triangles")
        refuse(lines[0].replace("}]", '}, {"name": "two", "triangles": 4}]') + "".join(lines[1:]), "2 bodies")
        refuse(good.replace('"time_s": 0.0', '"time_s": NaN', 1), "bad.jsonl:2:")
        refuse(good.replace('"rotation"', '"rotations"', 1), "bad.jsonl:2:", "rotation")
        hit = next(i for i, line in enumerate(lines) if '"impulse"' in line)
        for key, value in (
            ("impulse_n_s", [1e39, 0, 0]),
            ("duration_s", 1e6),
            ("duration_s", -1),
            ("body", 7),
            ("triangle", 4000),
            ("impulse_n_s", [None, 0, 0]),
            ("time_s", -5),
        ):
            event = json.loads(lines[hit])
            event["impulse"][key] = value
            refuse("".join(lines[:hit]) + json.dumps(event) + "\n" + "".join(lines[hit + 1 :]), f"bad.jsonl:{hit + 1}:")
        self.assert_refused(render(scene, "--contacts", self.root / "nowhere.jsonl", "-o", wav), 2, "nowhere.jsonl")
        file.write_text(good)
        self.assert_refused(render(scene, "--contacts", file, "--record", file, "-o", wav), 2, "would overwrite")
        self.assertEqual(file.read_text(), good)

    def test_invalid_inputs_are_refused_before_any_output(self):
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
        scene = self.scene(
            "overlap.json",
            bodies=[
                {"name": n, "bank": "cube.h5", "position_m": [x, x, 1], "rotation_deg": [x * 300, 0, 0]}
                for n, x in (("one", 0), ("two", 0.03))
            ],
        )
        self.assert_refused(render(scene, "-o", out), 2, "overlap.json", "one", "two")
        for change, word in (({"triangle": 12}, "has 12"), ({"point_m": [0, 0, 50]}, "49.95 m away")):
            scene = self.scene("strike.json", strikes=[{"time_s": 0.1, "body": "cube", "impulse_n_s": [0, 0, 1], **change}])
            self.assert_refused(render(scene, "-o", out), 2, "strike.json:", word)
        self.assertFalse(out.exists())

    def test_hostile_scenes_are_one_error_each(self):
        out = self.root / "never.wav"

        def refuse(text, *words):
            (self.root / "hostile.json").write_text(text)
            run = render(self.root / "hostile.json", "-o", out)
            self.assert_refused(run, 2, "hostile.json", *words)
            self.assertEqual(run.stderr.count("\n"), 1, run.stderr)  # exactly one line
            self.assertLess(len(run.stderr), 700)
            self.assertFalse(out.exists())

        def change(**changes):
            return self.scene("hostile.json", **changes).read_text()

        def change_body(**changes):
            return change(bodies=[{"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15], **changes}])

        good = change()
        for number in ("1e999", "NaN", "Infinity", "-1e999"):
            refuse(good.replace("0.15", number), "not JSON")
        for pose, word in (
            (None, "null"),
            ("high", "text"),
            ([0, 0], "list of 2"),
            ([0, 0, 1e30], "out of range"),
            ([0, 0, "1"], "text"),
            ([0, 0, None], "null"),
        ):
            refuse(change_body(position_m=pose), "hostile.json:", "position_m", word)
        refuse(change_body(quaternion=[0, 0, 0, 0]), "quaternion", "length 1")
        refuse(change_body(name="a\nb"), "name", "control")
        refuse(change_body(name="x" * 100000), "name", "200")
        refuse(change_body(name=""), "name", "empty")
        refuse(change_body(position_m=[0, 0, 0.02]), "inside the ground", "raise it")
        cube = {"name": "cube", "bank": "cube.h5", "position_m": [0, 0, 0.15]}
        refuse(change(bodies=[cube, {**cube, "position_m": [1, 0, 0.15]}]), "bodies[1].name", "another name")
        refuse(change(bodies=[cube, {**cube, "name": "twin"}]), "cube", "twin", "inside each other")
        for ground in ({"young_modulus_pa": -1}, {"density_kg_m3": 0}, {"density_kg_m3": -2400}, {"friction": -1}):
            refuse(change(ground=ground), "hostile.json:", "ground." + next(iter(ground)))
        refuse(good + "\0", "zero byte")
        refuse("[" * 100000, "brackets")
        refuse("", "not JSON")

    def test_too_many_bodies_are_refused_quickly(self):
        out = self.root / "never.wav"
        for count, words in (
            (1001, ["1001 bodies", "at most 1000"]),
            (100000, ["100000 bodies", "at most 1000"]),
            (1000000, ["too many for a JSON file", "a scene may hold 1000 bodies"]),
        ):
            bodies = ", ".join('{"name": "b%d", "bank": "cube.h5"}' % i for i in range(count))
            (self.root / "crowd.json").write_text('{"duration_s": 1, "bodies": [%s]}' % bodies)
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            self.assert_refused(render(self.root / "crowd.json", "-o", out), 2, "crowd.json", *words)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            self.assertLess(after.ru_utime - before.ru_utime, 10.0)
            self.assertLess(after.ru_maxrss, 600 * 1024)  # KiB, largest child so far
        (self.root / "crowd.json").unlink()

    def test_a_microphone_in_the_middle_of_a_body_hears_a_finite_sound(self):
        scene = self.scene(
            "inside.json",
            bodies=[{"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 1]}],
            listener=None,
            strikes=[{"time_s": 0.1, "body": "cube", "triangle": 1, "impulse_n_s": [0, 0, -0.01]}],
            microphones=[[0, 0, 1], [0, 0, 2]],
        )
        document = json.loads(scene.read_text())
        del document["listener"]
        scene.write_text(json.dumps(document))
        run = render(scene, "-o", self.root / "inside.wav", "--report", self.root / "inside-report.json", "-q")
        self.assertEqual(run.returncode, 0, run.stderr)
        report = json.loads((self.root / "inside-report.json").read_text())
        self.assertTrue(math.isfinite(report["peak_pa"]))
        _, _, sound = read_wav(self.root / "inside.wav")
        # Distances are at least 5 cm: 20 times the pressure at 1 m.
        self.assertAlmostEqual(np.abs(sound[:, 0]).max() / np.abs(sound[:, 1]).max(), 20.0, delta=1.0)

    def struck_scene(self, name, duration, **changes):
        """Two fixed cubes that ring for seconds, ten strikes per second until half a second before the end."""
        strikes = [
            {"time_s": 0.1 * i + 0.05, "body": "ab"[i % 2], "triangle": i % 12, "impulse_n_s": [0, 0, -0.01], "duration_s": 1e-4}
            for i in range(int(10 * duration) - 4)
        ]
        bodies = [{"name": n, "bank": "cube.h5", "fixed": True, "position_m": [x, 0, 1]} for n, x in (("a", 0), ("b", 0.5))]
        return self.scene(name, duration_s=duration, bodies=bodies, strikes=strikes, **changes)

    def test_memory_does_not_grow_with_the_length(self):
        peaks = {}
        for seconds in (6, 240):
            scene = self.scene(f"long-{seconds}.json", duration_s=seconds)
            # From a contacts file: a body that swings, hits and slides, with 100 records of each per second.
            with (self.root / "long.jsonl").open("w") as file:
                file.write(json.dumps({"carillon_contacts": 1, "bodies": [{"name": "cube", "triangles": 12}]}) + "\n")
                for i in range(100 * seconds + 1):
                    t = 0.01 * i
                    file.write(
                        json.dumps(
                            {
                                "motion": {
                                    "time_s": t,
                                    "body": 0,
                                    "position_m": [math.sin(t), 0.0, 0.2],
                                    "velocity_m_s": [math.cos(t), 0.0, 0.0],
                                    "rotation": [1.0, 0.0, 0.0, 0.0],
                                }
                            }
                        )
                        + "\n"
                    )
                    state = "begin" if i == 0 else "hold"
                    file.write(
                        json.dumps(
                            {
                                "contact": {
                                    "time_s": t,
                                    "id": 1,
                                    "body": 0,
                                    "triangle": 1,
                                    "state": state,
                                    "barycentric": [1.0, 0.0, 0.0],
                                    "normal": [0.0, 0.0, 1.0],
                                    "slip_m_s": [0.1, 0.0, 0.0],
                                    "force_n": 1.0,
                                    "sweep_m_s": 0.1,
                                    "other_sweep_m_s": 0.1,
                                    "spin_rad_s": 0.0,
                                    "patch_radius_m": 1e-5,
                                }
                            }
                        )
                        + "\n"
                    )
                    if i % 10 == 5:
                        file.write(
                            json.dumps(
                                {
                                    "impulse": {
                                        "time_s": t,
                                        "body": 0,
                                        "triangle": 3,
                                        "barycentric": [1.0, 0.0, 0.0],
                                        "impulse_n_s": [0.0, 0.0, 0.01],
                                        "duration_s": 1e-4,
                                    }
                                }
                            )
                            + "\n"
                        )
            child = subprocess.Popen(
                [
                    BIN / "carillon-render",
                    scene,
                    "--contacts",
                    self.root / "long.jsonl",
                    "-o",
                    self.root / "long.wav",
                    "--report",
                    self.root / "long-report.json",
                    "--trajectory",
                    self.root / "long-path.json",
                    "--spectrogram",
                    self.root / "long.png",
                    "--record",
                    self.root / "long-again.jsonl",
                    "--audit",
                    "-q",
                ],
                stdout=subprocess.DEVNULL,
            )
            _, status, usage = os.wait4(child.pid, 0)
            self.assertEqual(os.waitstatus_to_exitcode(status), 0)
            child.returncode = 0
            peaks[seconds] = usage.ru_maxrss / 1024  # MiB
            self.assertEqual((self.root / "long.wav").stat().st_size, 44 + 6 * 48000 * seconds)
            self.assertGreater(sum(1 for _ in (self.root / "long-again.jsonl").open()), 200 * seconds)
        # The sound alone takes 176 MiB as floats. Each list may keep 4 MiB in memory; heap fragmentation is lost.
        self.assertLess(peaks[240] - peaks[6], 32.0, peaks)

    def test_a_sound_that_is_cut_off_fades_with_a_note(self):
        raw = self.struck_scene("raw.json", 1.0, output={"fade_end": False})
        faded = self.struck_scene("faded.json", 1.0)
        silent = self.scene("still.json", bodies=[{"name": "cube", "bank": "cube.h5", "fixed": True, "position_m": [0, 0, 1]}])
        runs = {}
        for scene in (raw, faded, silent):
            runs[scene.stem] = render(scene, "-o", scene.with_suffix(".wav"), "--report", scene.with_suffix(".report"))
            self.assertEqual(runs[scene.stem].returncode, 0, runs[scene.stem].stderr)
        report = {name: json.loads((self.root / f"{name}.report").read_text()) for name in runs}
        self.assertEqual([report[name]["faded_end_s"] for name in ("raw", "faded", "still")], [0, 0.01, 0])
        self.assertIn("faded within the last 10 ms", runs["faded"].stdout)
        for name in ("raw", "still"):
            self.assertNotIn("faded", runs[name].stdout)

    def test_the_sound_goes_to_standard_output(self):
        scene = self.struck_scene("out.json", 2.0)
        for arguments in ([], ["--format", "float"], ["--format", "pcm16", "--rate", "8000"]):
            self.assertEqual(render(scene, "-o", self.root / "out.wav", *arguments, "-q").returncode, 0)
            run = subprocess.run(
                [BIN / "carillon-render", scene, "-o", "-", "--report", self.root / "out.report", *arguments],
                capture_output=True,
                cwd=self.root,
                timeout=200,
            )
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(run.stdout, (self.root / "out.wav").read_bytes())
            self.assertIn(b"real-time factor", run.stderr)
            self.assertFalse((self.root / "-").exists())
        # A closed output pipe gives one error, no signal, and no partial files.
        (self.root / "out.report").unlink()
        child = subprocess.Popen(
            [BIN / "carillon-render", self.struck_scene("gone.json", 10.0), "-o", "-", "--report", self.root / "out.report", "-q"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            cwd=self.root,
        )
        child.stdout.close()
        message = child.stderr.read().decode()
        child.stderr.close()
        self.assertEqual(child.wait(timeout=200), 4, message)
        self.assertIn("carillon-render: standard output", message)
        self.assertFalse((self.root / "out.report").exists())

    def test_a_full_disk_is_one_error_and_leaves_nothing(self):
        scene = self.struck_scene("full.json", 30.0)

        def limit(size):
            def apply():
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

            return apply

        before = sorted(f.name for f in self.root.iterdir())
        for size in (5 << 20, 9 << 20):  # 11.5 MB while rendering, 8.6 MB for the file
            run = subprocess.run(
                [
                    BIN / "carillon-render",
                    scene,
                    "-o",
                    self.root / "full.wav",
                    "--report",
                    self.root / "full.report",
                    "--format",
                    "pcm32",
                    "-q",
                ],
                capture_output=True,
                text=True,
                timeout=200,
                preexec_fn=limit(size),
                restore_signals=False,
            )
            self.assert_refused(run, 4, "File too large")
            self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
            self.assertEqual(sorted(f.name for f in self.root.iterdir()), before)

    def test_no_partial_files_after_any_end(self):
        scene = self.struck_scene("killed.json", 600.0)
        before = sorted(f.name for f in self.root.iterdir())
        for how in (signal.SIGKILL, signal.SIGTERM):
            child = subprocess.Popen(
                [BIN / "carillon-render", scene, "-o", self.root / "killed.wav"],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
            for line in child.stderr:
                if line.startswith("sound: 25"):
                    break
            child.send_signal(how)
            child.stderr.close()
            self.assertEqual(child.wait(timeout=60), -how)
            self.assertEqual(sorted(f.name for f in self.root.iterdir()), before)

    def test_invalid_outputs_are_found_before_the_simulation(self):
        scene = self.scene("outputs.json", duration_s=500)  # would take minutes
        self.assert_refused(render(scene, "-o", self.root), 2, "folder")
        self.assert_refused(render(scene, "-o", scene), 2, "overwrite the scene")
        self.assert_refused(render(scene, "-o", self.root / "cube.h5"), 2, 'overwrite the bank of "cube"')
        self.assert_refused(render(scene, "-o", self.root / "x.wav", "--report", self.root / "x.wav"), 2, "overwrite the sound file")
        self.assert_refused(render(scene, "-o", self.root / "outputs.json" / "x.wav"), 2, "outputs.json")
        self.assert_refused(render(scene, "-o", self.root / "x.wav", "--spectrogram", "/proc/no/x.png"), 2, "/proc/no")
        self.assertFalse((self.root / "x.wav").exists())

    def test_a_wrong_command_line_is_explained(self):
        scene = self.scene("line.json")
        for arguments, word in (
            ([scene], "--output"),
            ([scene, "-o", self.root / "x.wav", "--rate", "5"], "--rate"),
            ([scene, "-o", self.root / "x.wav", "--format", "mp3"], "--format"),
            ([scene, "-o", self.root / "x.wav", "--lout"], "--lout"),
        ):
            run = render(*arguments)
            self.assertEqual(run.returncode, 2)
            self.assertIn(word, run.stderr)
        self.assertEqual(render("--help").returncode, 0)

    def test_nothing_is_left_behind(self):
        leftovers = [f.name for f in self.root.iterdir() if f.name.startswith(".") or "tmp" in f.name]
        self.assertEqual(leftovers, [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
