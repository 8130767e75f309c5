"""Section: sound of Bullet through the contact tracker against our own contact, by steps a second and by knobs of the tracker: impacts with
modes, early hits, impulses that the engine does not give."""
import pathlib
import sys

import measuring
import plots
from section import Section
from sounds import find_spread, np

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "system/engines"))
import scenes

NAME, TITLE = "tracker", "Contact tracker: what the steps of an engine and the tracker's knobs cost and buy"
PROGRAMS = ("carillon-precompute", "carillon-mesh", "carillon-render", "engine_bullet")
SCENES = {"box": "box", "tube": "tube", "pile": "heap of ten boxes"}
QUICK_SCENES = ("box",)
RATES, USUAL_HZ = (60, 240, 1000), 240
# Arguments MAX_IMPACTS and WAY of engine_bullet.
KNOBS = {
    "default": (8, "given"),
    "max_impacts 0": (0, "given"),
    "max_impacts 2": (2, "given"),
    "max_impacts 32": (32, "given"),
    "early": (8, "early"),
    "impulses not given": (8, "found"),
}


def list_settings():
    """[(steps a second, knob)]"""
    return [(hz, "default") for hz in RATES] + [(USUAL_HZ, knob) for knob in KNOBS if knob != "default"]


def play(lab, folder, name, hz, knob, own):
    """{first_db, centroid_percent, windows_db, hits, latest_ms, cpu: of the tracker [CPU s per s]}; `own`: sounds of all starts, or of the
    first alone, without windows_db."""
    max_impacts, way = KNOBS[knob]
    programs = lab.find_program("carillon-render").parent
    again = lambda *start: scenes.play(programs, folder, "bullet", name, hz, *start, way=way, max_impacts=max_impacts)
    counters, sound = again()
    (peak, centroid), (own_peak, own_centroid) = scenes.find_first_hit(sound), scenes.find_first_hit(own[0])
    windows = scenes.find_differences(sound, own[0])
    for offset_m, other in zip(scenes.get_starts(name), own[1:]):
        windows += scenes.find_differences(again(offset_m, 0.5)[1], other)
    return {
        "first_db": float(20 * np.log10(peak / own_peak)),
        "centroid_percent": float(100 * (centroid / own_centroid - 1)),
        "windows_db": float(np.median(windows)),
        "hits": counters["hits"],
        "latest_ms": 1e3 * counters["latest_s"],
        "cpu": counters["tracker_cpu_s"] / scenes.SCENES[name][0],
    }


def measure(lab, names):
    """{(scene, steps a second, knob): (figures, [CPU s per s])}; rounds alternate in direction."""
    folder = lab.out / "work/tracker"
    folder.mkdir(parents=True, exist_ok=True)
    programs = lab.find_program("carillon-render").parent
    if not all((folder / f"{kind}.h5").is_file() for kind in scenes.BANKS):
        scenes.solve_banks(programs, folder)
    own, found = {}, {}
    for name in names:
        own[name] = scenes.render_own(programs, folder, name)
    cases = [(name, *setting) for name in names for setting in list_settings()]
    for number in range(lab.repeats):
        for case in cases if number % 2 == 0 else reversed(cases):
            sounds = own[case[0]]
            figures = play(lab, folder, *case, sounds[:1] if case in found else sounds)  # again for the CPU time alone
            found.setdefault(case, (figures, []))[1].append(figures["cpu"])
        lab.say(f"tracker: round {number + 1} of {lab.repeats}")
    return found


def describe(name, found):
    pick = lambda hz, knob="default": found[name, hz, knob]
    say = lambda hz, knob="default": (
        f"{pick(hz, knob)[0]['windows_db']:.1f} dB for {measuring.find_median(pick(hz, knob)[1]):.2g} CPU s per s"
    )
    rates = ", ".join(f"{say(hz)} at {hz}" for hz in RATES)
    knobs = ", ".join(f"{say(USUAL_HZ, knob)} ({knob})" for knob in KNOBS if knob != "default")
    return f"**{SCENES[name].capitalize()}** by steps a second: {rates}. At {USUAL_HZ} steps: {knobs}."


def study(lab, bodies):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    names = QUICK_SCENES if lab.quick else tuple(SCENES)
    found = measure(lab, names)
    starts = ", ".join(f"{SCENES[name]}: {1 + len(scenes.get_starts(name))}" for name in names)
    section.say(
        "Bodies fall in Bullet (`tests/system/engines/scenes.py`). The tracker makes contacts of its steps, and `carillon-render` plays"
        " them, against the same scene in our own physics. Error: median difference of the levels of windows of 125 ms above"
        f" 60 dB(A) in the first half second, over starts up to 3 mm apart ({starts}), and of the peak of the first hit."
        " A heap differs already by its motion. CPU is of the tracker."
    )
    for name in names:
        section.conclude(describe(name, found))
    head = ("scene", "steps a second", "knob", "windows, dB", "first hit, dB", "centroid, %", "hits", "latest, ms", "CPU s per s", "spread")
    rows, data = [head], [head]
    for (name, hz, knob), (figures, cpu) in found.items():
        numbers = [figures[key] for key in ("windows_db", "first_db", "centroid_percent")]
        late = figures["latest_ms"]
        rows.append(
            (
                SCENES[name],
                hz,
                knob,
                f"{numbers[0]:.1f}",
                f"{numbers[1]:+.1f}",
                f"{numbers[2]:+.0f}",
                figures["hits"],
                f"{late:.0f}",
                f"{measuring.find_median(cpu):.4f}",
                f"{100 * find_spread(cpu):.0f} %",
            )
        )
        data.append((name, hz, knob, *numbers, figures["hits"], late, float(measuring.find_median(cpu)), float(find_spread(cpu))))
    section.add_table(
        "settings",
        rows,
        "Steps of the engine and knobs of the tracker. *latest*: how far the tracker was behind the engine, at most.",
        data,
        in_docs=True,
    )
    panels = []
    for name in names:
        point = lambda hz, knob: (measuring.find_median(found[name, hz, knob][1]), found[name, hz, knob][0]["windows_db"])
        curves = {"60, 240, 1000 steps a second": [point(hz, "default") for hz in RATES]}
        curves |= {f"{USUAL_HZ}, {knob}": [point(USUAL_HZ, knob)] for knob in KNOBS if knob != "default"}
        panels.append(plots.Panel(SCENES[name], "tracker, CPU s per s", "windows, dB", curves, x_log=True, y_log=False))
    section.add_chart(
        "price",
        plots.draw_panels(panels, "Contact tracker", "difference from our own contact against the CPU of the tracker", 3),
        "Difference from our own contact against the CPU time of the tracker.",
        data,
    )
    return section
