// Forces of solids: known stresses, rotations, derivatives of the energy, work against damping. Oracles: stresses with 25 digits, the
// divergence theorem, differences of the energy, plain sums over points.
#include "precompute/simulation/transient/solids.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "tests/support/instruction_sets.hpp"
#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient {
namespace {

struct Patch {
  const char* name;
  Mat3 f, p;
  double energy;
};
// lambda 2, mu 1.
const Patch kPatches[] = {{"rotation by 40 degrees about (1, 2, 3)",
                           {Vec3{0.78275555432476532, -0.48195442214065507, 0.39371776331884827},
                            Vec3{0.5487988669638042, 0.83288888794212717, -0.071525547616019511},
                            Vec3{-0.29345109608412457, 0.27205888208546691, 0.91644444397106358}},
                           {},
                           0.0},
                          {"simple shear of 0.3",
                           {Vec3{1, 0.3, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}},
                           {Vec3{0.18, 0.354, 0}, Vec3{0.3, 0.18, 0}, Vec3{0, 0, 0.09}},
                           0.04905},
                          {"stretch",
                           {Vec3{1.2, 0, 0}, Vec3{0, 0.9, 0}, Vec3{0, 0, 1.05}},
                           {Vec3{0.951, 0, 0}, Vec3{0, 0.14625, 0}, Vec3{0, 0, 0.47775}},
                           0.091115625},
                          {"general",
                           {Vec3{1.1, 0.2, -0.1}, Vec3{0.05, 0.95, 0.15}, Vec3{-0.2, 0.1, 1.3}},
                           {Vec3{1.38375, 0.423, -0.51325}, Vec3{0.23975, 0.88625, 0.46925}, Vec3{-0.6825, 0.36675, 2.24275}},
                           0.490278125}};

struct Body {
  mesh::TetMesh mesh;
  Law law;
  Solids solids;
  std::vector<SolidElement> elements;
  std::size_t nodes() const { return mesh.nodes_m.size(); }
};

Body make_body(int order, double bend_m, const Law& law, const Loops& loops, const std::array<int, 3>& cells = {3, 2, 2}) {
  Body body{testing::make_box({0.3, 0.2, 0.25}, cells, order, bend_m), law, {}, {}};
  for (std::int64_t e = 0; e < body.mesh.tet_count(); ++e) {
    SolidElement element;
    std::vector<Vec3> x;
    const auto nodes = body.mesh.tet(e);
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      element.read[a] = element.write[a] = nodes[a];
      x.push_back(body.mesh.nodes_m[nodes[a]]);
    }
    element.kind = order == 1 ? Kind::kT4 : is_curved(x) ? Kind::kCurvedT10 : Kind::kT10;
    body.elements.push_back(element);
  }
  body.solids = Solids(body.elements, {law}, body.mesh.nodes_m, static_cast<std::int32_t>(body.nodes()), loops);
  return body;
}

std::vector<Quad> make_values(const Body& body, const Mat3& gradient) {
  std::vector<Quad> u;
  for (const Vec3& x : body.mesh.nodes_m) {
    const Vec3 value = gradient * x;
    u.push_back({value[0], value[1], value[2], 0.0});
  }
  return u;
}

std::vector<Quad> make_random(std::size_t count, double size, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> draw(-size, size);
  std::vector<Quad> values;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = draw(random), y = draw(random), z = draw(random);
    values.push_back({x, y, z, 0.0});
  }
  return values;
}

std::vector<Quad> calc_forces(const Body& body, const std::vector<Quad>& u) {
  std::vector<Quad> f(body.nodes() + 1);
  body.solids.add_elastic_forces(u.data(), f.data());
  return f;
}

double calc_energy(const Body& body, const std::vector<Quad>& u) {
  std::vector<double> energy, least;
  body.solids.calc_state(u.data(), energy, least);
  return std::accumulate(energy.begin(), energy.end(), 0.0);
}

struct Choice {
  const char* name;
  int order;
  double bend_m;
};
void PrintTo(const Choice& choice, std::ostream* out) { *out << choice.name; }

class OfKind : public ::testing::TestWithParam<Choice> {};
INSTANTIATE_TEST_SUITE_P(Solids, OfKind, ::testing::Values(Choice{"T4", 1, 0.0}, Choice{"T10", 2, 0.0}, Choice{"curved", 2, 0.004}),
                         [](const auto& info) { return std::string(info.param.name); });

// u = (F - I) x in every node. In the interior forces cancel; the sum of f (x) X is - P times the volume. Of a curved mesh the volume is
// that of the rule of four points, and forces in the interior do not cancel to rounding but to the error of that rule.
TEST_P(OfKind, homogeneous_deformation) {
  Law law;
  law.lambda_pa = 2.0;
  law.mu_pa = 1.0;
  law.density_kg_m3 = 1.0;
  tests::for_each_instruction_set([&] {
    const Body body = make_body(GetParam().order, GetParam().bend_m, law, find_loops());
    double volume = 0.0;
    for (const SolidElement& element : body.elements) {
      std::vector<Vec3> x;
      for (int a = 0; a < count_nodes(element.kind); ++a) x.push_back(body.mesh.nodes_m[element.read[a]]);
      ElementShape shape;
      ASSERT_TRUE(make_shape(element.kind, x, shape));
      for (const double weight : shape.weight_m3) volume += weight;
    }
    if (GetParam().bend_m == 0.0) {
      EXPECT_NEAR(volume, 0.3 * 0.2 * 0.25, 1e-16);
    }
    for (const Patch& patch : kPatches) {
      Mat3 gradient = patch.f;
      for (std::size_t i = 0; i < 3; ++i) gradient[i][i] -= 1.0;
      const std::vector<Quad> u = make_values(body, gradient), f = calc_forces(body, u);
      Mat3 stress{};
      double inside = 0.0, sum[3] = {};
      for (std::size_t n = 0; n < body.nodes(); ++n) {
        const Vec3& x = body.mesh.nodes_m[n];
        const Vec3 force{f[n].x, f[n].y, f[n].z};
        for (std::size_t i = 0; i < 3; ++i) {
          sum[i] += force[i];
          for (std::size_t j = 0; j < 3; ++j) stress[i][j] -= force[i] * x[j] / volume;
        }
        if (std::abs(x[0]) < 0.149 && std::abs(x[1]) < 0.099 && std::abs(x[2]) < 0.124) inside = std::max(inside, norm(force));
      }
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(sum[i], 0.0, 1e-15);
        for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(stress[i][j], patch.p[i][j], 1e-12) << patch.name << ' ' << i << j;
      }
      EXPECT_NEAR(calc_energy(body, u) / volume, patch.energy, 1e-12) << patch.name;
      if (GetParam().bend_m == 0.0) {
        EXPECT_LT(inside, 1e-14) << patch.name;
      }
    }
  });
}

TEST_P(OfKind, rotation) {
  const Body body = make_body(GetParam().order, GetParam().bend_m, testing::make_law(200e9, 0.3, 7850), find_loops());
  Mat3 gradient = kPatches[0].f;
  for (std::size_t i = 0; i < 3; ++i) gradient[i][i] -= 1.0;
  for (const Quad& f : calc_forces(body, make_values(body, gradient))) EXPECT_LT(norm(Vec3{f.x, f.y, f.z}), 1e-12 * 200e9 * 0.05);
}

TEST_P(OfKind, forces_against_energy_gradient) {
  const Body body = make_body(GetParam().order, GetParam().bend_m, testing::make_law(3.0, 0.3, 1.0), find_loops());
  const std::vector<Quad> u = make_random(body.nodes(), 0.01, 1), p = make_random(body.nodes(), 1.0, 2), f = calc_forces(body, u);
  double power = 0.0;
  for (std::size_t n = 0; n < u.size(); ++n) power += f[n].x * p[n].x + f[n].y * p[n].y + f[n].z * p[n].z;
  const auto at = [&](double step) {
    std::vector<Quad> moved = u;
    for (std::size_t n = 0; n < u.size(); ++n) moved[n] = {u[n].x + step * p[n].x, u[n].y + step * p[n].y, u[n].z + step * p[n].z, 0.0};
    return calc_energy(body, moved);
  };
  const double h = 1e-2;  // the energy is a quartic along a line, of which these differences are exact
  EXPECT_NEAR(-(8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h) / power, 1.0, 1e-10);
}

TEST_P(OfKind, damping_work) {
  const Law law = testing::make_law(3.0, 0.3, 1.0, 0.02);
  Body body = make_body(GetParam().order, GetParam().bend_m, law, find_loops());
  Body elastic = make_body(GetParam().order, GetParam().bend_m, testing::make_law(3.0, 0.3, 1.0), find_loops());
  // Two steps: the forces of the first act on its own velocity and on that of the second.
  const double h = 1e-3;
  std::vector<Quad> u0 = make_random(body.nodes(), 0.01, 1), v0 = make_random(body.nodes(), 1.0, 2), v1 = make_random(body.nodes(), 1.0, 3),
                    u1 = u0;
  for (std::size_t n = 0; n < u0.size(); ++n) u1[n] = {u0[n].x + h * v1[n].x, u0[n].y + h * v1[n].y, u0[n].z + h * v1[n].z, 0.0};
  const auto calc_viscous = [&](const std::vector<Quad>& u, const std::vector<Quad>& v, const StepWeights& weights) {
    std::vector<Quad> f(body.nodes() + 1), g = calc_forces(elastic, u);
    body.solids.add_forces(weights, u.data(), v.data(), f.data());
    for (std::size_t n = 0; n < f.size(); ++n) f[n] = {f[n].x - g[n].x, f[n].y - g[n].y, f[n].z - g[n].z, 0.0};
    return f;
  };
  const auto multiply = [](const std::vector<Quad>& f, const std::vector<Quad>& v) {
    double sum = 0.0;
    for (std::size_t n = 0; n < v.size(); ++n) sum += f[n].x * v[n].x + f[n].y * v[n].y + f[n].z * v[n].z;
    return sum;
  };
  const std::vector<Quad> f0 = calc_viscous(u0, v0, {0.5 * h, 0.0, h});
  const auto spent = [&] {
    const std::vector<double> list = body.solids.list_spent();
    return std::accumulate(list.begin(), list.end(), 0.0);
  };
  EXPECT_NEAR(spent() / (-0.5 * h * multiply(f0, v0)), 1.0, 1e-12);
  body.solids.forget_spent();
  const std::vector<Quad> f1 = calc_viscous(u1, v1, {0.5 * h, 0.5 * h, h});
  EXPECT_NEAR(spent() / (-0.5 * h * (multiply(f0, v1) + multiply(f1, v1))), 1.0, 1e-10);
}

// Every instruction set sums in the order of the elements, and a block's size does not show: the elements one by one give the same bits.
TEST_P(OfKind, independence_of_blocks) {
  tests::for_each_instruction_set([&] {
    Body body = make_body(GetParam().order, GetParam().bend_m, testing::make_law(3.0, 0.3, 1.0, 0.02), find_loops(), {3, 1, 1});
    const std::vector<Quad> u = make_random(body.nodes(), 0.01, 4), v = make_random(body.nodes(), 1.0, 5);
    std::vector<Quad> together(body.nodes() + 1), apart(body.nodes() + 1);
    body.solids.add_forces({1e-3, 0.0, 1e-3}, u.data(), v.data(), together.data());
    double spent = 0.0;
    const std::vector<double> by_element = body.solids.list_spent();
    for (std::size_t e = 0; e < body.elements.size(); ++e) {
      Solids one({body.elements[e]}, {body.law}, body.mesh.nodes_m, static_cast<std::int32_t>(body.nodes()), find_loops());
      one.add_forces({1e-3, 0.0, 1e-3}, u.data(), v.data(), apart.data());
      EXPECT_EQ(one.list_spent()[0], by_element[e]);
      spent += by_element[e];
    }
    EXPECT_GT(spent, 0.0);
    for (std::size_t n = 0; n < body.nodes(); ++n) {
      EXPECT_EQ(together[n].x, apart[n].x);
      EXPECT_EQ(together[n].y, apart[n].y);
      EXPECT_EQ(together[n].z, apart[n].z);
    }
  });
}

TEST_P(OfKind, smallest_determinant) {
  const Body body = make_body(GetParam().order, GetParam().bend_m, testing::make_law(3.0, 0.3, 1.0), find_loops());
  std::vector<Quad> u(body.nodes());
  std::vector<double> energy, least;
  body.solids.calc_state(u.data(), energy, least);
  for (const double det : least) EXPECT_NEAR(det, 1.0, 1e-14);
  // A corner through the opposite face of one element, and a mirror of the whole body.
  const auto tet = body.mesh.tet(7);
  const auto place = [&](std::size_t a) { return body.mesh.nodes_m[tet[a]]; };
  const Vec3 move = 2.0 * ((1.0 / 3.0) * (place(1) + place(2) + place(3)) - place(0));
  u[tet[0]] = {move[0], move[1], move[2], 0.0};
  body.solids.calc_state(u.data(), energy, least);
  EXPECT_LT(least[7], 0.0);
  const std::vector<Quad> mirror = make_values(body, {Vec3{-2, 0, 0}, Vec3{0, 0, 0}, Vec3{0, 0, 0}});
  body.solids.calc_state(mirror.data(), energy, least);
  for (const double det : least) EXPECT_NEAR(det, -1.0, 1e-12);
}

}  // namespace
}  // namespace carillon::transient
