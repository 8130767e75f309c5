#include "runtime/bank/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "runtime/bank/kinds.hpp"
#include "runtime/bank/pack.hpp"
#include "runtime/bank/select.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::bank {
namespace {

/// "under", "critical" or "over"; critical: d = omega to rounding.
const char* find_regime(double decay, double omega) {
  if (std::abs(decay - omega) <= 1e-9 * omega) return "critical";
  return decay < omega ? "under" : "over";
}

std::string format_bytes(std::uintmax_t bytes) {
  return bytes < 1'000'000 ? fmt::format("{:.1f} kB", static_cast<double>(bytes) / 1e3)
                           : fmt::format("{:.2f} MB", static_cast<double>(bytes) / 1e6);
}

std::string format_scalar(const std::string& key, const base::Json& value) {
  if (value.is_number()) {
    const double x = value.as_double();
    const bool is_bytes = x >= 0.0 && x < 1e18 && x == std::floor(x) && key.find("bytes") != std::string::npos;
    return is_bytes ? format_bytes(static_cast<std::uintmax_t>(x)) : fmt::format("{:.6g}", x);
  }
  if (value.is_string()) return base::printable(value.as_string());
  std::string text = value.sorted_text({.indentation = "\t", .breaks_arrays = true});
  text.erase(std::remove(text.begin(), text.end(), '\n'), text.end());
  return text.size() > 100 ? fmt::format("{}...", std::string_view(text).substr(0, 97)) : text;
}

bool is_nested(const base::Json& value) { return value.is_object() || value.is_array(); }

bool is_flat(const base::Json& value) { return std::none_of(value.begin(), value.end(), is_nested); }

/// Scalars and short flat objects on one line ("solve: peak_bytes 900 MB, seconds 12.25"), nested ones indented. Array elements are
/// labelled by their "name", if any.
void append_tree(const base::Json& tree, std::size_t depth, std::string& text) {
  constexpr std::size_t kMaxDepth = 6;
  if (depth >= kMaxDepth) return;
  const std::string indent(2 * depth, ' ');
  const std::vector<std::string> keys = tree.keys();
  for (std::size_t i = 0; i < tree.size(); ++i) {
    base::Json value = tree.is_object() ? tree[keys[i]] : tree[i];
    std::string key = tree.is_object() ? keys[i] : std::to_string(i);
    if (tree.is_array() && std::as_const(value)["name"].is_string()) {
      key = value["name"].as_string();
      value.erase("name");
    }
    text += fmt::format("{}{}:", indent, base::printable(key));
    if (!is_nested(value) || (value.is_array() && is_flat(value))) {
      text += fmt::format(" {}\n", format_scalar(key, value));
    } else if (value.is_object() && is_flat(value) && value.size() <= 4) {
      std::string line;
      for (const std::string& name : value.keys())
        line += fmt::format("{}{} {}", line.empty() ? "" : ", ", base::printable(name), format_scalar(name, value[name]));
      text += fmt::format(" {}\n", line);
    } else {
      text += '\n';
      append_tree(value, depth + 1, text);
    }
  }
}

/// "0.012", or "-" if unknown.
std::string format_cents(const std::vector<double>& cents, std::size_t mode) {
  return mode < cents.size() && std::isfinite(cents[mode]) ? fmt::format("{:.2g}", cents[mode]) : "-";
}

std::string format_modes(const Bank& bank, std::span<const HeardMode> heard, std::size_t limit) {
  const bool is_corrected = !bank.corrected.is_empty(), is_doubtful = !bank.facet_error_cents.empty();
  const auto format_facets = [&](const std::string& cents) { return is_doubtful ? fmt::format(" {:>8}", cents) : std::string(); };
  const bool has_air = !bank.multipoles.is_empty(), has_supports = bank.supports.count() > 0;
  const auto format_parts = [&](const std::string& material, const std::string& air, const std::string& supports) {
    return (has_air || has_supports ? fmt::format(" {:>9}", material) : "") + (has_air ? fmt::format(" {:>9}", air) : "") +
           (has_supports ? fmt::format(" {:>9}", supports) : "");
  };
  const std::string origin = name_origin(bank);
  std::string text = fmt::format("\n{:>5} {:>13} {:>10} {:>9} {:>10} {:>8}{} {:>10} {:>10}{} {:>9} {:>8} {:>10}  {}\n", "mode",
                                 origin + " [Hz]", "+-" + origin, "+-body", "freq [Hz]", "+-body", format_facets("+-facets"), "correction",
                                 "d [1/s]", format_parts("material", "air", "supports"), "T60 [s]", "regime", "gain", "kind");
  const std::size_t shown = std::min(limit, bank.mode_count());
  const std::vector<ModeKind> kinds = find_kinds(bank, shown);
  for (std::size_t i = 0; i < shown; ++i) {
    const HeardMode& mode = heard[i];
    const double omega = 2.0 * std::numbers::pi * mode.freq_hz, decay = mode.calc_decay_per_s();
    text += fmt::format("{:>5} {:>13.2f} {:>10} {:>9} {:>10.2f} {:>8}{} {:>10} {:>10.4g}{} {:>9.3g} {:>8} {:>10.4g}  {}\n", i + 1,
                        bank.freq_hz(i), format_cents(bank.algebraic_error_cents, i), format_cents(bank.discretisation_error_cents, i),
                        mode.freq_hz, format_cents(bank.corrected.error_cents, i), format_facets(format_cents(bank.facet_error_cents, i)),
                        is_corrected ? describe(bank.corrected.correction[i]) : "-", decay,
                        format_parts(fmt::format("{:.3g}", mode.material_per_s), fmt::format("{:.3g}", mode.radiation_per_s),
                                     fmt::format("{:.3g}", mode.supports_per_s)),
                        mode.calc_t60_s(), find_regime(decay, omega), bank.radiation_gain[i], describe(kinds[i]));
  }
  if (shown < bank.mode_count())
    text += fmt::format("  ... {} more; --modes {} shows them all\n", bank.mode_count() - shown, bank.mode_count());
  text += fmt::format(
      "{0}: the frequency of {1}; +-{0}: cents to its exact mode, a bound; +-body: cents to the mode of the body, an estimate\n", origin,
      bank.element == "imported" ? "the other program" : "the " + origin);
  text +=
      "freq: frequency of playing, which sorts modes by it: without the estimated error of the mesh, in air and on the bank's supports\n"
      "d and T60: decay by material, air and supports together\n"
      "gain: Pa at 1 m for q' = 1 m kg^1/2 / s; frequencies are undamped; kind: kind of motion, if its shape shows one\n";
  if (is_doubtful)
    text += "+-facets: cents beyond +-body in the other case of facets in doubt (planes of the body, or samples of a smooth surface)\n";
  return text;
}

/// "rayleigh: alpha1 1e-07 s, alpha2 5 1/s"
std::string format_damping(const Bank& bank) {
  const Damping& law = bank.damping;
  std::string text = base::printable(law.law);
  if (law.law == "rayleigh")
    return text + fmt::format(", alpha1 {:.4g} s, alpha2 {:.4g} 1/s", bank.material.alpha1_s, bank.material.alpha2_per_s);
  if (law.law == "internal_friction") return text + fmt::format(", tan(phi) {:.4g}", law.coefficient[0]);
  if (law.law == "caughey") {
    for (std::size_t j = 0; j < std::min<std::size_t>(law.power.size(), 6); ++j)
      text += fmt::format("{}{:.4g} lambda^{:g}", j == 0 ? ", c = " : " + ", law.coefficient[j], law.power[j]);
    return text + (law.power.size() > 6 ? " + ..." : "");
  }
  if (law.law == "loss_table")
    return text + fmt::format(", {} rows from {:g} Hz to {:g} Hz", law.freq_hz.size(), law.freq_hz.front(), law.freq_hz.back());
  return text + ", weighed by each material's part of the energies";
}

/// Summary of a bank's multipoles.
struct RadiationFacts {
  std::int32_t lowest = 0, highest = 0;  // order
  std::size_t bytes = 0;                 // orders, scales and coefficients
  double worst_db = 0.0;                 // stated error
  std::size_t strong = 0;                // modes with more than half of their damping by radiation
  double cents = 0.0;                    // largest shift by the mass of the air, either sign
  std::int32_t parts = 0;                // largest number of parts of a coupled mode
};

RadiationFacts find_radiation_facts(const Bank& bank) {
  const Multipoles& air = bank.multipoles;
  const auto [low, high] = std::minmax_element(air.order.begin(), air.order.end());
  RadiationFacts facts{*low, *high, 12 * air.order.size() + 2 * air.coefficient.size(), -HUGE_VAL, 0, 0.0, 0};
  for (std::size_t m = 0; m < air.order.size(); ++m) {
    facts.worst_db = std::max(facts.worst_db, air.error_db[m]);
    const double material = bank.corrected.is_empty() ? bank.decay_per_s[m] : bank.corrected.decay_per_s[m];
    if (air.decay_per_s[m] > material) ++facts.strong;
    if (!air.mixing.is_empty()) facts.parts = std::max(facts.parts, air.mixing.count[m]);
    if (const double cents = 600.0 * std::log2(1.0 + air.added_mass[m]); std::abs(cents) > std::abs(facts.cents)) facts.cents = cents;
  }
  return facts;
}

std::string format_radiation(const Bank& bank) {
  const RadiationFacts facts = find_radiation_facts(bank);
  const Multipoles& air = bank.multipoles;
  std::string text = fmt::format("radiation {}\n", air.method.empty() ? "by an unknown method" : base::printable(air.method));
  text += fmt::format("          order {} to {}, {}, error at most {:.1f} dB from {:.4g} m outward\n", facts.lowest, facts.highest,
                      format_bytes(facts.bytes), facts.worst_db, air.nearest_m);
  text += fmt::format("          more than half of the damping of {} of {} modes; the mass of the air lowers one by {:.2g} cents\n",
                      facts.strong, bank.mode_count(), facts.cents);
  if (facts.parts > 0)
    text += fmt::format("          coupled by the air: a mode is a sum of up to {} motions of the body without it\n", facts.parts);
  return text;
}

/// "rows" or "points".
const char* get_form(const QuarticEnergy& energy) { return energy.is_of_points() ? "points" : "rows"; }

std::size_t count_bytes(const QuarticEnergy& energy) {
  return 4 * (energy.rows.size() + energy.gradient.size() + energy.stress.size()) + 8 * (energy.weight.size() + energy.linear.size());
}

std::string format_nonlinear(const QuarticEnergy& energy) {
  std::string text =
      fmt::format("nonlinear {} coupled modes, {} row{}", energy.mode_count(), energy.row_count(), energy.row_count() == 1 ? "" : "s");
  if (energy.is_of_points()) text += fmt::format(" at {} points, energy to {:.1e}", energy.point_count(), energy.error);
  text += fmt::format(", {}, {}", energy.linear.empty() ? "flat" : "curved", format_bytes(count_bytes(energy)));
  if (energy.membrane_ratio > kMaxMembraneRatio)
    text += fmt::format("\n          the highest coupled mode is at {:.2g} of the lowest condensed one: above {:g} its inertia counts",
                        energy.membrane_ratio, kMaxMembraneRatio);
  return text + "\n";
}

template <class Range>
base::Json make_list(const Range& values) {
  base::Json list = base::Json::array();
  for (const double value : values) list.append(value);
  return list;
}

base::Json make_mode(const Bank& bank, const HeardMode& heard, std::size_t i, const ModeKind& kind) {
  const double omega = 2.0 * std::numbers::pi * heard.freq_hz, decay = heard.calc_decay_per_s();
  base::Json mode;
  mode.set("frequency_hz", bank.freq_hz(i)).set("eigenvalue_rad2_s2", bank.eigenvalue_rad2_s2[i]).set("decay_per_s", bank.decay_per_s[i]);
  // JSON has no infinity: an undamped mode has no T60.
  mode["t60_s"] = std::isfinite(calc_t60_s(decay)) ? base::Json(calc_t60_s(decay)) : base::Json();
  base::Json& parts = mode["heard"];
  parts.set("frequency_hz", heard.freq_hz).set("decay_per_s", decay).set("material_per_s", heard.material_per_s);
  parts.set("radiation_per_s", heard.radiation_per_s).set("supports_per_s", heard.supports_per_s);
  mode.set("damping_ratio", decay / omega).set("regime", find_regime(decay, omega)).set("residual", bank.residual[i]);
  const auto get_cents = [&](const std::vector<double>& cents) {
    return i < cents.size() && std::isfinite(cents[i]) ? base::Json(cents[i]) : base::Json();
  };
  mode["algebraic_error_cents"] = get_cents(bank.algebraic_error_cents);
  mode["discretisation_error_cents"] = get_cents(bank.discretisation_error_cents);
  mode["facet_error_cents"] = bank.facet_error_cents.empty() ? base::Json(0.0) : get_cents(bank.facet_error_cents);
  if (const Corrected& corrected = bank.corrected; !corrected.is_empty()) {
    mode.set("corrected_frequency_hz", corrected.freq_hz[i]).set("corrected_decay_per_s", corrected.decay_per_s[i]);
    mode.set("corrected_error_cents", get_cents(corrected.error_cents)).set("correction", describe(corrected.correction[i]));
  }
  mode["radiation_gain"] = bank.radiation_gain[i];
  if (const Multipoles& air = bank.multipoles; !air.is_empty()) {
    base::Json& radiation = mode["radiation"];
    radiation.set("frequency_hz", air.freq_hz[i]).set("order", air.order[i]).set("decay_per_s", air.decay_per_s[i]);
    radiation.set("added_mass", air.added_mass[i]).set("error_db", air.error_db[i]);
    if (!air.mixing.is_empty()) radiation["coupled_modes"] = air.mixing.count[i];
  }
  mode.set("shape_scale", bank.shape_scale[i]).set("kind", describe(kind));
  return mode;
}

base::Json make_damping(const Bank& bank) {
  const Damping& law = bank.damping;
  base::Json damping;
  damping["law"] = law.law;
  if (law.law == "rayleigh") {
    damping["rayleigh"].set("alpha1_s", bank.material.alpha1_s).set("alpha2_per_s", bank.material.alpha2_per_s);
  }
  if (!law.coefficient.empty()) damping["coefficient"] = make_list(law.coefficient);
  if (!law.power.empty()) damping["power"] = make_list(law.power);
  if (!law.freq_hz.empty()) {
    damping.set("freq_hz", make_list(law.freq_hz)).set("loss_factor", make_list(law.loss_factor));
  }
  return damping;
}

base::Json make_counts(const std::vector<std::int64_t>& counts) {
  base::Json list = base::Json::array();
  for (const std::int64_t count : counts) list.append(count);
  return list;
}

base::Json make_proof(const Proof& proof) {
  base::Json value;
  value.set("cut_hz", make_list(proof.cut_hz)).set("below", make_counts(proof.below)).set("margin", make_list(proof.margin));
  value.set("rigid_per_component", make_counts(proof.rigid_per_component)).set("found", proof.found);
  value.set("orthonormality", proof.orthonormality).set("backward_error", proof.backward_error);
  value.set("cluster_first", make_counts(proof.cluster_first)).set("cluster_count", make_counts(proof.cluster_count));
  value.set("method", proof.method);
  if (!proof.below_band_hz.empty()) value["below_band_hz"] = make_list(proof.below_band_hz);
  return value;
}

base::Json make_radiation(const Bank& bank) {
  const Multipoles& air = bank.multipoles;
  const RadiationFacts facts = find_radiation_facts(bank);
  base::Json radiation;
  radiation.set("method", air.method).set("centre_m", make_list(air.centre_m)).set("radius_m", air.radius_m);
  radiation.set("nearest_m", air.nearest_m).set("air_density_kg_m3", air.air_density_kg_m3).set("sound_speed_ms", air.sound_speed_ms);
  radiation.set("bytes", facts.bytes).set("worst_error_db", facts.worst_db).set("modes_mostly_damped_by_it", facts.strong);
  radiation.set("largest_added_mass_cents", facts.cents).set("most_coupled_modes", facts.parts);
  return radiation;
}

base::Json make_nonlinear(const QuarticEnergy& energy) {
  base::Json nonlinear;
  nonlinear.set("form", get_form(energy)).set("coupled_modes", energy.mode_count()).set("rows", energy.row_count());
  nonlinear.set("points", energy.point_count()).set("is_curved", !energy.linear.empty()).set("bytes", count_bytes(energy));
  nonlinear.set("energy_error", energy.error).set("membrane_ratio", energy.membrane_ratio).set("thickness_m", energy.thickness_m);
  return nonlinear;
}

/// Program or format that imported modes come from.
std::string find_origin_program(const Bank& bank) {
  const std::optional<base::Json> record = base::Json::parse(bank.provenance);
  return record && record->is_object() && record->has("imported") && (*record)["imported"].is_string()
             ? base::printable((*record)["imported"].as_string())
             : "another program";
}

}  // namespace

std::string format_info(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file, std::size_t mode_limit,
                        bool has_record) {
  const auto [major, minor] = read_version(file);
  const RigidBody& rigid = bank.rigid;
  const Material& m = bank.material;
  const auto& inertia = rigid.inertia_kg_m2;
  double worst = 0.0;
  for (const double residual : bank.residual) worst = std::max(worst, residual);
  std::string text =
      fmt::format("{}\n  Carillon bank, format {}.{}, {}\n", file.string(), major, minor, format_bytes(std::filesystem::file_size(file)));
  text += fmt::format("modes     {} of {:g} to {:g} Hz ({}), worst residual {:.1e}\n", bank.mode_count(), bank.band_hz[0], bank.band_hz[1],
                      bank.complete ? "complete" : "not all of the band", worst);
  text += fmt::format("surface   {} vertices, {} triangles, shapes of {} bytes a component\n", bank.vertex_count(), bank.triangles.size(),
                      bank.shape_bytes);
  if (bank.packing) text += fmt::format("packed    {}\n", describe(*bank.packing));
  if (bank.element == "imported")
    text += fmt::format("solve     none: imported from {}, accuracy unknown; {} points\n", find_origin_program(bank), bank.counts.nodes);
  else if (bank.element == "analytic")
    text += fmt::format("solve     none: known modes at {} points, {} rigid modes\n", bank.counts.nodes, bank.counts.rigid_modes);
  else
    text += fmt::format("solve     {} elements, {} mass; {} nodes, {} tets, {} component{}, {} rigid modes deflated\n", bank.element,
                        bank.mass, bank.counts.nodes, bank.counts.tets, bank.counts.components, bank.counts.components == 1 ? "" : "s",
                        bank.counts.rigid_modes);
  text += fmt::format("proof     {}\naccuracy  {}\n", describe_completeness(bank), describe_accuracy(bank));
  text += fmt::format("material  E {:.5g} Pa, nu {:.4g}, rho {:.5g} kg/m^3{}\n", m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3,
                      bank.regions.empty() ? "" : " (of the whole; several materials: --json)");
  text += fmt::format("damping   {}\n", format_damping(bank));
  if (!bank.multipoles.is_empty()) text += format_radiation(bank);
  if (!bank.quartic.is_empty()) text += format_nonlinear(bank.quartic);
  text += fmt::format("rigid     {:.6g} kg, {:.6g} m^3, centre ({:.5g}, {:.5g}, {:.5g}) m\n", rigid.mass_kg, rigid.volume_m3,
                      rigid.centre_m[0], rigid.centre_m[1], rigid.centre_m[2]);
  text += fmt::format("inertia   xx {:.5g}, yy {:.5g}, zz {:.5g}, xy {:.3g}, xz {:.3g}, yz {:.3g} kg m^2\n", inertia[0], inertia[4],
                      inertia[8], inertia[1], inertia[2], inertia[5]);
  if (mode_limit > 0 && bank.mode_count() > 0) text += format_modes(bank, heard, mode_limit);
  const std::optional<base::Json> provenance = base::Json::parse(bank.provenance);
  // Record of the run; the whole job is printed by --json only.
  const bool is_recorded = provenance && provenance->is_object() && provenance->has("run") && (*provenance)["run"].is_object();
  if (is_recorded && !has_record) text += "the record of its run: --all; the whole job too: --json\n";
  if (is_recorded && has_record) {
    text += "\nprovenance (the whole job: --json)\n";
    append_tree((*provenance)["run"], 1, text);
  }
  return text;
}

std::string format_info_json(const Bank& bank, std::span<const HeardMode> heard, const std::filesystem::path& file) {
  const auto [major, minor] = read_version(file);
  base::Json root;
  root.set("file", file.string()).set("format_version", fmt::format("{}.{}", major, minor)).set("bytes", std::filesystem::file_size(file));
  root.set("mode_count", bank.mode_count()).set("vertex_count", bank.vertex_count()).set("triangle_count", bank.triangles.size());
  root.set("band_hz", make_list(bank.band_hz)).set("complete", bank.complete).set("shape_bytes", bank.shape_bytes);
  if (bank.packing) {
    root["packing"].set("error_db", bank.packing->error_db).set("worst_db", bank.packing->worst_db);
  }
  root.set("element", bank.element).set("mass", bank.mass);
  base::Json& counts = root["counts"];
  counts.set("nodes", bank.counts.nodes).set("tets", bank.counts.tets).set("components", bank.counts.components);
  counts.set("rigid_modes", bank.counts.rigid_modes);
  base::Json& rigid = root["rigid"];
  rigid.set("mass_kg", bank.rigid.mass_kg).set("volume_m3", bank.rigid.volume_m3).set("centre_m", make_list(bank.rigid.centre_m));
  for (std::size_t i = 0; i < 3; ++i) rigid["inertia_kg_m2"].append(make_list(std::span(bank.rigid.inertia_kg_m2).subspan(3 * i, 3)));
  base::Json& material = root["material"];
  material.set("young_modulus_pa", bank.material.young_modulus_pa).set("poisson_ratio", bank.material.poisson_ratio);
  material.set("density_kg_m3", bank.material.density_kg_m3).set("damping", make_damping(bank));
  if (const auto regions = base::Json::parse(bank.regions); !bank.regions.empty())
    material["regions"] = regions ? *regions : base::Json(bank.regions);
  if (!bank.multipoles.is_empty()) root["radiation"] = make_radiation(bank);
  if (!bank.quartic.is_empty()) root["nonlinear"] = make_nonlinear(bank.quartic);
  root.set("proof", bank.proof ? make_proof(*bank.proof) : base::Json()).set("frequencies_hz", base::Json::array());
  root.set("corrected_frequencies_hz", base::Json::array());
  for (const std::size_t mode : sort_modes(bank))
    if (!bank.corrected.is_empty()) root["corrected_frequencies_hz"].append(bank.corrected.freq_hz[mode]);
  root["modes"] = base::Json::array();
  const std::vector<ModeKind> kinds = find_kinds(bank);
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    root["frequencies_hz"].append(bank.freq_hz(i));
    root["modes"].append(make_mode(bank, heard[i], i, kinds[i]));
  }
  const auto provenance = base::Json::parse(bank.provenance);
  root["provenance"] = provenance ? *provenance : base::Json(bank.provenance);
  return root.sorted_text({.indentation = "  ", .breaks_arrays = true}) + "\n";
}

std::string format_info_csv(const Bank& bank, std::span<const HeardMode> heard) {
  std::string text =
      "mode,frequency_hz,heard_frequency_hz,corrected_error_cents,facet_error_cents,heard_decay_per_s,material_per_s,radiation_per_s,"
      "supports_per_s,t60_s,radiation_gain,kind\n";
  const auto format = [](const std::vector<double>& values, std::size_t mode) {
    return mode < values.size() && std::isfinite(values[mode]) ? fmt::format("{}", values[mode]) : std::string();
  };
  const std::vector<ModeKind> kinds = find_kinds(bank);
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const double t60_s = heard[i].calc_t60_s();
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},\"{}\"\n", i + 1, bank.freq_hz(i), heard[i].freq_hz,
                        format(bank.corrected.error_cents, i), bank.facet_error_cents.empty() ? "0" : format(bank.facet_error_cents, i),
                        heard[i].calc_decay_per_s(), heard[i].material_per_s, heard[i].radiation_per_s, heard[i].supports_per_s,
                        std::isfinite(t60_s) ? fmt::format("{}", t60_s) : "", bank.radiation_gain[i], describe(kinds[i]));
  }
  return text;
}

Check calc_regions_check(const Bank& bank) {
  Check check{"materials", "one", {}};
  if (bank.regions.empty()) return check;
  const std::optional<base::Json> regions = base::Json::parse(bank.regions);
  if (!regions || !regions->is_array()) {
    check.faults.push_back("material/regions is no JSON list");
  } else {
    check.figure = fmt::format("{} by region of the mesh", regions->size());
  }
  return check;
}

Check calc_provenance_check(const Bank& bank) {
  Check check{"provenance", fmt::format("{} bytes of JSON", bank.provenance.size()), {}};
  if (bank.provenance.empty()) {
    check.figure = "none given";
  } else if (!base::Json::parse(bank.provenance)) {
    check.faults.push_back("provenance is not JSON text");
  }
  return check;
}

std::string format_check(const Check& check) {
  if (check.faults.empty()) return fmt::format("ok      {:<12} {}\n", check.property, base::printable(check.figure));
  std::string text;
  for (const std::string& fault : check.faults) text += fmt::format("FAULT   {:<12} {}\n", check.property, base::printable(fault));
  return text;
}

}  // namespace carillon::bank
