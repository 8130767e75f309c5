"""Types of the compiled part. Units are SI and part of the names; (m), (V, 3) ... are shapes of arrays."""
import os
from typing import Any, Dict, Iterable, List, Optional, Sequence, Tuple, Union

import numpy
import numpy.typing

File = Union[str, os.PathLike]
Vector = Sequence[float]
Doubles = numpy.typing.NDArray[numpy.float64]
Floats = numpy.typing.NDArray[numpy.float32]
Integers = numpy.typing.NDArray[numpy.int32]
Booleans = numpy.typing.NDArray[numpy.bool_]

__version__: str

class InputError(ValueError): ...
class SolveError(RuntimeError): ...
class SystemError(OSError): ...

class Bank:
    """Mode bank of a body: m modes, V vertices and T triangles of its surface."""

    def __init__(self, file: File, frequencies: str = "corrected") -> None: ...
    @staticmethod
    def parse(data: bytes, frequencies: str = "corrected") -> Bank: ...
    @property
    def name(self) -> str: ...
    @property
    def vertices_m(self) -> Doubles: ...  # (V, 3)
    @property
    def triangles(self) -> numpy.typing.NDArray[numpy.int32]: ...  # (T, 3)
    @property
    def frequency_hz(self) -> Doubles: ...  # (m)
    @property
    def decay_per_s(self) -> Doubles: ...  # (m)
    @property
    def t60_s(self) -> Doubles: ...  # (m)
    @property
    def radiation_gain(self) -> Doubles: ...  # (m), Pa at 1 m for unit modal velocity
    @property
    def residual(self) -> Doubles: ...  # (m)
    @property
    def error_cents(self) -> Doubles: ...  # (m)
    @property
    def facet_error_cents(self) -> Doubles: ...  # (m)
    @property
    def algebraic_error_cents(self) -> Doubles: ...  # (m)
    @property
    def shape_steps(self) -> numpy.typing.NDArray[numpy.int16]: ...  # (V, m, 3)
    @property
    def shape_scale(self) -> Doubles: ...  # (m), kg^-1/2
    def shapes(self, modes: Union[None, int, slice, Iterable[int]] = None) -> Doubles: ...  # (V, 3) or (V, k, 3), kg^-1/2
    def nearest(self, point_m: Vector) -> Tuple[int, Doubles, Doubles, float]: ...
    def edited(self, *, material: Optional[str] = None, density: float = 1.0, stiffness: float = 1.0, size: float = 1.0) -> Bank: ...
    def write(self, file: File) -> None: ...
    @property
    def material(self) -> Dict[str, Any]: ...
    @property
    def provenance(self) -> Dict[str, Any]: ...
    @property
    def supports(self) -> Dict[str, Any]: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def volume_m3(self) -> float: ...
    @property
    def centre_m(self) -> Doubles: ...  # (3)
    @property
    def inertia_kg_m2(self) -> Doubles: ...  # (3, 3)
    @property
    def band_hz(self) -> Tuple[float, float]: ...
    @property
    def complete(self) -> bool: ...
    @property
    def element(self) -> str: ...
    def __len__(self) -> int: ...

class Synthesiser:
    """A synthesiser with struck bodies and microphones."""

    def __init__(
        self,
        rate_hz: float = 48000.0,
        microphones_m: Sequence[Vector] = ...,
        listener_m: Vector = ...,
        max_bodies: int = 64,
        head_radius_m: float | None = None,
        floor_reflection: float | None = None,
        floor_height_m: float = 0.0,
    ) -> None: ...
    def add_body(
        self, bank: Bank, position_m: Vector = ..., rotation: Vector = ..., radiation: str = "auto", effects: Optional[List[str]] = None
    ) -> int: ...
    def swap_bank(self, body: int, bank: Bank, radiation: str = "auto") -> None: ...
    def remove_body(self, body: int) -> None: ...
    def strike(
        self,
        body: int,
        impulse_n_s: Vector,
        *,
        point_m: Optional[Vector] = None,
        triangle: Optional[int] = None,
        duration_s: float = 1e-3,
        time_s: Optional[float] = None,
    ) -> None: ...
    def move(
        self, body: int, position_m: Vector, velocity_m_s: Vector = ..., rotation: Vector = ..., time_s: Optional[float] = None
    ) -> None: ...
    def add_sensor(
        self,
        body: int,
        direction: Vector,
        *,
        point_m: Optional[Vector] = None,
        triangle: Optional[int] = None,
        quantity: str = "acceleration",
        rate_hz: Optional[float] = None,
        held: bool = False,
        buffer_s: float = 60.0,
    ) -> int: ...
    def read_sensor(self, sensor: int) -> Doubles: ...  # (n), SI units
    def sensor_begin_s(self, sensor: int) -> float: ...
    def sensor_lost(self, sensor: int) -> int: ...
    def process(self, frames: int) -> Floats: ...  # (frames, channels), Pa
    @property
    def rate_hz(self) -> float: ...
    @property
    def channels(self) -> int: ...
    @property
    def time_s(self) -> float: ...
    @property
    def counters(self) -> Dict[str, int]: ...

class Touches:
    """What a physics engine computes in a step, turned into events of a synthesiser."""

    def __init__(
        self,
        synthesiser: Optional[Synthesiser] = None,
        gravity: Vector = ...,
        *,
        compliant: bool = False,
        early: bool = False,
        points_after: bool = False,
        max_points: int = 4096,
        max_impacts: int = 8,
        slowest_m_s: float = 0.0,
        longest_hit_s: float = 0.06,
        ground_restitution: float = 0.5,
        ground_friction: float = 0.5,
    ) -> None: ...
    def add(
        self,
        bank: Optional[Bank] = None,
        body: int = -1,
        name: str = "",
        fixed: bool = False,
        restitution: float = 0.5,
        friction: float = 0.4,
        mass_kg: float = 0.0,
        inertia_kg_m2: Optional[Sequence[float]] = None,
        young_pa: float = 0.0,
        poisson: float = 0.0,
        density_kg_m3: float = 0.0,
        size_m: float = 0.0,
    ) -> int: ...
    def remove(self, index: int) -> None: ...
    def start(
        self, time_s: float, position: Doubles, rotation: Doubles, velocity: Optional[Doubles] = None, spin: Optional[Doubles] = None
    ) -> None: ...
    def step(
        self,
        time_s: float,
        position: Doubles,
        rotation: Doubles,
        velocity: Doubles,
        spin: Doubles,
        pair: Optional[Integers] = None,
        point: Optional[Doubles] = None,
        normal: Optional[Doubles] = None,
        gap: Optional[Doubles] = None,
        impulse: Optional[Doubles] = None,
        friction: Optional[Doubles] = None,
        curvature: Optional[Doubles] = None,
        asleep: Optional[Booleans] = None,
        teleported: Optional[Booleans] = None,
        jointed: Optional[Booleans] = None,
    ) -> bool: ...
    def take_lines(self) -> str: ...
    @property
    def mark_s(self) -> float: ...
    @property
    def counters(self) -> Dict[str, float]: ...

class World:
    """A scene that is simulated and played by calls. Bodies by name, points in the world [m]."""

    def __init__(self, file: File, text: str = "", look_ahead_s: float = 0.05) -> None: ...
    def advance(self, seconds: float) -> Floats: ...  # (frames, channels), Pa
    def push(self, body: str, impulse_n_s: Vector, at_m: Optional[Vector] = None) -> None: ...
    def grab(
        self, body: str, at_m: Optional[Vector] = None, frequency_hz: float = 4.0, damping_ratio: float = 1.0, max_force_n: float = 0.0
    ) -> None: ...
    def drag(self, body: str, target_m: Vector, over_s: float = 0.02) -> None: ...
    def release(self, body: str) -> None: ...
    def add(
        self,
        body: str,
        position_m: Vector,
        rotation: Optional[Vector] = None,
        velocity_m_s: Vector = ...,
        angular_velocity_rad_s: Vector = ...,
    ) -> None: ...
    def add_body(self, text: str) -> str: ...
    def remove(self, body: str) -> None: ...
    def pose(self, body: str) -> Tuple[List[float], List[float]]: ...
    def centre(self, body: str) -> List[float]: ...
    def is_absent(self, body: str) -> bool: ...
    @property
    def bodies(self) -> List[str]: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def time_s(self) -> float: ...

def materials() -> Dict[str, Dict[str, Any]]: ...
def render(file: File, text: str = "", rate_hz: Optional[int] = None) -> Tuple[Floats, int]: ...
def find_bank(file: File, text: str = "") -> Optional[os.PathLike]: ...
