"""Sphere on sphere, the extension that CS448Z proposes: the click of two balls, its Hertz time and its spectrum, against closed forms."""
import math

import numpy


AIR_DENSITY, SOUND_SPEED = 1.21, 343.0
YOUNG, POISSON, DENSITY = 7e10, 0.3, 2700.0  # of the aluminium balls
RESTITUTION = 0.9
CASES = {"small": (0.04, 1.0), "soft": (0.04, 0.1), "large": (0.08, 1.0)}  # radius [m], speed at which they meet [m/s]
DISTANCE_M = 1.0
MICROPHONES = ((DISTANCE_M, 0), (0, DISTANCE_M))  # ahead: on the line through both centres; and next to it


def calc_hertz(radius, speed):
    """(mass of a ball, Hertz time) of two such balls: 2.87 (m*^2 / (R* E*^2 v))^(1/5), Johnson (1985) 11.24."""
    mass = DENSITY * 4 / 3 * math.pi * radius**3
    modulus = YOUNG / (1 - POISSON**2) / 2
    return mass, 2.87 * ((mass / 2) ** 2 / (radius / 2 * modulus**2 * speed)) ** 0.2


@numpy.vectorize
def calc_reciprocal_gamma(x):
    return 0.0 if x <= 0 and x == math.floor(x) else 1 / math.gamma(x)


def calc_pulse(freq, tau):
    """Fourier transform of sin^1.5(pi t / tau) on (0, tau), of area 1, about its middle: Gamma functions (Gradshteyn and Ryzhik 3.631.8).
    Its first zero is at 1.75 / tau."""
    x = freq * tau
    return calc_reciprocal_gamma(1.75 + x) * calc_reciprocal_gamma(1.75 - x) * math.gamma(1.75) ** 2


def calc_click(freq, radius, speed, tau, microphone):
    """|p|(f) [Pa s] at a microphone: two rigid spheres next to each other along x that are pushed apart (Morse and Ingard 1968, 7.2, far
    field)."""
    mass, _ = calc_hertz(radius, speed)
    s = 2j * math.pi * freq
    unit = s * radius / SOUND_SPEED
    answer = AIR_DENSITY * SOUND_SPEED * radius * unit**2 / (unit**2 + 2 * unit + 2) / (s * mass)
    push = (1 + RESTITUTION) * mass / 2 * speed * calc_pulse(freq, tau)
    total = 0
    for side in (-1, 1):
        x, y = microphone[0] - side * radius, microphone[1]
        distance = math.hypot(x, y)
        total = total + side * x / distance * numpy.exp(-s * distance / SOUND_SPEED) / distance
    return abs(push * answer * total)


def calc_worst(freq, heard, exact, highest):
    """The largest difference of third octaves from 500 Hz on [dB]."""
    worst, centre = 0.0, 500.0
    while centre * 2 ** (1 / 6) < highest:
        band = (freq > centre * 2 ** (-1 / 6)) & (freq < centre * 2 ** (1 / 6))
        worst = max(worst, abs(10 * math.log10((heard[band] ** 2).sum() / (exact[band] ** 2).sum())))
        centre *= 2 ** (1 / 3)
    return worst


def calc_hertz_heard(freq, magnitude, tau):
    """The contact time out of the spectrum: its deepest dip near the first zero of the pulse."""
    window = (freq > 1.4 / tau) & (freq < 2.1 / tau)
    dip = numpy.argmin(magnitude[window])
    return 1.75 / freq[window][dip]


def play(stage):
    stage.solve("ball.json", "ball-unit", quick={"body.nodes": 1200})
    rows = [
        (
            "balls",
            "meet at [m/s]",
            "Hertz time [us]",
            "in the sound [us]",
            "click [Pa]",
            "worst third octave ahead, next to [dB]",
            "modes in hearing",
            "modes alone [Pa]",
        )
    ]
    for name, (radius, speed) in CASES.items():
        stage.run(
            "the edit",
            stage.bin / "carillon-bank",
            "edit",
            "ball-unit.hdf",
            f"ball-{name}.hdf",
            "--density",
            DENSITY,
            "--size",
            round(radius / 0.1, 6),
        )
        mass, tau = calc_hertz(radius, speed)
        gap = 0.005
        bodies = [
            {
                "name": side,
                "bank": f"ball-{name}.hdf",
                "position_m": [sign * (radius + gap), 0, 0],
                "velocity_m_s": [-sign * speed / 2, 0, 0],
                "restitution": RESTITUTION,
            }
            for side, sign in (("left", -1), ("right", 1))
        ]
        scene = {
            "duration_s": round(2 * gap / speed + 0.03, 4),
            "gravity_m_s2": [0, 0, 0],
            "sample_rate_hz": 192000,
            "bodies": bodies,
            "effects": ["hertz_pulse", "acceleration_noise", "air_delay", "doppler"],
            "microphones": [[*place, 0] for place in MICROPHONES],
        }
        rate, samples, report = stage.render(f"spheres-{name}", scene, picture=name == "large")
        stage.expect(f"{name}: one contact", report["contacts"] == 1)

        # Pascals, and the milliseconds in which the click is.
        pressure = samples / report["gain_per_pa"]
        begin = int((2 * gap / speed + (DISTANCE_M - 3 * radius) / SOUND_SPEED) * rate)
        freq = numpy.maximum(numpy.fft.rfftfreq(1 << 17, 1 / rate), 1e-3)
        heard = [abs(numpy.fft.rfft(column[begin : begin + int(0.004 * rate)], 1 << 17)) / rate for column in pressure.T]
        tau_heard = calc_hertz_heard(freq, heard[0], tau)
        worst = [
            calc_worst(freq, spectrum, calc_click(freq, radius, speed, tau, place), min(1.5 / tau, 20000))
            for spectrum, place in zip(heard, MICROPHONES)
        ]
        _, _, ringing = stage.render(
            f"spheres-{name}-modes",
            {**scene, "sample_rate_hz": 48000, "effects": ["modal", "hertz_pulse", "air_delay"]},
            picture=False,
            may_be_silent=True,
        )
        rows.append(
            (
                f"{name}, radius {1000 * radius:.0f} mm",
                f"{speed:g}",
                f"{1e6 * tau:.1f}",
                f"{1e6 * tau_heard:.1f}",
                f"{abs(pressure).max():.3g}",
                f"{worst[0]:.2f}, {worst[1]:.2f}",
                ringing["modes"] // 2,
                f"{ringing['peak_pa']:.2g}",
            )
        )
        stage.expect(f"{name}: the click is far louder than what rings", abs(pressure).max() > 10 * ringing["peak_pa"])
        stage.compare(f"{name}: the Hertz time in the sound against its closed form [us]", 1e6 * tau_heard, 1e6 * tau, 3.0)
        bound = 1.0 if stage.quick else 0.5
        stage.expect(
            (
                f"{name}: the click's third octaves are those of two pushed spheres to {bound} dB, ahead and next to: {worst[0]:.2f},"
                f" {worst[1]:.2f}"
            ),
            max(worst) < bound,
        )
    print()
    stage.show("spheres", rows)
