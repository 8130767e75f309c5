// Method:     what the solver recorded of its run, phase by phase and rank by rank.
// Source:     none.
// Deviations: of very many ranks each bar is the largest of several.
#include <algorithm>
#include <cmath>

#include "jobs/front/report/chart.hpp"
#include "jobs/front/report/quantity.hpp"
#include "jobs/front/report/sections.hpp"

namespace carillon::report {
namespace {

constexpr std::size_t kMaxBars = 32;
constexpr std::size_t kMaxTableRows = 200;

/// The phases of a record in the order in which they happen, others behind them.
std::vector<std::string> order_phases(const base::Json& phases) {
  const std::vector<std::string> known{"trials", "read",          "partition", "assemble", "factor",
                                       "solve",  "orthogonalise", "errors",    "write",    "other"};
  std::vector<std::string> names;
  if (!phases.is_object()) return names;
  for (const std::string& name : known)
    if (phases.has(name)) names.push_back(name);
  for (const std::string& name : phases.keys())
    if (std::find(known.begin(), known.end(), name) == known.end() && names.size() < kMaxBars) names.push_back(name);
  return names;
}

struct Phase {
  std::string name;
  double seconds = 0.0;
};

std::vector<Phase> find_phases(const Subject& subject) {
  const base::Json& recorded = find(subject.record.run, "phase_seconds");
  std::vector<Phase> phases;
  for (const std::string& name : order_phases(recorded))
    if (const auto seconds = find_amount(recorded, name.c_str())) phases.push_back({name, *seconds});
  return phases;
}

Html format_or_dash(const std::optional<double>& value, std::string (*format)(double)) { return html("{}", value ? format(*value) : "-"); }

Html make_phase_table(const Subject& subject) {
  const base::Json& recorded = find(subject.record.run, "stations");
  Table table(
      {{"phase"}, {"wall clock", true}, {"CPU, all ranks", true}, {"peak so far, largest rank", true}, {"peak so far, all ranks", true}});
  for (std::size_t i = 0; recorded.is_array() && i < std::min<std::size_t>(recorded.size(), kMaxTableRows); ++i) {
    const base::Json& phase = recorded[i];
    const auto name = find_text(phase, "name");
    if (!name) continue;
    table.add({html("{}", *name), format_or_dash(find_amount(phase, "seconds"), format_seconds),
               format_or_dash(find_amount(phase, "cpu_seconds"), format_seconds),
               format_or_dash(find_amount(phase, "peak_bytes_largest_rank"), format_bytes),
               format_or_dash(find_amount(phase, "peak_bytes_all_ranks"), format_bytes)});
  }
  return table.finish();
}

std::vector<double> find_rank_bytes(const Subject& subject) {
  const base::Json& recorded = find(subject.record.run, "peak_bytes_by_rank");
  std::vector<double> bytes;
  if (!recorded.is_array()) return bytes;
  for (const base::Json& value : recorded) {
    if (!value.is_number() || !std::isfinite(value.as_double()) || value.as_double() < 0.0) return {};  // damaged
    bytes.push_back(value.as_double());
  }
  return bytes;
}

std::vector<Bar> make_rank_bars(const std::vector<double>& bytes) {
  const std::size_t each = (bytes.size() + kMaxBars - 1) / kMaxBars;
  std::vector<Bar> bars;
  for (std::size_t first = 0; first < bytes.size(); first += each) {
    const std::size_t last = std::min(first + each, bytes.size());
    const double max =
        *std::max_element(bytes.begin() + static_cast<std::ptrdiff_t>(first), bytes.begin() + static_cast<std::ptrdiff_t>(last));
    bars.push_back({each == 1 ? fmt::format("rank {}", first) : fmt::format("ranks {} - {}", first, last - 1), max, format_bytes(max)});
  }
  return bars;
}

Html make_rank_table(const Subject& subject) {
  const base::Json& partition = find(subject.record.run, "partition");
  const base::Json& ranks = find(partition, "ranks");
  Table table({{"rank", true}, {"elements", true}, {"own nodes", true}, {"nodes of neighbours", true}});
  const auto cell = [](const base::Json& rank, const char* key) {
    const auto count = find_count(rank, key);
    return html("{}", count ? format_count(*count) : "-");
  };
  for (std::size_t i = 0; ranks.is_array() && i < std::min<std::size_t>(ranks.size(), kMaxTableRows); ++i)
    table.add({html("{}", i), cell(ranks[i], "elements"), cell(ranks[i], "owned_nodes"), cell(ranks[i], "halo_nodes")});
  if (table.empty()) return {};
  Facts facts;
  if (const auto cut = find_count(partition, "edge_cut")) facts.add("edges cut", html("{}", format_count(*cut)), "between the parts");
  if (const auto balance = find_amount(partition, "element_balance"))
    facts.add("balance of elements", html("{:.3f}", *balance), "largest part over the mean");
  if (const auto balance = find_amount(partition, "node_balance")) facts.add("balance of nodes", html("{:.3f}", *balance));
  Html out = html("<h3>How the mesh was shared</h3>\n");
  out += facts.finish();
  out += table.finish();
  if (ranks.size() > kMaxTableRows) out += html("<p class=\"remark\">The first {} of {} ranks.</p>\n", kMaxTableRows, ranks.size());
  return out;
}

}  // namespace

std::optional<double> find_run_seconds(const Subject& subject) {
  const std::vector<Phase> phases = find_phases(subject);
  if (phases.empty()) return std::nullopt;
  double sum = 0.0;
  for (const Phase& phase : phases) sum += phase.seconds;
  return sum;
}

std::optional<double> find_peak_bytes(const Subject& subject) {
  const std::vector<double> bytes = find_rank_bytes(subject);
  if (bytes.empty()) return std::nullopt;
  double sum = 0.0;
  for (const double one : bytes) sum += one;
  return sum;
}

Html make_time_section(const Subject& subject) {
  const std::vector<Phase> phases = find_phases(subject);
  Html out;
  if (!phases.empty()) {
    const double sum = *find_run_seconds(subject);
    const auto ranks = find_count(subject.record.run, "ranks");
    out += html("<p>{} of wall clock{}.</p>\n", format_seconds(sum),
                ranks ? fmt::format(" on {} rank{}", *ranks, *ranks == 1 ? "" : "s") : std::string());
    std::vector<Bar> bars;
    for (const Phase& phase : phases)
      bars.push_back({phase.name, phase.seconds,
                      fmt::format("{} \u00b7 {}", format_seconds(phase.seconds), format_percent(sum > 0.0 ? phase.seconds / sum : 0.0))});
    out += draw_bars("Seconds by phase", bars);
  }
  const Html table = make_phase_table(subject);
  if (!table.empty()) out += html("<details><summary>Phases of the run</summary>\n{}</details>\n", table);
  if (out.empty()) return leave_out("time", "Time", explain_missing(subject, "times"));
  return make_section("time", "Time", out);
}

Html make_memory_section(const Subject& subject) {
  const std::vector<double> bytes = find_rank_bytes(subject);
  Html out;
  if (!bytes.empty()) {
    out += html("<p>At most {} on all ranks together.</p>\n", format_bytes(*find_peak_bytes(subject)));
    out += draw_bars("Peak memory by rank", make_rank_bars(bytes));
    if (bytes.size() > kMaxBars) out += html("<p class=\"remark\">Each bar is the largest of its ranks.</p>\n");
  }
  out += make_rank_table(subject);
  if (out.empty()) return leave_out("memory", "Memory", explain_missing(subject, "memory"));
  return make_section("memory", "Memory", out);
}

Html make_work_section(const Subject& subject) {
  const base::Json& work = find(subject.record.run, "work");
  const base::Json& solver = find(subject.record.run, "solver");
  Facts facts;
  const auto add = [&](const char* what, const char* key, const char* remark) {
    if (const auto count = find_count(solver, key)) facts.add(what, html("{}", format_count(*count)), remark);
  };
  if (const auto name = find_text(solver, "factorisation")) facts.add("factorisation", html("{}", *name));
  if (const auto name = find_text(solver, "ordering")) facts.add("ordering", html("{}", *name));
  add("entries of a factor", "factor_entries", "numbers of 8 bytes");
  if (const auto flops = find_amount(solver, "factor_flops"))
    facts.add("operations of a factorisation", html("{}flop", format_large(*flops) + (*flops < 1000.0 ? " " : "")));
  add("factorisations", "factorisations", "those of the proof among them");
  add("solves", "solves", "right-hand sides");
  Html out = facts.finish();
  const bool is_profiled = std::any_of(work.begin(), work.end(), [](const base::Json& phase) { return find_amount(phase, "messages"); });
  std::vector<Column> columns{{"phase"}, {"operations", true}};
  if (is_profiled)
    columns.insert(columns.end(), {{"messages", true}, {"bytes", true}, {"collectives", true}, {"bytes of collectives", true}});
  Table table(columns);
  const auto cell = [](const base::Json& of, const char* key, std::string (*format)(double)) {
    return format_or_dash(find_amount(of, key), format);
  };
  for (const std::string& name : order_phases(work)) {
    const base::Json& of = work[name];
    if (!of.is_object()) continue;
    std::vector<Html> row{html("{}", name), cell(of, "flops", format_large)};
    if (is_profiled)
      row.insert(row.end(), {cell(of, "messages", format_large), cell(of, "bytes", format_bytes), cell(of, "collectives", format_large),
                             cell(of, "collective_bytes", format_bytes)});
    table.add(row);
  }
  if (!table.empty()) out += html("<h3>Counted on all ranks, by phase</h3>\n{}", table.finish());
  if (out.empty()) return leave_out("work", "Work", explain_missing(subject, "work"));
  return make_section("work", "Work", out);
}

Html make_program_section(const Subject& subject) {
  const base::Json& run = subject.record.run;
  Facts facts;
  if (const auto program = find_text(run, "program")) facts.add("program", html("{}", *program));
  if (const auto git = find_text(run, "git")) facts.add("revision", html("{}", *git));
  if (const auto time = find_text(run, "finished_utc")) facts.add("finished", html("{}", *time), "UTC");
  if (const auto ranks = find_count(run, "ranks")) facts.add("ranks", html("{}", *ranks));
  const base::Json& versions = find(run, "versions");
  std::size_t shown = 0;
  if (versions.is_object()) {
    for (const std::string& name : versions.keys()) {
      const auto version = find_text(versions, name.c_str());
      if (version && ++shown <= kMaxBars) facts.add(name, html("{}", *version));
    }
  }
  if (facts.empty()) return leave_out("program", "Program and libraries", explain_missing(subject, "versions"));
  return make_section("program", "Program and libraries", facts.finish());
}

}  // namespace carillon::report
