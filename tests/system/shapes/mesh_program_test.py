#!/usr/bin/python3
"""Command line of carillon-mesh: every shape by name alone, conflicting options and their messages."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

PROGRAM = pathlib.Path(os.environ["CARILLON_BIN_DIR"]) / "carillon-mesh"
faults = []


def run(arguments, folder):
    return subprocess.run([PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, timeout=60)


def expect(true, what):
    if not true:
        faults.append(what)
        print("FAULT:", what)


def count_by_hand(path):
    """Node and tetrahedron counts of a binary Gmsh 4.1 file, by an independent reader: block headers of $Nodes, $Entities skipped."""
    import struct

    data = path.read_bytes()
    expect(data.startswith(b"$MeshFormat\n4.1 1 8\n"), f"{path.name} is no binary Gmsh 4.1 file")
    at = data.index(b"$Nodes\n") + 7
    nodes = struct.unpack_from("<4Q", data, at)[1]
    at = data.index(b"$Elements\n") + 10
    blocks = struct.unpack_from("<4Q", data, at)[0]
    at += 32
    tets = 0
    for _ in range(blocks):
        dimension, _, kind = struct.unpack_from("<3i", data, at)
        count = struct.unpack_from("<Q", data, at + 12)[0]
        at += 20 + count * 8 * (1 + {15: 1, 4: 4, 11: 10}[kind])
        tets += count if dimension == 3 else 0
    return nodes, tets


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    for shape in ["bar", "tube", "plate", "sphere", "bowl", "box", "hollow-box", "cylinder", "disc", "ring", "cone"]:
        for order in ["1", "2"]:
            done = run(["--shape", shape, "-o", "out.msh", "--order", order, "--nodes", "4000", "--json", "report.json"], folder)
            expect(done.returncode == 0, f"{shape} order {order}: exit code {done.returncode}: {done.stderr}")
            if done.returncode:
                continue
            report = json.loads((folder / "report.json").read_text())
            nodes, tets = count_by_hand(folder / "out.msh")
            expect((nodes, tets) == (report["nodes"], report["tets"]), f"{shape}: file has {nodes}, {tets}, report {report}")
            expect(abs(nodes / 4000 - 1) <= 0.1, f"{shape} order {order}: {nodes} nodes for 4000")
            expect(report["components"] == 1, f"{shape}: {report['components']} components")
            expect(str(nodes) in done.stdout, f"{shape}: the count is not in the report")
    (folder / "out.msh").unlink()
    (folder / "report.json").unlink()

    for arguments, words in [
        (["--shape", "spher", "-o", "out.msh"], ["spher", "did you mean 'sphere'"]),
        (["--shape", "bar", "--lengtx", "1", "-o", "out.msh"], ["--lengtx", "did you mean --length"]),
        (["--shape", "bar", "--wall", "0.001", "-o", "out.msh"], ["--wall does not belong to --shape bar", "--thickness"]),
        (["--shape", "box", "--wall", "0.001", "-o", "out.msh"], ["hollow-box"]),
        (["--shape", "bar", "--scale", "2", "-o", "out.msh"], ["--scale is for surfaces"]),
        (["--shape", "bar", "--method", "stuffing", "-o", "out.msh"], ["--method is for surfaces"]),
        (["--shape", "tube", "--wall", "0.02", "-o", "out.msh"], ["wall is 0.02", "outer radius"]),
        (["--shape", "tube", "--wall", "-0.02", "-o", "out.msh"], ["wall is -0.02", "positive"]),
        (["--shape", "tube", "--wall", "5mm", "-o", "out.msh"], ["--wall", "5mm"]),
        (["--shape", "tube", "--radius", "1", "--outer-radius", "1", "-o", "out.msh"], ["one of them"]),
        (["--shape", "bar", "--nodes", "100", "--edge", "0.1", "-o", "out.msh"], ["--nodes and --edge", "one of them"]),
        (["--shape", "bar", "--nodes", "-5", "-o", "out.msh"], ["-5 nodes", "positive"]),
        (["--shape", "bar", "--order", "3", "-o", "out.msh"], ["--order", "3"]),
        (["--shape", "bar", "-o", "out.ply"], ["out.ply", ".msh"]),
        (["--shape", "bar", "-o", "out.msh", "--json", "./out.msh"], ["--json", "overwrite the mesh"]),
        (["--shape", "bar"], ["-o is missing"]),
        (["-o", "out.msh"], ["SURFACE", "--shape"]),
        (["a.obj", "--shape", "bar", "-o", "out.msh"], ["both", "a.obj", "one of them"]),
        (["a.obj", "--length", "1", "-o", "out.msh"], ["--length is a dimension of a --shape"]),
        (["a.obj", "--height", "1", "--scale", "1", "-o", "out.msh"], ["--height and --scale", "one of them"]),
        (["a.obj", "--wall", "nan", "-o", "out.msh"], ["--wall is nan"]),
        (["a.obj", "b.obj", "-o", "out.msh"], ["b.obj"]),
        (["absent.obj", "-o", "out.msh"], ["absent.obj"]),
    ]:
        done = run(arguments, folder)
        expect(done.returncode == 2, f"{arguments}: exit code {done.returncode}, not 2: {done.stderr}")
        for word in words:
            expect(word in done.stderr, f"{arguments}: '{word}' is not in: {done.stderr}")
        expect(not list(folder.iterdir()), f"{arguments}: left {list(folder.iterdir())} behind")

    done = run(["--help"], folder)
    expect(done.returncode == 0 and "--opening-angle" in done.stdout and "node sets" in done.stdout, "--help says too little")

print(f"{len(faults)} faults")
sys.exit(1 if faults else 0)
