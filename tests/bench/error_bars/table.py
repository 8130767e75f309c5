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


def summarise(groups):
    """One record per mesh: largest error, median of bar over error (None if no error exceeds the reference's), modes outside their bars."""
    meshes = []
    for (body, kind, element, _), rows in groups.items():
        wide = [bar(r) / error(r) for r in rows if error(r) > 3 * float(r["truth_cents"])]
        meshes.append(
            {
                "body": body + (" (training)" if kind == "training" else ""),
                "element": element,
                "modes": len(rows),
                "largest": max(map(error, rows)),
                "width": statistics.median(wide) if wide else None,
                "outside": sum(error(r) > bar(r) + float(r["truth_cents"]) for r in rows),
            }
        )
    return meshes


def print_table(meshes):
    """A row per body, a cell per element, the meshes of a cell from coarse to fine; then all bodies together."""
    bodies = collections.OrderedDict()
    for mesh in meshes:
        bodies.setdefault(mesh["body"], []).append(mesh)
    print("| body | modes | " + " | ".join(COLOURS) + " |\n" + "|---" * (len(COLOURS) + 2) + "|")
    for body, own in bodies.items():
        modes = sorted({mesh["modes"] for mesh in own})
        cells = [body, " to ".join(map(str, [modes[0], modes[-1]] if len(modes) > 1 else modes))]
        for element in COLOURS:
            of_element = [mesh for mesh in own if mesh["element"] == element]
            widths = ", ".join("-" if mesh["width"] is None else f"{mesh['width']:.2g}" for mesh in of_element)
            outside = sum(mesh["outside"] for mesh in of_element)
            text = (
                ", ".join(f"{float(format(mesh['largest'], '.3g')):g}" for mesh in of_element)
                + f" ({widths})"
                + (f"; {outside} outside" if outside else "")
            )
            cells.append(text if of_element else "")
        print("| " + " | ".join(cells) + " |")
    print(
        "\n<!-- summary -->\n| element | meshes | modes | modes outside their bars | bar / error: median of a mesh |\n|---|--:|--:|--:|--:|"
    )
    for element in ("T10", "T10 curved", "T10 lumped", "T4", "T4 lumped"):
        own = [mesh for mesh in meshes if mesh["element"] == element]
        widths = [mesh["width"] for mesh in own if mesh["width"] is not None]
        modes, outside = (sum(mesh[key] for mesh in own) for key in ("modes", "outside"))
        spread = f"{statistics.median(widths):.2g} ({min(widths):.2g} to {max(widths):.2g})"
        print(f"| {element} | {len(own)} | {modes} | {outside} | {spread} |")
    good = sum(mesh["outside"] <= 0.05 * mesh["modes"] and (mesh["width"] or 0) < 10 for mesh in meshes)
    modes, outside = (sum(mesh[key] for mesh in meshes) for key in ("modes", "outside"))
    print(
        f"<!-- /summary -->\n\n{good} of {len(meshes)} meshes have at least 95 % of the modes within their bars and a median bar below ten"
        f" times the error; of all {modes} modes {100 * (1 - outside / modes):.2f} % lie within."
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


def calc_excess(row):
    return float(row["interpolation"]) + 4 * float(row["bent"])


def read_mesh(rows):
    """Of the k-th corrected frequency: lambda corrected and of the mesh; the mode's own bar, row, verdict; the error beyond the truth's."""
    found = []
    for row in rows:
        if int(row["corrected_mode"]) >= len(rows):
            break
        mode = rows[int(row["corrected_mode"])]
        excess = min(calc_excess(mode), 0.99)
        geometry = 1.5 * abs(float(mode["geometry"])) + 0.15 * float(mode["geometry_magnitude"])
        own = 600 * math.log2(1 + 3.5 * excess / (1 - excess) + geometry)
        beyond = abs(float(row["corrected_error_cents"])) - float(row["truth_cents"])
        found.append((float(row["corrected_hz"]) ** 2, float(mode["freq_hz"]) ** 2, own, mode, row["trust"], beyond))
    return found


def print_pairs(groups):
    """Bars of T10 where two meshes agree: the rule of correct.cpp, k-th against k-th, on each body's two meshes."""
    meshes = collections.defaultdict(list)
    for (body, _, element, unknowns), rows in sorted(groups.items(), key=lambda item: item[0][3]):
        if element in ("T10", "T10 curved"):
            meshes[body, element].append(read_mesh(rows))
    counts = {name: [0, 0] for name in ("straight", "curved", "curved, unseen parts", "rough at rims")}
    is_seen = lambda mode: 4 * float(mode["bent"]) <= 0.05 * calc_excess(mode) and abs(float(mode["geometry"])) <= 0.25 * calc_excess(mode)
    for (_, element), (coarse, fine, *_) in meshes.items():
        for (before, mesh_before, _, mode_before, trust_before, _), (now, mesh, own, mode, trust, beyond) in zip(coarse, fine):
            by, by_before = mesh - now, mesh_before - before
            is_rim = trust == "2" and calc_excess(mode) <= 0.3
            if not (trust == "0" or is_rim) or trust_before not in "02" or abs(by_before) < 1.5 * abs(by) or by == by_before:
                continue
            apart = abs(before - now) / abs(by_before - by)
            are_seen = not is_rim and is_seen(mode) and is_seen(mode_before)
            name = "rough at rims" if is_rim else "straight" if element == "T10" else "curved" if are_seen else "curved, unseen parts"
            if apart <= 1:
                counts[name][0] += 1
                counts[name][1] += beyond <= (0.125 if are_seen else 0.25) * max(1, 2 * apart) * own
    print("\nTwo meshes, modes within their bars: " + "; ".join(f"{name} {held} of {all}" for name, (all, held) in counts.items()))


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
    print_table(summarise(found))
    print_corrected(found)
    print_pairs(found)
    if len(sys.argv) > 2:
        draw(found, sys.argv[2])
