#include "precompute/analytic/known_body.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "precompute/analytic/flat_bodies.hpp"
#include "precompute/analytic/line_bodies.hpp"
#include "precompute/analytic/measured.hpp"
#include "precompute/analytic/polygon.hpp"
#include "runtime/base/error.hpp"

namespace carillon::analytic {
namespace {

std::unique_ptr<KnownBody> make(const job::StringBody& body, const material::Material& material) {
  return std::make_unique<String>(body, material);
}

std::unique_ptr<KnownBody> make(const job::BeamBody& body, const material::Material& material) {
  return std::make_unique<Beam>(body, material);
}

std::unique_ptr<KnownBody> make(const job::MembraneBody& body, const material::Material& material) {
  if (body.shape == "rectangle") return std::make_unique<SineRectangle>(body, material);
  if (body.shape == "circle") return std::make_unique<Circle>(body, material);
  return std::make_unique<Polygon>(body, material);
}

std::unique_ptr<KnownBody> make(const job::PlateBody& body, const material::Material& material) {
  if (body.shape == "circle") return std::make_unique<Circle>(body, material);
  const bool is_hinged = std::all_of(body.edges.begin(), body.edges.end(), [](job::Edge edge) { return edge == job::Edge::hinged; });
  if (is_hinged) return std::make_unique<SineRectangle>(body, material);
  return std::make_unique<RitzPlate>(body, material);
}

std::unique_ptr<KnownBody> make(const job::MeasuredBody& body, const material::Material&) { return std::make_unique<MeasuredObject>(body); }

}  // namespace

std::unique_ptr<KnownBody> make_known_body(const job::AnalyticBody& body, const material::Material& material) {
  if (material.orthotropic && body.kind.index() != 4)
    throw InputError("the formulas are for isotropic materials, and \"" + material.name +
                     "\" is not; choose another, or finite elements (\"shape\")");
  return std::visit([&](const auto& kind) { return make(kind, material); }, body.kind);
}

void check_mode_count(double count, double high_hz) {
  if (!(count <= kMaxListed))
    throw InputError(
        fmt::format("there are about {:.2g} modes up to {:g} Hz, more than {:g}; lower the end of \"band_hz\", or give \"max_modes\"",
                    count, high_hz, kMaxListed));
}

}  // namespace carillon::analytic
