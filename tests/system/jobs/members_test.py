#!/usr/bin/python3
"""Two users of one store: a member without privileges puts links where the store keeps its own, and root then works in it. Nothing of
root's may change.

usage: members_test.py BIN_DIR        does nothing but by root
"""
import contextlib
import errno
import json
import os
import pathlib
import shutil
import signal
import stat
import subprocess
import sys
import time
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import BIN, Bench, make_job, make_simulation

MEMBER = 65534  # user and group without privileges
AS_MEMBER = {"user": MEMBER, "group": MEMBER, "extra_groups": []}
SWAPS = 1000  # of each folder that is swapped while root works
PAUSE_S = 0.0005  # with the link in place, and with the folder
RETRIES_S = 300  # a job is tried again after 10, 40 and 160 s
DEAD = f"{os.uname().nodename},0-1:2,999999999,1,0123456789ab"  # as a folder in tmp/ of a process that is gone


def start_as_member(act):
    """Runs act() in a process of the member; its id."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setgroups([MEMBER])
            os.setgid(MEMBER)
            os.setuid(MEMBER)
            os.umask(0o002)
            act()
            code = 0
        except OSError as error:
            print(f"member: {error}", file=sys.stderr)
        finally:
            sys.stderr.flush()
            os._exit(code)
    return child


def swap_once(path, aside, target):
    """Sets a folder aside, puts a link in its place, and puts the folder back. Only the member makes links. Root may take any folder away
    or make it again between two steps, and the folder that is aside stays there then."""
    root_was_here = (errno.ENOENT, errno.EEXIST, errno.ENOTEMPTY, errno.EISDIR)

    def step(act, *arguments):
        try:
            act(*arguments)
            return True
        except OSError as error:
            if error.errno not in root_was_here:
                raise
            return False

    if not step(os.rename, path, aside):
        return
    if step(os.symlink, target, path):
        time.sleep(PAUSE_S)
        step(os.unlink, path)
    step(os.rename, aside, path)
    time.sleep(PAUSE_S)


def look(folder):
    """All that is below a folder: names, kinds, rights, owners, times and bytes."""
    found = {}
    for path in [folder, *sorted(folder.rglob("*"))]:
        info = path.lstat()
        content = path.read_bytes() if stat.S_ISREG(info.st_mode) else os.readlink(path) if stat.S_ISLNK(info.st_mode) else None
        found[str(path)] = (info.st_mode, info.st_uid, info.st_gid, info.st_nlink, info.st_mtime_ns, info.st_ino, content)
    return found


@unittest.skipIf(os.geteuid() != 0, "only root can be two users")
class Members(Bench):
    def setUp(self):
        super().setUp()
        self.folder.chmod(0o755)
        self.store.mkdir()
        os.chown(self.store, -1, MEMBER)
        self.store.chmod(0o2775)
        self.environment["OMPI_ALLOW_RUN_AS_ROOT"] = self.environment["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
        self.done = self.write("done.json", make_job())
        self.run_it("submit", self.done)
        self.run_it("run", "--quiet")
        self.open_job = self.write("open.json", make_job(max_modes=2))
        self.run_it("submit", self.open_job)
        (self.store / "tmp" / DEAD).mkdir()
        self.victim = self.folder / "root's own"
        self.victim.mkdir()

    def as_member(self, act):
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(start_as_member(act), 0)[1]), 0)

    def find(self, pattern):
        (path,) = self.store.glob(pattern)
        return path

    def work_as_root(self, name, place):
        """Every command; what it says has to name the place, or the command does what it is for."""
        before = look(self.victim)
        for words in (
            ("gc", "--delete"),
            ("status",),
            ("get", self.done),
            ("get", self.done, "--to", self.folder / "copy.hdf"),
            ("verify",),
            ("log", self.open_job),
            ("submit", self.open_job),
            ("run", "--quiet"),
            ("retry", self.open_job),
            ("verify", "--repair"),
            ("submit", self.done, self.open_job),
            ("gc", "--delete"),
            ("cancel", self.open_job),
        ):
            done = self.run_it(*words, code=None, timeout=60)
            self.assertEqual(look(self.victim), before, f"{name}: {words}: {done.stdout}{done.stderr}")
            self.assertIn(done.returncode, (0, 1, 2, 3, 4), f"{name}: {words}: {done.stdout}{done.stderr}")
            self.assertNotIn("internal", done.stderr)
            self.assertNotIn("SQL", done.stderr)
            if done.returncode in (2, 4):
                lines = [line for line in done.stderr.splitlines() if line.startswith("carillon: ")]
                self.assertTrue(lines, f"{name}: {words}: {done.stderr}")
                for line in lines:
                    self.assertIn(place, line, f"{name}: {words}")
                    self.assertIn("remove it", line, f"{name}: {words}")

    def swap(self, path, target):
        """The member puts a link in place of a path, and puts it back."""
        aside = path.with_name(path.name + ".aside")
        had = os.path.lexists(path)

        def put():
            if had:
                os.rename(path, aside)
            os.symlink(target, path)

        def put_back():
            if os.path.islink(path):
                os.unlink(path)
            if had and not os.path.lexists(path):
                os.rename(aside, path)
            elif had:
                subprocess.run(["chmod", "-R", "u+w", aside], check=False)
                shutil.rmtree(aside, ignore_errors=True)

        self.as_member(put)
        return put_back

    def test_what_one_makes_the_other_continues(self):
        for path in [self.store, *self.store.rglob("*")]:
            if DEAD not in path.name:
                info = path.lstat()
                self.assertEqual(info.st_gid, MEMBER, path)
                self.assertTrue(not path.is_dir() or "banks" in path.parts or info.st_mode & 0o2070 == 0o2070, path)
        work = self.find("work/*/*")
        command, environment = self.command("run", "--quiet"), {**self.environment, "HOME": str(self.folder)}

        def run():
            if os.access(command[0], os.X_OK):
                subprocess.run(command, check=True, env=environment, cwd="/", stdin=subprocess.DEVNULL, timeout=60)

        self.as_member(run)
        if work.exists():
            self.skipTest("the member may not start the program")
        bank = pathlib.Path(self.run_it("get", self.open_job).stdout.strip())
        self.assertEqual(bank.stat().st_uid, MEMBER)
        self.assertEqual(self.ask("verify")["damaged"], [])

    def test_folders_of_the_store(self):
        (self.victim / ".ssh").mkdir()
        (self.victim / ".ssh/id").write_text("important")
        (self.victim / DEAD).mkdir()
        (self.victim / DEAD / "thesis.tex").write_text("important")
        for folder in ("inputs", "work", "banks"):  # what lies there has the names that are looked for
            shutil.copytree(self.store / folder, self.victim, dirs_exist_ok=True)
        (self.victim / "ab").mkdir(exist_ok=True)
        (self.victim / "ab" / f"{'ab' * 32}.msh").write_text("important")
        work, bank = self.find("work/*/*"), self.find("banks/*/*")
        targets = {self.store / name: self.victim for name in ("tmp", "work", "inputs", "banks", "damaged", "slurm")}
        targets |= {work.parent: self.victim / work.parent.name, work: self.victim / work.parent.name / work.name}
        targets |= {bank.parent: self.victim / bank.parent.name}
        for path, target in targets.items():
            with self.subTest(str(path.relative_to(self.store))):
                put_back = self.swap(path, target)
                self.work_as_root(path.name, path.name)
                put_back()
                self.run_it("status")

    def test_files_of_a_job(self):
        for name in (
            "progress.jsonl",
            "log",
            "checkpoint",
            ".checkpoint.new",
            "bank.hdf",
            "bank.hdf.resolved.json",
            "lock",
            "reserve",
            "state.json",
            "attempt.json",
            "outcome.json",
        ):
            with self.subTest(name):
                (self.victim / "thesis.tex").write_text("important")
                before = look(self.victim)
                work = self.find("work/*/*")
                self.swap(work / name, self.victim / "thesis.tex")
                for words in (("status",), ("run", "--quiet"), ("verify",), ("gc", "--delete")):
                    self.run_it(*words)
                self.assertEqual(look(self.victim), before)
                self.assertEqual(self.ask("status", self.open_job)["jobs"][0]["state"], "done")
                shutil.rmtree(self.find(f"banks/*/{work.name}"))
                self.run_it("submit", self.open_job)

    def test_files_of_the_store(self):
        (self.victim / "thesis.tex").write_text("important")
        for name in (
            "registry.sqlite",
            "registry.sqlite-wal",
            "registry.sqlite-journal",
            "registry.sqlite-shm",
            "registry.lock",
            "lock",
            "VERSION",
            "submissions.jsonl",
        ):
            with self.subTest(name):
                put_back = self.swap(self.store / name, self.victim / "thesis.tex")
                before = look(self.victim)
                for words in (
                    ("status",),
                    ("get", self.done),
                    ("gc", "--delete"),
                    ("submit", self.open_job),
                    ("run", "--quiet"),
                    ("verify",),
                    ("retry", self.open_job),
                ):
                    self.refuse(*words, says=[name, "link", "remove it"])
                    self.assertEqual(look(self.victim), before)
                put_back()
                self.run_it("get", self.done)

    def test_a_folder_that_no_path_leads_to(self):
        """What root starts in a folder of the store writes there by names alone: a path to it may lead elsewhere by then. Here no path
        leads there for who may not search the folder above."""
        closed = self.folder / "closed"
        place = closed / "work"
        place.mkdir(parents=True)
        (place / "job.json").write_text(json.dumps(make_job(bank="bank.hdf")))
        outputs = {"sound": "sound.wav", "spectrogram": "sound.png", "surface": "sound.surface.hdf", "motion": "motion.vtkhdf"}
        (place / "simulation.json").write_text(json.dumps(make_simulation(**outputs, record="record.json")))
        os.chown(place, MEMBER, MEMBER)
        closed.chmod(0o700)
        records = ["--checkpoint", "checkpoint", "--progress", "progress.jsonl", "--result", "result.json"]
        for words, made in (
            (["carillon-precompute", "job.json", "--validate", "--json", "--result", "result.json"], ["result.json"]),
            (["carillon-precompute", "job.json", "--bank", "bank.hdf", *records], ["result.json", "bank.hdf", "bank.hdf.resolved.json"]),
            (["carillon-simulate", "simulation.json", "--validate", "--json", "--result", "result.json"], ["result.json"]),
            (["carillon-simulate", "simulation.json", *records], ["result.json", *outputs.values(), "record.json"]),
        ):
            with self.subTest(" ".join(words)):
                try:
                    done = subprocess.run(
                        [BIN / words[0], *words[1:]],
                        cwd=place,
                        env={**self.environment, "HOME": "/nonexistent"},
                        capture_output=True,
                        text=True,
                        **AS_MEMBER,
                    )
                except PermissionError:
                    self.skipTest("the member may not start the program")
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                for name in made:
                    self.assertTrue((place / name).exists(), name)
                (place / "result.json").unlink()

    def test_folders_that_are_swapped_again_and_again(self):
        (self.victim / "thesis.tex").write_text("important")
        (self.victim / DEAD).mkdir()
        (self.victim / DEAD / "thesis.tex").write_text("important")
        shutil.copytree(self.store / "work", self.victim, dirs_exist_ok=True)
        before = look(self.victim)
        paths = [self.store / "tmp", self.store / "work", self.find("work/*/*")]
        targets = [self.victim, self.victim, self.victim / paths[2].parent.name / paths[2].name]

        def swap_on():
            for number in range(SWAPS):
                for path, target in zip(paths, targets):
                    swap_once(path, path.with_name(f"{path.name}.{number}.aside"), target)

        child = start_as_member(swap_on)
        ends = []  # exit codes of the member: one at most
        self.addCleanup(lambda: ends or (os.kill(child, signal.SIGKILL), os.waitpid(child, 0)))  # before the folder goes
        rounds = 0
        while not ends or rounds < 3:
            rounds += 1
            if not ends and (waited := os.waitpid(child, os.WNOHANG))[0] != 0:
                ends.append(os.waitstatus_to_exitcode(waited[1]))
            with contextlib.suppress(FileNotFoundError, FileExistsError):  # tmp is aside, or a link to where there is one
                (self.store / "tmp" / DEAD).mkdir()
            for words in (("gc", "--delete"), ("submit", self.open_job), ("run", "--quiet")):
                done = self.run_it(*words, code=None, timeout=RETRIES_S)
                self.assertIn(done.returncode, (0, 1, 2, 3, 4), f"{words}: {done.stdout}{done.stderr}")
                self.assertNotIn("internal", done.stderr)
                self.assertEqual(look(self.victim), before, f"{words}: {done.stdout}{done.stderr}")
        print(f"{rounds} rounds of root's commands against {3 * SWAPS} swaps", file=sys.stderr)
        self.assertEqual(ends, [0], "the member stopped early")
        for path in paths:
            self.assertFalse(path.is_symlink(), path)
        for path in sorted(self.store.rglob("*.aside")):
            if path.exists():  # it goes with the one that it lies in
                shutil.rmtree(path)
        self.run_it("submit", self.open_job, code=None)
        self.run_it("retry", self.open_job, code=None)  # an attempt that met a link may have failed for good
        self.run_it("run", "--quiet")
        self.run_it("get", self.open_job)
        self.assertEqual(look(self.victim), before)


if __name__ == "__main__":
    unittest.main()
