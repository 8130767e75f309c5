// Headers of recorded surfaces from untrusted bytes.
#include "runtime/acoustics/recording/header.hpp"

#include <gtest/gtest.h>

#include <string>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::recording {
namespace {

Header make_header() {
  Header header;
  header.frames = 1000;
  header.vertices = 10;
  header.triangles = 16;
  header.bodies = 2;
  std::uint64_t at = kHeaderBytes;
  for (std::size_t i = 0; i < kArrays; ++i) {
    header.offset[i] = at;
    at += header.get_shape(static_cast<Array>(i)).bytes;
  }
  header.length = at;
  return header;
}

std::string make_head(const Header& header) { return format_header(header) + std::string(kDigestBytes, '0'); }

std::string change(const std::string& key, const std::string& value) {
  std::string head = make_head(make_header());
  const std::size_t at = head.find("\n" + key + " ") + 1, end = head.find('\n', at);
  head.replace(at, end - at, key + " " + value);
  head.resize(kHeaderBytes, '\n');
  return tests::catch_message<InputError>([&] { parse_header(head, make_header().length, "f"); });
}

TEST(Header, IsReadAsItWasWritten) {
  const Header header = make_header(), read = parse_header(make_head(header), header.length, "f");
  EXPECT_EQ(format_header(read), format_header(header));
  EXPECT_EQ(read.count_keys(), 22U);  // (1000 - 1) / 48 + 2
  EXPECT_EQ(read.count_blocks(), 4U);
}

TEST(Header, ImpossibleCountsAndOffsetsAreRefused) {
  for (const char* count : {"frames", "vertices", "triangles", "bodies", "key_frames", "place", "acceleration"})
    for (const char* value : {"0", "-1", "", "x", "1e3", "18446744073709551615", "1099511627776", "99999999999999999999"})
      EXPECT_EQ(change(count, value).find("f: "), 0U) << count << " " << value;
  for (const char* value : {"nan", "inf", "-1", "0", "x"}) EXPECT_EQ(change("sample_rate_hz", value).find("f: "), 0U) << value;
  EXPECT_NE(change("triangles", "1000000").find("exceeds the file"), std::string::npos);
  EXPECT_NE(change("triangle", "4095").find("the array triangle exceeds the file"), std::string::npos);
  EXPECT_NE(change("length", "5").find("bytes were added"), std::string::npos);
}

TEST(Header, OtherFilesAreNamed) {
  EXPECT_NE(tests::catch_message<InputError>([] { parse_header("", 0, "f"); }).find("is empty"), std::string::npos);
  EXPECT_NE(tests::catch_message<InputError>([] { parse_header("CARILLON BANK 1.0", 17, "f"); }).find("not a recorded surface"),
            std::string::npos);
  std::string head = make_head(make_header());
  head.replace(17, 3, "2.0");
  EXPECT_NE(tests::catch_message<InputError>([&] { parse_header(head, make_header().length, "f"); }).find("update Carillon"),
            std::string::npos);
}

}  // namespace
}  // namespace carillon::recording
