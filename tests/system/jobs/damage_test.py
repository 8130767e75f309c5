#!/usr/bin/python3
"""Damaged stores, full disks, two users of one store.

usage: damage_test.py BIN_DIR
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import BIN, Bench, make_job


class Damage(Bench):
    def run_queue(self, code=0):
        return self.run_it("run", "--quiet", code=code)

    def make_done(self, **changes):
        job = self.write("bar.json", make_job(**changes))
        self.run_it("submit", job)
        self.run_queue()
        bank = pathlib.Path(self.run_it("get", job).stdout.strip())
        for path in (bank.parent.parent, bank.parent, bank):
            path.chmod(0o755)
        return job, bank

    def make_mesh_job(self):
        mesh = self.make_bar_mesh()
        job = make_job(mesh="bar.msh")
        del job["body"]
        return self.write("mesh.json", job), mesh

    def test_a_job_that_was_edited_in_the_store_is_not_solved(self):
        job = self.write("bar.json", make_job())
        self.run_it("submit", job)
        (file,) = self.store.glob("work/*/*/job.json")
        file.write_text(file.read_text().replace("7800", "2800"))
        self.run_queue(code=3)
        state = self.ask("status")["jobs"][0]
        self.assertEqual((state["state"], state["attempts"]), ("failed", 1))
        self.assertIn("job.json", state["reason"])
        self.assertIn("submit the job again", state["reason"])
        self.run_it("submit", job)
        self.run_queue()
        self.run_it("get", job)
        record = json.loads((pathlib.Path(self.run_it("get", job).stdout.strip()).parent / "job.json").read_text())
        self.assertEqual(record["material"]["density_kg_m3"], 7800)

    def test_a_bank_of_another_job_is_not_served_whatever_its_sum_says(self):
        job, bank = self.make_done()
        other = self.write("other.json", make_job(material={**make_job()["material"], "density_kg_m3": 7900}))
        self.run_it("submit", other, "--run")
        forged = pathlib.Path(self.run_it("get", other).stdout.strip())
        times = forged.stat()
        bank.unlink()
        shutil.copy2(forged, bank)
        id_, other_id = bank.parent.name, forged.parent.name
        first = (forged.parent / "bank.sum").read_text().splitlines()[0]
        for has_sum in (True, False):  # banks of earlier versions have none
            sum_file = bank.parent / "bank.sum"
            sum_file.chmod(0o644)
            sum_file.unlink()
            if has_sum:
                sum_file.write_text(first.replace(other_id, id_) + "\n")
            os.utime(bank, ns=(times.st_atime_ns, times.st_mtime_ns))
            for words in ((), ("--to", "copy.hdf")):
                got = self.run_it("get", job, *words, code=1)
                self.assertEqual(got.stdout, "")
                self.assertIn("another job", got.stderr)
            self.assertFalse((self.folder / "copy.hdf").exists())
            sum_file.touch()
        self.run_it("retry", job)
        self.run_queue()
        self.assertNotEqual(pathlib.Path(self.run_it("get", job).stdout.strip()).read_bytes(), forged.read_bytes())

    def test_the_bank_goes_nowhere_else(self):
        job = self.write("bar.json", make_job())
        self.run_it("submit", job)
        victim = self.write("victim", "important")
        (file,) = self.store.glob("work/*/*/job.json")
        file.write_text(file.read_text().replace('"bank.hdf"', json.dumps(str(victim))))
        self.run_queue(code=3)
        self.assertEqual(victim.read_text(), "important")
        self.assertFalse(pathlib.Path(str(victim) + ".resolved.json").exists())
        self.assertEqual(self.ask("status")["jobs"][0]["state"], "failed")

    def test_a_damaged_input_is_not_solved_and_copied_again(self):
        job, mesh = self.make_mesh_job()
        self.run_it("submit", job)
        (copy,) = self.store.glob("inputs/*/*.msh")
        copy.chmod(0o644)
        whole = copy.read_bytes()
        copy.write_bytes(whole.replace(b"1", b"2", 1))
        self.run_queue(code=3)
        state = self.ask("status")["jobs"][0]
        self.assertEqual((state["state"], state["attempts"]), ("failed", 1))
        self.assertIn("damaged", state["reason"])
        self.assertEqual([entry["kind"] for entry in self.ask("verify", code=3)["damaged"]], ["input"])
        self.run_it("submit", job)
        self.assertEqual(copy.read_bytes(), whole)
        self.run_queue()
        self.run_it("get", job)

    def test_a_damaged_bank_is_not_done_and_can_be_computed_again(self):
        job, bank = self.make_done()
        whole = bank.read_bytes()
        other = self.write("other.json", make_job(max_modes=2))
        self.run_it("submit", other)
        self.run_queue()
        second = pathlib.Path(self.run_it("get", other).stdout.strip()).read_bytes()
        damages = {
            "missing": None,
            "cut": whole[:-1],
            "empty": b"",
            "flipped": whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:],
            "swapped": second,
        }
        for number, (name, content) in enumerate(damages.items()):
            for path in (bank.parent, bank):
                path.chmod(0o755)
            bank.unlink() if content is None else bank.write_bytes(content)
            with self.subTest(name):
                done = self.run_it("get", job, code=1)
                self.assertEqual(done.stdout, "")
                self.assertIn("computes it again", done.stderr)
                self.run_it("get", job, "--to", self.folder / "copy.hdf", code=1)
                self.assertFalse((self.folder / "copy.hdf").exists())
                self.assertEqual([entry["state"] for entry in self.ask("status", job)["jobs"]], ["failed"])
                self.assertTrue(self.ask("explain", job)["would_run"])
                self.assertEqual([entry["kind"] for entry in self.ask("verify", code=3)["damaged"]], ["bank"])
                self.run_it(*(("submit", job), ("retry", job), ("verify", "--repair"))[number % 3])
                self.run_queue()
                self.assertEqual(pathlib.Path(self.run_it("get", job).stdout.strip()), bank)
                subprocess.run([BIN / "carillon-bank", "check", bank], check=True, stdout=subprocess.DEVNULL)
                self.assertEqual(self.ask("verify")["damaged"], [])
        # A flipped bit with unchanged time.
        for path in (bank.parent, bank):
            path.chmod(0o755)
        time = bank.stat()
        content = bytearray(bank.read_bytes())
        content[9000] ^= 1
        bank.write_bytes(content)
        os.utime(bank, ns=(time.st_atime_ns, time.st_mtime_ns))
        self.run_it("get", job, "--to", self.folder / "copy.hdf", code=1)
        self.assertEqual([entry["state"] for entry in self.ask("status", job)["jobs"]], ["failed"])
        self.assertTrue(all(item["kind"] == "damaged" for item in self.ask("gc")["items"]))

    def open_up(self, folder):
        for path in (folder, *folder.iterdir()):
            path.chmod(0o755)

    def test_a_bank_without_its_sum_is_read_before_it_is_believed(self):
        job, bank = self.make_done()
        other = self.write("other.json", make_job(max_modes=2))
        self.run_it("submit", other)
        self.run_queue()
        second = pathlib.Path(self.run_it("get", other).stdout.strip()).read_bytes()
        whole = bank.read_bytes()

        def spoil(content):
            self.open_up(bank.parent)
            (bank.parent / "bank.sum").unlink()
            time = bank.stat()
            bank.write_bytes(content)
            os.utime(bank, ns=(time.st_atime_ns, time.st_mtime_ns))

        spoil(whole)
        self.run_it("get", job, "--to", self.folder / "copy.hdf")
        self.assertEqual((self.folder / "copy.hdf").read_bytes(), whole)
        self.assertIn("nothing to do", self.run_it("submit", job).stdout)
        self.assertIn("nothing to do again", self.run_it("retry", job, code=None).stdout)
        self.assertEqual(self.ask("verify")["damaged"], [])
        (bank.parent / "bank.sum").write_text("")
        flipped = whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:]
        for number, content in enumerate((flipped, second, flipped[: len(whole) // 2], second)):
            with self.subTest(number):
                spoil(content)
                self.assertIn("computes it again", self.run_it("get", job, code=1).stderr)  # also without --to
                (self.folder / "copy.hdf").unlink(missing_ok=True)
                self.assertIn("computes it again", self.run_it("get", job, "--to", self.folder / "copy.hdf", code=1).stderr)
                self.assertFalse((self.folder / "copy.hdf").exists())
                self.assertEqual([entry["kind"] for entry in self.ask("verify", code=3)["damaged"]], ["bank"])
                self.run_it("retry" if number % 2 == 0 else "submit", job)
                self.assertEqual(self.ask("status", job)["jobs"][0]["state"], "queued")
                self.run_queue()
                self.assertEqual(pathlib.Path(self.run_it("get", job).stdout.strip()), bank)
                self.assertTrue((bank.parent / "bank.sum").exists())
                self.assertEqual(self.ask("verify")["damaged"], [])

    def test_records_next_to_a_bank_are_verified_and_written_again(self):
        job, bank = self.make_done()
        loud = self.write("loud.json", make_job(band_hz=[20, 21]))
        self.run_it("submit", loud)
        self.run_queue()
        other = pathlib.Path(self.run_it("get", loud).stdout.strip()).parent
        whole = self.folder / "whole"
        shutil.copytree(bank.parent, whole)
        records = {name: (bank.parent / name).read_text() for name in ("job.json", "outcome.json", "request.json")}
        damages = {
            "empty": lambda name: "",
            "cut": lambda name: records[name][: len(records[name]) // 2],
            "other": lambda name: (other / name).read_text(),
            "odd": lambda name: "{}",
            "list": lambda name: "[1]",
            "deep": lambda name: "[" * 100000,
            "missing": lambda name: None,
        }
        for name in records:
            for kind, make in damages.items():
                for has_sum in (True, False):
                    if not has_sum and (name == "request.json" or (name, kind) == ("outcome.json", "other")):
                        continue  # not detectable without bank.sum
                    with self.subTest(f"{name} {kind} {has_sum}"):
                        self.open_up(bank.parent)
                        shutil.rmtree(bank.parent)
                        shutil.copytree(whole, bank.parent)
                        self.open_up(bank.parent)
                        if not has_sum:
                            (bank.parent / "bank.sum").unlink(missing_ok=True)
                        text = make(name)
                        (bank.parent / name).unlink() if text is None else (bank.parent / name).write_text(text)
                        got = self.ask("get", job)
                        self.assertEqual((got["state"], got["bank"]), ("done", str(bank)))
                        self.assertFalse([warning for warning in got["warnings"] if "silent" in warning])
                        state = next(entry for entry in self.ask("status")["jobs"] if entry["id"] == got["id"])
                        self.assertEqual(state["state"], "done")
                        self.assertFalse([warning for warning in state["warnings"] if "silent" in warning])
                        commands = (("explain", job), ("log", job), ("report", job, "--no-pictures"), ("gc",))
                        for words in commands if kind in ("empty", "deep") else ():
                            self.run_it(*words)
                        found = self.ask("verify", code=3)["damaged"]
                        self.assertEqual([(entry["kind"], entry["id"]) for entry in found], [("record", got["id"])])
                        self.assertIn(name, found[0]["fault"])
                        self.assertTrue(self.ask("verify", "--repair")["damaged"][0]["repaired"])
                        self.assertEqual(self.ask("verify")["damaged"], [])
                        self.assertEqual(self.ask("status", job)["jobs"][0]["state"], "done")
                        self.assertEqual(bank.parent.stat().st_mode & 0o222, 0)
                        before, after = json.loads(records["job.json"]), json.loads((bank.parent / "job.json").read_text())
                        self.assertEqual({**before, "run": None}, {**after, "run": None})
                        self.assertEqual(json.loads((bank.parent / "request.json").read_text())["id"], got["id"])

    def test_warnings_name_the_file_of_the_user(self):
        text = json.dumps(
            make_job(
                material={"young_modulus_pa": 72, "poisson_ratio": 0.3, "density_kg_m3": 2500, "damping": {"rayleigh": {"alpha1_s": 1e-7}}},
                max_modes=1,
            ),
            indent=1,
        )
        job = self.write("glass.json", text)
        line = next(number for number, words in enumerate(text.splitlines(), 1) if "young_modulus_pa" in words)
        wanted = "young_modulus_pa is 72: was it given in GPa?"

        def find(warnings):
            found = [warning for warning in warnings if wanted in warning]
            self.assertEqual(len(found), 1, warnings)
            self.assertNotIn(str(self.store), found[0])
            return found[0]

        self.run_it("submit", job)
        events = [json.loads(words) for words in self.run_it("run", "--json").stdout.splitlines()]
        self.assertTrue(find(next(entry["warnings"] for entry in events if entry["event"] == "done")).startswith(f"{job}: "))
        self.assertTrue(find(self.ask("submit", job)["jobs"][0]["warnings"]).startswith(f"{job}:{line}: "))
        self.assertTrue(find(self.run_it("submit", job).stderr.splitlines()).startswith(f"carillon: glass.json: warning: {job}:{line}: "))
        self.assertTrue(find(self.ask("status")["jobs"][0]["warnings"]).startswith("the job: "))
        self.assertTrue(find(self.ask("get", job)["warnings"]).startswith("the job: "))
        find(self.run_it("status").stdout.splitlines())
        find(self.run_it("get", job).stderr.splitlines())

    def test_a_bank_whose_folder_is_gone_is_found_and_queued_again(self):
        self.make_done()
        (folder,) = self.store.glob("banks/*/*")
        folder.chmod(0o755)
        shutil.rmtree(folder)
        self.assertIn("missing", self.run_it("verify", code=3).stdout)
        self.run_it("verify", "--repair")
        self.assertEqual(self.ask("status")["jobs"][0]["state"], "queued")

    def test_a_mesher_that_crashes_is_not_started_again(self):
        programs = self.folder / "bin"
        for name in ("bin/carillon", "bin/carillon-precompute", "libexec/carillon/carillon-precompute"):
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(BIN.parent / name, self.folder / name)
            except OSError:
                shutil.copy(BIN.parent / name, self.folder / name)
        (programs / "carillon-mesh").write_text("#!/bin/sh\nkill -SEGV $$\n")
        (programs / "carillon-mesh").chmod(0o755)
        self.write("body.off", "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n")
        job = self.write("body.json", make_job(body={"surface": "body.off", "nodes": 300}))
        command = [programs / "carillon", "--store", self.store]
        subprocess.run([*command, "submit", job], check=True, stdout=subprocess.DEVNULL, env=self.environment)
        self.assertEqual(subprocess.run([*command, "run", "--quiet"], env=self.environment, timeout=180).returncode, 3)
        state = self.ask("status")["jobs"][0]
        self.assertEqual((state["state"], state["attempts"]), ("failed", 1))
        self.assertIn("Segmentation fault", state["reason"])
        self.assertIn("repair the surface", state["reason"])

    def test_characters_that_steer_a_terminal_do_not_reach_it(self):
        job = self.write("a\u009b31mb\u202ec.json", make_job(max_modes=1))
        done = self.run_it("submit", job, "--run")
        text = (
            done.stdout
            + done.stderr
            + self.run_it("status").stdout
            + self.run_it("log", job).stdout
            + self.run_it("get", job, "--json").stdout
        )
        self.assertFalse([letter for letter in "\u009b\u202e\x1b" if letter in text], repr(text))

    def test_wide_error_bars_are_a_warning(self):
        job = self.write("wide.json", make_job(band_hz=[20, 20000]))
        self.assertTrue([text for text in self.ask("submit", job, "--run")["jobs"][0]["warnings"] if "frequencies can be wrong by" in text])
        self.assertIn("frequencies can be wrong by", self.run_it("status").stdout)

    def test_warnings_reach_who_asks(self):
        job = self.write("silent.json", make_job(band_hz=[20, 21]))
        said = self.ask("submit", job, "--run")
        self.assertIn("silent", said["jobs"][0]["warnings"][0])
        self.assertIn("silent", self.ask("status", job)["jobs"][0]["warnings"][0])
        self.assertIn("silent", self.ask("get", job)["warnings"][0])
        self.assertIn("warning", self.run_it("get", job).stderr)
        self.assertIn("warning", self.run_it("status").stdout)
        self.assertIn("warning", self.run_it("submit", job, "--run").stderr + self.run_it("submit", job).stderr)

    def test_a_full_disk_can_be_read_and_cleaned(self):
        disk = self.folder / "disk"
        disk.mkdir()
        if (
            os.geteuid() != 0
            or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", disk], stderr=subprocess.DEVNULL).returncode != 0
        ):
            self.skipTest("no disk can be mounted here")
        self.addCleanup(subprocess.run, ["umount", disk])
        self.store = disk / "store"
        job, bank = self.make_done()
        other = self.write("other.json", make_job(max_modes=2))
        self.run_it("submit", other)
        self.run_queue()
        other.unlink()
        fill = os.open(disk / "fill", os.O_WRONLY | os.O_CREAT)
        try:
            while True:
                os.write(fill, bytes(4096))
        except OSError:
            os.close(fill)
        self.assertEqual(os.statvfs(disk).f_bavail, 0)
        for words in (("get", job), ("status",), ("log", job), ("explain", job), ("report", job, "--no-pictures"), ("verify",), ("gc",)):
            with self.subTest(words[0]):
                self.run_it(*words)
        self.assertIn("full", self.run_it("submit", self.write("third.json", make_job(max_modes=3)), code=4).stderr)
        self.assertEqual(pathlib.Path(self.run_it("get", job).stdout.strip()), bank)
        self.assertEqual([item["kind"] for item in self.ask("gc", "--delete")["items"]], ["bank"])
        self.assertGreater(os.statvfs(disk).f_bavail, 0)
        self.assertEqual(len(self.ask("status")["jobs"]), 1)


@unittest.skipIf(os.geteuid() != 0, "only root can be two users")
class Members(Bench):
    def test_a_member_of_the_group_continues_a_job(self):
        member = 65534
        self.folder.chmod(0o755)
        self.store.mkdir()
        os.chown(self.store, -1, member)
        self.store.chmod(0o2775)
        job = self.write("bar.json", make_job())
        self.run_it("submit", job)
        for path in [self.store, *self.store.rglob("*")]:
            info = path.lstat()
            self.assertEqual(info.st_gid, member, path)
            self.assertTrue(not path.is_dir() or info.st_mode & 0o2070 == 0o2070, path)
        try:
            subprocess.run(
                self.command("run", "--quiet"),
                check=True,
                env={**self.environment, "HOME": str(self.folder)},
                cwd="/",
                stdin=subprocess.DEVNULL,
                timeout=60,
                user=member,
                group=member,
                extra_groups=[],
                umask=0o002,
            )
        except PermissionError:
            self.skipTest("the member may not start the program")
        bank = pathlib.Path(self.run_it("get", job).stdout.strip())
        self.assertEqual(bank.stat().st_uid, member)
        self.assertEqual(self.ask("verify")["damaged"], [])


if __name__ == "__main__":
    unittest.main()
