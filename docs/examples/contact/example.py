"""What slides and what rolls is heard as fast as it moves, what rests is silent, and what touches takes energy out of what rings."""
import math

import numpy

import measure
import stage as tools


def list_levels(samples, rate, step_s):
    """Level [dB re full scale] and mean frequency [Hz] of one interval of time after another; None for silence."""
    rows = []
    for begin in range(0, len(samples) - int(step_s * rate) + 1, int(step_s * rate)):
        part = samples[begin : begin + int(step_s * rate), 0]
        power = abs(numpy.fft.rfft(part * numpy.hanning(len(part)))) ** 2
        mean = (power * numpy.fft.rfftfreq(len(part), 1 / rate)).sum() / max(power.sum(), 1e-300)
        rows.append((begin / rate, 20 * math.log10(part.std()) if part.any() else None, mean))
    return rows


def play(stage):
    for name in ("tile", "ball", "shelf"):
        bank = stage.solve(f"{name}.json", name)
        if name == "tile":
            tile = bank

    rate, samples, _ = stage.render("slide", tools.read_json(stage.folder / "slide.json"))
    slide = list_levels(samples, rate, 0.1)
    stage.show(
        "sliding",
        [("sliding [s]", "speed [m/s]", "level [dB]", "mean frequency [Hz]")]
        + [
            (f"{t:.1f}", f"{max(0.0, 1 - 1.68 * (t + 0.05)):.2f}", "silent" if level is None else f"{level:.1f}", f"{mean:.0f}")
            for t, level, mean in slide
        ],
    )
    levels = [level for _, level, _ in slide[:5]]
    # A tenth of a second of noise has its level to a dB or two.
    stage.expect(
        "the sliding tile gets quieter as it slows down",
        all(later < sooner + 2 for sooner, later in zip(levels, levels[1:])) and levels[0] - levels[4] > 6,
    )
    # At 0.75 m/s in the second tenth and 0.24 in the fifth: 20 log10 of their ratio to the power of 0.75 to 1
    # (docs/decisions/contact-sound.md), and 3 dB of chance.
    stage.expect("by 4 to 13 dB from 0.75 to 0.24 m/s", 4 < levels[1] - levels[4] < 13)
    # Asperities of all sizes, of which none is longer than 6.4 mm (below 150 Hz) or too short to be heard: the force has the same spectrum
    # at every speed.
    means = [mean for _, _, mean in slide[:5]]
    stage.expect("its band stays where it is", max(means) < 1.25 * min(means))
    stage.expect("at rest it is silent, sample by sample", not samples[int(1.1 * rate) :].any())

    rate, samples, _ = stage.render("roll", tools.read_json(stage.folder / "roll.json"))
    roll = list_levels(samples, rate, 0.1)
    stage.show(
        "rolling",
        [("rolling [s]", "level [dB]", "mean frequency [Hz]")] + [(f"{t:.1f}", f"{level:.1f}", f"{mean:.0f}") for t, level, mean in roll],
    )
    turn = min(range(1, len(roll)), key=lambda i: roll[i][1])  # it is set down in the first tenth
    stage.expect(f"the ball is quietest where it turns, at 0.84 s ({roll[turn][0]:.1f} s and on)", 0.65 < roll[turn][0] < 0.95)
    stage.expect("and 15 dB and more below its start and its end", min(roll[1][1], roll[-1][1]) - roll[turn][1] > 15)

    decays = {}
    struck_hz = [
        tile["corrected_frequencies_hz"][i] for i in (0, 2)
    ]  # the second one's still lines go through the corners: it is not struck there, nor touched
    scene = tools.read_json(stage.folder / "lie.json")
    for name, effects in (("touched", scene["effects"]), ("free", ["modal", "hertz_pulse"])):
        rate, samples, _ = stage.render(f"lie-{name}", {**scene, "effects": effects}, picture=False)
        ring = samples[int(0.31 * rate) :]
        decays[name] = [measure.calc_decay(ring, rate, hz, 300.0, 30.0) for hz in struck_hz]
    stage.show(
        "decays",
        [("mode [Hz]", "free [1/s]", "touched [1/s]")]
        + [(f"{hz:.0f}", f"{free:.2f}", f"{held:.2f}") for hz, free, held in zip(struck_hz, decays["free"], decays["touched"])],
    )
    for hz, free in zip(struck_hz, decays["free"]):
        stage.compare(f"decay at {hz:.0f} Hz without contact damping against the bank's law [1/s]", free, 2 * math.pi * hz * 0.004 / 2, 3.0)
    stage.expect(
        "the ground takes energy out of every one of them", all(held > 1.01 * free for free, held in zip(decays["free"], decays["touched"]))
    )
