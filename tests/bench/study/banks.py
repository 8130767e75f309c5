"""Section: bank size. Audible error of a rendered hit, bank bytes and CPU, by number of modes and bits of the shapes."""
import dataclasses
import os
import pathlib

import bodies as known_bodies
import plots
import sounds
from lab import Case, calc_digest, calc_key
from section import Section
from sounds import np

NAME, TITLE = "banks", "Modes kept, precision of shapes, size of banks"
PROGRAMS = ("carillon-precompute", "carillon-mesh", "carillon-bank", "carillon-render")
COUNTS = (800, 400, 200, 100, 50, 20)
BITS = (14, 12, 10, 8, 6, 4)
SHIPPED_BITS = 16
BLOW_N_S = 0.05
BLOW_S = 1e-4  # hard, so that the hit covers the audible band
# A block of granite with many audible modes: 0.27 m^3, shear waves at 2.7 km/s.
GRANITE = {"young_modulus_pa": 50e9, "poisson_ratio": 0.25, "density_kg_m3": 2650, "damping": {"internal_friction": {"tan_phi": 0.003}}}


@dataclasses.dataclass(frozen=True)
class Sounding:
    """A struck body."""

    name: str
    summary: str
    job: dict = dataclasses.field(hash=False)


@dataclasses.dataclass
class Row:
    """A reduced bank against the full one. kept: "loudest", "lowest" or "" (all modes)."""

    modes: int
    kept: str
    bits: int
    bank_bytes: int
    played: sounds.Played
    difference: sounds.Difference | None  # None for the full bank


def make_stone(lab):
    """The body with many modes."""
    body = {"shape": "box", "length_m": 0.9, "width_m": 0.6, "height_m": 0.5, "nodes": 1500 if lab.quick else 6000}
    return Sounding(
        "stone",
        "block of granite, 0.9 x 0.6 x 0.5 m",
        {"body": body, "material": GRANITE, "element": "T10", "band_hz": [20, 8000 if lab.quick else 20000]},
    )


def make_sounding(lab, body):
    """A body of the study with all its audible modes."""
    if body.surface:  # thin walls need many second-order nodes
        kind, nodes = known_bodies.find_kind("T4 consistent" if lab.quick else "T10 curved"), 3000 if lab.quick else 20000
    else:
        kind, nodes = known_bodies.find_kind("T10 curved" if body.round else "T10 straight"), 800 if lab.quick else 3000
    mesh = body.make_mesh(lab, kind, nodes)
    return Sounding(
        body.name,
        body.summary,
        {"mesh": str(mesh.path), "material": body.material, "element": kind.element, "band_hz": [20, 8000 if lab.quick else 20000]},
    )


def find_soundings(lab, bodies):
    """The struck bodies: those of --on; of the whole list, the bunny and the stone."""
    if len(bodies) < len(known_bodies.make_bodies()) - 1:  # the bunny may be missing
        return [make_sounding(lab, body) for body in bodies]
    return [make_sounding(lab, body) for body in bodies if body.surface] + [make_stone(lab)]


def solve(lab, soundings):
    """{name: path of the bank}; each is solved once."""
    solves = lab.measure([Case(f"{one.name}, all that is heard", one.job | {"shapes": "exact"}) for one in soundings], repeats=1)
    return {one.name: solves[f"{one.name}, all that is heard"].bank for one in soundings}


def make_strikes(bank, times_s, body="body", duration_s=BLOW_S, impulse_n_s=BLOW_N_S):
    """Equal blows along the inward normal at distant points: the extreme triangles in directions that avoid the symmetries."""
    arrays = sounds.read_arrays(bank, {"mesh/vertices", "mesh/triangles"})
    corners = arrays["mesh/vertices"][arrays["mesh/triangles"]]  # (T, 3, 3)
    middles = corners.mean(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    size = np.ptp(middles, axis=0)
    directions = ((0.9, 0.31, 0.17), (-0.23, 0.85, -0.41), (0.29, -0.13, 0.93))
    strikes = []
    for number, time_s in enumerate(times_s):
        reach = (middles - middles.mean(axis=0)) / size @ np.array(directions[number % 3])
        triangle = int(np.argsort(reach)[-1 - number // 3])
        strikes.append(
            {
                "time_s": time_s,
                "body": body,
                "triangle": triangle,
                "impulse_n_s": [float(x) for x in -impulse_n_s * normals[triangle]],
                "duration_s": duration_s,
            }
        )
    return strikes


def make_scene(lab, bank, struck_by=None, seconds=None, **more):
    """Scene: a suspended body is struck three times, microphone at 1 m. struck_by: the bank that defines the points (default: this one)."""
    seconds = seconds or (1.5 if lab.quick else 3.0)
    centre = sounds.read_arrays(bank, {"rigid/centre_m"})["rigid/centre_m"]
    scene = {
        "duration_s": seconds,
        "bodies": [{"name": "body", "bank": str(bank), "fixed": True}],
        "strikes": make_strikes(struck_by or bank, [seconds * share for share in (0.02, 0.35, 0.68)]),
        "microphones": [[float(x) for x in centre + np.array([0.36, -0.8, 0.48])]],
        "effects": ["modal", "hertz_pulse"],
    }
    return scene | more


def reduce(lab, bank, modes=None, kept="loudest", bits=SHIPPED_BITS):
    """Path of the bank with fewer modes or coarser shapes, by carillon-bank edit."""
    folder = lab.out / "work/banks"
    folder.mkdir(parents=True, exist_ok=True)
    words = (["--modes", modes, "--keep", kept] if modes else []) + (["--shape-bits", bits] if bits < SHIPPED_BITS else [])
    program = lab.find_program("carillon-bank")
    out = folder / f"{calc_key([calc_digest(program), calc_digest(bank), list(map(str, words))])}.hdf"
    if not out.is_file():
        lab.call([program, "edit", bank, out, *words], "carillon-bank edit")
    return out


def measure_reduced(lab, name, bank, wishes):
    """[Row] of a bank: the full one first, then one per wish, a dictionary of `modes`, `kept` and `bits`."""
    files = [(pathlib.Path(bank), {})] + [(reduce(lab, bank, **wish), wish) for wish in wishes]
    scenes = {f"{name}-{number}": make_scene(lab, file, bank) for number, (file, _) in enumerate(files)}
    played = list(sounds.play_all(lab, scenes, 1 if lab.quick else max(3, lab.repeats)).values())
    count = count_modes(bank)
    return [
        Row(
            wish.get("modes", count),
            wish.get("kept", "loudest") if wish.get("modes") else "",
            wish.get("bits", SHIPPED_BITS),
            os.path.getsize(file),
            one,
            sounds.compare(played[0].sound, one.sound) if wish else None,
        )
        for (file, wish), one in zip(files, played)
    ]


def count_modes(bank):
    return len(sounds.read_arrays(bank, {"modes/decay"})["modes/decay"])


def measure_modes(lab, name, bank, counts=COUNTS, keeps=("loudest", "lowest")):
    """[Row]: all modes, then the loudest and the lowest of each count below the number of modes."""
    total = count_modes(bank)
    return measure_reduced(
        lab, f"{name}-modes", bank, [{"modes": count, "kept": kept} for kept in keeps for count in counts if count < total]
    )


def measure_bits(lab, name, bank, bits=BITS):
    """[Row]: shapes as stored, then rounded."""
    return measure_reduced(lab, f"{name}-bits", bank, [{"bits": number} for number in bits])


# --- words and tables


def describe_verdict(difference):
    if difference is None:
        return "the reference"
    return "audible" if difference.is_audible else "inaudible"


def to_cells(row):
    apart = row.difference.to_cells() if row.difference else sounds.NO_CELLS
    return (
        f"{row.bank_bytes / 1e6:.2f}",
        f"{row.played.cpu_ms:.2f}",
        f"{100 * row.played.spread:.0f} %",
        *apart,
        describe_verdict(row.difference),
    )


CELLS = ("bank, MB", "CPU, ms for 1 s", "spread", *sounds.HEAD, "by ear")


def to_data(row):
    return (row.bank_bytes, row.played.cpu_ms, row.played.spread, *(row.difference.to_data() if row.difference else sounds.NO_DATA))


DATA = ("bank_bytes", "cpu_ms_per_s", "cpu_spread", *sounds.DATA)


def find_fewest(rows, kept):
    """Smallest number of modes of a kind from which on no difference is audible; None without one."""
    fewest = None
    for row in sorted((row for row in rows if row.kept == kept), key=lambda row: -row.modes):
        if row.difference.is_audible:
            break
        fewest = row
    return fewest


def describe_modes(name, rows):
    """Sentences on the numbers of modes of one body."""
    whole = rows[0]
    out = []
    for kept in dict.fromkeys(row.kept for row in rows[1:]):
        fewest = find_fewest(rows, kept)
        if fewest:
            out.append(
                f"Of the {whole.modes} modes of the {name}, the {fewest.modes} {kept} do: they do not differ audibly from all"
                f" ({fewest.difference.distance_db:.2f} dB log-spectral distance, {sounds.format_change(fewest.difference.loudness_db)} dB"
                f" loudness), with {100 * fewest.bank_bytes / whole.bank_bytes:.0f} % of the bank's bytes and"
                f" {100 * fewest.played.cpu_ms / max(whole.played.cpu_ms, 1e-9):.0f} % of the CPU."
            )
        else:
            most = max((row for row in rows if row.kept == kept), key=lambda row: row.modes)
            out.append(
                f"Of the {whole.modes} modes of the {name}, even the {most.modes} {kept} differ audibly from all"
                f" ({most.difference.distance_db:.2f} dB log-spectral distance, {sounds.format_change(most.difference.loudness_db)} dB"
                " loudness)."
            )
    return out


def describe_lost(name, rows, counts=(800, 200, 50)):
    """Sentence on the loss at the papers' numbers of modes ("800 modes or fewer suffice")."""
    parts = []
    for count in counts:
        row = next((row for row in rows if row.modes == count and row.kept == "loudest"), None)
        if row:
            parts.append(
                f"at {count} the difference is {sounds.format_db(row.difference.error_db)} dB(A), {row.difference.distance_db:.2f} dB in"
                f" log-spectral distance and {sounds.format_change(row.difference.loudness_db)} dB in loudness"
                f" ({describe_verdict(row.difference)})"
            )
        elif rows[0].modes <= count:
            parts.append(f"{count} are all that there are")
    return f"The {name} has {rows[0].modes} modes; of the loudest, {'; '.join(parts)}."


def estimate_shipped_db(rows):
    """Error of 16 bits, extrapolated from the finest measured rounding by 6.02 dB per bit."""
    finest = max((row for row in rows if row.difference), key=lambda row: row.bits)
    return finest.difference.error_db - 6.0206 * (SHIPPED_BITS - finest.bits)


def add_body(lab, section, one, bank):
    command = section.command
    rows = measure_modes(lab, one.name, bank, COUNTS[1:] if lab.quick else COUNTS)
    if len(rows) > 1:
        section.add_table(
            f"{one.name}-modes",
            [("modes", "which", *CELLS), *((row.modes, row.kept or "all", *to_cells(row)) for row in rows)],
            f"The {one.name} ({one.summary}) with fewer modes: three hard blows, heard at 1 m.",
            [("modes", "which", *DATA), *((row.modes, row.kept or "all", *to_data(row)) for row in rows)],
            command,
        )
        for text in describe_modes(one.name, rows):
            section.conclude(text)
    bits = measure_bits(lab, one.name, bank, BITS[1::2] if lab.quick else BITS)
    section.add_table(
        f"{one.name}-bits",
        [("bits", *CELLS), *((row.bits, *to_cells(row)) for row in bits)],
        f"The {one.name} with all modes and shapes of fewer bits; up to 8 they take one byte a component in the file, else two.",
        [("bits", *DATA), *((row.bits, *to_data(row)) for row in bits)],
        command,
    )
    section.conclude(describe_bits(one.name, bits))
    if bargain := describe_bargain(one.name, rows, bits):
        section.conclude(bargain)
    return rows, bits


def describe_bits(name, bits):
    """Sentence on the bits of shapes."""
    shipped = estimate_shipped_db(bits)
    text = (
        f"Rounding shapes to {SHIPPED_BITS} bits, as banks have them, is an error of {shipped:.0f} dB(A) in the {name}'s sound, by the 6 dB"
        " that a bit is worth: all that floats could gain; "
    )
    enough = [row for row in bits[1:] if not row.difference.is_audible]
    if enough:
        least = min(enough, key=lambda row: row.bits)
        text += (
            f"{least.bits} bits are the fewest that do not differ audibly from them ({sounds.format_db(least.difference.error_db)} dB(A))"
        )
    else:
        text += f"none of the coarser ones escapes the ear ({bits[1].bits} bits: {sounds.format_db(bits[1].difference.error_db)} dB(A))"
    byte = next((row for row in bits if row.bits == 8), None)
    return text + (
        f"; with 8, one byte, the bank is {bits[0].bank_bytes / byte.bank_bytes:.1f} times smaller at"
        f" {sounds.format_db(byte.difference.error_db)} dB(A)."
        if byte
        else "."
    )


def describe_bargain(name, modes, bits):
    """Sentence on coarser shapes against fewer modes for a smaller bank; "" if there is nothing to compare."""
    byte = next((row for row in bits if row.bits == 8), None)
    fitting = [row for row in modes if row.kept == "loudest" and byte and row.bank_bytes <= byte.bank_bytes]
    if not fitting:
        return ""
    few = max(fitting, key=lambda row: row.modes)
    better = "coarser shapes are" if byte.difference.distance_db < few.difference.distance_db else "fewer modes are"
    return (
        f"Of the two ways to a smaller bank of the {name}, {better} the better one: all modes at 8 bits, {byte.bank_bytes / 1e6:.2f} MB,"
        f" are {byte.difference.distance_db:.2f} dB off, the {few.modes} loudest at {SHIPPED_BITS} bits, {few.bank_bytes / 1e6:.2f} MB,"
        f" {few.difference.distance_db:.2f} dB."
    )


def measure_papers(lab, counts=(800, 200, 50)):
    """([Row], sentence) on the papers' numbers of modes, for the body with many modes."""
    stone = make_stone(lab)
    rows = measure_modes(lab, "stone-papers", solve(lab, [stone])["stone"], counts, ("loudest",))
    return rows, describe_lost("stone", rows, counts)


def add_charts(section, results):
    panels, rows = [], [("body", "what", "modes", "bits", "bank_bytes", "cpu_ms_per_s", "error_dba", "log_spectral_distance_db")]
    for name, (modes, bits) in results.items():
        curves = {}
        for label, group in (
            ("loudest modes", [r for r in modes if r.kept == "loudest"]),
            ("lowest modes", [r for r in modes if r.kept == "lowest"]),
            ("coarser shapes", bits[1:]),
        ):
            if group:
                curves[label] = [(row.bank_bytes / 1e6, row.difference.distance_db) for row in group]
                rows += [
                    (name, label, r.modes, r.bits, r.bank_bytes, r.played.cpu_ms, r.difference.error_db, r.difference.distance_db)
                    for r in group
                ]
        panels.append(
            plots.Panel(
                f"{name}: what is heard against bytes",
                "bank, MB",
                "log-spectral distance, dB",
                curves,
                levels=[(sounds.DISTANCE_LIMIT_DB, "1 dB: audible above")],
                y_log=False,
            )
        )
        cpu = {
            label: [(row.played.cpu_ms, row.difference.distance_db) for row in modes if row.kept == kept]
            for label, kept in (("loudest modes", "loudest"), ("lowest modes", "lowest"))
        }
        panels.append(
            plots.Panel(
                f"{name}: what is heard against CPU",
                "CPU, ms for a second of sound",
                "log-spectral distance, dB",
                {k: v for k, v in cpu.items() if v},
                levels=[(sounds.DISTANCE_LIMIT_DB, "1 dB")],
                x_log=False,
                y_log=False,
            )
        )
    svg = plots.draw_panels(panels, "Fewer modes, coarser shapes", "against the whole bank; three hard blows, heard at 1 m")
    section.add_chart(
        "size", svg, "Log-spectral distance to the sound of the whole bank against the size of the bank and the CPU of its sound.", rows
    )


def study(lab, bodies):
    section = Section(NAME, TITLE, lab.make_command(NAME))
    soundings = find_soundings(lab, bodies)
    banks = solve(lab, soundings)
    section.say(f"How a difference is measured: {describe_measures()}")
    results = {}
    for one in soundings:
        if count_modes(banks[one.name]) == 0:
            section.say(f"The {one.name} has no mode that is heard, and no row here.")
            continue
        results[one.name] = add_body(lab, section, one, banks[one.name])
    if results:
        add_charts(section, results)
    lab.found[NAME] = results
    return section


def describe_measures():
    return (
        "error, the A-weighted exposure of the difference below that of the reference (IEC 61672-1; it knows phases; below"
        f" {sounds.ERROR_LIMIT_DB:.0f} dB it is inaudible); log-spectral distance, root mean square of level differences in third-octave"
        f" bands and frames of 43 ms, down to {sounds.RANGE_DB:.0f} dB below the loudest (below {sounds.DISTANCE_LIMIT_DB:.0f} dB, with no"
        f" more than {100 * sounds.OUTLIER_LIMIT:.0f} % of the frames more than {sounds.OUTLIER_DB:.0f} dB off, inaudible, Paliwal & Atal"
        " 1993); change of loudness, of the loudest A-weighted level within 0.2 s (10 dB are twice as many sones, ISO 131;"
        f" {sounds.LOUDNESS_LIMIT_DB:.0f} dB is just heard, Jesteadt, Wier & Green 1977)."
    )
