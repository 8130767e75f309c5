#include <algorithm>
#include <numeric>

#include "runtime/bank/packed/reader.hpp"
#include "runtime/bank/packed/surface.hpp"
#include "runtime/bank/packed/writer.hpp"

namespace carillon::packed {
namespace {

/// Edges by their first vertex.
class EdgeTable {
 public:
  EdgeTable(const std::vector<Triangle>& triangles, std::size_t vertices) : triangles_(triangles), begin_(vertices + 1, 0) {
    for (const Triangle& triangle : triangles)
      for (const std::int32_t v : triangle) ++begin_[v + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
    edges_.resize(3 * triangles.size());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k) edges_[next[triangles[t][k]]++] = static_cast<std::int32_t>(3 * t + k);
  }
  /// First unfinished triangle with this edge, which exists: three times its index, plus the corner where the edge begins.
  std::int32_t find(std::int32_t from, std::int32_t to, const std::vector<bool>& is_done) const {
    std::size_t i = begin_[from];
    while (triangles_[edges_[i] / 3][(edges_[i] + 1) % 3] != to || is_done[edges_[i] / 3]) ++i;
    return edges_[i];
  }

 private:
  const std::vector<Triangle>& triangles_;
  std::vector<std::size_t> begin_;
  std::vector<std::int32_t> edges_;
};

/// Streams for read_surface(). Vertices have their new indices.
struct Streams {
  std::vector<std::uint8_t> corners;
  std::vector<std::uint32_t> others;
  std::array<std::vector<std::uint32_t>, 3> places;
  std::uint32_t seeds = 0;
};

class Traversal {
 public:
  Traversal(const std::vector<Place>& places, const std::vector<Triangle>& triangles)
      : places_(places), triangles_(triangles), edges_(triangles, places.size()), number_(places.size(), -1) {}

  Streams run() {
    std::vector<bool> is_done(triangles_.size(), false);
    std::size_t first = 0;
    while (order_.size() < triangles_.size()) {
      const Gate* gate = border_.find_gate();
      Triangle corners;
      std::int32_t t;
      if (gate == nullptr) {
        while (is_done[first]) ++first;
        t = static_cast<std::int32_t>(first);
        ++streams_.seeds;
        for (std::size_t k = 0; k < 3; ++k) corners[k] = name_corner(triangles_[first][k], nullptr);
      } else {
        const std::int32_t edge = edges_.find(vertices_[gate->to], vertices_[gate->from], is_done);
        t = edge / 3;
        corners = {gate->to, gate->from, name_corner(triangles_[t][(edge + 2) % 3], gate)};
      }
      is_done[t] = true;
      order_.push_back(t);
      border_.add(corners);
    }
    return std::move(streams_);
  }
  const std::vector<std::int32_t>& get_vertices() const { return vertices_; }
  const std::vector<std::int32_t>& get_triangles() const { return order_; }

 private:
  std::int32_t name_corner(std::int32_t vertex, const Gate* gate) {
    std::int32_t& number = number_[vertex];
    Corner corner = Corner::kOther;
    if (number < 0) {
      add_vertex(vertex, gate);
      corner = Corner::kNew;
    } else if (gate != nullptr && border_.find_right(*gate) == number) {
      corner = Corner::kRight;
    } else if (gate != nullptr && border_.find_left(*gate) == number) {
      corner = Corner::kLeft;
    } else {
      streams_.others.push_back(static_cast<std::uint32_t>(vertices_.size() - 1) - static_cast<std::uint32_t>(number));
    }
    streams_.corners.push_back(static_cast<std::uint8_t>(corner));
    return number;
  }

  void add_vertex(std::int32_t vertex, const Gate* gate) {
    const auto at = [&](std::int32_t number) -> const Place& { return places_[vertices_[number]]; };
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t predicted = gate != nullptr     ? at(gate->from)[k] + at(gate->to)[k] - at(gate->opposite)[k]
                                     : vertices_.empty() ? 0
                                                         : places_[vertices_.back()][k];
      streams_.places[k].push_back(fold(places_[vertex][k] - predicted));
    }
    number_[vertex] = static_cast<std::int32_t>(vertices_.size());
    vertices_.push_back(vertex);
  }

  const std::vector<Place>& places_;
  const std::vector<Triangle>& triangles_;
  EdgeTable edges_;
  std::vector<std::int32_t> number_;            // index of each vertex in traversal order
  std::vector<std::int32_t> vertices_, order_;  // visited vertices and triangles
  Border border_;
  Streams streams_;
};

}  // namespace

std::vector<std::uint8_t> write_order(const TriangleOrder& order) {
  Writer writer;
  std::vector<std::uint32_t> steps;
  std::int32_t last = 0;
  for (const std::int32_t t : order.before) {
    steps.push_back(fold(t - last));
    last = t;
  }
  writer.put_numbers(steps);
  writer.put_block(order.first);
  return writer.get_bytes();
}

WrittenSurface write_surface(const Vec3& origin_m, double step_m, const std::vector<Place>& places, const std::vector<Triangle>& triangles,
                             const std::vector<std::uint8_t>& level) {
  Traversal traversal(places, triangles);
  const Streams streams = traversal.run();
  Writer writer;
  const std::size_t levels = level.empty() ? 1 : static_cast<std::size_t>(*std::max_element(level.begin(), level.end())) + 1;
  writer.put(std::uint8_t{1});
  writer.put(static_cast<std::uint8_t>(levels));
  writer.put(static_cast<std::uint32_t>(places.size()));
  writer.put(static_cast<std::uint32_t>(triangles.size()));
  writer.put(streams.seeds);
  for (const double x : origin_m) writer.put(x);
  writer.put(step_m);
  std::vector<std::uint8_t> fours((streams.corners.size() + 3) / 4, 0);
  for (std::size_t i = 0; i < streams.corners.size(); ++i)
    fours[i / 4] = static_cast<std::uint8_t>(fours[i / 4] | (streams.corners[i] << (2 * (i % 4))));
  writer.put_block(fours);
  writer.put(static_cast<std::uint32_t>(streams.others.size()));
  writer.put_numbers(streams.others);
  std::vector<std::uint32_t> folded;
  for (const auto& axis : streams.places) folded.insert(folded.end(), axis.begin(), axis.end());
  writer.put_numbers(folded);

  WrittenSurface written{{}, traversal.get_vertices(), traversal.get_triangles()};
  std::vector<std::uint8_t> levels_of;
  std::vector<Place> places_of;
  for (const std::int32_t v : written.vertices) {
    levels_of.push_back(level[v]);
    places_of.push_back(places[v]);
  }
  writer.put_block(levels_of);
  const std::vector<std::int32_t> seen = written.vertices;
  const std::vector<std::int32_t> order = find_order(places_of, levels_of);
  for (std::size_t v = 0; v < order.size(); ++v) written.vertices[v] = seen[order[v]];
  written.bytes = writer.get_bytes();
  return written;
}

}  // namespace carillon::packed
