#!/usr/bin/python3
"""The add-on, installed from its zip file into Blender without a window: keyframes against the trajectory of carillon-render, the floor,
the strip and its sound, materials, the cache by a count of solves, cancelled bakes, and refusals.

usage: bake_test.py ADDON.zip      finds the programs in $CARILLON_BIN_DIR; exits 77 (skipped) without Blender
"""
import json
import math
import os
import pathlib
import subprocess
import sys
import time
import unittest
import wave

try:
    import bpy
except ImportError:
    bpy = None

FPS, LAST_FRAME = 50, 121

if bpy is None:
    from launch import start

    sys.exit(start(__file__, *sys.argv[1:]))

import mathutils  # noqa: E402
import numpy  # noqa: E402

ADDON, FOLDER = sys.argv[sys.argv.index("--") + 1], pathlib.Path(sys.argv[sys.argv.index("--") + 2])


def clear():
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = FPS, 1, LAST_FRAME
    return scene


def add(name, material, kind="ACTIVE", location=(0, 0, 0), rotation=(0, 0, 0), size=(0.06, 0.05, 0.04), shape="cube"):
    """A box of these edges, as a cube with a scale, or a plane; a material for None makes none."""
    if shape == "cube":
        bpy.ops.mesh.primitive_cube_add(size=1, location=location, rotation=rotation)
    else:
        bpy.ops.mesh.primitive_plane_add(size=2, location=location)
        size = (1, 1, 1)
    item = bpy.context.object
    item.name, item.scale, item.carillon_body = name, size, kind
    item.carillon_restitution = 0.3
    if material:
        item.data.materials.append(bpy.data.materials.get(material) or bpy.data.materials.new(material))
    return item


def make_scene():
    """A small box of glass that turns as it falls, above a floor, and a fixed one next to it."""
    scene = clear()
    add("Floor", "Concrete", "PASSIVE", shape="plane")
    box = add("Box", "Glass", location=(0.02, 0.01, 0.12), rotation=(0.3, 0.2, 0.1))
    box.carillon_velocity, box.carillon_angular_velocity = (0.1, 0, 0), (0, 1, 2)
    add("Post", "Brass", "PASSIVE", location=(0.5, 0, 0.02))
    bpy.ops.object.camera_add(location=(0, -1, 0.3), rotation=(math.radians(80), 0, 0))
    scene.camera = bpy.context.object
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "scene.blend"))
    return scene, box


def bake():
    return bpy.ops.carillon.bake()


def count_runs():
    solves = FOLDER / "solves"
    return len(solves.read_text().split()) if solves.exists() else 0


def find_curves(item):
    return {(curve.data_path, curve.array_index): curve for curve in item.animation_data.action.fcurves}


def find_lowest(item):
    return min((item.matrix_world @ vertex.co).z for vertex in item.data.vertices)


def find_strips(scene):
    return [strip for strip in scene.sequence_editor.sequences_all if strip.type == "SOUND"] if scene.sequence_editor else []


def read_peak(file):
    with wave.open(str(file)) as sound:
        data = sound.readframes(sound.getnframes())
        width, frames = sound.getsampwidth(), sound.getnframes()
        raw = numpy.frombuffer(data, "u1").reshape(frames, -1, width)[:, :, -2:].copy().view("<i2")
        return frames / sound.getframerate(), abs(raw.astype(int)).max() / 32768


def list_left():
    """What a bake may leave: actions, strips, sounds, and files in the temporary folder and next to the .blend."""
    temporary = [file for file in (FOLDER / "tmp").iterdir() if not file.name.startswith("blender_")]
    kept = sorted(file.name for file in (FOLDER / "carillon").glob("*")) if (FOLDER / "carillon").exists() else []
    return (
        len(bpy.data.actions),
        len(find_strips(bpy.context.scene)),
        len(bpy.data.sounds),
        temporary,
        [name for name in kept if name != "banks"],
    )


class BakeTest(unittest.TestCase):
    def test_its_version_is_that_of_the_programs(self):
        import carillon_bake

        printed = subprocess.run(["carillon-render", "--version"], capture_output=True, text=True, check=True).stdout
        self.assertIn(" " + ".".join(map(str, carillon_bake.bl_info["version"])), printed)

    def test_a_fall(self):
        scene, box = make_scene()
        self.assertEqual(bake(), {"FINISHED"})
        self.check_poses(scene, box)
        scene.frame_set(LAST_FRAME)
        self.assertLess(abs(find_lowest(box)), 1e-4)
        self.assertLess((box.matrix_world.translation - mathutils.Vector(self.poses[-1][1:4])).length, 1e-6)
        self.assertIsNone(bpy.data.objects["Post"].animation_data)

        (strip,) = find_strips(scene)
        self.assertEqual(strip.frame_start, scene.frame_start)
        self.assertTrue(strip.sound.filepath.startswith("//"))
        duration, peak = read_peak(bpy.path.abspath(strip.sound.filepath))
        self.assertAlmostEqual(duration, LAST_FRAME / FPS, 3)
        self.assertGreater(peak, 0.5)

        # Again, from the keyframes: nothing is solved, and one strip is left.
        runs = count_runs()
        self.assertGreaterEqual(runs, 2)
        before = {key: [point.co[1] for point in curve.keyframe_points] for key, curve in find_curves(box).items()}
        self.assertEqual(bake(), {"FINISHED"})
        self.assertEqual(count_runs(), runs)
        self.assertEqual(len(find_strips(scene)), 1)
        self.assertEqual(len(bpy.data.sounds), 1)
        after = {key: [point.co[1] for point in curve.keyframe_points] for key, curve in find_curves(box).items()}
        self.assertEqual(set(before), set(after))
        # The first contacts, before rounding of the pose grows.
        self.assertLess(max(abs(a - b) for key in before for a, b in zip(before[key][:8], after[key][:8])), 1e-5)

        # Another material of the slot is another bank: one more solve, and another sound.
        old = json.loads((FOLDER / "carillon" / "scene-Scene.json").read_text())
        sound = (FOLDER / "carillon" / "scene-Scene.wav").read_bytes()
        box.material_slots[0].material = bpy.data.materials.new("my box")
        box.material_slots[0].material["carillon_material"] = "Stainless Steel"
        self.assertEqual(bake(), {"FINISHED"})
        new = json.loads((FOLDER / "carillon" / "scene-Scene.json").read_text())
        banks = [{body["name"]: body["bank"] for body in one["bodies"]} for one in (old, new)]
        self.assertNotEqual(banks[0]["Box"], banks[1]["Box"])
        self.assertEqual(banks[0]["Post"], banks[1]["Post"])
        self.assertGreater(count_runs(), runs)
        self.assertNotEqual((FOLDER / "carillon" / "scene-Scene.wav").read_bytes(), sound)
        self.assertTrue(pathlib.Path(banks[1]["Box"]).is_relative_to(FOLDER / "carillon" / "banks"))

    def check_poses(self, scene, box):
        """Keyframes against the trajectory of carillon-render for the scene file that the bake left, and against the law of free fall."""
        run = subprocess.run(
            ["carillon-render", "-q", "scene-Scene.json", "-o", FOLDER / "again.wav", "--trajectory", FOLDER / "again.json"],
            cwd=FOLDER / "carillon",
        )
        self.assertEqual(run.returncode, 0)
        path = next(body for body in json.loads((FOLDER / "again.json").read_text())["bodies"] if body["name"] == "Box")
        self.poses = numpy.array(path["poses"])
        curves = find_curves(box)
        frames = numpy.arange(1, LAST_FRAME + 1)
        times = (frames - 1) / FPS
        moved = 0.0
        for axis in range(3):
            curve = curves["location", axis]
            self.assertEqual([point.co[0] for point in curve.keyframe_points], frames.tolist())
            keyed = numpy.array([point.co[1] for point in curve.keyframe_points])
            self.assertLess(abs(keyed - numpy.interp(times, self.poses[:, 0], self.poses[:, 1 + axis])).max(), 1e-6)
            moved = max(moved, numpy.ptp(keyed))
        self.assertGreater(moved, 0.05)
        keyed = numpy.array([[point.co[1] for point in curves["rotation_quaternion", k].keyframe_points] for k in range(4)]).T
        for frame in range(LAST_FRAME):
            after = min(len(self.poses) - 1, int(numpy.searchsorted(self.poses[:, 0], times[frame], "right")))
            near = self.poses[max(0, after - 1) : after + 1, 4:]
            # Between two poses, the angle to each is at most the angle between them.
            spread = 1 - abs(near[0] @ near[-1])
            for one in near:
                self.assertLess(1 - abs(one @ keyed[frame]), spread + 1e-6)
        self.assertLess(abs(numpy.diff(keyed, axis=0)).max(), 1)  # no change of sign
        height = curves["location", 2]
        for frame in (2, 3, 4):
            fallen = 0.12 - 9.81 / 2 * ((frame - 1) / FPS) ** 2
            self.assertAlmostEqual(height.evaluate(frame), fallen, delta=6e-5)  # 6 ms between poses

    def test_a_cancelled_bake_leaves_nothing(self):
        scene, box = make_scene()
        box.scale = (0.061, 0.05, 0.04)  # no bank yet
        scene.frame_set(7)
        before, matrix = list_left(), box.matrix_world.copy()
        import carillon_bake.bake as own

        (FOLDER / "slow").touch()
        try:
            steps, runs = own.bake(bpy.context), count_runs()
            begin = time.monotonic()
            while count_runs() == runs:
                next(steps)
                self.assertLess(time.monotonic() - begin, 60)
            pid = int((FOLDER / "solves").read_text().split()[-1])
            self.assertTrue(pathlib.Path(f"/proc/{pid}").exists())
            steps.close()
        finally:
            (FOLDER / "slow").unlink()
        begin = time.monotonic()
        while pathlib.Path(f"/proc/{pid}").exists():
            self.assertLess(time.monotonic() - begin, 10, "the solver still runs")
            time.sleep(0.1)
        self.assertEqual(list_left(), before)
        self.assertEqual((box.matrix_world, scene.frame_current, box.animation_data), (matrix, 7, None))
        # At the last step before the keyframes, too.
        box.scale = (0.06, 0.05, 0.04)
        steps = own.bake(bpy.context)
        while next(steps)[1] != "keyframes":
            pass
        steps.close()
        self.assertEqual(list_left(), before)
        self.assertIsNone(box.animation_data)

    def test_parents_mirrors_units_and_rates(self):
        scene = clear()
        scene.render.fps, scene.render.fps_base, scene.frame_start, scene.frame_end = 30, 1.001, 11, 40
        scene.unit_settings.scale_length = 0.01  # a unit is a centimetre
        scene.gravity = (0, 0, -981)
        add("Floor", "concrete", "PASSIVE", shape="plane")
        bpy.ops.object.empty_add(location=(3, 0, 0), rotation=(0, 0, 1))
        parent = bpy.context.object
        parent.scale = (2, 2, 2)
        box = add("Box", "glass.001", location=(0, 0, 4), size=(3, -2.5, 2))
        box.parent = parent
        bpy.context.view_layer.update()
        place = box.matrix_world.translation.copy()
        self.assertEqual(bake(), {"FINISHED"})  # not saved: the sound is packed
        (strip,) = find_strips(scene)
        self.assertEqual(strip.frame_start, 11)
        self.assertIsNotNone(strip.sound.packed_file)
        for frame in (11, 13, 14):
            scene.frame_set(frame)
            time_s = (frame - 11) * 1.001 / 30
            here = box.matrix_world.translation
            self.assertLess((here.xy - place.xy).length, 1e-3)
            self.assertAlmostEqual(here.z, place.z - 981 / 2 * time_s**2, delta=0.01)  # of a centimetre
        scene.frame_set(40)
        self.assertLess(abs(find_lowest(box)), 0.01)
        self.assertLess((mathutils.Vector(box.scale) - mathutils.Vector((3, -2.5, 2))).length, 1e-6)

    def test_rigid_bodies_of_blender(self):
        scene = clear()
        floor = add("Floor", "oak", "AUTO", shape="plane")
        bpy.ops.rigidbody.object_add(type="PASSIVE")
        box = add("Box", "glass", "AUTO", location=(0, 0, 0.1))
        bpy.ops.rigidbody.object_add(type="ACTIVE")
        box.rigid_body.restitution = floor.rigid_body.restitution = 0.2
        other = add("Other", None, "AUTO", location=(1, 0, 0))
        bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "rigid.blend"))
        self.assertEqual(bake(), {"FINISHED"})
        self.assertTrue(box.rigid_body.kinematic)  # Blender's physics leaves it to the keyframes
        self.assertIsNone(other.animation_data)
        scene.frame_set(LAST_FRAME)
        self.assertLess(abs(find_lowest(box)), 1e-4)

    def test_errors_name_the_object_and_the_correction(self):
        def open_box(box):
            box.data.materials[0].name = "glass"
            import bmesh

            work = bmesh.new()
            work.from_mesh(box.data)
            work.faces.remove(work.faces[:][0])
            work.to_mesh(box.data)
            work.free()

        def two_materials(box):
            box.data.materials.append(bpy.data.materials.get("steel") or bpy.data.materials.new("steel"))
            box.data.polygons[0].material_index = 1

        def follow(box):
            box.constraints.new("COPY_LOCATION").target = bpy.data.objects["Post"]

        cases = (
            (open_box, ["Box", "not closed", "4 edges", "Solidify"]),
            (two_materials, ["Box", "glass and steel", "separate it by material"]),
            (lambda box: setattr(box.data.materials[0], "name", "Plaid"), ["Box", "Plaid", "Material > Carillon"]),
            (lambda box: setattr(box, "carillon_material", "unobtainium"), ["Box", "unobtainium", "carillon materials"]),
            (lambda box: box.data.materials.clear(), ["Box", "it has no material"]),
            (follow, ["Box", "constraints"]),
            (lambda box: setattr(box, "scale", (0, 1, 1)), ["Box", "scale is 0"]),
            (lambda box: setattr(box, "carillon_body", "PASSIVE"), ["no object moves", "Carillon > Body"]),
            (lambda box: setattr(box, "carillon_wall_m", 1.0), ["Box"]),  # of the mesher
            (lambda box: setattr(bpy.context.scene.render, "fps_base", 100.0), ["last frame", "3600"]),
            (lambda box: add("Floor2", "concrete", "PASSIVE", location=(0, 0, 1), shape="plane"), ["Floor2", "Floor is a floor already"]),
        )
        for break_it, words in cases:
            with self.subTest(words=words):
                scene, box = make_scene()
                scene.frame_end = 5000 if "3600" in words else LAST_FRAME
                break_it(box)
                before = list_left()
                with self.assertRaises(RuntimeError) as caught:
                    bake()
                for word in words:
                    self.assertIn(word, str(caught.exception))
                self.assertEqual(list_left(), before)
        make_scene()
        path = os.environ["PATH"]
        os.environ["PATH"] = "/usr/bin:/bin"
        try:
            with self.assertRaises(RuntimeError) as caught:
                bake()
            self.assertIn("carillon is not installed", str(caught.exception))
            # The folder of the preferences.
            bpy.context.preferences.addons["carillon_bake"].preferences.programs = str(FOLDER / "bin")
            self.assertEqual(bake(), {"FINISHED"})
        finally:
            os.environ["PATH"] = path
            bpy.context.preferences.addons["carillon_bake"].preferences.programs = ""


if __name__ == "__main__":
    bpy.ops.preferences.addon_install(filepath=ADDON)
    bpy.ops.preferences.addon_enable(module="carillon_bake")
    done = unittest.main(argv=[sys.argv[0], *sys.argv[sys.argv.index("--") + 3 :]], exit=False, verbosity=2)
    sys.exit(0 if done.result.wasSuccessful() and done.result.testsRun else 1)
