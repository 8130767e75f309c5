// Checks of a bank's content.
// Method: each property that a valid solve implies is tested from the bank alone.
//   Surface: a closed oriented surface has each edge once in each direction; its signed volume (sum of a . (b x c) / 6 over the triangles)
//   is positive if outward. Inertia: the second moments S = tr(I)/2 1 - I of a positive density are positive definite, which implies that I
//   is and that its principal moments obey the triangle inequality; S_ii / mass is at most the square of the largest distance from the
//   centre.
// Deviations: the enclosed volume is compared with volume_m3 within a factor of two only, since curved elements bulge.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/edges.hpp"
#include "runtime/bank/faults.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/radiation_gain.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/base/document.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/supports.hpp"

namespace carillon::bank {
namespace {

constexpr double kResidualLimit = 1e-4;
constexpr double kLawTolerance = 1e-9;   // quantities computed by the same formula
constexpr double kMassTolerance = 0.01;  // mass against density times volume
constexpr double kShareTolerance = 1e-6;
constexpr double kMinLengthM = 1e-9, kMaxOriginDistanceM = 1e12;  // size; distance from the origin
constexpr double kMaxAlpha1S = 1e6, kMaxAlpha2PerS = 1e12;
// A mode of unit modal mass that moves the fraction s of the body's mass has |phi| = 1 / sqrt(s m) there.
constexpr double kMinMassShare = 1e-12;
constexpr double kGainSlack = 10.0;  // factor over the gain of a sphere pulsating with the largest motion

constexpr double kMaxSteps = 32767.0;  // two-byte component

/// Largest |phi| representable by that many steps of a mode.
double calc_max_motion(const Bank& bank, std::size_t mode, double steps) { return std::numbers::sqrt3 * bank.shape_scale[mode] * steps; }

Check check_arrays(const Bank& bank) {
  Faults faults;
  const std::size_t vertices = bank.vertex_count();
  const std::size_t modes = bank.mode_count();
  const auto expect = [&](const char* name, std::size_t size, std::size_t wanted) {
    if (size != wanted) faults.add("arrays disagree: {} holds {} values, {} are required", name, size, wanted);
  };
  expect("decay", bank.decay_per_s.size(), modes);
  expect("residual", bank.residual.size(), modes);
  expect("radiation_gain", bank.radiation_gain.size(), modes);
  expect("shape_scale", bank.shape_scale.size(), modes);
  for (const auto& [name, cents] : {std::pair("algebraic_error_cents", &bank.algebraic_error_cents),
                                    std::pair("discretisation_error_cents", &bank.discretisation_error_cents),
                                    std::pair("facet_error_cents", &bank.facet_error_cents)}) {
    if (!cents->empty()) expect(name, cents->size(), modes);
  }
  if (const Corrected& corrected = bank.corrected; !corrected.is_empty()) {
    expect("corrected_frequency_hz", corrected.freq_hz.size(), modes);
    expect("corrected_decay", corrected.decay_per_s.size(), modes);
    expect("corrected_error_cents", corrected.error_cents.size(), modes);
    expect("correction", corrected.correction.size(), modes);
  }
  if (const Multipoles& air = bank.multipoles; !air.is_empty()) {
    expect("radiation/order", air.order.size(), modes);
    expect("radiation/freq_hz", air.freq_hz.size(), modes);
    expect("radiation/scale", air.scale.size(), modes);
    expect("radiation/decay", air.decay_per_s.size(), modes);
    expect("radiation/added_mass", air.added_mass.size(), modes);
    expect("radiation/error_db", air.error_db.size(), modes);
    if (const std::string fault = find_order_fault(air); !fault.empty()) faults.add("{}", fault);
    if (const Mixing& mixing = air.mixing; !mixing.is_empty()) {
      expect("radiation/mixing_count", mixing.count.size(), modes);
      expect("radiation/mixing_part", mixing.part.size(), mixing.motion.size());
      if (const std::string fault = find_mixing_fault(mixing); !fault.empty()) faults.add("{}", fault);
    }
  }
  for (const std::string& fault : {find_size_fault(bank.quartic), find_mode_fault(bank.quartic, modes)})
    if (!fault.empty()) faults.add("{}", fault);
  expect("shape", bank.shape.size(), vertices * modes * 3);
  if (bank.packing) expect("pack/witness_shape", bank.packing->witness_shape.size(), bank.packing->witness.size() * modes * 3);
  const Supports& supports = bank.supports;
  expect("supports/centre_m", supports.centre_m.size(), supports.count());
  expect("supports/normal", supports.normal.size(), supports.count());
  expect("supports/thickness_m", supports.thickness_m.size(), supports.count());
  expect("support_reaction", supports.reaction.size(), modes * supports.count() * 6);
  expect("support_energy", supports.energy.size(), modes * supports.count());
  if (vertices < 4 || bank.triangles.size() < 4) {
    faults.add("the surface has {} vertices and {} triangles; a solid has at least four of each", vertices, bank.triangles.size());
  }
  if (vertices > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max()))
    faults.add("{} vertices are more than 2^31 - 1", vertices);
  return {"arrays", fmt::format("{} vertices, {} triangles, {} modes", vertices, bank.triangles.size(), modes), faults.take()};
}

Check check_numbers(const Bank& bank) {
  Faults faults;
  std::size_t count = 0;
  const auto look = [&](const char* name, const double* values, std::size_t size) {
    count += size;
    for (std::size_t i = 0; i < size; ++i) {
      if (!std::isfinite(values[i])) faults.add("{}[{}] is {}, not a finite number", name, i, values[i]);
    }
  };
  look("vertices", bank.vertices_m.empty() ? nullptr : bank.vertices_m[0].data(), 3 * bank.vertex_count());
  look("eigenvalue", bank.eigenvalue_rad2_s2.data(), bank.mode_count());
  look("decay", bank.decay_per_s.data(), bank.mode_count());
  look("residual", bank.residual.data(), bank.mode_count());
  look("radiation_gain", bank.radiation_gain.data(), bank.mode_count());
  look("shape_scale", bank.shape_scale.data(), bank.mode_count());
  look("band_hz", bank.band_hz.data(), 2);
  if (bank.packing) {
    look("pack/error_db", &bank.packing->error_db, 1);
    look("pack/worst_db", &bank.packing->worst_db, 1);
  }
  look("mass_kg", &bank.rigid.mass_kg, 1);
  look("centre_m", bank.rigid.centre_m.data(), 3);
  look("inertia_kg_m2", bank.rigid.inertia_kg_m2.data(), 9);
  look("volume_m3", &bank.rigid.volume_m3, 1);
  const Material& material = bank.material;
  look("young_modulus_pa", &material.young_modulus_pa, 1);
  look("poisson_ratio", &material.poisson_ratio, 1);
  look("density_kg_m3", &material.density_kg_m3, 1);
  look("alpha1_s", &material.alpha1_s, 1);
  look("alpha2_per_s", &material.alpha2_per_s, 1);
  const auto look_all = [&](const char* name, const std::vector<double>& values) { look(name, values.data(), values.size()); };
  look_all("algebraic_error_cents", bank.algebraic_error_cents);
  look_all("facet_error_cents", bank.facet_error_cents);
  look_all("corrected_frequency_hz", bank.corrected.freq_hz);
  look_all("corrected_decay", bank.corrected.decay_per_s);
  look_all("damping/coefficient", bank.damping.coefficient);
  look_all("damping/power", bank.damping.power);
  look_all("damping/freq_hz", bank.damping.freq_hz);
  look_all("damping/loss_factor", bank.damping.loss_factor);
  const Supports& supports = bank.supports;
  look("supports/centre_m", supports.centre_m.empty() ? nullptr : supports.centre_m[0].data(), 3 * supports.count());
  look("supports/normal", supports.normal.empty() ? nullptr : supports.normal[0].data(), 3 * supports.count());
  look_all("supports/area_m2", supports.area_m2);
  look_all("supports/thickness_m", supports.thickness_m);
  look_all("support_reaction", supports.reaction);
  look_all("support_energy", supports.energy);
  if (const Multipoles& air = bank.multipoles; !air.is_empty()) {
    look("radiation/centre_m", air.centre_m.data(), 3);
    look("radiation/radius_m", &air.radius_m, 1);
    look("radiation/nearest_m", &air.nearest_m, 1);
    look("radiation/air_density_kg_m3", &air.air_density_kg_m3, 1);
    look("radiation/sound_speed_ms", &air.sound_speed_ms, 1);
    look_all("radiation/freq_hz", air.freq_hz);
    look_all("radiation/scale", air.scale);
    look_all("radiation/decay", air.decay_per_s);
    look_all("radiation/added_mass", air.added_mass);
    look_all("radiation/error_db", air.error_db);
    look_all("radiation/mixing_part", air.mixing.part);
  }
  if (bank.proof) {
    look_all("proof/cut_hz", bank.proof->cut_hz);
    look_all("proof/margin", bank.proof->margin);
    look_all("proof/below_band_hz", bank.proof->below_band_hz);
    look("proof/complete_below_hz", &bank.proof->complete_below_hz, 1);
    look("proof/orthonormality", &bank.proof->orthonormality, 1);
    look("proof/backward_error", &bank.proof->backward_error, 1);
  }
  return {"numbers", fmt::format("{} checked", count), faults.take()};
}

Check check_eigenvalues(const Bank& bank) {
  Faults faults;
  const auto& lambda = bank.eigenvalue_rad2_s2;
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    if (!(lambda[i] > 0.0)) faults.add("eigenvalue[{}] is {:.6g} rad^2/s^2, not positive", i, lambda[i]);
    if (bank.freq_hz(i) > kMaxHz) faults.add("mode {} is at {:.3g} Hz, above the limit of {:.0e} Hz", i, bank.freq_hz(i), kMaxHz);
    if (i > 0 && !(lambda[i] >= lambda[i - 1])) faults.add("eigenvalue[{}] is below the one before it: not ascending", i);
  }
  const auto figure = lambda.empty() ? std::string("no modes")
                                     : fmt::format("ascending from {:.2f} to {:.2f} Hz", bank.freq_hz(0), bank.freq_hz(lambda.size() - 1));
  return {"frequencies", figure, faults.take()};
}

Check check_band(const Bank& bank) {
  Faults faults;
  const auto [low, high] = bank.band_hz;
  if (!(low >= 0.0 && low < high)) faults.add("band_hz is [{:.6g}, {:.6g}], not an ascending pair of frequencies", low, high);
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double freq = bank.freq_hz(i);
    // Selected by the corrected frequency, if there is one; before 1.9 by that of the mesh, as at a lower end that rounding moved.
    const double other = bank.corrected.freq_hz.size() == bank.mode_count() ? bank.corrected.freq_hz[i] : freq;
    if (!(std::max(freq, other) >= low * (1.0 - kLawTolerance) && std::min(freq, other) <= high * (1.0 + kLawTolerance))) {
      faults.add("mode {} at {:.6g} Hz lies outside the band of {:.6g} to {:.6g} Hz", i, freq, low, high);
    }
  }
  return {"band",
          fmt::format("{:g} to {:g} Hz, {}", low, high, bank.complete ? "every mode of it is here" : "not all modes of it are here"),
          faults.take()};
}

/// Checks the constants of the law.
void check_law(const Bank& bank, Faults& faults) {
  const Damping& law = bank.damping;
  const auto expect = [&](bool is_so, const char* what) {
    if (!is_so) faults.add("the damping law {} has {}", law.law, what);
  };
  const bool is_caughey = law.law == "caughey", is_friction = law.law == "internal_friction", is_table = law.law == "loss_table";
  if (!is_caughey && !is_friction && !is_table && law.law != "rayleigh" && law.law != "mixed")
    return faults.add("the damping law \"{}\" is none that is known", law.law);
  expect(!is_caughey || !law.coefficient.empty(), "no terms");
  expect(law.coefficient.size() == (is_friction ? 1 : is_caughey ? law.power.size() : 0), "not as many coefficients as it takes");
  expect(is_caughey || law.power.empty(), "powers, which it does not use");
  expect(law.freq_hz.size() == law.loss_factor.size() && is_table == !law.freq_hz.empty(), "no table, or one that it does not use");
  expect(std::is_sorted(law.freq_hz.begin(), law.freq_hz.end(), std::less_equal<>()), "a table that does not ascend");
  expect(law.freq_hz.empty() || law.freq_hz[0] > 0.0, "a table that does not begin above 0 Hz");
}

Check check_decay(const Bank& bank) {
  Faults faults;
  check_law(bank, faults);
  const bool is_played = bank.multipoles.is_in_decay;  // includes radiation, which no law describes
  const bool has_law = bank.damping.law != "mixed" && faults.empty() && !is_played;
  double worst = 0.0;
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double d = bank.decay_per_s[i];
    if (!(d >= 0.0)) faults.add("decay[{}] is {:.6g} 1/s, negative", i, d);
    if (d > kMaxDecayPerS) faults.add("decay[{}] is {:.3g} 1/s, above the limit of {:.0e}", i, d, kMaxDecayPerS);
    if (is_played && !(d >= bank.multipoles.decay_per_s[i]))
      faults.add("decay[{}] is {:.9g} 1/s, radiation alone gives {:.9g}", i, d, bank.multipoles.decay_per_s[i]);
    if (!has_law) continue;
    const double law = calc_decay(bank.damping, bank.material, bank.eigenvalue_rad2_s2[i]);
    if (!(std::abs(d - law) <= kLawTolerance * law)) faults.add("decay[{}] is {:.9g} 1/s, and the damping law gives {:.9g}", i, d, law);
    if (law > 0.0) worst = std::max(worst, std::abs(d / law - 1.0));
  }
  return {"damping",
          has_law     ? fmt::format("law {}, to {:.1e}", bank.damping.law, worst)
          : is_played ? std::string("with radiation, decays not below it")
                      : std::string("several materials, decays not negative"),
          faults.take()};
}

constexpr double kMaxCorrection = 64.0;  // largest factor of a frequency, either way

/// Corrected frequencies, their decays and reasons.
Check check_corrected(const Bank& bank) {
  Faults faults;
  const Corrected& corrected = bank.corrected;
  if (corrected.is_empty()) return {"corrected", "no corrected frequencies", {}};
  const bool is_played = bank.multipoles.is_in_decay;  // decays of modes coupled by the air follow no law
  const bool has_law = bank.damping.law != "mixed" && !is_played && check_decay(bank).faults.empty();
  std::array<std::size_t, kCorrectionCount> counts{};
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double hz = corrected.freq_hz[i], mesh_hz = bank.freq_hz(i), d = corrected.decay_per_s[i], cents = corrected.error_cents[i];
    if (!(hz > mesh_hz / kMaxCorrection && hz < mesh_hz * kMaxCorrection))
      faults.add("corrected_frequency_hz[{}] is {:.6g}, and the mesh's is {:.6g}: too far apart", i, hz, mesh_hz);
    if (!(d >= 0.0 && d <= kMaxDecayPerS)) faults.add("corrected_decay[{}] is {:.6g} 1/s, not a decay", i, d);
    if (!(cents >= 0.0)) faults.add("corrected_error_cents[{}] is {:.6g}, negative", i, cents);
    const auto correction = static_cast<std::size_t>(corrected.correction[i]);
    if (correction >= counts.size()) {
      faults.add("correction[{}] is {}, and none above {} is known", i, correction, counts.size() - 1);
      continue;
    }
    ++counts[correction];
    if (!is_corrected(corrected.correction[i]) && !(std::abs(hz - mesh_hz) <= kLawTolerance * mesh_hz))
      faults.add("corrected_frequency_hz[{}] is {:.9g}, and its reason (\"{}\") leaves it at the mesh's {:.9g}", i, hz,
                 describe(corrected.correction[i]), mesh_hz);
    const double omega = 2.0 * std::numbers::pi * hz;
    const double law = has_law ? calc_decay(bank.damping, bank.material, omega * omega) : d;
    if (!(std::abs(d - law) <= kLawTolerance * law))
      faults.add("corrected_decay[{}] is {:.9g} 1/s, and the damping law gives {:.9g}", i, d, law);
  }
  std::string figure;
  for (std::size_t c = 0; c < counts.size(); ++c)
    if (counts[c] > 0) figure += fmt::format("{}{} {}", figure.empty() ? "" : ", ", counts[c], describe(static_cast<Correction>(c)));
  return {"corrected", figure.empty() ? "no modes" : figure, faults.take()};
}

Check check_residuals(const Bank& bank) {
  Faults faults;
  std::size_t worst = 0;
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    if (!(bank.residual[i] >= 0.0 && bank.residual[i] < kResidualLimit)) {
      faults.add("residual[{}] is {:.3g}, outside 0 to {:.0e}: the mode was not solved", i, bank.residual[i], kResidualLimit);
    }
    if (bank.residual[i] > bank.residual[worst]) worst = i;
  }
  const auto figure = bank.mode_count() == 0
                          ? std::string("no modes")
                          : fmt::format("worst {:.2e} at mode {}, limit {:.0e}", bank.residual[worst], worst, kResidualLimit);
  return {"residuals", figure, faults.take()};
}

/// Total area; infinite if a triangle has an invalid vertex, which is reported elsewhere.
double calc_area(const Bank& bank) {
  double twice = 0.0;
  const auto count = static_cast<std::int64_t>(bank.vertex_count());
  for (const auto& triangle : bank.triangles) {
    if (std::any_of(triangle.begin(), triangle.end(), [&](std::int64_t v) { return v < 0 || v >= count; }))
      return std::numeric_limits<double>::infinity();
    twice += calc_length(calc_normal(bank.vertices_m, triangle));
  }
  return 0.5 * twice;
}

Check check_radiation(const Bank& bank) {
  Faults faults;
  double largest = 0.0;
  const double area = calc_area(bank);
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    if (!(bank.radiation_gain[i] >= 0.0)) faults.add("radiation_gain[{}] is {:.6g}, negative", i, bank.radiation_gain[i]);
    // Upper bound: a pulsating sphere of the surface's area (docs/equations.md) with the mode's largest motion everywhere.
    const double max = calc_radiation_gain(2.0 * std::numbers::pi * bank.freq_hz(i), area * calc_max_motion(bank, i, kMaxSteps), area);
    if (max >= 0.0 && bank.radiation_gain[i] > kGainSlack * max)  // a negative scale is reported elsewhere
      faults.add("radiation_gain[{}] is {:.3g}, and a surface of this size and motion has {:.3g} at most", i, bank.radiation_gain[i], max);
    largest = std::max(largest, bank.radiation_gain[i]);
  }
  Check check{"radiation", fmt::format("largest gain {:.4g} Pa s m^-1 kg^-1/2", largest), faults.take()};
  if (bank.multipoles.is_empty()) return check;
  Check multipoles = check_multipoles(bank);
  check.figure += "; " + multipoles.figure;
  for (std::string& fault : multipoles.faults) check.faults.push_back(std::move(fault));
  return check;
}

Check check_shapes(const Bank& bank) {
  Faults faults;
  double step = 0.0;
  const double max = 1.0 / std::sqrt(kMinMassShare * bank.rigid.mass_kg);
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    if (!(bank.shape_scale[i] >= 0.0)) faults.add("shape_scale[{}] is {:.6g}, negative", i, bank.shape_scale[i]);
    const double motion = calc_max_motion(bank, i, bank.shape_bytes == 1 ? 127.0 : kMaxSteps);
    if (motion > max) {
      faults.add("shape_scale[{}] is {:.3g}, with which the mode moves by {:.3g} kg^-1/2, more than {:.3g} for a body of {:.3g} kg", i,
                 bank.shape_scale[i], motion, max, bank.rigid.mass_kg);
    }
    step = std::max(step, bank.shape_scale[i]);
  }
  if (bank.shape_bytes != 1 && bank.shape_bytes != 2) faults.add("shapes of {} bytes a component, neither 1 nor 2", bank.shape_bytes);
  if (std::find(bank.shape.begin(), bank.shape.end(), std::numeric_limits<std::int16_t>::min()) != bank.shape.end())
    faults.add("shapes have a component of -32768 steps, and they end at {}", -kMaxSteps);
  const auto is_wide = [](std::int16_t steps) { return steps < -127 || steps > 127; };
  if (bank.shape_bytes == 1 && std::any_of(bank.shape.begin(), bank.shape.end(), is_wide))
    faults.add("shapes have components beyond 127 steps, which one byte does not hold");
  return {"shapes", fmt::format("error at most {:.2e} kg^-1/2", step / 2.0), faults.take()};
}

/// Sum of a . (b x c) / 6 over the triangles, vertices relative to `origin`.
double calc_enclosed_volume(const Bank& bank, const Vec3& origin) {
  double volume = 0.0;
  for (const auto& triangle : bank.triangles) {
    const auto at = [&](int i) { return bank.vertices_m[triangle[i]] - origin; };
    volume += calc_det(at(0), at(1), at(2)) / 6.0;
  }
  return volume;
}

/// Reports edges that do not occur exactly once in each direction.
void find_open_edges(const Bank& bank, Faults& faults) {
  for_each_edge(bank.triangles, bank.vertex_count(), [&](std::int32_t low, const HalfEdge* first, const HalfEdge* last) {
    const auto begins_low = [&](const HalfEdge& edge) { return bank.triangles[edge.number / 3][edge.number % 3] == low; };
    const auto count = last - first;
    if (count == 2 && begins_low(first[0]) != begins_low(first[1])) return;
    const char* what = count == 1   ? "belongs to one triangle only: the surface is open"
                       : count == 2 ? "is passed twice in one direction: triangles are turned against each other"
                                    : "belongs to more than two triangles";
    faults.add("the edge of vertices {} and {} (triangle {}) {}", low, first->upper, first->number / 3, what);
  });
}

Check check_surface(const Bank& bank) {
  Faults faults;
  bool usable = true;
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    const auto& [a, b, c] = bank.triangles[t];
    for (const std::int32_t v : {a, b, c}) {
      if (v >= 0 && static_cast<std::size_t>(v) < bank.vertex_count()) continue;
      faults.add("triangle {} names vertex {}, and there are {}", t, v, bank.vertex_count());
      usable = false;
    }
    if (a == b || b == c || c == a) faults.add("triangle {} names a vertex twice", t);
  }
  if (!usable) return {"surface", "triangles out of range", faults.take()};
  find_open_edges(bank, faults);
  const double volume = calc_enclosed_volume(bank, bank.rigid.centre_m);
  if (!(volume > 0.0)) {
    faults.add("the surface encloses {:.6g} m^3: its triangles face inward", volume);
  } else if (!(volume > 0.5 * bank.rigid.volume_m3 && volume < 2.0 * bank.rigid.volume_m3)) {
    faults.add("the surface encloses {:.6g} m^3, the recorded volume is {:.6g}", volume, bank.rigid.volume_m3);
  }
  return {"surface", fmt::format("closed, outward, encloses {:.6g} m^3", volume), faults.take()};
}

Check check_rigid_body(const Bank& bank) {
  Faults faults;
  const RigidBody& rigid = bank.rigid;
  if (!(rigid.mass_kg > 0.0)) faults.add("mass_kg is {:.6g}, not positive", rigid.mass_kg);
  if (!(rigid.volume_m3 > 0.0)) faults.add("volume_m3 is {:.6g}, not positive", rigid.volume_m3);
  const double mass = bank.material.density_kg_m3 * rigid.volume_m3;
  if (!(std::abs(rigid.mass_kg - mass) <= kMassTolerance * mass)) {
    faults.add("mass_kg is {:.6g}, and density times volume gives {:.6g}", rigid.mass_kg, mass);
  }
  const auto& inertia = rigid.inertia_kg_m2;
  const double trace = inertia[0] + inertia[4] + inertia[8];
  Mat3 s;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      s[i][k] = (i == k ? trace / 2.0 : 0.0) - inertia[3 * i + k];
      if (i < k && !(std::abs(inertia[3 * i + k] - inertia[3 * k + i]) <= kLawTolerance * std::abs(trace)))
        faults.add("inertia_kg_m2 is not symmetric");
    }
  }
  const double minor2 = s[0][0] * s[1][1] - s[0][1] * s[1][0];
  const double minor3 = calc_det(s[0], s[1], s[2]);
  if (!(s[0][0] > 0.0 && minor2 > 0.0 && minor3 > 0.0)) {
    faults.add("inertia_kg_m2 is not that of a solid: not positive definite, or one principal moment exceeds the sum of the others");
  }
  for (int k = 0; k < 3; ++k) {
    double low = 0.0, high = 0.0;
    for (const Vec3& vertex : bank.vertices_m) {
      low = std::min(low, vertex[k] - rigid.centre_m[k]);
      high = std::max(high, vertex[k] - rigid.centre_m[k]);
    }
    const double reach = std::max(-low, high);
    if (!(high - low >= kMinLengthM && high - low <= kMaxLengthM) || !(std::abs(rigid.centre_m[k]) <= kMaxOriginDistanceM)) {
      faults.add("the body measures {:.3g} m along axis {} about {:.3g} m; bodies have {:.0e} to {:.0e} m", high - low, k,
                 rigid.centre_m[k], kMinLengthM, kMaxLengthM);
    }
    if (!(low < 0.0 && high > 0.0)) faults.add("centre_m[{}] is {:.6g} m, outside the surface", k, rigid.centre_m[k]);
    if (!(s[k][k] <= 1.1 * rigid.mass_kg * reach * reach)) faults.add("inertia_kg_m2 is too large for a surface of this size and mass");
  }
  return {"rigid body", fmt::format("{:.6g} kg, trace of inertia {:.6g} kg m^2, physically possible", rigid.mass_kg, trace), faults.take()};
}

/// Fault of the supports' text; empty if valid.
std::string find_text_fault(const Supports& supports) {
  try {
    const base::Document document = base::parse_document(supports.text, "supports/text");
    base::Object root = document.root();
    std::size_t count = 0;
    for (base::Entry& entry : root.entries("supports", supports.count())) {
      if (!entry.object) return "supports/text holds an entry that is not an object";
      entry.object->string("name");
      material::read_fixing(*entry.object);
      entry.object->finish();
      ++count;
    }
    root.finish();
    return count == supports.count() ? "" : fmt::format("supports/text names {} supports, and there are {}", count, supports.count());
  } catch (const InputError& error) {
    return error.what();
  }
}

/// The total force on all patches is -lambda times the integral of rho phi: at most lambda sqrt(m) for a mass-normalised mode.
Check check_supports(const Bank& bank) {
  Faults faults;
  const Supports& supports = bank.supports;
  const std::size_t count = supports.count();
  if (count > 0) {
    if (const std::string fault = find_text_fault(supports); !fault.empty()) faults.add("{}", fault);
  }
  for (std::size_t s = 0; s < count; ++s) {
    const double length = calc_length(supports.normal[s]);
    if (!(length < 1e-6 || std::abs(length - 1.0) < 1e-6)) faults.add("supports/normal[{}] has length {:.6g}, neither 0 nor 1", s, length);
    if (!(supports.area_m2[s] >= 0.0 && supports.thickness_m[s] >= 0.0))
      faults.add("support {} has area {:.6g} m^2 and thickness {:.6g} m, negative", s, supports.area_m2[s], supports.thickness_m[s]);
  }
  double worst = 0.0;
  for (std::size_t m = 0; m < bank.mode_count() && count > 0; ++m) {
    Vec3 force{};
    double shares = 0.0;
    for (std::size_t s = 0; s < count; ++s) {
      const double share = supports.energy[m * count + s];
      if (!(share >= 0.0 && share <= 1.0)) faults.add("support_energy of mode {} at support {} is {:.6g}, outside 0 to 1", m, s, share);
      shares += share;
      for (std::size_t k = 0; k < 3; ++k) force[k] += supports.reaction[(m * count + s) * 6 + k];
    }
    if (!(shares <= 1.0 + kShareTolerance)) faults.add("support_energy of mode {} sums up to {:.6g}, more than 1", m, shares);
    if (bank.multipoles.is_in_decay) continue;  // forces without air, frequencies with air
    const double share = calc_length(force) / (bank.eigenvalue_rad2_s2[m] * std::sqrt(bank.rigid.mass_kg));
    if (!(share <= 1.0 + kMassTolerance))
      faults.add("support_reaction of mode {} is {:.3g} times the maximum for a body of this mass", m, share);
    worst = std::max(worst, share);
  }
  return {
      "supports",
      count == 0 ? std::string("nothing is fixed") : fmt::format("{}, reactions of up to {:.3g} of the body's mass", count, worst * worst),
      faults.take()};
}

Check check_material(const Bank& bank) {
  Faults faults;
  const Material& m = bank.material;
  if (!(m.young_modulus_pa > 0.0)) faults.add("young_modulus_pa is {:.6g}, not positive", m.young_modulus_pa);
  if (!(m.poisson_ratio > -1.0 && m.poisson_ratio < 0.5)) faults.add("poisson_ratio is {:.6g}, outside -1 to 0.5", m.poisson_ratio);
  if (!(m.density_kg_m3 > 0.0)) faults.add("density_kg_m3 is {:.6g}, not positive", m.density_kg_m3);
  if (!(m.alpha1_s >= 0.0)) faults.add("alpha1_s is {:.6g}, negative", m.alpha1_s);
  if (!(m.alpha2_per_s >= 0.0)) faults.add("alpha2_per_s is {:.6g}, negative", m.alpha2_per_s);
  const auto expect = [&](const char* name, double value, double min, double max) {
    if (value > 0.0 && !(value >= min && value <= max)) faults.add("{} is {:.3g}, outside {:.0e} to {:.0e}", name, value, min, max);
  };
  expect("young_modulus_pa", m.young_modulus_pa, material::kMinStiffnessPa, material::kMaxStiffnessPa);
  expect("density_kg_m3", m.density_kg_m3, material::kMinDensityKgM3, material::kMaxDensityKgM3);
  expect("alpha1_s", m.alpha1_s, 0.0, kMaxAlpha1S);
  expect("alpha2_per_s", m.alpha2_per_s, 0.0, kMaxAlpha2PerS);
  return {"material", fmt::format("E {:.4g} Pa, nu {:.4g}, rho {:.4g} kg/m^3", m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3),
          faults.take()};
}

Check check_sensitivities(const Bank& bank) {
  const Sensitivities& s = bank.sensitivities;
  Faults faults;
  if (const std::string fault = find_fault(s, bank.vertex_count(), bank.mode_count()); !fault.empty()) faults.add("{}", fault);
  return {"sensitivities",
          fmt::format("{} modes, {} pairs, {} parameters", s.count, s.column_count() - s.count,
                      s.by_parameter.size() / std::max<std::size_t>(s.count, 1)),
          faults.take()};
}

Check check_solve(const Bank& bank) {
  Faults faults;
  const Counts& counts = bank.counts;
  if (bank.element != "T4" && bank.element != "T10" && bank.element != "analytic" && bank.element != "imported")
    faults.add("element is neither T4 nor T10 nor analytic nor imported");
  if (bank.mass != "consistent" && bank.mass != "lumped") faults.add("mass is neither consistent nor lumped");
  if (counts.nodes < static_cast<std::int64_t>(bank.vertex_count()))
    faults.add("{} nodes are fewer than the vertices of the surface", counts.nodes);
  if (counts.tets < 1) faults.add("{} tetrahedra", counts.tets);
  if (counts.components < 1 || counts.components > counts.tets)
    faults.add("{} connected components of {} tetrahedra", counts.components, counts.tets);
  if (counts.rigid_modes < 0 || counts.rigid_modes / 6 > counts.components ||
      (counts.rigid_modes / 6 == counts.components && counts.rigid_modes % 6 != 0)) {
    faults.add("{} rigid modes of {} components", counts.rigid_modes, counts.components);
  }
  if (bank.element == "imported")
    return {"solve", fmt::format("none here: modes of another program at {} points, {} rigid modes", counts.nodes, counts.rigid_modes),
            faults.take()};
  if (bank.element == "analytic")
    return {"solve", fmt::format("known modes at {} points, {} rigid modes", counts.nodes, counts.rigid_modes), faults.take()};
  return {"solve",
          fmt::format("{} elements, {} mass, {} nodes, {} tets, {} rigid modes", bank.element, bank.mass, counts.nodes, counts.tets,
                      counts.rigid_modes),
          faults.take()};
}

}  // namespace

std::vector<Check> calc_checks(const Bank& bank) {
  std::vector<Check> checks{check_arrays(bank)};
  if (!checks[0].faults.empty()) return checks;
  for (const auto check : {check_numbers, check_eigenvalues, check_band, check_decay, check_corrected, check_residuals, check_radiation,
                           check_shapes, check_surface, check_rigid_body, check_supports, check_material, check_solve, check_quartic}) {
    checks.push_back(check(bank));
  }
  checks.push_back(check_error_bars(bank));
  for (Check& check : check_proof(bank)) checks.push_back(std::move(check));
  if (!bank.sensitivities.is_empty()) checks.push_back(check_sensitivities(bank));
  if (bank.packing) checks.push_back(check_packing(bank));
  return checks;
}

std::vector<std::string> find_faults(const Bank& bank) {
  std::vector<std::string> faults;
  for (Check& check : calc_checks(bank)) faults.insert(faults.end(), check.faults.begin(), check.faults.end());
  return faults;
}

}  // namespace carillon::bank
