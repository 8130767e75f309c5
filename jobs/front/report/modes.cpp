// Method:     frequencies on a logarithmic axis, each with what is known of its error; numbers in tables next to the charts.
// Source:     docs/error-bars.md, docs/howto/trust-a-bank.md.
// Deviations: none.
#include <algorithm>
#include <cmath>

#include "jobs/front/report/chart.hpp"
#include "jobs/front/report/quantity.hpp"
#include "jobs/front/report/sections.hpp"
#include "runtime/bank/kinds.hpp"

namespace carillon::report {
namespace {

constexpr std::size_t kMaxModeRows = 1000;
constexpr double kResidualLimit = 1e-4;  // of a sane bank

/// Sum of the error bars of a mode's heard frequency [cent]; 0: unknown.
double calc_cents(const bank::Bank& bank, std::size_t mode) {
  double cents = 0.0;
  if (mode < bank.corrected.error_cents.size())
    return std::isfinite(bank.corrected.error_cents[mode]) ? bank.corrected.error_cents[mode] : 0.0;
  for (const std::vector<double>* bars : {&bank.algebraic_error_cents, &bank.discretisation_error_cents})
    if (mode < bars->size() && std::isfinite((*bars)[mode])) cents += (*bars)[mode];
  return cents;
}

std::string format_small(double value) { return fmt::format("{:.1e}", value); }

Html make_cents(const std::vector<double>& cents, std::size_t mode) {
  return mode < cents.size() && std::isfinite(cents[mode]) ? html("{:.2g}", cents[mode]) : html("-");
}

std::string name_mode(const Subject& subject, std::size_t mode) {
  return fmt::format("mode {}, {}", mode + 1, format_hz(subject.heard[mode].freq_hz));
}

Axis make_frequency_axis() { return {.label = "frequency [Hz]", .is_log = true}; }

/// Sticks over the frequency as high as the mode rings long; where not all decay, as high as their number.
Html draw_mode_chart(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  bool rings_out = true;
  for (const bank::HeardMode& mode : subject.heard)
    rings_out = rings_out && mode.calc_decay_per_s() > 0.0 && std::isfinite(mode.calc_decay_per_s());
  Scatter chart{.title = "Modes by frequency",
                .x = make_frequency_axis(),
                .y = {.label = rings_out ? "falls by 60 dB in [s]" : "number of the mode", .is_log = rings_out},
                .series = {{.name = "modes", .colour = 0, .marks = {}, .is_stick = true}},
                .lines = {}};
  for (std::size_t i = 0; i < bank.mode_count(); ++i) {
    const double freq = subject.heard[i].freq_hz, cents = calc_cents(bank, i), width = std::exp2(std::min(cents, 12000.0) / 1200.0);
    std::string title = name_mode(subject, i);
    if (cents > 0.0) title += fmt::format(" \u00b1 {}", format_cents(cents));
    if (rings_out) title += fmt::format(", T60 {:.3g} s", subject.heard[i].calc_t60_s());
    chart.series[0].marks.push_back({.x = freq,
                                     .y = rings_out ? subject.heard[i].calc_t60_s() : static_cast<double>(i + 1),
                                     .x_low = cents > 0.0 ? freq / width : 0.0,
                                     .x_high = cents > 0.0 ? freq * width : 0.0,
                                     .title = std::move(title)});
  }
  return draw_scatter(chart);
}

/// A number of each mode, not negative, over the frequency.
Series make_series(const Subject& subject, const char* name, int colour, const std::vector<double>& values, std::string (*format)(double)) {
  Series series{.name = name, .colour = colour, .marks = {}};
  for (std::size_t i = 0; i < std::min(values.size(), subject.heard.size()); ++i) {
    series.marks.push_back(
        {.x = subject.heard[i].freq_hz, .y = values[i], .title = fmt::format("{}: {} {}", name_mode(subject, i), name, format(values[i]))});
  }
  return series;
}

Html make_mode_table(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  const std::string frequency = fmt::format("{} [Hz]", bank::name_origin(bank)),
                    bound = fmt::format("\u00b1 {} [cent]", bank::name_origin(bank));
  std::vector<Column> columns{{"mode", true},
                              {frequency.c_str(), true},
                              {bound.c_str(), true},
                              {"\u00b1 body [cent]", true},
                              {"heard [Hz]", true},
                              {"\u00b1 body [cent]", true},
                              {"correction"},
                              {"decay [1/s]", true},
                              {"of material", true},
                              {"of radiation", true},
                              {"of supports", true},
                              {"T60 [s]", true},
                              {"residual", true},
                              {"gain", true},
                              {"kind"}};
  if (!bank.facet_error_cents.empty()) columns.push_back({"facets in doubt [cent]", true});
  Table table(columns);
  const std::size_t shown = std::min(kMaxModeRows, bank.mode_count());
  const std::vector<bank::ModeKind> kinds = bank::find_kinds(bank, shown);
  const bool is_corrected = !bank.corrected.is_empty();
  for (std::size_t i = 0; i < shown; ++i) {
    const bank::HeardMode& heard = subject.heard[i];
    table.add({html("{}", i + 1), html("{:.2f}", bank.freq_hz(i)), make_cents(bank.algebraic_error_cents, i),
               make_cents(bank.discretisation_error_cents, i), html("{:.2f}", heard.freq_hz), make_cents(bank.corrected.error_cents, i),
               html("{}", is_corrected ? bank::describe(bank.corrected.correction[i]) : "-"), html("{:.4g}", heard.calc_decay_per_s()),
               html("{:.4g}", heard.material_per_s), bank.multipoles.is_empty() ? html("-") : html("{:.4g}", heard.radiation_per_s),
               bank.supports.count() == 0 ? html("-") : html("{:.4g}", heard.supports_per_s), html("{:.3g}", heard.calc_t60_s()),
               html("{:.1e}", bank.residual[i]), html("{:.4g}", bank.radiation_gain[i]), html("{}", bank::describe(kinds[i])),
               make_cents(bank.facet_error_cents, i)});
  }
  Html out = table.finish();
  if (shown < bank.mode_count())
    out += html("<p class=\"remark\">The first {} of {} modes; carillon-bank info --json has them all.</p>\n", shown, bank.mode_count());
  return html(
      "<details><summary>All modes in numbers</summary>\n{}<p class=\"remark\">Frequencies are undamped. \u00b1 {}: to the exact mode, a "
      "bound; \u00b1 body: to the mode of the body, an estimate; heard: what is played, with the estimated error of the "
      "mesh taken off, in air and on its supports as far as the bank knows them; decay and T60: what is heard, with its parts; gain: Pa at "
      "1 m for unit modal velocity; kind: how the body moves, where its shape says so; facets in doubt: what comes to \u00b1 body if the "
      "facets are not what they were taken for.</p>\n</details>\n",
      out, bank::name_origin(bank));
}

Html find_largest(const std::vector<double>& values, const Subject& subject, std::string (*format)(double)) {
  const auto worst = std::max_element(values.begin(), values.end());
  if (worst == values.end()) return {};
  return html("{} at {}", format(*worst), name_mode(subject, static_cast<std::size_t>(worst - values.begin())));
}

/// Both error bars over the frequency; bounds that are negligible against the estimates only in words.
Html draw_errors(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  constexpr double kNothing = 1e-3;
  const auto find_worst = [](const std::vector<double>& bars) {
    double worst = 0.0;
    for (const double cents : bars)
      if (std::isfinite(cents)) worst = std::max(worst, cents);
    return worst;
  };
  const double body = find_worst(bank.discretisation_error_cents), mesh = find_worst(bank.algebraic_error_cents);
  Scatter chart{.title = "Error bars by frequency",
                .x = make_frequency_axis(),
                .y = {.label = "error bar [cent]", .is_log = true},
                .series = {},
                .lines = {}};
  if (body > 0.0) chart.series.push_back(make_series(subject, "body (estimate)", 0, bank.discretisation_error_cents, format_cents));
  if (find_worst(bank.corrected.error_cents) > 0.0)
    chart.series.push_back(make_series(subject, "body, corrected", 2, bank.corrected.error_cents, format_cents));
  if (mesh > kNothing * body) chart.series.push_back(make_series(subject, "mesh (bound)", 1, bank.algebraic_error_cents, format_cents));
  Html out = draw_scatter(chart);
  if (body > 0.0 && mesh > 0.0 && mesh <= kNothing * body)
    out += html("<p class=\"remark\">Estimates against the body; the bounds of the mesh are negligible against them.</p>\n");
  return out;
}

/// What was counted at the cuts, and what was found between them.
Html make_cut_table(const bank::Bank& bank) {
  const bank::Proof& proof = *bank.proof;
  Table table(
      {{"below [Hz]", true}, {"counted by inertia", true}, {"counted since the cut before", true}, {"modes here", true}, {"margin", true}});
  const std::size_t cuts = std::min({proof.cut_hz.size(), proof.below.size(), proof.margin.size()});
  for (std::size_t i = 0; i < std::min(cuts, kMaxModeRows); ++i) {
    std::int64_t here = 0;
    for (std::size_t m = 0; i > 0 && m < bank.mode_count(); ++m)
      here += static_cast<std::int64_t>(bank.freq_hz(m) >= proof.cut_hz[i - 1] && bank.freq_hz(m) < proof.cut_hz[i]);
    table.add({html("{:.6g}", proof.cut_hz[i]), html("{}", proof.below[i]),
               i > 0 ? html("{}", proof.below[i] - proof.below[i - 1]) : Html(), i > 0 ? html("{}", here) : Html(),
               html("{:.2g}", proof.margin[i])});
  }
  return table.finish();
}

}  // namespace

Html make_modes_section(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  if (bank.mode_count() == 0) return leave_out("modes", "Modes", "the bank has no modes; its band holds none.");
  const auto [lowest, highest] =
      std::minmax_element(subject.heard.begin(), subject.heard.end(), [](const auto& a, const auto& b) { return a.freq_hz < b.freq_hz; });
  Html out = html("<p>{} modes from {} to {}; the band is {} Hz to {} Hz{}.</p>\n",
                  format_count(static_cast<std::int64_t>(bank.mode_count())), format_hz(lowest->freq_hz), format_hz(highest->freq_hz),
                  format_plain(bank.band_hz[0]), format_plain(bank.band_hz[1]), bank.complete ? "" : ", and not all of its modes are here");
  out += draw_mode_chart(subject);
  if (!bank.discretisation_error_cents.empty() || !bank.algebraic_error_cents.empty())
    out += html("<p class=\"remark\">Whiskers along the frequency: its error bars.</p>\n");
  out += make_mode_table(subject);
  return make_section("modes", "Modes", out);
}

Html make_proof_section(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  if (!bank.proof) {
    const bool is_first = subject.version[0] == 1 && subject.version[1] == 0;
    return leave_out("proof", "Proof that no mode is missing",
                     !bank.complete ? "the bank carries none: of the band's modes the most audible ones were kept."
                     : is_first     ? "banks of version 1.0 carry none; nothing shows that the band holds no more modes than these."
                                    : "the bank carries none; nothing shows that the band holds no more modes than these.");
  }
  const bank::Proof& proof = *bank.proof;
  Html out;
  if (subject.is_sane()) out += html("<p>{}.</p>\n", bank::describe_completeness(bank));
  out += html(
      "<p>The signs of the pivots of K \u2212 \u03c3M count the modes below a frequency exactly, whatever the iteration found. Between two "
      "cuts both have to agree.</p>\n");
  out += make_cut_table(bank);
  Facts facts;
  facts.add("worst orthonormality", html("{:.1e}", proof.orthonormality),
            "largest error of \u03c6\u1d62\u1d40 M \u03c6\u2c7c = \u03b4\u1d62\u2c7c");
  facts.add("worst backward error", html("{:.1e}", proof.backward_error), "of the factorisations behind the counts");
  std::string rigid;
  for (std::size_t i = 0; i < std::min<std::size_t>(proof.rigid_per_component.size(), 24); ++i)
    rigid += fmt::format("{}{}", i == 0 ? "" : ", ", proof.rigid_per_component[i]);
  if (proof.rigid_per_component.size() > 24) rigid += " ...";
  facts.add("rigid motions", html("{}", rigid), "of each connected part; 6 where no node is fixed");
  facts.add("groups of degenerate modes", html("{}", proof.cluster_first.size()), "their single shapes are one choice among many");
  facts.add("method", html("{}", proof.method));
  out += facts.finish();
  return make_section("proof", "Proof that no mode is missing", out);
}

Html make_error_section(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  if (bank.algebraic_error_cents.empty() && bank.discretisation_error_cents.empty()) {
    return leave_out("errors", "Error bars", "the bank has none; how far its frequencies are from those of the body is not known.");
  }
  Facts facts;
  if (const Html worst = find_largest(bank.discretisation_error_cents, subject, format_cents); !worst.empty())
    facts.add("body, largest", worst, "how far the mode of the body may be: an estimate");
  if (const Html worst = find_largest(bank.corrected.error_cents, subject, format_cents); !worst.empty())
    facts.add("corrected, largest", worst, "how far it may be from the corrected frequency: an estimate");
  if (const Html worst = find_largest(bank.facet_error_cents, subject, format_cents); !worst.empty())
    facts.add("facets in doubt, largest", worst,
              "by how much farther the body may be if the facets are not what they were taken for, planes or samples of a smooth surface: "
              "an estimate, in no bar; a surface in finer facets settles it, or \"facets\": true in the job");
  if (const Html worst = find_largest(bank.algebraic_error_cents, subject, format_cents); !worst.empty())
    facts.add("mesh, largest", worst, "how far the exact mode of this mesh may be: a bound");
  if (const auto asked = find_amount(subject.record.job, "accuracy_cents")) facts.add("asked for", html("{} cent", format_plain(*asked)));
  Html out = facts.finish();
  out += draw_errors(subject);
  const base::Json& trials = find(find(subject.record.run, "accuracy"), "trials");
  Table table({{"trial", true}, {"element"}, {"nodes", true}, {"worst error bar [cent]", true}, {"CPU time", true}});
  for (std::size_t i = 0; trials.is_array() && i < std::min<std::size_t>(trials.size(), 100); ++i) {
    const base::Json& trial = trials[i];
    const auto nodes = find_count(trial, "nodes");
    const auto cents = find_amount(trial, "worst_cents"), seconds = find_amount(trial, "cpu_seconds");
    table.add({html("{}", i + 1), html("{}", find_text(trial, "element").value_or("-")), html("{}", nodes ? format_count(*nodes) : "-"),
               html("{}", cents ? fmt::format("{:.3g}", *cents) : "-"), html("{}", seconds ? format_seconds(*seconds) : "-")});
  }
  if (!table.empty()) out += html("<h3>On the way to the accuracy that was asked for</h3>\n{}", table.finish());
  return make_section("errors", "Error bars", out);
}

Html make_residual_section(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  if (bank.mode_count() == 0) return leave_out("residuals", "Residuals", "the bank has no modes.");
  Facts facts;
  facts.add("largest", find_largest(bank.residual, subject, format_small), "||K\u03c6 \u2212 \u03bbM\u03c6|| / (\u03bb ||M\u03c6||)");
  Scatter chart{.title = "Residuals by frequency",
                .x = make_frequency_axis(),
                .y = {.label = "residual", .is_log = true},
                .series = {make_series(subject, "residual", 0, bank.residual, format_small)},
                .lines = {}};
  auto tolerance = find_amount(find(subject.record.run, "chosen"), "tolerance");
  if (!tolerance) tolerance = find_amount(find(subject.record.job, "solver"), "tolerance");
  if (tolerance && *tolerance > 0.0) {
    facts.add("tolerance", html("{}", format_plain(*tolerance)), "of the job");
    chart.lines.push_back({*tolerance, "tolerance of the job"});
  } else {
    chart.lines.push_back({kResidualLimit, "limit of a sane bank"});
  }
  const base::Json& solver = find(subject.record.run, "solver");
  if (const auto above = find_count(solver, "above_tolerance"))
    facts.add("above the tolerance", html("{}", *above), "modes for which rounding allows no better");
  if (const auto error = find_amount(solver, "orthonormality_error")) facts.add("orthonormality", html("{:.1e}", *error), "largest error");
  Html out = facts.finish();
  out += draw_scatter(chart);
  return make_section("residuals", "Residuals", out);
}

}  // namespace carillon::report
