#include "jobs/front/report/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/heard.hpp"
#include "runtime/bank/kinds.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/base/error.hpp"

namespace carillon::report {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxNamedModes = 1000;  // rows of the table of modes
constexpr std::size_t kMaxFaults = 20;        // per check
constexpr std::size_t kBins = 6;              // of 10 degrees: the smallest angle of a triangle is at most 60 degrees

/// null for infinity and NaN.
base::Json to_json(double value) { return std::isfinite(value) ? base::Json(value) : base::Json(); }

template <class Values>
base::Json make_list(const Values& values) {
  base::Json list = base::Json::array();
  for (const auto& value : values) list.add(to_json(static_cast<double>(value)));
  return list;
}

bool is_valid(const std::vector<bank::Check>& checks) {
  return std::all_of(checks.begin(), checks.end(), [](const bank::Check& check) { return check.faults.empty(); });
}

std::vector<bank::HeardMode> find_heard(const bank::Bank& bank, bool is_valid) {
  try {
    if (is_valid) return mounting::calc_heard(bank);
  } catch (const InputError&) {  // invalid supports
  }
  return bank::list_heard(bank, {});
}

std::string format_cents(double cents) {
  return std::abs(cents) >= 9.95 && std::abs(cents) < 1e7 ? fmt::format("{:.0f} cent", cents) : fmt::format("{:.2g} cent", cents);
}

/// Accuracy of the frequencies, worst of all modes, without a full stop.
std::string describe_bars(const bank::Bank& bank) {
  const auto find_worst = [](const std::vector<double>& bars) { return *std::max_element(bars.begin(), bars.end()); };
  if (bank.mode_count() == 0) return "There are no frequencies";
  if (bank.element == "imported") return "The accuracy is " + bank::describe_accuracy(bank);
  if (bank.element == "analytic") {
    std::string text = bank::describe_accuracy(bank);
    text[0] = 'F';
    return text;
  }
  std::string text = bank.algebraic_error_cents.empty() ? "There are no bounds against the mesh"
                                                        : fmt::format("Frequencies are those of the mesh to {} (a bound)",
                                                                      format_cents(find_worst(bank.algebraic_error_cents)));
  const bool is_corrected = !bank.corrected.is_empty();
  const std::vector<double>& bars = is_corrected ? bank.corrected.error_cents : bank.discretisation_error_cents;
  if (bars.empty()) return text + ", and no estimates against the body";
  if (const double worst = find_worst(bars); std::isfinite(worst))
    text += fmt::format(", and {}those of the body to about {} (an estimate)", is_corrected ? "corrected ones " : "", format_cents(worst));
  else
    text += ", and not all of them have an estimate against the body";
  return bank.facet_error_cents.empty() ? text : text + "; " + bank::describe_facets(bank);
}

base::Json make_modes(const bank::Bank& bank, const std::vector<bank::HeardMode>& heard) {
  base::Json modes;
  for (const char* key :
       {"freq_hz", "heard_hz", "decay_per_s", "material_per_s", "radiation_per_s", "supports_per_s", "correction", "kind"})
    modes[key] = base::Json::array();
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    modes["freq_hz"].add(to_json(bank.freq_hz(i)));
    modes["heard_hz"].add(to_json(heard[i].freq_hz));
    modes["decay_per_s"].add(to_json(heard[i].calc_decay_per_s()));
    modes["material_per_s"].add(to_json(heard[i].material_per_s));
    if (!bank.multipoles.is_empty()) modes["radiation_per_s"].add(to_json(heard[i].radiation_per_s));
    if (bank.supports.count() > 0) modes["supports_per_s"].add(to_json(heard[i].supports_per_s));
    if (!bank.corrected.is_empty() && i < kMaxNamedModes) modes["correction"].add(bank::describe(bank.corrected.correction[i]));
  }
  for (const bank::ModeKind& kind : bank::find_kinds(bank, std::min(kMaxNamedModes, bank.mode_count())))
    modes["kind"].add(bank::describe(kind));
  modes.set("bound_cents", make_list(bank.algebraic_error_cents)).set("body_cents", make_list(bank.discretisation_error_cents));
  modes.set("corrected_cents", make_list(bank.corrected.error_cents)).set("facet_cents", make_list(bank.facet_error_cents));
  modes.set("residual", make_list(bank.residual)).set("gain", make_list(bank.radiation_gain));
  return modes;
}

base::Json make_proof(const bank::Proof& proof) {
  base::Json json;
  const std::size_t cuts = std::min({proof.cut_hz.size(), proof.below.size(), proof.margin.size()});
  for (const char* key : {"cut_hz", "below", "margin"}) json[key] = base::Json::array();
  for (std::size_t i = 0; i < cuts; ++i) {
    json["cut_hz"].add(to_json(proof.cut_hz[i]));
    json["below"].add(proof.below[i]);
    json["margin"].add(to_json(proof.margin[i]));
  }
  json.set("below_band_hz", make_list(proof.below_band_hz));
  json.set("orthonormality", to_json(proof.orthonormality)).set("backward_error", to_json(proof.backward_error));
  json.set("rigid", make_list(proof.rigid_per_component)).set("clusters", proof.cluster_first.size()).set("method", proof.method);
  return json;
}

/// Edges and smallest angles of the triangles with finite corners; null without such triangles. An edge counts once per triangle.
base::Json make_surface(const bank::Bank& bank) {
  double shortest_m = std::numeric_limits<double>::infinity(), longest_m = 0.0, sum_m = 0.0, smallest_deg = 180.0;
  std::array<std::int64_t, kBins> triangles{};
  std::int64_t count = 0;
  for (const auto& triangle : bank.triangles) {
    std::array<double, 3> edge{};
    if (std::any_of(triangle.begin(), triangle.end(),
                    [&](const auto corner) { return static_cast<std::size_t>(corner) >= bank.vertices_m.size(); }))
      continue;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3 &x = bank.vertices_m[triangle[i]], &y = bank.vertices_m[triangle[(i + 1) % 3]];
      edge[i] = std::hypot(y[0] - x[0], y[1] - x[1], y[2] - x[2]);
    }
    const auto [shortest, longest] = std::minmax({edge[0], edge[1], edge[2]});
    if (!std::isfinite(edge[0] + edge[1] + edge[2]) || !(shortest > 0.0)) continue;
    const double middle = edge[0] + edge[1] + edge[2] - shortest - longest;
    // The smallest angle is opposite to the shortest edge.
    const double cosine = (middle / longest + longest / middle - shortest / middle * (shortest / longest)) / 2.0;
    const double angle_deg = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / std::numbers::pi;
    smallest_deg = std::min(smallest_deg, angle_deg);
    shortest_m = std::min(shortest_m, shortest);
    longest_m = std::max(longest_m, longest);
    sum_m += (edge[0] + edge[1] + edge[2]) / 3.0;
    ++triangles[std::min(static_cast<std::size_t>(angle_deg / 10.0), kBins - 1)];
    ++count;
  }
  base::Json json;
  if (count == 0) return json;
  json.set("shortest_m", shortest_m).set("longest_m", longest_m).set("mean_m", sum_m / static_cast<double>(count));
  json.set("smallest_deg", smallest_deg).set("triangles", make_list(triangles));
  return json;
}

/// [name, bytes] of the parts of the file.
base::Json make_parts(const bank::Bank& bank, double file_bytes) {
  const double shapes = 2.0 * static_cast<double>(bank.shape.size());
  const double surface = 24.0 * static_cast<double>(bank.vertex_count()) + 12.0 * static_cast<double>(bank.triangles.size());
  const double bars =
      8.0 * static_cast<double>(bank.algebraic_error_cents.size() + bank.discretisation_error_cents.size() + bank.facet_error_cents.size());
  const double numbers = 8.0 * 6.0 * static_cast<double>(bank.mode_count()) + bars;
  const double record = static_cast<double>(bank.provenance.size() + bank.regions.size());
  const double rest = std::max(0.0, file_bytes - shapes - surface - numbers - record);
  base::Json parts = base::Json::array();
  for (const auto& [name, bytes] : {std::pair{"shapes", shapes},
                                    {"surface", surface},
                                    {"numbers of modes", numbers},
                                    {"job and record", record},
                                    {"layout, views, rest", rest}}) {
    base::Json& part = parts.append();
    part.add(name).add(bytes);
  }
  return parts;
}

base::Json make_checks(const std::vector<bank::Check>& checks) {
  base::Json list = base::Json::array();
  for (const bank::Check& check : checks) {
    base::Json& json = list.append();
    json.set("property", check.property).set("figure", check.figure).set("faults", base::Json::array());
    for (std::size_t i = 0; i < std::min(check.faults.size(), kMaxFaults); ++i) json["faults"].add(check.faults[i]);
  }
  return list;
}

}  // namespace

base::Json make_figures(const fs::path& file, std::string& provenance) {
  const bank::Bank bank = bank::read_bank_unchecked(file);
  const std::vector<bank::Check> checks = bank::calc_checks(bank);
  const bool is_sound = is_valid(checks);
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(file, error);
  provenance = bank.provenance;
  base::Json json;
  json.set("file", file.filename().string()).set("bytes", error ? 0.0 : static_cast<double>(bytes));
  json.set("version", make_list(bank::read_version(file))).set("element", bank.element).set("mass", bank.mass);
  json.set("origin", bank::name_origin(bank)).set("band_hz", make_list(bank.band_hz)).set("complete", bank.complete);
  json.set("completeness", is_sound && bank.proof ? base::Json(bank::describe_completeness(bank)) : base::Json());
  json.set("accuracy", is_sound ? describe_bars(bank) : std::string()).set("nodes", bank.counts.nodes).set("tets", bank.counts.tets);
  json.set("components", bank.counts.components).set("triangles", bank.triangles.size()).set("vertices", bank.vertex_count());
  json.set("mass_kg", to_json(bank.rigid.mass_kg)).set("volume_m3", to_json(bank.rigid.volume_m3));
  json.set("modes", make_modes(bank, find_heard(bank, is_sound))).set("proof", bank.proof ? make_proof(*bank.proof) : base::Json());
  json.set("surface", make_surface(bank)).set("parts", make_parts(bank, json["bytes"].as_double())).set("checks", make_checks(checks));
  return json;
}

}  // namespace carillon::report
