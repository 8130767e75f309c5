"""The scenes of O'Brien, Cook and Essl (2001): a bowl that falls, a plucked bar, plates struck on and off their centre, a vibraphone bar,
swinging bars, a ball on sheets that yield and on one that does not, bowed sheets that crinkle. Each is simulated in full, without modes.
One page of scenes that share the same few tools; longer than most files."""
import json
import math
import pathlib
import sys

import h5py
import numpy

import measure
import stage as tools

sys.path.append(str(pathlib.Path(__file__).resolve().parent))
import meshes

# Minutes for one second of motion of Table 1, on one processor of 350 MHz, and its element-steps per second.
TABLE_1 = {"bar": (240.4, 183_722), "pendulum": (88.4, 176_596), "vibraphone": (1309.7, 188_847)}
CLAMPED = (35.985, 73.394, 108.217, 131.581, 132.205, 165.0)  # lambda squared of a clamped square plate (Leissa 1969)
CANTILEVER = (1.875104068711961, 4.694091132974175, 7.854757438237613)  # roots of 1 + cos x cosh x
VIBRAPHONE = (184.980552, 739.889902, 1849.69685)  # the undercut bar's bending modes [Hz], by a Ritz solution of high order
SOUND_M_S, GRAVITY = 343.0, 9.81
COSTS = [("scene", "elements", "step [s]", "CPU s", "minutes for 1 s", "Table 1, minutes", "of it sound", "book error")]


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
        f" one second), {record['element_steps_per_second']:.3g} element-steps a second of CPU time, peak {record['peak_pa']:.3g} Pa"
    )
    minutes_1 = next((f"{TABLE_1[key][0]:g}" for key in TABLE_1 if name.startswith(key)), "lost")
    share = record["sound_cpu_seconds"] / record["cpu_seconds"]
    row = (name, record["elements"], f"{record['step_s']:.2g}", f"{record['cpu_seconds']:.1f}", f"{minutes:.2f}", minutes_1)
    COSTS.append((*row, f"{100 * share:.0f} %", f"{record['book_error']:.0e}"))
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
        rate, samples, record = simulate(stage, "bar.json", name, {bar: bodies}, {bar: short, "simulate.duration_s": 0.06})
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


def play_pluck(stage):
    """Figure 5, plucked: the bar bent by 10 N at its end, then released."""
    beam = calc_bending_hz(0, 0.2, 0.01, 70e9, 2700)
    short = {"simulate.duration_s": 0.06}
    rate, samples, record = simulate(stage, "pluck.json", "bar-plucked", None, short)
    first = measure.find_peak(samples, rate, beam, 0.2)
    bent = record["bent"][0]
    energy = 10**2 * 0.2**3 / (6 * 70e9 * 0.02 * 0.01**3 / 12)
    rows = [
        ("bar-plucked", "f1 [Hz]", "bent by [mm]", "energy at the start [mJ]", "put in later [mJ]", "CPU s to bend it"),
        ("Euler's beam", f"{beam:.1f}", f"{2e3 * energy / 10:.4f}", f"{1e3 * energy:.4f}", "0", ""),
    ]
    work = record["books"][-1]["work_j"]
    found = (f"{first:.1f}", f"{1e3 * bent['displacement_m']:.4f}", f"{1e3 * bent['energy_j']:.4f}", f"{1e3 * work:.1g}")
    tools.print_table([*rows, ("found", *found, f"{bent['cpu_seconds']:.2f}")])
    stage.compare("the first line of the plucked bar against the beam [Hz]", first, beam, 2.5)
    stage.expect("the bar has the energy of a bent beam to 5 %", abs(bent["energy_j"] / energy - 1) < 0.05)
    stage.expect("nothing is put in when it is let go", abs(work) < 1e-9 * energy)


def compare_blows(stage, off, on, rate, unit, limit_db=-30):
    """Lines of a clamped square plate [Hz] off its centre, and how far below those are the lines of the blow on it [dB]."""
    rows = [("line", "clamped plate [Hz]", "found [Hz]", "cents", "centre against off [dB]")]
    hz, below = [], []
    for factor in CLAMPED[:4]:
        hz.append(measure.find_peak(off if factor < 120 else on, rate, 0.98 * factor * unit, 0.06))
        below.append(find_level(on, rate, hz[-1]) - find_level(off, rate, hz[-1]))
        rows.append((len(hz), f"{factor * unit:.1f}", f"{hz[-1]:.1f}", f"{cents(hz[-1], factor * unit):+.0f}", f"{below[-1]:+.1f}"))
    tools.print_table(rows)
    lower = f"lines 2 and 3 are {-limit_db} dB down on the centre ({below[1]:.0f}, {below[2]:.0f} dB)"
    stage.expect(lower, max(below[1:3]) < limit_db)
    return hz


def calc_plate_unit(thickness):
    """Hz for a lambda squared of 1: steel, 0.3 m a side."""
    return math.sqrt(200e9 * thickness**2 / (12 * (1 - 0.3**2) * 7850)) / (2 * math.pi * 0.3**2)


def play_plate(stage):
    """Figures 6 and 7 as a thin sheet: the lines of the plate by two meshes, and which of them a blow on the centre leaves out."""
    unit = calc_plate_unit(0.001)
    document = tools.read_json(stage.folder / "plate.json")["simulate"]
    blow, body = document["impulses"][0], document["bodies"][0]
    lines, spectra = {}, []
    for cells in (12, 16) if stage.quick else (16, 24):
        changes = {"simulate.bodies": [{**body, "sheet": {**body["sheet"], "cells": cells}}]}
        quick = {"simulate.duration_s": 0.1}
        rate, off, _ = simulate(stage, "plate.json", f"plate-off-{cells}", changes, quick)
        lines[cells] = [
            measure.find_peak(off[int(0.003 * rate) :], rate, (0.92 if stage.quick else 0.96) * f * unit, 0.08)
            for f in CLAMPED[: 2 if stage.quick else 3]
        ]
    if not stage.quick:
        rate, on, _ = simulate(stage, "plate.json", "plate-on", {**changes, "simulate.impulses": [{**blow, "point_m": [0, 0, 0]}]})
        off, on = off[int(0.003 * rate) :], on[int(0.003 * rate) :]
        compare_blows(stage, off, on, rate, unit)
        spectra = [("off the centre", *measure.calc_spectrum(off, rate)), ("on the centre", *measure.calc_spectrum(on, rate))]
    (coarse, low), (fine, high) = lines.items()
    rows = [("line", "clamped plate [Hz]", *(f"{cells} cells [cents]" for cells in lines), "extrapolated [Hz]", "cents")]
    for number, factor in enumerate(CLAMPED[: 2 if stage.quick else 3]):
        # The error falls with the square of the cell.
        hz = (fine**2 * high[number] - coarse**2 * low[number]) / (fine**2 - coarse**2)
        wanted = factor * unit
        off_by = [f"{cents(one[number], wanted):+.0f}" for one in lines.values()]
        rows.append((number + 1, f"{wanted:.2f}", *off_by, f"{hz:.2f}", f"{cents(hz, wanted):+.0f}"))
        stage.compare(f"line {number + 1} of the plate, extrapolated from two meshes [Hz]", hz, wanted, 5 if stage.quick else 1)
    tools.print_table(rows)
    if not stage.quick:
        import pictures

        pictures.draw_spectra(stage, "oce01-plate.png", spectra, 1000, [factor * unit for factor in CLAMPED])


def play_solid(stage):
    """The same with finite thickness, as a solid of T10."""
    unit, found = calc_plate_unit(0.006), {}
    blow = tools.read_json(stage.folder / "solid.json")["simulate"]["impulses"][0]
    grids = (8,) if stage.quick else (12, 16)
    for cells in grids:
        meshes.write_box(stage.out / "solid.msh", (cells, cells, 1), (0.3, 0.3, 0.006))
        rate, off, _ = simulate(stage, "solid.json", f"solid-off-{cells}", {}, {"simulate.duration_s": 0.02})
        off = off[int(0.002 * rate) :]
        found[cells] = [measure.find_peak(off, rate, (1.15 if stage.quick else 1.05) * factor * unit, 0.1) for factor in CLAMPED[:3]]
    changes = {"simulate.impulses": [{**blow, "point_m": [0, 0, 0.003]}]}
    rate, on, _ = simulate(stage, "solid.json", "solid-on", changes, {"simulate.duration_s": 0.02})
    on = on[int(0.002 * rate) :]
    rows = [("line", "clamped plate [Hz]", *(f"{cells} cells [cents]" for cells in grids), "centre against off [dB]")]
    below = []
    for number, factor in enumerate(CLAMPED[:3]):
        hz = found[grids[-1]][number]
        below.append(find_level(on, rate, hz) - find_level(off, rate, hz))
        rows.append(
            (
                number + 1,
                f"{factor * unit:.1f}",
                *(f"{cents(found[cells][number], factor * unit):+.0f}" for cells in grids),
                f"{below[-1]:+.1f}",
            )
        )
    tools.print_table(rows)
    stage.expect(f"solid: lines 2 and 3 are 30 dB down on the centre ({below[1]:.0f}, {below[2]:.0f} dB)", max(below[1:3]) < -30)
    for number, factor in enumerate(CLAMPED[:3]):
        stage.compare(f"line {number + 1} of the solid plate [Hz]", found[grids[-1]][number], factor * unit, 25 if stage.quick else 3)


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
    # The rigid one, inclined: friction turns the ball, and it rolls off.
    quick = {"simulate.duration_s": 0.1}
    _, _, record = simulate(stage, "roll.json", "ball-rolls", {}, quick)
    ball, tilt, radius = record["strikers"][0], math.radians(10), 0.015
    spin = ball["angular_velocity_rad_s"][1] * radius
    # Rolls without slip: 5/7 of what it has along the slope after its fall, and 5/7 of g sin a on the way to the rim.
    along = 5 / 7 * (0.5 + GRAVITY * 0.0005 / 0.5) * math.sin(tilt)
    if stage.quick:
        start = 0.001
        wanted = along + 5 / 7 * GRAVITY * math.sin(tilt) * (record["duration_s"] - start)
    else:
        wanted = math.sqrt(along**2 + 2 * 5 / 7 * GRAVITY * math.sin(tilt) * 0.09)
        stage.expect("the ball has rolled over the rim", ball["position_m"][0] > 0.15 * math.cos(tilt))
    print(f"  ball-rolls: turns with {spin:.4f} m/s at its rim, rigid bodies {wanted:.4f} m/s")
    stage.compare("speed at which the ball rolls [m/s]", spin, wanted, 5 if stage.quick else 2)
    stage.expect("the thick one takes nearly all of its energy as waves", abs(found["ball-stiff"][1]) < 0.3)


def play_bowed(stage):
    """Figure 11: the sheet snaps, and each snap is a click over the whole band."""
    rate, samples, record = simulate(stage, "bowed.json", "bowed")
    times, places, points = read_motion(stage, "bowed")
    freq, level = measure.calc_spectrum(samples, rate)
    power = 10 ** (level / 10)
    high = 10 * math.log10(power[(freq > 2000) & (freq < 16000)].sum() / power[(freq > 100) & (freq < 2000)].sum())
    books = record["books"]
    print(f"  bowed: work {books[-1]['work_j']:.3g} J, lost {books[-1]['dissipated_j']:.3g} J, above 2 kHz {high:+.1f} dB of what is below")
    stage.expect("the sheet bends by more than 20 times its thickness", numpy.ptp(places[:, points[0], 2]) > 0.02)
    stage.expect(f"crinkling reaches above 2 kHz ({high:+.1f} dB)", high > -40)


def calc_high_level(samples, rate, above_hz=2000, window_s=0.001):
    """Level [dB] of what lies above a frequency, a value a millisecond."""
    spectrum = numpy.fft.rfft(samples[:, 0])
    spectrum[numpy.fft.rfftfreq(len(samples), 1 / rate) < above_hz] = 0
    width = int(window_s * rate)
    power = numpy.convolve(numpy.fft.irfft(spectrum, len(samples)) ** 2, numpy.ones(width) / width, "same")[::width]
    return 10 * numpy.log10(power + 1e-18)


def play_crinkle(stage):
    """Figure 11 as single events: a sheet that is bowed across snaps when it is bent along, at the same place of each swing."""
    rate, samples, record = simulate(stage, "crinkle.json", "crinkle", quick={"simulate.duration_s": 0.12})
    times, places, _ = read_motion(stage, "crinkle")
    level = calc_high_level(samples, rate)
    snaps, step = [], 0.001
    for i in range(4, len(level)):
        # What rises by 15 dB within 4 ms, to 30 dB below the loudest or more; none within 20 ms of the one before.
        if level[i] - level[i - 4 : i].min() > 15 and level[i] > level.max() - 30 and not (snaps and i * step < snaps[-1] + 0.02):
            snaps.append(i * step)
    start = places[0]
    middle = abs(start[:, 1]) < 0.007
    across = [middle & (abs(start[:, 0] - x) < 0.004) for x in (start[:, 0].min(), 0, start[:, 0].max())]
    sides, centre = 0.5 * (places[:, across[0], 2].mean(1) + places[:, across[2], 2].mean(1)), places[:, across[1], 2].mean(1)
    bow = 1e3 * (centre - sides)
    rows = [("snap [s]", "rise above 2 kHz [dB]", "bow across, 4 ms before and after [mm]")]
    moved = []
    for snap in snaps:
        at = int(snap / step)
        ends = [bow[numpy.argmin(abs(times - t))] for t in (snap - 0.004, snap + 0.008)]
        moved.append(abs(ends[1] - ends[0]))
        rise = level[at : at + 5].max() - level[max(0, at - 8) : at].min()
        rows.append((f"{snap:.3f}", f"{rise:.0f}", f"{ends[0]:.2f}, {ends[1]:.2f}"))
    tools.print_table(rows)
    wanted = 1 if stage.quick else 3
    stage.expect(f"the sheet snaps {len(snaps)} times, {wanted} or more wanted", len(snaps) >= wanted)
    stage.expect("at each snap its bow across moves by more than its thickness", snaps and min(moved) > 0.3)
    if not stage.quick:
        import pictures

        driven = start[:, 1] > start[:, 1].max() - 1e-6
        path = 1e3 * (places[:, driven, 2].mean(1) - start[driven, 2].mean())
        rows = [
            ("end [mm]", [("", times, path, "-")]),
            ("bow across [mm]", [("", times, bow, "-")]),
            ("above 2 kHz [dB]", [("", step * numpy.arange(len(level)), level - level.max(), "-")]),
        ]
        pictures.draw_courses(stage, "oce01-crinkle.png", rows, snaps)


def play_bowl(stage):
    """Figure 1: a bowl falls and is heard five times; its lines are the modes of the same mesh, each impact with other levels."""
    nodes = 400 if stage.quick else 1200
    shape = ("--shape", "bowl", "--outer-radius", "0.08", "--wall", "0.005", "--nodes", nodes)
    stage.run("the bowl's mesh", stage.bin / "carillon-mesh", "-q", *shape, "--order", "2", "--straight", "-o", "bowl.msh")
    bank = stage.solve("bowl-modes.json", "bowl-modes")
    document = tools.read_json(stage.folder / "bowl.json")["simulate"]["bodies"][0]
    quick = {"simulate.bodies": [{**document, "position_m": [0, 0, 0.081], "velocity_m_s": [0, 0, -0.6]}], "simulate.duration_s": 0.06}
    rate, samples, _ = simulate(stage, "bowl.json", "bowl", {}, quick)
    times, places, _ = read_motion(stage, "bowl")
    # An impact begins where the mean of the surface is thrown up by 0.1 m/s within 2 ms, 20 ms or more after the one before.
    rise = numpy.diff(places[:, :, 2].mean(1)) / numpy.diff(times)
    thrown = times[numpy.flatnonzero(rise[4:] - rise[:-4] > 0.1) + 4]
    impacts = [at for i, at in enumerate(thrown) if i == 0 or at > thrown[i - 1] + 0.02]
    width = int(0.002 * rate)
    power = numpy.add.reduceat(samples[:, 0] ** 2, numpy.arange(0, len(samples), width))
    level = 10 * numpy.log10(power + 1e-18)
    heard = [
        at for at in impacts if any(level[k] - level[k - 1] > 6 for k in range(int(at / 0.002), min(len(level), int(at / 0.002) + 4)) if k)
    ]
    print(f"  bowl: {len(impacts)} impacts, {len(heard)} of them heard as an onset: {', '.join(f'{at:.3f}' for at in impacts)} s")
    wanted = 1 if stage.quick else 5
    stage.expect(f"the bowl is heard {len(heard)} times, {wanted} or more wanted", len(heard) >= wanted)
    modes = bank["frequencies_hz"]
    # Lines of the longest time without an impact.
    ends = [*impacts[1:], times[-1]]
    longest = max(range(len(impacts)), key=lambda i: ends[i] - impacts[i])
    ring = samples[int((impacts[longest] + 0.004) * rate) : int(ends[longest] * rate)]
    rows, worst, lines = [("mode of the mesh [Hz]", "line [Hz]", "cents")], 0, []
    for hz, _ in measure.find_peaks(ring, rate, 300, 8500, 8, 30):
        nearest = min(modes, key=lambda mode: abs(mode - hz))
        rows.append((f"{nearest:.1f}", f"{hz:.1f}", f"{cents(hz, nearest):+.1f}"))
        worst = max(worst, abs(cents(hz, nearest)))
        lines.append(hz)
    tools.print_table(rows)
    bin_hz = 1 / (len(ring) / rate)
    stage.expect(f"every line is a mode of the mesh, to {worst:.0f} cents (the window resolves {bin_hz:.0f} Hz)", worst < 30)
    if stage.quick:
        return
    rows, levels = [("impact at [s]", *(f"{hz:.0f} Hz" for hz in lines))], []
    for i, at in enumerate(impacts[:5]):
        piece = samples[int((at + 0.003) * rate) : int(min(ends[i], at + 0.045) * rate)]
        levels.append([find_level(piece, rate, hz) for hz in lines])
        levels[-1] = [one - max(levels[-1]) for one in levels[-1]]
        rows.append((f"{at:.3f}", *(f"{one:.0f}" for one in levels[-1])))
    print("  levels after each impact, the strongest line at 0 dB:")
    tools.print_table(rows)
    spread = numpy.ptp(numpy.array(levels), axis=0).max()
    stage.expect(f"impacts excite the modes differently: a line differs by {spread:.0f} dB against the others", spread > 10)
    import pictures

    pictures.draw_fall(stage, "oce01-bowl.png", samples, rate, impacts, modes, 9000)


def play_vibraphone(stage):
    """Figure 8: T4 of 2 cm and of 1 cm are far too high, which moving f1 to its place hides; T10 are right."""
    rows = [("mesh", "nodes along", *(f"line {n + 1} [Hz] (cents)" for n in range(3)), "ratios")]
    runs = [
        ("t4-2cm", "T4", (18, 3, 1), 3.9),
        ("t4-1cm", "T4", (36, 5, 1), 2.4),
        ("t4-1cm-2", "T4", (36, 5, 2), 2.2),
        ("t10", "T10", (24, 3, 1), 1.0),
    ]
    if stage.quick:
        runs = [runs[0], ("t10", "T10", (12, 2, 1), 1.01)]
    rows.append(("true", "", *(f"{hz:.1f}" for hz in VIBRAPHONE), "1 : 4.00 : 10.00"))
    body = tools.read_json(stage.folder / "vibraphone.json")["simulate"]["bodies"][0]
    found, spectra = {}, []
    for name, element, cells, about in runs:
        meshes.write_vibraphone(stage.out / "vibraphone.msh", cells)
        changes = {"simulate.bodies": [{**body, "element": element}]}
        rate, samples, _ = simulate(stage, "vibraphone.json", f"vibraphone-{name}", changes, {"simulate.duration_s": 0.05})
        samples = samples[int(0.003 * rate) :]
        first = measure.find_peak(samples, rate, about * VIBRAPHONE[0], 0.15)
        second = measure.find_peak(samples, rate, (3.4 if element == "T4" else 4.05) * first, 0.12)
        third = measure.find_peak(samples, rate, (7.6 if element == "T4" else 10.15) * first, 0.12)
        found[name] = (first, second, third)
        shown = [f"{hz:.1f} ({cents(hz, true):+.0f})" for hz, true in zip(found[name], VIBRAPHONE)]
        rows.append((name, cells[0] + 1, *shown, f"1 : {second / first:.2f} : {third / first:.2f}"))
        freq, level = measure.calc_spectrum(samples, rate)
        spectra.append((f"{name}, x {first / VIBRAPHONE[0]:.2f}", freq * VIBRAPHONE[0] / first, level))
    tools.print_table(rows)
    coarse = found["t4-2cm"][0] / VIBRAPHONE[0]
    stage.compare("T4 of 2 cm, the first line against the lumped T4 of another program [Hz]", found["t4-2cm"][0], 731.08, 1.5)
    if not stage.quick:
        for name in ("t4-1cm", "t4-1cm-2"):
            factor = found[name][0] / VIBRAPHONE[0]
            stage.expect(f"{name}: {factor:.2f} times too high (2.1 to 2.5)", 2.1 < factor < 2.5)
        stage.expect("T10 has its first line within 12 cents", abs(cents(found["t10"][0], VIBRAPHONE[0])) < 12)
    else:
        stage.expect(f"T4 of 2 cm is {coarse:.1f} times too high, T10 right", abs(cents(found["t10"][0], VIBRAPHONE[0])) < 60)
    flat = [cents(hz[2] / hz[0], VIBRAPHONE[2] / VIBRAPHONE[0]) for name, hz in found.items() if name.startswith("t4")]
    stage.expect(f"moved to f1, the third line of T4 is flat by {-max(flat):.0f} cents or more", max(flat) < -100)
    if not stage.quick:
        import pictures

        pictures.draw_spectra(stage, "oce01-vibraphone.png", spectra, 4000, VIBRAPHONE)


def track_line(samples, rate, hz, half_hz):
    """Frequency [Hz] and size of the analytic signal of what lies within half_hz of hz."""
    freq = numpy.fft.fftfreq(len(samples), 1 / rate)
    band = numpy.where(abs(freq - hz) < half_hz, 0.5 + 0.5 * numpy.cos(numpy.pi * (freq - hz) / half_hz), 0)
    signal = numpy.fft.ifft(2 * numpy.fft.fft(samples) * band)
    return numpy.gradient(numpy.unwrap(numpy.angle(signal))) * rate / (2 * numpy.pi), abs(signal)


def play_carried(stage):
    """Figure 9 as a closed form: a bar of 500 Hz goes to and fro by 0.5 m, 0.7 times a second, 2 m in front of the microphone."""
    far, rate_hz, distance, start = 0.5, 0.7, 2.0, 0.01
    meshes.write_bar_with_nodes(stage.out / "carried.msh", (0.3, 0.02, 0.0086), 0.2242)
    at = 0.3 * (0.5 - 0.2242)
    boxes = [{"box_m": {"min": [sign * at - 1e-4, -1, -1e-4], "max": [sign * at + 1e-4, 1, 1e-4]}} for sign in (-1, 1)]
    path = [[0, 0, 0, 0]]
    for i in range(1, 57):
        path.append([start + i / 56 / rate_hz, round(far - far * math.cos(2 * math.pi * i / 56), 9), 0, 0])
    body = tools.read_json(stage.folder / "carried.json")["simulate"]["bodies"][0]
    still = {"simulate.bodies": [{**body, "fixed": boxes}], "simulate.duration_s": 0.25}
    rate, samples, _ = simulate(stage, "carried.json", "pendulum-held", still, {"simulate.duration_s": 0.06})
    hz = measure.find_peak(samples[int(0.02 * rate) :], rate, 500, 0.05)
    decay = 0.5 * (1 + 1e-8 * (2 * math.pi * hz) ** 2)
    stage.compare("the bar's line at rest [Hz]", hz, 500, 1.0 if stage.quick else 0.5)
    if stage.quick:
        return
    moving = {"simulate.bodies": [{**body, "drive": [{**box, "path": path} for box in boxes]}]}
    rate, samples, _ = simulate(stage, "carried.json", "pendulum-carried", moving)
    found, size = track_line(samples[:, 0], rate, hz, 40)
    times = numpy.arange(len(samples)) / rate
    # When what is heard now was sent: place and time of the source by its own path.
    sent = numpy.linspace(-0.02, times[-1], 200_000)
    place = -far * numpy.cos(2 * numpy.pi * rate_hz * numpy.clip(sent - start, 0, 1 / rate_hz))
    sent_at = numpy.interp(times, sent + (distance - place) / SOUND_M_S, sent)
    wanted = hz * numpy.gradient(sent_at, times)
    kept = (times > 0.06) & (times < 1.4)
    speed = 2 * math.pi * rate_hz * far
    bounds = [hz / (1 + speed / SOUND_M_S), hz / (1 - speed / SOUND_M_S)]
    swing = 20 * numpy.log10(size * numpy.exp(decay * sent_at))[kept]
    closed = 20 * math.log10((distance + far) / (distance - far))
    rows = [("", "lowest [Hz]", "highest [Hz]", "level swing [dB]")]
    scale = 500 / hz
    rows.append(("closed form, scaled to 500 Hz", *(f"{scale * one:.2f}" for one in bounds), f"{closed:.2f}"))
    rows.append(("found", *(f"{scale * one:.2f}" for one in (found[kept].min(), found[kept].max())), f"{numpy.ptp(swing):.2f}"))
    tools.print_table(rows)
    away = abs(found - wanted)[kept].max()
    stage.expect(f"the line follows the moving source to {away:.2f} Hz of {hz * speed / SOUND_M_S:.2f} Hz", away < 0.15)
    stage.expect(f"its level swings by {numpy.ptp(swing):.2f} dB, {closed:.2f} +- 0.4 dB wanted", abs(numpy.ptp(swing) - closed) < 0.4)
    import pictures

    shown = numpy.where(kept, found, numpy.nan)
    level = numpy.full(len(samples), numpy.nan)
    level[kept] = swing - swing.mean()
    apart = 20 * numpy.log10(distance / (distance - numpy.interp(sent_at, sent, place)))
    rows = [
        ("line [Hz]", [("found", shown, "-"), ("moving source", wanted, "--")]),
        ("level [dB]", [("found, decay taken away", level, "-"), ("1/r", apart - apart[kept].mean(), "--")]),
    ]
    pictures.draw_pendulum(stage, "oce01-carried.png", samples, rate, times, rows)


def play_pendulum(stage):
    """Figure 9 as it is: a bar on a hinge swings by its weight and is struck."""
    length, thickness = 0.4, 0.0225
    meshes.write_box(stage.out / "pendulum.msh", (12, 1, 1), (length, 0.02, thickness))
    rate, samples, _ = simulate(stage, "pendulum.json", "pendulum-swings", {}, {"simulate.duration_s": 0.08})
    times, places, _ = read_motion(stage, "pendulum-swings")
    tip = places[:, numpy.linalg.norm(places[0], axis=1) > length - 1e-3].mean(1)
    angle = numpy.arctan2(tip[:, 0], -tip[:, 2])
    # theta'' = -w2 sin theta, from the angle and speed after the blow; its energy says the speed at each angle.
    w2 = GRAVITY * (length / 2) / (length**2 / 3 + thickness**2 / 12)
    speed = numpy.gradient(angle, times)
    energy = (0.5 * speed**2 - w2 * numpy.cos(angle))[(times > 0.03)]
    stage.expect(f"the pendulum keeps its energy to {numpy.ptp(energy) / (2 * w2):.1g} of m g l", numpy.ptp(energy) / (2 * w2) < 0.02)
    if stage.quick:
        return
    top = abs(angle[times > 0.1]).max()
    a, b = 1.0, math.cos(top / 2)
    while abs(a - b) > 1e-14:
        a, b = (a + b) / 2, math.sqrt(a * b)
    half = math.pi / (a * math.sqrt(w2))
    crossings = []
    for i in numpy.flatnonzero(angle[1:] * angle[:-1] < 0):
        crossings.append(times[i] + (times[i + 1] - times[i]) * angle[i] / (angle[i] - angle[i + 1]))
    stage.compare(f"half a period at {math.degrees(top):.1f} degrees, elliptic integral [s]", crossings[1] - crossings[0], half, 0.5)
    hz = 500.4
    found, size = track_line(samples[:, 0], rate, hz, 60)
    now = numpy.arange(len(samples)) / rate
    decay = 0.5 * (2 + 1e-8 * (2 * math.pi * hz) ** 2)
    kept = (now > 0.06) & (now < now[-1] - 0.03)
    level = 20 * numpy.log10(size * numpy.exp(decay * now))
    level -= level[kept].mean()
    slope = numpy.polyfit(now[kept], level[kept], 1)[0]
    print(f"  pendulum-swings: what the decay of {8.686 * decay:.2f} dB/s leaves rises by {slope:.2f} dB/s")
    fastest = length * math.sqrt(2 * w2 * (1 - math.cos(top)))
    rest = 0.5 * (found[kept].max() + found[kept].min())
    bound = rest * fastest / SOUND_M_S
    rows = [("line near 500 Hz", "lowest [Hz]", "highest [Hz]", "level swing [dB]")]
    rows.append(("found", f"{found[kept].min():.2f}", f"{found[kept].max():.2f}", f"{numpy.ptp(level[kept]):.1f}"))
    rows.append(("no more than the tip's speed allows", f"{rest - bound:.2f}", f"{rest + bound:.2f}", ""))
    tools.print_table(rows)
    swing = found[kept].max() - found[kept].min()
    stage.expect(f"its frequency swings by {swing:.2f} Hz, by no more than {2 * bound:.2f} Hz", 0.3 * bound < swing < 2.2 * bound)
    stage.expect(f"its level swings by {numpy.ptp(level[kept]):.1f} dB", numpy.ptp(level[kept]) > 1)
    stage.compare("it decays by its law [dB/s]", 8.686 * decay - slope, 8.686 * decay, 6)
    import pictures

    shown = numpy.where(kept, found, numpy.nan)
    rows = [("line [Hz]", [("", shown, "-")]), ("level [dB]", [("", numpy.where(kept, level, numpy.nan), "-")])]
    pictures.draw_pendulum(stage, "oce01-pendulum.png", samples, rate, now, rows)


def play(stage):
    stage.pictures_to = tools.HERE.parent / "images"
    for part in (
        play_bowl,
        play_bar,
        play_pluck,
        play_plate,
        play_solid,
        play_vibraphone,
        play_carried,
        play_pendulum,
        play_ball,
        play_bowed,
        play_crinkle,
    ):
        if part is play_bowed and stage.quick:
            continue  # play_crinkle() has the same drives on the same kind of sheet
        part(stage)
    print()
    stage.show("costs", COSTS, COSTS[0][3:5] + COSTS[0][6:])
    total = sum(float(row[3]) for row in COSTS[1:])
    rate = TABLE_1["bar"][1]
    print(f"\n  {total:.0f} CPU seconds; the processor of Table 1, of 350 MHz, made {rate:,} element-steps a second")
