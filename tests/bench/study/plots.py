"""Charts of the accuracy study (matplotlib, SVG): panels of curves side by side, Pareto fronts, guides of theoretical slopes."""
import dataclasses
import io
import math

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.ticker import FuncFormatter

COLOURS = {"T4 consistent": "#c0392b", "T4 lumped": "#e59866", "T10 straight": "#2471a3", "T10 curved": "#17a589", "T10": "#2471a3"}
CYCLE = ("#2f6690", "#c8553d", "#588157", "#e09f3e", "#7b5ea7", "#17a589", "#9aa5b1", "#1a1a1a")


@dataclasses.dataclass
class Panel:
    """curves: {name: [(x, y)]}; guides: {text: [(x, y)]}, dashed and grey; front: [(x, y)], a broad band below the curves;
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
    """The Pareto front of [(cost, error, ...)], by cost."""
    front = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


def find_colours(names):
    free = iter(CYCLE * (1 + len(names) // len(CYCLE)))
    return {name: COLOURS.get(name) or next(free) for name in names}


def keep(points, panel):
    """(x values, y values) of the points that the axes can show."""
    points = [
        (x, y) for x, y in points if math.isfinite(x) and math.isfinite(y) and (x > 0 or not panel.x_log) and (y > 0 or not panel.y_log)
    ]
    return tuple(zip(*points)) if points else ((), ())


def draw_panel(axes, panel, colours):
    axes.set(title=panel.title, xlabel=panel.x_label, ylabel=panel.y_label)
    axes.grid(color="#e3e3e3")
    if not any(keep(points, panel)[0] for points in panel.curves.values()):
        axes.text(0.5, 0.5, "nothing was measured", ha="center", transform=axes.transAxes)
        return
    for name, points in panel.curves.items():
        axes.plot(*keep(points, panel), "o-", color=colours[name], markersize=4, zorder=3)
    axes.set(xscale="log" if panel.x_log else "linear", yscale="log" if panel.y_log else "linear")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    x_range, y_range = axes.get_xlim(), axes.get_ylim()
    axes.step(*keep(panel.front, panel), where="post", color="#333333", alpha=0.18, linewidth=8)
    for text, guide in panel.guides.items():
        x, y = keep(guide, panel)
        axes.plot(x, y, "--", color="#888888", linewidth=1.2)
        if x:
            axes.annotate(text, (x[-1], y[-1]), color="#666666", fontsize=8, annotation_clip=True)
    for level, text in panel.levels:
        if y_range[0] < level < y_range[1]:
            axes.axhline(level, color="#8a8a8a", linestyle=":")
            axes.text(x_range[1], level, text, ha="right", va="bottom", color="#666666", fontsize=8)
    axes.set(xlim=x_range, ylim=y_range)


def draw_panels(panels, title, subtitle, columns=2):
    """Panels side by side as one SVG with one legend; a curve has the same colour in all panels."""
    names = list(dict.fromkeys(name for panel in panels for name in panel.curves))
    colours = find_colours(names)
    columns = min(columns, len(panels))
    lines = -(-len(panels) // columns)
    # Text stays text; ids differ between charts of one page.
    with pyplot.rc_context({"svg.fonttype": "none", "svg.hashsalt": title, "font.size": 9, "axes.titlesize": 10}):
        figure, axes = pyplot.subplots(lines, columns, figsize=(4.8 * columns, 4.0 * lines + 0.9), squeeze=False, layout="constrained")
        for place in axes.flat[len(panels) :]:
            place.set_axis_off()
        for place, panel in zip(axes.flat, panels):
            draw_panel(place, panel, colours)
        figure.suptitle(f"{title}\n{subtitle}", fontsize=11)
        handles = [pyplot.Line2D([], [], color=colours[name], marker="o") for name in names]
        if any(panel.front for panel in panels):
            handles.append(pyplot.Line2D([], [], color="#cfcfcf", linewidth=8))
            names.append("Pareto front")
        per_row = min(len(names), 3 * columns)
        legend_height = 0.3 * -(-len(names) // per_row) / figure.get_figheight()
        figure.get_layout_engine().set(rect=(0, legend_height, 1, 1 - legend_height))  # loc="outside ..." needs matplotlib 3.7
        figure.legend(handles, names, loc="lower center", ncols=per_row)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None})
        pyplot.close(figure)
    return stream.getvalue()[stream.getvalue().index("<svg") :]


def draw_slope(points, power, reach=1.0):
    """A guide through the finest point of a curve: y = reach y_last (x / x_last)^power over the curve's x."""
    points = [(x, y) for x, y in points if x > 0 and y > 0]
    if len(points) < 2:
        return []
    last_x, last_y = min(points, key=lambda point: point[1])
    return [(x, reach * last_y * (x / last_x) ** power) for x in sorted({x for x, _ in points})]
