// Names and files of a page.
#include "jobs/front/explore/files.hpp"

#include <gtest/gtest.h>

#include "jobs/front/explore/names.hpp"
#include "tests/support/folder.hpp"

namespace carillon::explore {
namespace {

TEST(PageNames, safe_in_files_and_addresses) {
  EXPECT_EQ(make_name("bar-1_a.hdf"), "bar-1_a.hdf");
  for (const char* text : {"", ".", "../x", "a/b", "%2e", "\xc3\xa4", "..."}) {
    const std::string name = make_name(text);
    EXPECT_FALSE(name.empty()) << text;
    EXPECT_NE(name[0], '.') << text;
    EXPECT_EQ(name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-"), std::string::npos) << name;
  }
  std::string accents;
  for (int i = 0; i < 80; ++i) accents += "\xc3\xa4";
  EXPECT_EQ(cut_name(accents), accents.substr(0, 100));
  EXPECT_EQ(cut_name("a" + accents), ("a" + accents).substr(0, 99));
}

TEST(PageFiles, copied_compressed_and_counted) {
  const tests::Folder folder;
  folder.write("from/a/b.txt", std::string(10000, 'x'));
  put_folder(folder / "from", folder / "to");
  EXPECT_EQ(tests::read_all(folder / "to/a/b.txt").size(), 10000u);
  EXPECT_EQ(calc_bytes(folder / "to"), 10000u);
  compress_file(folder / "to/a/b.txt");
  EXPECT_LT(std::filesystem::file_size(folder / "to/a/b.txt.gz"), 200u);
  EXPECT_THROW(put_file(folder / "nowhere", folder / "x"), SystemError);
}

}  // namespace
}  // namespace carillon::explore
