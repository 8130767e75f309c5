"""SVG charts: lines on logarithmic axes, stacked bars."""
import math

import measuring

PALETTE = {
    "read": "#9aa5b1",
    "partition": "#c9b458",
    "assemble": "#8fb98b",
    "factor": "#c8553d",
    "solve": "#2f6690",
    "orthogonalise": "#7b5ea7",
    "errors": "#e09f3e",
    "error bars": "#e09f3e",
    "air": "#5fa8d3",
    "coupling": "#b56576",
    "write": "#588157",
    "other": "#bdbdbd",
    "in all": "#1a1a1a",
}


def start(width, height, title, subtitle=""):
    return [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
            ' font-family="sans-serif" font-size="13">'
        ),
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="16" y="26" font-size="16" font-weight="bold">{measuring.escape(title)}</text>',
        f'<text x="16" y="46" fill="#555">{measuring.escape(subtitle)}</text>',
    ]


def describe_number(value):
    if value >= 1e9:
        return f"{value / 1e9:g}G"
    if value >= 1e6:
        return f"{value / 1e6:g}M"
    if value >= 1e3:
        return f"{value:,.0f}"
    return f"{value:g}"


def find_ticks(low, high):
    """1, 2 and 5 times powers of ten for up to two decades, else powers of ten."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    factors = (1, 2, 5) if last - first <= 2 else (1,)
    return [
        tick
        for tick in (factor * 10.0**power for power in range(first, last + 1) for factor in factors)
        if low * 0.999 <= tick <= high * 1.001
    ]


class Axes:
    """A frame and its coordinate transform. Ranges are (low, high); axes are logarithmic by default."""

    def __init__(self, left, top, width, height, x_range, y_range, x_log=True, y_log=True, margin=0):
        self.left, self.top, self.width, self.height, self.margin = left, top, width, height, margin
        self.x_range, self.y_range, self.x_log, self.y_log = x_range, y_range, x_log, y_log

    @staticmethod
    def find_share(value, ends, is_log):
        low, high = ends
        if is_log:
            return math.log(value / low) / (math.log(high / low) or 1.0)
        return (value - low) / ((high - low) or 1.0)

    def place_x(self, x):
        return self.left + self.margin + (self.width - 2 * self.margin) * self.find_share(x, self.x_range, self.x_log)

    def place_y(self, y):
        return self.top + self.height * (1 - self.find_share(y, self.y_range, self.y_log))

    def draw_frame(self, x_label, y_label, x_ticks, y_ticks, marks=()):
        """Grid, ticks and labels. marks: x ticks with a star."""
        out = []
        for tick in y_ticks:
            y = self.place_y(tick)
            out.append(
                f'<line x1="{self.left}" x2="{self.left + self.width}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e3e3e3"/>'
                f'<text x="{self.left - 8}" y="{y + 4:.1f}" text-anchor="end">{describe_number(tick)}</text>'
            )
        for tick in x_ticks:
            x = self.place_x(tick)
            out.append(
                f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{self.top}" y2="{self.top + self.height}" stroke="#eeeeee"/><text x="{x:.1f}"'
                f' y="{self.top + self.height + 20}" text-anchor="middle">{describe_number(tick)}{"*" if tick in marks else ""}</text>'
            )
        out.append(f'<rect x="{self.left}" y="{self.top}" width="{self.width}" height="{self.height}" fill="none" stroke="#999"/>')
        out.append(
            f'<text x="{self.left + self.width / 2}" y="{self.top + self.height + 44}"'
            f' text-anchor="middle">{measuring.escape(x_label)}</text>'
        )
        middle, side = self.top + self.height / 2, self.left - 64
        out.append(
            f'<text x="{side}" y="{middle}" text-anchor="middle" transform="rotate(-90 {side} {middle})">{measuring.escape(y_label)}</text>'
        )
        return out

    def draw_curve(self, points, colour, width=2.0, is_dashed=False):
        path = " ".join(f"{self.place_x(x):.1f},{self.place_y(y):.1f}" for x, y in points)
        dashes = ' stroke-dasharray="6 5"' if is_dashed else ""
        return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashes}/>'

    def draw_point(self, x, y, colour, text, fill=None, radius=4):
        return (
            f'<circle cx="{self.place_x(x):.1f}" cy="{self.place_y(y):.1f}" r="{radius:g}" fill="{fill or colour}" stroke="{colour}"'
            f' stroke-width="2"><title>{measuring.escape(text)}</title></circle>'
        )


def draw_lines(curves, title, subtitle, x_label, y_label, x_ticks, marks=(), dashed=()):
    """curves: {name: [(x, y)]}, logarithmic axes. marks: x of hollow points. dashed: names of guides."""
    left, top, width, height = 84, 70, 520, 380
    curves = {name: [(x, y) for x, y in points if y > 0] for name, points in curves.items()}
    curves = {name: points for name, points in curves.items() if points}
    values = [y for points in curves.values() for _, y in points]
    low, high = min(values) / 1.3, max(values) * 1.3
    axes = Axes(left, top, width, height, (min(x_ticks), max(x_ticks)), (low, high), margin=24)
    out = start(left + width + 170, top + height + 66, title, subtitle)
    out += axes.draw_frame(x_label, y_label, x_ticks, find_ticks(low, high), marks)
    labels = []
    for name, points in curves.items():
        colour = PALETTE.get(name, "#888888")
        out.append(axes.draw_curve(points, colour, 1.5 if name in dashed else 3.2 if name == "in all" else 2, name in dashed))
        for x, y in points if name not in dashed else []:
            out.append(axes.draw_point(x, y, colour, f"{name}: {y:.3g}", "white" if x in marks else None))
        labels.append([axes.place_y(points[-1][1]), name, colour])
    labels.sort()
    for before, label in zip(labels, labels[1:]):
        label[0] = max(label[0], before[0] + 16)
    excess = labels[-1][0] - (top + height + 6) if labels else 0
    if excess > 0:  # shift the lowest labels up
        limit = top + height + 6
        for label in reversed(labels):
            label[0] = min(label[0], limit)
            limit = label[0] - 16
    bold = ' font-weight="bold"'
    for place, name, colour in labels:
        out.append(
            f'<text x="{left + width + 12}" y="{place + 4:.1f}"'
            f' fill="{colour}"{bold if name == "in all" else ""}>{measuring.escape(name)}</text>'
        )
    return "\n".join(out) + "\n</svg>\n"


def draw_bars(bars, title, subtitle, unit="s"):
    """bars: [(label, [(name, value, MPI value)])]: parts in the colours of their names, the part inside MPI paler."""
    width, height, top = 560, 26, 104
    left = max(190, 40 + round(7.2 * max(len(label) for label, _ in bars)))
    longest = max(sum(a + b for _, a, b in parts) for _, parts in bars) or 1.0
    names = [
        name for name in PALETTE if any(part[0] == name and part[1] + part[2] > 0.002 * longest for _, parts in bars for part in parts)
    ]
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
                    out.append(
                        f'<rect x="{x:.2f}" y="{y}" width="{length:.2f}" height="{height}" fill="{PALETTE[name]}"'
                        f' fill-opacity="{opacity}"><title>{name}{what}: {value:.3g} {unit}</title></rect>'
                    )
                x += max(length, 0)
        out.append(f'<text x="{x + 8:.1f}" y="{y + 18}">{sum(a + b for _, a, b in parts):.3g} {unit}</text>')
    return "\n".join(out) + "\n</svg>\n"
