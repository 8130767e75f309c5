#!/usr/bin/python3
"""One job across two hosts: network namespaces that a bridge joins. One host is cut off in the middle: the job says so, waits, and is done
later.

usage: two_hosts.py BIN_DIR        exits 77 (skipped) where no network namespaces can be made
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

BIN = pathlib.Path(sys.argv[1]).resolve()
PATIENCE_S = 300  # below CTest's limit, so that a wait without an end prints the log; no correct run comes near it
NAME = f"car{os.getpid() % 100000}"
HOSTS = {"n1": "10.77.0.1", "n2": "10.77.0.2"}
# As ssh would: the command runs on the host, with its name and its network. HOSTS_FILE and NAME are filled in.
AGENT = """#!/bin/sh
host=$1; shift
exec nsenter --net=/run/netns/@NAME@$host unshare --uts --mount \\
  sh -c 'hostname "$0"; mount --bind "@FILE@" /etc/hosts; exec sh -c "$1"' "$host" "$*"
"""


def ip(*words):
    return subprocess.run(["ip", *words], capture_output=True, text=True)


def check(holds, text):
    if not holds:
        print(f"two_hosts: {text}")
        sys.exit(1)


class Network:
    def __enter__(self):
        for namespace in ("br", *HOSTS):
            made = ip("netns", "add", NAME + namespace)
            if made.returncode != 0:
                print(f"SKIP: no network namespaces here: {made.stderr.strip()}")
                self.__exit__()
                sys.exit(77)
            self.do("-n", NAME + namespace, "link", "set", "lo", "up")
        self.do("-n", NAME + "br", "link", "add", "bridge", "type", "bridge")
        self.do("-n", NAME + "br", "link", "set", "bridge", "up")
        for host, address in HOSTS.items():
            self.do("-n", NAME + host, "link", "add", "net", "type", "veth", "peer", "name", host, "netns", NAME + "br")
            self.do("-n", NAME + "br", "link", "set", host, "master", "bridge", "up")
            self.do("-n", NAME + host, "addr", "add", f"{address}/24", "dev", "net")
            self.do("-n", NAME + host, "link", "set", "net", "up")
        return self

    @staticmethod
    def do(*words):
        done = ip(*words)
        check(done.returncode == 0, f"ip {' '.join(words)}: {done.stderr}")

    def set_cable(self, host, state):
        self.do("-n", NAME + "br", "link", "set", host, state)

    def count_bytes(self, host):
        return json.loads(ip("-n", NAME + host, "-json", "-statistics", "link", "show", "net").stdout)[0]["stats64"]["rx"]["bytes"]

    def __exit__(self, *_):
        for namespace in ("br", *HOSTS):
            ip("netns", "del", NAME + namespace)


class Site:
    def __init__(self, folder):
        self.folder = folder
        (folder / "hosts").write_text("127.0.0.1 localhost\n" + "".join(f"{address} {host}\n" for host, address in HOSTS.items()))
        self.agent = folder / "agent"
        self.agent.write_text(AGENT.replace("@NAME@", NAME).replace("@FILE@", str(folder / "hosts")))
        self.agent.chmod(0o755)
        network = "10.77.0.0/24"
        options = [
            "--host",
            "n1:1,n2:1",
            "--mca",
            "plm_rsh_agent",
            str(self.agent),
            "--mca",
            "btl",
            "self,tcp",
            "--mca",
            "btl_tcp_if_include",
            network,
            "--mca",
            "oob_tcp_if_include",
            network,
        ]
        (folder / "profile.json").write_text(json.dumps({"store": "store", "mpirun_options": options}))
        body = {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.004, "nodes": 20000}
        material = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {}}}
        (folder / "job.json").write_text(json.dumps({"body": body, "material": material}))

    def command(self, *words):
        quoted = " ".join(
            "'" + str(word).replace("'", "'\\''") + "'"
            for word in (BIN / "carillon", "--profile", self.folder / "profile.json", "--json", *words)
        )
        return [self.agent, "n1", f"cd '{self.folder}' && exec {quoted}"]

    def run(self, *words):
        done = subprocess.run(self.command(*words), capture_output=True, text=True, timeout=PATIENCE_S)
        check(done.returncode == 0, f"carillon {words}: {done.stdout}{done.stderr}")
        return json.loads(done.stdout)

    def status(self):
        return self.run("status")["jobs"][0]

    def log(self):
        return "\n".join(file.read_text(errors="replace") for file in self.folder.glob("store/*/*/*/log"))

    def find_ranks(self):
        """The network namespace of each rank of this job."""
        found = {}
        for entry in pathlib.Path("/proc").iterdir():
            try:
                if (
                    entry.name.isdigit()
                    and (entry / "comm").read_text().startswith("carillon-precom")
                    and os.readlink(entry / "cwd").startswith(str(self.folder))
                ):
                    found[entry.name] = os.readlink(entry / "ns/net")
            except OSError:
                continue
        return found

    def wait(self, runner, what, holds):
        deadline = time.monotonic() + PATIENCE_S
        while not holds():
            check(time.monotonic() < deadline, f"{what}: not after {PATIENCE_S} s; {self.status()}\n{self.log()}")
            check(runner.poll() is None or what == "done", f"{what}: the run has ended; {self.status()}\n{self.log()}")
            time.sleep(0.3)


def main():
    if os.geteuid() != 0 or ip("-V").returncode != 0:
        print("SKIP: network namespaces need root and iproute2")
        return 77
    with Network() as network, tempfile.TemporaryDirectory(prefix="carillon-hosts-") as name:
        site = Site(pathlib.Path(name))
        site.run("submit", "job.json", "--ranks", "2")
        before = network.count_bytes("n2")
        runner = subprocess.Popen(site.command("run"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            site.wait(runner, "one rank on each host", lambda: len(site.find_ranks()) == 2 and len(set(site.find_ranks().values())) == 2)
            site.wait(runner, "ranks that talk over the network", lambda: network.count_bytes("n2") - before > 1_000_000)
            network.set_cable("n2", "down")
            start = time.monotonic()
            site.wait(runner, "lost", lambda: site.status()["state"] == "waiting")
            row = site.status()
            print(f"noticed after {time.monotonic() - start:.0f} s: {row['reason']}")
            check("lost" in row["reason"] and row["failures"] == 1, f"not the true reason: {row}")
            check(not site.find_ranks(), f"ranks are left: {site.find_ranks()}")
            network.set_cable("n2", "up")
            site.wait(runner, "done", lambda: site.status()["state"] == "done")
            row = site.status()
            check(row["attempts"] == 2, f"not by the second attempt: {row}")
            done = subprocess.run([BIN / "carillon-bank", "check", row["bank"]], capture_output=True, text=True)
            check(done.returncode == 0, f"the bank is not whole: {done.stdout}{done.stderr}")
            check(runner.wait(PATIENCE_S) == 0, "the run did not end well")
        finally:
            runner.terminate()
            runner.wait()
    print("two_hosts: ok")
    return 0


if __name__ == "__main__":
    sys.exit(main())
