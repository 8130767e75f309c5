"""Energy received by a closed sphere of microphones around a struck body, against the energy lost by radiation damping."""
import json
import math
import subprocess

import air
import numpy as np
import scipy.io.wavfile

MODES, RADII, DURATION_S, IMPULSE_N_S, MOST_MICROPHONES = 12, 50, 2.0, 1e-3, 16
STRIKE_S = 639 / 48000  # in the last sample of a block: the books of --audit begin at the next one


def make_sphere(order):
    """Directions (n, 3) and weights whose sum is 4 pi: exact for the square of a field of this order."""
    z, weight = np.polynomial.legendre.leggauss(order + 1)
    around = 2 * order + 2
    angle = 2 * math.pi * np.arange(around) / around
    z, angle, weight = np.repeat(z, around), np.tile(angle, order + 1), np.repeat(weight * 2 * math.pi / around, around)
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z]), weight


def choose_strike(here):
    """The triangle outside that gives the modes the most even energies, and its inward normal."""
    size = np.linalg.norm(here.normal_m2, axis=1)
    inward = -here.normal_m2 / size[:, None]
    motion = np.einsum("tmi,ti->tm", here.shape[here.skin].mean(axis=1), inward)
    evenness = np.log(np.maximum(motion**2, 1e-30)).sum(axis=1)
    best = int(evenness.argmax())
    return here.vertices_m[here.skin[best]].mean(axis=0), inward[best], motion[best]


def measure(programs, bank, folder, name):
    """A row: energies in J. `bank` has multipoles; its lowest modes are struck by an ideal impulse.
    taken_j: of each mode's q'^2 / 2 the share of the decay by radiation in all its decay, from the bank alone; audit_j: "radiated_j" of
    carillon-render --audit; arrived_j: p^2 / (rho c) over the sphere and time, at 50 radii."""
    small = folder / f"energy-{name}.hdf"
    edit = [programs / "carillon-bank", "edit", bank, small, "--modes", str(MODES), "--keep", "lowest"]
    if small.exists():
        small.unlink()
    subprocess.run(edit, check=True, capture_output=True)
    here = air.Air(small)
    place_m, inward, motion = choose_strike(here)
    given_j = 0.5 * (IMPULSE_N_S * motion) ** 2
    decay_per_s = here.material_per_s + here.decay_per_s
    distance_m = RADII * here.radius_m
    heard_s = DURATION_S - STRIKE_S - distance_m / air.SOUND_SPEED_MS
    taken_j = given_j * here.decay_per_s / decay_per_s * -np.expm1(-2 * decay_per_s * heard_s)
    directions, weights = make_sphere(int(here.order.max()))
    arrived_j, radiated_j = 0.0, 0.0
    for first in range(0, len(directions), MOST_MICROPHONES):
        chosen = slice(first, first + MOST_MICROPHONES)
        scene = {
            "duration_s": DURATION_S,
            "bodies": [{"name": "body", "bank": small.name, "fixed": True}],
            "strikes": [{"time_s": STRIKE_S, "body": "body", "point_m": place_m.tolist(), "impulse_n_s": (IMPULSE_N_S * inward).tolist()}],
            "microphones": (here.centre_m + distance_m * directions[chosen]).tolist(),
            "effects": ["modal", "air_delay", "directivity"],
            "output": {"gain": 1e-6, "format": "float", "fade_end": False},
        }
        files = [folder / f"energy-{name}.{ending}" for ending in ("scene.json", "wav", "report.json")]
        files[0].write_text(json.dumps(scene))
        command = [programs / "carillon-render", files[0].name, "-o", files[1].name, "--report", files[2].name, "--audit", "-q"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
        rate_hz, sound = scipy.io.wavfile.read(files[1])
        pressure_pa = sound.astype(float).reshape(len(sound), -1) / 1e-6
        flow_j_m2 = (pressure_pa**2).sum(axis=0) / (rate_hz * air.AIR_DENSITY_KG_M3 * air.SOUND_SPEED_MS)
        arrived_j += float(weights[chosen] @ flow_j_m2) * distance_m**2
        radiated_j = json.loads(files[2].read_text())["energy"]["radiated_j"]
    return {
        "name": name,
        "modes": len(motion),
        "freq_hz": [float(here.freq_hz.min()), float(here.freq_hz.max())],
        "microphones": len(directions),
        "given_j": float(given_j.sum()),
        "decay_per_s": [float(here.decay_per_s.min()), float(here.decay_per_s.max())],
        "taken_j": float(taken_j.sum()),
        "audit_j": radiated_j,
        "arrived_j": arrived_j,
    }
