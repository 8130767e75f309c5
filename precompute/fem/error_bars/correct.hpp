// Corrected frequencies: estimated mesh error removed, with error bars.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "precompute/fem/error_bars/order.hpp"
#include "precompute/fem/error_bars/parts.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::error_bars {

/// Modes of one mesh and their error estimates.
struct Level {
  std::vector<double> lambda;     // (m) [rad^2/s^2], ascending, m > 0
  std::vector<ErrorParts> parts;  // (m)
  Kind kind = Kind::kT4;
  bool is_lumped = false;   // the mass
  bool is_guessed = false;  // ErrorParts::doubt comes from the mesh alone: Surface::doubts
  bool has_rims = false;    // between fixed and free faces
  double one_layer = 0.0;   // fraction of elements that are flat and have all corners on the surface: 1 for a single-layer wall
  Unlisted unlisted;
};

/// Power of the edge length in the interpolation errors of this mesh: measured against a coarser mesh with `edge_ratio` > 1 times the mean
/// edge if given, otherwise find_order(), or 2 for T10 bodies with a single layer of elements (bent ones: 3), which converge slower as long
/// as refinement keeps one layer. Pure.
double find_order(const Level& level, const Level* coarser, double edge_ratio);

/// Predicted level on a mesh with edges `edge_ratio` times as long, corrected to the same values as `level`. keeps_geometry: refinement
/// keeps the facets. Pure.
Level predict_level(const Level& level, double power, bool keeps_geometry, double edge_ratio);

/// One entry per mode, in the order of the mesh's frequencies. Corrected frequencies may be out of order.
struct Corrections {
  std::vector<double> lambda;     // (m) [rad^2/s^2] stated values: corrected, or the mesh's
  std::vector<double> cents;      // (m) bar: distance of the k-th lowest of `lambda` from the k-th true one, k as in ErrorBars; infinite if
                                  // is_too_short()
  std::vector<double> own_cents;  // (m) bar of the mode itself, known by its shape: no longer where others may take its place in the list
  std::vector<double> facet_cents;  // (m) as ErrorBars::facet_cents, around `lambda`; empty: no facets in doubt
  double complete_below = 0.0;      // [rad^2/s^2] modes of the body that are not listed lie above
  double stated_above = 0.0;        // [rad^2/s^2] stated values of modes of the mesh that are not listed lie above,
  double stated_below = 0.0;        // or below, as those of the body below
  double complete_above = 0.0;      // [rad^2/s^2]; 0: no modes lie below the list
  // (m) one mesh: half the mesh's bar (T4: 0.4 of it); two meshes: a quarter (most T10: an eighth, see docs/error-bars.md), up to twice
  // that where T10 nearly agree; rough estimates: the mesh's own interval; uncorrected modes: the mesh's bar; disputed modes: the distance
  // of the two meshes
  std::vector<bank::Correction> correction;
};

/// Corrections of `level`. coarser: other meshes of the same body and element with longer edges, the longest first, matched mode by mode.
/// Unless disputed, no bar reaches beyond that of the last of them. Pure.
Corrections calc_corrections(const Level& level, std::span<const Level> coarser = {});

/// (m) Additional width [cents] of each bar of `cents`, from `own`, to cover the body with the alternative surface (ErrorParts::doubt).
/// Empty without ambiguous facets. Pure.
std::vector<double> find_facet_cents(const Level& level, const OwnIntervals& own, const std::vector<double>& cents);

/// Factor of lambda after removal of interpolation, lumping and geometry errors; > 0. Pure.
double calc_share_left(const ErrorParts& parts, Kind kind, bool is_lumped);

/// True if a list is too short for bars: among few lumped T4 modes a whole family (bending) may be missing because the mesh shifts it far
/// up. Pure.
bool is_too_short(const Level& level);

/// Number of modes to compute for `wanted` reliable ones: the order of the last modes and the bars of short lists need a few more.
std::size_t find_computed_count(std::size_t wanted);

}  // namespace carillon::error_bars
