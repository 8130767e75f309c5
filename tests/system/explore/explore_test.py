#!/usr/bin/python3
"""carillon explore from outside: what the folder holds, that its scene and contacts play natively as the page has them, the server, and bad
input.

Finds the programs in $CARILLON_BIN_DIR.
"""
import gzip
import http.client
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import fixtures  # noqa: E402
import serving  # noqa: E402

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
PAGE = BIN.parent / "share/carillon/explore"
SCENE = {
    "duration_s": 0.6,
    "ground": {"height_m": 0.0},
    "bodies": [{"name": "bar", "bank": "brass.hdf", "position_m": [0, 0, 0.2], "rotation_deg": [0, 25, 10]}],
}


class Server:
    def __init__(self, *words):
        self.process, self.said = serving.start(*words)
        self.host, port = re.fullmatch(r"http://([0-9.]+):(\d+)/", self.said["address"]).groups()
        self.port = int(port)

    def get(self, path, **headers):
        connection = http.client.HTTPConnection(self.host, self.port, timeout=20)
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        response = connection.getresponse()
        body = response.read()
        connection.close()
        return response, body

    def stop(self, number=signal.SIGINT):
        self.process.send_signal(number)
        code = self.process.wait(timeout=20)
        self.process.stdout.close()
        return code


class Explore(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="carillon-explore-")
        cls.root = pathlib.Path(cls.scratch.name)
        fixtures.copy("brass_beam.hdf", cls.root, "brass.hdf")
        fixtures.copy("mylar_drum.hdf", cls.root, "drum_mylar.hdf")
        (cls.root / "scene.json").write_text("// a bar falls\n" + json.dumps(SCENE))

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def call(self, *words, code=0):
        run = subprocess.run([BIN / "carillon", *map(str, words)], cwd=self.root, capture_output=True, text=True, timeout=100)
        self.assertEqual(run.returncode, code, f"{words}: {run.stdout}{run.stderr}")
        return run.stdout if code == 0 else run.stderr

    def explore(self, *words):
        return json.loads(self.call("--json", "explore", *words))

    def refuse(self, *words, contains=()):
        before = sorted(self.root.rglob("*"))
        said = self.call("explore", *words, code=2).strip()
        self.assertEqual(len(said.splitlines()), 1, said)
        for word in contains:
            self.assertIn(word, said)
        self.assertEqual(sorted(self.root.rglob("*")), before, "nothing is left behind")

    def read(self, folder, name):
        return json.loads((self.root / folder / name).read_text())

    def test_banks_stand_side_by_side_on_the_floor(self):
        made = self.explore("brass.hdf", "drum_mylar.hdf", "-o", "two", "--title", "Two <bodies>")
        self.assertEqual(made["folder"], str(self.root / "two"))
        self.assertEqual(made["bytes"], sum(path.stat().st_size for path in (self.root / "two").rglob("*") if path.is_file()))
        about, scene = self.read("two", "explore.json"), self.read("two", "scene.json")
        self.assertEqual(about["title"], "Two <bodies>")
        self.assertIsNone(about["contacts"])
        self.assertGreater(about["gain_per_pa"], 0)
        self.assertEqual([body["material"] for body in about["bodies"]], ["brass", "polyester film"])
        for body in scene["bodies"]:
            self.assertEqual((self.root / "two" / body["bank"]).read_bytes(), (self.root / pathlib.Path(body["bank"]).name).read_bytes())
        bar, drum = (body["position_m"] for body in scene["bodies"])
        self.assertAlmostEqual(bar[2], 0.004, places=6)  # half its thickness
        self.assertGreater(drum[0] - 0.15, bar[0] + 0.3)  # they do not overlap
        for name in (
            "index.html",
            "main.js",
            "three/three.module.min.js",
            "three/LICENSE",
            "LICENSE.txt",
            "NOTICES.txt",
            "audio/carillon-audio.js",
            "audio/carillon-physics.wasm",
        ):
            self.assertTrue((self.root / "two" / name).is_file(), name)
        # It is a scene: carillon-render plays it. And made again in the same place it is the same.
        self.call_render("two/scene.json", "-o", "two.wav")
        before = {path.relative_to(self.root): path.read_bytes() for path in (self.root / "two").rglob("*") if path.is_file()}
        self.explore("brass.hdf", "drum_mylar.hdf", "-o", "two", "--title", "Two <bodies>")
        self.assertEqual(
            before, {path.relative_to(self.root): path.read_bytes() for path in (self.root / "two").rglob("*") if path.is_file()}
        )

    def call_render(self, *words):
        run = subprocess.run([BIN / "carillon-render", *words, "-q"], cwd=self.root, capture_output=True, text=True)
        self.assertEqual(run.returncode, 0, run.stderr)

    def test_the_folder_of_a_scene_plays_natively_as_the_scene_does(self):
        made = self.explore("scene.json", "-o", "fall")
        self.assertEqual(made["recording_s"], 0.6)
        self.assertEqual(self.read("fall", "explore.json")["title"], self.root.name)
        (self.root / "contacts.jsonl").write_bytes(gzip.decompress((self.root / "fall/contacts.jsonl.gz").read_bytes()))
        self.call_render("scene.json", "-o", "scene.wav", "--report", "report.json")
        self.call_render("fall/scene.json", "--contacts", "contacts.jsonl", "-o", "folder.wav")
        self.assertEqual((self.root / "scene.wav").read_bytes(), (self.root / "folder.wav").read_bytes())
        report = json.loads((self.root / "report.json").read_text())
        self.assertAlmostEqual(self.read("fall", "explore.json")["gain_per_pa"], report["gain_per_pa"], delta=1e-6 * report["gain_per_pa"])

    def test_a_page_has_no_effects_that_its_engine_lacks(self):
        bar = {"name": "bar", "bank": "brass.hdf", "fixed": True, "effects": {"off": ["nonlinear", "doppler"]}}
        scene = {"duration_s": 0.2, "bodies": [bar], "listener": {"ears": "hrtf"}, "effects": {"on": ["head", "two_ears"]}}
        (self.root / "head.json").write_text(json.dumps(scene))
        run = subprocess.run([BIN / "carillon", "explore", "head.json", "-o", "head"], cwd=self.root, capture_output=True, text=True)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("pages have no heads", run.stdout + run.stderr)
        page = self.read("head", "scene.json")
        self.assertEqual(page["effects"], {"on": ["two_ears"]})
        self.assertEqual(page["bodies"][0]["effects"], {"off": ["doppler"]})
        self.assertNotIn("ears", page["listener"])

    def test_a_body_that_is_described_is_computed_and_its_bank_comes_along(self):
        drum = {"name": "drum", "body": {"membrane": {"shape": "circle", "radius_m": 0.2, "lowest_hz": 100, "density_kg_m2": 0.3}}}
        drum |= {"material": "polyester film", "max_modes": 10, "fixed": True}
        blow = {"time_s": 0.05, "body": "drum", "point_m": [0.1, 0, 0], "impulse_n_s": [0, 0, -0.01]}
        bar = {"name": "bar", "bank": "brass.hdf", "fixed": True, "position_m": [1, 0, 0]}
        (self.root / "described.json").write_text(json.dumps({"duration_s": 0.2, "bodies": [drum, bar], "strikes": [blow]}))
        with tempfile.TemporaryDirectory() as cache, unittest.mock.patch.dict(os.environ, {"XDG_CACHE_HOME": cache}):
            self.explore("described.json", "-o", "described")
            self.call_render("described.json", "-o", "described.wav")
        scene = self.read("described", "scene.json")
        self.assertEqual([sorted(body) for body in scene["bodies"]], [["bank", "fixed", "name"], ["bank", "fixed", "name", "position_m"]])
        self.assertFalse(list((self.root / "described").glob(".*")))
        self.call_render("described/scene.json", "-o", "folder.wav")  # without the cache
        self.assertEqual((self.root / "described.wav").read_bytes(), (self.root / "folder.wav").read_bytes())

    def test_large_banks_are_made_smaller_and_whole_ones_are_kept(self):
        subprocess.run([BIN / "make_example_bank", "large.hdf", "60", "60"], cwd=self.root, check=True)
        size = (self.root / "large.hdf").stat().st_size
        self.assertGreater(size, 4_000_000)
        small, whole = self.explore("large.hdf", "-o", "small")["banks"][0], self.explore("large.hdf", "-o", "whole", "--whole")["banks"][0]
        self.assertLess(small["bytes"], 0.5 * size)
        self.assertRegex(small["change"], r"^packed, error at most -60\.\d dB\(A\) on 95 % of the surface")
        checked = subprocess.run(
            [BIN / "carillon-bank", "check", "small/banks/large.hdf", "--original", "large.hdf"],
            cwd=self.root,
            capture_output=True,
            text=True,
        )
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)
        self.assertEqual((whole["bytes"], whole["change"]), (size, None))
        self.assertEqual((self.root / "whole/banks/large.hdf").read_bytes(), (self.root / "large.hdf").read_bytes())

    def test_up_turns_the_meshes_of_modelling_programs(self):
        self.explore("brass.hdf", "-o", "turned", "--up", "y")
        body = self.read("turned", "scene.json")["bodies"][0]
        self.assertEqual(body["rotation_deg"], [90, 0, 0])
        self.assertAlmostEqual(body["position_m"][2], 0.025, places=6)  # its width points up

    def test_the_server_gives_the_folder_to_this_machine_alone(self):
        (self.root / "secret.txt").write_text("secret")
        server = Server(str(self.root / "brass.hdf"), "-o", str(self.root / "served"))
        self.addCleanup(lambda: server.process.poll() is None and server.process.kill())
        self.assertEqual(server.host, "127.0.0.1")
        types = {
            "/": "text/html",
            "/main.js": "javascript",
            "/explore.css": "text/css",
            "/scene.json": "application/json",
            "/audio/carillon.wasm": "application/wasm",
            "/banks/brass.hdf": "application/octet-stream",
        }
        for path, kind in types.items():
            response, body = server.get(path)
            self.assertEqual(response.status, 200, path)
            self.assertIn(kind, response.getheader("Content-Type"), path)
            self.assertEqual(response.getheader("X-Content-Type-Options"), "nosniff")
            self.assertEqual(body, (self.root / "served" / (path[1:] or "index.html")).read_bytes(), path)
        response, body = server.get("/scene.json", **{"Accept-Encoding": "br, gzip"})
        self.assertIsNone(response.getheader("Content-Encoding"))
        for path in ("/../secret.txt", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "//secret.txt", "/banks/../../secret.txt", "/none"):
            response, body = server.get(path)
            self.assertEqual(response.status, 404, path)
            self.assertNotIn(b"secret", body.replace(path.encode(), b""))
        (self.root / "served" / "out").symlink_to(self.root / "secret.txt")
        (self.root / "served" / "in").symlink_to("scene.json")
        self.assertEqual(server.get("/out")[0].status, 404)
        self.assertEqual(server.get("/in")[0].status, 200)
        for link in ("out", "in"):
            (self.root / "served" / link).unlink()
        self.assertEqual(server.get("/scene.json", Host="evil.example")[0].status, 421)
        self.assertEqual(server.get("/scene.json", Host=f"localhost:{server.port}")[0].status, 200)
        for name in {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}:
            with socket.socket() as other:
                self.assertNotEqual(other.connect_ex((name, server.port)), 0, name)
        self.refuse("brass.hdf", "-o", "x", "--port", "80", contains=("--port",))
        taken = subprocess.run(
            [BIN / "carillon", "explore", self.root / "served", "--serve", "--port", str(server.port)],
            capture_output=True,
            text=True,
            timeout=20,
        )
        self.assertEqual((taken.returncode, len(taken.stderr.splitlines())), (4, 1), taken.stderr)
        self.assertIn("in use", taken.stderr)
        self.assertEqual(server.stop(), 0)
        again = Server(str(self.root / "served"))
        self.assertEqual(again.get("/index.html")[0].status, 200)
        self.assertEqual(again.stop(signal.SIGTERM), 0)

    def test_bad_input_ends_in_one_sentence_and_leaves_nothing(self):
        (self.root / "text.json").write_text("{")
        whole = (self.root / "brass.hdf").read_bytes()
        (self.root / "cut.hdf").write_bytes(whole[:-1000])
        (self.root / "changed.hdf").write_bytes(whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:])
        (self.root / "future.hdf").write_bytes(whole.replace(b"CARILLON BANK 1.", b"CARILLON BANK 9.", 1))
        (self.root / "kept").mkdir(exist_ok=True)
        (self.root / "kept/mine.txt").write_text("mine")
        other = {**SCENE, "bodies": [{**SCENE["bodies"][0], "bank": "none.hdf"}]}
        (self.root / "other.json").write_text(json.dumps(other))
        recorded = {**SCENE, "bodies": [*SCENE["bodies"], {"name": "recorded", "recording": "plate.surface"}]}
        (self.root / "recorded.json").write_text(json.dumps(recorded))
        self.refuse("recorded.json", contains=("recorded.json", "is a recording, which pages cannot play"))
        self.refuse("none.hdf", contains=("none.hdf", "no such file"))
        self.refuse("text.json", contains=("text.json:1",))
        self.refuse("other.json", contains=("none.hdf",))
        self.refuse("cut.hdf", contains=("cut.hdf",))
        self.refuse("cut.hdf", "-o", "deep/down/page", contains=("cut.hdf",))
        self.refuse("changed.hdf", contains=("changed.hdf",))
        self.refuse("future.hdf", contains=("future.hdf", "9."))
        self.refuse("brass.hdf", "scene.json", contains=("scene.json",))
        self.refuse("brass.hdf", "-o", "kept", contains=("kept", "not made by carillon explore"))
        self.assertEqual((self.root / "kept/mine.txt").read_text(), "mine")
        self.refuse("kept", "--serve", contains=("kept",))
        self.refuse("kept", contains=("--serve",))
        self.refuse("brass.hdf", "--up", "x", contains=("--up",))


if __name__ == "__main__":
    unittest.main()
