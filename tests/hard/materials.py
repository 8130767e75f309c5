#!/usr/bin/env python3
"""Hard materials: Poisson's ratios up to the limits, contrasts within a body, anisotropy up to the limit of positive definiteness, and what
lies beyond.

usage: materials.py CASE
"""
import sys

import numpy as np

import elastic
from figure import hold, hold_refusal
from programs import calc_distance, refuse, solve
from solids import make_box, of_order

MU, DENSITY, SIDE = 77e9, 7850, 0.05
SPEED = (MU / DENSITY) ** 0.5  # of shear waves
# Free cube, omega a / c_T (Legendre-Ritz after Demarest 1971, 4e-8), ascending with multiplicities; the triple sqrt(2) pi is Lame's,
# whatever nu is.
LAME = 2**0.5 * np.pi
CUBE = {
    0.0: [2.85470972] * 2 + [3.73283842] * 6,
    0.3: [2.85604469] * 2 + [3.84597119] * 3 + [3.91125034] * 3,
    0.4999: [2.85680098] * 2 + [3.88878206] * 3 + [3.92330361] * 3,
}
VARIANTS = [("T10", "consistent", 1, {}), ("T10", "consistent", 2, {"solver": {"method": "krylov-schur"}}), ("T10", "lumped", 3, {})]


def isotropic(nu, mu=MU, density=DENSITY):
    return {"young_modulus_pa": 2 * mu * (1 + nu), "poisson_ratio": nu, "density_kg_m3": density}


def hold_cube(case, nu, bound, known=True):
    """The cube's lowest modes against theory, or (nu without a row in CUBE) Lame's triple alone."""
    to_eta = 2 * np.pi * SIDE / SPEED
    for element, mass, ranks, keys in VARIANTS:
        outcome = solve(
            make_box([6, 6, 6], [SIDE] * 3), element, mass=mass, ranks=ranks, material=isotropic(nu), band_hz=(20, 4.7 / to_eta), **keys
        )
        eta = outcome.freq_hz * to_eta
        part = " ".join([element, mass, keys.get("solver", {}).get("method", "")]).strip()
        loose = 10 * bound if mass == "lumped" else bound
        if known:
            hold(case, calc_distance(eta[:8], CUBE[nu]), loose, part, ranks)
        hold(case, np.abs(np.sort(np.abs(eta / LAME - 1))[:3]).max(), loose, f"{part}: Lame's triple", ranks)


def nu_0():
    hold_cube("nu_0", 0.0, 5e-3)


def hold_locking(case, nu):
    text = solve(make_box([3, 3, 3], [SIDE] * 3), "T4", material=isotropic(nu), band_hz=(20, 50000)).text
    hold_refusal(case, text, ["warning", "T4 locks", "T10"], "T4")


def nu_0_45():
    hold_cube("nu_0_45", 0.45, 5e-3, known=False)
    hold_locking("nu_0_45", 0.45)


def nu_0_499():
    hold_cube("nu_0_499", 0.499, 1e-2, known=False)
    hold_locking("nu_0_499", 0.499)


def nu_0_4999():
    hold_cube("nu_0_4999", 0.4999, 1e-2)
    outcome = solve(make_box([6, 6, 6], [SIDE] * 3), "T10", material=isotropic(0.4999999 - 1e-7), band_hz=(20, 50000))
    hold("nu_0_4999", calc_distance(outcome.freq_hz[:8] * 2 * np.pi * SIDE / SPEED, CUBE[0.4999]), 1e-2, "nu 0.4999998")


def nu_minus_0_5():
    # Truth: an assembly of our own; and nu 0 for Lame's triple.
    hold_cube("nu_minus_0_5", -0.5, 5e-3, known=False)
    body = make_box([3, 2, 2], [0.1, 0.03, 0.02])
    for element, mass, ranks, keys in VARIANTS:
        outcome = solve(body, element, mass=mass, ranks=ranks, material=isotropic(-0.5), band_hz=(20, 40000), **keys)
        k, m = elastic.assemble(of_order(body, 2), elastic.isotropic(MU, -0.5), DENSITY, mass == "lumped")
        truth = elastic.find_frequencies(k, m, len(outcome.freq_hz) + 6, 40000)[6:]
        hold(
            "nu_minus_0_5",
            calc_distance(outcome.freq_hz, truth),
            1e-9,
            f"bar, {mass} {keys.get('solver', {}).get('method', '')}".strip(),
            ranks,
        )


def nu_out_of_range():
    for nu in (0.5, 0.6, 0.49999999, -1.0, -1.5, -0.99999999):
        message = refuse(
            make_box([1, 1, 1], [SIDE] * 3), "T10", material={"young_modulus_pa": 2e11, "poisson_ratio": nu, "density_kg_m3": 7850}
        )
        hold_refusal("nu_out_of_range", message, ["job.json:", "poisson_ratio", "0.5"], f"nu {nu!r}")


def make_rod(cells=48):
    """1 m long, 20 mm square, its halves regions 1 and 2."""
    rod = make_box([cells, 1, 1], [1.0, 0.02, 0.02])
    rod.regions = np.where(rod.corners()[:, :, 0].mean(1) < 0.5, 1, 2)
    return rod


def find_rod_roots(soft, stiff, count, high):
    """omega of nu = 0 halves of 0.5 m, free ends: rho1 c1 tan(w L1 / c1) + rho2 c2 tan(w L2 / c2) = 0, multiplied by both cosines; by
    bisection."""
    (e1, r1), (e2, r2) = soft, stiff
    c1, c2 = (e1 / r1) ** 0.5, (e2 / r2) ** 0.5

    def f(w):
        a, b = w * 0.5 / c1, w * 0.5 / c2
        return r1 * c1 * np.sin(a) * np.cos(b) + r2 * c2 * np.sin(b) * np.cos(a)

    grid = np.linspace(high * 1e-4, high, 20001)
    values, roots = f(grid), []
    for i in np.flatnonzero(values[:-1] * values[1:] < 0):
        low, top = grid[i], grid[i + 1]
        for _ in range(60):
            middle = (low + top) / 2
            low, top = (low, middle) if f(low) * f(middle) <= 0 else (middle, top)
        roots.append(low)
    return np.array(roots[:count])


def hold_rod(case, part, first, second, bound, same):
    """nu = 0: stretching is exact in three dimensions for any cross-section. Among the modes there has to be one at each root. And all
    modes are those of the same matrices, to `same`."""
    roots = find_rod_roots(first, second, 2, 2 * np.pi * 6000) / (2 * np.pi)
    band = roots[0] * 0.8, roots[1] * 1.1
    materials = {str(i + 1): {"young_modulus_pa": e, "poisson_ratio": 0.0, "density_kg_m3": r} for i, (e, r) in enumerate((first, second))}
    body, half = of_order(make_rod(), 2), make_rod().regions - 1
    c, density = np.array([elastic.isotropic(e, 0.0) for e, _ in (first, second)])[half], np.array([first[1], second[1]])[half]
    truth = {mass: elastic.refine_frequencies(body, c, density, mass == "lumped", 60, band) for mass in ("consistent", "lumped")}
    for ranks, mass, keys in ((1, "consistent", {}), (3, "lumped", {}), (2, "consistent", {"solver": {"method": "krylov-schur"}})):
        outcome = solve(make_rod(), "T10", ranks=ranks, mass=mass, materials=materials, band_hz=band, **keys)
        hold(
            case,
            max(np.abs(outcome.freq_hz / root - 1).min() for root in roots),
            bound if mass == "consistent" else 2e-3,
            f"{part}, {mass} {keys.get('solver', {}).get('method', '')}".strip(),
            ranks,
        )
        within = outcome.freq_hz[outcome.freq_hz <= band[1]]  # the band is of corrected frequencies
        hold(case, calc_distance(within, truth[mass]), same, f"{part}, {mass}: the same matrices", ranks)


def modulus_contrast():
    hold_rod("modulus_contrast", "1e6", (1e9, 1000), (1e15, 1000), 1e-5, 2e-9)
    hold_rod("modulus_contrast", "1e3", (1e9, 1000), (1e12, 1000), 1e-5, 1e-11)


def density_contrast():
    hold_rod("density_contrast", "1e4", (1e10, 10), (1e10, 1e5), 1e-4, 1e-11)


ORTHOTROPIC = {"young_modulus_pa": [11e9, 0.9e9, 0.5e9], "shear_modulus_pa": [0.7e9, 0.1e9, 0.6e9]}


def make_wood(nu, **more):
    return {"orthotropic": {**ORTHOTROPIC, **more, "poisson_ratio": nu}, "density_kg_m3": 500}


def scale_nu(parts):
    """nu12, nu23, nu13 with compliances `parts` of what one pair alone could have."""
    e = ORTHOTROPIC["young_modulus_pa"]
    return [parts[0] * (e[0] / e[1]) ** 0.5, parts[1] * (e[1] / e[2]) ** 0.5, parts[2] * (e[0] / e[2]) ** 0.5]


def orthotropic_limit():
    body = make_box([6, 3, 3], [0.1, 0.03, 0.02])
    # Equal parts p: the least eigenvalue of the scaled compliance is 1 - 2 p. So p = 0.4999 has it at 2e-4.
    for p in (0.3, 0.49, 0.4999):
        nu = scale_nu([p] * 3)
        c = elastic.orthotropic(ORTHOTROPIC["young_modulus_pa"], ORTHOTROPIC["shear_modulus_pa"], nu)
        for element, mass, ranks in (("T4", "consistent", 1), ("T10", "consistent", 2), ("T10", "lumped", 3)):
            outcome = solve(body, element, mass=mass, ranks=ranks, material=make_wood(nu), band_hz=(20, 15000))
            k, m = elastic.assemble(of_order(body, 2 if element == "T10" else 1), c, 500, mass == "lumped")
            truth = elastic.find_frequencies(k, m, len(outcome.freq_hz) + 6, 15000)[6:]
            if element == "T4" or p < 0.45:
                hold("orthotropic_limit", calc_distance(outcome.freq_hz, truth), 1e-8, f"p {p}, {element} {mass}", ranks)
            else:  # nearly incompressible: the mean dilatation takes over and is softer, never stiffer, than the displacement form
                hold(
                    "orthotropic_limit",
                    (outcome.freq_hz[:4] / truth[:4] - 1).max(),
                    1e-8,
                    f"p {p}, {element} {mass}: not stiffer than the displacement form",
                    ranks,
                )
                fine = solve(
                    make_box([12, 5, 5], [0.1, 0.03, 0.02]), "T10", mass=mass, material=make_wood(nu), band_hz=(20, 15000), max_modes=4
                )
                hold(
                    "orthotropic_limit",
                    calc_distance(outcome.freq_hz[:4], fine.freq_hz[:4]),
                    3e-2,
                    f"p {p}, {element} {mass}: against a mesh twice as fine",
                    ranks,
                )


def orthotropic_beyond():
    body = make_box([1, 1, 1], [SIDE] * 3)
    for p in (0.5, 0.51, 0.8):
        message = refuse(body, "T10", material=make_wood(scale_nu([p] * 3)))
        hold_refusal("orthotropic_beyond", message, ["job.json:", "poisson_ratio", "positive definite"], f"p {p}")
    message = refuse(body, "T10", material=make_wood([4.0, 0.1, 0.1]))
    hold_refusal("orthotropic_beyond", message, ["job.json:", "poisson_ratio", "nu12", "gain energy"], "nu12 beyond its root")
    message = refuse(body, "T10", material=make_wood([0.1, 0.1, 0.1], young_modulus_pa=[-11e9, 0.9e9, 0.5e9]))
    hold_refusal("orthotropic_beyond", message, ["job.json:", "young_modulus_pa"], "a negative modulus")


if __name__ == "__main__":
    globals()[sys.argv[1]]()
