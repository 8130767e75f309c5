"""Section: recommendation. Justifies every default by its figures and those of the next stricter and looser setting; also writes the
measurements behind `carillon study advise` (advice.json)."""
import json
import os
import statistics
import time

import banks
import cents
import elements
import forecast
import playing
import solver
import sounds
from bodies import Kind, find_kind
from lab import Case, write_whole
from section import Section
from errors import InputError

PROGRAMS = solver.PROGRAMS
# A job without settings; its resolved form shows the current defaults.
PLAIN = {
    "body": {"shape": "bar"},
    "material": {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {}}},
}
# Why a default costs more than settings that this study cannot distinguish from it.
REASONS = {
    "silence_pa": (
        "a scene may be played with any gain, and what sleeps costs nothing from then on: the saving is that of the last of a decay"
    ),
    "contact_step_s": "it holds where bodies bounce and tumble, where another step is another fall (section playing)",
    "modes": "a limit is the scene's to set: what may be left out depends on what else sounds",
    "sample_rate_hz": "it is that of sound cards",
}
TRAINED_EAR, SEMITONE = 5.0, 100.0  # cents
START_DECIDES = 1.25  # on small meshes, where start-up time matters
WORTH_MS = 10.0  # CPU per second of sound: 1 % of a core
LITTLE = 1.1  # ratios of CPU time below this are insignificant
HEAD = ("default", "today", "the figure that chose it", "the next stricter", "the next looser", "does today's agree")
CALIBRATION = {
    "body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 4000},
    "element": "T10",
    "band_hz": [20, 40000],
    "material": {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {}}},
}


def name_element(body, kind):
    """Element name in advice.json: "T10" is the best T10 of the body; "T10 straight" means straight where curved was possible."""
    if kind.element == "T4":
        return "T4" if kind.mass == "consistent" else "T4 lumped"
    return "T10" if kind.curved or not body.round else "T10 straight"


def list_samples(body, solves):
    """(advice.json rows of one body, its Truth)."""
    truth, _ = elements.find_truth(body, solves)
    doubt = max(cents.to_cents(1 + doubt, 1) for doubt in truth.uncertainty)
    rows = []
    for kind, solve in solves:
        errors = [abs(cents.to_cents(f, true)) for f, true in zip(solve.freq_hz, truth.freq_hz)]
        if len(errors) == len(truth.freq_hz):
            rows.append(
                {
                    "element": name_element(body, kind),
                    "nodes": solve.nodes,
                    "unknowns": solve.unknowns,
                    "modes": len(solve.freq_hz),
                    "cpu_s": round(solve.cpu, 4),
                    "worst_cents": max(errors),
                    "median_cents": statistics.median(errors),
                    "bar_cents": max(solve.bar_cents),
                    "truth_cents": doubt,
                }
            )
    return rows, truth


def make_content(lab, bodies, facts):
    """advice.json: raw measurements only; forecast.Advice derives the rest."""
    solves = elements.measure(lab, bodies)
    calibration = lab.measure([Case("calibration", CALIBRATION)], 3)["calibration"]
    content = {
        "format": forecast.FORMAT,
        "made_by": "tests/bench/study/run --write-advice FILE",
        "machine": lab.describe_machine(),
        "date": time.strftime("%Y-%m-%d"),
        "is_quick": lab.quick,
        "calibration": {"job": CALIBRATION, "cpu_s": min(calibration.cpu_s)},
        "ranks": {str(ranks): row for ranks, row in facts["ranks"].items() if ranks > 1},
        "truths": {},
        "bodies": {},
    }
    for body in bodies:
        content["bodies"][body.name], truth = list_samples(body, solves[body.name])
        if not body.truth:
            content["truths"][body.name] = {"freq_hz": truth.freq_hz, "uncertainty": truth.uncertainty}
    forecast.Advice(content)  # check that it can be read
    return content


def check_path(path):
    """Raises InputError if write() could not write."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise InputError(f"{path}: cannot be written: {'this is a folder' if path.is_dir() else 'its folder may not be written to'}")


def write(lab, bodies, path):
    """Writes the file of `carillon study advise --advice FILE`. Solves of other sections are cached, so mostly the calibration runs."""
    facts = solver.find_facts(lab, bodies)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(make_content(lab, bodies, facts), indent=1) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


# --- the recommendation


def median(values):
    values = list(values)
    return statistics.median(values) if values else float("nan")


def say_times(ratio):
    return f"{ratio:.2g} times the CPU time"


def find_best_t10(body):
    return "T10 curved" if body.round else "T10 straight"


def find_costs(results, level):
    """{kind or "T10": {body: CPU seconds}} for the worst mode within so many cents, of bodies with a sufficiently known truth; "T10" is
    the best T10 of the body."""
    costs = {}
    for body, points, truth in results:
        for kind in body.get_kinds() if cents.is_known(truth, level) else ():
            cost = cents.find_cost([point for point in points if point.kind == kind.name], level)
            if cost:
                costs.setdefault("T10" if kind.name == find_best_t10(body) else kind.name, {})[body.name] = cost.cpu_s
    return costs


def recommend_element(results, today):
    ear, semitone, one = (find_costs(results, level) for level in (TRAINED_EAR, SEMITONE, 1.0))
    linear = {
        body: min(values)
        for body in (body.name for body, _, _ in results)
        if (values := [ear[kind][body] for kind in ("T4 consistent", "T4 lumped") if body in ear.get(kind, {})])
    }
    t10 = ear.get("T10", {})
    wins = [body for body in t10 if body not in linear or t10[body] <= LITTLE * linear[body]]
    ratios = [linear[body] / t10[body] for body in linear if body in t10]
    resolved = sum(cents.is_known(truth, TRAINED_EAR) for _, _, truth in results)  # bodies
    if not resolved:
        return None
    figure = f"{TRAINED_EAR:g} cents: T10 are the cheapest on {len(wins)} of {resolved} bod{'ies' if resolved != 1 else 'y'}"
    figure += (
        f"; T4 take {median(ratios):.2g} times as long (median of the {len(ratios)} where they reach it)"
        if ratios
        else "; T4 reach it on none"
    )
    stricter = median(one["T10"][body] / t10[body] for body in t10 if body in one.get("T10", {}))
    rough = [
        min(semitone[kind][body] for kind in ("T4 consistent", "T4 lumped") if body in semitone.get(kind, {})) / semitone["T10"][body]
        for body in semitone.get("T10", {})
        if any(body in semitone.get(kind, {}) for kind in ("T4 consistent", "T4 lumped"))
    ]
    looser = f"T4 for a semitone: {say_times(median(rough))} of T10" if rough else "T4 for a semitone: out of reach"
    return (
        "element",
        today["element"],
        figure,
        f"T10 to 1 cent: {say_times(stricter)} of {TRAINED_EAR:g} cents",
        looser,
        (today["element"] == "T10") == (2 * len(wins) > resolved),
    )


def recommend_sides(results):
    gains, prices = [], []
    for body, points, _ in results:
        own = {kind: [point for point in points if point.kind == kind] for kind in ("T10 straight", "T10 curved")}
        for straight, curved in zip(own["T10 straight"], own["T10 curved"]):
            gains.append(straight.worst / curved.worst)
            prices.append(curved.cpu_s / straight.cpu_s)
    if not gains:
        return None
    return (
        "sides",
        'curved (a "body", and --order 2)',
        f"on the same mesh straight sides are {median(gains):.2g} times as wrong (median of {len(gains)} meshes of round bodies)",
        "none",
        f"straight: {1 / median(prices):.2f} times the CPU time",
        median(gains) > 1 and median(prices) < 1.5,
    )


def recommend_mass(lab, bodies, results, today):
    linear = []
    for _, points, _ in results:
        own = {mass: [point for point in points if point.kind == f"T4 {mass}"] for mass in ("consistent", "lumped")}
        linear += [(lumped.worst / full.worst, lumped.cpu_s / full.cpu_s) for full, lumped in zip(own["consistent"], own["lumped"])]
    quadratic = []
    for body in solver.choose_bodies(bodies)[: 1 if lab.quick else 2]:
        kind = find_kind(find_best_t10(body))
        sizes = lab.get_sizes(body, kind)[-3:-1]
        full = [body.make_case(lab, kind, nodes) for nodes in sizes]
        lumped = [body.make_case(lab, Kind("T10 lumped", "T10", "lumped", kind.curved), nodes) for nodes in sizes]
        solves = lab.measure(full + lumped)
        truth = body.truth or next(truth for other, _, truth in results if other.name == body.name)
        worst = lambda solve: max(abs(cents.to_cents(f, true)) for f, true in zip(solve.freq_hz, truth.freq_hz))
        quadratic += [
            (worst(solves[b.name]) / worst(solves[a.name]), solves[b.name].cpu / solves[a.name].cpu) for a, b in zip(full, lumped)
        ]
    errors, prices = [median(column) for column in zip(*quadratic)]
    t4_errors, t4_prices = [median(column) for column in zip(*linear)]
    return (
        "mass",
        today["mass"],
        f"with T10 a lumped mass is {errors:.2g} times as wrong on the same mesh",
        "none",
        (
            f"lumped: {prices:.2f} times the CPU time with T10; with T4 {t4_prices:.2f} times, and {t4_errors:.2g} times the error, as its"
            " own has the other sign"
        ),
        today["mass"] == "consistent" and errors > 1 / LITTLE,
    )


def find_today(lab):
    """Defaults of the program: {"element", "mass", "tolerance", "method", "factorisation", "nodes"}."""
    solve = lab.measure([Case("a job that says nothing", PLAIN)], 1)["a job that says nothing"]
    job = json.loads(solve.bank.with_name(solve.bank.name + ".resolved.json").read_text())
    return {"element": job["element"], "mass": job["mass"], "nodes": round(solve.nodes, -3), **job["solver"]}


def recommend_nodes(results, today):
    usual = today["nodes"]

    def look(nodes):
        errors, seconds = [], []
        for body, points, _ in results:
            own = [point for point in points if point.kind == find_best_t10(body)]
            curve = forecast.Curve("T10", [forecast.Sample(p.nodes, p.unknowns, len(p.cents), p.worst, 0.0, p.cpu_s) for p in own])
            errors.append(curve.predict_cents(nodes))
            seconds.append(curve.predict_cpu(nodes))
        return errors, seconds

    (errors, seconds), (coarse, few), (fine, many) = look(usual), look(usual // 2), look(2 * usual)
    inside = sum(error <= TRAINED_EAR for error in errors)
    return (
        "nodes of a body",
        f"{usual:,}",
        (
            f"the worst mode is within {TRAINED_EAR:g} cents on {inside} of {len(errors)} bodies, median {median(errors):.2g}, at most"
            f" {max(errors):.3g}, for {median(seconds):.2g} CPU s"
        ),
        f"{2 * usual:,}: median {median(fine):.2g}, at most {max(fine):.3g} cents, {median(many):.2g} CPU s",
        f"{usual // 2:,}: median {median(coarse):.2g}, at most {max(coarse):.3g} cents, {median(few):.2g} CPU s",
        2 * inside >= len(errors),
    )


def recommend_tolerance(facts, today):
    fact = facts["tolerance"]
    tight = min(fact["cpu"])
    loose = max(fact["cpu"])
    stricter = fact["cpu"].get(1e-10, fact["cpu"][tight])
    return (
        "solver.tolerance",
        f"{today['tolerance']:g}",
        (
            f"it leaves bars of {fact['bars'][1e-8]:.1e} cents, where the best of these meshes is {fact['mesh']:.2g} cents wrong;"
            f" frequencies move by {fact['moved'][loose]:.1e} cents from {tight:g} to {loose:g}"
        ),
        f"1e-10: {stricter:.2f} times the CPU time" if 1e-10 in fact["cpu"] else f"{tight:g}: {stricter:.2f} times the CPU time",
        f"{loose:g}: {fact['cpu'][loose]:.2f} times the CPU time",
        today["tolerance"] == 1e-8 and fact["cpu"][loose] > 1 / LITTLE and fact["bars"][1e-8] < 0.01,
    )


def recommend_method(facts, today):
    fact = facts["method"]
    dense = (
        f"dense costs over a tenth more from {fact['dense_from']:,} unknowns on"
        if fact["dense_from"]
        else "dense never cost over a tenth more"
    )
    return (
        "solver.method",
        f"{today['method']}: block Lanczos; dense up to 300 unknowns",
        f"{dense}; Krylov-Schur takes {fact['krylov']:.1f} times the CPU time of block Lanczos",
        "none: all give the same frequencies",
        "none",
        today["method"] == "automatic" and fact["krylov"] > 1 / START_DECIDES and (fact["dense_from"] or 1e9) > 300,
    )


def recommend_factorisation(facts, today):
    fact = facts["ordering"]
    is_ours = fact["best"].startswith("L D L^T")
    return (
        "solver.factorisation",
        f"{today['factorisation']}: L D L^T of Carillon, METIS",
        (
            f"the quickest of {fact['count']}; the next takes {fact['next']:.2f} times as long"
            if is_ours
            else f"{fact['best']} takes {fact['over_ours']:.2f} times as long"
        ),
        "none: all give the same frequencies",
        "none",
        today["factorisation"] == "automatic" and (is_ours or fact["over_ours"] > 1 / LITTLE),
    )


def recommend_ranks(facts):
    two = facts["ranks"][2]
    return (
        "ranks",
        "1 (mpirun says more)",
        f"two take {two['cpu']:.2f} times the CPU time and {two['wall']:.2f} times the wall clock",
        "none: the frequencies are the same",
        "none",
        two["cpu"] > 1,
    )


def recommend_knob(knob, turns):
    """Judges a default of the runtime. One inaudibly looser setting is a wanted margin, since other scenes are more sensitive; further ones
    count only if they save 1 % of a core."""
    index = next(i for i, turn in enumerate(turns) if turn.setting == knob.default)
    usual = turns[index]
    describe = lambda turn: (
        "leaves nothing out"
        if turn.difference is None
        else playing.describe_difference(turn.difference).replace("from it", "from the strictest")
    )
    price = lambda turn: f"{playing.format_setting(turn.setting)}: {turn.cpu_ms:.2f} ms for a second, not {usual.cpu_ms:.2f}"
    stricter = price(turns[index - 1]) if index else "none"
    looser = f"{price(turns[index + 1])}; {describe(turns[index + 1])}" if index + 1 < len(turns) else "none"
    spare = [turn for turn in turns[index + 1 :] if not turn.difference.is_audible and usual.cpu_ms - turn.cpu_ms > WORTH_MS]
    agrees = not (usual.difference and usual.difference.is_audible) and len(spare) <= 1
    return (knob.key, playing.format_setting(knob.default), describe(usual), stricter, looser, agrees)


def recommend_modes(results):
    """Judges the defaults of banks: all modes of the band, 16 bits per component of a shape."""
    rows = []
    counts = [row for modes, _ in results.values() for row in modes[1:] if row.kept == "loudest"]
    fewest = {name: found for name, (modes, _) in results.items() if (found := banks.find_fewest(modes, "loudest"))}
    if counts and fewest:
        figure = "; ".join(
            f"{name}: {row.modes} of {results[name][0][0].modes} do not differ audibly from all where it is struck"
            for name, row in fewest.items()
        )
        saving = median(results[name][0][0].played.cpu_ms / max(row.played.cpu_ms, 1e-9) for name, row in fewest.items())
        rows.append(
            (
                "modes of a bank",
                "all of the band",
                figure + "; struck elsewhere other modes are the loudest, so the bank keeps all",
                "none",
                f"those alone: all take {saving:.2g} times their CPU time",
                True,
            )
        )
    bits = [row for _, tried in results.values() for row in tried[1:]]
    if bits:
        byte = [row for row in bits if row.bits == 8]
        shipped = max(banks.estimate_shipped_db(tried) for _, tried in results.values())
        looser = (
            f"8: {max(row.difference.error_db for row in byte):.0f} dB(A), audible on {sum(row.difference.is_audible for row in byte)} of"
            f" {len(byte)}"
            if byte
            else "none was measured"
        )
        rows.append(
            (
                "bits of a shape",
                str(banks.SHIPPED_BITS),
                f"an error of {shipped:.0f} dB(A) at most",
                "floats: twice the bytes",
                looser,
                shipped < sounds.ERROR_LIMIT_DB,
            )
        )
    return rows


def find_results(lab, bodies):
    measured = elements.measure(lab, bodies)
    results = []
    for body in bodies:
        truth, _ = elements.find_truth(body, measured[body.name])
        results.append((body, elements.make_points(body, measured[body.name], truth), truth))
    return results


def add_defaults(page, name, caption, rows):
    if not rows:
        return page.say(f"Of the {name}'s defaults nothing can be said on these bodies.")
    page.add_table(
        name,
        [HEAD] + [(*row[:5], "yes" if row[5] else "no" + (f": {REASONS[row[0]]}" if row[0] in REASONS else "")) for row in rows],
        caption,
        in_docs=name == "solver",  # those of bank and runtime are in the findings of banks and playing
    )
    against = [f"{row[0]} ({row[1]}{', kept: ' + REASONS[row[0]] if row[0] in REASONS else ''})" for row in rows if not row[5]]
    page.conclude(
        f"**Defaults, {name}**: {len(rows) - len(against)} of {len(rows)} agree with this study"
        + (f"; not {', '.join(against)}." if against else ".")
    )


def study(lab, bodies):
    page = Section("advice", "Recommendation: the defaults of the program", lab.make_command("banks", "playing", "advice"))
    facts, results = solver.find_facts(lab, bodies), find_results(lab, bodies)
    today = find_today(lab)
    rows = [
        recommend_element(results, today),
        recommend_sides(results),
        recommend_mass(lab, bodies, results, today),
        recommend_nodes(results, today),
        recommend_tolerance(facts, today),
        recommend_method(facts, today),
        recommend_factorisation(facts, today),
        recommend_ranks(facts),
    ]
    add_defaults(page, "solver", "Defaults of the solver, each with the figure that chose it.", [row for row in rows if row])
    if banks.NAME in lab.found:
        add_defaults(page, "bank", "Defaults of the bank (section banks).", recommend_modes(lab.found[banks.NAME]))
    if playing.NAME in lab.found:
        add_defaults(
            page,
            "runtime",
            (
                "Defaults of the runtime (section playing). One agrees when it does not differ audibly from the most accurate setting, and"
                f" no more than one looser setting of which that is true, too, would save {WORTH_MS:g} ms of CPU for a second."
            ),
            [recommend_knob(knob, turns) for knob, turns in lab.found[playing.NAME]],
        )
    else:
        page.say("Defaults of bank and runtime: `--only banks playing advice`.")
    write(lab, bodies, lab.out / "advice.json")
    page.say("`carillon study advise BODY --cents 5` chooses by these measurements and says afterwards what it came to.")
    return page
