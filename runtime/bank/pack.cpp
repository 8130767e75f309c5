// Method:     all modes share the error equally, each weighed by what is heard of it (reverse water-filling), so a mode's step is inverse
// to
//             the root of its exposure; runtime/codec does the rest. The steps are scaled until the error that a reader finds is the one
//             that was asked for.
// Source:     reverse water-filling: Cover and Thomas, Elements of Information Theory, 10.3.3.
// Deviations: the exposures of modes add, as in calc_audibility().
#include "runtime/bank/pack.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/bank/reduce.hpp"
#include "runtime/bank/surface.hpp"
#include "runtime/codec/fit_shapes.hpp"
#include "runtime/codec/levels.hpp"
#include "runtime/codec/surface.hpp"

namespace carillon::bank {
namespace {

constexpr double kLatticePerSize = 32768.0, kLatticePerEdge = 8.0;  // steps of the lattice in the body's size, in its shortest edge
constexpr double kMostLattice = 1 << 22;
constexpr double kMostStep = 1.0;    // of a mode, over the mean motion of its vertices: none vanishes
constexpr double kNearEnough = 0.4;  // dB that the error may stay below what was asked for
constexpr int kMostTries = 5;
constexpr std::size_t kWitnesses = 24;
constexpr double kSampleDb = 3.0;  // how much more than the mean the mean of the witnesses may be

constexpr double kExactDb = -200.0;  // stands for no error at all

double calc_db(double error, double signal) {
  return error > 0.0 ? std::max(10.0 * std::log10(error / std::max(signal, std::numeric_limits<double>::min())), kExactDb) : kExactDb;
}

/// The places where a body is struck: vertices of the outer surface, their shares of its area, and their normals. Vertices of no area, and
/// those of other surfaces, have none.
struct Skin {
  std::vector<double> area_m2;
  std::vector<Vec3> normal;
};

Skin find_skin(const Bank& bank) {
  Skin skin{std::vector<double>(bank.vertex_count(), 0.0), std::vector<Vec3>(bank.vertex_count(), Vec3{})};
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    for (const std::int32_t v : triangle) {
      skin.area_m2[static_cast<std::size_t>(v)] += norm(normal) / 6.0;
      skin.normal[static_cast<std::size_t>(v)] = skin.normal[static_cast<std::size_t>(v)] + normal;
    }
  }
  for (std::size_t v = 0; v < skin.normal.size(); ++v) {
    const double length = norm(skin.normal[v]);
    if (length > 0.0)
      skin.normal[v] = (1.0 / length) * skin.normal[v];
    else
      skin.area_m2[v] = 0.0;
  }
  return skin;
}

/// What is heard of a blow at a vertex with these shapes (m, 3) [steps of shape_scale].
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape) {
  double heard = 0.0;
  for (const double w : weight) {
    const double along = shape[0] * normal[0] + shape[1] * normal[1] + shape[2] * normal[2];
    heard += w * along * along;
    shape += 3;
  }
  return heard;
}
double calc_heard(const std::vector<double>& weight, const Vec3& normal, const std::int16_t* shape, const std::int16_t* other) {
  double heard = 0.0;
  for (const double w : weight) {
    const double along = (shape[0] - other[0]) * normal[0] + (shape[1] - other[1]) * normal[1] + (shape[2] - other[2]) * normal[2];
    heard += w * along * along;
    shape += 3;
    other += 3;
  }
  return heard;
}

/// calc_blow_exposure() for shapes in steps. Where nothing is heard, all modes count alike.
std::vector<double> calc_weights(const Bank& bank) {
  std::vector<double> weight = calc_blow_exposure(bank);
  if (std::all_of(weight.begin(), weight.end(), [](double w) { return !(w > 0.0); })) std::fill(weight.begin(), weight.end(), 1.0);
  for (std::size_t m = 0; m < weight.size(); ++m) weight[m] *= bank.shape_scale[m] * bank.shape_scale[m];
  return weight;
}

/// The bank without vertices that no triangle has.
Bank drop_unused(const Bank& bank) {
  std::vector<std::int32_t> moved(bank.vertex_count(), -1);
  for (const Triangle& triangle : bank.triangles)
    for (const std::int32_t v : triangle) moved[static_cast<std::size_t>(v)] = 0;
  if (std::find(moved.begin(), moved.end(), -1) == moved.end()) return bank;
  Bank used = bank;
  used.vertices_m.clear();
  used.shape.clear();
  const std::size_t width = 3 * bank.mode_count();
  for (std::size_t v = 0; v < moved.size(); ++v) {
    if (moved[v] < 0) continue;
    moved[v] = static_cast<std::int32_t>(used.vertices_m.size());
    used.vertices_m.push_back(bank.vertices_m[v]);
    const auto row = bank.shape.begin() + static_cast<std::ptrdiff_t>(v * width);
    used.shape.insert(used.shape.end(), row, row + static_cast<std::ptrdiff_t>(width));
  }
  for (Triangle& triangle : used.triangles)
    for (std::int32_t& v : triangle) v = moved[static_cast<std::size_t>(v)];
  return used;
}

/// A bank whose surface is that of a packed one, and its bytes.
struct PackedSurface {
  Bank bank;  // vertices on the lattice; shapes as they were
  std::vector<std::uint8_t> bytes;
  codec::Surface surface;
};

PackedSurface pack_surface(const Bank& original) {
  Bank bank = drop_unused(original);
  bank.packing.reset();
  const auto [low, high] = find_extent(bank.vertices_m);
  double size_m = 0.0, shortest_m = std::numeric_limits<double>::infinity(), area_m2 = 0.0;
  for (std::size_t k = 0; k < 3; ++k) size_m = std::max(size_m, high[k] - low[k]);
  for (const Triangle& t : bank.triangles) {
    area_m2 += 0.5 * norm(calc_normal(bank.vertices_m, t));
    for (std::size_t k = 0; k < 3; ++k)
      if (const double edge_m = norm(bank.vertices_m[t[k]] - bank.vertices_m[t[(k + 1) % 3]]); edge_m > 0.0)
        shortest_m = std::min(shortest_m, edge_m);
  }
  const double step_m = std::max(std::min(size_m / kLatticePerSize, shortest_m / kLatticePerEdge), size_m / kMostLattice);
  std::vector<codec::Place> places(bank.vertex_count());
  for (std::size_t v = 0; v < places.size(); ++v)
    for (std::size_t k = 0; k < 3; ++k) places[v][k] = static_cast<std::int32_t>(std::lround((bank.vertices_m[v][k] - low[k]) / step_m));
  const codec::WrittenSurface written =
      codec::write_surface(low, step_m, places, bank.triangles, codec::find_levels(bank.vertices_m, area_m2));
  const std::size_t width = 3 * bank.mode_count();
  std::vector<std::int16_t> shape;
  shape.reserve(bank.shape.size());
  for (const std::int32_t v : written.vertices) {
    const auto row = bank.shape.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(v) * width);
    shape.insert(shape.end(), row, row + static_cast<std::ptrdiff_t>(width));
  }
  bank.shape = std::move(shape);
  codec::Surface surface = codec::read_surface(std::as_bytes(std::span(written.bytes)), "the packed surface");
  bank.triangles = surface.triangles;
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) bank.vertices_m[v] = surface.find_vertex(v);
  return {std::move(bank), written.bytes, std::move(surface)};
}

/// The mean motion of each mode along an axis (m) [kg^-1/2]; of a mode at rest on the surface a step.
std::vector<double> calc_motion(const Bank& bank) {
  const std::size_t modes = bank.mode_count();
  std::vector<double> motion(modes, 0.0);
  for (std::size_t i = 0; i < bank.shape.size(); ++i) motion[i / 3 % modes] += static_cast<double>(bank.shape[i]) * bank.shape[i];
  for (std::size_t m = 0; m < modes; ++m) {
    motion[m] = bank.shape_scale[m] * std::sqrt(motion[m] / (3.0 * static_cast<double>(bank.vertex_count())));
    if (!(motion[m] > 0.0)) motion[m] = bank.shape_scale[m];
  }
  return motion;
}

/// Steps that give each mode the same share of the error, of `error` times what is heard in all [kg^-1/2].
std::vector<float> calc_steps(const Bank& bank, const Skin& skin, const std::vector<double>& weight, double error) {
  double heard = 0.0, area = 0.0;
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    if (skin.area_m2[v] > 0.0) heard += skin.area_m2[v] * calc_heard(weight, skin.normal[v], &bank.shape[v * bank.mode_count() * 3]);
    area += skin.area_m2[v];
  }
  const double share = 12.0 * error * heard / std::max(area, std::numeric_limits<double>::min()) / static_cast<double>(bank.mode_count());
  const std::vector<double> motion = calc_motion(bank);
  std::vector<float> step;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double most = kMostStep * motion[m];
    const double wanted = weight[m] > 0.0 ? bank.shape_scale[m] * std::sqrt(share / weight[m]) : most;
    step.push_back(static_cast<float>(std::min(wanted, most)));
  }
  return step;
}

codec::Rows make_rows(const Bank& bank, const std::vector<float>& step) {
  codec::Rows rows(bank.vertex_count(), bank.mode_count());
  std::vector<float> row(rows.get_width(), 0.0F);
  std::vector<float> factor;
  for (std::size_t m = 0; m < bank.mode_count(); ++m)
    factor.push_back(step[m] > 0.0F ? static_cast<float>(bank.shape_scale[m] / static_cast<double>(step[m])) : 0.0F);
  const std::int16_t* shape = bank.shape.data();
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    for (std::size_t m = 0; m < bank.mode_count(); ++m)
      for (std::size_t c = 0; c < 3; ++c) row[c * rows.get_padded() + m] = static_cast<float>(*shape++) * factor[m];
    rows.append(row);
  }
  return rows;
}

/// Of each of `count` equal parts of the outer area, the vertex where it begins.
std::vector<std::int32_t> choose_witnesses(const Skin& skin, std::size_t count) {
  double area = 0.0, before = 0.0;
  for (const double a : skin.area_m2) area += a;
  std::vector<std::int32_t> witnesses;
  for (std::size_t v = 0; v < skin.area_m2.size(); ++v) {
    before += skin.area_m2[v];
    if (skin.area_m2[v] > 0.0 && before * static_cast<double>(count) > area * (static_cast<double>(witnesses.size()) + 0.5))
      witnesses.push_back(static_cast<std::int32_t>(v));
  }
  return witnesses;
}

}  // namespace

std::string describe(const Packing& packing) {
  return fmt::format("error {:.1f} dB(A) in the mean, {:.1f} at the worst place", packing.error_db, packing.worst_db);
}

Packing calc_pack_error(const Bank& bank, const std::vector<std::int16_t>& shape) {
  const Skin skin = find_skin(bank);
  const std::vector<double> weight = calc_weights(bank);
  double error = 0.0, signal = 0.0;
  Packing packing;
  packing.worst_db = kExactDb;
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) {
    if (!(skin.area_m2[v] > 0.0)) continue;
    const std::size_t row = v * bank.mode_count() * 3;
    const double own = calc_heard(weight, skin.normal[v], &bank.shape[row]);
    const double missed = calc_heard(weight, skin.normal[v], &bank.shape[row], &shape[row]);
    signal += skin.area_m2[v] * own;
    error += skin.area_m2[v] * missed;
    packing.worst_db = std::max(packing.worst_db, calc_db(missed, own));
  }
  packing.error_db = calc_db(error, signal);
  return packing;
}

PackedBank calc_packed(const Bank& bank, double error_db) {
  if (!(error_db >= kMinPackError && error_db <= kMaxPackError))
    throw InputError(fmt::format("an error of {} dB(A); give {} to {}", error_db, kMinPackError, kMaxPackError));
  if (bank.mode_count() == 0) throw InputError("a bank without modes has nothing to pack; use it as it is");
  const auto [exact, surface_bytes, surface] = pack_surface(bank);
  const Skin skin = find_skin(exact);
  const std::vector<double> weight = calc_weights(exact);
  PackedBank packed{exact, surface_bytes, {}};
  Packing packing;
  double error = std::pow(10.0, error_db / 10.0);
  for (int tries = 0; tries < kMostTries; ++tries) {
    const std::vector<float> step = calc_steps(exact, skin, weight, error);
    const codec::FittedShapes fitted = codec::fit_shapes(surface, make_rows(exact, step), exact.mode_count());
    packed.shape = codec::write_shapes(step, fitted.levels);
    packed.bank.shape = codec::read_shapes(std::as_bytes(std::span(packed.shape)), surface, exact.shape_scale, "the packed shapes");
    packing = calc_pack_error(exact, packed.bank.shape);
    if (packing.error_db <= error_db && (packing.error_db > error_db - kNearEnough || tries + 1 == kMostTries)) break;
    error *= std::pow(10.0, (error_db - 0.5 * kNearEnough - packing.error_db) / 10.0);
  }
  if (packing.error_db > error_db)
    throw InputError(
        fmt::format("an error of {} dB(A) cannot be reached, {:.1f} is the least; use the bank as it is", error_db, packing.error_db));

  packing.witness = choose_witnesses(skin, kWitnesses);
  for (const std::int32_t v : packing.witness) {
    const auto row = exact.shape.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(v) * exact.mode_count() * 3);
    packing.witness_shape.insert(packing.witness_shape.end(), row, row + static_cast<std::ptrdiff_t>(exact.mode_count() * 3));
  }
  packed.bank.shape_bytes = 2;
  packed.bank.provenance = fmt::format(R"({{"packed": {{"error_db": {:.2f}, "worst_db": {:.2f}}})", packing.error_db, packing.worst_db) +
                           (bank.provenance.empty() ? "}" : fmt::format(R"(, "of": {}}})", bank.provenance));
  packed.bank.packing = std::move(packing);
  return packed;
}

Packing compare_packed(const Bank& packed, const Bank& original) {
  const Bank exact = pack_surface(original).bank;
  if (packed.mode_count() != exact.mode_count() || packed.vertices_m != exact.vertices_m || packed.triangles != exact.triangles)
    throw InputError(fmt::format(
        "{} vertices, {} triangles and {} modes are not those of the original packed ({}, {} and {}); give the bank that was packed",
        packed.vertex_count(), packed.triangles.size(), packed.mode_count(), exact.vertex_count(), exact.triangles.size(),
        exact.mode_count()));
  return calc_pack_error(exact, packed.shape);
}

Check check_packing(const Bank& bank) {
  const Packing& packing = *bank.packing;
  Check check{"packing", describe(packing), {}};
  const Skin skin = find_skin(bank);
  const std::vector<double> weight = calc_weights(bank);
  double error = 0.0, signal = 0.0;
  for (std::size_t i = 0; i < packing.witness.size(); ++i) {
    const auto v = static_cast<std::size_t>(packing.witness[i]);
    const std::int16_t* own = &packing.witness_shape[i * bank.mode_count() * 3];
    const double heard = calc_heard(weight, skin.normal[v], own);
    const double missed = calc_heard(weight, skin.normal[v], own, &bank.shape[v * bank.mode_count() * 3]);
    error += missed;
    signal += heard;
    const double here_db = calc_db(missed, heard);
    if (here_db > packing.worst_db + 0.1)
      check.faults.push_back(
          fmt::format("the error is {:.1f} dB(A) at vertex {}, and {:.1f} is said to be the worst", here_db, v, packing.worst_db));
  }
  if (packing.witness.empty()) return check;
  const double mean_db = calc_db(error, signal);
  check.figure += fmt::format(", {:.1f} at {} witnesses", mean_db, packing.witness.size());
  if (mean_db > packing.error_db + kSampleDb)
    check.faults.push_back(
        fmt::format("the error is {:.1f} dB(A) at the witnesses, and {:.1f} is said to be the mean", mean_db, packing.error_db));
  return check;
}

}  // namespace carillon::bank
