#!/usr/bin/python3
"""`"nonlinear": "stretch"` of held meshed bodies, from the job to the rendered sound: the glide of a clamped bar after a hard strike
against Duffing's equation of the thin beam, that of a sheet against its full condensed energy, and soft strikes against linear banks.

usage: nonlinear.py BIN_DIR
"""
import json
import math
import pathlib
import tempfile

import h5py
import numpy
import solver
from solver import run

RATE_HZ = 48000
YOUNG_PA, DENSITY_KG_M3, ALPHA2_PER_S = 70e9, 2700.0, 8.0
BAR = {"shape": "bar", "length_m": 0.3, "width_m": 0.01, "thickness_m": 0.002, "nodes": 350}
SHEET = {"shape": "plate", "length_m": 0.2, "width_m": 0.05, "thickness_m": 0.001, "nodes": 1200}
MATERIAL = {
    "young_modulus_pa": YOUNG_PA,
    "poisson_ratio": 0.0,
    "density_kg_m3": DENSITY_KG_M3,
    "damping": {"rayleigh": {"alpha1_s": 0, "alpha2_per_s": ALPHA2_PER_S}},
}
# First mode of a clamped beam: k L, modal mass of the mid-point deflection over the total mass, and gamma of q'' + omega^2 (q + gamma q^3 /
# h^2) = 0 for the deflection q of the mid-point.
WAVE_NUMBER, MASS_SHARE, GAMMA = 4.730040744862704, 0.396478, 0.719293030305
BEGIN_S, AWAY_M = 0.01, 1.0
WINDOWS_S = ((0.02, 0.12), (0.2, 0.4), (0.7, 0.95))  # of the motion


def solve(folder, name, body, nonlinear=None, max_modes=10, material="steel"):
    """Playback frequencies of the bank, and the number of its nonlinear rows."""
    job = {"body": body, "material": material, "fixed": ["x-min", "x-max"], "band_hz": [20, 3000], "max_modes": max_modes}
    solver.solve(folder, name, **job | ({"nonlinear": nonlinear} if nonlinear else {}))
    run(folder, "carillon-bank", "check", f"{name}.hdf")
    with h5py.File(folder / f"{name}.hdf") as bank:
        assert ("nonlinear" in bank) == (nonlinear is not None), name
        return bank["modes/corrected_frequency_hz"][:], len(bank["nonlinear/A"]) if nonlinear else 0


def strike(folder, bank, impulse_n_s, nonlinear=None, blow_s=1e-4):
    """The sound at 1 m above the middle, and the effect's part of the report."""
    with h5py.File(folder / f"{bank}.hdf") as file:
        top = float(file["mesh/vertices"][:, 2].max())
    scene = {
        "duration_s": 1,
        "radiation": "vddp96",
        "bodies": [{"name": "body", "bank": f"{bank}.hdf", "fixed": True} | ({} if nonlinear is None else {"nonlinear": nonlinear})],
        "strikes": [{"time_s": BEGIN_S, "body": "body", "point_m": [0, 0, top], "impulse_n_s": [0, 0, -impulse_n_s], "duration_s": blow_s}],
        "microphones": [[0, 0, AWAY_M]],
        "output": {"format": "float", "fade_end": False},
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    run(folder, "carillon-render", "scene.json", "-o", "scene.wav", "--quiet", "--report", "report.json")
    report = json.loads((folder / "report.json").read_text())
    data = (folder / "scene.wav").read_bytes()
    sound = numpy.frombuffer(data[data.index(b"data") + 8 :], "<f4").astype(float)
    assert len(sound) == RATE_HZ and report["resets"] == 0, report
    return sound / report["gain_per_pa"], report["per_body"][0]["effects"]["nonlinear"]


def find_pitch(sound, window_s, near_hz, late_s=0.0):
    """The strongest line between 0.75 and 1.8 near_hz, by parabolic interpolation [Hz]."""
    part = sound[int((window_s[0] + late_s) * RATE_HZ) : int((window_s[1] + late_s) * RATE_HZ)]
    level = numpy.log(abs(numpy.fft.rfft(part * numpy.hanning(len(part)), 1 << 19)) + 1e-300)
    step = RATE_HZ / (1 << 19)
    first = int(0.75 * near_hz / step)
    at = first + int(level[first : int(1.8 * near_hz / step)].argmax())
    low, middle, high = level[at - 1 : at + 2]
    return step * (at + (low - high) / (2 * (low - 2 * middle + high)))


def list_cents(sound, soft, near_hz):
    """Pitch of each window relative to a soft strike [cents]."""
    late = AWAY_M / 343
    soft_hz = find_pitch(soft, (0.1, 0.9), near_hz, late)
    return [1200 * math.log2(find_pitch(sound, window, near_hz, late) / soft_hz) for window in WINDOWS_S]


def integrate(omega, impulse_n_s):
    """Deflection of the middle of the thin clamped beam in its first mode, with the damping of the material, by Runge and Kutta."""
    thickness = BAR["thickness_m"]
    mass = MASS_SHARE * DENSITY_KG_M3 * BAR["length_m"] * BAR["width_m"] * thickness
    step = 0.25 / RATE_HZ
    q, v, path = 0.0, -impulse_n_s / mass, [0.0] * (4 * int(BEGIN_S * RATE_HZ))

    def push(q, v):
        return -(omega**2) * (q + GAMMA * q**3 / thickness**2) - ALPHA2_PER_S * v

    for _ in range(len(path), 4 * RATE_HZ):
        path.append(q)
        a = push(q, v)
        b = push(q + step / 2 * v, v + step / 2 * a)
        c = push(q + step / 2 * (v + step / 2 * a), v + step / 2 * b)
        d = push(q + step * (v + step / 2 * b), v + step * c)
        q, v = q + step * (v + step / 6 * (a + b + c)), v + step / 6 * (a + 2 * b + 2 * c + d)
    return numpy.array(path[::4])


def check_soft(folder, bank, linear, impulse_n_s, blow_s):
    """When forced on, the effect gives the linear sound to -100 dB; by default it is off, with identical bytes."""
    wanted, _ = strike(folder, linear, impulse_n_s, None, blow_s)
    found, effect = strike(folder, bank, impulse_n_s, True, blow_s)
    off = 20 * math.log10(abs(found - wanted).max() / abs(wanted).max())
    print(f"{bank}, soft: {off:.1f} dB from the linear sound")
    assert effect["on"] and off < -100, (effect, off)
    found_alone, effect = strike(folder, bank, impulse_n_s, None, blow_s)
    assert not effect["on"] and (found_alone == wanted).all(), effect
    return found


def check_bar(folder):
    """A single mode with its own hardening."""
    (near_hz,), rows = solve(folder, "bar", BAR, "stretch", 1, MATERIAL)
    assert rows == 1, rows
    solve(folder, "linear-bar", BAR, None, 1, MATERIAL)
    omega = WAVE_NUMBER**2 / BAR["length_m"] ** 2 * math.sqrt(YOUNG_PA / DENSITY_KG_M3 / 12) * BAR["thickness_m"]
    assert abs(near_hz / (omega / (2 * math.pi)) - 1) < 1e-3, near_hz
    soft = check_soft(folder, "bar", "linear-bar", 1e-6, 1e-4)
    for impulse in (0.005, 0.014):
        path = integrate(omega, impulse)
        sound, effect = strike(folder, "bar", impulse)
        assert effect["on"], effect  # chosen by default
        found = list_cents(sound, soft, near_hz)
        wanted = [1200 * math.log2(find_pitch(path, window, near_hz) / (omega / (2 * math.pi))) for window in WINDOWS_S]
        furthest = abs(path).max() / BAR["thickness_m"]
        print(f"bar, {furthest:.2f} thicknesses: sharp by {numpy.round(found, 2)} cents, {numpy.round(wanted, 2)} in closed form")
        assert wanted[0] > 50 and max(abs(a - b) for a, b in zip(found, wanted)) < 0.005 * wanted[0], (found, wanted)
    linear, _ = strike(folder, "linear-bar", 0.014)
    assert max(map(abs, list_cents(linear, soft, near_hz))) < 0.05


def check_sheet(folder):
    """Bending and twisting modes together: stretch rows against all rows."""
    _, rows = solve(folder, "stretch", SHEET, "stretch")
    _, full = solve(folder, "full", SHEET, {"modes": 10})
    frequencies, _ = solve(folder, "linear", SHEET)
    assert 1 <= rows <= 3 < full, (rows, full)
    soft = {bank: check_soft(folder, bank, "linear", 2e-6, 1e-3) for bank in ("stretch", "full")}
    cents = {bank: list_cents(strike(folder, bank, 0.02, True, 1e-3)[0], soft[bank], frequencies[0]) for bank in soft}
    print(f"sheet: sharp by {numpy.round(cents['stretch'], 2)} cents by its stretch, {numpy.round(cents['full'], 2)} in full")
    assert cents["full"][0] > cents["full"][2] + 20, cents
    assert max(abs(a - b) for a, b in zip(cents["stretch"], cents["full"])) < 2, cents


with tempfile.TemporaryDirectory(prefix="carillon-nonlinear-") as scratch:
    check_bar(pathlib.Path(scratch))
    check_sheet(pathlib.Path(scratch))
