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

/// Sets the bank file of a body without one. `carillon bank-for`, a program of the precompute side, finds or computes it, once per distinct
/// description. Progress goes to standard error. Throws InputError with the place in the scene if it is refused or not installed,
/// SolveError and SystemError as reported.
class MissingBanks {
 public:
  MissingBanks(const Scene& scene, bool is_quiet) : scene_(scene), is_quiet_(is_quiet) {}
  void find(SceneBody& body) {
    if (!body.bank.empty()) return;
    std::string words;
    for (const char c : body.job.text)
      if (c != '\n') words += c;
    const auto [entry, is_new] = made_.try_emplace(words);
    if (is_new) entry->second = make_bank(scene_, body, is_quiet_);
    body.bank = entry->second;
  }

 private:
  const Scene& scene_;
  bool is_quiet_;
  std::map<std::string, fs::path> made_;  // by the description of the body, without its place
};

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

/// The bank of a body, from that of its file. Throws InputError naming scene and body.
template <class GetBank>
std::unique_ptr<ReadBank> make_read_bank(Scene& scene, SceneBody& body, GetBank&& get_bank) {
  const std::string place = body.support_place.empty() ? scene.file.string() : body.support_place;
  try {
    auto read = std::make_unique<ReadBank>();
    read->bank = get_bank();
    mount(scene, body, read->bank);
    const radiation::PutGains put = radiation::put_gains(read->bank, scene.radiation);
    read->sphere_radius_m = put.sphere_radius_m;
    read->limited = put.limited;
    read->transfers = radiation::make_transfers(read->bank);
    return read;
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: the bank of body \"{}\": {}", place, body.name, error.what()));
  }
}

void use_bank(SceneBody& body, const ReadBank& read) {
  body.spec.bank = &read.bank;
  body.sphere_radius_m = read.sphere_radius_m;
  body.limited = read.limited;
  body.transfers = read.transfers;
}

bank::Bank read_file(const Scene& scene, const fs::path& file) {
  return bank::choose_frequencies(bank::read_bank(file), scene.frequencies);
}

}  // namespace

Banks read_banks(Scene& scene, bool is_quiet) {
  MissingBanks missing(scene, is_quiet);
  for (SceneBody& body : scene.bodies) missing.find(body);
  Banks banks;
  std::map<std::filesystem::path, int> left;  // bodies that still need the unmodified bank
  for (const SceneBody& body : scene.bodies) ++left[body.bank];
  std::map<std::filesystem::path, bank::Bank> files;
  std::map<const ReadBank*, const Mounting*> mountings;
  for (SceneBody& body : scene.bodies) {
    const bool is_last = --left[body.bank] == 0;
    auto& slot = banks[{body.bank, mounting::write_key(body.support)}];
    if (!slot) {
      slot = make_read_bank(scene, body, [&]() -> bank::Bank {
        if (!files.contains(body.bank)) files[body.bank] = read_file(scene, body.bank);
        return is_last ? std::move(files[body.bank]) : files[body.bank];
      });
      mountings[slot.get()] = &body.mounting;
    } else {
      body.mounting = *mountings[slot.get()];
    }
    use_bank(body, *slot);
  }
  // A strain is a derivative: it magnifies the error of packed shapes. Their files have version 2.
  for (const SceneSensor& sensor : scene.sensors)
    if (const SceneBody& body = scene.bodies[sensor.body];
        sensor.quantity == synth::Quantity::kStrain && bank::read_version(body.bank)[0] == 2)
      scene.warnings.push_back(
          fmt::format("{}: the shapes of \"{}\" are packed, which changes a strain by several percent; give its job \"shapes\": \"exact\"",
                      sensor.place, body.name));
  return banks;
}

void read_bank(Scene& scene, SceneBody& body, Banks& banks) {
  MissingBanks(scene, true).find(body);
  const Banks::key_type key{body.bank, mounting::write_key(body.support)};
  auto found = banks.find(key);
  if (found == banks.end()) found = banks.emplace(key, make_read_bank(scene, body, [&] { return read_file(scene, body.bank); })).first;
  use_bank(body, *found->second);
}

}  // namespace carillon::scene
