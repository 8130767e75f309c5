"""Section: large motion. Pitch error of full-order motion against CPU time, by elements, steps, sheets and solids; error of the
mode-coupling energy against its rows."""
import dataclasses
import json
import math

import plots
import sounds
from cents import to_cents
from lab import Case, calc_digest, calc_key, read_kept, write_whole
from section import Section
from sounds import np

NAME, TITLE = "motion", "Large motion: elements, steps, sheets, coupled modes"
PROGRAMS = ("carillon-precompute", "carillon-bank", "carillon-simulate", "carillon-render")
LOSSES = {"damping": {"rayleigh": {"alpha1_s": 1e-9, "alpha2_per_s": 2}}}
ALUMINIUM = {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700} | LOSSES
STEEL = {"young_modulus_pa": 200e9, "poisson_ratio": 0.3, "density_kg_m3": 7850} | LOSSES
LENGTH_M, SIDE_M = 0.2, 0.02  # bar
EDGE_M, THICKNESS_M = 0.3, 0.006  # plate
DISC_M, WALL_M, DISC_GAMMA = 0.2, 0.002, 0.5008  # clamped disc, nu = 0.3; gamma: von Karman's equations by Ritz's method
BAR_S, PLATE_S = (0.03, 0.01), (0.06, 0.03)  # all, quick
BAR_NODES = {"T4": ((150, 500, 1500), (150,)), "T10": ((150, 500, 1500), (150,))}
STEPS = ((1.0, 0.5, 0.25), (1.0, 0.5))  # relative to the default step
CELLS, PLATE_NODES = ((8, 12, 16, 24), (8, 12)), ((700, 1500), (700,))
# (nodes, energy_error)
DISCS = (((2500, 0.09), (2500, 0.01), (2500, 0.001), (9000, 0.01)), ((1200, 0.09),))
# Coupled modes of a hinged plate; the last count is the reference.
COUPLED, PLAYED_S, BLOW_N_S = ((1, 4, 12, 30, 60), (1, 4, 12)), (1.0, 0.35), 0.1
LOWEST_HZ = 55.0  # expected with large motion; 41.7 Hz for small amplitudes


@dataclasses.dataclass
class Run:
    """freq_hz: strongest line near the expected one; cpu_s: of the whole run."""

    freq_hz: float
    cpu_s: float
    step_s: float
    elements: int
    book_error: float


def calc_bar_hz(length_m, side_m, young_pa, nu, density):
    """First bending frequency of a free bar of square section, ASTM E1876."""
    r = (side_m / length_m) ** 2
    t1 = 1 + 6.585 * (1 + 0.0752 * nu + 0.8109 * nu**2) * r - 0.868 * r**2
    t1 -= 8.340 * (1 + 0.2023 * nu + 2.173 * nu**2) * r**2 / (1 + 6.338 * (1 + 0.1408 * nu + 1.536 * nu**2) * r)
    mass = density * length_m * side_m**2
    return math.sqrt(young_pa * side_m**4 / (0.9465 * mass * length_m**3 * t1))


def calc_plate_hz(edge_m, thickness_m, young_pa, nu, density):
    """Lowest mode of a square plate hinged on all sides, leading terms of Mindlin's theory."""
    k = math.sqrt(2) * math.pi / edge_m
    thin = k**2 * math.sqrt(young_pa * thickness_m**2 / (12 * density * (1 - nu**2))) / (2 * math.pi)
    return thin / math.sqrt(1 + (thickness_m * k) ** 2 / 12 * (1 + 2 / (math.pi**2 / 12 * (1 - nu))))


def find_line_hz(sound, rate, near_hz):
    """Strongest line from near_hz / 1.5 to 1.5 near_hz, by parabolic interpolation of the log magnitude."""
    level = np.log(np.abs(np.fft.rfft(sound * np.hanning(len(sound)), 1 << 20)) + 1e-300)
    step = rate / (1 << 20)
    low, high = int(near_hz / 1.5 / step), int(near_hz * 1.5 / step)
    at = low + int(level[low:high].argmax())
    below, middle, above = level[at - 1 : at + 2]
    return float((at + 0.5 * (below - above) / (below - 2 * middle + above)) * step)


def simulate(lab, name, body, duration_s, blow, near_hz, step_s=None):
    """Returns a Run, cached by the hash of its job."""
    job = {
        "simulate": {
            "duration_s": duration_s,
            "bodies": [{"name": "body"} | body],
            "impulses": [{"time_s": 1e-3, "body": "body"} | blow],
            "microphones": [[0, 0, 1.0]],
        }
        | ({"step_s": step_s} if step_s else {}),
        "sound": "sound.wav",
        "record": "record.json",
    }
    program = lab.find_program("carillon-simulate")
    folder = lab.runs / calc_key([calc_digest(program), job])
    kept = read_kept(folder / "kept.json")
    if kept is None:
        folder.mkdir(exist_ok=True)
        write_whole(folder / "job.json", json.dumps(job, indent=1) + "\n")
        cost = lab.call([program, "-q", "job.json"], name, cwd=folder)
        record = json.loads((folder / "record.json").read_text())
        sound = sounds.read_wav((folder / "sound.wav").read_bytes())
        begin = int(2.5e-3 * sound.rate_hz)  # after the blow
        hz = find_line_hz(sound.pressure_pa[begin:, 0], sound.rate_hz, near_hz)
        kept = {"freq_hz": hz, "cpu_s": cost.cpu_s, "step_s": record["step_s"], "elements": record["elements"]}
        kept["book_error"] = record["book_error"]
        lab.measured_s += cost.cpu_s
        lab.say(f"{name}: {cost.cpu_s:.2f} CPU s")
        write_whole(folder / "kept.json", json.dumps(kept) + "\n")
    return Run(**kept)


def simulate_bar(lab, element, nodes, step_s=None):
    shape = {"bar": {"length_m": LENGTH_M, "width_m": SIDE_M, "thickness_m": SIDE_M, "nodes": nodes}}
    blow = {"point_m": [LENGTH_M / 2, 0, SIDE_M / 2], "impulse_n_s": [0, 0, -1e-4], "duration_s": 2e-4}
    body = {"shape": shape, "element": element, "material": ALUMINIUM}
    name = f"bar, {element}, {nodes} nodes" + (f", step {step_s:.3g} s" if step_s else "")
    return simulate(lab, name, body, BAR_S[lab.quick], blow, find_bar_hz(), step_s)


def find_bar_hz():
    return calc_bar_hz(LENGTH_M, SIDE_M, *(ALUMINIUM[key] for key in ("young_modulus_pa", "poisson_ratio", "density_kg_m3")))


def find_plate_hz():
    return calc_plate_hz(EDGE_M, THICKNESS_M, *(STEEL[key] for key in ("young_modulus_pa", "poisson_ratio", "density_kg_m3")))


def simulate_plate(lab, cells=None, nodes=None):
    blow = {"point_m": [0, 0, 0 if cells else THICKNESS_M / 2], "impulse_n_s": [0, 0, -1e-4], "duration_s": 1e-3}
    edges = {"length_m": EDGE_M, "width_m": EDGE_M, "thickness_m": THICKNESS_M}
    if cells:
        body = {"sheet": {"shape": "rectangle", **edges, "cells": cells}, "hinged": "rim"}
        name = f"hinged plate, sheet of {cells} cells"
    else:
        # only the middle of the rim is fixed, so the faces can rotate
        half, thin = EDGE_M / 2, 1e-6
        boxes = []
        for axis in (0, 1):
            for side in (-half, half):
                low, high = [-1.0, -1.0, -thin], [1.0, 1.0, thin]
                low[axis], high[axis] = side - thin, side + thin
                boxes.append({"box_m": {"min": low, "max": high}})
        body = {"shape": {"plate": edges | {"nodes": nodes}}, "element": "T10", "fixed": boxes}
        name = f"hinged plate, T10 of {nodes} nodes"
    return simulate(lab, name, body | {"material": STEEL}, PLATE_S[lab.quick], blow, find_plate_hz())


def couple_disc(lab):
    """Clamped disc: [(nodes, energy_error, error stated in the bank, rows, bytes, CPU s of the solve, gamma of mode 1)]."""
    quick, cases = lab.quick, {}
    for nodes, error in DISCS[quick]:
        job = {
            "body": {"shape": "disc", "radius_m": DISC_M, "thickness_m": WALL_M, "nodes": nodes},
            "material": STEEL,
            "fixed": ["edge"],
            "band_hz": [20, 3000],
            "max_modes": 40,
            "shapes": "exact",
            "nonlinear": {"modes": 12, "below_hz": 3000, "energy_error": error},
        }
        cases[nodes, error] = Case(f"clamped disc, {nodes} nodes, energy_error {error:g}", job)
    solves = lab.measure(list(cases.values()), repeats=1)
    rows = []
    for (nodes, error), case in cases.items():
        solve = solves[case.name]
        arrays = sounds.read_arrays(
            solve.bank, {"nonlinear/modes", "nonlinear/A", "nonlinear/error", "modes/eigenvalue", "modes/shape", "modes/shape_scale"}
        )
        a, mode = arrays["nonlinear/A"].astype(float), int(arrays["nonlinear/modes"][0])
        shape = arrays["modes/shape"].reshape(-1, len(arrays["modes/eigenvalue"]), 3)[:, mode] * arrays["modes/shape_scale"][mode]
        self_coupling = 2 * (a[:, 0] ** 2).sum() / arrays["modes/eigenvalue"][mode]
        gamma = self_coupling * WALL_M**2 / (np.linalg.norm(shape, axis=1).max() ** 2)
        stated = float(arrays["nonlinear/error"].reshape(()))
        rows.append((solve.nodes, error, stated, a.shape[0], 4 * a.size, min(solve.cpu_s), float(gamma)))
    return rows


def describe_blow(sound):
    """(pitch of the lowest mode, power centroid from 20 Hz to 1 kHz) of the first 0.3 s after a blow, first microphone."""
    part = sound.pressure_pa[int(0.02 * sound.rate_hz) : int(0.32 * sound.rate_hz), 0]
    power = np.abs(np.fft.rfft(part * np.hanning(len(part)))) ** 2
    hz = np.fft.rfftfreq(len(part), 1 / sound.rate_hz)
    low = (hz > 20) & (hz < 1000)
    return find_line_hz(part, sound.rate_hz, LOWEST_HZ), float((hz * power)[low].sum() / power[low].sum())


def play_plate(lab):
    """[(coupled modes, share of a core, pitch, centroid)]: blow on a hinged steel plate, whose coupling has a closed form."""
    quick, banks = lab.quick, {}
    program = lab.find_program("carillon-precompute")
    for count in COUPLED[quick]:
        body = {"plate": {"shape": "rectangle", "length_m": 0.4, "width_m": 0.3, "thickness_m": 0.001, "edges": "hinged"}}
        job = {"body": body, "material": "steel", "band_hz": [20, 4000], "nonlinear": {"modes": count}}
        folder = lab.runs / calc_key([calc_digest(program), job])
        folder.mkdir(exist_ok=True)
        banks[count] = folder / "bank.hdf"
        write_whole(folder / "job.json", json.dumps(job | {"bank": "bank.hdf"}, indent=1) + "\n")
        lab.call([program, "-q", "job.json"], f"hinged plate, {count} coupled modes", cwd=folder)
    strike = {"body": "body", "time_s": 0.01, "point_m": [0.05, 0.03, 0.0005], "impulse_n_s": [0, 0, -BLOW_N_S]}
    scenes = {
        f"motion-{count}": {
            "duration_s": PLAYED_S[quick],
            "bodies": [{"name": "body", "bank": str(bank), "fixed": True}],
            "strikes": [strike],
            "microphones": [[0.3, -0.8, 0.5]],
        }
        for count, bank in banks.items()
    }
    played = sounds.play_all(lab, scenes)
    return [(count, min(one.playing_s), *describe_blow(one.sound)) for count, one in ((n, played[f"motion-{n}"]) for n in banks)]


def study(lab, chosen):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    quick = lab.quick
    section.say(
        "Bodies whose pitch has a closed form, struck softly in `carillon-simulate`: a free bar of aluminium of 200 x 20 x 20 mm (ASTM"
        " E1876), and a square plate of steel of 300 x 6 mm hinged on all sides (Mindlin). And the hardening of a clamped disc of 200 x 2"
        f" mm in a nonlinear bank, gamma = {DISC_GAMMA} of q'' + w0^2 q (1 + gamma (q / h)^2) by von Karman's equations. One run of each"
        " setting, one rank."
    )
    bar_hz, plate_hz = find_bar_hz(), find_plate_hz()
    bars = {element: [(nodes, simulate_bar(lab, element, nodes)) for nodes in sizes[quick]] for element, sizes in BAR_NODES.items()}
    nodes, own = bars["T10"][0]
    steps = [(share, own if share == 1.0 else simulate_bar(lab, "T10", nodes, share * own.step_s)) for share in STEPS[quick]]
    plates = {
        "sheet": [(cells, simulate_plate(lab, cells=cells)) for cells in CELLS[quick]],
        "T10": [(count, simulate_plate(lab, nodes=count)) for count in PLATE_NODES[quick]],
    }
    discs, counts = couple_disc(lab), play_plate(lab)
    off = lambda run, hz: to_cents(run.freq_hz, hz)
    draw = lambda runs_of, hz: {name: [(run.cpu_s, abs(off(run, hz))) for _, run in runs] for name, runs in runs_of.items()}
    panels = [
        plots.Panel("free bar", "CPU seconds", "cents off", draw(bars, bar_hz)),
        plots.Panel("hinged plate", "CPU seconds", "cents off", draw(plates, plate_hz)),
    ]
    data = [("panel", "what", "cpu_s", "cents")]
    data += [(panel.title, what, *point) for panel in panels for what, points in panel.curves.items() for point in points]
    subtitle = f"bar {BAR_S[quick]:g} s, plate {PLATE_S[quick]:g} s of motion"
    section.add_chart(
        "price",
        plots.draw_panels(panels, "What accuracy of motion costs", subtitle),
        "Cents by which the lowest mode is off, against CPU seconds of the run.",
        data,
    )

    def show(run, hz):
        return f"{run.elements:,}", f"{1e6 * run.step_s:.3f}", f"{off(run, hz):+.1f}", f"{run.book_error:.1e}", f"{run.cpu_s:.2f}"

    heads = ("elements", "step, us", "cents off", "energy book", "CPU s")
    section.add_table(
        "elements",
        [("element", "nodes asked for", *heads)]
        + [(element, nodes, *show(run, bar_hz)) for element, runs in bars.items() for nodes, run in runs],
        f"Free bar, {bar_hz:.1f} Hz.",
    )
    section.add_table(
        "steps",
        [("share of the program's own step", *heads)] + [(f"{share:g}", *show(run, bar_hz)) for share, run in steps],
        f"The same bar, T10 of {nodes} nodes, shorter steps.",
    )
    section.add_table(
        "plates",
        [("as", "cells or nodes", *heads)] + [(kind, size, *show(run, plate_hz)) for kind, runs in plates.items() for size, run in runs],
        f"Hinged plate, {plate_hz:.2f} Hz: a sheet, and solid elements one layer thick.",
    )
    hardening = lambda gamma: f"{100 * (gamma / DISC_GAMMA - 1):+.2f} %"
    section.add_table(
        "coupling",
        [("nodes", "`energy_error`", "error in the bank", "rows", "bytes", "CPU s of the solve", "gamma", "hardening off")]
        + [
            (f"{n:,}", f"{asked:g}", f"{stated:.1e}", rows, f"{size:,}", f"{cpu:.2f}", f"{gamma:.4f}", hardening(gamma))
            for n, asked, stated, rows, size, cpu, gamma in discs
        ],
        "Clamped disc, 12 coupled modes. A row costs 78 products a sample, twice.",
    )
    last, _, pitch_hz, centroid_hz = counts[-1]
    section.add_table(
        "modes",
        [("coupled modes", "share of a core", "lowest mode, Hz", "cents off", "centroid, Hz", "off")]
        + [
            (
                n,
                f"{share:.3f}",
                f"{hz:.1f}",
                f"{to_cents(hz, pitch_hz):+.0f}",
                f"{middle:.0f}",
                f"{100 * (middle / centroid_hz - 1):+.1f} %",
            )
            for n, share, hz, middle in counts
        ],
        f"A blow of {BLOW_N_S:g} N s on a hinged plate of steel of 400 x 300 x 1 mm, {PLAYED_S[quick]:g} s played: all modes to 4 kHz, of"
        f" which so many are coupled. Lowest mode and centroid up to 1 kHz in the first 0.3 s, off from those of {last}.",
    )
    worst = {element: runs[-1][1] for element, runs in bars.items()}
    coarse = bars["T10"][0][1]
    section.conclude(
        f"**Elements in motion**: the coarsest bar of T10 is {off(coarse, bar_hz):+.1f} cents off for {coarse.cpu_s:.2f} CPU s; the finest"
        f" of T4 {off(worst['T4'], bar_hz):+.0f} cents for {worst['T4'].cpu_s:.2f}."
    )
    share, least = steps[-1]
    section.conclude(
        f"**Step**: {share:g} of the program's own moves the pitch by {abs(to_cents(least.freq_hz, own.freq_hz)):.2f} cents for"
        f" {least.cpu_s / own.cpu_s:.1f} times the CPU time: the limit of stability is accurate enough."
    )
    sheet, solid = (min(runs, key=lambda one: abs(off(one[1], plate_hz)))[1] for runs in plates.values())
    section.conclude(
        f"**Sheet or solid**: a plate of a fiftieth is {off(sheet, plate_hz):+.1f} cents off as a sheet of {sheet.elements:,} triangles for"
        f" {sheet.cpu_s:.2f} CPU s, {off(solid, plate_hz):+.1f} cents as {solid.elements:,} T10 for {solid.cpu_s:.2f}."
    )
    parts = [f"{n} take {share:.2g} of a core and are {to_cents(hz, pitch_hz):+.0f} cents off" for n, share, hz, _ in counts[:-1]]
    section.conclude(
        f"**Coupled modes**, pitch of a hard blow against that of {last}: {'; '.join(parts)}; {last} take {counts[-1][1]:.2g} of a core."
    )
    parts = [f"{asked:g} takes {rows} rows ({size:,} bytes)" for n, asked, _, rows, size, _, _ in discs if n == discs[0][0]]
    coarsest, finest = discs[0], discs[-1]
    section.conclude(
        f"**`energy_error`** of 12 coupled modes: {'; '.join(parts)}. The hardening of the first mode is decided by the mesh:"
        f" {hardening(coarsest[-1])} with {coarsest[0]:,} nodes, {hardening(finest[-1])} with {finest[0]:,}."
    )
    return section
