#!/usr/bin/python3
"""Scenes in glTF: what carillon-bank import writes against poses, masses and frequencies that numpy takes from the glTF itself, what
carillon-render plays, and what is refused.

Finds the programs in $CARILLON_BIN_DIR. With "validator": gltf-validator of npm on exports and on these scenes.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy

from banks import BIN, calc_db, fixtures, make_radiating_plate, read_wav, run
from gltf_scene import AUDIO, DENSITY, PHYSICS, RAISE, Scene, calc_solid, make_grid_box, make_rotation
import npm  # found by banks

FREQ = [900.0, 1700.5, 3111.1, 5200.0]
BAR = numpy.array([0.2, 0.05, 0.03])
TILT = [0.1, 0.3, -0.2, 0.927]


def make_drop(scale=0.5, reading="unscaled", has_motion=True, **node):
    """A bar above a slab at height 0."""
    scene = Scene()
    points, triangles = make_grid_box(BAR)
    volume, _, inertia = calc_solid(points, triangles)
    mass = DENSITY * volume * (1 if reading == "unscaled" else scale**3)
    model = scene.add_model(points, triangles, FREQ, mass, name="Bar")
    motion = {"mass": DENSITY * volume * scale**3} if has_motion else None
    contact = scene.add_physics_material(restitution=0.4, dynamicFriction=0.3, staticFriction=0.3)
    slab = scene.add_shape("box", size=[2, 0.1, 2])
    box = scene.add_shape("box", size=list(BAR))
    scene.add_node(name="Floor", translation=[0, -0.05, 0], shape=slab, material=contact, audio={"acousticSurface": 1})
    place = {"translation": [0.1, 0.4, -0.2], "rotation": TILT, "scale": [scale] * 3, **node}
    bar = scene.add_node(name="Bar", audio={"modalModel": model, "acousticSurface": 0}, motion=motion, shape=box, material=contact, **place)
    return scene, bar, points, triangles


class GltfTest(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.addCleanup(self.place.cleanup)
        self.folder = pathlib.Path(self.place.name)

    def convert(self, scene, *words, name="scene.gltf", external=False):
        """scene.json, its banks by body, and the finished program."""
        file = scene.write(self.folder / name, external)
        done = run(BIN / "carillon-bank", "import", file, "-o", self.folder / "out", *words)
        made = json.loads((self.folder / "out/scene.json").read_text())
        banks = {}
        for body in made["bodies"]:
            with h5py.File(self.folder / "out" / body["bank"]) as bank:
                banks[body["name"]] = {
                    "vertices": bank["mesh/vertices"][:],
                    "lambda": bank["modes/eigenvalue"][:],
                    "decay": bank["modes/decay"][:],
                    "shape": bank["modes/shape"][:] * bank["modes/shape_scale"][:][None, :, None],
                    **{key: bank["rigid"][key][()] for key in bank["rigid"]},
                }
        return made, banks, done

    def find(self, made, name):
        return next(body for body in made["bodies"] if body["name"] == name)

    def check_place(self, scene, node, points, body, bank, tolerance=1e-6):
        """Every point of the model is a vertex of the bank, in the world."""
        w, x, y, z = body["quaternion"]
        got = bank["vertices"] @ make_rotation([x, y, z, w]).T + body["position_m"]
        expected = scene.place(node, points.astype("f4").astype(float))
        self.assertEqual(len(got), len(expected))
        distance = numpy.linalg.norm(got[:, None] - expected[None], axis=2)
        self.assertLess(max(distance.min(axis=0).max(), distance.min(axis=1).max()), tolerance)

    def check_frequencies(self, bank, factor, decay_factor=None):
        damped = numpy.sqrt(bank["lambda"] - bank["decay"] ** 2) / (2 * numpy.pi)
        omega2 = bank["lambda"]
        expected = numpy.array(FREQ, dtype="f4").astype(float)
        if decay_factor is None:  # Rayleigh's law at the new frequency
            self.assertLess(abs(bank["decay"] / (3 + 0.5e-7 * omega2) - 1).max(), 1e-6)
            decay = 3 + 0.5e-7 * (2 * numpy.pi * expected) ** 2
            for _ in range(20):
                decay = (6 + 1e-7 * ((2 * numpy.pi * expected) ** 2 + decay**2)) / 2
            undamped = numpy.sqrt((2 * numpy.pi * expected) ** 2 + decay**2) / (2 * numpy.pi)
            self.assertLess(abs(numpy.sqrt(omega2) / (2 * numpy.pi) / (undamped * factor) - 1).max(), 1e-6)
        else:
            self.assertLess(abs(damped / (expected * factor) - 1).max(), 1e-6)

    def test_both_readings_of_a_scaled_node(self):
        for scale in (0.5, 2.0):
            for reading in ("unscaled", "initial"):
                for has_motion in (True, False):
                    with self.subTest(scale=scale, reading=reading, has_motion=has_motion):
                        scene, bar, points, triangles = make_drop(scale, reading, has_motion)
                        made, banks, done = self.convert(scene)
                        body, bank = self.find(made, "Bar"), banks["Bar"]
                        self.check_place(scene, bar, points, body, bank)
                        self.check_frequencies(bank, 1 / scale if reading == "unscaled" else 1.0)
                        volume = calc_solid(points, triangles)[0]
                        self.assertLess(abs(bank["mass_kg"] / (DENSITY * volume * scale**3) - 1), 1e-6)
                        self.assertIn("unscaled" if reading == "unscaled" else "of the initial node", done.stdout)
                        self.assertEqual(body.get("fixed", False), not has_motion)
                        self.assertEqual(done.stderr, "")

    def test_shapes_are_of_the_mass_of_the_body(self):
        """sqrt(m / M), whatever the reading."""
        plain, _, _, _ = make_drop(1.0)
        _, banks, _ = self.convert(plain)
        largest = abs(banks["Bar"]["shape"]).max()
        for scale, factor in ((0.5, 1.0), (1.0, 0.7), (2.0, 3.0)):
            scene, bar, _, _ = make_drop(scale, "unscaled")
            motion = scene.json["nodes"][bar]["extensions"][PHYSICS]["motion"]
            motion["mass"] *= factor
            _, banks, done = self.convert(scene)
            bank = banks["Bar"]
            self.assertLess(abs(bank["mass_kg"] / motion["mass"] - 1), 1e-6)
            self.assertLess(abs(abs(bank["shape"]).max() / largest * numpy.sqrt(scale**3 * factor) - 1), 1e-3)
            if factor != 1.0 and scale != 1.0:  # neither mass
                self.check_frequencies(bank, 1.0)
                self.assertIn(f"the lowest is 900 Hz, and would be {900 / scale:g} Hz", done.stderr)

    def test_the_user_decides(self):
        for word, factor in (("yes", 2.0), ("no", 1.0)):
            for reading in ("unscaled", "initial"):
                scene, _, _, _ = make_drop(0.5, reading)
                _, banks, done = self.convert(scene, "--scale-frequencies", word)
                self.check_frequencies(banks["Bar"], factor)
                self.assertIn(f"--scale-frequencies {word}", done.stdout)

    def test_decays_without_a_law(self):
        scene = Scene()
        points, triangles = make_grid_box(BAR)
        mass = DENSITY * calc_solid(points, triangles)[0]
        model = scene.add_model(points, triangles, FREQ, mass, decay=[3.0, 11.0, 7.0, 90.0])
        scene.add_node(name="Bar", scale=[2, 2, 2], audio={"modalModel": model}, motion={"mass": 8 * mass})
        _, banks, _ = self.convert(scene)
        self.check_frequencies(banks["Bar"], 0.5, 0.5)

    def test_poses_velocities_and_children(self):
        scene, bar, points, _ = make_drop(1.0)
        carrier = scene.add_node(name="Carrier", translation=[1, 2, 3], rotation=[0.5, 0.5, 0.5, 0.5], scale=[2, 2, 2])
        spin = {"mass": 0.81 * 8 * 0.125, "linearVelocity": [0.3, -0.1, 0.2], "angularVelocity": [1.0, 2.0, -3.0]}
        child = scene.add_node(
            carrier, name="Child", translation=[0.2, 0.5, 0.1], rotation=TILT, scale=[0.5] * 3, audio={"modalModel": 0}, motion=spin
        )
        matrix = numpy.eye(4)
        matrix[:3, :3] = make_rotation([0.2, -0.4, 0.1, 0.9])
        matrix[:3, 3] = [-1, 1, -1]
        turned = scene.add_node(
            name="Turned", matrix=[float(x) for x in matrix.T.ravel()], audio={"modalModel": 0}, motion={"mass": 0.81 * (1 + 1e-14)}
        )
        made, banks, _ = self.convert(scene)
        for node, name in ((bar, "Bar"), (child, "Child"), (turned, "Turned")):
            self.check_place(scene, node, points, self.find(made, name), banks[name])
        rotation = scene.calc_global(child)[:3, :3]  # of scale 1
        body = self.find(made, "Child")
        for key, own in (("velocity_m_s", "linearVelocity"), ("angular_velocity_rad_s", "angularVelocity")):
            self.assertTrue(numpy.allclose(body[key], RAISE @ rotation @ spin[own], atol=1e-9), (body, own))
        self.assertEqual(len({body["bank"] for body in made["bodies"]}), 1)  # one model at one size and mass

    def test_instances_share_banks_by_scale(self):
        scene, _, points, triangles = make_drop(1.0)
        mass = DENSITY * calc_solid(points, triangles)[0]
        for k, scale in enumerate((1.0, 0.5, 0.5, 2.0)):
            motion = {"mass": mass * scale**3}
            scene.add_node(name="Bar", translation=[0, 1 + k, 0], scale=[scale] * 3, audio={"modalModel": 0, "gain": 1 + k}, motion=motion)
        made, banks, _ = self.convert(scene)
        self.assertEqual([body["name"] for body in made["bodies"]], ["Bar", "Bar 2", "Bar 3", "Bar 4", "Bar 5"])
        files = [body["bank"] for body in made["bodies"]]
        self.assertEqual([files.index(file) for file in files], [0, 0, 2, 2, 4])
        self.assertEqual([body.get("gain", 1) for body in made["bodies"]], [1, 1, 2, 3, 4])

    def test_the_slab_is_the_ground_and_other_boxes_are_silent(self):
        scene, _, _, _ = make_drop(1.0)
        wall = scene.add_shape("box", size=[0.1, 1, 1])
        scene.add_node(name="Floor too", translation=[3, -0.2, 0], scale=[1, 4, 1], shape=0, material=0, audio={"acousticSurface": 1})
        standing = scene.add_node(
            name="Wall", translation=[0.8, 0.5, 0], rotation=[0, 0.3826834, 0, 0.9238795], scale=[1, 2, 0.5], shape=wall
        )
        ball = scene.add_shape("sphere", radius=0.1)
        scene.add_node(name="Knob", translation=[-0.5, 0.1, 0.5], shape=ball, audio={"acousticSurface": 1})
        made, banks, done = self.convert(scene)
        ground = made["ground"]
        self.assertEqual((ground["height_m"], ground["restitution"], ground["friction"]), (0, 0.4, 0.3))
        self.assertEqual((ground["young_modulus_pa"], ground["roughness_m"], ground["density_kg_m3"]), (2e11, 1e-5, 7850))
        self.assertEqual([body["name"] for body in made["bodies"]], ["Bar", "Wall", "Knob"])
        corners = numpy.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        self.check_place(scene, standing, corners, self.find(made, "Wall"), banks["Wall"])
        for name in ("Wall", "Knob"):
            self.assertTrue(self.find(made, name)["fixed"])
            self.assertEqual(len(banks[name]["lambda"]), 0)
        self.assertLess(abs(numpy.linalg.norm(banks["Knob"]["vertices"], axis=1) / 0.1 - 1).max(), 1e-9)
        self.assertLess(abs(banks["Knob"]["volume_m3"] / (4 / 3 * numpy.pi * 1e-3) - 1), 5e-3)

    def test_a_box_with_nothing_above_is_no_ground(self):
        scene, _, _, _ = make_drop(1.0, translation=[5, 0.4, 0])
        made, _, _ = self.convert(scene)
        self.assertNotIn("ground", made)
        self.assertEqual([body["name"] for body in made["bodies"]], ["Floor", "Bar"])

    def test_a_silent_striker(self):
        scene, _, _, _ = make_drop(1.0, translation=[0, 0.0151, 0], rotation=[0.7071067811865476, 0, 0, 0.7071067811865476])
        scene.json["nodes"][1]["translation"] = [0, 0.0251, 0]
        capsule = scene.add_shape("capsule", height=0.04, radiusTop=0.01, radiusBottom=0.01)
        motion = {"mass": 0.05, "linearVelocity": [0, -2, 0], "inertiaDiagonal": [1e-9, 1e-9, 1e-9]}
        scene.add_node(name="Striker", translation=[0.05, 0.2, 0], shape=capsule, motion=motion, audio={"acousticSurface": 1}, material=0)
        made, banks, done = self.convert(scene)
        body, bank = self.find(made, "Striker"), banks["Striker"]
        self.assertEqual((len(bank["lambda"]), body["effects"], body["velocity_m_s"]), (0, [], [0, 0, -2]))
        self.assertLess(abs(bank["mass_kg"] / 0.05 - 1), 1e-6)
        self.assertIn("moments of inertia contradict", done.stderr)
        volume = numpy.pi * 1e-4 * (0.04 + 4 / 3 * 0.01)
        self.assertLess(abs(bank["volume_m3"] / volume - 1), 5e-3)
        run(BIN / "carillon-render", self.folder / "scene.gltf", "-o", self.folder / "x.wav", "--report", self.folder / "r.json", "-q")
        report = json.loads((self.folder / "r.json").read_text())
        sound, _ = read_wav(self.folder / "x.wav")
        self.assertGreater(abs(sound).max(), 0.5, report)

    def test_a_model_and_colliders_below_a_motion(self):
        """One body in the frame of its model, with the centre and the velocity of the motion."""
        scene, _, points, triangles = make_drop(1.0)
        mass = DENSITY * calc_solid(points, triangles)[0]
        motion = {"mass": mass * 8, "centerOfMass": [0.1, 0.01, 0], "angularVelocity": [0, 3, 0]}
        parent = scene.add_node(name="Whole", translation=[0, 2, 0], rotation=TILT, motion=motion)
        child = scene.add_node(
            parent, translation=[0.1, 0, 0], rotation=[0.5, 0.5, 0.5, 0.5], scale=[2, 2, 2], audio={"modalModel": 0}, shape=1
        )
        made, banks, done = self.convert(scene)
        self.check_place(scene, child, points, self.find(made, "Whole"), banks["Whole"])
        self.assertNotIn("warning", done.stderr)
        self.check_frequencies(banks["Whole"], 0.5)
        body, bank = self.find(made, "Whole"), banks["Whole"]
        w, x, y, z = body["quaternion"]
        centre = make_rotation([x, y, z, w]) @ bank["centre_m"] + body["position_m"]
        self.assertLess(abs(centre - scene.place(parent, numpy.array([[0.1, 0.01, 0]]))[0]).max(), 1e-9)
        self.assertTrue(numpy.allclose(body["angular_velocity_rad_s"], RAISE @ make_rotation(TILT) @ [0, 3, 0]))

    def test_colliders_of_meshes_and_several_shapes(self):
        scene, _, _, _ = make_drop(1.0)
        points, triangles = make_grid_box(numpy.array([0.3, 0.2, 0.1]), 1)
        corners = points[triangles].reshape(-1, 3)  # each triangle has its own corners, as flat shading has
        scene.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": scene.add_accessor(corners.astype("f4"), "VEC3")}}]}]
        plinth = scene.add_node(name="Plinth", mesh=0, translation=[0.9, 0.1, 0], scale=[1, 1, 2])
        scene.json["nodes"][plinth]["extensions"] = {PHYSICS: {"collider": {"geometry": {"node": plinth}}}}
        dumbbell = scene.add_node(name="Dumbbell", translation=[-0.5, 1, 0], rotation=TILT, motion={"mass": 2.0})
        small = scene.add_shape("box", size=[0.1, 0.1, 0.1])
        for side in (-0.2, 0.2):
            scene.add_node(dumbbell, translation=[side, 0, 0], shape=small)
        held = scene.add_node(name="Held", translation=[0, 3, 0], shape=small, motion={"mass": 1, "isKinematic": True})
        made, banks, _ = self.convert(scene)
        self.check_place(scene, plinth, points, self.find(made, "Plinth"), banks["Plinth"])
        self.assertTrue(self.find(made, "Plinth")["fixed"] and self.find(made, "Held")["fixed"])
        box = numpy.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])
        both = numpy.concatenate([box + [side, 0, 0] for side in (-0.2, 0.2)])
        bank = banks["Dumbbell"]
        self.check_place(scene, dumbbell, both, self.find(made, "Dumbbell"), bank)
        self.check_place(scene, held, box, self.find(made, "Held"), banks["Held"])
        self.assertAlmostEqual(bank["mass_kg"], 2.0, 9)
        across = 2 * (0.1**2 / 6 + 0.2**2)
        self.assertLess(abs(numpy.sort(numpy.diag(bank["inertia_kg_m2"])) - [2 * 0.1**2 / 6, across, across]).max(), 1e-8)
        run(BIN / "carillon-render", self.folder / "scene.gltf", "-o", self.folder / "x.wav", "-q")

    def test_inertia(self):
        """Of the motion or of the model where the surface can have it; else of the surface."""
        points, triangles = make_grid_box(BAR)
        volume, _, unit = calc_solid(points, triangles)
        mass, exact = DENSITY * volume, DENSITY * numpy.diag(unit)
        turn = [0, 0, 0.7071067811865476, 0.7071067811865476]  # x and y exchanged
        cases = [
            ("motion", list(1.02 * exact), None, None, 1.02 * exact),
            ("motion", list(1.02 * exact[[1, 0, 2]]), turn, None, 1.02 * exact),
            ("motion", list(1.2 * exact), None, "contradict", exact),
            ("motion", list(exact[[1, 0, 2]]), None, "contradict", exact),
            ("motion", [1e-4, 1e-4, 1.0], None, "contradict", exact),
            ("motion", [0, 0, 0], None, "contradict", exact),
            ("model", list(0.98 * exact), None, None, 0.98 * exact),
            ("model", list(3 * exact), None, "contradict", exact),
        ]
        for scale in (1.0, 0.5):
            for owner, diagonal, orientation, warning, expected in cases:
                with self.subTest(owner=owner, diagonal=diagonal, scale=scale):
                    scene = Scene()
                    model = scene.add_model(points, triangles, FREQ, mass, inertia=diagonal if owner == "model" else None)
                    motion = {"mass": mass * scale**3}
                    if owner == "motion":
                        motion["inertiaDiagonal"] = [x * scale**5 for x in diagonal]
                        if orientation:
                            motion["inertiaOrientation"] = orientation
                    scene.add_node(name="Bar", scale=[scale] * 3, audio={"modalModel": model}, motion=motion)
                    _, banks, done = self.convert(scene)
                    self.assertLess(
                        abs(banks["Bar"]["inertia_kg_m2"] - numpy.diag(expected * scale**5)).max(), 1e-5 * max(exact) * scale**5
                    )
                    self.assertEqual("contradict" in done.stderr, warning is not None, done.stderr)

    def test_contacts_combine(self):
        """The geometric mean of the scene file is what the extension combines."""
        for mode, expected in (("average", 0.5), ("minimum", 0.2), ("maximum", 0.8), ("multiply", 0.16)):
            scene, _, _, _ = make_drop(1.0)
            other = scene.add_physics_material(restitution=0.8, dynamicFriction=0.2, restitutionCombine=mode)
            scene.json["extensions"][PHYSICS]["physicsMaterials"][0].update(restitution=0.2, dynamicFriction=0.6, restitutionCombine=mode)
            scene.json["nodes"][0]["extensions"][PHYSICS]["collider"]["physicsMaterial"] = other
            made, _, done = self.convert(scene)
            body = self.find(made, "Bar")
            self.assertAlmostEqual((body["restitution"] * made["ground"]["restitution"]) ** 0.5, expected, 9)
            self.assertAlmostEqual((body["friction"] * made["ground"]["friction"]) ** 0.5, 0.4, 9)
            self.assertEqual(done.stderr, "")

    def test_the_camera_listens(self):
        scene, _, _, _ = make_drop(1.0)
        scene.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]
        scene.add_node(camera=0, translation=[1, 2, 3], rotation=[0, 0.7071067811865476, 0, 0.7071067811865476])
        made, _, _ = self.convert(scene)
        self.assertTrue(numpy.allclose(made["listener"]["position_m"], [1, -3, 2]))
        self.assertTrue(numpy.allclose(made["listener"]["facing"], [-1, 0, 0], atol=1e-9))

    def test_every_kind_of_file_is_the_same_scene(self):
        scene, _, _, _ = make_drop(0.5)
        texts = []
        for name, external in (("a.gltf", False), ("b.gltf", True), ("c.glb", False)):
            self.convert(scene, name=name, external=external)
            bank = h5py.File(self.folder / "out/Bar.hdf")["modes/shape"][:]
            texts.append(((self.folder / "out/scene.json").read_text(), bank.tobytes()))
        self.assertEqual(texts[0], texts[1])
        self.assertEqual(texts[0], texts[2])

    def test_the_sound_is_that_of_the_folder(self):
        scene, _, _, _ = make_drop(0.5)
        self.convert(scene)
        run(BIN / "carillon-render", self.folder / "scene.gltf", "-o", self.folder / "a.wav", "--format", "float")
        run(BIN / "carillon-render", self.folder / "out/scene.json", "-o", self.folder / "b.wav", "--format", "float")
        self.assertEqual((self.folder / "a.wav").read_bytes(), (self.folder / "b.wav").read_bytes())
        sound, _ = read_wav(self.folder / "a.wav")
        self.assertGreater(abs(sound).max(), 0.5)

    def test_gain(self):
        sounds = []
        for gain in (1.0, 0.25):
            scene, bar, _, _ = make_drop(1.0)
            scene.json["nodes"][bar]["extensions"][AUDIO]["gain"] = gain
            self.convert(scene)
            made = json.loads((self.folder / "out/scene.json").read_text())
            made["output"] = {"gain": 1e-3}
            (self.folder / "out/scene.json").write_text(json.dumps(made))
            run(BIN / "carillon-render", self.folder / "out/scene.json", "-o", self.folder / "a.wav", "--format", "float", "-q")
            sounds.append(read_wav(self.folder / "a.wav")[0])
            shutil.rmtree(self.folder / "out")
        self.assertGreater(abs(sounds[0]).max(), 1e-5)
        self.assertLess(calc_db(sounds[1] * 4 - sounds[0], sounds[0]), -90)

    def test_banks_say_that_they_are_imported(self):
        scene, _, _, _ = make_drop(0.5)
        self.convert(scene)
        said = run(BIN / "carillon-bank", "info", self.folder / "out/Bar.hdf").stdout
        self.assertIn("imported from KHR_audio_rigid_bodies, accuracy unknown", said)
        self.assertNotIn("theory", said)
        for bank in (self.folder / "out").glob("*.hdf"):
            run(BIN / "carillon-bank", "check", bank)

    def test_silent_banks(self):
        tool = BIN / "carillon-bank"
        (self.folder / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
        for body, volume in (("box:1,0.1,2", 0.2), ("sphere:0.5", numpy.pi / 6), ("cylinder:2,0.1", 0.02 * numpy.pi), ("t.obj", 1 / 6)):
            run(tool, "silent", body, "--material", "steel", "--density", 1000, "-o", "s.h5", cwd=self.folder)
            with h5py.File(self.folder / "s.h5") as bank:
                self.assertLess(abs(bank["rigid/mass_kg"][()] / volume / 1000 - 1), 5e-3)
                self.assertEqual(len(bank["modes/eigenvalue"]), 0)
            run(tool, "check", "s.h5", cwd=self.folder)
            self.assertIn("without modes", run(tool, "info", "s.h5", cwd=self.folder).stdout)
        for words, said in (
            (["box:1,2"], "give 3 lengths"),
            (["box:1,2,-3"], "above 0"),
            (["none.h5"], "no such file"),
            (["box:1,1,1"], "need a mass"),
        ):
            extra = [] if said == "need a mass" else ["--mass", 1]
            done = run(tool, "silent", *words, *extra, "-o", "n.h5", cwd=self.folder, code=2)
            self.assertIn(said, done.stderr)
            self.assertFalse((self.folder / "n.h5").exists())


class BadInputTest(GltfTest):
    """Each refusal names the file and the JSON path, and leaves nothing behind."""

    def refuse(self, change, *said, name="bad.gltf"):
        scene, _, _, _ = make_drop(0.5)
        file = scene.write(self.folder / name)
        root = json.loads(file.read_text())
        change(root)
        file.write_text(json.dumps(root))
        done = run(BIN / "carillon-bank", "import", file, "-o", self.folder / "out", code=2)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        for text in ("bad.gltf", *said):
            self.assertIn(text, done.stderr)
        self.assertEqual([entry.name for entry in self.folder.iterdir()], [name])
        again = run(BIN / "carillon-render", file, "-o", self.folder / "x.wav", code=2)
        self.assertIn(said[0], again.stderr)
        self.assertFalse((self.folder / "x.wav").exists())

    def test_refusals(self):
        def audio(root):
            return root["nodes"][1]["extensions"][AUDIO]

        def physics(root):
            return root["nodes"][1]["extensions"][PHYSICS]

        def model(root):
            return root["extensions"][AUDIO]["modalModels"][0]

        cases = [
            (
                lambda r: audio(r).update(modalModel=7),
                "nodes[1].extensions.KHR_audio_rigid_bodies.modalModel",
                "no modal model has this index",
            ),
            (lambda r: audio(r).update(modalModel="x"), "nodes[1].extensions.KHR_audio_rigid_bodies.modalModel"),
            (lambda r: audio(r).update(gain=-1), "nodes[1].extensions.KHR_audio_rigid_bodies.gain"),
            (lambda r: physics(r)["motion"].update(mass=-1), "nodes[1].extensions.KHR_physics_rigid_bodies.motion.mass", "negative"),
            (lambda r: physics(r)["motion"].update(linearVelocity=[1, 2]), "motion.linearVelocity", "3 numbers"),
            (lambda r: physics(r)["motion"].update(linearVelocity=[1e6, 0, 0]), "motion.linearVelocity", "at most 300"),
            (lambda r: physics(r)["collider"].pop("geometry"), "nodes[1].extensions.KHR_physics_rigid_bodies.collider", "geometry"),
            (lambda r: physics(r)["collider"]["geometry"].update(shape=99), "collider.geometry.shape", "no shape has this index"),
            (lambda r: physics(r)["collider"].update(physicsMaterial=9), "collider.physicsMaterial"),
            (
                lambda r: r["extensions"]["KHR_implicit_shapes"]["shapes"][0]["box"].update(size=[1, 0, 1]),
                "shapes[0].box.size",
                "more than 0",
            ),
            (lambda r: r["extensions"]["KHR_implicit_shapes"]["shapes"][0].update(type="cone"), "shapes[0].type"),
            (lambda r: r["nodes"][1].update(scale=[1, 2, 1]), "nodes[1]", "apply the scale"),
            (lambda r: r["nodes"][1].update(scale=[-1, 1, 1]), "nodes[1]", "mirrored"),
            (lambda r: r["nodes"][1].update(rotation=[0, 0, 0, 0]), "nodes[1].rotation"),
            (lambda r: r["nodes"][1].update(translation=[1e9, 0, 0]), "nodes[1]", "from the origin"),
            (lambda r: r["nodes"][1].update(translation=[1e300, 0, 0], scale=[1e300] * 3), "nodes[1]"),
            (lambda r: r["nodes"][1].update(children=[1]), "nodes[1].children", "ancestor"),
            (lambda r: (r["nodes"][0].update(children=[1]), r["nodes"][1].update(children=[0])), "nodes[", "ancestor"),
            (lambda r: r["nodes"][0].update(children=[55]), "nodes[0].children", "55"),
            (lambda r: r["nodes"][0].update(children=[1]), "scenes[0].nodes", "child of node 0"),
            (lambda r: r["scenes"][0].update(nodes=[0, 0]), "scenes[0].nodes", "twice"),
            (lambda r: r.update(scene=3), "scene"),
            (lambda r: r.update(nodes=[{}], scenes=[{"nodes": [0]}]), "no body"),
            (lambda r: model(r).update(shapes=0), "accessors[0].type", "VEC3"),
            (lambda r: model(r).update(frequencies=99), "modalModels[0].frequencies"),
            (lambda r: model(r).pop("indices"), "extensions.KHR_audio_rigid_bodies.modalModels[0]", "indices"),
            (lambda r: model(r).update(material=5), "modalModels[0].material"),
            (lambda r: model(r)["massProperties"].update(mass=0), "modalModels[0].massProperties.mass"),
            (lambda r: r["extensions"][AUDIO]["acousticMaterials"][0].pop("density"), "acousticMaterials[0]", "density"),
            (lambda r: r["accessors"][2].update(count=10**12), "accessors[2].count"),
            (lambda r: r["accessors"][2].update(byteOffset=10**9), "accessors[2]"),
            (lambda r: r["accessors"][2].update(bufferView=99), "accessors[2].bufferView"),
            (lambda r: r["bufferViews"][2].update(byteLength=10**9), "bufferViews[2].byteLength"),
            (lambda r: r["bufferViews"][2].update(buffer=4), "bufferViews[2].buffer"),
            (lambda r: r["buffers"][0].update(byteLength=10**12), "buffers[0].byteLength"),
            (lambda r: r["buffers"][0].update(uri=r["buffers"][0]["uri"][:-400]), "buffers[0].byteLength"),
            (lambda r: r["buffers"][0].update(uri="data:x;base64,***"), "buffers[0].uri"),
            (lambda r: r["buffers"][0].update(uri="../b.bin"), "buffers[0].uri", "same folder"),
            (lambda r: r["buffers"][0].update(uri="/etc/passwd"), "buffers[0].uri", "same folder"),
            (lambda r: r["buffers"][0].update(uri="%2e%2e/b.bin"), "buffers[0].uri", "same folder"),
            (lambda r: r["buffers"][0].update(uri="missing.bin"), "buffers[0].uri", "no such file"),
            (lambda r: r["asset"].update(version="1.0"), "asset.version"),
        ]
        for change, *said in cases:
            with self.subTest(said=said):
                self.refuse(change, *said)

    def test_a_link_out_of_the_folder(self):
        with tempfile.TemporaryDirectory() as other:
            (pathlib.Path(other) / "b.bin").write_bytes(bytes(10**6))
            scene, _, _, _ = make_drop(0.5)
            file = scene.write(self.folder / "s.gltf", external=True)
            file.with_suffix(".bin").unlink()
            file.with_suffix(".bin").symlink_to(pathlib.Path(other) / "b.bin")
            done = run(BIN / "carillon-bank", "import", file, "-o", self.folder / "out", code=2)
            self.assertIn("buffers[0].uri", done.stderr)

    def test_cut_files(self):
        scene, _, _, _ = make_drop(0.5)
        for name in ("cut.gltf", "cut.glb"):
            file = scene.write(self.folder / name)
            data = file.read_bytes()
            for length in sorted({*range(0, 60, 7), *range(60, len(data), len(data) // 25), len(data) - 2}):
                file.write_bytes(data[:length])
                done = subprocess.run([BIN / "carillon-bank", "import", file, "-o", self.folder / "out"], capture_output=True, text=True)
                self.assertEqual(done.returncode, 2, (length, done.stderr))
                self.assertIn(name, done.stderr)
            file.unlink()
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_other_files_are_kept(self):
        scene, _, _, _ = make_drop(0.5)
        file = scene.write(self.folder / "s.gltf")
        (self.folder / "mine").mkdir()
        (self.folder / "mine/letter.txt").write_text("x")
        done = run(BIN / "carillon-bank", "import", file, "-o", self.folder / "mine", code=2)
        self.assertIn("contains other files", done.stderr)
        self.assertEqual([entry.name for entry in (self.folder / "mine").iterdir()], ["letter.txt"])
        done = run(BIN / "carillon-render", file, "-o", self.folder / "w.wav", "--report", file, code=2)
        self.assertIn("overwrite", done.stderr)


# The cases of the base class run once.
for name in [name for name in vars(GltfTest) if name.startswith("test_")]:
    setattr(BadInputTest, name, None)


VALIDATE = """
import fs from 'node:fs';
import path from 'node:path';
import validator from 'gltf-validator';
(async () => {
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: file,
      externalResourceFunction: uri => Promise.resolve(new Uint8Array(fs.readFileSync(path.join(path.dirname(file), uri)))),
    });
    console.log(JSON.stringify({file, ...report.issues}));
  }
})();
"""


def validate():
    """No error and no warning of gltf-validator on exports and on scenes of this test."""
    with tempfile.TemporaryDirectory(prefix="carillon-gltf-") as scratch:
        folder = pathlib.Path(scratch)
        if not npm.install(folder, gltf_validator="2.0.0-dev.3.10"):
            return
        scene, _, _, _ = make_drop(0.5)
        files = [scene.write(folder / "a.gltf"), scene.write(folder / "b.gltf", external=True), scene.write(folder / "c.glb")]
        bank = fixtures.copy("glass_bowl.hdf", folder, "bowl.hdf")
        for up in ("y", "z"):
            run(BIN / "carillon-bank", "export", bank, "-o", folder / f"{up}.glb", "--up", up, "--modes", 20)
            files.append(folder / f"{up}.glb")
        run(BIN / "carillon-bank", "export", make_radiating_plate(folder), "-o", folder / "multipoles.glb")
        files.append(folder / "multipoles.glb")
        (folder / "run.js").write_text(VALIDATE)
        for line in run("node", "run.js", *files, cwd=folder).stdout.splitlines():
            report = json.loads(line)
            # An extension that the validator does not know is information.
            assert report["numErrors"] == 0 and report["numWarnings"] == 0, report
            print(f"{pathlib.Path(report['file']).name}: no errors, no warnings, {report['numInfos']} notes")


if __name__ == "__main__":
    if sys.argv[1:] == ["validator"]:
        validate()
    else:
        unittest.main()
