#!/usr/bin/python3
"""carillon-draw: pictures of mode banks, of simulated scenes and of simulations, drawn off-screen with VTK.

One file, so that it runs wherever it is copied to; four parts: pictures of modes, of their directivity, of scenes, of motions, and what all
share.

    carillon-draw modes BANK -o OUT.png [--modes 1,2,3] [--up x|y|z]
    carillon-draw directivity BANK -o OUT.png [--modes 1,2,3] [--up x|y|z]
    carillon-draw scene TRAJECTORY.json -o OUT.png
    carillon-draw motion MOTION.vtkhdf -o OUT.png [--moments 6] [--exaggerate 1] [--colour speed|displacement] [--up x|y|z] [--frames DIR]

Exit codes: 0 done, 2 the input cannot be used, 4 the machine refused.
"""
import argparse
import atexit
import ctypes
import errno
import hashlib
import json
import math
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unicodedata

import h5py
import numpy

VERSION = "unknown"  # what the build writes here
STANDARD_OUTPUT = pathlib.Path("-")
SUPERSAMPLING = 2  # pixels drawn per pixel written, along each side
RANGE_DB = 30.0  # of a directivity balloon, from its centre to its largest radius
FLOOR_DB = -120.0  # of a far level: what is lower counts as this, so that a silent direction has a level
MAX_ORDER = 120  # of multipoles (runtime/bank/multipoles.hpp)
TEXT = (0.16, 0.17, 0.20)
BACKGROUND = ((1.0, 1.0, 1.0), (0.90, 0.92, 0.95))  # top, bottom
# viridis (van der Walt and Smith 2015), nine of its colours; equal steps look equal.
VIRIDIS = (
    numpy.array(
        [
            (68, 1, 84),
            (71, 44, 122),
            (59, 82, 139),
            (44, 113, 142),
            (33, 145, 140),
            (39, 173, 129),
            (92, 200, 99),
            (170, 220, 50),
            (253, 231, 37),
        ]
    )
    / 255.0
)
MOVING = [(0.85, 0.42, 0.20), (0.20, 0.45, 0.78), (0.55, 0.30, 0.62), (0.25, 0.60, 0.35)]
FIXED = [(0.55, 0.66, 0.80), (0.72, 0.74, 0.78), (0.80, 0.66, 0.46), (0.62, 0.74, 0.62), (0.76, 0.62, 0.70)]


class InputError(Exception):
    """The input cannot be used; the message says what would correct it."""


class SystemError_(Exception):
    """The machine refused."""


def printable(text):
    """`text` on one line, without what a terminal obeys: control and format characters as escapes (as config::printable does for the other
    programs)."""

    def show(letter):
        if 0xDC80 <= ord(letter) <= 0xDCFF:  # a byte of a file name that is no UTF-8
            return f"\\x{ord(letter) - 0xDC00:02x}"
        hidden = unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Zl", "Zp") and letter not in "\u00ad\u200c\u200d"
        return f"\\u{ord(letter):04x}" if hidden else letter

    return "".join(map(show, str(text)))


# ------------------------------------------------------------------ what is drawn


class Bank:
    """The drawable part of a mode bank: surface, frequencies, modes on demand. Checked by its seal (docs/bank-format.md) before HDF5 sees
    it."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        try:
            data = self.path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a mode bank") from None
        first = data[:80].split(b"\n")[0]
        if not first.startswith(b"CARILLON BANK "):
            raise InputError(f"{path}: this is no mode bank (it does not begin with 'CARILLON BANK'); make one with carillon-precompute")
        version = first[14:].decode("ascii", "replace")
        if version.split(".")[0] != "1":
            if version.startswith("2."):
                raise InputError(f"{path}: is a packed bank; carillon-bank unpack makes a plain one of it, which this program reads")
            raise InputError(f"{path}: bank version {version} is newer than 1.x, which this program reads; use a newer carillon-draw")
        if len(data) < 4096 or hashlib.sha256(data[:4032] + data[4096:]).hexdigest().encode() != data[4032:4096]:
            raise InputError(f"{path}: the bank is cut short or was changed (its SHA-256 disagrees); copy or compute it again")
        del data
        try:
            with h5py.File(self.path, "r") as file:
                self.vertices = file["mesh/vertices"][:]
                self.triangles = file["mesh/triangles"][:]
                self.mesh_hz = file["modes/frequency_hz"][:]
                # Frequencies as played: of the modes in air, else corrected, else of the mesh.
                played = (key for key in ("radiation/freq_hz", "modes/corrected_frequency_hz", "modes/frequency_hz") if key in file)
                self.freq_hz = file[next(played)][:]
                self.centre = file["rigid/centre_m"][:]
                self.note = f"{file['solve/element'][()].decode()}, {int(file['solve/nodes'][()]):,} nodes"
                self.shape_extent = file["modes/shape"].shape
        except (OSError, KeyError, TypeError, ValueError, AttributeError, OverflowError, RuntimeError, MemoryError) as error:
            raise InputError(f"{path}: the bank cannot be read ({error}); run carillon-bank check on it") from None
        self.check()

    def check(self):
        """InputError unless everything can be drawn that is not drawn yet: shapes of arrays, finite numbers, triangles of vertices that
        there are."""

        def refuse(what):
            raise InputError(f"{self.path}: {what}; run carillon-bank check on it")

        numbers = [self.vertices, self.freq_hz, self.mesh_hz, self.centre]
        if any(not numpy.issubdtype(values.dtype, numpy.number) for values in [*numbers, self.triangles]):
            refuse("mesh, frequencies or centre are no numbers")
        if (
            self.vertices.ndim != 2
            or self.vertices.shape[1] != 3
            or self.triangles.ndim != 2
            or self.triangles.shape[1] != 3
            or not len(self.triangles)
        ):
            refuse("the surface is no list of vertices and triangles")
        if (
            self.freq_hz.ndim != 1
            or self.mesh_hz.shape != self.freq_hz.shape
            or self.shape_extent != (len(self.vertices), len(self.freq_hz), 3)
        ):
            refuse("frequencies, shapes and vertices do not fit each other")
        if not all(numpy.isfinite(values).all() for values in numbers) or numpy.abs(self.vertices).max() > 1e12:
            refuse("a coordinate or a frequency is no finite number")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            refuse("a triangle names a vertex that there is not")
        if not numpy.ptp(self.vertices, axis=0).max() > 0:
            refuse("the surface has no extent")

    def read_mode(self, number):
        """The displacement of mode `number`, counted from 1, at every surface vertex; any scale."""
        try:
            with h5py.File(self.path, "r") as file:
                steps, scale = file["modes/shape"][:, number - 1, :].astype(float), float(file["modes/shape_scale"][number - 1])
        except (OSError, KeyError, TypeError, ValueError, IndexError, RuntimeError) as error:
            raise InputError(f"{self.path}: mode {number} cannot be read ({error}); run carillon-bank check on it") from None
        if not numpy.isfinite(steps).all() or not math.isfinite(scale):
            raise InputError(f"{self.path}: mode {number} has a displacement that is no finite number; run carillon-bank check on it")
        largest = numpy.abs(steps).max(initial=0.0)
        return steps / largest if largest > 0 and scale != 0 else numpy.zeros_like(steps)


class Multipoles:
    """The group radiation/ of a bank, what its modes send into the air: every mode of the bank has one order and (order + 1)^2 finite
    coefficients."""

    def __init__(self, bank):
        path = bank.path
        try:
            with h5py.File(path, "r") as file:
                if "radiation" not in file:
                    raise InputError(
                        f"{path}: the bank has no multipoles, so that nothing is known of directions; add them with"
                        f' \'carillon-precompute --radiate {path} --bank OUT.hdf\', or with "radiation": "bem" in the job'
                    )
                group = file["radiation"]
                self.centre_m = numpy.asarray(group["centre_m"][:], dtype=float)
                self.radius_m, self.sound_speed_ms = float(group["radius_m"][()]), float(group["sound_speed_ms"][()])
                self.freq_hz, scale = (numpy.asarray(group[key][:], dtype=float) for key in ("freq_hz", "scale"))
                self.order = numpy.asarray(group["order"][:], dtype=int)
                steps = numpy.asarray(group["coefficient"][:], dtype=float)
        except (OSError, KeyError, TypeError, ValueError, AttributeError, OverflowError, RuntimeError, MemoryError) as error:
            raise InputError(f"{path}: the multipoles cannot be read ({error}); run carillon-bank check on it") from None

        def refuse(what):
            raise InputError(f"{path}: {what}; run carillon-bank check on it")

        modes = (len(bank.freq_hz),)
        if self.centre_m.shape != (3,) or not self.order.shape == self.freq_hz.shape == scale.shape == modes:
            refuse("multipoles and modes do not fit each other")
        if ((self.order < 0) | (self.order > MAX_ORDER)).any() or steps.shape != (((self.order + 1) ** 2).sum(), 2):
            refuse("the orders of the multipoles do not fit their coefficients")
        numbers = [self.centre_m, self.freq_hz, scale, numpy.array([self.radius_m, self.sound_speed_ms])]
        if not all(numpy.isfinite(values).all() for values in numbers):
            refuse("a multipole is no finite number")
        if not (self.radius_m > 0 and self.sound_speed_ms > 0 and (self.freq_hz > 0).all()):
            refuse("the air has a radius, a frequency or a speed of sound that is not above 0")
        self.first = numpy.concatenate([[0], numpy.cumsum((self.order + 1) ** 2)])
        # Levels are relative to the mode's largest: only whether the scale is 0 counts.
        self.coefficient = (steps[:, 0] + 1j * steps[:, 1]) * numpy.repeat(scale > 0, (self.order + 1) ** 2)

    def calc_far(self, number, polar, azimuth):
        """The far pressure of mode `number`, counted from 1, in the directions polar (from z) x azimuth (from x to y) of the mesh's frame;
        complex, any scale."""
        order = int(self.order[number - 1])
        waves = 2 * math.pi * self.freq_hz[number - 1] / self.sound_speed_ms * self.radius_m
        coefficient = self.coefficient[self.first[number - 1] : self.first[number]]
        return calc_far_pattern(coefficient, order, waves, polar, azimuth)


def calc_inverse_hankels(x, order):
    """(-i)^(l + 1) / h_l(x) for l = 0 .. order: a multipole on the sphere, seen from far away. h_l by upward recurrence (DLMF 10.51.1),
    which is stable for it; by ratios, so that what is too large for a number becomes 0 here."""
    ratio = 1 / x - 1j  # h_1 / h_0
    inverse = [x * numpy.exp(-1j * x)]  # h_0 = -i e^(ix) / x
    for l in range(1, order + 1):
        inverse.append(-1j * inverse[-1] / ratio)
        ratio = (2 * l + 1) / x - 1 / ratio
    return numpy.array(inverse)


def calc_far_pattern(coefficient, order, waves, polar, azimuth):
    """sum of a_lm (-i)^(l + 1) / h_l(kR) Y_lm over l <= order, |m| <= l: the far pressure times k r e^(-ikr) (runtime/bank/multipoles.hpp),
    in the directions polar x azimuth. coefficient: a_lm at l^2 + l + m. waves: kR > 0. Y_lm: real, orthonormal, cos m phi for m >= 0,
    sin |m| phi for m < 0 (docs/equations.md E10), by the recurrence of the normalised associated Legendre functions."""
    inverse = calc_inverse_hankels(waves, order)
    x, sine = numpy.cos(polar), numpy.sin(polar)
    rings, around = [], []  # the pattern is the sum over m of one times the other
    diagonal = numpy.full(len(polar), math.sqrt(0.25 / math.pi))  # P_mm, the sine included
    for m in range(order + 1):
        before, here, factor = numpy.zeros_like(x), diagonal, 0.0
        cosines, sines = numpy.zeros(len(polar), dtype=complex), numpy.zeros(len(polar), dtype=complex)
        for l in range(m, order + 1):
            middle = l * l + l
            cosines += coefficient[middle + m] * inverse[l] * here
            sines += coefficient[middle - m] * inverse[l] * here
            following = math.sqrt((4 * (l + 1) ** 2 - 1) / ((l + 1) ** 2 - m * m))
            before, here, factor = here, following * (x * here - factor * before), 1 / following
        norm = math.sqrt(2) if m else 1.0
        rings += [norm * cosines, norm * sines]
        around += [numpy.cos(m * azimuth), numpy.sin(m * azimuth)]
        diagonal = diagonal * sine * math.sqrt((2 * m + 3) / (2 * m + 2))
    rings, around = numpy.array(rings).T, numpy.array(around)
    return rings.real @ around + 1j * (rings.imag @ around)


def calc_levels(pattern):
    """Levels in dB relative to the largest, FLOOR_DB or more; None where nothing is sent."""
    size = numpy.abs(pattern)
    if not size.max() > 0:
        return None
    return 20 * numpy.log10(numpy.maximum(size / size.max(), 10 ** (FLOOR_DB / 20)))


def make_equal_areas(order):
    """Polar angles and azimuths of directions that stand for equal parts of the sphere, for means of a pattern of this order. None lies
    where symmetric bodies send nothing: a level has no bound there, and one direction would count for more than its part. The spread of a
    dipole is found within 0.1 dB."""
    rings = max(720, 8 * order)
    return numpy.arccos(1 - (2 * numpy.arange(rings) + 1) / rings), math.pi * (numpy.arange(2 * rings) + 0.382) / rings


class Trajectory:
    """A rendered scene: bodies with their poses, the ground, impulses (written by carillon-render --trajectory)."""

    def __init__(self, path):
        path = pathlib.Path(path)
        try:
            data = json.loads(path.read_text())
        except RecursionError:
            raise InputError(f"{path}: brackets are nested too deep; carillon-render --trajectory writes a trajectory") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); carillon-render --trajectory writes it") from None
        except ValueError as error:
            raise InputError(f"{path}: this is no JSON ({error}); carillon-render --trajectory writes it") from None
        banks = {}
        try:
            self.up = "xyz".index(data.get("up", "z"))
            self.bodies = []
            for body in data["bodies"]:
                file = path.parent / body["bank"]
                if file not in banks:
                    banks[file] = Bank(file)
                poses = numpy.array(body["poses"], dtype=float).reshape(-1, 8)
                if not len(poses) or not numpy.isfinite(poses).all():
                    raise InputError(f"{path}: body '{body['name']}' has no finite poses; render the scene again")
                self.bodies.append((body["name"], banks[file], bool(body["fixed"]), poses))
            if not self.bodies:
                raise InputError(f"{path}: there are no bodies in it; render a scene that has some")
            self.ground = (data.get("ground") or {}).get("height_m")
            impulses = [(*i["world_m"], i["impulse_n_s"]) for i in data.get("impulses", [])]
            self.impulses = numpy.array(impulses, dtype=float).reshape(-1, 4)
            if not numpy.isfinite(self.impulses).all() or (self.ground is not None and not math.isfinite(self.ground)):
                raise InputError(f"{path}: the ground or an impulse has a number that is not finite; render the scene again")
            if any(numpy.abs(poses).max() > 1e12 for _, _, _, poses in self.bodies):
                raise InputError(f"{path}: a body is farther away than can be drawn; render the scene again")
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
            raise InputError(
                f"{path}: this is no trajectory ({type(error).__name__}: {error}); carillon-render --trajectory writes one"
            ) from None


class Motion:
    """Surfaces in motion from a file of carillon-simulate: UnstructuredGrid of VTKHDF with steps, all of triangles.

    times_s: (frames); triangles: (t, 3) into the points, the same in all frames; read_frame(): points (n, 3) [m] and speeds (n) [m/s].
    InputError for a file that is none, or that is cut.
    """

    def __init__(self, path):
        self.path = pathlib.Path(path)
        try:
            self.file = h5py.File(self.path, "r")
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else "it is no HDF5 file, or cut"
            raise InputError(f"{path}: this motion cannot be read ({why}); carillon-simulate --motion writes one") from None
        try:
            root = self.file["VTKHDF"] if "VTKHDF" in self.file else None
            if root is None or "Steps" not in root or "speed" not in root.get("PointData", ()):
                raise ValueError("it has no steps of VTKHDF with speeds")
            if (root["Types"][:] != 5).any():  # VTK_TRIANGLE
                raise ValueError("its cells are no triangles")
            self.times_s = root["Steps/Values"][:].astype(float)
            self.triangles = root["Connectivity"][:].reshape(-1, 3)
            self.count = int(root["NumberOfPoints"][0])
            if (root["NumberOfPoints"][:] != self.count).any():
                raise ValueError("the number of points changes")
            self.points, self.speed = root["Points"], root["PointData/speed"]
            shape = (len(self.times_s) * self.count, 3)
            if not (self.points.shape == shape and self.speed.shape == shape[:1]):
                raise ValueError("points and steps do not fit")
            if not (len(self.times_s) and len(self.triangles) and numpy.isfinite(self.times_s).all()):
                raise ValueError("nothing moves in it")
            if self.triangles.min() < 0 or self.triangles.max() >= self.count:
                raise ValueError("a triangle has a corner that is no point")
        except (KeyError, ValueError, TypeError, IndexError, AttributeError, OSError) as error:
            why = str(error).strip("\"'")
            raise InputError(f"{path}: this is no motion of carillon-simulate ({why}); carillon-simulate --motion writes one") from None

    def read_frame(self, frame):
        rows = slice(frame * self.count, (frame + 1) * self.count)
        try:
            place, speed = self.points[rows].astype(float), self.speed[rows].astype(float)
        except OSError:
            raise InputError(f"{self.path}: frame {frame + 1} cannot be read; the file is damaged, run carillon-simulate again") from None
        if not (numpy.abs(place).max() <= 1e12 and numpy.isfinite(speed).all()):
            raise InputError(f"{self.path}: frame {frame + 1} has a number that is not finite; run carillon-simulate again")
        return place, speed


def drop_cavities(vertices, triangles):
    """The triangles without the inner skins of hollow bodies: connected parts that enclose a negative volume cannot be seen."""
    label = numpy.arange(len(vertices))
    while True:  # every vertex takes the least label of its triangles until nothing changes
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
    """Points (N, 3) turned by a quaternion (w, x, y, z)."""
    w, v = quaternion[0], numpy.asarray(quaternion[1:])
    t = 2 * numpy.cross(v, points)
    return points + w * t + numpy.cross(v, t)


# ------------------------------------------------------------------ VTK


def start_server():
    """Xvfb on a free display from :100 on, out of the way of programs (hwloc in Open MPI) that look at :0 to :9; its number, or None."""
    first = 100 + os.getpid() % 900
    for number in range(first, first + 20):
        read_end, write_end = os.pipe()
        server = subprocess.Popen(
            ["Xvfb", f":{number}", "-displayfd", str(write_end), "-screen", "0", "1280x1024x24", "-nolisten", "tcp", "-noreset"],
            pass_fds=[write_end],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=lambda: ctypes.CDLL(None).prctl(1, signal.SIGTERM),
        )  # PR_SET_PDEATHSIG: it ends with us
        os.close(write_end)
        with os.fdopen(read_end) as pipe:
            if pipe.readline().strip():
                atexit.register(lambda: (server.terminate(), server.wait()))
                return number
        server.wait()
    return None


def open_display():
    """VTK of Debian draws through X: a virtual server of our own, gone when we are."""
    if shutil.which("Xvfb") is None:
        if os.environ.get("DISPLAY"):
            return
        raise SystemError_("Xvfb is missing, and there is no display to draw on; install the package xvfb")
    number = start_server()
    if number is None:
        raise SystemError_("the virtual display Xvfb did not start; try 'Xvfb :99' by hand to see why")
    # VTK ends the process when it cannot connect, so a plain Xlib call tries first.
    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    for _ in range(100):
        display = x11.XOpenDisplay(f":{number}".encode())
        if display:
            x11.XCloseDisplay(display)
            os.environ["DISPLAY"] = f":{number}"
            return
        time.sleep(0.1)
    raise SystemError_(f"the virtual display :{number} takes no connections; is /tmp/.X11-unix a folder that everybody may write to?")


def load_vtk():
    """Imports VTK, which takes half a second and is not needed for messages about the input."""
    global vtk, to_vtk, to_numpy
    os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
    import vtkmodules.all as vtk
    from vtkmodules.util.numpy_support import numpy_to_vtk as to_vtk, vtk_to_numpy as to_numpy


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
    """Text at a place in fractions of the viewport, `size` in pixels of the finished picture."""
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
    """A key from the upper left of the eye, soft fills from the right and below, a rim from behind."""
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
    """The picture (height, width, 3) of renderers that lie on each other; every pixel is the mean of several."""
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
    """Writes the picture next to `path` first and renames it, so that there is a whole picture or none; "-" is standard output."""
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
        raise SystemError_(f"{path}: cannot be written ({error.strerror}); choose another place") from None


class View:
    """Directions of a picture: right, up and towards the eye, as rows of a rotation."""

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
        """A parallel camera that shows the box low..high (in view axes) within `room` = (left, right, bottom, top) pixels of margin."""
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


# ------------------------------------------------------------------ modes


def choose_panels(count, aspect):
    """Columns and panel size (pixels) for `count` bodies of a width-to-height ratio, in a picture of about 3 to 2."""
    best = None
    for columns in range(1, count + 1):
        rows = math.ceil(count / columns)
        width = 1860 // columns
        height = int(min(max((width - 90) / aspect, 150), 900)) + 150
        picture = columns * width / (rows * height)
        body = min((width - 90) / aspect, height - 150)  # height of the body on the page
        cost = abs(math.log(picture / 1.7)) + 1.0 * (columns * rows - count) - 0.15 * math.log(body * body * aspect)
        if best is None or cost < best[0]:
            best = (cost, columns, width, height)
    return best[1:]


def draw_modes(bank, numbers, up):
    triangles = drop_cavities(bank.vertices, bank.triangles)
    used = numpy.unique(triangles)
    place = bank.vertices[used]
    size = numpy.linalg.norm(place.max(axis=0) - place.min(axis=0))
    extent = place.max(axis=0) - place.min(axis=0)
    flat = extent[up] < 0.25 * max(extent)
    view = View(up, place, 28, 34 if flat else 14)
    deformed = []
    for number in numbers:
        mode = bank.read_mode(number)
        length = numpy.linalg.norm(mode, axis=1)
        largest = length[used].max()
        if not largest > 0:  # a mode at rest on the surface: drawn as it lies, in the colour of no motion
            deformed.append((bank.vertices, numpy.zeros(len(bank.vertices))))
            continue
        # A twelfth of the size is visible and does not turn it inside out; the sign makes the largest motion point outward.
        k = int(length[used].argmax())
        sign = 1.0 if mode[used][k] @ (place[k] - place.mean(axis=0)) >= 0 else -1.0
        deformed.append((bank.vertices + sign * 0.08 * size / largest * mode, length / largest))
    seen = numpy.vstack([place] + [shape[used] for shape, _ in deformed]) @ view.axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    columns, width, height = choose_panels(len(numbers), (high[0] - low[0]) / max(high[1] - low[1], 0.05 * (high[0] - low[0])))
    rows = math.ceil(len(numbers) / columns)
    legend = 84
    canvas = numpy.full((rows * height + legend, columns * width, 3), 255.0)
    colours = make_colours()
    rest = make_surface(bank.vertices, triangles)
    corners = numpy.vstack([place] + [shape[used] for shape, _ in deformed])
    bounds = numpy.column_stack([corners.min(axis=0), corners.max(axis=0)]).ravel()
    for index, (number, (shape, colour)) in enumerate(zip(numbers, deformed)):
        # The body at rest lies in a layer below: it shows where the deformed one has left it.
        renderer, above = make_renderer(), vtk.vtkRenderer()
        renderer.GradientBackgroundOff()
        renderer.SetBackground(1.0, 1.0, 1.0)
        make_lights(above)
        view.aim(renderer, low, high, width, height, (45, 45, 110, 25))
        above.SetActiveCamera(renderer.GetActiveCamera())
        above.AddActor(make_actor(make_surface(shape, triangles, colour), colours=colours))
        renderer.AddActor(make_actor(rest, (0.84, 0.86, 0.89)))
        outline = vtk.vtkPolyDataSilhouette()
        outline.SetInputData(rest)
        outline.SetCamera(renderer.GetActiveCamera())
        outline.SetEnableFeatureAngle(0)
        outline.Update()
        lines = make_flat(make_actor(outline.GetOutput(), (0.55, 0.58, 0.63)))
        lines.GetProperty().SetLineWidth(1.2 * SUPERSAMPLING)
        renderer.AddActor(lines)
        above.ResetCameraClippingRange(*bounds)
        renderer.AddActor2D(make_text(f"Mode {number}", 0.5, 80 / height, 30, bold=True))
        played_hz, mesh_hz = (f"{values[number - 1]:,.1f}" for values in (bank.freq_hz, bank.mesh_hz))
        label = f"{played_hz} Hz" if played_hz == mesh_hz else f"{played_hz} Hz (mesh: {mesh_hz})"
        renderer.AddActor2D(make_text(label, 0.5, 42 / height, 26))
        row, column = divmod(index, columns)
        canvas[row * height : (row + 1) * height, column * width : (column + 1) * width] = draw([renderer, above], width, height)
    note = f"{bank.path.name}   ·   {bank.note}   ·   grey: undeformed; displacements exaggerated"
    canvas[rows * height :] = draw_legend(canvas.shape[1], legend, colours, ("at rest", "largest displacement"), note)
    return canvas


def draw_legend(width, height, colours, ends, note):
    """A bar of all colours between the words of its two ends, and a note below."""
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


# ------------------------------------------------------------------ directivity


BODY_RADIUS = 0.24  # of the sphere around the body, where 1 is the largest radius of the balloon


def make_directions(order):
    """Polar angles from 0 to pi and azimuths all around, in equal steps: 16 a wave of the highest order, enough for a smooth picture."""
    steps = max(180, 8 * order)
    return numpy.linspace(0, math.pi, steps + 1), 2 * math.pi * numpy.arange(2 * steps) / (2 * steps)


def make_balloon(levels, polar, azimuth):
    """Vertices, triangles and colours 0 .. 1 of the surface whose radius and colour are the level over RANGE_DB."""
    radius = numpy.clip(1 + levels / RANGE_DB, 0, 1)
    sine, cosine = numpy.sin(polar)[:, None], numpy.cos(polar)[:, None]
    directions = numpy.stack([sine * numpy.cos(azimuth), sine * numpy.sin(azimuth), cosine * numpy.ones_like(azimuth)], axis=-1)
    rows, columns = radius.shape
    a = numpy.arange(rows * columns).reshape(rows, columns)[:-1]
    b = numpy.roll(a, -1, axis=1)  # the next azimuth; below: the next polar angle
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
    line = make_line(points, 0.5 * width, colour)
    return make_flat(line)


def make_glass(surface, toward):
    """A surface that is seen through where it faces the eye and not where it turns away, coloured by its scalars."""
    normals = to_numpy(surface.GetPointData().GetNormals())
    level = to_numpy(surface.GetPointData().GetScalars())
    facing = numpy.abs(normals @ toward)
    rgba = numpy.empty((len(level), 4))
    for channel in range(3):
        rgba[:, channel] = numpy.interp(level, numpy.linspace(0, 1, len(VIRIDIS)), VIRIDIS[:, channel])
    rgba[:, 3] = 0.46 + 0.50 * (1 - facing) ** 1.5
    surface.GetPointData().SetScalars(to_vtk((255 * rgba).astype(numpy.uint8), deep=True))
    actor = make_actor(surface)
    actor.GetMapper().ScalarVisibilityOn()
    actor.GetMapper().SetColorModeToDirectScalars()
    actor.ForceTranslucentOn()
    return actor


def draw_directivity(bank, air, numbers, up):
    triangles = drop_cavities(bank.vertices, bank.triangles)
    body = (bank.vertices - air.centre_m) * BODY_RADIUS / air.radius_m
    view = View(up, body[numpy.unique(triangles)], 28, 20)
    colours = make_colours()
    columns, width, height = choose_panels(len(numbers), 1.0)
    rows = math.ceil(len(numbers) / columns)
    legend = 84
    canvas = numpy.full((rows * height + legend, columns * width, 3), 255.0)
    for index, number in enumerate(numbers):
        order = int(air.order[number - 1])
        polar, azimuth = make_directions(order)
        levels = calc_levels(air.calc_far(number, polar, azimuth))
        renderer, above = make_renderer(), make_renderer()
        renderer.GradientBackgroundOff()
        renderer.SetBackground(1.0, 1.0, 1.0)
        reach = numpy.full(3, 1.06)
        pixel = view.aim(renderer, -reach, reach, width, height, (30, 30, 110, 20))
        above.SetActiveCamera(renderer.GetActiveCamera())
        above.SetMaximumNumberOfPeels(8)
        for step in range(3):
            radius = 1 - 10 * step / RANGE_DB
            renderer.AddActor(make_polyline(make_ring(view, radius), (0.72, 0.75, 0.80), 1.6 * pixel))
        above.AddActor(make_actor(make_surface(body, triangles), (0.96, 0.42, 0.26)))
        spread = "silent"
        if levels is not None:
            spread = f"spread {calc_levels(air.calc_far(number, *make_equal_areas(order))).std():.1f} dB"
            vertices, faces, level = make_balloon(levels, polar, azimuth)
            above.AddActor(make_glass(make_surface(vertices, faces, level, crease_deg=180.0), view.axes[2]))
        above.ResetCameraClippingRange(-2, 2, -2, 2, -2, 2)
        renderer.AddActor2D(make_text(f"Mode {number}", 0.5, 80 / height, 30, bold=True))
        label = f"{air.freq_hz[number - 1]:,.1f} Hz, order {order}, {spread}"
        renderer.AddActor2D(make_text(label, 0.5, 42 / height, min(24, 1.75 * width / len(label))))
        row, column = divmod(index, columns)
        canvas[row * height : (row + 1) * height, column * width : (column + 1) * width] = draw([renderer, above], width, height)
    note = f"{bank.path.name}   ·   far away, about the body in the middle   ·   rings: 0, -10 and -20 dB"
    canvas[rows * height :] = draw_legend(canvas.shape[1], legend, colours, (f"-{RANGE_DB:.0f} dB", "0 dB, the loudest direction"), note)
    return canvas


# ------------------------------------------------------------------ scene


def decimate(vertices, triangles, max_triangles):
    """A body of at most about `max_triangles` triangles, for copies that are drawn many times."""
    if len(triangles) <= max_triangles:
        return vertices, triangles
    clean = vtk.vtkCleanPolyData()  # also drops the points that no triangle uses
    clean.SetInputData(make_surface(vertices, triangles, crease_deg=180.0))
    clean.SetTolerance(0.0)
    thin = vtk.vtkQuadricDecimation()
    thin.SetInputConnection(clean.GetOutputPort())
    thin.SetTargetReduction(1.0 - max_triangles / len(triangles))
    thin.Update()
    output = thin.GetOutput()
    return to_numpy(output.GetPoints().GetData()).astype(float), to_numpy(output.GetPolys().GetData()).reshape(-1, 4)[:, 1:]


def choose_poses(centres, poses, radius, count):
    """Indices of poses spread evenly over way and rotation, the first and the last among them."""
    way = numpy.linalg.norm(numpy.diff(centres, axis=0), axis=1)
    turn = 2 * numpy.arccos(numpy.clip(numpy.abs(numpy.einsum("ij,ij->i", poses[1:, 4:], poses[:-1, 4:])), 0, 1))
    total = numpy.concatenate([[0.0], numpy.cumsum(way + 0.25 * radius * turn)])
    if total[-1] < 0.05 * radius:
        return [len(poses) - 1]
    count = int(min(count, max(2, round(total[-1] / (0.9 * radius)) + 1)))
    return sorted(
        {int(numpy.searchsorted(total, t)) for t in numpy.linspace(0, total[-1], count)} & set(range(len(poses))) | {len(poses) - 1}
    )


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
    return make_flat(make_actor(data, colours=vtk.vtkLookupTable()))


def blend(colour, other, weight):
    return tuple((1 - weight) * a + weight * b for a, b in zip(colour, other))


def add_legend(renderer, entries, width, height):
    """Entries (text, colour or None) in centred rows at the foot of the picture. Returns the number of rows."""
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
                dot.SetRadius(9 * SUPERSAMPLING)
                dot.SetCenter((x + 12) * SUPERSAMPLING, y * SUPERSAMPLING, 0)
                mapper = vtk.vtkPolyDataMapper2D()
                mapper.SetInputConnection(dot.GetOutputPort())
                actor = vtk.vtkActor2D()
                actor.SetMapper(mapper)
                actor.GetProperty().SetColor(*colour)
                renderer.AddActor2D(actor)
                x += 34
                need -= 34
            renderer.AddActor2D(make_text(text, x / width, y / height, size, centred=False))
            x += need
    return len(rows)


def draw_scene(scene):
    up = scene.up
    bodies, moving_points, fixed_points = [], [], []
    for name, bank, fixed, poses in scene.bodies:
        triangles = drop_cavities(bank.vertices, bank.triangles)
        used = bank.vertices[numpy.unique(triangles)]
        radius = numpy.linalg.norm(used - bank.centre, axis=1).max()
        centres = numpy.array([rotate(p[4:], bank.centre[None])[0] + p[1:4] for p in poses])
        bodies.append((name, bank, fixed, poses, triangles, radius, centres))
        if fixed:
            fixed_points.append(rotate(poses[0][4:], used) + poses[0][1:4])
        else:
            moving_points += [centres - radius, centres + radius]
    # A floor far wider than the action is drawn whole but does not decide the frame.
    points = numpy.vstack(moving_points or fixed_points)
    for shelf in fixed_points:
        low, high = points.min(axis=0), points.max(axis=0)
        room = 1.0 * (high - low).max()
        points = numpy.vstack([points, numpy.clip(shelf, low - room, high + room)])
    if scene.ground is not None:
        foot = points.min(axis=0)
        foot[up] = max(min(scene.ground, foot[up]), foot[up] - (points.max(axis=0) - foot).max())
        points = numpy.vstack([points, foot])
    size = numpy.linalg.norm(points.max(axis=0) - points.min(axis=0))

    view = View(up, points, 24, 13)
    renderer, overlay = make_renderer(), vtk.vtkRenderer()
    make_lights(overlay)
    seen = points @ view.axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    aspect = (high[0] - low[0]) / (high[1] - low[1])
    width, height = (1800, int(min(max(1650 / aspect, 900), 1900))) if aspect > 0.75 else (1600, 1900)
    camera = renderer.GetActiveCamera()
    slope = math.tan(math.radians(11))
    margin = 1.10
    focus = view.axes.T @ numpy.append(0.5 * (low + high)[:2], high[2])
    half = max(0.5 * margin * (high[1] - low[1]), 0.5 * margin * (high[0] - low[0]) * height / width)
    camera.SetViewAngle(22)
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + view.axes[2] * half / slope))
    camera.SetViewUp(*view.axes[1])
    overlay.SetActiveCamera(camera)

    if scene.ground is not None:
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        centre[up] = scene.ground
        renderer.AddActor(make_ground(centre, 1.1 * size, up))
    legend, moving = [], 0
    for name, bank, fixed, poses, triangles, radius, centres in bodies:
        if fixed:
            colour = FIXED[len([entry for entry in legend if entry[2]]) % len(FIXED)]
            legend.append((name, colour, True))
            renderer.AddActor(make_actor(make_surface(rotate(poses[0][4:], bank.vertices) + poses[0][1:4], triangles), colour))
            continue
        colour = MOVING[moving % len(MOVING)]
        moving += 1
        legend.append((name, colour, False))
        chosen = choose_poses(centres, poses, radius, 14)
        vertices, thin = decimate(bank.vertices, triangles, 16000)
        for order, index in enumerate(chosen):
            last = order == len(chosen) - 1
            pale = 0.55 * (1 - order / max(1, len(chosen) - 1))
            surface = make_surface(rotate(poses[index][4:], vertices) + poses[index][1:4], thin)
            renderer.AddActor(make_actor(surface, blend(colour, (1, 1, 1), pale), opacity=1.0 if last else 0.42))
        if len(centres) > 1 and numpy.ptp(centres, axis=0).max() > 0.02 * size:
            step = max(1, len(centres) // 2000)
            overlay.AddActor(make_line(centres[::step], 0.0018 * size, (0.95, 0.75, 0.10), 0.9))
    impulses = scene.impulses[numpy.argsort(-scene.impulses[:, 3])][:600]
    if len(impulses):
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
        overlay.AddActor(make_actor(dots.GetOutput(), (0.80, 0.10, 0.16), opacity=0.85))
        legend.append((f"contacts, largest {largest:.2g} N s", (0.80, 0.10, 0.16), True))
    if moving:
        legend.append(("path of the centre of mass", (0.95, 0.75, 0.10), True))
    times = [poses[:, 0] for _, _, fixed, poses, *_ in bodies if not fixed]
    if times:
        legend.append((f"{min(t[0] for t in times):.2f} s to {max(t[-1] for t in times):.2f} s, paler is earlier", None, False))
    rows = add_legend(overlay, [entry[:2] for entry in legend], width, height)
    # The scene keeps clear of the legend below it.
    band = (36 + 44 * rows) / height
    camera.SetViewAngle(2 * math.degrees(math.atan(slope / (1 - band))))
    camera.SetWindowCenter(0.0, -band)
    renderer.ResetCameraClippingRange()
    return draw([renderer, overlay], width, height)


# ------------------------------------------------------------------ motions


LEGEND = 84  # pixels: height of the bar of colours below


class MotionPainter:
    """Frames of a motion by one view and one scale of colours, so that they can be compared, and make a film."""

    def __init__(self, motion, frames, up, colour, exaggerate, panel_width):
        self.motion, self.colour, self.exaggerate, self.panel_width = motion, colour, exaggerate, panel_width
        self.rest = motion.read_frame(0)[0]
        extent = self.rest.max(axis=0) - self.rest.min(axis=0)
        if not extent.max() > 0:
            raise InputError(f"{motion.path}: its points have no extent; run carillon-simulate again")
        self.view = View(up, self.rest, 28, 34 if extent[up] < 0.25 * max(extent) else 14)
        low, high, self.largest = numpy.full(3, math.inf), numpy.full(3, -math.inf), 0.0
        first, last = low, high  # of the box in the axes of the world
        for frame in frames:  # one at a time: a film may be longer than the memory
            shape, value = self.calc_shape(frame)
            seen = shape @ self.view.axes.T
            low, high = numpy.minimum(low, seen.min(axis=0)), numpy.maximum(high, seen.max(axis=0))
            first, last = numpy.minimum(first, shape.min(axis=0)), numpy.maximum(last, shape.max(axis=0))
            self.largest = max(self.largest, value.max())
        self.low, self.high, self.bounds = low, high, numpy.column_stack([first, last]).ravel()
        aspect = (high[0] - low[0]) / max(high[1] - low[1], 0.05 * (high[0] - low[0]))
        self.panel_height = 2 * round(0.5 * (min(max((panel_width - 90) / aspect, 150), 900) + 100))  # even: films are coded so
        self.colours = make_colours()

    def calc_shape(self, frame):
        """Points with displacements as large as asked for, and what colours them, in m/s or m."""
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
        larger = "" if self.exaggerate == 1 else f"   ·   displacements drawn {self.exaggerate:g} times as large"
        return f"{self.motion.path.name}   ·   colour: {self.colour}{larger}"

    def draw_legend(self, width):
        return draw_legend(width, LEGEND, self.colours, self.describe_ends(), self.describe())


def draw_moments(motion, moments, up, colour, exaggerate):
    """A strip of moments that are evenly spread from the first frame to the last; a single one is the last."""
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
    """All frames as FOLDER/00001.png ...; their number, width and height. What cannot be read is found before the first one is written;
    where the disk refuses, the folder keeps those before it."""
    frames = range(len(motion.times_s))
    painter = MotionPainter(motion, frames, up, colour, exaggerate, 960)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise SystemError_(f"{folder}: cannot be made ({error.strerror}); choose another place") from None
    legend = painter.draw_legend(painter.panel_width)
    for frame in frames:
        write_png(numpy.vstack([painter.paint(frame), legend]), folder / f"{frame + 1:05d}.png")
    return len(frames), painter.panel_width, painter.panel_height + LEGEND


def parse_factor(text):
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0 < factor <= 1e9:
        raise InputError(f"--exaggerate {text}: is no factor; give a number above 0 and up to 1e9, 1 for motion as it is")
    return factor


def parse_moments(text):
    if not (text.isdecimal() and 1 <= int(text) <= 24):
        raise InputError(f"--moments {text}: is no number of pictures; give a whole number from 1 to 24")
    return int(text)


def check_motion_outputs(arguments):
    if arguments.output is None and arguments.frames is None:
        raise InputError("motion: nothing is to be drawn; give -o OUT.png, --frames DIR, or both")
    folder = arguments.frames
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: this is a file; give the name of a folder")
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: this folder is not empty; give an empty folder or a new one")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"{folder.absolute().parent}: there is no such folder; make it first")


# ------------------------------------------------------------------ the program


def parse_modes(text, bank):
    count = len(bank.freq_hz)
    if count == 0:
        raise InputError(f"{bank.path}: the bank has no modes to draw; compute one with a wider band_hz")
    if text is None:
        return list(range(1, min(3, count) + 1))
    numbers = []
    for word in text.split(","):
        if not word.strip().isdigit():
            raise InputError(f"--modes {text}: '{word}' is no mode number; give numbers from 1 to {count}, such as 1,2,3")
        number = int(word)
        if not 1 <= number <= count:
            raise InputError(f"--modes {text}: there is no mode {number} in {bank.path}, which has {count}; give numbers from 1 to {count}")
        numbers.append(number)
    if len(numbers) > 12:
        raise InputError(f"--modes {text}: {len(numbers)} modes are too many for one picture; give at most 12")
    return numbers


def check_output(path):
    if path == STANDARD_OUTPUT:
        if sys.stdout.isatty():
            raise InputError("-: a picture is no text for a terminal; send standard output to a file or another program")
        return
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: pictures are PNG; give the output a name that ends in .png, or - for standard output")
    if path.is_dir():
        raise InputError(f"{path}: this is a folder; give the name of a file")
    if not path.parent.is_dir():
        raise InputError(f"{path.parent}: there is no such folder; make it first")


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise InputError(f"{message}; see {self.prog} --help")


def run():
    parser = Parser(prog="carillon-draw", description="Draws mode banks, simulated scenes and simulations.")
    parser.add_argument("--version", action="version", version=f"carillon-draw {VERSION}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="modes|directivity|scene|motion", parser_class=Parser)
    modes = commands.add_parser("modes", help="modes of a bank as deformed bodies", allow_abbrev=False)
    directivity = commands.add_parser("directivity", help="how loud each mode is in every direction, far away", allow_abbrev=False)
    modes.add_argument("bank", metavar="BANK")
    directivity.add_argument("bank", metavar="BANK", help="with multipoles, as carillon-precompute --radiate writes it")
    for command in (modes, directivity):
        command.add_argument("-o", "--output", required=True, type=pathlib.Path, metavar="OUT.png")
        command.add_argument("--modes", metavar="1,2,3", help="which modes, counted from 1 [the first three]")
        command.add_argument("--up", choices="xyz", default="y", help="the axis of the mesh that points up in the picture [y]")
    scene = commands.add_parser("scene", help="the bodies of a simulated scene along their ways", allow_abbrev=False)
    scene.add_argument("trajectory", metavar="TRAJECTORY.json", help="written by carillon-render --trajectory")
    scene.add_argument("-o", "--output", required=True, type=pathlib.Path, metavar="OUT.png")
    motion_words = commands.add_parser("motion", help="bodies that deform, as carillon-simulate moved them", allow_abbrev=False)
    motion_words.add_argument("motion", metavar="MOTION.vtkhdf", help="written by carillon-simulate --motion")
    motion_words.add_argument("-o", "--output", type=pathlib.Path, metavar="OUT.png", help="pictures of some moments side by side")
    motion_words.add_argument("--moments", default="6", metavar="N", help="how many, from the first frame to the last [6]")
    motion_words.add_argument("--exaggerate", default="1", metavar="F", help="draw displacements from the first frame F times as large [1]")
    motion_words.add_argument("--colour", choices=["speed", "displacement"], default="speed", help="what the colours show [speed]")
    motion_words.add_argument("--up", choices="xyz", default="z", help="the axis that points up in the picture [z]")
    motion_words.add_argument("--frames", type=pathlib.Path, metavar="DIR", help="write every frame to this folder, 00001.png and so on")
    for command in (modes, directivity, scene, motion_words):
        command.add_argument("--result", type=pathlib.Path, metavar="FILE", help="write how the program ended to this file, a JSON object")
    arguments = parser.parse_args()

    if arguments.output is not None:
        check_output(arguments.output)
    if arguments.command == "motion":
        check_motion_outputs(arguments)
        moments, factor = parse_moments(arguments.moments), parse_factor(arguments.exaggerate)
        motion = Motion(arguments.motion)
    elif arguments.command == "scene":
        trajectory = Trajectory(arguments.trajectory)
    else:
        bank = Bank(arguments.bank)
        air = Multipoles(bank) if arguments.command == "directivity" else None
        numbers = parse_modes(arguments.modes, bank)
    open_display()
    load_vtk()
    if arguments.command == "modes":
        image = draw_modes(bank, numbers, "xyz".index(arguments.up))
    elif arguments.command == "directivity":
        image = draw_directivity(bank, air, numbers, "xyz".index(arguments.up))
    elif arguments.command == "motion":
        up = "xyz".index(arguments.up)
        image = draw_moments(motion, moments, up, arguments.colour, factor) if arguments.output is not None else None
        if arguments.frames is not None:
            count, width, height = write_frames(motion, arguments.frames, up, arguments.colour, factor)
            out = sys.stderr if arguments.output == STANDARD_OUTPUT else sys.stdout
            print(f"{printable(arguments.frames)}: {count} frames of {width} x {height} pixels", file=out)
        if image is None:
            return
    else:
        image = draw_scene(trajectory)
    write_png(image, arguments.output)
    piped = arguments.output == STANDARD_OUTPUT
    print(
        f"{'standard output' if piped else printable(arguments.output)}: {image.shape[1]} x {image.shape[0]} pixels",
        file=sys.stderr if piped else sys.stdout,
    )


def find_result_file(words):
    """The file of --result, also of a command line that argparse refuses; None when there is none."""
    for word, following in zip(words, [*words[1:], None]):
        if word == "--result":
            return following
        if word.startswith("--result="):
            return word.partition("=")[2]
    return None


def write_result(file, kind, message):
    """How the program ended, whole or not at all (runtime/base/result.hpp). The exit code says it, too, where this cannot be written."""
    if not file:
        return
    temporary = f"{file}.tmp.{os.getpid()}"
    try:
        with open(temporary, "x", encoding="utf-8") as out:
            json.dump({"kind": kind, **({"message": message} if message else {}), "resumable": False}, out)
        os.replace(temporary, file)
    except OSError:
        pass


def describe_error(error):
    """Kind, message and exit code of an exception."""
    if isinstance(error, InputError):
        return "bad-input", str(error), 2
    if isinstance(error, MemoryError):
        return "memory", "out of memory; close other programs", 4
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return "disk-full", str(error), 4
    if isinstance(error, (SystemError_, ImportError, OSError)):
        return "system", str(error), 4
    # Numbers that nothing above looks for.
    return "bad-input", f"this cannot be drawn ({type(error).__name__}: {error}); run carillon-bank check on its banks", 2


def main():
    file = find_result_file(sys.argv[1:])
    try:
        run()
    except Exception as error:
        kind, message, code = describe_error(error)
        print(f"carillon-draw: {printable(message)}", file=sys.stderr)
        write_result(file, kind, message)
        return code
    write_result(file, "done", "")
    return 0


if __name__ == "__main__":
    sys.exit(main())
