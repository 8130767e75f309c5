#include "runtime/bank/packing_error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/pack.hpp"
#include "runtime/bank/reduce.hpp"
#include "runtime/bank/surface.hpp"

namespace carillon::bank {
namespace {

constexpr double kOffNormal = 0.0027;   // sin^2 of 3 degrees: assumed tilt of blows against the normal
constexpr double kQuietest = 0x1p-20;   // -60 dB: floor of audible energy, relative to the loudest place
constexpr double kWitnessShare = 0.25;  // largest share of witnesses above the stated error

StruckSkin find_skin(const Bank& bank) {
  StruckSkin skin{std::vector<double>(bank.vertex_count(), 0.0), std::vector<Vec3>(bank.vertex_count(), Vec3{})};
  for (const Triangle& triangle : bank.triangles) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    for (const std::int32_t v : triangle) skin.normal[v] = skin.normal[v] + normal;
  }
  for (Vec3& normal : skin.normal)
    if (const double length = norm(normal); length > 0.0) normal = (1.0 / length) * normal;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles))
    for (const std::int32_t v : triangle)
      if (norm(skin.normal[v]) > 0.0) skin.area_m2[v] += norm(calc_normal(bank.vertices_m, triangle)) / 6.0;
  return skin;
}

/// Audible energy of a mode of shape `x` after a blow of unit weight.
double calc_heard(const Vec3& normal, const Vec3& x) {
  const double along = dot(x, normal);
  return along * along + kOffNormal * dot(x, x);
}
/// calc_blow_exposure() for shapes in steps; equal weights for an inaudible body.
std::vector<double> calc_weights(const Bank& bank) {
  std::vector<double> weight = calc_blow_exposure(bank);
  if (std::all_of(weight.begin(), weight.end(), [](double w) { return !(w > 0.0); })) std::fill(weight.begin(), weight.end(), 1.0);
  for (std::size_t m = 0; m < weight.size(); ++m) weight[m] *= bank.shape_scale[m] * bank.shape_scale[m];
  return weight;
}

}  // namespace

double calc_db(double error, double signal) {
  return error > 0.0 ? std::max(10.0 * std::log10(error / std::max(signal, std::numeric_limits<double>::min())), kExactDb) : kExactDb;
}

double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape) {
  double heard = 0.0;
  for (const double w : weight) {
    heard += w * calc_heard(normal, {double(shape[0]), double(shape[1]), double(shape[2])});
    shape += 3;
  }
  return heard;
}
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape, const std::int16_t* other) {
  double heard = 0.0;
  for (const double w : weight) {
    heard += w * calc_heard(normal, {double(shape[0] - other[0]), double(shape[1] - other[1]), double(shape[2] - other[2])});
    shape += 3;
    other += 3;
  }
  return heard;
}

Blows::Blows(const Bank& bank) : skin(find_skin(bank)), weight(calc_weights(bank)), exposure(bank.vertex_count()) {
  for (std::size_t v = 0; v < exposure.size(); ++v) {
    exposure[v] = calc_heard(weight, skin.normal[v], bank.get_steps(v));
    if (skin.area_m2[v] > 0.0) quietest = std::max(quietest, kQuietest * exposure[v]);
  }
  for (double& heard : exposure) heard = std::max(heard, quietest);
}

std::string describe(const Packing& packing) {
  if (packing.worst_db <= kExactDb) return "no error";
  return fmt::format("error at most {:.1f} dB(A) on 95 % of the surface, {:.1f} at the worst place", packing.error_db, packing.worst_db);
}

Check check_packing(const Bank& bank) {
  const Packing& packing = *bank.packing;
  Check check{"packing", describe(packing), {}};
  const auto is_vertex = [&](std::int32_t v) { return v >= 0 && static_cast<std::size_t>(v) < bank.vertex_count(); };
  if (!std::all_of(packing.witness.begin(), packing.witness.end(), is_vertex) ||
      packing.witness_shape.size() != packing.witness.size() * bank.mode_count() * 3) {
    check.faults.push_back("the witnesses are not vertices with the shapes of all modes");
    return check;
  }
  const Blows blows(bank);
  std::size_t above = 0;
  double worst_db = kExactDb;
  for (std::size_t i = 0; i < packing.witness.size(); ++i) {
    const std::size_t v = packing.witness[i];
    const std::int16_t* own = packing.witness_shape.data() + i * bank.mode_count() * 3;
    const Vec3& normal = blows.skin.normal[v];
    const double missed = calc_heard(blows.weight, normal, own, bank.get_steps(v));
    const double here_db = calc_db(missed, std::max(calc_heard(blows.weight, normal, own), blows.quietest));
    worst_db = std::max(worst_db, here_db);
    if (here_db > packing.error_db + kRoundingDb) ++above;
    if (here_db > packing.worst_db + kRoundingDb)
      check.faults.push_back(
          fmt::format("the error is {:.1f} dB(A) at vertex {}, the recorded maximum is {:.1f}", here_db, v, packing.worst_db));
  }
  check.figure += fmt::format("; {:.1f} at the worst of {} witnesses", worst_db, packing.witness.size());
  if (static_cast<double>(above) > kWitnessShare * static_cast<double>(packing.witness.size()))
    check.faults.push_back(
        fmt::format("the error is greater than {:.1f} dB(A) at {} of {} witnesses", packing.error_db, above, packing.witness.size()));
  return check;
}

}  // namespace carillon::bank
