"""OSG02's blocks of 5 cm and boxes of 50 cm: the same hollow cube, ten times as large."""
import copy
import math

import measure
import stage as tools

LENGTHS = ("position_m", "point_m", "look_at_m")
ALPHA1, ALPHA2 = 8e-6, 50.0


def enlarge(scene, times, speeds):
    """The scene ten times as large, with `times` and `speeds` as factors of its seconds and its metres per second, heard with the same
    ears."""
    scene = copy.deepcopy(scene)
    scene["duration_s"] *= times
    for part in [*scene["bodies"], *scene.get("strikes", []), scene["listener"]]:
        for key in part:
            if key in LENGTHS:
                part[key] = [10 * x for x in part[key]]
            elif key == "velocity_m_s":
                part[key] = [speeds * x for x in part[key]]
            elif key in ("time_s", "duration_s"):
                part[key] *= times
            elif key == "impulse_n_s":
                part[key] = [1000 * x for x in part[key]]
            elif key == "bank":
                part[key] = "box.hdf"
    return scene


def play(stage):
    quick = {"body.nodes": 2600, "band_hz": [20, 6000]}
    stage.solve("block.json", "block", quick=quick)
    edges = {f"body.{key}_m": 0.5 for key in ("length", "width", "height")}
    stage.solve("block.json", "box", {**edges, "body.wall_m": 0.025, "band_hz": [20, 1000]}, {**quick, "band_hz": [20, 600]})

    struck = tools.read_json(stage.folder / "struck.json")
    rate, small, _ = stage.render("block-struck", struck, picture=False)
    _, large, _ = stage.render("box-struck", enlarge(struck, 10.0, 1.0), picture=False)
    rows = [("peak", "block [Hz]", "box [Hz]", "block / box")]
    for place, begin in (("face", 0.05), ("edge", 0.13), ("corner", 0.21)):  # each strike alone
        of_block = small[int(begin * rate) : int((begin + 0.08) * rate)]
        of_box = large[int(10 * begin * rate) : int(10 * (begin + 0.08) * rate)]
        for hz, level in measure.find_peaks(of_block, rate, 500, 5000, 3, 20.0):
            near = measure.find_peak(of_box, rate, 0.1 * hz, 0.05)
            rows.append((f"{place}, {level:.0f} dB", f"{hz:.1f}", f"{near:.2f}", f"{hz / near:.4f}"))
            stage.compare(f"struck near the {place}, block over box in the two sounds at {hz:.0f} Hz", hz / near, 10.0, 1.0)
    print()
    stage.show("peaks", rows)

    # Table 1: base frequency, decay as printed, decay by its own alphas.
    print()
    rows = [("body", "in the sound [Hz]", "OSG02 [Hz]", "decay [1/s]", "by its alphas", "OSG02 printed", "corrected")]
    for name, samples, scale, paper in (("block", small, 1, (1596.2, 428.1, 428.1)), ("box", large, 10, (159.1, 49.0, 29.0))):
        ring = samples[int(0.05 * scale * rate) : int(0.13 * scale * rate)]
        base = measure.find_peak(ring, rate, 1030 / scale, 0.1)
        decay = measure.calc_decay(ring, rate, base, 180 / scale, 40.0)
        law = 0.5 * (ALPHA1 * (2 * math.pi * base) ** 2 + ALPHA2)
        rows.append((name, f"{base:.2f}", f"{paper[0]:.1f}", f"{decay:.1f}", f"{law:.1f}", f"{paper[1]:.1f}", f"{paper[2]:.1f}"))
        stage.compare(f"decay of the {name} in the sound against its damping law [1/s]", decay, law, 10.0)
        if not stage.quick:  # corrected frequencies of finer T10 meshes: 981.6 Hz with 40,374 nodes, 981.2 Hz with 89,890
            stage.compare(f"base frequency of the {name} against the limit of finer meshes [Hz]", base, 981.2 / scale, 2.5)
    stage.show("decays", rows)

    stack = tools.read_json(stage.folder / "stack.json")
    if stage.quick:
        stack["duration_s"] = 0.25
    for name, scene in (("blocks", stack), ("boxes", enlarge(stack, math.sqrt(10), math.sqrt(10)))):
        _, samples, report = stage.render(name, scene)
        stage.expect(f"every one of the four {name} is struck", all(body["impulses"] > 0 for body in report["per_body"]))
    stage.draw("blocks-path.png", "scene", "blocks-trajectory.json")
