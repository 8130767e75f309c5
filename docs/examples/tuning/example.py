"""Chimes tuned to the D scale by their lengths, as OSG02 did for Table 2: by solves, not by ear."""
import importlib.machinery
import importlib.util

import measure
import stage as tools

# OSG02 Table 2: pitch wished, adjusted length [m] and what the paper reached with it [Hz]. Last the length that three-dimensional
# elasticity asks for: the first bending frequency of the measured length (see ../chimes) scaled by length^-2, good to 1e-4 over a change of
# length of half a per cent.
NOTES = {
    "D5": (587.33, 0.5061, 587.40, 0.505 * (587.883 / 587.33) ** 0.5),
    "E5": (659.26, 0.4770, 659.27, 0.475 * (663.240 / 659.26) ** 0.5),
    "G5": (783.99, 0.4366, 784.06, 0.435 * (788.365 / 783.99) ** 0.5),
    "A5": (880.00, 0.4115, 879.36, 0.410 * (885.305 / 880.00) ** 0.5),
    "B5": (987.77, 0.3878, 987.32, 0.388 * (986.083 / 987.77) ** 0.5),
    "D6": (1174.66, 0.3548, 1174.67, 0.353 * (1185.467 / 1174.66) ** 0.5),
}
QUICK = {"body.nodes": 2000, "band_hz": [20, 2000]}


def load_tune():
    loader = importlib.machinery.SourceFileLoader("tune", str(tools.HERE / "tune"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("tune", loader))
    loader.exec_module(module)
    return module.tune


def play(stage):
    tune = load_tune()
    notes = dict(list(NOTES.items())[:2]) if stage.quick else NOTES
    tuned = {name: tune(stage, "chime.json", name, row[0], 0.5, quick=QUICK) for name, row in notes.items()}
    scene = tools.read_json(stage.folder / "scene.json")
    scene["bodies"] = [body for body in scene["bodies"] if body["name"] in notes]
    scene["strikes"] = [strike for strike in scene["strikes"] if strike["body"] in notes]
    rate, samples, _ = stage.render("tuning", scene)
    tail = samples[int((max(strike["time_s"] for strike in scene["strikes"]) + 0.05) * rate) :]
    rows = [("chime", "wished [Hz]", "in the sound [Hz]", "rounds", "length [m]", "OSG02's length", "off", "elasticity's", "off")]
    for name, (wished, adjusted, _, exact) in notes.items():
        length, _, tries = tuned[name]
        hz = measure.find_peak(tail, rate, wished)
        rows.append(
            (
                name,
                f"{wished:.2f}",
                f"{hz:.2f}",
                len(tries),
                f"{length:.5f}",
                f"{adjusted:.4f}",
                f"{100 * (length / adjusted - 1):+.2f} %",
                f"{exact:.5f}",
                f"{100 * (length / exact - 1):+.3f} %",
            )
        )
        stage.expect(f"{name} is within 1 Hz of {wished:g} Hz in the sound: {hz:.3f} Hz", abs(hz - wished) <= 1.0)
        stage.compare(f"length of {name} against OSG02's Table 2 [m]", length, adjusted, 0.3)
        stage.compare(f"length of {name} against three-dimensional elasticity [m]", length, exact, 0.2 if stage.quick else 0.05)
    print()
    stage.show("tuning", rows)
