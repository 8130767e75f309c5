"""The pictures of the page: spectrograms, spectra and courses in time, as small PNG files."""
import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
import numpy

SIZE, DPI = (7.6, 3.0), 80


def finish(stage, name, figure):
    figure.tight_layout()
    figure.savefig(stage.out / name, dpi=DPI)
    pyplot.close(figure)
    stage.pictures.append(name)


def draw_spectrogram(axes, samples, rate, window_s, most_hz, depth_db=70):
    """Of the first channel, the strongest place at 0 dB."""
    size = int(window_s * rate)
    column = samples.reshape(len(samples), -1)[:, 0]
    column = numpy.concatenate([numpy.zeros(size // 2), column, numpy.zeros(size // 2)])
    starts = numpy.arange(0, len(column) - size, max(1, size // 8))
    rows = numpy.array([abs(numpy.fft.rfft(column[at : at + size] * numpy.hanning(size), 2 * size)) for at in starts])
    level = 20 * numpy.log10(rows.T + 1e-12)
    kept = int(most_hz / (rate / (2 * size))) + 1
    extent = (0, starts[-1] / rate, 0, (kept - 1) * rate / (2 * size))
    axes.imshow(level[:kept], origin="lower", aspect="auto", extent=extent, cmap="magma", vmin=level.max() - depth_db, vmax=level.max())
    axes.set_xlabel("time [s]")
    axes.set_ylabel("frequency [Hz]")


def draw_fall(stage, name, samples, rate, impacts_s, lines_hz, most_hz):
    """Spectrogram of a fall with its impacts (ticks above) and the modes of the mesh (ticks at the right)."""
    figure, axes = pyplot.subplots(figsize=(7.6, 4.0))
    draw_spectrogram(axes, samples, rate, 0.02, most_hz)
    right = axes.secondary_yaxis("right")
    right.set_yticks([hz for hz in lines_hz if hz < most_hz], [""] * sum(hz < most_hz for hz in lines_hz))
    right.set_ylabel("modes of the mesh")
    above = axes.secondary_xaxis("top")
    above.set_xticks(impacts_s, [str(i) for i in range(1, len(impacts_s) + 1)])
    finish(stage, name, figure)


def draw_spectra(stage, name, curves, most_hz, wanted_hz, floor_db=-70):
    """curves: [(label, frequencies, levels)], one below the other; wanted_hz as vertical lines."""
    figure, all_axes = pyplot.subplots(len(curves), 1, sharex=True, figsize=(7.6, 1.3 * len(curves) + 0.6))
    for axes, (label, freq, level) in zip(numpy.atleast_1d(all_axes), curves):
        kept = freq <= most_hz
        axes.plot(freq[kept], level[kept] - level[kept].max(), linewidth=0.9, color="#2f6690")
        for hz in wanted_hz:
            axes.axvline(hz, color="#d1495b", linewidth=0.8, linestyle="--")
        axes.set_ylim(floor_db, 5)
        axes.set_xlim(0, most_hz)
        axes.set_ylabel("dB")
        axes.text(0.99, 0.85, label, transform=axes.transAxes, ha="right", va="top", fontsize=9)
    axes.set_xlabel("frequency [Hz]")
    finish(stage, name, figure)


def draw_courses(stage, name, rows, marks_s=()):
    """rows: [(label of the axis, [(label, times, values, style)])] over one axis of time."""
    figure, all_axes = pyplot.subplots(len(rows), 1, sharex=True, figsize=(7.6, 1.6 * len(rows) + 0.6))
    for axes, (label, curves) in zip(numpy.atleast_1d(all_axes), rows):
        for text, times, values, style in curves:
            axes.plot(times, values, style, linewidth=1.2, label=text)
        for mark in marks_s:
            axes.axvline(mark, color="#d1495b", linewidth=0.8, linestyle=":")
        axes.set_ylabel(label)
        if any(curve[0] for curve in curves):
            axes.legend(fontsize=8, loc="upper right")
    axes.set_xlabel("time [s]")
    finish(stage, name, figure)


def draw_pendulum(stage, name, samples, rate, times, rows):
    """Spectrogram to 2500 Hz; below it, over the same time, rows: [(label of the axis, [(label, values, style)])]."""
    figure, (above, *others) = pyplot.subplots(1 + len(rows), 1, sharex=True, figsize=(7.6, 1.7 * (1 + len(rows))))
    draw_spectrogram(above, samples, rate, 0.1, 2500)
    above.set_xlabel("")
    for axes, (label, curves) in zip(others, rows):
        for text, values, style in curves:
            axes.plot(times, values, style, linewidth=1.2, label=text)
        if len(curves) > 1:
            axes.legend(fontsize=8, loc="upper right")
        axes.set_ylabel(label)
    others[-1].set_xlabel("time [s]")
    others[-1].set_xlim(0, times[-1])
    finish(stage, name, figure)
