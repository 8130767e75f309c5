// Method: total Lagrangian, one element per lane. H = grad u; Green strain as 2 E = H + H^T + H^T H (no cancellation), rate 2 E' = G + G^T
//   + H^T G + G^T H with G = grad v. T10 at point q: with s_k = (4b - 1) u_k + 4b sum of the three u_kj, and w_k = u_q for k = q and u_kq
//   otherwise, the derivative with respect to L_k is s_k + 4 (a - b) w_k. The s part is the same at all points; w are the nodes of the
//   small tetrahedron at corner q. Forces by the transpose.
// Source: docs/equations.md E11. O'Brien, Cook and Essl 2001; Miller, Joldes, Lance and Wittek 2007 (total Lagrangian, explicit).
//
// Lanes are independent of each other.
#include "precompute/simulation/transient/kernel.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::transient::HWY_NAMESPACE {
namespace {

constexpr int kLanes = CARILLON_REGISTER_BYTES / sizeof(double);
typedef double V __attribute__((vector_size(8 * kLanes)));
typedef double Pair __attribute__((vector_size(16)));
typedef double Four __attribute__((vector_size(32)));

// clang's address sanitizer takes minutes to check one fully inlined function.
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define CARILLON_INLINE inline
#endif
#endif
#ifndef CARILLON_INLINE
#define CARILLON_INLINE inline __attribute__((always_inline))
#endif

CARILLON_INLINE V load(const double* at) { return *reinterpret_cast<const V*>(at); }
CARILLON_INLINE void store(double* at, V value) { *reinterpret_cast<V*>(at) = value; }
CARILLON_INLINE Pair load_pair(const double* at) { return *reinterpret_cast<const Pair*>(at); }

struct Three {
  V x, y, z;
};
CARILLON_INLINE Three operator-(const Three& a, const Three& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
CARILLON_INLINE Three operator+(const Three& a, const Three& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
CARILLON_INLINE Three operator*(double s, const Three& a) { return {s * a.x, s * a.y, s * a.z}; }

/// Interleaved pairs of lanes. T is V: a template, since shuffles of other widths do not compile.
template <int kWidth, typename T>
CARILLON_INLINE T load_pairs(const double* values, const std::int32_t* at) {
  if constexpr (kWidth == 2) {
    return load_pair(values + at[0]);
  } else {
    const Four first = __builtin_shufflevector(load_pair(values + at[0]), load_pair(values + at[2]), 0, 1, 2, 3);
    if constexpr (kWidth == 4) {
      return first;
    } else {
      const Four second = __builtin_shufflevector(load_pair(values + at[4]), load_pair(values + at[6]), 0, 1, 2, 3);
      return __builtin_shufflevector(first, second, 0, 1, 2, 3, 4, 5, 6, 7);
    }
  }
}
CARILLON_INLINE V load_pairs(const double* values, const std::int32_t* at) { return load_pairs<kLanes, V>(values, at); }

/// Interleaves the first, or (kSecond) the second, of each pair of a and b.
template <int kWidth, int kSecond, typename T>
CARILLON_INLINE T take(T a, T b) {
  constexpr int s = kSecond, w = kSecond + kWidth;
  if constexpr (kWidth == 2) {
    return __builtin_shufflevector(a, b, s, w);
  } else if constexpr (kWidth == 4) {
    return __builtin_shufflevector(a, b, s, w, s + 2, w + 2);
  } else {
    return __builtin_shufflevector(a, b, s, w, s + 2, w + 2, s + 4, w + 4, s + 6, w + 6);
  }
}
CARILLON_INLINE V take_first(V a, V b) { return take<kLanes, 0>(a, b); }
CARILLON_INLINE V take_second(V a, V b) { return take<kLanes, 1>(a, b); }

/// One node of every lane's element.
CARILLON_INLINE Three load_node(const Quad* values, const std::int32_t* at) {
  const double* first = reinterpret_cast<const double*>(values);
  const V even = load_pairs(first, at), odd = load_pairs(first, at + 1);
  return {take_first(even, odd), take_second(even, odd), take_first(load_pairs(first + 2, at), load_pairs(first + 2, at + 1))};
}

/// Forces of all lanes on one node, added later lane by lane, so that sums do not depend on block composition.
CARILLON_INLINE void keep_force(const Three& force, Four* kept, int stride) {
  const V even = take_first(force.x, force.y), odd = take_second(force.x, force.y), none{};
  const V even_z = take_first(force.z, none), odd_z = take_second(force.z, none);
#pragma GCC unroll 4
  for (int pair = 0; pair < kLanes / 2; ++pair) {
    kept[2 * pair * stride] = Four{even[2 * pair], even[2 * pair + 1], even_z[2 * pair], even_z[2 * pair + 1]};
    kept[(2 * pair + 1) * stride] = Four{odd[2 * pair], odd[2 * pair + 1], odd_z[2 * pair], odd_z[2 * pair + 1]};
  }
}

template <int kNodes>
CARILLON_INLINE void add_kept(const Four* kept, const std::int32_t* write, Quad* f) {
  double* first = reinterpret_cast<double*>(f);
#pragma GCC unroll 8
  for (int lane = 0; lane < kLanes; ++lane)
#pragma GCC unroll 10
    for (int node = 0; node < kNodes; ++node) {
      Four* at = reinterpret_cast<Four*>(first + write[node * kLanes + lane]);
      *at += kept[lane * kNodes + node];
    }
}

/// m += sum over k = 0..2 of d_k (x) gradient_k, by rows.
CARILLON_INLINE void add_gradient(const Three* d, const V* gradient, V* m) {
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k)
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j) {
      m[j] += d[k].x * gradient[3 * k + j];
      m[3 + j] += d[k].y * gradient[3 * k + j];
      m[6 + j] += d[k].z * gradient[3 * k + j];
    }
}

CARILLON_INLINE void calc_gradient(const Three* d, const V* gradient, V* m) {
#pragma GCC unroll 3
  for (int j = 0; j < 3; ++j) {
    m[j] = d[0].x * gradient[j] + d[1].x * gradient[3 + j] + d[2].x * gradient[6 + j];
    m[3 + j] = d[0].y * gradient[j] + d[1].y * gradient[3 + j] + d[2].y * gradient[6 + j];
    m[6 + j] = d[0].z * gradient[j] + d[1].z * gradient[3 + j] + d[2].z * gradient[6 + j];
  }
}

/// Column i of a times column j of b.
CARILLON_INLINE V multiply_columns(const V* a, int i, const V* b, int j) { return a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j]; }

/// 2 E.
CARILLON_INLINE void calc_strain(const V* h, V* twice) {
  twice[0] = 2.0 * h[0] + multiply_columns(h, 0, h, 0);
  twice[1] = 2.0 * h[4] + multiply_columns(h, 1, h, 1);
  twice[2] = 2.0 * h[8] + multiply_columns(h, 2, h, 2);
  twice[3] = (h[5] + h[7]) + multiply_columns(h, 1, h, 2);
  twice[4] = (h[2] + h[6]) + multiply_columns(h, 0, h, 2);
  twice[5] = (h[1] + h[3]) + multiply_columns(h, 0, h, 1);
}

/// bulk / 2 tr(C) I + shear C, for C = 2 E or 2 E'.
CARILLON_INLINE void calc_law(double bulk, double shear, const V* twice, V* s) {
  const V pressure = (0.5 * bulk) * (twice[0] + twice[1] + twice[2]);
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) s[i] = pressure + shear * twice[i];
#pragma GCC unroll 3
  for (int i = 3; i < 6; ++i) s[i] = shear * twice[i];
}

/// S : E for C = 2 E.
CARILLON_INLINE V contract(const V* s, const V* twice) {
  return 0.5 * (s[0] * twice[0] + s[1] * twice[1] + s[2] * twice[2]) + (s[3] * twice[3] + s[4] * twice[4] + s[5] * twice[5]);
}

/// One point: q = -weight (I + h) S, and the damping work.
template <bool kDamped>
CARILLON_INLINE void calc_point(const Law& law, const StepWeights& weights, V weight, const V* h, const V* g, double* lag, V& spent, V* q) {
  V twice[6], s[6];
  calc_strain(h, twice);
  calc_law(law.lambda_pa, law.mu_pa, twice, s);
  if constexpr (kDamped) {
    V rate[6], viscous[6], before[6], square[6];
    square[0] = multiply_columns(g, 0, g, 0);
    square[1] = multiply_columns(g, 1, g, 1);
    square[2] = multiply_columns(g, 2, g, 2);
    square[3] = multiply_columns(g, 1, g, 2);
    square[4] = multiply_columns(g, 0, g, 2);
    square[5] = multiply_columns(g, 0, g, 1);
    rate[0] = 2.0 * (g[0] + multiply_columns(h, 0, g, 0));
    rate[1] = 2.0 * (g[4] + multiply_columns(h, 1, g, 1));
    rate[2] = 2.0 * (g[8] + multiply_columns(h, 2, g, 2));
    rate[3] = (g[5] + g[7]) + multiply_columns(h, 1, g, 2) + multiply_columns(g, 1, h, 2);
    rate[4] = (g[2] + g[6]) + multiply_columns(h, 0, g, 2) + multiply_columns(g, 0, h, 2);
    rate[5] = (g[1] + g[3]) + multiply_columns(h, 0, g, 1) + multiply_columns(g, 0, h, 1);
    calc_law(law.phi_pa_s, law.psi_pa_s, rate, viscous);
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) {
      before[i] = load(lag + i * kLanes);
      store(lag + i * kLanes, viscous[i]);
      s[i] += viscous[i];
    }
    V loss = weights.now_s * contract(viscous, rate);
    // The previous step's force also acts on this velocity: through its F, which is this F less step G.
    const double twice_step = 2.0 * weights.step_s;
#pragma GCC unroll 6
    for (int i = 0; i < 6; ++i) rate[i] -= twice_step * square[i];
    loss += weights.before_s * contract(before, rate);
    spent += weight * loss;
  }
#pragma GCC unroll 6
  for (int i = 0; i < 6; ++i) s[i] *= -weight;
  constexpr int kColumn[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}};
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i)
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j)
      q[3 * i + j] = s[kColumn[i][j]] + (h[3 * i] * s[kColumn[0][j]] + h[3 * i + 1] * s[kColumn[1][j]] + h[3 * i + 2] * s[kColumn[2][j]]);
}

CARILLON_INLINE Three multiply(const V* q, const V* gradient) {
  return {q[0] * gradient[0] + q[1] * gradient[1] + q[2] * gradient[2], q[3] * gradient[0] + q[4] * gradient[1] + q[5] * gradient[2],
          q[6] * gradient[0] + q[7] * gradient[1] + q[8] * gradient[2]};
}

template <bool kDamped>
void add_t4(const BlockRun& run, const StepWeights& weights, const Quad* u, const Quad* v, Quad* f) {
  for (std::int64_t b = 0; b < run.blocks; ++b) {
    const double* shape = run.shape + b * 10 * kLanes;
    const std::int32_t* read = run.read + b * 4 * kLanes;
    V gradient[9];
#pragma GCC unroll 9
    for (int i = 0; i < 9; ++i) gradient[i] = load(shape + i * kLanes);
    V h[9], g[9] = {}, q[9], spent{};
    {
      const Three first = load_node(u, read);
      const Three d[3] = {load_node(u, read + kLanes) - first, load_node(u, read + 2 * kLanes) - first,
                          load_node(u, read + 3 * kLanes) - first};
      calc_gradient(d, gradient, h);
    }
    if constexpr (kDamped) {
      const Three first = load_node(v, read);
      const Three d[3] = {load_node(v, read + kLanes) - first, load_node(v, read + 2 * kLanes) - first,
                          load_node(v, read + 3 * kLanes) - first};
      calc_gradient(d, gradient, g);
      spent = load(run.spent + b * kLanes);
    }
    calc_point<kDamped>(run.law, weights, load(shape + 9 * kLanes), h, g, kDamped ? run.lag + b * kStresses * kLanes : nullptr, spent, q);
    if constexpr (kDamped) store(run.spent + b * kLanes, spent);
    const Three one = multiply(q, gradient), two = multiply(q, gradient + 3), three = multiply(q, gradient + 6);
    const Three none{};
    Four kept[4 * kLanes];
    keep_force(none - (one + two + three), kept, 4);
    keep_force(one, kept + 1, 4);
    keep_force(two, kept + 2, 4);
    keep_force(three, kept + 3, 4);
    add_kept<4>(kept, run.write + b * 4 * kLanes, f);
  }
}

/// Node between corners i and j; the corner itself if equal.
constexpr int kNode[4][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3}};

/// s_k - s_0 term, k = 1..3, over kPointScale.
CARILLON_INLINE void calc_common(const Three* node, Three* d) {
  Three s[4];
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k)
    s[k] = kCornerShare * node[k] + kEdgeShare * (node[kNode[k][(k + 1) % 4]] + node[kNode[k][(k + 2) % 4]] + node[kNode[k][(k + 3) % 4]]);
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k) d[k] = s[k + 1] - s[0];
}

template <int kPoint>
CARILLON_INLINE void calc_own(const Three* node, Three* d) {
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k) d[k] = node[kNode[k + 1][kPoint]] - node[kNode[0][kPoint]];
}

/// Nodes of an element, and the part of grad u or grad v common to all points: d for curved elements, the gradient itself for straight
/// ones.
struct Field {
  Three node[10], d[3];
  V m[9];
};

template <bool kCurved>
CARILLON_INLINE void load_field(const Quad* values, const std::int32_t* read, const V* gradient, Field& field) {
#pragma GCC unroll 10
  for (int a = 0; a < 10; ++a) field.node[a] = load_node(values, read + a * kLanes);
  calc_common(field.node, field.d);
  if constexpr (!kCurved) calc_gradient(field.d, gradient, field.m);
}

template <bool kCurved, int kPoint>
CARILLON_INLINE void calc_at_point(const Field& field, const V* gradient, V* m) {
  Three d[3];
  calc_own<kPoint>(field.node, d);
  if constexpr (kCurved) {
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) d[k] = d[k] + field.d[k];
    calc_gradient(d, gradient, m);
  } else {
#pragma GCC unroll 9
    for (int i = 0; i < 9; ++i) m[i] = field.m[i];
    add_gradient(d, gradient, m);
  }
}

CARILLON_INLINE void load_gradient(const double* shape, V* gradient) {
#pragma GCC unroll 9
  for (int i = 0; i < 9; ++i) gradient[i] = load(shape + i * kLanes);
}

/// Adds point kPoint to the sum over points and to the nodes of its small tetrahedron.
template <bool kDamped, bool kCurved, int kPoint>
CARILLON_INLINE void add_point(const BlockRun& run, const StepWeights& weights, const double* shape, const Field& u, const Field& v,
                               const V* common, double* lag, V& spent, V* sum, Three* total, Three* force) {
  V own[9];
  if constexpr (kCurved) load_gradient(shape + 10 * kPoint * kLanes, own);
  const V* gradient = kCurved ? own : common;
  V h[9], g[9] = {}, q[9];
  calc_at_point<kCurved, kPoint>(u, gradient, h);
  if constexpr (kDamped) calc_at_point<kCurved, kPoint>(v, gradient, g);
  const V weight = load(shape + (kCurved ? 10 * kPoint + 9 : 9) * kLanes);
  calc_point<kDamped>(run.law, weights, weight, h, g, kDamped ? lag + kPoint * kStresses * kLanes : nullptr, spent, q);
  Three t[4];
#pragma GCC unroll 3
  for (int k = 0; k < 3; ++k) t[k + 1] = multiply(q, gradient + 3 * k);
  const Three none{};
  t[0] = none - (t[1] + t[2] + t[3]);
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k) {
    force[kNode[k][kPoint]] = force[kNode[k][kPoint]] + t[k];
    if constexpr (kCurved) total[k] = total[k] + t[k];
  }
  if constexpr (!kCurved)
#pragma GCC unroll 9
    for (int i = 0; i < 9; ++i) sum[i] += q[i];
}

template <bool kDamped, bool kCurved>
void add_t10(const BlockRun& run, const StepWeights& weights, const Quad* u, const Quad* v, Quad* f) {
  constexpr int kShape = kCurved ? 40 : 10;
  for (std::int64_t b = 0; b < run.blocks; ++b) {
    const double* shape = run.shape + b * kShape * kLanes;
    const std::int32_t* read = run.read + b * 10 * kLanes;
    V gradient[9] = {};
    if constexpr (!kCurved) load_gradient(shape, gradient);
    Field displacement, velocity;
    load_field<kCurved>(u, read, gradient, displacement);
    V spent{};
    if constexpr (kDamped) {
      load_field<kCurved>(v, read, gradient, velocity);
      spent = load(run.spent + b * kLanes);
    }
    V sum[9] = {};
    Three total[4] = {}, force[10] = {};
    double* lag = kDamped ? run.lag + b * 4 * kStresses * kLanes : nullptr;
    add_point<kDamped, kCurved, 0>(run, weights, shape, displacement, velocity, gradient, lag, spent, sum, total, force);
    add_point<kDamped, kCurved, 1>(run, weights, shape, displacement, velocity, gradient, lag, spent, sum, total, force);
    add_point<kDamped, kCurved, 2>(run, weights, shape, displacement, velocity, gradient, lag, spent, sum, total, force);
    add_point<kDamped, kCurved, 3>(run, weights, shape, displacement, velocity, gradient, lag, spent, sum, total, force);
    if constexpr (kDamped) store(run.spent + b * kLanes, spent);
    if constexpr (!kCurved) {
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) total[k + 1] = multiply(sum, gradient + 3 * k);
      const Three none{};
      total[0] = none - (total[1] + total[2] + total[3]);
    }
    Four kept[10 * kLanes];
#pragma GCC unroll 4
    for (int i = 0; i < 4; ++i) {
      keep_force(force[i] + kCornerShare * total[i], kept + i, 10);
#pragma GCC unroll 3
      for (int j = i + 1; j < 4; ++j) keep_force(force[kNode[i][j]] + kEdgeShare * (total[i] + total[j]), kept + kNode[i][j], 10);
    }
    add_kept<10>(kept, run.write + b * 10 * kLanes, f);
  }
}

/// Adds weight times the energy density; det F.
CARILLON_INLINE void add_state(const Law& law, V weight, const V* h, V& energy, V& least) {
  V twice[6], s[6];
  calc_strain(h, twice);
  calc_law(law.lambda_pa, law.mu_pa, twice, s);
  energy += 0.5 * weight * contract(s, twice);
  const V a = 1.0 + h[0], e = 1.0 + h[4], i = 1.0 + h[8];
  const V det = a * (e * i - h[5] * h[7]) - h[1] * (h[3] * i - h[5] * h[6]) + h[2] * (h[3] * h[7] - e * h[6]);
  for (int lane = 0; lane < kLanes; ++lane)
    if (!(det[lane] >= least[lane])) least[lane] = det[lane];  // propagates NaN
}

inline void calc_t4_state(const BlockRun& run, const Quad* u, double* energy_j, double* least_out) {
  for (std::int64_t b = 0; b < run.blocks; ++b) {
    const double* shape = run.shape + b * 10 * kLanes;
    const std::int32_t* read = run.read + b * 4 * kLanes;
    V gradient[9], h[9], energy{}, least = 1e300 - V{};
    load_gradient(shape, gradient);
    const Three first = load_node(u, read);
    const Three d[3] = {load_node(u, read + kLanes) - first, load_node(u, read + 2 * kLanes) - first,
                        load_node(u, read + 3 * kLanes) - first};
    calc_gradient(d, gradient, h);
    add_state(run.law, load(shape + 9 * kLanes), h, energy, least);
    store(energy_j + b * kLanes, energy);
    store(least_out + b * kLanes, least);
  }
}

template <bool kCurved, int kPoint>
CARILLON_INLINE void add_point_state(const BlockRun& run, const double* shape, const Field& u, const V* common, V& energy, V& least) {
  V own[9], h[9];
  if constexpr (kCurved) load_gradient(shape + 10 * kPoint * kLanes, own);
  calc_at_point<kCurved, kPoint>(u, kCurved ? own : common, h);
  add_state(run.law, load(shape + (kCurved ? 10 * kPoint + 9 : 9) * kLanes), h, energy, least);
}

template <bool kCurved>
void calc_t10_state(const BlockRun& run, const Quad* u, double* energy_j, double* least_out) {
  for (std::int64_t b = 0; b < run.blocks; ++b) {
    const double* shape = run.shape + b * (kCurved ? 40 : 10) * kLanes;
    V gradient[9] = {}, energy{}, least = 1e300 - V{};
    if constexpr (!kCurved) load_gradient(shape, gradient);
    Field field;
    load_field<kCurved>(u, run.read + b * 10 * kLanes, gradient, field);
    add_point_state<kCurved, 0>(run, shape, field, gradient, energy, least);
    add_point_state<kCurved, 1>(run, shape, field, gradient, energy, least);
    add_point_state<kCurved, 2>(run, shape, field, gradient, energy, least);
    add_point_state<kCurved, 3>(run, shape, field, gradient, energy, least);
    store(energy_j + b * kLanes, energy);
    store(least_out + b * kLanes, least);
  }
}

template <bool kExternal, bool kBraked>
void step_some(const NodeStep& step) {
  const auto* force = reinterpret_cast<const Four*>(step.force);
  const auto* external = reinterpret_cast<const Four*>(step.external);
  const auto* carried = reinterpret_cast<const Four*>(step.carried);
  auto *work = reinterpret_cast<Four*>(step.work), *loss = reinterpret_cast<Four*>(step.brake_loss);
  auto *v = reinterpret_cast<Four*>(step.v), *u = reinterpret_cast<Four*>(step.u);
  const double half = 0.5 * step.act_s;
  for (std::int64_t i = 0; i < step.nodes; ++i) {
    Four total = force[i];
    if constexpr (kExternal) total += external[i];
    const Four before = v[i], after = before + (step.act_s * step.inverse_kg[i]) * total;
    if constexpr (kExternal) work[i] += half * external[i] * (before + after);
    if constexpr (kBraked) loss[i] += (half * step.braked_kg_s[i]) * (before - carried[i]) * (before + after);
    v[i] = after;
    u[i] += step.step_s * after;
  }
}

inline void step_nodes(const NodeStep& step) {
  if (step.external == nullptr) {
    step_some<false, false>(step);
  } else if (step.braked_kg_s == nullptr) {
    step_some<true, false>(step);
  } else {
    step_some<true, true>(step);
  }
}

inline void move_nodes(std::int64_t nodes, double step_s, const Quad* v_of, Quad* u_of) {
  const auto* v = reinterpret_cast<const Four*>(v_of);
  auto* u = reinterpret_cast<Four*>(u_of);
  for (std::int64_t i = 0; i < nodes; ++i) u[i] += step_s * v[i];
}

const Loops kLoops{kLanes,
                   add_t4<false>,
                   add_t4<true>,
                   add_t10<false, false>,
                   add_t10<true, false>,
                   add_t10<false, true>,
                   add_t10<true, true>,
                   calc_t4_state,
                   calc_t10_state<false>,
                   calc_t10_state<true>,
                   step_nodes,
                   move_nodes};
#undef CARILLON_INLINE

const Loops& get_loops() { return kLoops; }

}  // namespace
}  // namespace carillon::transient::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::transient {

HWY_EXPORT(get_loops);

const Loops& find_loops() { return base::choose(HWY_DISPATCH_TABLE(get_loops))(); }

}  // namespace carillon::transient
#endif
