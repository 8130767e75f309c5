// Potentials of a triangle against adaptive quadrature, differences and solid angles.
#include "precompute/air/potentials.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

namespace carillon::air {
namespace {

using Corners = std::array<Vec3, 3>;
/// 1 / R, lambda_c / R, its gradient, lambda_c d(1 / R) / dn_y.
using Integrals = std::array<double, 16>;

struct Plate {
  Corners corners{};
  Vec3 normal{};
  std::array<Vec3, 3> curl{};
  double size_m = 0.0;
};

Plate make_plate(const Corners& corners) {
  const Vec3 area = cross(corners[1] - corners[0], corners[2] - corners[0]);
  Plate plate{corners, normalise(area), {}, 0.0};
  for (std::size_t c = 0; c < 3; ++c) {
    const Vec3 opposite = corners[(c + 2) % 3] - corners[(c + 1) % 3];
    plate.curl[c] = (1.0 / norm(area)) * opposite;
    plate.size_m = std::max(plate.size_m, norm(opposite));
  }
  return plate;
}

Vec3 find_place(const Corners& corners, const Vec3& hat) { return hat[0] * corners[0] + hat[1] * corners[1] + hat[2] * corners[2]; }

/// Integrals over the part of a triangle between three barycentric points, by seven points, subdivided to convergence.
class Quadrature {
 public:
  /// `count`: number of integrals computed, from the first; the others are 0.
  Quadrature(const Plate& plate, const Vec3& x_m, std::size_t count = 16) : plate_(plate), x_m_(x_m), count_(count) {}

  Integrals calc() const {
    const std::array<Vec3, 3> all{Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
    return refine(all, apply_rule(all), 0);
  }

 private:
  Integrals apply_rule(const std::array<Vec3, 3>& part) const {
    const double root = std::sqrt(15.0);
    Integrals sum{};
    add(part, {1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 40.0, sum);
    for (const double sign : {-1.0, 1.0}) {
      const double a = (6.0 + sign * root) / 21.0, weight = (155.0 + sign * root) / 1200.0;
      for (std::size_t c = 0; c < 3; ++c) {
        Vec3 hat{a, a, a};
        hat[c] = 1.0 - 2.0 * a;
        add(part, hat, weight, sum);
      }
    }
    return sum;
  }

  void add(const std::array<Vec3, 3>& part, const Vec3& in_part, double share, Integrals& sum) const {
    const Corners places{find_place(plate_.corners, part[0]), find_place(plate_.corners, part[1]), find_place(plate_.corners, part[2])};
    const double weight = share * 0.5 * norm(cross(places[1] - places[0], places[2] - places[0]));
    const Vec3 hat = in_part[0] * part[0] + in_part[1] * part[1] + in_part[2] * part[2];
    const Vec3 away = x_m_ - find_place(places, in_part);
    const double r = norm(away), per_r = weight / r, per_cube = per_r / (r * r);
    sum[0] += per_r;
    for (std::size_t c = 0; c < 3; ++c) {
      sum[1 + c] += hat[c] * per_r;
      if (count_ == 4) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) sum[4 + 3 * c + axis] -= hat[c] * per_cube * away[axis];
      sum[13 + c] += hat[c] * per_cube * dot(away, plate_.normal);
    }
  }

  Integrals refine(const std::array<Vec3, 3>& part, const Integrals& whole, int level) const {
    const Vec3 ab = 0.5 * (part[0] + part[1]), bc = 0.5 * (part[1] + part[2]), ca = 0.5 * (part[2] + part[0]);
    const std::array<std::array<Vec3, 3>, 4> quarters{{{part[0], ab, ca}, {ab, part[1], bc}, {ca, bc, part[2]}, {ab, bc, ca}}};
    std::array<Integrals, 4> found;
    Integrals sum{};
    for (std::size_t q = 0; q < 4; ++q) {
      found[q] = apply_rule(quarters[q]);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += found[q][i];
    }
    // The rule is exact to degree five: the error after quartering is 1/63 of the change.
    bool is_good = level >= 3;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      const double scale = i < 4 ? plate_.size_m : 1.0;
      is_good = is_good && std::abs(sum[i] - whole[i]) < 1e-10 * scale;
    }
    if (is_good || level == 45) return sum;
    sum = {};
    for (std::size_t q = 0; q < 4; ++q) {
      const Integrals finer = refine(quarters[q], found[q], level + 1);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += finer[i];
    }
    return sum;
  }

  const Plate& plate_;
  Vec3 x_m_{};
  std::size_t count_ = 16;
};

Integrals list(const Potentials& found) {
  Integrals all{found.constant};
  for (std::size_t c = 0; c < 3; ++c) {
    all[1 + c] = found.single[c];
    for (std::size_t axis = 0; axis < 3; ++axis) all[4 + 3 * c + axis] = found.gradient[c][axis];
    all[13 + c] = found.double_layer[c];
  }
  return all;
}

Potentials calc(const Plate& plate, const Vec3& x_m) { return calc_potentials(plate.corners, plate.normal, plate.curl, x_m); }

/// Largest difference of any integral, relative to the largest of its kind.
double compare(const Plate& plate, const Vec3& x_m) {
  const Integrals wanted = Quadrature(plate, x_m).calc(), found = list(calc(plate, x_m));
  const auto find_worst = [&](std::size_t first, std::size_t last, double scale) {
    double worst = 0.0;
    for (std::size_t i = first; i < last; ++i) scale = std::max(scale, std::abs(wanted[i]));
    for (std::size_t i = first; i < last; ++i) worst = std::max(worst, std::abs(found[i] - wanted[i]) / scale);
    return worst;
  };
  return std::max({find_worst(0, 4, 0.0), find_worst(4, 13, 0.0), find_worst(13, 16, 1e-3)});
}

/// A. Van Oosterom, J. Strackee, IEEE Trans. BME-30 (1983) 125; positive on the side of the normal.
double calc_solid_angle(const Corners& corners, const Vec3& x_m) {
  const Vec3 a = corners[0] - x_m, b = corners[1] - x_m, c = corners[2] - x_m;
  const double la = norm(a), lb = norm(b), lc = norm(c);
  return -2.0 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(a, c) * lb + dot(b, c) * la);
}

std::vector<Plate> make_plates() {
  return {make_plate({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}}),
          make_plate({Vec3{0.3, -0.2, 0.1}, Vec3{0.31, 0.05, 0.14}, Vec3{0.1, 0.07, -0.02}}),
          make_plate({Vec3{0, 0, 0}, Vec3{0.01, 0, 0}, Vec3{0.004, 0.01, 0.002}})};
}

TEST(potentials, are_those_of_quadrature_near_and_far) {
  std::mt19937 random(3);
  std::normal_distribution<double> value;
  for (const Plate& plate : make_plates()) {
    const Vec3 middle = find_place(plate.corners, {1.0 / 3, 1.0 / 3, 1.0 / 3});
    for (const double distance : {0.05, 0.3, 1.0, 4.0, 30.0}) {
      for (int i = 0; i < 4; ++i) {
        const Vec3 to = normalise({value(random), value(random), value(random)});
        EXPECT_LT(compare(plate, middle + (distance * plate.size_m) * to), distance > 10.0 ? 1e-7 : 1e-9) << distance;
      }
    }
  }
}

TEST(potentials, are_those_of_quadrature_close_above_and_below_the_interior) {
  for (const Plate& plate : make_plates())
    for (const double height : {1e-1, 1e-2, 1e-3, -1e-3, -1e-2})
      for (const Vec3& hat : {Vec3{0.2, 0.5, 0.3}, Vec3{0.05, 0.05, 0.9}})
        EXPECT_LT(compare(plate, find_place(plate.corners, hat) + (height * plate.size_m) * plate.normal), 1e-7) << height;
}

TEST(potentials, are_those_of_quadrature_near_an_edge_and_beyond_its_end) {
  for (const Plate& plate : make_plates())
    for (const double gap : {1e-2, 1e-4, 1e-6, 1e-7})
      for (const Vec3& hat : {Vec3{0.4, 0.6, 0.0}, Vec3{1.3, -0.3, 0.0}, Vec3{1.0, 0.0, 0.0}}) {
        const Vec3 along = normalise(plate.corners[1] - plate.corners[0]), out = cross(along, plate.normal);
        const Vec3 off = normalise(out + 0.7 * plate.normal);
        EXPECT_LT(compare(plate, find_place(plate.corners, hat) + (gap * plate.size_m) * off), 1e-7) << gap << " " << hat[0];
      }
}

TEST(potentials, in_the_plane_are_those_of_quadrature_and_the_normal_parts_vanish) {
  for (const Plate& plate : make_plates()) {
    for (const Vec3& hat : {Vec3{0.5, 0.3, 0.2}, Vec3{0.1, 0.02, 0.88}}) {  // the gradient is not integrable there
      const Vec3 x = find_place(plate.corners, hat);
      const Potentials found = calc(plate, x);
      const Integrals wanted = Quadrature(plate, x, 4).calc();
      EXPECT_NEAR(found.constant / wanted[0], 1.0, 1e-7);
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(found.single[c] / wanted[1 + c], 1.0, 1e-7);
    }
    for (const Vec3& hat : {Vec3{0.7, 0.7, -0.4}, Vec3{-2.0, 1.0, 2.0}}) {
      const Vec3 x = find_place(plate.corners, hat);
      EXPECT_LT(compare(plate, x), 1e-8);
      for (const double part : calc(plate, x).double_layer) EXPECT_NEAR(part, 0.0, 1e-12);
    }
  }
  // Exactly in the plane where the coordinates allow it.
  const Plate flat = make_plates()[0];
  const Potentials inside = calc(flat, {0.25, 0.25, 0.0});
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(inside.double_layer[c], 0.0);
    EXPECT_EQ(inside.gradient[c][2], 0.0);
  }
}

TEST(potentials, have_the_gradient_that_differences_show) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> value(-1.5, 1.5);
  for (const Plate& plate : make_plates())
    for (int i = 0; i < 50; ++i) {
      const Vec3 x = plate.corners[0] + plate.size_m * Vec3{value(random), value(random), value(random)};
      const Potentials found = calc(plate, x);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double step = 1e-4 * plate.size_m;
        Vec3 up{}, down{};
        up[axis] = step;
        down[axis] = -step;
        const Potentials above = calc(plate, x + up), below = calc(plate, x + down);
        double largest = 0.0;
        for (const Vec3& g : found.gradient) largest = std::max(largest, norm(g));
        for (std::size_t c = 0; c < 3; ++c)
          EXPECT_NEAR(found.gradient[c][axis], (above.single[c] - below.single[c]) / (2.0 * step), 3e-5 * std::max(largest, 0.1));
      }
    }
}

TEST(potentials, of_a_constant_double_layer_are_the_solid_angle) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> value(-1.5, 1.5);
  for (const Plate& plate : make_plates())
    for (int i = 0; i < 200; ++i) {
      const Vec3 x = plate.corners[0] + plate.size_m * Vec3{value(random), value(random), value(random)};
      const Potentials found = calc(plate, x);
      EXPECT_NEAR(found.double_layer[0] + found.double_layer[1] + found.double_layer[2], calc_solid_angle(plate.corners, x), 1e-11);
      EXPECT_NEAR((found.single[0] + found.single[1] + found.single[2]) / found.constant, 1.0, 1e-10);
    }
}

TEST(potentials, of_needles_are_those_of_quadrature) {
  for (const double width : {1e-1, 1e-2, 1e-3}) {
    for (const double lean : {0.0, 0.5}) {  // a needle with one short edge, and a flat triangle with three long edges
      const Plate plate = make_plate({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{lean, width, 0}});
      for (const Vec3& x : {Vec3{0.5, 0.3 * width, 0.01}, Vec3{0.3, 0.5, 0.2}, Vec3{0.4, 0.4 * width, 1e-3}, Vec3{1.5, 0.01, 0.0},
                            Vec3{-0.01, width, 0.0}, Vec3{0.7, -0.02, -0.005}})
        EXPECT_LT(compare(plate, x), 1e-6) << width << " " << lean << " " << x[0];
    }
  }
}

}  // namespace
}  // namespace carillon::air
