"""A MuJoCo gripper that drops twenty objects on a table: timing of microphone, accelerometers and labels."""
import json
import re
import resource
import subprocess
import sys

import numpy

import measure

KINDS = ("bar", "box", "can", "ball")
RATE, SOUND_SPEED = 48000, 343.0
MICROPHONE_M, TABLE_M = numpy.array([0.35, -0.5, 0.4]), numpy.array([0.05, 0.0, -0.01])  # bodies are heard from their centres
LARGEST_M = 0.065  # half the diagonal of an object


def write_scene(stage, contacts, seconds):
    """The bodies of the contacts file, a microphone, an accelerometer on a finger and one below the table."""
    head = json.loads(contacts.open().readline())
    bodies = [{"name": body["name"], "bank": re.sub(r"\d+$", "", body["name"]) + ".hdf"} for body in head["bodies"]]
    scene = {
        "duration_s": seconds,
        "bodies": [{**body, "fixed": True, "position_m": TABLE_M.tolist()} if body["name"] == "table" else body for body in bodies],
        "microphones": [MICROPHONE_M.tolist()],
        "sensors": [
            {"name": "finger", "body": "finger1", "point_m": [-0.035, 0.006, 0], "direction": [0, 1, 0]},
            {"name": "table", "body": "table", "point_m": [0.3, 0, -0.01], "direction": [0, 0, 1]},
        ],
        "output": {"format": "float", "fade_end": False},
    }
    (stage.out / "gripper-scene.json").write_text(json.dumps(scene, indent=1) + "\n")


def calc_cpu_s(work):
    """CPU seconds of the programs that a function runs."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def find_onset(signal, frame, before, after, of_peak=0.0):
    """First frame in [frame - before, frame + after) above three times the peak of the 5 ms before `frame - before`, and above the share
    `of_peak` of the peak of the range; None if there is none."""
    quiet = abs(signal[frame - RATE // 200 : frame - before]).max()
    part = abs(signal[frame - before : frame + after])
    above = numpy.flatnonzero(part > max(3 * quiet, of_peak * part.max()))
    return frame - before + above[0] if len(above) else None


class Labels:
    """Tables of the labels by names of bodies."""

    def __init__(self, file):
        self.arrays = numpy.load(file)
        self.names = [name.decode() for name in self.arrays["bodies"]]

    def find_first_hit(self, body, after_s):
        """Row of the first hit of a body after a time."""
        hits = (self["hit.body"] == self.names.index(body)) & (self["hit.begin_s"] > after_s)
        rows = numpy.flatnonzero(hits)
        return rows[numpy.argmin(self["hit.begin_s"][rows])]

    def find_position(self, body, time_s):
        rows = (self["pose.body"] == self.names.index(body)) & (self["pose.time_s"] <= time_s + 1e-3)
        return self["pose.position_m"][rows][-1]

    def __getitem__(self, column):
        return self.arrays[column]


def draw(stage, sound, read, labels, begin_s, end_s):
    """Plots the microphone, both accelerometers, and the contacts and hits of the labels."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(4, 1, figsize=(10, 7), sharex=True, gridspec_kw={"height_ratios": [1, 1, 1, 1.3]})
    frames = slice(int(begin_s * RATE), int(end_s * RATE))
    times = numpy.arange(len(sound))[frames] / RATE
    for axis, signal, text in zip(axes, (sound, *read.T), ("microphone", "finger (m/s2)", "table (m/s2)")):
        axis.plot(times, signal[frames], linewidth=0.5)
        axis.set_ylabel(text)
    rows = {}
    for kind, first, last in (("contact", "begin_s", "end_s"), ("hit", "begin_s", "begin_s")):
        columns = (labels[f"{kind}.{name}"] for name in ("body", "other", first, last))
        for body, other, begin, end in zip(*columns):
            if begin > end_s or end < begin_s or (begin < begin_s and end > end_s):
                continue
            row = rows.setdefault((max(body, other), min(body, other)), len(rows))
            if kind == "contact":
                axes[3].barh(row, end - begin, left=begin, height=0.5, color="C1")
            else:
                axes[3].plot([begin], [row], "k|", markersize=8)
    axes[3].set_yticks(list(rows.values()), [f"{labels.names[body]} on {labels.names[other]}" for body, other in rows], fontsize=7)
    axes[3].set_xlabel("Time (s)")
    axes[3].set_xlim(begin_s, end_s)
    figure.tight_layout()
    figure.savefig(stage.out / "gripper-labels.png", dpi=75)
    stage.pictures.append("gripper-labels.png")


def play(stage):
    program = stage.bin / "mujoco_gripper"
    if not program.is_file():
        print("mujoco_gripper is not built: MuJoCo (libmujoco-dev) is missing")
        sys.exit(77)
    for name in ("table", "finger", *KINDS):
        stage.solve(f"{name}.json", name)
    print("$ mujoco_gripper . gripper.jsonl", flush=True)
    done = subprocess.run([program, ".", "gripper.jsonl"], cwd=stage.out, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{done.stdout}{done.stderr}\nmujoco_gripper failed (exit code {done.returncode})")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    seconds, drops = lines[-1]["seconds"], {row["drop"]: row["time_s"] for row in lines if "drop" in row}
    write_scene(stage, stage.out / "gripper.jsonl", seconds)
    files = ["-o", "gripper.wav", "--contacts", "gripper.jsonl", "--labels", "gripper.npz"]
    sound_cpu_s = calc_cpu_s(lambda: stage.run("the sound", stage.bin / "carillon-render", "-q", "gripper-scene.json", *files))

    sound = measure.read_wav(stage.out / "gripper.wav")[1][:, 0]
    read = measure.read_wav(stage.out / "gripper.sensors.wav")[1]
    labels = Labels(stage.out / "gripper.npz")
    is_finite = numpy.isfinite(sound).all() and numpy.isfinite(read).all()
    stage.expect("sound and sensors are finite, loud, and not clipped", is_finite and 0.5 < abs(sound).max() < 1 and read.any(axis=0).all())
    energy = labels["energy.modes_j"].sum(axis=-1).max()
    stage.expect(f"bodies ring with less than the ball has before it lands, 0.2 J ({1e3 * energy:.2g} mJ)", 0 < energy < 0.2)
    check_clock(stage, sound, read, labels, drops)
    cost = {
        "physics": lines[-1]["physics_cpu_s"],
        "contact tracker, file of contacts": lines[-1]["tracker_cpu_s"],
        "sound, sensors, labels": sound_cpu_s,
    }
    cost["all"] = sum(cost.values())
    stage.expect(f"it is faster than real time ({cost['all'] / seconds:.2f} CPU s per s)", cost["all"] < seconds)
    stage.show(
        "cost", [("part", "CPU s per s"), *((part, f"{cpu_s / seconds:.2f}") for part, cpu_s in cost.items())], varying=("CPU s per s",)
    )
    draw(stage, sound, read, labels, 0.4, drops["box1"] + 1.2)


def check_clock(stage, sound, read, labels, drops):
    """Compares times of the labels with the onsets in the sensors and at the microphone."""
    for channel, body in enumerate(("finger1", "table")):
        first = labels["hit.begin_s"][labels.find_first_hit(body, 0.0)]
        begun = numpy.flatnonzero(read[:, channel])[0]
        stage.expect(f"the sensor on {body} is still until the frame of its first hit ({begun})", begun == round(first * RATE))
    heard, exact, on_table = 0, 0, 0
    for name, time in drops.items():
        hit = labels.find_first_hit(name, time)
        begin = labels["hit.begin_s"][hit]
        ways = [numpy.linalg.norm(at - MICROPHONE_M) / SOUND_SPEED for at in (labels.find_position(name, begin), TABLE_M)]
        onset = find_onset(sound, round((begin + min(ways)) * RATE), RATE // 2000, RATE // 60, 0.03)
        heard += onset is not None and min(ways) - LARGEST_M / SOUND_SPEED <= onset / RATE - begin <= max(ways) + 1e-3
        if labels["hit.other"][hit] != labels.names.index("table"):
            continue
        on_table += 1
        onset = find_onset(read[:, 1], round(begin * RATE), 2, RATE // 50)
        exact += onset is not None and abs(onset - round(begin * RATE)) <= 1
    stage.expect(f"20 drops are heard after the propagation time of their sound ({heard} of {len(drops)})", heard == len(drops) == 20)
    stage.expect(f"those on the table reach its sensor at the frame of the label ({exact} of {on_table})", exact == on_table >= 5)
