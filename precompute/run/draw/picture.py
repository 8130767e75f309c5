"""Building blocks of pictures with VTK. Import only after display.open_display()."""
import math
import os
import sys
import tempfile

import numpy

from common import STANDARD_OUTPUT, SystemError_

os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
import vtkmodules.all as vtk
from vtkmodules.util.numpy_support import numpy_to_vtk as to_vtk, vtk_to_numpy as to_numpy

SUPERSAMPLING = 2  # pixels drawn per pixel written, along each side
LEGEND = 84  # pixels: height of the colour bar below
TEXT = (0.16, 0.17, 0.20)
BACKGROUND = ((1.0, 1.0, 1.0), (0.90, 0.92, 0.95))  # top, bottom
# viridis (van der Walt and Smith 2015), nine colours.
VIRIDIS = (
    numpy.frombuffer(bytes.fromhex("440154 472c7a 3b528b 2c718e 21918c 27ad81 5cc863 aadc32 fde725"), numpy.uint8).reshape(9, 3) / 255.0
)


def drop_cavities(vertices, triangles):
    """Removes the inner surfaces of hollow bodies: invisible connected parts with negative volume."""
    label = numpy.arange(len(vertices))
    while True:  # label propagation: minimum over the triangles of each vertex
        least = label[triangles].min(axis=1)
        new = label.copy()
        for corner in range(3):
            numpy.minimum.at(new, triangles[:, corner], least)
        new = new[new]
        if (new == label).all():
            break
        label = new
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    volumes = numpy.bincount(label[triangles[:, 0]], numpy.einsum("ij,ij->i", a, numpy.cross(b, c)), len(vertices))
    seen = volumes[label[triangles[:, 0]]] > 0
    return triangles[seen] if seen.any() else triangles


def rotate(quaternion, points):
    """Rotates points (N, 3) by a quaternion (w, x, y, z)."""
    w, v = quaternion[0], numpy.asarray(quaternion[1:])
    t = 2 * numpy.cross(v, points)
    return points + w * t + numpy.cross(v, t)


def make_surface(vertices, triangles, values=None, crease_deg=40.0):
    """Polygons with smooth normals that break at creases."""
    points = vtk.vtkPoints()
    points.SetData(to_vtk(numpy.ascontiguousarray(vertices, dtype=float), deep=True))
    cells = vtk.vtkCellArray()
    rows = numpy.hstack([numpy.full((len(triangles), 1), 3), triangles]).astype(numpy.int64)
    connectivity = vtk.vtkIdTypeArray()
    connectivity.DeepCopy(to_vtk(rows.ravel(), array_type=vtk.VTK_ID_TYPE))
    cells.SetCells(len(triangles), connectivity)
    surface = vtk.vtkPolyData()
    surface.SetPoints(points)
    surface.SetPolys(cells)
    if values is not None:
        surface.GetPointData().SetScalars(to_vtk(numpy.ascontiguousarray(values), deep=True))
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputData(surface)
    normals.SetFeatureAngle(crease_deg)
    normals.ConsistencyOff()
    normals.Update()
    return normals.GetOutput()


def make_colours():
    table = vtk.vtkColorTransferFunction()
    for i, colour in enumerate(VIRIDIS):
        table.AddRGBPoint(i / (len(VIRIDIS) - 1), *colour)
    return table


def make_actor(data, colour=None, colours=None, opacity=1.0):
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    if colours is not None:
        mapper.SetLookupTable(colours)
        mapper.InterpolateScalarsBeforeMappingOn()
    else:
        mapper.ScalarVisibilityOff()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    if colour is not None:
        look.SetColor(*colour)
    look.SetOpacity(opacity)
    look.SetAmbient(0.28)
    look.SetDiffuse(0.84)
    look.SetSpecular(0.18)
    look.SetSpecularPower(28)
    return actor


def make_flat(actor):
    actor.GetProperty().LightingOff()
    return actor


def make_text(text, x, y, size, bold=False, centred=True, colour=TEXT):
    """Text at a position in fractions of the viewport, `size` in pixels of the picture."""
    actor = vtk.vtkTextActor()
    actor.SetInput(text)
    actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    actor.SetPosition(x, y)
    look = actor.GetTextProperty()
    look.SetFontFamilyToArial()
    look.SetFontSize(int(size * SUPERSAMPLING))
    look.SetBold(bold)
    look.SetColor(*colour)
    if centred:
        look.SetJustificationToCentered()
    look.SetVerticalJustificationToCentered()
    return actor


def make_lights(renderer):
    """Key light from the upper left, soft fills from the right and below, rim light from behind."""
    renderer.AutomaticLightCreationOff()
    for place, strength, colour in [
        ((-0.7, 0.9, 1.0), 0.80, (1.0, 0.98, 0.95)),
        ((1.0, 0.2, 0.8), 0.34, (0.92, 0.95, 1.0)),
        ((0.1, 0.8, -1.0), 0.25, (1.0, 1.0, 1.0)),
        ((0.0, -0.9, 0.6), 0.22, (0.96, 0.97, 1.0)),
    ]:
        light = vtk.vtkLight()
        light.SetLightTypeToCameraLight()
        light.SetPosition(*place)
        light.SetFocalPoint(0, 0, 0)
        light.SetIntensity(strength)
        light.SetColor(*colour)
        renderer.AddLight(light)


def make_renderer():
    renderer = vtk.vtkRenderer()
    renderer.GradientBackgroundOn()
    renderer.SetBackground2(*BACKGROUND[0])
    renderer.SetBackground(*BACKGROUND[1])
    renderer.SetUseDepthPeeling(True)
    renderer.SetMaximumNumberOfPeels(12)
    make_lights(renderer)
    return renderer


def draw(renderers, width, height):
    """The picture (height, width, 3) of stacked renderers, antialiased by supersampling."""
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    window.SetAlphaBitPlanes(True)
    window.SetSize(width * SUPERSAMPLING, height * SUPERSAMPLING)
    window.SetNumberOfLayers(len(renderers))
    for layer, renderer in enumerate(renderers):
        renderer.SetLayer(layer)
        renderer.UseFXAAOn()
        window.AddRenderer(renderer)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    image = to_numpy(grab.GetOutput().GetPointData().GetScalars())[:, :3]
    image = image.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 3).astype(float).mean(axis=(1, 3))
    window.Finalize()
    return image[::-1]


def write_png(image, path):
    """Writes the picture atomically; "-" is standard output."""
    height, width, _ = image.shape
    data = vtk.vtkImageData()
    data.SetDimensions(width, height, 1)
    pixels = numpy.clip(numpy.rint(image[::-1]), 0, 255).astype(numpy.uint8).reshape(-1, 3)
    data.GetPointData().SetScalars(to_vtk(pixels, deep=True))
    writer = vtk.vtkPNGWriter()
    writer.SetInputData(data)
    writer.WriteToMemoryOn()
    writer.Write()
    if path == STANDARD_OUTPUT:
        sys.stdout.buffer.write(bytes(to_numpy(writer.GetResult())))
        sys.stdout.buffer.flush()
        return
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", suffix=".png", delete=False) as file:
            file.write(bytes(to_numpy(writer.GetResult())))
            file.flush()
            os.fsync(file.fileno())
        os.chmod(file.name, 0o644)
        os.replace(file.name, path)
    except OSError as error:
        raise SystemError_(f"{path}: cannot be written ({error.strerror}); choose another path") from None


class View:
    """Axes of a picture: right, up and towards the eye, as rows of a rotation."""

    def __init__(self, up, points, azimuth_deg, elevation_deg):
        extent = points.max(axis=0) - points.min(axis=0)
        # The longer horizontal axis runs across the picture.
        first, second = (up + 1) % 3, (up + 2) % 3
        across = first if extent[first] >= extent[second] else second
        up_vector, right = numpy.eye(3)[up], numpy.eye(3)[across]
        toward = numpy.cross(right, up_vector)
        azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
        toward = toward * math.cos(azimuth) + right * math.sin(azimuth)
        toward = toward * math.cos(elevation) + up_vector * math.sin(elevation)
        right = numpy.cross(up_vector, toward)
        right /= numpy.linalg.norm(right)
        self.axes = numpy.array([right, numpy.cross(toward, right), toward])

    def aim(self, renderer, low, high, width, height, room):
        """Parallel camera that shows the box low..high (in view axes) with margins `room` = (left, right, bottom, top) in pixels."""
        left, right, bottom, top = room
        pixel = max((high[0] - low[0]) / (width - left - right), (high[1] - low[1]) / (height - bottom - top))
        centre = 0.5 * (low + high) + numpy.array([0.5 * (right - left), 0.5 * (top - bottom), 0.0]) * pixel
        focus = self.axes.T @ centre
        camera = renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(*focus)
        camera.SetPosition(*(focus + self.axes[2] * 4 * max(high - low)))
        camera.SetViewUp(*self.axes[1])
        camera.SetParallelScale(0.5 * height * pixel)
        renderer.ResetCameraClippingRange()
        return pixel


def choose_panels(count, aspect):
    """Columns and panel size (pixels) for `count` bodies of a width-to-height ratio, in a picture of about 3 to 2."""
    best = None
    for columns in range(1, count + 1):
        rows = math.ceil(count / columns)
        width = 1860 // columns
        height = int(min(max((width - 90) / aspect, 150), 900)) + 150
        picture = columns * width / (rows * height)
        body = min((width - 90) / aspect, height - 150)  # height of the body in the picture
        cost = abs(math.log(picture / 1.7)) + 1.0 * (columns * rows - count) - 0.15 * math.log(body * body * aspect)
        if best is None or cost < best[0]:
            best = (cost, columns, width, height)
    return best[1:]


def draw_legend(width, height, colours, ends, note):
    """A colour bar with labels at both ends and a note below."""
    renderer = make_renderer()
    renderer.SetBackground(1.0, 1.0, 1.0)
    renderer.SetBackground2(1.0, 1.0, 1.0)
    bar = vtk.vtkPlaneSource()
    bar.SetResolution(128, 1)
    bar.SetOrigin(0, 0, 0)
    bar.SetPoint1(1, 0, 0)
    bar.SetPoint2(0, 0.05, 0)
    bar.Update()
    plane = bar.GetOutput()
    plane.GetPointData().SetScalars(to_vtk(to_numpy(plane.GetPoints().GetData())[:, 0].copy(), deep=True))
    renderer.AddActor(make_flat(make_actor(plane, colours=colours)))
    pixel = 1.0 / 360
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(0.5, 0.025 - 14 * pixel, 0)
    camera.SetPosition(0.5, 0.025 - 14 * pixel, 1)
    camera.SetParallelScale(0.5 * height * pixel)
    middle = 0.5 + 14 / height
    for text, side in zip(ends, (-1, 1)):
        renderer.AddActor2D(make_text(text, 0.5 + side * (180 + 18 + 4.5 * len(text)) / width, middle, 19))
    renderer.AddActor2D(make_text(note, 0.5, 18 / height, 16, colour=(0.42, 0.44, 0.48)))
    return draw([renderer], width, height)


def make_line(points, radius, colour, opacity=1.0):
    line = vtk.vtkPolyData()
    vertices = vtk.vtkPoints()
    vertices.SetData(to_vtk(numpy.ascontiguousarray(points), deep=True))
    cells = vtk.vtkCellArray()
    cells.InsertNextCell(len(points))
    for i in range(len(points)):
        cells.InsertCellPoint(i)
    line.SetPoints(vertices)
    line.SetLines(cells)
    tube = vtk.vtkTubeFilter()
    tube.SetInputData(line)
    tube.SetRadius(radius)
    tube.SetNumberOfSides(10)
    tube.CappingOn()
    tube.Update()
    return make_actor(tube.GetOutput(), colour, opacity=opacity)
