"""Section: radiation. Far-field error against CPU time and bank size, by surface nodes, wave numbers and multipole order."""
import dataclasses
import json
import math
import re
import statistics
import subprocess

import plots
import sounds
from lab import Case
from section import Section
from sounds import np
from errors import RunError

NAME, TITLE = "air", "Air: nodes of the skin, wave numbers, orders"
PROGRAMS = ("carillon-precompute", "carillon-bank")
# Plates of 300 x 200 mm, far from spherical: a thick one with a fine surface mesh, a thin one with many modes.
PLATE = {"shape": "plate", "length_m": 0.3, "width_m": 0.2}
THICK = {"material": "aluminium", "band_hz": [20, 20000]}
THIN = {"material": "steel", "band_hz": [20, 6000]}
WHOLE_NODES, THICK_MODES = (7500, 1000), (10, 6)  # all, quick
SKINS = ((300, 600, 1000, 1700, 2800), (150, 300))
THIN_NODES, THIN_SKIN, THIN_MODES = (1000, 1000), (1000, 300), (70, 20)
ERRORS, BEST_DB = ((-21, -30, -40, -50, -60), (-21, -40)), -79
USUAL_SKIN, USUAL_DB = 4500, -40
ORDERS = (-4, -2, 0, 2, 4, 6, 8)  # above k R
NEAR_RADII = 2.0
BYTES = 4  # bytes per coefficient
WHICH, WHERE = ("median of the modes", "worst mode"), ("far away", "at two radii")
FIELDS = ("radiation/order", "radiation/freq_hz", "radiation/radius_m", "radiation/scale", "radiation/coefficient")
SPEED_M_S = 343.0
LOWEST_DB = -150.0  # smaller differences count as equal


@dataclasses.dataclass
class Field:
    """Radiation of a bank's modes. far[m] (harmonics): far-field coefficients of Y_lm; kr[m]: wave number times radius."""

    far: list
    kr: list
    cpu_s: float  # of the radiation solve alone
    unknowns: int
    wave_numbers: int


@dataclasses.dataclass
class Row:
    """One setting against the most accurate: (median, worst) error in dB over the modes."""

    setting: int
    field: Field
    level: tuple
    pattern: tuple


def calc_hankel(order, x):
    """h_l(x), l = 0..order, by upward recurrence, stable for y_l (DLMF 10.51.1)."""
    h = [np.exp(1j * x) / (1j * x)]
    h.append(h[0] * (1.0 / x - 1j))
    for el in range(1, order):
        h.append((2 * el + 1) / x * h[el] - h[el - 1])
    return np.array(h[: order + 1])


def find_orders(count):
    """Order l of each harmonic."""
    return np.sqrt(np.arange(count) + 0.5).astype(int)


def read_method(lab, bank):
    """(unknowns, wave numbers) of a bank's radiation solve."""
    child = subprocess.run(
        [str(lab.find_program("carillon-bank")), "info", "--json", str(bank)], capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    if child.returncode != 0:
        raise RunError(4, f"{bank}: {child.stderr.strip()}")
    method = json.loads(child.stdout)["radiation"]["method"]
    return int(re.search(r"(\d+) unknowns", method)[1]), int(re.search(r"(\d+) wave numbers", method)[1])


def read_field(lab, solve):
    arrays = sounds.read_arrays(solve.bank, set(FIELDS))
    orders, scale = arrays["radiation/order"], arrays["radiation/scale"]
    pressure = arrays["radiation/coefficient"].astype(float) @ np.array([1, 1j])  # on the sphere of radius R, in quantization steps
    kr = 2 * math.pi * arrays["radiation/freq_hz"] / SPEED_M_S * float(arrays["radiation/radius_m"].reshape(()))
    ends = np.cumsum((orders + 1) ** 2)
    far = []
    for end, order, size, x in zip(ends, orders, scale, kr):
        el = find_orders((order + 1) ** 2)
        far.append(size * pressure[end - len(el) : end] / calc_hankel(int(order), x)[el] * (-1j) ** (el + 1))
    return Field(far, kr.tolist(), solve.record["effort"]["write"]["cpu_seconds"], *read_method(lab, solve.bank))


def to_db(ratio):
    return 20 * math.log10(max(ratio, 10 ** (LOWEST_DB / 20)))


def compare(setting, field, best):
    """Returns a Row. The harmonics are orthonormal, so mean squares over directions are sums of squares."""
    level, pattern = [], []
    for one, true in zip(field.far, best.far):
        size = max(len(one), len(true))
        one, true = (np.pad(c, (0, size - len(c))) for c in (one, true))
        sign = np.sign(np.real(np.vdot(true, one)))  # the sign of a mode shape is arbitrary
        level.append(abs(to_db(np.linalg.norm(one) / np.linalg.norm(true))))
        pattern.append(to_db(np.linalg.norm(sign * one - true) / np.linalg.norm(true)))
    return Row(setting, field, *((statistics.median(errors), max(errors)) for errors in (level, pattern)))


def solve_skins(lab):
    """([Row] of reduced surface meshes, Field of the full one)."""
    quick = lab.quick
    job = {"body": {**PLATE, "thickness_m": 0.01, "nodes": WHOLE_NODES[quick]}, **THICK, "max_modes": THICK_MODES[quick]}
    whole = 20000
    cases = {skin: Case(f"plate of 10 mm, {skin} nodes of the skin", make_air(job, skin, USUAL_DB)) for skin in (*SKINS[quick], whole)}
    solves = lab.measure(list(cases.values()), repeats=1)
    fields = {skin: read_field(lab, solves[case.name]) for skin, case in cases.items()}
    return [compare(skin, fields[skin], fields[whole]) for skin in SKINS[quick]], fields[whole]


def solve_errors(lab):
    """([Row] of larger error tolerances, Field of the smallest)."""
    quick = lab.quick
    job = {"body": {**PLATE, "thickness_m": 0.002, "nodes": THIN_NODES[quick]}, **THIN, "max_modes": THIN_MODES[quick]}
    cases = {
        error: Case(f"plate of 2 mm, {error} dB of error", make_air(job, THIN_SKIN[quick], error)) for error in (*ERRORS[quick], BEST_DB)
    }
    solves = lab.measure(list(cases.values()), repeats=1)
    fields = {error: read_field(lab, solves[case.name]) for error, case in cases.items()}
    return [compare(error, fields[error], fields[BEST_DB]) for error in ERRORS[quick]], fields[BEST_DB]


def make_air(job, skin_nodes, error_db):
    return job | {"radiation": {"method": "bem", "skin_nodes": skin_nodes, "error_db": error_db}}


def cut_orders(field):
    """[(orders above k R, bytes per mode, (median, worst) error in the far field, the same at two radii)]."""
    rows = []
    for above in ORDERS:
        cut, far, near = [], [], []
        for c, x in zip(field.far, field.kr):
            el = find_orders(len(c))
            order = min(max(0, math.ceil(x) + above), int(el[-1]))
            cut.append(BYTES * (order + 1) ** 2)
            for errors, size in ((far, np.abs(c)), (near, np.abs(c * calc_hankel(int(el[-1]), NEAR_RADII * x)[el]))):
                errors.append(to_db(np.linalg.norm(size[el > order]) / np.linalg.norm(size)))
        rows.append((above, statistics.mean(cut), *((statistics.median(errors), max(errors)) for errors in (far, near))))
    return rows


def format_db(value):
    return "the same" if value <= LOWEST_DB else f"{round(value)}"


def draw(section, skins, errors, orders):
    ways = {"nodes of the skin, plate of 10 mm": skins, "wave numbers, plate of 2 mm": errors}
    price = [
        {name: [(row.field.cpu_s, row.pattern[number]) for row in rows if row.pattern[number] > LOWEST_DB] for name, rows in ways.items()}
        for number in (0, 1)
    ]
    kept = [
        {which: [(row[1], row[place][number]) for row in orders if row[place][number] > LOWEST_DB] for number, which in enumerate(WHICH)}
        for place in (2, 3)
    ]
    add_chart(section, "price", WHICH, price, "CPU seconds of the air", "Errors of the patterns against CPU seconds of the air.")
    add_chart(section, "bytes", WHERE, kept, "bytes a mode", "Errors of the patterns against the bytes of the orders, plate of 2 mm.")


def add_chart(section, name, titles, curves, x_label, caption):
    panels = [plots.Panel(title, x_label, "error of the pattern, dB", one, y_log=False) for title, one in zip(titles, curves)]
    data = [("panel", "what", "x", "error_db")]
    data += [(panel.title, what, *point) for panel in panels for what, points in panel.curves.items() for point in points]
    subtitle = "plates of 300 x 200 mm; errors of far fields with their phase"
    section.add_chart(name, plots.draw_panels(panels, "What the air costs", subtitle), caption, data)


def add_tables(section, skins, whole, errors, best, orders):
    def list_errors(row):
        level, pattern = row.level, row.pattern
        shown = f"{level[0]:.3f}", f"{level[1]:.3f}", format_db(pattern[0]), format_db(pattern[1])
        return *shown, f"{row.field.cpu_s:.1f}"

    heads = "level: median, dB", "worst", "pattern: median, dB", "worst", "CPU s"
    section.add_table(
        "skins",
        [("nodes of the skin", *heads)]
        + [(f"{row.field.unknowns:,}", *list_errors(row)) for row in skins]
        + [(f"{whole.unknowns:,} (whole)", *4 * ("-",), f"{whole.cpu_s:.1f}")],
        f"Plate of 10 mm, {len(whole.far)} modes: coarsened skins against the whole one.",
    )
    section.add_table(
        "errors",
        [("`error_db`", "wave numbers", *heads)]
        + [(row.setting, row.field.wave_numbers, *list_errors(row)) for row in errors]
        + [(BEST_DB, best.wave_numbers, *4 * ("-",), f"{best.cpu_s:.1f}")],
        f"Plate of 2 mm, {len(best.far)} modes, k R {min(best.kr):.1f} to {max(best.kr):.1f}, {best.unknowns:,} nodes: the error of"
        " interpolation that is asked for.",
    )
    section.add_table(
        "orders",
        [("orders above k R", "bytes a mode", "far away: median, dB", "worst", "at two radii: median", "worst")]
        + [(above, f"{size:.0f}", *(format_db(error) for error in (*far, *near))) for above, size, far, near in orders],
        "The same modes with fewer orders of the multipoles than the bank has, which itself leaves out what is below -46 dB.",
    )


def study(lab, chosen):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    section.say(
        'The solve of the air outside a body (`"radiation": "bem"`), for two plates of 300 x 200 mm whatever `--on` says: their level and'
        " direction are what no equivalent sphere gives. Level: of the root mean square over directions. Pattern: root mean square of the"
        " difference of far fields, with its phase, over that of the field. CPU seconds of the air alone, one run."
        " [radiation](radiation.md) has 26 bodies, and proofs of the solve."
    )
    skins, whole = solve_skins(lab)
    errors, best = solve_errors(lab)
    orders = cut_orders(best)
    draw(section, skins, errors, orders)
    add_tables(section, skins, whole, errors, best, orders)
    finest = skins[-1]
    section.conclude(
        f"**Nodes of the skin**: {finest.field.unknowns:,} in place of {whole.unknowns:,} take {finest.field.cpu_s:.1f} CPU s in place of"
        f" {whole.cpu_s:.1f} and are {finest.level[1]:.3f} dB off in the worst level, {finest.pattern[1]:.0f} dB in the worst pattern;"
        f" {skins[0].field.unknowns:,} take {skins[0].field.cpu_s:.1f} CPU s and are {skins[0].level[1]:.2f} dB and"
        f" {skins[0].pattern[1]:.0f} dB off."
    )
    usual = next(row for row in errors if row.setting == USUAL_DB)
    rule = errors[0]
    section.conclude(
        f"**Wave numbers**: the default, `error_db` {USUAL_DB}, takes {usual.field.wave_numbers} for {len(best.far)} modes and is"
        f" {format_db(usual.pattern[1])} dB off in the worst pattern; {rule.setting} takes {rule.field.wave_numbers}"
        f" ({rule.field.cpu_s / usual.field.cpu_s:.2f} times the CPU time) and is {format_db(rule.pattern[1])} dB off, {BEST_DB}"
        f" {best.wave_numbers} and {best.cpu_s / usual.field.cpu_s:.2f} times the CPU time."
    )
    parts = [
        f"{above} above k R ({size:.0f} bytes a mode) leave out {format_db(far[1])} dB far away and {format_db(near[1])} dB at two radii"
        for above, size, far, near in orders
        if above > 0 and near[1] > LOWEST_DB
    ]
    section.conclude(
        f"**Orders**, worst mode: {'; '.join(parts)}. They cost bytes, not CPU time of the solve; banks choose the order of each mode by"
        " what is left out, -46 dB."
    )
    return section
