"""Rendering with carillon-render, and differences of two sounds.

Three measures of two whole sounds with the same microphones:
  error_db      sound exposure of the difference relative to the reference, A-weighted (IEC 61672-1:2013, E.4.2), 20 Hz to 20 kHz, all
                channels. Phase-sensitive: inaudible below -40 dB, meaningless for sounds that drift apart.
  distance_db   log-spectral distance: RMS level difference in dB over third-octave bands (IEC 61260-1) and frames of 43 ms. Counts cells
                where either sound exceeds a floor of 60 dB below the reference's loudest cell, at least 0 dB re 20 uPa; softer levels
                are raised to the floor. Insensitive to phase. Inaudible below 1 dB with at most 2 % of the frames more than 2 dB off
                (outliers; Paliwal & Atal 1993).
  loudness_db   change of the maximum A-weighted level over the ear's integration time, 0.2 s (Zwislocki 1969), in dB(A). Loudness by
                ISO 131: sones = 2^((L - 40 dB) / 10), L the A-weighted level, so 10 dB double the loudness. 1 dB is just noticeable
                (Jesteadt, Wier & Green 1977).
"""
import dataclasses
import json
import math
import pathlib

import measuring
from errors import InputError, RunError

try:
    import numpy as np
except ImportError:
    raise InputError("this section of the study needs numpy; install python3-numpy") from None

REFERENCE_PA = 20e-6
EAR_S = 0.2
FRAME_S = 0.0427
RANGE_DB = 60.0
LOW_HZ, HIGH_HZ = 20.0, 20000.0
# Full scale per pascal in float files, small enough to avoid any scaling down.
GAIN_PER_PA = 1e-6
# Thresholds of audibility (above).
NONE_DB = -200.0  # equal up to the rounding of the sums
ERROR_LIMIT_DB, DISTANCE_LIMIT_DB, LOUDNESS_LIMIT_DB = -40.0, 1.0, 1.0
OUTLIER_DB, OUTLIER_LIMIT = 2.0, 0.02


def find_spread(values):
    """Half the range over the median; 0 if the median is 0."""
    return measuring.find_spread(values) if measuring.find_median(values) > 0 else 0.0


@dataclasses.dataclass
class Sound:
    rate_hz: int
    pressure_pa: np.ndarray  # (samples, channels)


@dataclasses.dataclass
class Played:
    """A rendered scene. Times: CPU seconds per second of sound; playing_s: one entry per repeat."""

    sound: Sound
    playing_s: list
    physics_s: list
    report: dict

    @property
    def cpu_ms(self):
        """Median CPU ms per second of sound, without physics."""
        return 1e3 * float(np.median(self.playing_s))

    @property
    def spread(self):
        return find_spread(self.playing_s)

    @property
    def physics_spread(self):
        return find_spread(self.physics_s)

    @property
    def physics_ms(self):
        """Median CPU ms of the physics per second."""
        return 1e3 * float(np.median(self.physics_s))


@dataclasses.dataclass
class Difference:
    error_db: float
    distance_db: float
    loudness_db: float
    outliers: float = 0.0  # share of frames more than OUTLIER_DB off

    @property
    def is_audible(self):
        """True if the difference is audible: waveform error above -40 dB, and bands or loudness above threshold."""
        bands = self.distance_db > DISTANCE_LIMIT_DB or self.outliers > OUTLIER_LIMIT
        return self.error_db > ERROR_LIMIT_DB and (bands or abs(self.loudness_db) > LOUDNESS_LIMIT_DB)

    def to_cells(self):
        return format_db(self.error_db), f"{self.distance_db:.2f}", f"{100 * self.outliers:.0f} %", format_change(self.loudness_db)

    def to_data(self):
        return self.error_db, self.distance_db, self.outliers, self.loudness_db, int(self.is_audible)


HEAD = ("error, dB(A)", "log-spectral distance, dB", "frames off", "loudness, dB(A)")
DATA = ("error_dba", "log_spectral_distance_db", "frames_off", "loudness_change_dba", "audible")
NO_CELLS, NO_DATA = ("-",) * len(HEAD), (-300.0, 0.0, 0.0, 0.0, "")  # of the reference


def format_db(value):
    return "none" if value < NONE_DB else f"{value:.0f}"


def format_change(value):
    """Formats with sign, without negative zero."""
    return f"{round(value, 2) + 0.0:+.2f}"


# --- rendering


def read_wav(data, name="the WAV"):
    """Samples of a WAV file of 32-bit floats, in full scale. ValueError for other formats."""
    if data[:4] != b"RIFF" or data[8:12] != b"WAVE":
        raise ValueError(f"{name} is no WAV")
    chunks, at = {}, 12
    while at + 8 <= len(data):
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        chunks[data[at : at + 4]] = data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    form = chunks.get(b"fmt ", b"")
    kind, channels, rate = (int.from_bytes(form[a:b], "little") for a, b in ((0, 2), (2, 4), (4, 8)))
    if kind == 0xFFFE:
        kind = int.from_bytes(form[24:26], "little")
    if kind != 3 or channels < 1 or form[14:16] != b"\x20\x00" or b"data" not in chunks:
        raise ValueError(f"{name} does not hold numbers of 32-bit floating point")
    return Sound(rate, np.frombuffer(chunks[b"data"], "<f4").reshape(-1, channels).astype(float))


def play(lab, name, scene, repeats=1, contacts=None, record=None):
    """Renders the scene with carillon-render; returns Played, in pascals. Banks and contact files need absolute paths. RunError if the
    program fails."""
    folder = lab.out / "work/sounds"
    folder.mkdir(parents=True, exist_ok=True)
    scene = dict(scene) | {"output": {"gain": GAIN_PER_PA, "format": "float"}}
    scene_file, wav, report_file = (folder / f"{name}.{ending}" for ending in ("scene.json", "wav", "report.json"))
    scene_file.write_text(json.dumps(scene, indent=1) + "\n")
    words = [lab.find_program("carillon-render"), scene_file.name, "-q", "-o", wav.name, "--report", report_file.name]
    words += (["--contacts", contacts] if contacts else []) + (["--record", record] if record else [])
    playing, physics = [], []
    for _ in range(repeats):
        lab.call(words, f"carillon-render {name}", cwd=folder)
        report = json.loads(report_file.read_text())
        playing.append(report["playing_cpu_s"] / report["duration_s"])
        physics.append(report["physics_cpu_s"] / report["duration_s"])
    try:
        sound = read_wav(wav.read_bytes(), wav)
    except ValueError as error:
        raise RunError(4, str(error)) from None
    finally:
        wav.unlink(missing_ok=True)
    return Played(Sound(sound.rate_hz, sound.pressure_pa / report["gain_per_pa"]), playing, physics, report)


def play_all(lab, scenes, repeats=None, contacts=None):
    """{name: Played} of {name: scene}. Rounds alternate in direction, so that other load affects all scenes equally."""
    repeats = repeats or lab.repeats
    played = {}
    for number in range(repeats):
        for name in list(scenes) if number % 2 == 0 else reversed(list(scenes)):
            now = play(lab, name, scenes[name], contacts=contacts)
            if name not in played:
                played[name] = now
            else:
                played[name].playing_s += now.playing_s
                played[name].physics_s += now.physics_s
    return played


# --- banks


TYPES = {"<f8": "<f8", "<f4": "<f4", "<i8": "<i8", "<i4": "<i4", "<i2": "<i2", "|i1": "|i1", "|u1": "|u1"}


def read_arrays(path, names):
    """{name: array} from the table of a bank's seal (docs/bank-format.md); missing arrays are left out."""
    data = pathlib.Path(path).read_bytes()
    arrays = {}
    for line in data[:4032].decode().splitlines()[2:]:
        words = line.split(" ")
        if words[0] != "field" or words[1] not in names or words[2] not in TYPES:
            continue
        extents = list(map(int, words[4:]))
        arrays[words[1]] = np.frombuffer(data, TYPES[words[2]], math.prod(extents), int(words[3])).reshape(extents)
    return arrays


# --- differences


def calc_a_weight(freq_hz):
    """A-weighting as an amplitude factor, 1 at 1 kHz, 0 outside the audible band."""
    f2 = np.square(np.asarray(freq_hz, float))
    weight = (
        1.2589254
        * 12194.217**2
        * f2
        * f2
        / ((f2 + 20.598997**2) * np.sqrt((f2 + 107.65265**2) * (f2 + 737.86223**2)) * (f2 + 12194.217**2))
    )
    return np.where((freq_hz >= LOW_HZ) & (freq_hz <= HIGH_HZ), weight, 0.0)


def resample(sound, rate_hz):
    """Band-limited resampling: truncates or zero-pads the spectrum."""
    if sound.rate_hz == rate_hz:
        return sound
    count = len(sound.pressure_pa)
    wanted = round(count * rate_hz / sound.rate_hz)
    spectrum = np.fft.rfft(sound.pressure_pa, axis=0)
    kept = np.zeros((wanted // 2 + 1, spectrum.shape[1]), complex)
    bins = min(len(kept), len(spectrum), (min(count, wanted) + 1) // 2)
    kept[:bins] = spectrum[:bins]
    return Sound(rate_hz, np.fft.irfft(kept, wanted, axis=0) * wanted / count)


def match(reference, other):
    """Both sounds at the higher rate, truncated to equal length."""
    rate = max(reference.rate_hz, other.rate_hz)
    a, b = resample(reference, rate).pressure_pa, resample(other, rate).pressure_pa
    if a.shape[1] != b.shape[1]:
        raise ValueError("two sounds with different numbers of channels")
    count = min(len(a), len(b))
    return rate, a[:count], b[:count]


def to_db(ratio):
    return 10 * math.log10(ratio) if ratio > 1e-30 else -300.0


def calc_error_db(reference, other):
    rate, a, b = match(reference, other)
    size = 2 * len(a)
    weight = calc_a_weight(np.fft.rfftfreq(size, 1 / rate))[:, None] ** 2
    exposure = lambda x: float((np.abs(np.fft.rfft(x, size, axis=0)) ** 2 * weight).sum())
    whole = exposure(a)
    return to_db(exposure(b - a) / whole) if whole > 0 else -300.0


def calc_bands(pressure, rate):
    """(frames, bands): mean square [Pa^2] in third-octave bands, summed over channels. Bands narrower than three FFT bins are left out."""
    size = 2 ** round(math.log2(FRAME_S * rate))
    hop = size // 4
    phase = 2 * np.pi * np.arange(size) / size
    window = (
        0.35875 - 0.48829 * np.cos(phase) + 0.14128 * np.cos(2 * phase) - 0.01168 * np.cos(3 * phase)
    )  # Harris 1978: sidelobes below -92 dB
    padded = np.concatenate([np.zeros((size - hop, pressure.shape[1])), pressure, np.zeros((size, pressure.shape[1]))])
    frames = np.lib.stride_tricks.sliding_window_view(padded, size, axis=0)[::hop]  # (frames, channels, size)
    freq = np.fft.rfftfreq(size, 1 / rate)
    middles = 1000.0 * 10.0 ** (np.arange(-17, 14) / 10)
    edges = [(m * 10**-0.05, m * 10**0.05) for m in middles]
    edges = [(low, high) for low, high in edges if (high - low) >= 3 * rate / size and high <= rate / 2]
    members = np.array([(freq >= low) & (freq < high) for low, high in edges], float).reshape(len(edges), len(freq))
    out = np.empty((len(frames), len(edges)))
    for first in range(0, len(frames), 64):  # in chunks, to limit memory
        power = np.abs(np.fft.rfft(frames[first : first + 64] * window, axis=-1)) ** 2
        out[first : first + 64] = power.sum(axis=1) @ members.T
    return out * 2 / (size * np.square(window).sum())


def calc_distance(reference, other):
    """(dB, share of frames more than OUTLIER_DB off)."""
    rate, a, b = match(reference, other)
    first, second = calc_bands(a, rate), calc_bands(b, rate)
    if first.size == 0 or not first.max() > 0:
        return 0.0, 0.0
    floor = max(first.max() * 10 ** (-RANGE_DB / 10), REFERENCE_PA**2)
    counts = (first > floor) | (second > floor)
    if not counts.any():
        return 0.0, 0.0
    squares = np.square(10 * np.log10(np.maximum(first, floor) / np.maximum(second, floor)))
    of_frames = np.sqrt(squares.sum(axis=1, where=counts) / np.maximum(counts.sum(axis=1), 1))[counts.any(axis=1)]
    return float(np.sqrt(np.mean(squares[counts]))), float(np.mean(of_frames > OUTLIER_DB))


def calc_loudest_db(sound):
    """Maximum A-weighted level over EAR_S, dB(A) re 20 uPa, mean square of all channels; -300 for silence."""
    pressure = sound.pressure_pa
    size = 2 * len(pressure)
    weighted = np.fft.irfft(
        np.fft.rfft(pressure, size, axis=0) * calc_a_weight(np.fft.rfftfreq(size, 1 / sound.rate_hz))[:, None], size, axis=0
    )[: len(pressure)]
    square = np.square(weighted).mean(axis=1)
    count = min(max(1, round(EAR_S * sound.rate_hz)), len(square))
    running = np.concatenate([[0.0], np.cumsum(square)])
    return to_db(float((running[count:] - running[:-count]).max()) / count / REFERENCE_PA**2)


def calc_sones(level_dba):
    """ISO 131: 1 sone at 40 dB, doubling every 10 dB."""
    return 2.0 ** ((level_dba - 40.0) / 10.0)


def compare(reference, other):
    """Difference of `other` from `reference`."""
    rate, a, b = match(reference, other)
    a, b = Sound(rate, a), Sound(rate, b)
    loudness = calc_loudest_db(b) - calc_loudest_db(a)
    distance, outliers = calc_distance(a, b)
    return Difference(calc_error_db(a, b), distance, loudness, outliers)
