// Bodies whose frequencies are known from elsewhere (data/known_frequencies.csv), meshed in several ways, and how their error bars do.
#pragma once

#include <mpi.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "precompute/estimate/error_bars.hpp"
#include "precompute/job/material.hpp"
#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::tests {

struct Truth {
  double freq_hz = 0.0;
  double uncertainty = 0.0;  // relative
};

/// All known modes of a body, ascending.
std::vector<Truth> read_truth(const std::string& body);

enum class MeshKind { T4, T4Lumped, T10, T10Curved, T10Lumped };
std::string describe(MeshKind kind);

struct Body {
  std::string name;
  std::vector<job::Material> materials;  // by region of the mesh
  bool round = false;                    // has curved faces
  bool training = false;                 // the safety factors were chosen on it
  std::vector<int> fineness;             // meshes from coarse to fine, in numbers that make_mesh knows
  bool locks = false;                    // T4 are not for it
  bool fixed = false;                    // at its face of lowest x
};

const std::vector<Body>& get_bodies();
const Body& get_body(const std::string& name);

/// The mesh number `fineness` of a body, its regions the places of its materials, and the fixed nodes.
mesh::TetMesh make_mesh(const Body& body, int fineness, MeshKind kind, std::vector<std::int32_t>& fixed);

/// Computed modes against the truth.
struct Outcome {
  std::vector<double> freq_hz, true_hz, truth_cents;  // truth_cents: the uncertainty of the truth
  estimate::ErrorBars bars;
  std::int64_t unknowns = 0;
  double solve_cpu_s = 0.0, estimate_cpu_s = 0.0;  // of this rank

  double error_cents(std::size_t m) const;
  double bar_cents(std::size_t m) const { return bars.algebraic_cents[m] + bars.discretisation_cents[m]; }
  bool contains(std::size_t m) const { return std::abs(error_cents(m)) <= bar_cents(m) + truth_cents[m]; }
  /// Parts of all modes whose bar contains the truth.
  double coverage() const;
  /// Median of bar / error, over the modes whose error the truth resolves (1 where it resolves none).
  double median_width() const;
};

/// Solves for the known modes of the body and calculates the error bars. Collective.
Outcome solve(MPI_Comm comm, const Body& body, int fineness, MeshKind kind, double tolerance = 1e-8);

/// The same on a given mesh of the body, in its place and in metres. Collective.
Outcome solve(MPI_Comm comm, const Body& body, const mesh::TetMesh& mesh, MeshKind kind, double tolerance = 1e-8);

/// The same for any mesh, without truth, up to `high_hz`. Collective.
Outcome solve(MPI_Comm comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed, std::span<const job::Material> materials,
              bool lumped, double low_hz, double high_hz, int max_modes, double tolerance = 1e-8);

/// One body of the list on one mesh.
struct Case {
  const char* body;
  int fineness;
  MeshKind kind;
};
inline void PrintTo(const Case& c, std::ostream* out) { *out << c.body << " " << c.fineness << " " << describe(c.kind); }

}  // namespace carillon::tests
