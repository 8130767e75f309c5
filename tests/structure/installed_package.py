#!/usr/bin/python3
"""Makes the Debian packages of a build, unpacks them into an empty root, and builds docs/examples/embed against that root
alone: by find_package(Carillon), and the C examples by pkg-config. All programs play the same pinned bank.

usage: installed_package.py SOURCE_DIR BUILD_DIR WORK_DIR
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys

# Contents of each package, required and forbidden dependencies.
RUNTIME = {
    "files": [
        "bin/carillon-render",
        "bin/carillon-live",
        "bin/carillon-bank",
        "bin/carillon-samples",
        "lib/libcarillon.so.3",
        "lib/carillon/carillon-joints.so",
    ],
    "needs": "libhdf5-",
    "free_of": "mpi|petsc|slepc|metis|mumps|libcgal|libgmp",
}
DEV = {
    "files": [
        "include/carillon.h",
        "include/carillon/bullet.h",
        "include/carillon/mujoco.h",
        "include/carillon/simbody.h",
        "lib/libcarillon.so",
        "lib/pkgconfig/carillon.pc",
        "lib/cmake/carillon/carillon-config.cmake",
    ],
    "needs": "carillon-runtime",
    "free_of": "mpi|petsc",
}
PRECOMPUTE = {
    "files": [f"bin/carillon{name}" for name in ("", "-precompute", "-mesh", "-draw", "-study", "-tune")],
    "needs": "libpetsc-real",
    "free_of": "nothing",
}
PYTHON = {
    "files": ["lib/python3/dist-packages/carillon/__init__.py", "lib/python3/dist-packages/carillon/_carillon.pyi"],
    "needs": "python3-numpy",
    "free_of": "mpi|petsc|slepc|metis|mumps|libcgal|libgmp",
}
PACKAGES = {"python3-carillon": PYTHON, "carillon-runtime": RUNTIME, "carillon-runtime-dev": DEV, "carillon-precompute": PRECOMPUTE}

quiet = {"stdout": subprocess.DEVNULL}


def run(*command, **options):
    return subprocess.run([str(word) for word in command], check=True, text=True, **options)


def read(*command, **options):
    return run(*command, capture_output=True, **options).stdout


def find_packages(folder):
    return {read("dpkg-deb", "-f", file, "Package").strip(): file for file in folder.glob("*.deb")}


def make_packages(build, work):
    """{package: file}, one package per component of the build."""
    run("cpack", "--config", build / "CPackConfig.cmake", "-G", "DEB", "-B", work / "packages", cwd=work, **quiet)
    files = find_packages(work / "packages")
    wanted = set(PACKAGES)
    if not (build / "bin/carillon-precompute").exists():
        wanted.discard("carillon-precompute")
    if not (build / "python").exists():
        wanted.discard("python3-carillon")
    assert set(files) == wanted, files
    return files


def check_package(name, file):
    """Checks files and dependencies, which are installed packages or our own."""
    fields = PACKAGES[name]
    paths = [line.split()[5] for line in read("dpkg-deb", "-c", file).splitlines()]
    missing = [path for path in fields["files"] if f"./usr/{path}" not in paths]
    assert not missing, f"{name}: {missing} is not in it"
    depends = [re.split(r"[ :]", word.strip())[0] for word in read("dpkg-deb", "-f", file, "Depends").split(",")]
    assert any(word.startswith(fields["needs"]) for word in depends), (name, depends)
    assert not [word for word in depends if re.search(fields["free_of"], word)], (name, depends)
    for word in depends:
        if word not in PACKAGES:
            state = subprocess.run(["dpkg-query", "-W", "-f=${db:Status-Status}", word], capture_output=True, text=True).stdout
            assert state == "installed", f"{name} depends on {word}, which is not installed here"
    print(f"{name}: {file.stat().st_size / 1e6:.1f} MB, {len(depends)} dependencies")
    return [path for path in paths if not path.endswith("/")]


def check_symbols(library):
    """Only the C interface is visible."""
    symbols = re.findall(r" T (\w+)$", read("nm", "-D", "--defined-only", library), re.M)
    wrong = [name for name in symbols if not name.startswith("carillon_")]
    assert not wrong and "carillon_process" in symbols, f"{library}: visible in addition to the interface, or missing from it: {wrong[:5]}"


def check_module(folder, bank, work):
    """The unpacked Python module reads a bank with Debian's Python."""
    if not folder.exists():
        return
    script = f"import carillon; print(len(carillon.Bank({str(bank)!r})), carillon.__file__)"
    words = read("/usr/bin/python3", "-c", script, env={**os.environ, "PYTHONPATH": str(folder)}, cwd=work).split()
    assert int(words[0]) > 0 and words[1].startswith(str(folder)), words


def build_by_cmake(example, usr, work):
    warnings = "-Wall -Wextra -Werror"
    flags = [f"-DCMAKE_PREFIX_PATH={usr}", f"-DCMAKE_C_FLAGS=-std=c99 -pedantic {warnings}", f"-DCMAKE_CXX_FLAGS={warnings}"]
    run("cmake", "-S", example, "-B", work / "by-cmake", "-G", "Ninja", *flags, **quiet)
    run("cmake", "--build", work / "by-cmake", "--", "--quiet")
    return work / "by-cmake"


def build_by_pkg_config(example, usr, work):
    folder = work / "by-pkg-config"
    folder.mkdir()
    paths = {**os.environ, "PKG_CONFIG_PATH": str(usr / "lib/pkgconfig")}
    words = read("pkg-config", "--cflags", "--libs", "carillon", env=paths).split()
    for name in ("strike", "slide", "click"):
        run("cc", "-std=c99", "-pedantic", example / f"{name}.c", *words, f"-Wl,-rpath,{usr}/lib", "-lm", "-o", folder / f"{name}_c")
    return folder


def play(programs, pattern, bank):
    """Output of each program, grouped."""
    found = []
    for program in programs:
        line = read(program, bank)
        print(program.name, line.strip())
        match = re.fullmatch(pattern, line)
        assert match, (program, line)
        found.append(match.groups())
    return found


def main():
    source, build, work = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    root = work / "root"
    packages = make_packages(build, work)
    listed = [path for name, file in packages.items() for path in check_package(name, file)]
    assert len(listed) == len(set(listed)), "two packages have one file"
    for file in packages.values():
        run("dpkg-deb", "-x", file, root)
    usr = root / "usr"
    check_symbols(usr / "lib/libcarillon.so")
    for name in ("carillon-render", "carillon-bank", "carillon-samples", "carillon", "carillon-precompute", "carillon-mesh"):
        if (build / "bin" / name).exists():
            assert read(usr / "bin" / name, "--version") == read(build / "bin" / name, "--version"), name

    example = shutil.copytree(source / "docs/examples/embed", work / "example")  # out of reach of the source headers
    by_cmake, by_pkg_config = build_by_cmake(example, usr, work), build_by_pkg_config(example, usr, work)
    bank = source / "tests/unit/runtime/bank/pinned/version_1_0.hdf"
    strikes = [by_cmake / "strike_c", by_cmake / "strike_cpp", by_pkg_config / "strike_c"]
    heard = play(strikes, r"(\d+) modes, peak (\S+) Pa at the left ear\n", bank)
    assert len({modes for modes, _ in heard}) == 1 and all(float(peak) > 0 for _, peak in heard), "they do not play the same bank"
    assert heard[0] == heard[2], "one program by CMake and by pkg-config sounds differently"
    edits = [by_cmake / "slide_c", by_cmake / "edit_cpp", by_pkg_config / "slide_c"]
    edited = play(edits, r"peak (\S+) Pa, (\S+) Pa after the edit; (\d+) -> (\d+) Hz(?:; 0 underruns)?\n", bank)
    assert len({groups[2:] for groups in edited}) == 1, "they do not edit the same bank"
    play([by_cmake / "click_c", by_pkg_config / "click_c"], r"triangle \d+ of \d+, peak \S+ Pa at the left ear\n", bank)
    check_module(usr / "lib/python3/dist-packages", bank, work)
    bad = subprocess.run([by_cmake / "strike_c", __file__], capture_output=True, text=True)
    assert bad.returncode == 1 and "installed_package.py" in bad.stderr, f"no clear error for a file that is no bank: {bad.stderr}"


if __name__ == "__main__":
    main()
