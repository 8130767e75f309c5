#include "precompute/eigen/lanczos_basis.hpp"

#include <algorithm>

namespace carillon::eigen {

LanczosBasis::LanczosBasis(const Columns& memory, int room, int block)
    : memory_(memory), room_(room), block_(block), t_(la::Matrix::Zero(room, room)) {}

void LanczosBasis::start(int width) {
  size_ = width_ = width;
  previous_ = 0;
}

void LanczosBasis::set_diagonal(const la::Matrix& alpha) {
  const int first = size_ - width_;
  for (int j = 0; j < width_; ++j) {
    for (int i = 0; i < width_; ++i) t_(first + i, first + j) = 0.5 * (alpha(i, j) + alpha(j, i));
  }
}

void LanczosBasis::append() {
  const int first = size_ - width_;
  for (int j = 0; j < width_; ++j) {
    for (int i = 0; i < next_width(); ++i) t_(size_ + i, first + j) = t_(first + j, size_ + i) = coupling_(i, j);
  }
  previous_ = first;
  width_ = next_width();
  size_ += width_;
}

void LanczosBasis::restart(const la::Vector& theta, const la::Matrix& y) {
  const auto kept = static_cast<int>(theta.size());
  la::combine_columns(columns(0, size_), y.data(), kept);
  la::Matrix coupling = la::Matrix::Zero(next_width(), kept);
  for (int j = 0; j < kept; ++j) {
    for (int k = 0; k < next_width(); ++k) {
      for (int i = 0; i < width_; ++i) coupling(k, j) += coupling_(k, i) * y(size_ - width_ + i, j);
    }
  }
  t_.setZero();
  for (int j = 0; j < kept; ++j) t_(j, j) = theta[j];
  const Columns next = columns(size_, next_width()), to = columns(kept, next_width());
  for (int j = 0; j < next.count; ++j) std::copy_n(next.column(j), next.rows, to.column(j));
  coupling_ = std::move(coupling);
  size_ = width_ = kept;
}

void LanczosBasis::resume(int size, int width, int previous, const la::Matrix& t) {
  size_ = size;
  width_ = width;
  previous_ = previous;
  t_.topLeftCorner(size, size) = t;
}

}  // namespace carillon::eigen
