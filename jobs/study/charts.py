"""Charts as SVG text: lines on logarithmic axes, and bars in parts."""
import math

import measuring

PALETTE = {"read": "#9aa5b1", "partition": "#c9b458", "assemble": "#8fb98b", "factor": "#c8553d", "solve": "#2f6690", "orthogonalise": "#7b5ea7", "errors": "#e09f3e",
           "error bars": "#e09f3e", "write": "#588157", "other": "#bdbdbd", "in all": "#1a1a1a"}
HATCH = "#f4f4f4"


def start(width, height, title, subtitle=""):
    return [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">',
            '<rect width="100%" height="100%" fill="white"/>',
            f'<text x="16" y="26" font-size="16" font-weight="bold">{measuring.escape(title)}</text>',
            f'<text x="16" y="46" fill="#555">{measuring.escape(subtitle)}</text>']


def describe_number(value):
    if value >= 1e9:
        return f"{value / 1e9:g}G"
    if value >= 1e6:
        return f"{value / 1e6:g}M"
    if value >= 1e3:
        return f"{value:,.0f}"
    return f"{value:g}"


def find_ticks(low, high):
    """1, 2 and 5 times powers of ten where there is room, else the powers alone."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    factors = (1, 2, 5) if last - first <= 2 else (1,)
    return [tick for tick in (factor * 10.0**power for power in range(first, last + 1) for factor in factors) if low * 0.999 <= tick <= high * 1.001]


def draw_lines(curves, title, subtitle, x_label, y_label, x_ticks, marks=(), dashed=()):
    """curves: {name: [(x, y)]}, logarithmic axes. marks: x whose points are hollow. dashed: names of guides."""
    left, top, width, height = 84, 70, 520, 380
    curves = {name: [(x, y) for x, y in points if y > 0] for name, points in curves.items()}
    curves = {name: points for name, points in curves.items() if points}
    values = [y for points in curves.values() for _, y in points]
    low, high = min(values) / 1.3, max(values) * 1.3
    x_low, x_high = min(x_ticks), max(x_ticks)
    span = math.log(x_high / x_low) or 1.0
    place_x = lambda x: left + 24 + (width - 48) * math.log(x / x_low) / span
    place_y = lambda y: top + height * math.log(high / y) / math.log(high / low)
    out = start(left + width + 170, top + height + 66, title, subtitle)
    for tick in find_ticks(low, high):
        y = place_y(tick)
        out.append(f'<line x1="{left}" x2="{left + width}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e3e3e3"/><text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{describe_number(tick)}</text>')
    for tick in x_ticks:
        x = place_x(tick)
        out.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{top + height}" stroke="#eeeeee"/>'
                   f'<text x="{x:.1f}" y="{top + height + 20}" text-anchor="middle">{describe_number(tick)}{"*" if tick in marks else ""}</text>')
    out.append(f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#999"/>')
    out.append(f'<text x="{left + width / 2}" y="{top + height + 44}" text-anchor="middle">{measuring.escape(x_label)}</text>')
    out.append(f'<text x="20" y="{top + height / 2}" text-anchor="middle" transform="rotate(-90 20 {top + height / 2})">{measuring.escape(y_label)}</text>')
    labels = []
    for name, points in curves.items():
        colour = PALETTE.get(name, "#888888")
        path = " ".join(f"{place_x(x):.1f},{place_y(y):.1f}" for x, y in points)
        style = ' stroke-dasharray="6 5" stroke-width="1.5"' if name in dashed else f' stroke-width="{3.2 if name == "in all" else 2}"'
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}"{style}/>')
        for x, y in points if name not in dashed else []:
            fill = "white" if x in marks else colour
            out.append(f'<circle cx="{place_x(x):.1f}" cy="{place_y(y):.1f}" r="4" fill="{fill}" stroke="{colour}" stroke-width="2"><title>{measuring.escape(name)}: {y:.3g}</title></circle>')
        labels.append([place_y(points[-1][1]), name, colour])
    labels.sort()
    for before, label in zip(labels, labels[1:]):
        label[0] = max(label[0], before[0] + 16)
    excess = labels[-1][0] - (top + height + 6) if labels else 0
    if excess > 0:  # the lowest ones move up again
        limit = top + height + 6
        for label in reversed(labels):
            label[0] = min(label[0], limit)
            limit = label[0] - 16
    bold = ' font-weight="bold"'
    for place, name, colour in labels:
        out.append(f'<text x="{left + width + 12}" y="{place + 4:.1f}" fill="{colour}"{bold if name == "in all" else ""}>{measuring.escape(name)}</text>')
    return "\n".join(out) + "\n</svg>\n"


def draw_bars(bars, title, subtitle, unit="s"):
    """bars: [(label, [(name, value, paler value)])]: parts in the colours of their names; the pale end of each is what was spent inside MPI (0: not asked)."""
    width, height, top = 560, 26, 104
    left = max(190, 40 + round(7.2 * max(len(label) for label, _ in bars)))
    longest = max(sum(a + b for _, a, b in parts) for _, parts in bars) or 1.0
    names = [name for name in PALETTE if any(part[0] == name and part[1] + part[2] > 0.002 * longest for _, parts in bars for part in parts)]
    full = top + len(bars) * (height + 12) + 20
    out = start(left + width + 90, full, title, subtitle)
    x = 16.0
    for name in names:
        out.append(f'<rect x="{x:.0f}" y="66" width="13" height="13" fill="{PALETTE[name]}"/><text x="{x + 18:.0f}" y="77">{name}</text>')
        x += 34 + 7.2 * len(name)
    for index, (label, parts) in enumerate(bars):
        y = top + index * (height + 12)
        out.append(f'<text x="{left - 10}" y="{y + 18}" text-anchor="end">{measuring.escape(label)}</text>')
        x = float(left)
        for name, computing, inside in parts:
            for value, opacity, what in ((computing, 1.0, ", computing" if inside else ""), (inside, 0.35, ", inside MPI")):
                length = value / longest * width
                if length > 0.05:
                    out.append(f'<rect x="{x:.2f}" y="{y}" width="{length:.2f}" height="{height}" fill="{PALETTE[name]}" fill-opacity="{opacity}"><title>{name}{what}: {value:.3g} {unit}</title></rect>')
                x += max(length, 0)
        out.append(f'<text x="{x + 8:.1f}" y="{y + 18}">{sum(a + b for _, a, b in parts):.3g} {unit}</text>')
    return "\n".join(out) + "\n</svg>\n"
