#include "runtime/scene/missing_banks.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <map>
#include <optional>

#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::scene {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMaker = "carillon";
constexpr std::size_t kMaxPathBytes = 1 << 16;

fs::path make_bank(const Scene& scene, const SceneBody& body, bool is_quiet) {
  const std::optional<fs::path> program = base::find_program(kMaker);
  if (!program)
    throw InputError(
        fmt::format("{}: body \"{}\" has no \"bank\", and the program that computes one, {}, is not installed here (it comes with "
                    "carillon-precompute); install it, or name a bank",
                    body.place, body.name, kMaker));
  const base::TemporaryFolder folder("carillon-");
  const fs::path result_file = folder.path() / "result.json";
  base::Command command;
  command.words = {program->string(),
                   "bank-for",
                   "-",
                   "--name",
                   fs::absolute(scene.file).string(),
                   "--first-line",
                   std::to_string(body.job.first_line),
                   "--result",
                   result_file.string()};
  if (is_quiet) command.words.emplace_back("-q");
  command.output = base::kCapture;
  command.errors = base::kInherit;
  command.signal_at_end = SIGTERM;  // lets it remove its temporary folders
  const base::Finished finished = base::run(command, {.input = body.job.text, .max_bytes = kMaxPathBytes});
  if (finished.exit_code == 0) return finished.output.substr(0, finished.output.find('\n'));
  base::Result result = base::read_result(result_file).value_or(base::Result{.kind = base::ResultKind::system});
  if (result.message.empty())
    result.message = finished.signal != 0
                         ? fmt::format("{}: body \"{}\": {} was ended by signal {}", body.place, body.name, kMaker, finished.signal)
                         : fmt::format("{}: body \"{}\": {} ended with exit code {}", body.place, body.name, kMaker, finished.exit_code);
  base::throw_error(result);
}

}  // namespace

void find_missing_banks(Scene& scene, bool is_quiet) {
  std::map<std::string, fs::path> made;  // by the description of the body, without its place
  for (SceneBody& body : scene.bodies) {
    if (!body.bank.empty()) continue;
    std::string words;
    for (const char c : body.job.text)
      if (c != '\n') words += c;
    const auto [entry, is_new] = made.try_emplace(words);
    if (is_new) entry->second = make_bank(scene, body, is_quiet);
    body.bank = entry->second;
  }
}

}  // namespace carillon::scene
