"""Drawing of a body and what is cut from it, SVG at full scale: contours of depth seen from the cut side, and a section; mm."""
import numpy

from measuring import escape

MARGIN, TEXT = 12.0, 3.5  # mm
STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # mm between contours
MAX_CONTOURS = 10
COLOURS = ("#7fb2e5", "#4f8fd0", "#2c6cb3", "#1a4e8c", "#0b2f5c")


def find_lines(points, triangles, values, level):
    """(n, 2, 3) segments in triangles where the linear values (N) equal a level."""
    value = values[triangles] - level
    value = numpy.where(value == 0, 1e-30, value)
    segments = []
    for lone in range(3):
        a, b, c = lone, (lone + 1) % 3, (lone + 2) % 3
        here = (numpy.sign(value[:, a]) != numpy.sign(value[:, b])) & (numpy.sign(value[:, a]) != numpy.sign(value[:, c]))
        ends = []
        for other in (b, c):
            share = (value[here, a] / (value[here, a] - value[here, other]))[:, None]
            ends.append(points[triangles[here, a]] * (1 - share) + points[triangles[here, other]] * share)
        segments.append(numpy.stack(ends, axis=1))
    return numpy.concatenate(segments)


def draw(path, before_m, after_m, title, table):
    """before_m, after_m: (positions (N, 3), triangles) of the surface; contours where the triangles are the same. table: lines below."""
    (before, triangles), (after, after_triangles) = ((1e3 * points, t) for points, t in (before_m, after_m))
    depth = numpy.linalg.norm(after - before, axis=1) if triangles is after_triangles else numpy.zeros(len(before))
    along, across, up = numpy.argsort(-numpy.ptp(before, axis=0), kind="stable")
    most = depth.max()
    step = next((s for s in STEPS if most / s <= MAX_CONTOURS), STEPS[-1])
    low, high = before.min(axis=0), before.max(axis=0)
    width, height, thick = (high - low)[[along, across, up]]
    out, top = [], MARGIN + 2 * TEXT

    def add_lines(segments, x, y, x0, y0, style):
        x1, y1 = MARGIN + segments[:, :, x] - x0, y0 - segments[:, :, y]
        body = "".join(f"M{a:.3f} {b:.3f}L{c:.3f} {d:.3f}" for (a, c), (b, d) in zip(x1, y1))
        out.append(f'<path d="{body}" fill="none" {style}/>')

    def add_text(x, y, text, size=TEXT, font="sans-serif"):
        out.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size}" font-family="{font}" xml:space="preserve">{escape(text)}</text>')

    add_text(MARGIN, MARGIN, title, 1.3 * TEXT)
    corners = before[triangles]
    normal = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= numpy.maximum(numpy.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    cut = depth[triangles].max(axis=1) > 1e-4
    side = numpy.sign(normal[cut, up].sum()) or 1.0  # 1 where nothing or both sides are cut
    facing = normal[:, up] * side > 0.05
    # As seen from that side, with `along` to the right: `across` points up or down.
    plan = before.copy()
    if side * numpy.linalg.det(numpy.eye(3)[[along, across, up]]) < 0:
        plan[:, across] = low[across] + high[across] - plan[:, across]
    edges = {}
    for t in triangles[facing].tolist():
        for a, b in zip(t, t[1:] + t[:1]):
            edges[frozenset((a, b))] = None if frozenset((a, b)) in edges else (a, b)
    rim = plan[numpy.array([edge for edge in edges.values() if edge], int).reshape(-1, 2)]
    add_lines(rim, along, across, low[along], top + high[across], 'stroke="#000" stroke-width="0.35"')
    levels = numpy.arange(1, int(most / step + 1e-9) + 1) * step
    for number, level in enumerate(levels):
        lines = find_lines(plan, triangles[facing & cut], depth, level)
        colour = COLOURS[min(len(COLOURS) - 1, number * len(COLOURS) // max(len(levels), 1))]
        add_lines(lines, along, across, low[along], top + high[across], f'stroke="{colour}" stroke-width="0.25"')
        if len(lines):
            far = lines.reshape(-1, 3)[numpy.lexsort((lines[:, :, across].ravel(), lines[:, :, along].ravel().round(3)))[-1]]
            add_text(MARGIN + far[along] - low[along] + 0.3, top + high[across] - far[across] + TEXT, f"{level:g}", 0.7 * TEXT)
    y = top + height + 2 * TEXT
    contours = f", seen from the cut side, depth in mm, contours every {step:g} mm, deepest {most:.3f} mm" if most > 0 else ""
    add_text(MARGIN, y, f"{width:.1f} x {height:.1f} mm{contours}")
    # Through the deepest place, that nearest to the middle, and between the vertices.
    middle = (low + high)[across] / 2
    deepest = before[depth >= most - 1e-6]
    place = deepest[numpy.abs(deepest[:, across] - middle).argmin(), across] + 1e-3
    y += 2 * TEXT
    dashed, solid = 'stroke="#999" stroke-width="0.2" stroke-dasharray="1 1"', 'stroke="#000" stroke-width="0.35"'
    for points, of, style in ((before, triangles, dashed), (after, after_triangles, solid)):
        add_lines(find_lines(points, of, points[:, across], place), along, up, low[along], y + high[up], style)
    y += thick + 2 * TEXT
    add_text(MARGIN, y, f"section {place - low[across]:.1f} mm from the edge: {thick:.2f} mm high; dashed: before")
    for line in table:
        y += 1.5 * TEXT
        add_text(MARGIN, y, line, font="monospace")
    wide, tall = max(width, 190) + 2 * MARGIN, y + MARGIN
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.1f}mm" height="{tall:.1f}mm" viewBox="0 0 {wide:.1f} {tall:.1f}">'
        '<rect width="100%" height="100%" fill="#fff"/>' + "\n".join(out) + "</svg>\n"
    )
