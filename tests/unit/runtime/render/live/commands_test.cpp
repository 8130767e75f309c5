#include "runtime/render/live/commands.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::live {
namespace {

/// A pipe whose writing end is filled.
class Pipe {
 public:
  explicit Pipe(const std::string& text) {
    EXPECT_EQ(pipe(ends_.data()), 0);
    EXPECT_EQ(write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  ~Pipe() {
    close_writer();
    close(ends_[0]);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void close_writer() {
    if (ends_[1] >= 0) close(ends_[1]);
    ends_[1] = -1;
  }
  int get_reader() const { return ends_[0]; }

 private:
  std::array<int, 2> ends_{};
};

TEST(LineReader, AFloodComesInParts) {
  std::string text;
  for (int n = 0; n < 10000; ++n) text += "a" + std::to_string(n) + "\n";
  Pipe flood(text + "end");
  LineReader reader(flood.get_reader());
  std::vector<std::string> all = reader.read();
  EXPECT_GT(all.size(), 100U);
  EXPECT_LT(all.size(), 5000U);
  flood.close_writer();
  for (int n = 0; n < 20; ++n)
    for (std::string& line : reader.read()) all.push_back(std::move(line));
  ASSERT_EQ(all.size(), 10001U);
  EXPECT_EQ(all[9999], "a9999");
  EXPECT_EQ(all.back(), "end");
}

TEST(LiveCommands, MessagesShowWhatWasGiven) {
  Hands hands;
  const auto find_message = [&](const std::vector<std::string>& words) -> std::string {
    try {
      carry_out(words, hands);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  using namespace std::string_literals;
  EXPECT_NE(find_message({"\0x"s}).find("\\u0000x"), std::string::npos) << find_message({"\0x"s});
  EXPECT_EQ(find_message({"quit", "now"}).find("did you mean"), std::string::npos);
  EXPECT_NE(find_message({"pusch"}).find("did you mean \"push\"?"), std::string::npos);
}

}  // namespace
}  // namespace carillon::live
