// Method: under a mode's reaction r q a support moves with velocity Y r q; the absorbed power over twice the mode's energy is the decay,
//   the imaginary part shifts the frequency. Y is diagonal in the frame of the patch normal: force and couple along it and across it. Time
//   factor exp(i omega t).
// Source: thin plate: Cremer, Heckl and Petersson, Structure-Borne Sound (2005), chapter 5, for the force; couples and in-plane forces are
//   derived in docs/equations.md. Half space under a disc: Lysmer's analogue as in Richart, Hall and Woods, Vibrations of Soils and
//   Foundations (1970), tables 7-1 to 7-5.
// Deviations: the plate is infinite, thin and rigid under the patch; the added mass of the analogue's couples is neglected.
#include "runtime/bank/mounting/losses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <iterator>
#include <numbers>

#include "runtime/bank/heard.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mounting {
namespace {

using Complex = std::complex<double>;
constexpr Complex kI{0.0, 1.0};
constexpr double kEuler = std::numbers::egamma;
constexpr double kMinRadiusM = 1e-3;     // patch without area: a screw
constexpr double kMaxBeyondShare = 0.2;  // fraction of modes beyond first order, not the lowest, bounded without a warning
constexpr double kMixingRatio = 0.5;     // modes mix if their coupling exceeds this fraction of their distance
constexpr std::size_t kMaxSupports = 100000;

/// Velocity of a support per unit force or couple: force along the normal, across it (two), couple about it, across it (two).
using Admittance = std::array<Complex, 6>;

/// Patch of a support.
struct Patch {
  Vec3 normal{};
  bool has_normal = false;
  double radius_m = kMinRadiusM;  // disc of equal area
  double area_m2 = 0.0;
  double length_m = 0.0;  // long side
};

Complex calc_impedance(const material::Base& base, double omega) {
  return kI * omega * base.mass_kg + base.damping_n_s_m + base.stiffness_n_m * (1.0 + kI * base.loss_factor) / (kI * omega);
}

/// -(2 / pi) (ln(k a / 2) + Euler's constant) for wavelengths above the patch size, else 0.
Complex calc_near_field(Complex k_a) {
  const Complex log = std::log(0.5 * k_a) + kEuler;
  return log.real() < 0.0 ? -2.0 / std::numbers::pi * log : Complex(0.0);
}

/// Reduction for in-phase motion over several wavelengths: a plate driven along a line. `limit`: k l where point and line response are
/// equal.
double calc_line_share(double limit, Complex k, double length_m) { return std::min(1.0, limit / std::max(limit, std::abs(k) * length_m)); }

Admittance calc_plate(const material::Base& wall, const Patch& patch, double omega) {
  const Complex e = wall.young_modulus_pa * (1.0 + kI * wall.loss_factor), h = wall.thickness_m;
  const double nu = wall.poisson_ratio;
  const Complex bending = e * h * h * h / (12.0 * (1.0 - nu * nu)), shear = e * h / (2.0 * (1.0 + nu)), stretch = e * h / (1.0 - nu * nu);
  const Complex mass = wall.density_kg_m3 * h;
  const double a = patch.radius_m;
  const Complex k_bending = std::pow(omega * omega * mass / bending, 0.25);
  const Complex k_shear = omega * std::sqrt(mass / shear), k_stretch = omega * std::sqrt(mass / stretch);
  const double length = patch.length_m;
  const Complex normal = calc_line_share(2.0, k_bending, length) / (8.0 * std::sqrt(bending * mass));
  const Complex in_plane = omega / 8.0 *
                           (calc_line_share(4.0, k_shear, length) * (1.0 + kI * calc_near_field(k_shear * a)) / shear +
                            calc_line_share(4.0, k_stretch, length) * (1.0 + kI * calc_near_field(k_stretch * a)) / stretch);
  const Complex tilt =
      calc_line_share(4.0, k_bending, length) * omega / (16.0 * bending) * (1.0 + 2.0 * kI * calc_near_field(k_bending * a));
  const Complex twist = omega * k_shear * k_shear / (16.0 * shear) + kI * omega / (4.0 * std::numbers::pi * shear * a * a);
  if (!patch.has_normal) return {normal, normal, normal, tilt, tilt, tilt};
  return {normal, in_plane, in_plane, twist, tilt, tilt};
}

Admittance calc_half_space(const material::Base& block, const Patch& patch, double omega) {
  const double nu = block.poisson_ratio, a = patch.radius_m;
  const double shear = block.young_modulus_pa / (2.0 * (1.0 + nu)), wave = std::sqrt(block.density_kg_m3 * shear);
  const auto calc = [&](double stiffness, double damping) {
    return 1.0 / (damping + stiffness * (1.0 + kI * block.loss_factor) / (kI * omega));
  };
  const Complex normal = calc(4.0 * shear * a / (1.0 - nu), 3.4 * a * a * wave / (1.0 - nu));
  const Complex across = calc(8.0 * shear * a / (2.0 - nu), 4.6 * a * a * wave / (2.0 - nu));
  // At long waves couples radiate little: only the material's loss counts.
  const Complex tilt = calc(8.0 * shear * a * a * a / (3.0 * (1.0 - nu)), 0.0), twist = calc(16.0 * shear * a * a * a / 3.0, 0.0);
  if (!patch.has_normal) return {normal, normal, normal, tilt, tilt, tilt};
  return {normal, across, across, twist, tilt, tilt};
}

/// Impedance distributed evenly over the patch.
Admittance calc_lumped(const material::Base& base, const Patch& patch, double omega) {
  const Complex force = 1.0 / calc_impedance(base, omega);
  const double tilting = patch.area_m2 / (4.0 * std::numbers::pi);  // squared radius of gyration
  const Complex tilt = tilting > 0.0 ? force / tilting : Complex(0.0);
  return {force, force, force, 0.5 * tilt, tilt, tilt};
}

Admittance calc_admittance(const material::Base& base, const Patch& patch, double omega) {
  switch (base.kind) {
    case material::BaseKind::kPlate:
      return calc_plate(base, patch, omega);
    case material::BaseKind::kHalfSpace:
      return calc_half_space(base, patch, omega);
    case material::BaseKind::kLumped:
      return calc_lumped(base, patch, omega);
    case material::BaseKind::kRigid:
      break;
  }
  return {};
}

/// Reaction in the axes of Admittance. A wall rotates about its mid-plane: in-plane forces have the lever arm h/2.
std::array<double, 6> find_components(const double* reaction, const Patch& patch, const material::Base& base) {
  Vec3 force{reaction[0], reaction[1], reaction[2]}, couple{reaction[3], reaction[4], reaction[5]};
  if (!patch.has_normal) return {force[0], force[1], force[2], couple[0], couple[1], couple[2]};
  const Vec3& n = patch.normal;
  if (base.kind == material::BaseKind::kPlate) {
    const Vec3 moved = cross(n, force);
    for (std::size_t k = 0; k < 3; ++k) couple[k] -= 0.5 * base.thickness_m * moved[k];
  }
  const auto [a, b] = find_tangents(n);
  return {dot(force, n), dot(force, a), dot(force, b), dot(couple, n), dot(couple, a), dot(couple, b)};
}

struct Given {
  std::string name;
  material::Fixing fixing;
};

/// Supports recorded in the bank.
std::vector<Given> read_given(const bank::Bank& bank) {
  std::vector<Given> list;
  if (bank.supports.count() == 0) return list;
  const base::Document document = base::parse_document(bank.supports.text, "supports/text of the bank");
  base::Object root = document.root();
  for (base::Entry& entry : root.entries("supports", kMaxSupports)) {
    if (!entry.object) throw InputError(fmt::format("{}: a support is not an object; compute the bank again", entry.place));
    Given& given = list.emplace_back();
    given.name = entry.object->string("name");
    given.fixing = material::read_fixing(*entry.object).value_or(material::Fixing{});
    entry.object->finish();
  }
  if (list.size() != bank.supports.count())
    throw InputError(fmt::format("the bank names {} supports and has {}; compute the bank again", list.size(), bank.supports.count()));
  return list;
}

/// Complex shift of each mode, d - i delta omega, and its coupling to the next.
struct Sums {
  std::vector<Complex> own;
  std::vector<double> with_next;
};

void add_support(const bank::Bank& bank, std::size_t support, const material::Fixing& fixing, Sums& sums) {
  const bank::Supports& s = bank.supports;
  Patch patch;
  patch.normal = s.normal[support];
  patch.has_normal = dot(patch.normal, patch.normal) > 0.5;
  patch.area_m2 = s.area_m2[support];
  if (s.thickness_m[support] > 0.0) patch.length_m = patch.area_m2 / s.thickness_m[support];
  patch.radius_m = std::max(kMinRadiusM, std::sqrt(patch.area_m2 / std::numbers::pi));
  const auto get = [&](std::size_t m) { return find_components(&s.reaction[(m * s.count() + support) * 6], patch, fixing.base); };
  const std::size_t modes = bank.mode_count();
  for (std::size_t m = 0; m < modes; ++m) {
    const double lambda = bank.eigenvalue_rad2_s2[m], omega = std::sqrt(lambda);
    sums.own[m] += 0.5 * fixing.joint_loss * s.energy[m * s.count() + support] * omega;
    if (fixing.base.kind == material::BaseKind::kRigid) continue;
    const Admittance y = calc_admittance(fixing.base, patch, omega);
    const auto r = get(m);
    for (std::size_t k = 0; k < 6; ++k) sums.own[m] += y[k] * (r[k] * r[k] / (2.0 * lambda));
    if (m + 1 == modes) continue;
    const auto next = get(m + 1);
    Complex shared = 0.0;
    for (std::size_t k = 0; k < 6; ++k) shared += y[k] * (r[k] * next[k] / (2.0 * lambda));
    sums.with_next[m] += std::abs(shared);
  }
}

void add_holder(const bank::Bank& bank, const Holder& holder, Sums& sums) {
  const bank::NearestPlace place = bank::find_nearest(bank, holder.point_m);
  if (place.triangle < 0) throw InputError("\"point_m\" of \"held\" is too far away; its numbers are too large");
  const auto& corners = bank.triangles[place.triangle];
  const auto get = [&](std::size_t m) {
    Vec3 phi{};
    for (std::size_t c = 0; c < 3; ++c) {
      const Vec3 at = bank.shape_at(corners[c], m);
      for (std::size_t k = 0; k < 3; ++k) phi[k] += place.barycentric[c] * at[k];
    }
    return phi;
  };
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const Vec3 phi = get(m);
    // q'' + z q' + omega^2 q = 0 has d = Re z / 2 and the shift -Im z / 2.
    const Complex half = 0.5 * calc_impedance(holder.by, std::sqrt(bank.eigenvalue_rad2_s2[m]));
    sums.own[m] += half * dot(phi, phi);
    if (m + 1 < bank.mode_count()) sums.with_next[m] += std::abs(half * dot(phi, get(m + 1)));
  }
}

std::string format_t60(double decay_per_s) {
  return decay_per_s > 0.0 ? fmt::format("{:.3g} s", bank::calc_t60_s(decay_per_s)) : std::string("for ever");
}

}  // namespace

std::vector<std::string> list_names(const bank::Bank& bank) {
  std::vector<std::string> names;
  for (const Given& given : read_given(bank)) names.push_back(given.name);
  return names;
}

Losses calc_losses(const bank::Bank& bank, const MountingRequest& request) {
  Losses losses;
  const std::vector<Given> given = read_given(bank);
  if (given.empty() && (request.all || !request.by_name.empty()))
    throw InputError(
        "the bank has no supports: it was computed without fixed nodes, or by a version before banks had them; compute it with \"fixed\", "
        "or "
        "take \"held\"");
  std::vector<std::string> names;
  for (const Given& one : given) names.push_back(one.name);
  for (const auto& [name, fixing] : request.by_name) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    const std::string nearest = base::find_nearest(name, names);
    throw InputError(
        fmt::format("the bank has no support \"{}\"; {}", name,
                    nearest.empty() ? fmt::format("its first is \"{}\"", names.front()) : fmt::format("did you mean \"{}\"?", nearest)));
  }
  Sums sums{std::vector<Complex>(bank.mode_count()), std::vector<double>(bank.mode_count())};
  for (std::size_t s = 0; s < given.size(); ++s) {
    const auto named = request.by_name.find(given[s].name);
    const material::Fixing& fixing = named != request.by_name.end() ? named->second : request.all ? *request.all : given[s].fixing;
    if (fixing.base.kind == material::BaseKind::kRigid && fixing.joint_loss == 0.0) continue;
    add_support(bank, s, fixing, sums);
    losses.supports.push_back(fmt::format("{} {}", given[s].name, material::describe(fixing)));
  }
  if (!request.held.empty()) {
    for (const Holder& holder : request.held) {
      add_holder(bank, holder, sums);
      losses.supports.push_back(fmt::format("held by {}", material::describe(holder.by)));
    }
  }
  if (losses.supports.empty()) return losses;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]);
    const Complex shift = sums.own[m];
    const bool is_beyond = !(std::abs(shift) <= kMaxShift * omega);
    losses.beyond += is_beyond ? 1 : 0;
    losses.is_lowest_beyond = losses.is_lowest_beyond || (is_beyond && m == 0);
    losses.decay_per_s.push_back(std::isfinite(shift.real()) ? std::clamp(shift.real(), 0.0, kMaxDecay * omega) : kMaxDecay * omega);
    losses.shift_rad_s.push_back(is_beyond ? 0.0 : -shift.imag());
    if (m + 1 < bank.mode_count() && sums.with_next[m] > kMixingRatio * (std::sqrt(bank.eigenvalue_rad2_s2[m + 1]) - omega)) ++losses.mixed;
  }
  return losses;
}

void apply(const Losses& losses, bank::Bank& bank) {
  if (losses.is_empty()) return;
  double last = 0.0;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    bank.decay_per_s[m] += losses.decay_per_s[m];
    const double omega = std::sqrt(bank.eigenvalue_rad2_s2[m]) + losses.shift_rad_s[m];
    // Keep the modes in order: first order is not valid where shifts exceed distances.
    last = bank.eigenvalue_rad2_s2[m] = std::max(last, omega * omega);
  }
  bank.damping = {};
  bank.damping.law = "mixed";
  bank.proof.reset();  // counts the modes of the solve
}

std::string write_key(const MountingRequest& request) {
  std::string text;
  const auto out = std::back_inserter(text);
  if (request.all) text += material::write_fixing(*request.all).line();
  for (const auto& [name, fixing] : request.by_name) text += base::Json::object().set(name, material::write_fixing(fixing)).line();
  for (const Holder& holder : request.held) {
    const material::Base& by = holder.by;
    fmt::format_to(out, "held {} {} {} {} {} {} {}", by.mass_kg, by.damping_n_s_m, by.stiffness_n_m, by.loss_factor, holder.point_m[0],
                   holder.point_m[1], holder.point_m[2]);
  }
  return text;
}

std::string describe(const Losses& losses, const bank::Bank& before) {
  if (losses.is_empty() || before.mode_count() == 0) return {};
  std::string text;
  for (std::size_t i = 0; i < losses.supports.size() && i < 3; ++i)
    fmt::format_to(std::back_inserter(text), "{}{}", i == 0 ? "" : "; ", losses.supports[i]);
  if (losses.supports.size() > 3) fmt::format_to(std::back_inserter(text), "; and {} more", losses.supports.size() - 3);
  std::size_t longest = 0;
  for (std::size_t m = 0; m < before.mode_count(); ++m)
    if (before.decay_per_s[m] < before.decay_per_s[longest]) longest = m;
  const auto add = [&](std::size_t m) {
    fmt::format_to(std::back_inserter(text), ", T60 at {:.5g} Hz {} instead of {}", before.freq_hz(m),
                   format_t60(before.decay_per_s[m] + losses.decay_per_s[m]), format_t60(before.decay_per_s[m]));
  };
  add(0);
  if (longest != 0) add(longest);
  if (losses.beyond > 0)
    fmt::format_to(std::back_inserter(text), "; {} of {} modes beyond first order", losses.beyond, before.mode_count());
  return text;
}

std::string describe_limits(const Losses& losses, const bank::Bank& before) {
  if (!losses.is_lowest_beyond && static_cast<double>(losses.beyond) <= kMaxBeyondShare * static_cast<double>(before.mode_count()))
    return {};
  return fmt::format(
      "{} of {} modes are beyond first order (their support would shift them by more than {:g} % of their frequency): their "
      "frequency is kept, and their decay is at most {:g} of it; a stiffer support, or a solve without these fixed nodes and "
      "\"held\" in the scene, is exact",
      losses.beyond, before.mode_count(), 100 * kMaxShift, kMaxDecay);
}

}  // namespace carillon::mounting
