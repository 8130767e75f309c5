// Method: bodies of revolution from a profile; spheres from an icosahedron, each triangle divided into four, four times.
#include "runtime/exchange/silent.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/used_points.hpp"
#include "runtime/exchange/solid.hpp"

namespace carillon::exchange {
namespace {

constexpr int kSides = 64, kArcSteps = 16, kDivisions = 4;
constexpr std::size_t kMaxSurfacePoints = 100'000'000;

struct ProfilePoint {
  double radius, height;
};

/// Turns a profile, from the lowest point up, about the y axis.
Surface revolve(std::vector<ProfilePoint> profile) {
  if (profile.front().radius > 0.0) profile.insert(profile.begin(), {0.0, profile.front().height});
  if (profile.back().radius > 0.0) profile.push_back({0.0, profile.back().height});
  const auto is_same = [](const ProfilePoint& a, const ProfilePoint& b) {
    return std::hypot(a.radius - b.radius, a.height - b.height) <= 1e-12;
  };
  profile.erase(std::unique(profile.begin(), profile.end(), is_same), profile.end());
  Surface surface;
  std::vector<std::int32_t> first;  // vertex of each point; followed by those around the axis
  for (const ProfilePoint& p : profile) {
    first.push_back(static_cast<std::int32_t>(surface.vertices_m.size()));
    const int count = p.radius > 0.0 ? kSides : 1;
    for (int k = 0; k < count; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / kSides;
      surface.vertices_m.push_back({p.radius * std::cos(angle), p.height, -p.radius * std::sin(angle)});
    }
  }
  for (std::size_t i = 0; i + 1 < profile.size(); ++i)
    for (int k = 0; k < kSides; ++k) {
      const auto at = [&](std::size_t row, int side) { return first[row] + (profile[row].radius > 0.0 ? side % kSides : 0); };
      const std::int32_t a = at(i, k), b = at(i, k + 1), c = at(i + 1, k), d = at(i + 1, k + 1);
      if (a != b) surface.triangles.push_back({a, b, d});
      if (c != d) surface.triangles.push_back({a, d, c});
    }
  return surface;
}

/// Arc about (0, middle) between two elevations [rad].
void add_arc(double radius, double middle, double from, double to, std::vector<ProfilePoint>& profile) {
  for (int k = 0; k <= kArcSteps; ++k) {
    const double angle = from + (to - from) * k / kArcSteps;
    const bool is_pole = std::abs(std::abs(angle) - 0.5 * std::numbers::pi) < 1e-9;
    profile.push_back({is_pole ? 0.0 : radius * std::cos(angle), middle + radius * std::sin(angle)});
  }
}

}  // namespace

Surface make_box(const Vec3& size_m) {
  Surface surface;
  for (int corner = 0; corner < 8; ++corner)
    surface.vertices_m.push_back(
        {(corner & 1 ? 0.5 : -0.5) * size_m[0], (corner & 2 ? 0.5 : -0.5) * size_m[1], (corner & 4 ? 0.5 : -0.5) * size_m[2]});
  constexpr std::array<std::array<std::int32_t, 4>, 6> kFaces{
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  for (const auto& f : kFaces) {
    surface.triangles.push_back({f[0], f[1], f[2]});
    surface.triangles.push_back({f[0], f[2], f[3]});
  }
  return surface;
}

Surface make_sphere(double radius_m) {
  constexpr double kGolden = std::numbers::phi;
  Surface surface;
  surface.vertices_m = {{-1, kGolden, 0},  {1, kGolden, 0},  {-1, -kGolden, 0}, {1, -kGolden, 0}, {0, -1, kGolden},  {0, 1, kGolden},
                        {0, -1, -kGolden}, {0, 1, -kGolden}, {kGolden, 0, -1},  {kGolden, 0, 1},  {-kGolden, 0, -1}, {-kGolden, 0, 1}};
  surface.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                       {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                       {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int division = 0; division < kDivisions; ++division) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
    const auto halve = [&](std::int32_t a, std::int32_t b) {
      const auto [entry, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(surface.vertices_m.size()));
      if (is_new) surface.vertices_m.push_back(0.5 * (normalise(surface.vertices_m[a]) + normalise(surface.vertices_m[b])));
      return entry->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : surface.triangles) {
      const std::int32_t ab = halve(a, b), bc = halve(b, c), ca = halve(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    surface.triangles = std::move(finer);
  }
  for (Vec3& v : surface.vertices_m) v = radius_m * normalise(v);
  return surface;
}

Surface make_cylinder(double height_m, double bottom_m, double top_m) {
  return revolve({{bottom_m, -0.5 * height_m}, {top_m, 0.5 * height_m}});
}

Surface make_capsule(double height_m, double bottom_m, double top_m) {
  if (std::abs(bottom_m - top_m) >= height_m) {  // one sphere holds the other
    Surface surface = make_sphere(std::max(bottom_m, top_m));
    for (Vec3& v : surface.vertices_m) v[1] += bottom_m > top_m ? -0.5 * height_m : 0.5 * height_m;
    return surface;
  }
  const double tilt = std::asin((bottom_m - top_m) / height_m), pole = 0.5 * std::numbers::pi;
  std::vector<ProfilePoint> profile;
  add_arc(bottom_m, -0.5 * height_m, -pole, tilt, profile);
  add_arc(top_m, 0.5 * height_m, tilt, pole, profile);
  return revolve(profile);
}

void weld(Surface& surface) {
  std::map<Vec3, std::int32_t> first;
  for (Triangle& triangle : surface.triangles)
    for (std::int32_t& v : triangle) v = first.try_emplace(surface.vertices_m[v], v).first->second;
  std::erase_if(surface.triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  const base::UsedPoints used = base::find_used_points(surface.triangles, surface.vertices_m.size());
  std::vector<Vec3> vertices;
  for (const std::int32_t v : used.points) vertices.push_back(surface.vertices_m[v]);
  for (Triangle& triangle : surface.triangles)
    for (std::int32_t& v : triangle) v = used.number[v];
  surface.vertices_m = std::move(vertices);
}

Surface parse_obj_surface(std::string_view bytes, const std::string& name) {
  Surface surface;
  std::size_t line_number = 0;
  const auto refuse = [&](const std::string& message) { throw InputError(fmt::format("{}:{}: {}", name, line_number, message)); };
  while (!bytes.empty()) {
    ++line_number;
    const std::size_t end = std::min(bytes.find('\n'), bytes.size());
    std::string_view line = bytes.substr(0, end);
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    const auto next = [&] {
      const std::size_t begin = std::min(line.find_first_not_of(" \t\r"), line.size());
      line.remove_prefix(begin);
      const std::string_view word = line.substr(0, std::min(line.find_first_of(" \t\r"), line.size()));
      line.remove_prefix(word.size());
      return word;
    };
    const std::string_view key = next();
    if (key == "v") {
      Vec3 point{};
      for (double& x : point) {
        const std::string_view word = next();
        const auto [at, error] = std::from_chars(word.data(), word.data() + word.size(), x);
        if (error != std::errc() || at != word.data() + word.size() || !std::isfinite(x)) refuse("a vertex needs three numbers: v X Y Z");
      }
      if (surface.vertices_m.size() >= kMaxSurfacePoints) refuse("there are too many vertices");
      surface.vertices_m.push_back(point);
    } else if (key == "f") {
      std::vector<std::int32_t> corners;
      for (std::string_view word = next(); !word.empty(); word = next()) {
        std::int64_t number = 0;
        const auto [at, error] = std::from_chars(word.data(), word.data() + word.size(), number);
        const auto count = static_cast<std::int64_t>(surface.vertices_m.size());
        if (number < 0) number += count + 1;
        if (error != std::errc() || (at != word.data() + word.size() && *at != '/') || number < 1 || number > count)
          refuse(fmt::format("a face names vertex {}, and there are {} before it", base::printable(std::string(word)), count));
        corners.push_back(static_cast<std::int32_t>(number - 1));
      }
      if (corners.size() < 3) refuse("a face needs three corners or more");
      for (std::size_t k = 2; k < corners.size(); ++k) surface.triangles.push_back({corners[0], corners[k - 1], corners[k]});
    }
  }
  weld(surface);
  return surface;
}

bank::Bank make_silent_bank(const SilentBody& body, std::vector<std::string>& warnings) {
  if (body.surface.triangles.size() < 4) throw InputError("its surface has fewer than four triangles; give a closed surface");
  bank::Bank bank;
  bank.vertices_m = body.surface.vertices_m;
  bank.triangles = body.surface.triangles;
  const Solid solid = calc_solid(bank.vertices_m, bank.triangles);
  if (!(solid.volume_m3 > 0.0))
    throw InputError("its surface encloses no volume, or faces inward; give a closed surface that faces outward");
  bank.rigid.mass_kg = body.mass_kg.value_or(body.density_kg_m3 * solid.volume_m3);
  settle_rigid(body.centre_m, body.inertia_kg_m2, solid, bank, warnings);
  bank.material = {.young_modulus_pa = body.young_modulus_pa,
                   .poisson_ratio = body.poisson_ratio,
                   .density_kg_m3 = bank.rigid.mass_kg / solid.volume_m3};
  bank.counts = {.nodes = static_cast<std::int64_t>(bank.vertex_count()), .tets = 1, .components = 1, .rigid_modes = 6};
  bank.complete = false;
  bank.element = "analytic";
  bank.mass = "consistent";
  bank.provenance = base::Json::object().set("silent", base::printable(body.origin)).line();
  if (const std::vector<std::string> faults = bank::find_faults(bank); !faults.empty())
    throw InputError(fmt::format("it makes no body: {}; correct its surface or its mass", faults[0]));
  return bank;
}

}  // namespace carillon::exchange
