"""Prediction of error and cost of a setting from the measurements of the accuracy study (advice.json). Pure functions.

A curve is one body with one element on meshes of several sizes: the largest error of the band, the largest error bar, CPU seconds. Between
two sizes all are powers of the nodes. A body that the study does not have is measured on two coarse meshes first (Probe): how much its
frequencies fall from one to the other, and its error bars, say how wrong the finer one is.
"""
import dataclasses
import json
import math

from measuring import to_cents

FORMAT = 1
GOAL = 0.75  # fraction of the requested error that is aimed at
MAX_FINER = 10.0  # limit of extrapolation: nodes / nodes of the finest measured mesh
MAX_FINER_TRIAL = 4.0  # the same for trials
START_S, STEEPEST_CPU = 0.1, 1.8  # CPU seconds of the start; largest power of the nodes of the rest
# Of the power at the end of a curve, beyond it: meshes that are coarse for their walls gain faster than those that follow.
TRUST, STEEPEST_BEYOND = 0.85, 4 / 3
DISTRUST = 0.9  # factor for a power measured on coarse meshes
# Limits of the power of the nodes for errors: order four, and bodies refined in two directions.
MIN_STEEPNESS, MAX_STEEPNESS = 0.3, 4 / 2
LOOSEST_TOLERANCE, STRICTEST_TOLERANCE = 1e-6, 1e-12
CENTS_OF_RESIDUAL = 600 / math.log(2)  # frequency error in cents per relative residual of lambda


class OutOfReach(Exception):
    """No predictable setting meets the request."""


@dataclasses.dataclass(frozen=True)
class Setting:
    element: str  # "T4", "T4 lumped", "T10" (curved where the body is)
    nodes: int  # requested, including mid-side nodes
    tolerance: float
    ranks: int = 1


@dataclasses.dataclass(frozen=True)
class Forecast:
    setting: Setting
    cents: float  # largest error in the band
    cpu_s: float  # of all ranks, on this machine
    wall_s: float


@dataclasses.dataclass(frozen=True)
class Sample:
    """One mesh of a curve. Errors and bars: largest in the band, in cents."""

    nodes: int  # asked of the mesher
    unknowns: int
    modes: int
    cents: float
    bar: float
    cpu_s: float  # of one rank, on the machine of the study


def interpolate(points, x, min_slope, max_slope, trust=1.0):
    """points: [(x, y)] by x, both positive: y as powers of x between them; beyond the last the slope there times `trust`, before the first
    the slope there; both kept between two limits."""
    if len(points) == 1:
        return points[0][1]
    index = next((i for i in range(1, len(points) - 1) if x < points[i][0]), len(points) - 1)
    (x_0, y_0), (x_1, y_1) = points[index - 1], points[index]
    slope = math.log(y_1 / y_0) / math.log(x_1 / x_0)
    if x > points[-1][0]:
        (x_0, y_0), slope = points[-1], trust * slope
    if not x_0 <= x <= x_1:
        slope = min(max(slope, min_slope), max_slope)
    return y_0 * (x / x_0) ** slope


class Curve:
    """Samples of one body and one element, by nodes."""

    def __init__(self, element, samples, is_measured=True):
        self.element, self.is_measured = element, is_measured
        self.samples = []
        for sample in sorted(samples, key=lambda s: s.nodes):
            if not self.samples or sample.nodes > self.samples[-1].nodes:
                self.samples.append(sample)
        # An accidentally small error (change of sign) does not hold for coarser meshes.
        worst, self.errors = 0.0, []
        for sample in reversed(self.samples):
            worst = max(worst, sample.cents)
            self.errors.append((sample.nodes, max(worst, 1e-9)))
        self.errors.reverse()

    def get_max_nodes(self):
        return self.samples[-1].nodes * (MAX_FINER if self.is_measured else 1.0)

    def predict_cents(self, nodes):
        return interpolate(self.errors, nodes, -STEEPEST_BEYOND, 0.0, TRUST)

    def predict_cpu(self, nodes):
        return interpolate([(s.nodes, s.cpu_s) for s in self.samples], nodes, 0.3, 1.7)

    def find_nodes(self, cents):
        """The fewest nodes predicted to be no more than `cents` wrong; a mesh that was measured to be so goes before one that is predicted.
        None: out of reach."""
        for (nodes, error), after in zip(self.errors, [*self.errors[1:], None]):
            if error <= (0.95 if self.is_measured else GOAL) * cents:
                return nodes
            if after and after[1] <= GOAL * cents:
                found = bisect(lambda n: self.predict_cents(n) <= GOAL * cents, nodes, after[0])
                return after[0] if self.is_measured and found > 0.85 * after[0] else math.ceil(found)
        most = self.get_max_nodes()
        if self.predict_cents(most) > GOAL * cents:
            return None
        return math.ceil(bisect(lambda n: self.predict_cents(n) <= GOAL * cents, self.samples[-1].nodes, most))

    def find_affordable(self, cpu_s):
        """The most nodes within the CPU seconds; None if the coarsest mesh needs more."""
        if self.samples[0].cpu_s > cpu_s:
            return None
        most = self.get_max_nodes()
        if self.predict_cpu(most) <= cpu_s:
            return math.floor(most)
        found = bisect(lambda n: self.predict_cpu(n) > cpu_s, self.samples[0].nodes, most)
        measured = [s.nodes for s in self.samples if 0.85 * found < s.nodes <= found]
        return measured[-1] if measured else math.floor(found)


def bisect(is_beyond, low, high):
    """The smallest x in low .. high with is_beyond(x), which is monotonic."""
    for _ in range(50):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return high


def find_tolerance(cents):
    """The loosest power of ten whose residual is worth no more than a hundredth of what is asked, within what suits mode shapes."""
    power = math.floor(math.log10(max(0.01 * cents / CENTS_OF_RESIDUAL, STRICTEST_TOLERANCE)) + 1e-9)
    return min(max(10.0**power, STRICTEST_TOLERANCE), LOOSEST_TOLERANCE)


class Advice:
    """Measurements of the study: curves by body and element, ratios of bars to errors."""

    def __init__(self, content):
        self.content = content
        self.curves = {}
        for body, rows in content["bodies"].items():
            for element in {row["element"] for row in rows}:
                samples = [
                    Sample(row["nodes"], row["unknowns"], row["modes"], row["worst_cents"], row["bar_cents"], row["cpu_s"])
                    for row in rows
                    if row["element"] == element
                ]
                self.curves.setdefault(body, {})[element] = Curve(element, samples)

    def get_calibration(self):
        return self.content["calibration"]

    def find_bar_ratios(self, element, without=None):
        """Sorted largest bar over largest error of all samples that are neither all wrong nor rounding; `without`: a body that is left
        out."""
        return sorted(
            s.bar / s.cents
            for body, curves in self.curves.items()
            if body != without and element in curves
            for s in curves[element].samples
            if 0.02 < s.cents < 300
        )

    def find_usual_ratio(self, element="T10"):
        return find_quantile(self.find_bar_ratios(element), 0.25)

    def has_ranks(self, ranks):
        row = self.content.get("ranks", {}).get(str(ranks))
        return bool(row) and not row["crowded"] and row["wall"] < 0.9

    def find_rank_cost(self, ranks):
        """Measured (CPU, wall time) on `ranks` ranks / one rank."""
        row = self.content.get("ranks", {}).get(str(ranks))
        return (row["cpu"], row["wall"]) if row else (1.0, 1.0)


def find_quantile(values, part):
    """Interpolated quantile of a sorted list."""
    place = part * (len(values) - 1)
    low = math.floor(place)
    high = min(low + 1, len(values) - 1)
    return values[low] + (place - low) * (values[high] - values[low])


def read_advice(text):
    """Raises ValueError for anything but an advice file of this version."""
    content = json.loads(text)
    if not isinstance(content, dict) or content.get("format") != FORMAT or not isinstance(content.get("bodies"), dict):
        raise ValueError(f"not an advice file of format {FORMAT}")
    calibration = content["calibration"]
    numbers = [
        calibration["cpu_s"],
        *(
            row[key]
            for rows in content["bodies"].values()
            for row in rows
            for key in ("nodes", "unknowns", "modes", "cpu_s", "worst_cents", "bar_cents")
        ),
    ]
    if not isinstance(calibration["job"], dict) or not all(
        isinstance(number, (int, float)) and 0 < number < math.inf for number in numbers
    ):
        raise ValueError("a measurement is not a positive number")
    return Advice(content)


@dataclasses.dataclass
class Trial:
    """One coarse solve of a body outside the study."""

    nodes: int
    unknowns: int
    freq_hz: list
    bars: list
    cpu_s: float
    mesh_s: float  # of these, meshing


def find_fall(coarse_hz, fine_hz):
    """Largest distance in cents between modes of equal index."""
    return max((abs(to_cents(a, b)) for a, b in zip(coarse_hz, fine_hz)), default=0.0)


class Probe:
    """A body outside the study, from at least two trials with T10, coarse to fine.
    predict_seconds(element, nodes, modes): CPU seconds by the cost model of carillon-precompute."""

    def __init__(self, advice, element, predict_seconds):
        self.element, self.predict_seconds, self.trials = element, predict_seconds, []
        ratios = advice.find_bar_ratios(element)
        self.usual, self.least = find_quantile(ratios, 0.5), max(find_quantile(ratios, 0.02), 1.0)  # bars over errors

    def find_slope(self, coarse, fine):
        """The power of the nodes by which error bars fell between two trials, within what theory has, and a little less."""
        count = min(len(coarse.bars), len(fine.bars))
        bars = max(coarse.bars[:count], default=1.0), max(fine.bars[:count], default=1.0)
        slope = DISTRUST * math.log(bars[0] / max(bars[1], 1e-9)) / math.log(fine.nodes / coarse.nodes)
        return min(max(slope, MIN_STEEPNESS), MAX_STEEPNESS)

    def estimate(self, coarse, fine):
        """Cents of the largest error of the fine one of two: what its frequencies fell by, continued at the rate of its bars, or what bars
        of that length usually mean, if that is more."""
        bar = max(fine.bars)
        by_fall = 0.0
        if coarse.freq_hz and fine.nodes > 1.3 * coarse.nodes:
            by_fall = find_fall(coarse.freq_hz, fine.freq_hz) / ((fine.nodes / coarse.nodes) ** self.find_slope(coarse, fine) - 1)
        return min(max(by_fall, bar / self.usual), bar / self.least)

    def predict_cpu(self, nodes):
        """By the cost model at the pace of the finest trial, and by the power between the last two trials: their geometric mean."""
        coarse, fine = self.trials[-2:]
        factor, modes = nodes / fine.nodes, len(fine.freq_hz)
        spent = fine.cpu_s - fine.mesh_s
        by_model = spent * self.predict_seconds(self.element, round(nodes), modes) / self.predict_seconds(self.element, fine.nodes, modes)
        grown = max(spent - START_S, 1e-3) / max(coarse.cpu_s - coarse.mesh_s - START_S, 1e-3)
        power = min(max(math.log(grown) / math.log(fine.nodes / coarse.nodes), 1.0), STEEPEST_CPU)
        by_power = START_S + max(spent - START_S, 0.0) * factor**power
        return math.sqrt(by_model * by_power) + fine.mesh_s * factor

    def make_curve(self):
        """As if the study had it: the trials, and MAX_FINER_TRIAL times the nodes of the finest."""
        coarse, fine = self.trials[-2:]
        cents, slope, modes = self.estimate(coarse, fine), self.find_slope(coarse, fine), len(fine.freq_hz)
        samples = [
            Sample(t.nodes, t.unknowns, len(t.freq_hz), cents + find_fall(t.freq_hz, fine.freq_hz), max(t.bars), t.cpu_s)
            for t in self.trials
            if t.freq_hz
        ]
        for factor in (1.5, 2.0, MAX_FINER_TRIAL):
            nodes = round(fine.nodes * factor)
            samples.append(
                Sample(
                    nodes,
                    round(fine.unknowns * factor),
                    modes,
                    cents * factor**-slope,
                    max(fine.bars) * factor**-slope,
                    self.predict_cpu(nodes),
                )
            )
        return Curve(self.element, samples, is_measured=False)

    def judge(self, final):
        """Cents of the largest error of the final solve, by its own bars and by how far it fell below the trial before."""
        coarser = [trial for trial in self.trials if trial.nodes * 1.3 < final.nodes]
        return self.estimate((coarser or self.trials)[-1 if coarser else 0], final)
