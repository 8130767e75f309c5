// Method:     k = a + (b - a) (0.6 t + 0.4 t^2): finer at the lower end, where fields vary as powers of k. Lagrange interpolation on the
//   four wave numbers around a mode; error bound: difference from the three nearest.
// Source:     docs/equations.md E10.
#include "precompute/air/wave_numbers.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace carillon::air {
namespace {

std::vector<double> calc_lagrange(std::span<const double> nodes, double k) {
  std::vector<double> weights(nodes.size(), 1.0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < nodes.size(); ++j)
      if (j != i) weights[i] *= (k - nodes[j]) / (nodes[i] - nodes[j]);
  return weights;
}

}  // namespace

WaveNumbers::WaveNumbers(std::span<const double> modes, double radius_m, double step) {
  std::vector<double> own(modes.begin(), modes.end());
  std::sort(own.begin(), own.end());
  own.erase(std::unique(own.begin(), own.end()), own.end());
  if (own.empty()) return;
  const double low = 0.995 * own.front(), high = 1.005 * own.back();
  const auto count = static_cast<std::size_t>(std::ceil((high - low) * radius_m / step)) + 3;
  if (count >= own.size()) {
    nodes_ = std::move(own);
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(count - 1);
    nodes_.push_back(low + (high - low) * (0.6 + 0.4 * t) * t);
  }
}

Stencil WaveNumbers::find_stencil(double k) const {
  const auto above = std::lower_bound(nodes_.begin(), nodes_.end(), k);
  const auto at = static_cast<std::int32_t>(above - nodes_.begin());
  if (above != nodes_.end() && *above == k) return {{at}, {1.0}, {1.0}};
  const auto count = static_cast<std::int32_t>(std::min(kStencil, nodes_.size()));
  const std::int32_t first = std::clamp(at - count / 2, 0, static_cast<std::int32_t>(nodes_.size()) - count);
  Stencil stencil;
  for (std::int32_t i = first; i < first + count; ++i) stencil.nodes.push_back(i);
  const std::span<const double> near = std::span(nodes_).subspan(first, count);
  stencil.weights = calc_lagrange(near, k);
  const bool drops_first = count > 1 && k - near.front() > near.back() - k;
  stencil.weights_without_farthest = calc_lagrange(drops_first ? near.subspan(1) : near.first(near.size() - 1), k);
  stencil.weights_without_farthest.insert(drops_first ? stencil.weights_without_farthest.begin() : stencil.weights_without_farthest.end(),
                                          0.0);
  return stencil;
}

bool WaveNumbers::refine(std::span<const double> modes, const std::vector<bool>& is_wrong) {
  std::map<std::ptrdiff_t, double> chosen;  // by step
  for (std::size_t m = 0; m < modes.size(); ++m) {
    if (!is_wrong[m]) continue;
    const auto above = std::lower_bound(nodes_.begin(), nodes_.end(), modes[m]);
    if (above != nodes_.end() && *above == modes[m]) continue;
    const bool is_outside = above == nodes_.begin() || above == nodes_.end();
    const double middle = is_outside ? modes[m] : 0.5 * (*above + *(above - 1));
    const auto [best, is_new] = chosen.try_emplace(above - nodes_.begin(), modes[m]);
    if (!is_new && std::abs(modes[m] - middle) < std::abs(best->second - middle)) best->second = modes[m];
  }
  for (const auto& [step, k] : chosen) nodes_.push_back(k);
  std::sort(nodes_.begin(), nodes_.end());
  return !chosen.empty();
}

}  // namespace carillon::air
