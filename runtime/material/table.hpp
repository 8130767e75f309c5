// Materials by name: the table of the repository (materials.json), and a file of the user's own in front of it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/material/material.hpp"

namespace carillon::material {

/// One row of the table.
struct Row {
  Material material;              // with its first name
  std::string group;              // "metal", "wood", ...
  std::vector<std::string> also;  // other names
  std::string elasticity_source;
  std::string loss_source;
  std::string place;  // "file:line" of a file of the user's own; empty: of the repository
};

/// Rows by name. Case, spaces, hyphens and underscores do not matter.
class MaterialTable {
 public:
  /// The table of the repository, and in front of it the user's own: the file that $CARILLON_MATERIALS names, else carillon/materials.json
  /// in $XDG_CONFIG_HOME or ~/.config, if it is there. Read at the first call. Throws InputError for an invalid file.
  static const MaterialTable& get();
  /// Rows of a document {"materials": [...]}; a row may start from one of `base`, whose rows follow. Throws InputError.
  static MaterialTable read(const base::Document& document, const MaterialTable* base = nullptr);

  const std::vector<Row>& rows() const { return rows_; }
  /// Null where there is none of that name.
  const Row* find(std::string_view name) const;
  /// As find(), or an InputError that names the nearest one; it begins with `place`: an option, "file:line".
  const Row& require(std::string_view place, std::string_view name) const;

 private:
  std::vector<Row> rows_;
};

}  // namespace carillon::material
