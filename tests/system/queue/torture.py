#!/usr/bin/python3
"""Random kills of random processes over a mixed queue. In the end every job is done or failed with a true reason, every bank is whole, none
was solved again after it was finished, and nothing is left running or lying about.

usage: torture.py BIN_DIR KILLS [SEED]
"""
import json
import os
import sys
import time

from service import OPEN, Service, check, choose_seed

KINDS = ("run", "attempt", "mpirun", "rank")
PICTURED = 0.25  # fraction of runs with pictures


def fill(service, count):
    """Small jobs, jobs on two ranks, a bad mesh, an impossible memory request."""
    service.mesh("small.msh", 400)
    service.mesh("large.msh", 2500)
    (service.path / "bad.msh").write_bytes((service.path / "small.msh").read_bytes()[:3000])
    names = [service.write_job("bad.json", "bad.msh"), service.write_job("huge.json", "small.msh", 15000, resources={"memory_gb": 1e6})]
    for i in range(count):
        large = i % 3 == 1
        more = {"resources": {"ranks": 2}} if i % 3 == 2 else {}
        names.append(service.write_job(f"good-{i}.json", "large.msh" if large else "small.msh", 20000 + 10 * i, **more))
    return service.submit(*names)


def main():
    kills = int(sys.argv[2])
    random = choose_seed(sys.argv[3:])
    service = Service(sys.argv[1])
    try:
        bad, huge, *good = fill(service, 4)
        finished = {}  # id -> inode of the bank
        done_kills = {kind: 0 for kind in KINDS}
        batches = 1
        run = service.run(has_pictures=random.random() < PICTURED)
        end = time.monotonic() + 60 + 12 * kills
        while time.monotonic() < end:
            for identity in good:
                bank = service.bank(identity)
                if bank.exists():
                    inode = os.stat(bank).st_ino
                    check(finished.setdefault(identity, inode) == inode, f"{identity} was published twice")
            if sum(done_kills.values()) < kills:
                time.sleep(random.uniform(0.0, 1.5))
                processes = service.processes()
                present = [kind for kind in KINDS if processes[kind]]
                if present:
                    kind = random.choice(present)
                    service.kill(random.choice(processes[kind]))
                    done_kills[kind] += 1
                if len(finished) == len(good):
                    # More work for the remaining kills.
                    more = [
                        service.write_job(
                            f"more-{batches}-{i}.json",
                            "large.msh" if i == 1 else "small.msh",
                            21000 + 100 * batches + 10 * i,
                            **({"resources": {"ranks": 2}} if i == 2 else {}),
                        )
                        for i in range(3)
                    ]
                    good += service.submit(*more)
                    batches += 1
            elif not any(job["state"] in OPEN for job in service.jobs().values()):
                break
            service.hurry()
            if run.poll() is not None:
                if run.returncode == 0 and sum(done_kills.values()) >= kills:
                    continue
                run = service.run(has_pictures=random.random() < PICTURED)
            elif sum(done_kills.values()) >= kills:
                time.sleep(0.5)
        check(run.wait(timeout=60) is not None, "carillon run does not end")
        jobs = service.jobs()
        print(f"kills: {done_kills}; jobs: {len(jobs)}; attempts: {sum(job['attempts'] for job in jobs.values())}")
        check(sum(done_kills.values()) >= kills, "not all kills found a process to kill")
        for identity in good:
            check(jobs[identity]["state"] == "done", f"{json.dumps(jobs[identity])}\n{service.call('log', identity)[-3000:]}")
            service.check_bank(identity)
            check(
                finished.setdefault(identity, os.stat(service.bank(identity)).st_ino) == os.stat(service.bank(identity)).st_ino,
                f"{identity} was published twice",
            )
        check(jobs[bad]["state"] == "failed" and "cut short" in jobs[bad]["reason"], f"{jobs[bad]}")
        check(jobs[huge]["state"] == "failed" and "GB" in jobs[huge]["reason"], f"{jobs[huge]}")
        starts = {}
        for event in service.events():
            if event.get("event") == "done":
                starts[event["id"]] = "done"
            check(
                not (event.get("event") == "start" and starts.get(event["id"]) == "done"),
                f"{event['id'] if 'id' in event else ''} was started after it was done",
            )
        service.check_nothing_left()
    finally:
        service.close()
    print("as it should be")


main()
