// Method: one discrete point entity per node set, one discrete volume entity per region (with the box of the mesh); nodes belong to the
//   first volume.
// Source: Gmsh reference manual, "MSH file format", version 4.1.

#include "precompute/mesh/write.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <iterator>

#include "precompute/mesh/build_mesh.hpp"
#include "runtime/base/file.hpp"

namespace carillon::mesh {

namespace {

/// Number output in the mode of the file; `end_line` does nothing in binary.
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
      fmt::format_to(std::back_inserter(bytes_), "{} ", value);  // shortest round-trip digits
    }
  }
  bool binary_;
  std::string bytes_;
};

/// Replaces quotes and line ends, which would break the list of names.
std::string clean_name(std::string name) {
  for (char& c : name)
    if (c == '"' || c == '\n' || c == '\r') c = '_';
  return name;
}

/// Nodes of a region's elements, ascending.
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

/// Post-processing section of TetMesh::doubt_m, for nonzero nodes.
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

/// Regions and node sets of a mesh as groups and entities of the file.
class GmshWriter {
 public:
  GmshWriter(const TetMesh& mesh, GmshEncoding encoding)
      : mesh_(mesh), binary_(encoding == GmshEncoding::kBinary), region_of_(mesh.regions), out_(binary_) {
    region_of_.resize(mesh.tet_count(), 0);
    regions_ = region_of_;
    std::sort(regions_.begin(), regions_.end());
    regions_.erase(std::unique(regions_.begin(), regions_.end()), regions_.end());
    while (std::binary_search(regions_.begin(), regions_.end(), no_region_)) ++no_region_;
    for (const std::int32_t r : regions_) {
      const auto found = mesh.region_names.find(r);
      names_.push_back(r == 0 ? kNoRegionName : found != mesh.region_names.end() ? clean_name(found->second) : "");
    }
    for (const auto& [name, nodes] : mesh.node_sets)
      if (!is_region(clean_name(name), nodes)) sets_.emplace_back(clean_name(name), &nodes);
    for (std::size_t s = 0; s < sets_.size(); ++s)
      if (!sets_[s].second->empty()) filled_.push_back(s);
  }

  std::string write() {
    write_format();
    write_names();
    write_entities();
    write_nodes();
    write_elements();
    write_doubt(mesh_, binary_, out_);
    return out_.take();
  }

 private:
  /// Readers derive the node set of a region from its group.
  bool is_region(const std::string& name, const std::vector<std::int32_t>& nodes) const {
    for (std::size_t r = 0; r < regions_.size(); ++r) {
      if (regions_[r] == 0 || name != (names_[r].empty() ? fmt::format("physical:{}", regions_[r]) : names_[r])) continue;
      return nodes == find_region_nodes(mesh_, region_of_, regions_[r]);
    }
    return false;
  }
  std::int32_t find_group(std::size_t r) const { return regions_[r] != 0 ? regions_[r] : no_region_; }

  void begin(const char* section) { out_.text(fmt::format("${}\n", section)); }
  void end(const char* section) { out_.text(fmt::format("{}$End{}\n", binary_ ? "\n" : "", section)); }

  void write_format() {
    out_.text(fmt::format("$MeshFormat\n4.1 {} 8\n", binary_ ? 1 : 0));
    if (binary_) {
      out_.int32(1);
      out_.text("\n");
    }
    out_.text("$EndMeshFormat\n");
  }

  void write_names() {
    const auto named = std::count_if(names_.begin(), names_.end(), [](const std::string& name) { return !name.empty(); });
    if (sets_.empty() && named == 0) return;
    out_.text(fmt::format("$PhysicalNames\n{}\n", sets_.size() + static_cast<std::size_t>(named)));
    for (std::size_t r = 0; r < regions_.size(); ++r)
      if (!names_[r].empty()) out_.text(fmt::format("3 {} \"{}\"\n", find_group(r), names_[r]));
    for (std::size_t s = 0; s < sets_.size(); ++s) out_.text(fmt::format("0 {} \"{}\"\n", s + 1, sets_[s].first));
    out_.text("$EndPhysicalNames\n");
  }

  void write_entities() {
    Vec3 low = mesh_.nodes_m.empty() ? Vec3{} : mesh_.nodes_m.front(), high = low;
    for (const Vec3& x : mesh_.nodes_m)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], x[k]);
        high[k] = std::max(high[k], x[k]);
      }
    begin("Entities");
    for (const std::size_t count : {filled_.size(), std::size_t{0}, std::size_t{0}, regions_.size()}) out_.size(count);
    out_.end_line();
    for (const std::size_t s : filled_) {
      out_.int32(static_cast<std::int32_t>(s + 1));
      for (const double value : mesh_.nodes_m[sets_[s].second->front()]) out_.real(value);
      out_.size(1);
      out_.int32(static_cast<std::int32_t>(s + 1));
      out_.end_line();
    }
    for (std::size_t r = 0; r < regions_.size(); ++r) {
      out_.int32(static_cast<std::int32_t>(r + 1));
      for (const Vec3& corner : {low, high})
        for (const double value : corner) out_.real(value);
      out_.size(1);
      out_.int32(find_group(r));
      out_.size(0);
      out_.end_line();
    }
    end("Entities");
  }

  void write_nodes() {
    const std::size_t count = mesh_.nodes_m.size();
    begin("Nodes");
    for (const std::size_t value : {std::size_t{1}, count, std::size_t{1}, count}) out_.size(value);
    out_.end_line();
    for (const std::int32_t value : {3, 1, 0}) out_.int32(value);
    out_.size(count);
    out_.end_line();
    for (std::size_t i = 0; i < count; ++i) {
      out_.size(i + 1);
      out_.end_line();
    }
    for (const Vec3& x : mesh_.nodes_m) {
      for (const double value : x) out_.real(value);
      out_.end_line();
    }
    end("Nodes");
  }

  /// Tetrahedra in blocks, one per run of a region (order preserved); then the points of the sets.
  void write_elements() {
    std::size_t elements = mesh_.tet_count(), tag = 0;
    for (const std::size_t s : filled_) elements += sets_[s].second->size();
    std::vector<std::size_t> run_begin;
    for (std::size_t e = 0; e < region_of_.size(); ++e)
      if (e == 0 || region_of_[e] != region_of_[e - 1]) run_begin.push_back(e);
    begin("Elements");
    for (const std::size_t value : {run_begin.size() + filled_.size(), elements, std::size_t{1}, elements}) out_.size(value);
    out_.end_line();
    run_begin.push_back(region_of_.size());
    for (std::size_t b = 0; b + 1 < run_begin.size(); ++b) {
      const auto region = std::lower_bound(regions_.begin(), regions_.end(), region_of_[run_begin[b]]) - regions_.begin();
      for (const std::int32_t value : {3, static_cast<std::int32_t>(region + 1), mesh_.order == 1 ? 4 : 11}) out_.int32(value);
      out_.size(run_begin[b + 1] - run_begin[b]);
      out_.end_line();
      for (std::size_t e = run_begin[b]; e < run_begin[b + 1]; ++e) {
        out_.size(++tag);
        const auto tet = mesh_.tet(static_cast<std::int64_t>(e));
        for (std::size_t k = 0; k < tet.size(); ++k) out_.size(static_cast<std::size_t>(tet[kGmshOrder[k]]) + 1);
        out_.end_line();
      }
    }
    for (const std::size_t s : filled_) {
      for (const std::int32_t value : {0, static_cast<std::int32_t>(s + 1), 15}) out_.int32(value);
      out_.size(sets_[s].second->size());
      out_.end_line();
      for (const auto node : *sets_[s].second) {
        out_.size(++tag);
        out_.size(static_cast<std::size_t>(node) + 1);
        out_.end_line();
      }
    }
    end("Elements");
  }

  const TetMesh& mesh_;
  bool binary_;
  std::vector<std::int32_t> region_of_;  // (elements)
  std::vector<std::int32_t> regions_;    // ascending
  std::vector<std::string> names_;       // (regions) group names; empty: none
  std::int32_t no_region_ = 1;           // group of region 0: an unused number
  std::vector<std::pair<std::string, const std::vector<std::int32_t>*>> sets_;
  std::vector<std::size_t> filled_;  // sets that have nodes
  Output out_;
};

}  // namespace

std::string make_gmsh(const TetMesh& mesh, GmshEncoding encoding) { return GmshWriter(mesh, encoding).write(); }

void write_gmsh(const TetMesh& mesh, const std::filesystem::path& file, GmshEncoding encoding) {
  base::write_file(file, make_gmsh(mesh, encoding));
}

}  // namespace carillon::mesh
