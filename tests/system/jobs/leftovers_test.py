#!/usr/bin/python3
"""No process, temporary file or partial result is left after Ctrl-C or SIGTERM; after SIGKILL, none is left by the next run.

Signals are sent at several delays after the first temporary folder appears.

usage: leftovers_test.py BIN_DIR
"""
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import BIN, Bench, make_job
from surfaces import format_off, make_box

BAR = {"length_m": 0.2, "width_m": 0.03, "thickness_m": 0.012, "nodes": 20000}


class Leftovers(Bench):
    def setUp(self):
        super().setUp()
        self.temporary = self.folder / "tmp"
        self.temporary.mkdir()
        self.out = self.folder / "out"
        self.out.mkdir()
        self.environment |= {"TMPDIR": str(self.temporary), "XDG_CACHE_HOME": str(self.folder / "cache"), "CARILLON_MARK": str(self.folder)}
        body = {"name": "bar", "shape": {"bar": BAR}, "material": "steel", "fixed": True}
        scene = {"duration_s": 0.1, "bodies": [body], "listener": {"position_m": [0, -1, 0]}}
        scene["strikes"] = [{"time_s": 0.01, "body": "bar", "point_m": [0, 0, 0.006], "mallet": "hard-wood"}]
        self.write("scene.json", scene)

    def find_left(self):
        return sorted(path for folder in (self.temporary, self.out) for path in folder.iterdir())

    def find_processes(self):
        """Processes of this test, by their environment."""
        found = []
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            try:
                if f"CARILLON_MARK={self.folder}\0".encode() in (process / "environ").read_bytes():
                    found.append(process.name)
            except OSError:
                pass
        return found

    def interrupt(self, words, number, delay_s):
        program = subprocess.Popen(
            [str(word) for word in words],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        while not self.find_left() and program.poll() is None:
            time.sleep(0.005)
        time.sleep(delay_s)
        program.send_signal(number)
        said = program.communicate(timeout=60)[1]
        if program.returncode == 0:  # done before the signal
            self.assertEqual(list(self.temporary.iterdir()), [])
            shutil.rmtree(self.out)
            self.out.mkdir()
            return False
        self.assertIn(program.returncode, (-number, 128 + number), said)
        for _ in range(2000):  # wait for its children
            if not self.find_processes():
                break
            time.sleep(0.01)
        self.assertEqual(self.find_processes(), [])
        return True

    def check(self, *words):
        """Sends signals at several delays; nothing may be left."""
        ended = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            for delay_s in (0.0, 0.1, 0.5, 1.5):
                if not self.interrupt(words, number, delay_s):
                    break
                ended += 1
                self.assertEqual(self.find_left(), [], (number, delay_s))
        self.assertGreater(ended, 0)
        self.interrupt(words, signal.SIGKILL, 0.2)

    def test_a_scene_without_banks(self):
        words = (BIN / "carillon-render", "scene.json", "-q", "-o", "out/sound.wav")
        self.check(*words)
        done = subprocess.run([str(word) for word in words], cwd=self.folder, env=self.environment, timeout=300)
        self.assertEqual(done.returncode, 0)
        self.assertEqual([path.name for path in self.find_left()], ["sound.wav"])

    @unittest.skipUnless((BIN.parent / "share/carillon/explore").is_dir(), "a build without the page")
    def test_a_page(self):
        words = (BIN / "carillon", "explore", "scene.json", "-o", "out/page")
        self.check(*words)
        done = subprocess.run([str(word) for word in words], cwd=self.folder, env=self.environment, timeout=300, stdout=subprocess.DEVNULL)
        self.assertEqual(done.returncode, 0)
        self.assertEqual([path.name for path in self.find_left()], ["page"])
        self.assertFalse(list((self.out / "page").glob(".carillon*")))

    def test_a_solve(self):
        self.write("box.off", format_off(*make_box(0.1, 0.06, 0.02)))
        self.write("job.json", {"body": {"surface": "box.off", "nodes": 30000}, "material": "steel", "bank": "out/box.hdf"})
        self.check(BIN / "carillon-precompute", "-q", "job.json")

    def test_a_report_with_pictures(self):
        self.write("bar.json", make_job())
        self.run_it("submit", "bar.json", "--run")
        bank = self.run_it("get", "bar.json").stdout.strip()
        for number in (signal.SIGINT, signal.SIGTERM):
            self.interrupt((BIN / "carillon", "report", bank, "-o", "out"), number, 0.3)
            self.assertEqual([path for path in self.find_left() if path.name.startswith(".")], [])


if __name__ == "__main__":
    unittest.main()
