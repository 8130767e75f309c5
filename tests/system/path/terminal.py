#!/usr/bin/python3
"""Untrusted text reaches the terminal without control characters: errors of every program, from file names, keys, texts and arguments.

usage: terminal.py BIN_DIR
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

BIN = pathlib.Path(sys.argv[1]).resolve()
NASTY = "\x1b]0;owned\x07 \x1b[31m \x7f \u0085 \u009b2J \u200e \u200f \u2028 \u2029 \u202a \u202e \u2066 \u2069"
HIDDEN = {*range(0x20), *range(0x7F, 0xA0), 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A)} - {ord("\n")}
MATERIAL = {"young_modulus_pa": 2e11, "poisson_ratio": 0.3, "density_kg_m3": 7850, "damping": {"rayleigh": {"alpha1_s": 1e-7}}}


def expect_clean(done, what):
    assert done.returncode in (2, 4), f"{what}: exit code {done.returncode}: {done.stderr!r}"
    for name, data in (("standard error", done.stderr), ("standard output", done.stdout)):
        text = data.decode("utf-8")  # invalid UTF-8 fails here
        found = sorted({hex(ord(letter)) for letter in text if ord(letter) in HIDDEN})
        assert not found, f"{what}: {name} holds {found}: {text!r}"
    assert done.stderr.strip(), f"{what}: there is no message"


def run(folder, program, *words):
    return subprocess.run(
        [BIN / program, *words],
        cwd=folder,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        timeout=300,
        env={**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"},
    )


def write(folder, name, text):
    (folder / name).write_text(text, encoding="utf-8")
    return name


def check_texts(folder):
    """Texts, keys and node sets inside files."""
    for raw in (False, True):  # as JSON escapes and as raw characters
        dump = lambda value: json.dumps(value, ensure_ascii=not raw).replace("\\u001b", "\x1b" if raw else "\\u001b")
        scene = write(folder, "scene.json", dump({"duration_s": NASTY, "bodies": []}))
        body = write(folder, "body.json", dump({"duration_s": 1, "bodies": [{"name": "a", "bank": NASTY}]}))
        name = write(folder, "name.json", dump({"duration_s": 1, "bodies": [{"name": NASTY, "bank": "none.hdf"}]}))
        key = write(folder, "key.json", dump({"duration_s": 1, NASTY: 1, "bodies": [{"name": "a", "bank": "none.hdf"}]}))
        for file in (scene, body, name, key):
            expect_clean(run(folder, "carillon-render", file, "-o", "x.wav"), f"carillon-render {file}")
        expect_clean(run(folder, "carillon-live", scene), "carillon-live")
        for change in (
            {"element": NASTY},
            {NASTY: 1},
            {"mesh": NASTY},
            {"body": {"surface": NASTY}},
            {"body": {"shape": NASTY}},
            {"material": MATERIAL | {NASTY: 1}},
        ):
            job = {"mesh": "none.msh", "material": MATERIAL, "bank": "bank.hdf"} | change
            if "body" in change:
                del job["mesh"]
            write(folder, "job.json", dump(job))
            for words in (["job.json"], ["--validate", "job.json"]):
                expect_clean(run(folder, "carillon-precompute", *words), f"carillon-precompute {words} {change}")
            expect_clean(run(folder, "carillon", "--store", "store", "submit", "job.json"), f"carillon submit {change}")
        write(
            folder, "fixed.json", dump({"body": {"shape": "bar", "nodes": 100}, "fixed": NASTY, "material": MATERIAL, "bank": "bank.hdf"})
        )
        expect_clean(run(folder, "carillon-precompute", "fixed.json"), "a node set")
        write(folder, "bad.ply", f"ply\nformat {NASTY.replace(chr(0x2028), '')} 1.0\nend_header\n")
        expect_clean(run(folder, "carillon-mesh", "bad.ply", "-o", "x.msh"), "carillon-mesh PLY")
        write(folder, "bad.msh", f"$MeshFormat\n{NASTY} 0 8\n$EndMeshFormat\n")
        write(folder, "msh.json", dump({"mesh": "bad.msh", "material": MATERIAL, "bank": "bank.hdf"}))
        expect_clean(run(folder, "carillon-precompute", "msh.json"), "a mesh")
        write(folder, "trajectory.json", dump({"bodies": [{"name": NASTY, "bank": NASTY, "fixed": True, "poses": []}]}))
        expect_clean(run(folder, "carillon-draw", "scene", "trajectory.json", "-o", "x.png"), "carillon-draw")
        write(folder, "study.json", dump({"mesh": NASTY}))
        expect_clean(run(folder, "carillon-study", "advise", "study.json", "--cents", "5"), "carillon-study")


def check_names(folder):
    """File names and arguments, which may be invalid UTF-8."""
    for name in (NASTY.encode().replace(b"/", b""), b"latin \xe9 \x9b \xff"):
        for program, words in (
            ("carillon-render", [name, b"-o", b"x.wav"]),
            ("carillon-render", [b"--" + name]),
            ("carillon-live", [name]),
            ("carillon-bank", [b"check", name]),
            ("carillon-bank", [name]),
            ("carillon-mesh", [name + b".obj", b"-o", b"x.msh"]),
            ("carillon-mesh", [b"--" + name]),
            ("carillon-precompute", [name]),
            ("carillon-precompute", [b"--" + name]),
            ("carillon", [b"submit", name]),
            ("carillon-draw", [b"modes", name, b"-o", b"x.png"]),
            ("carillon-study", [b"advise", name, b"--cents", b"5"]),
        ):
            expect_clean(run(folder, program, *words), f"{program} {words}")


with tempfile.TemporaryDirectory() as top:
    check_texts(pathlib.Path(top))
    check_names(pathlib.Path(top))
print("terminal: ok")
