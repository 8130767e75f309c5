#include "runtime/bank/packed/inflate.hpp"

#ifdef __EMSCRIPTEN__
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_PNG
#define STBI_NO_STDIO
#include <stb_image.h>
#else
#include <libdeflate.h>

#include <memory>
#endif

namespace carillon::packed {

#ifdef __EMSCRIPTEN__

bool inflate(std::span<const std::uint8_t> stream, std::span<std::uint8_t> bytes) {
  const int length = stbi_zlib_decode_buffer(reinterpret_cast<char*>(bytes.data()), static_cast<int>(bytes.size()),
                                             reinterpret_cast<const char*>(stream.data()), static_cast<int>(stream.size()));
  return length >= 0 && length == std::ssize(bytes);
}

#else

bool inflate(std::span<const std::uint8_t> stream, std::span<std::uint8_t> bytes) {
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> decompressor(libdeflate_alloc_decompressor(),
                                                                                                  libdeflate_free_decompressor);
  if (!decompressor) return false;
  std::size_t length = 0;
  const libdeflate_result result =
      libdeflate_zlib_decompress(decompressor.get(), stream.data(), stream.size(), bytes.data(), bytes.size(), &length);
  return result == LIBDEFLATE_SUCCESS && length == bytes.size();
}

#endif

}  // namespace carillon::packed
