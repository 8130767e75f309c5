// Inner loops of solids: forces, energies and smallest det F of blocks of elements, one element per lane, and the step of nodes. Compiled
// once per instruction set. Internal header of carillon::transient.
#pragma once

#include <cstdint>

#include "precompute/simulation/transient/quad.hpp"

namespace carillon::transient {

inline constexpr int kStresses = 6;  // xx yy zz yz xz xy

/// Four-point rule: a node's barycentric coordinate at its own point, and at the others.
inline constexpr double kNear = 0.5854101966249685, kFar = 0.1381966011250105;
inline constexpr double kPointScale = 4.0 * (kNear - kFar);  // scale of the stored gradients of T10
inline constexpr double kCornerShare = (4.0 * kFar - 1.0) / kPointScale;
inline constexpr double kEdgeShare = 4.0 * kFar / kPointScale;

/// Blocks of elements of one kind and one law; non-owning. `lanes` is Loops::lanes. Padding lanes of the last block repeat a real element
/// with weight 0 and write to an unread entry.
struct BlockRun {
  std::int64_t blocks = 0;
  // (blocks, 10 or 40, lanes): T4: rows of Dm^-1 [1/m] (gradients of L1, L2, L3), then the volume [m^3]. T10: kPointScale times these
  // gradients, then a quarter of the volume; curved T10: for each of the four points.
  const double* shape = nullptr;
  const std::int32_t* read = nullptr;   // (blocks, nodes, lanes) entries of u and v, times four
  const std::int32_t* write = nullptr;  // (blocks, nodes, lanes) entries of f, times four
  double* lag = nullptr;                // (blocks, points, kStresses, lanes) viscous stress of the previous step [Pa]; damped only
  double* spent = nullptr;              // (blocks, lanes) damping work [J]; damped only
  Law law;
};

/// Accumulation of the damping work: the viscous force at u_n is based on v_{n-1/2} and acts for `now_s` on the mean of v_{n-1/2} and
/// v_{n+1/2}; the second half is known one step later.
struct StepWeights {
  double now_s = 0.0;     // half the duration for which this step's forces act
  double before_s = 0.0;  // the same for the previous step
  double step_s = 0.0;    // u_n - u_{n-1} is this times v_{n-1/2}
};

/// f += element forces, in ascending lane order.
using AddForces = void (*)(const BlockRun& run, const StepWeights& weights, const Quad* u, const Quad* v, Quad* f);
/// energy, least (blocks, lanes): elastic energy [J] and smallest det F over the element's points.
using CalcState = void (*)(const BlockRun& run, const Quad* u, double* energy_j, double* least);

/// Arrays of own nodes for one step; non-owning.
struct NodeStep {
  std::int64_t nodes = 0;
  double act_s = 0.0;                   // duration of the forces
  double step_s = 0.0;                  // duration of the velocity
  const double* inverse_kg = nullptr;   // (nodes)
  const Quad* force = nullptr;          // [N]
  const Quad* external = nullptr;       // [N]; null: none
  Quad* work = nullptr;                 // [J] per axis, of `external`
  const double* braked_kg_s = nullptr;  // (nodes) mass damping times mass; null: none
  const Quad* carried = nullptr;        // [m/s] velocity exempt from mass damping
  Quad* brake_loss = nullptr;           // [J] per axis, mass damping work, part of `external`
  Quad* v = nullptr;
  Quad* u = nullptr;
};
using StepNodes = void (*)(const NodeStep& step);
/// u += step_s v, bit-identical to StepNodes: for halo nodes with velocities received from their owners.
using MoveNodes = void (*)(std::int64_t nodes, double step_s, const Quad* v, Quad* u);

struct Loops {
  int lanes = 0;
  AddForces t4 = nullptr, t4_damped = nullptr;
  AddForces t10 = nullptr, t10_damped = nullptr;
  AddForces curved = nullptr, curved_damped = nullptr;
  CalcState t4_state = nullptr, t10_state = nullptr, curved_state = nullptr;
  StepNodes step_nodes = nullptr;
  MoveNodes move_nodes = nullptr;
};

const Loops& find_loops();

}  // namespace carillon::transient
