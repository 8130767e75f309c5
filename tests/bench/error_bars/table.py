#!/usr/bin/python3
"""The table and the picture of docs/reports/error-bars.md.

usage: table.py MODES.csv [PICTURE.svg]      MODES.csv: from  error_bars --modes MODES.csv
"""
import collections
import csv
import math
import statistics
import sys

COLOURS = {"T4": "#c0392b", "T4 lumped": "#e59866", "T10": "#2471a3", "T10 curved": "#17a589", "T10 lumped": "#a569bd"}


def read(file):
    groups = collections.OrderedDict()
    for row in csv.DictReader(open(file)):
        groups.setdefault((row["body"], row["set"], row["element"], int(float(row["unknowns"]))), []).append(row)
    return groups


def bar(row):
    return float(row["algebraic_cents"]) + float(row["discretisation_cents"])


def error(row):
    return abs(float(row["error_cents"]))


def print_table(groups):
    print("| body | element | unknowns | modes | error, cents: median | largest | bars hold | bar / error, median |")
    print("|---|---|---|---|---|---|---|---|")
    good = total = modes = held = 0
    for (body, kind, element, unknowns), rows in groups.items():
        inside = [error(r) <= bar(r) + float(r["truth_cents"]) for r in rows]
        wide = [bar(r) / error(r) for r in rows if error(r) > 3 * float(r["truth_cents"])]
        median = statistics.median(wide) if wide else float("nan")
        total, good = total + 1, good + (sum(inside) >= 0.95 * len(inside) and not median >= 10)
        modes, held = modes + len(inside), held + sum(inside)
        name = body + (" (training)" if kind == "training" else "")
        print(
            f"| {name} | {element} | {unknowns} | {len(rows)} | {statistics.median(map(error, rows)):.3g} | {max(map(error, rows)):.3g} "
            f"| {100 * sum(inside) / len(inside):.0f} % | {median:.2g} |"
        )
    print(
        f"\n{good} of {total} meshes have at least 95 % of the modes within their bars and a median bar less than ten times the error; "
        f"of all {modes} modes {100 * held / modes:.2f} % lie within."
    )


def print_corrected(groups):
    """Corrected frequencies against those of the mesh, by element and by what a body was used for."""
    print("\n| element | bodies | meshes | modes | median error, corrected over mesh | bars, corrected over mesh | within their bars |")
    print("|---|---|--:|--:|---|--:|--:|")
    for element in COLOURS:
        for kinds, name in (({"training", "test"}, "in view"), ({"unseen"}, "unseen")):
            own = {key: rows for key, rows in groups.items() if key[2] == element and key[1] in kinds}
            if not own:
                continue
            ratios, bars, modes, held = collections.defaultdict(list), [], 0, 0
            for (body, *_), rows in own.items():
                errors = [abs(float(row["corrected_error_cents"])) for row in rows]
                wide = [float(row["corrected_bar_cents"]) for row in rows]
                ratios[body].append(statistics.median(errors) / statistics.median(map(error, rows)))
                bars.append(statistics.median(wide) / statistics.median(map(bar, rows)))
                modes += len(rows)
                held += sum(e <= b + float(row["truth_cents"]) for e, b, row in zip(errors, wide, rows))
            by_body = [statistics.median(values) for values in ratios.values()]
            print(
                f"| {element} | {name}, {len(by_body)} | {len(own)} | {modes} | {statistics.median(by_body):.2f} ({min(by_body):.2f} to"
                f" {max(by_body):.2f}) | {statistics.median(bars):.2f} | {100 * held / modes:.2f} % |"
            )


def draw(groups, file):
    low, high, size, left = -2, 4, 620, 60
    scale = size / (high - low)
    place = lambda x, y: (left + (x - low) * scale, 20 + size - (y - low) * scale)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size + 220}" height="{size + 80}" font-family="sans-serif" font-size="13">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for decade in range(low, high + 1):
        for a, b, c, d in ((decade, low, decade, high), (low, decade, high, decade)):
            (x0, y0), (x1, y1) = place(a, b), place(c, d)
            out.append(f'<line x1="{x0:.0f}" y1="{y0:.0f}" x2="{x1:.0f}" y2="{y1:.0f}" stroke="#ddd"/>')
        x, y = place(decade, low)
        out.append(f'<text x="{x:.0f}" y="{y + 20:.0f}" text-anchor="middle">{10.0 ** decade:g}</text>')
        x, y = place(low, decade)
        out.append(f'<text x="{x - 8:.0f}" y="{y + 4:.0f}" text-anchor="end">{10.0 ** decade:g}</text>')
    for shift, text in ((0, "bar = error"), (1, "ten times the error")):
        (x0, y0), (x1, y1) = place(low, low + shift), place(high - shift, high)
        out.append(
            f'<line x1="{x0:.0f}" y1="{y0:.0f}" x2="{x1:.0f}" y2="{y1:.0f}" stroke="#444" stroke-dasharray="{"4 3" if shift else "none"}"/>'
        )
        x, y = place(low + 0.35, low + shift + 0.42)
        out.append(f'<text x="{x:.0f}" y="{y:.0f}" transform="rotate(-45 {x:.0f} {y:.0f})">{text}</text>')
    points = {element: {} for element in COLOURS}
    for (_, _, element, _), rows in groups.items():
        for row in rows:
            e, b = math.log10(max(error(row), 1e-9)), math.log10(max(bar(row), 1e-9))
            if low <= e <= high and low <= b <= high:
                points[element]["M{:.1f} {:.1f}h0".format(*place(e, b))] = True
    for element, dots in points.items():  # one path an element: a tenth of the bytes of as many circles
        out.append(
            f'<path d="{"".join(dots)}" stroke="{COLOURS[element]}" stroke-width="3.2" stroke-linecap="round" stroke-opacity="0.6"/>'
        )
    for i, (element, colour) in enumerate(COLOURS.items()):
        y = 40 + 22 * i
        out.append(
            f'<circle cx="{left + size + 24}" cy="{y}" r="5" fill="{colour}"/><text x="{left + size + 36}" y="{y + 4}">{element}</text>'
        )
    out.append(f'<text x="{left + size / 2}" y="{size + 62}" text-anchor="middle">true error of a mode, cents</text>')
    out.append(
        f'<text x="16" y="{20 + size / 2}" text-anchor="middle" transform="rotate(-90 16 {20 + size / 2})">its error bar,'
        " cents</text></svg>"
    )
    open(file, "w").write("\n".join(out) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    found = read(sys.argv[1])
    print_table(found)
    print_corrected(found)
    if len(sys.argv) > 2:
        draw(found, sys.argv[2])
