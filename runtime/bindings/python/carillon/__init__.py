"""Carillon in Python: mode banks as numpy arrays, jobs, scenes, and a block-based synthesiser.

    import carillon
    bank = carillon.solve({"body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012}, "material": "steel"})
    print(bank.frequency_hz[:5], bank.t60_s[:5])

Units are SI and part of the names. Errors are InputError (a ValueError), SolveError (a RuntimeError) and SystemError (an OSError), with
the same messages as the programs. docs/howto/embed-the-runtime.md
"""
import os as _os
import typing as _typing

import numpy as _numpy

from ._carillon import Bank, InputError, SolveError, Synthesiser, SystemError, Touches, __version__, materials
from ._carillon import World as _World
from ._carillon import render as _render
from .documents import write_json as _write_json
from .solving import solve

__all__ = [
    "Bank",
    "InputError",
    "SolveError",
    "Sound",
    "Synthesiser",
    "SystemError",
    "Touches",
    "World",
    "__version__",
    "materials",
    "render",
    "solve",
]


class Sound(_typing.NamedTuple):
    """The sound of a scene: samples_pa (frames, channels) float32 [Pa], rate_hz."""

    samples_pa: _numpy.ndarray
    rate_hz: int


def render(scene: _typing.Union[dict, str, _os.PathLike], *, rate_hz: _typing.Optional[int] = None) -> Sound:
    """Renders a scene like carillon-render, without its gain: (samples_pa, rate_hz).

    scene: a scene file, or a scene as a dict (docs/howto/scene-files.md) with paths relative to the current directory.
    rate_hz: 8000 to 192000, overrides the scene's. Channels: two ears, or the scene's microphones.
    Raises InputError, SolveError or SystemError. Releases the GIL; Ctrl-C ends it.
    """
    if isinstance(scene, dict):
        return Sound(*_render(_os.path.join(_os.getcwd(), "scene"), _write_json(scene, "scene"), rate_hz))
    return Sound(*_render(_os.fspath(scene), "", rate_hz))


class World(_World):
    """A scene that is simulated and played step by step, and whose bodies are pushed, held, added and removed meanwhile.

        world = carillon.World("scene.json")
        world.push("ball", [0, 0, -0.2])   # N s, at its centre of mass
        pressure = world.advance(0.5)      # the next half second: (frames, channels) float32 [Pa]

    scene: a scene file, or a scene as a dict with paths relative to the current directory; its duration_s is not used.
    look_ahead_s: lead of the physics over the sound, 0.02 to 10: actions take effect that much later.
    Raises InputError for what cannot be used or done, and SolveError if the physics fails.
    """

    def __init__(self, scene: _typing.Union[dict, str, _os.PathLike], *, look_ahead_s: float = 0.05) -> None:
        if isinstance(scene, dict):
            super().__init__(_os.path.join(_os.getcwd(), "scene"), _write_json(scene, "scene"), look_ahead_s)
        else:
            super().__init__(_os.fspath(scene), "", look_ahead_s)

    def add_body(self, body: dict) -> str:
        """Puts a new body into the world: a dict with the keys of a body in a scene file. Returns its name.

        Paths are relative to the scene. The first body of a bank reads it, which blocks until it is done.
        """
        return super().add_body(_write_json(body, "body"))
