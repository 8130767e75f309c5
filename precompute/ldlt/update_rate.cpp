#include "precompute/ldlt/update_rate.hpp"

#include <algorithm>
#include <vector>

#include "precompute/ldlt/buffer.hpp"
#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/storage.hpp"
#include "runtime/base/clock.hpp"

namespace carillon::ldlt {

double measure_update_rate() {
  constexpr int kRows = 1536;  // as in the larger fronts of a body: the update exceeds the second-level cache
  constexpr int kPivots = 3 * kPanelNodes;
  constexpr int kRuns = 3;
  constexpr double kSeconds = 0.05, kRowsOfPivots = double{kRows} * kPivots;
  const Buffer tiles(static_cast<std::int64_t>(kRowsOfPivots)), wide(static_cast<std::int64_t>(kRowsOfPivots));
  const Buffer update = Buffer::make_zero(count_update(kRows));
  std::fill_n(tiles.data(), tiles.size(), 1.0);
  std::fill_n(wide.data(), wide.size(), 1.0);
  std::vector<double*> columns;
  for (int j = 0; j < kRows; ++j) columns.push_back(update.data() + find_update_column(kRows, j));
  double best = 0, all = 0;
  for (int run = 0; run < kRuns || all < kSeconds; ++run) {
    const double start = base::get_thread_cpu_s();
    get_kernels().update({tiles.data(), wide.data(), kPivots, 0}, 0, kRows, false, columns.data());
    const double seconds = std::max(base::get_thread_cpu_s() - start, 1e-6);
    best = std::max(best, kRowsOfPivots * (kRows + 1) / seconds);
    all += seconds;
  }
  return best;
}

}  // namespace carillon::ldlt
