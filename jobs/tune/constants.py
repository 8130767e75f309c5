"""Elastic constants from the frequencies of a body: peaks assigned to modes, Gauss-Newton with the error bars of the modes in the weights.

Sources: Spinner and Tefft 1961 and ASTM E1876 (constants from resonances), Migliori et al. 1993 (resonant ultrasound spectroscopy:
assignment and inversion together), Friswell and Mottershead 1995 (updating with priors, what can be distinguished).
"""
import dataclasses
import math

import numpy

import solver
from errors import InputError

TO_CENTS = 1200 / math.log(2)
PRIOR = 0.3  # standard deviation of ln of a constant before the recording; of nu of an isotropic body PRIOR_NU
PRIOR_NU = 0.1
NU_RANGE = (-0.9, 0.495)
SOLID_NU = (0.02, 0.47)  # beyond: rubber, foam, or a wrong shape
RESOLVED = 0.5  # a constant is resolved if its standard deviation falls below this share of the prior's
FLOOR_CENTS = 0.3  # of a measurement: temperature, support
MISSED, EXTRA = 0.5, 4.5  # costs of a mode that is not heard and of a peak that is no mode, in squares of the deviation
STEP, STEP_NU, STEP_SIZE = 0.02, 0.01, 0.01  # of the differences
GATE_CENTS = (40.0, 25.0, 15.0)  # deviations allowed in the first assignments
STARTS, DRAWS = 5, 1000  # starts of the fit; points drawn near each
WRONG_CHI2 = 3.0
HEARD, ONE_TONE_CENTS = 1 / 3, 5.0  # share of the modes that a strike lets hear, at least; modes so close sound as one
OUTLIER, OUTLIER_CENTS = 0.1, 0.5  # share of the squared deviation left without an outlier; its least deviation
WRONG_SIZES = (0.15, 31)  # range and number of ln of the factors tried
GAIN = 6.0  # of cost by another size, to name it
MARGIN = 6  # modes more than needed, for those that others pass


@dataclasses.dataclass(frozen=True)
class Constant:
    """x is ln of the value, or the value where is_plain."""

    name: str
    x: float
    prior_sd: float
    is_plain: bool = False

    def get_value(self, x):
        return x if self.is_plain else math.exp(x)


def list_constants(material):
    """The elastic constants of a resolved material."""
    wood = material.get("orthotropic")
    if wood is None:
        young, nu = material["young_modulus_pa"], material["poisson_ratio"]
        return [Constant("E", math.log(young), PRIOR), Constant("nu", nu, PRIOR_NU, is_plain=True)]
    names = ("E1", "E2", "E3", "G12", "G23", "G13", "nu12", "nu23", "nu13")
    values = [*wood["young_modulus_pa"], *wood["shear_modulus_pa"], *wood["poisson_ratio"]]
    return [Constant(name, math.log(value), PRIOR) for name, value in zip(names, values)]


def make_material(material, constants, x):
    """The material with the constants at x."""
    values = [constant.get_value(value) for constant, value in zip(constants, x)]
    if "orthotropic" not in material:
        return material | {"young_modulus_pa": values[0], "poisson_ratio": values[1]}
    wood = {"young_modulus_pa": values[:3], "shear_modulus_pa": values[3:6], "poisson_ratio": values[6:]}
    return material | {"orthotropic": material["orthotropic"] | wood}


def align(model, peaks, sigma):
    """Monotone assignment of peaks to modes at least cost, for B models at once (dynamic programming; Needleman and Wunsch 1970).

    model: (B, m) ln f, ascending; peaks: (p) ln f, ascending; sigma: (m, p). Modes above the last peak cost nothing. Returns (B) costs and
    a function that gives the pairs [(mode, peak)] of one model."""
    count, modes, many = len(model), model.shape[1], len(peaks)
    cost = numpy.full((modes + 1, many + 1, count), numpy.inf)
    came = numpy.zeros((modes + 1, many + 1, count), numpy.int8)
    cost[0, 0] = 0.0
    for i in range(modes + 1):
        for j in range(many + 1):
            if i == j == 0:
                continue
            infinite = numpy.full(count, numpy.inf)
            options = numpy.stack(
                [
                    cost[i - 1, j - 1] + ((peaks[j - 1] - model[:, i - 1]) / sigma[i - 1, j - 1]) ** 2 if i and j else infinite,
                    cost[i - 1, j] + (MISSED if j < many else 0.0) if i else infinite,
                    cost[i, j - 1] + EXTRA if j else infinite,
                ]
            )
            came[i, j] = numpy.argmin(options, axis=0)
            cost[i, j] = numpy.min(options, axis=0)

    def trace(row):
        pairs, i, j = [], modes, many
        while i or j:
            way = came[i, j, row]
            if way == 0:
                pairs.append((i - 1, j - 1))
            i, j = i - (way != 2), j - (way != 1)
        return pairs[::-1]

    return cost[modes, many], trace


@dataclasses.dataclass(frozen=True)
class Linear:
    """ln f of the m modes near x0: base + slopes (x - x0) + size_slopes (ln of the sizes)."""

    solution: solver.Solution
    x0: numpy.ndarray  # (n)
    base: numpy.ndarray  # (m)
    slopes: numpy.ndarray  # (m, n)
    size_slopes: numpy.ndarray  # (m, d)

    def predict(self, x):
        return self.base + self.slopes @ (x - self.x0)


@dataclasses.dataclass(frozen=True)
class Fit:
    """constants at x with covariance; pairs: [(mode, peak)]; residual and sigma of the pairs [cents]; chi2 per degree of freedom."""

    x: numpy.ndarray
    covariance: numpy.ndarray
    resolved: numpy.ndarray  # (n) bool
    pairs: list
    residual: numpy.ndarray
    sigma: numpy.ndarray
    chi2: float


def find_sizes(job):
    """{key: value} of the lengths and angles of a body whose shape follows from them."""
    body = job.get("body", {})
    return {
        key: value
        for key, value in body.items()
        if key.endswith(("_m", "_deg")) and key != "edge_m" and isinstance(value, (int, float)) and value > 0
    }


def choose_apart(points, cost):
    """The STARTS best points that are different."""
    chosen = []
    for k in numpy.argsort(cost):
        if all((numpy.abs(points[k] - other) > 0.06).any() for other in chosen):
            chosen.append(points[k])
        if len(chosen) == STARTS:
            break
    return chosen


class Matcher:
    """Fits the constants of a job's body to peaks."""

    def __init__(self, made, job, peaks, tolerance_m=None):
        """made: a Solver. peaks: [sound.Peak], ascending. tolerance_m: standard deviation of each size."""
        self.solver = made
        self.hear(peaks)
        job = {key: value for key, value in job.items() if key != "max_modes"}
        count = 2 * len(peaks) + 10
        while True:  # up to a third above the highest peak
            self.job = job | {"band_hz": [0.2 * peaks[0].freq_hz, 60 * peaks[-1].freq_hz], "max_modes": count}
            first = made.solve(self.job)
            if first.corrected_hz[-1] > 1.35 * peaks[-1].freq_hz or count > 160:
                break
            count *= 2
        if "materials" in first.job:
            raise InputError(f"{made.job_file}: has several materials; match a body of one")
        self.count = max(4, int((first.corrected_hz < 1.35 * peaks[-1].freq_hz).sum()))
        self.material = first.job["material"]
        self.constants = list_constants(self.material)
        self.prior = numpy.array([constant.x for constant in self.constants])
        self.prior_sd = numpy.array([constant.prior_sd for constant in self.constants])
        self.sizes = find_sizes(self.job)
        tolerance = [(tolerance_m or 0.0) / size if key.endswith("_m") else 0.0 for key, size in self.sizes.items()]
        self.size_sd = numpy.array(tolerance)

    def hear(self, peaks):
        """Takes these peaks, ascending."""
        self.peaks = peaks
        self.log_peaks = numpy.log([peak.freq_hz for peak in peaks])
        self.peak_cents = numpy.array([math.hypot(peak.sd_cents, FLOOR_CENTS) for peak in peaks])

    def make_job(self, x, sizes=None, more=0):
        job = self.job | {"material": make_material(self.material, self.constants, x), "max_modes": self.count + more}
        return job | {"body": job["body"] | sizes} if sizes else job

    def linearise(self, x):
        """The Linear model at x: one solve, and one for each constant and size."""
        jobs, steps = [self.make_job(x)], []
        for k, constant in enumerate(self.constants):
            moved = x.copy()
            moved[k] += (STEP_NU if x[k] < 0.4 else -STEP_NU) if constant.is_plain else STEP
            steps.append(moved[k] - x[k])
            jobs.append(self.make_job(moved, more=MARGIN))
        for key, value in self.sizes.items():
            steps.append(STEP_SIZE)
            jobs.append(self.make_job(x, {key: value * math.exp(STEP_SIZE)}, more=MARGIN))
        base, *others = self.solver.solve_all(jobs)
        slopes = numpy.empty((len(base.corrected_hz), len(others)))
        for k, (other, step) in enumerate(zip(others, steps)):
            if len(other.corrected_hz) < len(base.corrected_hz):
                raise InputError(f"{self.solver.job_file}: the mesh has too few modes; give it more nodes")
            slopes[:, k] = numpy.log(other.corrected_hz[solver.follow(base, other)] / base.corrected_hz) / step
        count = len(self.constants)
        return Linear(base, x, numpy.log(base.corrected_hz), slopes[:, :count], slopes[:, count:])

    def find_starts(self, model):
        """Starts x on a grid of one factor of all moduli and, if isotropic, nu: the best of the grid, best first, and the factors of all
        moduli by which others about as good are off."""
        factors = numpy.arange(-1.5, 1.5, 0.02)
        nus = (
            numpy.arange(max(NU_RANGE[0], min(0.05, self.prior[1] - 1.5 * PRIOR_NU)), 0.46, 0.05) if self.constants[1].is_plain else [None]
        )
        points = []
        for nu in nus:
            for factor in factors:
                x = self.prior.copy()
                if nu is not None:
                    x[1] = nu
                x[[not c.is_plain and not c.name.startswith("nu") for c in self.constants]] += factor
                points.append(x)
        points = numpy.array(points)
        cost = self.calc_costs(model, points)
        shift = points[:, 0] - self.prior[0]
        cost = cost + (shift / PRIOR) ** 2
        if nus[0] is not None:
            cost = cost + ((points[:, 1] - self.prior[1]) / PRIOR_NU) ** 2
        best = int(numpy.argmin(cost))
        far = numpy.abs(shift - shift[best]) > 0.15
        rivals = [math.exp(shift[k] - shift[best]) for k in [numpy.argmin(numpy.where(far, cost, numpy.inf))] if cost[k] < cost[best] + 2]
        starts = choose_apart(points, cost)
        return starts if self.constants[1].is_plain else starts + self.draw_starts(model, starts), rivals

    def draw_starts(self, model, starts):
        """Starts near others, drawn from the prior: the moduli of wood are wrong by different factors."""
        random = numpy.random.default_rng(1)
        points = numpy.concatenate([start + self.prior_sd * random.normal(size=(DRAWS, len(start))) for start in starts])
        return choose_apart(points, self.calc_costs(model, points) + (((points - self.prior) / self.prior_sd) ** 2).sum(axis=1))

    def calc_costs(self, model, points):
        """(B) costs of the assignments at B points, on a linear model."""
        logs = numpy.sort(model.base + (points - model.x0) @ model.slopes.T, axis=1)
        return align(logs, self.log_peaks, self.make_sigma(model, GATE_CENTS[0]) / TO_CENTS)[0]

    def make_sigma(self, model, gate_cents=0.0):
        """(m, p) standard deviation of a peak from a mode [cents]: half its bar, a largest distance, and that of the peak."""
        bars = numpy.where(numpy.isfinite(model.solution.bar_cents), model.solution.bar_cents, 100.0)
        return numpy.sqrt((0.5 * bars[:, None]) ** 2 + self.peak_cents**2 + gate_cents**2)

    def assign(self, model, logs, gate_cents):
        """Pairs (mode, peak) for ln f of the modes."""
        order = numpy.argsort(logs)
        _, trace = align(logs[order][None], self.log_peaks, self.make_sigma(model, gate_cents)[order] / TO_CENTS)
        return [(int(order[i]), j) for i, j in trace(0)]

    def solve_step(self, model, pairs, free, gate_cents=0.0):
        """Least squares at given pairs: (x, covariance over all constants, residual and sigma [cents], chi2). free: (n) bool; the others
        stay at the prior."""
        modes, peaks = (numpy.array(part, int) for part in zip(*pairs))
        sigma = self.make_sigma(model, gate_cents)[modes, peaks]
        weight = numpy.diag(sigma**2)
        if self.size_sd.any():
            sizes = TO_CENTS * model.size_slopes[modes] * self.size_sd
            weight = weight + sizes @ sizes.T
        weight = numpy.linalg.inv(weight)
        slopes = TO_CENTS * model.slopes[modes]
        prior = numpy.diag(1 / self.prior_sd**2)
        fixed = numpy.where(free, model.x0, self.prior)
        deviation = TO_CENTS * (self.log_peaks[peaks] - model.predict(fixed)[modes])
        normal = (slopes.T @ weight @ slopes + prior)[numpy.ix_(free, free)]
        right = (slopes.T @ weight @ deviation + prior @ (self.prior - fixed))[free]
        x = fixed.copy()
        x[free] += numpy.linalg.solve(normal, right)
        for k, constant in enumerate(self.constants):
            if constant.is_plain:
                x[k] = numpy.clip(x[k], *NU_RANGE)
        residual = TO_CENTS * (self.log_peaks[peaks] - model.predict(x)[modes])
        chi2 = residual @ weight @ residual / max(1, len(pairs) - free.sum())
        return x, numpy.linalg.inv(slopes.T @ weight @ slopes + prior), residual, sigma, chi2

    def refine(self, model, x, gates=GATE_CENTS):
        """The Fit on a linear model: assignment and Gauss-Newton in turn, with ever closer assignments; None if no peak is near a mode."""
        pairs, everything, residual = [], numpy.full(len(x), True), numpy.zeros(1)
        for turn in range(12):
            gate = gates[turn] if turn < len(gates) else max(1.0, 2.5 * float(numpy.median(numpy.abs(residual))))
            before, pairs = pairs, self.assign(model, model.predict(x), gate)
            if not pairs:
                return None
            if turn > len(gates) and pairs == before:
                break
            x, _, residual, _, _ = self.solve_step(model, pairs, everything, gate)
        _, covariance, _, _, _ = self.solve_step(model, pairs, everything)
        resolved = numpy.sqrt(numpy.diag(covariance)) < RESOLVED * self.prior_sd
        if not resolved.any():
            resolved[0] = True
        pairs = self.drop_outliers(model, pairs, resolved)
        x, covariance, residual, sigma, chi2 = self.solve_step(model, pairs, resolved)
        return Fit(x, covariance * max(1.0, chi2), resolved, pairs, residual, sigma, chi2)

    def fit_to(self, model, starts=None):
        """The Fit of least cost on a linear model, from several starts."""
        starts = starts or self.find_starts(model)[0]
        fits = [fit for fit in (self.refine(model, x) for x in starts) if fit]
        if not fits:
            text = "no peak fits a mode of this body; check its sizes in metres, its support and its density"
            raise InputError(f"{self.solver.job_file}: {text}")
        return min(fits, key=lambda fit: self.calc_cost(model, fit))

    def fit(self):
        """(Fit, Linear model at it, factors of rival assignments)."""
        model = self.linearise(self.prior)
        starts, rivals = self.find_starts(model)
        for turn in range(4):
            found = self.fit_to(model, starts)
            moved = numpy.abs(found.x - model.x0) / self.prior_sd
            moved[: 1 if self.constants[1].is_plain else 0] *= 0.1  # E of an isotropic body scales exactly
            if turn == 3 or moved.max() < 0.01:
                return found, model, rivals
            model, starts = self.linearise(found.x), [found.x]

    def drop_outliers(self, model, pairs, free):
        """The pairs without those that alone make nearly all of the deviation: bars are estimates, and may hide a false peak."""

        def calc_sum(some):
            _, _, residual, sigma, _ = self.solve_step(model, some, free)
            return float(((residual / sigma) ** 2).sum())

        while len(pairs) - free.sum() >= 4:
            rests = [pairs[:k] + pairs[k + 1 :] for k in range(len(pairs))]
            sums = [calc_sum(rest) for rest in rests]
            best = int(numpy.argmin(sums))
            _, _, residual, _, _ = self.solve_step(model, pairs, free)
            if sums[best] > OUTLIER * calc_sum(pairs) or abs(residual[best]) < OUTLIER_CENTS:
                break
            pairs = rests[best]
        return pairs

    def calc_cost(self, model, fit):
        """Cost of the assignment of a Fit, with deviations beyond the last gate as an extra peak and a missed mode."""
        logs = numpy.sort(model.predict(fit.x))
        order = numpy.argsort(model.predict(fit.x))
        cost, _ = align(logs[None], self.log_peaks, self.make_sigma(model, GATE_CENTS[-1])[order] / TO_CENTS)
        return cost[0] + (((fit.x - self.prior) / self.prior_sd) ** 2).sum()

    def count_heard(self, found, model):
        """(modes that have a peak, modes up to the highest peak), those that sound as one counted once."""
        logs = model.predict(found.x)
        order = numpy.argsort(logs)
        tone = numpy.empty(len(logs), int)
        tone[order] = numpy.cumsum(numpy.diff(logs[order], prepend=-math.inf) > ONE_TONE_CENTS / TO_CENTS)
        heard = {int(tone[mode]) for mode, _ in found.pairs}
        return len(heard), max(heard)

    def find_hidden_sizes(self, found, model):
        """[(size, smallest relative change that shows [2 sd], power n of E size^n that the peaks fix)] of each size."""
        modes = [mode for mode, _ in found.pairs]
        slopes = TO_CENTS * model.slopes[modes][:, found.resolved] / found.sigma[:, None]
        rows = []
        for key, size_slopes in zip(self.sizes, model.size_slopes.T):
            size = TO_CENTS * size_slopes[modes] / found.sigma
            share = numpy.linalg.lstsq(slopes, size, rcond=None)[0]
            left = numpy.linalg.norm(size - slopes @ share)
            rows.append((key, 2 / left if left > 1e-9 else math.inf, share[0]))
        return rows

    def find_wrong_size(self, found, model):
        """(size, its value, peaks that fit with it) of the size that explains a bad fit best, by a new assignment; None if none does."""
        cost, best = self.calc_cost(model, found) - GAIN, None
        most, count = WRONG_SIZES
        for k, (key, value) in enumerate(self.sizes.items()):
            for factor in numpy.linspace(-most, most, count):
                changed = dataclasses.replace(model, base=model.base + factor * model.size_slopes[:, k])
                fit = self.refine(changed, found.x)
                if fit and self.calc_cost(changed, fit) < cost:
                    cost, best = self.calc_cost(changed, fit), (key, value * math.exp(factor), len(fit.pairs))
        return best
