// Model of a CAE file: elements, sets, supports, sections and materials, as .inp, UNV and Nastran have them in common. Internal header of
// the readers.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/build_mesh.hpp"

namespace carillon::mesh {

/// Solid of the file, in its units.
struct CaeMaterial {
  std::string name;
  std::optional<double> young, poisson, density;
  double alpha1_s = 0.0, alpha2_per_s = 0.0, loss_factor = 0.0;
  std::size_t place = 0;
  std::string problem;  // "file:line: ..."; empty: usable
};

/// The reader adds parts in the order of the file; build() resolves all references, so they may come in any order.
class CaeModel {
 public:
  struct Range {
    std::int64_t first, last, step;
  };
  /// The reader fills the first four.
  struct Set {
    std::vector<RawMesh::Reference> members;                       // nodes or elements
    std::vector<Range> ranges;                                     // what exists of them
    std::vector<std::pair<std::string, std::size_t>> parts;        // sets of the same kind, with their places
    std::vector<std::pair<std::string, std::size_t>> of_elements;  // of node sets: element sets whose nodes belong to it
    std::vector<std::int64_t> tets, others;                        // positions, of element sets
    std::size_t order = 0;                                         // of its definition
    bool is_resolved = false, is_open = false;
  };

  explicit CaeModel(const Cursor& cursor) : cursor_(cursor), budget_(4 * cursor.bytes().size() + 1024) {}

  void add_node(std::int64_t tag, const Vec3& x, std::size_t place) { raw_.add_node(cursor_, tag, x, place); }
  /// `nodes`: 4 or 10, mid nodes in VTK's order. `property`: number of its section, 0: none.
  void add_tet(std::int64_t tag, const std::vector<std::int64_t>& nodes, std::int32_t property, std::size_t place);
  /// An element that is not a solid; its nodes belong to the sets that name it. `kind`: plural, for messages.
  void add_other(std::int64_t tag, const std::string& kind, const std::vector<std::int64_t>& nodes, std::size_t place);

  /// Set of nodes or elements; made on the first call. Names differ in more than case; the first spelling is kept.
  Set& open_set(bool is_elements, std::string_view name);

  /// Adds directions (bit 0: x) in which a node, or a set of nodes, is held.
  void hold_node(std::int64_t node, unsigned directions, std::size_t place);
  void hold_set(const std::string& set, unsigned directions, std::size_t place);
  void hold_range(const Range& nodes, unsigned directions, std::size_t place);
  void clear_supports() { held_.clear(); }
  /// Sets may name elements that the file leaves out.
  void allow_missing_elements() { may_miss_elements_ = true; }

  /// Elements of a set, or of a property number, are of a material.
  void set_section(const std::string& element_set, const std::string& material, std::size_t place);
  void set_section(std::int32_t property, const std::string& material, std::size_t place);
  CaeMaterial& add_material(const std::string& name, std::size_t place);
  /// The unit of lengths, if the file names it.
  void set_unit(double metres, const std::string& why);
  void remark(std::size_t place, const std::string& text);

  bool has_unused_nodes() const;
  std::size_t tet_count() const { return raw_.tet_tags.size(); }
  const RawMesh& raw() const { return raw_; }

  /// `supports`: name of the node set of the supports ("*BOUNDARY").
  TetMesh build(const std::string& supports);

 private:
  struct Held {
    Range nodes;
    std::string set;  // empty: the nodes
    unsigned directions;
    std::size_t place;
  };
  struct Section {
    std::string set;
    std::int32_t property;
    std::string material;
    std::size_t place;
  };
  using Sets = std::map<std::string, Set>;

  const std::string& find_name(std::string_view name);
  void index_elements();
  void spend(std::size_t place, std::size_t count);
  Set& resolve(bool is_elements, const std::string& name, std::size_t place);
  void add_element(const RawMesh::Reference& element, const std::string& name, Set& set);
  void add_existing(bool is_elements, const Range& range, Set& set);
  void add_nodes_of(const Set& elements, std::size_t place, Set& set);
  void resolve_sets();
  void find_regions(TetMesh& mesh);
  void choose_small_sets();
  void find_supports(TetMesh& mesh, const std::string& supports);
  void convert_materials(TetMesh& mesh);

  const Cursor& cursor_;
  std::size_t budget_;
  bool may_miss_elements_ = false;
  RawMesh raw_;
  std::vector<std::int64_t> other_tags_, other_nodes_, other_ends_;
  std::vector<std::size_t> other_places_;
  std::vector<std::pair<std::int64_t, std::int64_t>> elements_;  // tag, position (other: -1 - position), ascending
  std::vector<std::int64_t> sorted_nodes_;
  std::map<std::string, std::string, std::less<>> spelling_;  // by upper case
  Sets node_sets_, element_sets_;
  std::vector<Held> held_;
  std::vector<Section> sections_;
  std::map<std::string, CaeMaterial> materials_;     // by name in upper case
  std::map<std::int32_t, std::string> region_name_;  // by region: element set
  std::map<std::int32_t, std::size_t> material_of_;  // by region: section
  double unit_m_ = 0.0;                              // 0: unknown
  std::string unit_;
  std::vector<std::string> remarks_;
};

}  // namespace carillon::mesh
