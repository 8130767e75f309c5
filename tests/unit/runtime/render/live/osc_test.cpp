#include "runtime/render/live/osc.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string_view>

#include "runtime/base/error.hpp"

namespace carillon::live {
namespace {

using namespace std::string_literals;

std::vector<Words> parse(std::string_view packet) { return parse_osc(std::as_bytes(std::span(packet))); }

// The examples of the specification's appendix, byte by byte.
const std::string kOscillator = "/oscillator/4/frequency\0,f\0\0\x43\xdc\0\0"s;
const std::string kFoo = "/foo\0\0\0\0,iisff\0\0\0\0\x03\xe8\xff\xff\xff\xffhello\0\0\0\x3f\x9d\xf3\xb6\x40\xb5\xb2\x2d"s;

std::string make_bundle(const std::vector<std::string>& parts) {
  std::string bundle = "#bundle\0\0\0\0\0\0\0\0\1"s;
  for (const std::string& part : parts) {
    bundle += "\0\0\0"s;
    bundle += static_cast<char>(part.size());
    bundle += part;
  }
  return bundle;
}

TEST(Osc, ReadsTheExamplesOfItsSpecification) {
  EXPECT_EQ(parse(kOscillator), (std::vector<Words>{{"oscillator/4/frequency", "440"}}));
  EXPECT_EQ(parse(kFoo), (std::vector<Words>{{"foo", "1000", "-1", "hello", "1.234", "5.678"}}));
  EXPECT_EQ(parse("/a\0\0"s), (std::vector<Words>{{"a"}}));  // old senders omit the type tags
  EXPECT_EQ(parse("/a\0\0,hdTF\0\0\0\xff\xff\xff\xff\xff\xff\xff\xfe\xc0\x04\0\0\0\0\0\0"s),
            (std::vector<Words>{{"a", "-2", "-2.5", "1", "0"}}));
  EXPECT_EQ(parse(make_bundle({kFoo, make_bundle({kOscillator})})), (std::vector<Words>{parse(kFoo)[0], parse(kOscillator)[0]}));
}

TEST(Osc, RefusesABadPacketAsAWhole) {
  const std::string bundle = make_bundle({kFoo, kOscillator});
  for (const std::string& good : {kFoo, bundle})
    for (std::size_t size = 0; size < good.size(); ++size) {
      // Cut after an element, a bundle is complete; cut after its address, a message has no arguments.
      if (good == kFoo ? size == 8 : size == 16 || size == 20 + kFoo.size()) continue;
      EXPECT_THROW(parse(std::string_view(good).substr(0, size)), InputError) << size;
    }
  for (const std::string& bad : {kFoo + "\0\0\0\0"s, "foo\0,\0\0\0"s, "/a\0\0f\0\0\0"s, "/a\0\0,b\0\0\0\0\0\0"s, "/a\0\0,s\0\0long"s,
                                 "#bundle\0\0\0\0\0\0\0\0\1\xff\xff\xff\xfc"s})
    EXPECT_THROW(parse(bad), InputError);
  std::string deep = kOscillator;
  for (int k = 0; k < 9; ++k) deep = make_bundle({deep.substr(0, 252)});
  EXPECT_THROW(parse(deep), InputError);
}

TEST(Osc, AnyBytesAreReadOrRefused) {
  std::mt19937 random(7);  // same bytes at every run
  const std::string seed = make_bundle({kFoo, kOscillator});
  int refused = 0;
  for (int k = 0; k < 20000; ++k) {
    std::string packet = seed;
    for (int change = 0; change <= k % 4; ++change) packet[random() % packet.size()] = static_cast<char>(random() % 256);
    try {
      (void)parse(packet);
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace carillon::live
