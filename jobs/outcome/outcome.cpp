#include "jobs/outcome/outcome.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <utility>

#include "runtime/config/document.hpp"
#include "runtime/config/file.hpp"

namespace carillon::outcome {
namespace {

constexpr std::array<std::pair<Cause, const char*>, 15> kWords{{{Cause::none, "none"},
                                                                {Cause::input, "input"},
                                                                {Cause::solve, "solve"},
                                                                {Cause::memory, "memory"},
                                                                {Cause::disk_full, "disk_full"},
                                                                {Cause::system, "system"},
                                                                {Cause::checkpointed, "checkpointed"},
                                                                {Cause::stopped, "stopped"},
                                                                {Cause::time_limit, "time_limit"},
                                                                {Cause::killed, "killed"},
                                                                {Cause::crashed, "crashed"},
                                                                {Cause::node_lost, "node_lost"},
                                                                {Cause::hung, "hung"},
                                                                {Cause::bad_bank, "bad_bank"},
                                                                {Cause::start, "start"}}};

double finite(double value) { return std::isfinite(value) ? value : 0.0; }

}  // namespace

std::string to_text(Cause cause) {
  for (const auto& [known, word] : kWords) {
    if (known == cause) return word;
  }
  return "system";
}

std::optional<Cause> find_cause(const std::string& word) {
  for (const auto& [cause, known] : kWords) {
    if (word == known) return cause;
  }
  return std::nullopt;
}

void write_outcome(const std::filesystem::path& work, const Outcome& o) {
  config::write_file(
      work / "outcome.json",
      fmt::format("{{\n  \"attempt\": {},\n  \"cause\": \"{}\",\n  \"reason\": {},\n  \"exit_code\": {},\n  \"ranks\": {},\n"
                  "  \"seconds\": {:.3f},\n  \"peak_memory_gb\": {:.6f},\n  \"memory_need_gb\": {:.6f},\n  \"percent\": {:.3f},\n"
                  "  \"is_further\": {},\n  \"host\": {},\n  \"started\": {},\n  \"ended\": {}\n}}\n",
                  config::quote(o.attempt), to_text(o.cause), config::quote(o.reason), o.exit_code, o.ranks, finite(o.seconds),
                  finite(o.peak_memory_gb), finite(o.memory_need_gb), finite(o.percent), o.is_further, config::quote(o.host),
                  config::quote(o.started), config::quote(o.ended)));
}

std::optional<Outcome> read_outcome(const std::filesystem::path& work) {
  try {
    config::Object root = config::read_document(work / "outcome.json").root();
    const std::optional<Cause> cause = find_cause(root.string("cause"));
    if (!cause) return std::nullopt;
    Outcome o;
    o.attempt = root.string("attempt");
    o.cause = *cause;
    o.reason = root.string("reason");
    o.exit_code = static_cast<int>(root.integer("exit_code", -1, 1000));
    o.ranks = static_cast<int>(root.integer("ranks", 0, 1 << 24));
    o.seconds = root.number("seconds");
    o.peak_memory_gb = root.number("peak_memory_gb");
    o.memory_need_gb = root.number("memory_need_gb");
    o.percent = root.number("percent");
    o.is_further = root.boolean_or("is_further", false);
    o.host = root.string("host");
    o.started = root.string("started");
    o.ended = root.string("ended");
    return o;
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Outcome make_killed() {
  Outcome o;
  o.cause = Cause::killed;
  o.reason = "killed: the process of the attempt is gone and left no word (kill -9, or the machine went down)";
  return o;
}

}  // namespace carillon::outcome
