// Method: reverse water-filling: all modes share the error equally, weighted by audibility; a mode's step is inverse to the root of its
//   exposure. Steps at a vertex are proportional to the root of the audible energy of a blow there. Coding: runtime/bank/packed. The steps
//   are scaled until the decoded error equals the requested one.
// Source: reverse water-filling: Cover and Thomas, Elements of Information Theory, 10.3.3.
// Deviations: exposures of modes add, as in calc_audibility().
#include "runtime/bank/pack.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <numeric>
#include <utility>

#include "runtime/bank/packed/fit_shapes.hpp"
#include "runtime/bank/packed/levels.hpp"
#include "runtime/bank/packed/surface.hpp"
#include "runtime/bank/packing_error.hpp"
#include "runtime/bank/surface.hpp"

namespace carillon::bank {
namespace {

constexpr double kLatticePerSize = 1 << 20;  // lattice steps per body size: flat faces stay flat to contact
constexpr double kLatticePerEdge = 8.0;      // at least, per shortest edge
constexpr double kMostLattice = 1 << 22;
// Maximum step of a mode over its mean motion: so that none vanishes, and, per root of the error, so that soft blows, which leave only
// modes that are hardly heard, keep their sound.
constexpr double kMaxRelativeStep = 1.0, kMaxStepPerError = 560.0;
constexpr double kCavityFactor = 16.0;  // permitted error of inner walls over that of the outer surface
constexpr double kSurfaceShare = 0.95;  // fraction of the surface within the stated error
constexpr double kMaxSlackDb = 0.8;     // dB below the requested error: converged
constexpr int kMaxSampledTrials = 5, kMaxNearTrials = 3,
              kMaxTrials = 20;                            // trials on a sample; on all vertices until near; on all vertices
constexpr std::size_t kSubsampling = 8;                   // subsampling of the finest level in sampled trials
constexpr double kFirstOffsetDb = -5.0;                   // offset of the first trial from the request
constexpr double kNextIsNearDb = 3.0;                     // miss of a trial after which the next is expected to be near
constexpr double kMaxStepDb = 20.0, kRefinementDb = 2.0;  // step limit of the secant method; step without it [dB]
constexpr std::size_t kWitnesses = 24;

/// Appends the row (m, 3) of a vertex to `shape`.
void append_row(const Bank& bank, std::int32_t vertex, std::vector<std::int16_t>& shape) {
  const std::size_t width = 3 * bank.mode_count();
  const auto row = bank.shape.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(vertex) * width);
  shape.insert(shape.end(), row, row + static_cast<std::ptrdiff_t>(width));
}

/// Removes vertices without triangles.
Bank drop_unused(const Bank& bank) {
  std::vector<std::int32_t> moved(bank.vertex_count(), -1);
  for (const Triangle& triangle : bank.triangles)
    for (const std::int32_t v : triangle) moved[v] = 0;
  if (std::find(moved.begin(), moved.end(), -1) == moved.end()) return bank;
  Bank used = bank;
  used.vertices_m.clear();
  used.shape.clear();
  for (std::size_t v = 0; v < moved.size(); ++v) {
    if (moved[v] < 0) continue;
    moved[v] = static_cast<std::int32_t>(used.vertices_m.size());
    used.vertices_m.push_back(bank.vertices_m[v]);
    append_row(bank, static_cast<std::int32_t>(v), used.shape);
  }
  for (Triangle& triangle : used.triangles)
    for (std::int32_t& v : triangle) v = moved[v];
  for (std::int32_t& v : used.sensitivities.vertex) v = moved[v];
  return used;
}

/// Bank with its surface as packed, and the surface's bytes.
struct PackedSurface {
  Bank bank;  // vertices on the lattice; original shapes
  std::vector<std::uint8_t> bytes, order;
  packed::Surface surface;
};

/// Original triangle order of `surface`, the surface of a bank whose vertices are now at `moved`.
packed::TriangleOrder find_triangle_order(const packed::Surface& surface, const std::vector<std::int32_t>& before,
                                          const std::vector<Triangle>& triangles, const std::vector<std::int32_t>& moved) {
  packed::TriangleOrder order{before, {}};
  for (std::size_t i = 0; i < before.size(); ++i) {
    const std::int32_t corner = moved[triangles[before[i]][0]];
    const Triangle& now = surface.triangles[i];
    order.first.push_back(static_cast<std::uint8_t>(std::find(now.begin(), now.end(), corner) - now.begin()));
  }
  return order;
}

PackedSurface pack_surface(const Bank& original, bool keep_numbers) {
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
  std::vector<packed::Place> places(bank.vertex_count());
  for (std::size_t v = 0; v < places.size(); ++v)
    for (std::size_t k = 0; k < 3; ++k) places[v][k] = static_cast<std::int32_t>(std::lround((bank.vertices_m[v][k] - low[k]) / step_m));
  const packed::WrittenSurface written =
      packed::write_surface(low, step_m, places, bank.triangles, packed::find_levels(bank.vertices_m, area_m2));
  std::vector<std::int16_t> shape;
  shape.reserve(bank.shape.size());
  for (const std::int32_t v : written.vertices) append_row(bank, v, shape);
  bank.shape = std::move(shape);
  packed::Surface surface = packed::read_surface(std::as_bytes(std::span(written.bytes)), "the packed surface");
  std::vector<std::int32_t> moved(bank.vertex_count());
  for (std::size_t v = 0; v < moved.size(); ++v) moved[written.vertices[v]] = static_cast<std::int32_t>(v);
  for (std::int32_t& v : bank.sensitivities.vertex) v = moved[v];
  std::vector<std::uint8_t> order;
  if (keep_numbers) {
    order = packed::write_order(find_triangle_order(surface, written.triangles, bank.triangles, moved));
  }
  bank.triangles = surface.triangles;
  if (keep_numbers) packed::restore_order(std::as_bytes(std::span(order)), bank.triangles, "the packed surface");
  for (std::size_t v = 0; v < bank.vertex_count(); ++v) bank.vertices_m[v] = surface.find_vertex(v);
  return {std::move(bank), written.bytes, std::move(order), std::move(surface)};
}

/// Mean motion of each mode along an axis (m) [kg^-1/2]; one step for a mode at rest on the surface.
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

/// Steps that give each mode an equal share of `error` times the audible energy `loudest` at the loudest vertex [kg^-1/2].
std::vector<float> calc_steps(const Bank& bank, const std::vector<double>& motion, const std::vector<double>& weight, double loudest,
                              double error) {
  const double share = 12.0 * error * loudest / static_cast<double>(bank.mode_count());
  std::vector<float> step;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double most = std::min(kMaxRelativeStep, kMaxStepPerError * std::sqrt(error)) * motion[m];
    const double wanted = weight[m] > 0.0 ? bank.shape_scale[m] * std::sqrt(share / weight[m]) : most;
    step.push_back(static_cast<float>(std::min(wanted, most)));
  }
  return step;
}

/// Refinement (V) relative to the loudest vertex: root of the audible energy.
std::vector<std::uint8_t> calc_fineness(const std::vector<double>& exposure, double loudest) {
  std::vector<std::uint8_t> fineness;
  for (const double heard : exposure) {
    const double halvings = heard > 0.0 ? std::log2(loudest / heard) : 0.0;
    fineness.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(halvings), 0L, static_cast<long>(packed::kMaxFineness))));
  }
  return fineness;
}

/// Vertices of a bank, and their surface without triangles: all, or the coarser levels and a sample of the finest.
struct Sample {
  packed::Surface surface;
  std::vector<std::int32_t> vertices;
  std::vector<double> area_m2;  // for which each stands

  Sample(const packed::Surface& whole, const std::vector<double>& area_m2_of_all, std::size_t subsampling) {
    const std::size_t levels = whole.level_count(), finest = whole.level_begin[levels - 1];
    surface = {whole.origin_m, whole.step_m, {}, {}, {whole.level_begin.begin(), whole.level_begin.end() - 1}};
    for (std::size_t v = 0; v < whole.places.size(); v += v < finest ? 1 : subsampling) {
      surface.places.push_back(whole.places[v]);
      vertices.push_back(static_cast<std::int32_t>(v));
      area_m2.push_back(area_m2_of_all[v] * (v < finest ? 1.0 : static_cast<double>(subsampling)));
    }
    surface.level_begin.push_back(vertices.size());
  }
};

/// Error of shapes (n, m, 3) at n vertices that stand for the areas (n). Without witnesses.
Packing calc_error(const Bank& bank, const Blows& blows, const std::vector<std::int32_t>& vertices, const std::vector<double>& area_m2,
                   const std::vector<std::int16_t>& shape) {
  std::vector<std::pair<double, double>> errors;  // [dB], area
  double area = 0.0;
  const std::size_t width = 3 * bank.mode_count();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::size_t v = vertices[i];
    if (!(area_m2[i] > 0.0)) continue;
    const double missed = calc_heard(blows.weight, blows.skin.normal[v], bank.shape.data() + v * width, shape.data() + i * width);
    errors.emplace_back(calc_db(missed, blows.exposure[v]), area_m2[i]);
    area += area_m2[i];
  }
  std::sort(errors.begin(), errors.end());
  Packing packing;
  packing.error_db = packing.worst_db = errors.empty() ? kExactDb : errors.back().first;
  double above = 0.0;
  for (std::size_t i = errors.size(); i-- > 0 && above <= (1.0 - kSurfaceShare) * area; above += errors[i].second)
    packing.error_db = errors[i].first;
  return packing;
}

/// First vertex of each of `count` equal parts of the outer area.
std::vector<std::int32_t> choose_witnesses(const StruckSkin& skin, std::size_t count) {
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

/// Secant search for the step scale that gives the requested error.
class Packer {
 public:
  Packer(const Bank& bank, const packed::Surface& surface)
      : bank_(bank), blows_(bank), motion_(calc_motion(bank)), all_(surface, blows_.skin.area_m2, 1) {
    std::vector<double> exposure = blows_.exposure;
    for (std::size_t v = 0; v < exposure.size(); ++v) {
      if (!(blows_.skin.area_m2[v] > 0.0)) exposure[v] *= kCavityFactor;
      loudest_ = std::max(loudest_, exposure[v]);
    }
    fineness_ = calc_fineness(exposure, loudest_);
  }

  struct Packed {
    std::vector<std::uint8_t> bytes;
    std::vector<std::int16_t> shape;  // as decoded
    Packing packing;
  };
  Packed run(double error_db) {
    const auto is_near = [&](double found_db) { return found_db <= error_db && found_db > error_db - kMaxSlackDb; };
    double asked_db = error_db + kFirstOffsetDb, before_db = 0.0, found_before_db = 0.0;
    const auto find_next = [&](int tries, double found_db) {
      const double slope = tries > 0 && asked_db != before_db ? (found_db - found_before_db) / (asked_db - before_db) : 1.0;
      before_db = asked_db;
      found_before_db = found_db;
      asked_db += std::clamp((error_db - 0.5 * kMaxSlackDb - found_db) / std::clamp(slope, 0.4, 1.5), -kMaxStepDb, kMaxStepDb);
    };
    if (all_.surface.level_count() > 1) {
      const Sample sample(all_.surface, blows_.skin.area_m2, kSubsampling);
      for (int tries = 0; tries < kMaxSampledTrials; ++tries) {
        const double found_db = try_sampled(asked_db, sample);
        if (is_near(found_db)) break;
        find_next(tries, found_db);
        if (std::abs(found_db - error_db) < kNextIsNearDb) break;
      }
    }
    Packed best;
    double least_db = std::numeric_limits<double>::infinity();
    for (int tries = 0; tries < kMaxTrials; ++tries) {
      Packed found = try_whole(asked_db);
      const double found_db = found.packing.error_db;
      least_db = std::min(least_db, found_db);
      if (found_db <= error_db && (best.bytes.empty() || found.bytes.size() < best.bytes.size())) best = std::move(found);
      if (is_near(found_db) || (tries >= kMaxNearTrials && !best.bytes.empty())) break;
      if (tries < kMaxNearTrials)
        find_next(tries, found_db);
      else
        asked_db -= std::max(kRefinementDb, found_db - error_db);  // with few vertices the error is not smooth
    }
    if (best.bytes.empty())
      throw InputError(fmt::format("an error of {} dB(A) cannot be reached, the least that was found is {:.1f}; use the bank as it is",
                                   error_db, least_db));
    best.packing.witness = choose_witnesses(blows_.skin, kWitnesses);
    for (const std::int32_t v : best.packing.witness) append_row(bank_, v, best.packing.witness_shape);
    return best;
  }

 private:
  std::vector<float> make_steps(double asked_db) const {
    return calc_steps(bank_, motion_, blows_.weight, loudest_, std::pow(10.0, asked_db / 10.0));
  }

  packed::FittedShapes fit(const Sample& sample, const std::vector<float>& step) const {
    const std::size_t modes = bank_.mode_count();
    std::vector<std::uint8_t> fineness;
    for (const std::int32_t v : sample.vertices) fineness.push_back(fineness_[v]);
    std::vector<float> per_step;
    for (std::size_t m = 0; m < modes; ++m)
      per_step.push_back(step[m] > 0.0F ? static_cast<float>(bank_.shape_scale[m] / static_cast<double>(step[m])) : 0.0F);
    const std::vector<float> factor = packed::calc_factors(step, bank_.shape_scale);
    return packed::fit_shapes(sample.surface, modes, fineness, factor, [&](std::size_t v, std::span<float> row) {
      const std::int16_t* shape = bank_.shape.data() + 3 * modes * static_cast<std::size_t>(sample.vertices[v]);
      const std::size_t padded = row.size() / 3;
      for (std::size_t m = 0; m < modes; ++m)
        for (std::size_t c = 0; c < 3; ++c) row[c * padded + m] = static_cast<float>(*shape++) * per_step[m];
    });
  }

  double try_sampled(double asked_db, const Sample& sample) const {
    const std::vector<float> step = make_steps(asked_db);
    return calc_error(bank_, blows_, sample.vertices, sample.area_m2, fit(sample, step).shape).error_db;
  }

  Packed try_whole(double asked_db) const {
    const std::vector<float> step = make_steps(asked_db);
    Packed packed;
    packed::FittedShapes fitted = fit(all_, step);
    packed.bytes = packed::write_shapes(step, fitted.levels);
    packed.shape = std::move(fitted.shape);
    packed.packing = calc_error(bank_, blows_, all_.vertices, all_.area_m2, packed.shape);
    return packed;
  }

  const Bank& bank_;
  Blows blows_;
  std::vector<double> motion_;
  Sample all_;
  double loudest_ = 0.0;  // over all vertices, cavity walls weighted
  std::vector<std::uint8_t> fineness_;
};

}  // namespace

PackedBank calc_packed(const Bank& bank, double error_db, bool keep_numbers) {
  if (!(error_db >= kMinPackError && error_db <= kMaxPackError))
    throw InputError(fmt::format("an error of {} dB(A); give {} to {}", error_db, kMinPackError, kMaxPackError));
  if (bank.mode_count() == 0) throw InputError("a bank without modes has nothing to pack; use it as it is");
  PackedSurface at_places = pack_surface(bank, keep_numbers);
  Packer::Packed found = Packer(at_places.bank, at_places.surface).run(error_db);
  Packing& packing = found.packing;
  PackedBank packed{std::move(at_places.bank), std::move(at_places.bytes), std::move(found.bytes), std::move(at_places.order)};
  packed.bank.shape = std::move(found.shape);
  packed.bank.shape_bytes = 2;
  packed.bank.provenance = fmt::format(R"({{"packed": {{"error_db": {:.2f}, "worst_db": {:.2f}}})", packing.error_db, packing.worst_db) +
                           (bank.provenance.empty() ? "}" : fmt::format(R"(, "of": {}}})", bank.provenance));
  packed.bank.packing = std::move(packing);
  return packed;
}

std::optional<PackedBank> try_packed(const Bank& bank, std::string& why) {
  constexpr std::size_t kSmallBytes = 1'000'000;
  if (bank.packing)
    why = "packed already";
  else if (bank.shape.size() * sizeof(std::int16_t) < kSmallBytes)
    why = "below 1 MB";
  else if (!find_faults(bank).empty())
    why = "the bank has faults";
  if (!why.empty()) return {};
  try {
    return calc_packed(bank, kPackError, true);
  } catch (const InputError& fault) {
    why = fault.what();
  } catch (const SystemError& fault) {
    why = fault.what();
  } catch (const std::bad_alloc&) {
    why = "too little memory";
  }
  return {};
}

Packing compare_packed(const Bank& packed, const Bank& original) {
  Bank exact = pack_surface(original, false).bank;
  if (packed.triangles != exact.triangles) exact = pack_surface(original, true).bank;
  if (packed.mode_count() != exact.mode_count() || packed.vertices_m != exact.vertices_m || packed.triangles != exact.triangles)
    throw InputError(
        fmt::format("{} vertices, {} triangles and {} modes are not those of the original packed ({}, {} and {}); give the bank that was "
                    "packed",
                    packed.vertex_count(), packed.triangles.size(), packed.mode_count(), exact.vertex_count(), exact.triangles.size(),
                    exact.mode_count()));
  const Blows blows(exact);
  std::vector<std::int32_t> all(exact.vertex_count());
  std::iota(all.begin(), all.end(), 0);
  return calc_error(exact, blows, all, blows.skin.area_m2, packed.shape);
}

Check check_original(const Bank& packed, const Bank& original) {
  const Packing found = compare_packed(packed, original);
  Check check{"original", describe(found), {}};
  if (found.error_db > packed.packing->error_db + kRoundingDb || found.worst_db > packed.packing->worst_db + kRoundingDb)
    check.faults.push_back(fmt::format("{}; less is stated: {}", describe(found), describe(*packed.packing)));
  return check;
}

}  // namespace carillon::bank
