// Arbitrary packed bytes give a usable surface and shapes, or an InputError. Each input is tried unchanged and, since mutations break the
// checksums of the blocks, as the numbers inside blocks.
#include <algorithm>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/packed/shapes.hpp"
#include "runtime/bank/packed/surface.hpp"
#include "runtime/bank/packed/writer.hpp"
#include "runtime/base/error.hpp"

namespace {

using namespace carillon;

void use(const packed::Surface& surface, std::span<const std::byte> shapes, std::size_t modes) {
  const std::vector<double> scale(modes, 1e-4);
  const std::vector<std::int16_t> shape = packed::read_shapes(shapes, surface, scale, "input");
  if (shape.size() != surface.places.size() * modes * 3) __builtin_trap();
}

void check(const packed::Surface& surface) {
  if (surface.level_begin.back() != surface.places.size()) __builtin_trap();
  for (const Triangle& triangle : surface.triangles)
    for (const std::int32_t v : triangle)
      if (v < 0 || v >= std::ssize(surface.places)) __builtin_trap();
}

/// Triangle order for a surface with triangles.
void restore(std::span<const std::byte> order, std::vector<Triangle> triangles) {
  try {
    packed::restore_order(order, triangles, "input");
  } catch (const InputError&) {
    return;
  }
  for (const Triangle& triangle : triangles)
    if (triangle[0] < 0) __builtin_trap();
}

/// Surface length (two bytes), number of modes, surface, shapes.
void read_as_it_is(std::span<const std::uint8_t> input) {
  if (input.size() < 3) return;
  const std::size_t modes = input[2];
  input = input.subspan(3);
  const std::size_t length = std::min<std::size_t>(input.size(), input.data()[-3] | input.data()[-2] << 8);
  const auto bytes = std::as_bytes(input);
  const packed::Surface surface = packed::read_surface(bytes.first(length), "input");
  check(surface);
  restore(bytes.subspan(length), surface.triangles);
  use(surface, bytes.subspan(length), modes);
}

/// Takes numbers from an input; zeros after its end.
class Source {
 public:
  explicit Source(std::span<const std::uint8_t> input) : input_(input) {}
  std::uint8_t take() {
    if (input_.empty()) return 0;
    const std::uint8_t byte = input_[0];
    input_ = input_.subspan(1);
    return byte;
  }
  /// Usually small.
  std::int32_t take_number() {
    const std::int32_t low = static_cast<std::int8_t>(take());
    if (low != -128) return low;
    std::uint32_t number = 0;
    for (int i = 0; i < 4; ++i) number = number << 8 | take();
    return static_cast<std::int32_t>(number);
  }
  float take_float() {
    const std::array choice{0.0F, 1e-30F, 0.01F, 1.0F, 1e10F, 3e38F};
    return choice[take() % choice.size()];
  }

 private:
  std::span<const std::uint8_t> input_;
};

/// Surface from the input's symbols and places, shapes from its numbers.
void read_as_numbers(std::span<const std::uint8_t> input) {
  Source source(input);
  const std::size_t triangles = 1 + source.take(), seeds = 1 + source.take() % 4, levels = 1 + source.take() % 3,
                    modes = source.take() % 20;
  std::vector<std::uint8_t> fours((triangles + 2 * seeds + 3) / 4);
  std::size_t vertices = 0, others = 0;
  for (std::size_t i = 0; i < triangles + 2 * seeds; ++i) {
    const unsigned corner = i < 3 ? 0 : source.take() % 4U;
    fours[i / 4] = static_cast<std::uint8_t>(fours[i / 4] | (corner << (2 * (i % 4))));
    vertices += corner == 0 ? 1 : 0;
    others += corner == 3 ? 1 : 0;
  }
  packed::Writer writer;
  writer.put(std::uint8_t{1});
  writer.put(static_cast<std::uint8_t>(levels));
  for (const std::size_t count : {vertices, triangles, seeds}) writer.put(static_cast<std::uint32_t>(count));
  for (int k = 0; k < 3; ++k) writer.put(0.0);
  writer.put(1e-3);
  writer.put_block(fours);
  writer.put(static_cast<std::uint32_t>(others));
  std::vector<std::uint32_t> numbers(others), places(3 * vertices);
  for (std::uint32_t& number : numbers) number = source.take();
  for (std::uint32_t& place : places) place = static_cast<std::uint32_t>(source.take_number());
  writer.put_numbers(numbers);
  writer.put_numbers(places);
  std::vector<std::uint8_t> level(vertices);
  for (std::size_t v = 0; v < vertices; ++v) level[v] = static_cast<std::uint8_t>(v < levels ? v : source.take() % levels);
  writer.put_block(level);
  const packed::Surface surface = packed::read_surface(std::as_bytes(std::span(writer.get_bytes())), "input");
  check(surface);
  packed::TriangleOrder order;
  for (std::size_t t = 0; t < triangles; ++t) {
    const std::int32_t move = source.take_number();
    order.before.push_back(static_cast<std::int32_t>(t) ^ move);
    order.first.push_back(static_cast<std::uint8_t>(move & 3));
  }
  const std::vector<std::uint8_t> order_bytes = packed::write_order(order);
  restore(std::as_bytes(std::span(order_bytes)), surface.triangles);

  std::vector<float> step(modes);
  for (float& x : step) x = source.take_float();
  std::vector<packed::LevelNumbers> said(levels);
  for (std::size_t l = 0; l < levels; ++l) {
    packed::LevelNumbers& of = said[l];
    of.steps = {source.take_float(), source.take_float(), source.take_float(), static_cast<std::uint8_t>(source.take() % 25)};
    for (std::size_t v = surface.level_begin[l]; v < surface.level_begin[l + 1]; ++v) {
      const std::uint8_t byte = source.take();
      packed::Kind kind = packed::to_kind(byte);
      kind.fit = l == 0 ? packed::Fit::kNone : static_cast<packed::Fit>(byte % 4 % 3);
      of.kinds.push_back(kind);
      const auto add = [&](std::vector<std::int32_t>& to, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) to.push_back(source.take_number());
      };
      if (kind.fit != packed::Fit::kNone) add(of.gradient, packed::kGradientNumbers);
      if (kind.fit == packed::Fit::kDifferences) add(of.differences, packed::kDifferenceNumbers);
      if (kind.has_residual) add(of.residual, 3 * modes);
    }
  }
  if (modes == 0) return;
  const std::vector<std::uint8_t> bytes = packed::write_shapes(step, said);
  use(surface, std::as_bytes(std::span(bytes)), modes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const auto read : {read_as_it_is, read_as_numbers}) {
    try {
      read({data, size});
    } catch (const InputError&) {
    }
  }
  return 0;
}
