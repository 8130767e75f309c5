"""Section: solver settings: tolerance, number of modes, ranks, ordering and factorisation, method."""
import dataclasses
import math
import os

import plots
from bodies import find_kind, make_bodies
from forecast import find_fall
from measuring import to_cents
from section import Section
from study_lab import QUADRATIC_SIZES_OF

PROGRAMS = ("carillon-mesh", "carillon-precompute", "carillon-bank")
TOLERANCES = (5e-5, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)  # banks reject residuals of 1e-4 or above
MODES = (10, 30, 100, 300, 800)
# (label, solver.factorisation, options after --)
FACTORISATIONS = (
    ("L D L^T of Carillon, METIS", "ldlt", ()),
    ("MUMPS, METIS", "mumps", ()),
    ("MUMPS, QAMD", "mumps", ("-mumps_ordering", "qamd")),
    ("MUMPS, PORD", "mumps", ("-mumps_ordering", "pord")),
    ("MUMPS, AMF", "mumps", ("-mumps_ordering", "amf")),
    ("MUMPS, AMD", "mumps", ("-mumps_ordering", "amd")),
)
MAX_DENSE_NODES = 400  # a dense solve of 1,000 takes most of a minute; the section on the papers includes one
METHODS = ("block-lanczos", "krylov-schur", "dense")
PREFERRED = ("sphere", "plate")  # curved with degenerate groups; thin with rounding errors in its lowest modes
HIGHEST_HZ = 1e6  # above the 800th mode of all bodies


def find_errors(body, freq_hz):
    """Cents above the truth by mode; empty without a truth."""
    return [to_cents(f, true) for f, true in zip(freq_hz, body.truth.freq_hz)] if body.truth else []


def find_distance(one_hz, other_hz):
    """Largest distance in cents of modes of equal index; infinite if the counts differ."""
    return find_fall(one_hz, other_hz) if len(one_hz) == len(other_hz) else math.inf


def show(value, digits=3):
    return "0" if value == 0 else f"{value:.{digits}g}"


def draw_curves(curves, title, subtitle, x_label, y_label):
    return plots.draw_panels([plots.Panel(subtitle, x_label, y_label, curves)], title, "")


def choose_bodies(bodies):
    """Preferred bodies, else the first that can be meshed coarsely (thin walls cannot)."""
    chosen = [body for name in PREFERRED for body in bodies if body.name == name]
    return chosen or [body for body in bodies if body.name not in QUADRATIC_SIZES_OF][:1] or [make_bodies()[PREFERRED[0]]]


class Solver:
    def __init__(self, lab, bodies):
        self.lab = lab
        self.bodies = choose_bodies(bodies)[: 1 if lab.quick else 2]
        self.nodes = 2000 if lab.quick else 5000
        self.page = Section("solver", "Solver: tolerance, number of modes, ranks, ordering, method", lab.make_command("solver"))
        self.facts = {}  # for the recommendation

    def make_case(self, name, body, nodes=None, ranks=1, options=(), max_modes=None, band_hz=None, **solver):
        kind = find_kind("T10 curved" if body.round else "T10 straight")
        more = {"max_modes": max_modes, "band_hz": [20, HIGHEST_HZ]} if max_modes else {}
        if band_hz:
            more = {"band_hz": band_hz}
        case = body.make_case(self.lab, kind, nodes or self.nodes, ranks, name, **more, **({"solver": solver} if solver else {}))
        return dataclasses.replace(case, options=tuple(options))

    def measure(self, cases, **more):
        """[Solve] in the order of the cases."""
        solves = self.lab.measure(cases, **more)
        return [solves[case.name] for case in cases]

    # --- tolerance

    def study_tolerance(self):
        tolerances = (TOLERANCES[0], 1e-8, TOLERANCES[-1]) if self.lab.quick else TOLERANCES
        cases = [self.make_case(f"tolerance {t:g}", body, tolerance=t) for body in self.bodies for t in tolerances]
        solves = iter(self.measure(cases))
        rows = [
            (
                "body",
                "tolerance",
                "CPU s",
                "spread",
                "solves",
                "worst residual (backward error)",
                "error bar of the equation, cents",
                "from the tightest, cents",
                "from the truth, cents",
            )
        ]
        data = [
            (
                "body",
                "tolerance",
                "cpu_s",
                "spread",
                "solves",
                "worst_residual",
                "worst_algebraic_cents",
                "worst_from_tightest_cents",
                "worst_from_truth_cents",
            )
        ]
        growth, moved, truths, bars, work = {}, {}, [], {}, {}
        for body in self.bodies:
            of_body = [next(solves) for _ in tolerances]
            tight = of_body[-1]
            curves = {"worst residual": [], "error bar, cents": [], "from the tightest, cents": []}
            for t, solve in zip(tolerances, of_body):
                truth = max(map(abs, find_errors(body, solve.freq_hz)), default=math.nan)
                distance, bar, residual = find_distance(solve.freq_hz, tight.freq_hz), max(solve.algebraic_cents), max(solve.residual)
                values = (body.name, t, solve.cpu, solve.spread, solve.record["solver"]["solves"], residual, bar, distance, truth)
                data.append(values)
                rows.append(
                    (
                        body.name,
                        f"{t:g}",
                        f"{solve.cpu:.2f}",
                        f"{100 * solve.spread:.0f} %",
                        values[4],
                        show(residual, 2),
                        show(bar, 2),
                        show(distance, 2),
                        show(truth, 4),
                    )
                )
                growth[t] = growth.get(t, []) + [solve.cpu / of_body[tolerances.index(1e-8)].cpu]
                moved[t] = max(moved.get(t, 0.0), distance)
                bars[t] = max(bars.get(t, 0.0), bar)
                truths.append(truth)
                work.setdefault(t, []).append(solve.record["solver"]["solves"])
                for name, value in zip(curves, (residual, bar, distance)):
                    curves[name].append((t, value))
            self.page.add_chart(
                f"tolerance-{body.name}",
                draw_curves(
                    curves,
                    f"What the tolerance buys: {body.name}",
                    f"T10, {of_body[0].nodes:,} nodes, {len(tight.freq_hz)} modes",
                    "solver.tolerance",
                    "residual, or cents",
                ),
                f"Backward error, its bar and the error against the tightest solve: {body.name}.",
                [("tolerance", "worst_residual", "bar_cents", "from_tightest_cents")]
                + [(row[1], row[5], row[6], row[7]) for row in data[1:] if row[0] == body.name],
            )
        self.page.add_table("tolerance", rows, "Errors are the largest of all modes; the truth is known without a mesh.", data)
        loose, strict = tolerances[0], tolerances[-1]
        self.facts["tolerance"] = {
            "cpu": {t: max(values) for t, values in growth.items()},
            "moved": moved,
            "bars": bars,
            "mesh": min(truths),
        }
        self.page.conclude(
            f"**Tolerance** hardly matters to frequencies: from {strict:g} to {loose:g} they move by {show(moved[loose], 2)} cents at most,"
            f" while these meshes are {show(min(truths), 2)} to {show(max(truths), 2)} cents from the truth; CPU time at {loose:g} is"
            f" {self.describe_change(growth[loose])} and at {strict:g} {self.describe_change(growth[strict])} that of the default, 1e-8,"
            f" whose bars of the matrix equation are {show(bars[1e-8], 2)} cents at most."
            + (
                " Looser than 1e-8 saves no solve: a run asks more of its vectors than that before it ends."
                if work[loose] == work[1e-8]
                else ""
            )
        )

    @staticmethod
    def describe_change(ratios):
        return " and ".join(f"{ratio:.2f}" for ratio in ratios) + " times"

    # --- number of modes

    def study_modes(self):
        body = self.bodies[0]
        counts = MODES[:3] if self.lab.quick else MODES
        solves = self.measure([self.make_case(f"{count} modes", body, max_modes=count) for count in counts])
        rows = [
            (
                "modes",
                "up to, Hz",
                "CPU s",
                "spread",
                "ms a mode",
                "solves a mode",
                "factorisations",
                "worst residual",
                "largest error bar, cents",
            )
        ]
        data = [("body", "modes", "highest_hz", "cpu_s", "spread", "solves", "factorisations", "worst_residual", "worst_bar_cents")]
        for solve in solves:
            found, record = len(solve.freq_hz), solve.record["solver"]
            bar = max(solve.bar_cents)
            data.append(
                (
                    body.name,
                    found,
                    solve.freq_hz[-1],
                    solve.cpu,
                    solve.spread,
                    record["solves"],
                    record["factorisations"],
                    max(solve.residual),
                    bar,
                )
            )
            rows.append(
                (
                    found,
                    f"{solve.freq_hz[-1]:,.0f}",
                    f"{solve.cpu:.2f}",
                    f"{100 * solve.spread:.0f} %",
                    f"{1e3 * solve.cpu / found:.1f}",
                    f"{record['solves'] / found:.1f}",
                    record["factorisations"],
                    show(max(solve.residual), 2),
                    show(bar),
                )
            )
        self.page.add_table("modes", rows, f"The lowest modes of the {body.name}, T10, {solves[0].nodes:,} nodes (`max_modes`).", data)
        self.page.add_chart(
            "modes",
            draw_curves(
                {"CPU s": [(row[1], row[3]) for row in data[1:]], "largest error bar, cents": [(row[1], row[8]) for row in data[1:]]},
                f"What more modes cost: {body.name}",
                f"T10, {solves[0].nodes:,} nodes",
                "modes",
                "CPU s, and cents",
            ),
            "CPU seconds and the largest error bar against the number of modes.",
            data,
        )
        first, last = data[1], data[-1]
        power = math.log(last[3] / first[3]) / math.log(last[1] / first[1])
        self.facts["modes"] = {"power": power}
        self.page.conclude(
            f"**Modes**: {last[1] / first[1]:.0f} times as many ({first[1]} to {last[1]}) take {last[3] / first[3]:.1f} times the CPU time"
            f" on one mesh (power {power:.2f}), but the error bar of the worst is {last[8] / first[8]:.0f} times as long: it is the mesh"
            " that they need, not the solver, which makes a wide band expensive."
        )

    # --- ranks

    def study_ranks(self):
        cores = len(os.sched_getaffinity(0))
        rows = [("body", "ranks", "CPU s", "spread", "wall s", "CPU over one rank", "wall over one rank", "frequencies agree to, cents")]
        data = [("body", "ranks", "oversubscribed", "cpu_s", "spread", "wall_s", "from_one_rank_cents")]
        ratios, moved = {}, 0.0
        counts = (1, 2) if self.lab.quick else (1, 2, 4)
        cases = [self.make_case(f"{ranks} ranks", body, ranks=ranks) for body in self.bodies for ranks in counts]
        solves = iter(self.measure(cases))
        for body in self.bodies:
            of_body = [next(solves) for _ in counts]
            one = of_body[0]
            for ranks, solve in zip(counts, of_body):
                wall, distance = sorted(solve.wall_s)[len(solve.wall_s) // 2], find_distance(solve.freq_hz, one.freq_hz)
                one_wall = sorted(one.wall_s)[len(one.wall_s) // 2]
                moved = max(moved, distance)
                ratios.setdefault(ranks, []).append((solve.cpu / one.cpu, wall / one_wall))
                data.append((body.name, ranks, ranks > cores, solve.cpu, solve.spread, wall, distance))
                rows.append(
                    (
                        body.name,
                        f"{ranks}{'*' if ranks > cores else ''}",
                        f"{solve.cpu:.2f}",
                        f"{100 * solve.spread:.0f} %",
                        f"{wall:.2f}",
                        f"{solve.cpu / one.cpu:.2f}",
                        f"{wall / one_wall:.2f}",
                        show(distance, 2),
                    )
                )
        self.page.add_table("ranks", rows, f"A star: more ranks than this machine has cores ({cores}), oversubscribed.", data)
        self.facts["ranks"] = {
            ranks: {
                "cpu": sum(c for c, _ in values) / len(values),
                "wall": sum(w for _, w in values) / len(values),
                "crowded": ranks > cores,
            }
            for ranks, values in ratios.items()
        }
        two = self.facts["ranks"][2]
        self.page.conclude(
            f"**Ranks** change no frequency by more than {show(moved, 2)} cents; two take {two['cpu']:.2f} times the CPU seconds of one and"
            f" {two['wall']:.2f} times its wall clock here, for solves of {min(row[3] for row in data[1:]):.1f} to"
            f" {max(row[3] for row in data[1:] if row[1] == 1):.1f} CPU s."
            + (
                f" The machine had other work as well (a load of {self.lab.load_start:.1f} on {cores} core{'s' if cores > 1 else ''} when"
                " the study began): the wall clock says little about the ranks."
                if self.lab.load_start > 0.5 * cores
                else ""
            )
        )

    # --- ordering and factorisation

    def study_ordering(self):
        body = self.bodies[-1]
        kinds = [FACTORISATIONS[i] for i in (0, 1, 5)] if self.lab.quick else FACTORISATIONS
        cases = [self.make_case(label, body, options=options, factorisation=kind) for label, kind, options in kinds]
        solves = self.measure(cases, may_fail=True)
        rows = [
            (
                "factorisation, ordering",
                "CPU s",
                "spread",
                "over ours",
                "entries of the factor",
                "operations",
                "worst residual",
                "frequencies agree to, cents",
            )
        ]
        data = [("label", "ordering", "cpu_s", "spread", "factor_entries", "factor_flops", "worst_residual", "from_ours_cents")]
        ours = solves[0]
        for (label, _, _), solve in zip(kinds, solves):
            if solve.error:
                rows.append((label, "failed", *[""] * 5, solve.error[:60]))
                continue
            record = solve.record["solver"]
            distance = find_distance(solve.freq_hz, ours.freq_hz)
            data.append(
                (
                    label,
                    record["ordering"],
                    solve.cpu,
                    solve.spread,
                    record["factor_entries"],
                    record["factor_flops"],
                    max(solve.residual),
                    distance,
                )
            )
            flops = f"{record['factor_flops']:.2g}" if record["factor_flops"] else "unknown"
            rows.append(
                (
                    label,
                    f"{solve.cpu:.2f}",
                    f"{100 * solve.spread:.0f} %",
                    f"{solve.cpu / ours.cpu:.2f}",
                    f"{record['factor_entries']:,}",
                    flops,
                    show(max(solve.residual), 2),
                    show(distance, 2),
                )
            )
        self.page.add_table(
            "ordering",
            rows,
            f"The {body.name}, T10, {ours.nodes:,} nodes, {len(ours.freq_hz)} modes; block Lanczos on each factorisation.",
            data,
        )
        best, worst = min(data[1:], key=lambda row: row[2]), max(data[1:], key=lambda row: row[2])
        mumps = [row for row in data[1:] if row[0].startswith("MUMPS")]
        least, most = min(mumps, key=lambda row: row[4]), max(mumps, key=lambda row: row[4])
        others = sorted(row[2] / ours.cpu for row in data[2:])
        self.facts["ordering"] = {"best": best[0], "over_ours": best[2] / ours.cpu, "next": others[0], "count": len(data) - 1}
        self.page.conclude(
            f"**Ordering and factorisation** change CPU time, not the answer ({show(max(row[7] for row in data[1:]), 2)} cents at most):"
            f" {best[0]} is the quickest, {worst[0]} takes {worst[2] / best[2]:.1f} times as long. Of MUMPS's orderings {least[1]} leaves"
            f" the fewest entries and {most[1]} {most[4] / least[4]:.2f} times as many."
        )

    # --- method

    def study_method(self):
        body = self.bodies[0]
        sizes = (200, 400) if self.lab.quick else (200, 300, 400, 700, 1000)
        # A band that holds a good part of all modes is solved densely whatever is asked for: it ends above the lowest six here.
        low, high = body.find_band()
        band = [low, 1.4 * (body.truth.freq_hz[5] if body.truth else high / 16)]
        cases = [
            self.make_case(f"{method}, {nodes} nodes", body, nodes, band_hz=band, method=method)
            for nodes in sizes
            for method in METHODS
            if nodes <= MAX_DENSE_NODES or method != "dense"
        ]
        if not self.lab.quick:
            cases += [self.make_case(f"{method}, {self.nodes} nodes", body, band_hz=band, method=method) for method in METHODS[:2]]
        solves = self.lab.measure(cases, may_fail=True)
        rows = [("unknowns", "method", "CPU s", "spread", "modes", "worst residual", "from the first of its size, cents")]
        data = [("unknowns", "method", "cpu_s", "spread", "modes", "worst_residual", "from_block_lanczos_cents")]
        curves, by_size = {}, {}
        for case in cases:
            solve = solves[case.name]
            method = case.job["solver"]["method"]
            if solve.error or not solve.freq_hz:
                continue
            first = by_size.setdefault(solve.unknowns, {method: solve})
            first[method] = solve
            distance = find_distance(solve.freq_hz, next(iter(first.values())).freq_hz)
            data.append((solve.unknowns, method, solve.cpu, solve.spread, len(solve.freq_hz), max(solve.residual), distance))
            rows.append(
                (
                    f"{solve.unknowns:,}",
                    method,
                    f"{solve.cpu:.2f}",
                    f"{100 * solve.spread:.0f} %",
                    len(solve.freq_hz),
                    show(max(solve.residual), 2),
                    show(distance, 2),
                )
            )
            curves.setdefault(method, []).append((solve.unknowns, solve.cpu))
        self.page.add_table("method", rows, f"The {body.name}, T10: all modes of its band by three methods.", data)
        self.page.add_chart(
            "method",
            draw_curves(curves, f"Three methods: {body.name}", "T10, all modes of the band", "unknowns", "CPU s"),
            "CPU seconds of the whole run by method.",
            data,
        )
        dearer = [
            n
            for n, methods in sorted(by_size.items())
            if {"dense", "block-lanczos"} <= methods.keys() and methods["dense"].cpu > 1.1 * methods["block-lanczos"].cpu
        ]
        tail = max(n for n, methods in by_size.items() if {"krylov-schur", "block-lanczos"} <= methods.keys())
        ratio = by_size[tail]["krylov-schur"].cpu / by_size[tail]["block-lanczos"].cpu
        self.facts["method"] = {"dense_from": dearer[0] if dearer else None, "krylov": ratio}
        crossing = (
            f"dense LAPACK costs over a tenth more from {dearer[0]:,} unknowns on"
            if dearer
            else "dense LAPACK never cost over a tenth more on these"
        )
        self.page.conclude(
            f"**Method**: all give the same frequencies to {show(max(row[6] for row in data[1:]), 2)} cents; {crossing}, and Krylov-Schur"
            f" takes {ratio:.1f} times the CPU time of block Lanczos at {tail:,} unknowns."
        )


def run(lab, bodies):
    solver = Solver(lab, bodies)
    solver.page.say(f"Every knob alone, the others at their defaults; bodies: {', '.join(body.name for body in solver.bodies)}.")
    for part in (solver.study_tolerance, solver.study_modes, solver.study_ranks, solver.study_ordering, solver.study_method):
        part()
    return solver


def study(lab, bodies):
    return run(lab, bodies).page


def find_facts(lab, bodies):
    """Basis of the recommendation: {knob: {...}}. Uses the section's cached solves."""
    return run(lab, bodies).facts
