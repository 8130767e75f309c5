"""The scenes of O'Brien, Cook and Essl (2001): a bar that is plucked, a plate struck on and off its centre, a ball on a sheet that yields
and on one that does not, a bowed sheet bent back and forth. Each is simulated in full, without modes."""
import json
import math

import h5py
import numpy

import measure
import stage as tools

# Minutes for one second of motion of Table 1, on one processor of 350 MHz, and its element-steps per second.
TABLE_1 = {"bar": (240.4, 183_722), "pendulum": (88.4, 188_856), "vibraphone": (1309.7, 176_596)}
CLAMPED = (35.985, 73.394, 108.217, 131.581, 132.205, 165.0)  # lambda squared of a clamped square plate (Leissa 1969)
CANTILEVER = (1.875104068711961, 4.694091132974175, 7.854757438237613)  # roots of 1 + cos x cosh x


def simulate(stage, job, name, changes=None, quick=None):
    """Runs a job with some of its values changed. (rate, sound in Pa, record)"""
    outputs = {"sound": f"{name}.wav", "motion": f"{name}.vtkhdf", "record": f"{name}.record.json"}
    document = tools.change(tools.read_json(stage.folder / job), {**(changes or {}), **(quick or {} if stage.quick else {}), **outputs})
    (stage.out / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n")
    stage.run(f"the simulation {name}", stage.bin / "carillon-simulate", "-q", f"{name}.json")
    record = json.loads((stage.out / f"{name}.record.json").read_text())
    rate, samples = measure.read_wav(stage.out / f"{name}.wav")
    minutes = record["cpu_seconds"] / document["simulate"]["duration_s"] / 60
    print(
        f"  {name}: {record['elements']} elements, step {record['step_s']:.3g} s, {record['cpu_seconds']:.1f} CPU s ({minutes:.2f} min for"
        f" one second), {record['element_steps_per_second']:.3g} element-steps a second, peak {record['peak_pa']:.3g} Pa"
    )
    stage.expect(f"{name}: the energy book closes to 1e-5 ({record['book_error']:.1g})", record["book_error"] < 1e-5)
    stage.expect(f"{name} sounds", numpy.isfinite(samples).all() and record["peak_pa"] > 0)
    return rate, samples / record["gain_per_pa"], record


def read_motion(stage, name):
    """(times, places (frames, points, 3), points of each body)"""
    with h5py.File(stage.out / f"{name}.vtkhdf") as file:
        root = file["VTKHDF"]
        times = root["Steps/Values"][:]
        places = root["Points"][:].reshape(len(times), -1, 3).astype(float)
        corners, body = root["Connectivity"][:].reshape(-1, 3), root["CellData/body"][:]
    return times, places, [numpy.unique(corners[body == one]) for one in numpy.unique(body)]


def calc_bending_hz(number, length, thickness, young, density):
    return CANTILEVER[number] ** 2 / (2 * math.pi) * thickness / length**2 * math.sqrt(young / (12 * density))


def find_level(samples, rate, hz):
    """Of the strongest line within 3 % of hz [dB, one reference]."""
    freq, level = measure.calc_spectrum(samples, rate)
    return level[(freq > 0.97 * hz) & (freq < 1.03 * hz)].max()


def cents(hz, wanted):
    return 1200 * math.log2(hz / wanted)


def play_bar(stage):
    """Figure 5: T10, and T4 one element thick, whose lines are flat in ratio to the first."""
    rows = [("bar", "f1 [Hz]", "off the beam [cents]", "f2 / f1", "CPU s for 1 s")]
    beam = [calc_bending_hz(n, 0.2, 0.01, 70e9, 2700) for n in range(3)]
    rows.append(("Euler's beam", f"{beam[0]:.1f}", "0", f"{beam[1] / beam[0]:.3f}", ""))
    found = {}
    bar = "simulate.bodies"
    document = tools.read_json(stage.folder / "bar.json")["simulate"]["bodies"]
    for name, element, nodes in (("bar-t10", "T10", 600), ("bar-t4", "T4", 125)):
        bodies = [{**document[0], "element": element, "shape": {"bar": {**document[0]["shape"]["bar"], "nodes": nodes}}}]
        short = [{**bodies[0], "shape": {"bar": {**document[0]["shape"]["bar"], "nodes": min(nodes, 300)}}}]
        rate, samples, record = simulate(stage, "bar.json", name, {bar: bodies}, {bar: short, "simulate.duration_s": 0.12})
        samples = samples[int(0.003 * rate) :]
        first = measure.find_peak(samples, rate, beam[0] * (1.0 if element == "T10" else 1.9), 0.2 if element == "T10" else 0.5)
        second = measure.find_peak(samples, rate, 6.15 * first, 0.06)
        found[name] = (first, second / first)
        seconds = record["cpu_seconds"] / record["duration_s"]
        rows.append((name, f"{first:.1f}", f"{cents(first, beam[0]):+.0f}", f"{second / first:.3f}", f"{seconds:.0f}"))
    tools.print_table(rows)
    stage.compare("the first line of T10 against the beam [Hz]", found["bar-t10"][0], beam[0], 2)
    stage.expect(
        "T4, one element thick, is far too high, and its second line is flat in ratio to its first",
        found["bar-t4"][0] > 1.3 * beam[0] and found["bar-t4"][1] < beam[1] / beam[0],
    )


def play_plate(stage):
    """Figures 6 and 7: the lines of the plate, and which of them a blow on the centre leaves out."""
    unit = math.sqrt(200e9 * 0.001**2 / (12 * (1 - 0.3**2) * 7850)) / (2 * math.pi * 0.3**2)
    quick = {"simulate.duration_s": 0.25}
    blow = tools.read_json(stage.folder / "plate.json")["simulate"]["impulses"][0]
    rate, off, _ = simulate(stage, "plate.json", "plate-off", quick=quick)
    _, on, _ = simulate(stage, "plate.json", "plate-on", {"simulate.impulses": [{**blow, "point_m": [0, 0, 0]}]}, quick)
    off, on = off[int(0.003 * rate) :], on[int(0.003 * rate) :]
    rows = [("line", "clamped plate [Hz]", "found [Hz]", "cents", "centre against off [dB]")]
    hz, below = [], []
    for factor in CLAMPED[:4]:
        hz.append(measure.find_peak(off if factor < 120 else on, rate, 0.97 * factor * unit, 0.05))
        below.append(find_level(on, rate, hz[-1]) - find_level(off, rate, hz[-1]))
        rows.append((len(hz), f"{factor * unit:.1f}", f"{hz[-1]:.1f}", f"{cents(hz[-1], factor * unit):+.0f}", f"{below[-1]:+.1f}"))
    tools.print_table(rows)
    for number in range(3):
        stage.compare(f"line {number + 1} of the plate [Hz]", hz[number], CLAMPED[number] * unit, 5)
    stage.expect(f"lines 2 and 3 are 30 dB down on the centre ({below[1]:.0f}, {below[2]:.0f} dB)", max(below[1:3]) < -30)


def play_ball(stage):
    """Figure 10: the sheet yields by many times its thickness; the thick plate takes the blow as waves."""
    rows = [("sheet", "depth [mm]", "speed of the ball, after and before [m/s]", "peak [Pa]")]
    found = {}
    sheet = tools.read_json(stage.folder / "ball.json")["simulate"]["bodies"][0]
    for name, thickness in (("ball-soft", 0.0002), ("ball-stiff", 0.005)):
        bodies = [{**sheet, "sheet": {**sheet["sheet"], "thickness_m": thickness}}]
        duration = 0.06 if thickness < 0.001 else 0.02
        ball = tools.read_json(stage.folder / "ball.json")["simulate"]["strikers"][0]
        ball = {**ball, "position_m": [0.01, 0.01, 0.0155 + thickness / 2]}
        _, _, record = simulate(
            stage, "ball.json", name, {"simulate.bodies": bodies, "simulate.strikers": [ball], "simulate.duration_s": duration}
        )
        _, places, points = read_motion(stage, name)
        depth = -1e3 * places[:, points[0], 2].min()
        speed = record["strikers"][0]["velocity_m_s"][2]
        found[name] = (depth, speed)
        rows.append((f"{1e3 * thickness:g} mm", f"{depth:.2f}", f"{speed:.2f}, -1.50", f"{record['peak_pa']:.0f}"))
    tools.print_table(rows)
    stage.expect(f"the thin sheet yields by more than 10 times its thickness ({found['ball-soft'][0]:.1f} mm)", found["ball-soft"][0] > 2)
    stage.expect(f"the thick one by less than a tenth of its own ({found['ball-stiff'][0]:.2f} mm)", found["ball-stiff"][0] < 0.5)
    stage.expect("the thin sheet throws the ball back, slower than it came", 0.3 < found["ball-soft"][1] < 1.5)
    stage.expect("the thick one takes nearly all of its energy as waves", abs(found["ball-stiff"][1]) < 0.3)


def play_bowed(stage):
    """Figure 11: the sheet snaps, and each snap is a click over the whole band."""
    rate, samples, record = simulate(stage, "bowed.json", "bowed", quick={"simulate.duration_s": 0.1})
    times, places, points = read_motion(stage, "bowed")
    freq, level = measure.calc_spectrum(samples, rate)
    power = 10 ** (level / 10)
    high = 10 * math.log10(power[(freq > 2000) & (freq < 16000)].sum() / power[(freq > 100) & (freq < 2000)].sum())
    books = record["books"]
    print(f"  bowed: work {books[-1]['work_j']:.3g} J, lost {books[-1]['dissipated_j']:.3g} J, above 2 kHz {high:+.1f} dB of what is below")
    stage.expect("the sheet bends by more than 20 times its thickness", numpy.ptp(places[:, points[0], 2]) > 0.02)
    stage.expect(f"crinkling reaches above 2 kHz ({high:+.1f} dB)", high > -40)


def play(stage):
    for part in (play_bar, play_plate, play_ball, play_bowed):
        part(stage)
    rate = TABLE_1["bar"][1]
    print(f"\n  Table 1 of the paper: {TABLE_1['bar'][0]} minutes for one second of its bar, {rate:,} element-steps a second")
