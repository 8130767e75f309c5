"""Section: trade-offs of the papers, measured: density that compensates a coarse mesh, lumped mass, few modes, dense matrices."""
import math
import statistics

import banks
import cents
import elements
import plots
from bodies import find_kind, make_bodies
from section import Section

PROGRAMS = ("carillon-mesh", "carillon-precompute", "carillon-bank", "carillon-render")
AUDIBLE_CENTS = 5  # about the threshold of a trained ear
DENSE_NODES, DENSE_NODES_QUICK = (105, 140, 210, 350, 512, 729, 1000), (105, 140, 210, 350)
ALWAYS_DENSE = 300  # unknowns up to which the program always uses LAPACK
EIGEN_PHASES = ("factor", "solve", "orthogonalise")


def find_points(lab, bodies):
    """[(body, truth, {kind: [Point]})] of the T4 meshes; without a known truth, curved T10 meshes are solved too."""
    known = elements.measure(lab, [body for body in bodies if body.truth], ("T4 consistent", "T4 lumped"))
    known |= elements.measure(lab, [body for body in bodies if not body.truth], ("T4 consistent", "T4 lumped", "T10 curved"))
    results = []
    for body in bodies:
        truth, _ = elements.find_truth(body, known[body.name])
        points = {}
        for point in elements.make_points(body, known[body.name], truth):
            points.setdefault(point.kind, []).append(point)
        results.append((body, truth, points))
    return results


def list_modes(values):
    return statistics.median(map(abs, values)), max(map(abs, values))


def study_density(section, lab, results):
    """Frequencies scale with density^(-1/2): the factor that corrects mode 1 shifts all modes by the same cents."""
    rows = [("body", "nodes, T4", "mode 1, cents", "density times", "others before: median", "worst", "others after: median", "worst")]
    data = [("body", "nodes", "density_factor", "mode", "error_before_cents", "error_after_cents")]
    left, curves = [], {}
    for body, _, points in results:
        for point in points.get("T4 consistent", []):
            shift = point.cents[0]
            after = [value - shift for value in point.cents]
            factor = 2 ** (2 * shift / 1200)
            before_others, after_others = list_modes(point.cents[1:]), list_modes(after[1:])
            rows.append(
                (
                    body.name,
                    f"{point.nodes:,}",
                    f"{shift:+.3g}",
                    f"{factor:.4g}",
                    *(f"{value:.3g}" for value in (*before_others, *after_others)),
                )
            )
            data += [
                (body.name, point.nodes, factor, index + 1, value, corrected)
                for index, (value, corrected) in enumerate(zip(point.cents, after))
            ]
            if abs(shift) > 1:
                left.append((after_others[0] / before_others[0], after_others[1], body.name, point.nodes))
            curves.setdefault(body.name, []).append((before_others[0], after_others[0]))
    section.add_table(
        "density",
        rows,
        (
            "Coarse meshes of T4 with consistent mass, and what is left when the density is raised until mode 1 is right. Every frequency"
            " falls by the same cents: the raised density corrects what all modes have in common, and no more."
        ),
        data,
    )
    panel = plots.Panel(
        "median of the other modes, before and after",
        "error before, cents",
        "error after, cents",
        curves,
        guides={"no repair": plots.draw_slope([(x, x) for curve in curves.values() for x, _ in curve], 1)},
    )
    section.add_chart(
        "repair",
        plots.draw_panels(
            [panel], "Raising the density until mode 1 is right", "what is left in the other modes; each point one mesh of T4"
        ),
        "What the repair leaves in the other modes against what they had.",
        data,
    )
    if left:
        ratios = [entry[0] for entry in left]
        worst = max(left, key=lambda entry: entry[1])
        harm = sum(ratio > 1 for ratio in ratios)
        section.conclude(
            f"**A density that makes up for a coarse mesh** leaves {100 * min(ratios):.0f} to {100 * max(ratios):.0f} % of the other modes'"
            f" median error (median {100 * statistics.median(ratios):.0f} % over {len(left)} meshes of T4)"
            + (f", on {harm} of them more than there was" if harm else "")
            + f"; the worst mode left is {worst[1]:.0f} cents out ({worst[2]}, {worst[3]:,} nodes)."
        )


def find_nodes_below(pairs, level):
    """Number of nodes at which a decreasing value crosses the level, by log-log interpolation; None without a crossing."""
    for (few, high), (many, low) in zip(pairs, pairs[1:]):
        if high > level >= low > 0:
            return round(few * (many / few) ** (math.log(high / level) / math.log(high / low)), -1)
    return None


def study_lumping(section, results):
    """Lumped against consistent mass on the same meshes."""
    rows = [
        (
            "body",
            "nodes, T4",
            "lumped below consistent, cents: median",
            "worst",
            "error, consistent: median",
            "lumped",
            "difference / error",
        )
    ]
    data = [("body", "nodes", "mode", "consistent_cents", "lumped_cents")]
    curves, crossings, ratios = {}, [], {}
    for body, _, points in results:
        pairs = []
        by_nodes = {point.nodes: point for point in points.get("T4 lumped", [])}
        for point in points.get("T4 consistent", []):
            lumped = by_nodes.get(point.nodes)
            if not lumped:
                continue
            gaps = [a - b for a, b in zip(point.cents, lumped.cents)]
            median, worst = list_modes(gaps)
            ratios.setdefault(body.name, []).append(median / point.median)
            rows.append(
                (
                    body.name,
                    f"{point.nodes:,}",
                    f"{median:.3g}",
                    f"{worst:.3g}",
                    f"{point.median:.3g}",
                    f"{lumped.median:.3g}",
                    f"{median / point.median:.2f}",
                )
            )
            data += [(body.name, point.nodes, index + 1, a, b) for index, (a, b) in enumerate(zip(point.cents, lumped.cents))]
            pairs.append((point.nodes, worst))
        curves[body.name] = pairs
        if pairs:
            crossings.append((body.name, pairs[-1], find_nodes_below(pairs, AUDIBLE_CENTS), pairs[0][1] <= AUDIBLE_CENTS))
    section.add_table("lumping", rows, "Lumped against consistent mass on the same meshes of T4.", data)
    panel = plots.Panel(
        "worst mode of the band", "nodes", "lumped below consistent, cents", curves, levels=[(AUDIBLE_CENTS, f"{AUDIBLE_CENTS} cents")]
    )
    section.add_chart(
        "lumping-size",
        plots.draw_panels([panel], "What lumping takes off, against the size of the mesh", "worst difference of a frequency, T4"),
        "The difference of both mass matrices against the nodes.",
        data,
    )
    if ratios:
        section.conclude(describe_lumping(ratios, crossings))


SMALL_SHARE = 0.1  # share of the error below which a difference is insignificant


def describe_lumping(ratios, crossings):
    """Sentences: where lumping is insignificant against the error of T4, and inaudible.

    ratios: {body: [difference / error, coarse to fine]}
    crossings: [(body, (nodes, cents) of the finest mesh, nodes or None where the difference becomes inaudible, always inaudible?)]
    """
    every = [ratio for values in ratios.values() for ratio in values]
    small = [name for name, values in ratios.items() if max(values) < SMALL_SHARE]
    text = (
        f"**Mass lumping** moves the frequencies of T4 by {100 * min(every):.0f} to {100 * max(every):.0f} % of the consistent element's"
        f" own error (medians over the band; median {100 * statistics.median(every):.0f} % over {len(every)} meshes),"
        f" {100 * statistics.median(values[0] for values in ratios.values()):.0f} % on the coarsest meshes and"
        f" {100 * statistics.median(values[-1] for values in ratios.values()):.0f} % on the finest: "
    )
    text += (
        f"on every mesh less than a tenth of it on {', '.join(small)}, and on no other body."
        if small
        else "on none of these bodies less than a tenth of it on every mesh."
    )
    reached = [f"{nodes:,.0f} nodes ({name})" for name, _, nodes, _ in crossings if nodes]
    never = [f"{name} ({last[1]:.0f} cents at {last[0]:,} nodes)" for name, last, nodes, always in crossings if not nodes and not always]
    if reached:
        text += f" The worst difference falls below {AUDIBLE_CENTS} cents from {', '.join(reached)} on."
    if never:
        text += f" It stays above {AUDIBLE_CENTS} cents on all meshes tried of {', '.join(never)}."
    return text


def study_modes(section, lab):
    """Loss of sound at the papers' numbers of modes, measured as in the section on banks."""
    rows, sentence = banks.measure_papers(lab)
    section.add_table(
        "modes",
        [("modes", *banks.CELLS), *((row.modes, *banks.to_cells(row)) for row in rows)],
        "A body of many modes with the loudest of them only: three hard blows, heard at 1 m.",
        [("modes", *banks.DATA), *((row.modes, *banks.to_data(row)) for row in rows)],
        lab.make_command("papers"),
    )
    section.conclude(f"**800 modes or fewer suffice**: {sentence[0].lower()}{sentence[1:]}")


def calc_eigen_s(solve):
    """CPU seconds of the eigensolver alone."""
    return sum(solve.record["effort"][phase]["cpu_seconds"] for phase in EIGEN_PHASES)


def find_crossing(sizes, dense_s, sparse_s):
    """Unknowns above which dense takes longer, by log-log interpolation; None without a crossing."""
    gaps = [math.log(a / b) for a, b in zip(dense_s, sparse_s)]
    for i in range(len(gaps) - 1):
        if gaps[i] <= 0 < gaps[i + 1]:
            return sizes[i] * (sizes[i + 1] / sizes[i]) ** (-gaps[i] / (gaps[i + 1] - gaps[i]))
    return None


def study_dense(section, lab):
    """Dense LAPACK against the sparse solver, same modes, cubes of T4."""
    body, kind = make_bodies()["cube"], find_kind("T4 consistent")
    names = ("dense", "block-lanczos")
    sizes = DENSE_NODES_QUICK if lab.quick else DENSE_NODES
    cases = {
        (nodes, method): body.make_case(lab, kind, nodes, name=method, solver={"method": method}) for nodes in sizes for method in names
    }
    solves = lab.measure(list(cases.values()))
    lines = []
    for nodes in sizes:
        dense, sparse = (solves[cases[nodes, method].name] for method in names)
        gap = max(abs(cents.to_cents(a, b)) for a, b in zip(dense.freq_hz, sparse.freq_hz))
        lines.append((dense.unknowns, dense.nodes, calc_eigen_s(dense), calc_eigen_s(sparse), dense.cpu, sparse.cpu, gap))
    rows = [
        (
            "unknowns",
            "nodes",
            "dense: eigensolver, CPU s",
            "sparse",
            "dense / sparse",
            "dense: whole run",
            "sparse",
            "differ by at most, cents",
        )
    ]
    rows += [
        (f"{n:,}", f"{nodes:,}", f"{a:.3f}", f"{b:.3f}", f"{a / b:.1f}", f"{c:.2f}", f"{d:.2f}", f"{gap:.1g}")
        for n, nodes, a, b, c, d, gap in lines
    ]
    data = [
        ("unknowns", "nodes", "dense_eigen_cpu_s", "sparse_eigen_cpu_s", "dense_cpu_s", "sparse_cpu_s", "largest_difference_cents"),
        *lines,
    ]
    section.add_table(
        "dense",
        rows,
        (
            f'LAPACK on dense matrices (`"method": "dense"`) against block Lanczos on a sparse factor, {body.modes} modes of a cube of T4.'
            f" Up to {ALWAYS_DENSE} unknowns the program solves densely in any case, so that both columns are the same there."
        ),
        data,
        lab.make_command("papers"),
    )
    curves = {"dense, LAPACK": [(line[0], line[2]) for line in lines], "sparse, block Lanczos": [(line[0], line[3]) for line in lines]}
    panel = plots.Panel(
        "eigensolver alone", "unknowns", "CPU seconds", curves, guides={"slope 3": plots.draw_slope(curves["dense, LAPACK"][-2:], 3)}
    )
    section.add_chart(
        "dense-time",
        plots.draw_panels([panel], "Dense and sparse today", f"{body.modes} modes of a cube of T4"),
        "Where dense and sparse cross.",
        data,
        lab.make_command("papers"),
    )
    apart = [line for line in lines if line[0] > ALWAYS_DENSE]
    crossing = find_crossing(*([line[column] for line in apart] for column in (0, 2, 3)))
    largest = lines[-1]
    if crossing:
        where = f"they cross at about {crossing:.0f} unknowns"
    elif all(line[2] > line[3] for line in apart):
        where = (
            f"dense takes longer on every size above the {ALWAYS_DENSE} unknowns at which the program goes over,"
            f" {apart[0][2] / apart[0][3]:.1f} times at {apart[0][0]:,} ({apart[0][1]} nodes)"
        )
    else:
        where = "dense takes no longer on any of these sizes"
    section.conclude(
        f"**Dense up to 1,000 nodes**: today {where}; at {largest[1]:,} nodes ({largest[0]:,} unknowns) dense takes"
        f" {largest[2] / largest[3]:.0f} times the CPU of the sparse eigensolver ({largest[2]:.2g} s against {largest[3]:.2g} s)."
    )


def study(lab, bodies):
    section = Section(
        "papers",
        "The papers' own trade-offs",
        lab.make_command("papers", *(["--on", *(body.name for body in bodies)] if len(bodies) < len(make_bodies()) - 1 else [])),
    )
    results = find_points(lab, bodies)
    study_density(section, lab, results)
    study_lumping(section, results)
    study_modes(section, lab)
    study_dense(section, lab)
    return section
