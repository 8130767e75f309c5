#!/usr/bin/python3
"""Makes the source archive of HEAD and its packages, by the commands of docs/howto/install.md; installs them into an empty root, and uses
them there: a bar is meshed, solved, struck and rendered, and its sound has the pitch of a beam with free ends.

The root has our packages and the files of the Debian packages that they depend on, copied from this machine, and no others. Where mount
namespaces are forbidden, the packages are made and checked, but not installed. Packages of a commit are made once.

usage: release.py SOURCE_DIR WORK_DIR
"""
import glob
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True
source, work = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
sys.path += [str(source / "tests/support"), str(source / "docs/examples")]
import installed_package
import measure
import namespaces
import version

BAR = {"length": 0.3, "width": 0.006, "thickness": 0.003}  # m
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.29, "density_kg_m3": 7850}
MAX_CENTS = 2  # rotation and shear lower the first mode by 0.6 cents
NAMESPACE = namespaces.find_mount_namespace()
SKIPPED = re.compile(r"/usr/(include|share/(doc|info|lintian|locale|man))/|.*[.]a$")  # no program reads them


def make_packages(commit, number):
    """{package: file}, made in the archive's own folder, which is removed."""
    folder = work / commit
    if not folder.exists():
        shutil.rmtree(work, ignore_errors=True)
        tree = work / f"carillon-{number}"
        tree.mkdir(parents=True)
        archive = subprocess.Popen(["git", "-C", source, "archive", commit], stdout=subprocess.PIPE)
        subprocess.run(["tar", "-x", "-C", tree], stdin=archive.stdout, check=True)
        assert archive.wait() == 0
        texts = version.read_texts(tree)
        assert not version.find_faults(texts) and version.find_versions(texts)[0] == number, version.find_faults(texts)
        page = (tree / "docs/howto/install.md").read_text()
        commands = re.search(r"^(cmake --preset .*?)^apt-get install", page, re.M | re.S)[1]
        print(commands, flush=True)
        environment = {**os.environ, "CMAKE_BUILD_PARALLEL_LEVEL": "2"}
        done = subprocess.run(["bash", "-euc", commands], cwd=tree, env=environment, text=True, stdout=subprocess.PIPE)
        assert done.returncode == 0, done.stdout[-3000:]
        folder.mkdir()
        for file in (tree / "build/packages").glob("*.deb"):
            file.rename(folder / file.name)
        shutil.rmtree(tree)
    return installed_package.find_packages(folder)


def read_installed():
    """{package: (names that it provides, alternatives of each dependency)} and the essential ones, of this machine."""
    form = "${Package}\t${db:Status-Status}\t${Essential}\t${Provides}\t${Pre-Depends}, ${Depends}\n"
    rows = [line.split("\t") for line in installed_package.read("dpkg-query", "-W", f"-f={form}").splitlines()]
    rows = [row for row in rows if row[1] == "installed"]
    return {row[0]: (split_names(row[3]), split_depends(row[4])) for row in rows}, [row[0] for row in rows if row[2] == "yes"]


def split_names(text):
    return [re.split(r"[ :(]", word.strip())[0] for word in text.split(",") if word.strip()]


def split_depends(text):
    return [split_names(group.replace("|", ",")) for group in text.split(",") if group.strip()]


def find_needed(packages):
    """The essential packages of Debian, and all that ours depend on."""
    (installed, waiting), needed = read_installed(), set()
    providers = {name: package for package, (names, _) in installed.items() for name in names}
    providers.update({package: package for package in installed})
    groups = [group for file in packages.values() for group in split_depends(installed_package.read("dpkg-deb", "-f", file, "Depends"))]
    while waiting or groups:
        waiting += [[providers[name] for name in group if name in providers][0] for group in groups if not packages.keys() & group]
        package = waiting.pop()
        groups = [] if package in needed else installed[package][1]
        needed.add(package)
    return sorted(needed)


def find_alternatives():
    """Links of update-alternatives, such as that of liblapack.so.3."""
    for file in glob.glob("/var/lib/dpkg/alternatives/*"):
        lines = pathlib.Path(file).read_text().splitlines()
        names = [pathlib.Path(file).name, *lines[2 : lines.index("") : 2]]
        for name, link in zip(names, lines[1 : lines.index("") : 2]):
            yield from (f"/etc/alternatives/{name}", link)


def make_root(root, packages):
    """A root of the needed packages of Debian, with dpkg's records of them, and ours, installed by dpkg."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    needed = find_needed(packages)
    names = {*installed_package.read("dpkg-query", "-L", *needed).splitlines(), *find_alternatives(), "/etc/passwd", "/etc/group"}
    names = {os.path.join(os.path.realpath(os.path.dirname(name)), os.path.basename(name)) for name in names}  # /bin is a link
    files = sorted(name for name in names if os.access(name, os.R_OK, follow_symlinks=False) and not SKIPPED.match(name))
    tar = ["tar", "-c", "--no-recursion", "-C", "/", "--null", "-T", "-"]
    copy = subprocess.Popen(tar, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    paste = subprocess.Popen(["tar", "-x", "-C", root], stdin=copy.stdout)
    copy.stdin.write("\0".join("." + name for name in files if name != "/.").encode())
    copy.stdin.close()
    assert copy.wait() == 0 and paste.wait() == 0
    for folder in ("info", "updates", "triggers"):
        (root / "var/lib/dpkg" / folder).mkdir(parents=True, exist_ok=True)
    (root / "var/lib/dpkg/status").write_text(installed_package.read("dpkg-query", "-s", *needed))
    install = ["dpkg", f"--root={root}", "--no-triggers", "--install", *packages.values()]
    done = subprocess.run([*NAMESPACE, *install], capture_output=True, text=True)
    assert done.returncode == 0, "\n".join(line for line in done.stderr.splitlines() if "files list file" not in line)
    enter(root, "ldconfig")
    print(f"root: {len(needed)} packages of Debian", flush=True)


def enter(root, *words):
    """Standard output of a command in the root."""
    inner = 'for f in dev proc sys; do mount --rbind /$f "$0/$f"; done; exec chroot "$0" env -C /tmp "$@"'
    done = subprocess.run(
        [*NAMESPACE, "sh", "-ec", inner, root, *words],
        capture_output=True,
        text=True,
        env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/tmp", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, (words, done.returncode, done.stdout, done.stderr)
    return done.stdout


def hear(root, below_hz):
    """Frequency of the strongest peak below a limit in the sound of the bar, struck at an end."""
    sizes = [word for key, value in BAR.items() for word in (f"--{key}", str(value))]
    enter(root, "carillon-mesh", "--shape", "bar", *sizes, "--nodes", "1500", "-q", "-o", "bar.msh")
    material = {**STEEL, "damping": {"internal_friction": {"tan_phi": 1e-3}}}
    job = {"mesh": "bar.msh", "material": material, "element": "T10", "max_modes": 12, "bank": "bar.hdf"}
    (root / "tmp/bar.json").write_text(json.dumps(job))
    enter(root, "carillon-precompute", "-q", "bar.json")
    enter(root, "carillon-bank", "check", "bar.hdf")
    strike = {"time_s": 0.1, "body": "bar", "point_m": [BAR["length"] / 2, 0, BAR["thickness"] / 2]}
    strike |= {"impulse_n_s": [0, 0, -0.01], "duration_s": 1e-3}
    scene = {"duration_s": 3, "bodies": [{"name": "bar", "bank": "bar.hdf", "fixed": True}], "strikes": [strike]}
    (root / "tmp/scene.json").write_text(json.dumps(scene))
    enter(root, "carillon-render", "-q", "scene.json", "-o", "bar.wav", "--spectrogram", "bar.png")
    rate, samples = measure.read_wav(root / "tmp/bar.wav")
    return measure.find_peaks(samples[rate // 5 :], rate, high_hz=below_hz, count=1)[0][0]


def use(root, commit, number):
    """The programs and the Python module in the root."""
    programs = sorted(path.name for path in (root / "usr/bin").glob("carillon*"))
    assert len(programs) >= 9, programs
    for name in programs:
        assert enter(root, name, "--version").strip() == f"{name} {number} ({commit})", name
    bending = math.sqrt(STEEL["young_modulus_pa"] / (12 * STEEL["density_kg_m3"])) * BAR["thickness"]
    exact = 4.730040744862704**2 / (2 * math.pi * BAR["length"] ** 2) * bending
    heard = hear(root, 1.9 * exact)  # the other direction has twice the frequency
    cents = 1200 * math.log2(heard / exact)
    print(f"first mode of the bar: {heard:.2f} Hz in the sound, {exact:.2f} Hz of a beam, {cents:+.2f} cents")
    assert abs(cents) < MAX_CENTS
    assert int(enter(root, "python3", "-c", "import carillon; print(len(carillon.Bank('bar.hdf')))")) == 12


def main():
    commit = version.read_git(source, "rev-parse", "HEAD").strip()
    number = version.find_versions(version.read_texts(source, commit))[0]
    tag = version.read_git(source, "describe", "--tags", "--exact-match", commit)
    print(f"version {number}, {tag.strip() if tag else 'no tag'}, {commit}", flush=True)
    packages = make_packages(commit, number)
    for name, file in packages.items():
        installed_package.check_package(name, file)
        assert installed_package.read("dpkg-deb", "-f", file, "Version").strip() == number, file
    if not NAMESPACE:
        print("SKIP: mount namespaces are forbidden here: the packages are not installed")
        sys.exit(77)
    root = work / "root"
    make_root(root, packages)
    use(root, commit, number)
    shutil.rmtree(root)


if __name__ == "__main__":
    main()
