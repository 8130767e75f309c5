#!/usr/bin/python3
"""Frequencies and decays as they are in a sound, not as a bank says they are.

usage: measure.py SOUND.wav [--from S] [--to S] [--low HZ] [--high HZ] [--count N]

Peaks: the sound under a Hann window, padded with zeros to four times its length or more, both ears added in power; a local maximum of the
level is placed by the parabola through it and its two neighbours. Decay: the band about the peak is cut out (raised-cosine edges), and a
straight line is fitted by least squares through the logarithm of its envelope (the size of the analytic signal).
"""
import argparse
import pathlib
import struct

import numpy


def read_chunks(file):
    """The chunks of a RIFF file: {name: bytes}."""
    data = pathlib.Path(file).read_bytes()
    if data[:4] != b"RIFF" or data[8:12] != b"WAVE":
        raise SystemExit(f"{file} is no WAV file")
    chunks, at = {}, 12
    while at + 8 <= len(data):
        name, size = struct.unpack_from("<4sI", data, at)
        chunks[name] = data[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    return chunks


def read_wav(file):
    """(rate, samples of full scale 1 as (N, channels)) of a PCM file of 16 or 24 bits, or of floats of 32 bits."""
    chunks = read_chunks(file)
    kind, channels, rate, _, _, bits = struct.unpack_from("<HHIIHH", chunks[b"fmt "])
    if kind == 3:
        return rate, numpy.frombuffer(chunks[b"data"], dtype="<f4").reshape(-1, channels).astype(float)
    width = bits // 8
    raw = numpy.frombuffer(chunks[b"data"], dtype=numpy.uint8).reshape(-1, width)
    value = sum(raw[:, i].astype(numpy.int64) << (8 * i) for i in range(width))
    value = numpy.where(value >= 1 << (8 * width - 1), value - (1 << (8 * width)), value)
    return rate, value.reshape(-1, channels) / float(1 << (8 * width - 1))


def calc_spectrum(samples, rate):
    """(frequencies [Hz], levels [dB], any reference) of (N,) or (N, channels) samples."""
    columns = samples.reshape(len(samples), -1)
    length = 1 << int(numpy.ceil(numpy.log2(4 * len(columns))))
    power = sum(abs(numpy.fft.rfft(column * numpy.hanning(len(column)), length)) ** 2 for column in columns.T)
    return numpy.arange(len(power)) * rate / length, 10 * numpy.log10(power + 1e-300)


def find_peaks(samples, rate, low_hz=20.0, high_hz=20000.0, count=8, floor_db=60.0):
    """The `count` strongest peaks [(Hz, dB re the strongest)] between low and high, ascending in Hz; none that lies floor_db or more below
    the strongest, or within two widths of the window's main lobe of a stronger one."""
    freq, level = calc_spectrum(samples, rate)
    inside = (freq[1:-1] >= low_hz) & (freq[1:-1] <= high_hz)
    tops = 1 + numpy.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:]) & inside)
    lobe_hz = 4 * rate / len(samples)
    kept = []
    for top in tops[numpy.argsort(-level[tops])]:
        below, at, above = level[top - 1 : top + 2]
        shift = 0.5 * (below - above) / (below - 2 * at + above)
        hz = (top + shift) * freq[1]
        if kept and at < kept[0][1] - floor_db:
            break
        if all(abs(hz - other) > lobe_hz for other, _ in kept):
            kept.append((hz, at))
        if len(kept) == count:
            break
    return sorted((hz, at - kept[0][1]) for hz, at in kept)


def find_peak(samples, rate, near_hz, within=0.03):
    """The frequency [Hz] of the strongest peak within a share of near_hz."""
    peaks = find_peaks(samples, rate, near_hz * (1 - within), near_hz * (1 + within), 1)
    if not peaks:
        raise SystemExit(f"there is no peak within {100 * within:g} % of {near_hz:g} Hz")
    return peaks[0][0]


def calc_decay(samples, rate, hz, half_width_hz, depth_db=40.0):
    """The decay rate d [1/s] of what rings within half_width_hz of hz, amplitude ~ e^(-d t). Fitted from the envelope's top until it has
    fallen by depth_db; the two ends of the sound, where the filter rings, are left out."""
    column = samples.reshape(len(samples), -1)[:, 0]
    spectrum = numpy.fft.fft(column)
    freq = numpy.fft.fftfreq(len(column), 1 / rate)
    away = abs(freq - hz) / half_width_hz
    envelope = abs(numpy.fft.ifft(2 * spectrum * numpy.where(away < 1, 0.5 + 0.5 * numpy.cos(numpy.pi * away), 0)))
    edge = int(2 * rate / half_width_hz)
    envelope = envelope[edge : len(envelope) - edge]
    envelope = envelope[numpy.argmax(envelope) :]
    low = numpy.flatnonzero(envelope < envelope[0] * 10 ** (-depth_db / 20))
    envelope = envelope[: low[0]] if len(low) else envelope
    if len(envelope) < 0.01 * rate:
        raise SystemExit(f"what rings at {hz:g} Hz is too short for its decay")
    return -numpy.polyfit(numpy.arange(len(envelope)) / rate, numpy.log(envelope), 1)[0]


def main():
    parser = argparse.ArgumentParser(description="Prints the strongest peaks of a sound and their decays.")
    parser.add_argument("sound", type=pathlib.Path)
    parser.add_argument("--from", dest="begin", type=float, default=0.0, help="seconds")
    parser.add_argument("--to", dest="end", type=float, default=None, help="seconds")
    parser.add_argument("--low", type=float, default=20.0, help="Hz")
    parser.add_argument("--high", type=float, default=20000.0, help="Hz")
    parser.add_argument("--count", type=int, default=8)
    options = parser.parse_args()
    rate, samples = read_wav(options.sound)
    samples = samples[int(options.begin * rate) : None if options.end is None else int(options.end * rate)]
    for hz, level in find_peaks(samples, rate, options.low, options.high, options.count):
        print(f"{hz:10.2f} Hz  {level:7.1f} dB")


if __name__ == "__main__":
    main()
