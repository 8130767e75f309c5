#include "jobs/front/hear/assume.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "runtime/base/file.hpp"

namespace carillon::hear {
namespace {

// Plausible sizes of objects struck by hand.
constexpr double kSmallestM = 0.005, kLargestM = 3.0;
constexpr double kLeastM = 0.001, kMostM = 100.0;  // hard limits
constexpr double kHugeM = 10.0;                    // above: probably a wrong unit
constexpr double kThinnestWall = 1.0 / 5000;       // of the body's largest extent
constexpr double kNoWallM = 0.3;                   // above: no default wall
constexpr double kNormalisedM = 0.15;              // size of a model without a unit

struct Unit {
  const char* name;
  double metres;
  double max;  // largest plausible extent in this unit
};
constexpr Unit kUnits[] = {{"metres", 1.0, kLargestM}, {"centimetres", 0.01, 30.0}, {"millimetres", 0.001, 1000.0 * kLargestM}};

std::string format_extent(const std::array<double, 3>& extent, double scale) {
  return fmt::format("{:.3g} x {:.3g} x {:.3g} m", extent[0] * scale, extent[1] * scale, extent[2] * scale);
}

/// True for models normalised to [-1, 1] or [0, 1].
bool is_normalised(double largest) { return std::abs(largest - 1.0) < 1e-3 || std::abs(largest - 2.0) < 1e-3; }

bool is_gltf(const std::filesystem::path& file) {
  const std::string ending = base::find_extension(file);
  return ending == ".glb" || ending == ".gltf";
}

double guess_scale(const Order& options, const SurfaceFacts& look, std::vector<std::string>& assumed) {
  const double largest = *std::max_element(look.extent.begin(), look.extent.end());
  const std::string file = options.object.filename().string();
  if (!look.unit.empty()) {
    assumed.push_back(fmt::format("size: {}, since {}; change it with --scale", format_extent(look.extent, look.unit_m), look.unit));
    return look.unit_m;
  }
  if (look.is_mesh || is_gltf(options.object)) {  // glTF is in metres by its specification
    const char* const what = look.is_mesh ? "meshes are" : "glTF is";
    const char* const remedy =
        look.is_mesh ? "--scale, metres per unit of the file (0.001 for millimetres)" : "its --height in metres, or --scale";
    if (largest < kSmallestM || largest > kLargestM)
      throw InputError(fmt::format("{}: {:.4g} m across, as {} in metres: too small or too large to be struck by hand; give {}",
                                   options.object.string(), largest, what, remedy));
    assumed.push_back(fmt::format("size: {}, since {} in metres; change it with {}", format_extent(look.extent, 1.0), what,
                                  look.is_mesh ? "--scale (0.001 for millimetres)" : "--height"));
    return 1.0;
  }
  if (is_normalised(largest)) {
    const double scale = kNormalisedM / largest;
    assumed.push_back(
        fmt::format("size: {} is {:g} units across, a normalised size: scaled to {:g} m ({}); change it with --height or --scale", file,
                    largest, kNormalisedM, format_extent(look.extent, scale)));
    return scale;
  }
  for (const Unit& unit : kUnits) {
    if (largest > unit.max || largest * unit.metres < kSmallestM) continue;
    assumed.push_back(fmt::format(
        "size: {}, since {} is {:.4g} units across, which are taken for {}; change it with --scale ({}) or --height",
        format_extent(look.extent, unit.metres), file, largest, unit.name, unit.metres == 1.0 ? "0.001 for millimetres" : "1 for metres"));
    return unit.metres;
  }
  throw InputError(
      fmt::format("{}: {:.4g} units across: too small or too large to be struck by hand in metres, centimetres and millimetres; give its "
                  "--height in metres, or --scale, metres per unit",
                  options.object.string(), largest));
}

}  // namespace

double find_scale(const Order& options, const SurfaceFacts& look, double height_m, std::vector<std::string>& assumed) {
  const double largest = *std::max_element(look.extent.begin(), look.extent.end());
  if (!(largest > 0.0)) throw InputError(fmt::format("{}: all points coincide; check the file", options.object.string()));
  if (height_m > 0.0 && !(look.extent[1] > 0.0))
    throw InputError(fmt::format("{}: its height (y) is 0, so --height cannot be used; give --scale", options.object.string()));
  const double scale = height_m > 0.0 ? height_m / look.extent[1] : options.scale ? *options.scale : guess_scale(options, look, assumed);
  if (!(scale * largest >= kLeastM && scale * largest <= kMostM))
    throw InputError(fmt::format("{}: {:.3g} m across, outside {:g} to {:g} m; check {}", options.object.string(), scale * largest, kLeastM,
                                 kMostM, height_m > 0.0 ? "--height (metres)" : "--scale (metres per unit)"));
  if (scale * largest > kHugeM)
    assumed.push_back(fmt::format("size: {}, by {}, which is very large: is it in metres?", format_extent(look.extent, scale),
                                  height_m > 0.0 ? "--height" : "--scale"));
  return scale;
}

void check_wall(const Order& options, const SurfaceFacts& look, double scale) {
  const std::string file = options.object.string();
  if (!options.wall_m) {
    if (look.openings > 0)
      throw InputError(fmt::format("{}: an open surface ({} border{}) has no thickness; give one in metres: --wall 0.002", file,
                                   look.openings, look.openings == 1 ? "" : "s"));
    return;
  }
  const double wall_m = *options.wall_m;
  const auto [smallest, largest] = std::minmax_element(look.extent.begin(), look.extent.end());
  if (wall_m < kThinnestWall * scale * *largest)
    throw InputError(
        fmt::format("{}: a wall of {:g} m is thinner than a {:.0f}th of the body; --wall is in metres", file, wall_m, 1.0 / kThinnestWall));
  // The wall of a closed surface is inside; a sheet is limited to half its length.
  const bool is_sheet = look.openings > 0;
  const double space_m = scale * (is_sheet ? *largest : *smallest);
  if (2.0 * wall_m < space_m) return;
  const double millimetres_m = 1e-3 * wall_m;
  const bool is_in_millimetres = wall_m >= kNoWallM && 2.0 * millimetres_m < space_m && millimetres_m >= kThinnestWall * scale * *largest;
  throw InputError(fmt::format("{}: a wall of {:g} m is thicker than half the body, which is {:.3g} m across{}; {}", file, wall_m, space_m,
                               is_sheet ? "" : " where it is thinnest",
                               is_in_millimetres ? fmt::format("--wall is in metres: {:g} mm are --wall {:g}", wall_m, millimetres_m)
                               : is_sheet        ? std::string("give a thinner one (metres)")
                                                 : std::string("give a thinner one (metres), or leave --wall out for a solid body")));
}

}  // namespace carillon::hear
