"""Radiation data of a bank, computed from its arrays alone: gains, patterns, roundness. numpy, scipy and h5py; no code of Carillon."""
import numpy as np
import scipy.special
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

AIR_DENSITY_KG_M3, SOUND_SPEED_MS = 1.21, 343.0
LOBES = 8  # harmonics of the equivalent sphere; finer patterns count as one order above (docs/decisions/radiation-gain.md)
ALONG = 5e-3  # modes that move along the surface: less than this share of the square of their motion is normal to it
POLAR, AROUND = 48, 96  # directions: Gauss-Legendre by equal steps, exact for products of harmonics to order 47


def calc_harmonics(directions, order):
    """Real orthonormal harmonics (directions, (order + 1)^2) at l^2 + l + m."""
    x, y, z = directions.T
    angle, harmonics = np.arctan2(y, x), np.empty((len(directions), (order + 1) ** 2))
    for m in range(order + 1):
        here = np.sqrt(0.25 / np.pi) * np.ones_like(z)  # P_mm, orthonormal
        for i in range(1, m + 1):
            here = here * np.sqrt((2 * i + 1) / (2 * i)) * np.sqrt(np.maximum(0.0, 1 - z**2))
        before = np.zeros_like(here)
        for el in range(m, order + 1):
            root = 1.0 if m == 0 else np.sqrt(2.0)
            harmonics[:, el * el + el + m] = root * here * np.cos(m * angle)
            if m > 0:
                harmonics[:, el * el + el - m] = root * here * np.sin(m * angle)
            ahead = np.sqrt((4 * (el + 1) ** 2 - 1) / ((el + 1) ** 2 - m * m))
            behind = np.sqrt((el * el - m * m) / (4 * el * el - 1)) if el > m else 0.0
            before, here = here, ahead * (z * here - behind * before)
    return harmonics


def calc_hankel(order, x, derivative=False):
    """h_l(x) = j_l + i y_l, or h_l'(x): (order + 1)."""
    el = np.arange(order + 1)
    return scipy.special.spherical_jn(el, x, derivative) + 1j * scipy.special.spherical_yn(el, x, derivative)


def make_directions():
    """Unit vectors (n, 3), and weights whose sum is 1."""
    z, weight = np.polynomial.legendre.leggauss(POLAR)
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    z, angle, weight = np.repeat(z, AROUND), np.tile(angle, POLAR), np.repeat(weight / (2 * AROUND), AROUND)
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z]), weight


class Air:
    """A bank: outer surface and radiation of its modes."""

    def __init__(self, file):
        import h5py

        with h5py.File(file) as bank:
            self.vertices_m, self.triangles = bank["mesh/vertices"][:], bank["mesh/triangles"][:]
            self.shape = bank["modes/shape"][:] * bank["modes/shape_scale"][:][None, :, None]  # (vertices, modes, 3)
            self.osg02 = bank["modes/radiation_gain"][:]
            decay = "modes/corrected_decay" if "modes/corrected_decay" in bank else "modes/decay"
            self.material_per_s = bank[decay][:]
            air = bank["radiation"]
            self.freq_hz, self.order, self.scale = air["freq_hz"][:], air["order"][:], air["scale"][:]
            self.centre_m, self.radius_m = air["centre_m"][:], float(air["radius_m"][()])
            self.nearest_m = float(air["nearest_m"][()])
            self.decay_per_s, self.added_mass, self.error_db = air["decay"][:], air["added_mass"][:], air["error_db"][:]
            assert air["air_density_kg_m3"][()] == AIR_DENSITY_KG_M3 and air["sound_speed_ms"][()] == SOUND_SPEED_MS
            self.method = air["method"][()].decode()
            steps = air["coefficient"][:]
        ends = np.cumsum((self.order + 1) ** 2)
        pressure = np.split(steps[:, 0] + 1j * steps[:, 1], ends[:-1])
        self.pressure = [a * scale for a, scale in zip(pressure, self.scale)]  # a_lm on the sphere R
        self.k = 2 * np.pi * self.freq_hz / SOUND_SPEED_MS
        self.make_skin()

    def make_skin(self):
        """Triangles of the shells that enclose a positive volume, and the enclosed volume."""
        corners = self.triangles
        edges = np.sort(np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
        _, edge = np.unique(edges, axis=0, return_inverse=True)
        count = len(corners)
        joined = coo_matrix((np.ones(3 * count), (np.tile(np.arange(count), 3), count + edge.ravel())), shape=(count + edge.max() + 1,) * 2)
        shell = connected_components(joined, directed=False)[1][:count]
        a, b, c = (self.vertices_m[corners[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a) / 2
        volume = np.einsum("ij,ij->i", a, normal) / 3
        outer = np.bincount(shell, weights=volume)[shell] > 0
        self.skin, self.normal_m2, volume, middle = corners[outer], normal[outer], volume[outer], ((a + b + c) / 3)[outer]
        self.area_m2 = np.linalg.norm(self.normal_m2, axis=1)
        self.volume_m3 = volume.sum()
        inside = (0.75 * middle * volume[:, None]).sum(axis=0) / self.volume_m3  # the centre of a tetrahedron from the origin
        directions = middle - inside
        self.directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        self.roundness = 36 * np.pi * self.volume_m3**2 / self.area_m2.sum() ** 3
        motion = self.shape[self.skin].mean(axis=1)  # (triangles, modes, 3)
        self.through = np.einsum("tmi,ti->tm", motion, self.normal_m2)  # m^2 kg^-1/2
        square = np.einsum("tmi,tmi,t->m", motion, motion, self.area_m2)
        self.squares = np.einsum("tm,t->m", self.through**2, 1 / np.maximum(self.area_m2, 1e-300))
        self.is_heard = self.squares > ALONG * square

    def calc_sphere_gains(self):
        """Gains of the sphere of the same area, at the frequencies of the air."""
        area = self.area_m2.sum()
        radius = np.sqrt(area / (4 * np.pi))
        flow = calc_harmonics(self.directions, LOBES).T @ self.through / radius**2  # U_lm, (81, modes)
        power = np.array([(flow[el * el : (el + 1) ** 2] ** 2).sum(axis=0) for el in range(LOBES + 1)])
        rest = np.maximum(0.0, self.squares / radius**2 - power.sum(axis=0))
        power = np.vstack([power, rest])
        gains = []
        for m, k in enumerate(self.k):
            sizes = np.abs(calc_hankel(LOBES + 1, k * radius, derivative=True))
            gains.append(AIR_DENSITY_KG_M3 * SOUND_SPEED_MS / k * np.sqrt((power[:, m] / sizes**2).sum() / (4 * np.pi)))
        return np.array(gains)

    def calc_sphere_decays(self):
        """Decay by radiation that those gains are [1/s]."""
        return 2 * np.pi * self.calc_sphere_gains() ** 2 / (AIR_DENSITY_KG_M3 * SOUND_SPEED_MS)

    def calc_true_gains(self):
        return np.sqrt(self.decay_per_s * AIR_DENSITY_KG_M3 * SOUND_SPEED_MS / (2 * np.pi))

    def calc_far_coefficients(self, mode):
        """c_lm of the far field F(d) = r p e^{-i k r}, about the centre of the multipoles: p = sum of c_lm h_l(k r) Y_lm."""
        el = np.sqrt(np.arange(len(self.pressure[mode]))).astype(int)
        sizes = calc_hankel(self.order[mode], self.k[mode] * self.radius_m)
        return (self.pressure[mode] / sizes[el]) * (-1j) ** (el + 1) / self.k[mode]

    def calc_far(self, directions, harmonics):
        """F (directions, modes) about the origin of the mesh: the way from one centre to another is a phase."""
        far = np.empty((len(directions), len(self.k)), complex)
        for m, k in enumerate(self.k):
            c = self.calc_far_coefficients(m)
            far[:, m] = (harmonics[:, : len(c)] @ c) * np.exp(-1j * k * (directions @ self.centre_m))
        return far

    def calc_tail(self, mode, distance_m):
        """Share of the square of the pressure that orders above l make, (order + 1); infinite distance: far away."""
        order = self.order[mode]
        el = np.sqrt(np.arange(len(self.pressure[mode]))).astype(int)
        here = np.abs(calc_hankel(order, self.k[mode] * self.radius_m))
        there = np.abs(calc_hankel(order, self.k[mode] * distance_m)) if np.isfinite(distance_m) else np.ones(order + 1)
        power = np.bincount(el, weights=np.abs(self.pressure[mode]) ** 2) * (there / here) ** 2
        return 1 - np.cumsum(power) / power.sum()


def compare_far(one, truth, weights):
    """(level, pattern) of every mode [dB]: of the root mean square over directions; of the difference with its phase over the truth."""
    sizes = [np.sqrt(weights @ np.abs(far) ** 2) for far in (one, truth)]
    sign = np.sign(np.real(weights @ (np.conj(truth) * one)))  # of the mode shape, which no solver promises
    missed = np.sqrt(weights @ np.abs(one * sign - truth) ** 2)
    return 20 * np.log10(sizes[0] / sizes[1]), 20 * np.log10(np.maximum(missed / sizes[1], 1e-10))
