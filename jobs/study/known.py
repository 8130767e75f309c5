"""Reference frequencies from other sources than finite elements: known.csv."""
import csv
import dataclasses
import io
import pkgutil


@dataclasses.dataclass(frozen=True)
class Truth:
    """Sorted frequencies, repeated by multiplicity, with relative uncertainties."""

    freq_hz: tuple
    uncertainty: tuple
    source: str


def read_known():
    """{body: Truth}."""
    text = pkgutil.get_data(__name__, "known.csv").decode()
    rows = {}
    for row in csv.DictReader(line for line in io.StringIO(text) if not line.startswith("#")):
        rows.setdefault(row["body"], []).append(row)
    known = {}
    for body, lines in rows.items():
        modes = sorted(
            (float(row["frequency_hz"]), float(row["relative_uncertainty"])) for row in lines for _ in range(int(row["multiplicity"]))
        )
        known[body] = Truth(tuple(f for f, _ in modes), tuple(u for _, u in modes), lines[0]["source"])
    return known
