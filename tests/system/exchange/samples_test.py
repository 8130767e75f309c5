#!/usr/bin/python3
"""carillon-samples, from outside: the SFZ file by a parser of its own, the samples against scenes of the same blows, and the whole played
by a sampler: Polyphone reads the SFZ, FluidSynth plays what it made of it.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import os
import pathlib
import re
import struct
import subprocess
import tempfile
import unittest

import h5py
import numpy

from banks import BIN, calc_db, fixtures, read_wav, run


def parse_sfz(text):
    """The regions, each with what group and global give it."""
    levels, regions = {"global": {}, "group": {}}, []
    text = re.sub(r"//[^\n]*", "", text)
    for kind, body in re.findall(r"<(\w+)>([^<]*)", text):
        keys = dict(re.findall(r"(\w+)=(.*?)(?=\s+\w+=|\s*$)", body, re.S))
        if kind == "region":
            regions.append({**levels["global"], **levels["group"], **keys})
        else:
            assert kind in levels, kind
            levels[kind] = keys
            if kind == "global":
                levels["group"] = {}
    return regions


def make_midi(notes):
    """A MIDI file, 480 ticks a quarter at 120 a minute: (seconds, key, velocity)."""
    events, last = b"", 0
    for time, key, velocity in notes:
        tick = int(960 * time)
        delta, last = tick - last, tick
        groups = [delta & 127]
        while delta > 127:
            delta >>= 7
            groups.append(128 | delta & 127)
        events += bytes(reversed(groups)) + bytes((0x90, key, velocity))
    events += b"\x8f\x00\xff\x2f\x00"
    return struct.pack(">4sIHHH4sI", b"MThd", 6, 0, 1, 480, b"MTrk", len(events)) + events


class SamplesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.place.name)
        cls.bank = fixtures.copy("aluminium_bar.hdf", cls.folder, "bar.hdf")
        cls.out = cls.make(cls.bank, "bar", "--places 2 --layers 3 --mallets hard-wood,soft-felt --round-robin 2 --seconds 1.5")
        cls.regions = parse_sfz((cls.folder / "bar" / "bar.sfz").read_text())

    @classmethod
    def make(cls, bank, folder, options):
        return run(BIN / "carillon-samples", bank, "-o", folder, "-q", *options.split(), cwd=cls.folder).stdout

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_every_velocity_of_every_key_has_its_sample(self):
        self.assertEqual(self.out, "")
        self.assertEqual(len(self.regions), 2 * 3 * 2 * 2)
        played = {}
        for region in self.regions:
            self.assertEqual(region["loop_mode"], "one_shot")
            self.assertEqual(region["pitch_keytrack"], "0")
            self.assertEqual(region["lokey"], region["hikey"])
            self.assertTrue((self.folder / "bar" / region["sample"]).is_file())
            for velocity in range(int(region["lovel"]), int(region["hivel"]) + 1):
                played.setdefault((int(region["lokey"]), velocity), []).append(int(region["seq_position"]))
        self.assertEqual(sorted({key for key, _ in played}), [36, 37, 38, 39])
        for key in range(36, 40):
            for velocity in range(1, 128):
                self.assertEqual(sorted(played[key, velocity]), [1, 2], (key, velocity))

    def test_a_sample_is_the_sound_of_the_blow(self):
        with h5py.File(self.bank) as file:
            centre = file["rigid/centre_m"][:]
        text = (self.folder / "bar" / "bar.sfz").read_text()
        full_scale = float(re.search(r"velocity 127 is (\S+) Pa", text)[1])
        point = list(map(float, re.search(r"// soft-felt, at (\S+), (\S+), (\S+) m", text).groups()))
        region = next(r for r in self.regions if "soft-felt-1" in r["sample"] and int(r["hivel"]) == 127 and r["seq_position"] == "1")
        velocity = int(re.search(r"-v(\d+)", region["sample"])[1])
        self.assertTrue(int(region["lovel"]) <= velocity <= 127)
        scene = {
            "duration_s": 1.5,
            "bodies": [{"name": "bar", "bank": str(self.bank), "fixed": True, "effects": ["modal", "hertz_pulse"]}],
            "strikes": [
                {"time_s": 0, "body": "bar", "point_m": point, "mallet": {"from": "soft-felt", "speed_m_s": 2 * (velocity / 127) ** 2}}
            ],
            "microphones": [[centre[0] + 1, centre[1], centre[2]]],
            "output": {"gain": 1e-3, "format": "float"},
        }
        (self.folder / "blow.json").write_text(json.dumps(scene))
        run(BIN / "carillon-render", "blow.json", "-o", "blow.wav", "-q", cwd=self.folder)
        pascals = 1e3 * read_wav(self.folder / "blow.wav")[0][:, 0]
        sample, rate = read_wav(self.folder / "bar" / region["sample"])
        self.assertEqual(rate, 48000)
        ours = sample[:, 0] * (velocity / 127) ** 2 * full_scale
        n = min(len(ours), len(pascals))
        self.assertLess(calc_db(ours[:n] - pascals[:n], pascals[:n]), -60)

    def test_louder_layers_are_brighter_and_none_clips(self):
        peaks, centroids = {}, {}
        for region in self.regions:
            samples, rate = read_wav(self.folder / "bar" / region["sample"])
            peaks[region["sample"]] = abs(samples).max()
            spectrum = abs(numpy.fft.rfft(samples[:, 0], 1 << 17)) ** 2
            centroids[region["sample"]] = (spectrum * numpy.fft.rfftfreq(1 << 17, 1 / rate)).sum() / spectrum.sum()
            self.assertLess(abs(samples[-1, 0]), 1e-3)  # it has ended
        self.assertAlmostEqual(20 * numpy.log10(max(peaks.values())), -1.0, 2)
        felt = {v: [c for name, c in centroids.items() if "soft-felt" in name and f"-v{v}" in name] for v in (22, 64, 106)}
        by_layer = [numpy.mean(felt[v]) for v in (22, 64, 106)]
        self.assertEqual(by_layer, sorted(by_layer))
        self.assertGreater(
            numpy.mean([c for n, c in centroids.items() if "hard-wood" in n]),
            numpy.mean([c for n, c in centroids.items() if "soft-felt" in n]),
        )

    def test_a_sampler_plays_them(self):
        """Key and velocity choose the sample that the file says: FluidSynth's output has its spectrum."""
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "XDG_RUNTIME_DIR": str(self.folder), "HOME": str(self.folder)}
        self.make(fixtures.get("long_bar.hdf"), "played", "--mallets soft-felt --places 2 --layers 2 --seconds 1 --speed 4 --format pcm16")
        convert = ["polyphone", "-1", "-i", "long_bar.sfz", "-d", ".", "-o", "long"]
        subprocess.run(convert, cwd=self.folder / "played", env=environment, check=True, capture_output=True, timeout=60)
        notes = [(0.5, 36, 127), (2.5, 37, 127), (4.5, 36, 60)]
        (self.folder / "played" / "notes.mid").write_bytes(make_midi(notes))
        run(*"fluidsynth -ni -R 0 -C 0 -g 1 -r 48000 -F out.wav long.sf2 notes.mid".split(), cwd=self.folder / "played")
        heard, rate = read_wav(self.folder / "played" / "out.wav")
        self.assertEqual(rate, 48000)
        heard = heard[:, 0]
        regions = parse_sfz((self.folder / "played" / "long_bar.sfz").read_text())
        for time, key, velocity in notes:
            (region,) = [r for r in regions if int(r["lokey"]) == key and int(r["lovel"]) <= velocity <= int(r["hivel"])]
            start = int(time * rate)
            piece = abs(heard[start : start + rate // 2])
            begin = start + int(numpy.argmax(piece > 0.02 * piece.max()))
            alike = {}
            for other in regions:
                sample = read_wav(self.folder / "played" / other["sample"])[0][: rate // 2, 0]
                # Magnitudes up to 4 kHz: FluidSynth begins between two samples.
                pair = [abs(numpy.fft.rfft(part, 1 << 16))[:5461] for part in (heard[begin : begin + len(sample)], sample)]
                alike[other["sample"]] = (pair[0] @ pair[1]) / (numpy.linalg.norm(pair[0]) * numpy.linalg.norm(pair[1]))
            self.assertEqual(max(alike, key=alike.get), region["sample"], alike)
            self.assertGreater(alike[region["sample"]], 0.999)

    def test_pitches_put_the_body_over_the_keyboard(self):
        self.make(self.bank, "pitched", "--keys pitches --places 3 --layers 1 --seconds 0.3")
        regions = parse_sfz((self.folder / "pitched" / "bar.sfz").read_text())
        self.assertEqual([r["seq_position"] for r in regions], ["1", "2", "3"])
        (region,) = {(r["lokey"], r["hikey"], r["pitch_keycenter"], r["tune"], r["seq_length"], r["lovel"], r["hivel"]) for r in regions}
        self.assertEqual((region[0], region[1], region[4:]), ("0", "127", ("3", "1", "127")))
        # The pitch that it names is that of a mode.
        freq = 440 * 2 ** ((int(region[2]) - int(region[3]) / 100 - 69) / 12)
        with h5py.File(self.bank) as file:
            self.assertLess(abs(1200 * numpy.log2(file["modes/frequency_hz"][:] / freq)).min(), 1)

    def test_mistakes_end_in_a_sentence(self):
        for words, said in (
            (["none.hdf"], "no such file"),
            ([self.bank, "--mallets", "feather"], "feather"),
            ([self.bank, "--at", "1", "2"], "three for each point"),
            ([self.bank, "--at", "5", "5", "5"], "away from"),
            ([self.bank, "--first-key", "127"], "do not fit the keys"),
            ([self.bank, "--speed", "-1"], "a mallet of -1 m/s"),
        ):
            done = run(BIN / "carillon-samples", *words, "-o", "none", "-q", cwd=self.folder, code=2)
            self.assertIn(said, done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertFalse((self.folder / "none").exists())

    def test_the_folder_is_replaced_as_a_whole_and_never_one_with_other_files(self):
        options = "--places 1 --layers 1 --seconds 0.2"
        self.make(self.bank, "again", "--places 2 --layers 2 --seconds 0.2")
        self.make(self.bank, "again", options)
        files = sorted(path.name for path in (self.folder / "again").rglob("*") if path.is_file())
        self.assertEqual(files, ["bar-hard-wood-1-v64.wav", "bar.sfz"])
        (self.folder / "again" / "notes.txt").write_text("mine")
        done = run(BIN / "carillon-samples", self.bank, "-o", "again", "-q", cwd=self.folder, code=2)
        self.assertIn("contains other files", done.stderr)
        self.assertEqual(sorted(path.name for path in (self.folder / "again").rglob("*") if path.is_file()), [*files, "notes.txt"])
        self.assertEqual([path.name for path in self.folder.glob(".*")], [])


if __name__ == "__main__":
    unittest.main()
