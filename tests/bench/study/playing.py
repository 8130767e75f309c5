"""Section: runtime settings. Each is varied alone: error of the sound against CPU per second of sound. The most accurate setting is the
reference."""
import dataclasses

import banks
import plots
import sounds
from section import Section
from sounds import np

NAME, TITLE = "playing", "Playing: what each knob of the runtime costs and buys"
PROGRAMS = banks.PROGRAMS
EFFECTS = ("modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise", "air_delay", "doppler", "two_ears")
INSTRUCTIONS = ("plain", "sse4", "avx2", "avx512")
SOUND_SPEED = 343.0  # m/s
# Most accurate thresholds of effect selection that a scene may set: reference for selection errors.
STRICTEST = {"planner_db": -150, "quiet_db": 250, "silence_pa": 1e-15}
SOFT_DB = 40.0  # just audible in a living room
BALL = {
    "body": {"shape": "sphere", "radius_m": 0.05},
    "element": "T10",
    "band_hz": [20, 30000],
    "material": {
        "young_modulus_pa": 3e9,
        "poisson_ratio": 0.35,
        "density_kg_m3": 1200,
        "damping": {"internal_friction": {"tan_phi": 0.02}},
    },
}
TILE = {
    "body": {"shape": "plate", "length_m": 0.1, "width_m": 0.1, "thickness_m": 0.008},
    "element": "T10",
    "band_hz": [20, 16000],
    "material": {
        "young_modulus_pa": 60e9,
        "poisson_ratio": 0.22,
        "density_kg_m3": 2400,
        "damping": {"internal_friction": {"tan_phi": 0.004}},
    },
}
SHELF = {
    "body": {"shape": "plate", "length_m": 0.24, "width_m": 0.2, "thickness_m": 0.01},
    "element": "T10",
    "band_hz": [20, 12000],
    "fixed": "y-max",
    "material": {
        "young_modulus_pa": 34.05e9,
        "poisson_ratio": 0.33,
        "density_kg_m3": 2700,
        "damping": {"rayleigh": {"alpha1_s": 1e-6, "alpha2_per_s": 30}},
    },
}


@dataclasses.dataclass(frozen=True)
class Knob:
    """A key of a scene's "quality" (or "sample_rate_hz"), its settings from accurate to cheap, the default and the test scene. physics: it
    affects the motion, and CPU means that of the physics."""

    key: str
    title: str
    settings: tuple
    default: object
    scene: str
    physics: bool = False


KNOBS = (
    Knob(
        "silence_pa",
        "Culling: below this pressure at 1 m a body sleeps",
        (1e-15, 1e-10, 1e-8, "planned", 1e-6, 1e-5, 1e-4, 1e-3, 1e-2),
        "planned",
        "soft",
    ),
    Knob("modes", "Budget: modes that may ring at once", (None, 400, 200, 100, 48, 16), None, "hang"),
    Knob("sample_rate_hz", "Sample rate", (192000, 96000, 48000, 44100, 32000, 22050), 48000, "hang"),
    Knob(
        "planner_db",
        "Effect selection: what changes a body's sound by less is left out",
        (-150, -100, -70, -50, -40, -30, -20, -10),
        -50,
        "chute",
    ),
    Knob("quiet_db", "Effect selection: what is so far below the loudest strike is not heard", (250, 120, 90, 70, 50, 40, 30), 70, "chute"),
    Knob("contact_step_s", "Physics: longest step while bodies touch and move", (1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3), 2.5e-4, "roll", True),
)


@dataclasses.dataclass
class Turn:
    """One setting of a knob."""

    setting: object
    cpu_ms: float
    spread: float
    difference: sounds.Difference | None  # None for the reference


def find_jobs(lab):
    """{name: job} of the moving bodies."""
    grow = lambda job, nodes: job | {"body": job["body"] | {"nodes": nodes // 2 if lab.quick else nodes}}
    return {"tile": grow(TILE, 2000), "shelf": grow(SHELF, 1500), "ball": grow(BALL, 1500)}


def make_hang(lab, bank):
    """Scene: a suspended body is struck three times."""
    return banks.make_scene(lab, bank)


def make_soft(lab, bank):
    """The same scene scaled to a peak level of SOFT_DB with effect selection on, as culling depends on the absolute level."""
    scene = banks.make_scene(lab, bank)
    level = sounds.calc_loudest_db(sounds.play(lab, "soft-level", scene).sound)
    factor = 10 ** ((SOFT_DB - level) / 20)
    return scene | {
        "effects": "auto",
        "strikes": [strike | {"impulse_n_s": [factor * x for x in strike["impulse_n_s"]]} for strike in scene["strikes"]],
    }


def make_roll(lab, paths):
    """Scene: a plastic ball rolls up a slope (tilted gravity, level floor) and is struck meanwhile. No roughness: it is random and restarts
    with every contact, so different steps would draw different profiles."""
    seconds = 0.5 if lab.quick else 0.8
    return {
        "duration_s": seconds,
        "gravity_m_s2": [-1.0, 0, -9.76],
        "ground": {"friction": 0.6},
        "listener": {"position_m": [0, -1, 0.4], "look_at_m": [0, 0, 0]},
        "strikes": banks.make_strikes(paths["ball"], [seconds * share for share in (0.12, 0.44, 0.75)], "ball"),
        "effects": [name for name in EFFECTS if name not in ("roughness", "rolling")],
        "bodies": [
            {
                "name": "ball",
                "bank": str(paths["ball"]),
                "position_m": [-0.2, 0, 0.05],
                "velocity_m_s": [0.6, 0.1, 0],
                "angular_velocity_rad_s": [-2, 12, 0],
                "friction": 0.6,
            }
        ],
    }


def make_chute(lab, paths):
    """Scene: a tile falls on a slanting shelf, slides off onto the floor and comes to rest."""
    return {
        "duration_s": 1.2 if lab.quick else 2.0,
        "ground": {"restitution": 0.3},
        "listener": {"position_m": [0, -1, 0.4], "look_at_m": [0, 0, 0.1]},
        "bodies": [
            {
                "name": "tile",
                "bank": str(paths["tile"]),
                "position_m": [-0.02, 0, 0.32],
                "rotation_deg": [4, 17, 10],
                "restitution": 0.3,
                "friction": 0.2,
            },
            {
                "name": "shelf",
                "bank": str(paths["shelf"]),
                "fixed": True,
                "position_m": [0, 0, 0.2],
                "rotation_deg": [0, 22, 0],
                "restitution": 0.3,
                "friction": 0.2,
            },
        ],
    }


def turn(scene, key, setting):
    """The scene with a knob at a setting; None and "planned" leave it out."""
    if key == "sample_rate_hz":
        return scene | {key: setting}
    quality = dict(scene.get("quality", {}))
    if setting is None or setting == "planned":
        quality.pop(key, None)
    else:
        quality[key] = setting
    return scene | {"quality": quality}


def thin(lab, settings, default):
    """Settings to measure; quick studies take the ends and the default."""
    return tuple(s for n, s in enumerate(settings) if n in (0, len(settings) - 1) or s == default) if lab.quick else settings


def measure_knob(lab, knob, scene, contacts=None):
    """[Turn] of a knob; the first is the most accurate setting, the reference."""
    settings = thin(lab, knob.settings, knob.default)
    scenes = {f"{knob.key}-{number}": turn(scene, knob.key, setting) for number, setting in enumerate(settings)}
    played = list(sounds.play_all(lab, scenes, contacts=None if knob.physics else contacts).values())
    costs = [(one.physics_ms, one.physics_spread) if knob.physics else (one.cpu_ms, one.spread) for one in played]
    return [
        Turn(setting, *costs[number], sounds.compare(played[0].sound, one.sound) if number else None)
        for number, (setting, one) in enumerate(zip(settings, played))
    ]


def measure_effects(lab, scene, contacts):
    """{effects: Turn}: all on, each off alone, and effect selection, with the same contacts."""
    wishes = (
        {"all on": list(EFFECTS)}
        | {f"without {effect}": [name for name in EFFECTS if name != effect] for effect in (EFFECTS[1::3] if lab.quick else EFFECTS)}
        | {"auto": "auto"}
    )
    quality = {"quality": {"silence_pa": 1e-15}}
    scenes = {
        f"effects-{number}": scene | {"effects": wish} | (quality if wish != "auto" else {}) for number, wish in enumerate(wishes.values())
    }
    played = list(sounds.play_all(lab, scenes, contacts=contacts).values())
    return {
        what: Turn(what, one.cpu_ms, one.spread, sounds.compare(played[0].sound, one.sound) if number else None)
        for number, (what, one) in enumerate(zip(wishes, played))
    }


def measure_fall(lab, scene, steps=(2.5e-4, 1e-4)):
    """(Difference, CPU ms of physics of both) of one fall at two physics steps."""
    played = sounds.play_all(lab, {f"fall-{number}": turn(scene, "contact_step_s", step) for number, step in enumerate(steps)}, repeats=1)
    usual, finer = played.values()
    return sounds.compare(usual.sound, finer.sound), usual.physics_ms, finer.physics_ms


# --- kernel against closed form


def calc_sphere_gain(freq_hz, corners):
    """Frequency dependence of the gain of a pulsating sphere of equal area, up to a constant (Pierce 1981, section 4.1)."""
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    return freq_hz / np.hypot(1, 2 * np.pi * freq_hz / SOUND_SPEED * np.sqrt(area / (4 * np.pi)))


def calc_closed_form(bank, strikes, rate_hz, samples):
    """Pressure at 1 m of ideal impulses in double precision, without the runtime's tables:
    sum g (phi . J) e^(-d t) (cos w_d t - d / w_d sin w_d t)."""
    names = (
        "mesh/vertices",
        "mesh/triangles",
        "modes/frequency_hz",
        "modes/corrected_frequency_hz",
        "modes/corrected_decay",
        "modes/radiation_gain",
        "modes/shape_scale",
        "modes/shape",
    )
    arrays = sounds.read_arrays(bank, set(names))
    vertices, triangles, mesh_hz, freq_hz, decay, gain, scale, shape = (arrays[name] for name in names)
    eigenvalue = (2 * np.pi * freq_hz) ** 2
    gain = gain * calc_sphere_gain(freq_hz, vertices[triangles]) / calc_sphere_gain(mesh_hz, vertices[triangles])
    heard = (np.sqrt(eigenvalue) < np.pi * rate_hz) & (decay < 0.9 * np.sqrt(eigenvalue))
    pressure = np.zeros(samples)
    for strike in strikes:
        phi = shape[triangles[strike["triangle"]]].astype(float).mean(axis=0) * scale[:, None]  # centroid of the triangle
        amplitude = gain * (phi @ np.array(strike["impulse_n_s"]))
        first = int(np.ceil(strike["time_s"] * rate_hz - 1e-9))
        time = np.arange(first, samples) / rate_hz - strike["time_s"]
        for a, d, w in zip(amplitude[heard], decay[heard], np.sqrt(eigenvalue[heard] - decay[heard] ** 2)):
            pressure[first:] += a * np.exp(-d * time) * (np.cos(w * time) - d / w * np.sin(w * time))
    return pressure


def measure_kernels(lab, bank):
    """[(instruction set, Turn)] against the closed form, for the instruction sets of this processor. Blows fall between samples; microphone
    1 m from the body's centre."""
    scene = banks.make_scene(
        lab, bank, seconds=1.5 if lab.quick else 4.0, radiation="osg02", effects=["modal"], quality={"silence_pa": 1e-15}
    )
    centre = sounds.read_arrays(bank, {"rigid/centre_m"})["rigid/centre_m"]
    scene["microphones"] = [[float(x) for x in centre + np.array([0.0, 1.0, 0.0])]]
    for number, strike in enumerate(scene["strikes"]):
        strike |= {"duration_s": 0.0, "time_s": (round(strike["time_s"] * 48000) + 0.3 * number) / 48000}
    scenes = {f"kernel-{name}": scene | {"quality": scene["quality"] | {"instructions": name}} for name in INSTRUCTIONS}
    played = sounds.play_all(lab, scenes)
    truth = None
    rows = []
    for name in INSTRUCTIONS:
        one = played[f"kernel-{name}"]
        if one.report["instructions"] != name:
            continue
        if truth is None:
            truth = sounds.Sound(
                one.sound.rate_hz, calc_closed_form(bank, scene["strikes"], one.sound.rate_hz, len(one.sound.pressure_pa))[:, None]
            )
        rows.append((name, Turn(name, one.cpu_ms, one.spread, sounds.compare(truth, one.sound))))
    return rows


# --- words and tables


HEAD = ("CPU, ms for 1 s", "spread", *sounds.HEAD, "by ear")
DATA = ("cpu_ms_per_s", "cpu_spread", *sounds.DATA)


def to_cells(one):
    apart = one.difference.to_cells() if one.difference else sounds.NO_CELLS
    return (f"{one.cpu_ms:.2f}", f"{100 * one.spread:.0f} %", *apart, banks.describe_verdict(one.difference))


def to_data(one):
    return (one.cpu_ms, one.spread, *(one.difference.to_data() if one.difference else sounds.NO_DATA))


def format_setting(setting):
    return "all" if setting is None else setting if isinstance(setting, str) else f"{setting:g}"


def find_turn(turns, setting):
    return next(one for one in turns if one.setting == setting)


def describe_difference(difference):
    if difference.error_db < sounds.NONE_DB:
        return "does not differ from it"
    return (
        f"differs from it by {sounds.format_db(difference.error_db)} dB(A), {difference.distance_db:.2f} dB in bands and"
        f" {sounds.format_change(difference.loudness_db)} dB in loudness ({banks.describe_verdict(difference)})"
    )


def describe_knob(knob, turns):
    """Compares the default with the most accurate and the loosest inaudible setting."""
    best, usual = turns[0], find_turn(turns, knob.default)
    cheap = None
    for one in turns[1:]:
        if one.difference.is_audible:
            break
        cheap = one
    what = "the physics" if knob.physics else "CPU"
    if usual is best:
        text = f"{knob.title} (`{knob.key}`): the default leaves nothing out, {best.cpu_ms:.2f} ms of {what} for a second"
    else:
        text = (
            f"{knob.title} (`{knob.key}`): the default, {format_setting(knob.default)}, takes {usual.cpu_ms:.2f} ms of {what} for a second"
            f" where the most accurate one, {format_setting(best.setting)}, takes {best.cpu_ms:.2f}, and"
            f" {describe_difference(usual.difference)}"
        )
    if cheap is None:
        return text + "; every looser setting differs audibly."
    if cheap is usual:
        return text + "; it is the loosest that does not differ audibly."
    return (
        text + f"; the loosest that does not differ audibly is {format_setting(cheap.setting)}, {cheap.cpu_ms:.2f} ms,"
        f" {sounds.format_db(cheap.difference.error_db)} dB(A)."
    )


def add_knob(section, knob, turns):
    section.add_table(
        knob.key,
        [
            (knob.key, *HEAD),
            *((format_setting(one.setting) + (" (default)" if one.setting == knob.default else ""), *to_cells(one)) for one in turns),
        ],
        f"{knob.title}. Scene: {knob.scene}.",
        [(knob.key, *DATA), *((format_setting(one.setting), *to_data(one)) for one in turns)],
    )
    section.conclude(describe_knob(knob, turns))


def add_effects(section, effects):
    section.add_table(
        "effects",
        [("effects", *HEAD), *((what, *to_cells(one)) for what, one in effects.items())],
        "Everything on against each effect left out by itself and against the choice of effect selection; the same contacts in all."
        " Scene: chute.",
        [("effects", *DATA), *((what, *to_data(one)) for what, one in effects.items())],
        in_docs=True,
    )
    audible = [what.removeprefix("without ") for what, one in effects.items() if what.startswith("without") and one.difference.is_audible]
    inaudible = [
        what.removeprefix("without ") for what, one in effects.items() if what.startswith("without") and not one.difference.is_audible
    ]
    whole, auto = effects["all on"], effects["auto"]
    parts = ([f"{', '.join(audible)} {'is' if len(audible) == 1 else 'are'} missed when left out"] if audible else []) + (
        [f"{', '.join(inaudible)} {'is' if len(inaudible) == 1 else 'are'} not"] if inaudible else []
    )
    section.conclude(
        f"In the chute {'; '.join(parts)}. What effect selection chooses takes {100 * auto.cpu_ms / max(whole.cpu_ms, 1e-9):.0f} % of the"
        f" CPU of everything on and differs by {sounds.format_db(auto.difference.error_db)} dB(A)"
        f" ({banks.describe_verdict(auto.difference)})."
    )


def add_kernels(section, rows):
    section.add_table(
        "kernel",
        [("instructions", *HEAD), *((name, *to_cells(one)) for name, one in rows)],
        "Single-precision tables with a double-precision state against the closed form in double precision (numpy), by instruction set.",
        [("instructions", *DATA), *((name, *to_data(one)) for name, one in rows)],
    )
    worst, fastest = max(rows, key=lambda row: row[1].difference.error_db), min(rows, key=lambda row: row[1].cpu_ms)
    slowest = max(rows, key=lambda row: row[1].cpu_ms)
    section.conclude(
        f"Single precision in the kernel is {abs(worst[1].difference.error_db):.0f} dB(A) below the sound or better with every instruction"
        f" set that this processor has ({', '.join(name for name, _ in rows)}); {fastest[0]} takes {fastest[1].cpu_ms:.2f} ms for a second"
        f" of sound, {slowest[0]} {slowest[1].cpu_ms:.2f} ms."
    )


def add_chart(section, measured):
    panels, rows = [], [("knob", "setting", *DATA)]
    for knob, turns in measured:
        points = [(one.cpu_ms, one.difference.error_db) for one in turns[1:] if one.difference.error_db > sounds.NONE_DB]
        rows += [(knob.key, format_setting(one.setting), *to_data(one)) for one in turns]
        if not points:
            continue  # no setting differs
        panels.append(
            plots.Panel(
                knob.key,
                f"{'physics' if knob.physics else 'CPU'}, ms for a second",
                "error, dB(A)",
                {"settings": points},
                levels=[(sounds.ERROR_LIMIT_DB, "-40 dB: inaudible below")],
                x_log=False,
                y_log=False,
            )
        )
    section.add_chart(
        "knobs",
        plots.draw_panels(panels, "Each knob by itself", "error against the most accurate setting, and the CPU of a second of sound", 3),
        "Error of the sound against CPU, setting by setting.",
        rows,
    )


def study(lab, bodies):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    soundings = banks.find_soundings(lab, bodies)
    paths = banks.solve(lab, soundings + [banks.Sounding(name, name, job) for name, job in find_jobs(lab).items()])
    hung = max(paths, key=lambda name: banks.count_modes(paths[name]))
    scenes = {
        "hang": make_hang(lab, paths[hung]),
        "soft": make_soft(lab, paths[hung]),
        "roll": make_roll(lab, paths),
        "chute": make_chute(lab, paths),
    }
    contacts = lab.out / "work/sounds/chute.jsonl"
    sounds.play(lab, "record", scenes["chute"] | {"effects": list(EFFECTS)}, record=contacts)
    section.say(
        f"Four scenes. hang: the {hung} hangs still, struck three times; soft: so softly that it is {SOFT_DB:.0f} dB(A). roll: a ball rolls"
        " up a slope, struck three times. chute: a tile falls on a slanting shelf, slides off it and onto the floor; what happens is"
        " recorded once, and each setting plays the same contacts. Each knob is turned by itself; the reference is its most accurate"
        " setting."
    )
    add_kernels(section, measure_kernels(lab, paths[hung]))
    measured = []
    for knob in KNOBS:
        measured.append((knob, measure_knob(lab, knob, make_base(knob, scenes[knob.scene]), contacts if knob.scene == "chute" else None)))
        add_knob(section, *measured[-1])
    if not lab.quick:
        fall, usual_ms, finer_ms = measure_fall(lab, scenes["chute"])
        section.conclude(
            f"Where bodies bounce and tumble: the chute simulated again at 0.0001 s instead of 0.00025 s ({finer_ms:.0f} ms of the physics"
            f" for a second instead of {usual_ms:.0f}) differs by {sounds.format_db(fall.error_db)} dB(A), {fall.distance_db:.2f} dB in"
            f" bands and {sounds.format_change(fall.loudness_db)} dB in loudness: "
            + ("another fall, as good as the first." if fall.is_audible else "the same fall to the ear.")
        )
    add_effects(section, measure_effects(lab, scenes["chute"], contacts))
    add_chart(section, measured)
    section.say(describe_defaults(measured))
    lab.found[NAME] = measured
    return section


def make_base(knob, scene):
    """Settings that accompany a knob: effect selection for its own knobs."""
    if knob.scene == "chute":
        return scene | {"quality": {key: value for key, value in STRICTEST.items() if key != knob.key}}
    if knob.physics:
        return scene | {"quality": {"silence_pa": 1e-15}}
    return scene


def find_defaults(measured):
    """[(key, default, error in dB(A), distance in dB)]: basis of the defaults."""
    out = []
    for knob, turns in measured:
        usual = find_turn(turns, knob.default).difference
        out.append((knob.key, format_setting(knob.default), usual.error_db if usual else -300.0, usual.distance_db if usual else 0.0))
    return out


def describe_defaults(measured):
    audible = [f"`{knob.key}`" for knob, turns in measured if (usual := find_turn(turns, knob.default).difference) and usual.is_audible]
    kept = [f"`{knob.key}` {format_setting(knob.default)}" for knob, turns in measured if f"`{knob.key}`" not in audible]
    return f"Defaults that do not differ audibly from the most accurate setting: {', '.join(kept) or 'none'}." + (
        f" Defaults that do: {', '.join(audible)}." if audible else ""
    )
