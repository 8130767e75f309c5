// Method: p <- M^-1 (f(u - e p) - f(u + e p)) / 2 e for all bodies at once, each scaled separately, with e p at most 1e-6 of the body's
//   shortest edge; omega^2 is the Rayleigh quotient. docs/equations.md E11.
#include "precompute/simulation/transient/stable_step.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "precompute/simulation/transient/order_free_sum.hpp"

namespace carillon::transient {

double calc_longest_step(double omega_rad_s, double alpha1_s, double alpha2_per_s) {
  if (!(omega_rad_s > 0.0)) return std::numeric_limits<double>::infinity();
  const double xi = 0.5 * (alpha1_s * omega_rad_s + alpha2_per_s / omega_rad_s);
  return 2.0 / omega_rad_s / (std::sqrt(1.0 + xi * xi) + xi);
}

double calc_alpha1(const Law& law) {
  return std::max(law.psi_pa_s / law.mu_pa, (3.0 * law.phi_pa_s + 2.0 * law.psi_pa_s) / (3.0 * law.lambda_pa + 2.0 * law.mu_pa));
}

HighestFrequency::HighestFrequency(const Domain& domain)
    : p_(static_cast<std::size_t>(domain.node_count())),
      moved_(p_.size()),
      f_(static_cast<std::size_t>(domain.force_count())),
      g_(f_.size()) {
  for (std::size_t i = 0; i < p_.size(); ++i) {
    // The same on every rank that has the node.
    auto seed = static_cast<std::uint64_t>(domain.find_number(static_cast<std::int32_t>(i)) + 1) * 0x9e3779b97f4a7c15U;
    const auto draw = [&] {
      seed ^= seed >> 31;
      seed *= 0xbf58476d1ce4e5b9U;
      return static_cast<double>(seed >> 11) * 0x1p-52 - 1.0;
    };
    p_[i] = {draw(), draw(), draw(), 0.0};
  }
  const Assembly& assembly = domain.get_assembly();
  for (const Assembly::Body& body : assembly.bodies) {
    double shortest = std::numeric_limits<double>::infinity();
    for (std::int32_t e = body.first_element; e < body.last_element; ++e) {
      const auto nodes = assembly.find_nodes(e);
      for (std::size_t i = 0; i < (body.is_sheet ? 3U : 4U); ++i)
        for (std::size_t j = 0; j < i; ++j) shortest = std::min(shortest, norm(assembly.nodes_m[nodes[i]] - assembly.nodes_m[nodes[j]]));
    }
    shortest_edge_m_.push_back(shortest);
  }
}

std::vector<double> HighestFrequency::calc(Domain& domain, const Quad* u, const std::vector<char>& fixed, int iterations) {
  constexpr double kShareOfEdge = 1e-6;
  const comm::Communicator& comm = domain.get_comm();
  const auto bodies = shortest_edge_m_.size(), own = static_cast<std::size_t>(domain.own_count());
  std::vector<double> square(bodies, 0.0);
  for (std::size_t i = 0; i < own; ++i)
    if (fixed[i] != 0) p_[i] = {};
  domain.copy_to_halo(p_.data());
  for (int n = 0; n < iterations; ++n) {
    std::vector<double> most(bodies, 0.0);
    const auto body_of = [&](std::size_t i) { return static_cast<std::size_t>(domain.find_body(static_cast<std::int32_t>(i))); };
    for (std::size_t i = 0; i < own; ++i)
      most[body_of(i)] = std::max({most[body_of(i)], std::abs(p_[i].x), std::abs(p_[i].y), std::abs(p_[i].z)});
    comm.max(std::span<double>(most));
    const auto scale_of = [&](std::size_t b) { return most[b] > 0.0 ? kShareOfEdge * shortest_edge_m_[b] / most[b] : 0.0; };
    for (const double sign : {1.0, -1.0}) {
      for (std::size_t i = 0; i < p_.size(); ++i) {
        const double scale = sign * scale_of(body_of(i));
        moved_[i] = {u[i].x + scale * p_[i].x, u[i].y + scale * p_[i].y, u[i].z + scale * p_[i].z, 0.0};
      }
      domain.set_elastic_forces(moved_.data(), sign > 0.0 ? f_.data() : g_.data());
    }
    std::vector<OrderFreeSum> sums(2 * bodies);
    for (std::size_t i = 0; i < own; ++i) {
      const std::size_t b = body_of(i);
      const double scale = scale_of(b), mass = domain.get_masses_kg()[i];
      if (fixed[i] != 0 || scale == 0.0) continue;
      const Quad force{(g_[i].x - f_[i].x) / (2.0 * scale), (g_[i].y - f_[i].y) / (2.0 * scale), (g_[i].z - f_[i].z) / (2.0 * scale), 0.0};
      sums[2 * b].add(p_[i].x * force.x + p_[i].y * force.y + p_[i].z * force.z);
      sums[2 * b + 1].add(mass * (p_[i].x * p_[i].x + p_[i].y * p_[i].y + p_[i].z * p_[i].z));
      p_[i] = {force.x / mass, force.y / mass, force.z / mass, 0.0};
    }
    const std::vector<double> sum = calc_sums(comm, sums);
    for (std::size_t b = 0; b < bodies; ++b) square[b] = sum[2 * b + 1] > 0.0 ? sum[2 * b] / sum[2 * b + 1] : 0.0;
    // Normalise.
    for (std::size_t i = 0; i < own; ++i) {
      const double factor = square[body_of(i)] > 0.0 ? 1.0 / square[body_of(i)] : 1.0;
      p_[i] = {factor * p_[i].x, factor * p_[i].y, factor * p_[i].z, 0.0};
    }
    domain.copy_to_halo(p_.data());
  }
  std::vector<double> omega;
  for (const double value : square) omega.push_back(std::sqrt(std::max(value, 0.0)));
  return omega;
}

}  // namespace carillon::transient
