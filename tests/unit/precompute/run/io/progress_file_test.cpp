#include "precompute/run/io/progress_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::io {
namespace {

namespace fs = std::filesystem;

class ProgressFileTest : public testing::Test {
 protected:
  ProgressFileTest() : folder_(fs::temp_directory_path() / ("carillon-progress-" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~ProgressFileTest() override { fs::remove_all(folder_); }
  std::string read() const { return base::read_file(folder_ / "p", "progress file", 1 << 20); }
  fs::path folder_;
};

TEST(ProgressLine, has_its_members_in_order_and_leaves_out_what_is_unknown) {
  ProgressLine line{"factor", 31.4, 0, 228, 8.07, 3.7};
  EXPECT_EQ(
      format_progress(line),
      "{\"phase\": \"factor\", \"percent\": 31.40, \"modes_done\": 0, \"modes_wanted\": 228, \"seconds_left\": 8.1, \"seconds\": 3.70}\n");
  line.modes_wanted.reset();
  line.seconds_left.reset();
  EXPECT_EQ(format_progress(line), "{\"phase\": \"factor\", \"percent\": 31.40, \"modes_done\": 0, \"seconds\": 3.70}\n");
}

TEST_F(ProgressFileTest, appends_and_leaves_out_a_line_that_says_nothing_new) {
  base::write_file(folder_ / "p", "before\n");
  ProgressLine line{"read", 1.0, 0, {}, {}, 0.5};
  ProgressFile file(folder_ / "p");
  EXPECT_TRUE(file.append(line));
  line.seconds = 1.0;
  line.seconds_left = 7;
  EXPECT_TRUE(file.append(line));  // only the times differ
  line.percent = 2.0;
  EXPECT_TRUE(file.append(line));
  ProgressLine first{"read", 1.0, 0, {}, {}, 0.5};
  EXPECT_EQ(read(), "before\n" + format_progress(first) + format_progress(line));
}

TEST_F(ProgressFileTest, refuses_what_is_no_file_to_append_to) {
  EXPECT_THROW(ProgressFile{folder_}, InputError);
  EXPECT_THROW(ProgressFile{folder_ / "none" / "p"}, InputError);
  ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  EXPECT_THROW(ProgressFile{folder_ / "fifo"}, InputError);  // must not wait for a reader
}

TEST_F(ProgressFileTest, a_full_disk_is_reported_once) {
  ProgressFile file("/dev/full");
  ProgressLine line{"read", 1.0, 0, {}, {}, 0.5};
  EXPECT_FALSE(file.append(line));
  line.percent = 2.0;
  EXPECT_TRUE(file.append(line));
}

}  // namespace
}  // namespace carillon::io
