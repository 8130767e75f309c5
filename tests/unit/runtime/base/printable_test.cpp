#include "runtime/base/printable.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <set>
#include <string>

#include "runtime/base/message.hpp"

namespace {

using carillon::base::printable;
using carillon::base::printable_lines;

/// UTF-8 of a character by the table of RFC 3629.
std::string encode(std::uint32_t c) {
  const auto byte = [](std::uint32_t value) { return static_cast<char>(value); };
  if (c < 0x80) return {byte(c)};
  if (c < 0x800) return {byte(0xC0 + c / 64), byte(0x80 + c % 64)};
  if (c < 0x10000) return {byte(0xE0 + c / 4096), byte(0x80 + c / 64 % 64), byte(0x80 + c % 64)};
  return {byte(0xF0 + c / 262144), byte(0x80 + c / 4096 % 64), byte(0x80 + c / 64 % 64), byte(0x80 + c % 64)};
}

TEST(Printable, text_of_any_script_is_unchanged) {
  for (const std::string text :
       {"", "plain", "Glockenspiel \u00e4\u00f6\u00fc\u00df", "\u0431\u0435\u043b\u043b", "\u9418", "\U0001F514", "~ \u00a0"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, controls_and_bidirectional_marks_are_escaped) {
  std::set<std::uint32_t> hidden{0x7F, 0x61C, 0x200E, 0x200F, 0x2028, 0x2029, 0xFEFF};
  for (std::uint32_t c = 0; c < 0x20; ++c) hidden.insert(c);
  for (std::uint32_t c = 0x80; c <= 0x9F; ++c) hidden.insert(c);
  for (std::uint32_t c = 0x202A; c <= 0x202E; ++c) hidden.insert(c);
  for (std::uint32_t c = 0x2066; c <= 0x2069; ++c) hidden.insert(c);
  for (const std::uint32_t c : hidden) {
    const std::string shown = printable("a" + encode(c) + "b");
    for (const char letter : shown) EXPECT_TRUE(letter >= 0x20 && letter < 0x7F) << c << ": " << shown;
    EXPECT_TRUE(shown.starts_with("a\\") && shown.ends_with("b")) << shown;
  }
  EXPECT_EQ(printable("\x1b]0;x\x07"), "\\u001b]0;x\\u0007");
  EXPECT_EQ(printable("one\r\n\ttwo"), "one\\r\\n\\ttwo");
}

TEST(Printable, arbitrary_bytes_give_utf8_without_controls) {
  std::uint32_t state = 1;
  for (int round = 0; round < 2000; ++round) {
    std::string text;
    for (int i = 0; i < 40; ++i) {
      state = state * 1664525U + 1013904223U;
      const auto high = static_cast<unsigned char>(state >> 24U);
      text += static_cast<char>(round % 2 == 0 || high > 0xC0 ? high : high | 0x80U);
    }
    const std::string shown = printable(text);
    EXPECT_EQ(printable(shown), shown) << "a text that was made printable is printable";
    for (const char letter : shown) ASSERT_FALSE(static_cast<unsigned char>(letter) < 0x20 || letter == 0x7F);
    ASSERT_EQ(shown.find("\xC2\x9B"), std::string::npos);
  }
}

TEST(Printable, invalid_utf8_is_written_in_hexadecimal) {
  EXPECT_EQ(printable("a\x9b\x80z"), "a\\x9b\\x80z");
  EXPECT_EQ(printable("\xC0\xAF"), "\\xc0\\xaf");                    // overlong
  EXPECT_EQ(printable("\xE0\x80\xAF"), "\\xe0\\x80\\xaf");           // overlong
  EXPECT_EQ(printable("\xED\xA0\x80"), "\\xed\\xa0\\x80");           // a surrogate
  EXPECT_EQ(printable("\xF4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // beyond U+10FFFF
  EXPECT_EQ(printable("cut \xE2\x80"), "cut \\xe2\\x80");
  EXPECT_EQ(printable(std::string("nul\0l", 5)), "nul\\u0000l");
}

TEST(Printable, line_breaks_are_kept) { EXPECT_EQ(printable_lines("a\n\tb\x1b"), "a\n\tb\\u001b"); }

TEST(Message, is_shortened) {
  using carillon::base::show_message;
  EXPECT_EQ(show_message("job.json:3: no such key; give another"), "job.json:3: no such key; give another");
  const std::string message = show_message("scene.json:7: body \"" + std::string(9000, 'a') + "\" is unknown; name another");
  EXPECT_LT(message.size(), 1000U);
  EXPECT_TRUE(message.starts_with("scene.json:7: body \"aaa"));
  EXPECT_TRUE(message.ends_with("aaa\" is unknown; name another"));
  std::string words;
  for (int i = 0; i < 9000; ++i) words += "\u00e9 ";
  const std::string cut = show_message(words + "; name another");
  EXPECT_LT(cut.size(), 4100U);
  EXPECT_TRUE(cut.ends_with("; name another"));
  EXPECT_EQ(cut.find("\\x"), std::string::npos);  // cut at characters
}

TEST(Message, names_the_file_of_a_descriptor) {
  using carillon::base::find_name;
  EXPECT_EQ(find_name("a/b.json"), "a/b.json");
  const int folder = ::open("/usr", O_RDONLY | O_DIRECTORY);
  EXPECT_EQ(find_name("/proc/self/fd/" + std::to_string(folder) + "/job.json"), "/usr/job.json");
  ::close(folder);
  EXPECT_EQ(find_name("/proc/self/fd/" + std::to_string(folder) + "/job.json"), "/proc/self/fd/" + std::to_string(folder) + "/job.json");
}

}  // namespace
