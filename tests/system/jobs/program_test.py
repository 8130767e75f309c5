#!/usr/bin/python3
"""carillon from submit to gc, and hostile input.

usage: program_test.py BIN_DIR
"""
import concurrent.futures
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
from bench import BIN, Bench, make_job, make_simulation
from surfaces import format_off, make_box


class Path(Bench):
    def test_from_submit_to_gc(self):
        job = self.write("a/bar.json", make_job())
        self.assertEqual(self.run_it("get", job, code=1).stdout, "")
        said = self.ask("submit", job)
        self.assertEqual([(entry["state"], entry["new"]) for entry in said["jobs"]], [("queued", True)])
        id_ = said["jobs"][0]["id"]
        # An equivalent job from another folder, with resources: the same id.
        other = {**make_job(), "resources": {"ranks": 1}, "bank": "elsewhere.hdf", "element": "T10"}
        again = self.ask("submit", self.write("b/c/other.json", "// the same\n" + json.dumps(dict(reversed(other.items())), indent=3)))
        self.assertEqual([(entry["id"], entry["new"]) for entry in again["jobs"]], [(id_, False)])
        self.run_it("run", "--quiet")
        self.assertEqual(self.ask("submit", job)["jobs"][0]["state"], "done")
        state = self.ask("status", id_[:8])["jobs"][0]
        self.assertEqual((state["state"], state["attempts"], state["percent"], state["phase"]), ("done", 1, 100.0, "done"))
        bank = pathlib.Path(self.run_it("get", job).stdout.strip())
        self.assertEqual(self.ask("get", "b/c/other.json")["bank"], str(bank))
        self.assertEqual(bank.stat().st_mode & 0o222, 0)
        self.assertEqual(bank.parent.stat().st_mode & 0o222, 0)
        subprocess.run([BIN / "carillon-bank", "check", bank], check=True, stdout=subprocess.DEVNULL)
        for name in ("job.json", "request.json", "outcome.json", "log", "report.html"):
            self.assertTrue((bank.parent / name).is_file(), name)
        self.run_it("get", job, "--to", self.folder / "copy.hdf")
        self.assertEqual((self.folder / "copy.hdf").read_bytes(), bank.read_bytes())
        self.assertIn("6 modes", self.run_it("log", id_).stdout)
        self.assertEqual(self.run_it("report", job, "--no-pictures").stdout.strip(), str(bank.parent / "report.html"))
        self.assertEqual(self.ask("gc")["items"], [])
        # Without both job files the bank is unreferenced.
        job.unlink()
        self.assertEqual(self.ask("gc")["items"], [])
        (self.folder / "b/c/other.json").unlink()
        items = self.ask("gc")["items"]
        self.assertEqual([(item["kind"], item["id"]) for item in items], [("bank", id_)])
        self.assertTrue(bank.exists())
        self.assertTrue(self.ask("gc", "--delete")["deleted"])
        self.assertFalse(bank.exists())
        self.assertEqual(self.ask("status")["jobs"], [])

    def test_gc_never_takes_what_is_queued(self):
        job = self.write("bar.json", make_job())
        self.ask("submit", job)
        job.unlink()
        self.assertEqual(self.ask("gc", "--delete")["items"], [])
        self.assertEqual(self.ask("status")["counts"]["queued"], 1)
        # Other names are kept.
        (self.store / "tmp" / "rubbish").mkdir()
        (self.store / "tmp" / f"{os.uname().nodename},0-1:2,999999999,1,0123456789ab").mkdir()
        (self.store / "inputs" / "thesis.tex").write_text("important")
        self.assertEqual([item["kind"] for item in self.ask("gc", "--delete")["items"]], ["temporary"])
        self.assertTrue((self.store / "tmp" / "rubbish").is_dir() and (self.store / "inputs" / "thesis.tex").is_file())

    def test_a_mesh_that_goes_after_the_submission_changes_nothing(self):
        mesh = self.make_bar_mesh()
        job = make_job(mesh="bar.msh")
        del job["body"]
        file = self.write("bar.json", job)
        self.ask("submit", file)
        mesh.unlink()
        self.run_it("run", "--quiet")
        self.assertEqual(self.ask("status")["jobs"][0]["state"], "done")

    def test_a_bad_mesh_fails_once_and_says_why_by_its_own_name(self):
        job = make_job(mesh="hole.msh")
        del job["body"]
        (self.folder / "hole.msh").write_text("$MeshFormat\nno mesh\n")
        file = self.write("bar.json", job)
        self.ask("submit", file)
        self.run_it("run", "--quiet", code=3)
        state = self.ask("status", file)["jobs"][0]
        self.assertEqual((state["state"], state["attempts"]), ("failed", 1))
        self.assertIn(str(self.folder / "hole.msh"), state["reason"])
        self.assertIn("failed", self.run_it("get", file, code=1).stderr)
        self.run_it("submit", file, code=3)

    def test_validate_needs_neither_a_bank_nor_a_solve(self):
        said = json.loads(self.run_it("validate", self.write("bar.json", make_job()), "--json").stdout)
        self.assertTrue(said)
        self.assertFalse(self.store.exists() and any(self.store.glob("banks/*/*")))
        self.run_it("validate", self.write("bad.json", make_job(band_hz=[5, 1])), code=2)

    def test_memory_that_is_no_number_is_refused(self):
        file = self.write("bar.json", make_job())
        for word in ("nan", "inf", "-1", "0", "1e400", "2x", ""):
            self.refuse("submit", file, f"--memory-gb={word}", says="--memory-gb")
        self.refuse("run", "--memory-gb=nan", says="--memory-gb")

    @unittest.skipUnless((BIN / "carillon-study").exists(), "a build without the component STUDIES")
    def test_study_speaks_json_too(self):
        for words in (["study", "scaling", "none.json", "--json"], ["--json", "study", "scaling", "none.json"]):
            done = subprocess.run([BIN / "carillon", *words], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            self.assertEqual((done.returncode, json.loads(done.stdout)["exit_code"]), (2, 2))

    @unittest.skipIf(os.geteuid() == 0 and not shutil.which("setpriv"), "root reads and writes all")
    def test_a_reader_gets_what_is_there_and_changes_nothing(self):
        done, failed, queued = (self.write(f"{n}.json", make_job(max_modes=n)) for n in (1, 2, 3))
        mesh = make_job(mesh="none.msh")
        (self.folder / "none.msh").write_text("$MeshFormat\nno mesh\n")
        del mesh["body"]
        self.write("2.json", mesh)
        self.run_it("submit", done, failed)
        self.run_it("run", "--quiet", code=3)
        self.run_it("submit", queued)
        wanted = {job["name"]: (job["id"], job["state"], job["reason"], job["bank"]) for job in self.ask("status")["jobs"]}
        self.assertEqual([state for _, state, *_ in wanted.values()], ["done", "failed", "queued"])
        for path, _, names in os.walk(self.store, topdown=False):
            for name in names:
                os.chmod(os.path.join(path, name), 0o444)
            os.chmod(path, 0o555)
        before = self.picture()
        # Without these capabilities file permissions apply to root.
        self.wrapper = (
            ["setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner", "--inh-caps=-dac_override,-dac_read_search,-fowner"]
            if os.geteuid() == 0
            else []
        )
        bank = wanted["1.json"][3]
        self.assertEqual(self.run_it("get", done).stdout.strip(), bank)
        self.run_it("get", done, "--to", self.folder / "copy.hdf")
        self.assertEqual((self.folder / "copy.hdf").read_bytes(), pathlib.Path(bank).read_bytes())
        self.assertIn("failed", self.run_it("get", failed, code=1).stderr)
        said = self.ask("status")
        self.assertTrue(said["read_only"])
        self.assertEqual({job["name"]: (job["id"], job["state"], job["reason"], job["bank"]) for job in said["jobs"]}, wanted)
        self.assertIn("read-only store", self.run_it("status").stderr)
        self.run_it("status", "--watch", done)
        self.assertFalse(self.ask("explain", failed)["would_run"])
        self.assertTrue(self.run_it("report", done, "--no-pictures").stdout.strip().endswith("report.html"))
        self.assertIn("modes", self.run_it("log", done).stdout)
        self.refuse("log", queued, says="no output yet", code=1)
        for words in (("submit", done), ("cancel", queued), ("retry", failed), ("run", "--quiet"), ("gc",)):
            self.refuse(*words, says="may not write to this store")
        self.assertEqual(self.picture(), before)

    def picture(self):
        """Every file of the store with its time."""
        return sorted(
            (os.path.join(path, name), os.lstat(os.path.join(path, name)).st_mtime_ns)
            for path, folders, names in os.walk(self.store)
            for name in folders + names
        )

    def test_an_unknown_command_is_named_with_the_nearest(self):
        self.refuse("statsu", says=['"statsu"', '"status"'])
        self.refuse("xyzzy", says=['"xyzzy"', "--help"])
        self.assertEqual(self.ask("sbmit", code=2)["exit_code"], 2)

    def test_the_exit_code_of_watching_shows_what_failed_before(self):
        self.run_it("status", "--watch")
        file = self.write("bar.json", make_job())
        self.ask("submit", file)
        self.ask("cancel", file)
        self.run_it("status", "--watch", code=3)

    def test_more_ranks_than_cores_run_on_the_cores_and_it_is_said(self):
        self.run_it("submit", self.write("bar.json", make_job()), "--ranks", "1000")
        events = [json.loads(line) for line in self.run_it("run", "--json", "--cores", "1").stdout.splitlines()]
        start = next(event for event in events if event["event"] == "start")
        self.assertEqual(start["ranks"], 1)
        self.assertIn("requested 1000 ranks, using 1", start["reason"])
        self.assertEqual([(job["state"], job["reason"]) for job in self.ask("status")["jobs"]], [("done", "")])

    def test_jobs_of_a_manifest_go_by_the_names_that_status_prints(self):
        lengths = (0.2, 0.21, 0.22)
        lines = [json.dumps(make_job(body={**make_job()["body"], "length_m": length})) for length in lengths]
        self.write("sweep.txt", "# three bars\n" + "\n".join(lines) + "\n" + "own/bar.json\n")
        self.write("own/bar.json", make_job(body={**make_job()["body"], "length_m": 0.23}))
        self.assertEqual(self.run_it("submit", "-q", "sweep.txt").stdout, "")
        said = self.run_it("run").stdout
        for name in ("sweep.txt#2", "sweep.txt#3", "sweep.txt#4", "bar.json"):
            self.assertIn(f" {name}: done\n", said)  # text, also without a terminal
        names = {job["name"]: job["id"] for job in self.ask("status")["jobs"]}
        bank = self.ask("get", "sweep.txt#3")
        self.assertEqual(bank["id"], names["sweep.txt#3"])
        self.assertEqual(self.ask("get", "sweep.txt")["jobs"][1]["bank"], bank["bank"])
        self.assertEqual([job["id"] for job in self.ask("status", "sweep.txt#3", "own")["jobs"]], [names["sweep.txt#3"], names["bar.json"]])
        printed = self.run_it("get", "sweep.txt", "--to", "copies").stdout.split()
        self.assertEqual(printed, [f"copies/{name}.hdf" for name in ("sweep-2", "sweep-3", "sweep-4", "bar")])
        self.assertEqual((self.folder / "copies/sweep-3.hdf").read_bytes(), pathlib.Path(bank["bank"]).read_bytes())
        self.assertIn("6 modes", self.run_it("log", "sweep.txt#2").stdout)
        self.assertEqual(self.run_it("log", "sweep.txt").stdout.count("== "), 4)
        self.assertEqual([job["state"] for job in self.ask("explain", "sweep.txt")["jobs"]], ["done"] * 4)
        self.run_it("cancel", "sweep.txt#4", code=1)
        self.run_it("retry", "sweep.txt", code=1)
        self.refuse("get", "sweep.txt#9", says="line 9")
        self.refuse("get", "sweep.txt#1", says="line 1")
        # A line that was never submitted does not hide the others.
        self.write("sweep.txt", (self.folder / "sweep.txt").read_text() + json.dumps(make_job(max_modes=2)) + "\n")
        got = self.run_it("get", "sweep.txt", code=1)
        self.assertEqual(len(got.stdout.split()), 4)
        self.assertIn("sweep.txt#6", got.stderr)
        self.assertEqual(len(self.ask("status", "sweep.txt")["jobs"]), 4)

    def test_warnings_of_many_jobs_are_few_lines(self):
        count = 12
        lines = [
            json.dumps(make_job(body={**make_job()["body"], "length_m": 0.2 + 0.01 * i}, element="T4", band_hz=[20, 20000]))
            for i in range(count)
        ]
        self.write("sweep.txt", "\n".join(lines))
        said = self.run_it("submit", "sweep.txt", "--run").stdout
        warnings = [line for line in self.ask("status")["jobs"] if line["warnings"]]
        self.assertGreater(len(warnings), count // 2)
        for text in (said, self.run_it("status").stdout, self.run_it("get", "sweep.txt").stderr):
            shown = [line for line in text.splitlines() if "warning" in line]
            self.assertLess(len(shown), 5, text)
            self.assertTrue(any(f"warning in {len(warnings)} jobs" in line for line in shown), text)

    def test_memory_gb_is_a_limit(self):
        large = make_job(body={**make_job()["body"], "nodes": 20000})
        self.ask("submit", self.write("large.json", {**large, "resources": {"ranks": 1, "memory_gb": 0.2}}))
        self.run_it("run", "--quiet", code=3)
        job = self.ask("status")["jobs"][0]
        self.assertEqual((job["state"], job["attempts"]), ("failed", 1))
        self.assertIn('"memory_gb" of the job is 0.2, and it needs at least', job["reason"])
        self.run_it("retry", "large.json", "--memory-gb", "3")
        self.run_it("run", "--quiet")

    @unittest.skipUnless((BIN / "carillon-simulate").exists(), "a build without the component SIMULATION")
    def test_the_queue_ends_a_simulation_above_its_memory(self):
        simulation = make_simulation(duration_s=1000.0, resources={"ranks": 1, "memory_gb": 0.01})
        self.ask("submit", self.write("long.json", simulation))
        self.run_it("run", "--quiet", code=3)
        job = self.ask("status", "long.json")["jobs"][0]
        self.assertEqual((job["state"], job["attempts"]), ("failed", 1))
        self.assertIn('"memory_gb" of the job is 0.01', job["reason"])

    def test_what_the_mesher_did_to_a_surface_is_said(self):
        points, faces = make_box(0.1, 0.06, 0.02)

        def write_job(name, **body):
            return self.write(
                f"{name}.json", make_job(body={"surface": f"{name}.off", "nodes": 1500, **body}, band_hz=[20, 20000], max_modes=2)
            )

        self.write("open.off", format_off(points, faces[:2] + faces[4:]))  # a box without its lid
        self.write("twice.off", format_off(points, [*faces, faces[3]]))
        opened, twice = write_job("open"), write_job("twice")
        self.refuse("validate", opened, says=["open surface", '"wall_m"', '"close_holes"'])
        self.ask("submit", opened, twice)
        self.run_it("run", "--quiet", code=3)
        states = {job["name"]: job for job in self.ask("status")["jobs"]}
        self.assertEqual(states["open.json"]["state"], "failed")
        self.assertIn("open surface", states["open.json"]["reason"])
        self.assertIn("1 of the 13 triangles", " ".join(states["twice.json"]["warnings"]))
        self.assertIn("1 of the 13 triangles", " ".join(self.ask("get", twice)["warnings"]))
        self.assertIn("1 of the 13 triangles", " ".join(self.ask("validate", twice)["warnings"]))
        # An explicit "close_holes" closes it, with a warning.
        closed = write_job("open", close_holes=1)
        self.ask("submit", closed)
        self.run_it("run", "--quiet")
        self.assertIn("hole was closed", " ".join(self.ask("get", closed)["warnings"]))

    def test_explain_and_submit_agree_on_a_job_that_failed_before_it_ran(self):
        file = self.write("bar.json", make_job())
        self.run_it("submit", file, "--memory-gb", "1000000")
        self.run_it("run", "--quiet", code=3)
        self.assertEqual(self.ask("status")["jobs"][0]["state"], "failed")
        said = self.ask("explain", file)
        self.assertTrue(said["would_run"])
        self.assertIn("it would run", said["why"])
        self.assertEqual(self.ask("submit", file)["jobs"][0]["state"], "queued")

    def test_cancel_and_retry(self):
        file = self.write("bar.json", make_job())
        self.ask("submit", file)
        self.assertTrue(self.ask("cancel", file)["jobs"][0]["did"])
        self.assertEqual(self.ask("status")["counts"]["cancelled"], 1)
        self.assertEqual(self.ask("retry", file)["jobs"][0]["state"], "queued")
        self.ask("cancel", file)
        self.assertEqual(self.ask("submit", file)["jobs"][0]["state"], "queued")
        done = self.run_it("submit", file, "--run")
        self.assertIn("queued", done.stdout)
        self.assertEqual(self.run_it("cancel", file, code=1).returncode, 1)

    def test_explain_names_what_changed(self):
        (self.folder / "m.msh").write_text("$MeshFormat\n1\n")
        job = make_job(mesh="m.msh")
        del job["body"]
        file = self.write("bar.json", job)
        self.assertEqual(self.ask("explain", file)["state"], "new")
        self.assertFalse((self.store / "work").exists() and any((self.store / "work").iterdir()))
        self.ask("submit", file)
        self.assertEqual(self.ask("explain", file)["changes"], [])
        self.write("bar.json", {**job, "material": {**job["material"], "density_kg_m3": 7900}, "max_modes": 3})
        self.assertEqual(
            [(c["part"], c["key"]) for c in self.ask("explain", file)["changes"]], [("job", "material.density_kg_m3"), ("job", "max_modes")]
        )
        self.write("bar.json", job)
        (self.folder / "m.msh").write_text("$MeshFormat\n2\n")
        said = self.ask("explain", file)
        self.assertEqual([c["part"] for c in said["changes"]], ["mesh"])
        self.assertTrue(said["would_run"])
        self.assertIn("m.msh", self.run_it("explain", file).stdout)

    def test_racing_submitters_make_one_job_and_racing_runners_one_solve(self):
        same = self.write("same.json", make_job())
        others = [self.write(f"other-{n}.json", make_job(max_modes=n + 1)) for n in range(4)]
        words = [[same]] * 5 + [[same, *others]] * 3
        processes = [
            subprocess.Popen(self.command("submit", *w), env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            for w in words
        ]
        for process in processes:
            out, err = process.communicate(timeout=120)
            self.assertEqual(process.returncode, 0, out + err)
        self.assertEqual(self.ask("status")["counts"]["queued"], 5)
        with concurrent.futures.ThreadPoolExecutor(3) as pool:
            list(pool.map(lambda _: self.run_it("run", "--quiet", timeout=300), range(3)))
        jobs = self.ask("status")["jobs"]
        self.assertEqual([(job["state"], job["attempts"]) for job in jobs], [("done", 1)] * 5)
        self.assertEqual(list((self.store / "tmp").iterdir()), [])


class Strangers(Bench):
    def test_names_are_only_names(self):
        names = [
            "; rm -rf ~ #.json",
            "two\nlines\x1b[2J.json",
            "$(touch pwned).json",
            "..json",
            "ü\u202eöβ.json",
            "x" * 250 + ".json",
            " .json",
            "-job.json",
            "a\\x41.json",
        ]
        files = [self.write(name, make_job(max_modes=n + 1)) for n, name in enumerate(names)]
        raw = os.path.join(os.fsencode(self.folder), b"\xff\xfe.json")
        with open(raw, "w") as stream:
            json.dump(make_job(max_modes=99), stream)
        self.run_it("submit", *files, os.fsdecode(raw))
        shown = self.run_it("status").stdout
        self.assertNotIn("\x1b", shown)
        self.assertEqual(len(shown.splitlines()), len(names) + 2)
        self.assertEqual(self.ask("status")["counts"]["queued"], len(names) + 1)
        self.assertFalse((self.folder / "pwned").exists())
        self.assertEqual(self.ask("status", files[1])["jobs"][0]["state"], "queued")
        self.refuse("submit", self.folder / ("y" * 4096 + ".json"), says="too long")
        self.refuse("status", "../../x", says="not a job of this store")
        self.refuse("log", "../" * 20 + "etc/passwd", says="passwd:1: ")
        self.refuse("get", "%", says="not an id")

    def test_what_is_no_file_is_one_clear_error_at_once(self):
        os.mkfifo(self.folder / "pipe.json")
        os.mkfifo(self.folder / "pipe.msh")
        os.symlink("loop.msh", self.folder / "loop.msh")
        os.symlink("loop.json", self.folder / "loop.json")
        self.refuse("submit", "pipe.json", says="regular file")
        self.refuse("submit", "loop.json", says="symbolic links")
        self.refuse("submit", "none.json", says="No such file")
        for mesh, words in (
            ("pipe.msh", "regular file"),
            ("loop.msh", "symbolic links"),
            ("/dev/zero", "device"),
            (".", "folder"),
            ("none.msh", "No such file"),
        ):
            job = make_job(mesh=mesh)
            del job["body"]
            self.refuse("submit", self.write("job.json", job), says=[words, mesh])
        with open(self.folder / "huge.json", "w") as stream:
            stream.truncate(1 << 30)
        self.refuse("submit", "huge.json", says="too many")
        self.assertEqual(self.ask("status")["jobs"], [])
        self.assertEqual(list((self.store / "tmp").iterdir()), [])

    def test_folders_and_manifests(self):
        (self.folder / "empty").mkdir()
        self.refuse("submit", "empty", says="no jobs in this folder")
        self.write("jobs/a.json", make_job(max_modes=1))
        self.write("jobs/b.json", make_job(max_modes=2))
        self.write("jobs/b.hdf.resolved.json", "{}")
        self.assertEqual(len(self.ask("submit", "jobs")["jobs"]), 2)
        lines = ["# a sweep", "", "jobs/a.json", json.dumps(make_job(max_modes=3)), "jobs/none.json", '{"mesh": 7}']
        self.write("sweep.txt", "\n".join(lines))
        self.refuse("submit", "sweep.txt", says=["sweep.txt:5", "sweep.txt:6", "nothing was submitted"])
        self.assertEqual(len(self.ask("status")["jobs"]), 2)
        said = self.ask("submit", "sweep.txt", "--keep-going", code=2)
        self.assertEqual((len(said["jobs"]), len(said["errors"])), (2, 2))
        self.assertEqual(len(self.ask("status")["jobs"]), 3)
        self.write("thousand.txt", "\n".join(json.dumps(make_job(max_modes=n)) for n in range(1, 1001)))
        self.assertEqual(len(self.ask("submit", "thousand.txt")["jobs"]), 1000)
        self.assertEqual(self.ask("status")["counts"]["queued"], 1000)
        self.refuse("submit", "/dev/null", says="regular file")

    def test_options_that_make_no_sense(self):
        file = self.write("bar.json", make_job())
        for words, says in (
            (["submit"], "JOB"),
            (["submit", file, "--time-limit", "soon"], "15m"),
            (["submit", file, "--ranks", "0"], "ranks"),
            (["fly"], "--help"),
            (["retry"], "--failed"),
            (["status", "abcd"], "not an id"),
        ):
            self.refuse(*words, says=says)
        self.assertEqual(self.ask("submit", "none.json", code=2)["errors"][0]["job_file"], str(self.folder / "none.json"))
        self.assertEqual(self.ask("status", "abcd", code=2)["exit_code"], 2)
        (self.folder / "letters").mkdir()
        (self.folder / "letters/dear.txt").write_text("dear")
        self.store = self.folder / "letters"
        self.refuse("status", says="not a Carillon store")

    @unittest.skipUnless(os.geteuid() == 0, "mounting needs root")
    def test_a_full_disk_is_a_clear_error_and_nothing_is_half_written(self):
        self.store.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=600k", "none", self.store], capture_output=True).returncode != 0:
            self.skipTest("no tmpfs may be mounted here")
        self.addCleanup(subprocess.run, ["umount", self.store], check=True)
        (self.folder / "m.msh").write_bytes(os.urandom(300_000))
        job = make_job(mesh="m.msh")
        del job["body"]
        self.ask("status")
        filler = self.store / "tmp" / "filler"
        filler.write_bytes(b"x" * 350_000)
        self.refuse("submit", self.write("bar.json", job), says=["No space left", "make room"], code=4)
        self.assertEqual([path.name for path in (self.store / "tmp").iterdir()], ["filler"])
        self.assertEqual(list((self.store / "inputs").rglob("*.msh")) + list((self.store / "work").rglob("*.json")), [])
        filler.unlink()
        self.assertEqual(self.ask("submit", "bar.json")["jobs"][0]["state"], "queued")


if __name__ == "__main__":
    unittest.main()
