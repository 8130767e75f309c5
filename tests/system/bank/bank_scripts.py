"""Banks in the eyes of others: h5py by the words of docs/bank-format.md, VTK, and files that h5py made bad and sealed again.

One script of five parts that share the same small banks; longer than most files.

bank_scripts.py doc|vtk|bad|packed|program. Finds the programs in $CARILLON_BIN_DIR and the page in $CARILLON_SOURCE_DIR.
"""
import json
import os
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

BIN = os.environ["CARILLON_BIN_DIR"]
PAGE = os.path.join(os.environ["CARILLON_SOURCE_DIR"], "docs", "bank-format.md")


def make_bank(path, squares=2, modes=5, kind=""):
    subprocess.run([f"{BIN}/make_example_bank", path, str(squares), str(modes), kind], check=True)


def get_snippet(name):
    """The code block of the page that begins with a comment of that name."""
    blocks = re.findall(r"```python\n(.*?)```", open(PAGE).read(), re.S)
    (block,) = [b for b in blocks if b.startswith(f"# {name} ")]
    return block


def run_snippet(name, path):
    """Runs the code as a stranger would, with BANK as its argument; returns its variables."""
    kept, sys.argv = sys.argv, [name, path]
    variables = {"__name__": "__main__"}
    try:
        exec(compile(get_snippet(name), name, "exec"), variables)
    finally:
        sys.argv = kept
    return variables


def bank_program(*arguments):
    return subprocess.run([f"{BIN}/carillon-bank", *arguments], capture_output=True, text=True, timeout=60)


def check_doc(folder):
    path = f"{folder}/a.hdf"
    make_bank(path, 3, 12, "corrected")
    code = [line for line in get_snippet("read_bank.py").splitlines() if line and not line.startswith("#")]
    assert len(code) <= 10, f"the reader on the page has {len(code)} lines"
    got = run_snippet("read_bank.py", path)
    assert got["vertices"].shape == (56, 3) and got["triangles"].shape == (108, 3) and got["phi_at_7"].shape == (12, 3)
    # The example is made from formulas: tests/unit/runtime/bank/example_bank.hpp.
    mode = np.arange(12)
    freq = (574.44 + 19000.0 * mode / 12) * np.where(mode == 4, 1.0, np.where(mode % 3 == 2, 0.7, 0.99))
    assert np.allclose(got["freq_hz"], freq, rtol=1e-13), got["freq_hz"]
    assert np.allclose(got["decay_per_s"], (1e-7 * (2 * np.pi * freq) ** 2 + 5.0) / 2, rtol=1e-13)
    x = got["vertices"][7]
    k = np.arange(1, 13)
    phase = 20 * k * x[0] + 7 * x[1] * k**2 + 3 * x[2]
    phi = np.stack([2 * np.sin(phase), 3 * np.cos(1.3 * phase), 0.01 * k * np.sin(0.7 * phase + 1)], axis=1)
    assert np.all(abs(got["phi_at_7"] - phi) <= 0.5000001 * got["scale"][:, None])
    assert got["young_modulus_pa"] == 200e9 and got["provenance"]["run"]["ranks"] == 2
    # The surface is closed and outward also in the eyes of numpy (divergence theorem): 0.3 x 0.02 x 0.01 m.
    a, b, c = (got["vertices"][got["triangles"][:, i]] for i in range(3))
    assert np.isclose(np.einsum("ij,ij->", a, np.cross(b, c)) / 6, 6e-5, rtol=1e-9)

    with h5py.File(path) as bank:
        datasets = []
        bank.visititems(lambda name, item: datasets.append((name, item)) if isinstance(item, h5py.Dataset) else None)
        page = open(PAGE).read()
        for name, item in datasets:
            if name.startswith("VTKHDF"):
                continue
            assert item.attrs["units"] and item.attrs["meaning"], name
            assert name in page or name.split("/")[-1] in page, f"{name} is not on the page"

    # The seal by the words of the page, and its table against what HDF5 knows.
    sealed = open(path, "rb").read()
    run_snippet("seal_bank.py", path)
    again = open(path, "rb").read()
    lines = lambda b: sorted(b[:4032].decode().split("\n"))
    assert lines(sealed) == lines(again), "the seal on the page differs from that of the program"
    assert sealed[4096:] == again[4096:]
    assert bank_program("check", path).returncode == 0

    # The same for the air, whose decays are those of the formula of the page.
    air = f"{folder}/air.hdf"
    make_bank(air, 3, 12, "radiation")
    sealed = open(air, "rb").read()
    run_snippet("seal_bank.py", air)
    assert lines(sealed) == lines(open(air, "rb").read())
    with h5py.File(air) as bank:
        group = {name: item[()] for name, item in bank["radiation"].items()}
        for name, item in bank["radiation"].items():
            assert item.attrs["units"] and item.attrs["meaning"] and name in page, name
    assert np.allclose(calc_decays(group), group["decay"], rtol=1e-3), (calc_decays(group), group["decay"])

    # A stranger's own bank: every array copied by h5py into a new file of his.
    other = f"{folder}/stranger.hdf"
    with h5py.File(path) as bank, h5py.File(other, "w", userblock_size=4096) as copy:
        copy.attrs["version"] = "1.1"
        for name, item in datasets_of(bank):
            copy[name] = item[()]
    run_snippet("seal_bank.py", other)
    done = bank_program("check", other)
    assert done.returncode == 0, done.stderr


def calc_decays(air):
    """Of the multipoles, with |h_l|^2 as a finite sum (DLMF 10.49.18)."""
    decays, first = [], 0
    for freq, order, scale in zip(air["freq_hz"], air["order"], air["scale"]):
        k, power = 2 * np.pi * freq / air["sound_speed_ms"], 0.0
        x2 = (k * air["radius_m"]) ** 2
        for l in range(order + 1):
            steps = air["coefficient"][first : first + 2 * l + 1].astype(float)
            first += 2 * l + 1
            factors = [(2 * j - 1) / (2 * j) * (l + j) * (l - j + 1) / x2 for j in range(1, l + 1)]
            power += (steps**2).sum() * scale**2 / (np.cumprod([1.0, *factors]).sum() / x2)
        decays.append(power / (2 * air["air_density_kg_m3"] * air["sound_speed_ms"] * k**2))
    assert first == len(air["coefficient"])
    return np.array(decays)


def datasets_of(bank):
    found = []
    bank.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) and "VTKHDF" not in name else None)
    return found


def check_vtk(folder):
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOHDF import vtkHDFReader
    except ImportError as error:  # Debian's VTK needs MPI, which a machine for the runtime alone lacks; CTest calls 77 skipped only there
        print(error)
        sys.exit(77)

    for squares, modes in ((3, 12), (40, 120)):
        path = f"{folder}/vtk.hdf"
        make_bank(path, squares, modes)
        reader = vtkHDFReader()
        assert reader.CanReadFile(path)
        reader.SetFileName(path)
        reader.Update()
        grid = reader.GetOutput()
        with h5py.File(path) as bank:
            vertices, triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
            shape, freq = bank["modes/shape"][:], bank["modes/frequency_hz"][:]
        assert np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), vertices)
        assert grid.GetNumberOfCells() == len(triangles) and grid.GetCellType(0) == 5
        assert np.array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 3), triangles)
        arrays = grid.GetPointData()
        assert arrays.GetNumberOfArrays() == modes
        for k in range(modes):
            array = arrays.GetArray(f"mode_{k + 1:03d}_{freq[k]:.1f}Hz")
            assert array is not None, f"mode {k} has no view"
            assert np.array_equal(vtk_to_numpy(array), shape[:, k, :]), k


def put(name, value):
    """Changes values of an array in place."""

    def change(bank):
        bank[name][...] = value(bank[name][...]) if callable(value) else value

    return change


def replace(name, value):
    """Puts another array in the place of one."""

    def change(bank):
        old = bank[name][()]
        del bank[name]
        bank[name] = value(old)

    return change


def at(index, value):
    def change(array):
        array[index] = value
        return array

    return change


def set_version(version):
    return lambda bank: bank.attrs.__setitem__("version", version)


# What was done to a good bank before it was sealed again, and words of the message of `carillon-bank info`.
# Damage in a file; content of every kind: tests/unit/runtime/bank/content_test.cpp.
BAD = [
    ("newer major", set_version("3.0"), "written as version 3.0, this reader knows 1.x and 2.x: update Carillon or write the bank again"),
    ("much newer major", set_version("17.4"), "written as version 17.4"),
    ("version zero", set_version("0.9"), "never a version 0.9"),
    ("no version", set_version("one"), "line 1 names no version"),
    ("negative version", set_version("-1.0"), "line 1 names no version"),
    ("NaN vertex", put("mesh/vertices", at((3, 1), np.nan)), "vertices[10] is nan"),
    ("wrong frequency", put("modes/frequency_hz", at(2, 440.0)), "modes/frequency_hz[2] is 440 Hz, and its eigenvalue says"),
    ("NaN frequency", put("modes/frequency_hz", at(2, np.nan)), "modes/frequency_hz[2] is nan"),
    ("shape of fewer modes", replace("modes/shape", lambda s: s[:, :-1]), "modes/shape is <i2 (26, 4, 3), <i2 (26, 5, 3) is required"),
    ("shape of other type", replace("modes/shape", lambda s: s.astype("<f8")), "modes/shape is <f8 (26, 5, 3), <i2"),
    ("flat shape", replace("modes/shape", lambda s: s.reshape(-1)), "modes/shape is <i2 (390), <i2"),
    ("one decay too few", replace("modes/decay", lambda d: d[:-1]), "modes/decay is <f8 (4), <f8 (5) is required"),
    ("scalar eigenvalue", replace("modes/eigenvalue", lambda e: e[0]), "modes/eigenvalue is a single number"),
    ("two-dimensional vertices", replace("mesh/vertices", lambda v: v[:, :2]), "mesh/vertices is <f8 (26, 2), <f8 (26, 3) is required"),
    ("no residuals", lambda bank: bank.__delitem__("modes/residual"), "the array modes/residual is missing"),
    ("no mass", lambda bank: bank.__delitem__("rigid/mass_kg"), "the array rigid/mass_kg is missing"),
    ("neither complete nor not", put("solve/complete", 7), "solve/complete is 7, neither 0 nor 1"),
    ("rigid modes without a body", put("solve/rigid_modes", 2**62), "rigid modes of 1 components"),
    ("provenance of numbers", replace("provenance", lambda p: np.arange(3.0)), "provenance is not text"),
    ("long element", replace("solve/element", lambda e: np.bytes_(b"T" * 17)), "neither T4 nor T10"),
    ("proof of one array", lambda bank: bank.__delitem__("proof/below"), "the array proof/below is missing"),
    ("proof without a cut", lambda bank: bank.__delitem__("proof/cut_hz"), "the array proof/cut_hz is missing"),
    ("counts of a matrix", replace("proof/below", lambda b: b.reshape(3, 1)), "proof/below is <i8 (3, 1), <i8 (3) is required"),
    ("counts without end", put("proof/below", at(2, 2**63 - 1)), "modes lie between 7000 and 20000 Hz"),
    ("law of numbers", replace("damping/law", lambda p: np.arange(3.0)), "damping/law is not text"),
    ("law without numbers", lambda bank: bank.__delitem__("damping/power"), "the array damping/power is missing"),
    ("chunked shape", lambda bank: recreate_chunked(bank, "modes/shape"), "gives an array that cannot be in this file"),
]


# The same of a packed bank.
BAD_PACKED = [
    ("no surface", lambda bank: bank.__delitem__("mesh/packed"), "the array mesh/vertices is missing"),
    ("no shapes", lambda bank: bank.__delitem__("modes/packed_shape"), "the array modes/packed_shape is missing"),
    ("shapes cut", replace("modes/packed_shape", lambda b: b[:-5]), "packed shapes"),
    ("shapes of nothing", replace("modes/packed_shape", lambda b: b[:0]), "packed shapes: ends too early"),
    ("a surface of another form", put("mesh/packed", at(0, 9)), "packed surface: its form is 9, and this reader knows 1"),
    ("2^32 - 1 vertices", put("mesh/packed", at(slice(2, 6), 255)), "packed surface: it would expand beyond the limit for its length"),
    ("2^32 - 1 modes", put("modes/packed_shape", at(slice(1, 5), 255)), "packed shapes: they are of 4294967295 modes, and the bank has"),
    ("shapes damaged", put("modes/packed_shape", at(-40, 170)), "packed shapes"),
    ("a surface as numbers", replace("mesh/packed", lambda b: b.astype("<i4")), "mesh/packed is <i4"),
    ("NaN scale", put("modes/shape_scale", at(0, np.nan)), "scale of shapes is nan"),
    ("a witness elsewhere", put("pack/witness", at(0, 2**31 - 1)), "pack/witness names vertex 2147483647"),
    ("a witness before all", put("pack/witness", at(0, -1)), "pack/witness names vertex -1"),
    ("witnesses of fewer modes", replace("pack/witness_shape", lambda s: s[:, :-1]), "pack/witness_shape is <i2 (24, 11, 3)"),
    ("NaN error", put("pack/error_db", np.nan), "pack/error_db[0] is nan"),
    ("order of fewer triangles", replace("mesh/packed_order", lambda b: b[:-9]), "order of packed triangles"),
]


def check_contacts(folder, whole, packed, loose):
    """Contacts that were recorded on the whole bank play on a packed one that keeps the numbers, and on no other."""

    def render(bank, *options):
        scene = {"duration_s": 0.3, "bodies": [{"name": "a", "bank": bank, "fixed": True}], "listener": {"position_m": [1, 1, 1]}}
        scene["strikes"] = [{"time_s": 0.1, "body": "a", "triangle": 7, "impulse_n_s": [0.01, -0.02, 0.03]}]
        if "--contacts" in options:
            del scene["strikes"]
        scene["output"] = {"gain": 0.01, "format": "float"}
        open(f"{folder}/scene.json", "w").write(json.dumps(scene))
        words = [f"{BIN}/carillon-render", f"{folder}/scene.json", "-o", f"{folder}/sound.wav", *options]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60)
        return done, np.frombuffer(open(f"{folder}/sound.wav", "rb").read()[-8 * 14400 :], "<f4") if done.returncode == 0 else None

    contacts = f"{folder}/contacts.jsonl"
    done, expected = render(whole, "--record", contacts)
    assert done.returncode == 0, done
    done, sound = render(packed, "--contacts", contacts)
    assert done.returncode == 0, done
    ratio = np.sum((sound - expected) ** 2.0) / np.sum(expected**2.0)
    assert 0 < ratio < 0.01, ratio  # an oblique blow; at another triangle it would be about 1
    done, _ = render(loose, "--contacts", contacts)
    assert done.returncode == 2 and "contacts.jsonl" in done.stderr, done


def check_packed(folder):
    """Packed banks: h5py sees what the page says of them; damage is found; the stated error cannot be made smaller than it is."""
    whole, path, plain = f"{folder}/whole.hdf", f"{folder}/packed.hdf", f"{folder}/plain.hdf"
    make_bank(whole, 12, 12, "corrected")
    done = bank_program("pack", whole, path, "--error", "-40", "--keep-numbers")
    assert done.returncode == 0 and done.stdout.startswith("packed ") and done.stderr == "", done
    assert os.path.getsize(path) < 0.5 * os.path.getsize(whole)
    done = bank_program("check", path, "--original", whole)
    assert done.returncode == 0 and "ok      original     error at most -40." in done.stdout, done
    assert "packed    error at most -40." in bank_program("info", path).stdout
    assert bank_program("unpack", path, plain).returncode == 0 and bank_program("check", plain).returncode == 0
    with h5py.File(whole) as old, h5py.File(path) as packed, h5py.File(plain) as new:
        assert packed.attrs["version"] == "2.0" and "VTKHDF" not in packed and "mesh/vertices" not in packed
        assert packed["mesh/packed"].dtype == np.uint8 and packed["modes/packed_shape"].dtype == np.uint8
        same = [name for name, _ in datasets_of(old) if name not in ("mesh/vertices", "mesh/triangles", "modes/shape", "provenance")]
        for name in same:
            assert np.array_equal(old[name][()], packed[name][()]) and np.array_equal(old[name][()], new[name][()]), name
        # Triangles keep their numbers, and their corners their places, to half a step of the lattice.
        size = np.ptp(old["mesh/vertices"][:], axis=0).max()
        corners = [bank["mesh/vertices"][:][bank["mesh/triangles"][:]] for bank in (old, new)]
        assert np.abs(corners[0] - corners[1]).max() <= size / 2**20 / 2 * 1.001
        shapes = [bank["modes/shape"][:][bank["mesh/triangles"][:]] * bank["modes/shape_scale"][:][:, None] for bank in (old, new)]
        error = np.sqrt(np.mean((shapes[0] - shapes[1]) ** 2) / np.mean(shapes[0] ** 2))
        assert 1e-4 < error < 0.1, error  # not the same, and not another
        # Witnesses are what was there before.
        places = old["mesh/vertices"][:]
        for vertex, rows in zip(packed["pack/witness"][:], packed["pack/witness_shape"][:]):
            nearest = np.argmin(np.linalg.norm(places - new["mesh/vertices"][vertex], axis=1))
            assert np.array_equal(rows, old["modes/shape"][nearest]), vertex
    # Written to standard output; packed once.
    piped = subprocess.run([f"{BIN}/carillon-bank", "pack", whole, "-", "--error", "-40", "--keep-numbers"], capture_output=True)
    assert piped.returncode == 0 and piped.stdout == open(path, "rb").read(), piped.stderr
    # Without numbers it is smaller; edits give plain banks.
    assert bank_program("pack", whole, f"{folder}/loose.hdf", "--error", "-40").returncode == 0
    assert os.path.getsize(f"{folder}/loose.hdf") < os.path.getsize(path)
    assert bank_program("check", f"{folder}/loose.hdf", "--original", whole).returncode == 0
    assert bank_program("edit", path, f"{folder}/large.hdf", "--size", "2").returncode == 0
    assert "format 1.4" in bank_program("info", f"{folder}/large.hdf").stdout
    check_contacts(folder, whole, path, f"{folder}/loose.hdf")
    for arguments, words in (
        (["unpack", whole, plain], "is not packed; use it as it is"),
        (["check", whole, "--original", whole], "is not packed; omit --original"),
        (["check", path, "--original", f"{folder}/none.hdf"], "none.hdf: no such file"),
        (["check", path, "--original", path], "is packed itself"),
        (["pack", path, f"{folder}/b.hdf"], "is packed already; give the bank that was packed"),
        (["pack", whole, f"{folder}/a.txt"], "a bank is an HDF5 file"),
        (["pack", f"{folder}/none.hdf", f"{folder}/b.hdf"], "no such file"),
        (["pack", whole, f"{folder}/b.hdf", "--error", "-100"], "--error"),
        (["pack", whole, f"{folder}/b.hdf", "--error", "quiet"], "--error"),
    ):
        done = bank_program(*arguments)
        assert done.returncode == 2 and words in done.stdout + done.stderr, (arguments, done)
    assert not os.path.exists(f"{folder}/b.hdf") and not os.path.exists(f"{folder}/a.txt")

    good, bad = open(path, "rb").read(), f"{folder}/bad.hdf"
    for title, change, words in BAD_PACKED:
        open(bad, "wb").write(good)
        with h5py.File(bad, "r+") as bank:
            change(bank)
        run_snippet("seal_bank.py", bad)
        done = bank_program("info", bad)
        assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1, (title, done)
    # An error that is stated too small, and shapes of another bank, do not pass.
    for title, change in (
        ("a better error", lambda bank: [put(f"pack/{name}_db", -80.0)(bank) for name in ("error", "worst")]),
        ("other shapes", put("pack/witness_shape", lambda s: s[::-1])),
    ):
        open(bad, "wb").write(good)
        with h5py.File(bad, "r+") as bank:
            change(bank)
        run_snippet("seal_bank.py", bad)
        done = bank_program("check", bad)
        assert done.returncode == 2 and "FAULT   packing" in done.stdout, (title, done)
    # Every change of a byte, and every cut, is found.
    for place in list(range(4096, len(good), max(1, len(good) // 60))):
        for damaged in (good[:place], good[:place] + bytes([good[place] ^ 0x10]) + good[place + 1 :]):
            open(bad, "wb").write(damaged)
            done = bank_program("info", bad)
            assert done.returncode == 2 and done.stderr.count("\n") == 1, (place, done)


def recreate_chunked(bank, name):
    values = bank[name][()]
    del bank[name]
    bank.create_dataset(name, data=values, chunks=True, compression="gzip")


def check_bad(folder):
    path = f"{folder}/bad.hdf"
    for title, change, words in BAD:
        make_bank(path)
        with h5py.File(path, "r+") as bank:
            change(bank)
        assert bank_program("info", path).returncode == 2, f"{title}: read although it was not sealed again"
        run_snippet("seal_bank.py", path)
        for arguments in (["info", path], ["info", "--json", path], ["check", path]):
            done = bank_program(*arguments)
            text = done.stderr if arguments[0] == "info" else done.stdout + done.stderr
            assert done.returncode == 2, f"{title}: exit code {done.returncode} of {arguments}"
            assert words in text, f"{title}: {words!r} is not in {text!r}"
            assert done.stderr.startswith("carillon-bank: " + path + ": ") and done.stderr.count("\n") == 1, done.stderr
            assert arguments[0] == "check" or done.stdout == "", done.stdout
    # A newer minor version is read, with an array and a line that this reader does not know.
    make_bank(path)
    with h5py.File(path, "r+") as bank:
        bank.attrs["version"] = "1.7"
        bank["modes/sparkle"] = np.arange(5.0)
    run_snippet("seal_bank.py", path)
    done = bank_program("info", path)
    assert done.returncode == 0 and "format 1.7" in done.stdout, done.stderr


def check_reduced(path, small):
    """Fewer modes and coarser shapes by `carillon-bank edit`, in the eyes of h5py."""

    def edit(*words):
        done = bank_program("edit", path, small, *words)
        assert done.returncode == 0 and done.stdout == "" == done.stderr, done
        assert bank_program("check", small).returncode == 0
        return bank_program("info", small).stdout

    assert "the lowest 7 of 30 modes" in edit("--modes", "7", "--keep", "lowest", "--shape-bits", "8")
    with h5py.File(path) as whole, h5py.File(small) as bank:
        assert bank["modes/shape"].dtype == np.int8 and bank["modes/shape"].shape[1] == 7 and bank["solve/complete"][()] == 0
        assert bank.attrs["version"] == "1.2" and np.array_equal(bank["modes/eigenvalue"][:], whole["modes/eigenvalue"][:7])
        phi, coarse = (b["modes/shape"][:, :7] * b["modes/shape_scale"][:7][:, None] for b in (whole, bank))
        assert np.all(np.abs(coarse - phi) <= 0.5001 * (bank["modes/shape_scale"][:] + whole["modes/shape_scale"][:7])[:, None])
        assert np.array_equal(bank["VTKHDF/PointData"][list(bank["VTKHDF/PointData"])[3]][:], bank["modes/shape"][:, 3].astype("f4"))
        assert json.loads(bank["provenance"][()])["reduced"] == {"modes": 7, "of_modes": 30, "keep": "lowest", "shape_bits": 8}
    assert "5 modes of the band were kept, not all" in edit("--modes", "5")
    with h5py.File(small) as bank:
        assert "proof" not in bank and bank["modes/shape"].dtype == np.int16 and bank.attrs["version"] == "1.1"
    assert "30 modes in 20 .. 20000 Hz and no more" in edit("--modes", "30", "--size", "1.0")
    os.remove(small)
    for words in (
        ["--modes", "0"],
        ["--modes", "-3"],
        ["--modes", "x"],
        ["--keep", "lowest"],
        ["--modes", "3", "--keep", "best"],
        ["--shape-bits", "1"],
        ["--shape-bits", "17"],
    ):
        done = bank_program("edit", path, small, *words)
        assert done.returncode == 2 and done.stderr and not os.path.exists(small), (words, done)


def check_program(folder):
    path = f"{folder}/a.hdf"
    make_bank(path, 2, 30)
    done = bank_program("info", "--json", path)
    info = json.loads(done.stdout, parse_constant=lambda word: sys.exit(f"{word} is no JSON"))
    with h5py.File(path) as bank:
        for k, mode in enumerate(info["modes"]):
            # To the last bit: 17 digits.
            assert mode["eigenvalue_rad2_s2"] == bank["modes/eigenvalue"][k] and mode["decay_per_s"] == bank["modes/decay"][k]
            assert mode["algebraic_error_cents"] == bank["modes/algebraic_error_cents"][k]
            assert mode["residual"] == bank["modes/residual"][k] and mode["radiation_gain"] == bank["modes/radiation_gain"][k]
            assert np.isclose(mode["frequency_hz"], bank["modes/frequency_hz"][k], rtol=1e-14)
            assert np.isclose(mode["t60_s"], np.log(1000) / bank["modes/decay"][k], rtol=1e-12) and mode["regime"] == "under"
        assert np.array_equal(info["rigid"]["inertia_kg_m2"], bank["rigid/inertia_kg_m2"][:])
    assert info["mode_count"] == 30 and len(info["frequencies_hz"]) == 30 and info["counts"]["rigid_modes"] == 6
    assert info["provenance"]["run"]["stations"][1]["seconds"] == 12.25 and info["bytes"] == os.path.getsize(path)

    air, other = f"{folder}/air.hdf", f"{folder}/other.hdf"
    make_bank(air, 2, 12, "radiation")
    info = json.loads(bank_program("info", "--json", air).stdout)
    with h5py.File(air) as bank:
        for name, key in (("freq_hz", "frequency_hz"), ("order", "order"), ("decay", "decay_per_s"), ("added_mass", "added_mass")):
            assert [mode["radiation"][key] for mode in info["modes"]] == bank[f"radiation/{name}"][:].tolist(), name
        assert info["radiation"]["radius_m"] == bank["radiation/radius_m"][()]
    assert "order 1 to 4" in bank_program("info", air).stdout and "multipoles of order 1 to 4" in bank_program("check", air).stdout
    for arguments, is_kept in ((["--size", "2"], True), (["--tan-phi", "0.01"], True), (["--density", "1.1"], False)):
        done = bank_program("edit", air, other, *arguments)
        assert done.returncode == 0 and ("radiation: dropped" in done.stdout) != is_kept, done
        with h5py.File(other) as bank:
            assert ("radiation" in bank) == is_kept
        assert bank_program("check", other).returncode == 0

    page = bank_program("info", "--modes", "3", path).stdout
    assert "provenance" not in page and "peak_bytes" not in page and "--all" in page and len(page.splitlines()) <= 22, page
    page = bank_program("info", "--all", "--modes", "3", path).stdout
    assert (
        max(map(len, page.splitlines())) <= 140
        and "574.44" in page
        and "27 more" in page
        and "+-body" in page
        and "solve: peak_bytes_largest_rank 900.00 MB, seconds 12.25" in page
    ), page
    check = bank_program("check", path)
    assert check.returncode == 0 and check.stderr == ""
    done = bank_program("check", f"{os.environ['CARILLON_SOURCE_DIR']}/tests/unit/runtime/bank/pinned/version_1_0.hdf")
    assert done.returncode == 0 and "nothing shows that the band holds no more than these 2 modes" in done.stdout, done
    for words in (
        "30 modes in 20 .. 20000 Hz and no more: 6 below 20 Hz and 36 below 20000 Hz by inertia, 6 rigid",
        "36 - 6 = 30 modes, all of them found",
        "6 of the one component, and nothing else below",
        "phi_i^T M phi_j = delta_ij to 2.0e-13",
        "discretisation at most 30 cent",
        "seal",
        "version",
        "arrays",
        "worst 3.00e-09",
        "closed, outward",
        "ascending from 574.44",
        "20 to 20000 Hz",
        f"{path}: valid",
    ):
        assert words in check.stdout, words

    for words, law in (
        (("--tan-phi", "0.02"), "internal_friction, tan(phi) 0.02"),
        (("--loss", "100:0.01", "1000:0.02"), "loss_table, 2 rows"),
        (("--caughey", "0:5", "1:1e-9"), "caughey, c = 5 lambda^0"),
        (("--alphas", "1e-9", "3"), "rayleigh, alpha1 1e-09 s"),
    ):
        done = bank_program("edit", path, f"{folder}/edited.hdf", *words)
        assert (done.returncode, done.stdout) == (0, ""), done
        assert law in bank_program("info", f"{folder}/edited.hdf").stdout and bank_program("check", f"{folder}/edited.hdf").returncode == 0
    done = bank_program("edit", path, f"{folder}/edited.hdf", "--size", "2")
    assert done.returncode == 0 and "10 to 10000 Hz" in done.stdout and "no modes above" in done.stdout, done
    for words, error in (
        (("--tan-phi", "3"), "below 2"),
        (("--loss", "100"), "HZ:FACTOR"),
        (("--loss", "100:0.1", "50:0.1"), "ascend"),
        (("--tan-phi", "0.1", "--alphas", "0", "1"), "one of"),
        (("--caughey", "0:-5"), "decay"),
    ):
        done = bank_program("edit", path, f"{folder}/bad.hdf", *words)
        assert done.returncode == 2 and error in done.stderr and not os.path.exists(f"{folder}/bad.hdf"), done
    done = bank_program("edit", path, f"{folder}/bad.mp3")
    assert done.returncode == 2 and ".hdf" in done.stderr and not os.path.exists(f"{folder}/bad.mp3"), done

    check_reduced(path, f"{folder}/small.hdf")

    # Over-damped and undamped modes, and provenance that is no JSON or hostile to a terminal.
    def spoil(change):
        with h5py.File(path, "r+") as bank:
            change(bank)
        run_snippet("seal_bank.py", path)

    def damp(bank):
        bank["material/alpha1_s"][...] = 2e-4
        bank["modes/decay"][...] = (2e-4 * bank["modes/eigenvalue"][:] + 5) / 2

    spoil(damp)
    regimes = [m["regime"] for m in json.loads(bank_program("info", "--json", path).stdout)["modes"]]
    assert regimes[0] == "under" and regimes[-1] == "over", regimes

    def quiet(bank):
        bank["material/alpha1_s"][...] = bank["material/alpha2_per_s"][...] = 0.0
        bank["modes/decay"][...] = 0.0
        del bank["provenance"]
        bank["provenance"] = np.bytes_(b'{"run": {"a": "\\u001b[31m"}, "b": ' + b"[" * 5000)

    spoil(quiet)
    done = subprocess.run([f"{BIN}/carillon-bank", "info", "--json", path], capture_output=True)
    assert json.loads(done.stdout)["modes"][0]["t60_s"] is None
    assert bank_program("info", path).returncode == 0
    done = bank_program("check", path)
    assert done.returncode == 2 and "provenance is not JSON text" in done.stdout

    def coloured(bank):
        del bank["provenance"]
        bank["provenance"] = np.bytes_(b'{"run": {"\\u001b[31m": "\\u001b[32m red \x7f \xff", "list": [{"name": "\\u001b[33m", "a": 1}]}}')

    spoil(coloured)
    done = subprocess.run([f"{BIN}/carillon-bank", "info", "--all", path], capture_output=True)
    assert done.returncode == 0 and b"red" in done.stdout and b"\x1b" not in done.stdout and b"\x7f" not in done.stdout, done

    # What is no bank at all must neither hang nor crash.
    os.mkfifo(f"{folder}/fifo")
    open(f"{folder}/empty", "w").close()
    for path, words in (
        ("/dev/zero", "not a regular file"),
        (f"{folder}/fifo", "not a regular file"),
        (folder, "is a folder"),
        (f"{folder}/empty", "is empty"),
        (f"{folder}/none", "no such file"),
        (sys.executable, "not a Carillon bank"),
    ):
        for command in ("info", "check"):
            done = bank_program(command, path)
            assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1, (path, done)
    for arguments in ([], ["info"], ["sing", path], ["check", "--loud", path]):
        assert bank_program(*arguments).returncode == 2, arguments
    assert bank_program("--help").returncode == 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        {"doc": check_doc, "vtk": check_vtk, "bad": check_bad, "packed": check_packed, "program": check_program}[sys.argv[1]](scratch)
