// Method: sums use eight lanes, so that results do not depend on the vector width.
#include "runtime/physics/impact/modal_groups.hpp"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <utility>

namespace carillon::impact {
namespace {

std::size_t pad(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

struct State {
  const double *a, *b, *c, *e, *g;
  const double* phi;
  double *q, *v, *x;
  std::size_t padded;
};

/// Advances q, v by one step under the forces f of the rows; x: free motion of q in the next step; w_free = phi x. kRows = 0: `rows` rows.
template <int kRows>
void move_modes(const State& s, int rows, const double* __restrict f, double* __restrict w_free, double* __restrict lanes) {
  const int n = kRows ? kRows : rows;
  for (int r = 0; r < n * kLanes; ++r) lanes[r] = 0.0;
  for (std::size_t i = 0; i < s.padded; i += kLanes) {
    double drive[kLanes] = {}, next[kLanes];
    for (int r = 0; r < n; ++r) {
      const double* __restrict phi = s.phi + static_cast<std::size_t>(r) * s.padded + i;
      for (int l = 0; l < kLanes; ++l) drive[l] += phi[l] * f[r];
    }
    for (int l = 0; l < kLanes; ++l) {
      const std::size_t k = i + static_cast<std::size_t>(l);
      const double q = s.x[k] + s.g[k] * drive[l], v = s.c[k] * s.q[k] + s.e[k] * s.v[k] + s.b[k] * drive[l];
      next[l] = s.a[k] * q + s.b[k] * v;
      s.q[k] = q;
      s.v[k] = v;
      s.x[k] = next[l];
    }
    for (int r = 0; r < n; ++r) {
      const double* __restrict phi = s.phi + static_cast<std::size_t>(r) * s.padded + i;
      for (int l = 0; l < kLanes; ++l) lanes[r * kLanes + l] += phi[l] * next[l];
    }
  }
  for (int r = 0; r < n; ++r) {
    const double* sum = lanes + r * kLanes;
    w_free[r] = ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
  }
}

double calc_dot(const double* x, const double* y, std::size_t padded) {
  double lanes[kLanes] = {};
  for (std::size_t i = 0; i < padded; i += kLanes)
    for (std::size_t l = 0; l < kLanes; ++l) lanes[l] += x[i + l] * y[i + l];
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

double calc_dot(const double* x, const double* y, const double* z, std::size_t padded) {
  double lanes[kLanes] = {};
  for (std::size_t i = 0; i < padded; i += kLanes)
    for (std::size_t l = 0; l < kLanes; ++l) lanes[l] += x[i + l] * y[i + l] * z[i + l];
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

}  // namespace

double ModalGroups::add_body(int body, const Modes& modes, std::vector<double> q, std::vector<double> v) {
  Group& group = groups_.emplace_back();
  group.body = body;
  group.modes = &modes;
  group.energy = modes.calc_energy(q, v);
  group.q = std::move(q);
  group.v = std::move(v);
  group.q.resize(pad(modes.size()), 0.0);
  group.v.resize(group.q.size(), 0.0);
  return group.energy;
}

void ModalGroups::place(int body, std::span<const double> shape, double sign, int row, std::span<const Vec3> axes, bool above_band) {
  const auto find = [&](bool tail) {
    return std::find_if(groups_.begin(), groups_.end(),
                        [&](const Group& g) { return g.body == body && g.tail == tail && (!tail || g.rows.front() == row); });
  };
  Group& group = *find(false);
  const Modes& modes = *group.modes;
  const auto n = static_cast<std::size_t>(modes.size()), padded = pad(modes.size());
  const std::size_t place = std::find(group.rows.begin(), group.rows.end(), row) - group.rows.begin();
  if (place == group.rows.size()) {
    for (std::size_t k = 0; k < axes.size(); ++k) group.rows.push_back(row + static_cast<int>(k));
    group.phi.resize(group.rows.size() * padded, 0.0);
  }
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const Vec3 axis = sign * axes[k];
    double* phi = group.phi.data() + (place + k) * padded;
    for (std::size_t i = 0; i < n; ++i) phi[i] = axis[0] * shape[3 * i] + axis[1] * shape[3 * i + 1] + axis[2] * shape[3 * i + 2];
  }
  if (!above_band || !modes.has_tail()) return;
  std::vector<double> above = modes.calc_tail_shapes(modes.calc_tail_compliance({group.phi.data() + place * padded, n}));
  above.resize(pad(kTailModes), 0.0);
  const auto known = find(true);
  if (known != groups_.end()) {
    known->phi = std::move(above);
    return;
  }
  Group tail;
  tail.body = body;
  tail.modes = &modes;
  tail.tail = true;
  tail.rows = {row};
  tail.phi = std::move(above);
  tail.q.assign(tail.phi.size(), 0.0);
  tail.v = tail.q;
  groups_.push_back(std::move(tail));
}

void ModalGroups::add_approach(int row, double& approach, double& inverse_mass) const {
  for (const Group& group : groups_)
    for (std::size_t r = 0; r < group.rows.size(); ++r) {
      if (group.rows[r] != row) continue;
      const double* phi = group.phi.data() + r * group.q.size();
      approach -= calc_dot(phi, group.v.data(), group.q.size());
      inverse_mass += calc_dot(phi, phi, group.q.size());
    }
}

double ModalGroups::calc_displacement(int row) const {
  double sum = 0.0;
  for (const Group& group : groups_)
    for (std::size_t r = 0; r < group.rows.size(); ++r)
      if (group.rows[r] == row) sum += group.w[r];
  return sum;
}

double ModalGroups::limit_step(double longest_s) const {
  for (const Group& group : groups_) {
    const double band = group.modes->get_band();
    if (!group.rows.empty() && band > 0.0) longest_s = std::min(longest_s, 0.5 * std::numbers::pi / band);  // 1/(4 f_c)
  }
  return longest_s;
}

void ModalGroups::set_up(int k, std::size_t n, std::vector<double>& a) {
  for (Group& group : groups_) {
    const Modes& modes = *group.modes;
    group.p = group.tail ? modes.find_tail_propagator(k) : modes.find_propagator(k);
    const std::size_t padded = group.q.size(), m = group.rows.size();
    group.x.resize(padded);
    for (std::size_t i = 0; i < padded; ++i) group.x[i] = group.p->a[i] * group.q[i] + group.p->b[i] * group.v[i];
    group.w.assign(m, 0.0);
    group.w_free.assign(m, 0.0);
    group.compliance.assign(m * m, 0.0);
    for (std::size_t r = 0; r < m; ++r) {
      const double* phi = group.phi.data() + r * padded;
      group.w[r] = calc_dot(phi, group.q.data(), padded);
      group.w_free[r] = calc_dot(phi, group.x.data(), padded);
      for (std::size_t s = 0; s <= r; ++s) {
        const double compliance = calc_dot(phi, group.p->g.data(), group.phi.data() + s * padded, padded);
        const std::size_t i = group.rows[r], j = group.rows[s];
        group.compliance[r * m + s] = group.compliance[s * m + r] = compliance;
        a[i * n + j] += compliance;
        if (r != s) a[j * n + i] += compliance;
      }
    }
  }
}

void ModalGroups::add_free_motion(std::vector<double>& free) const {
  for (const Group& group : groups_)
    for (std::size_t r = 0; r < group.rows.size(); ++r) free[group.rows[r]] += group.w_free[r] - group.w[r];
}

void ModalGroups::move(const std::vector<double>& force) {
  for (Group& group : groups_) {
    const std::size_t m = group.rows.size();
    group.f.resize(m);
    group.lanes.resize(m * kLanes);
    for (std::size_t r = 0; r < m; ++r) group.f[r] = force[group.rows[r]];
    for (std::size_t r = 0; r < m; ++r) {
      double w = group.w_free[r];
      for (std::size_t s = 0; s < m; ++s) w += group.compliance[r * m + s] * group.f[s];
      group.work += group.f[r] * (w - group.w[r]);
      group.w[r] = w;
    }
    const Propagator& p = *group.p;
    const State state{p.a.data(),       p.b.data(),     p.c.data(),     p.e.data(),     p.g.data(),
                      group.phi.data(), group.q.data(), group.v.data(), group.x.data(), group.q.size()};
    const auto move = m == 1 ? move_modes<1> : m == 3 ? move_modes<3> : move_modes<0>;
    move(state, static_cast<int>(m), group.f.data(), group.w_free.data(), group.lanes.data());
  }
}

void ModalGroups::read_state(int body, std::vector<double>& q, std::vector<double>& v) const {
  for (const Group& group : groups_) {
    if (group.tail || group.body != body) continue;
    q.assign(group.q.begin(), group.q.begin() + group.modes->size());
    v.assign(group.v.begin(), group.v.begin() + group.modes->size());
  }
}

ModalEnergy ModalGroups::calc_energy() const {
  ModalEnergy sum;
  for (const Group& group : groups_) {
    if (group.tail) {
      sum.above_band += group.work;
      continue;
    }
    const std::size_t n = group.modes->size();
    const double modal = group.modes->calc_energy({group.q.data(), n}, {group.v.data(), n});
    sum.modal += modal;
    sum.dissipated += group.energy + group.work - modal;
  }
  return sum;
}

}  // namespace carillon::impact
