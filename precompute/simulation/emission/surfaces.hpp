// Sounding triangles of this rank, and their global indices. Internal to carillon::emission.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/simulation/emission/emission.hpp"
#include "precompute/simulation/emission/rows.hpp"
#include "precompute/simulation/emission/surface_file.hpp"

namespace carillon::emission {

/// Vertices are the triangles' nodes. A vertex position or velocity is three rows; a triangle is a slot.
struct Surfaces {
  /// Slots of one body, aligned to kLane.
  struct Run {
    std::size_t begin, middle, end;  // twins from the middle on
    std::int32_t body;
  };

  /// Throws InputError on all ranks. Collective.
  Surfaces(const comm::Communicator& communicator, const SurfacePart& part);

  std::size_t get_rows() const { return (node.size() + kVertices - 1) / kVertices * kLane; }
  std::size_t get_slots() const { return place.size(); }
  /// Positions of the vertices of all ranks [m], from rows. Collective.
  std::vector<Vec3> gather_vertices(const double* x) const;

  comm::Communicator comm;
  std::vector<std::int32_t> node;   // (V) caller's nodes
  std::vector<std::int32_t> row;    // (V)
  Rows rest;                        // m
  std::vector<Triangle> corners;    // (slots): vertex rows; 0 in padding
  std::vector<std::int64_t> place;  // (slots) index among the triangles of all ranks by number; -1: padding
  std::vector<double> area;         // (slots) at rest, m2
  std::vector<std::int32_t> twin;   // (slots) the first side of the same triangle; -1: none
  std::vector<bool> has_twin;       // (slots)
  std::vector<Run> runs;
  std::vector<std::int64_t> gathered_places;    // of the sent triangles, concatenated by rank
  std::vector<std::int64_t> gathered_vertices;  // of the vertices
  std::size_t vertex_total = 0, triangle_total = 0;
  SurfaceTables tables;  // of all ranks

 private:
  /// Slots of this rank's triangles, by body. vertex_of: (nodes) index into `node`. numbers: of all triangles, ascending.
  void fill_slots(const SurfacePart& part, const std::vector<std::int32_t>& vertex_of, const std::vector<std::int64_t>& numbers);
  void add_slot(const Triangle& corner, std::int64_t at, std::int32_t of_twin);
  /// Pads to a multiple of kLane; returns the new number of slots.
  std::size_t pad();
};

inline Vec3 get_vertex(const double* rows, std::int32_t row) { return {rows[row], rows[row + 1], rows[row + 2]}; }

}  // namespace carillon::emission
