"""Choice of the damping law from decays: by Akaike's information criterion (Akaike 1974) among the laws of a job."""
import dataclasses
import math

import numpy
import scipy.optimize

FLOOR = 0.05  # relative standard deviation of a decay next to that of its measurement: support, air, position
NAMES = {"internal friction": "internal_friction", "Rayleigh": "rayleigh", "two powers": "caughey", "table": "loss_table"}


@dataclasses.dataclass(frozen=True)
class Law:
    """damping: as in a material. values, deviations: its constants [SI]; chi2 of the decays; aic."""

    name: str
    damping: dict
    values: list
    deviations: list
    chi2: float
    aic: float


def fit_series(name, powers, omega, decay, sd):
    """The Law d = sum of a omega^(2 p) / 2 with a >= 0: Lawson and Hanson's least squares."""
    columns = numpy.stack([0.5 * omega ** (2 * power) for power in powers], axis=1) / sd[:, None]
    scale = numpy.linalg.norm(columns, axis=0)
    values, left = scipy.optimize.nnls(columns / scale, decay / sd)
    chi2 = left**2
    spread = numpy.linalg.pinv((columns / scale).T @ (columns / scale)) * max(1.0, chi2 / max(1, len(decay) - len(powers)))
    values, deviations = values / scale, numpy.sqrt(numpy.diag(spread)) / scale
    damping = {
        "internal friction": lambda a: {"internal_friction": {"tan_phi": a[0]}},
        "Rayleigh": lambda a: {"rayleigh": {"alpha2_per_s": a[0], "alpha1_s": a[1]}},
        "two powers": lambda a: {"caughey": {"powers": list(powers), "coefficients": a}},
    }[name](values.tolist())
    return Law(name, damping, values.tolist(), deviations.tolist(), chi2, chi2 + 2 * len(powers))


def make_table(hz, decay, sd):
    """The Law of a loss factor in each row; peaks closer than 1 % share one."""
    rows, chi2, first = [], 0.0, 0
    deviations = []
    for end in range(1, len(hz) + 1):
        if end < len(hz) and hz[end] < 1.01 * hz[first]:
            continue
        part = slice(first, end)
        eta, sd_eta = decay[part] / (math.pi * hz[part]), sd[part] / (math.pi * hz[part])
        weight = 1 / sd_eta**2
        mean = float((weight * eta).sum() / weight.sum())
        chi2 += float((weight * (eta - mean) ** 2).sum())
        rows.append([float(hz[part].mean()), min(mean, 1.9)])
        deviations.append(float(weight.sum() ** -0.5))
        first = end
    return Law("table", {"loss_table": rows}, [eta for _, eta in rows], deviations, chi2, chi2 + 2 * len(rows))


def fit_laws(peaks):
    """The Laws for [sound.Peak], best first; those without a decay do not count. Empty without any."""
    peaks = sorted((peak for peak in peaks if peak.decay_per_s), key=lambda peak: peak.freq_hz)
    if not peaks:
        return []
    hz = numpy.array([peak.freq_hz for peak in peaks])
    decay = numpy.array([peak.decay_per_s for peak in peaks])
    stated = numpy.array([peak.sd_per_s if math.isfinite(peak.sd_per_s) else 0.1 * peak.decay_per_s for peak in peaks])
    sd = numpy.hypot(stated, FLOOR * decay)
    omega = 2 * math.pi * hz
    laws = [fit_series("internal friction", (0.5,), omega, decay, sd)]
    if len(peaks) > 2:
        laws += [fit_series("Rayleigh", (0, 1), omega, decay, sd), fit_series("two powers", (0, 0.5), omega, decay, sd)]
        laws.append(make_table(hz, decay, sd))
    return sorted(laws, key=lambda law: law.aic)
