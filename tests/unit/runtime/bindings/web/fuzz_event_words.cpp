// Fuzzes rows of events, sent to a playing engine.
#include <cstdint>
#include <cstring>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/bindings/web/event_words.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<double> words(size / sizeof(double));
  if (!words.empty()) std::memcpy(words.data(), data, words.size() * sizeof(double));
  try {
    carillon::web::read_words(words, [](const carillon::events::Event& event, carillon::web::Timing timing) {
      if (carillon::events::find_fault(event) != nullptr) return;
      std::vector<double> again;
      carillon::web::append_words(again, event, timing);
      if (again.empty()) __builtin_trap();
    });
  } catch (const carillon::InputError&) {
  }
  return 0;
}
