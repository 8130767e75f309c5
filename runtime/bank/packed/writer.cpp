#include "runtime/bank/packed/writer.hpp"

#include <libdeflate.h>

#include <bit>
#include <memory>

#include "runtime/base/error.hpp"

namespace carillon::packed {
namespace {

constexpr int kCompressionLevel = 6;  // 12 takes 5 % less space and 15 times as long

}  // namespace

void Writer::put_block(std::span<const std::uint8_t> block) {
  const std::unique_ptr<libdeflate_compressor, void (*)(libdeflate_compressor*)> compressor(libdeflate_alloc_compressor(kCompressionLevel),
                                                                                            libdeflate_free_compressor);
  if (!compressor) throw SystemError("there is no memory to compress with");
  std::vector<std::uint8_t> stream(libdeflate_zlib_compress_bound(compressor.get(), block.size()));
  stream.resize(libdeflate_zlib_compress(compressor.get(), block.data(), block.size(), stream.data(), stream.size()));
  put(static_cast<std::uint32_t>(stream.size()));
  bytes_.insert(bytes_.end(), stream.begin(), stream.end());
}

void Writer::put_numbers(std::span<const std::uint32_t> values) {
  std::uint32_t all = 0;
  for (const std::uint32_t value : values) all |= value;
  const int planes = (std::bit_width(all) + 7) / 8;
  put(static_cast<std::uint8_t>(planes));
  std::vector<std::uint8_t> bytes(values.size());
  for (int plane = 0; plane < planes; ++plane) {
    for (std::size_t i = 0; i < values.size(); ++i) bytes[i] = static_cast<std::uint8_t>(values[i] >> (8 * plane));
    put_block(bytes);
  }
}

}  // namespace carillon::packed
