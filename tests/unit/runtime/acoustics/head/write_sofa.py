#!/usr/bin/python3
"""Writes a SOFA file (AES69, SimpleFreeFieldHRIR) as a netCDF library would, of pulses whose delay and level follow a law.

usage: write_sofa.py FILE KEY=VALUE ...

The left ear hears a source in the direction d with the level 1 + 0.5 d_y, (28 - 10 d_y) / 44100 s after the beginning of the response; the
right ear with -d_y in place of d_y. The pulse is a sinc that ends at 16 kHz, under a Gaussian.
keys: rate, taps, step (degrees of azimuth and elevation), low and high (elevations), span (degrees of azimuth), level, near (1: a second
distance, twice as loud), delay (samples in Data.Delay, 0 to 4), convention, type (of coordinates), fault (nan, short, silent, late)
"""
import sys

import h5py
import numpy as np

OPTIONS = {
    "rate": 44100.0,
    "taps": 128,
    "step": 10,
    "low": -90,
    "high": 90,
    "span": 360,
    "level": 1.0,
    "near": 0,
    "delay": 0,
    "convention": "SimpleFreeFieldHRIR",
    "type": "spherical",
    "fault": "",
}


def make_sources(options):
    """Azimuth, elevation and distance (M, 3); each pole as often as there are azimuths."""
    azimuths = np.arange(0, options["span"], options["step"])
    elevations = np.arange(options["low"], options["high"] + 1, options["step"])
    grid = np.array([(a, e, 1.5) for e in elevations for a in azimuths], dtype=float)
    return np.concatenate([grid * [1, 1, 0.3], grid]) if options["near"] else grid


def to_cartesian(sources):
    azimuth, elevation = np.radians(sources[:, 0]), np.radians(sources[:, 1])
    unit = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    return unit * sources[:, 2:]


def make_responses(options, sources):
    """(M, 2, taps)"""
    rate, taps = options["rate"], options["taps"]
    left = to_cartesian(sources)[:, 1] / sources[:, 2]
    loud = np.where(sources[:, 2] < 1.0, 2.0, 1.0) * options["level"]
    time = np.arange(taps) / rate
    responses = np.zeros((len(sources), 2, taps))
    for ear, side in enumerate((1, -1)):
        delay = (28.0 - 10.0 * side * left) / 44100.0 - options["delay"] * (1 - ear) / rate
        t = time[None, :] - delay[:, None]
        responses[:, ear] = (loud * (1 + 0.5 * side * left))[:, None] * np.sinc(32000.0 * t) * np.exp(-((t / 0.0002) ** 2)) * 32000.0 / rate
    return responses


def write(path, options):
    sources = make_sources(options)
    responses = make_responses(options, sources)
    fault = options["fault"]
    if fault == "nan":
        responses[5, 1, 3] = np.nan
    elif fault == "silent":
        responses[:] = 0.0
    elif fault == "late":
        responses[40] = np.roll(responses[40], 1000, axis=1)
    sizes = {"I": 1, "C": 3, "R": 2, "E": 1, "N": options["taps"], "M": len(sources)}
    with h5py.File(path, "w", libver=("v108", "v108"), track_order=True) as file:
        names = {"Conventions": "SOFA", "Version": "1.0", "SOFAConventions": options["convention"], "SOFAConventionsVersion": "1.0"}
        for name, text in {**names, "DataType": "FIR", "RoomType": "free field"}.items():
            file.attrs[name] = np.string_(text)
        scales = {}
        for name, size in sizes.items():
            scales[name] = file.create_dataset(name, shape=(size,), dtype=">f4")
            scales[name].make_scale(f"This is a netCDF dimension but not a netCDF variable.{size:10d}")

        def put(name, values, dimensions, **attributes):
            data = file.create_dataset(name, data=np.asarray(values, dtype="f8"))
            for i, dimension in enumerate(dimensions):
                data.dims[i].attach_scale(scales[dimension])
            for key, text in attributes.items():
                data.attrs[key] = np.string_(text)

        metres = {"Type": "cartesian", "Units": "metre"}
        put("ListenerPosition", np.zeros((1, 3)), "IC", **metres)
        put("ListenerView", [[1, 0, 0]], "IC", **metres)
        put("ListenerUp", [[0, 0, 1]], "IC", **metres)
        put("ReceiverPosition", [[[0], [0.09], [0]], [[0], [-0.09], [0]]], "RCI", **metres)
        put("EmitterPosition", np.zeros((1, 3, 1)), "ECI", **metres)
        if options["type"] == "cartesian":
            put("SourcePosition", to_cartesian(sources), "MC", **metres)
        else:
            put("SourcePosition", sources, "MC", Type=options["type"], Units="degree, degree, metre")
        put("Data.SamplingRate", [options["rate"]], "I", Units="hertz")
        put("Data.Delay", [[options["delay"], 0.0]], "IR")
        put("Data.IR", responses[: len(sources) // 2] if fault == "short" else responses, "MRN")


if __name__ == "__main__":
    chosen = dict(OPTIONS)
    for word in sys.argv[2:]:
        key, value = word.split("=")
        chosen[key] = type(OPTIONS[key])(value)
    write(sys.argv[1], chosen)
