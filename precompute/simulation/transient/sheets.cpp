// Method: constants of a triangle in its own frame; energies in scalar code, for the energy book. docs/equations.md E11.
#include "precompute/simulation/transient/sheets.hpp"

#include <algorithm>

#include "precompute/simulation/transient/vectors.hpp"

namespace carillon::transient {
namespace {

/// Twice the tangent of half the dihedral angle at the edge from a to b, c on its left and d on its right.
double calc_turn(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 own = cross(a - c, b - c), other = cross(b - d, a - d);
  return -2.0 * norm(b - a) * dot(c - a, other) / (norm(own) * norm(other) + dot(own, other));
}

/// s of the three edges.
std::array<double, 3> calc_angles(const std::array<Vec3, 6>& at, const std::array<double, 3>& psi, const double* turn, const double* side) {
  std::array<double, 3> s{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    s[i] = side[i] * psi[i] + (turn[i] != 0.0 ? turn[i] * calc_turn(at[j], at[k], at[i], at[3 + i]) : 0.0);
  }
  return s;
}

}  // namespace

std::vector<double> calc_masses(const SheetElements& elements, const SheetLaw& law) {
  std::vector<double> mass(elements.count_nodes());
  for (const auto& nodes : elements.nodes) {
    std::array<Vec3, 3> at{};
    for (std::size_t c = 0; c < 3; ++c) at[c] = elements.rest_m[nodes[c]];
    const double area = 0.5 * norm(cross(at[1] - at[0], at[2] - at[0])), third = law.density_kg_m3 * law.thickness_m * area / 3.0;
    for (std::size_t c = 0; c < 3; ++c) {
      mass[nodes[c]] += third;
      mass[nodes[6 + c]] += kEdgeInertia * third * 2.0 * area;
      if (nodes[3 + c] >= elements.vertices + elements.edges) mass[nodes[3 + c]] += third;
    }
  }
  return mass;
}

Sheets::Sheets(const SheetElements& elements, std::span<const std::int32_t> which, const SheetLaw& law,
               std::span<const std::array<std::int32_t, 9>> read, std::span<const std::array<std::int32_t, 9>> write, std::int32_t spare)
    : count_(which.size()), is_damped_(law.alpha1_s != 0.0) {
  const double plane = 2.0 * law.lambda_pa * law.mu_pa / (law.lambda_pa + 2.0 * law.mu_pa), mu = law.mu_pa, t = law.thickness_m;
  blocks_.resize((count_ + kLanes - 1) / kLanes);
  if (is_damped_) lag_.resize(blocks_.size() * 6 * kLanes);
  spent_.resize(blocks_.size() * kLanes);
  for (std::size_t k = 0; k < blocks_.size() * kLanes; ++k) {
    const bool is_padded = k >= count_;
    const std::size_t from = std::min(k, count_ - 1), lane = k % kLanes;
    const std::size_t triangle = which[from];
    const auto& nodes = elements.nodes[triangle];
    Block& block = blocks_[k / kLanes];
    std::array<Vec3, 6> at{};
    for (std::size_t c = 0; c < 6; ++c) {
      const bool is_there = nodes[c] >= 0;
      at[c] = is_there ? elements.rest_m[nodes[c]] : Vec3{};
    }
    const Vec3 d1 = at[1] - at[0], d2 = at[2] - at[0];
    const double p = norm(d1), q = dot(d1, d2) / p, r = norm(cross(d1, d2)) / p, area = 0.5 * p * r;
    const double share = is_padded ? 0.0 : 1.0;
    std::array<double, 3> per_height{};
    std::array<Vec3, 3> normal{};
    const Vec3 up = normalise(cross(d1, d2));
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 along = at[(i + 2) % 3] - at[(i + 1) % 3];
      per_height[i] = norm(along) / (2.0 * area);
      normal[i] = cross(normalise(along), up);
    }
    const auto bend = [&](std::size_t i, std::size_t j) {
      const double c = dot(normal[i], normal[j]);
      return share * area * t * t * t / 12.0 * 4.0 * per_height[i] * per_height[j] * (plane + 2.0 * mu * c * c);
    };
    const std::array<double, kConstants> constant{1.0 / p,
                                                  -q / (p * r),
                                                  1.0 / r,
                                                  share * area * t * plane,
                                                  share * 2.0 * area * t * mu,
                                                  bend(0, 0),
                                                  bend(1, 1),
                                                  bend(2, 2),
                                                  bend(0, 1),
                                                  bend(0, 2),
                                                  bend(1, 2),
                                                  elements.turn[triangle][0],
                                                  elements.turn[triangle][1],
                                                  elements.turn[triangle][2],
                                                  elements.side[triangle][0],
                                                  elements.side[triangle][1],
                                                  elements.side[triangle][2],
                                                  law.alpha1_s};
    for (std::size_t c = 0; c < kConstants; ++c) block.constant[c][lane] = constant[c];
    const std::array<double, 3> rest = calc_angles(at, {}, elements.turn[triangle].data(), elements.side[triangle].data());
    for (std::size_t i = 0; i < 3; ++i) block.rest[i][lane] = rest[i];
    for (std::size_t c = 0; c < 9; ++c) {
      // Without a neighbour the corner itself, whose angle has no share.
      block.read[c][lane] = read[from][nodes[c] >= 0 || c < 3 ? c : c - 3];
      block.write[c][lane] = nodes[c] >= 0 && !is_padded ? write[from][c] : spare;
    }
  }
}

void Sheets::add_forces(const StepWeights& weights, const Quad* x, const Quad* v, Quad* f) {
  add_sheet_forces(blocks_.data(), blocks_.size(), is_damped_, weights, x, v, f, lag_.data(), spent_.data());
}

void Sheets::add_elastic_forces(const Quad* x, Quad* f) const {
  add_sheet_forces(blocks_.data(), blocks_.size(), false, {}, x, nullptr, f, nullptr, nullptr);
}

void Sheets::save_state(std::size_t k, double* state) const {
  state[0] = spent_[k];
  for (std::size_t i = 0; i < 6; ++i) state[1 + i] = is_damped_ ? lag_[(k / kLanes * 6 + i) * kLanes + k % kLanes] : 0.0;
}

void Sheets::load_state(std::size_t k, const double* state) {
  spent_[k] = state[0];
  if (is_damped_)
    for (std::size_t i = 0; i < 6; ++i) lag_[(k / kLanes * 6 + i) * kLanes + k % kLanes] = state[1 + i];
}

double Sheets::calc_energy(std::size_t k, const Quad* x) const {
  const Block& block = blocks_[k / kLanes];
  const std::size_t lane = k % kLanes;
  std::array<double, kConstants> c{};
  for (std::size_t i = 0; i < kConstants; ++i) c[i] = block.constant[i][lane];
  std::array<Vec3, 6> at{};
  for (std::size_t i = 0; i < 6; ++i) at[i] = to_vector(x[block.read[i][lane]]);
  const Vec3 d1 = at[1] - at[0], d2 = at[2] - at[0], f1 = c[0] * d1, f2 = c[1] * d1 + c[2] * d2;
  const double e11 = 0.5 * (dot(f1, f1) - 1.0), e22 = 0.5 * (dot(f2, f2) - 1.0), e12 = 0.5 * dot(f1, f2);
  double energy = 0.5 * c[3] * (e11 + e22) * (e11 + e22) + 0.5 * c[4] * (e11 * e11 + e22 * e22 + 2.0 * e12 * e12);
  std::array<double, 3> psi{};
  for (std::size_t i = 0; i < 3; ++i) psi[i] = x[block.read[6 + i][lane]].x;
  std::array<double, 3> s = calc_angles(at, psi, &c[11], &c[14]);
  for (std::size_t i = 0; i < 3; ++i) s[i] -= block.rest[i][lane];
  energy +=
      0.5 * (c[5] * s[0] * s[0] + c[6] * s[1] * s[1] + c[7] * s[2] * s[2]) + c[8] * s[0] * s[1] + c[9] * s[0] * s[2] + c[10] * s[1] * s[2];
  return energy;
}

}  // namespace carillon::transient
