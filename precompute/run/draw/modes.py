"""Pictures of modes as deformed bodies."""
import math

import numpy

import picture
from picture import vtk


def draw_modes(bank, numbers, up):
    triangles = picture.drop_cavities(bank.vertices, bank.triangles)
    used = numpy.unique(triangles)
    place = bank.vertices[used]
    size = numpy.linalg.norm(place.max(axis=0) - place.min(axis=0))
    deformed = []
    for number in numbers:
        mode = bank.read_mode(number)
        length = numpy.linalg.norm(mode, axis=1)
        largest = length[used].max()
        if not largest > 0:  # no motion at the surface: drawn undeformed
            deformed.append((bank.vertices, numpy.zeros(len(bank.vertices))))
            continue
        # 8 % of the size is visible without inversion; the sign makes the largest motion point outward.
        k = int(length[used].argmax())
        sign = 1.0 if mode[used][k] @ (place[k] - place.mean(axis=0)) >= 0 else -1.0
        deformed.append((bank.vertices + sign * 0.08 * size / largest * mode, length / largest))
    note = "grey: undeformed; displacements exaggerated"
    return draw_panels(bank, numbers, up, triangles, deformed, picture.make_colours(), ("at rest", "largest displacement"), note)


def draw_panels(bank, numbers, up, triangles, deformed, colours, ends, note):
    """A panel for each mode. deformed: vertices and colours, 0 to 1, of the surface `triangles` of each."""
    outer, used = picture.drop_cavities(bank.vertices, bank.triangles), numpy.unique(triangles)
    place = bank.vertices[numpy.unique(outer)]
    extent = place.max(axis=0) - place.min(axis=0)
    flat = extent[up] < 0.25 * max(extent)
    view = picture.View(up, place, 28, 34 if flat else 14)
    seen = numpy.vstack([place] + [shape[used] for shape, _ in deformed]) @ view.axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    columns, width, height = picture.choose_panels(len(numbers), (high[0] - low[0]) / max(high[1] - low[1], 0.05 * (high[0] - low[0])))
    rows = math.ceil(len(numbers) / columns)
    canvas = numpy.full((rows * height + picture.LEGEND, columns * width, 3), 255.0)
    rest = picture.make_surface(bank.vertices, outer)
    corners = numpy.vstack([place] + [shape[used] for shape, _ in deformed])
    bounds = numpy.column_stack([corners.min(axis=0), corners.max(axis=0)]).ravel()
    for index, (number, (shape, colour)) in enumerate(zip(numbers, deformed)):
        # The undeformed body is in a layer below.
        renderer, above = picture.make_renderer(), vtk.vtkRenderer()
        renderer.GradientBackgroundOff()
        renderer.SetBackground(1.0, 1.0, 1.0)
        picture.make_lights(above)
        view.aim(renderer, low, high, width, height, (45, 45, 110, 25))
        above.SetActiveCamera(renderer.GetActiveCamera())
        above.AddActor(picture.make_actor(picture.make_surface(shape, triangles, colour), colours=colours))
        renderer.AddActor(picture.make_actor(rest, (0.84, 0.86, 0.89)))
        outline = vtk.vtkPolyDataSilhouette()
        outline.SetInputData(rest)
        outline.SetCamera(renderer.GetActiveCamera())
        outline.SetEnableFeatureAngle(0)
        outline.Update()
        lines = picture.make_flat(picture.make_actor(outline.GetOutput(), (0.55, 0.58, 0.63)))
        lines.GetProperty().SetLineWidth(1.2 * picture.SUPERSAMPLING)
        renderer.AddActor(lines)
        above.ResetCameraClippingRange(*bounds)
        renderer.AddActor2D(picture.make_text(f"Mode {number}", 0.5, 80 / height, 30, bold=True))
        played_hz, mesh_hz = (f"{values[number - 1]:,.1f}" for values in (bank.freq_hz, bank.mesh_hz))
        label = f"{played_hz} Hz" if played_hz == mesh_hz else f"{played_hz} Hz (mesh: {mesh_hz})"
        renderer.AddActor2D(picture.make_text(label, 0.5, 42 / height, 26))
        row, column = divmod(index, columns)
        canvas[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture.draw([renderer, above], width, height)
    note = f"{bank.path.name}   ·   {bank.note}   ·   {note}"
    canvas[rows * height :] = picture.draw_legend(canvas.shape[1], picture.LEGEND, colours, ends, note)
    return canvas
