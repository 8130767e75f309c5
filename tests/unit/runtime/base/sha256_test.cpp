// Published values of NIST: FIPS 180-4 examples, and the message of a million letters.
#include "runtime/base/sha256.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <string>

#include "runtime/base/sha256_plain.hpp"

namespace carillon::base {
namespace {

TEST(Sha256, matches_the_standard) {
  EXPECT_EQ(to_hex(calc_sha256("")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(to_hex(calc_sha256("abc")), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(to_hex(calc_sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq")),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(to_hex(calc_sha256(std::string(1'000'000, 'a'))), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, is_independent_of_the_pieces) {
  const std::string text(100'003, 'x');
  Sha256 sha;
  for (std::size_t at = 0, size = 1; at < text.size(); at += size, size = size * 3 % 1009 + 1)
    sha.add(std::string_view(text).substr(at, size));
  EXPECT_EQ(sha.finish(), calc_sha256(text));
}

// Against OpenSSL: all lengths around block boundaries, in pieces of all lengths.
TEST(PlainSha256, matches_openssl) {
  std::string text(1000, ' ');
  for (std::size_t i = 0; i < text.size(); ++i) text[i] = static_cast<char>(i * 89 + i / 7);
  for (std::size_t size = 0; size <= text.size(); size += size < 300 ? 1 : 37) {
    const auto bytes = std::as_bytes(std::span(text)).first(size);
    PlainSha256 whole;
    whole.add(bytes);
    ASSERT_EQ(whole.finish(), calc_sha256(std::string_view(text).substr(0, size))) << size;
    PlainSha256 pieces;
    for (std::size_t at = 0, piece = 1; at < size; at += piece, piece = piece % 130 + 1)
      pieces.add(bytes.subspan(at, std::min(piece, size - at)));
    ASSERT_EQ(pieces.finish(), calc_sha256(std::string_view(text).substr(0, size))) << size;
  }
}

}  // namespace
}  // namespace carillon::base
