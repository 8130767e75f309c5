#!/usr/bin/python3
"""The Python module: banks against h5py, jobs against carillon-precompute, scenes against carillon-render's file,
strikes against the sum of modes by its formula, what is hostile, and what must not be held or left behind.

Finds the programs in $CARILLON_BIN_DIR and the module along PYTHONPATH.
"""
import ast
import gc
import inspect
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock
import warnings

import h5py
import numpy
import scipy.io.wavfile

import carillon
import carillon._carillon

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
SOURCE = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"])
PINNED = SOURCE / "tests/unit/runtime/bank/pinned"
HAS_SOLVER = (BIN / "carillon-precompute").exists()
HAS_HEADS = os.environ.get("CARILLON_HEADS", "1") == "1"  # docs/components.md
BAR = {"body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 800}, "material": "steel"}


def count_files():
    return len(os.listdir("/proc/self/fd"))


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="carillon-python-")
        cls.folder = pathlib.Path(cls.scratch.name)
        cls.addClassCleanup(cls.scratch.cleanup)
        before = os.getcwd()
        os.chdir(cls.folder)
        cls.addClassCleanup(os.chdir, before)
        warnings.simplefilter("ignore")
        cls.bank_file = PINNED / "version_1_4.hdf"

    def refuse(self, kind, work, *words):
        with self.assertRaises(kind) as caught:
            work()
        message = str(caught.exception)
        self.assertEqual(len(message.splitlines()), 1, message)
        for word in words:
            self.assertIn(word, message)
        return message


class Banks(Case):
    def test_arrays_are_those_of_the_file(self):
        for file in sorted(PINNED.glob("*.hdf")):
            bank = carillon.Bank(file, frequencies="mesh")
            with h5py.File(file) as stored:
                for name, where in (
                    ("vertices_m", "mesh/vertices"),
                    ("triangles", "mesh/triangles"),
                    ("residual", "modes/residual"),
                    ("shape_steps", "modes/shape"),
                    ("shape_scale", "modes/shape_scale"),
                ):
                    numpy.testing.assert_array_equal(getattr(bank, name), stored[where][:], f"{file} {name}")
                decay, gain = stored["modes/decay"][:], stored["modes/radiation_gain"][:]
                in_air = "radiation/decay" in stored  # played with radiation damping and gain
                if in_air:
                    air = stored["radiation/decay"][:]
                    decay, gain = decay + air, numpy.sqrt(air * 1.21 * 343.0 / (2 * numpy.pi))
                numpy.testing.assert_allclose(bank.decay_per_s, decay, rtol=1e-14 if in_air else 0)
                numpy.testing.assert_allclose(bank.radiation_gain, gain, rtol=1e-14 if in_air else 0)
                hertz = stored["modes/frequency_hz"][:]
                numpy.testing.assert_allclose(bank.frequency_hz, hertz, rtol=1e-14)
                shapes = stored["modes/shape"][:] * stored["modes/shape_scale"][:][:, None]
                numpy.testing.assert_array_equal(bank.shapes(), shapes)
                numpy.testing.assert_array_equal(bank.shapes(1), shapes[:, 1])
                numpy.testing.assert_array_equal(bank.shapes([0, -1]), shapes[:, [0, -1]])
                numpy.testing.assert_array_equal(bank.shapes(slice(1, 3)), shapes[:, 1:3])
                if "modes/discretisation_error_cents" in stored:
                    numpy.testing.assert_array_equal(bank.error_cents, stored["modes/discretisation_error_cents"][:])
                self.assertEqual(bank.material["young_modulus_pa"], stored["material/young_modulus_pa"][()])
                corrected = "modes/corrected_frequency_hz"
                played = numpy.sort(stored[corrected][:]) if corrected in stored else hertz
                played = numpy.sort(stored["radiation/freq_hz"][:]) if in_air else played
                numpy.testing.assert_allclose(carillon.Bank(file).frequency_hz, played, rtol=1e-12)
            self.assertEqual(len(bank), len(hertz))
            heard = json.loads(subprocess.check_output([BIN / "carillon-bank", "info", "--json", file]))["modes"]
            heard.sort(key=lambda mode: mode["heard"]["frequency_hz"])
            numpy.testing.assert_allclose(carillon.Bank(file).t60_s, [mode["t60_s"] for mode in heard], rtol=1e-12)
            self.assertIn(f"{len(bank)} modes", repr(bank))

    def test_arrays_are_read_only_views_that_keep_the_bank_alive(self):
        bank = carillon.Bank(self.bank_file)
        shapes, points = bank.shape_steps, bank.vertices_m
        self.assertTrue(numpy.shares_memory(shapes, bank.shape_steps))
        copies = shapes.copy(), points.copy()
        with self.assertRaises(ValueError):
            points[0, 0] = 1
        with self.assertRaises(ValueError):
            shapes.setflags(write=True)
        del bank
        gc.collect()
        _ = [carillon.Bank(self.bank_file) for _ in range(5)]
        numpy.testing.assert_array_equal(shapes, copies[0])
        numpy.testing.assert_array_equal(points, copies[1])

    def test_edits_scale_and_the_nearest_place_is_on_the_surface(self):
        bank = carillon.Bank(self.bank_file)
        twice = bank.edited(size=2)
        numpy.testing.assert_allclose(twice.frequency_hz, bank.frequency_hz / 2, rtol=1e-12)
        numpy.testing.assert_allclose(twice.mass_kg, 8 * bank.mass_kg, rtol=1e-12)
        glass = bank.edited(material="glass")
        speed = lambda m: (m["young_modulus_pa"] / m["density_kg_m3"]) ** 0.5
        numpy.testing.assert_allclose(glass.frequency_hz / bank.frequency_hz, speed(glass.material) / speed(bank.material), rtol=1e-12)
        glass.write("glass.hdf")
        numpy.testing.assert_array_equal(carillon.Bank("glass.hdf").frequency_hz, glass.frequency_hz)
        corners = bank.vertices_m[bank.triangles[0]]
        triangle, weights, point, distance = bank.nearest(corners.mean(axis=0))
        self.assertLess(distance, 1e-12)
        numpy.testing.assert_allclose(weights @ bank.vertices_m[bank.triangles[triangle]], point, atol=1e-12)
        self.refuse(carillon.InputError, lambda: bank.nearest([float("nan"), 0, 0]), "not finite")
        self.refuse(carillon.InputError, lambda: bank.edited(material="glas"), 'did you mean "glass"?')
        self.refuse(carillon.InputError, lambda: bank.edited(material="glass", density=2), "of its own")
        self.refuse(carillon.InputError, lambda: bank.edited(size=0), "size")
        self.refuse(carillon.InputError, lambda: bank.write("none/x.hdf"), "there is no folder none")

    def test_hostile_files_are_one_message_and_are_closed(self):
        whole = self.bank_file.read_bytes()
        _ = carillon.Bank.parse(whole)
        before = count_files()
        for n in range(0, len(whole), max(1, len(whole) // 200)):
            self.refuse(carillon.InputError, lambda: carillon.Bank.parse(whole[:n]))
            changed = bytearray(whole)
            changed[n] ^= 0x41
            self.refuse(carillon.InputError, lambda: carillon.Bank.parse(bytes(changed)))
        pathlib.Path("cut.hdf").write_bytes(whole[:5000])
        os.mkfifo("pipe.hdf")
        for file, words in (
            ("none.hdf", "none.hdf"),
            ("cut.hdf", "cut.hdf"),
            (".", "folder"),
            ("pipe.hdf", "pipe"),
            (b"\xff.hdf", "\\xff"),
        ):
            self.refuse(carillon.InputError, lambda: carillon.Bank(os.fsdecode(file)), words)
        self.refuse(carillon.InputError, lambda: carillon.Bank(self.bank_file, frequencies="both"), '"corrected" or "mesh"')
        for _ in range(20):
            carillon.Bank(self.bank_file)
        self.assertEqual(count_files(), before)

    def test_materials_are_listed(self):
        self.assertGreaterEqual(len(carillon.materials()), 30)
        self.assertEqual(carillon.materials()["steel"]["density_kg_m3"], 7850)


@unittest.skipUnless(HAS_SOLVER, "a build without the solver")
class Jobs(Case):
    def solve_outside(self, job, name="outside"):
        pathlib.Path(f"{name}.json").write_text(json.dumps({"bank": f"{name}.hdf", **job}))
        return subprocess.run(
            [BIN / "carillon-precompute", f"{name}.json", "-q", "--result", f"{name}.result"],
            capture_output=True,
            text=True,
            cwd=self.folder,
        )

    def test_a_job_matches_the_program(self):
        self.assertEqual(self.solve_outside(BAR).returncode, 0)
        outside = carillon.Bank("outside.hdf")
        before, files = count_files(), set(os.listdir("."))
        inside = carillon.solve(BAR)
        numpy.testing.assert_array_equal(inside.frequency_hz, outside.frequency_hz)
        numpy.testing.assert_array_equal(inside.vertices_m, outside.vertices_m)
        self.assertEqual(set(os.listdir(".")), files)
        # Lowest bending mode of a free bar, 4.73004^2 / (2 pi L^2) sqrt(E I / (rho A)), minus some percent for shear and inertia.
        beam = 4.73004**2 / (2 * numpy.pi * 0.3**2) * (200e9 * 0.012**2 / 12 / 7850) ** 0.5
        self.assertTrue(0.96 * beam < inside.frequency_hz[0] < beam, (inside.frequency_hz[0], beam))
        kept = carillon.solve({**BAR, "bank": "kept.hdf"}, ranks=2)
        # Two ranks sum in another order; modes have a tolerance of 1e-8, and corrections are their differences.
        numpy.testing.assert_allclose(kept.frequency_hz, outside.frequency_hz, rtol=1e-7)
        numpy.testing.assert_array_equal(carillon.Bank("kept.hdf").frequency_hz, kept.frequency_hz)
        numpy.testing.assert_array_equal(carillon.solve("outside.json", bank="other.hdf").frequency_hz, outside.frequency_hz)
        self.assertTrue(pathlib.Path("other.hdf").exists())
        self.assertEqual(count_files(), before)
        self.assertEqual(inside.provenance["material"]["name"], "steel")

    def test_paths_of_a_job_are_relative_to_the_working_directory(self):
        fixtures.copy("bar.msh", ".")
        self.assertGreater(len(carillon.solve({"mesh": pathlib.Path("bar.msh"), "material": "cork"})), 0)
        tetrahedron = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
        pathlib.Path("t.obj").write_text(tetrahedron)
        self.assertGreater(len(carillon.solve({"body": {"surface": "t.obj", "nodes": 500}, "material": {"from": "cork"}})), 0)

    def test_errors_match_the_program(self):
        wrong = {**BAR, "material": "steele"}
        self.assertEqual(self.solve_outside(wrong, "wrong").returncode, 2)
        message = self.refuse(carillon.InputError, lambda: carillon.solve("wrong.json"), "wrong.json:1", 'did you mean "steel"?')
        self.assertEqual(message, json.loads(pathlib.Path("wrong.result").read_text())["message"])
        self.refuse(carillon.InputError, lambda: carillon.solve(wrong), f"{os.getcwd()}/job:", 'did you mean "steel"?')
        self.refuse(carillon.InputError, lambda: carillon.solve({**BAR, "mesh": "x.msh"}), "job")
        self.refuse(carillon.InputError, lambda: carillon.solve({"mesh": "none.msh", "material": "steel"}), "none.msh")
        self.refuse(carillon.InputError, lambda: carillon.solve("none.json"), "none.json")
        self.refuse(carillon.InputError, lambda: carillon.solve(BAR, ranks=0), "ranks")
        self.refuse(carillon.InputError, lambda: carillon.solve({**BAR, "band_hz": [20, float("inf")]}), "finite")
        self.refuse(carillon.InputError, lambda: carillon.solve({**BAR, "note": object()}), "object")
        self.refuse(carillon.InputError, lambda: carillon.solve(BAR, bank="/proc/none/x.hdf"), "/proc/none")
        with unittest.mock.patch.dict(os.environ, PATH=str(self.folder)):
            self.refuse(carillon.SystemError, lambda: carillon.solve(BAR, ranks=2), "mpirun is not in PATH")

    def test_jobs_leave_no_temporary_files(self):
        scratch = self.folder / "scratch"
        scratch.mkdir()
        with unittest.mock.patch.object(tempfile, "tempdir", str(scratch)):
            self.refuse(carillon.InputError, lambda: carillon.solve({**BAR, "material": "steele"}), "steel")
            self.assertGreater(len(carillon.solve(BAR)), 0)
        self.assertEqual(list(scratch.iterdir()), [])

    def test_an_interrupt_ends_the_solver(self):
        script = "import carillon, sys\nprint('begins', flush=True)\ncarillon.solve(%r)\n" % {
            **BAR,
            "body": {**BAR["body"], "nodes": 60000},
        }
        with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
            child.stdout.readline()
            children = pathlib.Path(f"/proc/{child.pid}/task/{child.pid}/children")
            solver = 0
            for _ in range(2000):
                found = children.read_text().split()
                if found and b"libexec" in pathlib.Path(f"/proc/{found[0]}/cmdline").read_bytes():
                    solver = int(found[0])
                    break
                time.sleep(0.01)
            self.assertGreater(solver, 0)
            child.send_signal(signal.SIGINT)
            _, said = child.communicate(timeout=60)
        self.assertIn("KeyboardInterrupt", said)
        self.assertFalse(pathlib.Path(f"/proc/{solver}").exists(), "the solver still runs")

    def test_other_threads_run_while_a_job_is_solved(self):
        worker = threading.Thread(target=carillon.solve, args=(BAR,))
        worker.start()
        ticks = 0
        while worker.is_alive():
            time.sleep(0.001)
            ticks += 1
        worker.join()
        self.assertGreater(ticks, 20)


class Worlds(Case):
    def make_scene(self):
        bar = {"bank": str(self.bank_file), "restitution": 0.3}
        return {
            "duration_s": 0.5,
            "ground": {},
            "listener": {"position_m": [0, -1, 0.3]},
            "bodies": [
                {"name": "bar", "position_m": [-0.2, 0.09, -0.199], **bar},
                {"name": "spare", "position_m": [-0.2, 1.09, 0.1], "absent": True, **bar},
                {"name": "shelf", "position_m": [0.4, 0.09, 0.0], "fixed": True, **bar},
            ],
        }

    def test_bodies_are_pushed_held_added_and_removed(self):
        world = carillon.World(self.make_scene(), look_ahead_s=0.02)
        self.assertEqual((world.bodies, world.rate_hz, world.time_s), (["bar", "spare", "shelf"], 48000, 0))
        pressure = world.advance(0.5)
        self.assertEqual((pressure.shape, pressure.dtype), ((24000, 2), numpy.float32))
        self.assertGreater(abs(pressure).max(), 0)
        numpy.testing.assert_allclose(world.centre("bar"), [0, 0, 0.005], atol=1e-4)
        speed = 1.0
        world.push("bar", [0, 0, speed * carillon.Bank(self.bank_file).mass_kg])
        world.advance(0.05)
        flown_s = 0.05  # a parabola
        numpy.testing.assert_allclose(world.centre("bar")[2], 0.005 + speed * flown_s - 9.81 / 2 * flown_s**2, atol=5e-4)
        world.grab("bar", frequency_hz=6)
        world.drag("bar", [0, 0, 0.5], over_s=0.2)
        world.advance(1.0)
        sag_m = 9.81 / (2 * numpy.pi * 6) ** 2
        numpy.testing.assert_allclose(world.centre("bar"), [0, 0, 0.5 - sag_m], atol=2e-3)
        self.assertTrue(world.is_absent("spare"))
        world.add("spare", [-0.2, 1.09, 0.2], velocity_m_s=[0, 0, -1])
        world.release("bar")
        self.assertGreater(abs(world.advance(0.5)).max(), 10 * abs(pressure[-4800:]).max(), "both fall")
        position, rotation = world.pose("spare")
        self.assertEqual((len(position), len(rotation)), (3, 4))
        world.remove("shelf")
        self.assertTrue(world.is_absent("shelf"))
        self.assertAlmostEqual(world.time_s, 2.05, places=9)
        world.advance(2.0)  # all come to rest
        new = {"name": "new", "bank": str(self.bank_file), "position_m": [-0.2, 2.09, 0.3], "restitution": 0.3}
        self.assertEqual((world.add_body(new), world.bodies[-1]), ("new", "new"))
        quiet = abs(world.advance(0.2)).max()
        self.assertGreater(abs(world.advance(0.5)).max(), 10 * quiet, "it falls")
        numpy.testing.assert_allclose(world.centre("new")[2], 0.005, atol=1e-3)
        self.refuse(carillon.InputError, lambda: world.add_body(new), 'called "new" already')
        self.refuse(carillon.InputError, lambda: world.add_body({**new, "name": "inside"} | {"position_m": [-0.2, 2.09, -0.3]}), "inside")
        self.refuse(carillon.InputError, lambda: world.add_body({**new, "name": "odd", "colour": 1}), "colour")
        self.refuse(carillon.InputError, lambda: world.add_body({**new, "name": "no", "bank": "no.h5"}), "no.h5")
        self.assertEqual(world.bodies[-1], "new", "what is refused leaves no trace")
        world.push("new", [0, 0, 0.1])

    def test_new_body_sounds_as_one_that_was_absent(self):
        def play(is_new):
            scene = self.make_scene()
            spare = scene["bodies"].pop(1)
            del spare["absent"]
            if not is_new:
                scene["bodies"].append({**spare, "absent": True})
            world = carillon.World(scene)
            begin = world.advance(0.3)
            if is_new:
                world.add_body({**spare, "velocity_m_s": [0, 0, -1]})
            else:
                world.add("spare", spare["position_m"], velocity_m_s=[0, 0, -1])
            return begin, world.advance(0.7)

        (_, new), (begin, absent) = play(True), play(False)
        self.assertGreater(abs(absent).max(), abs(begin[-4800:]).max())
        numpy.testing.assert_allclose(new, absent, atol=1e-6 * abs(absent).max())

    def test_what_cannot_be_done_is_one_message(self):
        world = carillon.World(self.make_scene())
        self.refuse(carillon.InputError, lambda: world.push("ba", [0, 0, 1]), 'did you mean "bar"?')
        self.refuse(carillon.InputError, lambda: world.push("bar", [0, 0, float("nan")]), "finite")
        self.refuse(carillon.InputError, lambda: world.push("shelf", [0, 0, 1]), "fixed")
        self.refuse(carillon.InputError, lambda: world.grab("spare"), "not in the world")
        self.refuse(carillon.InputError, lambda: world.grab("bar", frequency_hz=0), "frequency")
        self.refuse(carillon.InputError, lambda: world.drag("bar", [0, 0, 1]), "not held")
        self.refuse(carillon.InputError, lambda: world.add("bar", [0, 0, 1]), "already")
        self.refuse(carillon.InputError, lambda: world.add("spare", [-0.2, 0.09, -0.199]), "inside each other")
        self.refuse(carillon.InputError, lambda: world.advance(-1), "advance")
        self.refuse(carillon.InputError, lambda: carillon.World(self.make_scene(), look_ahead_s=0), "look_ahead_s")
        self.refuse(carillon.InputError, lambda: carillon.World("none.json"), "none.json")

    def test_sound_is_that_of_the_whole_scene(self):
        scene = {**self.make_scene(), "output": {"fade_end": False}}
        whole = carillon.render(scene).samples_pa.astype(float)
        world = carillon.World(scene)
        pieces = numpy.concatenate([world.advance(0.1) for _ in range(5)]).astype(float)
        # Here the latency of the synthesiser stays, as live, and bodies have effects for whatever may happen.
        worst = min(numpy.square(pieces[late:] - whole[: len(whole) - late]).sum() for late in range(48))
        self.assertLess(worst, 1e-3 * numpy.square(whole).sum())


class Sounds(Case):
    def make_scene(self):
        bank = carillon.Bank(self.bank_file)
        low = bank.vertices_m.min(axis=0)
        return {
            "duration_s": 1.0,
            "ground": {"height_m": 0.0},
            "bodies": [
                {"name": "falls", "bank": str(self.bank_file), "position_m": [0, 0, 0.3 - low[2]], "rotation_axis_angle": None},
                {"name": "fixed", "bank": str(self.bank_file), "position_m": [2, 0, 1], "fixed": True},
            ],
            "strikes": [{"time_s": 0.2, "body": "fixed", "point_m": bank.vertices_m[3], "mallet": "hard-wood"}],
        }

    def test_a_scene_matches_carillon_render(self):
        scene = self.make_scene()
        scene["bodies"][0].pop("rotation_axis_angle")
        plain = json.loads(carillon.documents.write_json(scene, "scene"))
        pathlib.Path("scene.json").write_text(json.dumps({**plain, "output": {"format": "float"}}))
        done = subprocess.run(
            [BIN / "carillon-render", "scene.json", "-o", "scene.wav", "--report", "report.json", "-q"], capture_output=True
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        rate, theirs = scipy.io.wavfile.read("scene.wav")
        gain = json.loads(pathlib.Path("report.json").read_text())
        before = count_files()
        ours = carillon.render("scene.json")
        self.assertEqual((ours.rate_hz, ours.samples_pa.shape, ours.samples_pa.dtype), (rate, theirs.shape, numpy.float32))
        self.assertGreater(abs(theirs).max(), 0.5)
        factor = numpy.vdot(theirs, ours.samples_pa) / numpy.vdot(theirs, theirs)
        self.assertLess(abs(factor * theirs - ours.samples_pa).max(), 1e-6 * abs(ours.samples_pa).max())
        self.assertIsInstance(gain, dict)
        samples, rate = carillon.render(scene)
        numpy.testing.assert_array_equal(samples, ours.samples_pa)
        self.assertEqual(carillon.render(scene, rate_hz=22050).samples_pa.shape, (22050, 2))
        if HAS_HEADS:
            by_head = carillon.render({**scene, "listener": {"ears": "hrtf"}}).samples_pa
            self.assertEqual(by_head.shape, samples.shape)
            self.assertGreater(abs(by_head - samples).max(), 0.02 * abs(samples).max())
        self.assertEqual(count_files(), before)

    def test_a_silent_body_collides_and_only_clicks(self):
        made = subprocess.run(
            [BIN / "carillon-bank", "silent", "sphere:0.01", "--material", "steel", "-o", "bead.hdf"], capture_output=True
        )
        if made.returncode == 2 and b"EXCHANGE" in made.stderr:
            self.skipTest("without the component")
        self.assertEqual(made.returncode, 0, made.stderr)
        bead = carillon.Bank("bead.hdf")
        self.assertEqual(len(bead.frequency_hz), 0)
        peaks = {}
        for effects in (["modal"], ["modal", "acceleration_noise"], []):
            synth = carillon.Synthesiser()
            body = synth.add_body(bead, position_m=(0, 1, 0), effects=effects)
            synth.strike(body, (0, -1e-2, 0), point_m=(0, 0.01, 0), duration_s=5e-5)
            peaks[len(effects)] = abs(synth.process(4800)).max()
        self.assertEqual((peaks[0], peaks[1]), (0, 0))
        self.assertGreater(peaks[2], 1e-3)
        scene = {"duration_s": 0.3, "ground": {}, "bodies": [{"name": "bead", "bank": "bead.hdf", "position_m": [0, 0, 0.1]}]}
        pathlib.Path("bead.json").write_text(json.dumps(scene))
        self.assertGreater(abs(carillon.render("bead.json")[0]).max(), 1e-3)
        scene["bodies"][0]["effects"] = []
        pathlib.Path("bead.json").write_text(json.dumps(scene))
        self.assertEqual(abs(carillon.render("bead.json")[0]).max(), 0)

    def test_invalid_scenes_are_one_message(self):
        scene = self.make_scene()
        self.refuse(carillon.InputError, lambda: carillon.render(scene), f"{os.getcwd()}/scene:", "rotation_axis_angle")
        scene["bodies"][0].pop("rotation_axis_angle")
        self.refuse(carillon.InputError, lambda: carillon.render({**scene, "duration_s": float("nan")}), "finite")
        self.refuse(carillon.InputError, lambda: carillon.render({**scene, "strikes": [{"time_s": 0}]}), "body")
        self.refuse(carillon.InputError, lambda: carillon.render({**scene, "listener": {"ears": "hrtf", "sofa": "no.sofa"}}), "no.sofa")
        self.refuse(carillon.InputError, lambda: carillon.render("none.json"), "none.json")
        self.refuse(carillon.InputError, lambda: carillon.render(scene, rate_hz=7), "rate_hz")
        pathlib.Path("cut.hdf").write_bytes(self.bank_file.read_bytes()[:6000])
        scene["bodies"][0]["bank"] = "cut.hdf"
        self.refuse(carillon.InputError, lambda: carillon.render(scene), "falls", "cut.hdf")

    def test_a_strike_is_the_sum_of_the_modes(self):
        """p(t) = g v e^(-d t) (cos w' t - d / w' sin w' t) / r of every mode: equations.md E4, for an ideal blow at 2 m."""
        bank = carillon.Bank(self.bank_file)
        rate, frames, blow, vertex = 48000, 9600, numpy.array([1e-3, 2e-3, -5e-3]), 3
        synthesiser = carillon.Synthesiser(rate, microphones_m=[[0, 0, 0]])
        body = synthesiser.add_body(bank, position_m=[0, 2, 0], radiation="osg02", effects=["modal"])
        synthesiser.strike(body, blow, point_m=bank.vertices_m[vertex], duration_s=0, time_s=0.01)
        pressure = synthesiser.process(frames)[:, 0].astype(float)
        heard = bank.frequency_hz < rate / 2
        omega, decay = 2 * numpy.pi * bank.frequency_hz[heard], bank.decay_per_s[heard]
        ringing = numpy.sqrt(omega**2 - decay**2)
        force = bank.radiation_gain[heard] * (bank.shapes()[vertex][heard] @ blow) / 2

        def expect(delay_s):
            t = numpy.arange(frames) / rate - 0.01 - delay_s
            later = numpy.maximum(t, 0)[:, None]
            waves = numpy.exp(-decay * later) * (numpy.cos(ringing * later) - decay / ringing * numpy.sin(ringing * later))
            return numpy.where(t >= 0, waves @ force, 0.0)

        first = numpy.argmax(abs(pressure) > 0.1 * abs(pressure).max())
        delays = [(first - shift) / rate - 0.01 for shift in range(-2, 40)]
        worst = min(abs(expect(delay) - pressure)[first + 40 :].max() for delay in delays)
        self.assertLess(worst, 1e-4 * abs(pressure).max())

    @unittest.skipUnless(HAS_HEADS, "a build without the component HEADS")
    def test_a_head_has_a_louder_near_ear(self):
        bank = carillon.Bank(self.bank_file)
        synthesiser = carillon.Synthesiser(head_radius_m=0.0875)
        synthesiser.strike(synthesiser.add_body(bank, [-2, 0, 0]), [0, 0, 0.01], triangle=0, time_s=0.005)
        left, right = (synthesiser.process(9600).astype(float) ** 2).sum(axis=0)
        self.assertGreater(left, 1.5 * right)
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser(head_radius_m=1), "radius")
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser(microphones_m=[[0, 0, 0]], head_radius_m=0.09), "two microphones")
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser().add_body(bank, effects=["modal", "two_ears", "head"]), "head")

    def test_a_floor_doubles_the_pressure_on_it(self):
        bank = carillon.Bank(self.bank_file)
        squares = []
        for floor in ({}, {"floor_reflection": 1.0, "floor_height_m": -0.5}):
            synthesiser = carillon.Synthesiser(microphones_m=[[0, 0, -0.5]], **floor)
            synthesiser.strike(synthesiser.add_body(bank, [0, 2, 0]), [0, 0, 0.01], triangle=0, time_s=0.005)
            squares.append((synthesiser.process(9600).astype(float) ** 2).sum())
        self.assertAlmostEqual(squares[1] / squares[0], 4, delta=0.01)
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser(floor_reflection=1.5, floor_height_m=-1), "reflection")
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser(floor_reflection=1, floor_height_m=2), "above")
        effects = ["modal", "ground_reflection"]
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser().add_body(bank, effects=effects), "floor")

    def test_the_synthesiser_renders_blocks_edits_and_bodies(self):
        bank = carillon.Bank(self.bank_file)
        whole, pieces = carillon.Synthesiser(), carillon.Synthesiser()
        for synthesiser in (whole, pieces):
            body = synthesiser.add_body(bank)
            synthesiser.strike(body, [0, 0, 0.01], triangle=0, time_s=0.005)
        together = whole.process(5000)
        self.assertEqual((together.shape, whole.channels, whole.rate_hz), ((5000, 2), 2, 48000))
        numpy.testing.assert_array_equal(together, numpy.concatenate([pieces.process(n) for n in (1, 0, 777, 4222)]))
        self.assertEqual(whole.counters["strikes"], 1)
        self.assertAlmostEqual(whole.time_s, 5000 / 48000)
        whole.swap_bank(body, bank.edited(size=2))
        whole.move(body, [0, 3, 0], velocity_m_s=[0, 10, 0])
        self.assertTrue(numpy.isfinite(whole.process(5000)).all())
        whole.remove_body(body)
        whole.process(2000)
        self.assertEqual(abs(whole.process(100)).max(), 0)
        self.refuse(carillon.InputError, lambda: whole.strike(body, [0, 0, 1], triangle=0), "no body")
        self.refuse(carillon.InputError, lambda: pieces.strike(body, [0, 0, 1], triangle=10**6), "no triangle")
        self.refuse(carillon.InputError, lambda: pieces.strike(body, [0, 0, 1]), "point_m or triangle")
        self.refuse(carillon.InputError, lambda: pieces.strike(body, [0, 0, float("inf")], triangle=0), "cannot be played")
        self.refuse(carillon.InputError, lambda: pieces.add_body(bank, effects=["loud"]), "loud")
        self.refuse(carillon.InputError, lambda: pieces.add_body(bank, radiation="loud"), "loud")
        self.refuse(carillon.InputError, lambda: pieces.process(-1), "frames")
        self.refuse(carillon.InputError, lambda: carillon.Synthesiser(rate_hz=0), "rate")
        for _ in range(10000):
            try:
                pieces.strike(body, [0, 0, 1e-6], triangle=0)
            except carillon.InputError as error:
                self.assertIn("process()", str(error))
                break
        else:
            self.fail("the ring has no end")

    def test_other_threads_run_during_playback(self):
        bank = carillon.Bank(self.bank_file).edited(density=1e-3)
        most = 0
        for _ in range(50):  # on a busy machine, this thread may get no time during a short playback
            synthesiser = carillon.Synthesiser()
            body = synthesiser.add_body(bank)
            for k in range(60):
                synthesiser.strike(body, [0, 0, 1e-2], triangle=0, time_s=0.1 * k)
            seen = []
            worker = threading.Thread(target=lambda synthesiser=synthesiser, seen=seen: seen.append(synthesiser.process(30 * 48000)))
            worker.start()
            ticks = 0
            while worker.is_alive():
                time.sleep(0.0005)
                ticks += 1
            worker.join()
            self.assertEqual(seen[0].shape, (30 * 48000, 2))
            most = max(most, ticks)
            if most > 5:
                break
        self.assertGreater(most, 5)


class Engines(Case):
    """A body of hand-written physics that falls on the ground."""

    def play(self, touches, bank, body, impulse):
        """Falls at 1 m/s; after the step 0.2 m/s are left."""
        index = touches.add(bank, body, "bar", restitution=0.5)
        self.assertEqual(index, 0)
        lowest = bank.vertices_m[numpy.argmin(bank.vertices_m[:, 2])]
        position = numpy.array([bank.centre_m - lowest])
        rotation, spin = numpy.array([[1.0, 0, 0, 0]]), numpy.zeros((1, 3))
        touches.start(0.0, position, rotation, numpy.array([[0, 0, -1.0]]), spin)
        points = {"pair": numpy.array([[0, -1]], numpy.int32), "point": numpy.zeros((1, 3)), "normal": numpy.array([[0, 0, 1.0]])}
        dt = 1 / 240
        self.assertTrue(touches.step(dt, position, rotation, numpy.array([[0, 0, -0.2]]), spin, impulse=impulse, **points))
        for n in range(2, 30):
            touches.step(n * dt, position, rotation, numpy.array([[0, 0, 0.1]]), spin)
        return touches.counters

    def test_a_hit_is_an_event(self):
        bank = carillon.Bank(PINNED / "version_1_5.hdf")
        touches = carillon.Touches()
        counters = self.play(touches, bank, 0, numpy.array([0.84 * bank.mass_kg]))
        self.assertEqual((counters["hits"], counters["steps"], counters["points"]), (1, 29, 1))
        lines = [json.loads(line) for line in touches.take_lines().splitlines()]
        pulses = [one for one in lines if "impulse" in one or "force" in one]
        self.assertTrue(pulses)
        self.assertEqual(touches.take_lines(), "")
        self.assertAlmostEqual(touches.mark_s, 29 / 240)

    def test_a_synthesiser_sounds(self):
        bank = carillon.Bank(PINNED / "version_1_5.hdf")
        synthesiser = carillon.Synthesiser()
        body = synthesiser.add_body(bank)
        touches = carillon.Touches(synthesiser)
        self.play(touches, bank, body, None)  # found from the velocities
        del touches
        self.assertGreater(abs(synthesiser.process(9600)).max(), 0)

    def test_wrong_arrays_are_one_message(self):
        bank = carillon.Bank(PINNED / "version_1_5.hdf")
        touches = carillon.Touches()
        touches.add(bank, 0)
        one, turn = numpy.zeros((1, 3)), numpy.array([[1.0, 0, 0, 0]])
        touches.start(0.0, one, turn)
        for arrays, part in (
            ((numpy.zeros((2, 3)), turn, one, one), "position: 2 rows; give 1"),
            ((one, numpy.zeros((1, 3)), one, one), r"rotation: give an array \(1, 4\)"),
            ((one, 2 * turn, one, one), "no unit quaternion"),
            ((one, turn, numpy.full((1, 3), numpy.nan), one), "not finite"),
        ):
            with self.assertRaisesRegex(carillon.InputError, part):
                touches.step(0.1, *arrays)
        with self.assertRaisesRegex(carillon.InputError, "pair, point and normal"):
            touches.step(0.1, one, turn, one, one, pair=numpy.array([[0, -1]], numpy.int32))
        self.assertEqual(touches.counters["steps"], 0)
        with self.assertRaisesRegex(carillon.InputError, "bank: a body that sounds needs one"):
            touches.add(None, 0, mass_kg=1.0, young_pa=1e9, density_kg_m3=1e3, size_m=0.1)
        with self.assertRaises(TypeError):
            carillon.Touches(3)


class Module(unittest.TestCase):
    def test_the_stub_matches_the_module(self):
        declared = ast.parse((pathlib.Path(carillon.__file__).parent / "_carillon.pyi").read_text())
        compiled = carillon._carillon
        stated = {node.name: node for node in declared.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(stated), {name for name in vars(compiled) if not name.startswith("_")})

        def list_words(function):
            return [a.arg for a in function.args.args + function.args.kwonlyargs]

        def find_words(text):
            signature = text.splitlines()[0]
            return [word for word in re.findall(r"(?:\(|, )(?:\*, )?(\w+):", signature)]

        for name, node in stated.items():
            found = getattr(compiled, name)
            self.assertTrue(found.__doc__, name)
            if isinstance(node, ast.FunctionDef):
                self.assertEqual(list_words(node), find_words(found.__doc__), name)
                continue
            members = {one.name: one for one in node.body if isinstance(one, ast.FunctionDef)}
            own = {key for key in vars(found) if not key.startswith("__") and key != "_pybind11_conduit_v1_"}
            self.assertEqual({key for key in members if not key.startswith("__")}, own, name)
            for key in own:
                member = inspect.getattr_static(found, key)
                if isinstance(member, property):
                    self.assertIn("property", [ast.unparse(d) for d in members[key].decorator_list], key)
                else:
                    self.assertEqual(list_words(members[key]), find_words(getattr(found, key).__doc__), f"{name}.{key}")

    def test_it_has_the_version_of_the_programs(self):
        said = subprocess.run([BIN / "carillon-render", "--version"], capture_output=True, text=True, check=True).stdout
        self.assertIn(carillon.__version__, said)


if __name__ == "__main__":
    unittest.main()
