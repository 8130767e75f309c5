// Assumed size and wall of an object.
#include "jobs/front/hear/assume.hpp"

#include <gtest/gtest.h>

#include "runtime/base/error.hpp"

namespace carillon::hear {
namespace {

SurfaceFacts make_facts(double extent) {
  SurfaceFacts facts;
  facts.extent = {extent, extent, extent};
  return facts;
}

TEST(Scale, unit_from_the_extent) {
  Order order;
  order.object = "cup.obj";
  std::vector<std::string> assumed;
  EXPECT_EQ(find_scale(order, make_facts(0.1), 0.0, assumed), 1.0);
  EXPECT_EQ(find_scale(order, make_facts(10.0), 0.0, assumed), 0.01);
  EXPECT_EQ(find_scale(order, make_facts(100.0), 0.0, assumed), 0.001);
  EXPECT_EQ(assumed.size(), 3u);
  EXPECT_THROW(find_scale(order, make_facts(1e7), 0.0, assumed), InputError);
  EXPECT_THROW(find_scale(order, make_facts(0.0), 0.0, assumed), InputError);
}

TEST(Scale, given_values_take_precedence) {
  Order order;
  order.object = "cup.obj";
  order.scale = 0.5;
  std::vector<std::string> assumed;
  EXPECT_EQ(find_scale(order, make_facts(0.1), 0.0, assumed), 0.5);
  EXPECT_EQ(find_scale(order, make_facts(0.1), 0.2, assumed), 2.0);
  EXPECT_TRUE(assumed.empty());
  EXPECT_EQ(find_scale(order, make_facts(0.1), 20.0, assumed), 200.0);
  EXPECT_EQ(assumed.size(), 1u);  // very large
  EXPECT_THROW(find_scale(order, make_facts(0.1), 2000.0, assumed), InputError);
}

TEST(Scale, gltf_is_in_metres) {
  Order order;
  order.object = "cup.glb";
  std::vector<std::string> assumed;
  EXPECT_EQ(find_scale(order, make_facts(0.1), 0.0, assumed), 1.0);
  EXPECT_THROW(find_scale(order, make_facts(1000.0), 0.0, assumed), InputError);
}

TEST(Wall, limits) {
  Order order;
  order.object = "cup.obj";
  SurfaceFacts facts = make_facts(0.1);
  EXPECT_NO_THROW(check_wall(order, facts, 1.0));
  facts.openings = 1;
  EXPECT_THROW(check_wall(order, facts, 1.0), InputError);
  order.wall_m = 0.002;
  EXPECT_NO_THROW(check_wall(order, facts, 1.0));
  for (const double bad : {1e-6, 0.06, 2.0}) {
    order.wall_m = bad;
    EXPECT_THROW(check_wall(order, facts, 1.0), InputError) << bad;
  }
}

}  // namespace
}  // namespace carillon::hear
