// Corrected frequencies: those of the mesh with the estimated error removed, with bars of their own.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "precompute/fem/error_bars/order.hpp"
#include "precompute/fem/error_bars/parts.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::error_bars {

/// The modes of one mesh and the estimates of their errors.
struct Level {
  std::vector<double> lambda;     // (m) [rad^2/s^2], ascending, m > 0
  std::vector<ErrorParts> parts;  // (m)
  Kind kind = Kind::kT4;
  bool is_lumped = false;  // the mass
  double one_layer = 0.0;  // share of the elements that are flat and have all corners on the surface: 1 for a wall of one layer
  Unlisted unlisted;
};

/// The power of the edges by which the interpolation errors of this mesh fall on the next one: measured against a coarser mesh whose mean
/// edge is `edge_ratio` > 1 times as long where there is one, otherwise find_order(), or 2 for T10 where the body has one layer of
/// elements, which a finer mesh of as many layers does not cure as fast. Pure.
double find_order(const Level& level, const Level* coarser, double edge_ratio);

/// The level that is predicted on a mesh with edges `edge_ratio` times as long, whose modes are corrected to the same values as those of
/// `level`. keeps_geometry: the mesh is refined in the facets that it has. Pure.
Level predict_level(const Level& level, double power, bool keeps_geometry, double edge_ratio);

/// One entry a mode, in the order of the mesh's frequencies. Corrected ones are not in that order where modes change places.
struct Corrections {
  std::vector<double> lambda;  // (m) [rad^2/s^2] stated values: corrected, or the mesh's
  std::vector<double> cents;   // (m) bar: the k-th lowest of `lambda` is so near to the k-th true one, k as in ErrorBars; infinite where
                               // is_too_short()
  std::vector<double> facet_cents;  // (m) as ErrorBars::facet_cents, around `lambda`; empty: no facets in doubt
  // (m) half the mesh's bar (T4: 0.4 of it) by one mesh, a quarter (a third of curved elements) by two, the mesh's own interval where it is
  // rough, the mesh's bar where it is not corrected, and as far as two meshes are apart where they dispute
  std::vector<bank::Correction> correction;
};

/// The corrections of `level`. coarser: another mesh of the same body and element with longer edges, in which the same modes are looked
/// for; null: none. Pure.
Corrections calc_corrections(const Level& level, const Level* coarser = nullptr);

/// (m) Additional width [cents] of each bar of `cents`, computed from `own`, to cover the body with the other surface too
/// (ErrorParts::doubt). Empty without facets in doubt. Pure.
std::vector<double> find_facet_cents(const Level& level, const OwnIntervals& own, const std::vector<double>& cents);

/// The share of lambda that is left when interpolation, lumping and geometry are taken off; 0 < result. Pure.
double calc_share_left(const ErrorParts& parts, Kind kind, bool is_lumped);

/// Whether a list is too short for bars: of a few T4 modes with a lumped mass a whole kind (bending) may be missing, which the mesh has far
/// above and the body has among them. Pure.
bool is_too_short(const Level& level);

/// How many modes are to be computed so that the lowest `wanted` ones are sure: the order of the last ones, and bars of short lists, need
/// some more.
std::size_t find_computed_count(std::size_t wanted);

/// The modes with the `wanted` lowest corrected frequencies, ascending numbers; all when there are no more.
std::vector<std::size_t> find_lowest(const Corrections& corrections, std::size_t wanted);

}  // namespace carillon::error_bars
