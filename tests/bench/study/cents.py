"""Frequency errors in cents, reference values, convergence rates and the cost of an accuracy."""
import dataclasses
import math
import statistics

import scaling
from known import Truth
from measuring import to_cents


@dataclasses.dataclass
class Point:
    """Cost and error of one mesh of one kind. cents: one per mode, k-th frequency against k-th, multiplicities included."""

    kind: str
    nodes: int
    unknowns: int
    elements: int
    cpu_s: float
    spread: float | None  # None: one run
    cents: list

    @property
    def first(self):
        return abs(self.cents[0])

    @property
    def median(self):
        return statistics.median(map(abs, self.cents))

    @property
    def worst(self):
        return max(map(abs, self.cents))

    @property
    def edge(self):
        """Mean edge length relative to the body's size: elements^(-1/3)."""
        return self.elements ** (-1 / 3)


def make_point(kind, solve, truth):
    """None if the mesh has fewer modes than are known."""
    if len(solve.freq_hz) < len(truth.freq_hz):
        return None
    return Point(
        kind,
        solve.nodes,
        solve.unknowns,
        solve.elements,
        solve.cpu,
        solve.spread if len(solve.cpu_s) > 1 else None,
        [to_cents(f, true) for f, true in zip(solve.freq_hz, truth.freq_hz)],
    )


def fit_line(x, y):
    """(intercept, slope) of a least-squares line."""
    mean_x, mean_y = statistics.fmean(x), statistics.fmean(y)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
    return mean_y - slope * mean_x, slope


def extrapolate(edges, freq_hz):
    """(Truth, order): limit of three or more meshes. edges: mean edge lengths; freq_hz: [mesh][mode].

    f(h) = f0 + c h^p by least squares, f0 and c per mode, one p in [2, 4] for all modes (least relative residuals), since unstructured
    meshes scatter. Uncertainty of a mode: maximum of the distances to the limits for p - 1/2 and p + 1/2, the largest residual, and the
    distance from the finest mesh to the limit. After Richardson 1911.
    """
    modes = list(zip(*freq_hz))

    def fit(power):
        """[(limit, largest residual)] of all modes."""
        x = [edge**power for edge in edges]
        lines = [fit_line(x, y) for y in modes]
        return [(limit, max(abs(limit + slope * a - b) for a, b in zip(x, y))) for (limit, slope), y in zip(lines, modes)]

    def find_misfit(power):
        return sum((residual / limit) ** 2 for limit, residual in fit(power))

    low, high = 2.0, 4.0
    for _ in range(80):  # the misfit is unimodal
        third = (high - low) / 3
        low, high = (low, high - third) if find_misfit(low + third) < find_misfit(high - third) else (low + third, high)
    power = (low + high) / 2
    finest = min(range(len(edges)), key=lambda i: edges[i])
    limits, doubts = [], []
    for (limit, residual), (less, _), (more, _), values in zip(fit(power), fit(power - 0.5), fit(power + 0.5), modes):
        limits.append(limit)
        doubts.append(max(abs(less - limit), abs(more - limit), residual, abs(values[finest] - limit)) / limit)
    return Truth(tuple(limits), tuple(doubts), "extrapolated"), power


def find_rate(points, truth, find_error=lambda point: point.median):
    """Convergence order over the three finest meshes whose error exceeds the uncertainty of the truth; None with fewer than two."""
    doubt = to_cents(1 + statistics.median(truth.uncertainty), 1)
    clear = [point for point in sorted(points, key=lambda point: point.elements) if find_error(point) > 4 * doubt][-3:]
    fit = scaling.fit_power([point.edge for point in clear], [find_error(point) for point in clear])
    return fit[0] if fit else None


@dataclasses.dataclass
class Cost:
    """CPU seconds for an accuracy. how: "measured" (between two meshes), "at most" (the coarsest mesh suffices), "extrapolated" (the finest
    is worse)."""

    cpu_s: float
    how: str

    def __str__(self):
        sign = {"measured": "", "at most": "≤ ", "extrapolated": "~ "}[self.how]
        return f"{sign}{self.cpu_s:.2g}" if self.cpu_s < 100 else f"{sign}{self.cpu_s:.0f}"


def is_known(truth, cents):
    """True if the truth of every mode is certain enough to resolve an error of so many cents."""
    return to_cents(1 + max(truth.uncertainty), 1) <= cents


MIN_GROWTH = 1.2  # exponent of CPU time in the number of elements; start-up time hides it on small meshes


def find_cost(points, cents, find_error=lambda point: point.worst):
    """Cost of one element kind for an error of at most `cents`, by log-log interpolation. Beyond the finest mesh: last slope of the error,
    CPU time growing at least as elements^MIN_GROWTH. None if errors do not fall or the finest is over thirty times as large."""
    curve = []
    for point in sorted(points, key=lambda point: point.cpu_s):
        if not curve or find_error(point) < find_error(curve[-1]):
            curve.append(point)
    if not curve:
        return None
    if find_error(curve[0]) <= cents:
        return Cost(curve[0].cpu_s, "at most")
    for cheap, dear in zip(curve, curve[1:]):
        if find_error(dear) <= cents:
            share = math.log(find_error(cheap) / cents) / math.log(find_error(cheap) / find_error(dear))
            return Cost(cheap.cpu_s * (dear.cpu_s / cheap.cpu_s) ** share, "measured")
    if len(curve) < 3 or find_error(curve[-1]) > 30 * cents:
        return None
    cheap, dear = curve[-2:]
    growth = max(math.log(dear.cpu_s / cheap.cpu_s), MIN_GROWTH * math.log(dear.elements / cheap.elements))
    return Cost(
        dear.cpu_s * math.exp(growth * math.log(find_error(dear) / cents) / math.log(find_error(cheap) / find_error(dear))), "extrapolated"
    )
