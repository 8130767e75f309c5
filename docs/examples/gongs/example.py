"""A gong and a thunder sheet under soft, medium and hard blows: pitch that moves, and high frequencies that grow after the blow; the sheet
also with the cascade above its coupled modes."""
import math

import numpy

import measure
import stage as tools

RADIUS_M, RISE_M, RINGS = 0.15, 0.003, 16  # of the gong: its middle is higher than its rim
MALLET = {"from": "soft-felt"}
BLOW_S = 0.05
BLOWS = {  # mass [kg] and speeds [m/s] of the mallet, and where
    "gong": (0.2, {"soft": 0.3, "medium": 1.0, "hard": 4.0}, [0.03, 0.01, 0.0006]),
    "thunder": (0.1, {"soft": 0.05, "medium": 0.5, "hard": 5.0}, [0.2, 0.05, 0.0003]),
}
QUICK = {
    "gong": {"body.nodes": 2500, "band_hz": [20, 4000], "nonlinear.modes": 16},
    "thunder": {"body.nodes": 2500, "max_modes": 120, "nonlinear.modes": 16},
}
WINDOW_S = 0.1
TIMES_S = (0.01, 0.1, 0.3, 1.0, 2.0, 3.5)  # after the blow


def write_gong(file):
    """Its middle surface, a paraboloid: rings of vertices, six more in each."""
    vertices, faces = [(0.0, 0.0, 0.0)], []
    for ring in range(1, RINGS + 1):
        share = ring / RINGS
        for k in range(6 * ring):
            angle = 2 * math.pi * k / (6 * ring)
            vertices.append((RADIUS_M * share * math.cos(angle), RADIUS_M * share * math.sin(angle), -RISE_M * share**2))

    def number(ring, k):
        return 1 if ring == 0 else 2 + 3 * ring * (ring - 1) + k % (6 * ring)

    for ring in range(1, RINGS + 1):
        for sector in range(6):
            for k in range(ring):
                outer, inner = sector * ring + k, sector * (ring - 1) + k
                faces.append((number(ring, outer), number(ring, outer + 1), number(ring - 1, inner)))
                if k + 1 < ring:
                    faces.append((number(ring - 1, inner), number(ring, outer + 1), number(ring - 1, inner + 1)))
    lines = ["v %.7f %.7f %.7f" % vertex for vertex in vertices] + ["f %d %d %d" % face for face in faces]
    file.write_text("\n".join(lines) + "\n")


def cut(samples, rate, begin, length):
    return samples[int(begin * rate) : int((begin + length) * rate)]


def calc_centroid(samples, rate):
    """Of the power [Hz]."""
    freq, level = measure.calc_spectrum(samples, rate)
    power = 10 ** (level / 10)
    return (freq * power).sum() / power.sum()


def find_pitch(samples, rate, near_hz):
    """Of the strongest peak within a whole tone of near_hz."""
    return measure.find_peak(samples, rate, near_hz, 0.122)


def calc_centroids(samples, rate, times):
    """At so many seconds after the blow [Hz]."""
    return [calc_centroid(cut(samples, rate, BLOW_S + t, WINDOW_S), rate) for t in times]


def calc_level(samples):
    """In dB re 20 uPa."""
    return 20 * math.log10(math.sqrt((samples**2).mean()) / 20e-6)


def blow(stage, name, duration, has_cascade=False):
    """Renders the three blows: {strength: (rate, sound in Pa, report)}"""
    mass, speeds, place = BLOWS[name]
    scene = tools.read_json(stage.folder / "scene.json")
    scene["duration_s"] = duration
    if has_cascade:
        scene["effects"]["off"].remove("cascade")
    scene["bodies"][0]["bank"] = f"{name}.hdf"
    sounds = {}
    for strength, speed in speeds.items():
        scene["strikes"][0].update({"point_m": place, "mallet": {**MALLET, "mass_kg": mass, "speed_m_s": speed}})
        file = f"{name}-{strength}-cascade" if has_cascade else f"{name}-{strength}"
        rate, samples, report = stage.render(file, scene, picture=False)
        sounds[strength] = (rate, samples / report["gain_per_pa"], report)
        mallet, radiated = report["mallets"][0], report["energy"]["radiated_j"]
        stage.expect(f"{file}: every sample is a number", numpy.isfinite(samples).all())
        stage.expect(
            f"{file}: {radiated:.2g} J are radiated, of {mallet['modes_j']:.2g} J that the blow left in modes",
            0 < radiated < mallet["modes_j"],
        )
    return sounds


def describe(sounds, duration, has_pitch):
    """What became of the blows: {strength: (centroids [Hz], cents from the soft blow's loudest mode, where has_pitch)}"""
    rate, samples, _ = sounds["soft"]
    times = [t for t in TIMES_S if BLOW_S + t + WINDOW_S < duration]
    long_s = duration / 8
    if has_pitch:
        soft_hz = measure.find_peaks(cut(samples, rate, duration / 2, duration / 2 - 0.02), rate, 20, 2000, 1)[0][0]
    found = {}
    for strength, (rate, samples, _) in sounds.items():
        centroids, cents = calc_centroids(samples, rate, times), []
        if has_pitch:
            starts = numpy.linspace(BLOW_S + 0.02, duration - long_s - 0.02, 8)
            pitches = [find_pitch(cut(samples, rate, start, long_s), rate, soft_hz) for start in starts]
            cents = [1200 * math.log2(pitch / soft_hz) for pitch in pitches]
        found[strength] = (centroids, cents)
    return found


def draw(stage, sounds, picture):
    """One spectrogram below the other: how the same body answers three blows."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(len(sounds), 3, figsize=(12, 3.2 * len(sounds)), sharex=True, squeeze=False)
    for row, (name, of_body) in zip(axes, sounds.items()):
        for axis, (strength, (rate, samples, _)) in zip(row, of_body.items()):
            top = 20 * math.log10(abs(samples).max() + 1e-30)
            axis.specgram(samples[:, 0], NFFT=4096, Fs=rate, noverlap=3072, vmin=top - 140, vmax=top - 40, cmap="magma")
            axis.set_ylim(0, 5000)
            axis.set_title(f"{name}, {strength}")
            axis.set_xlabel("Time (s)")
        row[0].set_ylabel("Frequency (Hz)")
    figure.tight_layout()
    figure.savefig(stage.out / picture, dpi=60)
    stage.pictures.append(picture)


def show_blows(stage, sounds, found):
    """The table of all blows. What depends on rounding after a while, because the motion is chaotic, varies from run to run."""
    pitch, cost = "cents above the soft blow", "of a core"
    rows = [("blow", "left in modes [J]", "peak [Pa]", pitch, cost)]
    for name, of_body in sounds.items():
        for strength, (_, samples, report) in of_body.items():
            cents = found[name][strength][1]
            rows.append(
                (
                    f"{name}, {BLOWS[name][0]:g} kg at {BLOWS[name][1][strength]:g} m/s",
                    f"{report['mallets'][0]['modes_j']:.2g}",
                    f"{abs(samples).max():.2g}",
                    f"{round(min(cents))} to {round(max(cents))}" if cents else "-",
                    f"{100 * report['playing_cpu_s'] / report['duration_s']:.0f} %",
                )
            )
    stage.show("blows", rows, (pitch, cost))


def compare_cascade(stage, gong, off, on, duration):
    """Checks what the cascade changes; shows centroids [Hz] and levels [dB] over time after the blow."""
    times = [t for t in TIMES_S if BLOW_S + t + WINDOW_S < duration]
    rows = [("blow", "cascade", *(f"{t:g} s" for t in times))]
    for strength, (rate, samples, _) in gong.items():
        levels_db = [calc_level(cut(samples, rate, BLOW_S + t, WINDOW_S)) for t in times]
        cells = (f"{hz:.0f}, {db:.1f}" for hz, db in zip(calc_centroids(samples, rate, times), levels_db))
        rows.append((f"gong, {strength}", "off", *cells))
    centroids, levels = {}, {}
    for strength in off:
        for name, (rate, samples, _) in (("off", off[strength]), ("on", on[strength])):
            centroids[strength, name] = calc_centroids(samples, rate, times)
            levels[strength, name] = [calc_level(cut(samples, rate, BLOW_S + t, WINDOW_S)) for t in times]
            cells = (f"{hz:.0f}, {db:.1f}" for hz, db in zip(centroids[strength, name], levels[strength, name]))
            rows.append((f"thunder, {strength}", name, *cells))
    stage.show("centroids", rows, rows[0][3:])
    soft, soft_on = off["soft"], on["soft"]
    same = abs(soft_on[1] - soft[1]).max() <= 1e-5 * abs(soft[1]).max()
    stage.expect("thunder: after a soft blow the cascade stays off", not soft_on[2]["per_body"][0]["effects"]["cascade"]["on"] and same)
    gain, wide = levels["hard", "on"][-1] - levels["hard", "off"][-1], centroids["hard", "on"][-1] / centroids["hard", "off"][-1]
    stage.expect(
        f"thunder: {times[-1]:g} s after a hard blow the cascade has added {gain:.1f} dB, and the centroid is {wide:.2f} times as high",
        gain > 3 and wide > 0.9,
    )


def draw_cascade(stage, off, on, duration, picture):
    """The hard blow without and with the cascade, and the centroids of all blows over time."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    top = 20 * math.log10(abs(on["hard"][1]).max())
    for axis, (name, (rate, samples, _)) in zip(axes, (("off", off["hard"]), ("on", on["hard"]))):
        axis.specgram(samples[:, 0], NFFT=4096, Fs=rate, noverlap=3072, vmin=top - 110, vmax=top - 40, cmap="magma")
        axis.set(title=f"hard blow, cascade {name}", ylim=(0, 4000), xlabel="Time (s)", ylabel="Frequency (Hz)")
    times = numpy.arange(0.01, duration - BLOW_S - WINDOW_S, 0.05)
    for strength, colour in zip(off, ("C0", "C2", "C3")):
        for (rate, samples, _), style, name in ((off[strength], "--", "off"), (on[strength], "-", "on")):
            axes[2].plot(times, calc_centroids(samples, rate, times), colour + style, label=f"{strength}, {name}", linewidth=1)
    axes[2].set(title="centroid", xlabel="Time after the blow (s)", ylabel="Frequency (Hz)", yscale="log", ylim=(60, 9000))
    axes[2].legend(fontsize="small", ncols=3, loc="upper center")
    figure.savefig(stage.out / picture, dpi=70)
    stage.pictures.append(picture)


def play(stage):
    write_gong(stage.out / "gong.obj")
    duration = 2.0 if stage.quick else 4.0
    sounds, found = {}, {}
    for name in BLOWS:
        stage.solve(f"{name}.json", name, quick=QUICK[name])
        sounds[name] = blow(stage, name, duration)
        found[name] = describe(sounds[name], duration, name == "gong")
    cascade = blow(stage, "thunder", duration, has_cascade=True)
    show_blows(stage, sounds, found)
    compare_cascade(stage, sounds["gong"], sounds["thunder"], cascade, duration)
    for name in BLOWS:
        soft, hard = (found[name][strength][0] for strength in ("soft", "hard"))
        stage.expect(
            f"{name}: a hard blow is brighter than a soft one after 0.3 s ({hard[2]:.0f} Hz against {soft[2]:.0f} Hz)",
            hard[2] > 1.5 * soft[2],
        )
    soft = found["gong"]["soft"][1]
    stage.expect(f"gong: a soft blow keeps its pitch (to {numpy.ptp(soft):.2f} cents)", numpy.ptp(soft) < 2)
    medium = found["gong"]["medium"]
    stage.expect(f"gong: the pitch of a medium blow moves by {numpy.ptp(medium[1]):.0f} cents", numpy.ptp(medium[1]) > 10)
    stage.expect(
        f"gong: high frequencies grow after a medium blow, from {medium[0][0]:.0f} Hz to {max(medium[0]):.0f} Hz",
        max(medium[0]) > 1.2 * medium[0][0] and numpy.argmax(medium[0]) > 0,
    )
    soft = found["gong"]["soft"][0]
    stage.expect(f"gong: a soft one becomes darker at once ({soft[0]:.0f} Hz to {soft[-1]:.0f} Hz)", soft[-1] < soft[0])
    if not stage.quick:
        draw(stage, sounds, "gongs.png")
        draw_cascade(stage, sounds["thunder"], cascade, duration, "cascade.png")
