#!/usr/bin/python3
"""The sound engine in a page built by a bundler. Vite builds a page that plays a bank; headless Chromium plays the built folder: all
requested files exist, and the sound is that of carillon-render. For other bundlers: each file of the engine is named by a literal
URL, and the files of other threads import nothing.

usage: bundle_test.py files | vite      vite: skipped, with a message, without npm's registry
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np

from browser import Browser, serve

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "support"))
import npm  # noqa: E402
from web_test import BIN, EFFECTS, LATENCY, WEB, calc_db, read_wav, run

STRIKE = {"time_s": 0.1, "body": "a", "triangle": 7, "impulse_n_s": [0.01, -0.02, 0.03], "duration_s": 0.0003}
SCENE = {
    "duration_s": 0.5,
    "effects": EFFECTS,
    "bodies": [{"name": "a", "bank": "public/a.hdf", "fixed": True}],
    "listener": {"position_m": [0, -1, 0.5]},
    "strikes": [STRIKE],
    "output": {"gain": 0.01, "format": "float", "fade_end": False},
}
# Without file addresses: the bundler finds them in the engine's module.
MAIN = """
import { CarillonAudio } from './engine/carillon-audio.js';
window.play = async () => {
  const context = new OfflineAudioContext(2, 24000 + %d, 48000);
  const audio = await CarillonAudio.open({ context, gain_per_pa: 0.01, listener: { position_m: [0, -1, 0.5] } });
  const bank = await audio.addBank(await (await fetch('a.hdf')).arrayBuffer(), 'a.hdf');
  const body = await audio.addBody({ bank, name: 'a', fixed: true, effects: %s });
  body.strike({ triangle: 7, impulse_n_s: [0.01, -0.02, 0.03], duration_s: 0.0003, time_s: 0.1 });
  await audio.settled();
  const sound = await context.startRendering();
  return [0, 1].map((c) => Array.from(sound.getChannelData(c)));
};
""" % (
    LATENCY,
    json.dumps(EFFECTS),
)


def test_files():
    main = (WEB / "carillon-audio.js").read_text()
    named = re.findall(r"new URL\(([^)]*), import\.meta\.url\)", main)
    assert len(named) == main.count("import.meta"), "every use of import.meta is such a URL"
    for name in named:
        assert re.fullmatch(r"'\./[a-z-]+\.(js|wasm)'", name), f"{name}: no literal, so bundlers leave the file out"
        assert (WEB / name.strip("'")).is_file(), name
    assert re.search(r"new Worker\(new URL\('\./carillon-worker\.js', import\.meta\.url\), \{ type: 'module' \}\)", main)
    for file in WEB.glob("*.js"):
        assert not re.search(r"^\s*import\b|\bimport\(", file.read_text(), re.M), f"{file.name} imports a file that bundlers leave out"
    for file in ("carillon-worker.js", "carillon-worklet.js"):
        assert not re.search(r"^export\b", (WEB / file).read_text(), re.M), f"{file} is no script of one file"


def test_vite():
    with tempfile.TemporaryDirectory(prefix="carillon-vite-") as scratch:
        folder = pathlib.Path(scratch)
        if not npm.install(folder, vite="^8.0.0"):
            return
        shutil.copytree(WEB, folder / "engine")
        (folder / "public").mkdir()
        run(BIN / "make_example_bank", folder / "public/a.hdf", 6, 60)
        (folder / "main.js").write_text(MAIN)
        (folder / "index.html").write_text('<!doctype html><link rel="icon" href="data:,"><script type="module" src="./main.js"></script>')
        built = subprocess.run(["npx", "vite", "build", "--base", "./"], cwd=folder, capture_output=True, text=True)
        assert built.returncode == 0, built.stdout + built.stderr
        (folder / "scene.json").write_text(json.dumps(SCENE))
        run(BIN / "carillon-render", folder / "scene.json", "-o", folder / "sound.wav", "-q")
        expected = read_wav(folder / "sound.wav")
        with serve(folder / "dist") as server, Browser() as browser:
            page = browser.open(server.url + "index.html")
            page.wait_for("typeof window.play === 'function'")
            got = np.array(page.evaluate("window.play()", timeout_s=100), dtype=np.float32).T[LATENCY:]
            missing = [path for path in server.requests if not (folder / "dist" / path.lstrip("/")).exists()]
            assert not missing and not page.errors, (missing, page.errors)
            assert page.find_strangers(server.url) == []
        db = calc_db(got, expected)
        print(f"a page built by Vite against carillon-render: {db:.1f} dB")
        assert db < -90.0 and abs(got).max() > 1e-4, (db, abs(got).max())


if __name__ == "__main__":
    {"files": test_files, "vite": test_vite}[sys.argv[1]]()
