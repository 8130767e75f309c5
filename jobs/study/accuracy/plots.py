"""Charts of a study of accuracy: panels of curves side by side, Pareto fronts, guides of theoretical slopes."""
import dataclasses
import math

import charts
import measuring

COLOURS = {"T4 consistent": "#c0392b", "T4 lumped": "#e59866", "T10 straight": "#2471a3", "T10 curved": "#17a589", "T10": "#2471a3"}
CYCLE = ("#2f6690", "#c8553d", "#588157", "#e09f3e", "#7b5ea7", "#17a589", "#9aa5b1", "#1a1a1a")
FRONT = "#333333"
WIDTH, HEIGHT, LEFT, TOP, GAP, FOOT = 360, 280, 84, 118, 100, 66


@dataclasses.dataclass
class Panel:
    """curves: {name: [(x, y)]}; guides: {text: [(x, y)]}, dashed and grey; front: [(x, y)], drawn below the curves as a broad band;
    levels: [(y, text)], horizontal lines. Values that a logarithmic axis cannot show are left out."""

    title: str
    x_label: str
    y_label: str
    curves: dict
    guides: dict = dataclasses.field(default_factory=dict)
    front: list = dataclasses.field(default_factory=list)
    levels: list = dataclasses.field(default_factory=list)
    x_log: bool = True
    y_log: bool = True


def find_front(points):
    """The Pareto front of [(cost, error, ...)]: those that nothing cheaper beats, by cost."""
    front = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


def find_colours(names):
    free = iter(CYCLE * (1 + len(names) // len(CYCLE)))
    return {name: COLOURS.get(name) or next(free) for name in names}


def find_range(values, is_log):
    low, high = min(values), max(values)
    if is_log:
        return (low / 1.4, high * 1.4)
    room = 0.06 * ((high - low) or abs(high) or 1.0)
    return (low - room if low else 0.0, high + room)


def find_linear_ticks(low, high):
    step = 10.0 ** math.floor(math.log10((high - low) / 2))
    step *= next(factor for factor in (1, 2, 5, 10) if (high - low) / (factor * step) <= 7)
    return [round(index * step, 12) for index in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def find_ticks(ends, is_log):
    return charts.find_ticks(*ends) if is_log else find_linear_ticks(*ends)


def keep(points, panel):
    return [
        (x, y) for x, y in points if math.isfinite(x) and math.isfinite(y) and (x > 0 or not panel.x_log) and (y > 0 or not panel.y_log)
    ]


def draw_panel(panel, left, top, colours):
    curves = {name: keep(points, panel) for name, points in panel.curves.items()}
    points = [point for curve in curves.values() for point in curve]
    out = [f'<text x="{left}" y="{top - 10}" font-weight="bold">{measuring.escape(panel.title)}</text>']
    if not points:
        return out + [f'<text x="{left}" y="{top + 40}">nothing was measured</text>']
    x_range, y_range = find_range([x for x, _ in points], panel.x_log), find_range([y for _, y in points], panel.y_log)
    axes = charts.Axes(left, top, WIDTH, HEIGHT, x_range, y_range, panel.x_log, panel.y_log)
    out += axes.draw_frame(panel.x_label, panel.y_label, find_ticks(x_range, panel.x_log), find_ticks(y_range, panel.y_log))
    inside = lambda x, y: x_range[0] <= x <= x_range[1] and y_range[0] <= y <= y_range[1]
    for level, text in panel.levels:
        if y_range[0] < level < y_range[1]:
            y = axes.place_y(level)
            out.append(
                f'<line x1="{left}" x2="{left + WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#8a8a8a" stroke-dasharray="2 4"/>'
                f'<text x="{left + WIDTH - 4}" y="{y - 4:.1f}" text-anchor="end" fill="#666" font-size="11">{measuring.escape(text)}</text>'
            )
    clip = f"clip{left}-{top}"
    out.append(
        f'<clipPath id="{clip}"><rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}"/></clipPath><g clip-path="url(#{clip})">'
    )
    front = keep(panel.front, panel)
    if len(front) > 1:
        steps = [front[0]] + [step for before, after in zip(front, front[1:]) for step in ((after[0], before[1]), after)]
        out.append(f'<g opacity="0.18">{axes.draw_curve(steps, FRONT, 9)}</g>')
    for text, guide in panel.guides.items():
        guide = keep(guide, panel)
        if len(guide) > 1:
            out.append(axes.draw_curve(guide, "#888888", 1.3, True))
            x, y = guide[-1] if inside(*guide[-1]) else guide[0]
            side, shift = ("end", -4) if axes.place_x(x) > left + WIDTH / 2 else ("start", 8)
            out.append(
                f'<text x="{axes.place_x(x) + shift:.1f}" y="{axes.place_y(y) - 6:.1f}" text-anchor="{side}" fill="#666"'
                f' font-size="11">{measuring.escape(text)}</text>'
            )
    for name, curve in curves.items():
        out.append(axes.draw_curve(curve, colours[name]))
        out += [axes.draw_point(x, y, colours[name], f"{name}: {x:.4g}, {y:.3g}", radius=3.2) for x, y in curve]
    return out + ["</g>"]


def draw_panels(panels, title, subtitle, columns=2):
    """Panels side by side as one SVG, with one legend for all; a curve has one colour everywhere."""
    names = list(dict.fromkeys(name for panel in panels for name in panel.curves))
    colours = find_colours(names)
    columns = min(columns, len(panels))
    lines = -(-len(panels) // columns)
    width = columns * (LEFT + WIDTH) + 40
    entries = [(name, colours[name]) for name in names] + ([("Pareto front", "#cfcfcf")] if any(panel.front for panel in panels) else [])
    out = charts.start(
        max(width, 40 + 9 * len(subtitle), 20 + round(sum(40 + 7.4 * len(name) for name, _ in entries))),
        TOP + lines * (HEIGHT + GAP) - GAP + FOOT,
        title,
        subtitle,
    )
    x = 16.0
    for name, colour in entries:
        out.append(
            f'<rect x="{x:.0f}" y="62" width="13" height="13" fill="{colour}"/><text x="{x + 18:.0f}"'
            f' y="73">{measuring.escape(name)}</text>'
        )
        x += 40 + 7.4 * len(name)
    for index, panel in enumerate(panels):
        out += draw_panel(panel, LEFT + (index % columns) * (LEFT + WIDTH), TOP + (index // columns) * (HEIGHT + GAP), colours)
    return "\n".join(out) + "\n</svg>\n"


def draw_slope(points, power, reach=1.0):
    """A guide through the finest point of a curve: y = y_last (x / x_last)^power over the curve's x, `reach` times as high."""
    points = [(x, y) for x, y in points if x > 0 and y > 0]
    if len(points) < 2:
        return []
    last_x, last_y = min(points, key=lambda point: point[1])
    return [(x, reach * last_y * (x / last_x) ** power) for x in sorted({x for x, _ in points})]
