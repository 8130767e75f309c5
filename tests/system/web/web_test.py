#!/usr/bin/env python3
"""The sound engine of pages in headless Chromium, held against carillon-render. One script, whose
pages and browser every test shares; longer than most files.

usage: web_test.py NAME    NAME is one of the functions test_NAME below
"""

import base64
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np

from browser import Browser, serve

BIN = pathlib.Path(os.environ["CARILLON_BIN_DIR"])
WEB = BIN.parent / "share" / "carillon" / "web"
WORLD = BIN.parent / "share" / "carillon" / "world"
HERE = pathlib.Path(__file__).parent
EFFECTS = ["modal", "hertz_pulse", "air_delay", "doppler", "two_ears"]
CONTACTS = ["roughness", "rolling", "contact_damping"]
OTHERS = ["acceleration_noise", "directivity", "ground_reflection", "head", "nonlinear", "cascade"]
LATENCY = 16  # frames of the engine's delay relative to a file
LIMIT_DB = -90.0  # required: -60


def run(*command, code=0):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == code, (command, done.returncode, done.stdout, done.stderr)
    return done.stdout + done.stderr


def read_wav(file):
    """(frames, channels) of a WAV file in single precision."""
    data, at, channels = pathlib.Path(file).read_bytes(), 12, 0
    while True:
        name, size = data[at : at + 4], struct.unpack("<I", data[at + 4 : at + 8])[0]
        if name == b"fmt ":
            channels = struct.unpack("<H", data[at + 10 : at + 12])[0]
        if name == b"data":
            return np.frombuffer(data[at + 8 : at + 8 + size], "<f4").reshape(-1, channels)
        at += 8 + size + size % 2


class Bench:
    """Serves a folder with banks and the engine; a page has loaded it."""

    def __init__(self, flags=()):
        self.flags = flags

    def __enter__(self):
        self.temporary = tempfile.TemporaryDirectory(prefix="carillon-web-")
        self.folder = pathlib.Path(self.temporary.name)
        self.server = serve(HERE, WEB, WORLD, self.folder)
        self.browser = Browser(self.flags)
        self.page = self.browser.open(self.server.url + "page.html")
        self.page.wait_for("window.isReady")
        return self

    def __exit__(self, kind, *_):
        strangers, errors = self.page.find_strangers(self.server.url), self.page.errors
        self.browser.close()
        self.server.__exit__()
        self.temporary.cleanup()
        if kind is None:
            assert strangers == [], strangers
            assert errors == [], errors

    def make_bank(self, name, squares=6, modes=60):
        run(BIN / "make_example_bank", self.folder / name, squares, modes)
        return name

    def render_file(self, scene, *options):
        """Sound of carillon-render for a scene, in pascals times 0.01."""
        scene = {**scene, "output": {"gain": 0.01, "format": "float", "fade_end": False}}
        (self.folder / "scene.json").write_text(json.dumps(scene))
        run(BIN / "carillon-render", self.folder / "scene.json", "-o", self.folder / "sound.wav", *options)
        return read_wav(self.folder / "sound.wav")

    def render_page(self, options, act):
        """The same from the page: `act` is the body of an async function of audio, load and at."""
        options = {"gain_per_pa": 0.01, **options}
        got = self.page.evaluate(f"window.render({json.dumps(options)}, async (audio, {{load, at}}) => {{ {act} }})", timeout_s=120)
        got["sound"] = np.stack([np.frombuffer(base64.b64decode(x), "<f4") for x in got.pop("samples")], 1)[LATENCY:]
        return got

    def compare(self, name, scene, options, act, limit_db=LIMIT_DB, file_options=()):
        """Asserts that page and file sound the same."""
        expected = self.render_file(scene, *file_options)
        got = self.render_page({"seconds": scene["duration_s"], **options}, act)
        assert got["errors"] == [], got["errors"]
        check(name, got["sound"], expected, limit_db)
        return got


def calc_db(got, expected):
    """Energy of the difference relative to the expected energy."""
    assert got.shape == expected.shape, (got.shape, expected.shape)
    power = np.mean(expected.astype(float) ** 2)
    assert power > 0.0
    return 10.0 * np.log10(np.mean((got.astype(float) - expected) ** 2) / power + 1e-30)


def check(name, got, expected, limit_db=LIMIT_DB):
    difference = calc_db(got, expected)
    print(f"{name}: {difference:.1f} dB, limit {limit_db:g} dB")
    assert difference < limit_db, (name, difference)


PLACE = {"position_m": [0.2, 0.8, 0.1], "quaternion": [0.8, 0.6, 0, 0]}
BODY = {"name": "a", "bank": "a.hdf", "fixed": True, **PLACE}
ADD = "{bank, name: 'a', fixed: true, position_m: [0.2, 0.8, 0.1], rotation: [0.8, 0.6, 0, 0], effects: %s}" % json.dumps(EFFECTS)
LOAD = "const bank = await load('a.hdf'), body = await audio.addBody(%s);" % ADD
LISTENER = {"position_m": [0.0, -0.5, 0.5]}
STRIKE = {"triangle": 7, "impulse_n_s": [0.01, -0.02, 0.03], "duration_s": 0.0003}
STRIKE_AT = "body.strike({time_s: %g, triangle: 7, impulse_n_s: [0.01, -0.02, 0.03], duration_s: 0.0003});"


def make_scene(duration_s=1.0, **more):
    scene = {"duration_s": duration_s, "bodies": [BODY], "effects": EFFECTS, "listener": LISTENER}
    return {**scene, "strikes": [{"time_s": 0.1, "body": "a", **STRIKE}], **more}


def test_strikes():
    """Strikes, by pulse and by mallet, with SIMD and without, at both usual rates."""
    with Bench() as bench:
        bench.make_bank("a.hdf")
        options = {"listener": LISTENER}
        for simd, instructions in (("true", "simd128"), ("false", "plain")):
            got = bench.compare(f"a strike, {instructions}", make_scene(), {**options, "simd": simd == "true"}, LOAD + STRIKE_AT % 0.1)
            assert got["instructions"] == instructions, got["instructions"]
            assert got["counters"]["strikes"] == 1 and got["counters"]["late"] == 0, got["counters"]
        at_44 = make_scene(sample_rate_hz=44100)
        bench.compare("a strike at 44.1 kHz", at_44, {**options, "rate_hz": 44100}, LOAD + STRIKE_AT % 0.1)

        point = [0.0, 0.0, 0.0]
        blow = {"time_s": 0.1, "body": "a", "triangle": 7, "mallet": {"from": "hard-wood", "speed_m_s": 2.0}}
        act = LOAD + "return await body.hit({time_s: 0.1, triangle: 7, mallet: 'hard-wood', speed_m_s: 2});"
        got = bench.compare("the blow of a mallet", make_scene(strikes=[blow]), options, act)
        assert got["extra"]["impulse_n_s"] > 0.0 and got["extra"]["contact_s"] > 0.0, (got["extra"], point)


def test_ears():
    """Moving ears and bodies: delay, level and Doppler shift; rotating ears."""
    with Bench() as bench:
        bench.make_bank("a.hdf")
        path = [[0.0, 0.0, -0.5, 0.5], [0.3, 2.0, -0.5, 0.5], [0.7, 2.0, 3.0, 0.5], [1.2, -1.0, 2.0, 1.0]]
        places = np.array(path)
        # Speeds as in scene files: slopes between neighbours.
        speeds = [(places[min(i + 1, 3)] - places[max(i - 1, 0)]) for i in range(4)]
        rows = [{"time_s": p[0], "position_m": list(p[1:]), "velocity_m_s": list(v[1:] / v[0])} for p, v in zip(places, speeds)]
        act = LOAD + STRIKE_AT % 0.1 + f"for (const row of {json.dumps(rows)}) audio.setListener(row);"
        moving = make_scene(1.2, listener={"path": path})
        bench.compare("a listener that walks", moving, {"listener": {"position_m": path[0][1:]}}, act)
        still = bench.render_file(make_scene(1.2))
        assert calc_db(bench.render_file(moving), still) > -20.0  # the path is audible

        # After a quarter turn to the left the right ear points to the former front.
        turned = {"position_m": [0.0, -0.5, 0.5], "facing": [-1, 0, 0]}
        act = LOAD + STRIKE_AT % 0.1
        quarter = {"position_m": [0.0, -0.5, 0.5], "rotation": [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]}
        bench.compare("ears that have turned", make_scene(listener=turned), {"listener": quarter}, act)


def test_scenes():
    """Playback of a contacts file with moving, colliding and sliding bodies."""
    with Bench() as bench:
        bench.make_bank("a.hdf", 4, 40)
        body = {"name": "a", "bank": "a.hdf", "position_m": [-0.2, 0.09, -0.15], "velocity_m_s": [0.8, 0.2, 0]}
        scene = {"duration_s": 1.0, "bodies": [body, {**body, "name": "b", "position_m": [-0.2, 0.5, 0.0]}], "ground": {"height_m": 0.0}}
        scene = {**scene, "effects": EFFECTS + CONTACTS, "listener": LISTENER}
        (bench.folder / "scene.json").write_text(json.dumps(scene))
        contacts = bench.folder / "contacts.jsonl"
        run(BIN / "carillon-render", bench.folder / "scene.json", "-o", bench.folder / "x.wav", "--record", contacts)
        kinds = {key for line in contacts.read_text().splitlines() for key in json.loads(line)}
        assert {"contact", "motion"} <= kinds and kinds & {"impulse", "force"}, kinds
        act = """
            const bank = await load('a.hdf'), bodies = [];
            for (const [name, position_m] of [['a', [-0.2, 0.09, -0.15]], ['b', [-0.2, 0.5, 0]]])
              bodies.push(await audio.addBody({bank, name, position_m, effects: EFFECTS}));
            const text = await (await fetch('contacts.jsonl')).text(), recording = await audio.addRecording(text, bodies);
            const began_s = await recording.start({at_s: 0});
            const plan = await recording.plan();
            return {duration_s: recording.duration_s, began_s, pose: recording.pose(0, 0.5), plan};
        """.replace(
            "EFFECTS", json.dumps(EFFECTS + CONTACTS)
        )
        file_options = ("--contacts", contacts)
        got = bench.compare("a recorded scene", scene, {"listener": LISTENER}, act, file_options=file_options)
        extra = got["extra"]
        assert extra["began_s"] == 0 and 0.9 < extra["duration_s"] < 1.1, extra
        # The displayed pose is that of the recording.
        motions = [line["motion"] for line in map(json.loads, contacts.read_text().splitlines()) if "motion" in line]
        mine = [m for m in motions if m["body"] == 0]
        for k in range(3):
            expected = np.interp(0.5, [m["time_s"] for m in mine], [m["position_m"][k] for m in mine])
            assert abs(extra["pose"]["position_m"][k] - expected) < 1e-9, (k, extra["pose"], expected)
        effects = extra["plan"]["bodies"][0]["effects"]
        assert effects["modal"]["why"] and set(effects) == set(EFFECTS + CONTACTS + OTHERS), effects

        wrong = contacts.read_text().replace('"body": 0', '"body": 7', 1)
        (bench.folder / "wrong.jsonl").write_text(wrong)
        refused = bench.render_page(
            {"seconds": 0.1},
            """
                const bank = await load('a.hdf'), bodies = [await audio.addBody({bank, name: 'a'}), await audio.addBody({bank, name: 'b'})];
                return await audio.addRecording(await (await fetch('wrong.jsonl')).text(), bodies, 'wrong.jsonl').catch((e) => e.message);
            """,
        )
        assert refused["extra"].startswith("wrong.jsonl:"), refused["extra"]


def test_edits():
    """Edits without a solve, before a strike and during playback; solo of a mode."""
    with Bench() as bench:
        bench.make_bank("a.hdf")
        options = {"listener": LISTENER}
        made = {
            "heavier, stiffer, larger": (
                ["--density", 1.4, "--stiffness", 0.7, "--size", 1.3],
                "{density_scale: 1.4, stiffness_scale: 0.7, size_scale: 1.3}",
            ),
            "of glass": (["--material", "glass"], "{material: 'glass'}"),
            "another damping": (["--tan-phi", 0.004], "{loss: 0.002, damping_scale: 2}"),
        }
        for name, (given, edits) in made.items():
            run(BIN / "carillon-bank", "edit", bench.folder / "a.hdf", bench.folder / "b.hdf", *given)
            scene = make_scene(bodies=[{**BODY, "bank": "b.hdf"}])
            bench.compare(name, scene, options, LOAD + f"await body.edit({edits});" + STRIKE_AT % 0.1)
            # During playback: the last of three requests applies.
            live = (
                LOAD
                + "at(0.25, async () => { body.edit({size_scale: 3}); body.edit({size_scale: 0.5}); "
                + f"await body.edit({edits}); {STRIKE_AT % 0.4} }});"
            )
            late = {**scene, "strikes": [{"time_s": 0.4, "body": "a", **STRIKE}]}
            bench.compare(f"{name}, live", late, options, live)
            if name == "of glass":
                # A ringing body continues without a click: no step of the sound is larger than those of its own strike.
                ringing = bench.render_page({"seconds": 0.6, **options}, LOAD + STRIKE_AT % 0.1 + f"at(0.25, () => body.edit({edits}));")[
                    "sound"
                ]
                steps = np.abs(np.diff(ringing, axis=0)).max(1)
                begin, end = int(0.24 * 48000), int(0.3 * 48000)
                assert steps[begin:end].max() < 1.5 * steps[int(0.15 * 48000) : begin].max(), "a click"

        run(BIN / "carillon-bank", "edit", bench.folder / "a.hdf", bench.folder / "one.hdf", "--modes", 1, "--keep", "lowest")
        scene = make_scene(bodies=[{**BODY, "bank": "one.hdf"}])
        bench.compare("one mode alone", scene, options, LOAD + "body.solo(0);" + STRIKE_AT % 0.1)
        # The other modes continue: after the solo they sound as without it.
        back = bench.render_page({"seconds": 1.0, **options}, LOAD + STRIKE_AT % 0.1 + "body.solo(0); at(0.3, () => body.solo(null));")[
            "sound"
        ]
        whole = bench.render_file(make_scene())
        check("after one mode alone", back[int(0.32 * 48000) :], whole[int(0.32 * 48000) :])

        refused = bench.render_page(
            {"seconds": 0.1, **options},
            LOAD
            + """
            const said = [];
            for (const wish of [{size_scale: -1}, {material: 'unobtainium'}, {size: 2}, {alphas: [1e-7, 1], loss: 0.1}, {size_scale: 1e9}])
              said.push(await body.edit(wish).then(() => 'taken', (error) => error.message));
            return {said, modes: (await body.edit({})).length};
        """,
        )["extra"]
        assert all("taken" != text and len(text) < 400 for text in refused["said"]) and refused["modes"] == 60, refused
        assert "did you mean" in refused["said"][2] or "unknown key" in refused["said"][2], refused["said"]


def test_banks():
    """Invalid banks, plain and packed, give one sentence each; the engine continues."""
    with Bench() as bench:
        bench.make_bank("plain.hdf", 2, 8)
        run(BIN / "carillon-bank", "pack", bench.folder / "plain.hdf", bench.folder / "packed.hdf")
        for name, version in (("plain.hdf", "1."), ("packed.hdf", "2.")):
            damage_bank(bench, name, version)


def damage_bank(bench, name, version):
    whole = (bench.folder / name).read_bytes()
    answer = bench.page.evaluate(
        """(async () => {
          const audio = await CarillonAudio.open({context: new OfflineAudioContext(2, 4800, 48000)});
          const whole = new Uint8Array(await (await fetch('NAME')).arrayBuffer()), said = [];
          const attempt = async (bytes) =>
            audio.addBank(bytes, 'cup.hdf').then((bank) => { bank.close(); return ''; }, (error) => error.message);
          const step = Math.max(1, Math.floor(whole.length / 150));
          for (let cut = 0; cut < whole.length; cut += step) said.push(await attempt(whole.slice(0, cut)));
          for (let at = 0; at < whole.length; at += step) {
            const bytes = whole.slice();
            bytes[at] ^= 0x41;
            said.push(await attempt(bytes));
          }
          const text = new TextDecoder('latin1').decode(whole.subarray(0, 200)), version = whole.slice();
          const at = text.indexOf('VERSION');
          version.set([0x39, 0x2e, 0x39], at);
          said.push(await attempt(version));
          said.push(await attempt(new TextEncoder().encode('<html>404</html>')));
          const bank = await audio.addBank(whole, 'cup.hdf'), body = await audio.addBody({bank});
          return {said, modes: body.modes.length, header: text};
        })()""".replace(
            "VERSION", version
        ).replace(
            "NAME", name
        ),
        timeout_s=110,
    )
    good = [text for text in answer["said"] if not text]
    assert good == [], f"{len(good)} of {len(answer['said'])} damaged banks were taken"
    for text in answer["said"]:
        assert text.startswith("cup.hdf") and "failed" not in text and "\n" not in text and len(text) < 400, text
    assert "9.9" in answer["said"][-2], (answer["said"][-2], answer["header"])
    assert answer["modes"] == 8 and len(answer["said"]) > 300, answer["modes"]
    print(f"{len(answer['said'])} damaged banks of {len(whole)} bytes, a sentence each; the last: {answer['said'][-1]}")


def test_packed():
    """A packed bank sounds the same in the page and carillon-render, and similar to the original bank."""
    with Bench() as bench:
        bench.make_bank("whole.hdf", 20)
        run(BIN / "carillon-bank", "pack", bench.folder / "whole.hdf", bench.folder / "a.hdf", "--error", "-50", "--keep-numbers")
        assert (bench.folder / "a.hdf").stat().st_size < 0.5 * (bench.folder / "whole.hdf").stat().st_size
        for simd in ("true", "false"):
            options = {"listener": LISTENER, "simd": simd == "true"}
            bench.compare(f"a packed bank, simd {simd}", make_scene(), options, LOAD + STRIKE_AT % 0.1)
        whole = bench.render_file(make_scene(bodies=[{**BODY, "bank": "whole.hdf"}]))
        check("packed with -50 dB(A) against the whole bank", bench.render_file(make_scene()), whole, -40.0)


def test_hard():
    """Input out of range, many simultaneous strikes, extreme sizes and rates."""
    with Bench() as bench:
        bench.make_bank("a.hdf", 3, 30)
        options = {"listener": LISTENER}
        # Non-finite numbers and unknown places are counted and reported; the next strike sounds.
        bad = """
            for (const x of [NaN, Infinity, -Infinity]) body.strike({triangle: 7, impulse_n_s: [0, x, 0], duration_s: 1e-3, time_s: 0.05});
            body.strike({triangle: 7, impulse_n_s: [0, 0, 1], duration_s: -1, time_s: 0.05});
            body.strike({triangle: 1e9, impulse_n_s: [0, 0, 1], time_s: 0.05});
            body.strike({triangle: -5, impulse_n_s: [0, 0, 1], time_s: 0.05});
            body.strike({triangle: 0.5, impulse_n_s: [0, 0, 1], time_s: 0.05});
            body.strike({triangle: 7, impulse_n_s: [0, 0, 1], time_s: NaN});
            body.setPosition({position_m: [NaN, 0, 0], time_s: 0.05});
            audio.setListener({position_m: [0, 1e400, 0], time_s: 0.05});
            audio.setListener({position_m: [0, 0, 0], rotation: [0, 0, 0, 0], time_s: 0.05});
        """
        got = bench.render_page({"seconds": 1.0, **options}, LOAD + bad + STRIKE_AT % 0.1)
        assert len(got["errors"]) >= 9 and all("failed" not in text for text in got["errors"]), got["errors"]
        check("a strike after nonsense", got["sound"], bench.render_file(make_scene()))

        # More simultaneous strikes than a body can queue.
        storm = (
            "for (let k = 0; k < 20000; ++k) "
            "body.strike({triangle: k % 100, impulse_n_s: [0, 0, 0.01], duration_s: 1e-3, time_s: 0.1 + 1e-5 * k});"
        )
        got = bench.render_page({"seconds": 0.6, **options}, LOAD + storm)
        counters = got["counters"]
        assert np.isfinite(got["sound"]).all() and counters["resets"] == 0, counters
        assert counters["strikes"] > 100 and counters["strikes"] + counters["refused"] + counters["overflows"] >= 20000, counters
        print("storm:", {key: counters[key] for key in ("strikes", "refused", "overflows", "zeroed")})

        # Sizes from a hundredth to a hundredfold, rates from 8 to 192 kHz.
        for size in (0.01, 0.1, 10, 100):
            given = ["--size", size]
            run(BIN / "carillon-bank", "edit", bench.folder / "a.hdf", bench.folder / "b.hdf", *given)
            far = {**LISTENER, "position_m": [0.0, -50.0, 0.5]}
            sized = LOAD.replace("fixed: true,", f"fixed: true, edits: {{size_scale: {size}}},")
            scene = make_scene(bodies=[{**BODY, "bank": "b.hdf"}], listener=far, duration_s=0.5)
            if np.mean(bench.render_file(scene) ** 2) == 0.0:
                got = bench.render_page({"seconds": 0.5, "listener": far}, sized + STRIKE_AT % 0.1)
                assert not got["sound"].any() and got["errors"] == [], size  # all modes are above Nyquist
                continue
            bench.compare(f"{size} times as large", scene, {"listener": far}, sized + STRIKE_AT % 0.1)
        for rate_hz in (8000, 192000):
            bench.compare(f"{rate_hz} Hz", make_scene(0.5, sample_rate_hz=rate_hz), {**options, "rate_hz": rate_hz}, LOAD + STRIKE_AT % 0.1)

        # A thousand modes in a separate file: the browser may cache a file for a tenth of its age.
        bank = bench.make_bank("thousand.hdf", 4, 1000)
        scene = make_scene(0.5, bodies=[{**BODY, "bank": bank}])
        bench.compare("1000 modes", scene, options, LOAD.replace("a.hdf", bank) + STRIKE_AT % 0.1)


def test_world():
    """Bodies that fall, are pushed, held, added and removed in the page."""
    with Bench() as bench:
        bench.make_bank("a.hdf", 3, 30)
        page = bench.page
        page.evaluate(
            """(async () => {
          const audio = window.audio = await live();
          const bytes = await (await fetch('a.hdf')).arrayBuffer(), bank = await audio.addBank(bytes.slice(), 'a.hdf');
          const add = (name, position_m) => audio.addBody({bank, name, position_m});
          window.a = await add('a', [0, 0, 0.1]);
          window.b = await add('b', [1, 0, 0.5]);
          const bodies = [{body: a, bank: bytes, restitution: 0.3}, {body: b, bank: bytes, absent: true}];
          window.world = await World.open(audio, {bodies, modes: false});
        })()"""
        )
        page.wait_for("world.time_s > 0.2 && world.pose(a).position_m[2] < 0.05")
        page.evaluate("world.grab(a)")
        page.evaluate("world.drag(a, [0.2, 0, 0.5], 0.3)")
        page.wait_for("world.pose(a).position_m[2] > 0.45 && Math.abs(world.pose(a).position_m[0] - 0.2) < 0.01")
        page.evaluate("world.release(a)")
        page.evaluate("world.add(b, {position_m: [1, 0, 0.3]})")
        page.wait_for("world.pose(a).position_m[2] < 0.05 && world.pose(b).position_m[2] < 0.05")
        page.evaluate("world.push(a, [0, 0, 2 * a.mass_kg])")
        page.wait_for("world.pose(a).position_m[2] > 0.1")
        # A pointer takes the body along and throws it; a key pushes it.
        page.evaluate(
            """(async () => {
          await new Promise((resolve) => setTimeout(resolve, 1000));
          const hand = window.hand = document.body;
          hand.setPointerCapture = undefined; // the pointer of a test is none
          const at = {...world.pose(a)}.position_m;
          window.unfollow = world.follow(hand, {
            pick: () => ({body: a, at_m: at}),
            place: ({clientX, clientY}) => [at[0] + clientX / 1000, at[1], at[2] - clientY / 1000],
          });
          const send = (type, clientX, clientY) => hand.dispatchEvent(new PointerEvent(type, {pointerId: 7, clientX, clientY}));
          send('pointerdown', 0, 0);
          for (let k = 1; k <= 20; ++k) {
            await new Promise((resolve) => setTimeout(resolve, 16));
            send('pointermove', -20 * k, -20 * k);
          }
          send('pointerup', -400, -400);
          window.fromX = at[0];
        })()"""
        )
        page.wait_for("world.pose(a).position_m[0] < fromX - 0.25 && world.pose(a).position_m[2] > 0.2")
        page.wait_for("world.pose(a).position_m[2] < 0.05")
        page.evaluate("hand.dispatchEvent(new KeyboardEvent('keydown', {key: 'PageUp'})), unfollow()")
        page.wait_for("world.pose(a).position_m[2] > 0.035")
        page.evaluate("world.remove(b)")
        for call, words in (
            ("world.remove(b)", "not in the world"),
            ("world.drag(a, [0, 0, 1])", "not held"),
            ("world.push({}, [0, 0, 1])", "not one"),
        ):
            said = page.evaluate(f"{call}.then(() => 'done', (error) => error.message)")
            assert words in said, said
        counters = page.evaluate("audio.counters()")
        print(counters)
        assert counters["strikes"] > 5 and counters["faults"] == counters["resets"] == 0, counters
        assert page.evaluate("audio.seen.errors") == []
        page.evaluate("world.close()")


def test_throw():
    """Ten boxes thrown in a page sound like the same throw by carillon-render."""
    bodies = [
        {
            "name": f"box {k}",
            "bank": "a.hdf",
            "position_m": [0.3 * (k % 5) - 0.6, 0.4 * (k // 5), 0.15 + 0.02 * k],
            "quaternion": [0.8, 0.6, 0.0, 0.0],
            "velocity_m_s": [0.2 * (k % 3) - 0.2, 0.1 * k - 0.5, 0.5],
            "angular_velocity_rad_s": [3.0 - k, 2.0, k - 4.0],
        }
        for k in range(10)
    ]
    seconds = 1.5
    act = """
      const bytes = await (await fetch('a.hdf')).arrayBuffer(), bank = await audio.addBank(bytes.slice(), 'a.hdf'), bodies = [];
      for (const {name, position_m, quaternion, velocity_m_s, angular_velocity_rad_s} of %s) {
        const body = await audio.addBody({bank, name, position_m, rotation: quaternion, effects: %s});
        bodies.push({body, bank: bytes, velocity_m_s, angular_velocity_rad_s});
      }
      const world = await World.open(audio, {bodies});
      for (let time_s = 0.05; time_s < %g; time_s += 0.05) at(time_s, () => world.settled());
      await world.settled();
      return world.at_s;
    """
    with Bench() as bench:
        bench.make_bank("a.hdf", 3, 30)
        effects = [*EFFECTS, *CONTACTS]
        act %= json.dumps(bodies), json.dumps(effects), seconds + 0.2
        got = bench.render_page({"seconds": seconds + 0.2, "listener": LISTENER}, act)
        assert got["errors"] == [] and got["counters"]["late"] == 0, got
        begin = round(got["extra"] * 48000)
        page = got["sound"][begin : begin + round(seconds * 48000)].astype(float)
        scene = {"duration_s": seconds, "bodies": bodies, "ground": {}, "listener": LISTENER, "effects": effects}
        native = bench.render_file(scene)
        first = int(np.argmax(abs(native[:, 0]) > 0.1 * abs(native[:4800, 0]).max()))
        check("the first hit", page[first - 48 : first + 960], native[first - 48 : first + 960])
        # Bounces amplify rounding: later windows differ as those of native runs that start 1e-14 m apart.
        others = []
        for offset_m in (-1e-14, -1e-15, 1e-15, 1e-14):
            moved = [{**b, "position_m": [b["position_m"][0] + offset_m, *b["position_m"][1:]]} for b in bodies]
            others.append(bench.render_file({**scene, "bodies": moved}))
        levels = np.array([10.0 * np.log10(np.mean(x.reshape(-1, 6000, 2) ** 2.0, axis=(1, 2)) + 1e-30) for x in (page, native, *others)])
        loud = levels[1] > levels[1].max() - 60.0
        low, high = levels[1:].min(axis=0), levels[1:].max(axis=0)
        beyond = np.maximum(levels[0] - high, low - levels[0]) - (high - low)  # one more run may be outside five others
        determined = int((loud & (high - low < 1.0)).sum())
        print(f"windows of 125 ms: {beyond[loud].max():.2f} dB beyond native runs, limit 3 dB; {determined} the same to 1 dB")
        assert loud.sum() >= 6 and determined >= 3 and beyond[loud].max() < 3.0, levels


def test_live():
    """Real time: interactive contacts, a suspended page, a trap in the audio thread."""
    with Bench() as bench:
        bench.make_bank("a.hdf", 3, 30)
        page = bench.page
        page.evaluate(
            """(async () => {
          const audio = window.audio = await live();
          const bank = await audio.addBank(await (await fetch('a.hdf')).arrayBuffer(), 'a.hdf');
          window.body = await audio.addBody({bank, name: 'a', fixed: true});
          body.watch(true);
          audio.addEventListener('state', ({detail}) => (window.state = detail));
        })()"""
        )
        before = page.evaluate("body.strike({triangle: 3, impulse_n_s: [0, 0, 0.1], duration_s: 1e-3}), audio.counters()")
        amplitudes = page.wait_for("window.state?.bodies[0] && state.peak_pa > 0 && Array.from(state.bodies[0].amplitudes)")
        assert len(amplitudes) == 30 and max(amplitudes) > 0.0, amplitudes

        # A scrape sounds while the hand moves and ends with it.
        page.evaluate(
            """(async () => {
          const touch = body.touch({triangle: 3, normal: [0, 0, 1], force_n: 5, slip_m_s: [0.3, 0, 0], mallet: 'steel'});
          for (let k = 0; k < 30; ++k) {
            touch.move({slip_m_s: [0.3, 0.01 * k, 0]});
            await new Promise((resolve) => setTimeout(resolve, 16));
          }
          touch.end();
        })()"""
        )
        plan = page.evaluate("audio.plan()")
        effects = plan["bodies"][0]["effects"]
        assert effects["modal"]["on"] and effects["roughness"]["on"], effects
        assert all(of["why"] for of in effects.values()), effects

        # Suspended for some seconds: time stands still, nothing is lost or late.
        page.evaluate("audio.context.suspend()")
        time.sleep(2.0)
        at = page.evaluate("audio.counters()")
        page.evaluate("body.strike({triangle: 3, impulse_n_s: [0, 0, 0.1], duration_s: 1e-3}), audio.context.resume()")
        page.wait_for(f"audio.counters().then((c) => c.quanta > {at['quanta']} + 50)")
        after = page.evaluate("audio.counters()")
        assert after["strikes"] == before["strikes"] + 2 or after["strikes"] >= 2, (before, after)
        # A browser may skip the quantum in which it is suspended.
        assert after["gaps"] - at["gaps"] <= 1 and after["late"] == after["faults"] == after["resets"] == 0, (at, after)

        # A trap silences the engine with one report; the page continues.
        page.evaluate("audio.engine.ask({type: 'fail'}).catch(() => 0)")
        page.evaluate("body.strike({triangle: 3, impulse_n_s: [0, 0, 0.1], duration_s: 1e-3})")
        said = page.evaluate("audio.settled().then(() => '', (error) => error.message)")
        assert "failed" in said and "load the page again" in said, said
        assert page.evaluate("1 + 1") == 2


def test_minute(seconds=60):
    """Twenty bodies of 200 modes, 200 strikes a second in all, for a minute, without a dropout."""
    with Bench() as bench:
        bench.make_bank("a.hdf", 6, 200)
        page = bench.page
        page.evaluate(
            """(async () => {
          const audio = window.audio = await live({load_share: null, gain_per_pa: 1e-3});
          const bank = await audio.addBank(await (await fetch('a.hdf')).arrayBuffer(), 'a.hdf');
          window.bodies = [];
          for (let i = 0; i < 20; ++i) {
            const angle = i * Math.PI / 10, position_m = [2 * Math.sin(angle), 2 * Math.cos(angle), 0];
            bodies.push(await audio.addBody({bank, name: 'a' + i, fixed: true, position_m}));
          }
          // By time stamps, so that a page's slow timers do not matter: a second ahead.
          let next_s = audio.time_s + 0.5, k = 0;
          window.strikes = 0;
          window.striking = setInterval(() => {
            for (; next_s < audio.time_s + 1.5; next_s += 1 / 200, ++k) {
              bodies[k % 20].strike({triangle: (7 * k) % 400, impulse_n_s: [0, 0, 0.003], duration_s: 5e-4, time_s: next_s});
              ++window.strikes;
            }
            const angle = audio.time_s;
            audio.setListener({position_m: [0.5 * Math.sin(angle), 0.5 * Math.cos(angle), 0],
                               rotation: [Math.cos(angle / 2), 0, 0, Math.sin(angle / 2)]});
          }, 33);
        })()"""
        )
        time.sleep(1.0)
        before, cpu_before, wall_before = (
            page.evaluate("audio.counters()"),
            bench.browser.read_cpu_s(bench.browser.AUDIO_THREADS),
            time.monotonic(),
        )
        played = page.evaluate("audio.context.currentTime")
        underruns = page.evaluate("audio.context.playbackStats?.underrunEvents ?? 0")
        time.sleep(seconds)
        after, cpu_s, wall_s = (
            page.evaluate("audio.counters()"),
            bench.browser.read_cpu_s(bench.browser.AUDIO_THREADS) - cpu_before,
            time.monotonic() - wall_before,
        )
        played_s = page.evaluate("audio.context.currentTime") - played
        underruns = page.evaluate("audio.context.playbackStats?.underrunEvents ?? 0") - underruns
        page.evaluate("clearInterval(striking)")
        errors = page.evaluate("audio.seen.errors")
        modes = (after["mode_samples"] - before["mode_samples"]) / (played_s * page.evaluate("audio.context.sampleRate"))
        busy = os.getloadavg()[0] / os.cpu_count()
        over = after["over_budget"] - before["over_budget"]
        print(f"{played_s:.1f} s of sound in {wall_s:.1f} s: {modes:.0f} modes at work, {after['strikes'] - before['strikes']} strikes,")
        print(
            f"audio thread {100 * cpu_s / played_s:.1f} % of a core, {over} quanta over budget, "
            f"{underruns} underruns of the browser, load {busy:.1f} a core"
        )
        assert errors == [] and after["gaps"] == before["gaps"] and after["resets"] == 0 and after["zeroed"] == 0 and after["faded"] == 0, (
            errors,
            after,
        )
        assert after["refused"] == 0 and after["overflows"] == 0, after
        assert after["strikes"] - before["strikes"] > 190 * played_s, after
        assert played_s > 0.98 * seconds, played_s
        # The thread's own time must leave headroom. Timely scheduling depends on the machine and is required of an idle one only.
        assert 0.0 < cpu_s < 0.5 * played_s, (cpu_s, played_s)
        if busy < 0.7:
            assert over <= 2 and underruns == 0, (over, underruns)


if __name__ == "__main__":
    globals()["test_" + sys.argv[1]]()
