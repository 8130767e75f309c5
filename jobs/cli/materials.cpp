// carillon materials: the table of materials.
#include <fmt/core.h>

#include <numbers>
#include <utility>

#include "jobs/cli/commands.hpp"
#include "runtime/material/table.hpp"

namespace carillon::cli {
namespace {

constexpr double kAtHz = 1000.0;

/// Loss factor at 1 kHz, for any damping law.
double calc_loss_factor(const material::Material& material) {
  const double omega = 2 * std::numbers::pi * kAtHz;
  return 2 * material.calc_decay_per_s(omega * omega) / omega;
}

base::Json describe(const material::Row& row) {
  const material::Material& m = row.material;
  base::Json entry;
  entry.set("name", to_json(m.name)).set("group", to_json(row.group)).set("also", to_json(row.also));
  entry.set("young_modulus_pa", m.young_modulus_pa).set("poisson_ratio", m.poisson_ratio).set("density_kg_m3", m.density_kg_m3);
  entry.set("is_orthotropic", m.orthotropic.has_value());
  if (m.orthotropic) {
    const auto& [e, g, nu, axes] = *m.orthotropic;
    for (const auto& [key, values] : {std::pair{"young_modulus_pa", &e}, {"shear_modulus_pa", &g}, {"poisson_ratio", &nu}})
      for (const double value : *values) entry["orthotropic"][key].append(value);
  }
  entry.set("loss_factor_at_1_khz", calc_loss_factor(m)).set("damping", to_json(m.describe_damping()));
  entry.set("elasticity_source", to_json(row.elasticity_source)).set("loss_source", to_json(row.loss_source));
  entry.set("place", row.place.empty() ? base::Json() : to_json(row.place));
  return entry;
}

void print_whole(const material::Row& row) {
  const material::Material& m = row.material;
  std::string names;
  for (const std::string& name : row.also) names += (names.empty() ? "" : ", ") + show(name);
  fmt::print("{}  {}{}\n", show(m.name), show(row.group), names.empty() ? "" : fmt::format("; also {}", names));
  if (m.orthotropic) {
    const auto& [e, g, nu, axes] = *m.orthotropic;
    fmt::print("  Young's modulus  {:.4g}, {:.4g}, {:.4g} GPa (1 along the grain, 2 radial, 3 tangential)\n", 1e-9 * e[0], 1e-9 * e[1],
               1e-9 * e[2]);
    fmt::print("  shear modulus    {:.4g}, {:.4g}, {:.4g} GPa (12, 23, 13)\n", 1e-9 * g[0], 1e-9 * g[1], 1e-9 * g[2]);
    fmt::print("  Poisson's ratio  {:g}, {:g}, {:g} (12, 23, 13)\n", nu[0], nu[1], nu[2]);
  } else {
    fmt::print("  Young's modulus  {:.4g} GPa\n  Poisson's ratio  {:g}\n", 1e-9 * m.young_modulus_pa, m.poisson_ratio);
  }
  fmt::print("                   {}\n", show(row.elasticity_source));
  fmt::print("  density          {:g} kg/m^3\n  damping          {}\n                   {}\n", m.density_kg_m3, show(m.describe_damping()),
             show(row.loss_source));
  if (!row.place.empty()) fmt::print("  from             {}\n", show(row.place));
}

}  // namespace

int run_materials(Shared& shared, const MaterialsOptions& options) {
  const material::MaterialTable& table = material::MaterialTable::get();
  std::vector<const material::Row*> rows;
  for (const std::string& name : options.names) rows.push_back(&table.require("carillon materials", name));
  if (options.names.empty())
    for (const material::Row& row : table.rows()) rows.push_back(&row);
  if (shared.json) {
    base::Json root;
    root["materials"] = base::Json::array();
    for (const material::Row* row : rows) root["materials"].append(describe(*row));
    print_json(root);
    return 0;
  }
  if (!options.names.empty()) {
    for (const material::Row* row : rows) print_whole(*row);
    return 0;
  }
  fmt::print("{:<18} {:<8} {:>9} {:>6} {:>8} {:>9}  {}\n", "material", "group", "E [GPa]", "nu", "[kg/m^3]", "loss", "also");
  for (const material::Row* row : rows) {
    const material::Material& m = row->material;
    std::string names;
    for (const std::string& name : row->also) names += (names.empty() ? "" : ", ") + show(name);
    fmt::print("{:<18} {:<8} {:>9.4g} {:>6.3g} {:>8.5g} {:>9.2g}  {}\n", show(m.name), show(row->group), 1e-9 * m.young_modulus_pa,
               m.poisson_ratio, m.density_kg_m3, calc_loss_factor(m), m.orthotropic && names.empty() ? "" : names);
  }
  fmt::print("Wood and bone: constants of the nearest isotropic solid; `carillon materials oak` shows all constants and sources.\n");
  return 0;
}

}  // namespace carillon::cli
