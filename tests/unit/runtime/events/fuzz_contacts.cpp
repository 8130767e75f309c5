// Arbitrary bytes as a contacts file: round trip to the same events, or an InputError.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/events/file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace carillon;
  try {
    const events::Recording recording = events::parse_recording({reinterpret_cast<const char*>(data), size}, "contacts.jsonl");
    const std::string text = events::format_recording(recording);
    if (events::format_recording(events::parse_recording(text, "again.jsonl")) != text) std::abort();
  } catch (const InputError&) {
  }
  return 0;
}
