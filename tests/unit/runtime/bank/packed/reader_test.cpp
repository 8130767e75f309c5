// Round trip of numbers and blocks; invalid data is rejected before memory is allocated.
#include "runtime/bank/packed/reader.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "runtime/bank/packed/inflate.hpp"
#include "runtime/bank/packed/writer.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::packed {
namespace {

Reader make_reader(const Writer& writer) { return {std::as_bytes(std::span(writer.get_bytes())), "file.hdf", "packed part"}; }

template <class Call>
std::string message_of(Call&& call) {
  return tests::catch_message<InputError>(std::forward<Call>(call));
}

TEST(CodecReader, zigzag_code_is_invertible_and_small) {
  for (std::int32_t value = -1000; value <= 1000; ++value) {
    EXPECT_EQ(unfold(fold(value)), value);
    EXPECT_LE(fold(value), 2U * static_cast<std::uint32_t>(std::abs(value)));
  }
  for (const std::int32_t value : {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()})
    EXPECT_EQ(unfold(fold(value)), value);
  EXPECT_EQ(fold(-1), 1U);
}

TEST(CodecReader, reads_back_exactly) {
  std::mt19937 random(1);
  Writer writer;
  writer.put(std::uint8_t{200});
  writer.put(-1.5);
  writer.put(0.25);
  writer.put_list(std::span<const float>(std::vector<float>{1.0F, -2.0F}));
  std::vector<std::vector<std::uint32_t>> lists{
      {}, {0, 0, 0}, {255}, {256, 1}, {0xffffff, 0, 7}, {0xffffffffU, 0}, std::vector<std::uint32_t>(5000)};
  for (std::uint32_t& value : lists.back()) value = static_cast<std::uint32_t>(random()) >> (random() % 32);
  for (const auto& list : lists) writer.put_numbers(list);
  const std::vector<std::uint8_t> block(100000, 7);
  writer.put_block(block);
  writer.put_block({});

  Reader reader = make_reader(writer);
  EXPECT_EQ(reader.get<std::uint8_t>(), 200);
  EXPECT_EQ(reader.get<double>(), -1.5);
  EXPECT_EQ(reader.get_positive("step"), 0.25);
  EXPECT_EQ(reader.get_list<float>(2), (std::vector<float>{1.0F, -2.0F}));
  for (const auto& list : lists) EXPECT_EQ(reader.get_numbers(list.size()), list);
  EXPECT_EQ(reader.get_block(block.size()), block);
  EXPECT_TRUE(message_of([&] { reader.finish(); }).ends_with(" excess bytes; copy or pack the bank again"));
  EXPECT_TRUE(reader.get_block(0).empty());
  EXPECT_NO_THROW(reader.finish());
}

TEST(CodecReader, rejects_missing_data) {
  Writer writer;
  writer.put(std::uint32_t{5});
  EXPECT_NE(message_of([&] { make_reader(writer).get<double>(); }).find("ends too early"), std::string::npos);
  EXPECT_NE(message_of([&] { make_reader(writer).get_list<std::uint16_t>(3); }).find("ends too early"), std::string::npos);
  EXPECT_NE(
      message_of([&] { make_reader(writer).get_list<double>(std::numeric_limits<std::size_t>::max() / 8 + 2); }).find("ends too early"),
      std::string::npos);
  EXPECT_NE(message_of([&] { make_reader(writer).get_block(1); }).find("ends too early"), std::string::npos);
  EXPECT_EQ(make_reader(writer).get_list<std::uint16_t>(2).size(), 2u);
}

TEST(CodecReader, rejects_nonpositive_numbers) {
  for (const double bad :
       {0.0, -0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
    Writer writer;
    writer.put(bad);
    EXPECT_NE(message_of([&] { make_reader(writer).get_positive("step"); }).find("its step is "), std::string::npos) << bad;
  }
}

TEST(CodecReader, rejects_damaged_blocks) {
  std::vector<std::uint8_t> block(600);
  for (std::size_t i = 0; i < block.size(); ++i) block[i] = static_cast<std::uint8_t>(i * i % 251);
  Writer writer;
  writer.put_block(block);
  for (const std::size_t size : {0u, 1u, 599u, 601u, 100000u}) EXPECT_THROW(make_reader(writer).get_block(size), InputError) << size;
  std::size_t refused = 0;
  for (std::size_t i = 0; i < writer.get_bytes().size(); ++i) {
    std::vector<std::uint8_t> bytes = writer.get_bytes();
    bytes[i] = static_cast<std::uint8_t>(bytes[i] ^ 0x10U);
    Reader reader(std::as_bytes(std::span(bytes)), "file.hdf", "packed part");
    try {
      EXPECT_EQ(reader.get_block(block.size()), block) << i;  // padding bits before the checksum are ignored
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GE(refused + 1, writer.get_bytes().size());
}

TEST(CodecReader, rejects_impossible_expansion) {
  const std::vector<std::uint8_t> zeros(1 << 22, 0);
  Writer writer;
  writer.put_block(zeros);
  ASSERT_LE(zeros.size() / kMaxInflation, writer.get_bytes().size());  // kMaxInflation is a bound
  EXPECT_EQ(make_reader(writer).get_block(zeros.size()), zeros);
  EXPECT_NE(message_of([&] { make_reader(writer).get_block(std::size_t{1} << 40); }).find("too short"), std::string::npos);
}

TEST(CodecReader, rejects_numbers_of_five_bytes) {
  Writer writer;
  writer.put(std::uint8_t{5});
  EXPECT_NE(message_of([&] { make_reader(writer).get_numbers(0); }).find("numbers of 5 bytes"), std::string::npos);
}

TEST(CodecReader, expansion_is_limited) {
  EXPECT_EQ(find_most_unpacked(0), 64u << 20);
  EXPECT_EQ(find_most_unpacked(16384), 64u << 20);
  EXPECT_EQ(find_most_unpacked(1 << 20), std::uint64_t{4096} << 20);
}

}  // namespace
}  // namespace carillon::packed
