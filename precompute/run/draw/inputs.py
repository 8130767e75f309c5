"""Input files of carillon-draw, checked."""
import hashlib
import io
import json
import math
import os
import pathlib
import subprocess
import sys

import h5py
import numpy

from common import InputError
from far_field import calc_far_pattern

MAX_ORDER = 120  # of multipoles (runtime/bank/multipoles.hpp)


def unpack(path):
    """The bytes of a packed bank as a plain one, by carillon-bank, which is next to this program."""
    program = pathlib.Path(sys.argv[0]).resolve().parent / "carillon-bank"
    try:
        done = subprocess.run([program, "unpack", path, "-"], capture_output=True)
    except OSError as error:
        raise InputError(f"{path}: is a packed bank, and {program} does not run ({error.strerror}); install it there") from None
    if done.returncode != 0:
        raise InputError(done.stderr.decode(errors="replace").strip().removeprefix("carillon-bank: "))
    return done.stdout


class Bank:
    """The drawable part of a mode bank: surface, frequencies, modes on demand. Its checksum (docs/bank-format.md) is verified before HDF5
    reads it."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        try:
            data = self.path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a mode bank") from None
        first = data[:80].split(b"\n")[0]
        if not first.startswith(b"CARILLON BANK "):
            raise InputError(f"{path}: not a mode bank (it does not begin with 'CARILLON BANK'); make one with carillon-precompute")
        version = first[14:].decode("ascii", "replace")
        self.unpacked = unpack(self.path) if version.startswith("2.") else None
        if version.split(".")[0] not in ("1", "2"):
            raise InputError(f"{path}: bank version {version} is newer than this program reads; use a newer carillon-draw")
        if not self.unpacked and (len(data) < 4096 or hashlib.sha256(data[:4032] + data[4096:]).hexdigest().encode() != data[4032:4096]):
            raise InputError(f"{path}: the bank is truncated or was changed (SHA-256 mismatch); copy or compute it again")
        del data
        try:
            with self.open() as file:
                self.vertices = file["mesh/vertices"][:]
                self.triangles = file["mesh/triangles"][:]
                self.mesh_hz = file["modes/frequency_hz"][:]
                # Playback frequencies: in air, else corrected, else of the mesh.
                played = (key for key in ("radiation/freq_hz", "modes/corrected_frequency_hz", "modes/frequency_hz") if key in file)
                self.freq_hz = file[next(played)][:]
                self.centre = file["rigid/centre_m"][:]
                self.note = f"{file['solve/element'][()].decode()}, {int(file['solve/nodes'][()]):,} nodes"
                self.shape_extent = file["modes/shape"].shape
        except (OSError, KeyError, TypeError, ValueError, AttributeError, OverflowError, RuntimeError, MemoryError) as error:
            raise InputError(f"{path}: the bank cannot be read ({error}); run carillon-bank check on it") from None
        self.check()

    def open(self):
        return h5py.File(io.BytesIO(self.unpacked) if self.unpacked else self.path, "r")

    def check(self):
        """InputError for inconsistent arrays, non-finite numbers or invalid triangles."""

        def refuse(what):
            raise InputError(f"{self.path}: {what}; run carillon-bank check on it")

        numbers = [self.vertices, self.freq_hz, self.mesh_hz, self.centre]
        if any(not numpy.issubdtype(values.dtype, numpy.number) for values in [*numbers, self.triangles]):
            refuse("mesh, frequencies or centre are not numbers")
        if (
            self.vertices.ndim != 2
            or self.vertices.shape[1] != 3
            or self.triangles.ndim != 2
            or self.triangles.shape[1] != 3
            or not len(self.triangles)
        ):
            refuse("the surface is not a list of vertices and triangles")
        if (
            self.freq_hz.ndim != 1
            or self.mesh_hz.shape != self.freq_hz.shape
            or self.shape_extent != (len(self.vertices), len(self.freq_hz), 3)
        ):
            refuse("frequencies, shapes and vertices do not fit each other")
        if not all(numpy.isfinite(values).all() for values in numbers) or numpy.abs(self.vertices).max() > 1e12:
            refuse("a coordinate or a frequency is not finite")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            refuse("a triangle refers to a missing vertex")
        if not numpy.ptp(self.vertices, axis=0).max() > 0:
            refuse("the surface has no extent")

    def read_mode(self, number):
        """The displacement of mode `number`, counted from 1, at every surface vertex; any scale."""
        try:
            with self.open() as file:
                steps, scale = file["modes/shape"][:, number - 1, :].astype(float), float(file["modes/shape_scale"][number - 1])
        except (OSError, KeyError, TypeError, ValueError, IndexError, RuntimeError) as error:
            raise InputError(f"{self.path}: mode {number} cannot be read ({error}); run carillon-bank check on it") from None
        if not numpy.isfinite(steps).all() or not math.isfinite(scale):
            raise InputError(f"{self.path}: mode {number} has a displacement that is not finite; run carillon-bank check on it")
        largest = numpy.abs(steps).max(initial=0.0)
        return steps / largest if largest > 0 and scale != 0 else numpy.zeros_like(steps)


class Sensitivities:
    """Densities of a bank's lowest modes over its sites (docs/bank-format.md)."""

    def __init__(self, bank):
        try:
            with bank.open() as file:
                if "sensitivity" not in file:
                    raise InputError(f'{bank.path}: has no sensitivities; compute it with "sensitivities": 30 in the job')
                group = file["sensitivity"]
                self.count = len(group["by_parameter"])
                self.density = group["density"][:, : self.count] * group["scale"][: self.count]
                self.vertex, self.normal, self.doubtful = (group[name][:] for name in ("vertex", "normal", "doubtful"))
        except (OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"{bank.path}: the sensitivities cannot be read ({error}); run carillon-bank check on it") from None
        sites = len(self.vertex)
        if self.density.shape != (sites, self.count) or self.normal.shape != (sites, 3) or self.doubtful.shape != (sites,):
            raise InputError(f"{bank.path}: the arrays of sensitivity/ disagree; run carillon-bank check on it")
        if not sites or self.vertex.min() < 0 or self.vertex.max() >= len(bank.vertices):
            raise InputError(f"{bank.path}: a site is of no vertex; run carillon-bank check on it")


class Multipoles:
    """The group radiation/ of a bank: one order and (order + 1)^2 finite coefficients per mode."""

    def __init__(self, bank):
        path = bank.path
        try:
            with bank.open() as file:
                if "radiation" not in file:
                    raise InputError(
                        f"{path}: the bank has no multipoles; add them with"
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
            refuse("a multipole is not finite")
        if not (self.radius_m > 0 and self.sound_speed_ms > 0 and (self.freq_hz > 0).all()):
            refuse("radius, frequencies and speed of sound must be above 0")
        self.first = numpy.concatenate([[0], numpy.cumsum((self.order + 1) ** 2)])
        # Levels are relative to the mode's largest: only a zero scale matters.
        self.coefficient = (steps[:, 0] + 1j * steps[:, 1]) * numpy.repeat(scale > 0, (self.order + 1) ** 2)

    def calc_far(self, number, polar, azimuth):
        """Far pressure of mode `number`, counted from 1, in the directions polar (from z) x azimuth (from x to y) of the mesh's frame;
        complex, any scale."""
        order = int(self.order[number - 1])
        waves = 2 * math.pi * self.freq_hz[number - 1] / self.sound_speed_ms * self.radius_m
        coefficient = self.coefficient[self.first[number - 1] : self.first[number]]
        return calc_far_pattern(coefficient, order, waves, polar, azimuth)


class Trajectory:
    """A rendered scene: bodies with their poses, the ground, impulses (written by carillon-render --trajectory)."""

    def __init__(self, path):
        path = pathlib.Path(path)
        try:
            data = json.loads(path.read_text())
        except RecursionError:
            raise InputError(f"{path}: brackets are nested too deep; make it with carillon-render --trajectory") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); make it with carillon-render --trajectory") from None
        except ValueError as error:
            raise InputError(f"{path}: not JSON ({error}); make it with carillon-render --trajectory") from None
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
                raise InputError(f"{path}: no bodies; render a scene with bodies")
            self.ground = (data.get("ground") or {}).get("height_m")
            impulses = [(*i["world_m"], i["impulse_n_s"]) for i in data.get("impulses", [])]
            self.impulses = numpy.array(impulses, dtype=float).reshape(-1, 4)
            if not numpy.isfinite(self.impulses).all() or (self.ground is not None and not math.isfinite(self.ground)):
                raise InputError(f"{path}: the ground or an impulse is not finite; render the scene again")
            if any(numpy.abs(poses).max() > 1e12 for _, _, _, poses in self.bodies):
                raise InputError(f"{path}: a body is too far away; render the scene again")
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
            raise InputError(
                f"{path}: not a trajectory ({type(error).__name__}: {error}); make it with carillon-render --trajectory"
            ) from None


class Motion:
    """Moving surfaces written by carillon-simulate: UnstructuredGrid of VTKHDF with steps, all triangles.

    times_s: (frames); triangles: (t, 3) into the points, the same in all frames; read_frame(): points (n, 3) [m] and speeds (n) [m/s].
    InputError for an invalid or truncated file.
    """

    def __init__(self, path):
        self.path = pathlib.Path(path)
        try:
            self.file = h5py.File(self.path, "r")
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else "not an HDF5 file, or truncated"
            raise InputError(f"{path}: this motion cannot be read ({why}); make it with carillon-simulate --motion") from None
        try:
            root = self.file["VTKHDF"] if "VTKHDF" in self.file else None
            if root is None or "Steps" not in root or "speed" not in root.get("PointData", ()):
                raise ValueError("no VTKHDF steps with speeds")
            if (root["Types"][:] != 5).any():  # VTK_TRIANGLE
                raise ValueError("its cells are not triangles")
            self.times_s = root["Steps/Values"][:].astype(float)
            self.triangles = root["Connectivity"][:].reshape(-1, 3)
            self.count = int(root["NumberOfPoints"][0])
            if (root["NumberOfPoints"][:] != self.count).any():
                raise ValueError("the number of points changes")
            self.points, self.speed = root["Points"], root["PointData/speed"]
            shape = (len(self.times_s) * self.count, 3)
            if not (self.points.shape == shape and self.speed.shape == shape[:1]):
                raise ValueError("points and steps do not match")
            if not (len(self.times_s) and len(self.triangles) and numpy.isfinite(self.times_s).all()):
                raise ValueError("it has no frames or triangles")
            if self.triangles.min() < 0 or self.triangles.max() >= self.count:
                raise ValueError("a triangle refers to a missing point")
        except (KeyError, ValueError, TypeError, IndexError, AttributeError, OSError) as error:
            why = str(error).strip("\"'")
            raise InputError(f"{path}: not a motion of carillon-simulate ({why}); make it with carillon-simulate --motion") from None

    def read_frame(self, frame):
        rows = slice(frame * self.count, (frame + 1) * self.count)
        try:
            place, speed = self.points[rows].astype(float), self.speed[rows].astype(float)
        except OSError:
            raise InputError(f"{self.path}: frame {frame + 1} cannot be read; the file is damaged, run carillon-simulate again") from None
        if not (numpy.abs(place).max() <= 1e12 and numpy.isfinite(speed).all()):
            raise InputError(f"{self.path}: frame {frame + 1} is not finite; run carillon-simulate again")
        return place, speed
