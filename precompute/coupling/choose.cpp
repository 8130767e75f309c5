// Method: In a plate of thickness h, bending with the wave number k has rotation / strain = sqrt(24) / (h k); bulk shear waves have 1,
//   compression waves 0.
// Source: docs/equations.md E13.
#include "precompute/coupling/choose.hpp"

#include <algorithm>
#include <cmath>

#include "precompute/coupling/static_answer.hpp"

namespace carillon::coupling {

std::vector<double> calc_slenderness(const comm::Communicator& comm, const Strains& strains, const mesh::LocalMesh& local,
                                     const la::Columns& shapes) {
  comm::HaloExchange halo = make_halo(comm, local);
  constexpr int kAtOnce = 32;
  std::vector<double> rotation(shapes.count, 0.0), strain = rotation;
  ElementPoints points;
  RowMatrix values, gradients;
  for (int first = 0; first < shapes.count; first += kAtOnce) {
    const int width = std::min(kAtOnce, shapes.count - first);
    const Nodal nodal = spread(comm, halo, local, shapes.part(first, width));
    for (std::int32_t e = 0; e < strains.element_count(); ++e) {
      strains.calc_points(e, points);
      strains.gather(e, nodal.data(), width, values);
      Strains::calc_gradients(points, values, gradients);
      for (int p = 0; p < points.point_count(); ++p)
        for (int a = 0; a < 3; ++a)
          for (int k = 0; k < 3; ++k)
            for (int j = 0; j < width; ++j) {
              const double h = gradients(9 * p + 3 * a + k, j), t = gradients(9 * p + 3 * k + a, j);
              const double w = 0.25 * points.volume_m3[p];
              rotation[first + j] += w * (h - t) * (h - t);
              strain[first + j] += w * (h + t) * (h + t);
            }
    }
  }
  comm.sum(rotation);
  comm.sum(strain);
  for (std::size_t j = 0; j < rotation.size(); ++j) rotation[j] = std::sqrt(rotation[j] / strain[j]);
  return rotation;
}

Choice choose_modes(std::span<const double> freq_hz, std::span<const double> slenderness, std::span<const std::int32_t> eligible, int count,
                    double below_hz) {
  constexpr double kSame = 1e-6;  // relative frequency difference of degenerate modes
  Choice choice;
  std::vector<std::int32_t> bending;
  const auto find_freq = [&](std::int32_t mode) { return freq_hz[mode]; };
  for (const std::int32_t mode : eligible)
    if (slenderness[mode] >= kSlender && find_freq(mode) <= below_hz) bending.push_back(mode);
  const auto membrane = std::find_if(slenderness.begin(), slenderness.end(), [](double value) { return value < kSlender; });
  if (membrane != slenderness.end()) choice.membrane_hz = freq_hz[membrane - slenderness.begin()];
  choice.bending_count = static_cast<std::int64_t>(bending.size());
  auto kept = static_cast<std::size_t>(std::min<std::int64_t>(count, choice.bending_count));
  const auto is_same = [&](std::size_t a, std::size_t b) {
    return find_freq(bending[b]) - find_freq(bending[a]) <= kSame * find_freq(bending[b]);
  };
  if (kept > 1 && kept < bending.size() && is_same(kept - 1, kept)) {
    std::size_t first = kept - 1;
    while (first > 0 && is_same(first - 1, first)) --first;
    if (first > 0) {
      kept = first;
      choice.splits_pair = true;
    }
  }
  choice.modes.assign(bending.begin(), bending.begin() + static_cast<std::ptrdiff_t>(kept));
  if (!choice.modes.empty()) choice.top_hz = find_freq(choice.modes.back());
  return choice;
}

}  // namespace carillon::coupling
