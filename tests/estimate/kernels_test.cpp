// The inner loops of the estimate give the same with every instruction set of this processor.
#include "precompute/estimate/kernels.hpp"

#include <gtest/gtest.h>

#include <random>

namespace carillon::estimate {
namespace {

struct Work {
  Elements elements;
  std::vector<std::int32_t> value_of;
  std::vector<Shift> shifts;
  std::vector<FloatLanes> displacement;
  std::vector<DoubleLanes> displacement2;
};

/// Elements of random numbers on 40 nodes; 70 of them, so that the last chunk is not full.
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
  return work;
}

class Loops : public testing::TestWithParam<int> {};

TEST_P(Loops, give_the_same_with_every_instruction_set) {
  const Work work = make_work(GetParam());
  const void* displacement = GetParam() == 4 ? static_cast<const void*>(work.displacement.data()) : work.displacement2.data();
  DoubleLanes lambda;
  for (int l = 0; l < kLanes; ++l) lambda.lane[l] = 0.1 * (l + 1);
  std::array<DoubleLanes, 5> first{};
  const std::vector<const Kernels*> tables = list_kernels(GetParam());
  for (const Kernels* kernels : tables) {
    std::vector<Strain> patches(40 * work.elements.terms, Strain{}), strains(work.elements.count * work.elements.samples);
    std::array<DoubleLanes, 5> sums{};
    kernels->add_strains(work.elements, true, displacement, strains.data(), patches.data(), sums[2]);
    kernels->add_energies(work.elements, work.value_of.data(), patches.data(), displacement, strains.data(), sums[0], sums[1]);
    kernels->add_shifts(work.shifts, patches.data(), displacement, lambda, sums[3], sums[4]);
    if (kernels == tables.front()) first = sums;
    for (int s = 0; s < 5; ++s)
      for (int l = 0; l < kLanes; ++l) {
        EXPECT_NEAR(sums[s].lane[l], first[s].lane[l], 1e-5 * first[s == 3 ? 4 : s].lane[l]) << kernels->name << " " << s;
        EXPECT_GT(first[s == 3 ? 4 : s].lane[l], 0) << s;
      }
  }
}

INSTANTIATE_TEST_SUITE_P(Kernels, Loops, testing::Values(4, 10));

}  // namespace
}  // namespace carillon::estimate
