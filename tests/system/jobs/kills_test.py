#!/usr/bin/python3
"""carillon submit is killed at each of its disk-changing system calls in turn; the next submit must find a consistent store.

usage: kills_test.py BIN_DIR
"""
import collections
import os
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import Bench, make_job

CALLS = "write,pwrite64,fsync,fdatasync,rename,renameat,renameat2,mkdir,linkat,unlink,rmdir,ftruncate"


class Kills(Bench):
    parent = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # SIGKILL loses no written data, so a RAM disk is sufficient

    def trace(self, kill, *words):
        inject = ["-e", f"inject={kill[0]}:signal=KILL:when={kill[1]}"] if kill else []
        return subprocess.run(
            ["strace", "-qq", "-o", self.folder / "trace", "-e", f"trace={CALLS}", *inject, *self.command(*words)],
            capture_output=True,
            text=True,
            cwd=self.folder,
            env=self.environment,
            timeout=60,
        )

    def setUp(self):
        super().setUp()
        if subprocess.run(["strace", "-qq", "true"], capture_output=True).returncode != 0:
            self.skipTest("strace may not trace here")

    def test_submit_killed_at_every_write(self):
        (self.folder / "m.msh").write_text("$MeshFormat\n")
        job = make_job(mesh="m.msh")
        del job["body"]
        self.write("bar.json", job)
        self.assertEqual(self.trace(None, "submit", "bar.json").returncode, 0)
        calls = collections.Counter(re.findall(r"^(\w+)\(", (self.folder / "trace").read_text(), re.M))
        kills = [(name, when) for name, count in calls.items() for when in range(1, count + 1)]
        self.assertGreater(len(kills), 50)
        id_ = self.ask("status")["jobs"][0]["id"]
        killed = 0
        for kill in kills:
            shutil.rmtree(self.store)
            killed += self.trace(kill, "submit", "bar.json").returncode != 0
            with self.subTest(kill=kill):
                jobs = self.ask("status")["jobs"]
                self.assertIn([(entry["id"], entry["state"]) for entry in jobs], ([], [(id_, "queued")]))
                self.assertEqual([(entry["id"], entry["state"]) for entry in self.ask("submit", "bar.json")["jobs"]], [(id_, "queued")])
                work = list((self.store / "work").glob("??/*"))
                self.assertEqual([path.name for path in work], [id_])
                self.assertEqual({path.name for path in work[0].iterdir()}, {"job.json", "request.json", "state.json"})
                self.assertEqual([path.read_text() for path in (self.store / "inputs").rglob("*.msh")], ["$MeshFormat\n"])
                self.ask("gc", "--delete")
                self.assertEqual(list((self.store / "tmp").iterdir()), [])
                self.assertEqual(self.ask("explain", "bar.json")["changes"], [])
        self.assertGreaterEqual(killed, len(kills) - 2)

    def test_retry_killed_at_every_sync_did_all_or_nothing(self):
        self.write("bar.json", make_job())
        id_ = self.ask("submit", "bar.json", "--ranks", "1")["jobs"][0]["id"]
        self.ask("cancel", "bar.json")
        kept = self.folder / "kept"
        shutil.copytree(self.store, kept)
        self.assertEqual(self.trace(None, "retry", id_, "--ranks", "2").returncode, 0)
        calls = collections.Counter(re.findall(r"^(f\w*sync)\(", (self.folder / "trace").read_text(), re.M))
        self.assertGreater(sum(calls.values()), 2)
        seen = set()
        for kill in [(name, when) for name, count in calls.items() for when in range(1, count + 1)]:
            shutil.rmtree(self.store)
            shutil.copytree(kept, self.store)
            self.trace(kill, "retry", id_, "--ranks", "2")
            job = self.ask("status", id_)["jobs"][0]
            seen.add((job["state"], job["ranks"]))
        self.assertLessEqual(seen, {("cancelled", 1), ("queued", 2)})
        self.assertIn(("cancelled", 1), seen)


if __name__ == "__main__":
    unittest.main()
