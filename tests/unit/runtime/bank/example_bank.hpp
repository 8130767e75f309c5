// Synthetic bank: a box with n x n squares per side, closed-form rigid data and smooth artificial shapes.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include "runtime/bank/bank.hpp"
#include "tests/unit/runtime/bank/sphere_multipoles.hpp"

namespace carillon::bank::example {

inline constexpr Vec3 kSidesM{0.3, 0.02, 0.01};
inline constexpr Vec3 kCornerM{0.05, -0.1, 0.2};

/// Outward surface of the box: n x n squares of two triangles on each of its six sides, shared vertices.
inline void add_box(Bank& bank, int n) {
  std::map<std::tuple<int, int, int>, std::int32_t> numbers;
  const auto vertex = [&](std::array<int, 3> at) {
    const auto [entry, added] = numbers.try_emplace({at[0], at[1], at[2]}, static_cast<std::int32_t>(bank.vertices_m.size()));
    if (added) {
      Vec3 x;
      for (int k = 0; k < 3; ++k) x[k] = kCornerM[k] + kSidesM[k] * at[k] / n;
      bank.vertices_m.push_back(x);
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const int side : {0, n}) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int a, int b) {
            std::array<int, 3> at{};
            at[axis] = side;
            at[u] = i + a;
            at[v] = j + b;
            return vertex(at);
          };
          const std::int32_t a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
          if (side == n) {
            bank.triangles.push_back({a, b, c});
            bank.triangles.push_back({a, c, d});
          } else {
            bank.triangles.push_back({a, c, b});
            bank.triangles.push_back({a, d, c});
          }
        }
      }
    }
  }
}

/// phi of mode k at x: a plane wave with a direction depending on k [kg^-1/2].
inline Vec3 calc_shape(std::size_t mode, const Vec3& x) {
  const double k = static_cast<double>(mode + 1);
  const double phase = 20.0 * k * x[0] + 7.0 * x[1] * k * k + 3.0 * x[2];
  return {2.0 * std::sin(phase), 3.0 * std::cos(1.3 * phase), 0.01 * k * std::sin(0.7 * phase + 1.0)};
}

inline std::vector<double> calc_shapes(const Bank& bank) {
  std::vector<double> shapes;
  for (const Vec3& x : bank.vertices_m) {
    for (std::size_t mode = 0; mode < bank.mode_count(); ++mode) {
      for (const double value : calc_shape(mode, x)) shapes.push_back(value);
    }
  }
  return shapes;
}

inline double calc_margin(const Bank& bank, double cut_hz) {
  double margin = 1.0;
  for (std::size_t i = 0; i < bank.mode_count(); ++i) margin = std::min(margin, std::abs(std::pow(bank.freq_hz(i) / cut_hz, 2) - 1.0));
  return margin;
}

/// Proof with counts at 20 Hz, 7 kHz and 20 kHz.
inline Proof make_proof(const Bank& bank) {
  Proof proof;
  proof.cut_hz = {20.0, 7000.0, 20000.0};
  proof.found = static_cast<std::int64_t>(bank.mode_count());
  for (const double cut_hz : proof.cut_hz) {
    std::int64_t below = 6;
    for (std::size_t i = 0; i < bank.mode_count(); ++i) below += bank.freq_hz(i) < cut_hz ? 1 : 0;
    proof.below.push_back(below);
    proof.margin.push_back(calc_margin(bank, cut_hz));
  }
  proof.rigid_per_component = {6};
  proof.orthonormality = 2e-13;
  proof.backward_error = 3e-16;
  proof.method = "made up";
  return proof;
}

/// Bank of version 1.0.
inline Bank make_first_bank(int n, std::size_t modes) {
  Bank bank;
  add_box(bank, n);
  bank.material = {200e9, 0.3, 7800.0, 1e-7, 5.0};
  const auto [a, b, c] = kSidesM;
  bank.rigid.volume_m3 = a * b * c;
  const double mass = bank.rigid.mass_kg = 7800.0 * a * b * c;
  for (int k = 0; k < 3; ++k) bank.rigid.centre_m[k] = kCornerM[k] + kSidesM[k] / 2.0;
  bank.rigid.inertia_kg_m2 = {mass * (b * b + c * c) / 12.0, 0, 0, 0, mass * (a * a + c * c) / 12.0, 0, 0, 0,
                              mass * (a * a + b * b) / 12.0};
  for (std::size_t i = 0; i < modes; ++i) {
    const double omega = 2.0 * 3.14159265358979323846 * (574.44 + 19000.0 * static_cast<double>(i) / static_cast<double>(modes));
    bank.eigenvalue_rad2_s2.push_back(omega * omega);
    bank.decay_per_s.push_back((bank.material.alpha1_s * omega * omega + bank.material.alpha2_per_s) / 2.0);
    bank.residual.push_back(1e-10 * static_cast<double>(i + 1));
    bank.radiation_gain.push_back(0.5 + static_cast<double>(i % 60));
  }
  bank.counts = {static_cast<std::int64_t>(bank.vertex_count()) + 1, 6 * n * n * n, 1, 6};
  bank.element = "T10";
  bank.mass = "consistent";
  bank.provenance = R"({"mesh": "box.msh", "run": {"program": "example", "ranks": 2, "versions": {"PETSc": "3.18.5", "SLEPc": "3.18.2"},)"
                    R"( "stations": [{"name": "mesh", "seconds": 0.5, "peak_bytes_largest_rank": 80000000},)"
                    R"( {"name": "solve", "seconds": 12.25, "peak_bytes_largest_rank": 900000000}]}})";
  quantise_shapes(bank, calc_shapes(bank));
  return bank;
}

inline Bank make_bank(int n = 2, std::size_t modes = 5) {
  Bank bank = make_first_bank(n, modes);
  for (std::size_t i = 0; i < modes; ++i) {
    bank.algebraic_error_cents.push_back(1e-6 * static_cast<double>(i + 1));
    bank.discretisation_error_cents.push_back(0.5 + static_cast<double>(i));
  }
  bank.proof = make_proof(bank);
  return bank;
}

/// The same with corrected frequencies (version 1.4): every third mode 30 %, the others 1 % below the mesh's, so that the order changes;
/// the fifth is not corrected.
inline Bank make_corrected_bank(int n = 2, std::size_t modes = 9) {
  Bank bank = make_bank(n, modes);
  Corrected& corrected = bank.corrected;
  for (std::size_t m = 0; m < modes; ++m) {
    const double hz = bank.freq_hz(m) * (m == 4 ? 1.0 : m % 3 == 2 ? 0.7 : 0.99), omega = 2.0 * 3.14159265358979323846 * hz;
    corrected.freq_hz.push_back(hz);
    corrected.decay_per_s.push_back((bank.material.alpha1_s * omega * omega + bank.material.alpha2_per_s) / 2.0);
    corrected.error_cents.push_back(0.25 + static_cast<double>(m));
    corrected.correction.push_back(m == 4 ? Correction::kStiff : m % 3 == 2 ? Correction::kRough : Correction::kOneMesh);
  }
  return bank;
}

/// The same with multipoles (version 1.5).
inline Bank make_radiating_bank(int n = 2, std::size_t modes = 9) {
  Bank bank = make_corrected_bank(n, modes);
  add_multipoles(bank);
  return bank;
}

/// Fixes the ends x = 0 and x = 0.3 m with artificial reactions, the second half of the first.
inline void add_supports(Bank& bank) {
  Supports& supports = bank.supports;
  supports.text = R"({"supports": [{"name": "x-min", "on": "brick wall", "joint": "screwed"}, {"name": "x-max"}]})";
  const Vec3& c = kCornerM;
  supports.centre_m = {{c[0], c[1] + 0.01, c[2] + 0.005}, {c[0] + 0.3, c[1] + 0.01, c[2] + 0.005}};
  supports.normal = {{-1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}};
  supports.area_m2 = {2e-4, 2e-4};
  supports.thickness_m = {0.01, 0.01};
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    for (const double part : {1.0, 0.5}) {
      const double force = part * 0.4 * bank.eigenvalue_rad2_s2[m] * std::sqrt(bank.rigid.mass_kg);
      supports.reaction.insert(supports.reaction.end(), {0.1 * force, 0.2 * force, force, 0.01 * force, -0.2 * force, 0.05 * force});
      supports.energy.push_back(part / (4.0 + static_cast<double>(m)));
    }
  }
}

/// make_bank() with supports (version 1.3).
inline Bank make_supported_bank(int n = 2, std::size_t modes = 5) {
  Bank bank = make_bank(n, modes);
  add_supports(bank);
  return bank;
}

/// All contributions to the decay: material, radiation and supports.
inline Bank make_mounted_bank(int n = 2, std::size_t modes = 9) {
  Bank bank = make_radiating_bank(n, modes);
  add_supports(bank);
  return bank;
}

}  // namespace carillon::bank::example
