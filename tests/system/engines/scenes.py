"""Scenes for our own contact and for other engines, and the comparison of their sound."""
import json
import math
import pathlib
import subprocess

import numpy as np

FRICTION, RESTITUTION = 0.4, 0.5  # of every body
IN_EFFECT = {"rod": 0.37}  # of engines: in our own contact modes take energy of the hits
CHAOTIC = ("box", "tube", "two", "pile", "bar", "slap", "rod", "row", "bead", "drop")
# Further starts to each side, and their distance [m]. Single bounces are chaotic: a frequency changed by 1e-9 moves medians of the pile
# and the rod by 2 dB over 13 starts, by 0.5 dB over 49. The rod's level while it rolls differs by up to 5 dB between starts of our own.
STARTS = {"tube": (6, 5e-4), "slap": (6, 5e-4), "row": (6, 5e-4), "bead": (6, 5e-4), "rod": (24, 1.25e-4), "pile": (24, 1.25e-4)}
PLAYED_WHOLE = {"rod": 6}  # every sixth start; of other scenes the first only


def get_starts(name):
    """Offsets of the further starts of a scene [m]."""
    count, apart_m = STARTS.get(name, (1, 1e-3)) if name in CHAOTIC else (0, 0.0)
    return tuple(sign * apart_m * k for k in range(1, count + 1) for sign in (1, -1))


BOX, BALL, TUBE = [0.06, 0.04, 0.025], [0.03, 0.03, 0.03], [0.075, 0.02, 0.02]
BEAD, PANE, BAR, ROD = [0.008] * 3, [0.1, 0.075, 0.002], [0.1, 0.01, 0.006], [0.08, 0.005, 0.005]
BANKS = {
    "box": {
        "body": {"shape": "hollow-box", "length_m": 0.12, "width_m": 0.08, "height_m": 0.05, "wall_m": 0.003, "nodes": 4000},
        "material": {"young_modulus_pa": 12.6e9, "poisson_ratio": 0.35, "density_kg_m3": 700, "damping": 0.01},
    },
    "ball": {
        "body": {"shape": "sphere", "radius_m": 0.03, "wall_m": 0.002, "nodes": 5000},
        "material": {"young_modulus_pa": 1e11, "poisson_ratio": 0.34, "density_kg_m3": 8500, "damping": 0.0005},
    },
    "tube": {
        "body": {"shape": "tube", "length_m": 0.15, "outer_radius_m": 0.02, "wall_m": 0.002, "nodes": 5000},
        "material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": 0.001},
    },
    "bead": {
        "body": {"shape": "sphere", "radius_m": 0.008, "nodes": 1500},
        "material": {"young_modulus_pa": 2.1e11, "poisson_ratio": 0.29, "density_kg_m3": 7850, "damping": 0.0005},
    },
    "pane": {
        "body": {"shape": "plate", "length_m": 0.2, "width_m": 0.15, "thickness_m": 0.004, "nodes": 3000},
        "material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.22, "density_kg_m3": 2500, "damping": 0.002},
    },
    "bar": {
        "body": {"shape": "bar", "length_m": 0.2, "width_m": 0.02, "thickness_m": 0.012, "nodes": 2000},
        "material": {"young_modulus_pa": 7e10, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": 0.0005},
    },
    "rod": {
        "body": {"shape": "cylinder", "length_m": 0.16, "radius_m": 0.005, "nodes": 2500},
        "material": {"young_modulus_pa": 1e11, "poisson_ratio": 0.34, "density_kg_m3": 8500, "damping": 0.0005},
    },
}


SOLIDS = {"bead": "ball", "pane": "box", "bar": "box", "rod": "tube"}  # shapes of the engines, others by their own names


def solve_banks(programs, folder):
    for name, job in BANKS.items():
        material = {**job["material"], "damping": {"internal_friction": {"tan_phi": job["material"]["damping"]}}}
        file = folder / f"{name}-job.json"
        file.write_text(json.dumps({"body": job["body"], "material": material, "band_hz": [20, 20000], "bank": f"{name}.h5"}))
        run(programs / "carillon-precompute", "-q", file.name, cwd=folder)


def place(name, kind, half, position, turns=(0, 0, 0), velocity=(0, 0, 0), spin=(0, 0, 0), moved=(0, 0, 1)):
    """A body; turns in degrees about the fixed axes x, y, z. `moved`: direction in which further starts move it."""
    return dict(name=name, kind=kind, half=half, position=position, turns=turns, velocity=velocity, spin=spin, moved=moved)


def make_pile(count, spread):
    boxes = []
    for i in range(count):
        column, level = i % spread**2, i // spread**2
        x, y = (0.02 * (i % 3) - 0.02, 0.015 * (i % 2)) if spread == 1 else (0.14 * (column % spread), 0.14 * (column // spread))
        boxes.append(place(f"b{i}", "box", BOX, (x, y, 0.1 + 0.15 * level), (17 * i, 29 * i, 41 * i)))
    return boxes


ROW = (("a", -0.2, 0.6, (1, 0, 0)), ("b", 0.0, 0.0, (0, 0, 0)), ("c", 0.061, 0.0, (0, 0, 0)))  # name, place [m], speed [m/s], moved

# Name: seconds and bodies.
SCENES = {
    "box": (3, [place("box", "box", BOX, (0, 0, 0.3), (30, 40, 0), spin=(2, 5, 1))]),
    "slide": (2, [place("box", "box", BOX, (0, 0, 0.025), velocity=(1.5, 0, 0))]),
    "ball": (3, [place("ball", "ball", BALL, (-0.6, 0, 0.03), velocity=(0.5, 0, 0), spin=(0, 0.5 / 0.03, 0))]),
    "tube": (3, [place("tube", "tube", TUBE, (0, -0.5, 0.05), velocity=(0, 0.4, 0))]),
    "two": (2, [place("a", "ball", BALL, (-0.1, 0, 0.5), velocity=(1, 0, 0)), place("b", "ball", BALL, (0, 0, 0.5))]),
    "pile": (3.5, make_pile(10, 1)),
    # The tracker's constants were chosen on the six above; bar, rod and pane changed rules.
    "bar": (4.5, [place("bar", "bar", BAR, (0, 0, 0.25), (0, 75, 0), velocity=(0.2, 0, 0))]),
    "slap": (3, [place("pane", "pane", PANE, (0, 0, 0.11), (0, 25, 0))]),
    "rod": (2, [place("rod", "rod", ROD, (0, -0.3, 0.1), (0, 12, 0), velocity=(0, 0.3, 0))]),
    "row": (1, [place(n, "ball", BALL, (x, 0, 0.03), velocity=(v, 0, 0), spin=(0, v / 0.03, 0), moved=m) for n, x, v, m in ROW]),
    "bead": (2, [place("pane", "pane", PANE, (0, 0, 0.002), moved=(0, 0, 0)), place("bead", "bead", BEAD, (0.045, 0.03, 0.2))]),
    "flat": (2, [place("box", "box", BOX, (0, 0, 0.1))]),
    "side": (2, [place("box", "box", BOX, (0, 0, 0.2), (90, 0, 0))]),
    "drop": (1, [place("ball", "ball", BALL, (0, 0, 0.2), spin=(0, 10, 0))]),
}


def run(*command, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, **options)
    if done.returncode != 0:
        raise SystemExit(f"{command[0]} failed ({done.returncode}): {done.stdout}{done.stderr}")
    return done.stdout


def calc_quaternion(turns):
    """w x y z of turns [degrees] about the fixed axes x, then y, then z."""
    q = np.array([1.0, 0, 0, 0])
    for axis, angle in enumerate(turns):
        half = math.radians(angle) / 2
        v = np.zeros(3)
        v[axis] = math.sin(half)
        w = math.cos(half)
        q = np.concatenate([[w * q[0] - v @ q[1:]], w * q[1:] + q[0] * v + np.cross(v, q[1:])])
    return q


def format_solids(bodies):
    lines = []
    for b in bodies:
        numbers = [*b["half"], *b["position"], *calc_quaternion(b["turns"]), *b["velocity"], *b["spin"]]
        numbers.append(IN_EFFECT.get(b["kind"], RESTITUTION))
        lines.append(f"{b['name']} {SOLIDS.get(b['kind'], b['kind'])} {b['kind']}.h5 " + " ".join(f"{x:.17g}" for x in numbers))
    return "\n".join(lines) + "\n"


def write_scene(file, seconds, bodies):
    scene = {
        "duration_s": seconds,
        "ground": {"restitution": RESTITUTION},
        "listener": {"position_m": [0, -1, 0.4]},
        "effects": ["modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "air_delay", "doppler", "two_ears"],
        "output": {"format": "float", "gain": 1e-3, "fade_end": False},
        "bodies": [
            {
                "name": b["name"],
                "bank": f"{b['kind']}.h5",
                "position_m": b["position"],
                "quaternion": list(calc_quaternion(b["turns"])),
                "velocity_m_s": b["velocity"],
                "angular_velocity_rad_s": b["spin"],
                "restitution": RESTITUTION,
                "friction": FRICTION,
            }
            for b in bodies
        ],
    }
    file.write_text(json.dumps(scene))


def read_wav(file):
    """(frames, 2) in Pa of a WAV file of floats with gain 1e-3."""
    data = pathlib.Path(file).read_bytes()
    at = data.index(b"data")
    size = int.from_bytes(data[at + 4 : at + 8], "little")
    return np.frombuffer(data[at + 8 : at + 8 + size], dtype="<f4").reshape(-1, 2) * 1e3


def render(programs, folder, scene, contacts=None):
    """Sound of the left ear [Pa] at 48 kHz."""
    words = ["--contacts", contacts] if contacts else []
    run(programs / "carillon-render", "-q", f"{scene}.json", "-o", "sound.wav", *words, cwd=folder)
    return read_wav(folder / "sound.wav")[:, 0].astype(float)


def calc_levels(sound, rate=48000, window_s=0.125):
    """A-weighted levels [dB(A)] of windows, at least -120."""
    n = int(window_s * rate)
    f = np.fft.rfftfreq(n, 1 / rate)
    f2 = f * f
    weight = 12194**2 * f2**2 / ((f2 + 20.6**2) * np.sqrt((f2 + 107.7**2) * (f2 + 737.9**2)) * (f2 + 12194**2)) * 1.2589
    power = [2 * (abs(np.fft.rfft(sound[b : b + n]) * weight) ** 2).sum() / n**2 for b in range(0, len(sound) - n + 1, n)]
    return np.array([max(-120.0, 10 * math.log10(p / 4e-10 + 1e-30)) for p in power])


def find_first_hit(sound, rate=48000):
    """Peak [Pa] and centroid of the spectrum [Hz] of the first 10 ms of the first hit; the other end of the rod follows after 15 ms. Peak:
    after 8-fold interpolation, as a period at 14 kHz has only 3.4 samples."""
    begin = np.argmax(abs(sound) > 0.05 * abs(sound[: rate // 2]).max())
    part = sound[begin : begin + rate // 100]
    spectrum = np.fft.rfft(part)
    power = abs(spectrum) ** 2
    wave = 8 * np.fft.irfft(spectrum, 8 * len(part))
    return abs(wave).max(), (power * np.fft.rfftfreq(len(part), 1 / rate)).sum() / power.sum()


def read_counters(output):
    """Counters of the last line; Debian's Simbody logs its time stepper in those before."""
    return json.loads(output.splitlines()[-1])


def count_lost(programs, folder, engine, name, hz):
    """Events that were lost or late while an engine's scene played live, as far behind the physics as its mark says."""
    seconds, bodies = SCENES[name]
    output = run(programs / f"engine_{engine}", hz, seconds, "live.jsonl", "live.f32", cwd=folder, input=format_solids(bodies))
    return read_counters(output)["lost"]


def find_length(name, number):
    """Seconds to play of a start; number 0 is the first."""
    is_whole = number % PLAYED_WHOLE[name] == 0 if name in PLAYED_WHOLE else number == 0
    return SCENES[name][0] if is_whole else 0.5


def move_bodies(bodies, offset_m):
    return [{**b, "position": tuple(x + offset_m * m for x, m in zip(b["position"], b["moved"]))} for b in bodies]


def render_own(programs, folder, name):
    """Sounds of a scene by our own contact: of its start, and of the further ones."""
    bodies = SCENES[name][1]
    sounds = []
    for offset_m in (0.0, *get_starts(name)):
        write_scene(folder / f"{name}.json", find_length(name, len(sounds)), move_bodies(bodies, offset_m))
        sounds.append(render(programs, folder, name))
    return sounds


def play(programs, folder, engine, name, hz, offset_m=0.0, seconds=None, way="given", max_impacts=8):
    """Counters and sound of an engine's scene."""
    whole, bodies = SCENES[name]
    seconds, bodies = seconds or whole, move_bodies(bodies, offset_m)
    write_scene(folder / f"{name}.json", seconds, bodies)
    words = [hz, seconds, "contacts.jsonl", "-", max_impacts, way]
    output = run(programs / f"engine_{engine}", *words, cwd=folder, input=format_solids(bodies))
    return read_counters(output), render(programs, folder, name, "contacts.jsonl")


def calc_momentum(programs, folder, engine, hz):
    """Distance of the pulse of a steel ball that bounces from the engine's impulse [%], which may include the weight of the steps in which
    the ball touches."""
    seconds, file = 0.25, folder / "fall.jsonl"
    bodies = [place("bead", "bead", BEAD, (0, 0, 0.1))]
    counters = read_counters(
        run(programs / f"engine_{engine}", hz, seconds, file.name, "-", 0, "given", cwd=folder, input=format_solids(bodies))
    )
    assert counters["limited"] == 0 and counters["hits"] == 1, counters
    given = 0.0
    for line in file.read_text().splitlines():
        event = json.loads(line)
        given += event["impulse"]["impulse_n_s"][2] if "impulse" in event else 0.0
    weight = counters["mass_kg"] * 9.81 * counters["points"] * seconds / counters["steps"]
    pushed = counters["pushed_n_s"]
    return 100 * max(pushed - weight - given, given - pushed, 0.0) / pushed


def find_differences(sound, own):
    """Of the windows of the first half second that are above 60 dB(A) in our own contact [dB]."""
    levels, wanted = calc_levels(sound)[:4], calc_levels(own)[:4]
    return list(abs(levels - wanted)[wanted > 60.0])


def compare_ways(programs, folder, engine, name, hz):
    """Impulses found from velocities, and hits reported early, against the ordinary way: largest difference of windows above 60 dB(A) [dB],
    and that of the first hit [dB]."""
    given = play(programs, folder, engine, name, hz)[1]
    found = play(programs, folder, engine, name, hz, way="found")[1]
    early = play(programs, folder, engine, name, hz, way="early")[1]
    loud = calc_levels(given) > 60.0
    return {
        "found_db": float(abs(calc_levels(found) - calc_levels(given))[loud].max()),
        "early_db": 20 * math.log10(find_first_hit(early)[0] / find_first_hit(given)[0]),
    }


def compare(programs, folder, engine, name, hz, own):
    """An engine's scene at a step against our own contact, whose sounds are `own` (render_own): counters, and differences of the first hit
    (level and centroid), the median of the windows of the first half second above 60 dB(A) of all starts, and that of all windows from
    0.25 s to 2 s of the starts played whole; the level of the last 0.5 s; all levels."""
    counters, sound = play(programs, folder, engine, name, hz)
    levels, wanted = calc_levels(sound), calc_levels(own[0])
    peak, centroid = find_first_hit(sound)
    own_peak, own_centroid = find_first_hit(own[0])
    windows = find_differences(sound, own[0])
    differences = [abs(levels - wanted)[2:16]]
    for number, offset_m in enumerate(get_starts(name), 1):
        seconds = find_length(name, number)
        other = play(programs, folder, engine, name, hz, offset_m, seconds)[1]
        windows += find_differences(other, own[number])
        if seconds == SCENES[name][0]:
            differences.append(abs(calc_levels(other) - calc_levels(own[number]))[2:16])
    return {
        **counters,
        "first_db": 20 * math.log10(peak / own_peak),
        "centroid_percent": 100 * (centroid / own_centroid - 1),
        "windows_db": float(np.median(windows)) if windows else 0.0,
        "quiet_db": float(np.median(np.concatenate(differences))),
        "end_db": float(levels[-4:].max()),
        "levels": levels,
    }
