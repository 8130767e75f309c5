#!/usr/bin/python3
"""Failures in the queue, with real processes and mpirun.

usage: queue_test.py BIN_DIR CASE
"""
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import h5py

from service import Service, check, is_alive, read

LONG_NODES = 2500  # a solve of some seconds on one rank


def kills(service):
    """SIGKILL of each kind of process of a job on two ranks: no loss, no leftovers, no second solve."""
    service.mesh("bar.msh", LONG_NODES)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000, resources={"ranks": 2}))
    run = service.run(has_pictures=True)
    for kind in ("rank", "mpirun", "attempt", "run"):
        service.wait_for(
            f"a {kind} to kill",  # on a busy machine the job may already be done
            lambda: (found := service.processes()) and len(found["rank"]) == 2 and found[kind] or service.job(identity)["state"] == "done",
        )
        time.sleep(0.3)
        victims = service.processes()
        if not victims[kind]:
            check(service.job(identity)["state"] == "done", f"no {kind} and not done")
            break
        service.kill(victims[kind][-1])
        if kind == "run":
            run.wait()
            check(service.job(identity)["state"] in ("running", "done"), "an attempt does not continue without its run")
            check(any(is_alive(pid) for pid in victims["attempt"]) or service.bank(identity).exists(), "the attempt died with its run")
            run = service.run(has_pictures=True)
        else:
            state = service.wait_for(
                "the end of the attempt to be seen", lambda: service.job(identity)["state"] != "running" and service.job(identity)
            )
            check(state["state"] == "waiting", f"after the kill of a {kind}: {state}")
            check("kill" in state["reason"], f"no true reason: {state['reason']}")
            for pids in (victims["rank"], victims["mpirun"], victims["attempt"]):
                service.wait_for("all of the attempt to end", lambda: not any(map(is_alive, pids)), 20)
            service.hurry()
    check(service.wait_end(run) == 0, "carillon run ends badly")
    check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
    service.check_bank(identity)
    service.check_nothing_left()
    # A second run has nothing to do.
    before = os.stat(service.bank(identity)).st_ino
    check(service.wait_end(service.run(), 20) == 0 and os.stat(service.bank(identity)).st_ino == before, "it was solved again")


def hopeless(service):
    """Permanent failures fail at once with a reason; other jobs run."""
    service.mesh("bar.msh", 300)
    (service.path / "bad.msh").write_bytes((service.path / "bar.msh").read_bytes()[:3000])
    good, bad, huge = service.submit(
        service.write_job("good.json", "bar.msh"),
        service.write_job("bad.json", "bad.msh"),
        service.write_job("huge.json", "bar.msh", 15000, resources={"memory_gb": 1e6}),
    )
    check(service.wait_end(service.run()) == 3, "carillon run ends badly")
    jobs = service.jobs()
    check(jobs[good]["state"] == "done", f"{jobs[good]}")
    check(jobs[bad]["state"] == "failed" and jobs[bad]["attempts"] == 1 and "cut short" in jobs[bad]["reason"], f"{jobs[bad]}")
    check(jobs[huge]["state"] == "failed" and jobs[huge]["attempts"] == 0 and "1000000.00 GB" in jobs[huge]["reason"], f"{jobs[huge]}")
    # A retry fails again.
    service.call("retry", bad)
    service.wait_end(service.run())
    check(service.job(bad)["attempts"] == 2 and service.job(bad)["state"] == "failed", f"{service.job(bad)}")
    service.check_nothing_left()


def cancel(service):
    """Cancelled while queued and while running; completed by a retry."""
    service.mesh("bar.msh", LONG_NODES)
    first, second = service.submit(
        service.write_job("first.json", "bar.msh", 30000, resources={"ranks": 2}), service.write_job("second.json", "bar.msh", 1000)
    )
    service.call("cancel", second)
    check(service.job(second)["state"] == "cancelled", f"{service.job(second)}")
    run = service.run()
    service.wait_for("a rank", lambda: service.processes()["rank"])
    service.call("cancel", first)
    check(service.job(first)["state"] == "cancelled", f"{service.job(first)}")
    check(service.wait_end(run) == 3, "carillon run ends badly")
    service.check_nothing_left()
    check(not service.bank(first).exists() and not service.bank(second).exists(), "a bank of a cancelled job")
    service.call("retry", first, second)
    check(service.wait_end(service.run()) == 0, "carillon run ends badly")
    for identity in (first, second):
        check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
        service.check_bank(identity)
    service.check_nothing_left()


def stop(service):
    """Ctrl-C: jobs are requeued without counting a failure and completed by the next run. A second Ctrl-C ends them at once."""
    service.mesh("bar.msh", LONG_NODES)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000))
    for rounds in (1, 2):
        run = service.run()
        service.wait_for("a rank", lambda: service.processes()["rank"])
        time.sleep(0.5)
        for _ in range(rounds):
            run.send_signal(signal.SIGINT)
            time.sleep(0.2)
        check(service.wait_end(run, 60) in (130, 0), f"exit code {run.returncode}")
        if run.returncode == 0:  # done before the signal
            break
        job = service.job(identity)
        check(job["state"] == "queued" and job["failures"] == 0, f"{job}")
        check(not any(service.processes().values()), f"left: {service.processes()}")
    check(service.wait_end(service.run()) == 0 and service.job(identity)["state"] == "done", f"{service.job(identity)}")
    service.check_bank(identity)
    service.check_nothing_left()


def time_limit(service):
    """A job at its time limit is saved with a reason; with more time it resumes and completes."""
    service.mesh("bar.msh", LONG_NODES)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000, resources={"time_limit_s": 1}))
    run = service.run()
    ends = service.wait_for(
        "the end of its time", lambda: [event for event in service.events() if "time limit" in (event.get("reason") or "")]
    )
    check(ends[0]["event"] in ("queued", "waiting"), f"{ends}")
    service.kill(run.pid, signal.SIGINT)
    service.wait_end(run)
    service.call("submit", "job.json", "--time-limit", "1h")
    service.hurry()
    check(service.wait_end(service.run()) == 0, "carillon run ends badly")
    check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
    service.check_bank(identity)
    service.check_nothing_left()


def two_runs(service):
    """Two runs on one store: every job runs once, never more ranks than cores."""
    service.mesh("bar.msh", 500)
    cores = len(os.sched_getaffinity(0))
    names = [service.write_job(f"{i}.json", "bar.msh", 20000 + i, **({"resources": {"ranks": 2}} if i % 3 == 0 else {})) for i in range(4)]
    identities = service.submit(*names)
    runs = [service.run(), service.run()]
    while any(run.poll() is None for run in runs):
        at_work = set(service.processes()["rank"])
        if len(at_work) > cores:  # One may have ended while the others were listed.
            at_work &= set(service.processes()["rank"])
        check(len(at_work) <= cores, f"{len(at_work)} ranks on {cores} cores")
    for run in runs:
        check(service.wait_end(run) == 0, "carillon run ends badly")
    starts = {}
    for event in service.events():
        if event.get("event") in ("start", "predict"):
            starts[event["id"]] = starts.get(event["id"], 0) + 1
    check(sorted(starts) == sorted(identities) and set(starts.values()) == {1}, f"starts: {starts}")
    for identity in identities:
        check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
        service.check_bank(identity)
    service.check_nothing_left()


def disk_full(service):
    """A disk that fills during jobs: no partial results, a clear reason, continuation with free space."""
    service.store.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", service.store], stderr=subprocess.DEVNULL).returncode != 0:
        print("no small disk can be mounted here: not tried")
        return
    try:
        service.mesh("bar.msh", LONG_NODES)
        (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000))
        run = service.run()
        service.wait_for("a rank", lambda: service.processes()["rank"])
        with open(service.store / "filling", "wb", buffering=0) as filling:
            try:
                while True:
                    filling.write(bytes(4096))
            except OSError:
                pass
        time.sleep(12)
        check(run.poll() is None, "carillon run ended on a full disk")
        check(not service.bank(identity).exists(), "a bank on a full disk")
        os.unlink(service.store / "filling")
        state = service.wait_for(
            "what happened to be written", lambda: service.job(identity)["state"] != "running" and service.job(identity), 60
        )
        check(state["state"] == "done" or "disk" in state["reason"] or "space" in state["reason"], f"{state}")
        print([{key: event.get(key) for key in ("event", "reason", "text")} for event in service.events() if event["event"] != "progress"])
        check(service.wait_end(run) == 0 and service.job(identity)["state"] == "done", f"{service.job(identity)}")
        service.check_bank(identity)
        service.check_nothing_left()
    finally:
        service.stop_all()
        subprocess.run(["umount", "--lazy", service.store])


def clock(service):
    """Runs with boot clocks that differ by a day: no loss, no endless wait."""
    other = ("unshare", "-T", "--boottime", "86400", "--monotonic", "86400")
    if subprocess.run([*other, "true"], stderr=subprocess.DEVNULL).returncode != 0:
        print("no time namespace here: not tried")
        return
    service.mesh("bar.msh", LONG_NODES)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000))
    for prefix in (other, ()):
        run = service.run(prefix=prefix)
        rank, *_ = service.wait_for("a rank", lambda: service.processes()["rank"])
        service.kill(rank)
        service.wait_for("a back-off", lambda: service.job(identity)["state"] == "waiting")
        service.kill(run.pid)
        run.wait()
    # The clock of the last run is a day behind the first.
    service.run(prefix=other)
    service.wait_for("the job to run", lambda: service.job(identity)["state"] == "done", 100)
    service.wait_end(service.runs[-1])
    service.check_bank(identity)
    service.check_nothing_left()


def hang(service):
    """A stopped rank is detected as hung and killed, and the job runs again."""
    service.mesh("bar.msh", LONG_NODES)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh", 30000))
    work = service.store / "work" / identity[:2] / identity
    with subprocess.Popen(
        [service.bin / "carillon", "attempt", work, "--ranks", "2", "--hang-s", "3"], stderr=subprocess.DEVNULL
    ) as attempt:
        service.wait_for("two ranks", lambda: len(service.processes()["rank"]) == 2)
        service.kill(service.processes()["rank"][0], signal.SIGSTOP)
        check(attempt.wait(timeout=60) == 85, f"exit code {attempt.returncode}")
    outcome = json.loads((work / "outcome.json").read_text())
    check(outcome["cause"] == "hung", f"{outcome}")
    check(not any(service.processes().values()), f"left: {service.processes()}")
    check(service.wait_end(service.run()) == 0 and service.job(identity)["state"] == "done", f"{service.job(identity)}")
    service.check_bank(identity)
    service.check_nothing_left()


def lost_claims(service):
    """Rows claimed by a process that died before the start, and stale lock files."""
    service.mesh("bar.msh", 300)
    identities = service.submit(*(service.write_job(f"{i}.json", "bar.msh", 20000 + i) for i in range(2)))
    for _ in range(12):
        run = service.run()
        time.sleep(0.03 * (len(service.runs) % 8))
        service.kill(run.pid)
        run.wait()
    check(service.wait_end(service.run()) == 0, "carillon run ends badly")
    for identity in identities:
        check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
        service.check_bank(identity)
    service.check_nothing_left()


def worker(service):
    """Jobs on one rank share a worker: the end of one process harms no other job, and banks are those of the program."""
    service.mesh("bar.msh", LONG_NODES)
    service.mesh("small.msh", 300)
    job = {"resources": {"ranks": 1}}
    small = service.submit(*(service.write_job(f"{hz}.json", "small.msh", hz, **job) for hz in (8000, 9000, 10000)))
    crashing, other = service.submit(*(service.write_job(f"{hz}.json", "bar.msh", hz, **job) for hz in (30000, 25000)))
    (last,) = service.submit(service.write_job("11000.json", "small.msh", 11000, **job))
    run = service.run("--cores", "2")

    def find_ranks():
        """{identity: rank} of the two long jobs, when both run."""
        where = {os.path.basename(os.readlink(f"/proc/{pid}/cwd")): pid for pid in service.processes()["rank"]}
        return {key: where[key] for key in (crashing, other) if key in where}

    ranks = service.wait_for("two ranks", lambda: len(found := find_ranks()) == 2 and found)
    (keeper,) = [pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if read_parent(pid, b"carillon-worker") == run.pid]
    programs = {os.readlink(f"/proc/{pid}/exe") for pid in (keeper, *ranks.values())}
    check(len(programs) == 1, f"ranks that are no forks of the worker: {programs}")
    service.kill(ranks[crashing], signal.SIGSEGV)
    service.wait_for("the crash to be seen", lambda: service.job(crashing)["state"] == "waiting")
    check("Segmentation fault" in service.job(crashing)["reason"], f"no true reason: {service.job(crashing)}")
    service.kill(keeper)
    service.hurry()
    check(service.wait_end(run) == 0, "carillon run ends badly")
    jobs = service.jobs()
    check(all(job["state"] == "done" for job in jobs.values()), f"{jobs}")
    check([jobs[key]["attempts"] for key in (crashing, other, *small, last)] == [2, 1, 1, 1, 1, 1], f"other jobs were harmed: {jobs}")
    for name, identity in (("25000.json", other), ("9000.json", small[1])):
        service.check_bank(identity)
        subprocess.run([service.bin / "carillon-precompute", "-q", name, "--bank", "alone.hdf"], cwd=service.path, check=True)
        check(read_bank(service.bank(identity)) == read_bank(service.path / "alone.hdf"), f"{name}: another bank than that of the program")
    service.check_nothing_left()


def read_parent(pid, name):
    """The parent of a process with this name."""
    stat = read(f"/proc/{pid}/stat")
    return int(stat.rsplit(b")", 1)[1].split()[1]) if b"(" + name + b")" in stat else None


def read_bank(file):
    """Bytes of all numbers."""
    found = {}

    def take(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
            found[name] = item[()].tobytes()

    with h5py.File(file) as bank:
        bank.visititems(take)
    check(len(found) > 5, f"{file}: {list(found)}")
    return found


def killed_before_publication(service):
    """An attempt killed between solve and publication: the next attempt publishes its bank; the job has a log."""
    service.mesh("bar.msh", 300)
    (identity,) = service.submit(service.write_job("job.json", "bar.msh"))
    check(service.wait_end(service.run()) == 0, "carillon run ends badly")
    solved = service.path / "bank.hdf"
    shutil.copy(service.bank(identity), solved)
    service.store = service.path / "another store"
    check(service.submit("job.json") == [identity], "another id")
    shutil.copy(solved, service.store / "work" / identity[:2] / identity / "bank.hdf")
    check(service.wait_end(service.run()) == 0, "carillon run ends badly")
    check(service.job(identity)["state"] == "done", f"{service.job(identity)}")
    check("computed by an attempt that ended before publication" in service.call("log", identity), "no log")
    check(service.bank(identity).read_bytes() == solved.read_bytes(), "it was solved again")
    service.check_nothing_left()


cases = {
    function.__name__: function
    for function in (
        worker,
        killed_before_publication,
        kills,
        hopeless,
        cancel,
        stop,
        time_limit,
        two_runs,
        disk_full,
        clock,
        hang,
        lost_claims,
    )
}
service = Service(sys.argv[1])
try:
    cases[sys.argv[2]](service)
finally:
    service.close()
print(f"{sys.argv[2]}: as it should be")
