"""Carillon in Python: banks as numpy arrays, jobs solved, scenes rendered, a synthesiser to play block by block.

    import carillon
    bank = carillon.solve({"body": {"shape": "bar", "length_m": 0.3, "width_m": 0.03, "thickness_m": 0.012}, "material": "steel"})
    print(bank.frequency_hz[:5], bank.t60_s[:5])

Units are SI and stand in the names. Errors are InputError (a ValueError), SolveError (a RuntimeError) and SystemError (an OSError), with
the message that the programs print. docs/howto/python.md
"""
import os as _os
import typing as _typing

import numpy as _numpy

from ._carillon import Bank, InputError, SolveError, Synthesiser, SystemError, __version__, materials
from ._carillon import render as _render
from .documents import write_json as _write_json
from .solving import solve

__all__ = ["Bank", "InputError", "SolveError", "Sound", "Synthesiser", "SystemError", "__version__", "materials", "render", "solve"]


class Sound(_typing.NamedTuple):
    """The sound of a scene: samples_pa (frames, channels) float32 [Pa], rate_hz."""

    samples_pa: _numpy.ndarray
    rate_hz: int


def render(scene: _typing.Union[dict, str, _os.PathLike], *, rate_hz: _typing.Optional[int] = None) -> Sound:
    """The sound of a scene, as carillon-render makes it, before its gain: (samples_pa, rate_hz).

    scene: the file of a scene, or the scene itself as a dict (docs/howto/scene-files.md), whose relative paths start here.
    rate_hz: 8000 to 192000, in place of the scene's. Two ears, or a channel for each of its microphones.
    Raises InputError, SolveError or SystemError. Other threads run meanwhile; Ctrl-C ends it.
    """
    if isinstance(scene, dict):
        return Sound(*_render(_os.path.join(_os.getcwd(), "scene"), _write_json(scene, "scene"), rate_hz))
    return Sound(*_render(_os.fspath(scene), "", rate_hz))
