#!/usr/bin/env python3
"""The tables of docs/reports/stability.md against the cases (cases/*.json), the tests (CTest's label hard) and the figures of the last run.
A table has the cases nearest to their bounds, and the number of all.

usage: page.py BUILD_DIR            exit 1 and one line a fault: a case that is missing somewhere, one that is there twice, a bound that is
                                    not the one held
       page.py BUILD_DIR --update [GROUP]   runs the cases (ctest -L hard), then writes the tables; of one group, those alone
       page.py --self-test          proves that faults are found

Figures are lines {"case", "part", "value", "bound", "ranks"} in BUILD_DIR/hard-figures/<case>.jsonl, as figure.hpp and figure.py write
them.
"""
import json
import math
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import ctest
import provenance

PAGE = HERE.parents[1] / "docs/reports/stability.md"
GROUPS = ["meshes", "materials", "spectra", "ranks", "air", "motion", "time", "depth", "touches", "tune", "formats", "cross"]
KEYS = {"id", "title", "risk", "method", "figure"}
HEAD = "| case | risk | figure | measured | bound |\n|---|---|---|---|---|\n"
MAX_ROWS = 6  # of a group


def read_cases(folder=HERE / "cases"):
    """{group: [case, ...]} of the groups that there are."""
    return {group: json.loads((folder / f"{group}.json").read_text()) for group in GROUPS if (folder / f"{group}.json").exists()}


def read_figures(folder):
    """{case: [figure, ...]}"""
    figures = {}
    for path in sorted(pathlib.Path(folder).glob("*.jsonl")):
        for line in path.read_text().splitlines():
            figure = json.loads(line)
            figures.setdefault(figure["case"], []).append(figure)
    return figures


def read_tests(build):
    """The names of the tests with label hard."""
    return [test["name"] for test in ctest.list_tests(build, "-L", "hard", "-FA", "hard_figures")]


def read_tables(page):
    """{group: text between its markers}"""
    return dict(re.findall(r"<!-- begin (\w+) -->\n(.*?)<!-- end \1 -->", page, re.S))


def read_rows(page):
    """[(group, id, words, measured, bound), ...] as they stand between the markers of the page; words are the cells of the case."""
    rows = []
    for group, table in read_tables(page).items():
        for line in [line for line in table.splitlines() if line.startswith("|")][2:]:
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            rows.append((group, re.search(r"`(\w+)`", cells[0]).group(1), cells[:3], cells[-2], cells[-1]))
    return rows


def show(value):
    if value is None:
        return "not finite"
    return value if isinstance(value, str) else f"{value:.3g}"


def is_beyond(measured, bound):
    """Whether a row shows a figure that missed its bound."""
    if measured.startswith("not finite"):
        return True
    number, limit = (re.match(r"[-+]?[0-9][-+0-9.e]*", text) for text in (measured, bound))
    return bool(number and limit) and float(number[0]) > float(limit[0])


def calc_share(figure):
    """Share of its bound that a figure takes, above 1 beyond it; negative bounds are levels in dB. A refusal takes none."""
    value, bound = figure["value"], figure["bound"]
    if value is None:
        return math.inf
    if isinstance(value, str):
        return -math.inf
    if bound == 0:
        return math.inf if value > 0 else 0
    return value / bound if bound > 0 else 10 ** ((value - bound) / 20)


def find_worst(figures):
    """The figure that comes nearest to its bound; those that are only refused last."""
    return max(figures, key=calc_share)


def describe(figures):
    """(measured, bound) of a case as the page shows them."""
    worst = find_worst(figures)
    measured, bound = show(worst["value"]), show(worst["bound"])
    if worst["part"] and not isinstance(worst["value"], str):
        measured += f" ({worst['part']})"
    if not isinstance(worst["value"], str) and any(isinstance(figure["value"], str) for figure in figures):
        measured += ", others refused"
    return measured, bound


def make_words(case):
    """The cells of a row that do not depend on a run; the method stays in cases/*.json."""
    cells = [f"{case['title']} `{case['id']}`", case["risk"], case["figure"]]
    return [cell.replace("|", "\\|") for cell in cells]


def count_cases(cases, figures):
    """The line above a table."""
    refused = sum(all(isinstance(figure["value"], str) for figure in figures.get(case["id"], [{"value": None}])) for case in cases)
    return f"{len(cases)} cases: {len(cases) - refused} held to a bound, {refused} refused with one error."


def make_table(cases, figures):
    """Raises KeyError for a case without a figure."""
    shares = {case["id"]: calc_share(find_worst(figures[case["id"]])) for case in cases}
    rows = []
    for case in sorted((case for case in cases if shares[case["id"]] > -math.inf), key=lambda case: -shares[case["id"]])[:MAX_ROWS]:
        results = describe(figures[case["id"]])
        rows.append("| " + " | ".join([*make_words(case), *(cell.replace("|", "\\|") for cell in results)]) + " |")
    return f"{count_cases(cases, figures)}\n\n{HEAD}" + "\n".join(rows) + "\n"


def find_faults(cases, tests, page, figures):
    """What does not agree, one sentence each."""
    faults, tables, rows = [], read_tables(page), read_rows(page)
    known = [(group, case["id"]) for group in cases for case in cases[group]]
    shown = [(group, id) for group, id, _, _, _ in rows]
    texts = {(group, case["id"]): make_words(case) for group in cases for case in cases[group] if set(case) == KEYS}
    tested = {tuple(name.split(".")[1:3]) for name in tests if not name.startswith("hard.page")}
    for group in cases:
        for case in cases[group]:
            if set(case) != KEYS:
                faults.append(f"cases/{group}.json: {case.get('id', '?')} has not exactly the keys {', '.join(sorted(KEYS))}")
        if not tables.get(group, "").startswith(f"{len(cases[group])} cases: "):
            faults.append(f"docs/reports/stability.md does not say that {group} has {len(cases[group])} cases")
    for pair in sorted(set(known)):
        name = ".".join(pair)
        if [id for _, id in known].count(pair[1]) > 1:
            faults.append(f"{name} is there twice in cases/*.json")
        if pair not in tested:
            faults.append(f"{name} has no test hard.{name}")
        if shown.count(pair) > 1:
            faults.append(f"{name} stands {shown.count(pair)} times in docs/reports/stability.md")
    faults += [f"hard.{'.'.join(pair)} is a test without a case in cases/{pair[0]}.json" for pair in sorted(tested - set(known))]
    faults += [f"{'.'.join(pair)} stands in docs/reports/stability.md and is no case" for pair in sorted(set(shown) - set(known))]
    faults += [f"a figure is recorded for {id}, which is no case" for id in sorted(set(figures) - {id for _, id in known})]
    faults += [f"{id}: a figure is beyond its bound" for id in sorted(figures) if calc_share(find_worst(figures[id])) > 1]
    for group, id, words, measured, bound in rows:
        if words != texts.get((group, id), words):
            faults.append(f"{group}.{id}: docs/reports/stability.md has other words than cases/{group}.json")
        if is_beyond(measured, bound):
            faults.append(f"{group}.{id}: docs/reports/stability.md has {measured}, beyond its bound {bound}")
        held = {show(figure["bound"]) for figure in figures.get(id, [])}
        if held and bound not in held:
            faults.append(f"{group}.{id}: docs/reports/stability.md has the bound {bound}, held was {', '.join(sorted(held))}")
    return faults


def update(build, group=""):
    is_part = bool(group)
    chosen = ["-R", rf"^hard\.{group}\."] if group else ["-E", "^hard.page"]
    subprocess.run(["ctest", "--test-dir", build, "-L", "hard", *chosen, "-FC", "hard_figures", "--output-on-failure", "-j2"], check=True)
    figures, page = read_figures(pathlib.Path(build) / "hard-figures"), PAGE.read_text()
    for group, cases in {name: cases for name, cases in read_cases().items() if group in ("", name)}.items():
        marked = re.compile(rf"(<!-- begin {group} -->\n).*?(<!-- end {group} -->)", re.S)
        if not marked.search(page):
            sys.exit(f"{PAGE}: no line <!-- begin {group} -->")
        page = marked.sub(lambda found: found[1] + make_table(cases, figures) + found[2], page)
    PAGE.write_text(page if is_part else provenance.put(page, provenance.describe("tests/hard/page.py build/release --update")))


def self_test():
    case = {"id": "a", "title": "A", "risk": "r | s", "method": "m", "figure": "f"}
    figures = {
        "a": [
            {"case": "a", "part": "T4", "value": 2e-3, "bound": 1e-2, "ranks": 1},
            {"case": "a", "part": "", "value": "refused", "bound": "refused", "ranks": 1},
        ]
    }
    cases, tests = {"time": [case]}, ["hard.time.a.np2", "hard.page"]
    page = "<!-- begin time -->\n" + make_table([case], figures) + "<!-- end time -->\n"
    assert find_faults(cases, tests, page, figures) == [], find_faults(cases, tests, page, figures)
    assert "1 cases: 1 held to a bound, 0 refused" in page and "0.002 (T4), others refused" in page
    other = {"id": "b", "title": "B", "risk": "r", "method": "m", "figure": "f"}
    table = make_table([other, case], figures | {"b": [{"case": "b", "part": "", "value": "refused", "bound": "refused", "ranks": 1}]})
    assert table.startswith("2 cases: 1 held to a bound, 1 refused") and "`b`" not in table, table
    beyond = {"a": [{"case": "a", "part": "T4", "value": -29.0, "bound": -30.0, "ranks": 1}]}
    spoilt = [
        ({"time": [case, case]}, tests, page, figures, "twice"),
        (cases, ["hard.page"], page, figures, "no test"),
        (cases, tests + ["hard.time.b"], page, figures, "without a case"),
        (cases, tests, "", figures, "does not say that time has 1 cases"),
        (cases, tests, page.replace("1 cases", "2 cases"), figures, "does not say that time has 1 cases"),
        (cases, tests, page.replace("<!-- end time -->", "| `a` | r | f | 0.001 | 0.01 |\n<!-- end time -->"), figures, "stands 2 times"),
        (cases, tests, page.replace("`a`", "`c`"), figures, "is no case"),
        (cases, tests, page.replace("| 0.01 |", "| 0.02 |"), figures, "has the bound 0.02"),
        (cases, tests, page.replace("| 0.002 (T4)", "| 0.0101 (T4)"), figures, "beyond its bound"),
        (cases, tests, page.replace("| 0.002 (T4)", "| not finite (T4)"), figures, "beyond its bound"),
        (cases, tests, page, beyond, "a: a figure is beyond its bound"),
        (cases, tests, page, {"b": figures["a"]}, "figure is recorded"),
        ({"time": [{"id": "a"}]}, tests, page, figures, "keys"),
        ({"time": [case | {"risk": "another"}]}, tests, page, figures, "other words"),
    ]
    for cases, tests, page, figures, word in spoilt:
        found = find_faults(cases, tests, page, figures)
        assert any(word in fault for fault in found), (word, found)
    assert show(None) == "not finite" and find_worst([{"value": 1, "bound": 2}, {"value": None, "bound": 2}])["value"] is None


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        self_test()
    else:
        if sys.argv[2:3] == ["--update"]:
            update(sys.argv[1], *sys.argv[3:])
        faults = find_faults(
            read_cases(), read_tests(sys.argv[1]), PAGE.read_text(), read_figures(pathlib.Path(sys.argv[1]) / "hard-figures")
        )
        print("\n".join(faults) or "cases, tests and page agree")
        sys.exit(bool(faults))
