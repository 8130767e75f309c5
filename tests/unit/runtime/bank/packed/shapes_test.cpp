// Shapes are reproduced within the requested steps, as the writer predicts; damaged bytes are rejected or give numbers.
#include "runtime/bank/packed/shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/packed/fit_loops.hpp"
#include "runtime/bank/packed/fit_shapes.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/bank/packed/surfaces.hpp"

namespace carillon::packed {
namespace {

// The finest level has the widest steps, 1.6, with a residual of up to 0.9.
constexpr double kMostLeft = 1.44;

/// Smooth field: plane waves of lengths from several body sizes to half of one.
Vec3 calc_field(std::size_t mode, const Vec3& x) {
  const double k = 0.5 + 0.35 * static_cast<double>(mode);
  const double phase = k * (x[0] + 0.3 * x[1]) - 0.6 * k * x[2] + static_cast<double>(mode);
  return {std::sin(phase), 0.7 * std::cos(1.1 * phase), std::sin(x[0] * x[1]) + 0.2 * std::sin(0.8 * phase)};
}

/// Shapes at the vertices of a surface, with motion and precision by `steps_per_unit`; modes may be at rest.
struct Shapes {
  std::size_t modes;
  std::vector<float> step;
  std::vector<double> scale;
  Rows wanted;
  std::vector<std::uint8_t> fineness;

  Shapes(const Surface& surface, std::size_t count, double step_of_all, bool is_any_at_rest = false)
      : modes(count), wanted(surface.places.size(), count), fineness(surface.places.size(), 0) {
    for (std::size_t m = 0; m < modes; ++m) {
      const double size = std::pow(10.0, static_cast<double>(m % 5) - 2.0);  // amplitudes over five decades
      step.push_back(is_rest(m, is_any_at_rest) ? 0.0F : static_cast<float>(size * step_of_all));
      scale.push_back(is_rest(m, is_any_at_rest) ? 0.0 : size * 1.3 / 32767.0);
    }
    std::vector<float> row(wanted.get_width());
    for (std::size_t v = 0; v < surface.places.size(); ++v) {
      std::fill(row.begin(), row.end(), 0.0F);
      for (std::size_t m = 0; m < modes; ++m) {
        if (is_rest(m, is_any_at_rest)) continue;
        const Vec3 field = calc_field(m, surface.find_vertex(v));
        for (std::size_t c = 0; c < 3; ++c) row[c * wanted.get_padded() + m] = static_cast<float>(field[c] / step_of_all);
      }
      wanted.append(row);
    }
  }
  static bool is_rest(std::size_t mode, bool is_any_at_rest) { return is_any_at_rest && mode % 3 == 1; }

  FittedShapes fit(const Surface& surface) const {
    return fit_shapes(surface, modes, fineness, calc_factors(step, scale),
                      [&](std::size_t v, std::span<float> row) { std::copy_n(wanted.get(v), row.size(), row.begin()); });
  }

  double find_wanted(std::size_t v, std::size_t m, std::size_t c) const {
    return static_cast<double>(wanted.get(v)[c * wanted.get_padded() + m]);
  }
};

/// Decoded shapes and their error [steps].
struct Result {
  std::vector<std::uint8_t> bytes;
  std::vector<std::int16_t> shape;
  double worst = 0.0, mean = 0.0;
};

Result pack(const Surface& surface, const Shapes& shapes) {
  const FittedShapes fitted = shapes.fit(surface);
  Result result;
  result.bytes = write_shapes(shapes.step, fitted.levels);
  result.shape = read_shapes(example::as_bytes(result.bytes), surface, shapes.scale, "shapes");
  EXPECT_EQ(result.shape.size(), surface.places.size() * shapes.modes * 3);
  EXPECT_EQ(result.shape, fitted.shape);  // encoder and decoder agree
  double count = 0.0;
  for (std::size_t v = 0; v < surface.places.size(); ++v) {
    for (std::size_t m = 0; m < shapes.modes; ++m) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int16_t found = result.shape[(v * shapes.modes + m) * 3 + c];
        if (shapes.scale[m] == 0.0) {
          EXPECT_EQ(found, 0);
          continue;
        }
        const double per_step = shapes.scale[m] / static_cast<double>(shapes.step[m]);
        const double share = static_cast<double>(LevelSteps::calc_share(shapes.fineness[v]));
        const double left = std::max(std::abs(found * per_step - shapes.find_wanted(v, m, c)) - 0.5 * per_step, 0.0) / share;
        result.worst = std::max(result.worst, left);
        result.mean += left * left;
        count += 1.0;
      }
    }
  }
  result.mean = count > 0.0 ? std::sqrt(result.mean / count) : 0.0;
  return result;
}

TEST(CodecShapes, of_any_number_of_modes_read_back_within_steps) {
  const Surface surface = example::make_surface(example::shuffle(example::make_ball(3), 1));
  ASSERT_GE(surface.level_count(), 2u);
  for (const std::size_t modes : {1u, 2u, 15u, 16u, 17u, 33u}) {
    SCOPED_TRACE(modes);
    const Result result = pack(surface, Shapes(surface, modes, 0.01));
    EXPECT_LT(result.worst, 1.01 * kMostLeft);
    EXPECT_LT(result.mean, 0.75);
  }
}

TEST(CodecShapes, of_all_surfaces_read_back_within_steps) {
  for (const example::Mesh& mesh : {example::make_tetrahedron(), example::make_ball(1), example::make_plate(20),
                                    example::make_torus(40, 20), example::make_hollow_ball(2), example::make_touching_balls(2)}) {
    const Surface surface = example::make_surface(example::shuffle(mesh, 2));
    const Result result = pack(surface, Shapes(surface, 6, 0.02));
    EXPECT_LT(result.worst, 1.01 * kMostLeft) << surface.places.size();
  }
}

TEST(CodecShapes, may_have_modes_at_rest_and_no_mode) {
  const Surface surface = example::make_surface(example::make_ball(3));
  EXPECT_LT(pack(surface, Shapes(surface, 7, 0.01, true)).worst, 1.01 * kMostLeft);
  EXPECT_TRUE(pack(surface, Shapes(surface, 0, 0.01)).shape.empty());
}

TEST(CodecShapes, are_more_accurate_and_longer_with_finer_steps) {
  const Surface surface = example::make_surface(example::make_ball(3));
  double worst_before = std::numeric_limits<double>::infinity();
  std::size_t bytes_before = 0;
  for (const double step : {0.3, 0.1, 0.03, 0.01, 0.003}) {
    const Result result = pack(surface, Shapes(surface, 9, step));
    EXPECT_LT(step * result.worst, worst_before) << step;
    EXPECT_GT(result.bytes.size(), bytes_before) << step;
    worst_before = step * result.worst;
    bytes_before = result.bytes.size();
  }
}

TEST(CodecShapes, are_finer_at_requested_vertices) {
  const Surface surface = example::make_surface(example::make_ball(3));
  Shapes shapes(surface, 6, 0.1);
  for (std::size_t v = 0; v < surface.places.size(); ++v) shapes.fineness[v] = static_cast<std::uint8_t>(v % 10);
  EXPECT_LT(pack(surface, shapes).worst, 1.02 * kMostLeft);  // in steps of each vertex
}

// A mode at rest at a vertex that moves by thousands of steps next to it must decode to exactly zero.
TEST(CodecShapes, at_the_finest_are_exact) {
  const Surface surface = example::make_surface(example::make_ball(3));
  Shapes shapes(surface, 5, 1e-4);
  Rows wanted(surface.places.size(), 5);
  for (std::size_t v = 0; v < surface.places.size(); ++v) {
    const bool is_fixed = surface.find_vertex(v)[2] > 0.3;
    std::vector<float> row(shapes.wanted.get(v), shapes.wanted.get(v) + wanted.get_width());
    if (is_fixed) std::fill(row.begin(), row.end(), 0.0F);
    wanted.append(row);
    shapes.fineness[v] = is_fixed ? kMaxFineness : 0;
  }
  shapes.wanted = std::move(wanted);
  const FittedShapes fitted = shapes.fit(surface);
  const std::vector<std::uint8_t> bytes = write_shapes(shapes.step, fitted.levels);
  const std::vector<std::int16_t> shape = read_shapes(example::as_bytes(bytes), surface, shapes.scale, "shapes");
  for (std::size_t v = 0; v < surface.places.size(); ++v)
    for (std::size_t i = 0; shapes.fineness[v] > 0 && i < 15; ++i) ASSERT_EQ(shape[15 * v + i], 0) << v;
}

TEST(CodecShapes, of_smooth_fields_are_compressed_to_a_fifth) {
  const Surface surface = example::make_surface(example::make_ball(4));
  const Result result = pack(surface, Shapes(surface, 20, 0.02));
  EXPECT_LT(result.worst, 1.01 * kMostLeft);
  EXPECT_LT(5 * result.bytes.size(), 6 * surface.places.size() * 20);
}

TEST(CodecShapes, of_noise_read_back_within_steps) {
  const Surface surface = example::make_surface(example::make_ball(3));
  Shapes shapes(surface, 4, 0.05);
  std::mt19937 random(4);
  Rows wanted(surface.places.size(), 4);
  for (std::size_t v = 0; v < surface.places.size(); ++v) {
    std::vector<float> row(wanted.get_width(), 0.0F);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < 4; ++m) row[c * wanted.get_padded() + m] = std::uniform_real_distribution<float>(-20.0F, 20.0F)(random);
    wanted.append(row);
  }
  shapes.wanted = std::move(wanted);
  EXPECT_LT(pack(surface, shapes).worst, 1.01 * kMostLeft);
}

TEST(CodecFitLoops, of_all_instruction_sets_agree_with_sums_in_double) {
  constexpr std::size_t kPadded = 48, kModes = 41;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> draw(-3.0F, 3.0F);
  const auto fill = [&](std::vector<float>& row) {
    row.assign(3 * kPadded, 0.0F);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < kModes; ++m) row[c * kPadded + m] = draw(random);
  };
  std::array<std::vector<float>, kNeighbours> of_neighbours;
  std::array<const float*, kNeighbours> rows;
  for (std::size_t k = 0; k < kNeighbours; ++k) fill(of_neighbours[k]), rows[k] = of_neighbours[k].data();
  std::vector<float> wanted, coefficients(3 * kFields);
  fill(wanted);
  for (float& x : coefficients) x = 0.1F * draw(random);
  Stencil stencil;
  for (std::size_t k = 0; k < kNeighbours; ++k) {
    stencil.value[k] = draw(random);
    for (std::size_t j = 0; j < 3; ++j) stencil.gradient[j][k] = draw(random), stencil.offset[j][k] = draw(random);
  }
  const ResidualCost model{.step = 0.7F, .rounding = 0.4F, .bits_of_0 = 0.25F, .bits_of_1 = 2.5F, .per_error = 3.0F};
  for (const base::Instructions set : base::list_instructions()) {
    SCOPED_TRACE(base::get_name(set));
    const FitLoops& loops = find_fit_loops(set);
    Columns columns(kPadded);
    loops.calc_columns(rows.data(), wanted.data(), stencil, columns);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < kModes; ++m) {
        const auto get = [&](std::size_t k) { return static_cast<double>(of_neighbours[k][c * kPadded + m]); };
        double value = 0.0;
        std::array<double, 3> gradient{};
        for (std::size_t k = 0; k < kNeighbours; ++k) {
          value += static_cast<double>(stencil.value[k]) * get(k);
          for (std::size_t j = 0; j < 3; ++j) gradient[j] += static_cast<double>(stencil.gradient[j][k]) * get(k);
        }
        EXPECT_NEAR(columns.get(c)[m], static_cast<double>(wanted[c * kPadded + m]) - value, 1e-3);
        for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(columns.get(Columns::kGradient + 3 * c + j)[m], gradient[j], 1e-3);
        for (std::size_t k = 0; k < kNeighbours; ++k) {
          double left = get(k) - value;
          for (std::size_t j = 0; j < 3; ++j) left -= gradient[j] * static_cast<double>(stencil.offset[j][k]);
          EXPECT_NEAR(columns.get(Columns::kDifferences + kNeighbours * c + k)[m], left, 1e-2);
        }
      }
    Products products{};
    loops.calc_products(columns, 0, Columns::kDifferences, products);
    loops.calc_products(columns, Columns::kDifferences, Columns::kCount, products);
    for (std::size_t i = 0; i < Columns::kUsed; ++i)
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = 0.0, size = 0.0;
        for (std::size_t m = 0; m < kPadded; ++m) {
          const double part = static_cast<double>(columns.get(i)[m]) * static_cast<double>(columns.get(j)[m]);
          sum += part;
          size += std::abs(part);
        }
        EXPECT_NEAR(products[i * Columns::kCount + j], sum, 1e-5 * size) << i << " " << j;
      }
    double cost = 0.0;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < kPadded; ++m) {
        double left = static_cast<double>(columns.get(c)[m]);
        for (std::size_t f = 0; f < kFields; ++f)
          left -= static_cast<double>(coefficients[3 * f + c]) * static_cast<double>(columns.get(Columns::kGradient + f)[m]);
        const double x = std::abs(left) / 0.7, q = std::floor(x + 0.4);
        cost += (q > 0.0 ? 2.5 + 2.0 * std::log2(q) : 0.25) + 3.0 * (x - q) * (x - q);
      }
    EXPECT_NEAR(loops.calc_cost(columns, coefficients.data(), kFields, model) / cost, 1.0, 0.02);
  }
}

// ---- damaged bytes ----

/// False if the bytes are rejected.
bool try_read(std::span<const std::byte> bytes, const Surface& surface, const std::vector<double>& scale) {
  try {
    const std::vector<std::int16_t> shape = read_shapes(bytes, surface, scale, "damaged");
    EXPECT_EQ(shape.size(), surface.places.size() * scale.size() * 3);
    EXPECT_EQ(std::count(shape.begin(), shape.end(), std::int16_t{-32768}), 0);
    return true;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("damaged: packed shapes: "), std::string::npos) << error.what();
    return false;
  }
}

struct Sample {
  Surface surface;
  Shapes shapes;
  std::vector<LevelNumbers> levels;

  explicit Sample(int divisions, std::size_t modes = 2, double step = 0.2)
      : surface(example::make_surface(example::make_ball(divisions))), shapes(surface, modes, step), levels(shapes.fit(surface).levels) {}
  std::vector<std::uint8_t> write() const { return write_shapes(shapes.step, levels); }
  bool try_read(const std::vector<std::uint8_t>& bytes) const { return packed::try_read(example::as_bytes(bytes), surface, shapes.scale); }
};

TEST(CodecShapes, of_wrong_length_are_rejected) {
  const Sample sample(3);
  std::vector<std::uint8_t> bytes = sample.write();
  ASSERT_TRUE(sample.try_read(bytes));
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_FALSE(try_read(example::as_bytes(bytes).first(length), sample.surface, sample.shapes.scale)) << length;
  bytes.push_back(0);
  EXPECT_FALSE(sample.try_read(bytes));
}

TEST(CodecShapes, with_a_changed_byte_are_rejected_or_finite) {
  for (const int divisions : {2, 3}) {
    const Sample sample(divisions);
    const std::vector<std::uint8_t> bytes = sample.write();
    std::size_t read = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i)
      for (const unsigned flip : {0x01u, 0x10u, 0x80u, 0xffu}) {
        std::vector<std::uint8_t> changed = bytes;
        changed[i] = static_cast<std::uint8_t>(changed[i] ^ flip);
        read += sample.try_read(changed) ? 1 : 0;
      }
    EXPECT_GT(read, 10u);  // steps may differ
    EXPECT_LT(read, bytes.size());
  }
}

TEST(CodecShapes, of_huge_numbers_and_steps_are_finite) {
  const Sample sample(3, 24, 1e-2);
  ASSERT_EQ(sample.levels.size(), 2u);
  std::mt19937 random(8);
  for (int round = 0; round < 24; ++round) {
    std::vector<LevelNumbers> levels = sample.levels;
    for (LevelNumbers& level : levels) {
      for (std::vector<std::int32_t>* numbers : {&level.gradient, &level.differences, &level.residual})
        for (std::int32_t& number : *numbers)
          if (random() % 16 == 0) number = static_cast<std::int32_t>(static_cast<std::uint32_t>(random()) >> (random() % 32));
      for (float* step : {&level.steps.residual, &level.steps.gradient, &level.steps.differences}) {
        const std::array choice{*step, 0.0F, 1e-45F, 1e18F, 3.4e38F};
        *step = choice[random() % choice.size()];
      }
      level.steps.cell_shift = static_cast<std::uint8_t>(random() % (kMaxCellShift + 1));
      for (Kind& kind : level.kinds) kind.fineness = static_cast<std::uint8_t>(random() % (kMaxFineness + 1));
    }
    EXPECT_TRUE(sample.try_read(write_shapes(std::vector<float>(24, std::array{3.4e38F, 0.0F, 1.0F}[random() % 3]), levels))) << round;
  }
}

TEST(CodecShapes, with_invalid_headers_are_rejected) {
  const Sample sample(3, 64, 1e-2);
  ASSERT_GT(sample.levels[1].residual.size(), 2 * 192u);
  ASSERT_GT(sample.levels[1].gradient.size(), 0u);
  ASSERT_GT(sample.levels[1].differences.size(), 0u);
  const auto expect_refused = [&](const char* why, auto&& change) {
    Sample bad = sample;
    change(bad);
    EXPECT_FALSE(sample.try_read(bad.write())) << why;
  };
  expect_refused("a level less", [](Sample& s) { s.levels.pop_back(); });
  expect_refused("a level more", [](Sample& s) { s.levels.push_back(s.levels.back()); });
  const auto drop_residuals = [](Sample& s) {
    for (LevelNumbers& level : s.levels) {
      level.residual.clear();
      for (Kind& kind : level.kinds) kind.has_residual = false;
    }
  };
  Sample bare = sample;
  drop_residuals(bare);
  EXPECT_TRUE(sample.try_read(bare.write()));
  expect_refused("a mode less", [&](Sample& s) { drop_residuals(s), s.shapes.step.pop_back(); });
  expect_refused("a mode more", [&](Sample& s) { drop_residuals(s), s.shapes.step.push_back(1.0F); });
  expect_refused("a step of a mode below 0", [](Sample& s) { s.shapes.step[1] = -1.0F; });
  expect_refused("a step of a mode that is none", [](Sample& s) { s.shapes.step[0] = std::nanf(""); });
  expect_refused("an infinite step of a mode", [](Sample& s) { s.shapes.step[0] = std::numeric_limits<float>::infinity(); });
  expect_refused("a step of a level below 0", [](Sample& s) { s.levels[1].steps.gradient = -0.1F; });
  expect_refused("a step of a level that is none", [](Sample& s) { s.levels[0].steps.residual = std::nanf(""); });
  expect_refused("cells too wide", [](Sample& s) { s.levels[1].steps.cell_shift = kMaxCellShift + 1; });
  expect_refused("a fit on the coarsest level", [](Sample& s) { s.levels[0].kinds[3].fit = Fit::kGradient; });
  expect_refused("an unknown fit", [](Sample& s) { s.levels[1].kinds[3].fit = static_cast<Fit>(3); });
  expect_refused("a vertex less", [](Sample& s) { s.levels[1].kinds.pop_back(); });
  expect_refused("another number of fits", [](Sample& s) {
    for (Kind& kind : s.levels[1].kinds) kind.fit = kind.fit == Fit::kNone ? Fit::kGradient : Fit::kNone;
  });
  expect_refused("a residual less", [](Sample& s) { s.levels[1].residual.resize(s.levels[1].residual.size() - 192); });
  expect_refused("a residual more", [](Sample& s) { s.levels[1].residual.resize(s.levels[1].residual.size() + 192, 1); });
  std::vector<std::uint8_t> bytes = sample.write();
  bytes[0] = 2;
  EXPECT_FALSE(sample.try_read(bytes)) << "form";
}

TEST(CodecShapes, of_too_many_modes_are_rejected_before_allocation) {
  const Surface surface = example::make_surface(example::make_ball(4));
  const std::vector<double> scale(1 << 20, 1.0);
  std::vector<std::uint8_t> bytes{1, 0, 0, 0x10, 0, static_cast<std::uint8_t>(surface.level_count())};
  EXPECT_FALSE(try_read(example::as_bytes(bytes), surface, scale));
  bytes.resize(100000);
  EXPECT_FALSE(try_read(example::as_bytes(bytes), surface, scale));
}

TEST(CodecShapes, on_too_few_coarse_vertices_are_rejected) {
  Surface surface = example::make_surface(example::make_ball(2));
  surface.level_begin = {0, kNeighbours - 1, surface.places.size()};
  const Shapes shapes(surface, 1, 0.1);
  LevelNumbers first, second;
  first.kinds.resize(kNeighbours - 1);
  second.kinds.resize(surface.places.size() - kNeighbours + 1);
  EXPECT_FALSE(try_read(example::as_bytes(write_shapes(shapes.step, std::vector{first, second})), surface, shapes.scale));
  surface.level_begin[1] = kNeighbours;
  first.kinds.resize(kNeighbours);
  second.kinds.resize(surface.places.size() - kNeighbours);
  EXPECT_TRUE(try_read(example::as_bytes(write_shapes(shapes.step, std::vector{first, second})), surface, shapes.scale));
}

}  // namespace
}  // namespace carillon::packed
