#include "runtime/base/file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>

#include "runtime/base/document.hpp"
#include "tests/support/folder.hpp"

namespace {

namespace fs = std::filesystem;
namespace base = carillon::base;
using carillon::InputError;

class File : public testing::Test {
 protected:
  std::size_t count_entries() const { return std::distance(fs::directory_iterator(folder_), {}); }
  const carillon::tests::Folder scratch_;
  const fs::path& folder_ = scratch_.path();
};

TEST_F(File, reads_back_and_leaves_no_other_file) {
  const std::string bytes("a\0b\n", 4);
  base::write_file(folder_ / "x", "old");
  base::write_file(folder_ / "x", bytes);
  EXPECT_EQ(base::read_file(folder_ / "x", "test file", 100), bytes);
  EXPECT_EQ(count_entries(), 1u);
}

TEST_F(File, earlier_bytes_are_replaced) {
  base::WholeFile file(folder_ / "x");
  file.append("0123456789");
  file.overwrite(2, "ab");
  file.append("end");
  file.overwrite(0, "-");
  file.commit();
  EXPECT_EQ(base::read_file(folder_ / "x", "test file", 100), "-1ab456789end");
}

TEST_F(File, only_regular_files_are_read) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  for (const fs::path& path : {folder_ / "pipe", folder_, fs::path("/dev/zero"), folder_ / "missing"}) {
    EXPECT_THROW(base::read_file(path, "test file", 100), InputError) << path;
    EXPECT_THROW(base::read_document(path), InputError) << path;
  }
}

TEST_F(File, link_loops_and_large_files_are_rejected) {
  fs::create_symlink(folder_ / "b", folder_ / "a");
  fs::create_symlink(folder_ / "a", folder_ / "b");
  EXPECT_THROW(base::read_file(folder_ / "a", "test file", 100), InputError);
  base::write_file(folder_ / "big", std::string(101, 'x'));
  EXPECT_THROW(base::read_file(folder_ / "big", "test file", 100), InputError);
}

TEST_F(File, unwritable_paths_are_found_early) {
  base::check_writable(folder_ / "new" / "x.bank", "bank");
  EXPECT_EQ(count_entries(), 1u);  // the new folder, no probe
  EXPECT_THROW(base::check_writable(folder_, "bank"), InputError);
  base::write_file(folder_ / "plain", "x");
  EXPECT_THROW(base::check_writable(folder_ / "plain" / "x.bank", "bank"), InputError);
  EXPECT_THROW(base::write_file("/proc/carillon", "x"), carillon::SystemError);
  EXPECT_THROW(base::check_writable(folder_ / std::string(256, 'x'), "bank"), InputError);
}

TEST_F(File, the_longest_name_is_written) {
  const fs::path file = folder_ / std::string(255, 'x');
  base::check_writable(file, "bank");
  base::write_file(file, "long");
  EXPECT_EQ(base::read_file(file, "test file", 100), "long");
  EXPECT_EQ(count_entries(), 1u);
}

TEST_F(File, a_failed_write_leaves_the_old_file) {
  base::write_file(folder_ / "x", "old");
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{1000, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(base::write_file(folder_ / "x", std::string(100000, 'n')), carillon::SystemError);
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(base::read_file(folder_ / "x", "test file", 100), "old");
  EXPECT_EQ(count_entries(), 1u);
}

}  // namespace
