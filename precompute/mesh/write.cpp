// Method: one point entity for each node set, one volume entity for each region; nodes belong to the first volume.
// Source: Gmsh reference manual, "MSH file format", version 4.1.
// Deviations: entities are discrete (no geometry); the boxes of the volumes are that of the mesh.

#include "precompute/mesh/write.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <iterator>

#include "precompute/mesh/build_mesh.hpp"
#include "runtime/base/file.hpp"

namespace carillon::mesh {

namespace {

/// Numbers in the mode of the file; `end_line` is silent in binary.
class Output {
 public:
  explicit Output(bool binary) : binary_(binary) {}
  void text(const std::string& line) { bytes_ += line; }
  void int32(std::int32_t value) { put(value); }
  void size(std::size_t value) { put(static_cast<std::uint64_t>(value)); }
  void real(double value) { put(value); }
  void end_line() {
    if (!binary_) bytes_ += '\n';
  }
  std::string take() { return std::move(bytes_); }

 private:
  template <class T>
  void put(T value) {
    if (binary_) {
      const auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
      bytes_.append(raw.data(), raw.size());
    } else {
      fmt::format_to(std::back_inserter(bytes_), "{} ", value);  // the shortest digits that read back the same
    }
  }
  bool binary_;
  std::string bytes_;
};

/// Quotes and line ends would break the list of names.
std::string clean_name(std::string name) {
  for (char& c : name)
    if (c == '"' || c == '\n' || c == '\r') c = '_';
  return name;
}

/// The nodes of the elements of a region, ascending.
std::vector<std::int32_t> find_region_nodes(const TetMesh& mesh, const std::vector<std::int32_t>& region_of, std::int32_t region) {
  std::vector<char> is_in(mesh.nodes_m.size(), 0);
  for (std::size_t e = 0; e < region_of.size(); ++e)
    if (region_of[e] == region)
      for (const std::int32_t node : mesh.tet(static_cast<std::int64_t>(e))) is_in[node] = 1;
  std::vector<std::int32_t> nodes;
  for (std::size_t i = 0; i < is_in.size(); ++i)
    if (is_in[i] != 0) nodes.push_back(static_cast<std::int32_t>(i));
  return nodes;
}

/// The section of post-processing data with TetMesh::doubt_m, of the nodes that have any.
void write_doubt(const TetMesh& mesh, bool binary, Output& out) {
  std::vector<std::size_t> nodes;
  for (std::size_t i = 0; i < mesh.doubt_m.size(); ++i)
    if (mesh.doubt_m[i] != Vec3{}) nodes.push_back(i);
  if (nodes.empty()) return;
  out.text(fmt::format("$NodeData\n1\n\"{}\"\n1\n0\n3\n0\n3\n{}\n", kDoubtName, nodes.size()));
  for (const std::size_t i : nodes) {
    out.int32(static_cast<std::int32_t>(i + 1));
    for (const double value : mesh.doubt_m[i]) out.real(value);
    out.end_line();
  }
  out.text(binary ? "\n$EndNodeData\n" : "$EndNodeData\n");
}

}  // namespace

std::string make_gmsh(const TetMesh& mesh, GmshEncoding encoding) {
  const bool binary = encoding == GmshEncoding::kBinary;
  std::vector<std::int32_t> region_of(mesh.regions);
  region_of.resize(mesh.tet_count(), 0);
  std::vector<std::int32_t> regions(region_of);
  std::sort(regions.begin(), regions.end());
  regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
  // The group of region 0 gets an unused number.
  std::int32_t no_region = 1;
  while (std::binary_search(regions.begin(), regions.end(), no_region)) ++no_region;
  std::vector<std::string> names;  // of the groups of the regions; empty: none
  for (const std::int32_t r : regions) {
    const auto found = mesh.region_names.find(r);
    names.push_back(r == 0 ? kNoRegionName : found != mesh.region_names.end() ? clean_name(found->second) : "");
  }
  // Readers derive the set of a region's nodes from its group.
  const auto is_region = [&](const std::string& name, const std::vector<std::int32_t>& nodes) {
    for (std::size_t r = 0; r < regions.size(); ++r) {
      if (regions[r] == 0 || name != (names[r].empty() ? fmt::format("physical:{}", regions[r]) : names[r])) continue;
      return nodes == find_region_nodes(mesh, region_of, regions[r]);
    }
    return false;
  };
  std::vector<std::pair<std::string, const std::vector<std::int32_t>*>> sets;
  for (const auto& [name, nodes] : mesh.node_sets)
    if (!is_region(clean_name(name), nodes)) sets.emplace_back(clean_name(name), &nodes);
  Output out(binary);
  out.text(fmt::format("$MeshFormat\n4.1 {} 8\n", binary ? 1 : 0));
  if (binary) {
    out.int32(1);
    out.text("\n");
  }
  out.text("$EndMeshFormat\n");
  const auto named = std::count_if(names.begin(), names.end(), [](const std::string& name) { return !name.empty(); });
  if (!sets.empty() || named > 0) {
    out.text(fmt::format("$PhysicalNames\n{}\n", sets.size() + static_cast<std::size_t>(named)));
    for (std::size_t r = 0; r < regions.size(); ++r)
      if (!names[r].empty()) out.text(fmt::format("3 {} \"{}\"\n", regions[r] != 0 ? regions[r] : no_region, names[r]));
    for (std::size_t s = 0; s < sets.size(); ++s) out.text(fmt::format("0 {} \"{}\"\n", s + 1, sets[s].first));
    out.text("$EndPhysicalNames\n");
  }
  std::vector<std::size_t> filled;  // sets that have nodes
  for (std::size_t s = 0; s < sets.size(); ++s)
    if (!sets[s].second->empty()) filled.push_back(s);
  Vec3 low = mesh.nodes_m.empty() ? Vec3{} : mesh.nodes_m.front(), high = low;
  for (const Vec3& x : mesh.nodes_m)
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  out.text("$Entities\n");
  for (const std::size_t count : {filled.size(), std::size_t{0}, std::size_t{0}, regions.size()}) out.size(count);
  out.end_line();
  for (const std::size_t s : filled) {
    out.int32(static_cast<std::int32_t>(s + 1));
    for (const double value : mesh.nodes_m[sets[s].second->front()]) out.real(value);
    out.size(1);
    out.int32(static_cast<std::int32_t>(s + 1));
    out.end_line();
  }
  for (std::size_t r = 0; r < regions.size(); ++r) {
    out.int32(static_cast<std::int32_t>(r + 1));
    for (const Vec3& corner : {low, high})
      for (const double value : corner) out.real(value);
    out.size(1);
    out.int32(regions[r] != 0 ? regions[r] : no_region);
    out.size(0);
    out.end_line();
  }
  out.text(binary ? "\n$EndEntities\n$Nodes\n" : "$EndEntities\n$Nodes\n");
  for (const std::size_t value : {std::size_t{1}, mesh.nodes_m.size(), std::size_t{1}, mesh.nodes_m.size()}) out.size(value);
  out.end_line();
  for (const std::int32_t value : {3, 1, 0}) out.int32(value);
  out.size(mesh.nodes_m.size());
  out.end_line();
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    out.size(i + 1);
    out.end_line();
  }
  for (const Vec3& x : mesh.nodes_m) {
    for (const double value : x) out.real(value);
    out.end_line();
  }
  std::size_t elements = mesh.tet_count();
  for (const std::size_t s : filled) elements += sets[s].second->size();
  out.text(binary ? "\n$EndNodes\n$Elements\n" : "$EndNodes\n$Elements\n");
  std::size_t tag = 0;
  // Elements of one region keep their order; runs of a region become one block each, so that the order of the whole is kept as well.
  std::vector<std::size_t> run_begin;
  for (std::size_t e = 0; e < region_of.size(); ++e)
    if (e == 0 || region_of[e] != region_of[e - 1]) run_begin.push_back(e);
  for (const std::size_t value : {run_begin.size() + filled.size(), elements, std::size_t{1}, elements}) out.size(value);
  out.end_line();
  run_begin.push_back(region_of.size());
  for (std::size_t b = 0; b + 1 < run_begin.size(); ++b) {
    const auto region = std::lower_bound(regions.begin(), regions.end(), region_of[run_begin[b]]) - regions.begin();
    for (const std::int32_t value : {3, static_cast<std::int32_t>(region + 1), mesh.order == 1 ? 4 : 11}) out.int32(value);
    out.size(run_begin[b + 1] - run_begin[b]);
    out.end_line();
    for (std::size_t e = run_begin[b]; e < run_begin[b + 1]; ++e) {
      out.size(++tag);
      const auto tet = mesh.tet(static_cast<std::int64_t>(e));
      for (std::size_t k = 0; k < tet.size(); ++k) out.size(static_cast<std::size_t>(tet[kGmshOrder[k]]) + 1);
      out.end_line();
    }
  }
  for (const std::size_t s : filled) {
    for (const std::int32_t value : {0, static_cast<std::int32_t>(s + 1), 15}) out.int32(value);
    out.size(sets[s].second->size());
    out.end_line();
    for (const auto node : *sets[s].second) {
      out.size(++tag);
      out.size(static_cast<std::size_t>(node) + 1);
      out.end_line();
    }
  }
  out.text(binary ? "\n$EndElements\n" : "$EndElements\n");
  write_doubt(mesh, binary, out);
  return out.take();
}

void write_gmsh(const TetMesh& mesh, const std::filesystem::path& file, GmshEncoding encoding) {
  base::write_file(file, make_gmsh(mesh, encoding));
}

}  // namespace carillon::mesh
