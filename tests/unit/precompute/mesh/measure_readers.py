#!/usr/bin/env python3
"""How do libgmsh and VTK behave on damaged mesh files?  The measurement behind docs/decisions/mesh-readers.md.

Every damaged copy is read in a child process of its own. Counted: died by a signal, hung (10 s), reported (an exception, or any error or
warning in the library's log), reported with a line or byte, silent (returned normally without a word). Damage: the file cut at a random
place; a number of the file (a count or a reference) replaced by an absurd one; one random byte replaced. Only the first two must always be
noticed (a changed digit of a coordinate may be good data), so `silent` counts these alone.

Needs python3-gmsh, python3-vtk9. Run: /usr/bin/python3 tests/unit/precompute/mesh/measure_readers.py FOLDER_FOR_SCRATCH
"""
import collections
import os
import random
import re
import signal
import sys

import gmsh
import vtkmodules.vtkIOXML as xml


def make_valid(folder):
    files = []
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addBox(0, 0, 0, 1, 0.5, 0.25)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], 1)
    gmsh.model.mesh.generate(3)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            path = f"{folder}/v{int(version)}{'b' if binary else 'a'}.msh"
            gmsh.write(path)
            files.append(path)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.write(f"{folder}/v.mesh")
    files.append(f"{folder}/v.mesh")
    gmsh.write(f"{folder}/v.vtk")
    gmsh.finalize()
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader

    reader = vtkUnstructuredGridReader()
    reader.SetFileName(f"{folder}/v.vtk")
    reader.Update()
    for name, mode, compress in (("a", "Ascii", 0), ("b", "Binary", 0), ("z", "Appended", 1), ("r", "Appended", 0)):
        writer = xml.vtkXMLUnstructuredGridWriter()
        path = f"{folder}/{name}.vtu"
        writer.SetFileName(path)
        writer.SetInputData(reader.GetOutput())
        getattr(writer, f"SetDataModeTo{mode}")()
        if not compress:
            writer.SetCompressorTypeToNone()
        if name == "r":
            writer.SetEncodeAppendedData(0)
        writer.Write()
        files.append(path)
    return files


def damage(data, kind, rng):
    if kind == "none":
        return data
    if kind == "cut":
        return data[: rng.randrange(1, len(data) * 19 // 20)]
    if kind == "number":
        spots = [m for m in re.finditer(rb'(?<![\w.\-+])\d+(?=[\s"])', data)]
        spot = rng.choice(spots)
        return data[: spot.start()] + rng.choice([b"999999999", b"-7", b"99999999999999999999"]) + data[spot.end() :]
    place = rng.randrange(len(data))
    return data[:place] + bytes([rng.randrange(256)]) + data[place + 1 :]


def read_with_library(path):
    """Runs in the child; returns the library's complaints as text."""
    if path.endswith(".vtu"):
        said = []
        reader = xml.vtkXMLUnstructuredGridReader()
        reader.SetFileName(path)
        for source in (reader, reader.GetExecutive()):
            for event in ("ErrorEvent", "WarningEvent"):
                source.AddObserver(event, lambda *_: said.append("error"))
        reader.Update()
        return " ".join(said), reader.GetOutput().GetNumberOfCells()
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    try:
        gmsh.open(path)
    except Exception as error:
        return "error " + " ".join(gmsh.logger.get()) + str(error), 0
    said = [m for m in gmsh.logger.get() if m.startswith(("Error", "Warning"))]
    return " ".join(said), 1


def run_child(path):
    out = path + ".said"
    pid = os.fork()
    if pid == 0:
        signal.alarm(10)
        null = os.open(out, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(null, 1)
        os.dup2(null, 2)
        said, _ = read_with_library(path)
        os.write(null, said.encode())
        os._exit(3 if said else 0)
    _, status = os.waitpid(pid, 0)
    text = open(out, "rb").read().decode("latin-1")
    if os.WIFSIGNALED(status):
        return ("hung" if os.WTERMSIG(status) == signal.SIGALRM else "signal"), text
    code = os.WEXITSTATUS(status)
    if code == 3 or re.search(r"(?i)error|warn", text):
        return ("placed" if re.search(r"(?i)\bline:? *\d+|byte \d+", text) else "reported"), text
    return ("silent" if code == 0 else "exit"), text


def main(folder):
    os.makedirs(folder, exist_ok=True)
    rng = random.Random(7)
    print(f"{'file':8} {'damage':7} {'signal':>6} {'hung':>5} {'exit':>5} {'reported':>8} {'placed':>6} {'silent':>6}")
    for path in make_valid(folder):
        data = open(path, "rb").read()
        for kind, count in (("none", 1), ("cut", 40), ("number", 40), ("byte", 20)):
            tally = collections.Counter()
            for k in range(count):
                copy = f"{folder}/damaged{os.path.splitext(path)[1]}"
                open(copy, "wb").write(damage(data, kind, rng))
                result, text = run_child(copy)
                tally[result] += 1
            print(
                f"{os.path.basename(path):8} {kind:7} {tally['signal']:6} {tally['hung']:5} {tally['exit']:5} {tally['reported']:8} "
                f"{tally['placed']:6} {tally['silent']:6}",
                flush=True,
            )


main(sys.argv[1])
