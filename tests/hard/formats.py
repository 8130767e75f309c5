#!/usr/bin/env python3
"""Hard cases of formats for other programs: what a Faust program or a GLB file has to hold that is at the edge of either. The truth is
carillon-render's sound of the same blow, a closed form, or the bank itself read by h5py.

usage: formats.py CASE
"""
import pathlib
import re
import sys
import tempfile

import h5py
import numpy as np

from figure import hold, hold_refusal

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "system/exchange"))
from banks import BIN, fixtures, make_bank, render_blow, run, take_modes  # noqa: E402
from faust_test import compile_dsp, play  # noqa: E402
from glb_test import Glb  # noqa: E402


def compare(folder, bank, modes, point, rate, seconds=0.3, level="-O1"):
    """Largest error of a sample of the Faust program against the scene, over the peak."""
    out = run(BIN / "carillon-bank", "export", bank, "-o", "body.dsp", "--modes", modes, "--points", ",".join(map(str, point)), cwd=folder)
    with h5py.File(bank) as file:
        centre, count = file["rigid/centre_m"][:], len(file["modes/frequency_hz"])
    assert f"{min(modes, count)} of {count} modes" in out.stdout, out.stdout
    compile_dsp(folder, "body.dsp", level=level)
    scene = render_blow(folder, bank, point, (0, 0, -1e-4), centre, seconds, rate)
    return abs(play(folder, rate, len(scene), 1e-4) - scene).max() / abs(scene).max()


def faust_thousand_modes(folder):
    plate = {"plate": {"shape": "rectangle", "length_m": 1.2, "width_m": 0.9, "thickness_m": 0.004}, "grid": 48}
    bank = make_bank(folder, "plate", plate, max_modes=1000)
    hold("faust_thousand_modes", compare(folder, bank, 1000, (0.41, 0.28, 0.002), 48000, level="-O0"), 1e-5)


def faust_damped(folder):
    """alpha2 of 400 1/s: modes below 32 Hz do not swing."""
    damping = {"rayleigh": {"alpha1_s": 1e-9, "alpha2_per_s": 400.0}}
    material = {"young_modulus_pa": 7e10, "poisson_ratio": 0.2, "density_kg_m3": 2500, "damping": damping}
    plate = {"plate": {"shape": "rectangle", "length_m": 0.9, "width_m": 0.7, "thickness_m": 0.003}, "grid": 24}
    bank = make_bank(folder, "damped", plate, material=material, band_hz=[5, 20000], max_modes=100)
    with h5py.File(bank) as file:
        assert (2 * np.pi * file["modes/frequency_hz"][:] < file["modes/decay"][:]).sum() > 0
    hold("faust_damped", compare(folder, bank, 100, (0.31, 0.17, 0.0015), 44100), 1e-5)
    assert "creep(" in (folder / "body.dsp").read_text().split("group0(point)")[1]


def faust_nyquist(folder):
    """Modes from 15 to 30 kHz at 44.1 kHz and at 16 kHz: below half the rate exact, above silent."""
    bank = make_bank(
        folder,
        "high",
        {"plate": {"shape": "rectangle", "length_m": 0.11, "width_m": 0.09, "thickness_m": 0.003}, "grid": 24},
        band_hz=[3000, 30000],
    )
    for rate in (44100, 16000):
        hold("faust_nyquist", compare(folder, bank, 1000, (0.031, 0.027, 0.0015), rate, 0.1), 1e-5, f"{rate} Hz")


def faust_one_mode(folder):
    bank = take_modes(folder, "glass_plate.hdf", 1)
    run(BIN / "carillon-bank", "export", bank, "-o", "body.dsp", "--points", "0.39,0.29,0.002", cwd=folder)
    numbers = re.search(r"swing\((\S+), (\S+), at\(point, (\S+)\)\)", (folder / "body.dsp").read_text()).groups()
    hz, d, gain = map(float, numbers)
    t = np.arange(48000) / 48000
    v = np.sqrt((2 * np.pi * hz) ** 2 - d**2)
    exact = gain * np.exp(-d * t) * (np.cos(v * t) - d / v * np.sin(v * t))
    for precision, bound in (("-double", 1e-9), ("-single", 5e-3)):
        compile_dsp(folder, "body.dsp", precision)
        hold("faust_one_mode", abs(play(folder, 48000, len(t), 1.0) - exact).max() / abs(gain), bound, precision[1:])


def glb_many_vertices(folder):
    """More vertices than 16 bits number: indices of 32 bits, and the same bank again."""
    bank = make_bank(
        folder, "fine", {"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.004}, "grid": 220}, max_modes=2
    )
    run(BIN / "carillon-bank", "export", bank, "-o", "fine.glb", cwd=folder)
    run(BIN / "carillon-bank", "import", "fine.glb", "-o", "again.hdf", cwd=folder)
    glb = Glb((folder / "fine.glb").read_bytes())
    (primitive,) = glb.json["meshes"][0]["primitives"]
    with h5py.File(bank) as file, h5py.File(folder / "again.hdf") as again:
        triangles = file["mesh/triangles"][:]
        assert file["mesh/vertices"].shape[0] > 65535
        wrong = (glb.read(primitive["indices"]).reshape(-1, 3) != triangles).sum()
        for name in ("mesh/vertices", "mesh/triangles", "modes/eigenvalue", "modes/decay", "modes/shape", "modes/shape_scale"):
            wrong += (file[name][:] != again[name][:]).sum()
    hold("glb_many_vertices", wrong, 0)


def glb_damaged(folder):
    """Cut at a hundred places, and one byte in every 97th changed: the bank, or one sentence."""
    bank = fixtures.get("small_plate.hdf")
    run(BIN / "carillon-bank", "export", bank, "-o", "whole.glb", cwd=folder)
    whole = (folder / "whole.glb").read_bytes()
    import subprocess

    def read(data):
        (folder / "x.glb").write_bytes(data)
        (folder / "x.hdf").unlink(missing_ok=True)
        words = [BIN / "carillon-bank", "import", "x.glb", "-o", "x.hdf"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=60, errors="replace")
        sentence = done.returncode == 2 and done.stderr.startswith("carillon-bank: ") and done.stderr.count("\n") == 1
        return done.returncode, sentence and not (folder / "x.hdf").exists()

    bad = 0
    for i in range(40):
        code, is_said = read(whole[: i * len(whole) // 40])
        bad += not is_said
    for at in range(0, len(whole), max(1, len(whole) // 60)):
        code, is_said = read(whole[:at] + bytes([whole[at] ^ 0x41]) + whole[at + 1 :])
        bad += not (is_said or code == 0)
    hold("glb_damaged", bad, 0)
    hold_refusal(
        "glb_damaged",
        run(BIN / "carillon-bank", "import", bank, "-o", "x.hdf", cwd=folder, code=2).stderr,
        ["small_plate.hdf", "not a GLB file"],
        "a bank",
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="carillon-hard-") as name:
        globals()[sys.argv[1]](pathlib.Path(name))
