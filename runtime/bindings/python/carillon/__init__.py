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
