#include "jobs/store/outcome/outcome.hpp"

#include <fmt/chrono.h>
#include <fmt/core.h>

#include <array>
#include <cmath>
#include <ctime>
#include <utility>

#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon::outcome {
namespace {

constexpr std::array<std::pair<Cause, const char*>, 17> kWords{{{Cause::done, "done"},
                                                                {Cause::bad_input, "bad-input"},
                                                                {Cause::no_solution, "no-solution"},
                                                                {Cause::memory, "memory"},
                                                                {Cause::memory_limit, "memory-limit"},
                                                                {Cause::disk_full, "disk-full"},
                                                                {Cause::system, "system"},
                                                                {Cause::checkpointed, "checkpointed"},
                                                                {Cause::stopped, "stopped"},
                                                                {Cause::time_limit, "time-limit"},
                                                                {Cause::killed, "killed"},
                                                                {Cause::crashed, "crashed"},
                                                                {Cause::node_lost, "node-lost"},
                                                                {Cause::hung, "hung"},
                                                                {Cause::bad_bank, "bad-bank"},
                                                                {Cause::no_program, "no-program"},
                                                                {Cause::predicted, "predicted"}}};

double finite(double value) { return std::isfinite(value) ? value : 0.0; }

}  // namespace

std::string to_text(Cause cause) {
  for (const auto& [known, word] : kWords) {
    if (known == cause) return word;
  }
  return "system";
}

std::optional<Cause> find_cause(std::string_view word) {
  for (const auto& [cause, known] : kWords) {
    if (word == known) return cause;
  }
  return std::nullopt;
}

void write_outcome(const std::filesystem::path& work, const Outcome& o) {
  base::Json root = base::Json::object();
  root.set("cause", to_text(o.cause)).set("exit_code", o.exit_code).set("ranks", o.ranks);
  root.set("seconds", base::decimals(finite(o.seconds), 3)).set("peak_memory_gb", base::decimals(finite(o.peak_memory_gb), 6));
  root.set("memory_need_gb", base::decimals(finite(o.memory_need_gb), 6));
  root.set("percent", base::decimals(finite(o.percent), 3)).set("is_further", o.is_further);
  for (const auto& [key, value] : {std::pair<const char*, const std::string&>{"token", o.token},
                                   {"reason", o.reason},
                                   {"host", o.host},
                                   {"started", o.started},
                                   {"ended", o.ended}}) {
    if (!value.empty()) root.set(key, value);
  }
  base::write_file(work / "outcome.json", root.text());
}

std::optional<Outcome> read_outcome(const std::filesystem::path& work) {
  try {
    base::Object root = base::read_document(work / "outcome.json").root();
    const std::optional<Cause> cause = find_cause(root.string("cause"));
    if (!cause) return std::nullopt;
    Outcome o;
    o.token = root.string_or("token", "");
    o.cause = *cause;
    o.reason = root.string_or("reason", "");
    o.exit_code = static_cast<int>(root.integer("exit_code", -1, 1000));
    o.ranks = static_cast<int>(root.integer("ranks", 0, 1 << 24));
    o.seconds = root.number("seconds");
    o.peak_memory_gb = root.number("peak_memory_gb");
    o.memory_need_gb = root.number("memory_need_gb");
    o.percent = root.number("percent");
    o.is_further = root.boolean_or("is_further", false);
    o.host = root.string_or("host", "");
    o.started = root.string_or("started", "");
    o.ended = root.string_or("ended", "");
    return o;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Outcome make_killed(const std::string& token) {
  Outcome o;
  o.token = token;
  o.cause = Cause::killed;
  o.reason = "killed: the process of the attempt is gone without an outcome (kill -9, or the machine went down)";
  return o;
}

void write_attempt(const std::filesystem::path& work, const Attempt& a) {
  base::Json root = base::Json::object();
  root.set("token", a.token).set("host", a.process.host).set("boot", a.process.boot).set("pid", a.process.pid);
  root.set("start_ticks", a.process.start_ticks).set("ranks", a.ranks).set("memory_gb", base::decimals(finite(a.memory_gb), 6));
  root.set("started", a.started);
  base::write_file(work / "attempt.json", root.text());
}

std::optional<Attempt> read_attempt(const std::filesystem::path& work) {
  try {
    base::Object root = base::read_document(work / "attempt.json").root();
    Attempt a;
    a.token = root.string("token");
    a.process.host = root.string("host");
    a.process.boot = root.string("boot");
    a.process.pid = static_cast<int>(root.integer("pid", 0, 1LL << 30));
    a.process.start_ticks = static_cast<std::uint64_t>(root.integer("start_ticks", 0, 1LL << 62));
    a.ranks = static_cast<int>(root.integer("ranks", 0, 1 << 24));
    a.memory_gb = root.number("memory_gb");
    a.started = root.string("started");
    return a;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

std::string find_utc() {
  std::time_t now = std::time(nullptr);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now));
}

}  // namespace carillon::outcome
