"""One bar under heads from soft felt to steel: how long they touch, what comes back, and which modes they leave behind."""
import numpy

import stage as tools

# Of one mass and speed. Stiffness and exponent of the felts are of the order of piano hammers; the others are spheres of their material.
HEADS = {
    "soft felt": {"felt": {"stiffness_n_m_p": 1e8, "exponent": 2.5}},
    "hard felt": {"felt": {"stiffness_n_m_p": 1e10, "exponent": 2.5}},
    "rubber": {"radius_m": 0.015, "young_modulus_pa": 5e6, "poisson_ratio": 0.49, "restitution": 0.8},
    "wood": {"radius_m": 0.015, "young_modulus_pa": 1e9},
    "steel": {"radius_m": 0.015, "young_modulus_pa": 200e9},
}
QUICK = {"body.nodes": 2500}


def calc_levels(samples, rate, split_hz):
    """Levels of the sound's energy below and above a frequency [dB, one reference for both]."""
    power = (abs(numpy.fft.rfft(samples, axis=0)) ** 2).sum(axis=1)
    high = numpy.arange(len(power)) * rate / len(samples) >= split_hz
    return [10 * numpy.log10(power[part].sum()) for part in (~high, high)]


def play(stage):
    stage.solve("bar.json", "bar", quick=QUICK)
    scene = tools.read_json(stage.folder / "scene.json")
    rows = [
        (
            "head",
            "touches [ms]",
            "peak [N]",
            "restitution",
            "kept [%]",
            "motion [%]",
            "modes [%]",
            "lost [%]",
            "below 1 kHz [dB]",
            "above 3 kHz [dB]",
        )
    ]
    blows, levels = {}, {}
    for head, hardness in reversed(HEADS.items()):
        name = head.replace(" ", "-")
        mallet = {"mass_kg": 0.02, "speed_m_s": 1.0, **hardness}
        rate, samples, report = stage.render(
            name, {**scene, "strikes": [{**scene["strikes"][0], "mallet": mallet}]}, picture=head in ("soft felt", "steel")
        )
        blow = blows[head] = report["mallets"][0]
        pascals = samples / report["gain_per_pa"]
        levels[head] = [calc_levels(pascals, rate, 1000)[0], calc_levels(pascals, rate, 3000)[1]]
        low, high = (level - steel for level, steel in zip(levels[head], levels["steel"]))
        percent = [100 * blow[part] / blow["before_j"] for part in ("after_j", "motion_j", "modes_j", "lost_j")]
        rows.append(
            (
                head,
                f"{1e3 * blow['contact_s']:.3f}",
                f"{blow['peak_n']:.0f}",
                f"{blow['restitution']:.3f}",
                *(f"{x:.1f}" for x in percent),
                f"{low:+.1f}",
                f"{high:+.1f}",
            )
        )
        stage.expect(
            f"{head}: the head's energy is found again to 1e-5 (off by {sum(percent) - 100:+.1g} %)", abs(sum(percent) - 100) < 1e-3
        )
        stage.expect(f"{head}: the impulse is less than on a rigid wall", 0 < blow["impulse_n_s"] < 2 * 0.02 * 1.0)
    stage.show("heads", rows)
    order = sorted(blows, key=lambda head: blows[head]["contact_s"])
    stage.expect(
        f"from the shortest to the longest touch: {', '.join(order)}", order == ["steel", "wood", "hard felt", "rubber", "soft felt"]
    )
    high = {head: levels[head][1] - levels["steel"][1] for head in order}
    softer = max(high[head] for head in ("hard felt", "rubber", "soft felt"))
    stage.expect(
        f"steel, then wood, then the soft heads leave the most above 3 kHz (0, {high['wood']:.0f}, at most {softer:.0f} dB)",
        0 > high["wood"] > softer + 20,
    )
    stage.expect(
        f"hard felt leaves more there than soft felt ({high['hard felt']:.0f} against {high['soft felt']:.0f} dB)",
        high["hard felt"] > high["soft felt"] + 10,
    )
    fallen = [level - steel for level, steel in zip(levels["soft felt"], levels["steel"])]
    stage.expect(
        f"soft felt takes more from there than from below 1 kHz ({fallen[1]:.0f} against {fallen[0]:.0f} dB)", fallen[1] < fallen[0] - 10
    )
    # A second blow while the bar rings from the first: it meets a surface that moves.
    two = {**scene, "strikes": [scene["strikes"][0], {**scene["strikes"][0], "time_s": 0.2}]}
    _, _, report = stage.render("twice", two, picture=False)
    first, second = (blow["restitution"] for blow in report["mallets"])
    print(f"\n  the same blow again 0.1 s later: restitution {first:.4f}, then {second:.4f}")
    stage.expect("the second blow differs, as the bar moves", abs(first - second) > 1e-6)
