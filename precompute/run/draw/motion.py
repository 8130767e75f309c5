"""Pictures and films of motions of carillon-simulate."""
import math

import numpy

from common import InputError, SystemError_
from picture import LEGEND, View, draw, draw_legend, make_actor, make_colours, make_renderer, make_surface, make_text, write_png


class MotionPainter:
    """Frames of a motion with a common view and colour scale."""

    def __init__(self, motion, frames, up, colour, exaggerate, panel_width):
        self.motion, self.colour, self.exaggerate, self.panel_width = motion, colour, exaggerate, panel_width
        self.rest = motion.read_frame(0)[0]
        extent = self.rest.max(axis=0) - self.rest.min(axis=0)
        if not extent.max() > 0:
            raise InputError(f"{motion.path}: its points have no extent; run carillon-simulate again")
        self.view = View(up, self.rest, 28, 34 if extent[up] < 0.25 * max(extent) else 14)
        low, high, self.largest = numpy.full(3, math.inf), numpy.full(3, -math.inf), 0.0
        first, last = low, high  # bounding box in world axes
        for frame in frames:  # one at a time: a film may exceed the memory
            shape, value = self.calc_shape(frame)
            seen = shape @ self.view.axes.T
            low, high = numpy.minimum(low, seen.min(axis=0)), numpy.maximum(high, seen.max(axis=0))
            first, last = numpy.minimum(first, shape.min(axis=0)), numpy.maximum(last, shape.max(axis=0))
            self.largest = max(self.largest, value.max())
        self.low, self.high, self.bounds = low, high, numpy.column_stack([first, last]).ravel()
        aspect = (high[0] - low[0]) / max(high[1] - low[1], 0.05 * (high[0] - low[0]))
        self.panel_height = 2 * round(0.5 * (min(max((panel_width - 90) / aspect, 150), 900) + 100))  # even, as video codecs require
        self.colours = make_colours()

    def calc_shape(self, frame):
        """Points with exaggerated displacements, and their colour values in m/s or m."""
        place, speed = self.motion.read_frame(frame)
        moved = place - self.rest
        value = speed if self.colour == "speed" else numpy.linalg.norm(moved, axis=1)
        return self.rest + self.exaggerate * moved, value

    def paint(self, frame):
        shape, value = self.calc_shape(frame)
        renderer = make_renderer()
        renderer.GradientBackgroundOff()
        renderer.SetBackground(1.0, 1.0, 1.0)
        width, height = self.panel_width, self.panel_height
        self.view.aim(renderer, self.low, self.high, width, height, (45, 45, 70, 20))
        value = value / self.largest if self.largest > 0 else value
        renderer.AddActor(make_actor(make_surface(shape, self.motion.triangles, value), colours=self.colours))
        renderer.ResetCameraClippingRange(*self.bounds)
        renderer.AddActor2D(make_text(f"{1e3 * self.motion.times_s[frame] + 0.0:.3f} ms", 0.5, 36 / height, 26))
        return draw([renderer], width, height)

    def describe_ends(self):
        unit, value = ("m/s", self.largest) if self.colour == "speed" else ("mm", 1e3 * self.largest)
        return "0", f"{value:.3g} {unit}"

    def describe(self):
        larger = "" if self.exaggerate == 1 else f"   ·   displacements exaggerated {self.exaggerate:g} times"
        return f"{self.motion.path.name}   ·   colour: {self.colour}{larger}"

    def draw_legend(self, width):
        return draw_legend(width, LEGEND, self.colours, self.describe_ends(), self.describe())


def draw_moments(motion, moments, up, colour, exaggerate):
    """Evenly spaced moments from the first frame to the last; a single one is the last."""
    last = len(motion.times_s) - 1
    frames = sorted({round(i * last / (moments - 1)) for i in range(moments)}) if moments > 1 else [last]
    columns = min(len(frames), 6)
    painter = MotionPainter(motion, frames, up, colour, exaggerate, 1860 // columns)
    rows, width, height = math.ceil(len(frames) / columns), painter.panel_width, painter.panel_height
    canvas = numpy.full((rows * height + LEGEND, columns * width, 3), 255.0)
    for index, frame in enumerate(frames):
        row, column = divmod(index, columns)
        canvas[row * height : (row + 1) * height, column * width : (column + 1) * width] = painter.paint(frame)
    canvas[rows * height :] = painter.draw_legend(canvas.shape[1])
    return canvas


def write_frames(motion, folder, up, colour, exaggerate):
    """Writes all frames as FOLDER/00001.png ...; returns their number, width and height. Read errors are found before the first frame is
    written; after a write error the folder keeps the previous frames."""
    frames = range(len(motion.times_s))
    painter = MotionPainter(motion, frames, up, colour, exaggerate, 960)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise SystemError_(f"{folder}: cannot be made ({error.strerror}); choose another path") from None
    legend = painter.draw_legend(painter.panel_width)
    for frame in frames:
        write_png(numpy.vstack([painter.paint(frame), legend]), folder / f"{frame + 1:05d}.png")
    return len(frames), painter.panel_width, painter.panel_height + LEGEND
