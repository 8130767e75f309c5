// Method: four triangles in the lanes. Membrane: constant Green strain in plane stress. Bending: s = turn * 2 tan(theta / 2) +- psi of each
//   edge, M = B (s - s0 + alpha1 s'); each triangle handles its own side of a hinge, so no separate edge pass is needed.
// Source: docs/equations.md E11; Grinspun, Gingold, Reisman and Zorin 2006 (mid-edge normals), with 2 tan(theta / 2) for theta.
#include "precompute/simulation/transient/sheets.hpp"
#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::transient::HWY_NAMESPACE {
namespace {

typedef double Lanes __attribute__((vector_size(32)));

struct Lanes3 {
  Lanes x, y, z;
};

inline Lanes3 operator+(const Lanes3& a, const Lanes3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Lanes3 operator-(const Lanes3& a, const Lanes3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Lanes3 operator*(Lanes s, const Lanes3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Lanes dot(const Lanes3& a, const Lanes3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Lanes3 cross(const Lanes3& a, const Lanes3& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

inline Lanes load(const double* at) { return *reinterpret_cast<const Lanes*>(at); }
/// Unaligned.
inline Lanes load_loose(const double* at) {
  Lanes value;
  __builtin_memcpy(&value, at, sizeof value);
  return value;
}
inline void store_loose(double* at, Lanes value) { __builtin_memcpy(at, &value, sizeof value); }
inline Lanes calc_root(Lanes x) {
  Lanes root;
  for (int lane = 0; lane < 4; ++lane) root[lane] = __builtin_sqrt(x[lane]);
  return root;
}

/// Transposes 4 x 4.
inline void transpose(Lanes& a, Lanes& b, Lanes& c, Lanes& d) {
  const Lanes ab0 = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab1 = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Lanes cd0 = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd1 = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab0, cd0, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab0, cd0, 2, 3, 6, 7);
  d = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
}

inline Lanes3 gather(const Quad* q, const std::int32_t* at) {
  Lanes a = load(&q[at[0]].x), b = load(&q[at[1]].x), c = load(&q[at[2]].x), d = load(&q[at[3]].x);
  transpose(a, b, c, d);
  return {a, b, c};
}

inline Lanes gather_angle(const Quad* q, const std::int32_t* at) { return Lanes{q[at[0]].x, q[at[1]].x, q[at[2]].x, q[at[3]].x}; }

/// Work of the viscous stresses of this and (from `lag`) the previous step: StepWeights.
inline Lanes spend(const StepWeights& weights, double* lag, Lanes stress, Lanes rate) {
  const Lanes work = (weights.now_s * stress + weights.before_s * load_loose(lag)) * rate;
  store_loose(lag, stress);
  return work;
}

/// Membrane forces on the corners of a triangle; returns the damping power.
template <bool kIsDamped>
inline Lanes add_membrane(const Sheets::Block& block, const StepWeights& weights, const Lanes3* at, const Lanes3* speed, double* lag,
                          Lanes3* force) {
  const Lanes per_p = load(block.constant[0]), skew = load(block.constant[1]), per_r = load(block.constant[2]);
  const Lanes lambda = load(block.constant[3]), twice_mu = load(block.constant[4]), alpha1 = load(block.constant[17]);
  Lanes lost{};
  const Lanes3 d1 = at[1] - at[0], d2 = at[2] - at[0];
  const Lanes3 f1 = per_p * d1, f2 = skew * d1 + per_r * d2;
  Lanes e11 = 0.5 * (dot(f1, f1) - 1.0), e22 = 0.5 * (dot(f2, f2) - 1.0), e12 = 0.5 * dot(f1, f2);
  if constexpr (kIsDamped) {
    const Lanes3 r1 = speed[1] - speed[0], r2 = speed[2] - speed[0];
    const Lanes3 g1 = per_p * r1, g2 = skew * r1 + per_r * r2;
    const Lanes q11 = dot(f1, g1), q22 = dot(f2, g2), q12 = 0.5 * (dot(f1, g2) + dot(f2, g1));
    const Lanes trace = alpha1 * lambda * (q11 + q22), part = alpha1 * twice_mu;
    lost = spend(weights, lag, trace + part * q11, q11) + spend(weights, lag + 4, trace + part * q22, q22) +
           spend(weights, lag + 8, 2.0 * part * q12, q12);
    e11 += alpha1 * q11;
    e22 += alpha1 * q22;
    e12 += alpha1 * q12;
  }
  const Lanes pressure = lambda * (e11 + e22);
  const Lanes s11 = pressure + twice_mu * e11, s22 = pressure + twice_mu * e22, s12 = twice_mu * e12;
  const Lanes3 p1 = s11 * f1 + s12 * f2, p2 = s12 * f1 + s22 * f2;
  const Lanes3 on1 = per_p * p1 + skew * p2, on2 = per_r * p2;
  force[0] = on1 + on2;
  force[1] = Lanes{} * on1 - on1;
  force[2] = Lanes{} * on2 - on2;
  return lost;
}

/// Adds to the nodes, lane by lane: a node's sum over triangles is in ascending order.
inline void scatter(const Sheets::Block& block, const Lanes3* force, const Lanes* on_edge, Quad* f) {
  Lanes rows[6][4];
  for (int k = 0; k < 6; ++k) {
    rows[k][0] = force[k].x;
    rows[k][1] = force[k].y;
    rows[k][2] = force[k].z;
    rows[k][3] = Lanes{};
    transpose(rows[k][0], rows[k][1], rows[k][2], rows[k][3]);
  }
  for (int lane = 0; lane < 4; ++lane) {
    for (int k = 0; k < 6; ++k) *reinterpret_cast<Lanes*>(&f[block.write[k][lane]].x) += rows[k][lane];
    for (int i = 0; i < 3; ++i) f[block.write[6 + i][lane]].x += on_edge[i][lane];
  }
}

/// Forces of a triangle and its three neighbours.
template <bool kIsDamped>
inline void add_block(const Sheets::Block& block, const StepWeights& weights, const Quad* x, const Quad* v, Quad* f, double* lag,
                      double* spent) {
  const auto constant = [&](int k) HWY_ATTR { return load(block.constant[k]); };
  Lanes3 at[6], speed[6], force[6];
  for (int k = 0; k < 6; ++k) at[k] = gather(x, block.read[k]);
  if constexpr (kIsDamped)
    for (int k = 0; k < 6; ++k) speed[k] = gather(v, block.read[k]);
  const Lanes alpha1 = constant(17);
  Lanes lost = add_membrane<kIsDamped>(block, weights, at, speed, lag, force);
  const Lanes3 own = cross(at[1] - at[0], at[2] - at[0]);
  const Lanes own2 = dot(own, own), own_size = calc_root(own2);
  Lanes angle[3], rate[3], slope[3];
  Lanes3 to_c[3], to_d[3], to_a[3], to_b[3];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const Lanes3 &a = at[j], &b = at[k], &c = at[i], &d = at[3 + i];
    const Lanes3 along = b - a, other = cross(b - d, a - d);
    const Lanes length2 = dot(along, along), length = calc_root(length2), per_length = 1.0 / length;
    const Lanes other2 = dot(other, other), other_size = calc_root(other2);
    const Lanes turn = constant(11 + i);
    // Without a neighbour d is c (folded back): any finite angle, with share 0.
    const Lanes alone = turn == 0.0 ? own2 : Lanes{};
    const Lanes tangent = -length * dot(c - a, other) / (own_size * other_size + dot(own, other) + alone);
    slope[i] = turn * (1.0 + tangent * tangent);
    // Gradients of the dihedral angle.
    const Lanes3 n1 = (1.0 / own2) * own, n2 = (1.0 / other2) * other;
    const Lanes cb = dot(c - b, along) * per_length, db = dot(d - b, along) * per_length;
    const Lanes ca = dot(c - a, along) * per_length, da = dot(d - a, along) * per_length;
    to_c[i] = -length * n1;
    to_d[i] = -length * n2;
    to_a[i] = -cb * n1 - db * n2;
    to_b[i] = ca * n1 + da * n2;
    const Lanes side = constant(14 + i);
    angle[i] = turn * 2.0 * tangent + side * gather_angle(x, block.read[6 + i]) - load(block.rest[i]);
    if constexpr (kIsDamped)
      rate[i] = slope[i] * (dot(to_c[i], speed[i]) + dot(to_d[i], speed[3 + i]) + dot(to_a[i], speed[j]) + dot(to_b[i], speed[k])) +
                side * gather_angle(v, block.read[6 + i]);
  }
  const Lanes b00 = constant(5), b11 = constant(6), b22 = constant(7), b01 = constant(8), b02 = constant(9), b12 = constant(10);
  if constexpr (kIsDamped) {
    lost += spend(weights, lag + 12, alpha1 * (b00 * rate[0] + b01 * rate[1] + b02 * rate[2]), rate[0]) +
            spend(weights, lag + 16, alpha1 * (b01 * rate[0] + b11 * rate[1] + b12 * rate[2]), rate[1]) +
            spend(weights, lag + 20, alpha1 * (b02 * rate[0] + b12 * rate[1] + b22 * rate[2]), rate[2]);
    for (int i = 0; i < 3; ++i) angle[i] += alpha1 * rate[i];
  }
  const Lanes moment[3] = {b00 * angle[0] + b01 * angle[1] + b02 * angle[2], b01 * angle[0] + b11 * angle[1] + b12 * angle[2],
                           b02 * angle[0] + b12 * angle[1] + b22 * angle[2]};
  Lanes on_edge[3];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const Lanes share = -moment[i] * slope[i];
    force[i] = force[i] + share * to_c[i];
    force[3 + i] = share * to_d[i];
    force[j] = force[j] + share * to_a[i];
    force[k] = force[k] + share * to_b[i];
    on_edge[i] = -moment[i] * constant(14 + i);
  }
  if constexpr (kIsDamped) store_loose(spent, load_loose(spent) + lost);
  scatter(block, force, on_edge, f);
}

inline void add_blocks(const Sheets::Block* blocks, std::size_t count, bool is_damped, const StepWeights& weights, const Quad* x,
                       const Quad* v, Quad* f, double* lag, double* spent) {
  for (std::size_t b = 0; b < count; ++b) {
    if (is_damped)
      add_block<true>(blocks[b], weights, x, v, f, lag + 24 * b, spent + 4 * b);
    else
      add_block<false>(blocks[b], weights, x, v, f, nullptr, nullptr);
  }
}

}  // namespace
}  // namespace carillon::transient::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::transient {

HWY_EXPORT(add_blocks);

void add_sheet_forces(const Sheets::Block* blocks, std::size_t count, bool is_damped, const StepWeights& weights, const Quad* x,
                      const Quad* v, Quad* f, double* lag, double* spent) {
  base::choose(HWY_DISPATCH_TABLE(add_blocks))(blocks, count, is_damped, weights, x, v, f, lag, spent);
}

}  // namespace carillon::transient
#endif
