#!/usr/bin/python3
"""Bodies described in scenes: carillon-render and carillon-live obtain cached banks from `carillon bank-for`.

Finds the programs in $CARILLON_BIN_DIR.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
BOX = {"shape": {"box": {"length_m": 0.2, "width_m": 0.03, "height_m": 0.01, "nodes": 400}}, "material": "aluminium"}


class BodiesTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(lambda: (subprocess.run(["chmod", "-R", "u+w", place.name]), place.cleanup()))
        self.folder = pathlib.Path(place.name)
        self.environment = {**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache"), "XDG_DATA_HOME": str(self.folder / "data")}

    def run_program(self, *words, code=0, **more):
        done = subprocess.run(
            [str(w) for w in words], capture_output=True, text=True, cwd=self.folder, timeout=200, env={**self.environment, **more}
        )
        self.assertEqual(done.returncode, code, done)
        return done

    def write_scene(self, *bodies, name="scene.json", **more):
        bodies = [{"name": f"body{i}", "fixed": True, **body} for i, body in enumerate(bodies)]
        strikes = [{"time_s": 0.01, "body": body["name"], "point_m": [0.05, 0.01, 0.01], "mallet": "hard-wood"} for body in bodies]
        (self.folder / name).write_text(json.dumps({"duration_s": 0.2, "bodies": bodies, "strikes": strikes, **more}, indent=1))
        return name

    def list_banks(self):
        return sorted((self.folder / "cache").glob("carillon/banks/*/*/bank.hdf"))

    def test_cached_bank_equals_job(self):
        scene = self.write_scene(BOX, {**BOX})
        first = self.run_program(BIN / "carillon-render", scene, "-o", "first.wav")
        self.assertIn("computing the modes of box of aluminium, once", first.stderr)
        self.assertEqual(len(self.list_banks()), 1)
        again = self.run_program(BIN / "carillon-render", scene, "-o", "again.wav", "-q")
        self.assertEqual((again.stdout, again.stderr), ("", ""))
        self.assertEqual((self.folder / "first.wav").read_bytes(), (self.folder / "again.wav").read_bytes())
        box = BOX["shape"]["box"]
        job = {"body": {"shape": "box", **box}, "material": "aluminium", "bank": "own.hdf"}
        (self.folder / "job.json").write_text(json.dumps(job))
        self.run_program(BIN / "carillon-precompute", "-q", "job.json")
        self.write_scene({"bank": "own.hdf"}, {"bank": "own.hdf"}, name="named.json")
        self.run_program(BIN / "carillon-render", "named.json", "-o", "named.wav", "-q")
        self.assertEqual((self.folder / "first.wav").read_bytes(), (self.folder / "named.wav").read_bytes())
        # An equivalent description is the same body: banks in the job store are reused.
        self.write_scene({"body": {"shape": "box", **box}, "material": "aluminium"}, name="words.json")
        self.assertNotIn("computing", self.run_program(BIN / "carillon-render", "words.json", "-o", "words.wav").stderr)
        self.assertEqual(len(self.list_banks()), 1)
        live = self.run_program(BIN / "carillon-live", scene, "--null")
        self.assertNotIn("computing", live.stderr)

    def test_known_bodies_surfaces_and_meshes(self):
        (self.folder / "part").mkdir()
        cube = "\n".join(f"v {x} {y} {z}" for x in (0, 50) for y in (0, 50) for z in (0, 50))
        faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
        (self.folder / "part" / "cube.obj").write_text(cube + "\n" + "\n".join("f %d %d %d %d" % f for f in faces) + "\n")
        fixtures.copy("bar.msh", self.folder)
        oak = {"young_modulus_pa": 1.2e10, "poisson_ratio": 0.3, "density_kg_m3": 700, "damping": {"internal_friction": {"tan_phi": 0.01}}}
        scene = self.write_scene(
            {"body": {"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 200, "density_kg_m2": 0.3}}, "max_modes": 20},
            {"body": {"surface": "part/cube.obj", "scale": 0.001, "nodes": 500}, "material": oak, "max_modes": 10},
            {"mesh": "bar.msh", "material": "steel", "max_modes": 10, "band_hz": [20, 40000]},
            {"body": {"string": {"length_m": 0.65, "lowest_hz": 196, "diameter_m": 0.001}}, "material": "steel", "max_modes": 20},
        )
        done = self.run_program(BIN / "carillon-render", scene, "-o", "out.wav")
        for words in (
            "computing the modes of membrane",
            "computing the modes of cube.obj",
            "computing the modes of bar.msh of steel",
            "computing the modes of string",
        ):
            self.assertIn(words, done.stderr)
        self.assertEqual(len(self.list_banks()), 4)
        # Another surface under the same name is another body.
        (self.folder / "part" / "cube.obj").write_text(
            cube.replace("50", "40") + "\n" + "\n".join("f %d %d %d %d" % f for f in faces) + "\n"
        )
        self.assertIn("computing the modes of cube.obj", self.run_program(BIN / "carillon-render", scene, "-o", "out.wav").stderr)

    def test_concurrent_requests(self):
        scene = self.write_scene(BOX)
        both = [
            subprocess.Popen([BIN / "carillon-render", scene, "-q", "-o", f"{i}.wav"], cwd=self.folder, env=self.environment)
            for i in range(2)
        ]
        self.assertEqual([one.wait(200) for one in both], [0, 0])
        self.assertEqual(len(self.list_banks()), 1)
        self.assertEqual((self.folder / "0.wav").read_bytes(), (self.folder / "1.wav").read_bytes())

    def test_truncated_bank(self):
        scene = self.write_scene(BOX)
        self.run_program(BIN / "carillon-render", scene, "-o", "first.wav", "-q")
        (bank,) = self.list_banks()
        whole = bank.read_bytes()
        bank.parent.chmod(0o755)
        bank.chmod(0o644)
        bank.write_bytes(whole[: len(whole) // 2])
        self.assertIn("computing", self.run_program(BIN / "carillon-render", scene, "-o", "again.wav").stderr)
        self.assertEqual((self.folder / "first.wav").read_bytes(), (self.folder / "again.wav").read_bytes())

    def test_error_messages(self):
        for body, said in (
            ({**BOX, "bank": "own.hdf"}, 'scene.json:7: "bodies[0].shape": describes a body'),
            ({"shape": {"bol": {}}, "material": "glass"}, 'scene.json:8: "shape.bol": is not a shape, did you mean "bowl"?'),
            ({"shape": {"bowl": {"outer_radius": 0.06}}, "material": "glass"}, "outer_radius"),
            ({"shape": {"bowl": {"outer_radius_m": 0.06, "wall_m": 0.004}}, "material": "unobtainium"}, "unobtainium"),
            ({"shape": {"bowl": {"outer_radius_m": 0.06, "wall_m": 0.004}}}, '"material" is missing'),
            ({"shape": {"bowl": {"outer_radius_m": 0.06, "wall_m": 0.5, "nodes": 400}}, "material": "glass"}, "scene.json:"),
            ({"body": {"surface": "none.obj"}, "material": "glass"}, "none.obj"),
            ({"material": "glass"}, '"bank" is missing here'),
        ):
            scene = self.write_scene(body)
            for words in (("carillon-render", scene, "-o", "out.wav"), ("carillon-live", scene, "--null")):
                done = self.run_program(BIN / words[0], *words[1:], code=2)
                line = done.stderr.strip().splitlines()[-1]
                self.assertIn(said, line)
                self.assertIn("scene.json:", line)
                self.assertEqual(
                    sum(": " in part and not part.startswith("carillon: ") for part in done.stderr.splitlines()), 1, done.stderr
                )
                self.assertFalse((self.folder / "out.wav").exists())
        self.assertEqual(self.list_banks(), [])
        self.assertEqual(list((self.folder / "cache").glob("carillon/tmp/*")), [])

    def test_without_precompute(self):
        alone = self.folder / "alone"
        alone.mkdir()
        shutil.copy(BIN / "carillon-render", alone)
        scene = self.write_scene(BOX)
        done = self.run_program(alone / "carillon-render", scene, "-o", "out.wav", code=2, PATH="/usr/bin:/bin")
        self.assertRegex(
            done.stderr,
            r'^carillon-render: \S*scene\.json:4: body "body0" has no "bank", and the program that computes one, carillon, is not'
            " installed",
        )
        self.assertEqual(done.stderr.count("\n"), 1)

    def test_bank_for_command(self):
        (self.folder / "body.json").write_text(json.dumps(BOX))
        answer = json.loads(self.run_program(BIN / "carillon", "--json", "bank-for", "body.json").stdout)
        self.assertTrue(answer["is_new"])
        again = self.run_program(BIN / "carillon", "bank-for", "body.json")
        self.assertEqual((again.stdout, again.stderr), (answer["bank"] + "\n", ""))
        self.run_program(BIN / "carillon-bank", "check", answer["bank"])
        # The cache is a store: gc finds nothing in use, and removes it on request.
        self.run_program(BIN / "carillon", "--store", self.folder / "cache" / "carillon", "gc", "--delete")


if __name__ == "__main__":
    unittest.main()
