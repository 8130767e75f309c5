#include <fmt/format.h>

#include <algorithm>

#include "runtime/bank/packed/inflate.hpp"
#include "runtime/bank/packed/reader.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {
namespace {

constexpr std::size_t kMaxMeanVisits = 256;  // mean list nodes visited per triangle: bounds the time by the length

/// Streams of the triangles, one symbol at a time.
class Corners {
 public:
  Corners(Reader& reader, std::size_t triangles, std::size_t seeds) : reader_(reader), count_(triangles + 2 * seeds) {
    symbols_ = reader.get_block((count_ + 3) / 4);
    const std::size_t others = reader.get<std::uint32_t>();
    if (others > count_) reader.fail("more corners have an index than exist");
    others_ = reader.get_numbers(others);
  }
  Corner next() {
    if (at_ >= count_) reader_.fail("its triangles begin more often than declared");
    const std::uint8_t four = symbols_[at_ / 4];
    return static_cast<Corner>((four >> (2 * (at_++ % 4))) & 3U);
  }
  std::uint32_t next_other() {
    if (at_other_ >= others_.size()) reader_.fail("a corner has no index");
    return others_[at_other_++];
  }
  void finish() {
    if (at_ != count_ || at_other_ != others_.size()) reader_.fail("it has more corners than triangles");
  }

 private:
  Reader& reader_;
  std::size_t count_, at_ = 0, at_other_ = 0;
  std::vector<std::uint8_t> symbols_;
  std::vector<std::uint32_t> others_;
};

/// Vertices in traversal order.
class Vertices {
 public:
  Vertices(Reader& reader, std::size_t count) : reader_(reader) {
    const std::vector<std::uint32_t> folded = reader.get_numbers(3 * count);
    places_.resize(count);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < 3; ++k) places_[i][k] = unfold(folded[k * count + i]);
  }
  std::int32_t add(const Place& predicted) {
    if (used_ == places_.size()) reader_.fail("its triangles have more vertices than there are");
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t place = std::int64_t{predicted[k]} + places_[used_][k];
      if (place < -kMaxPlace || place > kMaxPlace) reader_.fail(fmt::format("vertex {} is outside of its lattice", used_));
      places_[used_][k] = static_cast<std::int32_t>(place);
    }
    return static_cast<std::int32_t>(used_++);
  }
  const Place& operator[](std::int32_t vertex) const { return places_[vertex]; }
  Place get_last() const { return used_ > 0 ? places_[used_ - 1] : Place{}; }
  std::int32_t find_other(std::uint32_t back) {
    if (back >= used_) reader_.fail("a corner refers to a later vertex");
    return static_cast<std::int32_t>(used_ - 1 - back);
  }
  std::vector<Place> take() {
    if (used_ != places_.size()) reader_.fail("a vertex has no triangle");
    return std::move(places_);
  }

 private:
  Reader& reader_;
  std::vector<Place> places_;  // from used_ on: differences from the prediction
  std::size_t used_ = 0;
};

/// Parallelogram prediction across the gate.
Place predict(const Vertices& vertices, const Gate& gate) {
  Place place;
  for (std::size_t k = 0; k < 3; ++k) place[k] = vertices[gate.from][k] + vertices[gate.to][k] - vertices[gate.opposite][k];
  return place;
}

Triangle begin_shell(Corners& corners, Vertices& vertices) {
  Triangle triangle;
  for (std::int32_t& corner : triangle)
    corner = corners.next() == Corner::kNew ? vertices.add(vertices.get_last()) : vertices.find_other(corners.next_other());
  return triangle;
}

Triangle cross_gate(const Gate& gate, const Border& border, Corners& corners, Vertices& vertices, const Reader& reader) {
  std::int32_t third = -1;
  switch (corners.next()) {
    case Corner::kNew:
      third = vertices.add(predict(vertices, gate));
      break;
    case Corner::kRight:
      third = border.find_right(gate);
      break;
    case Corner::kLeft:
      third = border.find_left(gate);
      break;
    case Corner::kOther:
      third = vertices.find_other(corners.next_other());
      break;
  }
  if (third < 0) reader.fail("a triangle continues without a border");
  return {gate.to, gate.from, third};
}

/// Sorts the vertices into the order of find_order().
void sort_vertices(Surface& surface, const std::vector<std::uint8_t>& level, std::size_t levels, const Reader& reader) {
  surface.level_begin.assign(levels + 1, 0);
  for (const std::uint8_t l : level) {
    if (l >= levels) reader.fail(fmt::format("a vertex is of level {}, and there are {}", l, levels));
    ++surface.level_begin[l + 1];
  }
  for (std::size_t l = 0; l < levels; ++l) {
    if (surface.level_begin[l + 1] == 0) reader.fail(fmt::format("its level {} is empty", l));
    surface.level_begin[l + 1] += surface.level_begin[l];
  }
  const std::vector<std::int32_t> order = find_order(surface.places, level);
  std::vector<std::int32_t> moved(level.size());
  std::vector<Place> places(level.size());
  for (std::size_t v = 0; v < level.size(); ++v) {
    moved[order[v]] = static_cast<std::int32_t>(v);
    places[v] = surface.places[order[v]];
  }
  surface.places = std::move(places);
  for (Triangle& triangle : surface.triangles)
    for (std::int32_t& corner : triangle) corner = moved[corner];
}

/// Spreads the lowest 19 bits, two zeros after each.
std::uint64_t spread(std::uint64_t x) {
  x &= 0x7ffffU;
  x = (x | x << 32) & 0x1f00000000ffffU;
  x = (x | x << 16) & 0x1f0000ff0000ffU;
  x = (x | x << 8) & 0x100f00f00f00f00fU;
  x = (x | x << 4) & 0x10c30c30c30c30c3U;
  x = (x | x << 2) & 0x1249249249249249U;
  return x;
}

}  // namespace

std::vector<std::int32_t> find_order(std::span<const Place> places, std::span<const std::uint8_t> level) {
  Place low{};
  std::int32_t extent = 0;
  for (std::size_t k = 0; k < 3 && !places.empty(); ++k) {
    const auto [first, last] =
        std::minmax_element(places.begin(), places.end(), [k](const Place& a, const Place& b) { return a[k] < b[k]; });
    low[k] = (*first)[k];
    extent = std::max(extent, (*last)[k] - low[k]);
  }
  int shift = 0;
  while (extent >> shift >= 1 << 19) ++shift;
  std::vector<std::pair<std::uint64_t, std::int32_t>> keys(places.size());
  for (std::size_t v = 0; v < places.size(); ++v) {
    std::uint64_t key = level[v];
    key <<= 57;
    for (std::size_t k = 0; k < 3; ++k) key |= spread(static_cast<std::uint64_t>((places[v][k] - low[k]) >> shift)) << k;
    keys[v] = {key, static_cast<std::int32_t>(v)};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::int32_t> order(places.size());
  for (std::size_t v = 0; v < places.size(); ++v) order[v] = keys[v].second;
  return order;
}

void restore_order(std::span<const std::byte> bytes, std::vector<Triangle>& triangles, const std::string& name) {
  Reader reader(bytes, name, "order of packed triangles");
  const std::vector<std::uint32_t> steps = reader.get_numbers(triangles.size());
  const std::vector<std::uint8_t> first = reader.get_block(triangles.size());
  reader.finish();
  std::vector<Triangle> before(triangles.size(), Triangle{-1, -1, -1});
  std::int64_t t = 0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    t += unfold(steps[i]);
    if (t < 0 || t >= static_cast<std::int64_t>(before.size())) reader.fail(fmt::format("triangle {} is out of range", i));
    Triangle& triangle = before[t];
    if (triangle[0] >= 0) reader.fail(fmt::format("two triangles have the number {}", t));
    if (first[i] > 2) reader.fail(fmt::format("triangle {} begins with its corner {}", i, first[i]));
    for (std::size_t k = 0; k < 3; ++k) triangle[k] = triangles[i][(k + first[i]) % 3];
  }
  triangles = std::move(before);
}

Surface read_surface(std::span<const std::byte> bytes, const std::string& name) {
  Reader reader(bytes, name, "packed surface");
  if (const auto form = reader.get<std::uint8_t>(); form != 1) reader.fail(fmt::format("its form is {}, and this reader knows 1", form));
  const std::size_t levels = reader.get<std::uint8_t>();
  const std::size_t vertex_count = reader.get<std::uint32_t>(), triangle_count = reader.get<std::uint32_t>();
  const std::size_t seeds = reader.get<std::uint32_t>();
  // Per vertex 12 bytes of position, 12 while sorting and 24 of order; per triangle 12 bytes and three gates of 24 while their list grows.
  if (48 * std::uint64_t{vertex_count} + 156 * std::uint64_t{triangle_count} > find_most_unpacked(bytes.size()))
    reader.fail("it would expand beyond the limit for its length");
  if (seeds > triangle_count) reader.fail("it begins more often than it has triangles");
  if (levels == 0 || levels > kMaxLevels) reader.fail(fmt::format("it has {} levels; 1 to {} are possible", levels, kMaxLevels));
  Surface surface;
  for (double& x : surface.origin_m) {
    x = reader.get<double>();
    if (!std::isfinite(x)) reader.fail("its origin is not finite");
  }
  surface.step_m = reader.get_positive("step");

  Corners corners(reader, triangle_count, seeds);
  Vertices vertices(reader, vertex_count);
  const std::vector<std::uint8_t> level = reader.get_block(vertex_count);
  reader.finish();

  Border border;
  surface.triangles.reserve(triangle_count);
  for (std::size_t t = 0; t < triangle_count; ++t) {
    const Gate* gate = border.find_gate();
    const Triangle triangle = gate != nullptr ? cross_gate(*gate, border, corners, vertices, reader) : begin_shell(corners, vertices);
    if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0])
      reader.fail(fmt::format("triangle {} has a vertex twice", t));
    border.add(triangle);
    if (border.count_passed() > kMaxMeanVisits * (t + kMaxMeanVisits)) reader.fail("too many of its edges are open at one vertex");
    surface.triangles.push_back(triangle);
  }
  corners.finish();
  surface.places = vertices.take();
  sort_vertices(surface, level, levels, reader);
  return surface;
}

}  // namespace carillon::packed
