#include "runtime/material/table.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "runtime/material/read_material.hpp"

namespace carillon::material {

extern const char* const kTableText;  // materials.json

namespace {

constexpr std::size_t kMaxRows = 10'000;
constexpr std::array<double, 2> kBandHz{20.0, 20000.0};  // damping must not be negative here

/// Canonical form of a name for comparison.
std::string fold(std::string_view name) {
  std::string folded;
  for (const char c : name)
    if (c != ' ' && c != '-' && c != '_') folded += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return folded;
}

std::filesystem::path find_user_file() {
  const auto get = [](const char* name) {
    const char* value = std::getenv(name);
    return std::filesystem::path(value == nullptr ? "" : value);
  };
  if (auto named = get("CARILLON_MATERIALS"); !named.empty()) return named;
  const auto config = get("XDG_CONFIG_HOME"), home = get("HOME");
  if (config.empty() && home.empty()) return {};
  const auto file = (config.empty() ? home / ".config" : config) / "carillon" / "materials.json";
  std::error_code error;
  return std::filesystem::exists(file, error) ? file : std::filesystem::path();
}

}  // namespace

MaterialTable MaterialTable::read(const base::Document& document, const MaterialTable* base) {
  base::Object root = document.root();
  const bool is_own = base != nullptr;
  MaterialTable table;
  std::vector<std::string> warnings;
  for (base::Object& object : root.objects("materials")) {
    if (table.rows_.size() == kMaxRows) object.fail("", fmt::format("a file may have {} materials at most", kMaxRows));
    Row row;
    const std::string name = object.string("name");
    if (fold(name).empty()) object.fail("name", "a material needs a name");
    if (table.find(name) != nullptr) object.fail("name", fmt::format("\"{}\" is already defined; give it another name", name));
    row.group = object.string_or("group", "own");
    for (const base::Entry& entry : object.entries("also", 100)) {
      if (entry.object) object.fail("also", "must be a list of other names, as texts");
      row.also.push_back(entry.text);
    }
    row.elasticity_source = object.string_or("elasticity_source", "");
    row.loss_source = object.string_or("loss_source", "");
    object.ignore("note");
    if (is_own) row.place = object.find_place("");
    row.material = read_material(object, kBandHz, warnings, base);
    table.rows_.push_back(std::move(row));
  }
  root.finish();
  if (is_own) table.rows_.insert(table.rows_.end(), base->rows_.begin(), base->rows_.end());
  return table;
}

const MaterialTable& MaterialTable::get_built_in() {
  static const MaterialTable table = read(base::parse_document(kTableText, "runtime/material/materials.json"));
  return table;
}

const MaterialTable& MaterialTable::get() {
  static const MaterialTable table = [] {
    const std::filesystem::path own = find_user_file();
    return own.empty() ? get_built_in() : read(base::read_document(own), &get_built_in());
  }();
  return table;
}

const Row* MaterialTable::find(std::string_view name) const {
  const std::string folded = fold(name);
  for (const Row& row : rows_) {
    if (fold(row.material.name) == folded) return &row;
    if (std::any_of(row.also.begin(), row.also.end(), [&](const std::string& other) { return fold(other) == folded; })) return &row;
  }
  return nullptr;
}

const Row& MaterialTable::require(std::string_view place, std::string_view name) const {
  if (const Row* row = find(name)) return *row;
  std::vector<std::string> names;
  for (const Row& row : rows_) {
    names.push_back(row.material.name);
    names.insert(names.end(), row.also.begin(), row.also.end());
  }
  const std::string nearest = base::find_nearest(name, names);
  throw InputError(fmt::format("{}: \"{}\" is no known material{}; `carillon materials` lists them, and a file of your own may add to them",
                               place, name, nearest.empty() ? "" : fmt::format(" (did you mean \"{}\"?)", nearest)));
}

}  // namespace carillon::material
