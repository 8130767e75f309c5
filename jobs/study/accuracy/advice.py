"""Section: the recommendation. For every default of the program the figure that chose it, and what the next stricter and the next looser
would cost and bring; and the measurements that `carillon study advise` foresees from (advice.json), written anew from a study."""
import json
import statistics
import time

from accuracy import cents, elements, forecast, solver
from accuracy.bodies import Kind, find_kind
from accuracy.lab import Case, write_whole
from accuracy.section import Section

PROGRAMS = solver.PROGRAMS
DEFAULT_NODES = 10000  # of carillon-mesh and of a job's "body"
TRAINED_EAR, SEMITONE = 5.0, 100.0  # cents
START_DECIDES = 1.25  # the same on meshes so small that starting weighs as much as solving
LITTLE = 1.1  # times the CPU seconds: what is not worth a choice
HEAD = ("default", "today", "the figure that chose it", "the next stricter", "the next looser", "does today's agree")
CALIBRATION = {"body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012, "nodes": 4000}, "element": "T10", "band_hz": [20, 40000],
               "material": {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"rayleigh": {}}}}


def name_element(body, kind):
    """As advice.json has it: T10 are as good as the body lets them be, and "T10 straight" are those that could have been curved."""
    if kind.element == "T4":
        return "T4" if kind.mass == "consistent" else "T4 lumped"
    return "T10" if kind.curved or not body.round else "T10 straight"


def list_samples(body, solves):
    """(rows of advice.json for one body, its Truth)."""
    truth, _ = elements.find_truth(body, solves)
    doubt = max(cents.to_cents(1 + doubt, 1) for doubt in truth.uncertainty)
    rows = []
    for kind, solve in solves:
        errors = [abs(cents.to_cents(f, true)) for f, true in zip(solve.freq_hz, truth.freq_hz)]
        bars = [a + b for a, b in zip(solve.algebraic_cents, solve.discretisation_cents)]
        if len(errors) == len(truth.freq_hz):
            rows.append({"element": name_element(body, kind), "nodes": solve.nodes, "unknowns": solve.unknowns, "modes": len(solve.freq_hz), "cpu_s": round(solve.cpu, 4),
                         "worst_cents": max(errors), "median_cents": statistics.median(errors), "bar_cents": max(bars), "truth_cents": doubt})
    return rows, truth


def make_content(lab, bodies, facts):
    """advice.json: raw measurements; what follows from them is calculated when they are read (forecast.Advice)."""
    solves = elements.measure(lab, bodies)
    calibration = lab.measure([Case("calibration", CALIBRATION)], 3)["calibration"]
    content = {"format": forecast.FORMAT, "made_by": "carillon study accuracy --write-advice FILE", "machine": lab.describe_machine(), "date": time.strftime("%Y-%m-%d"),
               "calibration": {"job": CALIBRATION, "cpu_s": min(calibration.cpu_s)}, "ranks": {str(ranks): row for ranks, row in facts["ranks"].items() if ranks > 1}, "truths": {}, "bodies": {}}
    for body in bodies:
        content["bodies"][body.name], truth = list_samples(body, solves[body.name])
        if not body.truth:
            content["truths"][body.name] = {"freq_hz": truth.freq_hz, "uncertainty": truth.uncertainty}
    forecast.Advice(content)  # whoever reads it can
    return content


def write(lab, bodies, path):
    """Writes what `carillon study advise --advice FILE` reads; what the sections measured is kept, so this runs little more than the calibration."""
    facts = solver.find_facts(lab, bodies)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(make_content(lab, bodies, facts), indent=1) + "\n")


# --- the recommendation

def median(values):
    values = list(values)
    return statistics.median(values) if values else float("nan")


def say_times(ratio):
    return f"{ratio:.2g} times the CPU time"


def find_best_t10(body):
    return "T10 curved" if body.round else "T10 straight"


def find_costs(results, level):
    """{kind or "T10": {body: CPU seconds}} for the worst mode within so many cents; "T10" are those that suit the body."""
    costs = {}
    for body, points, _ in results:
        for kind in body.get_kinds():
            cost = cents.find_cost([point for point in points if point.kind == kind.name], level)
            if cost:
                costs.setdefault("T10" if kind.name == find_best_t10(body) else kind.name, {})[body.name] = cost.cpu_s
    return costs


def recommend_element(results):
    ear, semitone, one = (find_costs(results, level) for level in (TRAINED_EAR, SEMITONE, 1.0))
    linear = {body: min(values) for body in (body.name for body, _, _ in results) if (values := [ear[kind][body] for kind in ("T4 consistent", "T4 lumped") if body in ear.get(kind, {})])}
    t10 = ear.get("T10", {})
    wins = [body for body in t10 if body not in linear or t10[body] <= LITTLE * linear[body]]
    ratios = [linear[body] / t10[body] for body in linear if body in t10]
    figure = f"{TRAINED_EAR:g} cents: T10 are the cheapest on {len(wins)} of {len(results)} bodies"
    figure += f"; T4 take {median(ratios):.2g} times as long (median of the {len(ratios)} where they get there)" if ratios else "; T4 get there on none"
    stricter = median(one["T10"][body] / t10[body] for body in t10 if body in one.get("T10", {}))
    rough = [min(semitone[kind][body] for kind in ("T4 consistent", "T4 lumped") if body in semitone.get(kind, {})) / semitone["T10"][body]
             for body in semitone.get("T10", {}) if any(body in semitone.get(kind, {}) for kind in ("T4 consistent", "T4 lumped"))]
    looser = f"T4 for a semitone: {say_times(median(rough))} of T10" if rough else "T4 for a semitone: out of reach"
    return ("element", "T10", figure, f"T10 to 1 cent: {say_times(stricter)} of {TRAINED_EAR:g} cents", looser, 2 * len(wins) > len(results))


def recommend_sides(results):
    gains, prices = [], []
    for body, points, _ in results:
        own = {kind: [point for point in points if point.kind == kind] for kind in ("T10 straight", "T10 curved")}
        for straight, curved in zip(own["T10 straight"], own["T10 curved"]):
            gains.append(straight.worst / curved.worst)
            prices.append(curved.cpu_s / straight.cpu_s)
    if not gains:
        return None
    return ("sides", "curved (a \"body\", and --order 2)", f"on the same mesh straight sides are {median(gains):.2g} times as wrong (median of {len(gains)} meshes of round bodies)",
            "none", f"straight: {1 / median(prices):.2f} times the CPU time", median(gains) > 1 and median(prices) < 1.5)


def recommend_mass(lab, bodies, results):
    linear = []
    for _, points, _ in results:
        own = {mass: [point for point in points if point.kind == f"T4 {mass}"] for mass in ("consistent", "lumped")}
        linear += [(lumped.worst / full.worst, lumped.cpu_s / full.cpu_s) for full, lumped in zip(own["consistent"], own["lumped"])]
    quadratic = []
    for body in solver.choose_bodies(bodies)[: 1 if lab.quick else 2]:
        kind = find_kind(find_best_t10(body))
        sizes = body.get_sizes(lab)[1:3]
        full = [body.make_case(lab, kind, nodes) for nodes in sizes]
        lumped = [body.make_case(lab, Kind("T10 lumped", "T10", "lumped", kind.curved), nodes) for nodes in sizes]
        solves = lab.measure(full + lumped)
        truth = next(truth for other, _, truth in results if other.name == body.name)
        worst = lambda solve: max(abs(cents.to_cents(f, true)) for f, true in zip(solve.freq_hz, truth.freq_hz))
        quadratic += [(worst(solves[b.name]) / worst(solves[a.name]), solves[b.name].cpu / solves[a.name].cpu) for a, b in zip(full, lumped)]
    errors, prices = [median(column) for column in zip(*quadratic)]
    t4_errors, t4_prices = [median(column) for column in zip(*linear)]
    return ("mass", "consistent", f"with T10 a lumped mass is {errors:.2g} times as wrong on the same mesh", "none",
            f"lumped: {prices:.2f} times the CPU time with T10; with T4 {t4_prices:.2f} times, and {t4_errors:.2g} times the error, as its own has the other sign", errors > 1)


def recommend_nodes(results):
    def look(nodes):
        errors, seconds = [], []
        for body, points, _ in results:
            own = [point for point in points if point.kind == find_best_t10(body)]
            curve = forecast.Curve("T10", [forecast.Sample(p.nodes, p.unknowns, len(p.cents), p.worst, 0.0, p.cpu_s) for p in own])
            errors.append(curve.predict_cents(nodes))
            seconds.append(curve.predict_cpu(nodes))
        return errors, seconds

    (errors, seconds), (coarse, few), (fine, many) = look(DEFAULT_NODES), look(DEFAULT_NODES // 2), look(2 * DEFAULT_NODES)
    inside = sum(error <= TRAINED_EAR for error in errors)
    return ("nodes of a body", f"{DEFAULT_NODES:,}", f"the worst mode is within {TRAINED_EAR:g} cents on {inside} of {len(errors)} bodies, median {median(errors):.2g}, at most {max(errors):.3g}, for {median(seconds):.2g} CPU s",
            f"{2 * DEFAULT_NODES:,}: median {median(fine):.2g}, at most {max(fine):.3g} cents, {median(many):.2g} CPU s", f"{DEFAULT_NODES // 2:,}: median {median(coarse):.2g}, at most {max(coarse):.3g} cents, {median(few):.2g} CPU s",
            2 * inside >= len(errors))


def recommend_tolerance(facts):
    fact = facts["tolerance"]
    tight = min(fact["cpu"])
    loose = max(fact["cpu"])
    stricter = fact["cpu"].get(1e-10, fact["cpu"][tight])
    return ("solver.tolerance", "1e-8", f"it leaves bars of {fact['bars'][1e-8]:.1e} cents, where the best of these meshes is {fact['mesh']:.2g} cents wrong; frequencies move by {fact['moved'][loose]:.1e} cents from {tight:g} to {loose:g}",
            f"1e-10: {stricter:.2f} times the CPU time" if 1e-10 in fact["cpu"] else f"{tight:g}: {stricter:.2f} times the CPU time", f"{loose:g}: {fact['cpu'][loose]:.2f} times the CPU time",
            fact["cpu"][loose] > 1 / LITTLE and fact["bars"][1e-8] < 0.01)


def recommend_method(facts):
    fact = facts["method"]
    dense = f"dense costs over a tenth more from {fact['dense_from']:,} unknowns on" if fact["dense_from"] else "dense never cost over a tenth more"
    return ("solver.method", "automatic: block Lanczos; dense up to 300 unknowns", f"{dense}; Krylov-Schur takes {fact['krylov']:.1f} times the CPU time of block Lanczos", "none: all give the same frequencies", "none",
            fact["krylov"] > 1 / START_DECIDES and (fact["dense_from"] or 1e9) > 300)


def recommend_factorisation(facts):
    fact = facts["ordering"]
    is_ours = fact["best"].startswith("L D L^T")
    return ("solver.factorisation", "automatic: L D L^T of Carillon, METIS", f"the quickest of {fact['count']}; the next takes {fact['next']:.2f} times as long" if is_ours else f"{fact['best']} takes {fact['over_ours']:.2f} times as long",
            "none: all give the same frequencies", "none", is_ours or fact["over_ours"] > 1 / LITTLE)


def recommend_ranks(facts):
    two = facts["ranks"][2]
    return ("ranks", "1 (mpirun says more)", f"two take {two['cpu']:.2f} times the CPU time and {two['wall']:.2f} times the wall clock", "none: the frequencies are the same", "none", two["cpu"] > 1)


def find_results(lab, bodies):
    measured = elements.measure(lab, bodies)
    results = []
    for body in bodies:
        truth, _ = elements.find_truth(body, measured[body.name])
        results.append((body, elements.make_points(body, measured[body.name], truth), truth))
    return results


def study(lab, bodies):
    page = Section("advice", "Recommendation: the defaults of the program", lab.make_command("advice"))
    facts, results = solver.find_facts(lab, bodies), find_results(lab, bodies)
    rows = [recommend_element(results), recommend_sides(results), recommend_mass(lab, bodies, results), recommend_nodes(results), recommend_tolerance(facts), recommend_method(facts),
            recommend_factorisation(facts), recommend_ranks(facts)]
    rows = [row for row in rows if row]
    page.add_table("defaults", [HEAD] + [(*row[:5], "yes" if row[5] else "no") for row in rows], "Every default of the solver with the figure that chose it.")
    against = [row[0] for row in rows if not row[5]]
    page.conclude(f"**Defaults**: {len(rows) - len(against)} of {len(rows)} agree with this study" + (f"; not {', '.join(against)}." if against else "."))
    page.say("`carillon study advise BODY --cents 5` chooses by these measurements and says afterwards what it came to.")
    return page
