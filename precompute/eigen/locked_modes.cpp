#include "precompute/eigen/locked_modes.hpp"

#include <algorithm>

namespace carillon::eigen {

// Calls visit(columns, offset in the range) for every set that intersects the range.
template <class Visit>
void LockedModes::for_parts(LockedRange range, const Visit& visit) const {
  int at = 0;  // first column of the set
  for (const Columns& set : sets) {
    const int from = std::max(range.first, at);
    const int to = std::min(range.first + range.count, at + set.count);
    if (from < to) visit(set.part(from - at, to - from), from - range.first);
    at += set.count;
  }
}

std::vector<Columns> LockedModes::find_parts(LockedRange range) const {
  std::vector<Columns> parts;
  for_parts(range, [&](const Columns& part, int) { parts.push_back(part); });
  return parts;
}

la::Matrix LockedModes::multiply_transposed(const comm::Communicator& comm, LockedRange range, const Columns& b) const {
  la::Matrix products = la::Matrix::Zero(range.count, b.count);
  for_parts(range, [&](const Columns& part, int at) { la::multiply_transposed(part, b, products.data() + at, range.count); });
  comm.sum(la::entries(products));
  return products;
}

void LockedModes::subtract_product(LockedRange range, const la::Matrix& s, const Columns& b) const {
  for_parts(range, [&](const Columns& part, int at) { la::subtract_product(part, s.data() + at, range.count, b); });
}

la::Matrix LockedModes::project_out(const comm::Communicator& comm, LockedRange range, const Columns& b, const Columns& z) const {
  if (range.count == 0) return {};
  const la::Matrix parts = multiply_transposed(comm, range, z);
  subtract_product(range, parts, b);
  return parts;
}

}  // namespace carillon::eigen
