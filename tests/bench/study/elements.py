"""Section: elements. Frequency errors against CPU time, convergence rates, cost of one cent."""
import collections
import statistics

import cents
import plots
from bodies import KINDS, make_bodies
from section import Section

PROGRAMS = ("carillon-mesh", "carillon-precompute", "carillon-bank")
LEVELS = ((1, "one cent"), (10, "ten cents"), (100, "a semitone"))


def measure(lab, bodies, kinds=None):
    """{body's name: [(kind, Solve)]}, coarse to fine, identical meshes once. kinds: names (default: all)."""
    cases, order = {}, collections.defaultdict(list)
    for body in bodies:
        lab.say(f"meshing: {body.name}")
        for kind in [kind for kind in body.get_kinds() if not kinds or kind.name in kinds]:
            seen = set()
            for nodes in lab.get_sizes(body, kind):
                case = body.make_case(lab, kind, nodes)
                if case.job["mesh"] not in seen:
                    seen.add(case.job["mesh"])
                    cases[case.name] = case
                    order[body.name].append((kind, case.name))
    solves = lab.measure(list(cases.values()))
    return {name: [(kind, solves[case]) for kind, case in entries] for name, entries in order.items()}


def find_truth(body, solves):
    """(Truth, sentence or ""): the known one, or the limit of curved T10 meshes, described by the sentence."""
    if body.truth:
        return body.truth, ""
    finest = sorted((solve for kind, solve in solves if kind.curved), key=lambda solve: solve.elements)
    count = min(len(solve.freq_hz) for solve in finest)
    truth, power = cents.extrapolate([solve.elements ** (-1 / 3) for solve in finest], [solve.freq_hz[:count] for solve in finest])
    doubts = [cents.to_cents(1 + doubt, 1) for doubt in truth.uncertainty]
    steps = [abs(cents.to_cents(f, limit)) for f, limit in zip(finest[-1].freq_hz, truth.freq_hz)]
    return (
        truth,
        (
            f"The frequencies of the {body.name} are not known. Its reference here is the limit of all its curved T10"
            f" ({', '.join(f'{solve.nodes:,}' for solve in finest)} nodes; order {power:.1f}), {statistics.median(steps):.1f} cents"
            f" (median; {max(steps):.1f} at most) below the finest; it is itself uncertain by {statistics.median(doubts):.1f} cents"
            f" (median; {max(doubts):.1f} at most). Errors near that are no errors."
        ),
    )


def make_points(body, solves, truth):
    points = [cents.make_point(kind.name, solve, truth) for kind, solve in solves]
    return [point for point in points if point]


def draw(section, body, points, command):
    curves = lambda find_x, find_y: {
        kind.name: [(find_x(point), find_y(point)) for point in points if point.kind == kind.name] for kind in body.get_kinds()
    }
    panels = []
    cpu = lambda point: point.cpu_s
    levels = [(level, text) for level, text in LEVELS]
    for title, find in (
        ("mode 1", lambda point: point.first),
        ("median of the band", lambda point: point.median),
        ("worst of the band", lambda point: point.worst),
    ):
        front = [pair for pair in plots.find_front([(cpu(point), find(point)) for point in points])]
        panels.append(plots.Panel(title, "CPU seconds", "error, cents", curves(cpu, find), front=front, levels=levels))
    rates = curves(lambda point: point.edge, lambda point: point.median)
    guides = {
        f"slope {power}": plots.draw_slope(rates.get(name, []), power, 0.6)
        for name, power in (("T4 consistent", 2), ("T10 curved" if body.round else "T10 straight", 4))
    }
    panels.append(
        plots.Panel("median against edge length", "edge length (elements to the power -1/3)", "error, cents", rates, guides=guides)
    )
    rows = [
        (
            "body",
            "element",
            "nodes",
            "unknowns",
            "elements",
            "cpu_s",
            "cpu_spread",
            "error_mode_1_cents",
            "error_median_cents",
            "error_worst_cents",
        )
    ]
    rows += [
        (
            body.name,
            point.kind,
            point.nodes,
            point.unknowns,
            point.elements,
            point.cpu_s,
            "" if point.spread is None else point.spread,
            point.cents[0],
            point.median,
            point.worst,
        )
        for point in points
    ]
    section.add_chart(
        body.name,
        plots.draw_panels(panels, f"{body.name}: {body.summary}", f"error of the frequencies of {body.modes} modes against CPU seconds"),
        f"{body.name[0].upper()}{body.name[1:]}, {body.summary}: errors against CPU seconds, and against the edge length.",
        rows,
        command,
    )


def add_table(section, body, points, command):
    rows = [("element", "nodes", "unknowns", "CPU s", "spread", "mode 1, cents", "median", "worst")]
    for point in points:
        rows.append(
            (
                point.kind,
                f"{point.nodes:,}",
                f"{point.unknowns:,}",
                f"{point.cpu_s:.2f}",
                "-" if point.spread is None else f"{100 * point.spread:.0f} %",
                f"{point.cents[0]:+.3g}",
                f"{point.median:.3g}",
                f"{point.worst:.3g}",
            )
        )
    data = [("element", "nodes", "unknowns", "cpu_s", "mode", "error_cents")]
    data += [
        (point.kind, point.nodes, point.unknowns, point.cpu_s, index + 1, value)
        for point in points
        for index, value in enumerate(point.cents)
    ]
    section.add_table(
        f"{body.name}-modes",
        rows,
        (
            "The same as numbers; the CSV has every mode. Spread: half the distance of the extremes over the median; - where there was one"
            " run."
        ),
        data,
        command,
    )


def expect_rate(body, kind):
    """Theoretical order: 2p for elements of degree p, 2 where straight sides approximate a curved body."""
    if kind.element == "T4":
        return 2
    return 4 if kind.curved or not body.round else 2


def describe_cost(points, kinds, truth):
    """Sentence: cheapest element for each accuracy that the truth resolves; "" without one."""
    parts = []
    for level, text in reversed([(level, text) for level, text in LEVELS if cents.is_known(truth, level)]):
        costs = {kind.name: cents.find_cost([point for point in points if point.kind == kind.name], level) for kind in kinds}
        costs = {name: cost for name, cost in costs.items() if cost}
        if costs:
            name = min(costs, key=lambda name: costs[name].cpu_s)
            parts.append(f"{text} {costs[name]} CPU s ({name})")
    return "; ".join(parts)


def study_body(section, lab, body, solves):
    """Adds chart, table and sentences of one body; returns (points, truth)."""
    truth, remark = find_truth(body, solves)
    points = make_points(body, solves, truth)
    command = lab.make_command("elements", "--on", body.name)
    if remark:
        section.say(remark)
    draw(section, body, points, command)
    add_table(section, body, points, command)
    cost = describe_cost(points, body.get_kinds(), truth)
    if cost:
        section.say(
            f"{body.name[0].upper()}{body.name[1:]}: the worst of {len(points[0].cents)} modes within {cost}. (≤: its coarsest mesh is"
            " better than that; ~: its finest is worse, by its trend.)"
        )
    return points, truth


def add_rates(section, lab, results):
    """Measured against theoretical rate of every kind on every body."""
    rows = [("body", *(f"{kind.name}: measured (theory)" for kind in KINDS))]
    data = [("body", "element", "rate_measured", "rate_theory")]
    gaps = collections.defaultdict(list)
    for body, points, truth in results:
        cells = []
        for kind in KINDS:
            own = [point for point in points if point.kind == kind.name]
            rate = cents.find_rate(own, truth) if own else None
            cells.append("-" if rate is None else f"{rate:.1f} ({expect_rate(body, kind)})")
            if rate is not None:
                data.append((body.name, kind.name, rate, expect_rate(body, kind)))
                gaps[kind.name].append(rate - expect_rate(body, kind))
        rows.append((body.name, *cells))
    section.add_table(
        "rates",
        rows,
        (
            "Rates of convergence: the power of the edge length with which the median error falls over the three finest meshes. On bodies"
            " with flat faces straight and curved T10 are the same mesh. Theory holds where the solution is smooth and meshes are similar;"
            " bodies with thin walls reach it late."
        ),
        data,
        lab.make_command("elements"),
    )
    if gaps:
        parts = (f"{name} {statistics.median(own):+.1f} ({min(own):+.1f} to {max(own):+.1f})" for name, own in gaps.items())
        section.conclude(f"**Rates of convergence** less those of theory, median of the bodies and extremes: {', '.join(parts)}.")


def add_costs(section, lab, results):
    """Cost of one cent, ten cents and a semitone by body and element, and the sentences of the summary."""
    rows = [("body", "element", *(f"{text}: CPU s" for _, text in LEVELS))]
    data = [("body", "element", "cents", "cpu_s", "how")]
    cheapest = {level: collections.Counter() for level, _ in LEVELS}
    table = {}
    for body, points, truth in results:
        best = {}
        for kind in body.get_kinds():
            own = [point for point in points if point.kind == kind.name]
            costs = [cents.find_cost(own, level) if cents.is_known(truth, level) else None for level, _ in LEVELS]
            rows.append(
                (
                    body.name,
                    kind.name,
                    *(
                        str(cost) if cost else "out of reach" if cents.is_known(truth, level) else "unknown"
                        for cost, (level, _) in zip(costs, LEVELS)
                    ),
                )
            )
            for (level, _), cost in zip(LEVELS, costs):
                if cost:
                    data.append((body.name, kind.name, level, cost.cpu_s, cost.how))
                    table[body.name, kind.name, level] = cost
                    if level not in best or cost.cpu_s < best[level][0]:
                        best[level] = (cost.cpu_s, kind.name)
        for level, (_, name) in best.items():
            cheapest[level][name] += 1
    section.add_table(
        "costs",
        rows,
        (
            "CPU seconds for the worst mode of the band to be as near as that (≤: the coarsest mesh is better; ~: the finest is worse, by"
            " its trend; out of reach: more than thirty times as wrong, or errors that do not fall; unknown: the truth itself is less"
            " certain than that)."
        ),
        data,
        lab.make_command("elements"),
    )
    names = [body.name for body, _, _ in results]
    for level, text in LEVELS:
        least = [
            min(costs, key=lambda cost: cost.cpu_s)
            for name in names
            if (costs := [cost for key, cost in table.items() if key[0] == name and key[2] == level])
        ]
        if least:
            section.conclude(describe_level(text, least, cheapest[level], len(names)))


def describe_level(text, least, cheapest, count):
    """Cost of an accuracy over all bodies. least: lowest Cost of each body; cheapest: how often each element has it."""
    seconds = [cost.cpu_s for cost in least]
    spread = (
        f"{min(seconds):.2g} to {max(seconds):.2g} CPU s (median {statistics.median(seconds):.2g} s over {len(seconds)} of {count} bodies)"
        if len(seconds) > 1
        else f"{seconds[0]:.2g} CPU s"
    )
    by_trend = sum(cost.how == "extrapolated" for cost in least)
    trend = (
        (", by the trend of the finest meshes" if len(least) == 1 else f", {by_trend} of them by the trend of the finest meshes")
        if by_trend
        else ""
    )
    return (
        f"**{text[0].upper()}{text[1:]}** for the worst mode of the band costs {spread}{trend}; cheapest is"
        f" {', '.join(f'{kind} on {number}' for kind, number in cheapest.most_common())}."
    )


def study(lab, bodies):
    section = Section(
        "elements",
        "Element and mesh",
        lab.make_command("elements", *(["--on", *(body.name for body in bodies)] if len(bodies) < len(make_bodies()) - 1 else [])),
    )
    measured = measure(lab, bodies)
    section.say(
        f"Frequencies of {len(bodies)} bod{'ies' if len(bodies) > 1 else 'y'} on meshes of several sizes, one rank, tolerance and method by"
        " default; CPU seconds of `carillon-precompute`, which reads the mesh and writes the bank with its proof and error bars. Truth: no"
        " finite element gave it (Ritz, Lamb, Fourier-Ritz; `known.csv` names the source), but for the bunny. Meshing is not in the CPU"
        " seconds."
    )
    results = []
    for body in bodies:
        points, truth = study_body(section, lab, body, measured[body.name])
        results.append((body, points, truth))
    add_rates(section, lab, results)
    add_costs(section, lab, results)
    return section
