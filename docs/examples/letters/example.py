"""OSG02's last example: the words "The End" in coarse letters fall on a hard surface, and both sound."""
import math
import pathlib
import sys

import measure

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import outlines

SQUARE_M = 0.0556  # a fifth of a letter's height; as large as makes the T's first mode that of Table 1
ALPHA1, ALPHA2 = 2e-7, 30.0
WORDS = "THE END"
PAPER_HZ, PAPER_DECAY = 247.7, 15.2  # OSG02 Table 1, "The End (T)": 71 nodes
TURNS_DEG = ([4, -9, 0], [-3, 6, 0], [5, 3, 0], [0, 0, 0], [-4, 10, 0], [3, -7, 0], [-5, -4, 0])


def make_scene(word, duration_s):
    """The letters side by side above the slab, each a little higher and turned a little."""
    bodies = [{"name": "slab", "bank": "slab.hdf", "fixed": True, "position_m": [0, 0, -0.03], "restitution": 0.5, "friction": 0.6}]
    widths = [4 if letter in "ED" else 3 if letter == " " else 5 for letter in word]
    x = -0.5 * (sum(widths) + 1.5 * (len(word) - 1)) * SQUARE_M
    for index, (letter, width) in enumerate(zip(word, widths)):
        if letter != " ":
            place = [round(x + 0.5 * width * SQUARE_M, 4), 0, round(2.5 * SQUARE_M + 0.07 + 0.05 * index, 4)]
            bodies.append(
                {
                    "name": f"{letter}{index}",
                    "bank": f"{letter}.hdf",
                    "position_m": place,
                    "rotation_deg": TURNS_DEG[index],
                    "restitution": 0.4,
                    "friction": 0.5,
                }
            )
        x += (width + 1.5) * SQUARE_M
    return {
        "radiation": "osg02",
        "frequencies": "mesh",
        "duration_s": duration_s,
        "ground": {"height_m": -0.06},
        "bodies": bodies,
        "listener": {"position_m": [0, -1.6, 0.6], "look_at_m": [0, 0, 0.1]},
    }


def play(stage):
    base = {}
    for letter in sorted(set(WORDS) - {" "}):
        outlines.write_medit(stage.out / f"{letter}.mesh", *outlines.make_mesh(letter, SQUARE_M))
        bank = stage.solve("letter.json", letter, {"mesh": f"{letter}.mesh"}, {"band_hz": [20, 4000]})
        base[letter] = bank["frequencies_hz"][0]
    linear = stage.solve("letter.json", "T-linear", {"mesh": "T.mesh", "element": "T4"}, {"band_hz": [20, 4000]})
    stage.solve("slab.json", "slab", quick={"body.nodes": 1500, "band_hz": [20, 2000]})

    # Each letter alone, held in the air and struck on a foot; then what Table 1 has of it.
    struck = {
        "radiation": "osg02",
        "duration_s": 0.6 * len(base) + 0.1,
        "frequencies": "mesh",  # as the paper plays its letters: coarse, and as sharp as their meshes make them
        "listener": {"position_m": [0, -1.2, 0]},
        "bodies": [{"name": letter, "bank": f"{letter}.hdf", "fixed": True} for letter in base],
        "strikes": [
            {
                "time_s": 0.05 + 0.6 * i,
                "body": letter,
                "duration_s": 1e-3,
                "impulse_n_s": [0.03, 0.05, 0.02],
                "point_m": [SQUARE_M * (0.4 if letter == "T" else -1.9), -0.5 * SQUARE_M, -2.5 * SQUARE_M],
            }
            for i, letter in enumerate(base)
        ],
    }
    rate, samples, _ = stage.render("letters-struck", struck, picture=False)
    rows = [("letter", "in the sound [Hz]", "OSG02 [Hz]", "decay [1/s]", "by its alphas", "OSG02 [1/s]")]
    for index, (letter, hz) in enumerate(base.items()):
        ring = samples[int((0.055 + 0.6 * index) * rate) : int((0.64 + 0.6 * index) * rate)]
        heard = measure.find_peak(ring, rate, hz, 0.01)
        law = 0.5 * (ALPHA1 * (2 * math.pi * heard) ** 2 + ALPHA2)
        decay = measure.calc_decay(ring, rate, heard, 0.04 * heard + 6, 25.0)
        rows.append(
            (
                letter,
                f"{heard:.2f}",
                f"{PAPER_HZ:.1f}" if letter == "T" else "",
                f"{decay:.2f}",
                f"{law:.2f}",
                f"{PAPER_DECAY:.1f}" if letter == "T" else "",
            )
        )
        stage.compare(f"{letter}: base frequency in the sound against its bank [Hz]", heard, hz, 0.3)
        stage.compare(f"{letter}: decay in the sound against its damping law [1/s]", decay, law, 8.0)
        if letter == "T":
            stage.compare("T: base frequency in the sound against OSG02, whose size was chosen for it [Hz]", heard, PAPER_HZ, 1.0)
            stage.compare("T: decay in the sound against OSG02 [1/s]", decay, PAPER_DECAY, 8.0)
    print()
    stage.show("letters", rows)
    ratio = linear["frequencies_hz"][0] / base["T"]
    print(
        f"\n  the same mesh of the T with linear elements, as in the paper: {linear['frequencies_hz'][0]:.1f} Hz, {ratio:.2f} times as high"
    )
    stage.expect(f"a coarse mesh of linear elements is sharp, as the paper says of its letters: {ratio:.2f}", ratio > 1.2)

    _, _, report = stage.render("letters", make_scene(WORDS, 0.7 if stage.quick else 2.0))
    stage.expect("every letter knocks, and the slab sounds", all(body["impulses"] > 0 for body in report["per_body"]))
    stage.draw("letters-path.png", "scene", "letters-trajectory.json")
