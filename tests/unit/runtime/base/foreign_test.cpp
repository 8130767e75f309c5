// UTF-16 text, paths with backslashes, and files beyond the size limit.
#include "runtime/base/foreign.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cerrno>
#include <string>

#include "runtime/base/document.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/file_limit.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/support/folder.hpp"

namespace carillon::base {
namespace {

std::string widen(const std::string& text, bool is_little) {
  std::string wide;
  for (const char c : text) wide += is_little ? std::string{c, '\0'} : std::string{'\0', c};
  return wide;
}

std::string find_error(const std::string& text) {
  return tests::catch_message<InputError>([&] { (void)parse_document(text, "job.json"); });
}

TEST(Foreign, utf16_is_recognised) {
  const std::string job = R"({"mesh": "bar.msh"})";
  for (const std::string& text : {"\xFF\xFE" + widen(job, true), "\xFE\xFF" + widen(job, false), widen(job, true), widen(job, false)}) {
    EXPECT_EQ(find_error(text).rfind("job.json: this text is UTF-16", 0), 0u) << find_error(text);
    EXPECT_NE(find_error(text).find("UTF-8"), std::string::npos);
  }
}

TEST(Foreign, other_bytes_are_not_utf16) {
  EXPECT_NO_THROW(refuse_utf16("", "a"));
  EXPECT_NO_THROW(refuse_utf16("{}", "a"));
  EXPECT_NO_THROW(refuse_utf16("\xEF\xBB\xBF{}", "a"));
  EXPECT_NO_THROW(refuse_utf16(std::string(200, '\0'), "a"));
  EXPECT_NO_THROW(refuse_utf16(std::string("a\0b\0c\0", 6), "a"));  // too short
  EXPECT_NO_THROW(refuse_utf16("\xFF\xFEsolid", "a"));
}

TEST(Foreign, backslashes_in_paths_are_reported) {
  EXPECT_NE(find_error(R"({"mesh": "C:\meshes\cup.msh"})").find("use / between the folders"), std::string::npos);
  try {
    Object job = parse_document(R"({"mesh": "..\\in\\bar.msh"})", "job.json").root();
    (void)job.path("mesh");
    FAIL() << "taken";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), R"(job.json:1: "mesh": there is no file "..\in\bar.msh"; use / between folders, not \)");
  }
  tests::expect_error<InputError>({"use / between folders"}, [&] { (void)read_file("in\\bar.msh", "mesh file", 100); });
  EXPECT_EQ(hint_backslash("in/bar.msh"), "");
}

TEST(Foreign, a_backslash_in_an_existing_name_is_accepted) {
  const tests::Folder folder;
  write_file(folder / "a\\b.msh", "x");
  Object job = parse_document(R"({"mesh": "a\\b.msh"})", folder / "job.json").root();
  EXPECT_EQ(job.path("mesh"), folder / "a\\b.msh");
}

/// Exit code 0: the error names the limit, and there is no file.
[[noreturn]] void write_beyond_limit(const std::filesystem::path& file) {
  report_file_limit();
  const rlimit limit{20'000, 20'000};
  if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) std::_Exit(1);
  try {
    write_file(file, std::string(50'000, 'x'));
  } catch (const DiskFullError& error) {
    std::_Exit(std::string(error.what()).find("ulimit -f") != std::string::npos && !std::filesystem::exists(file) ? 0 : 2);
  } catch (...) {
    std::_Exit(3);
  }
  std::_Exit(4);
}

TEST(Foreign, exceeding_the_file_size_limit_is_an_error) {
  const tests::Folder folder;
  EXPECT_EXIT(write_beyond_limit(folder / "sound.wav"), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace carillon::base
