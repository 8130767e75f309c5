"""The six chimes of OSG02: their base frequencies as they are in the rendered sound."""
import math

import measure
import stage as tools

# OSG02 Table 2 (lengths in metres, Hz): measured length, measured, computed. Then the first bending frequency of exactly this tube in
# three-dimensional elasticity (Fourier-Ritz, 8 digits), a figure that owes nothing to this program.
CHIMES = {
    "D5": (0.505, 585.8, 589.17, 587.883),
    "E5": (0.475, 656.0, 665.03, 663.240),
    "G5": (0.435, 781.8, 787.01, 788.365),
    "A5": (0.410, 877.5, 884.70, 885.305),
    "B5": (0.388, 982.5, 984.75, 986.083),
    "D6": (0.353, 1167.0, 1186.88, 1185.467),
}
QUICK = {"body.nodes": 2000, "band_hz": [20, 4000]}


def play(stage):
    for name, row in CHIMES.items():
        stage.solve("chime.json", name, {"body.length_m": row[0]}, QUICK)
    rate, samples, _ = stage.render("chimes", tools.read_json(stage.folder / "scene.json"))
    tail = samples[int(2.7 * rate) :]  # all six ring
    rows = [("chime", "length [m]", "in the sound [Hz]", "exact 3-D", "off", "OSG02 computed", "off", "OSG02 measured", "off")]
    for name, (length, measured, computed, exact) in CHIMES.items():
        hz = measure.find_peak(tail, rate, exact)
        off = lambda other: f"{100 * (hz / other - 1):+.2f} %"
        rows.append(
            (name, length, f"{hz:.2f}", f"{exact:.2f}", off(exact), f"{computed:.2f}", off(computed), f"{measured:.1f}", off(measured))
        )
        stage.compare(f"{name} in the sound against three-dimensional elasticity [Hz]", hz, exact, 0.5 if stage.quick else 0.1)
        stage.compare(f"{name} in the sound against the real chime [Hz]", hz, measured, 2.0)
    print()
    stage.show("chimes", rows)

    # Table 1 has the D: base frequency 587.4 (of the adjusted length) and decay 0.6.
    base = measure.find_peak(tail, rate, CHIMES["D5"][3])
    decay = measure.calc_decay(tail, rate, base, 20.0)
    print(
        f"\n  D5, base frequency and decay: in the sound {base:.2f} Hz, {decay:.3f} 1/s; OSG02 Table 1: 587.4 Hz (length 0.5061 m), 0.6 1/s"
        "\n  erratum: 1e-7 s (2 pi 587.4 Hz)^2 / 2 = 0.681 1/s, which the paper cut to 0.6"
    )
    stage.compare("decay of D5 in the sound against alpha1 omega^2 / 2 [1/s]", decay, 1e-7 * (2 * math.pi * base) ** 2 / 2, 2.0)
    stage.draw("chime-modes.png", "modes", "D5.hdf", "--modes", "1")
