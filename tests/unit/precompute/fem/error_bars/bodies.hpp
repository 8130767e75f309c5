// Bodies with known frequencies (data/known_frequencies.csv), in several meshes, and the quality of their error bars.
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

/// Role of a body in the choice of the estimate's formulas.
enum class Role {
  training,  // safety factors were fitted to it
  test,      // known while the factors were chosen
  unseen     // added after all formulas were fixed
};
std::string describe(Role role);

struct Body {
  std::string name;
  std::vector<material::Material> materials;  // by region of the mesh
  bool round = false;                         // has curved faces
  Role role = Role::test;
  std::vector<int> fineness;  // meshes from coarse to fine, as arguments of make_mesh
  bool locks = false;         // T4 lock on it
  bool fixed = false;         // at its face of lowest x
};

const std::vector<Body>& get_bodies();
const Body& get_body(const std::string& name);

/// The mesh `fineness` of a body, with regions as indices of its materials, and the fixed nodes.
mesh::TetMesh make_mesh(const Body& body, int fineness, MeshKind kind, std::vector<std::int32_t>& fixed);

/// Computed modes against the truth.
struct Outcome {
  std::vector<double> freq_hz;               // (m) of the mesh, all computed
  std::vector<std::size_t> by_correction;    // (m) modes by ascending corrected frequency
  std::vector<double> true_hz, truth_cents;  // known ones; truth_cents: uncertainty of the reference
  error_bars::ErrorBars bars;
  std::int64_t unknowns = 0;
  double solve_cpu_s = 0.0, estimate_cpu_s = 0.0;  // of this rank

  double error_cents(std::size_t m) const;
  /// Of the m-th lowest corrected frequency.
  double corrected_error_cents(std::size_t m) const;
  double corrected_bar_cents(std::size_t m) const;
  bool corrected_contains(std::size_t m) const { return std::abs(corrected_error_cents(m)) <= corrected_bar_cents(m) + truth_cents[m]; }
  /// Median error of all modes with a reference: of the mesh's and of the corrected frequencies.
  double median_error_cents() const;
  double median_corrected_error_cents() const;
  double bar_cents(std::size_t m) const { return bars.algebraic_cents[m] + bars.discretisation_cents[m]; }
  bool contains(std::size_t m) const { return std::abs(error_cents(m)) <= bar_cents(m) + truth_cents[m]; }
  /// Fraction of modes whose bar contains the truth.
  double coverage() const;
  /// Median of bar / error over modes whose error exceeds the reference's uncertainty (1 if none).
  double median_width() const;
};

/// Solves for the known modes of the body and calculates the error bars. Collective.
Outcome solve(MPI_Comm comm, const Body& body, int fineness, MeshKind kind, double tolerance = 1e-8);

/// The same on a given mesh of the body, in its position and in metres. Collective.
Outcome solve(MPI_Comm comm, const Body& body, const mesh::TetMesh& mesh, MeshKind kind, double tolerance = 1e-8);

/// The same for any mesh without a reference, up to `high_hz`. Collective.
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
