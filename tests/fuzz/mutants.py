#!/usr/bin/python3
"""Seeded mutants of scenes, contacts, jobs and banks, most of which remain readable.

usage: mutants.py BIN_DIR KIND COUNT [--seed N] [--keep FOLDER]

BIN_DIR holds the libFuzzer targets (preset fuzz). Each mutant is read and played by the target of its kind (fuzz_play_scene,
fuzz_play_contacts, fuzz_job, fuzz_play_bank) under the sanitizers, limited to 20 s and 3 GB. Exit code 1 and the mutant's name on a fault;
the mutant is kept in --keep.
"""
import argparse
import collections
import copy
import io
import json
import math
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

import h5py
import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
BATCH = 250
NUMBERS = [
    0,
    -0.0,
    1,
    -1,
    2,
    3,
    7,
    0.1,
    0.5,
    0.25,
    1e-3,
    1e-6,
    1e-9,
    1e-12,
    1e-300,
    5e-324,
    1e3,
    1e6,
    1e9,
    1e12,
    1e300,
    -1e-3,
    -1e9,
    2**31 - 1,
    2**31,
    2**32,
    2**53,
    2**63,
    -(2**63),
    48000,
    8000,
    0.4999999,
    1.0000001,
]
WORDS = [
    "",
    " ",
    "auto",
    "cube",
    "shelf",
    "modal",
    "roughness",
    "rolling",
    "two_ears",
    "directivity",
    "ground_reflection",
    "head",
    "hrtf",
    "ambisonic",
    "begin",
    "hold",
    "end",
    "hertz",
    "gaussian",
    "x-min",
    "T4",
    "T10",
    "bar",
    "sphere",
    "\u001b[31m",
    "\u202e",
    "\u0000",
    "a" * 300,
    "../..",
    "/dev/zero",
    "nan",
    "1e5",
]
RAW = [
    "012",
    "-01",
    "+1",
    "1.",
    ".5",
    "0x10",
    "NaN",
    "Infinity",
    "1e999",
    "-1e999",
    "1e",
    "--1",
    "truefalse",
    "[[",
    "]]",
    "{",
    "}",
    ",",
    ":",
    "//",
    "/*",
    '"',
    "\\u",
    "\x1b",
    "\x9b",
    "\xff",
]


def list_places(value, path=()):
    """All paths inside a JSON value, its own included."""
    places = [path]
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        places += list_places(inner, path + (key,))
    return places


def get(value, path):
    for key in path:
        value = value[key]
    return value


def change_number(draw, number):
    kind = draw.randrange(6)
    if kind == 0:
        return draw.choice(NUMBERS)
    if kind == 1:
        return -number
    if kind == 2:
        return number * 10 ** draw.randint(-3, 3)
    if kind == 3:
        return number * (1 + draw.uniform(-0.5, 0.5))
    if kind == 4 and isinstance(number, int):
        return number + draw.randint(-2, 2)
    return number + draw.gauss(0, 0.1)


def change_value(draw, value):
    """Replaces a value by another, mostly of the same kind."""
    if draw.random() < 0.08:
        return draw.choice([None, True, False, 0, "", [], {}, [0], {"x": 1}, draw.choice(NUMBERS), draw.choice(WORDS)])
    if isinstance(value, bool):
        return not value
    if isinstance(value, (int, float)):
        return change_number(draw, value)
    if isinstance(value, str):
        return draw.choice(WORDS) if draw.random() < 0.5 else value[: draw.randrange(len(value) + 1)] + draw.choice(WORDS)
    if isinstance(value, list):
        changed = list(value)
        if not changed:
            return [0]
        kind = draw.randrange(4)
        at = draw.randrange(len(changed))
        if kind == 0:
            del changed[at]
        elif kind == 1:
            changed.insert(at, copy.deepcopy(changed[at]))
        elif kind == 2:
            draw.shuffle(changed)
        else:
            changed += copy.deepcopy(changed[: draw.randint(1, 3)])
        return changed
    if value is None:
        return 0
    changed = dict(value)
    if changed:
        key = draw.choice(list(changed))
        if draw.random() < 0.5:
            del changed[key]
        else:
            changed[draw.choice([key.upper(), key[:-1], key + "s", draw.choice(WORDS)])] = changed.pop(key)
    return changed


def mutate_json(draw, value):
    value = copy.deepcopy(value)
    for _ in range(draw.choice([1, 1, 1, 2, 3, 5])):
        path = draw.choice(list_places(value))
        if not path:
            continue
        holder = get(value, path[:-1])
        holder[path[-1]] = change_value(draw, holder[path[-1]])
    return value


def mutate_bytes(draw, data):
    """Occasionally mutates the text itself."""
    data = bytearray(data)
    for _ in range(draw.choice([1, 1, 2, 4])):
        at = draw.randrange(len(data) + 1)
        kind = draw.randrange(4)
        if kind == 0 and at < len(data):
            data[at] = draw.randrange(256)
        elif kind == 1:
            del data[at : at + draw.randint(1, 40)]
        elif kind == 2:
            data[at:at] = draw.choice(RAW).encode("latin-1")
        else:
            data[at:at] = data[at : at + draw.randint(1, 80)]
    return bytes(data)


def write_json(draw, value, share=0.1):
    text = json.dumps(value)
    if draw.random() < share:  # invalid JSON number
        words = [
            i for i, letter in enumerate(text) if letter.isdigit() and (i == 0 or not text[i - 1].isalnum() and text[i - 1] not in ".-_")
        ]
        if words:
            at = draw.choice(words)
            text = text[:at] + draw.choice(RAW) + text[at:]
    return text.encode("utf-8", "surrogatepass")


def make_text(draw, seeds):
    value = mutate_json(draw, draw.choice(seeds))
    data = write_json(draw, value)
    return mutate_bytes(draw, data) if draw.random() < 0.15 else data


def tune_event(draw, line):
    """Changes an amount, a time, an id or a state of an event within the playable range."""
    event = next(iter(line.values())) if isinstance(line, dict) and len(line) == 1 else None
    if not isinstance(event, dict) or not event:
        return
    key = draw.choice(list(event))
    value = event[key]
    if key == "time_s" and isinstance(value, (int, float)):
        event[key] = value + draw.choice([-0.4, -0.01, -1e-9, 0.0, 1e-9, 0.003, 0.02, 3.0])
    elif key in ("force_n", "sweep_m_s", "other_sweep_m_s", "spin_rad_s", "impedance_n_s_m", "patch_radius_m", "duration_s"):
        event[key] = draw.choice([0, 1e-300, 1e-12, 1e-6, 1e-3, 1, 10, 1e3, 1e6, 1e9])
    elif key in ("slip_m_s", "impulse_n_s", "velocity_m_s", "position_m"):
        event[key] = [draw.choice([0, 0, 1, -1]) * 10 ** draw.uniform(-9, 9) for _ in range(3)]
    elif key == "state":
        event[key] = draw.choice(["begin", "hold", "end"])
    elif key == "id":
        event[key] = draw.choice([0, 7, 9, 10, 2**63 - 1])
    elif key == "triangle":
        event[key] = draw.randrange(12)
    elif key in ("body", "other"):
        event[key] = draw.choice([0, 1])
    elif key == "barycentric":
        a, b = sorted((draw.random(), draw.random()))
        event[key] = draw.choice([[a, b - a, 1 - b], [0, 0, 1], [1 + 1e-7, -1e-7, 0]])
    elif key in ("normal", "rotation"):
        numbers = [draw.gauss(0, 1) for _ in value]
        event[key] = [x / sum(y * y for y in numbers) ** 0.5 for x in numbers]


def make_lines(draw, seeds):
    """Changes, drops, duplicates or swaps lines of a contacts file."""
    lines = copy.deepcopy(draw.choice(seeds))
    for _ in range(draw.choice([1, 1, 2, 3, 6])):
        at = draw.randrange(len(lines))
        kind = draw.randrange(8)
        if kind == 0 and len(lines) > 2:
            del lines[at]
        elif kind == 1:
            lines.insert(at, copy.deepcopy(lines[at]))
        elif kind == 2:
            other = draw.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        elif kind < 6:
            tune_event(draw, lines[at])
        else:
            lines[at] = mutate_json(draw, lines[at])
    if draw.random() < 0.9 and isinstance(lines[0], dict) and "events" in lines[0]:
        lines[0]["events"] = len(lines) - 1
    data = b"\n".join(write_json(draw, line, 0.05 / len(lines)) for line in lines) + b"\n"
    return mutate_bytes(draw, data) if draw.random() < 0.1 else data


def make_bank(draw, seeds):
    """Changes numbers or, occasionally, bytes of a bank; the target seals it again."""
    data = bytearray(draw.choice(seeds))
    if draw.random() < 0.2:
        for _ in range(draw.choice([1, 1, 2, 4])):
            at = draw.randrange(4096, len(data))
            data[at] = data[at] ^ 1 << draw.randrange(8) if draw.random() < 0.5 else draw.choice([0, 1, 127, 128, 255])
        return bytes(data[: draw.randrange(len(data))] if draw.random() < 0.1 else data)
    image = io.BytesIO(bytes(data))
    with h5py.File(image, "r+") as bank:
        arrays = []
        bank.visititems(lambda name, item: arrays.append(item) if isinstance(item, h5py.Dataset) else None)
        for _ in range(draw.choice([1, 1, 1, 2, 4])):
            change_array(draw, draw.choice(arrays))
    return image.getvalue()


def change_array(draw, array):
    values = numpy.array(array[()])
    if values.dtype.kind in "SO":
        return
    flat = values.reshape(-1)
    if not flat.size:
        return
    kind = draw.randrange(4)
    at = draw.randrange(flat.size)
    with numpy.errstate(all="ignore"):
        if values.dtype.kind == "f":
            if kind == 0:
                flat[at] = draw.choice([*NUMBERS, math.nan, math.inf])
            elif kind == 1:
                flat[at] *= 10 ** draw.uniform(-3, 3)
            elif kind == 2:
                flat *= draw.choice([0.0, -1.0, 1e-300, 1e-12, 1e-3, 1.0001, 2.0, 1e3, 1e12, 1e300])
            else:
                flat[at] = flat[draw.randrange(flat.size)]
        else:
            limits = numpy.iinfo(values.dtype)
            flat[at] = draw.choice(
                [
                    0,
                    1,
                    limits.max,
                    limits.min,
                    min(max(int(flat[at]) + draw.randint(-3, 3), limits.min), limits.max),
                    int(flat[draw.randrange(flat.size)]),
                ]
            )
    array[()] = values


def read_seeds(kind):
    if kind == "bank":
        return [path.read_bytes() for path in sorted((ROOT / "tests/unit/runtime/bank/pinned").iterdir())]
    folder = ROOT / "tests/fuzz" / f"{kind}s" if kind != "contacts" else ROOT / "tests/fuzz/contacts"
    files = sorted(path for path in folder.iterdir() if path.is_file())
    if kind == "contacts":
        return [[json.loads(line) for line in path.read_text().splitlines()] for path in files]
    return [json.loads(path.read_text()) for path in files]


KINDS = {
    "scene": ("fuzz_play_scene", make_text),
    "contacts": ("fuzz_play_contacts", make_lines),
    "job": ("fuzz_job", make_text),
    "bank": ("fuzz_play_bank", make_bank),
}


def run_batch(program, files):
    environment = {
        **os.environ,
        "UBSAN_OPTIONS": "halt_on_error=1:print_stacktrace=1",
        "ASAN_OPTIONS": "detect_leaks=1:allocator_may_return_null=0",
        "OPENBLAS_NUM_THREADS": "1",
    }
    with tempfile.TemporaryDirectory() as scratch:
        return subprocess.run(
            [str(program), "-timeout=20", "-rss_limit_mb=3000", "-close_fd_mask=1", f"-artifact_prefix={scratch}/", *map(str, files)],
            cwd=scratch,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("kind", choices=sorted(KINDS))
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=pathlib.Path, default=pathlib.Path("mutants-that-failed"))
    options = parser.parse_args()
    name, make = KINDS[options.kind]
    program = options.bin.resolve() / name
    seeds = read_seeds(options.kind)
    tally = collections.Counter()
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for first in range(0, options.count, BATCH):
            files = []
            for number in range(first, min(first + BATCH, options.count)):
                draw = random.Random(f"{options.kind} {options.seed} {number}")
                files.append(pathlib.Path(folder) / f"{options.kind}-{options.seed}-{number}")
                files[-1].write_bytes(make(draw, seeds))
            result = run_batch(program, files)
            for line in result.stderr.splitlines():
                if line.startswith("mutant: "):
                    tally[line[8:]] += 1
            if result.returncode != 0:  # one by one, to name all failures
                for file in files:
                    alone = run_batch(program, [file])
                    if alone.returncode == 0:
                        continue
                    faults += 1
                    options.keep.mkdir(parents=True, exist_ok=True)
                    shutil.copy(file, options.keep / file.name)
                    print(
                        f"{options.keep / file.name}: exit code {alone.returncode}\n"
                        + "\n".join(
                            line for line in alone.stderr.splitlines() if "ERROR" in line or "runtime error" in line or "#" in line
                        )[:2000],
                        flush=True,
                    )
            for file in files:
                file.unlink()
    print(
        f"{options.kind}: {options.count} mutants, {faults} faults" + "".join(f", {count} {what}" for what, count in sorted(tally.items()))
    )
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
