#!/usr/bin/env python3
"""Hard cases of the air outside a body by boundary elements (a job's "radiation"; precompute/air). The truth is a closed form of what the
surface in the bank does, a symmetry, or the same air solved in another way.

usage: air.py CASE
"""
import json
import math
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.linalg import eigh
from scipy.special import h1vp, sph_harm, spherical_jn, spherical_yn

import solids
from figure import hold, hold_refusal
from programs import BIN, TIMEOUT_S

RHO, C = 1.21, 343.0  # of the air: kg/m3, m/s


def soft(young_pa, density=1000.0):
    """A solid whose waves are as slow as a case wants: k R of a mode in air goes with the root of its stiffness."""
    damping = {"rayleigh": {"alpha1_s": 1e-9, "alpha2_per_s": 0.0}}
    return {"young_modulus_pa": young_pa, "poisson_ratio": 0.3, "density_kg_m3": density, "damping": damping}


class Air:
    """A bank with its multipoles. M modes; k (M) is that of each in air."""

    def __init__(self, path):
        with h5py.File(path) as bank:
            self.vertices_m, self.triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
            self.shape = bank["modes/shape"][:] * bank["modes/shape_scale"][:][:, None]
            self.solid_hz = bank["modes/frequency_hz"][:]
            for name in ("freq_hz", "order", "decay", "added_mass", "error_db", "centre_m", "radius_m", "nearest_m"):
                setattr(self, name, bank["radiation/" + name][()])
            steps, scale = bank["radiation/coefficient"][:].astype(float), bank["radiation/scale"][:]
            assert (bank["radiation/air_density_kg_m3"][()], bank["radiation/sound_speed_ms"][()]) == (RHO, C)
            self.bytes = bank["radiation/coefficient"][:].tobytes() + bank["radiation/decay"][:].tobytes()
            self.method = bank["radiation/method"][()].decode()
        ends = np.cumsum((self.order + 1) ** 2)
        self.coefficient = [s * (steps[e - (n + 1) ** 2 : e] @ [1, 1j]) for s, n, e in zip(scale, self.order, ends)]
        self.k = 2 * math.pi * self.freq_hz / C
        for name in ("decay", "added_mass", "error_db"):
            assert np.isfinite(getattr(self, name)).all(), name

    def count_unknowns(self):
        return int(self.method.split(" unknowns")[0].split()[-1])

    def count_wave_numbers(self):
        return int(self.method.split(" wave numbers")[0].split()[-1])

    def calc_facets(self):
        """Corners (T, 3, 3), areas (T), and normal velocities at the corners (T, 3, M), of all triangles."""
        corners = self.vertices_m[self.triangles]
        twice = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(twice, axis=1) / 2
        normal = twice / (2 * area[:, None])
        return corners, area, np.einsum("td,tcmd->tcm", normal, self.shape[self.triangles])

    def calc_flows(self, side=lambda middle: np.ones(len(middle), bool)):
        """(M) volume per second through the triangles whose middles `side` chooses, at unit modal velocity [m3/s]."""
        corners, area, velocity = self.calc_facets()
        chosen = side(corners.mean(1))
        return (area[chosen, None] * velocity[chosen].mean(1)).sum(0)

    def calc_far(self, mode, order):
        """(harmonics) of the far field: a_lm / h_l(k R), up to an order."""
        far = np.zeros((order + 1) ** 2, complex)
        sizes = calc_hankel(self.k[mode] * self.radius_m, int(self.order[mode]))
        for n in range(min(order, int(self.order[mode])) + 1):
            far[n * n : (n + 1) ** 2] = self.coefficient[mode][n * n : (n + 1) ** 2] / sizes[n]
        return far

    def calc_power(self, a, b):
        """Of two modes of one frequency that swing together, the part of the power that both make [1/s]: decay of a, where a is b."""
        order = int(max(self.order[a], self.order[b]))
        return np.vdot(self.calc_far(a, order), self.calc_far(b, order)).real / (2 * RHO * C * self.k[a] * self.k[b])


def calc_hankel(x, order, derivative=False):
    n = np.arange(order + 1)
    return spherical_jn(n, x, derivative) + 1j * spherical_yn(n, x, derivative)


def run_job(folder, name, code=0, words=(), **job):
    """What carillon-precompute prints; the bank is NAME.hdf, and has been checked."""
    (folder / f"{name}.json").write_text(json.dumps({"bank": f"{name}.hdf", **job}))
    command = [BIN / "carillon-precompute", f"{name}.json", *words]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=TIMEOUT_S)
    assert done.returncode == code, f"exit code {done.returncode}: {done.stdout[-1500:]}"
    if code == 0:
        check = subprocess.run([BIN / "carillon-bank", "check", f"{name}.hdf"], cwd=folder, capture_output=True, text=True)
        assert check.returncode == 0, check.stdout + check.stderr
    return done.stdout


def radiate(folder, name, skin_nodes=1500, radiation={}, **job):
    run_job(folder, name, radiation={"method": "bem", "skin_nodes": skin_nodes, **radiation}, **job)
    return Air(folder / f"{name}.hdf")


def calc_sphere_powers(air, radius_m, side, most):
    """(most + 1, M) of each order the power that a sphere sends out whose surface moves as the bank's, over its harmonics: DLMF 10.51."""
    corners, area, velocity = air.calc_facets()
    chosen = side(corners.mean(1))
    corners, area, velocity = corners[chosen], area[chosen], velocity[chosen]
    powers = np.zeros((most + 1, velocity.shape[2]))
    halves = np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])  # of the edges: exact for products of two linear fields
    place, value = np.einsum("qc,tcd->tqd", halves, corners), np.einsum("qc,tcm->tqm", halves, velocity)
    far = np.linalg.norm(place, axis=2)
    polar, azimuth = np.arccos(place[..., 2] / far), np.arctan2(place[..., 1], place[..., 0])
    weight = np.broadcast_to(area[:, None] / 3, far.shape) / radius_m**2
    slope = np.array([calc_hankel(k * radius_m, most, True) for k in air.k]).T
    for n in range(most + 1):
        for m in range(-n, n + 1):
            part = np.einsum("tq,tqm->m", weight * sph_harm(m, n, azimuth, polar).conj(), value)
            powers[n] += RHO * C / (2 * air.k**2) * np.abs(part / slope[n]) ** 2
    return powers


def calc_screen_operator(x, y, step):
    """(cells, cells) flow through the middle of each cell by a jump of the potential of 1 on each."""
    matrix = np.zeros((len(x), len(x)))
    for sx in (-1, 1):
        for sy in (-1, 1):
            u, v = x[:, None] - x + sx * step[0] / 2, y[:, None] - y + sy * step[1] / 2
            matrix += sx * sy * np.hypot(u, v) / (4 * math.pi * u * v)
    return matrix


def calc_screen_masses(length, width, cells, speed):
    """(M) rho times the integral of jump of the potential times speed over a screen without thickness in still air of infinite sound speed:
    constant jumps on cells, collocation at their middles (hypersingular integral in closed form). `speed(x, y)`: (n, M)."""
    step = np.array([length, width]) / cells
    x, y = ((np.arange(n) + 0.5) * d - n * d / 2 for n, d in zip(cells, step))
    x, y = (g.ravel() for g in np.meshgrid(x, y, indexing="ij"))
    matrix = calc_screen_operator(x, y, step)
    moved = speed(x, y)
    jump = np.linalg.solve(matrix, moved)
    return RHO * step.prod() * np.abs((jump * moved).sum(0))


def thin_plate(folder):
    """Half a millimetre of aluminium, facets 15 to 40 times as long: both faces cancel each other's potential but for the jump between
    them. The mass of the air against that on a screen without thickness, extrapolated from two grids."""
    length, width, thickness = 0.3, 0.2, 0.0005
    plate = {"shape": "plate", "length_m": length, "width_m": width, "thickness_m": thickness, "nodes": 2500}
    for skin_nodes, bound in ((20000, 0.02), (700, 0.04)):
        air = radiate(folder, "plate", skin_nodes, body=plate, material="aluminium", band_hz=[20, 100])
        upper = air.vertices_m[:, 2] > 0.49 * thickness
        field = LinearNDInterpolator(air.vertices_m[upper, :2], air.shape[upper, :, 2])
        coarse, fine = (calc_screen_masses(length, width, np.array([3, 2]) * n, lambda x, y: field(np.c_[x, y])) for n in (10, 20))
        part = f"added mass against a screen, relative; {'own' if skin_nodes > 2500 else 'coarsened'} skin"
        hold("thin_plate", np.abs(air.added_mass / (2 * fine - coarse) - 1).max(), bound, part)


def read_mixing(path, count):
    """(M, M + 6) parts of the modes without air, and of the rigid motions after them, in each mode in air."""
    mixing = np.zeros((count, count + 6))
    with h5py.File(path) as bank:
        at = 0
        for mode, parts in enumerate(bank["radiation/mixing_count"][:]):
            mixing[mode, bank["radiation/mixing_motion"][at : at + parts]] = bank["radiation/mixing_part"][at : at + parts]
            at += parts
    return mixing


def calc_screen_matrix(length, width, cells, speed):
    """(M, M) the masses of calc_screen_masses(), also between motions."""
    step = np.array([length, width]) / cells
    x, y = ((np.arange(n) + 0.5) * d - n * d / 2 for n, d in zip(cells, step))
    x, y = (g.ravel() for g in np.meshgrid(x, y, indexing="ij"))
    moved = speed(x, y)
    jump = np.linalg.solve(calc_screen_operator(x, y, step), moved)
    mass = RHO * step.prod() * jump.T @ moved
    return np.sign(mass[0, 0]) * (mass + mass.T) / 2


def light_plate(folder):
    """Foam of half a millimetre: the air adds 0.2 to 0.8 of the modes' own mass, mixes them, and makes the free plate yield. Against the
    eigenproblem of modes and rigid motions with the air's mass on a screen without thickness, extrapolated from two grids; against the
    momentum of plate and air together, which stays zero; and against more modes."""
    length, width, thickness = 0.3, 0.2, 0.0005
    plate = {"shape": "plate", "length_m": length, "width_m": width, "thickness_m": thickness, "nodes": 2500}
    for density, young_pa in ((400.0, 2.56e8), (150.0, 1e8)):
        job = {"body": plate, "material": soft(young_pa, density)}
        air = radiate(folder, "plate", 20000, **job, band_hz=[0.5, 25])
        count = len(air.k)
        mixing = read_mixing(folder / "plate.hdf", count)
        with h5py.File(folder / "plate.hdf") as bank:
            alone_hz = bank["modes/corrected_frequency_hz"][:]
            mass, inertia = bank["rigid/mass_kg"][()], bank["rigid/inertia_kg_m2"][:]
        upper = air.vertices_m[:, 2] > 0.49 * thickness
        field = LinearNDInterpolator(air.vertices_m[upper, :2], air.shape[upper, :, 2])

        def speed(x, y):
            return np.c_[field(np.c_[x, y]), np.full(len(x), mass**-0.5), y / inertia[0, 0] ** 0.5, -x / inertia[1, 1] ** 0.5]

        coarse, fine = (calc_screen_matrix(length, width, np.array([3, 2]) * n, speed) for n in (10, 20))
        whole = np.eye(count + 3) + 2 * fine - coarse
        squares, exact = eigh(np.diag(np.append(alone_hz, [0, 0, 0]) ** 2), whole)
        found = mixing[:, list(range(count)) + [count + 2, count + 3, count + 4]]
        overlap = np.abs(found @ whole @ exact)
        own = overlap.argmax(1)
        assert len(set(own)) == count, own
        name = f"{density:.0f} kg/m3"
        hold("light_plate", np.abs(air.freq_hz / np.sqrt(squares[own]) - 1).max(), 0.0015, f"{name}, frequency, relative")
        angle = np.sqrt(np.abs(1 - overlap.max(1) ** 2 / np.einsum("mi,ij,mj->m", found, whole, found)))
        hold("light_plate", angle.max(), 0.006, f"{name}, sine of the angle between shapes")
        alone = alone_hz / np.sqrt(np.diag(whole)[:count])  # what each mode would do without the others
        missed = np.abs(alone / np.sqrt(squares[own]) - 1).max()
        assert missed > 4 * 0.0015 and 0.15 < air.added_mass.min() and air.added_mass.max() < 0.8, (missed, air.added_mass)
        # The force on the air is that which shakes the plate: a dipole, less the air that the plate takes the place of.
        shaken = np.abs(mixing[:, count + 2]) > 0.01
        omega = 2 * math.pi * air.freq_hz
        force = omega * math.sqrt(mass) * np.abs(mixing[:, count + 2]) * (1 - RHO / density)
        dipole = np.array([abs(air.calc_far(m, 1)[2]) for m in range(count)])
        wanted = air.k**2 * force / (4 * math.pi) * math.sqrt(4 * math.pi / 3)
        assert shaken.sum() >= 3
        hold("light_plate", np.abs(dipole[shaken] / wanted[shaken] - 1).max(), 0.01, f"{name}, dipole by the momentum, relative")
    # Of the lightest, which mixes most.
    more = radiate(folder, "more", 20000, **job, band_hz=[0.5, 60])
    kept = alone_hz < 0.7 * alone_hz.max()
    assert kept.sum() >= 5 and len(more.k) > 2 * count
    cents = 1200 * np.log2(air.freq_hz / more.freq_hz[:count])[kept]
    hold("light_plate", np.abs(cents).max(), 2.5, f"{name}, cents by modes beyond the band, below 0.7 of it")
    level = 10 * np.log10(air.decay / more.decay[:count])[kept]
    hold("light_plate", np.abs(level).max(), 0.3, f"{name}, dB of power by modes beyond the band, below 0.7 of it")
    text = run_job(folder, "heavy", 2, body=plate, material=soft(5e7, 80.0), band_hz=[0.5, 10], radiation="bem")
    (line,) = [line for line in text.splitlines() if "error:" in line]
    hold_refusal("light_plate", line, ["heavy.json", "the air adds", "membrane", '"radiation": "none"'], "80 kg/m3")


def find_breathing(air, count=1):
    """The modes with the most flow."""
    return np.sort(np.argsort(-np.abs(air.calc_flows()))[:count])


def long_waves(folder):
    """A ball of a tenth of a millimetre as soft as ka = 1e-4 asks for: all terms of the equation but the static ones are lost to single
    precision, and still the power, of the fourth power of ka, has to be right."""
    radius = 1e-4
    body = {"shape": "sphere", "radius_m": radius, "nodes": 3000}
    air = radiate(folder, "ball", 1500, body=body, material=soft(0.12), band_hz=[1, 70], max_modes=60)
    powers = calc_sphere_powers(air, radius, lambda middle: np.ones(len(middle), bool), 3)
    motion = powers * np.abs([calc_hankel(k * radius, 3, True) for k in air.k]).T ** 2
    share = motion / motion.sum(0)
    (breathing,) = find_breathing(air)
    assert 0.9e-4 < air.k[breathing] * radius < 1.1e-4, air.k[breathing] * radius
    for order, name in enumerate(("breathing", "to and fro")):
        chosen = np.flatnonzero(share[order] > 0.9)
        assert len(chosen) > 0, share
        hold("long_waves", np.abs(air.decay / powers.sum(0) - 1)[chosen].max(), 0.02, f"{name}, power, relative")


def sealed_cavity(folder):
    """The inner wall of a hollow ball moves as much as the outer one, and nothing of that is heard."""
    radius, wall = 0.05, 0.01
    body = {"shape": "sphere", "radius_m": radius, "wall_m": wall, "nodes": 5000}
    air = radiate(folder, "ball", 1500, body=body, material=soft(1e8), band_hz=[20, 3000], max_modes=40)
    outside = np.linalg.norm(air.vertices_m, axis=1) > radius - wall / 2
    powers = calc_sphere_powers(air, radius, lambda middle: np.linalg.norm(middle, axis=1) > radius - wall / 2, 8).sum(0)
    direction = air.vertices_m[outside] / np.linalg.norm(air.vertices_m[outside], axis=1)[:, None]
    outward = np.einsum("vd,vmd->vm", direction, air.shape[outside])
    chosen = (outward**2).sum(0) > 0.01 * (air.shape[outside] ** 2).sum((0, 2))  # the others only turn about their middle
    assert chosen.sum() > 20, chosen
    hold("sealed_cavity", np.abs(air.decay / powers - 1)[chosen].max(), 0.02, "ball, power against its outer surface, relative")
    box = {"shape": "hollow-box", "length_m": 0.2, "width_m": 0.15, "height_m": 0.1, "wall_m": 0.01, "nodes": 6000}
    air = radiate(folder, "box", 20000, body=box, material=soft(1e8), band_hz=[20, 300], max_modes=4)
    from_middle = np.abs(air.vertices_m - (air.vertices_m.max(0) + air.vertices_m.min(0)) / 2)
    outside = (np.abs(from_middle - [0.1, 0.075, 0.05]) < 1e-6).any(1).sum()
    assert outside < len(air.vertices_m)
    hold("sealed_cavity", abs(air.count_unknowns() - outside), 0, "box, unknowns that are not on its outer surface")


def two_bodies(folder):
    """Two soft cubes that know nothing of each other but through the air. Their modes come in pairs, mixed as the solver likes; both in
    step, and both against each other, have to send what two small sources do: 2 P (1 +- sin(kd) / kd)."""
    side = 0.08
    cube = solids.to_quadratic(solids.make_box([4, 4, 4], [side] * 3))
    for distance in (0.4, 3.0):
        other = solids.Solid(cube.nodes + [distance, 0, 0], cube.tets)
        solids.join(cube, other).write(folder / "two.msh")
        air = radiate(folder, "two", 5000, mesh="two.msh", element="T10", material=soft(29000.0), band_hz=[1, 60], max_modes=120)
        pair = find_breathing(air, 2)
        k, kd = air.k[pair[0]], air.k[pair[0]] * distance
        flows = np.array([air.calc_flows(lambda middle, s=s: (middle[:, 0] > 0.2) == s)[pair] for s in (False, True)])
        powers = np.array([[air.calc_power(i, j) for j in pair] for i in pair])
        one = RHO * C * k**2 / (8 * math.pi)
        total = 0.0
        for sign, name in ((1, "in step"), (-1, "against each other")):
            share = np.linalg.solve(flows, [1.0, sign])
            power = share @ powers @ share
            total += power
            error = abs(power / (2 * one * (1 + sign * math.sin(kd) / kd)) - 1)
            hold("two_bodies", error, 0.01, f"{distance:g} m apart, {name}, power, relative")
        hold("two_bodies", abs(total / (4 * one) - 1), 0.01, f"{distance:g} m apart, sum of both, relative")


def calc_line_decay(radius, k, x, motion):
    """The decay [1/s] that a long rod along x has by what it radiates, its motion across x being `motion` (n, 2): by wave numbers along it,
    each that of an endless cylinder."""
    along = k * np.sin((np.arange(400) + 0.5) / 400 * math.pi - math.pi / 2)
    across = np.sqrt(k**2 - along**2)
    moved = np.trapz(motion[:, :, None] * np.exp(-1j * along * x[:, None, None]), x, axis=0)
    # Re(i H / H') = 2 / (pi x |H'|^2), with H of order 1 (DLMF 10.5.5).
    power = (np.abs(moved) ** 2).sum(0) * RHO * C * k / (across**2 * np.abs(h1vp(1, across * radius)) ** 2)
    return (power * across).sum() * math.pi / 400 / (2 * math.pi)


def needle(folder):
    """A rod 60 radii long. The air's mass is that of a cylinder in a plane flow, rho_air / rho, less where it flows round the ends; the
    sound is that of an endless cylinder whose motion begins and ends."""
    length, radius = 0.3, 0.005
    body = {"shape": "cylinder", "length_m": length, "radius_m": radius, "nodes": 6000}
    air = radiate(folder, "rod", 20000, body=body, material="aluminium", band_hz=[100, 3000])
    x = np.unique(air.vertices_m[:, 0].round(9))
    motion = np.array([air.shape[np.abs(air.vertices_m[:, 0] - at) < 1e-8][:, :, 1:].mean(0) for at in x])
    decay = np.array([calc_line_decay(radius, k, x, motion[:, m]) for m, k in enumerate(air.k)])
    with h5py.File(folder / "rod.hdf") as bank:
        mass = RHO / bank["material/density_kg_m3"][()]
    assert len(air.k) == 6
    hold("needle", np.abs(air.added_mass / mass - 1).max(), 0.12, "added mass against a plane flow, relative")
    hold(
        "needle", np.abs(air.decay[4:] / decay[4:] - 1).max(), 0.06, "power of four half-waves, relative"
    )  # low ones hang on the ends alone
    hold("needle", np.abs(air.decay[1::2] / air.decay[::2] - 1).max(), 1e-3, "power of both of a pair, relative difference")


def slivers_in_skin(folder):
    """A strip of facets a thousand times as long as high around a box: the iteration converges, and the box sounds as without it."""
    size, cells = np.array([0.1, 0.08, 0.06]), [5, 4, 3]
    planes = [size[d] * np.arange(cells[d] + 1) / cells[d] for d in range(3)]
    strip = np.sort(np.append(planes[0], planes[0][2] + 2e-5))
    outcomes = []
    for x in (planes[0], strip):
        solids.to_quadratic(solids.make_lattice(x, planes[1], planes[2], lambda i, j, k: (0, j % 2, k % 2))).write(folder / "box.msh")
        outcomes.append(radiate(folder, "box", 5000, mesh="box.msh", element="T10", material=soft(1e8), band_hz=[20, 4000], max_modes=25))
    plain, spoilt = outcomes
    corners, area, _ = spoilt.calc_facets()
    longest = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).max(1)
    assert (2 * area / longest**2).min() < 1.01e-3
    loud = plain.decay > 1e-3 * plain.decay.max()
    assert len(plain.k) == len(spoilt.k) and loud.sum() > 15
    hold("slivers_in_skin", np.abs(10 * np.log10(spoilt.decay / plain.decay))[loud].max(), 0.1, "power, dB from that without")
    hold("slivers_in_skin", np.abs(spoilt.added_mass / plain.added_mass - 1).max(), 0.002, "added mass, relative")


def bowl_resonance(folder):
    """A soft ball with a small mouth, whose lowest mode that pumps air meets the Helmholtz resonance of the inside, which is sharp: what is
    interpolated over the wave number against a solve at each mode's own."""
    bowl = {"shape": "bowl", "outer_radius_m": 0.08, "wall_m": 0.002, "opening_angle_deg": 340, "nodes": 6000}
    job = {"body": bowl, "material": soft(1.243e7)}
    whole = radiate(folder, "whole", 1000, **job, band_hz=[140, 225])
    assert whole.count_wave_numbers() < len(whole.k), whole.method
    heard = whole.decay > 1e-6 * whole.decay.max()
    hold("bowl_resonance", whole.error_db[heard].max(), -40, "stated error of all modes that are heard, dB")
    fields = whole.shape.transpose(0, 2, 1).reshape(-1, len(whole.k))
    beyond_db, resonant = [], 0
    for band_hz in ([160, 170], [196.8, 198], [210.4, 211]):  # modes that pump air
        own = radiate(folder, "own", 1000, **job, band_hz=band_hz)
        assert 0 < len(own.k) < 4, own.k
        # Modes of one frequency may be mixed in another way.
        mix = np.linalg.lstsq(fields, own.shape.transpose(0, 2, 1).reshape(-1, len(own.k)), rcond=None)[0]
        for i in range(len(own.k)):
            chosen = np.flatnonzero(np.abs(mix[:, i]) > 1e-3)
            order = int(max(whole.order[chosen].max(), own.order[i]))
            here, there = own.calc_far(i, order), sum(mix[j, i] * whole.calc_far(j, order) for j in chosen)
            found = np.linalg.norm(there - here) / np.linalg.norm(here)
            stated = 10 ** (own.error_db[i] / 10) + sum(mix[j, i] ** 2 * 10 ** (whole.error_db[j] / 10) for j in chosen)
            beyond_db.append(20 * math.log10(found + 1e-15) - 10 * math.log10(stated))
        resonant += (own.added_mass < 0).sum()
    assert resonant == 1, "no mode meets the resonance"
    hold("bowl_resonance", max(beyond_db), 0, "dB by which the error of the far field is above the stated one")


def stopped_and_resumed(folder):
    """Stopped by SIGTERM in the middle of the air, and killed there: the next run takes up what is solved, and ends in the same bytes."""
    bowl = {"shape": "bowl", "outer_radius_m": 0.08, "wall_m": 0.002, "opening_angle_deg": 340, "nodes": 3000}
    job = {"body": bowl, "material": soft(1.0e7), "band_hz": [120, 200]}
    reference = radiate(folder, "whole", 700, **job)
    wrong = 0
    for number, code in ((signal.SIGTERM, 85), (signal.SIGKILL, -signal.SIGKILL)):
        name = number.name.lower()
        (folder / f"{name}.json").write_text(json.dumps({"bank": f"{name}.hdf", "radiation": {"method": "bem", "skin_nodes": 700}, **job}))
        command = [BIN / "carillon-precompute", f"{name}.json", "--checkpoint", f"{name}.check"]
        run = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        for line in run.stdout:
            if re.search(r"[2-9] of [0-9]+ wave numbers", line):
                break
        else:
            raise AssertionError("the air was never reached")
        run.send_signal(number)
        rest = run.communicate(timeout=TIMEOUT_S)[0]
        assert run.returncode == code, (run.returncode, rest)
        assert not (folder / f"{name}.hdf").exists() and (folder / f"{name}.check.air").exists()
        words = ("--checkpoint", f"{name}.check")
        run_job(folder, name, words=words, radiation={"method": "bem", "skin_nodes": 700}, **job)
        assert not list(folder.glob("*.check*"))
        found = Air(folder / f"{name}.hdf")
        wrong += found.bytes != reference.bytes or found.method != reference.method
    hold("stopped_and_resumed", wrong, 0, "banks with other bytes")


def half_space(folder):
    """A small source close above a rigid plane sends into half the room what it and its image make: 1 + sin(2kh) / 2kh of its power."""
    radius, height = 0.05, 0.06
    job = {"body": {"shape": "sphere", "radius_m": radius, "nodes": 2500}, "material": soft(4700.0), "band_hz": [1, 30], "max_modes": 60}
    free = radiate(folder, "free", 700, **job)
    plane = {"point_m": [0, 0, -height], "normal": [0, 0, 1]}
    above = radiate(folder, "above", 700, {"half_space": plane}, **job)
    (mode,) = find_breathing(free)
    twice = 2 * free.k[mode] * height
    assert twice < 0.1
    hold("half_space", abs(above.decay[mode] / free.decay[mode] / (1 + math.sin(twice) / twice) - 1), 0.01, "power, relative")


def coarse_skin(folder):
    """ka = 60, at which a wave is half a centimetre long, on facets of one centimetre and of half a one: refused, or right within a
    decibel."""
    body = {"shape": "sphere", "radius_m": 0.05, "nodes": 9000}
    material = {**soft(2.33e11, 7850.0), "poisson_ratio": 0.29}
    job = {"body": body, "material": material, "band_hz": [64000, 66000], "max_modes": 6}
    text = run_job(folder, "few", 2, radiation={"method": "bem", "skin_nodes": 300}, **job)
    (line,) = [line for line in text.splitlines() if "error:" in line]
    hold_refusal("coarse_skin", line, ["few.json", "too coarse", "facets per wavelength", "skin_nodes"], "300 nodes")
    assert not (folder / "few.hdf").exists()
    air = radiate(folder, "more", 1500, **job)
    powers = calc_sphere_powers(air, 0.05, lambda middle: np.ones(len(middle), bool), 12).sum(0)
    loud = powers > 1e-3 * powers.max()
    assert (air.k * 0.05 > 55).all() and loud.any()
    hold("coarse_skin", np.abs(10 * np.log10(air.decay / powers))[loud].max(), 1, "1500 nodes, power, dB")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="carillon-hard-") as name:
        globals()[sys.argv[1]](Path(name))
