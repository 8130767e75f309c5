#!/usr/bin/python3
"""Simulations in the store: submitted, run by mpirun, killed and resumed, damaged, copied.

usage: simulate_test.py BIN_DIR
"""
import json
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import time
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import BIN, Bench, make_simulation


def run_alone(folder, job):
    """The sound of carillon-simulate without a store."""
    (folder / "alone.json").write_text(json.dumps({**job, "sound": "alone.wav"}))
    subprocess.run([BIN / "carillon-simulate", "--quiet", "alone.json"], cwd=folder, check=True)
    return (folder / "alone.wav").read_bytes()


class Simulations(Bench):
    def results(self, job):
        return {key: pathlib.Path(file) for key, file in self.ask("get", job)["results"].items()}

    def test_from_submit_to_gc(self):
        job = make_simulation(motion="bar.vtkhdf", surface="bar.surface.hdf", spectrogram="bar.png")
        file = self.write("a/bar.json", job)
        said = self.ask("submit", file)
        self.assertEqual([(entry["state"], entry["new"]) for entry in said["jobs"]], [("queued", True)])
        id_ = said["jobs"][0]["id"]
        # An equivalent job with other file names and resources: the same id.
        other = {**job, "motion": "x.vtkhdf", "record": "x.json", "resources": {"ranks": 1}}
        other["simulate"] = {**job["simulate"], "duration_s": 2.0e-3}
        text = "// the same\n" + json.dumps(dict(reversed(other.items())), indent=3)
        again = self.ask("submit", self.write("b/other.json", text))
        self.assertEqual([(entry["id"], entry["new"]) for entry in again["jobs"]], [(id_, False)])
        self.run_it("run", "--quiet")
        state = self.ask("status", id_)["jobs"][0]
        self.assertEqual((state["state"], state["percent"], state["bank"]), ("done", 100.0, None))
        self.assertGreater(state["memory_gb"], 0)
        files = self.results(file)
        self.assertEqual(
            {key: path.name for key, path in files.items()},
            {
                "motion": "motion.vtkhdf",
                "record": "record.json",
                "sound": "sound.wav",
                "spectrogram": "spectrogram.png",
                "surface": "surface.hdf",
            },
        )
        folder = files["sound"].parent
        self.assertEqual(files["sound"].read_bytes(), run_alone(self.folder, job))
        self.assertEqual(files["spectrogram"].read_bytes(), (self.folder / "bar.png").read_bytes())  # of the run alone
        self.assertEqual(folder.stat().st_mode & 0o222, 0)
        self.assertFalse((folder / "report.html").exists())
        self.assertIn("steps of", self.run_it("log", id_).stdout)
        # Again: served from the store.
        done = self.ask("submit", "b/other.json", "--run")["jobs"][0]
        self.assertEqual((done["state"], done["new"], done["attempts"]), ("done", False, state["attempts"]))
        self.assertFalse(self.ask("explain", file)["would_run"])
        self.refuse("report", file, says="a simulation has no report")
        (self.folder / "out").mkdir()
        self.run_it("get", file, "--to", "out")
        self.assertEqual({path.name for path in (self.folder / "out").iterdir()}, {path.name for path in files.values()})
        self.assertEqual((self.folder / "out/motion.vtkhdf").read_bytes(), files["motion"].read_bytes())
        self.refuse("get", file, "--to", "one.wav", says=["one.wav", "folder"])
        # Damage is found and repaired by another run.
        self.assertEqual(self.ask("verify")["damaged"], [])
        sound, picture = files["sound"].read_bytes(), files["spectrogram"].read_bytes()
        folder.chmod(0o755)
        files["spectrogram"].chmod(0o644)
        files["spectrogram"].write_bytes(picture[:-1] + b"x")
        self.assertIn("spectrogram.png", self.ask("verify", code=3)["damaged"][0]["fault"])
        files["spectrogram"].write_bytes(picture)
        files["sound"].chmod(0o644)
        files["sound"].write_bytes(sound[:-4] + b"\0\0\0\1")
        found = self.ask("verify", code=3)["damaged"]
        self.assertEqual([entry["id"] for entry in found], [id_])
        self.assertIn("sound.wav", found[0]["fault"])
        self.run_it("verify", "--repair")
        self.run_it("run", "--quiet")
        self.assertEqual(self.results(file)["sound"].read_bytes(), sound)
        # Garbage only without both job files.
        self.assertEqual([item["kind"] for item in self.ask("gc")["items"]], ["damaged"])
        file.unlink()
        (self.folder / "b/other.json").unlink()
        self.assertEqual(sorted(item["kind"] for item in self.ask("gc", "--delete")["items"]), ["bank", "damaged"])
        self.assertFalse(folder.exists())

    def test_killed_and_resumed_on_two_ranks(self):
        job = make_simulation(0.3)
        file = self.write("bar.json", {**job, "resources": {"ranks": 2}})
        id_ = self.ask("submit", file)["jobs"][0]["id"]
        work = self.store / "work" / id_[:2] / id_
        queue = subprocess.Popen(self.command("run", "--quiet"), cwd=self.folder, env=self.environment, stderr=subprocess.DEVNULL)
        self.addCleanup(queue.kill)
        self.wait(lambda: self.percent(work) > 5)
        status = self.ask("status", id_)["jobs"][0]
        self.assertEqual((status["state"], status["phase"], status["ranks"]), ("running", "simulate", 2))
        queue.send_signal(signal.SIGTERM)
        queue.wait(120)
        self.assertTrue((work / "checkpoint").exists())
        self.assertEqual(self.ask("status", id_)["jobs"][0]["state"], "queued")
        # Then all of its processes at once.
        queue = subprocess.Popen(self.command("run", "--quiet"), cwd=self.folder, env=self.environment, stderr=subprocess.DEVNULL)
        self.addCleanup(queue.kill)
        self.wait(lambda: "resumed at" in (work / "log").read_text())
        attempt = json.loads((work / "attempt.json").read_text())
        queue.kill()
        subprocess.run(["kill", "-KILL", str(attempt["pid"])])
        queue.wait(60)
        self.run_it("run", "--quiet")
        log = self.run_it("log", id_).stdout
        self.assertGreaterEqual(log.count("resumed at"), 2)
        self.assertIn("2 ranks", log)
        # Bitwise equal to an uninterrupted run on one rank without a store.
        self.assertEqual(self.results(file)["sound"].read_bytes(), run_alone(self.folder, job))

    def percent(self, work):
        try:
            return json.loads((work / "progress.jsonl").read_text().splitlines()[-1])["percent"]
        except (OSError, IndexError, ValueError):
            return 0

    def wait(self, holds, limit_s=120):
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            try:
                if holds():
                    return
            except OSError:
                pass
            time.sleep(0.1)
        self.fail("it did not come to that")

    def test_meshes_are_copied_and_count(self):
        mesh = self.make_bar_mesh()
        job = make_simulation()
        body = job["simulate"]["bodies"][0]
        del body["shape"]
        job["simulate"]["impulses"] = []
        job["simulate"]["gravity_m_s2"] = [0, 0, -9.8]
        job["simulate"]["bodies"] = [{**body, "mesh": "bar.msh"}, {**body, "name": "other", "mesh": "copy.msh", "position_m": [0, 1, 0]}]
        shutil.copy(mesh, self.folder / "copy.msh")
        file = self.write("bar.json", job)
        id_ = self.ask("submit", file)["jobs"][0]["id"]
        self.assertEqual(len(list((self.store / "inputs").rglob("*.msh"))), 1)
        # A changed mesh gives another id; carillon explain shows the mesh.
        (self.folder / "copy.msh").write_bytes(mesh.read_bytes() + b"\n")
        said = self.ask("explain", file)
        self.assertNotEqual(said["id"], id_)
        self.assertEqual([change["part"] for change in said["changes"] if change["part"] == "mesh"], ["mesh"])
        mesh.unlink()
        (self.folder / "copy.msh").unlink()
        self.run_it("run", "--quiet")
        self.assertEqual(self.ask("status", id_)["jobs"][0]["state"], "done")
        sound = (self.store / "banks" / id_[:2] / id_ / "sound.wav").read_bytes()
        fact = sound.index(b"fact")  # chunk: name, size, number of frames
        frames = struct.unpack("<I", sound[fact + 8 : fact + 12])[0]
        self.assertEqual(frames, 96)

    def test_wrong_jobs(self):
        job = make_simulation()
        job["simulate"]["duraton_s"] = 1
        self.refuse("submit", self.write("typo.json", job), says=["typo.json:1", "duraton_s", "duration_s"])
        del job["simulate"]["duraton_s"]
        silent = dict(job)
        del silent["sound"]
        self.refuse("submit", self.write("silent.json", silent), says=["silent.json", "sound"])
        # An error that only the mesh shows fails the job without retries.
        job["simulate"]["bodies"][0]["fixed"] = "x-mni"
        file = self.write("set.json", job)
        self.run_it("submit", file, "--run", code=3)
        state = self.ask("status", file)["jobs"][0]
        self.assertEqual((state["state"], state["attempts"]), ("failed", 1))
        self.assertIn("x-mni", state["reason"])
        self.assertFalse(list((self.store / "banks").glob("??/*")))

    def test_prediction_and_cancel(self):
        file = self.write("long.json", make_simulation(60.0))
        said = self.ask("validate", file)
        self.assertGreater(said["cpu_seconds"], 10)
        self.assertEqual(said["memory_bytes"]["2"], 2 * said["memory_bytes"]["1"])
        self.run_it("submit", file)
        queue = subprocess.Popen(self.command("run", "--quiet"), cwd=self.folder, env=self.environment, stderr=subprocess.DEVNULL)
        self.addCleanup(queue.kill)
        id_ = self.ask("status", file)["jobs"][0]["id"]
        work = self.store / "work" / id_[:2] / id_
        self.wait(lambda: self.percent(work) > 0)
        state = self.ask("status", id_)["jobs"][0]
        predicted = json.loads((work / "prediction.json").read_text())["memory_bytes"]
        self.assertGreaterEqual(state["memory_gb"], 1e-9 * predicted[str(state["ranks"])])
        self.run_it("cancel", file)
        self.assertEqual(queue.wait(120), 3, "a cancelled job")
        self.assertEqual(self.ask("status", file)["jobs"][0]["state"], "cancelled")
        self.assertTrue((work / "checkpoint").exists())


if __name__ == "__main__":
    unittest.main()
