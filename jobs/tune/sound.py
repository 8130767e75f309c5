"""Modes in the sound of one strike: frequencies and decays with standard errors, and what spoils them.

Method: starts from spectra of three windows; then all damped sinusoids together by least squares in time, with the amplitudes eliminated
(variable projection: Golub and Pereyra 1973, Jacobian of Kaufman 1975). Lines left in the residual join, and all are fitted again.
In a room, decays are fitted once more, with the room's sound as noise of known covariance (RoomDecays).
"""
import dataclasses
import math
import struct
import warnings

import numpy
import scipy.io.wavfile
import scipy.linalg
import scipy.ndimage
import scipy.optimize

from errors import InputError

WINDOWS_S = (0.08, 0.3, 1.2)
MIN_HZ = 30.0
FLOOR_DB, RANGE_DB = 14.0, 70.0  # of a line above the local median, below the strongest line
NEAR = 0.015  # relative distance of the lines of one spectrum
MAX_LINES, MAX_ADDED, MAX_STEPS = 30, 8, 15  # of a fit, by one residual
MIN_SIGNAL = 4.0  # amplitude over its standard error
TORN = 0.5  # lines closer than this share of their half width are one mode, of which nothing would be known
SKIP_S, MIN_S = 0.002, 0.15
FIT_S, FIT_DECAYS = (0.4, 0.8), 3.0  # length of the fit: so many times 1 / d of the slowest line, within these limits
T60_DECAY = math.log(1000.0)
ROOM_T60_S, ROOM_LEVELS = (0.15, 0.25, 0.4, 0.6, 0.9, 1.4), tuple(10 ** (db / 10) for db in (-28, -24, -20, -16, -12, -8, -4))
MIN_ROOM_S = 0.12  # T60; a residual that decays sooner is of modes that were not found, or distortion
ROOM_STEP_S = 0.008  # of a line's amplitudes
ROOM_BAND_HZ, ROOM_MINOR = 70.0, 0.5  # lines so near, weaker by this factor, are the flicker of a line
ROOM_SHARE, QUIET_SHARE = 0.2, 0.02  # least standard error of a decay, of the decay: in a room; else: a room too weak to be noticed
MAX_WAV_S = 600.0


@dataclasses.dataclass(frozen=True)
class Peak:
    """A mode in a sound. freq_hz is undamped; decay_per_s is None if unknown; level_db is 0 for the strongest."""

    freq_hz: float
    sd_hz: float
    decay_per_s: float | None = None
    sd_per_s: float = math.inf
    level_db: float = 0.0

    @property
    def sd_cents(self):
        return 1200 / math.log(2) * self.sd_hz / self.freq_hz


@dataclasses.dataclass(frozen=True)
class Hearing:
    """peaks: ascending. notes: sentences for the user. samples: (n) from the strike on, at rate_hz. room_t60_s: None in the open."""

    peaks: list
    notes: list
    samples: numpy.ndarray
    rate_hz: float
    room_t60_s: float | None


def read_wav(path):
    """(samples (n), rate in Hz) of the loudest channel. InputError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", scipy.io.wavfile.WavFileWarning)
            rate, samples = scipy.io.wavfile.read(path)
    # The last five are what scipy's reader raises on damaged headers.
    except (OSError, ValueError, EOFError, MemoryError, struct.error, ArithmeticError, TypeError, LookupError, NameError) as error:
        raise InputError(f"{path}: cannot be read as a WAV file: {error}; save it as PCM, uncompressed") from None
    samples = numpy.asarray(samples, float)
    samples = samples.reshape(len(samples), -1) if samples.size else numpy.empty((0, 1))
    if not len(samples) or not numpy.isfinite(samples).all():
        raise InputError(f"{path}: has no samples, or some that are no numbers; save it as PCM")
    samples = samples[:, numpy.argmax(numpy.var(samples, axis=0))]
    length = len(samples) / max(rate, 1)
    if rate < 8000 or not MIN_S < length < MAX_WAV_S:
        raise InputError(f"{path}: {length:.3g} s at {rate} Hz; give {MIN_S:g} to {MAX_WAV_S:g} s of one strike, at 8000 Hz or more")
    samples = samples - samples.mean()
    if not samples.any():
        raise InputError(f"{path}: is silent; record the strike again")
    return samples / numpy.abs(samples).max(), float(rate)


def find_onsets(samples, rate):
    """Indices where the energy of the differenced signal rises threefold, within 3 ms, above its maximum of the 23 ms before: of a
    period of mains hum."""
    step = max(1, round(rate / 1000))
    count = len(samples) // step
    energy = (numpy.diff(samples, prepend=samples[0])[: count * step].reshape(count, step) ** 2).sum(axis=1)
    energy = energy + 1e-12 * energy.max()
    before = scipy.ndimage.maximum_filter1d(energy, 23, origin=11)
    before = numpy.concatenate([numpy.full(3, energy.min()), before])[: len(energy)]
    onsets = []
    for block in numpy.flatnonzero((energy > 3 * before) & (energy > 3e-3 * energy.max())):
        if not onsets or block - onsets[-1] > 20:
            onsets.append(block)
    return [block * step for block in onsets]


def find_strike(samples, rate, notes):
    """(begin, end) of the part of one free decay; says what it left out."""
    onsets = find_onsets(samples, rate) or [0]
    ends = [*onsets[1:], len(samples)]
    energies = [
        (samples[begin:end] ** 2).sum() if end - begin > MIN_S * rate or len(onsets) == 1 else 0.0 for begin, end in zip(onsets, ends)
    ]
    if not any(energies):
        energies = [end - begin for begin, end in zip(onsets, ends)]
    chosen = int(numpy.argmax(energies))
    begin, end = onsets[chosen], ends[chosen]
    if len(onsets) > 1:
        times = ", ".join(f"{onset / rate:.3f}" for onset in onsets[:8])
        notes.append(f"{len(onsets)} strikes, at {times} s: the one at {begin / rate:.3f} s is used, {(end - begin) / rate:.2f} s of it")
    start = begin + round(SKIP_S * rate)
    # Equal samples at the limit, three in a row, are clipped.
    top = (samples > 0.9995 * samples.max()) | (samples < 0.9995 * samples.min())
    clipped = numpy.flatnonzero(top[begin : end - 2] & top[begin + 1 : end - 1] & top[begin + 2 : end])
    if len(clipped):
        start = max(start, begin + clipped[-1] + round(SKIP_S * rate))
        notes.append(f"clipped until {(begin + clipped[-1]) / rate:.3f} s: used from {start / rate:.3f} s on; record at a lower level")
    return start, end


def find_lines(samples, rate, whole=None):
    """[(hz, decay_per_s)] of spectral lines that stand out, one of those closer than NEAR. Short windows come first:
    in a long one the flicker of a room splits a line. whole: what `samples` was a part of, for the range."""
    lines = []
    for window_s in WINDOWS_S:
        part = samples[: round(window_s * rate)]
        length_s = len(part) / rate
        size = 1 << math.ceil(math.log2(2 * len(part)))
        level, most = (
            20 * numpy.log10(numpy.abs(numpy.fft.rfft(some[: len(part)] * numpy.blackman(len(part)), size)) + 1e-30)
            for some in (samples, samples if whole is None else whole)
        )
        spacing = rate / size
        floor = find_floor(level, spacing, length_s)
        inner = level[1:-1]
        tops = numpy.flatnonzero((inner > level[:-2]) & (inner >= level[2:]) & (inner > floor[1:-1] + FLOOR_DB)) + 1
        least_hz = MIN_HZ if window_s == WINDOWS_S[-1] else 3 / (length_s * NEAR)
        tops = tops[(tops * spacing > max(least_hz, 6 / length_s)) & (tops * spacing < 0.45 * rate)]
        for top in sorted(tops[level[tops] > most.max() - RANGE_DB], key=lambda k: -level[k]):
            left, middle, right = level[top - 1 : top + 2]
            hz = (top + 0.5 * (left - right) / (left - 2 * middle + right)) * spacing
            if len(lines) < MAX_LINES and all(abs(hz - other) > max(NEAR * other, 4 / length_s) for other, _ in lines):
                lines.append((hz, guess_decay(part, rate, hz)))
    return lines


def find_floor(level, spacing, length_s):
    """(n) median of a spectrum [dB] within 400 Hz, or within 5 % where that is more: next to a strong line in a room, its flicker."""
    bins = numpy.arange(len(level))
    coarse = max(1, round(20 / spacing))
    wide = numpy.interp(bins, bins[::coarse], scipy.ndimage.median_filter(level[::coarse], 41))
    points = numpy.geomspace(1, len(level) - 1, 4000)
    near = scipy.ndimage.median_filter(level[points.astype(int)], 1 + round(0.1 / math.log(points[1] / points[0])))
    return numpy.where(bins * spacing > 240 / length_s, numpy.maximum(wide, numpy.interp(bins, points, near)), wide)


def guess_decay(part, rate, hz):
    """From the amplitudes in the two halves of a window."""
    half = len(part) // 2
    wave = numpy.exp(-2j * math.pi * hz / rate * numpy.arange(half)) * numpy.hanning(half)
    first, second = abs(part[:half] @ wave), abs(part[half : 2 * half] @ wave)
    return float(numpy.clip(math.log((first + 1e-30) / (second + 1e-30)) * rate / half, 0.3, 400.0))


class DampedSines:
    """Least squares of damped sines, amplitudes eliminated. x: (2 K) angular frequencies [rad/s], then decays [1/s]."""

    def __init__(self, samples, rate):
        self.samples, self.rate = samples, rate
        self.time_s = numpy.arange(len(samples)) / rate

    def set(self, x):
        """Waves, amplitudes and residual of x; returns half the energy of the residual."""
        half = len(x) // 2
        waves = numpy.exp((1j * x[:half] - x[half:]) * self.time_s[:, None])
        self.basis = numpy.hstack([waves.real, -waves.imag])
        gram = self.basis.T @ self.basis
        self.inverse = numpy.linalg.inv(gram + 1e-13 * numpy.trace(gram) * numpy.eye(2 * half))
        self.parts = self.inverse @ (self.basis.T @ self.samples)
        self.residual = self.samples - self.basis @ self.parts
        return 0.5 * (self.residual**2).sum()

    def calc_normal(self):
        """(2 K, 2 K) and (2 K): normal matrix of the frequencies and decays, with the amplitudes eliminated, and its right-hand side."""
        half = len(self.parts) // 2
        real, imaginary = self.basis[:, :half], -self.basis[:, half:]
        a, b = self.parts[:half] * self.time_s[:, None], self.parts[half:] * self.time_s[:, None]
        jacobian = numpy.hstack([-(real * b + imaginary * a), imaginary * b - real * a])
        mixed = self.basis.T @ jacobian
        return jacobian.T @ jacobian - mixed.T @ self.inverse @ mixed, jacobian.T @ self.residual

    def improve(self, x):
        """(x, (2 K, 2 K) normal matrix) at the least squares from the start x, by the method of Levenberg and Marquardt."""
        cost, damping = self.set(x), 1e-3
        for _ in range(MAX_STEPS):
            normal, slope = self.calc_normal()
            scale = numpy.sqrt(numpy.maximum(numpy.diag(normal), 0.0)) + 1e-30
            while True:
                step = numpy.linalg.solve(normal / numpy.outer(scale, scale) + damping * numpy.eye(len(x)), slope / scale) / scale
                moved = x + step
                moved[len(x) // 2 :] = numpy.clip(moved[len(x) // 2 :], -0.5, 5e3)
                new = self.set(moved)
                if new < cost or damping > 1e3:
                    break
                damping *= 8
            if not new < cost:
                self.set(x)
                break
            x, gain, cost, damping = moved, cost - new, new, max(damping / 8, 1e-9)
            if gain < 1e-6 * cost:
                break
        return x, self.calc_normal()[0]

    def fit(self, lines):
        """(5, K): frequency [Hz] and decay [1/s] of the lines [(hz, decay_per_s)], their standard errors, amplitude. Lines that are not
        certain are left out, and the others fitted again."""
        while True:
            start = numpy.array([2 * math.pi * hz for hz, _ in lines] + [decay for _, decay in lines])
            half = len(lines)
            x, normal = self.improve(start)
            hz, decay, size = x[:half] / (2 * math.pi), x[half:], numpy.hypot(*self.parts.reshape(2, half))
            noise = (self.residual**2).sum() / max(1, len(self.samples) - 4 * half) * self.measure_local_noise(hz)
            sd = numpy.sqrt(numpy.abs(numpy.diag(numpy.linalg.pinv(normal, rcond=1e-14, hermitian=True))) * numpy.tile(noise, 2))
            parts = numpy.sqrt(numpy.abs(numpy.diag(self.inverse)).reshape(2, half).max(axis=0) * noise)
            sane = (size > MIN_SIGNAL * parts) & (decay < 0.1 * 2 * math.pi * hz) & (sd[:half] < 0.02 * 2 * math.pi * hz)
            width = TORN * numpy.minimum(decay[:, None], decay) / (2 * math.pi)
            sane &= ~((numpy.abs(hz[:, None] - hz) < width) & (size[:, None] < size)).any(axis=1)
            if sane.all() or not sane.any():
                return numpy.array([hz, decay, sd[:half] / (2 * math.pi), sd[half:], size])[:, sane]
            lines = list(zip(hz[sane], numpy.maximum(decay[sane], 0.0)))

    def measure_local_noise(self, hz):
        """(K) mean square density of the residual near each frequency, as a share of its mean: noise need not be white."""
        size = len(self.residual)
        power = numpy.abs(numpy.fft.rfft(self.residual * numpy.hanning(size))) ** 2
        smooth = scipy.ndimage.uniform_filter1d(power, max(5, round(60 * size / self.rate)))
        return numpy.maximum(smooth[numpy.minimum(numpy.round(hz * size / self.rate).astype(int), len(smooth) - 1)] / power.mean(), 0.05)


def find_room(residual, samples, rate):
    """T60 [s] of sound that decays and is none of the lines; None if the residual is steady or weak."""
    step = round(0.02 * rate)
    count = len(residual) // step
    left, whole = ((part[: count * step].reshape(count, step) ** 2).mean(axis=1) for part in (residual, samples))
    floor = numpy.median(left[-max(2, count // 4) :])
    if not (left[:3].mean() > 4 * floor and left[:3].mean() > 1e-4 * whole[:3].mean()):
        return None
    last = next((k for k in range(3, count) if left[k] < 3 * floor), count)
    slope = numpy.polyfit(numpy.arange(last) * 0.02, 10 * numpy.log10(left[:last]), 1)[0]
    return min(60 / max(-slope, 6.0), 10.0)


class RoomDecays:
    """Decays of lines with the sound of the room as noise, by maximum likelihood.

    A response of the room that is noise under exp(-r t) adds A exp(-d t) W(t) to a line A exp(-d t), W Brownian with the variance
    R 2 r (exp(2 (d - r) t) - 1) / (2 (d - r)); R: energy of the room over that of the direct sound. So the covariance of the line's
    amplitudes in time is known, up to r and R, which all lines share."""

    def __init__(self, sines, modes):
        """sines: at its least squares; modes: (5, K) of it."""
        step = max(1, round(ROOM_STEP_S * sines.rate))
        self.count = len(sines.samples) // step
        self.time_s = (numpy.arange(self.count) + 0.5) * step / sines.rate
        hz, decay, _, _, size = modes
        half = len(hz)
        sines.set(numpy.concatenate([2 * math.pi * hz, decay]))
        self.lines = []
        for k in numpy.flatnonzero(decay > 0.5):
            near = numpy.flatnonzero(numpy.abs(hz - hz[k]) < ROOM_BAND_HZ)
            if (size[near] > ROOM_MINOR * size[k]).sum() > 1:
                continue  # a pair, or the flicker of a stronger line
            own = sines.residual + sines.basis[:, [*near, *near + half]] @ sines.parts[[*near, *near + half]]
            turned = 2 * own * numpy.exp(-2j * math.pi * hz[k] * sines.time_s)
            blocks = turned[: self.count * step].reshape(self.count, step).mean(axis=1)
            rest = numpy.abs(numpy.diff(blocks, 2, prepend=0, append=0)) ** 2 / 6
            rest[[0, -1]] = rest[[1, -2]]
            noise = numpy.maximum(scipy.ndimage.uniform_filter1d(rest, 9), 1e-12 * size[k] ** 2)
            self.lines.append((int(k), blocks, decay[k], size[k], noise))

    def calc_cost(self, line, decay, turn, rate, share):
        """- ln of the likelihood of a line. turn: of its frequency [rad/s]; rate: r; share: R."""
        _, blocks, _, size, noise = line
        mean = numpy.exp(-(decay + 1j * turn) * self.time_s)
        first = numpy.minimum.outer(self.time_s, self.time_s)
        gap = 2 * (decay - rate) if abs(decay - rate) > 1e-6 else 1e-6
        walk = 2 * rate * share * numpy.expm1(numpy.minimum(gap * first, 60.0)) / gap
        decays = numpy.exp(-decay * self.time_s)
        factor = scipy.linalg.cholesky(size**2 * walk * numpy.outer(decays, decays) + numpy.diag(noise), lower=True)
        white = scipy.linalg.solve_triangular(factor, numpy.stack([blocks, mean], axis=1), lower=True)
        left = white[:, 0] - white[:, 1] * (numpy.vdot(white[:, 1], white[:, 0]) / numpy.vdot(white[:, 1], white[:, 1]).real)
        return (numpy.abs(left) ** 2).sum() + 2 * numpy.log(numpy.diag(factor)).sum()

    def fit(self):
        """({line: (decay, standard error)}, T60 of the room [s])."""
        at = {line[0]: (line[2], 0.0) for line in self.lines}
        for _ in range(2):
            costs = {
                (t60, share): sum(self.calc_cost(line, *at[line[0]], T60_DECAY / t60, share) for line in self.lines)
                for t60 in ROOM_T60_S
                for share in ROOM_LEVELS
            }
            t60, share = min(costs, key=costs.get)
            for line in self.lines:
                start = numpy.array(at[line[0]])
                simplex = start + 0.2 * start[0] * numpy.array([[0, 0], [1, 0], [0, 1]])
                found = scipy.optimize.minimize(
                    lambda x, line=line: self.calc_cost(line, abs(x[0]), x[1], T60_DECAY / t60, share),
                    start,
                    method="Nelder-Mead",
                    options={"initial_simplex": simplex, "maxfev": 60, "xatol": 1e-3, "fatol": 1e-2},
                )
                at[line[0]] = (abs(found.x[0]), found.x[1])
        result = {}
        for line in self.lines:
            decay, turn = at[line[0]]
            around = [self.calc_cost(line, decay * (1 + move), turn, T60_DECAY / t60, share) for move in (-0.1, 0.0, 0.1)]
            bend = (around[0] - 2 * around[1] + around[2]) / (0.1 * decay) ** 2
            result[line[0]] = (decay, bend**-0.5 if bend > 0 else decay)
        return result, t60


def is_hum(hz):
    """Next to a multiple of 50 or 60 Hz."""
    return hz < 1500 and min(abs(hz / mains - round(hz / mains)) * mains for mains in (50, 60)) < 0.5


def hear(samples, rate):
    """The Hearing of a recorded strike."""
    notes = []
    start, end = find_strike(samples, rate, notes)
    if end - start < 0.5 * MIN_S * rate:
        raise InputError(f"{max(end - start, 0) / rate:.3f} s of sound follow the strike; record it to its end")
    lines = find_lines(samples[start:end], rate)
    if not lines:
        raise InputError("no tone stands out of the noise; record a strike nearer to the body")
    length_s = numpy.clip(FIT_DECAYS / min(decay for _, decay in lines), *FIT_S)
    part = samples[start : min(end, start + round(length_s * rate))]
    sines = DampedSines(part, rate)
    modes = sines.fit(lines)
    room_t60_s = find_room(sines.residual, part, rate)
    for _ in range(2):
        added = find_lines(sines.residual, rate, part)[: min(MAX_ADDED, MAX_LINES - modes.shape[1])]
        if not added:
            break
        found = sines.fit([*zip(modes[0], numpy.maximum(modes[1], 0.0)), *added])
        left_t60_s = find_room(sines.residual, part, rate)
        if room_t60_s and left_t60_s:  # these lines are the flicker of the room; the other mode of a pair would have explained the rest
            break
        modes, room_t60_s = found, left_t60_s
    if room_t60_s and room_t60_s < MIN_ROOM_S:
        room_t60_s = None
    if room_t60_s and modes.shape[1] == MAX_LINES and find_lines(sines.residual, rate, part):
        notes.append(f"more than {modes.shape[1]} tones: the weaker ones are left out, and a room would not be noticed")
        room_t60_s = None
    hz, decay, sd_hz, sd_decays, size = modes
    if room_t60_s:
        room = RoomDecays(sines, modes)
        found, room_t60_s = room.fit() if room.lines else ({}, room_t60_s)
        for k, (value, sd) in found.items():
            decay[k], sd_decays[k] = value, sd
    peaks = []
    steady = []
    for k in numpy.argsort(hz):
        sd_angle, sd_decay = 2 * math.pi * sd_hz[k], sd_decays[k]
        if decay[k] < 2 * sd_decay or (decay[k] < 0.3 and is_hum(hz[k])):
            steady.append(hz[k])
            continue
        sd_decay = math.hypot(sd_decay, (ROOM_SHARE if room_t60_s else QUIET_SHARE) * decay[k])
        if room_t60_s:
            sd_angle = math.hypot(sd_angle, ROOM_SHARE * decay[k])
        undamped = math.hypot(hz[k], decay[k] / (2 * math.pi))
        level = 20 * math.log10(size[k] / size.max())
        peaks.append(Peak(undamped, sd_angle / (2 * math.pi), max(decay[k], 1e-3), sd_decay, level))
    if steady:
        named = ", ".join(f"{f:.1f}" for f in steady)
        cause = ", mains hum among them," if any(map(is_hum, steady)) else ""
        notes.append(f"lines that do not decay{cause} are left out: {named} Hz")
    if room_t60_s:
        notes.append(
            f"a room or a rattle is heard: the rest decays in about {room_t60_s:.1f} s (T60). Decays are known to {100 * ROOM_SHARE:.0f} %"
            " at best, and modes that stop sooner than the room sound too long; record in the open, 0.1 m from the body"
        )
    if not peaks:
        raise InputError("no decaying tone stands out of the noise; record a strike nearer to the body")
    return Hearing(peaks, notes, samples[start:], rate, room_t60_s)
