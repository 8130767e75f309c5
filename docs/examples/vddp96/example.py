"""The square membrane of van den Doel and Pai 1996: its lines and its brightness; and their room, every body of it struck."""
import csv
import math
import subprocess

import numpy

import stage as tools

# Where the membrane is struck, and the centroid of the 400 modes' energies there [Hz], by the closed form.
POINTS = [
    ((0.5, 0.5), 2274.0008),
    ((0.45, 0.4), 2276.8101),
    ((0.3, 0.35), 2391.5311),
    ((0.2, 0.2), 2718.6342),
    ((0.1, 0.1), 3326.9521),
    ((0.05, 0.05), 4363.0099),
    ((0.02, 0.02), 6296.9423),
]
WIDTH, HEIGHT, LEFT, TOP = 760, 360, 60, 20


def list_modes(stage, point):
    """[(frequency, amplitude)] of the program at a point, the amplitude that of the paper, Psi / omega, times 2 pi 500."""
    words = [stage.bin / "carillon-precompute", "membrane.json", "--at", f"{point[0]},{point[1]},0"]
    done = subprocess.run(
        ["bash", "-c", '. "$0"; exec "$@"', tools.ENVIRONMENT, *map(str, words)], cwd=stage.out, capture_output=True, text=True, check=True
    )
    return [
        (float(row["frequency_hz"]), float(row["phi_z"]) * 500 / float(row["frequency_hz"]))
        for row in csv.DictReader(done.stdout.splitlines())
    ]


def draw(stage, name, parts, x_label, y_label, x_ticks, y_ticks, place_x, place_y):
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for tick in x_ticks:
        out.append(f'<text x="{place_x(tick):.1f}" y="{HEIGHT - 34}" text-anchor="middle">{tick:g}</text>')
    for tick in y_ticks:
        out.append(f'<line x1="{LEFT}" x2="{WIDTH - 20}" y1="{place_y(tick):.1f}" y2="{place_y(tick):.1f}" stroke="#dddddd"/>')
        out.append(f'<text x="{LEFT - 6}" y="{place_y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')
    out.append(f'<text x="{WIDTH / 2}" y="{HEIGHT - 12}" text-anchor="middle">{x_label}</text>')
    out.append(f'<text transform="translate(14 {HEIGHT / 2}) rotate(-90)" text-anchor="middle">{y_label}</text>')
    (stage.out / name).write_text("\n".join(out + parts + ["</svg>"]) + "\n")
    stage.pictures.append(name)


def draw_lines(stage, modes):
    x = lambda hz: LEFT + (WIDTH - LEFT - 20) * hz / 9000
    y = lambda a: HEIGHT - 54 - (HEIGHT - 54 - TOP) * a / 0.5
    stems = [f'<line x1="{x(hz):.1f}" x2="{x(hz):.1f}" y1="{y(0):.1f}" y2="{y(abs(a)):.1f}" stroke="#2f6690"/>' for hz, a in modes]
    draw(stage, "figure-2.svg", stems, "frequency [Hz]", "amplitude, Psi / omega", range(0, 9001, 1000), (0, 0.1, 0.2, 0.3, 0.4, 0.5), x, y)


def draw_brightness(stage, centroids):
    x = lambda d: LEFT + (WIDTH - LEFT - 20) * math.log(d / 0.015) / math.log(0.6 / 0.015)
    y = lambda hz: HEIGHT - 54 - (HEIGHT - 54 - TOP) * hz / 7000
    parts = [f'<circle cx="{x(d):.1f}" cy="{y(hz):.1f}" r="4" fill="#c8553d"/>' for d, hz in centroids]
    draw(
        stage,
        "brightness.svg",
        parts,
        "distance of the blow from the nearest side",
        "centroid [Hz]",
        (0.02, 0.05, 0.1, 0.2, 0.5),
        range(0, 7001, 1000),
        x,
        y,
    )


def measure_lines(rate, samples, modes):
    """The first 40 lines that are heard: largest difference [dB] between the sound and what modes of one frequency add up to."""
    lines = {}
    for hz, a in modes:
        lines[round(hz, 6)] = lines.get(round(hz, 6), 0.0) + a
    loudest = max(map(abs, lines.values()))
    heard = sorted(hz for hz, a in lines.items() if abs(a) > 1e-3 * loudest)[:40]
    part = samples[rate // 10 :, 0]
    n = len(part)
    t = numpy.arange(n)
    window = sum(c * numpy.cos(2 * math.pi * k * t / (n - 1)) for k, c in enumerate((0.35875, -0.48829, 0.14128, -0.01168)))
    decayed = lambda hz: window * numpy.exp(-math.pi * hz * 1e-4 * t / rate)  # d = omega tan(phi) / 2
    level = lambda hz: abs(numpy.sum(part * window * numpy.exp(-2j * math.pi * hz / rate * t))) / decayed(hz).sum()
    start = lambda hz: math.exp(-math.pi * hz * 1e-4 * 0.09)  # from the blow to the first sample that counts, but for the same delay
    found = {hz: level(hz) / start(hz) / abs(lines[hz]) for hz in heard}
    reference = found[max(heard, key=lambda hz: abs(lines[hz]))]
    return max(abs(20 * math.log10(value / reference)) for value in found.values())


def play(stage):
    stage.solve("membrane.json", "membrane")
    modes = list_modes(stage, (0.1, 0.1))
    stage.expect(f"400 modes, the last at {modes[-1][0]:.2f} Hz (8200.61)", len(modes) == 400 and abs(modes[-1][0] - 8200.61) < 0.005)
    draw_lines(stage, modes)
    scene = tools.read_json(stage.folder / "scene.json")
    rate, samples, _ = stage.render("membrane-struck", scene, picture=False)
    worst = measure_lines(rate, samples, modes)
    stage.expect(f"the first 40 lines of the sound are those of figure 2 within {worst:.3f} dB (0.5)", worst < 0.5)
    rows, centroids = [("struck at", "centroid [Hz]", "wanted")], []
    for point, wanted in POINTS:
        struck = list_modes(stage, point)
        centroid = sum(hz * a * a for hz, a in struck) / sum(a * a for _, a in struck)
        rows.append((f"{point[0]:g}, {point[1]:g}", f"{centroid:.2f}", f"{wanted:.2f}"))
        centroids.append((min(point), centroid))
        stage.compare(f"centroid of a blow at {point}", centroid, wanted, 3e-6)  # half of the last digit
    stage.show("brightness", rows)
    draw_brightness(stage, centroids)
    stage.expect("brighter with every step towards the edge", all(a[1] < b[1] for a, b in zip(centroids, centroids[1:])))
    for job in sorted((stage.folder / "room").glob("*.json")):
        if job.name not in ("scene.json", "to-play.json"):
            stage.solve(f"room/{job.name}", job.stem, quick={"max_modes": 60})
    _, _, report = stage.render("room", tools.read_json(stage.folder / "room/scene.json"))
    silent = [one["name"] for one in report["per_body"] if not one["peak_pa_at_1m"] > 0.0]
    stage.expect("every body of the room sounds", report["contacts"] >= 9 and not silent)
