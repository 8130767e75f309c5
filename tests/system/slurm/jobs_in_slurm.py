#!/usr/bin/python3
"""Jobs of `carillon submit --on slurm` in a real Slurm of one node, started by deploy/slurm/cluster.

usage: jobs_in_slurm.py BIN_DIR CLUSTER_DIR CASE        exits 77 (skipped) when there is no cluster in CLUSTER_DIR
"""
import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

import h5py

BIN, CLUSTER, CASE = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
SCRIPT = pathlib.Path(__file__).resolve().parents[3] / "deploy/slurm/cluster"
os.environ["SLURM_CONF"] = str(CLUSTER / "slurm.conf")
QUICK = 300  # nodes: a second of work
SLOW = {"nodes": 20000, "band_hz": [20, 400000]}  # ten seconds on two idle cores, with several checkpoints
PATIENCE_S = 300  # below CTest's limit, so that a wait without an end prints the job's log; no correct run comes near it


def check(holds, text):
    """`text`: the failure message, or a function for it."""
    if not holds:
        print(f"{CASE}: {text() if callable(text) else text}")
        print(subprocess.run(["squeue", "--states=all"], capture_output=True, text=True).stdout)
        sys.exit(1)


class Store:
    """A store in a folder whose name needs quotes."""

    def __init__(self):
        self.scratch = tempfile.TemporaryDirectory(prefix="carillon-slurm-")
        self.folder = pathlib.Path(self.scratch.name) / 'it\'s a $HOME "store"'
        self.folder.mkdir()
        (self.folder / "profile.json").write_text(
            json.dumps(
                {
                    "store": "store",
                    "on": "slurm",
                    "slurm": {"poll_s": 0.5, "signal_before_s": 60, "pictures": CASE == "submit", "pack": CASE != "array"},
                }
            )
        )

    def run(self, *words, code=0):
        done = subprocess.run(
            [BIN / "carillon", "--profile", self.folder / "profile.json", "--json", *words],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            cwd=self.folder,
        )
        check(code is None or done.returncode == code, f"carillon {words}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
        return json.loads(done.stdout)

    def run_lines(self, *words):
        """run() for a command that prints one object per line."""
        words = [BIN / "carillon", "--profile", self.folder / "profile.json", "--json", *words]
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, cwd=self.folder)
        check(done.returncode == 0, f"carillon {words}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")

    def write(self, name, nodes, number=0, **more):
        """Each number is a job of its own."""
        body = {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.004, "nodes": nodes}
        material = {"young_modulus_pa": 200e9 + number, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
        file = self.folder / name
        file.write_text(json.dumps({"body": body, "material": material, "bank": "out.hdf", **more}))
        return file

    def submit(self, *words):
        return self.run("submit", *words)["jobs"]

    def status(self, job):
        return next(row for row in self.run("status")["jobs"] if row["id"] == job["id"])

    def wait(self, job, state):
        deadline = time.monotonic() + PATIENCE_S
        while (row := self.status(job))["state"] != state:
            check(time.monotonic() < deadline, lambda: f"not {state} after {PATIENCE_S} s: {row}\n{self.log(job)}")
            check(row["state"] not in ("done", "failed", "cancelled"), lambda: f"ended as {row} instead of {state}\n{self.log(job)}")
            time.sleep(0.5)
        return row

    def wait_until(self, holds):
        deadline = time.monotonic() + PATIENCE_S
        while not holds(counts := self.run("status")["counts"]):
            check(time.monotonic() < deadline, lambda: f"not in {PATIENCE_S} s: {counts}")
            time.sleep(0.5)
        return counts

    def log(self, job):
        files = [*self.folder.glob(f"store/*/*/{job['id']}/log"), *self.folder.glob("store/slurm/*/*")]
        return "\n".join(f"{file}:\n{file.read_text(errors='replace')}" for file in files if file.is_file())

    def check_bank(self, job):
        done = subprocess.run([BIN / "carillon-bank", "check", self.status(job)["bank"]], capture_output=True, text=True)
        check(done.returncode == 0, f"the bank is not whole: {done.stdout}{done.stderr}")

    def work(self, job):
        return self.folder / "store/work" / job["id"][:2] / job["id"]

    def wait_for_solver(self, job, count):
        """Ranks of a running job after its first checkpoint."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            ranks = [
                int(pid)
                for pid in subprocess.run(["pgrep", "-f", "carillon-precompute job.json"], capture_output=True, text=True).stdout.split()
                if os.path.exists(f"/proc/{pid}/cwd")
                and os.readlink(f"/proc/{pid}/cwd") == str(self.work(job))
                and program(pid) == "carillon-precompute"
            ]
            progress = self.work(job) / "progress.jsonl"
            if len(ranks) == count and progress.exists() and progress.stat().st_size > 0:
                return ranks
            check(time.monotonic() < deadline, lambda: f"no {count} ranks at work but {ranks}: {self.status(job)}\n{self.log(job)}")
            time.sleep(0.2)


@contextlib.contextmanager
def paused(pids):
    """SIGSTOPs processes, so that the following actions happen during their run."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)


def program(pid):
    try:
        return os.path.basename(os.readlink(f"/proc/{pid}/exe"))
    except OSError:
        return ""


def cluster(verb, daemon):
    subprocess.run([SCRIPT, verb, CLUSTER, daemon], check=True)


def submit(store):
    """One job on two ranks with a hostile name; a second submission does not use Slurm."""
    job = store.submit(store.write("a;b'$(touch harmed).json", QUICK), "--ranks", "2")[0]
    check(job["slurm_job"], f"not with Slurm: {job}")
    name = subprocess.run(
        ["squeue", "--noheader", "--states=all", "--format=%j %k", f"--jobs={job['slurm_job']}"], capture_output=True, text=True
    ).stdout.split()
    check(name[:2] == [f"carillon-{job['id'][:12]}", job["id"]], f"Slurm calls it {name}")
    store.wait(job, "done")
    store.check_bank(job)
    check(not list(store.folder.rglob("harmed")), "a job's name was run as a command")
    again = store.submit(store.folder / "a;b'$(touch harmed).json")[0]
    check(again["state"] == "done" and not again["new"], f"solved is not solved: {again}")
    check(not list((store.folder / "store/slurm").iterdir()), "the batch has left its folder")


def simulate(store):
    """A simulation on two ranks gives the files of a run on one rank without Slurm."""
    bar = {
        "name": "bar",
        "shape": {"bar": {"length_m": 0.1, "width_m": 0.02, "thickness_m": 0.01, "nodes": 150}},
        "material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {}}},
        "velocity_m_s": [0, 0, -1],
    }
    floor = {"plane": {"point_m": [0, 0, -0.0051], "normal": [0, 0, 1]}}
    scene = {"duration_s": 0.002, "bodies": [bar], "obstacles": [floor], "microphones": [[0, 0, 0.1]]}
    job = {"simulate": scene, "sound": "bar.wav", "surface": "bar.surface.hdf"}
    file = store.folder / "bar.json"
    file.write_text(json.dumps(job))
    asked = store.submit(file, "--ranks", "2")[0]
    check(asked["slurm_job"], f"not with Slurm: {asked}")
    row = store.wait(asked, "done")
    check((row["ranks"], row["attempts"]) == (2, 1), f"not one attempt on two ranks: {row}")
    results = store.run("get", asked["id"])["results"]
    check(sorted(results) == ["record", "sound", "surface"], f"not the files of the job: {results}")
    check(json.loads(pathlib.Path(results["record"]).read_text())["ranks"] == 2, "its record is not of two ranks")
    alone = subprocess.run([BIN / "carillon-simulate", "--quiet", file], capture_output=True, text=True, cwd=store.folder)
    check(alone.returncode == 0, f"alone: {alone.stderr}")
    check(any((store.folder / "bar.wav").read_bytes()[-300:]), "the sound is silence")
    for key in ("sound", "surface"):
        made = pathlib.Path(results[key]).read_bytes()
        check(made == (store.folder / job[key]).read_bytes(), f"the {key} from Slurm has other bytes")
    again = store.submit(file)[0]
    check(again["state"] == "done" and not again["new"], f"simulated is not simulated: {again}")


def array(store):
    """Ten jobs in one array; an unsolvable one fails with its reason, without retries."""
    for number in range(9):
        store.write(f"jobs{number}.json", QUICK, number)
    bad = store.write("jobs9.json", QUICK, 9, fixed="no such set")
    jobs = store.submit(*sorted(store.folder.glob("jobs*.json")), "--ranks", "1", "--memory-gb", "0.5")
    arrays = {job["slurm_job"].split("_")[0] for job in jobs}
    check(
        len(jobs) == 10 and len(arrays) == 1 and {job["slurm_job"].split("_")[1] for job in jobs} == set(map(str, range(10))),
        f"no array of ten: {jobs}",
    )
    for job in jobs:
        if job["job_file"].endswith(bad.name):
            continue
        store.wait(job, "done")
        store.check_bank(job)
    row = [job for job in jobs if job["job_file"].endswith(bad.name)][0]
    row = store.wait(row, "failed")
    check("no such set" in row["reason"] and row["attempts"] == 1, f"not the true reason: {row}")


def read_modes(bank):
    """Bytes of frequencies, decays and shapes."""
    found = {}
    with h5py.File(bank) as file:
        file.visititems(
            lambda name, item: found.update({name: item[()].tobytes()})
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu"
            else None
        )
    return found


def library(store):
    """Forty bodies are one array of one task that packs them: each has one bank, with the modes of a direct run; a broken mesh fails alone,
    a cancelled job touches no other, and a task that is asked to save and stop continues with what is left."""
    for number in range(38):
        store.write(f"body{number:02}.json", 100 + 5 * number, number)
    mesh = store.folder / "broken.msh"
    mesh.write_text("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\nnonsense\n")
    (store.folder / "body38.json").write_text(json.dumps({"mesh": "broken.msh", "material": "steel"}))
    store.write("body39.json", 4000, 39)  # starts first
    jobs = store.submit(*sorted(store.folder.glob("body*.json")))
    check({job["slurm_job"].split(".")[0] for job in jobs} == {jobs[0]["slurm_job"].split(".")[0]}, f"not one task: {jobs}")
    check({int(job["slurm_job"].split(".")[1]) for job in jobs} == set(range(40)), f"not forty places: {jobs}")
    task = jobs[0]["slurm_job"].split(".")[0]
    by_name = {pathlib.Path(job["job_file"]).name: job for job in jobs}
    last = by_name["body01.json"]
    store.run("cancel", last["id"])
    check(store.status(last)["state"] == "cancelled", lambda: f"not cancelled: {store.status(last)}")
    store.wait_until(lambda counts: counts["done"] > 3)
    subprocess.run(["scancel", "--batch", "--signal=USR1", task], check=True)
    counts = store.wait_until(lambda counts: counts["queued"] + counts["running"] + counts["waiting"] == 0)
    check((counts["done"], counts["failed"], counts["cancelled"]) == (38, 1, 1), f"not 38 done, one failed, one cancelled: {counts}")
    shown = subprocess.run(["scontrol", "--oneliner", "show", "job", task], capture_output=True, text=True).stdout
    check("Restarts=1" in shown and "JobState=COMPLETED" in shown, f"the task was not queued again, or failed: {shown}")
    broken = store.status(by_name["body38.json"])
    check("broken.msh:5" in broken["reason"] and broken["attempts"] == 1, f"not the true reason: {broken}")
    banks = [row["bank"] for row in store.run("status")["jobs"] if row["state"] == "done"]
    check(len(set(banks)) == 38, "a bank is not there, or there twice")
    for name in ("body00.json", "body20.json", "body37.json"):
        alone = store.folder / "alone.hdf"
        done = subprocess.run(
            [BIN / "carillon-precompute", "-q", store.folder / name, "--bank", alone], capture_output=True, text=True, cwd=store.folder
        )
        check(done.returncode == 0, f"alone: {done.stderr}")
        mine, its = read_modes(alone), read_modes(store.status(by_name[name])["bank"])
        check(mine and mine == its, f"{name}: the bank of the array has other modes")


def killed_task(store):
    """kill -9 of a packed task: its attempts save and end, jobs that had not begun are not charged, and the next run finishes all; one of
    them takes two ranks in the task."""
    store.write("wide.json", 8000, 0, band_hz=[20, 200000], resources={"ranks": 2})
    for number in range(1, 6):
        store.write(f"small{number}.json", 100, number)
    jobs = store.submit(*sorted(store.folder.glob("[sw]*.json")))
    wide = next(job for job in jobs if job["job_file"].endswith("wide.json"))
    check(wide["slurm_job"].endswith("_0.0"), f"the widest does not start first: {wide}")
    store.wait_for_solver(wide, 2)
    runner = subprocess.run(["pgrep", "-f", "carillon task .*store"], capture_output=True, text=True).stdout.split()
    mine = [int(pid) for pid in runner if str(store.folder) in pathlib.Path(f"/proc/{pid}/cmdline").read_text()]
    check(len(mine) == 1, f"no runner: {runner}")
    os.kill(mine[0], signal.SIGKILL)
    deadline = time.monotonic() + PATIENCE_S
    while not (store.work(wide) / "outcome.json").exists():
        check(time.monotonic() < deadline, "its attempt does not end with it")
        time.sleep(0.2)
    store.run_lines("run", "--on", "slurm")
    rows = store.run("status")["jobs"]
    check(all(row["state"] == "done" and row["failures"] == 0 for row in rows), f"not all done: {rows}")
    check(all(row["attempts"] == 1 for row in rows if row["id"] != wide["id"]), f"a job that had not begun was charged: {rows}")
    store.check_bank(wide)


def cancel(store):
    """A running and a pending job are cancelled in Slurm; scancel is detected; retry submits again."""
    one, two = (
        store.submit(store.write("one.json", **SLOW), "--ranks", "2")[0],
        store.submit(store.write("two.json", number=1, **SLOW), "--ranks", "2")[0],
    )
    store.wait_for_solver(one, 2)
    for job in (two, one):
        store.run("cancel", job["id"])
        row = store.wait(job, "cancelled")
        check("cancelled" in row["reason"], f"no reason: {row}")
    alive = subprocess.run(["squeue", "--noheader", "--states=pending,running", "--format=%i"], capture_output=True, text=True).stdout
    check(alive == "", f"still in Slurm: {alive}")
    store.run("retry", two["id"])
    row = store.status(two)
    check(row["slurm_job"], f"not handed over again: {row}")
    subprocess.run(["scancel", row["slurm_job"]], check=True)
    check("scancel" in store.wait(two, "cancelled")["reason"], "who cancelled is not reported")


def time_limit(store):
    """Slurm's signal before the time limit: the job saves, is queued again by itself, continues, and its bank is that of a run in one
    piece."""
    job = store.submit(store.write("slow.json", **SLOW), "--ranks", "2", "--time-limit", "10m")[0]
    ranks = store.wait_for_solver(job, 2)
    deadline = time.monotonic() + PATIENCE_S
    while not (store.status(job)["modes_done"] or 0) > 0:
        check(time.monotonic() < deadline, lambda: f"nothing is found: {store.status(job)}\n{store.log(job)}")
        time.sleep(0.1)
    with paused(ranks):
        slurm_job = store.status(job)["slurm_job"]
        limit = subprocess.run(["scontrol", "--oneliner", "show", "job", slurm_job], capture_output=True, text=True).stdout
        check("TimeLimit=00:10:00" in limit, f"the limit is not Slurm's: {limit}")
        subprocess.run(["scancel", "--batch", "--signal=USR1", slurm_job], check=True)
    row = store.wait(job, "done")
    check(row["slurm_job"] is None or row["slurm_job"] == slurm_job, f"another job of Slurm did it: {row}")
    check(
        "Restarts=1" in subprocess.run(["scontrol", "--oneliner", "show", "job", slurm_job], capture_output=True, text=True).stdout,
        "it was not queued again",
    )
    for words in ("time limit", "queued again in Slurm", "resumes from"):
        check(words in store.log(job), lambda: f"the log does not say '{words}':\n{store.log(job)}")
    store.check_bank(job)


def killed_rank(store):
    """SIGKILL of one rank: the job is requeued with a back-off and completes."""
    job = store.submit(store.write("slow.json", **SLOW), "--ranks", "2")[0]
    os.kill(store.wait_for_solver(job, 2)[0], signal.SIGKILL)
    store.wait(job, "done")
    check(
        "queued again in Slurm" in store.log(job) and "killed" in store.log(job),
        lambda: f"the log does not say that a rank was killed:\n{store.log(job)}",
    )
    store.check_bank(job)


def wait_until_saved(number):
    """Waits until slurmctld has saved its jobs; killed earlier it forgets them and reuses their numbers."""
    saved = pathlib.Path(os.environ["SLURM_CONF"]).parent / "state/job_state"
    since = time.time()
    subprocess.run(["scontrol", "update", f"JobId={number}", "TimeLimit=300"], check=True)
    deadline = time.monotonic() + PATIENCE_S
    while not saved.exists() or saved.stat().st_mtime < since:
        check(time.monotonic() < deadline, "slurmctld does not write its state")
        time.sleep(0.2)


def killed_daemon(store):
    """kill -9 of the node's daemon and of the controller: the job continues, its state stays while there is no answer, and is right
    afterwards."""
    job = store.submit(store.write("slow.json", **SLOW), "--ranks", "2")[0]
    with paused(store.wait_for_solver(job, 2)):
        wait_until_saved(store.wait(job, "running")["slurm_job"])
        cluster("kill", "slurmd")
        cluster("kill", "slurmctld")
        check(store.status(job)["state"] == "running", lambda: f"a controller that does not answer changed the state: {store.status(job)}")
        waiting = store.submit(store.write("quick.json", QUICK, 1), "--ranks", "1")[0]
        check(waiting["state"] == "queued" and waiting["slurm_job"] is None, f"handed over to no Slurm: {waiting}")
        cluster("revive", "slurmctld")
        cluster("revive", "slurmd")
        deadline = time.monotonic() + PATIENCE_S
        while subprocess.run(["scontrol", "ping"], capture_output=True, text=True).stdout.find("UP") < 0 and time.monotonic() < deadline:
            time.sleep(0.2)
    store.submit(store.folder / "quick.json")
    for ended in (job, waiting):
        store.wait(ended, "done")
        store.check_bank(ended)


def lost_registry(store):
    """The registry is gone, and so is the number that Slurm gave: the job is found by its name, nothing is submitted twice, and --wait sees
    its end."""
    job = store.submit(store.write("slow.json", **SLOW), "--ranks", "2")[0]
    numbers = list((store.folder / "store/slurm").glob("*/number"))
    check([file.read_text().strip() for file in numbers] == [job["slurm_job"]], f"the number is not written: {numbers}")
    for file in [*numbers, *(store.folder / "store").glob("registry.sqlite*")]:
        file.unlink()
    row = store.status(job)
    check(row["slurm_job"] == job["slurm_job"], f"not found again: {row}")
    row = store.run("submit", store.folder / "slow.json", "--wait")["jobs"][0]
    check(row["state"] == "done", f"not done: {row}")
    store.check_bank(job)
    later = subprocess.run(["scontrol", "show", "job", str(int(job["slurm_job"]) + 1)], capture_output=True, text=True)
    check(later.returncode != 0, f"submitted twice: {later.stdout}")


def memory_limit(store):
    """More memory than requested: failed with a reason and a remedy, without retries."""
    job = store.submit(store.write("big.json", 80000), "--ranks", "1", "--memory-gb", "0.06")[0]
    row = store.wait(job, "failed")
    check("memory" in row["reason"] and "memory_gb" in row["reason"], f"not the true reason: {row['reason']}")
    check(row["attempts"] == 1, f"tried again: {row}")
    refused = store.run("submit", store.write("huge.json", QUICK), "--ranks", "1", "--memory-gb", "100000", code=3)["jobs"][0]
    check(refused["state"] == "failed" and "Slurm refuses" in refused["reason"], f"Slurm took it: {refused}")


def main():
    if not (CLUSTER / "control").exists():
        print(f"SKIP: no cluster runs in {CLUSTER}; slurm.cluster_starts says why")
        return 77
    store = Store()
    try:
        {
            "submit": submit,
            "simulate": simulate,
            "array": array,
            "library": library,
            "killed_task": killed_task,
            "cancel": cancel,
            "time_limit": time_limit,
            "killed_rank": killed_rank,
            "killed_daemon": killed_daemon,
            "lost_registry": lost_registry,
            "memory_limit": memory_limit,
        }[CASE](store)
    finally:
        subprocess.run(["scancel", "--quiet", f"--user={os.getuid()}"], timeout=PATIENCE_S)
    print(f"{CASE}: ok")
    return 0


if __name__ == "__main__":
    sys.exit(main())
