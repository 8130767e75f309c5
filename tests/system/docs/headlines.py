#!/usr/bin/python3
"""The headline figures of the one-screen pages of docs/, taken from the generated reports in docs/reports/. A report is short. It
says when, at which commit, on which machine and by which command it was measured, as the pages of the examples do.

usage: headlines.py SOURCE_DIR            exit 1 and one line per fault
       headlines.py SOURCE_DIR --update   writes them
"""
import json
import pathlib
import re
import statistics
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import provenance

MAX_LINES = 200  # of a report
HEAD_LINES = 20
GOALS = ((100, "a semitone (100 cents)"), (10, "10 cents"), (1, "1 cent"))
GROUPS = {
    "meshes": "bad, extreme and odd meshes",
    "materials": "extreme materials",
    "spectra": "dense, clustered and wide spectra",
    "air": "radiation by boundary elements",
    "motion": "large motion: full order, coupled modes",
    "time": "long times, contacts, joints, sound",
    "touches": "contacts from the steps of other engines",
    "tune": "sensitivities, tuning, recordings",
    "formats": "formats of other programs",
    "cross": "answers of other solvers and engines",
}


def read_between(page, name):
    found = re.search(rf"<!-- (?:begin )?{re.escape(name)} -->\n(.*?)<!-- (?:/|end ){re.escape(name)} -->", page, re.S)
    if not found:
        raise ValueError(f"no place between <!-- {name} --> and <!-- /{name} -->")
    return found[1]


def read_rows(text, columns):
    """The rows of all Markdown tables of so many columns, without heads."""
    rows = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in text.splitlines() if line.startswith("|")]
    heads = [k for k, row in enumerate(rows) if set("".join(row)) <= set("-:")]
    dropped = {*heads, *(k - 1 for k in heads)}
    return [row for k, row in enumerate(rows) if k not in dropped and len(row) == columns]


def write_table(head, rows):
    rule = "|---|" + "--:|" * (len(head) - 1)
    return "\n".join([f"| {' | '.join(head)} |", rule, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def say_range(values, form):
    """Median, and the extremes in brackets."""
    return f"{form(statistics.median(values))} ({form(min(values))} to {form(max(values))})"


def make_goals(source):
    """Of each body the cheapest measured mesh whose worst mode is within the goal. Bodies whose true frequencies are less certain than
    the goal are left out."""
    bodies = json.loads((source / "jobs/study/advice.json").read_text())["bodies"]
    rows = []
    for cents, text in GOALS:
        for element in ("T10", "T4"):
            reached, asked = [], 0
            for points in bodies.values():
                own = [point for point in points if point["element"] == element and point["truth_cents"] <= cents]
                good = [point for point in own if point["worst_cents"] <= cents]
                asked += bool(own)
                reached += [min(good, key=lambda point: point["cpu_s"])] if good else []
            nodes = say_range([point["nodes"] for point in reached], lambda value: f"{value:,.0f}") if reached else "-"
            seconds = say_range([point["cpu_s"] for point in reached], lambda value: f"{value:.2g}") if reached else "-"
            rows.append([text, element, f"{len(reached)} of {asked}", nodes, seconds])
    default = next(row for row in read_rows((source / "docs/reports/accuracy.md").read_text(), 6) if row[0] == "nodes of a body")
    table = write_table(["worst mode of the band within", "element", "bodies that reach it", "nodes", "CPU s"], rows)
    return f"{table}\nThe default, {default[1]} nodes: {default[2]}.\n"


def make_bars(source):
    return read_between((source / "docs/reports/error-bars.md").read_text(), "summary")


def make_cases(source):
    page = (source / "docs/reports/stability.md").read_text()
    table = []
    for group, text in GROUPS.items():
        held, refused = re.match(r"\d+ cases: (\d+) held to a bound, (\d+) refused", read_between(page, group)).groups()
        table.append([text, f"`ctest --preset release -R hard.{group}`", held, refused])
    return write_table(["group", "command", "cases held to a bound", "cases refused with one error"], table)


def make_prediction(source):
    page = (source / "docs/reports/scaling.md").read_text()
    rows = [[row[0], row[9], row[8], row[10], row[12]] for row in read_rows(read_between(page, "prediction"), 13)]
    prediction = write_table(["ranks", "good, s", "expected, s", "poor, s", "GB on the fullest rank"], rows)
    return f"{make_counts(page)}\n{prediction}\n{make_check(page)}"


def make_counts(page):
    """The goals by counts, on two bodies."""
    t10, million = ({row[0]: row for row in read_rows(read_between(page, f"counts-{name}"), 14)} for name in ("t10", "million"))
    head = [
        "ranks",
        "bunny of 106,471 nodes, T10: path",
        "fullest rank",
        "a million unknowns, T4: path",
        "fullest rank",
        "messages on a solve's path",
    ]
    rows = [[ranks, one[2], one[4], million[ranks][2], million[ranks][4], million[ranks][11]] for ranks, one in t10.items()]
    return write_table(head, rows)


def make_check(page):
    """How far the model of scaling is from what was measured on several ranks, at most."""
    check = [row for row in read_rows(read_between(page, "check"), 9) if row[0] != "1"]
    large = ("factor", "solve and orthogonalise")
    percent = {row: abs(int(check[row][4].rstrip(" %"))) for row in range(len(check))}
    memory = [row for row in read_rows(read_between(page, "memory"), 5) if row[0] != "1"]
    rows = [
        [", ".join(large), f"{max(percent[k] for k, row in enumerate(check) if row[1] in large)} %"],
        ["the other phases, tenths of a second each", f"{max(percent[k] for k, row in enumerate(check) if row[1] not in large)} %"],
        ["memory of the fullest rank", f"{max(abs(100 * (float(row[4]) / float(row[1]) - 1)) for row in memory):.0f} %"],
    ]
    return write_table(["quantity, on 2 to 4 ranks", "largest deviation of the model"], rows)


def make_rivals(source):
    page = (source / "docs/reports/performance.md").read_text()
    tables = []
    for name in ("table", "table-800"):
        text = read_between(page, name)
        facts = re.search(r"([\d,]+) unknowns, (\d+) modes.*?(\d+|one) runs? each.*?(\d{4}-\d\d-\d\d)", text, re.S)
        if facts[3] == "one":
            continue  # no headline
        runs = f"medians of {facts[3]} interleaved runs"
        rows = [row[:6] for row in read_rows(text, 9)]
        head = ["program", "CPU s", "spread", "times ours", "wall s", "peak GB"]
        tables.append(f"{facts[2]} modes, {facts[1]} unknowns, {runs}, {facts[4]}:\n\n{write_table(head, rows)}")
    return "\n".join(tables)


def make_voices(source):
    page = (source / "docs/reports/performance-runtime.md").read_text()
    text = read_between(page, "table")
    one = {row[0]: row for row in read_rows(text, 6) if row[1] == "1024"}
    many = {row[0]: row for row in read_rows(text, 5) if row[2] == "4"}
    rows = [[name, one[name][4], f"{int(one[name][5]):,}", f"{int(many[name][4]):,}"] for name in one]
    return write_table(
        ["instructions", "of the machine's limit", "modes in real time, one voice of 1,024", "512 voices of 1,000, four banks"], rows
    )


def make_effects(source):
    rows = read_rows(read_between((source / "docs/reports/effects.md").read_text(), "study"), 8)
    return write_table(["scene", "difference, dB(A)", "CPU, auto : all on"], [[row[0].split(":")[0], row[2], row[5]] for row in rows])


PAGES = {
    "accuracy": make_goals,
    "error-bars": make_bars,
    "stability": make_cases,
    "scaling": make_prediction,
    "performance": make_rivals,
    "performance-runtime": make_voices,
    "effects": make_effects,
}


def find_report_faults(source):
    pages = [*source.glob("docs/reports/*.md"), *source.glob("docs/examples/*/README.md")]
    for page in sorted([*pages, source / "docs/packed-banks.md", source / "docs/performance-web.md"]):
        name, lines = page.relative_to(source), page.read_text().splitlines()
        measured = provenance.LINE.search("\n".join(lines[:HEAD_LINES]))
        if page.parent.name == "reports" and len(lines) > MAX_LINES:
            yield f"{name}: {len(lines)} lines; a report has at most {MAX_LINES}"
        if (page.parent.name != "reports" or page.name != "README.md") and (not measured or measured[1]):
            yield f"{name}: no line `Measured DATE, commit COMMIT, MACHINE, by COMMAND.` of a commit at its top"


def main():
    source = pathlib.Path(sys.argv[1])
    faults = list(find_report_faults(source))
    for name, make in PAGES.items():
        page = source / f"docs/{name}.md"
        text, table = page.read_text(), make(source)
        if make != make_rivals:  # whose tables say when they were measured
            table += f"\n{provenance.LINE.search((source / f'docs/reports/{name}.md').read_text())[0]}\n"
        if read_between(text, "headline") == table:
            continue
        if sys.argv[2:] == ["--update"]:
            page.write_text(
                re.sub(r"(<!-- headline -->\n).*?(<!-- /headline -->)", lambda found: found[1] + table + found[2], text, flags=re.S)
            )
        else:
            faults.append(f"docs/{name}.md: its figures are not those of its report: tests/system/docs/headlines.py . --update renews them")
    print("\n".join(faults) if faults else f"{len(PAGES)} pages have the figures of their reports")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
