// Method:     what came of the solve: the figures of the head, the file of the bank and its checks, the job.
// Source:     docs/bank-format.md (what a bank holds).
// Deviations: none.
#include <algorithm>
#include <cmath>

#include "jobs/front/report/chart.hpp"
#include "jobs/front/report/quantity.hpp"
#include "jobs/front/report/sections.hpp"

namespace carillon::report {
namespace {

constexpr std::size_t kMaxFaults = 50;
constexpr std::size_t kMaxJobBytes = 200000;

Html make_tile(std::string_view what, const Html& value, std::string_view remark) {
  return html("<div class=\"tile\"><div class=\"what\">{}</div><div class=\"value\">{}</div><div class=\"remark\">{}</div></div>\n", what,
              value, remark);
}

Html make_tiles(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  Html out = make_tile("Modes", html("{}", format_count(static_cast<std::int64_t>(bank.mode_count()))),
                       fmt::format("{} to {} Hz", format_plain(bank.band_hz[0]), format_plain(bank.band_hz[1])));
  const bool is_corrected = !bank.corrected.is_empty();
  const std::vector<double>& bars = is_corrected ? bank.corrected.error_cents : bank.discretisation_error_cents;
  const auto worst = std::max_element(bars.begin(), bars.end());
  out += make_tile("Error bar", worst == bars.end() ? html("-") : html("{}", format_cents(*worst)),
                   worst == bars.end() ? "not known"
                   : is_corrected      ? "body, worst mode, corrected"
                                       : "body, worst mode");
  const auto residual = std::max_element(bank.residual.begin(), bank.residual.end());
  out += make_tile("Residual", residual == bank.residual.end() ? html("-") : html("{:.1e}", *residual), "worst mode");
  const auto seconds = find_run_seconds(subject);
  const auto bytes = find_peak_bytes(subject);
  const auto ranks = find_count(subject.record.run, "ranks");
  const std::string on = ranks ? fmt::format("{} rank{}", *ranks, *ranks == 1 ? "" : "s") : "";
  out += make_tile("Time", html("{}", seconds ? format_seconds(*seconds) : "-"), seconds ? on : "not recorded");
  out += make_tile("Memory", html("{}", bytes ? format_bytes(*bytes) : "-"), bytes ? "peak of all ranks" : "not recorded");
  out += make_tile("Bank", html("{}", format_bytes(subject.file_bytes)),
                   fmt::format("{} vertices", format_count(static_cast<std::int64_t>(bank.vertex_count()))));
  return html("<div class=\"tiles\">\n{}</div>\n", out);
}

/// How wrong the frequencies can be, the worst of all modes, without a full stop.
std::string describe_bars(const bank::Bank& bank) {
  const auto find_worst = [](const std::vector<double>& bars) { return *std::max_element(bars.begin(), bars.end()); };
  if (bank.mode_count() == 0) return "There are no frequencies that could be wrong";
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

Html make_warnings(const Subject& subject) {
  std::vector<std::string> texts = find_texts(find(subject.record.run, "warnings"));
  texts.insert(texts.end(), subject.record.remarks.begin(), subject.record.remarks.end());
  return make_note(texts);
}

/// The shares of the file that the layout gives to its parts.
std::vector<Bar> make_size_bars(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  const auto modes = static_cast<double>(bank.mode_count()), vertices = static_cast<double>(bank.vertex_count());
  const double shapes = 2.0 * static_cast<double>(bank.shape.size());
  const double surface = 24.0 * vertices + 12.0 * static_cast<double>(bank.triangles.size());
  const double bars =
      8.0 * static_cast<double>(bank.algebraic_error_cents.size() + bank.discretisation_error_cents.size() + bank.facet_error_cents.size());
  const double numbers = 8.0 * 6.0 * modes + bars;
  const double record = static_cast<double>(bank.provenance.size() + bank.regions.size());
  const double rest = std::max(0.0, subject.file_bytes - shapes - surface - numbers - record);
  const auto make = [&](const char* what, double bytes) {
    return Bar{what, bytes, fmt::format("{} \u00b7 {}", format_bytes(bytes), format_percent(bytes / std::max(1.0, subject.file_bytes)))};
  };
  return {make("shapes", shapes), make("surface", surface), make("numbers of modes", numbers), make("job and record", record),
          make("layout, views, rest", rest)};
}

/// A text of JSON as lines.
std::string write_lines(const base::Json& value) {
  return value.sorted_text({.indentation = "  ", .is_ascii = false, .breaks_arrays = true});
}

}  // namespace

bool Subject::is_sane() const {
  return std::all_of(checks.begin(), checks.end(), [](const bank::Check& check) { return check.faults.empty(); });
}

std::string explain_missing(const Subject& subject, std::string_view what) {
  if (subject.record.run.is_null()) return fmt::format("there is no record of the run, and so no {}.", what);
  return fmt::format("the record of the run holds no {}; it is of an older version, or damaged.", what);
}

Html make_head(const Subject& subject, std::string_view title) {
  const bank::Bank& bank = subject.bank;
  Html out = html("<header>\n<h1>{}</h1>\n<p class=\"remark\">{}, bank of version {}.{}; {}</p>\n", title, subject.file.filename().string(),
                  subject.version[0], subject.version[1],
                  bank.element == "analytic"   ? "known modes"
                  : bank.element == "imported" ? "modes imported from another program"
                                               : fmt::format("{} elements, {} mass", bank.element, bank.mass));
  const auto faults =
      std::count_if(subject.checks.begin(), subject.checks.end(), [](const bank::Check& one) { return !one.faults.empty(); });
  if (faults > 0) {
    out += html("<p class=\"verdict bad\">This bank is not sane: {} of {} checks fail. <a href=\"#checks\">Which?</a></p>\n", faults,
                subject.checks.size());
  } else {
    out += html("<p class=\"verdict {}\">{}.<br>{}.</p>\n", bank.proof ? "good" : "fair",
                bank.proof ? bank::describe_completeness(bank) : "There is no proof that no mode is missing", describe_bars(bank));
  }
  out += make_warnings(subject);
  out += make_tiles(subject);
  return out += html("</header>\n");
}

Html make_bank_section(const Subject& subject) {
  const bank::Bank& bank = subject.bank;
  Html out = html("<p>{} in all, {} bytes: {} vertices of the surface, {} modes.</p>\n", format_bytes(subject.file_bytes),
                  format_count(static_cast<std::int64_t>(subject.file_bytes)), format_count(static_cast<std::int64_t>(bank.vertex_count())),
                  format_count(static_cast<std::int64_t>(bank.mode_count())));
  out += draw_bars("Bytes by part of the bank", make_size_bars(subject));
  return make_section("size", "Size of the bank", out);
}

Html make_check_section(const Subject& subject) {
  Table table({{""}, {"property"}, {"figure"}});
  for (const bank::Check& check : subject.checks) {
    if (check.faults.empty()) table.add({html("<span class=\"ok\">ok</span>"), html("{}", check.property), html("{}", check.figure)});
    for (std::size_t i = 0; i < std::min<std::size_t>(check.faults.size(), kMaxFaults); ++i)
      table.add({html("<span class=\"fault\">FAULT</span>"), html("{}", check.property), html("{}", check.faults[i])});
  }
  return make_section("checks", "Checks",
                      html("{}<p class=\"remark\">As carillon-bank check says it; it counts modes from 0.</p>\n", table.finish()));
}

Html make_job_section(const Subject& subject) {
  base::Json job = subject.record.job;
  if (!job.is_object()) return leave_out("job", "Job", "neither the file of the resolved job nor the bank holds it.");
  job.erase("run");
  Html out = html("<pre>{}</pre>\n", escape(write_lines(job), kMaxJobBytes));
  return make_section("job", "Job", out);
}

}  // namespace carillon::report
