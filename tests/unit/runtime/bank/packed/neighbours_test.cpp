// Neighbours, stencils and the inner loops of every instruction set.
#include "runtime/bank/packed/neighbours.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <set>

#include "runtime/bank/packed/loops.hpp"
#include "runtime/bank/packed/rows.hpp"
#include "runtime/base/instructions.hpp"
#include "tests/unit/runtime/bank/packed/surfaces.hpp"

namespace carillon::packed {
namespace {

double calc_distance2(const Place& a, const Place& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += std::pow(static_cast<double>(a[k]) - b[k], 2);
  return sum;
}

void expect_valid(const Neighbours& neighbours, std::size_t known) {
  for (const std::int32_t v : neighbours) {
    ASSERT_GE(v, 0);
    ASSERT_LT(static_cast<std::size_t>(v), known);
  }
  ASSERT_EQ(std::set(neighbours.begin(), neighbours.end()).size(), kNeighbours);
}

TEST(CodecNeighbours, are_nearly_the_nearest_and_sorted) {
  for (const example::Mesh& mesh : {example::make_ball(4), example::make_torus(80, 30)}) {
    const Surface surface = example::make_surface(example::shuffle(mesh, 8));
    const std::size_t first = surface.level_begin[surface.level_count() - 1];
    const std::span<const Place> known = std::span(surface.places).first(first);
    NeighbourSearch search(known, find_cell_shift(known));
    std::size_t good = 0, all = 0;
    for (std::size_t v = first; v < surface.places.size(); v += 3) {
      const Place& place = surface.places[v];
      const Neighbours found = search.find(place);
      ASSERT_NO_FATAL_FAILURE(expect_valid(found, known.size()));
      std::vector<double> distances;
      for (const Place& other : known) distances.push_back(calc_distance2(place, other));
      std::nth_element(distances.begin(), distances.begin() + 2 * kNeighbours - 1, distances.end());
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        const double here = calc_distance2(place, known[found[k]]);
        good += here <= distances[2 * kNeighbours - 1] ? 1 : 0;
        ++all;
        if (k > 0) {
          EXPECT_LE(std::sqrt(calc_distance2(place, known[found[k - 1]])), std::sqrt(here) * 1.01 + 4.0);
        }
      }
    }
    EXPECT_GT(static_cast<double>(good), 0.9 * static_cast<double>(all));
  }
}

TEST(CodecNeighbours, depend_on_places_and_cells_only) {
  const Surface surface = example::make_surface(example::make_ball(3));
  const std::span<const Place> known = std::span(surface.places).first(surface.level_begin[surface.level_count() - 1]);
  NeighbourSearch forward(known, 10), backward(known, 10);
  std::vector<Neighbours> found;
  for (const Place& place : surface.places) found.push_back(forward.find(place));
  for (std::size_t v = surface.places.size(); v-- > 0;) EXPECT_EQ(backward.find(surface.places[v]), found[v]) << v;
}

TEST(CodecNeighbours, of_dense_vertices_are_found_quickly) {
  std::mt19937 random(3);
  std::vector<Place> one_place(20000, Place{5, -7, 1000}), one_cell, far_apart;
  for (int i = 0; i < 20000; ++i)
    one_cell.push_back({static_cast<std::int32_t>(random() % 64), static_cast<std::int32_t>(random() % 64), 0});
  for (std::int32_t i = 0; i < 12; ++i)
    far_apart.push_back({i % 2 ? kMaxPlace : -kMaxPlace, i % 3 ? kMaxPlace : -kMaxPlace, i % 5 ? kMaxPlace : -kMaxPlace});
  const std::clock_t begin = std::clock();  // CPU time, independent of load
  for (const std::vector<Place>& known : {one_place, one_cell, far_apart})
    for (const int shift : {0, 6, find_cell_shift(known), kMaxCellShift}) {
      NeighbourSearch search(known, shift);
      for (int i = 0; i < 1000; ++i) {
        const Place place = i % 4 == 0 ? Place{kMaxPlace, -kMaxPlace, kMaxPlace}
                                       : Place{static_cast<std::int32_t>(random() % 64), static_cast<std::int32_t>(random() % 64) - 32, i};
        ASSERT_NO_FATAL_FAILURE(expect_valid(search.find(place), known.size())) << shift;
      }
    }
  EXPECT_LT(std::clock() - begin, 4 * CLOCKS_PER_SEC);
}

TEST(CodecNeighbours, may_be_all_vertices) {
  const std::vector<Place> known{{0, 0, 0}, {9, 0, 0}, {0, 9, 0}, {0, 0, 9}, {9, 9, 0},
                                 {9, 0, 9}, {0, 9, 9}, {9, 9, 9}, {4, 4, 0}, {4, 4, 9}};
  NeighbourSearch search(known, find_cell_shift(known));
  const Neighbours found = search.find({4, 4, 1});
  expect_valid(found, known.size());
  EXPECT_EQ(found[0], 8);
}

TEST(CodecNeighbours, have_cells_of_a_few_vertices) {
  for (const double step_m : {1.0 / 512.0, 1.0 / 65536.0}) {
    const std::vector<Place> places = example::find_places(example::make_ball(4), step_m);
    const double width = std::exp2(find_cell_shift(places)) * step_m;
    const double per_cell = static_cast<double>(places.size()) * width * width / (4.0 * 3.14159265);
    EXPECT_GT(per_cell, 0.5);
    EXPECT_LT(per_cell, 6.0);
  }
  EXPECT_EQ(find_cell_shift(std::vector<Place>(100, Place{1, 2, 3})), 0);
  EXPECT_EQ(find_cell_shift(std::vector<Place>{{-kMaxPlace, -kMaxPlace, -kMaxPlace}, {kMaxPlace, kMaxPlace, kMaxPlace}}), kMaxCellShift);
}

// ---- stencils ----

struct Stencils {
  Surface surface;
  std::size_t first = 0;  // first vertex with a stencil
  std::vector<Neighbours> neighbours;
  std::vector<Stencil> stencils;

  explicit Stencils(const example::Mesh& mesh)
      : surface(example::make_surface(mesh)), first(surface.level_begin[surface.level_count() - 1]) {
    const std::span<const Place> known = std::span(surface.places).first(first), centres = std::span(surface.places).subspan(first);
    NeighbourSearch search(known, find_cell_shift(known));
    for (const Place& place : centres) neighbours.push_back(search.find(place));
    stencils.resize(centres.size());
    calc_stencils(centres, neighbours, surface.places, stencils);
  }
};

TEST(CodecStencil, reproduces_linear_fields_and_gradients) {
  const Stencils all(example::make_ball(4));
  ASSERT_GT(all.stencils.size(), 100u);
  for (std::size_t i = 0; i < all.stencils.size(); ++i) {
    const Place& centre = all.surface.places[all.first + i];
    double h = 0.0;
    for (const std::int32_t v : all.neighbours[i]) h += std::sqrt(calc_distance2(centre, all.surface.places[v])) / kNeighbours;
    const std::array<double, 3> slope{0.7 / h, -1.1 / h, 0.4 / h};
    const auto field = [&](const Place& x) {
      double value = 0.3;
      for (std::size_t k = 0; k < 3; ++k) value += slope[k] * (x[k] - centre[k]);
      return value;
    };
    double value = 0.0, one = 0.0;
    std::array<double, 3> gradient{};
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      const Place& x = all.surface.places[all.neighbours[i][k]];
      value += static_cast<double>(all.stencils[i].value[k]) * field(x);
      one += static_cast<double>(all.stencils[i].value[k]);
      for (std::size_t c = 0; c < 3; ++c) {
        gradient[c] += static_cast<double>(all.stencils[i].gradient[c][k]) * field(x);
        EXPECT_NEAR(static_cast<double>(all.stencils[i].offset[c][k]), (x[c] - centre[c]) / h, 1e-4);
      }
    }
    // Nugget and prior of linear fields prevent an exact result.
    EXPECT_NEAR(value, 0.3, 0.01) << i;
    EXPECT_NEAR(one, 1.0, 0.01) << i;
    const Vec3 normal = normalise(Vec3{1.0 * centre[0], 1.0 * centre[1], 1.0 * centre[2]});
    const Vec3 missed = Vec3{gradient[0] - h * slope[0], gradient[1] - h * slope[1], gradient[2] - h * slope[2]};
    EXPECT_LT(norm(missed - dot(missed, normal) * normal), 0.03) << i;  // along the surface
  }
}

TEST(CodecStencil, is_finite_for_coincident_neighbours) {
  std::vector<Place> places(12, Place{100, 100, 100});
  Neighbours neighbours;
  std::iota(neighbours.begin(), neighbours.end(), 0);
  for (int apart = 0; apart < 4; ++apart) {
    places[3] = {100, 100, 100 + apart};
    places[11] = apart == 3 ? Place{kMaxPlace, -kMaxPlace, 0} : Place{100 + apart / 2, 100, 100};
    std::vector<Stencil> stencils(1);
    calc_stencils(std::span(places).subspan(11, 1), std::vector<Neighbours>{neighbours}, places, stencils);
    double one = 0.0;
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      one += static_cast<double>(stencils[0].value[k]);
      EXPECT_TRUE(std::isfinite(stencils[0].value[k]));
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_TRUE(std::isfinite(stencils[0].gradient[c][k]));
        EXPECT_TRUE(std::isfinite(stencils[0].offset[c][k]));
      }
    }
    EXPECT_NEAR(one, 1.0, 0.6);
  }
}

// ---- instruction sets ----

std::vector<std::pair<const char*, const Loops*>> list_loops() {
  std::vector<std::pair<const char*, const Loops*>> all;
  for (const base::Instructions set : base::list_instructions()) all.emplace_back(base::get_name(set), &find_loops(set));
  return all;
}

TEST(CodecLoops, of_all_instruction_sets_find_the_same_neighbours_in_the_same_order) {
  std::mt19937 random(21);
  for (int round = 0; round < 2000; ++round) {
    Near near;
    near.count = kNeighbours + random() % (Near::kMost - kNeighbours + 1);
    const int reach = 2 + static_cast<int>(random() % 25);
    const std::int32_t most = 1 << (reach - 1);
    const Place place{static_cast<std::int32_t>(random() % 1000), -static_cast<std::int32_t>(random() % 1000), 0};
    const auto draw = [&] { return static_cast<std::int32_t>(random() % static_cast<std::uint32_t>(2 * most)) - most; };
    std::vector<std::pair<double, std::int32_t>> expected;
    for (std::size_t i = 0; i < near.count; ++i) {
      near.x[i] = place[0] + draw();
      near.y[i] = place[1] + draw();
      near.z[i] = place[2] + (round % 2 == 0 ? 0 : draw());
      near.vertex[i] = static_cast<std::int32_t>(random() % 100000);
      expected.emplace_back(calc_distance2(place, {near.x[i], near.y[i], near.z[i]}), static_cast<std::int32_t>(i));
    }
    Neighbours plain;
    find_loops(base::Instructions::kPlain).find_nearest(near, place, reach, plain);
    if (reach <= kReachBits) {  // exact
      std::sort(expected.begin(), expected.end());
      for (std::size_t k = 0; k < kNeighbours; ++k) ASSERT_EQ(plain[k], near.vertex[expected[k].second]) << round;
    }
    for (const auto& [name, loops] : list_loops()) {
      Neighbours found;
      loops->find_nearest(near, place, reach, found);
      ASSERT_EQ(found, plain) << name << " " << round;
    }
  }
}

TEST(CodecLoops, of_all_instruction_sets_make_the_same_stencils) {
  const Stencils all(example::make_ball(3));
  const std::size_t count = all.stencils.size() - 1;  // not a multiple of the vector length
  std::vector<Stencil> plain(count), found(count);
  find_loops(base::Instructions::kPlain)
      .calc_stencils(&all.surface.places[all.first], all.neighbours.data(), all.surface.places.data(), count, plain.data());
  for (const auto& [name, loops] : list_loops()) {
    loops->calc_stencils(&all.surface.places[all.first], all.neighbours.data(), all.surface.places.data(), count, found.data());
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < kNeighbours; ++k) {
        ASSERT_NEAR(found[i].value[k], plain[i].value[k], 1e-5F) << name;
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_NEAR(found[i].gradient[c][k], plain[i].gradient[c][k], 1e-4F) << name;
          ASSERT_NEAR(found[i].offset[c][k], plain[i].offset[c][k], 1e-6F) << name;
        }
      }
  }
}

// Against double-precision sums.
TEST(CodecLoops, match_double_precision_sums) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> draw(-1.0F, 1.0F);
  for (const std::size_t padded : {16u, 32u, 48u, 64u, 80u, 208u}) {
    Rows rows(kNeighbours, padded);
    ASSERT_EQ(rows.get_padded(), padded);
    std::vector<float> row(3 * padded);
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      for (float& x : row) x = draw(random);
      rows.append(row);
    }
    std::array<const float*, kNeighbours> from;
    for (std::size_t k = 0; k < kNeighbours; ++k) from[k] = rows.get(k);
    Stencil stencil;
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      stencil.value[k] = draw(random);
      for (std::size_t c = 0; c < 3; ++c) stencil.gradient[c][k] = draw(random), stencil.offset[c][k] = draw(random);
    }
    std::array<float, kGradientNumbers> gradient;
    std::array<float, kDifferenceNumbers> differences;
    for (float& x : gradient) x = draw(random);
    for (float& x : differences) x = draw(random);
    for (const auto& [name, loops] : list_loops()) {
      SCOPED_TRACE(name);
      loops->add_weighted(from.data(), stencil.value.data(), 3 * padded, row.data());
      for (std::size_t i = 0; i < 3 * padded; ++i) {
        double sum = 0.0;
        for (std::size_t k = 0; k < kNeighbours; ++k) sum += static_cast<double>(stencil.value[k]) * static_cast<double>(from[k][i]);
        ASSERT_NEAR(static_cast<double>(row[i]), sum, 1e-5);
      }
      double energy = 0.0;
      for (const float x : row) energy += static_cast<double>(x) * static_cast<double>(x);
      EXPECT_NEAR(static_cast<double>(loops->calc_energy(row.data(), row.size())) / energy, 1.0, 1e-5);
      for (const bool is_wide : {false, true}) {
        Matrix matrix;
        loops->calc_matrix(stencil, gradient.data(), is_wide ? differences.data() : nullptr, matrix);
        loops->multiply(from.data(), matrix.data(), padded, row.data());
        for (std::size_t m = 0; m < padded; m += 5) {
          std::array<double, 3> value{}, wanted{};
          std::array<std::array<double, 3>, 3> slope{};  // by axis, then component
          const auto at = [&](std::size_t k, std::size_t c) { return static_cast<double>(from[k][c * padded + m]); };
          for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t k = 0; k < kNeighbours; ++k) {
              value[c] += static_cast<double>(stencil.value[k]) * at(k, c);
              for (std::size_t j = 0; j < 3; ++j) slope[j][c] += static_cast<double>(stencil.gradient[j][k]) * at(k, c);
            }
          for (std::size_t to = 0; to < 3; ++to) {
            wanted[to] = value[to];
            for (std::size_t c = 0; c < 3; ++c) {
              for (std::size_t j = 0; j < 3; ++j) wanted[to] += static_cast<double>(gradient[9 * j + 3 * to + c]) * slope[j][c];
              for (std::size_t k = 0; is_wide && k < kNeighbours; ++k) {
                double difference = at(k, c) - value[c];
                for (std::size_t j = 0; j < 3; ++j) difference -= static_cast<double>(stencil.offset[j][k]) * slope[j][c];
                wanted[to] += static_cast<double>(differences[9 * k + 3 * to + c]) * difference;
              }
            }
            ASSERT_NEAR(static_cast<double>(row[to * padded + m]), wanted[to], 1e-4);
          }
        }
      }
    }
  }
}

TEST(CodecLoops, round_to_nearest_and_clamp) {
  constexpr float kInf = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr std::size_t kPadded = 80;
  std::vector<float> row(3 * kPadded), factor(kPadded, 2.0F);
  std::mt19937 random(6);
  for (float& x : row) x = std::uniform_real_distribution<float>(-20.0F, 20.0F)(random);
  const std::vector<float> odd{0.0F, -0.0F, 0.2499F, 0.25F, -0.25F, 16383.4F, 16383.6F, -16383.6F, 1e30F, -1e30F, kInf, -kInf, kNan, 3e38F};
  std::copy(odd.begin(), odd.end(), row.begin() + kPadded);
  const std::vector<std::int16_t> expected{0, 0, 0, 1, -1, 32767, 32767, -32767, 32767, -32767, 32767, -32767, 0, 32767};
  for (const auto& [name, loops] : list_loops()) {
    std::vector<std::int16_t> shape(3 * kPadded);
    loops->round(row.data(), factor.data(), kPadded, shape.data());
    for (std::size_t i = 0; i < odd.size(); ++i) EXPECT_EQ(shape[3 * i + 1], expected[i]) << name << " " << odd[i];
    for (std::size_t m = odd.size(); m < kPadded; ++m)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(shape[3 * m + c], std::lround(2.0F * row[c * kPadded + m])) << name;
  }
}

}  // namespace
}  // namespace carillon::packed
