"""Drawing of a body and what is cut from it, SVG at full scale: contours of depth on each side that is cut, and a section; mm."""
import numpy

from measuring import escape

MARGIN, TEXT = 12.0, 3.5  # mm
STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # mm between contours
MAX_CONTOURS = 10
COLOURS = ("#7fb2e5", "#4f8fd0", "#2c6cb3", "#1a4e8c", "#0b2f5c")
DASHED, SOLID = 'stroke="#999" stroke-width="0.2" stroke-dasharray="1 1"', 'stroke="#000" stroke-width="0.35"'


def find_lines(points, triangles, values, level):
    """(n, 2, d) segments in triangles of points (N, d) where the linear values (N) equal a level."""
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


def find_views(normal, cut, up):
    """(axis, sign) of the sides that show the cuts, most cut first; of a body without cuts the top. Sides with below 2 % are left out.

    normal: (T, 3) area vectors of the triangles; cut: those that are cut; up: the shortest axis, the side of what is cut equally."""
    main = numpy.abs(normal).argmax(axis=1)
    areas = {}
    for axis in (up, *(other for other in range(3) if other != up)):
        for sign in (1.0, -1.0):
            here = cut & (main == axis) & (normal[:, axis] * sign > 0)
            areas[axis, sign] = numpy.abs(normal[here, axis]).sum()
    least = 0.02 * sum(areas.values())
    return sorted((view for view in areas if areas[view] > least), key=lambda view: -areas[view]) or [(up, 1.0)]


class Sheet:
    """Lines and texts of an SVG, from the top down; mm."""

    def __init__(self):
        self.out, self.y, self.wide = [], MARGIN, 190.0

    def add_text(self, text, x=MARGIN, y=None, size=TEXT, font="sans-serif"):
        y = self.y if y is None else y
        self.out.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size}" font-family="{font}" xml:space="preserve">{escape(text)}</text>')

    def add_lines(self, segments, style):
        """segments: (n, 2, 2) on paper, x from the left margin, y up from the present height."""
        x, y = MARGIN + segments[:, :, 0], self.y - segments[:, :, 1]
        body = "".join(f"M{a:.3f} {b:.3f}L{c:.3f} {d:.3f}" for (a, c), (b, d) in zip(x, y))
        self.out.append(f'<path d="{body}" fill="none" {style}/>')

    def write(self, path):
        wide, tall = self.wide + 2 * MARGIN, self.y + MARGIN
        path.write_text(
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide:.1f}mm" height="{tall:.1f}mm" viewBox="0 0 {wide:.1f} {tall:.1f}">'
            '<rect width="100%" height="100%" fill="#fff"/>' + "\n".join(self.out) + "</svg>\n"
        )


def draw_view(sheet, view, points, triangles, normal, depth, cut, step):
    """The outline as seen from one side, and contours of depth on what faces it."""
    axis, sign = view
    x, y = sorted((other for other in range(3) if other != axis), key=lambda other: -numpy.ptp(points[:, other]))
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = (high - low)[[x, y]]
    # With x to the right, y points up or down.
    flip = sign * numpy.linalg.det(numpy.eye(3)[[x, y, axis]]) < 0
    plan = numpy.column_stack([points[:, x] - low[x], high[y] - points[:, y] if flip else points[:, y] - low[y]])
    facing = normal[:, axis] * sign > 0.05 * numpy.linalg.norm(normal, axis=1)
    edges = {}
    for t in triangles[facing].tolist():
        for a, b in zip(t, t[1:] + t[:1]):
            edges[frozenset((a, b))] = None if frozenset((a, b)) in edges else (a, b)
    sheet.y += height
    sheet.wide = max(sheet.wide, width)
    sheet.add_lines(plan[numpy.array([edge for edge in edges.values() if edge], int).reshape(-1, 2)], SOLID)
    most = depth[triangles[facing & cut]].max(initial=0.0)
    levels = numpy.arange(1, int(most / step + 1e-9) + 1) * step
    for number, level in enumerate(levels):
        lines = find_lines(plan, triangles[facing & cut], depth, level)
        colour = COLOURS[min(len(COLOURS) - 1, number * len(COLOURS) // len(levels))]
        sheet.add_lines(lines, f'stroke="{colour}" stroke-width="0.25"')
        if len(lines):
            far = lines.reshape(-1, 2)[numpy.lexsort((lines[:, :, 1].ravel(), lines[:, :, 0].ravel().round(3)))[-1]]
            sheet.add_text(f"{level:g}", MARGIN + far[0] + 0.3, sheet.y - far[1] + TEXT, 0.7 * TEXT)
    sheet.y += 2 * TEXT
    contours = f", depth in mm, contours every {step:g} mm, deepest {most:.3f} mm" if most > 0 else ""
    sheet.add_text(f"seen from {'+' if sign > 0 else '-'}{'xyz'[axis]}: {width:.1f} x {height:.1f} mm{contours}")
    sheet.y += TEXT


def draw(path, before_m, after_m, title, table):
    """before_m, after_m: (positions (N, 3), triangles) of the surface; contours where the triangles are the same. table: lines below."""
    (before, triangles), (after, after_triangles) = ((1e3 * points, t) for points, t in (before_m, after_m))
    move = after - before if triangles is after_triangles else numpy.zeros_like(before)
    depth = numpy.linalg.norm(move, axis=1)
    along, across, up = numpy.argsort(-numpy.ptp(before, axis=0), kind="stable")
    most = depth.max()
    step = next((s for s in STEPS if most / s <= MAX_CONTOURS), STEPS[-1])
    low, high = before.min(axis=0), before.max(axis=0)
    corners = before[triangles]
    normal = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # A rim that moves within the plane of a side is no cut of that side.
    area = numpy.maximum(numpy.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    inward = -numpy.einsum("tcx,tx->tc", move[triangles], normal) / area
    cut = numpy.max(inward - 0.3 * depth[triangles], axis=1) > 1e-4
    sheet = Sheet()
    sheet.add_text(title, size=1.3 * TEXT)
    sheet.y += 2 * TEXT
    for view in find_views(normal, cut, up):
        draw_view(sheet, view, before, triangles, normal, depth, cut, step)
    # Through the deepest place, that nearest to the middle, and between the vertices.
    middle = (low + high)[across] / 2
    deepest = before[depth >= most - 1e-6]
    place = deepest[numpy.abs(deepest[:, across] - middle).argmin(), across] + 1e-3
    thick = (high - low)[up]
    sheet.y += TEXT + thick
    for points, of, style in ((before, triangles, DASHED), (after, after_triangles, SOLID)):
        sheet.add_lines(find_lines(points, of, points[:, across], place)[:, :, [along, up]] - low[[along, up]], style)
    sheet.y += 2 * TEXT
    sheet.add_text(f"section {place - low[across]:.1f} mm from the edge: {thick:.2f} mm high; dashed: before")
    for line in table:
        sheet.y += 1.5 * TEXT
        sheet.add_text(line, font="monospace")
    sheet.write(path)
