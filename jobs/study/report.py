"""Output of a scaling study: report.md, cases.csv and SVG charts."""
import csv

import charts
import measuring
import scaling

SPREAD_LIMIT = 0.15


def write(study):
    write_cases(study)
    lines = [f"# Scaling of {study.job_file.name}", "", *describe_setup(study), ""]
    lines += write_strong(study)
    lines += write_weak(study)
    lines += write_growth(study)
    lines += write_messages(study)
    (study.out / "report.md").write_text("\n".join(lines) + "\n")


def describe_setup(study):
    record = next(iter(study.runs.values()))[0]
    processors = [line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")][:1]
    lines = [
        (
            f"{study.program.name} {record['git']}, {record['versions']['mpi']}, {record['versions']['blas'].split(' (')[0]};"
            f" {processors[0] if processors else 'a processor without a name'}, {study.cores} core{'s' if study.cores > 1 else ''} to"
            " run on."
        ),
        (
            f"{study.repeats} repeat{'s' if study.repeats > 1 else ''} of every case, all cases in turn; seconds are medians of wall clock,"
            " and means over the ranks."
        ),
    ]
    if any(study.is_crowded(ranks) for ranks in study.ranks):
        lines.append(
            "**Ranks with a star are more than there are cores**: their seconds say nothing of a machine that has as many; their"
            " messages do."
        )
    spread, share = max(study.calc_spread(case) for case in study.cases), study.calc_share()
    if spread > SPREAD_LIMIT or share < 1 - SPREAD_LIMIT:
        lines.append(
            f"**The machine was busy**: repeats differ by up to {100 * spread:.0f} % from their median, and one rank got"
            f" {100 * min(share, 1):.0f} % of a processor. Operations, messages and bytes do not mind; seconds do, and what they say of"
            " limits may be the others' doing."
        )
    if not study.is_repeatable():
        lines.append("**Repeats of a case did different work**: the counts are those of the first.")
    if not study.has_body:
        lines.append(
            'The job has a mesh file, which cannot be meshed again: strong scaling only. With a `"body"` it would get weak scaling and'
            " growth."
        )
    return lines


def star(study, ranks):
    return f"{ranks}*" if study.is_crowded(ranks) else str(ranks)


def to_table(rows):
    return measuring.format_table(rows, True).splitlines() + [""]


def find_phases(study, cases):
    """Phases with at least a thousandth of the time of some case."""
    return [phase for phase in scaling.PHASES if any(study.calc_phase(case, phase)[0] > 1e-3 * study.calc_seconds(case) for case in cases)]


def save(study, name, picture):
    (study.out / name).write_text(picture)


def draw_cases(study, name, title, cases, labels):
    bars = [(label, [(phase, *study.calc_phase(case, phase)[1:]) for phase in scaling.PHASES]) for case, label in zip(cases, labels)]
    save(study, name, charts.draw_bars(bars, title, "wall seconds by phase; the pale part of each is inside MPI (messages and waiting)"))


def write_strong(study):
    cases = study.strong
    title = f"Strong scaling: {study.get_unknowns(cases[0]):,} unknowns, {study.runs[cases[0]][0]['solver']['modes']} modes"
    draw_cases(study, "strong.svg", title, cases, [f"{star(study, case.ranks)} rank{'s' if case.ranks > 1 else ''}" for case in cases])
    base = scaling.Case(cases[0].nodes, 1)
    has_base = base in study.runs
    rows = [("phase", *(f"{star(study, case.ranks)}: s (in MPI)" for case in cases), "times as fast", "limit")]
    last = max((case for case in cases if not study.is_crowded(case.ranks)), default=cases[-1])
    for phase in find_phases(study, cases):
        cells = [
            f"{wall:.3f} ({100 * inside / wall if wall > 0 else 0:.0f} %)"
            for wall, _, inside in (study.calc_phase(case, phase) for case in cases)
        ]
        limit = scaling.find_limit(study, phase, last)
        faster = (
            study.calc_phase(base, phase)[0] / study.calc_phase(last, phase)[0] if has_base and study.calc_phase(last, phase)[0] > 0 else 0
        )
        rows.append((phase, *cells, f"{faster:.2f}" if faster else "-", limit.text if limit else "-"))
    total = [study.calc_seconds(case) for case in cases]
    faster = study.calc_seconds(base) / study.calc_seconds(last) if has_base else 0
    rows.append(("in all", *(f"{seconds:.3f}" for seconds in total), f"{faster:.2f}" if faster else "-", ""))
    rows.append(
        ("peak of the fullest rank, GB", *(f"{max(study.runs[case][0]['peak_bytes_by_rank']) / 1e9:.3f}" for case in cases), "", "")
    )
    lines = [
        "## Strong scaling: the same body on more ranks",
        "",
        "![seconds by phase on 1, 2, ... ranks](strong.svg)",
        "",
        *to_table(rows),
    ]
    if has_base and last.ranks > 1:
        lines += [
            (
                f'"Times as fast" and the limits are those of {last.ranks} ranks against one. A limit is the largest part of the'
                " rank-seconds that were lost: computing more, computing slower, messages (counted, at 2 us and 4 GB/s), or waiting inside"
                " MPI."
            ),
            "",
        ]
    return lines


def write_weak(study):
    if not study.weak:
        return []
    cases = study.weak
    labels = [f"{star(study, case.ranks)} rank{'s' if case.ranks > 1 else ''}, {study.get_unknowns(case):,}" for case in cases]
    draw_cases(study, "weak.svg", "Weak scaling: the body's unknowns grow with the ranks", cases, labels)
    rows = [("phase", *labels, "Gflop/s a rank", "of one rank's")]
    crowded = [case for case in cases if not study.is_crowded(case.ranks)] or cases
    one, last = cases[0], crowded[-1]

    def calc_rate(case, phase):
        wall = study.calc_phase(case, phase)[0]
        return study.get_work(case)[phase]["flops"] / case.ranks / wall / 1e9 if wall > 0 else 0.0

    for phase in find_phases(study, cases):
        first, final = calc_rate(one, phase), calc_rate(last, phase)
        rows.append(
            (
                phase,
                *(f"{study.calc_phase(case, phase)[0]:.3f}" for case in cases),
                f"{first:.2f} -> {final:.2f}" if first > 0.01 else "-",
                f"{100 * final / first:.0f} %" if first > 0.01 else "-",
            )
        )
    rows.append(("in all", *(f"{study.calc_seconds(case):.3f}" for case in cases), "", ""))
    return [
        "## Weak scaling: as many unknowns on every rank",
        "",
        "![seconds by phase as body and ranks grow](weak.svg)",
        "",
        *to_table(rows),
        (
            "A direct factorisation does more than its share as a body grows, so equal seconds are not to be had; what can stay is the"
            f" rate of the work on each rank ({one.ranks} rank against {last.ranks})."
        ),
        "",
    ]


def write_growth(study):
    cases = study.growth
    if len(cases) < 2:
        return []
    unknowns = [study.get_unknowns(case) for case in cases]
    phases = find_phases(study, cases)
    curves = {phase: [(n, study.calc_phase(case, phase)[0]) for n, case in zip(unknowns, cases)] for phase in phases}
    curves["in all"] = [(n, study.calc_seconds(case)) for n, case in zip(unknowns, cases)]
    first, last = unknowns[0], unknowns[-1]
    begin = curves["in all"][0][1]
    curves["unknowns^1"] = [(first, begin), (last, begin * last / first)]
    curves["unknowns^2"] = [(first, begin), (last, begin * (last / first) ** 2)]
    save(
        study,
        "growth.svg",
        charts.draw_lines(
            curves,
            "Growth with the mesh, on one rank",
            "wall seconds by phase; dashed: slopes 1 and 2",
            "unknowns",
            "seconds",
            unknowns,
            dashed=("unknowns^1", "unknowns^2"),
        ),
    )

    def describe(values):
        fit = scaling.fit_power(unknowns, values)
        return f"{fit[0]:.2f}" + (f" (within {100 * (fit[1] - 1):.0f} %)" if len(unknowns) > 2 else "") if fit else "-"

    rows = [("phase", *(f"{n:,} unknowns: s" for n in unknowns), "seconds grow as unknowns^", "operations as unknowns^")]
    for phase in phases:
        rows.append(
            (
                phase,
                *(f"{study.calc_phase(case, phase)[0]:.3f}" for case in cases),
                describe([study.calc_phase(case, phase)[0] for case in cases]),
                describe([study.get_work(case)[phase]["flops"] for case in cases]),
            )
        )
    rows.append(
        (
            "in all",
            *(f"{study.calc_seconds(case):.3f}" for case in cases),
            describe([study.calc_seconds(case) for case in cases]),
            describe([sum(work["flops"] for work in study.get_work(case).values()) for case in cases]),
        )
    )
    solver = lambda case, key: study.runs[case][0]["solver"][key]
    more = [("what", *(f"{n:,} unknowns" for n in unknowns), "grows as unknowns^")]
    for label, values, form in (
        ("modes", [solver(case, "modes") for case in cases], "{:.0f}"),
        ("entries of a factor", [solver(case, "factor_entries") for case in cases], "{:.3g}"),
        ("operations of a factorisation", [solver(case, "factor_flops") for case in cases], "{:.3g}"),
        ("peak of memory, GB", [max(study.runs[case][0]["peak_bytes_by_rank"]) / 1e9 for case in cases], "{:.3f}"),
    ):
        more.append((label, *(form.format(value) for value in values), describe(values)))
    return [
        "## Growth with the mesh, on one rank",
        "",
        "![seconds by phase against unknowns](growth.svg)",
        "",
        *to_table(rows),
        *to_table(more),
    ]


def write_messages(study):
    cases = [case for case in study.strong if case.ranks > 1]
    if not cases:
        return []
    rows = [("phase", *(f"{star(study, case.ranks)}: {what}" for case in cases for what in ("messages", "MB", "collective calls", "MB")))]
    for phase in scaling.PHASES:
        work = [study.get_work(case)[phase] for case in cases]
        rows.append(
            (
                phase,
                *(
                    cell
                    for w in work
                    for cell in (
                        f"{w['messages']:.0f}",
                        f"{w['bytes'] / 1e6:.3f}",
                        f"{w['collectives']:.0f}",
                        f"{w['collective_bytes'] / 1e6:.3f}",
                    )
                ),
            )
        )
    lines = [
        "## Messages",
        "",
        "Of all ranks together, in the strong case; a collective call is counted on every rank that takes part.",
        "",
        *to_table(rows),
    ]
    curves = {}
    for phase in scaling.PHASES:
        points = [(case.ranks, study.get_work(case)[phase]["bytes"] + study.get_work(case)[phase]["collective_bytes"]) for case in cases]
        if any(value > 0 for _, value in points):
            curves[phase] = [(ranks, value / 1e6) for ranks, value in points]
    if len(cases) > 1 and curves:
        marks = [case.ranks for case in cases if study.is_crowded(case.ranks)]
        save(
            study,
            "messages.svg",
            charts.draw_lines(
                curves,
                "Bytes between the ranks",
                "sent and put into collective calls, all ranks; a star: more ranks than cores",
                "ranks",
                "MB",
                [case.ranks for case in cases],
                marks,
            ),
        )
        lines[2:2] = ["![bytes by phase against ranks](messages.svg)", ""]
    return lines


def write_cases(study):
    with open(study.out / "cases.csv", "w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(
            "nodes_asked ranks more_ranks_than_cores unknowns modes repeat phase wall_s mpi_s cpu_s flops messages bytes collectives"
            " collective_bytes peak_bytes_fullest_rank".split()
        )
        for case in study.cases:
            for repeat, record in enumerate(study.runs[case]):
                for phase in scaling.PHASES:
                    effort, work = record["effort"][phase], record["work"][phase]
                    seconds = (effort["wall_seconds"] / case.ranks, effort["mpi_seconds"] / case.ranks, effort["cpu_seconds"])
                    counts = (work[key] for key in ("flops", "messages", "bytes", "collectives", "collective_bytes"))
                    names = [case.nodes or "", case.ranks, int(study.is_crowded(case.ranks)), study.get_unknowns(case)]
                    names += [record["solver"]["modes"], repeat, phase]
                    figures = [*(f"{value:.6f}" for value in seconds), *(f"{value:.0f}" for value in counts)]
                    table.writerow([*names, *figures, max(record["peak_bytes_by_rank"])])
