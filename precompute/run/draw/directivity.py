"""Balloons of the far levels of modes."""
import math

import numpy

from far_field import calc_levels, make_equal_areas
import picture
from picture import to_numpy, to_vtk

RANGE_DB = 30.0  # from the centre of a balloon to its largest radius
BODY_RADIUS = 0.24  # of the sphere around the body, relative to the largest radius of the balloon


def make_directions(order):
    """Equidistant polar angles and azimuths: 16 per wave of the highest order, for a smooth picture."""
    steps = max(180, 8 * order)
    return numpy.linspace(0, math.pi, steps + 1), 2 * math.pi * numpy.arange(2 * steps) / (2 * steps)


def make_balloon(levels, polar, azimuth):
    """Vertices, triangles and colours 0 .. 1 of the surface with the level over RANGE_DB as radius and colour."""
    radius = numpy.clip(1 + levels / RANGE_DB, 0, 1)
    sine, cosine = numpy.sin(polar)[:, None], numpy.cos(polar)[:, None]
    directions = numpy.stack([sine * numpy.cos(azimuth), sine * numpy.sin(azimuth), cosine * numpy.ones_like(azimuth)], axis=-1)
    rows, columns = radius.shape
    a = numpy.arange(rows * columns).reshape(rows, columns)[:-1]
    b = numpy.roll(a, -1, axis=1)  # next azimuth; below: next polar angle
    triangles = numpy.concatenate(
        [
            numpy.stack(corners, -1)[part].reshape(-1, 3)
            for corners, part in [((a, a + columns, b + columns), slice(None, -1)), ((a, b + columns, b), slice(1, None))]
        ]
    )
    return (radius[..., None] * directions).reshape(-1, 3), triangles, radius.ravel()


def make_ring(view, radius):
    """A circle about the centre, in the plane of the picture."""
    angle = numpy.linspace(0, 2 * math.pi, 181)
    return radius * (numpy.outer(numpy.cos(angle), view.axes[0]) + numpy.outer(numpy.sin(angle), view.axes[1]))


def make_polyline(points, colour, width):
    line = picture.make_line(points, 0.5 * width, colour)
    return picture.make_flat(line)


def make_glass(surface, toward):
    """A surface coloured by its scalars, translucent where it faces the eye."""
    normals = to_numpy(surface.GetPointData().GetNormals())
    level = to_numpy(surface.GetPointData().GetScalars())
    facing = numpy.abs(normals @ toward)
    rgba = numpy.empty((len(level), 4))
    for channel in range(3):
        rgba[:, channel] = numpy.interp(level, numpy.linspace(0, 1, len(picture.VIRIDIS)), picture.VIRIDIS[:, channel])
    rgba[:, 3] = 0.46 + 0.50 * (1 - facing) ** 1.5
    surface.GetPointData().SetScalars(to_vtk((255 * rgba).astype(numpy.uint8), deep=True))
    actor = picture.make_actor(surface)
    actor.GetMapper().ScalarVisibilityOn()
    actor.GetMapper().SetColorModeToDirectScalars()
    actor.ForceTranslucentOn()
    return actor


def draw_directivity(bank, air, numbers, up):
    triangles = picture.drop_cavities(bank.vertices, bank.triangles)
    body = (bank.vertices - air.centre_m) * BODY_RADIUS / air.radius_m
    view = picture.View(up, body[numpy.unique(triangles)], 28, 20)
    colours = picture.make_colours()
    columns, width, height = picture.choose_panels(len(numbers), 1.0)
    rows = math.ceil(len(numbers) / columns)
    canvas = numpy.full((rows * height + picture.LEGEND, columns * width, 3), 255.0)
    for index, number in enumerate(numbers):
        order = int(air.order[number - 1])
        polar, azimuth = make_directions(order)
        levels = calc_levels(air.calc_far(number, polar, azimuth))
        renderer, above = picture.make_renderer(), picture.make_renderer()
        renderer.GradientBackgroundOff()
        renderer.SetBackground(1.0, 1.0, 1.0)
        reach = numpy.full(3, 1.06)
        pixel = view.aim(renderer, -reach, reach, width, height, (30, 30, 110, 20))
        above.SetActiveCamera(renderer.GetActiveCamera())
        above.SetMaximumNumberOfPeels(8)
        for step in range(3):
            radius = 1 - 10 * step / RANGE_DB
            renderer.AddActor(make_polyline(make_ring(view, radius), (0.72, 0.75, 0.80), 1.6 * pixel))
        above.AddActor(picture.make_actor(picture.make_surface(body, triangles), (0.96, 0.42, 0.26)))
        spread = "silent"
        if levels is not None:
            spread = f"spread {calc_levels(air.calc_far(number, *make_equal_areas(order))).std():.1f} dB"
            vertices, faces, level = make_balloon(levels, polar, azimuth)
            above.AddActor(make_glass(picture.make_surface(vertices, faces, level, crease_deg=180.0), view.axes[2]))
        above.ResetCameraClippingRange(-2, 2, -2, 2, -2, 2)
        renderer.AddActor2D(picture.make_text(f"Mode {number}", 0.5, 80 / height, 30, bold=True))
        label = f"{air.freq_hz[number - 1]:,.1f} Hz, order {order}, {spread}"
        renderer.AddActor2D(picture.make_text(label, 0.5, 42 / height, min(24, 1.75 * width / len(label))))
        row, column = divmod(index, columns)
        canvas[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture.draw([renderer, above], width, height)
    note = f"{bank.path.name}   ·   far away, about the body in the middle   ·   rings: 0, -10 and -20 dB"
    canvas[rows * height :] = picture.draw_legend(
        canvas.shape[1], picture.LEGEND, colours, (f"-{RANGE_DB:.0f} dB", "0 dB, the loudest direction"), note
    )
    return canvas
