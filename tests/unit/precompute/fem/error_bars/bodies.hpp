// Bodies whose frequencies are known from elsewhere (data/known_frequencies.csv), meshed in several ways, and how their error bars do.
#pragma once

#include <mpi.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "precompute/fem/error_bars/error_bars.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/material/material.hpp"

namespace carillon::tests {

struct Truth {
  double freq_hz = 0.0;
  double uncertainty = 0.0;  // relative
};

/// All known modes of a body, ascending.
std::vector<Truth> read_truth(const std::string& body);

enum class MeshKind { T4, T4Lumped, T10, T10Curved, T10Lumped };
std::string describe(MeshKind kind);

/// What a body was used for when the formulas of the estimate were chosen.
enum class Role {
  training,  // the safety factors were chosen on it
  test,      // in view then
  unseen     // came when all formulas were fixed
};
std::string describe(Role role);

struct Body {
  std::string name;
  std::vector<material::Material> materials;  // by region of the mesh
  bool round = false;                         // has curved faces
  Role role = Role::test;
  std::vector<int> fineness;  // meshes from coarse to fine, in numbers that make_mesh knows
  bool locks = false;         // T4 are not for it
  bool fixed = false;         // at its face of lowest x
};

const std::vector<Body>& get_bodies();
const Body& get_body(const std::string& name);

/// The mesh number `fineness` of a body, its regions the places of its materials, and the fixed nodes.
mesh::TetMesh make_mesh(const Body& body, int fineness, MeshKind kind, std::vector<std::int32_t>& fixed);

/// Computed modes against the truth.
struct Outcome {
  std::vector<double> freq_hz;               // (m) of the mesh, all that were computed
  std::vector<std::size_t> by_correction;    // (m) modes by ascending corrected frequency
  std::vector<double> true_hz, truth_cents;  // those known; truth_cents: the uncertainty of the truth
  error_bars::ErrorBars bars;
  std::int64_t unknowns = 0;
  double solve_cpu_s = 0.0, estimate_cpu_s = 0.0;  // of this rank

  double error_cents(std::size_t m) const;
  /// Of the m-th lowest corrected frequency.
  double corrected_error_cents(std::size_t m) const;
  double corrected_bar_cents(std::size_t m) const;
  bool corrected_contains(std::size_t m) const { return std::abs(corrected_error_cents(m)) <= corrected_bar_cents(m) + truth_cents[m]; }
  /// Median of the errors of all modes with a truth: of the mesh's, of the corrected frequencies.
  double median_error_cents() const;
  double median_corrected_error_cents() const;
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
Outcome solve(MPI_Comm comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed,
              std::span<const material::Material> materials, bool lumped, double low_hz, double high_hz, int max_modes,
              double tolerance = 1e-8);

/// One body of the list on one mesh.
struct Case {
  const char* body;
  int fineness;
  MeshKind kind;
};
inline void PrintTo(const Case& c, std::ostream* out) { *out << c.body << " " << c.fineness << " " << describe(c.kind); }

}  // namespace carillon::tests
