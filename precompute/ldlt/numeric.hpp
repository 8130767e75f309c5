// The numbers of a factorisation, and what computes and uses them.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "precompute/ldlt/plan.hpp"

namespace carillon::ldlt {

struct FreeNumbers {
  std::size_t mapped_bytes = 0;  // 0: from the heap
  void operator()(double* p) const;
};

/// When a large buffer gets its memory: all of it at once takes two thirds of the time, and is for what will be used from end to end.
enum class Pages { kWhenTouched, kAtOnce };

/// Uninitialised numbers, aligned for vectors. Large ones are pages of their own, which go back to the system at once: update matrices come
/// and go, and what the heap keeps of them would count as memory of the rank. Throws std::bad_alloc.
class Buffer {
 public:
  Buffer() = default;
  explicit Buffer(std::int64_t count, Pages pages_come = Pages::kWhenTouched);
  double* data() const { return data_.get(); }
  std::int64_t size() const { return size_; }

 private:
  std::unique_ptr<double, FreeNumbers> data_;
  std::int64_t size_ = 0;
};

/// L D L^T of this rank's fronts. Each front is a row of panels; each panel is L11^-1 and then L21, both in tiles (kernels.hpp).
struct Numbers {
  Buffer panels;
  std::vector<std::int64_t> front_offsets;  // where each front's panels begin
  std::vector<double> d_diagonal;           // (3 local_nodes) the inverse of D at this rank's pivots: diagonal ...
  std::vector<double> d_off;                // ... and between a row and the next
  std::vector<std::uint8_t> order;          // (3 local_nodes) of the pivots in their panels: BlockPivots::order
  std::int64_t negative = 0;                // the rest over all ranks: negative eigenvalues of D
  double smallest = 0;                      // least magnitude of a pivot
  double growth = 0;                        // largest magnitude in L21
  bool is_complete = false;                 // no pivot vanished exactly
};

/// Room for the panels. Throws std::bad_alloc.
Numbers make_numbers(const Plan& plan);

/// Computes L D L^T of K - sigma M. Collective. Throws SystemError on all ranks when memory runs out.
void factorise_fronts(const Plan& plan, const la::Pencil& pencil, double sigma, Numbers& numbers);

/// Right-hand sides in order of elimination: blocks of 8 or 16 columns, in each a row of them per row of the matrix.
struct Workspace {
  std::vector<Buffer> blocks;  // one per 16 columns
};

inline constexpr int kSolveColumns = 32;  // at a time

/// x <- A^-1 b for at most kSolveColumns columns, `stride` apart; b may be x. Collective.
void solve_columns(const Plan& plan, const Numbers& numbers, Workspace& workspace, const double* b, double* x, int stride, int columns);
Workspace make_workspace(const Plan& plan);

}  // namespace carillon::ldlt
