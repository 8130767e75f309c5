"""The scaling laws of CS448Z's assignment: density, stiffness and size without a solve, compared with fresh solves, in the bank and in the
sound."""
import math

import h5py
import numpy

import measure
import stage as tools

# Factors on density, on both elastic constants, and on lengths, from data for density 1 (CS448Z: E = 7e10 Pa, nu = 0.3).
EDITS = {"aluminium": (2700.0, 1.0, 1.0), "steel": (7850.0, 2e11 / 7e10, 1.0), "twice": (2700.0, 1.0, 2.0)}
BODIES = {"sphere": [0.2, 0.0, 0.0], "rod": [0.15, 0.0, 0.005], "slab": [0.29, 0.24, 0.04]}  # where it is struck
ALPHA1, ALPHA2 = 1e-8, 6.0  # of every job: damping follows the scaled eigenvalue


def read_bank(file):
    """(eigenvalues, decays, shapes (V, m, 3), vertices) of a bank, up to where it has all modes of the mesh: bands are of corrected
    frequencies."""
    with h5py.File(file) as bank:
        hz = bank["modes/frequency_hz"][:]
        count = int((hz < bank["proof/complete_below_hz"][()]).sum()) if "proof/complete_below_hz" in bank else len(hz)
        shapes = bank["modes/shape"][:, :count] * bank["modes/shape_scale"][:count][None, :, None]
        return (2 * math.pi * hz[:count]) ** 2, bank["modes/decay"][:count], shapes, bank["mesh/vertices"][:]


def find_groups(eigenvalues):
    """Slices of modes that are degenerate to 1e-3, whose shapes are one subspace."""
    ends = [0, *(1 + numpy.flatnonzero(numpy.diff(eigenvalues) > 1e-3 * eigenvalues[:-1])), len(eigenvalues)]
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:])]


def play(stage):
    rows = [
        (
            "body",
            "from density 1 to",
            "modes",
            "formula [Hz]",
            "fresh solve [Hz]",
            "worst of lambda",
            "of decays",
            "of shapes",
            "in the sound [Hz]",
            "cents off",
        )
    ]
    for body, point in BODIES.items():
        job = tools.read_json(stage.folder / f"{body}.json")
        quick = {"body.nodes": 1200}
        stage.solve(f"{body}.json", f"{body}-unit", quick=quick)
        unit, _, unit_shapes, unit_vertices = read_bank(stage.out / f"{body}-unit.hdf")
        for name, (density, stiffness, size) in EDITS.items():
            lengths = {f"body.{key}": size * value for key, value in job["body"].items() if key.endswith("_m")}
            edited = {
                **lengths,
                "material.density_kg_m3": density,
                "material.young_modulus_pa": job["material"]["young_modulus_pa"] * stiffness,
                "band_hz": [20, 20000],
            }
            stage.solve(f"{body}.json", f"{body}-{name}", edited, quick)
            fresh, decays, shapes, vertices = read_bank(stage.out / f"{body}-{name}.hdf")

            # carillon-bank applies the laws to the file.
            stage.run(
                "the edit",
                stage.bin / "carillon-bank",
                "edit",
                f"{body}-unit.hdf",
                f"{body}-{name}-edited.hdf",
                "--density",
                density,
                "--stiffness",
                stiffness,
                "--size",
                size,
            )
            by_edit, decays_by_edit, shapes_by_edit, _ = read_bank(stage.out / f"{body}-{name}-edited.hdf")

            # The laws. K grows with stiffness and size, M with density and size^3; phi^T M phi = 1 stays.
            scaled = unit * stiffness / density / size**2
            scaled_shapes = unit_shapes / math.sqrt(density * size**3)
            count = min(len(scaled), len(fresh))
            off = abs(scaled[:count] / fresh[:count] - 1).max()
            off_edit = max(
                abs(by_edit / scaled - 1).max(),
                abs(shapes_by_edit - scaled_shapes).max() / abs(scaled_shapes).max(),
                abs(decays_by_edit / (0.5 * (ALPHA1 * scaled + ALPHA2)) - 1).max(),
            )
            stage.expect(f"{body}, {name}: carillon-bank edit gives the formulas' bank to 1e-12: {off_edit:.1e}", off_edit < 1e-12)
            off_decay = abs(0.5 * (ALPHA1 * scaled[:count] + ALPHA2) / decays[:count] - 1).max()
            assert numpy.allclose(vertices, size * unit_vertices, rtol=1e-9, atol=1e-12)
            off_shape = 0.0
            groups = find_groups(scaled)
            for group in groups:
                if group.stop >= count:  # cut by the end of a band
                    break
                a, b = ((s[:, group] ** 2).sum(axis=(1, 2)) for s in (scaled_shapes, shapes))
                off_shape = max(off_shape, abs(a - b).max() / b.max())

            # Radiation as OSG02 has it: the ball's lowest mode is torsion, and really makes no sound.
            scene = {
                "radiation": "osg02",
                "frequencies": "mesh",  # the formula is about those
                "duration_s": 1.0,
                "bodies": [{"name": body, "bank": f"{body}-{name}.hdf", "fixed": True}],
                "strikes": [{"time_s": 0.05, "body": body, "point_m": [size * x for x in point], "impulse_n_s": [-0.05, 0.02, -0.05]}],
            }
            rate, samples, _ = stage.render(f"{body}-{name}", scene, picture=False)
            # The degenerate modes of the ball are five that a coarse mesh separates a little: the sound has to lie among them.
            damped = [math.sqrt(x - 0.25 * (ALPHA1 * x + ALPHA2) ** 2) / (2 * math.pi) for x in (scaled[0], scaled[groups[0].stop - 1])]
            hz = measure.find_peak(samples[int(0.05 * rate) :], rate, damped[0], 0.004)
            cents = 1200 * math.log2(hz / min(max(hz, damped[0]), damped[1]))
            rows.append(
                (
                    body,
                    name,
                    count,
                    f"{math.sqrt(scaled[0]) / 2 / math.pi:.3f}",
                    f"{math.sqrt(fresh[0]) / 2 / math.pi:.3f}",
                    f"{off:.0e}",
                    f"{off_decay:.0e}",
                    f"{off_shape:.0e}",
                    f"{hz:.3f}",
                    f"{cents:+.2f}",
                )
            )
            stage.expect(f"{body}, {name}: eigenvalues by formula are those of a fresh solve to 1e-7: {off:.1e}", off < 1e-7)
            stage.expect(f"{body}, {name}: decays by formula are those of a fresh solve to 1e-7: {off_decay:.1e}", off_decay < 1e-7)
            stage.expect(f"{body}, {name}: shapes by formula are those of a fresh solve to 2e-4: {off_shape:.1e}", off_shape < 2e-4)
            stage.expect(f"{body}, {name}: the sound has the formula's base frequency to 1 cent: {cents:+.2f}", abs(cents) < 1.0)
            if body == "sphere":
                # The ball's lowest mode, torsion with l = 2: omega a / c_T = 2.501132610 whatever Poisson's ratio (Lamb 1882).
                exact = 2.5011326104 * math.sqrt(7e10 * stiffness / 2.6 / density) / (2 * math.pi * size * job["body"]["radius_m"])
                stage.compare(f"sphere, {name}: the sound against Lamb's closed form [Hz]", hz, exact, 0.5 if stage.quick else 0.05)
    print()
    stage.show("scaling", rows, rows[0][5:8])
