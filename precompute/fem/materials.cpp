#include "precompute/fem/materials.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <set>

#include "precompute/fem/element.hpp"
#include "runtime/base/error.hpp"

namespace carillon::fem {
namespace {

using mesh::LocalMesh;

/// Region tags of all ranks, ascending. Collective.
std::vector<std::int32_t> find_regions(const comm::Communicator& comm, const LocalMesh& local) {
  auto all = comm.all_gather([&] {
    if (std::ssize(local.region) != local.tet_count())
      throw SystemError(fmt::format("{} tetrahedra came with {} region tags", local.tet_count(), local.region.size()));
    const std::set<std::int32_t> own(local.region.begin(), local.region.end());
    return std::vector(own.begin(), own.end());
  });
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

/// Broadcasts rank 0's names. Collective.
std::map<std::int32_t, std::string> broadcast_names(const comm::Communicator& comm, const std::map<std::int32_t, std::string>& names) {
  const auto tags = comm.broadcast([&] {
    std::vector<std::int32_t> keys;
    for (const auto& [tag, name] : names) keys.push_back(tag);
    return keys;
  });
  const auto values = comm.broadcast([&] {
    std::vector<std::string> texts;
    for (const auto& [tag, name] : names) texts.push_back(name);
    return texts;
  });
  return comm.agree([&] {
    std::map<std::int32_t, std::string> all;
    for (std::size_t i = 0; i < tags.size(); ++i) all[tags[i]] = values[i];
    return all;
  });
}

std::string describe(std::int32_t tag, const std::map<std::int32_t, std::string>& names) {
  const auto name = names.find(tag);
  return name == names.end() ? fmt::format("{}", tag) : fmt::format("{} \"{}\"", tag, name->second);
}

std::string describe(const std::vector<std::int32_t>& tags, const std::map<std::int32_t, std::string>& names) {
  constexpr std::size_t kMax = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(tags.size(), kMax); ++i) text += (i == 0 ? "" : ", ") + describe(tags[i], names);
  return tags.size() > kMax ? fmt::format("{} and {} more", text, tags.size() - kMax) : text;
}

/// Material index of each region. Throws InputError.
std::map<std::int32_t, std::int32_t> match(const std::vector<std::int32_t>& regions, const std::map<std::int32_t, std::string>& names,
                                           const job::JobSpec& job, Materials& out) {
  std::map<std::int32_t, std::int32_t> place;
  for (const auto& [key, material] : job.materials) {
    const auto is_named = [&, &key = key](std::int32_t tag) {
      const auto name = names.find(tag);
      return key == std::to_string(tag) || (name != names.end() && key == name->second);
    };
    bool found = false;
    for (const std::int32_t tag : regions) {
      if (!is_named(tag)) continue;
      found = true;
      if (!place.emplace(tag, static_cast<std::int32_t>(out.list.size())).second)
        throw InputError(fmt::format("{}: \"materials.{}\": region {} already has a material, as \"{}\"; remove one", material.place, key,
                                     describe(tag, names), out.region[place[tag]]));
    }
    if (!found)
      throw InputError(
          fmt::format("{}: \"materials.{}\": no such region in the mesh, which has {}", material.place, key,
                      regions.size() == 1 && regions[0] == 0 ? "none: its elements have no region tags" : describe(regions, names)));
    out.list.push_back(material);
    out.region.push_back(key);
  }
  std::vector<std::int32_t> rest;
  for (const std::int32_t tag : regions)
    if (!place.contains(tag)) rest.push_back(tag);
  if (rest.empty()) return place;
  if (!job.has_material)
    throw InputError(
        fmt::format("{}: \"materials\": no material for region{} {} of the mesh; add {}, or \"material\" for all regions that "
                    "are not named",
                    job.file.string(), rest.size() == 1 ? "" : "s", describe(rest, names), rest.size() == 1 ? "it" : "them"));
  for (const std::int32_t tag : rest) place[tag] = static_cast<std::int32_t>(out.list.size());
  out.list.push_back(job.material);
  out.region.emplace_back();
  return place;
}

}  // namespace

Materials find_materials(const comm::Communicator& comm, const LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names) {
  if (job.materials.empty()) return job.material;
  const std::vector<std::int32_t> regions = find_regions(comm, local);
  const auto names = broadcast_names(comm, region_names);
  Materials materials;
  comm.agree([&] {
    const auto place = match(regions, names, job, materials);
    materials.of_tet.reserve(local.tet_count());
    for (const std::int32_t tag : local.region) materials.of_tet.push_back(place.at(tag));
  });
  return materials;
}

std::vector<double> calc_volumes(const comm::Communicator& comm, const LocalMesh& local, const Materials& materials) {
  std::vector<double> volume(materials.list.size(), 0.0);
  const int width = local.nodes_per_tet();
  std::array<Vec3, kMaxNodes> x;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    for (int i = 0; i < width; ++i) x[i] = local.nodes_m[local.tets[static_cast<std::size_t>(e) * width + i]];
    volume[materials.find(e)] += calc_moments({x.data(), static_cast<std::size_t>(width)}, 1.0).volume_m3;
  }
  comm.sum(volume);
  return volume;
}

}  // namespace carillon::fem
