// Named materials: the built-in table (materials.json), extended by a user file.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/material/material.hpp"

namespace carillon::material {

/// One row of the table.
struct Row {
  Material material;              // with its primary name
  std::string group;              // "metal", "wood", ...
  std::vector<std::string> also;  // aliases
  std::string elasticity_source;
  std::string loss_source;
  std::string place;  // "file:line" in the user's file; empty: built in
};

/// Rows by name. Case, spaces, hyphens and underscores are ignored.
class MaterialTable {
 public:
  /// Built-in rows, preceded by the user's file: $CARILLON_MATERIALS, else carillon/materials.json in $XDG_CONFIG_HOME or ~/.config, if
  /// present. Read on the first call. Throws InputError for an invalid file.
  static const MaterialTable& get();
  /// Built-in rows, read on the first call.
  static const MaterialTable& get_built_in();
  /// Rows of a document {"materials": [...]}, followed by those of `base`, which they may refer to by "from". Throws InputError.
  static MaterialTable read(const base::Document& document, const MaterialTable* base = nullptr);

  const std::vector<Row>& rows() const { return rows_; }
  /// nullptr if unknown.
  const Row* find(std::string_view name) const;
  /// As find(); the InputError names the nearest match and begins with `place` (an option, "file:line").
  const Row& require(std::string_view place, std::string_view name) const;

 private:
  std::vector<Row> rows_;
};

}  // namespace carillon::material
