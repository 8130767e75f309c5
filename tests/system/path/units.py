#!/usr/bin/python3
"""Units: a mesh in millimetres with "mesh_scale" equals the body in metres, on one rank and in the parallel format, free and fixed;
values that are probably in another unit give warnings.

usage: units.py BIN_DIR
"""
import json
import pathlib
import sys
import tempfile

import meshio
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "failures"))
import solver
from runs import make_box, write_vtkhdf
from solver import GLASS, read_record


def run(folder, *words, ranks=1):
    return solver.run(folder, "carillon-precompute", *words, ranks=ranks)


def write_job(folder, **job):
    solver.write_job(folder, **{"material": GLASS} | job)


def solve(folder, ranks=1, **job):
    write_job(folder, **{"band_hz": [20, 60000], "max_modes": 8} | job)
    done = run(folder, "-q", "job.json", ranks=ranks)
    return numpy.array(solver.read_info(folder)["frequencies_hz"]), read_record(folder), done.stderr


def expect_close(found, wanted, what):
    assert len(found) == len(wanted) == 8 and abs(found / wanted - 1).max() < 1e-9, f"{what}: {found} and {wanted}"


def check_scale(folder):
    nodes, tets = make_box((8, 3, 2), (0.1, 0.033, 0.021))
    turned = numpy.linalg.det(nodes[tets[:, 1:4]] - nodes[tets[:, :1]]) < 0  # none may be inside out, which would be reported
    tets[turned, :2] = tets[turned, 1::-1]
    side = (nodes[:, 0] == 0).astype("i4")
    meshio.Mesh(nodes, [("tetra", tets)], point_data={"side": side}).write(folder / "metres.vtu")
    meshio.Mesh(1000 * nodes, [("tetra", tets)], point_data={"side": side}).write(folder / "millimetres.vtu")
    write_vtkhdf(folder / "millimetres.vtkhdf", 1000 * nodes, tets, {"side": side})
    holds = ({}, {"fixed": "side:1"}, {"fixed": {"box_m": {"min": [-1, -1, -1], "max": [1e-6, 1, 1]}}})
    for hold in holds:
        wanted, record, said = solve(folder, mesh="metres.vtu", **hold)
        assert "mesh_scale" not in record and "millimetres" not in said, said
        for mesh, ranks in (("millimetres.vtu", 1), ("millimetres.vtkhdf", 1), ("millimetres.vtkhdf", 2)):
            found, record, said = solve(folder, ranks, mesh=mesh, mesh_scale=0.001, **hold)
            expect_close(found, wanted, f"{mesh}, {hold}, {ranks} ranks")
            assert record["mesh_scale"] == 0.001 and "millimetres" not in said, said
        # The provenance is a job that reproduces the result.
        (folder / "again.json").write_text(json.dumps({key: value for key, value in record.items() if key != "run"}))
        run(folder, "-q", "again.json")
    accurate, record, _ = solve(folder, mesh="millimetres.vtu", mesh_scale=0.001, accuracy_cents=300, max_modes=8)
    coarse, _, _ = solve(folder, mesh="metres.vtu", accuracy_cents=300, max_modes=8)
    expect_close(accurate, coarse, "accuracy_cents")
    # Without the key the warning names it; with a wrong value it states the right one.
    write_job(folder, mesh="metres.vtu", mesh_scale=1000)
    warnings = json.loads(run(folder, "--validate", "--json", "job.json").stdout)["warnings"]
    assert any("millimetres" in text and "is 1000: for millimetres give 1" in text for text in warnings), warnings
    write_job(folder, mesh="millimetres.vtu")
    looked = run(folder, "--validate", "--json", "job.json")
    warnings = json.loads(looked.stdout)["warnings"]
    assert any("millimetres" in text and '"mesh_scale": 0.001' in text for text in warnings), warnings
    assert '"mesh_scale": 0.001' in looked.stderr


def check_questions(folder):
    body = {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.02, "nodes": 300}
    for change, words in (
        (
            {"young_modulus_pa": 72, "density_kg_m3": 2.5},
            ["young_modulus_pa is 72: was it given in GPa?", "density_kg_m3 is 2.5: was it given in g/cm^3?"],
        ),
        ({"young_modulus_pa": 72}, ["72: was it given in GPa?"]),
        ({"young_modulus_pa": 72000}, ["72000: was it given in MPa"]),
        ({"density_kg_m3": 2.5}, ["2.5: was it given in g/cm^3?"]),
        ({"damping": {"rayleigh": {}}}, ["rings for ever"]),
    ):
        write_job(folder, body=body, material=GLASS | change, band_hz=[20, 5000], max_modes=3)
        looked = run(folder, "--validate", "--json", "job.json")
        warnings = json.loads(looked.stdout)["warnings"]
        for word in words:
            assert sum(word in text for text in warnings) == 1, f"{change}: {warnings}"
            assert sum(word in line for line in looked.stderr.splitlines()) == 1, looked.stderr
        people = run(folder, "--validate", "job.json")
        assert all(word in people.stderr for word in words), people.stderr
    solved = run(folder, "-q", "job.json")  # no damping: solved, with the warning in the provenance
    assert "rings for ever" in solved.stderr, solved.stderr
    assert any("rings for ever" in text for text in read_record(folder)["run"]["warnings"])


with tempfile.TemporaryDirectory() as top:
    check_scale(pathlib.Path(top))
    check_questions(pathlib.Path(top))
print("units: ok")
