#include "runtime/scene/banks.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <map>
#include <optional>

#include "runtime/acoustics/radiation/transfers.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/result.hpp"
#include "runtime/base/temporary.hpp"
#include "runtime/scene/scene.hpp"

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

/// Sets the bank file of every body without one. `carillon bank-for`, a program of the precompute side, finds or computes it, once per
/// distinct description. Progress goes to standard error. Throws InputError with the place in the scene if it is refused or not installed,
/// SolveError and SystemError as reported.
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

/// Applies the support losses to the body's bank.
void mount(Scene& scene, SceneBody& body, bank::Bank& bank) {
  const mounting::Losses losses = mounting::calc_losses(bank, body.support);
  if (losses.is_empty()) return;
  body.mounting = {mounting::describe(losses, bank), losses.beyond, losses.mixed, {}, bank.decay_per_s, {}};
  if (const std::string limits = mounting::describe_limits(losses, bank); !limits.empty())
    scene.warnings.push_back(fmt::format("{}: the support of body \"{}\": {}", scene.file.string(), body.name, limits));
  mounting::apply(losses, bank);
  body.mounting.decay_per_s = bank.decay_per_s;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) body.mounting.freq_hz.push_back(bank.freq_hz(m));
}

}  // namespace

Banks read_banks(Scene& scene, bool is_quiet) {
  find_missing_banks(scene, is_quiet);
  Banks banks;
  std::map<std::filesystem::path, int> left;  // bodies that still need the unmodified bank
  for (const SceneBody& body : scene.bodies) ++left[body.bank];
  std::map<std::filesystem::path, bank::Bank> files;
  std::map<const ReadBank*, const Mounting*> mountings;
  for (SceneBody& body : scene.bodies) {
    const bool is_last = --left[body.bank] == 0;
    auto& slot = banks[{body.bank, mounting::write_key(body.support)}];
    if (!slot) {
      const std::string place = body.support_place.empty() ? scene.file.string() : body.support_place;
      try {
        slot = std::make_unique<ReadBank>();
        if (!files.contains(body.bank)) files[body.bank] = bank::choose_frequencies(bank::read_bank(body.bank), scene.frequencies);
        slot->bank = is_last ? std::move(files[body.bank]) : files[body.bank];
        mount(scene, body, slot->bank);
        const radiation::PutGains put = radiation::put_gains(slot->bank, scene.radiation);
        slot->sphere_radius_m = put.sphere_radius_m;
        slot->limited = put.limited;
        slot->transfers = radiation::make_transfers(slot->bank);
      } catch (const InputError& error) {
        throw InputError(fmt::format("{}: the bank of body \"{}\": {}", place, body.name, error.what()));
      }
      mountings[slot.get()] = &body.mounting;
    } else {
      body.mounting = *mountings[slot.get()];
    }
    body.spec.bank = &slot->bank;
    body.sphere_radius_m = slot->sphere_radius_m;
    body.limited = slot->limited;
    body.transfers = slot->transfers;
  }
  return banks;
}

}  // namespace carillon::scene
