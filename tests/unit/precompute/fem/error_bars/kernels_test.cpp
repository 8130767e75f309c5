// Kernels of the estimate: equal results for every instruction set, exact integration.
#include "precompute/fem/error_bars/kernels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "precompute/mesh/tet_mesh.hpp"
#include "tests/support/instruction_sets.hpp"

namespace carillon::error_bars {
namespace {

struct Work {
  Elements elements;
  std::vector<std::int32_t> value_of;
  std::vector<Shift> shifts;
  std::vector<Middle> middles;
  std::vector<Traction> tractions;
  std::vector<FloatLanes> displacement;
  std::vector<DoubleLanes> displacement2;
};

/// Random elements on 40 nodes; 70 elements, so that the last chunk is partial.
Work make_work(int nodes) {
  std::mt19937 random(11);
  std::normal_distribution<float> value;
  std::uniform_int_distribution<std::int32_t> node(0, 39);
  Work work;
  Elements& e = work.elements;
  e.nodes = nodes;
  e.samples = nodes == 4 ? 1 : 4;
  e.terms = nodes == 4 ? 1 : 10;
  e.count = 70;
  e.material.assign(e.count, 0);
  e.root.resize(1);
  for (float& entry : e.root[0]) entry = value(random);
  e.dilatation = {0.5F};
  e.density = {3.0F};
  for (std::size_t i = 0; i < e.count; ++i) {
    e.volume.push_back(1.0F + value(random) / 8);
    e.singular.push_back(i % 3 == 0 ? 1.0F : 0.0F);
    e.bent.push_back(i % 4 == 0 ? 0.5F : 0.0F);
    e.share.push_back(i % 5 == 0 ? 0.5F : 1.0F);
    for (int k = 0; k < nodes; ++k) {
      e.node.push_back(node(random));
      work.value_of.push_back(node(random));
    }
    for (int k = 0; k < 4; ++k) e.patch.push_back(node(random));
  }
  e.gradient.resize(e.count * e.samples * (nodes - 1) * 3);
  for (float& entry : e.gradient) entry = value(random);
  e.weight.resize(e.count * 4 * e.samples * e.terms);
  for (float& entry : e.weight) entry = value(random);
  work.displacement.resize(120);
  work.displacement2.resize(120);
  for (int i = 0; i < 120; ++i)
    for (int l = 0; l < kLanes; ++l) work.displacement[i].lane[l] = work.displacement2[i].lane[l] = value(random);
  for (int i = 0; i < 45; ++i) work.shifts.push_back({{node(random), node(random)}, {node(random), node(random)}, value(random), 2.0F});
  for (int i = 0; i < 45; ++i) {
    Traction traction{node(random), {}};
    for (float& entry : traction.part) entry = value(random);
    work.tractions.push_back(traction);
  }
  for (std::int32_t i = 0; i < 20; ++i) {
    Middle middle{i, {node(random), node(random)}, {}};
    for (auto& end : middle.monomials)
      for (float& entry : end) entry = value(random);
    work.middles.push_back(middle);
  }
  return work;
}

class Loops : public testing::TestWithParam<int> {};

TEST_P(Loops, give_the_same_with_every_instruction_set) {
  const Work work = make_work(GetParam());
  const void* displacement = GetParam() == 4 ? static_cast<const void*>(work.displacement.data()) : work.displacement2.data();
  DoubleLanes lambda;
  for (int l = 0; l < kLanes; ++l) lambda.lane[l] = 0.1 * (l + 1);
  std::array<DoubleLanes, 8> first{};
  bool is_first = true;
  tests::for_each_instruction_set([&] {
    const ElementKernels& kernels = find_kernels(GetParam());
    std::vector<Strain> patches(40 * work.elements.terms, Strain{}), strains(work.elements.count * work.elements.samples);
    std::array<DoubleLanes, 8> sums{};
    kernels.add_strains(work.elements, true, displacement, strains.data(), patches.data(), sums[2]);
    std::vector<Strain> values(patches.begin(), patches.begin() + 40);
    if (GetParam() == 10) kernels.find_middles(work.middles, 1, patches.data(), values.data());
    kernels.add_energies(work.elements, work.value_of.data(), values.data(), displacement, strains.data(), sums[0], sums[6], sums[7],
                         sums[1]);
    kernels.add_shifts(work.shifts, patches.data(), displacement, lambda, sums[3], sums[4]);
    kernels.add_tractions(work.tractions, patches.data(), sums[5]);
    if (std::exchange(is_first, false)) first = sums;
    for (int s = 0; s < 8; ++s)
      for (int l = 0; l < kLanes; ++l) {
        EXPECT_NEAR(sums[s].lane[l], first[s].lane[l], 1e-5 * first[s == 3 ? 4 : s].lane[l]) << s;
        EXPECT_GT(first[s == 3 ? 4 : s].lane[l], 0) << s;
      }
  });
}

/// Polynomial in the four barycentric coordinates: coefficients by exponents.
using Polynomial = std::map<std::array<int, 4>, double>;

/// Mean of its square over the tetrahedron: L^a has the mean 6 a! / (|a| + 3)!.
double calc_mean_square(const Polynomial& p) {
  double sum = 0;
  for (const auto& [a, x] : p)
    for (const auto& [b, y] : p) {
      double mean = 6, degree = 3;
      for (int k = 0; k < 4; ++k) {
        mean *= std::tgamma(a[k] + b[k] + 1.0);
        degree += a[k] + b[k];
      }
      sum += x * y * mean / std::tgamma(degree + 1);
    }
  return sum;
}

TEST(Energies, of_T10_are_the_exact_integrals_of_the_squared_field) {
  Elements elements;
  elements.nodes = 10;
  elements.samples = 4;
  elements.terms = 10;
  elements.count = 1;
  elements.volume = {2.5F};
  elements.singular = {1.0F};
  elements.bent = {2.0F};
  elements.share = {0.5F};
  const std::vector<std::int32_t> value_of{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  std::vector<Strain> values(10, Strain{}), strains(4, Strain{});
  std::mt19937 random(3);
  std::normal_distribution<float> value;
  std::array<Polynomial, kLanes> field;  // of the lane's own strain component
  for (int l = 0; l < kLanes; ++l)
    for (int i = 0; i < 10; ++i) {
      const float u = value(random);
      values[i].part[l % 6][l] = u;
      if (i < 4) {
        std::array<int, 4> one{}, two{};
        one[i] = 1;
        two[i] = 2;
        field[l][two] += 2 * u;
        field[l][one] -= u;
      } else {
        std::array<int, 4> both{};
        for (const int end : mesh::kEdges[i - 4]) both[end] = 1;
        field[l][both] += 4 * u;
      }
    }
  tests::for_each_instruction_set([&] {
    DoubleLanes error{}, singular{}, bent{}, energy{};
    find_kernels(10).add_energies(elements, value_of.data(), values.data(), nullptr, strains.data(), error, singular, bent, energy);
    for (int l = 0; l < kLanes; ++l) {
      EXPECT_NEAR(error.lane[l] / (0.5 * 2.5 * calc_mean_square(field[l])), 1, 1e-5) << l;
      EXPECT_EQ(singular.lane[l], error.lane[l]);
      EXPECT_EQ(bent.lane[l], 2 * error.lane[l]);
      EXPECT_EQ(energy.lane[l], 0);
    }
  });
}

INSTANTIATE_TEST_SUITE_P(ElementKernels, Loops, testing::Values(4, 10));

}  // namespace
}  // namespace carillon::error_bars
