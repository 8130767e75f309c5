#include "runtime/base/spool.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <numeric>

#include "tests/support/folder.hpp"

namespace {

namespace fs = std::filesystem;
using carillon::base::RecordLists;
using carillon::base::Records;
using carillon::base::Spool;

class SpoolTest : public testing::Test {
 protected:
  const carillon::tests::Folder scratch_;
  const fs::path& folder_ = scratch_.path();
};

TEST_F(SpoolTest, reads_back_from_memory_and_file) {
  for (const std::size_t memory : {std::size_t{0}, std::size_t{1}, std::size_t{7}, std::size_t{100}, std::size_t{1} << 20}) {
    Spool spool(folder_, "test", memory);
    std::string all;
    for (int i = 0; i < 400; ++i) {
      const std::string piece(i % 13, static_cast<char>('a' + i % 26));
      spool.append(std::as_bytes(std::span(piece)));
      all += piece;
    }
    ASSERT_EQ(spool.size(), all.size());
    const Spool moved = std::move(spool);
    for (std::size_t from = 0; from <= all.size(); from += 17) {
      for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{50}, all.size() - from}) {
        if (from + count > all.size()) continue;
        std::string back(count, '?');
        moved.read(from, std::as_writable_bytes(std::span(back)));
        ASSERT_EQ(back, all.substr(from, count)) << memory;
      }
    }
    EXPECT_TRUE(fs::is_empty(folder_));  // also while in use: a killed program leaves nothing
  }
}

TEST_F(SpoolTest, records_and_lists_keep_their_order) {
  Records<int> records(Spool(folder_, "test", 64));
  RecordLists<int> lists(3, Spool(folder_, "test", 64));
  for (int i = 0; i < 5000; ++i) {
    records.append(i);
    lists.append(static_cast<std::size_t>(i % 7 == 0 ? 2 : 0), i);
  }
  EXPECT_EQ(records.size(), 5000U);
  EXPECT_EQ(records.get(4321), 4321);
  int next = 0;
  records.for_each([&](int value) { EXPECT_EQ(value, next++); });
  EXPECT_EQ(next, 5000);
  RecordLists<int>::Reader seventh(lists, 2), other(lists, 0), none(lists, 1);
  for (int i = 0; i < 5000; ++i) {
    auto& reader = i % 7 == 0 ? seventh : other;
    ASSERT_NE(reader.peek(), nullptr) << i;
    EXPECT_EQ(*reader.peek(), i);
    reader.next();
  }
  EXPECT_EQ(seventh.peek(), nullptr);
  EXPECT_EQ(other.peek(), nullptr);
  EXPECT_EQ(none.peek(), nullptr);
}

TEST_F(SpoolTest, a_full_disk_is_an_error_that_names_the_folder) {
  // A file size limit replaces a full disk.
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  const rlimit small{4096, old.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  std::string message;
  try {
    Spool spool(folder_, "sound", 1000);
    const std::vector<std::byte> piece(1000);
    for (int i = 0; i < 100; ++i) spool.append(piece);
  } catch (const carillon::SystemError& error) {
    message = error.what();
  }
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, before);
  EXPECT_NE(message.find(folder_.string()), std::string::npos) << message;
  EXPECT_NE(message.find("sound"), std::string::npos) << message;
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
