"""Python documents as JSON for the programs."""
import json
import os

import numpy

from ._carillon import InputError


def write_json(document: dict, what: str) -> str:
    """A document as text with one value per line, so messages can name a line. numpy values become numbers and lists."""

    def to_plain(value):
        if isinstance(value, (numpy.ndarray, numpy.generic)):
            return value.tolist()
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        raise InputError(f"{what}: JSON has no type {type(value).__name__}; give numbers, texts, lists and dicts")

    try:
        return json.dumps(document, indent=1, allow_nan=False, default=to_plain)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{what}: {error}; give finite numbers") from None
