// Change of the lowest frequencies when material is removed from the surface, and with the constants of the material.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/material/material.hpp"

namespace carillon::bank {

struct Bank;

/// Modes closer than this ratio of frequencies have off-diagonal columns: a cut mixes them.
inline constexpr double kPairRatio = 1.01;
/// Modes in Sensitivities by default.
inline constexpr int kSensitiveModes = 30;

/// C columns over S sites: the vertices of the surface, those of sharp edges once for each side. Column (i, i) is the change of mode i,
/// (i, j) the entry i, j of the matrix of a pair, whose eigenvalues are the changes. A cut that is d (S) [mm] deep along the normals,
/// linear between sites, changes entry c by the sum of density(s, c) area(s) d(s).
struct Sensitivities {
  std::size_t count = 0;                           // n modes, the lowest of the mesh
  std::vector<std::array<std::int32_t, 2>> modes;  // (C) i <= j; first the pairs (i, i), i = 0, 1, ...
  std::vector<double> scale;                       // (C) cent / (mm m^2), of one integer step
  std::vector<std::int16_t> density;               // (S, C) negative where a cut lowers the frequency
  std::vector<std::int32_t> vertex;                // (S) of the bank
  std::vector<std::array<float, 3>> normal;        // (S) unit, outward; mean of the side
  std::vector<float> area_m2;                      // (S) of the side, a third of each adjacent triangle
  std::vector<std::uint8_t> doubtful;              // (S) 1 near inward edges and fixed nodes, where the density is much too small
  std::string parameters;                          // JSON list of p names: "young_modulus_pa", "size", ...
  std::vector<double> by_parameter;                // (n, p) d ln f / d ln parameter; of Poisson's ratios d ln f / d nu
  std::vector<double> own_error_cents;             // (n) bar of the corrected frequency of the mode, known by its shape; may be empty

  bool is_empty() const { return modes.empty(); }
  std::size_t column_count() const { return modes.size(); }
  std::size_t site_count() const { return vertex.size(); }
  double get_density(std::size_t site, std::size_t column) const { return density[site * modes.size() + column] * scale[column]; }
};

/// Densities of the `count` lowest modes of an unpacked bank of one material, from the shapes of its surface: Hadamard's formula of a free
/// surface, whose stress is plane (docs/equations.md, sensitivities). `fixed` (V): 1 at fixed nodes. Parameters are left empty.
Sensitivities calc_sensitivities(const Bank& bank, const material::Elasticity& elasticity_pa, double density_kg_m3, std::size_t count,
                                 std::span<const std::uint8_t> fixed);

/// First-order changes [cent] of the n modes by a cut of `depth_mm` (S), ascending within each group of near modes.
std::vector<double> calc_changes(const Bank& bank, std::span<const double> depth_mm);

/// A spot where material is removed: `depth_m` deep at the site nearest to `at_m`, smoothly less deep to `radius_m`, on that side only.
struct Cut {
  Vec3 at_m{};
  double radius_m = 0.0;
  double depth_m = 0.0;
};

/// Depth of all cuts together [mm] (S).
std::vector<double> calc_depth(const Bank& bank, std::span<const Cut> cuts);

/// Density of a mode at the corners of the triangles (T, 3) [cent / (mm m^2)]; NaN where doubtful.
std::vector<float> calc_corner_density(const Bank& bank, std::size_t mode);

/// Columns of the modes `chosen`, renumbered; empty unless the lowest modes stay the lowest.
Sensitivities select_sensitive(const Sensitivities& sensitivities, std::span<const std::size_t> chosen);

/// First fault of the sizes and numbers, for a bank of V vertices and m modes; empty if valid.
std::string find_fault(const Sensitivities& sensitivities, std::size_t vertices, std::size_t modes);

}  // namespace carillon::bank
