"""Section: corrected frequencies against those of the mesh: gain, validity of the error bars, cost of accuracy_cents."""
import dataclasses
import statistics

import cents
import elements
import plots
from lab import Case
from section import Section

PROGRAMS = elements.PROGRAMS
GOALS = (20.0, 5.0)  # tested values of accuracy_cents
QUADRATIC = ("T10 curved", "T10 straight")


@dataclasses.dataclass
class Compared:
    """One mesh of one kind: errors in cents, k-th against k-th, of mesh and corrected frequencies, and the error bars."""

    kind: str
    nodes: int
    cpu_s: float  # meshing included
    mesh: list
    corrected: list
    mesh_bars: list
    corrected_bars: list
    doubts: list  # uncertainty of the truth

    @property
    def ratio(self):
        """Median error of corrected frequencies relative to that of the mesh."""
        mesh, corrected = self.find_median()
        return corrected / mesh

    def find_median(self):
        """Median error in cents: (mesh, corrected)."""
        return tuple(statistics.median(map(abs, errors)) for errors in (self.mesh, self.corrected))

    def find_worst(self):
        return tuple(max(map(abs, errors)) for errors in (self.mesh, self.corrected))

    def count_held(self):
        return sum(abs(error) <= bar + doubt for error, bar, doubt in zip(self.corrected, self.corrected_bars, self.doubts))


def compare(kind, solve, truth, mesh_cpu_s):
    """None if the mesh has fewer modes than are known."""
    count = len(truth.freq_hz)
    if len(solve.freq_hz) < count:
        return None
    believed = sorted(zip(solve.corrected_hz, solve.corrected_cents))[:count]
    return Compared(
        kind.name,
        solve.nodes,
        solve.cpu + mesh_cpu_s,
        [cents.to_cents(f, true) for f, true in zip(solve.freq_hz, truth.freq_hz)],
        [cents.to_cents(f, true) for (f, _), true in zip(believed, truth.freq_hz)],
        solve.bar_cents[:count],
        [bar for _, bar in believed],
        [cents.to_cents(1 + doubt, 1) for doubt in truth.uncertainty],
    )


def compare_all(lab, body, solves):
    truth, _ = elements.find_truth(body, solves)
    seconds = {}
    for kind in dict.fromkeys(kind for kind, _ in solves):
        for size in lab.get_sizes(body, kind):
            mesh = body.make_mesh(lab, kind, size)
            seconds[kind.name, mesh.nodes] = mesh.cpu_s
    found = [compare(kind, solve, truth, seconds[kind.name, solve.nodes]) for kind, solve in solves]
    return [one for one in found if one], truth


def draw(section, lab, body, found):
    quadratic = next(name for name in QUADRATIC if any(one.kind == name for one in found))
    panels, rows = [], [("body", "element", "nodes", "cpu_s", "mesh_median", "corrected_median", "mesh_worst", "corrected_worst")]
    for title, find in (("median of the band", Compared.find_median), ("worst of the band", Compared.find_worst)):
        curves = {}
        for name in ("T4 consistent", quadratic):
            own = [one for one in found if one.kind == name]
            curves[f"{name}, mesh"] = [(one.cpu_s, find(one)[0]) for one in own]
            curves[f"{name}, corrected"] = [(one.cpu_s, find(one)[1]) for one in own]
        panels.append(plots.Panel(title, "CPU seconds, mesh included", "error, cents", curves, levels=list(elements.LEVELS)))
    for one in found:
        rows.append((body.name, one.kind, one.nodes, one.cpu_s, *one.find_median(), *one.find_worst()))
    section.add_chart(
        body.name,
        plots.draw_panels(panels, f"{body.name}: {body.summary}", "errors of the mesh's and of corrected frequencies"),
        f"{body.name[0].upper()}{body.name[1:]}: errors of the frequencies of the mesh and of the corrected ones.",
        rows,
        lab.make_command("corrected", "--on", body.name),
    )


def add_ratios(section, lab, results):
    """By element: gain, length of the error bars, share that holds."""
    rows = [("element", "meshes", "corrected over mesh: median error", "bars: corrected over mesh", "modes", "within their bars")]
    data = [("body", "element", "nodes", "ratio_of_medians", "bars", "modes", "held")]
    for name in dict.fromkeys(one.kind for _, found, _ in results for one in found):
        own = [(body, one) for body, found, _ in results for one in found if one.kind == name]
        # the truth must resolve the remaining error
        clear = [(body, one) for body, one in own if statistics.median(map(abs, one.corrected)) > 2 * statistics.median(one.doubts)]
        by_body = [
            statistics.median(one.ratio for body, one in clear if body.name == chosen)
            for chosen in dict.fromkeys(body.name for body, _ in clear)
        ]
        bars = [statistics.median(one.corrected_bars) / statistics.median(one.mesh_bars) for _, one in own]
        modes, held = sum(len(one.mesh) for _, one in own), sum(one.count_held() for _, one in own)
        ratio = f"{statistics.median(by_body):.2f} ({min(by_body):.2f} to {max(by_body):.2f})" if by_body else "-"
        rows.append((name, len(own), ratio, f"{statistics.median(bars):.2f}", modes, f"{100 * held / modes:.1f} %"))
        for body, one in own:
            bar = statistics.median(one.corrected_bars) / statistics.median(one.mesh_bars)
            data.append((body.name, name, one.nodes, one.ratio, bar, len(one.mesh), one.count_held()))
        if by_body:
            section.conclude(
                f"**Corrected frequencies, {name}**: the median error is {statistics.median(by_body):.2f} of the mesh's (median of"
                f" {len(by_body)} bodies), the bars are {statistics.median(bars):.2f} as long, and {100 * held / modes:.1f} % of"
                f" {modes} modes lie within them."
            )
    section.add_table(
        "ratios",
        rows,
        "Median error of the corrected frequencies over that of the mesh's: median over the meshes of a body, then over the bodies"
        " (extremes of the bodies); without meshes whose corrected error the truth does not resolve.",
        data,
        lab.make_command("corrected"),
    )


def find_shape(body):
    """The key "body" of a job for a parametric body; None for bent bodies and files."""
    if body.surface or body.change:
        return None
    words = body.words[2:]
    return {"shape": body.words[1]} | {f"{word[2:].replace('-', '_')}_m": float(value) for word, value in zip(words[::2], words[1::2])}


def add_goals(section, lab, results):
    """Cost of accuracy_cents, including trials and meshing, against the cheapest sufficient mesh of the study."""
    cases = {}
    for body, _, truth in results:
        shape = find_shape(body)
        for goal in GOALS:
            if shape and cents.is_known(truth, goal):
                job = {
                    "body": shape,
                    "material": body.material,
                    "accuracy_cents": goal,
                    "band_hz": body.find_band(),
                    "max_modes": body.modes,
                }
                cases[body.name, goal] = Case(f"{body.name}, accuracy_cents {goal:g}", job)
    if not cases:
        return
    solves = lab.measure(list(cases.values()))
    rows = [("body", "asked, cents", "trials", "nodes", "worst error, cents", "CPU s", "just does, CPU s", "ratio")]
    ratios = []
    for body, found, truth in results:
        for goal in GOALS:
            if (body.name, goal) not in cases:
                continue
            solve = solves[cases[body.name, goal].name]
            believed = sorted(solve.corrected_hz)
            worst = max(abs(cents.to_cents(f, true)) for f, true in zip(believed, truth.freq_hz))
            quadratic = [one for one in found if one.kind in QUADRATIC]
            cost = cents.find_cost([one for one in map(make_cost_point, quadratic)], goal, lambda point: point.worst)
            ratio = solve.cpu / cost.cpu_s if cost and cost.how != "extrapolated" else None
            ratios += [ratio] if ratio else []
            rows.append(
                (
                    body.name,
                    f"{goal:g}",
                    len(solve.record["accuracy"]["trials"]),
                    f"{solve.nodes:,}",
                    f"{worst:.2g}",
                    f"{solve.cpu:.2f}",
                    str(cost) if cost else "-",
                    f"{ratio:.1f}" if ratio else "-",
                )
            )
    section.add_table(
        "goals",
        rows,
        "`accuracy_cents`: CPU seconds of all its trials, meshing included, against the cheapest mesh of T10 of which the worst"
        " frequency of the mesh is as near as was asked (with its meshing; ≤: the coarsest mesh is better).",
        command=lab.make_command("corrected"),
    )
    if ratios:
        section.conclude(
            f"**accuracy_cents** spends {statistics.median(ratios):.1f} times the CPU time of a mesh that just does (median of"
            f" {len(ratios)}; {min(ratios):.1f} to {max(ratios):.1f}), its trials included."
        )


def make_cost_point(one):
    """Point of the uncorrected frequencies, for cents.find_cost()."""
    return cents.Point(one.kind, one.nodes, 3 * one.nodes, one.nodes, one.cpu_s, None, one.mesh)


def study(lab, bodies):
    section = Section("corrected", "Corrected frequencies", lab.make_command("corrected"))
    section.say(
        "The same solves as in the section before. A corrected frequency is that of the mesh with its estimated error taken off"
        " (docs/error-bars.md); both lists are sorted and compared with the truth k-th against k-th."
    )
    measured = elements.measure(lab, bodies)
    results = []
    for body in bodies:
        found, truth = compare_all(lab, body, measured[body.name])
        results.append((body, found, truth))
        draw(section, lab, body, found)
    add_ratios(section, lab, results)
    add_goals(section, lab, results)
    return section
