"""Pictures of rendered scenes: bodies along their paths."""
import math

import numpy

import picture
from picture import to_numpy, to_vtk, vtk

MOVING = [(0.85, 0.42, 0.20), (0.20, 0.45, 0.78), (0.55, 0.30, 0.62), (0.25, 0.60, 0.35)]
FIXED = [(0.55, 0.66, 0.80), (0.72, 0.74, 0.78), (0.80, 0.66, 0.46), (0.62, 0.74, 0.62), (0.76, 0.62, 0.70)]


def decimate(vertices, triangles, max_triangles):
    """Reduces a body to about `max_triangles` triangles, for repeated copies."""
    if len(triangles) <= max_triangles:
        return vertices, triangles
    clean = vtk.vtkCleanPolyData()  # also removes unused points
    clean.SetInputData(picture.make_surface(vertices, triangles, crease_deg=180.0))
    clean.SetTolerance(0.0)
    thin = vtk.vtkQuadricDecimation()
    thin.SetInputConnection(clean.GetOutputPort())
    thin.SetTargetReduction(1.0 - max_triangles / len(triangles))
    thin.Update()
    output = thin.GetOutput()
    return to_numpy(output.GetPoints().GetData()).astype(float), to_numpy(output.GetPolys().GetData()).reshape(-1, 4)[:, 1:]


def choose_poses(centres, poses, radius, count):
    """Indices of poses spaced evenly in path and rotation, including the first and the last."""
    way = numpy.linalg.norm(numpy.diff(centres, axis=0), axis=1)
    turn = 2 * numpy.arccos(numpy.clip(numpy.abs(numpy.einsum("ij,ij->i", poses[1:, 4:], poses[:-1, 4:])), 0, 1))
    total = numpy.concatenate([[0.0], numpy.cumsum(way + 0.25 * radius * turn)])
    if total[-1] < 0.05 * radius:
        return [len(poses) - 1]
    count = int(min(count, max(2, round(total[-1] / (0.9 * radius)) + 1)))
    return sorted(
        {int(numpy.searchsorted(total, t)) for t in numpy.linspace(0, total[-1], count)} & set(range(len(poses))) | {len(poses) - 1}
    )


def make_ground(centre, radius, up):
    """A disc that fades into the background."""
    disc = vtk.vtkDiskSource()
    disc.SetInnerRadius(0.0)
    disc.SetOuterRadius(radius)
    disc.SetRadialResolution(24)
    disc.SetCircumferentialResolution(96)
    disc.Update()
    data = disc.GetOutput()
    flat = to_numpy(data.GetPoints().GetData()).astype(float)
    points = numpy.zeros_like(flat)
    points[:, (up + 1) % 3], points[:, (up + 2) % 3] = flat[:, 0], flat[:, 1]
    data.GetPoints().SetData(to_vtk(points + centre, deep=True))
    fade = numpy.clip(1.15 - numpy.hypot(flat[:, 0], flat[:, 1]) / radius, 0, 1) ** 1.2
    rgba = numpy.column_stack([numpy.tile((202, 207, 214), (len(flat), 1)), 255 * numpy.minimum(fade, 1)]).astype(numpy.uint8)
    rgba[numpy.hypot(flat[:, 0], flat[:, 1]) > 0.999 * radius, 3] = 0
    data.GetPointData().SetScalars(to_vtk(rgba, deep=True))
    return picture.make_flat(picture.make_actor(data, colours=vtk.vtkLookupTable()))


def blend(colour, other, weight):
    return tuple((1 - weight) * a + weight * b for a, b in zip(colour, other))


def add_legend(renderer, entries, width, height):
    """Entries (text, colour or None) in centred rows at the bottom of the picture. Returns the number of rows."""
    size, letter = 24, 12.0
    rows, room = [[]], 0.0
    for text, colour in entries:
        need = letter * len(text) + (34 if colour else 0) + 44
        if rows[-1] and room + need > width - 80:
            rows.append([])
            room = 0.0
        rows[-1].append((text, colour, need))
        room += need
    for row, line in enumerate(rows):
        x = 0.5 * (width - sum(need for *_, need in line))
        y = 36 + 44 * (len(rows) - 1 - row)
        for text, colour, need in line:
            if colour:
                dot = vtk.vtkRegularPolygonSource()
                dot.SetNumberOfSides(32)
                dot.SetRadius(9 * picture.SUPERSAMPLING)
                dot.SetCenter((x + 12) * picture.SUPERSAMPLING, y * picture.SUPERSAMPLING, 0)
                mapper = vtk.vtkPolyDataMapper2D()
                mapper.SetInputConnection(dot.GetOutputPort())
                actor = vtk.vtkActor2D()
                actor.SetMapper(mapper)
                actor.GetProperty().SetColor(*colour)
                renderer.AddActor2D(actor)
                x += 34
                need -= 34
            renderer.AddActor2D(picture.make_text(text, x / width, y / height, size, centred=False))
            x += need
    return len(rows)


def find_frame(scene, moving_points, fixed_points):
    """Points that the picture has to show. A floor far wider than the motion is drawn but does not determine the frame."""
    points = numpy.vstack(moving_points or fixed_points)
    for shelf in fixed_points:
        low, high = points.min(axis=0), points.max(axis=0)
        room = 1.0 * (high - low).max()
        points = numpy.vstack([points, numpy.clip(shelf, low - room, high + room)])
    if scene.ground is not None:
        foot = points.min(axis=0)
        foot[scene.up] = max(min(scene.ground, foot[scene.up]), foot[scene.up] - (points.max(axis=0) - foot).max())
        points = numpy.vstack([points, foot])
    return points


def aim_camera(camera, view, points):
    """Perspective camera that shows the points. Returns width and height of the picture, and the tangent of half the view angle."""
    seen = points @ view.axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    aspect = (high[0] - low[0]) / (high[1] - low[1])
    width, height = (1800, int(min(max(1650 / aspect, 900), 1900))) if aspect > 0.75 else (1600, 1900)
    slope = math.tan(math.radians(11))
    margin = 1.10
    focus = view.axes.T @ numpy.append(0.5 * (low + high)[:2], high[2])
    half = max(0.5 * margin * (high[1] - low[1]), 0.5 * margin * (high[0] - low[0]) * height / width)
    camera.SetViewAngle(22)
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + view.axes[2] * half / slope))
    camera.SetViewUp(*view.axes[1])
    return width, height, slope


def add_impulses(overlay, impulses, size, legend):
    """Dots with areas in proportion to the impulses, the 600 largest."""
    impulses = impulses[numpy.argsort(-impulses[:, 3])][:600]
    if not len(impulses):
        return
    largest = impulses[0, 3] if impulses[0, 3] > 0 else 1.0
    dots = vtk.vtkAppendPolyData()
    for x, y, z, impulse in impulses[impulses[:, 3] > 0.01 * largest]:
        dot = vtk.vtkSphereSource()
        dot.SetCenter(x, y, z)
        dot.SetRadius(size * 0.0105 * (max(impulse, 0.0) / largest) ** 0.5 + 0.0012 * size)
        dot.SetThetaResolution(24)
        dot.SetPhiResolution(24)
        dot.Update()
        dots.AddInputData(dot.GetOutput())
    dots.Update()
    overlay.AddActor(picture.make_actor(dots.GetOutput(), (0.80, 0.10, 0.16), opacity=0.85))
    legend.append((f"contacts, largest {largest:.2g} N s", (0.80, 0.10, 0.16), True))


def add_moving_body(renderer, overlay, body, colour, size):
    """Copies of a body along its path, paler for earlier poses, and the path."""
    _, bank, _, poses, triangles, radius, centres = body
    chosen = choose_poses(centres, poses, radius, 14)
    vertices, thin = decimate(bank.vertices, triangles, 16000)
    for order, index in enumerate(chosen):
        last = order == len(chosen) - 1
        pale = 0.55 * (1 - order / max(1, len(chosen) - 1))
        surface = picture.make_surface(picture.rotate(poses[index][4:], vertices) + poses[index][1:4], thin)
        renderer.AddActor(picture.make_actor(surface, blend(colour, (1, 1, 1), pale), opacity=1.0 if last else 0.42))
    if len(centres) > 1 and numpy.ptp(centres, axis=0).max() > 0.02 * size:
        step = max(1, len(centres) // 2000)
        overlay.AddActor(picture.make_line(centres[::step], 0.0018 * size, (0.95, 0.75, 0.10), 0.9))


def draw_scene(scene):
    bodies, moving_points, fixed_points = [], [], []
    for name, bank, fixed, poses in scene.bodies:
        triangles = picture.drop_cavities(bank.vertices, bank.triangles)
        used = bank.vertices[numpy.unique(triangles)]
        radius = numpy.linalg.norm(used - bank.centre, axis=1).max()
        centres = numpy.array([picture.rotate(p[4:], bank.centre[None])[0] + p[1:4] for p in poses])
        bodies.append((name, bank, fixed, poses, triangles, radius, centres))
        if fixed:
            fixed_points.append(picture.rotate(poses[0][4:], used) + poses[0][1:4])
        else:
            moving_points += [centres - radius, centres + radius]
    points = find_frame(scene, moving_points, fixed_points)
    size = numpy.linalg.norm(points.max(axis=0) - points.min(axis=0))
    renderer, overlay = picture.make_renderer(), vtk.vtkRenderer()
    picture.make_lights(overlay)
    camera = renderer.GetActiveCamera()
    width, height, slope = aim_camera(camera, picture.View(scene.up, points, 24, 13), points)
    overlay.SetActiveCamera(camera)
    if scene.ground is not None:
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        centre[scene.up] = scene.ground
        renderer.AddActor(make_ground(centre, 1.1 * size, scene.up))
    legend, moving = [], 0
    for body in bodies:
        name, bank, fixed, poses, triangles, *_ = body
        if fixed:
            colour = FIXED[len([entry for entry in legend if entry[2]]) % len(FIXED)]
            legend.append((name, colour, True))
            renderer.AddActor(
                picture.make_actor(picture.make_surface(picture.rotate(poses[0][4:], bank.vertices) + poses[0][1:4], triangles), colour)
            )
            continue
        colour = MOVING[moving % len(MOVING)]
        moving += 1
        legend.append((name, colour, False))
        add_moving_body(renderer, overlay, body, colour, size)
    add_impulses(overlay, scene.impulses, size, legend)
    if moving:
        legend.append(("path of the centre of mass", (0.95, 0.75, 0.10), True))
    times = [poses[:, 0] for _, _, fixed, poses, *_ in bodies if not fixed]
    if times:
        legend.append((f"{min(t[0] for t in times):.2f} s to {max(t[-1] for t in times):.2f} s, paler is earlier", None, False))
    rows = add_legend(overlay, [entry[:2] for entry in legend], width, height)
    # Keep the scene clear of the legend.
    band = (36 + 44 * rows) / height
    camera.SetViewAngle(2 * math.degrees(math.atan(slope / (1 - band))))
    camera.SetWindowCenter(0.0, -band)
    renderer.ResetCameraClippingRange()
    return picture.draw([renderer, overlay], width, height)
