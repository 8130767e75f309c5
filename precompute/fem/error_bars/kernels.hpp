// Kernels of the error estimate for a block of modes: strains, patches, errors. Private header.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::error_bars {

inline constexpr int kLanes = 16;  // modes per block
using Lanes = float __attribute__((vector_size(4 * kLanes)));
// Structs, because the alignment of a bare vector depends on the instruction set and memory is shared between instruction sets.
struct alignas(64) FloatLanes {
  Lanes lane;
};
/// Doubles of one block of modes.
struct alignas(64) DoubleLanes {
  double lane[kLanes];
};

/// Scaled strain q of a point: q . q = strain^T C strain, twice the density of the elastic energy.
struct alignas(64) Strain {
  Lanes part[6];
  Lanes& operator[](int r) { return part[r]; }
  const Lanes& operator[](int r) const { return part[r]; }
};

/// Mode-independent element data. n = 4 or 10 nodes; s = 1 or 4 strain samples per element; t = 1 or 10 stored terms of a patch polynomial.
struct Elements {
  int nodes = 4;
  int samples = 1;
  int terms = 1;
  int materials = 1;
  std::size_t count = 0;
  std::vector<std::int32_t> node;           // (e, n) local nodes
  std::vector<std::int32_t> patch;          // (e, 4) patches of its corners
  std::vector<std::int32_t> material;       // (e)
  std::vector<float> gradient;              // (e, s, n - 1, 3) of the shape functions 1 ... n - 1 [1/m]
  std::vector<float> weight;                // (e, 4, s, t) contribution of a sample to the terms of the patches
  std::vector<float> volume;                // (e) [m^3]
  std::vector<float> singular;              // (e) 1: touches an edge with singular stress (Surface::singular), 0: does not
  std::vector<float> share;                 // (e) of the energy of recovered minus computed strain that is error; T10
  std::vector<float> bent;                  // (e) curvature rise over the element (Surface::bend), squared
  std::vector<std::array<float, 36>> root;  // (materials) U with U^T U = C, row-major, upper triangular
  std::vector<float> dilatation;            // (materials) factor of a T10's dilatation beyond its mean; 1, less when nearly incompressible
  std::vector<float> density;               // (materials) [kg/m^3]
};

/// Mid-side node: mean of the patches at both ends of its edge.
struct Middle {
  std::int32_t node = 0;
  std::array<std::int32_t, 2> patch{};
  std::array<std::array<float, 10>, 2> monomials{};
};

/// Surface shift at an edge of a face, see SurfaceEdge.
struct Shift {
  std::array<std::int32_t, 2> value{};  // recovered strains to average
  std::array<std::int32_t, 2> node{};   // displacements to average
  float volume_m3 = 0.0F;               // gap times area
  float density = 0.0F;                 // 0 if fixed
};

/// Node of the traction-free surface.
struct Traction {
  std::int32_t value = 0;        // recovered strain
  std::array<float, 18> part{};  // (3, 6): traction part of a scaled strain, times the root of the node's volume [m^1.5]
};

/// Kernels for one kind of element and one instruction set. displacement: (nodes, 3), FloatLanes for T4, DoubleLanes for T10 (whose error
/// energies are below single-precision differences).
struct ElementKernels {
  /// q of every sample, accumulated into the patch terms; if `lumped`, adds phi^T (M_lumped - M_consistent) phi to `difference`. strains:
  /// (e, s), T10 only; patches: (patches, t).
  void (*add_strains)(const Elements& elements, bool lumped, const void* displacement, Strain* strains, Strain* patches,
                      DoubleLanes& difference);
  /// Recovered strains at mid-side nodes from patches with ten terms. values: (nodes * materials).
  void (*find_middles)(const std::vector<Middle>& middles, int materials, const Strain* patches, Strain* values);
  /// Adds per element the energies of recovered minus computed strain (of all elements, of singular ones, and times `bent`) and of the
  /// computed strain. T4 strains are recomputed: cheaper than reading stored ones.
  void (*add_energies)(const Elements& elements, const std::int32_t* value_of, const Strain* values, const void* displacement,
                       const Strain* strains, DoubleLanes& error, DoubleLanes& singular, DoubleLanes& bent, DoubleLanes& energy);
  /// Adds gap times (2 W - lambda rho |u|^2), and the sum of magnitudes.
  void (*add_shifts)(const std::vector<Shift>& shifts, const Strain* values, const void* displacement, const DoubleLanes& lambda,
                     DoubleLanes& change, DoubleLanes& magnitude);
  /// Adds the energy of the recovered tractions.
  void (*add_tractions)(const std::vector<Traction>& tractions, const Strain* values, DoubleLanes& error);
};

/// nodes: 4 or 10.
const ElementKernels& find_kernels(int nodes);

}  // namespace carillon::error_bars
