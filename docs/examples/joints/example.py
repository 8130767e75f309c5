"""What hangs and swings: a wind chime on cords, a pendulum that strikes a bell, a bar that falls into its cords and a mallet on a hinged
stick."""
import json
import math

import numpy

import measure
import stage as tools

TUBES = {"long": 0.505, "middle": 0.435, "short": 0.388}
G = 9.81


def read_path(stage, name, body):
    """Times and places of the origin of a body's mesh, and the times of what strikes it."""
    trajectory = json.loads((stage.out / f"{name}-trajectory.json").read_text())
    index = [one["name"] for one in trajectory["bodies"]].index(body)
    poses = numpy.array([pose[:4] for pose in trajectory["bodies"][index]["poses"]], dtype=float)
    hits = numpy.array(sorted(hit["time_s"] for hit in trajectory["impulses"] if hit["body"] == index))
    return poses[:, 0], poses[:, 1:], hits


def count_blows(times, apart_s=0.02):
    """Impulses that follow each other closely are one blow."""
    return 0 if len(times) == 0 else 1 + int((numpy.diff(times) > apart_s).sum())


def hear(stage, what, samples, rate, wanted_hz, percent):
    stage.compare(f"{what} in the sound against its bank [Hz]", measure.find_peak(samples, rate, wanted_hz, 0.03), wanted_hz, percent)


def play_chime(stage):
    quick = {"body.nodes": 1500, "band_hz": [20, 4000]}
    banks = {name: stage.solve("tube.json", name, {"body.length_m": length}, quick) for name, length in TUBES.items()}
    stage.solve("ball.json", "clapper", {"body.radius_m": 0.03})
    scene = tools.read_json(stage.folder / "chime.json")
    rate, samples, report = stage.render("chime", scene)
    rows = [("tube", "blows", "lowest mode [Hz]", "farthest from its place [mm]")]
    for name in TUBES:
        times, places, hits = read_path(stage, "chime", name)
        blows, far = count_blows(hits), 1e3 * numpy.linalg.norm(places - places[0], axis=1).max()
        hz = banks[name]["corrected_frequencies_hz"][0]
        rows.append((name, blows, f"{hz:.1f}", f"{far:.1f}"))
        stage.expect(f"the clapper strikes the {name} tube 1 to 60 times ({blows})", 1 <= blows <= 60)
        stage.expect(f"the {name} tube swings, and its cords keep it ({far:.1f} mm)", 0.1 < far < 100)
        hear(stage, f"the {name} tube", samples, rate, hz, 0.3)
    stage.show("tubes", rows, ("blows", "farthest from its place [mm]"))
    _, places, _ = read_path(stage, "chime", "clapper")
    anchor = numpy.array([0.0, 0.0, 0.15])
    longest = numpy.linalg.norm(places - anchor, axis=1).max()
    stage.expect("the clapper stays within its cord", longest < 0.27 + 1e-4)
    return report, sum(row[1] for row in rows[1:]), "the length of the clapper's cord", f"{max(0.0, 1e6 * (longest - 0.27)):.1f} um"


def play_bell(stage):
    bank = stage.solve("bell.json", "bell", quick={"body.nodes": 2500, "band_hz": [20, 6000]})
    stage.solve(
        "ball.json",
        "steel",
        {"body.radius_m": 0.015, "material.young_modulus_pa": 200e9, "material.density_kg_m3": 7800, "band_hz": [20, 150000]},
    )
    scene = tools.read_json(stage.folder / "bell-scene.json")
    rate, samples, report = stage.render("bell", scene)
    times, places, hits = read_path(stage, "bell", "pendulum")
    # Until the first hit: a pendulum of a ball r on an arm l, from its angle to the bottom, by energy.
    arm, r = 0.3, 0.015
    angles = numpy.arctan2(places[:, 0] + 0.0755, 0.304 - places[:, 2])
    start, first = angles[0], hits[0]
    reached = numpy.interp(first, times, angles)
    before = times < first - 2e-3
    spin = numpy.gradient(angles[before], times[before])
    w2 = G * arm / (arm**2 + 0.4 * r**2)
    predicted = numpy.sqrt(2 * w2 * numpy.maximum(numpy.cos(angles[before]) - math.cos(start), 0))
    off = abs(spin[2:-2] - predicted[2:-2]).max() / predicted.max()
    print(
        f"  the pendulum falls from {math.degrees(start):.1f} degrees and strikes at {first:.4f} s and {math.degrees(reached):.2f} degrees;"
        f" {count_blows(hits)} blows"
    )
    stage.expect(f"its speed until then is that of its energy to 1 % (off by {100 * off:.2f} %)", off < 0.01)
    stage.expect(f"the pendulum strikes the bell 2 to 60 times ({count_blows(hits)})", 2 <= count_blows(hits) <= 60)
    swing = read_path(stage, "bell", "bell")[1]
    stage.expect("the bell's pole stays on its hinge", (abs(numpy.linalg.norm(swing - [0, 0, 0.08], axis=1) - 0.08) < 1e-5).all())
    hear(stage, "the bell", samples, rate, bank["corrected_frequencies_hz"][0], 0.3)
    return report, count_blows(hits), "energy: the speed of the pendulum", f"{100 * off:.2f} %"


def play_bar(stage):
    bank = stage.solve("bar.json", "bar", quick={"body.nodes": 2500, "band_hz": [20, 6000]})
    stage.solve("ball.json", "head", {"body.radius_m": 0.012, "band_hz": [20, 150000]})
    scene = tools.read_json(stage.folder / "bar-scene.json")
    rate, samples, report = stage.render("bar", scene)
    times, places, hits = read_path(stage, "bar", "bar")
    fall = times <= math.sqrt(2 * 0.0149 / G)
    off = abs(places[fall, 2] - (0.015 - 0.5 * G * times[fall] ** 2)).max()
    stage.expect(f"the bar falls freely until its cords are taut (off by {1e6 * off:.2f} um)", off < 2e-6)
    first = hits[0]
    caught = places[(times > 0.06) & (times < first - 1e-3)][-1:]  # it sleeps from then on
    stage.expect(f"they hold it where they are taut ({1e6 * abs(caught[:, 2]).max():.1f} um off)", abs(caught[:, 2]).max() < 2e-5)
    print(f"  the mallet strikes at {first:.4f} s, {count_blows(hits)} blows")
    stage.expect(f"the mallet strikes the bar 1 to 60 times ({count_blows(hits)})", 1 <= count_blows(hits) <= 60)
    hear(stage, "the bar", samples[int(first * rate) :], rate, bank["corrected_frequencies_hz"][0], 0.3)
    return report, count_blows(hits), "free fall, until the cords are taut", f"{1e6 * off:.2f} um"


def play(stage):
    scenes = {"wind chime": play_chime(stage), "pendulum and bell": play_bell(stage), "bar and mallet": play_bar(stage)}
    cost = "physics, CPU s for 1 s"
    rows = [("scene", "seconds", "blows", cost, "held against", "off by")]
    for name, (report, blows, against, off) in scenes.items():
        seconds = report["duration_s"]
        rows.append((name, f"{seconds:g}", blows, f"{report['physics_cpu_s'] / seconds:.2f}", against, off))
    stage.show("scenes", rows, ("blows", cost, "off by"))
