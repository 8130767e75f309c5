#include "precompute/eigen/inner_product.hpp"

#include <algorithm>

namespace carillon::eigen {

InnerProduct::InnerProduct(const comm::Communicator& comm, const la::NodeMatrix& mass, std::ptrdiff_t rows, int width)
    : comm_(comm),
      mass_(mass),
      width_(width),
      space_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(width)),
      z_{space_.data(), rows, rows, width} {}

la::Matrix InnerProduct::subtract_and_calc_products(const la::Product& product, int s_stride, std::span<const Columns> c, int count,
                                                    std::array<double, 2>& sums) {
  int all = 0;
  for (const Columns& set : c) all += set.count;
  const std::ptrdiff_t size = std::ptrdiff_t{all} * count;
  std::vector<double> message(static_cast<std::size_t>(size) + sums.size(), 0.0);
  const Columns w = w_.part(0, count);
  if (mass_.is_diagonal()) {
    la::subtract_and_multiply_transposed(product, s_stride, mass_.get_diagonal(), w, c, message.data(), all);
  } else {
    la::subtract_product(product.a, product.s, s_stride, w);
    multiply();
    double* at = message.data();
    for (const Columns& set : c) {
      la::multiply_transposed(set, z_.part(0, count), at, all);
      at += set.count;
    }
  }
  std::copy(sums.begin(), sums.end(), message.begin() + size);
  comm_.sum(message);
  std::copy(message.begin() + size, message.end(), sums.begin());
  return Eigen::Map<const la::Matrix>(message.data(), all, count);
}

void InnerProduct::subtract_and_combine(std::span<const la::Product> products, int s_stride, const double* t, int count) {
  const Columns w = w_.part(0, count);
  if (mass_.is_diagonal()) return la::subtract_and_combine(products, s_stride, t, mass_.get_diagonal(), w, z_.part(0, count));
  for (const la::Product& product : products) la::subtract_product(product.a, product.s, s_stride, w);
  if (t != nullptr) la::combine_columns(w, t, count);
  multiply();
}

}  // namespace carillon::eigen
