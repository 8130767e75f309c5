// The arithmetic of the estimate, for a block of modes at once: strains, patches, errors. Inner header of estimate.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::error_bars {

inline constexpr int kLanes = 16;  // modes of a block
using Lanes = float __attribute__((vector_size(4 * kLanes)));
// The alignment of a bare vector depends on the instruction set, and memory goes from one to another: hence structs.
struct alignas(64) FloatLanes {
  Lanes lane;
};
/// Doubles of a block.
struct alignas(64) DoubleLanes {
  double lane[kLanes];
};

/// The scaled strain q of a point: six numbers with q . q = strain^T C strain, twice the density of the elastic energy.
struct alignas(64) Strain {
  Lanes part[6];
  Lanes& operator[](int r) { return part[r]; }
  const Lanes& operator[](int r) const { return part[r]; }
};

/// What is known of the elements before any mode. n = 4 or 10 nodes; s = 1 or 4 points where an element's strain is taken; t = 1 or 10
/// terms of a patch's polynomial that are kept.
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
  std::vector<float> weight;                // (e, 4, s, t) what a sample adds to the terms of the patches
  std::vector<float> volume;                // (e) [m^3]
  std::vector<float> singular;              // (e) 1: touches an edge where stresses have no limit (Surface::is_singular), 0: does not
  std::vector<float> bent;                  // (e) how far it bends with the surface (Surface::bend), squared
  std::vector<std::array<float, 36>> root;  // (materials) U with U^T U = C, row-major, upper triangular
  std::vector<float> dilatation;  // (materials) what counts of a T10's dilatation beyond its mean; 1, less when nearly incompressible
  std::vector<float> density;     // (materials) [kg/m^3]
};

/// A mid-side node: the mean of what the patches at both ends of its edge say there.
struct Middle {
  std::int32_t node = 0;
  std::array<std::int32_t, 2> patch{};
  std::array<std::array<float, 10>, 2> monomials{};
};

/// Where the surface of the mesh should move: an edge of a face, see SurfaceEdge.
struct Shift {
  std::array<std::int32_t, 2> value{};  // recovered strains whose mean is taken
  std::array<std::int32_t, 2> node{};   // displacements whose mean is taken
  float volume_m3 = 0.0F;               // gap times area
  float density = 0.0F;                 // 0 where fixed
};

/// A node of the free surface, where no traction acts.
struct Traction {
  std::int32_t value = 0;        // the recovered strain there
  std::array<float, 18> part{};  // (3, 6): of a scaled strain what makes traction, times the root of the node's volume [m^1.5]
};

/// The loops for one kind of element and one instruction set. displacement: (nodes, 3), of T4 FloatLanes, of T10 DoubleLanes (their error
/// energies are smaller than what the differences of single precision leave).
struct ElementKernels {
  /// q of every sample, added into the patches' terms; if `lumped`, adds phi^T (M_lumped - M_consistent) phi to `difference`.
  /// strains: (e, s), of T10 only; patches: (patches, t).
  void (*add_strains)(const Elements& elements, bool lumped, const void* displacement, Strain* strains, Strain* patches,
                      DoubleLanes& difference);
  /// Recovered strains at mid-side nodes from patches with ten terms. values: (nodes * materials).
  void (*find_middles)(const std::vector<Middle>& middles, int materials, const Strain* patches, Strain* values);
  /// Adds per element the energies of recovered minus computed strain, of all elements, of the singular ones and times `bent`, and that of
  /// the computed strain. T4 compute their strains again: that costs less than to read what add_strains would have to write.
  void (*add_energies)(const Elements& elements, const std::int32_t* value_of, const Strain* values, const void* displacement,
                       const Strain* strains, DoubleLanes& error, DoubleLanes& singular, DoubleLanes& bent, DoubleLanes& energy);
  /// Adds gap times (2 W - lambda rho |u|^2), and the sum of its magnitudes.
  void (*add_shifts)(const std::vector<Shift>& shifts, const Strain* values, const void* displacement, const DoubleLanes& lambda,
                     DoubleLanes& change, DoubleLanes& magnitude);
  /// Adds the energy that the recovered strains spend on tractions.
  void (*add_tractions)(const std::vector<Traction>& tractions, const Strain* values, DoubleLanes& error);
  const char* name;
};

/// The tables that this processor can run, the fastest first. nodes: 4 or 10.
std::vector<const ElementKernels*> list_kernels(int nodes);

}  // namespace carillon::error_bars
