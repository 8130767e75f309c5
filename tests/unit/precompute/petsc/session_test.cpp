#include "precompute/petsc/session.hpp"

#include <gtest/gtest.h>
#include <petscmat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <type_traits>
#include <vector>

#include "precompute/petsc/handle.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::petsc {
namespace {

using tests::catch_message;

TEST(Session, takes_no_options_from_the_command_line_or_the_environment) {
  PetscBool is_set = PETSC_TRUE;
  check(PetscOptionsHasName(nullptr, nullptr, "-carillon_leak", &is_set));
  EXPECT_FALSE(is_set);
}

TEST(Check, turns_a_petsc_error_into_an_exception_with_its_words) {
  MatHandle mat;
  check(MatCreateSeqAIJ(PETSC_COMM_SELF, 2, 2, 1, nullptr, mat.out()));
  const std::string text = catch_message<SolveError>([&] { check(MatSetValue(mat, 7, 0, 1.0, INSERT_VALUES)); });
  EXPECT_NE(text.find("out of range"), std::string::npos) << text;
  EXPECT_NE(text.find('7'), std::string::npos) << text;
}

TEST(Check, maps_a_missing_file_to_a_system_error) {
  FILE* file = nullptr;
  const std::string text = catch_message<SystemError>([&] { check(PetscFOpen(PETSC_COMM_SELF, "/no/such/file", "r", &file)); });
  EXPECT_NE(text.find("/no/such/file"), std::string::npos) << text;
}

TEST(Check, forgets_an_error_once_it_was_thrown) {
  MatHandle mat;
  check(MatCreateSeqAIJ(PETSC_COMM_SELF, 2, 2, 1, nullptr, mat.out()));
  EXPECT_THROW(check(MatSetValue(mat, 7, 0, 1.0, INSERT_VALUES)), SolveError);
  const std::string text = catch_message<SolveError>([&] { check(MatSetValue(mat, 0, 9, 1.0, INSERT_VALUES)); });
  EXPECT_EQ(text.find('7'), std::string::npos) << text;
}

TEST(Handle, owns_one_reference_and_moves_it) {
  static_assert(!std::is_copy_constructible_v<VecHandle>);
  Vec plain = nullptr;
  check(VecCreateSeq(PETSC_COMM_SELF, 3, &plain));
  check(PetscObjectReference(reinterpret_cast<PetscObject>(plain)));
  PetscInt references = 0;
  {
    VecHandle first(plain);
    VecHandle second(std::move(first));
    EXPECT_EQ(first.get(), nullptr);
    EXPECT_EQ(second.get(), plain);
  }
  check(PetscObjectGetReference(reinterpret_cast<PetscObject>(plain), &references));
  EXPECT_EQ(references, 1);
  check(VecDestroy(&plain));
}

TEST(ToPetscInt, rejects_values_out_of_range) {
  EXPECT_EQ(to_petsc_int(2'000'000'000), 2'000'000'000);
  if constexpr (sizeof(PetscInt) == 4) {
    EXPECT_THROW(to_petsc_int(std::int64_t{1} << 31), SystemError);
  }
}

// Of this process, currently.
std::int64_t get_resident_bytes() {
  std::int64_t whole = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> whole >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

constexpr std::size_t kLarge = 64 << 20;
constexpr std::int64_t kLittle = 8 << 20;

TEST(Memory, of_large_blocks_is_returned_when_freed) {
  const std::int64_t before = get_resident_bytes();
  for (int repeat = 0; repeat < 3; ++repeat) {
    char* piece = nullptr;
    check(PetscMalloc1(kLarge, &piece));
    std::fill_n(piece, kLarge, '\1');
    EXPECT_GT(get_resident_bytes(), before + static_cast<std::int64_t>(kLarge) - kLittle);
    std::vector<char> behind(1 << 20, '\1');  // keeps the heap from shrinking, if the block is in it
    check(PetscFree(piece));
    EXPECT_LT(get_resident_bytes(), before + kLittle);
  }
}

TEST(Memory, cleared_by_petsc_is_not_resident_before_use) {
  const std::int64_t before = get_resident_bytes();
  for (int repeat = 0; repeat < 2; ++repeat) {
    char* piece = nullptr;
    check(PetscCalloc1(kLarge, &piece));
    EXPECT_LT(get_resident_bytes(), before + kLittle);
    EXPECT_EQ(std::count(piece, piece + kLarge, '\0'), static_cast<std::ptrdiff_t>(kLarge));
    std::fill_n(piece, kLarge, '\1');
    check(PetscFree(piece));
  }
}

TEST(Memory, is_given_back_in_whole_pages_and_no_more) {
  const std::ptrdiff_t page = sysconf(_SC_PAGESIZE);
  char* piece = nullptr;
  check(PetscMalloc1(kLarge, &piece));
  std::fill_n(piece, kLarge, '\1');
  const std::int64_t before = get_resident_bytes();
  char* const begin = piece + page / 2;
  char* const end = piece + kLarge - page / 2;
  give_back_pages(begin, end);
  EXPECT_LT(get_resident_bytes(), before - static_cast<std::int64_t>(kLarge) + kLittle);
  EXPECT_EQ(std::count(piece, begin, '\1'), begin - piece);
  EXPECT_EQ(std::count(end, piece + kLarge, '\1'), piece + kLarge - end);
  EXPECT_EQ(std::count(begin + page, end - page, '\0'), end - begin - 2 * page);
  piece[4 * page] = '\2';
  give_back_pages(piece + 4 * page, piece + 4 * page);          // empty range
  give_back_pages(piece + 4 * page - 1, piece + 5 * page - 1);  // no whole page
  EXPECT_EQ(piece[4 * page], '\2');
  check(PetscFree(piece));
}

TEST(Blas, has_a_name_consistent_with_its_kind) {
  EXPECT_EQ(blas_is_reference(), blas_name().find("reference") != std::string::npos) << blas_name();
  EXPECT_NE(blas_name().find(".so"), std::string::npos) << blas_name();
}

}  // namespace
}  // namespace carillon::petsc
