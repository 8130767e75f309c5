// Identities of vector algebra, independent of component formulas.
#include "runtime/base/vector.hpp"

#include <gtest/gtest.h>

#include "runtime/base/chance.hpp"

namespace carillon {
namespace {

Vec3 draw(std::uint64_t& state) {
  Vec3 v;
  for (double& x : v) x = 2.0 * base::to_unit(base::draw(state)) - 1.0;
  return v;
}

TEST(Vector, products_satisfy_lagrange_and_jacobi) {
  std::uint64_t state = 5;
  for (int n = 0; n < 1000; ++n) {
    const Vec3 a = draw(state), b = draw(state), c = draw(state);
    EXPECT_NEAR(dot(cross(a, b), cross(a, b)), dot(a, a) * dot(b, b) - dot(a, b) * dot(a, b), 1e-14);
    EXPECT_LT(norm(cross(a, cross(b, c)) + cross(b, cross(c, a)) + cross(c, cross(a, b))), 1e-14);
    EXPECT_NEAR(dot(find_across(normalise(a)), a), 0.0, 1e-14);
    EXPECT_NEAR(norm(find_across(normalise(a))), 1.0, 1e-14);
  }
}

TEST(Vector, inverse_times_matrix_is_identity) {
  std::uint64_t state = 7;
  for (int n = 0; n < 1000; ++n) {
    const Vec3 a = draw(state), b = draw(state), c = draw(state), x = draw(state);
    Mat3 m{a, b, c};
    m = m * transpose(m);
    for (std::size_t k = 0; k < 3; ++k) m[k][k] += 1.0;
    EXPECT_LT(norm(calc_inverse(m) * (m * x) - x), 1e-13);
    EXPECT_LT(norm(turn_back(m, x) - transpose(m) * x), 1e-14);
  }
}

}  // namespace
}  // namespace carillon
