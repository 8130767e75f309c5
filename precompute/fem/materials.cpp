#include "precompute/fem/materials.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <set>

#include "precompute/fem/element.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::fem {
namespace {

/// The regions of all ranks, ascending. Collective.
std::vector<std::int32_t> find_regions(MPI_Comm comm, const LocalMesh& local) {
  std::vector<std::int32_t> sent;
  petsc::run_agreed(comm, [&] {
    if (local.region.size() != static_cast<std::size_t>(local.tet_count()))
      throw SystemError(fmt::format("{} tetrahedra came with {} region tags", local.tet_count(), local.region.size()));
    const std::set<std::int32_t> own(local.region.begin(), local.region.end());
    sent.assign(own.begin(), own.end());
  });
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  std::vector<int> counts(ranks), at(ranks + 1, 0);
  const int count = static_cast<int>(sent.size());
  MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, comm);
  std::partial_sum(counts.begin(), counts.end(), at.begin() + 1);
  std::vector<std::int32_t> all;
  petsc::run_agreed(comm, [&] { all.resize(at.back()); });
  MPI_Allgatherv(sent.data(), count, MPI_INT32_T, all.data(), counts.data(), at.data(), MPI_INT32_T, comm);
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

/// Rank 0's names on every rank. Collective.
std::map<std::int32_t, std::string> share_names(MPI_Comm comm, const std::map<std::int32_t, std::string>& names) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  std::string text;
  petsc::run_agreed(comm, [&] {
    if (rank != 0) return;
    for (const auto& [tag, name] : names) text += fmt::format("{} {} ", tag, name.size()) + name;  // a name may hold any byte
    if (text.size() > std::numeric_limits<int>::max()) throw InputError("the names of the mesh's regions are longer than 2 GB in all");
  });
  auto size = static_cast<int>(text.size());
  MPI_Bcast(&size, 1, MPI_INT, 0, comm);
  petsc::run_agreed(comm, [&] { text.resize(size); });
  MPI_Bcast(text.data(), size, MPI_CHAR, 0, comm);
  std::map<std::int32_t, std::string> shared;
  petsc::run_agreed(comm, [&] {
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t blank = text.find(' ', begin), name = text.find(' ', blank + 1) + 1;
      const std::size_t size = std::stoull(text.substr(blank + 1, name - blank - 2));
      shared[std::stoi(text.substr(begin, blank - begin))] = text.substr(name, size);
      begin = name + size;
    }
  });
  return shared;
}

std::string describe(std::int32_t tag, const std::map<std::int32_t, std::string>& names) {
  const auto name = names.find(tag);
  return name == names.end() ? fmt::format("{}", tag) : fmt::format("{} \"{}\"", tag, name->second);
}

std::string describe(const std::vector<std::int32_t>& tags, const std::map<std::int32_t, std::string>& names) {
  constexpr std::size_t kMost = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(tags.size(), kMost); ++i) text += (i == 0 ? "" : ", ") + describe(tags[i], names);
  return tags.size() > kMost ? fmt::format("{} and {} more", text, tags.size() - kMost) : text;
}

/// The material of each region by its place in the list. Throws InputError.
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
        throw InputError(fmt::format("{}: \"materials.{}\": region {} has a material already, as \"{}\"; remove one", material.place, key,
                                     describe(tag, names), out.region[place[tag]]));
    }
    if (!found)
      throw InputError(
          fmt::format("{}: \"materials.{}\": the mesh has no such region; there is {}", material.place, key,
                      regions.size() == 1 && regions[0] == 0 ? "none at all: its elements carry no region tag" : describe(regions, names)));
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

Materials find_materials(MPI_Comm comm, const LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names) {
  if (job.materials.empty()) return job.material;
  const std::vector<std::int32_t> regions = find_regions(comm, local);
  const auto names = share_names(comm, region_names);
  Materials materials;
  petsc::run_agreed(comm, [&] {
    const auto place = match(regions, names, job, materials);
    materials.of_tet.reserve(local.tet_count());
    for (const std::int32_t tag : local.region) materials.of_tet.push_back(place.at(tag));
  });
  return materials;
}

std::vector<double> calc_volumes(MPI_Comm comm, const LocalMesh& local, const Materials& materials) {
  std::vector<double> volume(materials.list.size(), 0.0);
  const int width = local.nodes_per_tet();
  std::array<Vec3, kMaxNodes> x;
  for (std::int32_t e = 0; e < local.tet_count(); ++e) {
    for (int i = 0; i < width; ++i) x[i] = local.nodes_m[local.tets[static_cast<std::size_t>(e) * width + i]];
    volume[materials.find(e)] += calc_moments({x.data(), static_cast<std::size_t>(width)}, 1.0).volume_m3;
  }
  MPI_Allreduce(MPI_IN_PLACE, volume.data(), static_cast<int>(volume.size()), MPI_DOUBLE, MPI_SUM, comm);
  return volume;
}

}  // namespace carillon::fem
