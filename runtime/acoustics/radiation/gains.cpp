// Method:     the outer surface is replaced by a sphere of the same area; each triangle is seen in its direction from the centre of the
//             enclosed volume. U_lm = (1 / a^2) sum over triangles of (phi . n) A Y_lm, phi the mean of its corners. A sphere that moves
//             with U_lm Y_lm radiates the far pressure rho0 c0 U_lm Y_lm / (k |h_l'(ka)| r), and different (l, m) are orthogonal over
//             directions: g^2 = (rho0 c0)^2 / 4 pi  sum_l U_l^2 / (k |h_l'(ka)|)^2 with U_l^2 = sum_m U_lm^2. The remainder of (phi . n)^2
//             in Parseval's sum is assigned to the next order. All modes are summed at once, a block of triangles as a matrix product.
// Source:     Morse & Ingard, Theoretical Acoustics (1968), 7.2; Pierce, Acoustics (1981), 4.1-4.2.
// Deviations: exact for spheres only. The monopole is the true volume flow for every body, hence also its level at wavelengths long against
//             the body.
#include "runtime/acoustics/radiation/gains.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>

#include "runtime/acoustics/radiation/flow.hpp"
#include "runtime/bank/air.hpp"
#include "runtime/bank/multipoles.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/hankel.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::radiation {
namespace {

using std::numbers::pi;

constexpr std::size_t kOrders = kMaxLobes + 1;
constexpr std::size_t kHarmonics = kOrders * kOrders;

/// Recurrence factors of calc_harmonics.
struct Recurrence {
  std::array<std::array<double, kOrders>, kOrders> a{}, b{};  // [m][l]
  std::array<double, kOrders> diagonal{};
  Recurrence() {
    for (int m = 0; m <= kMaxLobes; ++m) {
      const double m2 = static_cast<double>(m) * m;
      for (int l = m; l <= kMaxLobes; ++l) {
        const double l1 = l + 1.0;
        a[m][l] = std::sqrt((4.0 * l1 * l1 - 1.0) / (l1 * l1 - m2));
        b[m][l] = l == m ? 0.0 : std::sqrt((static_cast<double>(l) * l - m2) / (4.0 * l * l - 1.0));
      }
      diagonal[m] = std::sqrt((2.0 * m + 3.0) / (2.0 * m + 2.0));
    }
  }
};

/// Real orthonormal spherical harmonics of a unit vector at l^2 + l + m, by the recurrence of the normalised associated Legendre functions.
std::array<double, kHarmonics> calc_harmonics(const Recurrence& recurrence, const Vec3& direction) {
  const auto [x, y, z] = direction;
  std::array<double, kHarmonics> harmonics;
  double cosine = 1.0, sine = 0.0;         // sin(theta)^m times cos(m phi) and sin(m phi)
  double diagonal = std::sqrt(0.25 / pi);  // P_mm / sin(theta)^m
  for (int m = 0; m <= kMaxLobes; ++m) {
    double before = 0.0, here = diagonal;
    for (int l = m; l <= kMaxLobes; ++l) {
      const double scale = m == 0 ? 1.0 : std::numbers::sqrt2;
      harmonics[l * l + l + m] = scale * here * cosine;
      if (m > 0) harmonics[l * l + l - m] = scale * here * sine;
      const double next = recurrence.a[m][l] * (z * here - recurrence.b[m][l] * before);
      before = here;
      here = next;
    }
    const double turned = x * cosine - y * sine;
    sine = y * cosine + x * sine;
    cosine = turned;
    diagonal *= recurrence.diagonal[m];
  }
  return harmonics;
}

/// 1 / |h_l'(x)| for l = 0 .. kMaxLobes + 1, h_l the spherical Hankel function of x > 0.
std::array<double, kOrders + 1> calc_radiation_factors(double x) {
  const std::vector<std::complex<double>> quotients = base::calc_hankel_quotients(x, static_cast<int>(kOrders));
  std::array<double, kOrders + 1> factors;
  double size = 1.0 / x;  // |h_l|
  for (std::size_t l = 0; l < factors.size(); ++l) {
    if (l > 0) size /= std::abs(quotients[l]);
    factors[l] = 1.0 / (size * std::abs(quotients[l] - (static_cast<double>(l) + 1.0) / x));
  }
  return factors;
}

/// Outer surface and its equivalent sphere.
struct Skin {
  std::vector<Triangle> triangles;
  std::vector<Vec3> normals_m2;  // area times unit normal
  Vec3 centre_m{};               // of the enclosed volume
  double radius_m = 0.0;         // sphere of the same area
  double volume_m3 = 0.0;        // including cavities
};

Skin make_skin(const bank::Bank& bank) {
  Skin skin;
  skin.triangles = bank::find_outer_triangles(bank.vertices_m, bank.triangles);
  if (skin.triangles.empty()) throw InputError("the surface of the bank has no outside: no closed part encloses a volume");
  const Vec3 base = bank.vertices_m[skin.triangles[0][0]];
  double area = 0.0, volume = 0.0;  // volume: six times
  Vec3 moment{};
  for (const Triangle& triangle : skin.triangles) {
    Vec3 normal = bank::calc_normal(bank.vertices_m, triangle), sum{}, corner{};
    for (int k = 0; k < 3; ++k) {
      corner[k] = bank.vertices_m[triangle[0]][k] - base[k];
      for (const std::int32_t v : triangle) sum[k] += bank.vertices_m[v][k] - base[k];
    }
    const double tetrahedron = dot(corner, normal);
    volume += tetrahedron;
    for (int k = 0; k < 3; ++k) {
      moment[k] += tetrahedron * sum[k] / 4.0;
      normal[k] /= 2.0;
    }
    area += std::sqrt(dot(normal, normal));
    skin.normals_m2.push_back(normal);
  }
  for (int k = 0; k < 3; ++k) skin.centre_m[k] = base[k] + moment[k] / volume;
  skin.radius_m = std::sqrt(area / (4.0 * pi));
  skin.volume_m3 = volume / 6.0;
  return skin;
}

/// Radiated power of a mode per order: U_l^2 summed over m, and the remainder.
using Power = std::array<double, kOrders + 1>;

std::vector<Power> calc_powers(const bank::Bank& bank, const Skin& skin) {
  static_assert(kHarmonics <= kFlowColumns);
  const FlowLoops& loops = find_flow_loops();
  const Recurrence recurrence;
  const std::size_t modes = bank.mode_count(), rows = (modes + kFlowRows - 1) / kFlowRows * kFlowRows;
  if (modes == 0) return {};  // a stiff body has none in its band
  const double per_area = 1.0 / (skin.radius_m * skin.radius_m);
  std::vector<double> flow(rows * kFlowColumns), squares(modes);  // in integer steps of the shapes
  std::vector<float> through(kFlowBlock * rows), harmonic(kFlowBlock * kFlowColumns), block_squares(modes);
  for (std::size_t first = 0; first < skin.triangles.size(); first += kFlowBlock) {
    std::fill(through.begin(), through.end(), 0.0F);
    std::fill(harmonic.begin(), harmonic.end(), 0.0F);
    std::fill(block_squares.begin(), block_squares.end(), 0.0F);
    for (std::size_t t = first; t < std::min(first + kFlowBlock, skin.triangles.size()); ++t) {
      const Triangle& corners = skin.triangles[t];
      const Vec3& normal = skin.normals_m2[t];
      const double area = std::sqrt(dot(normal, normal));
      if (!(area > 0.0)) continue;
      Vec3 direction{};
      for (int k = 0; k < 3; ++k) {
        for (const std::int32_t v : corners) direction[k] += bank.vertices_m[v][k] / 3.0;
        direction[k] -= skin.centre_m[k];
      }
      const double length = std::sqrt(dot(direction, direction));
      for (double& x : direction) x = length > 0.0 ? x / length : 0.0;
      const std::array<double, kHarmonics> harmonics = calc_harmonics(recurrence, direction);
      std::copy(harmonics.begin(), harmonics.end(), harmonic.begin() + static_cast<std::ptrdiff_t>((t - first) * kFlowColumns));
      Corners motion{.per_share = static_cast<float>(1.0 / (area * per_area))};
      for (std::size_t k = 0; k < 3; ++k) {
        motion.steps[k] = bank.get_steps(static_cast<std::size_t>(corners[k]));
        motion.share[k] = static_cast<float>(normal[k] / 3.0 * per_area);
      }
      loops.calc_through(motion, modes, &through[(t - first) * rows], block_squares.data());
    }
    loops.add_flow(through.data(), harmonic.data(), rows, flow.data());
    for (std::size_t m = 0; m < modes; ++m) squares[m] += static_cast<double>(block_squares[m]);
  }
  std::vector<Power> powers(modes);
  for (std::size_t m = 0; m < modes; ++m) {
    double resolved = 0.0;
    for (std::size_t l = 0; l < kOrders; ++l) {
      for (std::size_t i = l * l; i < (l + 1) * (l + 1); ++i) powers[m][l] += flow[m * kFlowColumns + i] * flow[m * kFlowColumns + i];
      resolved += powers[m][l];
    }
    powers[m][kOrders] = std::max(0.0, squares[m] - resolved);
    for (double& power : powers[m]) power *= bank.shape_scale[m] * bank.shape_scale[m];
  }
  return powers;
}

std::vector<double> calc_gains_of_skin(const bank::Bank& bank, const Skin& skin) {
  const std::vector<Power> powers = calc_powers(bank, skin);
  std::vector<double> gains(bank.mode_count());
  for (std::size_t m = 0; m < gains.size(); ++m) {
    const double k = std::sqrt(bank.eigenvalue_rad2_s2[m]) / bank::kSoundSpeedMs;
    const auto factors = calc_radiation_factors(k * skin.radius_m);
    double sum = 0.0;
    for (std::size_t l = 0; l < factors.size(); ++l) sum += powers[m][l] * factors[l] * factors[l];
    gains[m] = bank::kAirDensityKgM3 * bank::kSoundSpeedMs / k * std::sqrt(sum / (4.0 * pi));
  }
  return gains;
}

double calc_sphere_radius_of_skin(const Skin& skin) { return std::cbrt(skin.volume_m3 * 3.0 / (4.0 * pi)); }

void check_sizes(const bank::Bank& bank) {
  const std::size_t modes = bank.mode_count(), vertices = bank.vertex_count();
  bool inside = bank.shape.size() == 3 * vertices * modes && bank.shape_scale.size() == modes && bank.radiation_gain.size() == modes;
  for (const Triangle& triangle : bank.triangles)
    for (const std::int32_t v : triangle) inside = inside && v >= 0 && static_cast<std::size_t>(v) < vertices;
  if (!inside) throw InputError("the arrays of the bank disagree: sizes of shapes, gains and triangles do not match");
}

/// Gains of the coordinate q: amplitude 1 / omega at unit velocity.
std::vector<double> calc_gains_of_coordinates(const bank::Bank& bank) {
  std::vector<double> gains;
  for (const double lambda : bank.eigenvalue_rad2_s2) gains.push_back(1.0 / std::sqrt(lambda));
  return gains;
}

std::vector<double> calc_gains_of_multipoles(const bank::Bank& bank) {
  const bank::Multipoles& air = bank.multipoles;
  if (air.is_empty())
    throw InputError(
        "radiation \"bem\": the bank has no multipoles; solve its job with the air, or give \"sphere\", \"osg02\" or \"vddp96\"");
  if (air.decay_per_s.size() != bank.mode_count()) throw InputError("the arrays of the bank's multipoles disagree");
  return bank::calc_far_gains(air);
}

}  // namespace

std::vector<double> calc_gains(const bank::Bank& bank, GainKind kind) {
  check_sizes(bank);
  switch (choose_gain_kind(bank, kind)) {
    case GainKind::kOsg02:
      return bank.radiation_gain;
    case GainKind::kVddp96:
      return calc_gains_of_coordinates(bank);
    case GainKind::kBem:
      return calc_gains_of_multipoles(bank);
    case GainKind::kSphere:
    case GainKind::kAuto:
      break;
  }
  return calc_gains_of_skin(bank, make_skin(bank));
}

Radiation calc_radiation(const bank::Bank& bank, GainKind kind) {
  check_sizes(bank);
  const Skin skin = make_skin(bank);
  kind = choose_gain_kind(bank, kind);
  std::vector<double> gains = kind == GainKind::kSphere ? calc_gains_of_skin(bank, skin) : calc_gains(bank, kind);
  return {std::move(gains), calc_sphere_radius_of_skin(skin)};
}

Limited limit_gains(std::span<double> gains, std::span<const double> decay_per_s) {
  if (gains.size() != decay_per_s.size()) throw InputError("decays and radiation gains differ in number");
  Limited limited;
  for (std::size_t m = 0; m < gains.size(); ++m) {
    const double share = bank::calc_radiation_decay(gains[m]) / decay_per_s[m];
    if (!(decay_per_s[m] > 0.0) || !(share > 1.0)) continue;
    gains[m] /= std::sqrt(share);
    ++limited.modes;
    limited.max_db = std::max(limited.max_db, 10.0 * std::log10(share));
  }
  return limited;
}

double calc_sphere_radius_m(const bank::Bank& bank) {
  check_sizes(bank);
  return calc_sphere_radius_of_skin(make_skin(bank));
}

GainKind require_gain_kind(std::string_view option, std::string_view name) {
  const auto found = std::find(kGainKindNames.begin(), kGainKindNames.end(), name);
  if (found == kGainKindNames.end())
    throw InputError(std::string(option) + " \"" + std::string(name) + "\": give \"auto\", \"bem\", \"sphere\", \"osg02\" or \"vddp96\"");
  return static_cast<GainKind>(found - kGainKindNames.begin());
}

GainKind choose_gain_kind(const bank::Bank& bank, GainKind wish) {
  if (wish != GainKind::kAuto) return wish;
  return bank.multipoles.is_empty() ? GainKind::kSphere : GainKind::kBem;
}

PutGains put_gains(bank::Bank& bank, GainKind kind) {
  kind = choose_gain_kind(bank, kind);
  Radiation radiation = calc_radiation(bank, kind);
  bank.radiation_gain = std::move(radiation.gains);
  PutGains put{.sphere_radius_m = radiation.sphere_radius_m};
  if (kind == GainKind::kSphere) put.limited = limit_gains(bank.radiation_gain, bank.decay_per_s);
  return put;
}

}  // namespace carillon::radiation
