#include "runtime/base/result.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <new>

#include "runtime/base/failure.hpp"

namespace {

namespace base = carillon::base;
namespace fs = std::filesystem;
using base::Result;
using base::ResultKind;

class ResultFile : public testing::Test {
 protected:
  ResultFile() : file_(fs::temp_directory_path() / ("carillon-result-" + std::to_string(::getpid()))) {}
  ~ResultFile() override { fs::remove(file_); }
  const fs::path file_;
};

template <class Error>
Result describe(const Error& error) {
  return base::describe_error(std::make_exception_ptr(error), "no memory");
}

TEST_F(ResultFile, reads_back_exactly) {
  for (int kind = 0; kind <= static_cast<int>(ResultKind::checkpointed); ++kind) {
    const Result wanted{static_cast<ResultKind>(kind), "it \"needs\"\n more", "a.json:3", 12.5e9, kind % 2 == 1, 7000};
    ASSERT_TRUE(base::write_result(file_, wanted));
    const auto found = base::read_result(file_);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->kind, wanted.kind);
    EXPECT_EQ(found->message, wanted.message);
    EXPECT_EQ(found->place, wanted.place);
    EXPECT_EQ(found->need_bytes, wanted.need_bytes);
    EXPECT_EQ(found->is_resumable, wanted.is_resumable);
    EXPECT_EQ(found->possible_nodes, wanted.possible_nodes);
  }
}

TEST_F(ResultFile, truncated_gives_nothing) {
  base::write_result(file_, {ResultKind::memory, "out of memory", "", 1e9, true});
  std::ifstream stream(file_);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  for (std::size_t bytes = 0; bytes + 2 < whole.size(); ++bytes) {
    std::ofstream(file_) << whole.substr(0, bytes);
    EXPECT_FALSE(base::read_result(file_)) << bytes;
  }
  std::ofstream(file_) << R"({"kind": "unheard of"})";
  EXPECT_FALSE(base::read_result(file_));
  fs::remove(file_);
  EXPECT_FALSE(base::read_result(file_));
}

TEST(ResultKind, follows_from_the_exception) {
  const Result placed = describe(carillon::PlacedError("job.json:7", "no such key"));
  EXPECT_EQ(placed.kind, ResultKind::bad_input);
  EXPECT_EQ(placed.place, "job.json:7");
  EXPECT_EQ(placed.message, "job.json:7: no such key");
  EXPECT_EQ(describe(carillon::InputError("bad")).kind, ResultKind::bad_input);
  EXPECT_EQ(describe(carillon::SolveError("lost")).kind, ResultKind::no_solution);
  EXPECT_EQ(describe(carillon::SystemError("no")).kind, ResultKind::system);
  EXPECT_EQ(describe(carillon::DiskFullError("full")).kind, ResultKind::disk_full);
  const Result memory = describe(carillon::MemoryError("too much", 3e9));
  EXPECT_EQ(memory.kind, ResultKind::memory);
  EXPECT_EQ(memory.need_bytes, 3e9);
  EXPECT_EQ(describe(std::bad_alloc()).message, "no memory");
  EXPECT_EQ(describe(std::logic_error("odd")).kind, ResultKind::system);
}

TEST(DescribeError, and_throw_error_are_inverse) {
  const auto fail = [](const auto& error) { return std::make_exception_ptr(error); };
  for (const std::exception_ptr& error :
       {fail(carillon::PlacedError("job.json:3", "bad key")), fail(carillon::CountRefusal("too few nodes", 7000)),
        fail(carillon::InputError("no")), fail(carillon::SolveError("not found")), fail(carillon::MemoryError("too much", 3e9)),
        fail(carillon::DiskFullError("full")), fail(carillon::SystemError("odd"))}) {
    const Result before = base::describe_error(error, "");
    Result after;
    try {
      base::throw_error(before);
    } catch (...) {
      after = base::describe_error(std::current_exception(), "");
    }
    EXPECT_EQ(after.kind, before.kind);
    EXPECT_EQ(after.message, before.message);
    EXPECT_EQ(after.place, before.place);
    EXPECT_EQ(after.need_bytes, before.need_bytes);
    EXPECT_EQ(after.possible_nodes, before.possible_nodes);
  }
}

TEST(ResultKind, has_the_exit_code_of_its_error) {
  EXPECT_EQ(base::get_exit_code(ResultKind::done), 0);
  EXPECT_EQ(base::get_exit_code(ResultKind::bad_input), 2);
  EXPECT_EQ(base::get_exit_code(ResultKind::no_solution), 3);
  for (const ResultKind kind : {ResultKind::memory, ResultKind::disk_full, ResultKind::system}) EXPECT_EQ(base::get_exit_code(kind), 4);
  EXPECT_EQ(base::get_exit_code(ResultKind::checkpointed), 85);
}

TEST(RethrowAfter, keeps_the_kind_of_the_error) {
  try {
    try {
      throw carillon::MemoryError("too much", 5.0);
    } catch (const std::exception&) {
      carillon::rethrow_after("so far. ");
    }
  } catch (const carillon::MemoryError& error) {
    EXPECT_STREQ(error.what(), "so far. too much");
    EXPECT_EQ(error.get_need_bytes(), 5.0);
  }
  try {
    try {
      throw carillon::PlacedError("job.json:4", "no such material");
    } catch (const std::exception&) {
      carillon::rethrow_after("so far. ");
    }
  } catch (const carillon::PlacedError& error) {
    EXPECT_EQ(error.get_place(), "job.json:4");
    EXPECT_STREQ(error.what(), "job.json:4: so far. no such material");
  }
}

TEST(SystemErrors, are_sorted_by_errno) {
  EXPECT_THROW(carillon::throw_system_error(ENOSPC, "x"), carillon::DiskFullError);
  EXPECT_THROW(carillon::throw_system_error(EDQUOT, "x"), carillon::DiskFullError);
  EXPECT_THROW(carillon::throw_system_error(ENOMEM, "x"), carillon::MemoryError);
  EXPECT_THROW(carillon::throw_system_error(EACCES, "x"), carillon::SystemError);
}

}  // namespace
