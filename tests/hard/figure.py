"""The figure of a hard case: held to its bound, and written down for the table of docs/reports/stability.md. The same as figure.hpp."""
import json
import math
import os
import pathlib


class Missed(AssertionError):
    """A figure beyond its bound, or a message without a word that it owes."""


def record(case, part, value, bound, ranks):
    folder = os.environ.get("CARILLON_FIGURES")
    if not folder:
        return
    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    line = json.dumps({"case": case, "part": part, "value": value, "bound": bound, "ranks": ranks}) + "\n"
    with open(pathlib.Path(folder) / f"{case}.jsonl", "a") as out:
        out.write(line)


def hold(case, value, bound, part="", ranks=1):
    """Holds value to at most bound (NaN and infinity fail) and records it; raises Missed. `ranks`: on how many the figure was made."""
    value = float(value)
    record(case, part, value if math.isfinite(value) else None, bound, ranks)
    if not (math.isfinite(value) and value <= bound):
        raise Missed(f"{case} {part}: {value:g} is not at most {bound:g}")


def hold_refusal(case, message, words, part="", ranks=1):
    """For refusals and warnings: `message` must contain all of `words` (file, place, remedy). Counts as the figure "refused"."""
    record(case, part, "refused", "refused", ranks)
    for word in words:
        if word not in message:
            raise Missed(f'{case} {part}: no "{word}" in: {message}')
