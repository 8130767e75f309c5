#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "runtime/bank/packed/inflate.hpp"
#include "runtime/bank/packed/loops.hpp"
#include "runtime/bank/packed/reader.hpp"
#include "runtime/bank/packed/rows.hpp"
#include "runtime/bank/packed/shapes.hpp"

namespace carillon::packed {
namespace {

constexpr std::size_t kGroup = 32;  // vertices decoded at once: the file is transposed

/// Decoded values of a byte.
constexpr std::array<float, 256> kUnfolded = [] {
  std::array<float, 256> numbers{};
  for (std::uint32_t i = 0; i < 256; ++i) numbers[i] = static_cast<float>(unfold(i));
  return numbers;
}();

/// Numbers of vertices, transposed: all first ones, then all second ones ...
class Numbers {
 public:
  Numbers(Reader& reader, std::size_t vertices, std::size_t numbers) : vertices_(vertices), numbers_(numbers), tile_(kGroup * numbers) {
    const int planes = reader.get<std::uint8_t>();
    if (planes > 4) reader.fail(fmt::format("numbers of {} bytes", planes));
    for (int plane = 0; plane < planes; ++plane) planes_.push_back(reader.get_block(vertices * numbers));
  }
  /// Decodes the next `count` vertices, at most kGroup, for get().
  void take(std::size_t count) {
    for (std::size_t j = 0; j < numbers_; ++j) {
      const std::size_t from = j * vertices_ + first_;
      if (planes_.size() == 1) {  // usual case
        for (std::size_t v = 0; v < count; ++v) tile_[v * numbers_ + j] = kUnfolded[planes_[0][from + v]];
        continue;
      }
      for (std::size_t v = 0; v < count; ++v) {
        std::uint32_t folded = 0;
        for (std::size_t plane = planes_.size(); plane-- > 0;) folded = folded << 8 | planes_[plane][from + v];
        tile_[v * numbers_ + j] = static_cast<float>(unfold(folded));
      }
    }
    first_ += count;
    next_ = 0;
  }
  std::span<const float> get() { return {tile_.data() + next_++ * numbers_, numbers_}; }

 private:
  std::size_t vertices_, numbers_, first_ = 0, next_ = 0;
  std::vector<std::vector<std::uint8_t>> planes_;
  std::vector<float> tile_;  // (kGroup, numbers)
};

/// Sparse residuals: per vertex the number of nonzero ones, and for each the preceding zeros.
class SparseResidual {
 public:
  SparseResidual(Reader& reader, std::size_t vertices, std::size_t numbers) : reader_(reader), numbers_(numbers) {
    counts_ = reader.get_numbers(vertices);
    const std::size_t total = reader.get<std::uint32_t>();
    // Nonzero, so each takes at least a byte.
    if (total > vertices * numbers || total / kMaxInflation > reader.get_left()) reader.fail("there are more residuals than numbers");
    gaps_ = reader.get_numbers(total);
    values_ = reader.get_numbers(total);
  }
  template <class Add>
  void take(Add&& add) {
    std::size_t place = 0;
    for (std::uint32_t i = 0; i < counts_[vertex_]; ++i, ++at_, ++place) {
      if (at_ >= values_.size() || gaps_[at_] >= numbers_ - place) reader_.fail("a residual lies outside its vertex");
      place += gaps_[at_];
      add(place, static_cast<float>(unfold(values_[at_])));
    }
    ++vertex_;
  }
  void finish() const {
    if (at_ != values_.size()) reader_.fail("there are excess residuals");
  }

 private:
  Reader& reader_;
  std::size_t numbers_, vertex_ = 0, at_ = 0;
  std::vector<std::uint32_t> counts_, gaps_, values_;
};

class ShapeReader {
 public:
  ShapeReader(Reader& reader, const Surface& surface, std::size_t modes, std::span<const float> factor)
      : reader_(reader),
        surface_(surface),
        modes_(modes),
        factor_(factor),
        rows_(surface.level_begin[surface.level_count() - 1], modes),
        row_(rows_.get_width()),
        shape_row_(rows_.get_width()) {
    base::reserve_large(shape_, surface.places.size() * modes * 3);
  }

  std::vector<std::int16_t> run() {
    for (std::size_t level = 0; level < surface_.level_count(); ++level) read_level(level);
    return std::move(shape_);
  }

 private:
  void read_level(std::size_t level) {
    const std::size_t first = surface_.level_begin[level], end = surface_.level_begin[level + 1];
    const bool is_last = level + 1 == surface_.level_count();
    LevelSteps steps;
    for (float* step : {&steps.residual, &steps.gradient, &steps.differences}) {
      *step = reader_.get<float>();
      if (!(*step >= 0.0F) || !std::isfinite(*step)) reader_.fail(fmt::format("a step of level {} is {}", level, *step));
    }
    steps.cell_shift = reader_.get<std::uint8_t>();
    if (steps.cell_shift > kMaxCellShift) reader_.fail(fmt::format("cells of 2^{} steps", steps.cell_shift));
    const std::vector<std::uint8_t> bytes = reader_.get_block(end - first);
    std::size_t fits = 0, wide_fits = 0, residuals = 0;
    for (const std::uint8_t byte : bytes) {
      if ((byte & 3) == 3 || (level == 0 && (byte & 3) != 0)) reader_.fail(fmt::format("a vertex of level {} has no known fit", level));
      const Kind kind = to_kind(byte);
      fits += kind.fit != Fit::kNone ? 1 : 0;
      wide_fits += kind.fit == Fit::kDifferences ? 1 : 0;
      residuals += kind.has_residual ? 1 : 0;
    }
    Numbers gradient(reader_, fits, kGradientNumbers), differences(reader_, wide_fits, kDifferenceNumbers);
    std::unique_ptr<Numbers> dense;
    std::unique_ptr<SparseResidual> sparse;
    const auto form = reader_.get<std::uint8_t>();
    if (form > 1) reader_.fail(fmt::format("residuals of form {}", form));
    if (form == 0)
      dense = std::make_unique<Numbers>(reader_, residuals, 3 * modes_);
    else
      sparse = std::make_unique<SparseResidual>(reader_, residuals, 3 * modes_);
    std::unique_ptr<NeighbourSearch> search;
    if (level > 0) search = std::make_unique<NeighbourSearch>(std::span(surface_.places).first(first), steps.cell_shift);

    std::array<Neighbours, kGroup> neighbours;
    std::array<Stencil, kGroup> stencils;
    for (std::size_t begin = first; begin < end; begin += kGroup) {
      const std::size_t count = std::min(kGroup, end - begin);
      std::array<Kind, kGroup> kinds;
      fits = wide_fits = residuals = 0;
      for (std::size_t i = 0; i < count; ++i) {
        kinds[i] = to_kind(bytes[begin - first + i]);
        fits += kinds[i].fit != Fit::kNone ? 1 : 0;
        wide_fits += kinds[i].fit == Fit::kDifferences ? 1 : 0;
        residuals += kinds[i].has_residual ? 1 : 0;
      }
      gradient.take(fits);
      differences.take(wide_fits);
      if (dense) dense->take(residuals);
      if (search) {
        for (std::size_t i = 0; i < count; ++i) neighbours[i] = search->find(surface_.places[begin + i]);
        calc_stencils(std::span(surface_.places).subspan(begin, count), std::span(neighbours).first(count), surface_.places,
                      std::span(stencils).first(count));
      }
      for (std::size_t i = 0; i < count; ++i) {
        const float share = LevelSteps::calc_share(kinds[i].fineness);
        if (search)
          predict(kinds[i].fit, neighbours[i], stencils[i], share, steps, gradient, differences);
        else
          std::fill(row_.begin(), row_.end(), 0.0F);
        if (kinds[i].has_residual) add_residual(share * steps.residual, dense.get(), sparse.get());
        if (!is_last) {
          rows_.append(row_);
          energies_.push_back(loops_.calc_energy(row_.data(), row_.size()));
        }
        loops_.round(row_.data(), factor_.data(), rows_.get_padded(), shape_row_.data());
        shape_.insert(shape_.end(), shape_row_.begin(), shape_row_.begin() + static_cast<std::ptrdiff_t>(3 * modes_));
      }
    }
    if (sparse) sparse->finish();
  }

  void predict(Fit fit, const Neighbours& neighbours, const Stencil& stencil, float share, const LevelSteps& steps, Numbers& gradient,
               Numbers& differences) {
    std::array<const float*, kNeighbours> from;
    float energy = 0.0F;
    for (std::size_t k = 0; k < kNeighbours; ++k) {
      from[k] = rows_.get(static_cast<std::size_t>(neighbours[k]));
      energy += energies_[neighbours[k]] / static_cast<float>(kNeighbours);
    }
    if (fit == Fit::kNone) {
      return loops_.add_weighted(from.data(), stencil.value.data(), row_.size(), row_.data());
    }
    const float unit = share / std::sqrt(1.0F + energy);
    std::array<float, kGradientNumbers> of_gradient;
    std::array<float, kDifferenceNumbers> of_differences;
    const auto scale = [&](std::span<const float> numbers, float step, std::span<float> scaled) {
      for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] = step * unit * numbers[i];
    };
    scale(gradient.get(), steps.gradient, of_gradient);
    const bool is_wide = fit == Fit::kDifferences;
    if (is_wide) scale(differences.get(), steps.differences, of_differences);
    Matrix matrix;
    loops_.calc_matrix(stencil, of_gradient.data(), is_wide ? of_differences.data() : nullptr, matrix);
    loops_.multiply(from.data(), matrix.data(), rows_.get_padded(), row_.data());
  }

  void add_residual(float step, Numbers* dense, SparseResidual* sparse) {
    const std::size_t padded = rows_.get_padded();
    if (sparse != nullptr)
      return sparse->take([&](std::size_t place, float value) { row_[place % 3 * padded + place / 3] += step * value; });
    const std::span<const float> numbers = dense->get();
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < modes_; ++m) row_[c * padded + m] += step * numbers[3 * m + c];
  }

  Reader& reader_;
  const Surface& surface_;
  std::size_t modes_;
  std::span<const float> factor_;
  const Loops& loops_ = find_loops();
  Rows rows_;                    // all levels but the last
  std::vector<float> energies_;  // per row
  std::vector<float> row_;
  std::vector<std::int16_t> shape_row_, shape_;
};

}  // namespace

std::vector<float> calc_factors(std::span<const float> step, std::span<const double> scale) {
  std::vector<float> factor((step.size() + kRowUnit - 1) / kRowUnit * kRowUnit, 0.0F);
  for (std::size_t m = 0; m < step.size(); ++m)
    if (scale[m] > 0.0) factor[m] = static_cast<float>(static_cast<double>(step[m]) / scale[m]);
  return factor;
}

std::vector<std::int16_t> read_shapes(std::span<const std::byte> bytes, const Surface& surface, std::span<const double> scale,
                                      const std::string& name) {
  Reader reader(bytes, name, "packed shapes");
  const std::size_t modes = scale.size(), vertices = surface.places.size();
  if (const auto form = reader.get<std::uint8_t>(); form != 1) reader.fail(fmt::format("their form is {}, and this reader knows 1", form));
  if (const auto count = reader.get<std::uint32_t>(); count != modes)
    reader.fail(fmt::format("they are of {} modes, and the bank has {}", count, modes));
  if (const auto levels = reader.get<std::uint8_t>(); levels != surface.level_count())
    reader.fail(fmt::format("they have {} levels, and the surface {}", levels, surface.level_count()));
  if (surface.level_count() > 1 && surface.level_begin[1] < kNeighbours)
    reader.fail(fmt::format("their coarsest level has {} vertices; {} are needed", surface.level_begin[1], kNeighbours));
  // Per vertex and mode 18 bytes (6 of the shape, 12 of its row), and 24 per vertex of each search grid.
  const auto most = static_cast<double>(find_most_unpacked(bytes.size()));
  if (18.0 * (static_cast<double>(vertices) + 256.0) * (static_cast<double>(modes) + kRowUnit) +
          24.0 * (kMaxCellShift + 3) * static_cast<double>(vertices) >
      most + (64 << 20))
    reader.fail(fmt::format("{} modes at {} vertices are more than any bank of this length becomes", modes, vertices));

  const std::vector<float> step = reader.get_list<float>(modes);
  for (std::size_t m = 0; m < modes; ++m)
    if (!(step[m] >= 0.0F) || !std::isfinite(step[m])) reader.fail(fmt::format("the step of mode {} is {}", m, step[m]));
  const std::vector<float> factor = calc_factors(step, scale);
  std::vector<std::int16_t> shape = ShapeReader(reader, surface, modes, factor).run();
  reader.finish();
  return shape;
}

}  // namespace carillon::packed
