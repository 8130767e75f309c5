"""Options with units."""
import argparse
import math
import re

MASS_UNITS = {"kg": 1.0, "g": 1e-3}
LENGTH_UNITS = {"mm": 1e-3, "um": 1e-6, "m": 1.0}


def read_quantity(units):
    """Type of an option: a number with one of the units, in SI."""

    def read(text):
        match = re.fullmatch(r"([0-9.]+(?:e-?[0-9]+)?)\s*([a-z]+)", text)
        try:
            value = float(match[1]) * units[match[2]]
        except (TypeError, KeyError, ValueError):
            value = 0.0
        if not (math.isfinite(value) and value > 0):
            raise argparse.ArgumentTypeError(f"{text!r}: give a number above 0 with its unit, {' or '.join(units)}, as 0.2{[*units][0]}")
        return value

    return read
