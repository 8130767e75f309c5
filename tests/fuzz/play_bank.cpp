// Arbitrary bank bytes, sealed again: checked, edited and played, or rejected with an InputError.
#include <span>

#include "runtime/bank/edits.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "runtime/bank/report.hpp"
#include "tests/fuzz/play.hpp"
#include "tests/unit/runtime/bank/seal_again.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  const fuzz::Folder& folder = fuzz::get_folder();
  static const std::filesystem::path scene =
      folder.write("scene.json", R"({"duration_s": 0.03, "bodies": [{"name": "one", "bank": "fuzzed.h5"}],
    "strikes": [{"time_s": 0.005, "body": "one", "triangle": 0, "impulse_n_s": [0.01, 0.02, 0.03], "duration_s": 1e-4}]})");
  const std::string sealed = bank::seal_again(std::string(fuzz::to_text(data, size)));
  const std::filesystem::path file = folder.write("fuzzed.h5", sealed);
  try {
    const bank::Bank loose = bank::read_bank_unchecked(file);
    for (const bank::Check& check : bank::calc_checks(loose)) bank::format_check(check);
    const bank::Bank bank = bank::read_bank(file);
    const std::vector<bank::HeardMode> heard = mounting::calc_heard(bank);
    bank::format_info(bank, heard, file, 100, true);
    bank::format_info_json(bank, heard, file);
    if (bank.mode_count() > 200 || bank.triangles.size() > 2000) {
      fuzz::report("only read");
      return 0;
    }
    bank::calc_edited(bank, {.density_scale = 2.0, .stiffness_scale = 0.5, .size_scale = 1.5});
  } catch (const InputError&) {
  }
  fuzz::play({.scene = scene});
  return 0;
}
