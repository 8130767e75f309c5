#include "runtime/scene/recorded_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/base/error.hpp"

namespace carillon::scene {
namespace {

std::string format_size(const Vec3& size_m) { return fmt::format("{:.4g} x {:.4g} x {:.4g} m", size_m[0], size_m[1], size_m[2]); }

}  // namespace

std::vector<events::RecordedBody> list_bodies(const Scene& scene) {
  std::vector<events::RecordedBody> bodies;
  for (const SceneBody& body : scene.bodies) {
    const bank::Bank& bank = *body.spec.bank;
    bodies.push_back({body.name, static_cast<std::int64_t>(bank.triangles.size()), events::mark_surface(bank.vertices_m, bank.triangles)});
  }
  return bodies;
}

void check_bodies(const std::filesystem::path& file, const std::vector<events::RecordedBody>& theirs,
                  const std::vector<events::RecordedBody>& ours, std::vector<std::string>& warnings) {
  if (theirs.size() != ours.size()) {
    throw InputError(
        fmt::format("{}: has {} bodies, and the scene has {}; play it with its own scene", file.string(), theirs.size(), ours.size()));
  }
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (theirs[i].name != ours[i].name) {
      throw InputError(fmt::format("{}: body {} is \"{}\", and \"{}\" in the scene; play it with its own scene", file.string(), i,
                                   theirs[i].name, ours[i].name));
    }
    if (theirs[i].triangles != ours[i].triangles) {
      throw InputError(
          fmt::format("{}: was made for a bank of \"{}\" with {} triangles, and the scene's has {}; use banks of the same mesh",
                      file.string(), ours[i].name, theirs[i].triangles, ours[i].triangles));
    }
    if (theirs[i].surface && !events::is_same_surface(*theirs[i].surface, *ours[i].surface)) {
      const std::string were = format_size(theirs[i].surface->size_m), are = format_size(ours[i].surface->size_m);
      throw InputError(were == are
                           ? fmt::format("{}: was made for a different surface of \"{}\" of the same size and number of triangles; use "
                                         "a bank of the same mesh",
                                         file.string(), ours[i].name)
                           : fmt::format("{}: was made for a body \"{}\" of {}, and the scene's bank measures {}; use a bank of the "
                                         "same mesh and size, or record the contacts again",
                                         file.string(), ours[i].name, were, are));
    }
  }
  const auto is_unmarked = [](const events::RecordedBody& body) { return !body.surface; };
  if (std::any_of(theirs.begin(), theirs.end(), is_unmarked)) {
    warnings.push_back(
        fmt::format("{}: does not give the size of its bodies (\"size_m\", \"order_m\"); only the numbers of triangles "
                    "were compared",
                    file.string()));
  }
}

}  // namespace carillon::scene
