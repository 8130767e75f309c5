
#include "runtime/bank/packed/reader.hpp"
#include "runtime/bank/packed/shapes.hpp"
#include "runtime/bank/packed/writer.hpp"

namespace carillon::packed {
namespace {

/// values: (vertices, numbers), transposed for Numbers.
void put_across(Writer& writer, std::span<const std::int32_t> values, std::size_t numbers) {
  const std::size_t vertices = values.empty() ? 0 : values.size() / numbers;
  std::vector<std::uint32_t> folded(values.size());
  for (std::size_t v = 0; v < vertices; ++v)
    for (std::size_t j = 0; j < numbers; ++j) folded[j * vertices + v] = fold(values[v * numbers + j]);
  writer.put_numbers(folded);
}

void put_sparse(Writer& writer, std::span<const std::int32_t> values, std::size_t numbers) {
  std::vector<std::uint32_t> counts, gaps, folded;
  for (std::size_t begin = 0; begin < values.size(); begin += numbers) {
    const std::size_t before = folded.size();
    std::uint32_t gap = 0;
    for (const std::int32_t value : values.subspan(begin, numbers)) {
      if (value == 0) {
        ++gap;
        continue;
      }
      gaps.push_back(gap);
      folded.push_back(fold(value));
      gap = 0;
    }
    counts.push_back(static_cast<std::uint32_t>(folded.size() - before));
  }
  writer.put_numbers(counts);
  writer.put(static_cast<std::uint32_t>(folded.size()));
  writer.put_numbers(gaps);
  writer.put_numbers(folded);
}

/// The shorter of the two forms, preceded by its number.
void put_residual(Writer& writer, std::span<const std::int32_t> values, std::size_t numbers) {
  Writer dense, sparse;
  put_across(dense, values, numbers);
  put_sparse(sparse, values, numbers);
  const bool is_sparse = sparse.get_bytes().size() < dense.get_bytes().size();
  writer.put(static_cast<std::uint8_t>(is_sparse ? 1 : 0));
  writer.put_list(std::span<const std::uint8_t>((is_sparse ? sparse : dense).get_bytes()));
}

}  // namespace

std::vector<std::uint8_t> write_shapes(std::span<const float> step, std::span<const LevelNumbers> levels) {
  Writer writer;
  writer.put(std::uint8_t{1});
  writer.put(static_cast<std::uint32_t>(step.size()));
  writer.put(static_cast<std::uint8_t>(levels.size()));
  writer.put_list(step);
  for (const LevelNumbers& level : levels) {
    writer.put(level.steps.residual);
    writer.put(level.steps.gradient);
    writer.put(level.steps.differences);
    writer.put(level.steps.cell_shift);
    std::vector<std::uint8_t> kinds;
    for (const Kind kind : level.kinds) kinds.push_back(to_byte(kind));
    writer.put_block(kinds);
    put_across(writer, level.gradient, kGradientNumbers);
    put_across(writer, level.differences, kDifferenceNumbers);
    put_residual(writer, level.residual, 3 * step.size());
  }
  return writer.get_bytes();
}

}  // namespace carillon::packed
