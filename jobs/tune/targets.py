"""Wishes of a tuning: frequencies, the modes that are to have them, and modes that must stay away."""
import dataclasses
import math
import re

import numpy

from errors import InputError

NOTES = {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}
A4_HZ, A4_KEY = 440.0, 69
PAIR_CENTS = 3.0  # modes this close are one pair where both are of one kind
# Partials of a minor-third bell against its prime, by kind of mode: Fletcher and Rossing, The Physics of Musical Instruments, ch. 21.
BELLS = {
    "minor": (("n=2", 0.5), ("n=2 2", 1.0), ("n=3", 1.2), ("n=3 2", 1.5), ("n=4", 2.0)),
    "major": (("n=2", 0.5), ("n=2 2", 1.0), ("n=3", 1.25), ("n=3 2", 1.5), ("n=4", 2.0)),
}


@dataclasses.dataclass(frozen=True)
class Wish:
    """mode: a kind with a number, 'bending 1', 'n=2', 'mode 3'; empty: the nearest."""

    mode: str
    hz: float
    weight: float = 1.0


def read_hz(text):
    """Hz of '440', '440Hz' or a note like 'C5', 'F#3', 'Bb2' (A4 = 440 Hz). InputError."""
    word = text.strip()
    if note := re.fullmatch(r"([A-Ga-g])([#b]?)(-?\d)", word):
        letter, sign, octave = note.groups()
        key = 12 * (int(octave) + 1) + NOTES[letter.upper()] + {"#": 1, "b": -1, "": 0}[sign]
        return A4_HZ * 2 ** ((key - A4_KEY) / 12)
    try:
        hz = float(word.removesuffix("Hz"))
    except ValueError:
        hz = 0.0
    if not 0 < hz < 1e6:
        raise InputError(f"{text!r}: give a frequency like 440 or a note like C5")
    return hz


def read_numbers(text, read):
    """[(value, weight)] of 'value' or 'value:weight', separated by commas. InputError."""
    pairs = []
    for word in text.split(","):
        value, _, weight = word.partition(":")
        try:
            pairs.append((read(value), float(weight or 1)))
        except ValueError:
            raise InputError(f"{word!r}: give numbers like 1,4,10 or with weights like 1,4,10:0.5") from None
        if not (math.isfinite(pairs[-1][1]) and pairs[-1][1] > 0 and math.isfinite(pairs[-1][0]) and pairs[-1][0] > 0):
            raise InputError(f"{word!r}: values and weights are above 0")
    return pairs


def read_wishes(options, default=""):
    """The Wishes of a command line. default: kind of the modes in ascending order if --modes does not name them."""
    if sum(bool(x) for x in (options.partials, options.hz, options.bell)) != 1:
        raise InputError("give one of --partials, --hz and --bell")
    if options.bell:
        if not options.fundamental:
            raise InputError("--bell needs --fundamental, the frequency or note of the prime")
        pitch = read_hz(options.fundamental)
        return [Wish(mode, ratio * pitch) for mode, ratio in BELLS[options.bell]]
    if options.partials:
        if not options.fundamental:
            raise InputError("--partials needs --fundamental, a frequency or note")
        first = read_hz(options.fundamental)
        wanted = [(first * ratio, weight) for ratio, weight in read_numbers(options.partials, float)]
    else:
        wanted = read_numbers(options.hz, read_hz)
    modes = [word.strip() for word in options.modes.split(",")] if options.modes else []
    if modes and len(modes) != len(wanted):
        raise InputError(f"--modes names {len(modes)} modes for {len(wanted)} frequencies")
    if not modes:
        modes = [f"{default} {k}" if default else "" for k in range(1, len(wanted) + 1)]
    return [Wish(mode, *want) for mode, want in zip(modes, wanted)]


def find_kind(solution, kind):
    """Modes of a kind, ascending, in groups of one or, if they are a pair, two. 'n=2': two nodal diameters."""
    head = f"{kind[2:]} diameter" if kind.startswith("n=") else kind
    of_kind = [m for m, name in enumerate(solution.kinds) if name.split(",")[0].removesuffix("s") == head]
    groups = []
    for m in of_kind:
        if kind.startswith("n=") and groups and len(groups[-1]) == 1 and to_cents(solution, m, groups[-1][0]) < PAIR_CENTS:
            groups[-1].append(m)
        else:
            groups.append([m])
    return groups


def list_kinds(solution):
    names = ", ".join(dict.fromkeys(name.split(",")[0] for name in solution.kinds if name.strip("-")))
    return f"it has: {names}" if names else "their kinds are unknown: name them by numbers, like mode 1"


def to_cents(solution, mode, other):
    return 1200 * math.log2(solution.corrected_hz[mode] / solution.corrected_hz[other])


def find_groups(solution, wishes):
    """[modes] for each Wish: one mode, or two of one pair. InputError for modes that are not there."""
    groups = []
    for wish in wishes:
        kind, number = (re.fullmatch(r"(.*?)(?: (\d+))?", wish.mode)).groups()
        if not wish.mode:
            away = numpy.abs(numpy.log2(solution.corrected_hz / wish.hz))
            away[[m for group in groups for m in group]] = numpy.inf
            group = [int(away.argmin())]
            pair = next((g for g in find_pairs(solution) if group[0] in g), group)
            groups.append(pair)
            continue
        if number and int(number) < 1:
            raise InputError(f"{wish.mode}: modes are numbered from 1")
        found = [[m] for m in range(len(solution.kinds))] if kind == "mode" else find_kind(solution, kind)
        if len(found) < int(number or 1):
            raise InputError(f"{wish.mode}: not among the lowest {len(solution.kinds)} modes of this body; {list_kinds(solution)}")
        groups.append(found[int(number or 1) - 1])
    taken = [m for group in groups for m in group]
    if len(set(taken)) != len(taken):
        raise InputError("two wishes mean one mode; name the modes with --modes")
    return groups


def find_pairs(solution, within_cents=PAIR_CENTS):
    """[[i, j]] neighbours within so many cents that are of one kind, each mode once."""
    pairs, m = [], 0
    while m + 1 < len(solution.kinds):
        if to_cents(solution, m + 1, m) < within_cents and solution.kinds[m] == solution.kinds[m + 1]:
            pairs.append([m, m + 1])
            m += 1
        m += 1
    return pairs


@dataclasses.dataclass(frozen=True)
class Apart:
    """Modes of a kind that stay so far from every wish."""

    kind: str
    cents: float


def read_apart(text):
    kind, _, cents = text.partition(":")
    try:
        value = float(cents)
    except ValueError:
        value = -1.0
    if not (kind.strip() and 0 < value < 1200):
        raise InputError(f"--apart {text!r}: give a kind and cents, like torsion:50")
    return Apart(kind.strip(), value)
