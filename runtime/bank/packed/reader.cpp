#include "runtime/bank/packed/reader.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "runtime/bank/packed/inflate.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/large.hpp"

namespace carillon::packed {

static_assert(std::endian::native == std::endian::little, "Numbers are copied unchanged between file and memory.");

void Reader::fail(std::string_view fault) const {
  throw InputError(fmt::format("{}: {}: {}; copy or pack the bank again", name_, what_, fault));
}

std::span<const std::byte> Reader::take(std::size_t count, std::size_t size) {
  if (count > bytes_.size() / size) fail("ends too early");
  const auto taken = bytes_.first(count * size);
  bytes_ = bytes_.subspan(taken.size());
  return taken;
}

double Reader::get_positive(std::string_view name) {
  const auto value = get<double>();
  if (!(value > 0.0) || !std::isfinite(value)) fail(fmt::format("its {} is {}, not a positive number", name, value));
  return value;
}

std::vector<std::uint8_t> Reader::get_block(std::size_t size) {
  const auto stream = take(get<std::uint32_t>());
  if (size / kMaxInflation > stream.size()) fail("a block is too short for its content");
  std::vector<std::uint8_t> block;
  base::reserve_large(block, size);
  block.resize(size);
  if (!inflate({reinterpret_cast<const std::uint8_t*>(stream.data()), stream.size()}, block)) fail("a block is damaged");
  return block;
}

std::vector<std::uint32_t> Reader::get_numbers(std::size_t count) {
  const int planes = get<std::uint8_t>();
  if (planes > 4) fail(fmt::format("numbers of {} bytes", planes));
  std::vector<std::uint32_t> values;
  base::reserve_large(values, count);
  values.resize(count);
  for (int plane = 0; plane < planes; ++plane) {
    const std::vector<std::uint8_t> bytes = get_block(count);
    for (std::size_t i = 0; i < count; ++i) values[i] |= static_cast<std::uint32_t>(bytes[i]) << (8 * plane);
  }
  return values;
}

void Reader::finish() {
  if (!bytes_.empty()) fail(fmt::format("{} excess bytes", bytes_.size()));
}

}  // namespace carillon::packed
