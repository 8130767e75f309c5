"""A string struck hard in two planes: it is sharp while it swings far, its ellipse turns, and both are those of the closed forms."""
import math

import numpy

import stage as tools

LENGTH_M, TENSION_N, DIAMETER_M, YOUNG_PA, DENSITY_KG_M3 = 0.65, 70.0, 5e-4, 200e9, 7850.0
AREA_M2 = math.pi / 4 * DIAMETER_M**2
KG_PER_M = DENSITY_KG_M3 * AREA_M2
# Of the first mode: stiff string, hinged at both ends.
STIFFNESS = math.pi**3 * YOUNG_PA * DIAMETER_M**4 / (64 * TENSION_N * LENGTH_M**2)
OMEGA = math.pi / LENGTH_M * math.sqrt(TENSION_N / KG_PER_M * (1 + STIFFNESS))
# Kirchhoff and Carrier: w'' + omega^2 w + BETA |w|^2 w = 0 for the deflection of the middle, both planes.
BETA = YOUNG_PA * AREA_M2 * (math.pi / LENGTH_M) ** 4 / (4 * KG_PER_M)
LOSSLESS = {"material.damping": {"internal_friction": {"tan_phi": 1e-7}}, "max_modes": 2, "nonlinear": "stretch"}


def calc_duffing_ratio(alpha):
    """Frequency over that of soft motion for alpha = beta amplitude^2 / omega^2: pi sqrt(1 + alpha) / (2 K(alpha / (2 (1 + alpha))))."""
    a, b = 1.0, math.sqrt(1 - alpha / (2 * (1 + alpha)))
    for _ in range(40):
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.sqrt(1 + alpha) * a


def calc_ellipse(a, b):
    """Of the motion about the middle between the distances b and a: how fast its ellipse turns, its mean angular frequency [rad/s], and its
    speed at a [m/s]. With u the square of the distance, (du/dt)^2 = 2 beta (u - b^2) (a^2 - u) (u + c)."""
    c = 2 * OMEGA**2 / BETA + a * a + b * b
    momentum = math.sqrt(BETA / 2 * c) * a * b
    theta = (numpy.arange(200) + 0.5) * math.pi / 200
    u = (a * a + b * b) / 2 + (a * a - b * b) / 2 * numpy.cos(theta)
    seconds = 1 / (2 * numpy.sqrt(BETA / 2 * (u + c)))
    quarter_s, quarter_turn = math.pi * seconds.mean(), math.pi * (momentum / u * seconds).mean()
    return (4 * quarter_turn - 2 * math.pi) / (4 * quarter_s), math.pi / (2 * quarter_s), momentum / a


def strike(speeds_m_s, times_s):
    """Strokes in the middle that give it these speeds in the first mode, one along y and one along z."""
    impulse = [v * KG_PER_M * LENGTH_M / 2 for v in speeds_m_s]
    return [
        {
            "time_s": time,
            "body": "string",
            "point_m": [LENGTH_M / 2, 0, 0],
            "impulse_n_s": [0, impulse[0], 0] if axis == 0 else [0, 0, impulse[1]],
            "duration_s": 1e-4,
        }
        for axis, time in enumerate(times_s)
    ]


def find_lines(rate, samples, count):
    """Angular frequencies [rad/s] of the strongest lines: maxima of a Hann spectrum, padded with zeros, by a parabola."""
    n = len(samples)
    spectrum = numpy.abs(numpy.fft.rfft(samples * numpy.hanning(n), 8 * n))
    maxima = [i for i in range(1, len(spectrum) - 1) if spectrum[i] > spectrum[i - 1] and spectrum[i] >= spectrum[i + 1]]
    maxima = sorted(maxima, key=lambda i: -spectrum[i])[:count]
    lines = []
    for i in maxima:
        low, middle, high = numpy.log(spectrum[i - 1 : i + 2])
        lines.append(2 * math.pi * rate / (8 * n) * (i + (low - high) / (2 * (low - 2 * middle + high))))
    return sorted(lines)


def find_pitch(rate, samples, begin_s, end_s):
    """Of the strongest line in a part of the sound [Hz]."""
    return find_lines(rate, samples[int(begin_s * rate) : int(end_s * rate)], 1)[0] / (2 * math.pi)


def play(stage):
    scene = tools.read_json(stage.folder / "scene.json")
    stage.solve("string.json", "string")
    stage.solve("string.json", "mode", changes=LOSSLESS)
    stage.solve("string.json", "damped", changes={"max_modes": 2, "nonlinear": "stretch"})
    mode = {**scene, "duration_s": 4, "bodies": [{**scene["bodies"][0], "bank": "mode.hdf"}]}

    rows = [("what", "found", "wanted", "to first order")]
    for far_mm in (1, 3):
        w = far_mm * 1e-3
        alpha = BETA * w * w / OMEGA**2
        speed = OMEGA * w * math.sqrt(1 + alpha / 2)
        rate, samples, _ = stage.render(f"plane-{far_mm}", {**mode, "strikes": strike((speed, 0), (0.01,))}, picture=False)
        ratio = calc_duffing_ratio(alpha)
        found = find_lines(rate, samples[int(0.1 * rate) :, 0], 1)[0] / OMEGA
        cents = 1200 * math.log2(found / ratio)
        stage.expect(f"{far_mm} mm: sharp by {1200 * math.log2(ratio):.2f} cents, found {1200 * math.log2(found):.2f}", abs(cents) < 0.3)
        first_order = 1200 * math.log2(1 + 3 * alpha / 8)
        rows.append(
            (f"one plane, {far_mm} mm: sharp by [cents]", *(f"{1200 * math.log2(x):.2f}" for x in (found, ratio)), f"{first_order:.2f}")
        )

    # To first order an ellipse of half axes a and b turns by beta a b / (4 omega), against its own sense. The line of the motion that goes
    # round one way lies twice that from the line of the other.
    a, b = 4e-3, 2e-3
    turn, mean, speed = calc_ellipse(a, b)
    alpha = BETA * a * a / OMEGA**2
    quarter_s = math.pi / (2 * OMEGA * calc_duffing_ratio(alpha))
    strokes = strike((OMEGA * a * math.sqrt(1 + alpha / 2), speed), (0.01, 0.01 + quarter_s))
    rate, samples, _ = stage.render("ellipse", {**mode, "duration_s": 8, "strikes": strokes}, picture=False)
    slow, fast = find_lines(rate, samples[int(0.1 * rate) :, 0], 2)
    stage.compare("the ellipse turns [rad/s]", (fast - slow) / 2, abs(turn), 0.5)
    stage.compare("the same to first order", (fast - slow) / 2, BETA * a * b / (4 * OMEGA), 5)
    stage.compare("its mean frequency over that of soft motion, less 1", (fast + slow) / (2 * OMEGA) - 1, mean / OMEGA - 1, 0.5)
    stage.compare("the same to first order", (fast + slow) / (2 * OMEGA) - 1, 3 * BETA * (a * a + b * b) / (8 * OMEGA**2), 2)

    mean_found, turn_first, mean_first = (
        (fast + slow) / (2 * OMEGA),
        BETA * a * b / (4 * OMEGA),
        3 * BETA * (a * a + b * b) / (8 * OMEGA**2),
    )
    rows.append(("ellipse of 4 by 2 mm: turns by [rad/s]", f"{(fast - slow) / 2:.3f}", f"{abs(turn):.3f}", f"{turn_first:.3f}"))
    rows.append(("its mean frequency over that of soft motion", f"{mean_found:.5f}", f"{mean / OMEGA:.5f}", f"{1 + mean_first:.5f}"))

    # With loss the pitch follows the amplitude down.
    w = 4e-3
    damped = {**mode, "duration_s": 3, "bodies": [{**scene["bodies"][0], "bank": "damped.hdf"}]}
    rate, samples, _ = stage.render(
        "glide", {**damped, "strikes": strike((OMEGA * w * math.sqrt(1 + BETA * w * w / (2 * OMEGA**2)), 0), (0.01,))}, picture=False
    )
    decay = 0.5 * 0.001 * OMEGA
    for begin, end in ((0.1, 0.3), (0.5, 0.7), (1.5, 1.9)):
        far = w * math.exp(-decay * ((begin + end) / 2 - 0.01))
        wanted = OMEGA * calc_duffing_ratio(BETA * far * far / OMEGA**2) / (2 * math.pi)
        found = find_pitch(rate, samples[:, 0], begin, end)
        stage.expect(
            f"glide at {(begin + end) / 2:.1f} s: {found:.3f} Hz, wanted {wanted:.3f}", abs(1200 * math.log2(found / wanted)) < 1.5
        )
        rows.append((f"with loss, at {(begin + end) / 2:.1f} s [Hz]", f"{found:.2f}", f"{wanted:.2f}", "-"))
    stage.show("whirl", rows)

    rate, samples, report = stage.render("whirl", scene)
    rate, linear, _ = stage.render("straight", {**scene, "bodies": [{**scene["bodies"][0], "nonlinear": False}]}, picture=False)
    cents = []
    for sound in (samples[:, 0], linear[:, 0]):
        first, last = find_pitch(rate, sound, 0.05, 0.25), find_pitch(rate, sound, 2.6, 2.95)
        cents.append(1200 * math.log2(first / round(first / last) / last))
    stage.expect(f"all modes: the pitch glides down by {cents[0]:.1f} cents", cents[0] > 50)
    stage.expect(f"without the stretch by {cents[1]:.2f}", abs(cents[1]) < 1)
