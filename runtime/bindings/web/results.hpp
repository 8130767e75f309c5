// Results by address and errors as text, for all modules of a page. To be included in one source of a module.
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#define WEB_EXPORT(result, name) extern "C" __attribute__((export_name(#name))) result name

namespace {

std::string text;            // last result, or error message
std::vector<double> words;   // last event rows or poses
std::vector<float> numbers;  // last list of numbers
std::vector<std::byte> bytes;

/// The value of `work`, or -1 with a message in `text`.
template <class Work>
int run(Work&& work) noexcept {
  try {
    return static_cast<int>(work());
  } catch (const std::bad_alloc&) {
    text = "there is not enough memory";
  } catch (const std::exception& error) {
    text = error.what();
  } catch (...) {
    text = "an unknown error";
  }
  return -1;
}

std::string_view to_text(const char* at, int size) { return {at, static_cast<std::size_t>(std::max(size, 0))}; }
template <class Value>
std::span<const Value> to_span(const Value* at, int count) {
  return {at, static_cast<std::size_t>(std::max(count, 0))};
}

}  // namespace

WEB_EXPORT(const char*, web_text)() { return text.data(); }
WEB_EXPORT(int, web_text_size)() { return static_cast<int>(text.size()); }
WEB_EXPORT(const double*, web_words)() { return words.data(); }
WEB_EXPORT(int, web_words_count)() { return static_cast<int>(words.size()); }
WEB_EXPORT(const float*, web_numbers)() { return numbers.data(); }
WEB_EXPORT(int, web_numbers_count)() { return static_cast<int>(numbers.size()); }
WEB_EXPORT(const std::byte*, web_bytes)() { return bytes.data(); }
WEB_EXPORT(int, web_bytes_count)() { return static_cast<int>(bytes.size()); }
