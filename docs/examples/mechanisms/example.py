"""Mechanisms of a program of one's own, by Simbody: a clock that strikes and an arm that lets go of a box."""
import math
import re
import subprocess
import sys
import wave

import numpy

import measure

G, SOUND_SPEED = 9.81, 343.0
ROD_M, ANGLE, PIVOT_M = 0.3, 0.6, 0.8  # as in docs/examples/embed/clock.cpp
RATE, FULL_SCALE_PA = 48000, 50.0
EAR_M = numpy.array([0.1, -1.0, 0.2])


def play_program(stage, name, bank):
    """Lines that the program prints, and the sound [Pa], (frames, 2), without its latency."""
    program = stage.bin / name
    if not program.is_file():
        print(f"{name} is not built: Simbody (libsimbody-dev) is missing")
        sys.exit(77)
    print(f"$ {name} {bank}.hdf {name}.f32", flush=True)
    done = subprocess.run([program, f"{bank}.hdf", f"{name}.f32"], cwd=stage.out, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}{done.stderr}\n{name} failed (exit code {done.returncode})")
    print(done.stdout, end="")
    samples = numpy.fromfile(stage.out / f"{name}.f32", dtype="<f4").reshape(-1, 2)[16:].astype(float)
    with wave.open(str(stage.out / f"{name}.wav"), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes((numpy.clip(samples / FULL_SCALE_PA, -1, 1) * 32767).astype("<i2").tobytes())
    peak = abs(samples).max()
    stage.expect(
        f"{name}.wav is loud, not clipped ({peak:.3g} Pa), and no event was lost",
        " 0 events lost" in done.stdout and 0.5 < peak < FULL_SCALE_PA,
    )
    return done.stdout, samples


def calc_level(samples):
    """Unweighted [dB]."""
    return 10 * math.log10((samples**2).mean() / 4e-10 + 1e-12)


def draw(stage, samples, name):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axis = pyplot.subplots(figsize=(10, 3.5))
    top = 20 * math.log10(abs(samples).max() + 1e-30)
    with numpy.errstate(divide="ignore"):  # it is silent before the first hit
        axis.specgram(samples[:, 0], NFFT=1024, Fs=RATE, noverlap=768, vmin=top - 140, vmax=top - 50, cmap="magma")
    axis.set_facecolor("black")
    axis.set_xlabel("Time (s)")
    axis.set_ylabel("Frequency (Hz)")
    figure.tight_layout()
    figure.savefig(stage.out / f"{name}-spectrogram.png", dpi=60)
    stage.pictures.append(f"{name}-spectrogram.png")


def find_onsets(samples, apart_s=0.1, rise=4.0):
    """Times at which the sound grows suddenly [s]."""
    block = RATE // 1000
    power = (samples[: len(samples) // block * block, 0].reshape(-1, block) ** 2).mean(axis=1)
    times = []
    for n in range(2, len(power)):
        if power[n] > 1e-6 and power[n] > rise**2 * power[max(0, n - 20) : n - 1].max() and (not times or n * 1e-3 - times[-1] > apart_s):
            times.append(n * 1e-3)
    return times


def calc_quarter(mobility):
    """Time [s] in which the pendulum falls from ANGLE to the bottom: T = K(sin(ANGLE / 2)) / w, by the arithmetic-geometric mean."""
    a, b = 1.0, math.cos(ANGLE / 2)
    for _ in range(6):
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.pi / (2 * a) / math.sqrt(mobility)


def play_clock(stage):
    bank = stage.solve("bob.json", "bob", quick={"body.nodes": 2500})
    text, samples = play_program(stage, "simbody_clock", "bob")
    strikes = [(float(time), abs(float(speed))) for time, speed in re.findall(r"strike at (\S+) s, (\S+) m/s", text)]
    stage.expect(f"the clock strikes 5 times in 3 s ({len(strikes)})", len(strikes) == 5)
    radius, wall = 0.03, 0.002
    gyration2 = 0.4 * (radius**5 - (radius - wall) ** 5) / (radius**3 - (radius - wall) ** 3)
    mobility = G * ROD_M / (ROD_M**2 + gyration2)
    quarter, speed = calc_quarter(mobility), ROD_M * math.sqrt(2 * mobility * (1 - math.cos(ANGLE)))
    stage.compare("speed of the first strike against the energy of its fall [m/s]", strikes[0][1], speed, 0.5)
    onsets = find_onsets(samples)
    travel = numpy.linalg.norm(EAR_M * [-1, 1, 1] - [0, 0, PIVOT_M - ROD_M]) / SOUND_SPEED
    stage.expect(
        f"the first strike is heard when the pendulum has fallen, to 3 ms ({1e3 * (onsets[0] - travel - quarter):+.1f} ms)",
        abs(onsets[0] - travel - quarter) < 3e-3,
    )
    stage.expect(f"every strike is heard ({len(onsets)} onsets)", len(onsets) == len(strikes))
    first = samples[int(onsets[0] * RATE) :]
    stage.compare("the lowest mode of the bobs in the sound [Hz]", *[f(first, bank) for f in (find_pitch, get_pitch)], 0.5)
    rows = [("strike", "time [s]", "speed of approach [m/s]", "level [dB]")]
    for number, ((time, before), onset) in enumerate(zip(strikes, onsets), 1):
        rows.append((number, f"{time:.3f}", f"{before:.3f}", f"{calc_level(samples[int(onset * RATE) :][: RATE // 8]):.1f}"))
    stage.show("strikes", rows)
    draw(stage, samples, "clock")


def get_pitch(_, bank):
    return bank["corrected_frequencies_hz"][0]


def find_pitch(samples, bank):
    return measure.find_peak(samples, RATE, get_pitch(samples, bank), 0.02)


def play_arm(stage):
    stage.solve("box.json", "box", quick={"body.nodes": 2500})
    text, samples = play_program(stage, "simbody_arm", "box")
    released, z, up = map(float, re.search(r"released at (\S+) s, (\S+) m high, (\S+) m/s", text).groups())
    landed, height = map(float, re.search(r"lands at (\S+) s, (\S+) m high", text).groups())
    fall = landed - released
    off = height - (z + up * fall - G * fall**2 / 2)
    stage.expect(f"the box falls freely from the hand to the floor (off by {1e3 * off:.2f} mm)", abs(off) < 1e-3)
    onsets = find_onsets(samples)
    stage.expect(f"it is silent until it lands at {landed:.3f} s and heard within 10 ms ({onsets[0]:.3f} s)", 0 < onsets[0] - landed < 0.01)
    levels = {
        "in flight": calc_level(samples[: int(landed * RATE)]),
        "landing, 0.125 s": calc_level(samples[int(onsets[0] * RATE) :][: RATE // 8]),
        "last 0.5 s": calc_level(samples[-RATE // 2 :]),
    }
    stage.expect(f"at rest it is below 20 dB ({levels['last 0.5 s']:.0f})", levels["last 0.5 s"] < 20)
    stage.show("arm", [("part", "level [dB]"), *((part, f"{level:.0f}" if level > 20 else "20 or less") for part, level in levels.items())])
    draw(stage, samples, "arm")


def play(stage):
    play_clock(stage)
    play_arm(stage)
