#include "precompute/fem/materials.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "precompute/fem/element.hpp"
#include "runtime/base/error.hpp"
#include "runtime/material/solids.hpp"
#include "runtime/material/table.hpp"

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

/// Broadcasts rank 0's materials of the mesh file. Collective.
FileMaterials broadcast_materials(const comm::Communicator& comm, const FileMaterials& materials) {
  const auto tags = comm.broadcast([&] {
    std::vector<std::int32_t> keys;
    for (const auto& [tag, material] : materials) keys.push_back(tag);
    return keys;
  });
  const auto texts = comm.broadcast([&] {
    std::vector<std::string> list;
    for (const auto& [tag, m] : materials) list.insert(list.end(), {m.name, m.place, m.problem});
    return list;
  });
  const auto numbers = comm.broadcast([&] {
    std::vector<double> list;
    for (const auto& [tag, m] : materials)
      list.insert(list.end(), {m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3, m.alpha1_s, m.alpha2_per_s, m.loss_factor});
    return list;
  });
  return comm.agree([&] {
    FileMaterials all;
    for (std::size_t i = 0; i < tags.size(); ++i) {
      const std::string* const text = &texts[3 * i];
      const double* const n = &numbers[6 * i];
      all[tags[i]] = {text[0], n[0], n[1], n[2], n[3], n[4], n[5], text[1], text[2]};
    }
    return all;
  });
}

/// "material": "file" for the regions that the job does not name; equal ones become one material.
void match_file_materials(const std::vector<std::int32_t>& rest, const std::map<std::int32_t, std::string>& names,
                          const FileMaterials& file_materials, const job::JobSpec& job, std::map<std::int32_t, std::int32_t>& place,
                          Materials& out) {
  std::map<std::string, std::int32_t> known;  // by place in the file
  for (const std::int32_t tag : rest) {
    const auto found = file_materials.find(tag);
    if (found == file_materials.end())
      throw InputError(
          fmt::format("{}: \"material\": \"file\": the mesh file has no material for {}; give it a section (*SOLID SECTION, "
                      "PSOLID), or name a material in the job",
                      job.material.place, tag == 0 ? "some elements" : "region " + describe(tag, names)));
    const auto [entry, is_new] = known.try_emplace(found->second.place, static_cast<std::int32_t>(out.list.size()));
    place[tag] = entry->second;
    if (!is_new) continue;
    std::string remark;
    out.list.push_back(make_material(found->second, remark));
    const auto name = names.find(tag);
    out.region.push_back(name == names.end() ? std::to_string(tag) : name->second);
    if (!remark.empty()) out.remarks.push_back(remark);
  }
}

/// Material index of each region. Throws InputError.
std::map<std::int32_t, std::int32_t> match(const std::vector<std::int32_t>& regions, const std::map<std::int32_t, std::string>& names,
                                           const FileMaterials& file_materials, const job::JobSpec& job, Materials& out) {
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
  if (job.takes_file_material) {
    match_file_materials(rest, names, file_materials, job, place, out);
    return place;
  }
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

material::Material make_material(const mesh::FileMaterial& file, std::string& remark) {
  if (!file.problem.empty()) throw InputError(file.problem);
  material::Material made;
  made.name = file.name;
  made.place = file.place;
  made.young_modulus_pa = file.young_modulus_pa;
  made.poisson_ratio = file.poisson_ratio;
  made.density_kg_m3 = file.density_kg_m3;
  const auto refuse = [&](const char* what, double value, double low, double high) {
    if (!(value >= low && value <= high))
      throw InputError(fmt::format("{}: material '{}': {} is {:g}, outside {:g} to {:g}; check the unit of the file", file.place, file.name,
                                   what, value, low, high));
  };
  refuse("Young's modulus in Pa", made.young_modulus_pa, material::kMinStiffnessPa, material::kMaxStiffnessPa);
  refuse("Poisson's ratio", made.poisson_ratio, -1.0 + 1e-7, 0.5 - 1e-7);
  refuse("the loss factor", file.loss_factor, 0.0, 1.999);
  refuse("the stiffness-proportional damping", file.alpha1_s, 0.0, 1e6);
  refuse("the mass-proportional damping", file.alpha2_per_s, 0.0, 1e12);
  if (file.loss_factor > 0.0) {
    made.law = material::DampingLaw::internal_friction;
    made.tan_phi = file.loss_factor;
    return made;
  }
  made.alpha1_s = file.alpha1_s;
  made.alpha2_per_s = file.alpha2_per_s;
  if (file.alpha1_s > 0.0 || file.alpha2_per_s > 0.0) return made;
  const material::Row* nearest = nullptr;
  const auto distance = [&](const material::Material& other) {
    return std::abs(std::log(other.young_modulus_pa / made.young_modulus_pa)) +
           std::abs(std::log(other.density_kg_m3 / made.density_kg_m3));
  };
  for (const material::Row& row : material::MaterialTable::get().rows())
    if (nearest == nullptr || distance(row.material) < distance(nearest->material)) nearest = &row;
  made.law = nearest->material.law;
  made.alpha1_s = nearest->material.alpha1_s;
  made.alpha2_per_s = nearest->material.alpha2_per_s;
  made.tan_phi = nearest->material.tan_phi;
  made.caughey = nearest->material.caughey;
  made.loss_table = nearest->material.loss_table;
  remark = fmt::format("{}: material '{}' has no damping; it is damped like {}, the nearest solid in stiffness and density", file.place,
                       file.name, nearest->material.name);
  return made;
}

Materials find_materials(const comm::Communicator& comm, const LocalMesh& local, const job::JobSpec& job,
                         const std::map<std::int32_t, std::string>& region_names, const FileMaterials& file_materials) {
  if (job.materials.empty() && !job.takes_file_material) return job.material;
  const std::vector<std::int32_t> regions = find_regions(comm, local);
  const auto names = broadcast_names(comm, region_names);
  const FileMaterials of_file = broadcast_materials(comm, file_materials);
  Materials materials;
  comm.agree([&] {
    const auto place = match(regions, names, of_file, job, materials);
    if (job.materials.empty() && materials.list.size() == 1) {
      materials.region.clear();
      return;
    }
    if (job.sensitivities > 0)
      throw InputError(fmt::format("{}: \"sensitivities\" are for bodies of one material, and the mesh file has {}; remove them",
                                   job.file.string(), materials.list.size()));
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
