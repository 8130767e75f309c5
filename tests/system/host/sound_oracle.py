#!/usr/bin/python3
"""A mute cube falls with one corner on a fixed cube that sounds. What carillon-render writes is compared, sample by sample, with
docs/equations.md E4 to E6 worked out here in numpy from the bank (read with h5py) and the hit: nothing of our code takes part in what is
expected."""
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

import h5py
import numpy as np

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
RESTITUTION = 0.6
GAIN = 1e-4  # full scale per Pa
LISTENER = np.array([0.4, -2.0, 0.3])
TURN_DEG = (46.0, 34.0)  # about x, then y: nearly along the space diagonal, so it bounces without tipping over at once
FALL_FROM = np.array([0.013, -0.007, 0.4])
SOUND_SPEED = 343.0


def read_float_wav(file):
    """(rate, (samples, 2)) of a float WAV, chunk by chunk."""
    data = file.read_bytes()
    assert data[:4] == b"RIFF" and data[8:12] == b"WAVE" and int.from_bytes(data[4:8], "little") == len(data) - 8
    at, chunks = 12, {}
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        chunks[data[at : at + 4]] = data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    fmt = chunks[b"fmt "]
    assert int.from_bytes(fmt[0:2], "little") == 3 and int.from_bytes(fmt[2:4], "little") == 2
    return int.from_bytes(fmt[4:8], "little"), np.frombuffer(chunks[b"data"], "<f4").reshape(-1, 2).astype(float)


def rotation():
    a, b = np.radians(TURN_DEG)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return about_y @ about_x


class Bank:
    def __init__(self, file):
        with h5py.File(file) as h:
            self.vertices = h["mesh/vertices"][()]
            self.triangles = h["mesh/triangles"][()]
            self.shape = h["modes/shape"][()] * h["modes/shape_scale"][()][None, :, None]
            self.eigenvalue = h["modes/eigenvalue"][()]
            self.decay = h["modes/decay"][()]
            self.gain = h["modes/radiation_gain"][()]
            self.mass = float(h["rigid/mass_kg"][()])
            self.inertia = h["rigid/inertia_kg_m2"][()]

    def shape_at_top(self, point):
        """phi (modes, 3) at a point of the upper face."""
        for t in self.triangles:
            corners = self.vertices[t]
            if not np.allclose(corners[:, 2], 0.05):
                continue
            weights = np.linalg.solve(np.vstack([corners[:, :2].T, np.ones(3)]), [point[0], point[1], 1.0])
            if weights.min() >= -1e-9:
                return np.einsum("c,cmk->mk", weights, self.shape[t])
        raise AssertionError(f"{point} is not on the upper face")


class OneHit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        subprocess.run([BIN / "write_cube_bank", cls.root / "anvil.h5"], check=True)
        subprocess.run([BIN / "write_cube_bank", cls.root / "mute.h5", "0"], check=True)
        contact = {"restitution": RESTITUTION, "friction": 0}
        scene = {
            "duration_s": 0.45,
            "radiation": "osg02",
            "quality": {"modes_in_impacts": False},
            "effects": ["modal", "hertz_pulse", "air_delay", "doppler", "two_ears"],
            "bodies": [
                {"name": "anvil", "bank": "anvil.h5", "fixed": True, **contact},
                {"name": "mute", "bank": "mute.h5", "position_m": FALL_FROM.tolist(), "rotation_deg": [*TURN_DEG, 0], **contact},
            ],
            "listener": {"position_m": LISTENER.tolist(), "facing": [0, 1, 0]},
            "output": {"gain": GAIN, "format": "float", "fade_end": False},
        }
        (cls.root / "scene.json").write_text(json.dumps(scene))
        cls.bank = Bank(cls.root / "anvil.h5")
        cls.sounds = {}
        for rate in (8000, 48000, 192000):
            run = subprocess.run(
                [
                    BIN / "carillon-render",
                    cls.root / "scene.json",
                    "-o",
                    cls.root / f"{rate}.wav",
                    "--rate",
                    str(rate),
                    "-q",
                    "--trajectory",
                    cls.root / "path.json",
                ],
                capture_output=True,
                text=True,
                timeout=200,
            )
            assert run.returncode == 0 and "warning" not in run.stderr, run.stderr
            got, sound = read_float_wav(cls.root / f"{rate}.wav")
            assert got == rate and len(sound) == round(0.45 * rate)
            cls.sounds[rate] = sound / GAIN
        hits = [i for i in json.loads((cls.root / "path.json").read_text())["impulses"] if i["body"] == 0]
        cls.hit, cls.next_s = hits[0], min([h["time_s"] for h in hits[1:]] + [0.45])

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_hit_has_the_time_and_the_impulse_of_the_closed_form(self):
        turn = rotation()
        corners = self.bank.vertices @ turn.T
        lowest = corners[np.argmin(corners[:, 2])]
        gap = FALL_FROM[2] + lowest[2] - 0.05
        self.assertAlmostEqual(self.hit["time_s"] - 0.5 * self.hit["duration_s"], np.sqrt(2 * gap / 9.81), delta=1e-5)
        normal = np.array([0, 0, 1.0])
        inverse = np.linalg.inv(turn @ self.bank.inertia @ turn.T)
        mobility = 1 / self.bank.mass + normal @ np.cross(inverse @ np.cross(lowest, normal), lowest)
        self.assertAlmostEqual(self.hit["impulse_n_s"] * mobility / ((1 + RESTITUTION) * np.sqrt(2 * 9.81 * gap)), 1.0, delta=1e-3)
        np.testing.assert_allclose(self.hit["world_m"], [*(FALL_FROM + lowest)[:2], 0.05], atol=1e-5)

    def calc_expected(self, rate, ear, times):
        """Pressure after the pulse, at an ear (-1 left, +1 right)."""
        bank, hit = self.bank, self.hit
        sounding = np.sqrt(bank.eigenvalue) < np.pi * rate
        distance = np.linalg.norm(LISTENER + [0.1 * ear, 0, 0])
        begin, tau = hit["time_s"] - 0.5 * hit["duration_s"], hit["duration_s"]
        x = (np.arange(4000) + 0.5) / 4000
        pulse = np.sin(np.pi * x) ** 1.5
        pulse /= pulse.sum()
        total = np.zeros_like(times)
        force = bank.shape_at_top(hit["world_m"]) @ [0, 0, -hit["impulse_n_s"]]
        for m in np.flatnonzero(sounding):
            d = bank.decay[m]
            root = -d + 1j * np.sqrt(bank.eigenvalue[m] - d * d)
            spectrum = (pulse * np.exp(-root * tau * x)).sum()
            local = times - distance / SOUND_SPEED - begin
            total += bank.gain[m] * force[m] / distance * np.real((1 + 1j * d / root.imag) * spectrum * np.exp(root * np.maximum(local, 0)))
        return total, begin + distance / SOUND_SPEED

    def test_every_sample_matches_the_equations_at_every_rate(self):
        for rate, sound in self.sounds.items():
            for column, ear in ((0, -1), (1, 1)):
                times = np.arange(len(sound)) / rate
                expected, arrival = self.calc_expected(rate, ear, times)
                before = times < arrival - 17 / rate
                self.assertEqual(np.abs(sound[before, column]).max(), 0.0, "sound before the contact can be heard")
                after = (times > arrival + self.hit["duration_s"] + 24 / rate) & (times < self.next_s)
                self.assertGreater(after.sum(), 0.05 * rate)
                error = np.sqrt(np.mean((sound[after, column] - expected[after]) ** 2) / np.mean(expected[after] ** 2))
                self.assertLess(error, 2e-3, f"{rate} Hz, ear {ear}")  # 0.02 dB and 2e-3 rad

    def test_each_mode_has_its_frequency_its_decay_and_its_level(self):
        rate, sound = 48000, self.sounds[48000][:, 0]
        expected, arrival = self.calc_expected(rate, -1, np.arange(len(sound)) / rate)
        start, length = int((arrival + 2e-3) * rate), int(0.05 * rate)
        window = np.hanning(length)
        for m, eigenvalue in enumerate(self.bank.eigenvalue):
            omega = np.sqrt(eigenvalue - self.bank.decay[m] ** 2) / rate

            def component(signal, at):
                n = np.arange(at, at + length)
                return (signal[n] * window * np.exp(-1j * omega * n)).sum()

            step = int(0.05 * rate)
            self.assertLess((start + step + length) / rate, self.next_s)
            ratio = component(sound, start + step) / component(sound, start)
            self.assertAlmostEqual(-np.log(abs(ratio)) * rate / step, self.bank.decay[m], delta=0.05)
            self.assertAlmostEqual(np.angle(ratio) * rate / step / (2 * np.pi), 0.0, delta=0.02)  # difference in Hz
            level = 20 * np.log10(abs(component(sound, start) / component(expected, start)))
            self.assertLess(abs(level), 0.05, f"mode {m}: {level} dB off")


if __name__ == "__main__":
    unittest.main(verbosity=2)
