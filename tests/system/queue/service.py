"""A store with real programs: jobs, `carillon run` and its processes."""
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
OPEN = ("queued", "waiting", "running")


def fail(text):
    print(text, flush=True)
    sys.exit(1)


def check(is_true, text):
    if not is_true:
        fail(text)


def read(path):
    try:
        return pathlib.Path(path).read_bytes()
    except OSError:
        return b""


def is_alive(pid):
    stat = read(f"/proc/{pid}/stat")
    return stat != b"" and stat.rsplit(b")", 1)[1].split()[0] not in (b"Z", b"X")


def read_words(pid, has_words):
    """The command line of a process. While a program restarts itself (the solver does once, to choose kernels) Linux shows none, for up to
    20 ms."""
    end = time.monotonic() + 0.5
    while True:
        words = read(f"/proc/{pid}/cmdline").split(b"\0")
        if words[0] or not has_words or time.monotonic() > end or not is_alive(pid):
            return words
        time.sleep(0.001)


class Service:
    def __init__(self, bin_dir):
        self.bin = pathlib.Path(bin_dir).resolve()
        self.scratch = tempfile.TemporaryDirectory(prefix="carillon-queue-")
        self.path = pathlib.Path(self.scratch.name)
        self.store = self.path / "store"
        self.runs = []

    def mesh(self, name, nodes):
        subprocess.run(
            [
                self.bin / "carillon-mesh",
                "--quiet",
                *f"--shape bar --length 0.2 --width 0.03 --thickness 0.02 --nodes {nodes}".split(),
                "-o",
                name,
            ],
            cwd=self.path,
            check=True,
            stdout=subprocess.DEVNULL,
        )

    def write_job(self, name, mesh, top_hz=20000, **more):
        """`top_hz` distinguishes jobs of one mesh."""
        (self.path / name).write_text(json.dumps({"mesh": mesh, "material": STEEL, "band_hz": [20, top_hz], **more}))
        return name

    def call(self, *arguments, codes=(0,)):
        done = subprocess.run(
            [self.bin / "carillon", "--store", self.store, *map(str, arguments)],
            cwd=self.path,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=200,
        )
        check(done.returncode in codes, f"carillon {arguments} gave {done.returncode}:\n{done.stdout}{done.stderr}")
        return done.stdout

    def submit(self, *names):
        return [job["id"] for job in json.loads(self.call("--json", "submit", *names))["jobs"]]

    def jobs(self):
        return {job["id"]: job for job in json.loads(self.call("--json", "status", "--all"))["jobs"]}

    def job(self, identity):
        return self.jobs()[identity]

    def run(self, *options, prefix=(), has_pictures=False):
        """Starts `carillon run`; its JSON lines go to a file. Pictures of a report take far longer than these jobs."""
        options = ("--pictures", *options) if has_pictures else options
        log = self.path / f"run-{len(self.runs)}.jsonl"
        with open(log, "w") as out:
            process = subprocess.Popen(
                [*prefix, self.bin / "carillon", "--store", self.store, "run", "--json", *options],
                cwd=self.path,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
            )
        process.log = log
        self.runs.append(process)
        return process

    def events(self):
        found = []
        for run in self.runs:
            for line in run.log.read_text().splitlines(keepends=True):
                if not line.endswith("\n"):  # incomplete
                    continue
                try:
                    found.append(json.loads(line))
                except ValueError:
                    fail(f"no JSON line: {line}")
        return found

    def wait_for(self, what, is_true, timeout_s=120):
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            value = is_true()
            if value:
                return value
            time.sleep(0.05)
        fail(
            f"{what}: not within {timeout_s} s\n{json.dumps(self.jobs(), indent=1)}\n" + "\n".join(run.log.read_text() for run in self.runs)
        )

    def wait_end(self, run, timeout_s=170):
        try:
            return run.wait(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            fail(f"carillon run does not end\n{json.dumps(self.jobs(), indent=1)}\n{run.log.read_text()}")

    def processes(self):
        """{kind: pids} of this store."""
        found = {"run": [], "attempt": [], "mpirun": [], "rank": []}
        folder = str(self.store).encode()
        for entry in os.listdir("/proc"):
            if not entry.isdigit() or not is_alive(entry):
                continue
            try:
                where = os.readlink(f"/proc/{entry}/cwd").encode()
            except OSError:
                continue
            words = read_words(entry, where.startswith(folder))
            name = words[0].rsplit(b"/", 1)[-1]
            if name == b"carillon" and folder in b" ".join(words):
                kind = "attempt" if b"attempt" in words else "run" if b"run" in words else None
            elif where.startswith(folder):
                kind = "mpirun" if name == b"mpirun" else "rank" if name == b"carillon-precompute" else None
            else:
                continue
            if kind:
                found[kind].append(int(entry))
        return found

    def hurry(self):
        """Skips the back-off."""
        waiting = [identity for identity, job in self.jobs().items() if job["state"] == "waiting"]
        if waiting:
            self.call("retry", *waiting, codes=(0, 1))
        return waiting

    def bank(self, identity):
        return self.store / "banks" / identity[:2] / identity / "bank.hdf"

    def check_bank(self, identity):
        done = subprocess.run([self.bin / "carillon-bank", "check", self.bank(identity)], capture_output=True, text=True)
        check(done.returncode == 0, f"the bank of {identity} is not sound:\n{done.stdout}{done.stderr}")

    def check_nothing_left(self):
        end = time.monotonic() + 10
        while any(self.processes().values()) and time.monotonic() < end:
            time.sleep(0.1)
        check(not any(self.processes().values()), f"processes are left: {self.processes()}")
        check(not list((self.store / "tmp").iterdir()) or self.call("gc", "--delete") is not None, "")
        left = [str(path) for path in (self.store / "tmp").iterdir()]
        check(not left, f"left in tmp after gc: {left}")

    def kill(self, pid, number=signal.SIGKILL):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass

    def stop_all(self):
        for run in self.runs:
            run.kill()
            run.wait()
        for pids in self.processes().values():
            for pid in pids:
                self.kill(pid)

    def close(self):
        self.stop_all()
        self.scratch.cleanup()


def choose_seed(words):
    seed = int(words[0]) if words else random.SystemRandom().randrange(1 << 30)
    print(f"seed {seed}", flush=True)
    return random.Random(seed)
