// The wave of falling dominoes, stones that turn about their feet without slip and stay together once they met, with Coulomb friction where
// one leans on the next: J. M. J. van Leeuwen, "The domino effect", Am. J. Phys. 78, 721 (2010), of which this is a solution of its own.
//
// Stone f and the one behind it, r, lean by angles a_f < a_r: h sin(a_r - a_f) = (s + d) cos a_f - d. At the touch (the upper edge of r on
// the back of f) a push N acts along the normal of that back, and mu N along it, as r slides down. One stone's motion gives all others'.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace carillon::physics::tests {

class LeaningTrain {
 public:
  /// Height, thickness and gap of the stones [m], friction between them.
  LeaningTrain(double height_m, double thickness_m, double gap_m, double friction)
      : h_(height_m), d_(thickness_m), pitch_(gap_m + thickness_m), mu_(friction), meets_(std::asin(gap_m / height_m)) {}

  /// When each of so many stones is struck, the first being pushed at a spin [s].
  std::vector<double> calc_starts(int stones, double spin_rad_s) {
    constexpr double kStep = 1e-4;
    std::vector<double> starts{0.0};
    double a = 0.0, w = spin_rad_s, t = 0.0;
    for (int count = 1; static_cast<int>(starts.size()) < stones; ++count) {
      for (;;) {
        double next_a = a, next_w = w;
        step(a, w, kStep, count, next_a, next_w);
        if (next_a < meets_) {
          a = next_a, w = next_w, t += kStep;
          continue;
        }
        double low = 0.0, high = kStep;
        for (int i = 0; i < 50; ++i) {
          const double half = 0.5 * (low + high);
          step(a, w, half, count, next_a, next_w);
          (next_a < meets_ ? low : high) = half;
        }
        t += high;
        w = next_w;
        break;
      }
      starts.push_back(t);
      w = collide(w, count);
      a = 0.0;
    }
    return starts;
  }

 private:
  static constexpr double kGravity = 9.81;
  struct Arms {
    double front = 0.0, rear = 0.0;  // couple on each per push [m]
  };

  double calc_ratio(double f, double r) const { return 1.0 - pitch_ * std::sin(f) / (h_ * std::cos(r - f)); }  // of the spins
  Arms calc_arms(double f, double r) const {
    const double x = std::cos(f) - mu_ * std::sin(f), z = -std::sin(f) - mu_ * std::cos(f);  // force on the front one
    return {h_ * std::cos(r) * x - (h_ * std::sin(r) - pitch_) * z, -h_ * (std::cos(r) * x - std::sin(r) * z)};
  }
  double calc_weight(double a) const { return kGravity * (0.5 * h_ * std::sin(a) - 0.5 * d_ * std::cos(a)); }
  std::vector<double> lean(double first, int count) const {
    std::vector<double> angles{first};
    for (int i = 1; i < count; ++i) angles.push_back(angles.back() + std::asin((pitch_ * std::cos(angles.back()) - d_) / h_));
    return angles;
  }

  /// Solves I (p_i + q_i x) = G_i + front_i N_i + rear_(i-1) N_(i-1) for x, from the last stone to the first; of a unit mass.
  double solve(const std::vector<double>& angles, const std::vector<double>& p, const std::vector<double>& q, bool has_weight) const {
    const double inertia = (h_ * h_ + d_ * d_) / 3.0;
    double fixed = 0.0, by_x = 0.0, behind = 0.0;  // push of the one behind, and its arm
    for (std::size_t i = angles.size() - 1; i > 0; --i) {
      const Arms arms = calc_arms(angles[i - 1], angles[i]);
      const double weight = has_weight ? calc_weight(angles[i]) : 0.0;
      fixed = (inertia * p[i] - weight - behind * fixed) / arms.rear;
      by_x = (inertia * q[i] - behind * by_x) / arms.rear;
      behind = arms.front;
    }
    const double weight = has_weight ? calc_weight(angles[0]) : 0.0;
    return (weight + behind * fixed - inertia * p[0]) / (inertia * q[0] - behind * by_x);
  }

  double calc_acceleration(double a, double w, int count) const {
    const std::vector<double> angles = lean(a, count);
    std::vector<double> p{0.0}, q{1.0};
    double spin = w;
    for (std::size_t i = 0; i + 1 < angles.size(); ++i) {
      const double f = angles[i], r = angles[i + 1], c = std::cos(r - f), ratio = calc_ratio(f, r), next = ratio * spin;
      const double change = -(pitch_ / h_) * (std::cos(f) * spin / c + std::sin(f) * std::sin(r - f) / (c * c) * (next - spin));
      p.push_back(p.back() * ratio + spin * change);
      q.push_back(q.back() * ratio);
      spin = next;
    }
    return solve(angles, p, q, true);
  }

  void step(double a, double w, double h, int count, double& to_a, double& to_w) const {
    const double k1 = calc_acceleration(a, w, count), k2 = calc_acceleration(a + 0.5 * h * w, w + 0.5 * h * k1, count),
                 k3 = calc_acceleration(a + 0.5 * h * (w + 0.5 * h * k1), w + 0.5 * h * k2, count),
                 k4 = calc_acceleration(a + h * (w + 0.5 * h * k2), w + h * k3, count);
    to_a = a + h * w + h * h / 6.0 * (k1 + k2 + k3);
    to_w = w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }

  /// The spin of a stone at rest that the first of `count` strikes, without rebound.
  double collide(double w, int count) const {
    std::vector<double> angles = lean(meets_, count);
    angles.insert(angles.begin(), 0.0);
    std::vector<double> p{0.0}, q{1.0};
    double before = w;
    for (std::size_t i = 0; i + 1 < angles.size(); ++i) {
      p.push_back(-before);
      q.push_back(q.back() * calc_ratio(angles[i], angles[i + 1]));
      if (i + 2 < angles.size()) before *= calc_ratio(angles[i + 1], angles[i + 2]);
    }
    return solve(angles, p, q, false);
  }

  double h_, d_, pitch_, mu_, meets_;
};

}  // namespace carillon::physics::tests
