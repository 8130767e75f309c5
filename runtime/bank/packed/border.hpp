// Border of a surface that grows by one triangle at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "runtime/base/triangle.hpp"

namespace carillon::packed {

/// Edge with one side open. The closing triangle has it reversed.
struct Gate {
  std::int32_t from = 0, to = 0;
  std::int32_t opposite = 0;  // third corner of the edge's triangle
  bool is_open = true;
  std::int32_t next_out = -1, next_in = -1;  // other open gates leaving `from`, entering `to`
};

/// Encoding of the third corner of the next triangle.
enum class Corner : std::uint8_t {
  kNew = 0,    // next new vertex
  kRight = 1,  // next along the border
  kLeft = 2,   // previous along the border
  kOther = 3,  // by its index
};

/// Open gates in opening order: the surface grows at the oldest one (breadth first, which keeps the border short). Invariant: the lists of
/// a vertex hold exactly the open gates leaving and entering it.
class Border {
 public:
  /// Oldest open gate; nullptr if none. Valid until the next add().
  const Gate* find_gate() {
    while (first_ < gates_.size() && !gates_[first_].is_open) ++first_;
    return first_ < gates_.size() ? &gates_[first_] : nullptr;
  }
  /// Vertex of kRight or kLeft at a gate; -1 if none.
  std::int32_t find_right(const Gate& gate) const { return is_known(gate.to) && out_[gate.to] >= 0 ? gates_[out_[gate.to]].to : -1; }
  std::int32_t find_left(const Gate& gate) const { return is_known(gate.from) && in_[gate.from] >= 0 ? gates_[in_[gate.from]].from : -1; }

  /// List nodes visited so far: a few per triangle, unless very many gates are open at one vertex.
  std::size_t count_passed() const { return passed_; }

  /// Closes the gates that its edges match and opens the others. Corners are at least 0.
  void add(const Triangle& corners) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int32_t from = corners[k], to = corners[(k + 1) % 3];
      const std::int32_t met = find_open(to, from);
      if (met >= 0)
        close(met);
      else
        open(from, to, corners[(k + 2) % 3]);
    }
  }

 private:
  bool is_known(std::int32_t vertex) const { return vertex < std::ssize(out_); }

  std::int32_t find_open(std::int32_t from, std::int32_t to) {
    if (!is_known(from)) return -1;
    std::int32_t gate = out_[from];
    for (; gate >= 0 && gates_[gate].to != to; ++passed_) gate = gates_[gate].next_out;
    return gate;
  }

  void open(std::int32_t from, std::int32_t to, std::int32_t opposite) {
    const auto needed = static_cast<std::size_t>(std::max(from, to)) + 1;
    if (out_.size() < needed) {
      out_.resize(needed, -1);
      in_.resize(needed, -1);
    }
    const auto number = static_cast<std::int32_t>(gates_.size());
    gates_.push_back({from, to, opposite, true, out_[from], in_[to]});
    out_[from] = in_[to] = number;
  }

  void close(std::int32_t number) {
    Gate& gate = gates_[number];
    gate.is_open = false;
    unlink(&out_[gate.from], number, &Gate::next_out);
    unlink(&in_[gate.to], number, &Gate::next_in);
  }

  void unlink(std::int32_t* link, std::int32_t number, std::int32_t Gate::*next) {
    for (; *link != number; ++passed_) link = &(gates_[*link].*next);
    *link = gates_[number].*next;
  }

  std::vector<Gate> gates_;
  std::vector<std::int32_t> out_, in_;  // per vertex: last open gate leaving, entering; -1: none
  std::size_t first_ = 0, passed_ = 0;
};

}  // namespace carillon::packed
