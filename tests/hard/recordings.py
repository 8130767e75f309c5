#!/usr/bin/env python3
"""Hard cases of `carillon match`: few, equal and foreign peaks, materials at their limits, spoilt recordings. Bodies are Ritz boxes
(Visscher et al. 1991) and spheres in closed form; sounds are sums of their modes made here.

usage: recordings.py CASE
"""
import json
import pathlib
import sys

import numpy as np
import scipy.io.wavfile
import scipy.optimize
import scipy.special

from figure import hold, hold_refusal
from programs import Folder

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "unit/precompute/fem/error_bars"))
import box_ritz

RATE = 44100
BAR, YOUNG, NU, DENSITY = (0.2, 0.03, 0.01), 205e9, 0.285, 7850.0
TAN_PHI = 0.0015
LAW = {"damping": {"internal_friction": {"tan_phi": 0.001}}}


def find_hz(sizes, count, constants=(YOUNG, NU), density=DENSITY, degrees=(18, 10, 8)):
    """(count) frequencies [Hz] of a free box, ascending."""
    return box_ritz.solve(sizes, count, density, box_ritz.calc_elasticity(constants), False, degrees)


def make_job(sizes, young=200e9, nu=0.3, density=DENSITY, nodes=2000):
    body = {"shape": "box", "length_m": sizes[0], "width_m": sizes[1], "height_m": sizes[2], "nodes": nodes}
    return {"body": body, "material": {"young_modulus_pa": young, "poisson_ratio": nu, "density_kg_m3": density, **LAW}, "bank": "b.hdf"}


def match(folder, job, recording, *words, code=0):
    """The document of a match. recording: peaks [Hz], or samples where there are more than 1000."""
    (folder.path / "job.json").write_text(json.dumps(job))
    name = "strike.wav"
    if len(recording) > 1000:
        level = 3e4 / max(np.abs(recording).max(), 1e-9)
        scipy.io.wavfile.write(folder.path / name, RATE, np.round(level * recording).astype(np.int16))
    else:
        name = "peaks.csv"
        (folder.path / name).write_text("hz,sd_hz\n" + "".join(f"{hz:.9g},{1e-4 * hz:.3g}\n" for hz in np.sort(recording)))
    outcome = folder.run(1, "carillon-tune", "match", "job.json", name, *words, "--json")
    assert outcome.code == code, outcome.text[-1500:]
    assert "NaN" not in outcome.text and "Infinity" not in outcome.text
    return json.JSONDecoder().raw_decode(outcome.text)[0]


def hold_constant(case, found, name, truth, bound, part=""):
    """The relative error of a constant (nu: the error), and in its deviations."""
    constant = found["constants"][name]
    assert constant["sd"], f"{name} is not resolved"
    error = abs(constant["value"] - truth)
    label = f"{name} {part}".strip()
    hold(case, error / (1 if name.startswith("nu") else truth), bound, label)
    hold(case, error / constant["sd"], 3, f"{label}, over its deviation")


def strike(hz, tan_phi=TAN_PHI, seconds=1.5, noise=1e-3, seed=1):
    """Damped modes of undamped frequencies hz after 0.1 s of silence, with noise."""
    random = np.random.default_rng(seed)
    time_s = np.arange(round(seconds * RATE)) / RATE
    wave = np.zeros(len(time_s))
    for k, f in enumerate(hz):
        decay = np.pi * tan_phi * f
        damped = np.sqrt((2 * np.pi * f) ** 2 - decay**2)
        wave += 0.9**k * np.exp(-decay * time_s) * np.sin(damped * time_s + k)
    return np.concatenate([np.zeros(RATE // 10), wave]) + noise * random.normal(size=len(wave) + RATE // 10)


def one_peak():
    """One peak gives E; Poisson's ratio is said to be unresolved."""
    with Folder() as folder:
        found = match(folder, make_job(BAR), find_hz(BAR, 1))
        hold_constant("one_peak", found, "E", YOUNG, 3e-3)
        hold("one_peak", found["constants"]["nu"]["sd"] is not None, 0, "nu resolved")


def equal_peaks():
    """A square bar: each pair is heard as one peak, and one peak stands twice in the table."""
    sizes = (0.2, 0.02, 0.02)
    modes = find_hz(sizes, 12)
    single = modes[np.concatenate([[True], np.diff(modes) > 1e-4 * modes[1:]])]
    with Folder() as folder:
        found = match(folder, make_job(sizes), [*single, single[1]])
        hold_constant("equal_peaks", found, "E", YOUNG, 3e-3)
        hold_constant("equal_peaks", found, "nu", NU, 0.01)


def rubber():
    """Poisson's ratio 0.49: inside the range of solids, and not taken for a wrong shape."""
    sizes = (0.08, 0.05, 0.03)
    with Folder() as folder:
        found = match(folder, make_job(sizes, 9e6, 0.47, 1100.0, 3000), find_hz(sizes, 14, (10e6, 0.49), 1100.0, (14, 12, 10)))
        hold_constant("rubber", found, "E", 10e6, 5e-3)
        hold_constant("rubber", found, "nu", 0.49, 0.005)
        hold("rubber", found["is_wrong_shape"], 0, "taken for a wrong shape")


def auxetic():
    """A foam that grows wider when it is pulled: Poisson's ratio -0.3."""
    sizes = (0.08, 0.05, 0.03)
    with Folder() as folder:
        found = match(folder, make_job(sizes, 2e6, -0.2, 80.0, 3000), find_hz(sizes, 14, (1.8e6, -0.3), 80.0, (14, 12, 10)))
        hold_constant("auxetic", found, "E", 1.8e6, 5e-3)
        hold_constant("auxetic", found, "nu", -0.3, 0.01)
        hold("auxetic", found["is_wrong_shape"], 0, "taken for a wrong shape")


def spruce():
    """Nine constants, each 10 to 20 % off in the job; those that are resolved are right."""
    sizes = (0.12, 0.09, 0.02)
    young, shear, nu = [10.8e9, 0.84e9, 0.46e9], [0.69e9, 0.032e9, 0.66e9], [0.372, 0.435, 0.467]
    modes = find_hz(sizes, 20, (*young, *shear, *nu), 400.0, (14, 12, 8))
    off = np.exp(np.random.default_rng(4).choice([-1, 1], 6) * np.random.default_rng(5).uniform(0.1, 0.2, 6))
    job = make_job(sizes, nodes=4000)
    start = {"young_modulus_pa": list(young * off[:3]), "shear_modulus_pa": list(shear * off[3:]), "poisson_ratio": nu}
    job["material"] = {"orthotropic": start, "density_kg_m3": 400.0, **LAW}
    with Folder() as folder:
        found = match(folder, job, modes)
        names = {"E1": young[0], "E2": young[1], "G12": shear[0]}
        for name, truth in names.items():
            hold_constant("spruce", found, name, truth, 0.03)
        truths = dict(zip(("E1", "E2", "E3", "G12", "G23", "G13"), [*young, *shear]))
        over = [abs(c["value"] - truths[n]) / c["sd"] for n, c in found["constants"].items() if c["sd"] and n in truths]
        hold("spruce", max(over), 3, "worst error of a resolved modulus over its deviation")


def false_peaks():
    """A plate of spruce, three of sixteen modes lost and four peaks false: several assignments fit, the right one fits best."""
    sizes = (0.3, 0.2, 0.006)
    young, shear, nu = [13.5e9, 0.99e9, 0.77e9], [0.837e9, 0.1e9, 0.84e9], [0.38, 0.45, 0.4]
    modes = find_hz(sizes, 16, (*young, *shear, *nu), 500.0, (16, 14, 5))
    job = make_job(sizes, nodes=3000)
    start = {"young_modulus_pa": [12.5e9, 1.1e9, 0.7e9], "shear_modulus_pa": [0.9e9, 0.1e9, 0.75e9], "poisson_ratio": nu}
    job["material"] = {"orthotropic": start, "density_kg_m3": 500.0, **LAW}
    for seed in (1, 3):
        random = np.random.default_rng(seed)
        kept = random.permutation(modes)[3:]
        with Folder() as folder:
            found = match(folder, job, [*kept, *np.exp(random.uniform(*np.log([0.9 * modes[0], 1.05 * modes[-1]]), 4))])
        for name, truth in {"E1": young[0], "E2": young[1], "G12": shear[0]}.items():
            hold_constant("false_peaks", found, name, truth, 0.03, f"draw {seed}")


def find_sphere(radius_m, young, nu, density, count):
    """(count) frequencies [Hz] of a free sphere, each multiplet once (Lamb 1882; Eringen and Suhubi 1975, 8.13)."""
    shear = np.sqrt(young / 2 / (1 + nu) / density)
    ratio = np.sqrt((1 - 2 * nu) / (2 - 2 * nu))  # of shear to pressure waves
    j = scipy.special.spherical_jn

    def toroidal(n, b):
        return (n - 1) * j(n, b) - b * j(n + 1, b)

    def spheroidal(n, b):
        a = ratio * b
        if n == 0:
            return (b**2 / 2) * j(0, a) - 2 * a * j(1, a)
        inner = (n * n - n - b * b / 2) * j(n, a) + 2 * a * j(n + 1, a), n * (n + 1) * ((n - 1) * j(n, b) - b * j(n + 1, b))
        outer = (n - 1) * j(n, a) - a * j(n + 1, a), (n * n - 1 - b * b / 2) * j(n, b) + b * j(n + 1, b)
        return inner[0] * outer[1] - inner[1] * outer[0]

    grid, roots = np.linspace(0.8, 12, 3000), []
    for calc, first in ((toroidal, 1), (spheroidal, 0)):
        for n in range(first, 8):
            values = [calc(n, b) for b in grid]
            for k in np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:])):
                roots.append(scipy.optimize.brentq(lambda b: calc(n, b), grid[k], grid[k + 1]))
    return np.sort(roots)[:count] * shear / radius_m / 2 / np.pi


def sphere():
    """Multiplets of three to nine equal modes, each heard as one peak."""
    peaks = find_sphere(0.03, YOUNG, NU, DENSITY, 7)
    job = make_job(BAR) | {"body": {"shape": "sphere", "radius_m": 0.03, "nodes": 2000}}
    with Folder() as folder:
        found = match(folder, job, peaks)
        hold_constant("sphere", found, "E", YOUNG, 3e-3)
        hold_constant("sphere", found, "nu", NU, 0.01)


def strangers():
    """Peaks of another body: never constants without a word."""
    with Folder() as folder:
        found = match(folder, make_job(BAR), find_sphere(0.03, YOUNG, NU, DENSITY, 7))
        warning = "Do not use these constants" if found["is_wrong_shape"] else "check sizes"
        hold_refusal("strangers", " ".join(found["notes"]), [warning])


def hold_sound(case, samples, part="", notes=(), tan_phi=TAN_PHI, sizes=BAR, bound=2e-3, loss=0.05):
    with Folder() as folder:
        found = match(folder, make_job(sizes), samples)
        hold_constant(case, found, "E", YOUNG, bound, part)
        hold(case, sum(peak["mode"] is None for peak in found["peaks"]), 0, f"{part} peaks that are no modes".strip())
        law = found["law"].get("internal_friction", {}).get("tan_phi")
        if loss:
            assert law, found["law"]
            hold(case, abs(law / tan_phi - 1), loss, f"{part} tan phi".strip())
        if notes:
            hold_refusal(case, " ".join(found["notes"]), notes, part)
        return found


def hum():
    """Mains hum three times as loud as the strike, with its harmonics to 1 kHz."""
    samples = strike(find_hz(BAR, 10))
    time_s = np.arange(len(samples)) / RATE
    for k in range(1, 21):
        samples += 3 / k * np.sin(2 * np.pi * 50 * k * time_s + k)
    hold_sound("hum", samples, notes=["mains hum", "left out"])


def double_strike():
    """A second, louder blow 60 ms after the first, and a third in its tail."""
    first = strike(find_hz(BAR, 10))
    samples = first.copy()
    for late, size in ((0.06, 1.5), (0.9, 0.3)):
        shift = round(late * RATE)
        samples[shift:] += size * first[:-shift]
    hold_sound("double_strike", samples, notes=["strikes"])


def beating_pair():
    """A square bar filed on one side: two modes 0.5 Hz apart, which decay before they have beaten once."""
    modes = find_hz((0.2, 0.02, 0.02), 8)
    found = hold_sound("beating_pair", strike([modes[0] - 0.5, *modes[1:]]), sizes=(0.2, 0.02, 0.02), loss=0)
    near = [peak["hz"] for peak in found["peaks"] if abs(peak["hz"] / modes[0] - 1) < 0.01]
    hold("beating_pair", max(max(modes[0] - 0.5 - hz, hz - modes[0], 0) for hz in near), 0.1, "Hz outside the pair")


def dull():
    """A loss factor of 0.02: each mode sounds for a few periods; of 0.1: none stands out."""
    modes = find_hz(BAR, 6)
    hold_sound("dull", strike(modes, 0.02, 0.6, 1e-4), tan_phi=0.02, bound=0.01, loss=0.1)
    with Folder() as folder:
        done = match(folder, make_job(BAR), strike(modes, 0.1, 0.6, 1e-4), code=2)
        hold_refusal("dull", done["error"], ["no tone stands out of the noise"], "loss factor 0.1")


def clipped():
    """The first 30 ms beyond the range of the recorder."""
    samples = strike(find_hz(BAR, 10))
    level = 0.4 * np.abs(samples).max()
    hold_sound("clipped", np.clip(samples, -level, level), notes=["clipped until"])


def no_tone():
    """Noise, hum alone, silence, and a tone that does not decay."""
    random, time_s = np.random.default_rng(3), np.arange(RATE) / RATE
    sounds = {
        "noise": random.normal(size=RATE),
        "hum alone": np.sin(2 * np.pi * 50 * time_s) + 0.3 * np.sin(2 * np.pi * 150 * time_s) + 1e-3 * random.normal(size=RATE),
        "a steady tone": np.sin(2 * np.pi * 1234 * time_s) + 1e-3 * random.normal(size=RATE),
    }
    with Folder() as folder:
        for part, samples in sounds.items():
            done = match(folder, make_job(BAR), samples, code=2)
            hold_refusal("no_tone", done["error"], ["stands out of the noise", "record a strike"], part)
        done = match(folder, make_job(BAR), np.zeros(RATE), code=2)
        hold_refusal("no_tone", done["error"], ["silent"], "silence")


CASES = [
    one_peak,
    equal_peaks,
    rubber,
    auxetic,
    spruce,
    false_peaks,
    sphere,
    strangers,
    hum,
    double_strike,
    beating_pair,
    dull,
    clipped,
    no_tone,
]

if __name__ == "__main__":
    {case.__name__: case for case in CASES}[sys.argv[1]]()
