// Header of a recorded-surface file: its first 4096 bytes, with the positions of its arrays.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace carillon::recording {

inline constexpr std::size_t kHeaderBytes = 4096;                       // the HDF5 user block of the file
inline constexpr std::size_t kDigestBytes = 64;                         // hexadecimal SHA-256 of all other bytes, at the end of the header
inline constexpr std::size_t kTextBytes = kHeaderBytes - kDigestBytes;  // padded with line feeds
inline constexpr std::uint32_t kBlockFrames = 256;                      // samples per triangle with a common scale

/// Arrays, little-endian, contiguous. V vertices, T triangles, B bodies, K keys, N blocks.
enum class Array : std::uint8_t {
  kTriangle,      // i4 (T, 3): vertices, counter-clockwise from outside
  kTriangleBody,  // i4 (T)
  kVertexBody,    // i4 (V)
  kArea,          // rest surface
  kRadius,        // sphere with the surface area of the body
  kCentre,        // f8 (K, B, 3) m
  kStep,          // f8 (K, B) m
  kPlace,         // vertex = centre + step times this
  kScale,         // f4 (N, T) m/s2
  kAcceleration,  // normal acceleration, times scale; for the rest area
};
inline constexpr std::size_t kArrays = 10;

/// Headers from parse_header() have counts and arrays that fit into the file.
struct Header {
  double sample_rate_hz = 48000.0;
  double air_density_kg_m3 = 1.21, sound_speed_m_s = 343.0;
  std::uint64_t frames = 0;       // samples
  std::uint64_t key_frames = 48;  // samples between two key positions of a vertex
  std::uint64_t vertices = 0, triangles = 0, bodies = 0;
  std::array<std::uint64_t, kArrays> offset{};  // from the start of the file
  std::uint64_t length = 0;                     // of the file

  std::uint64_t count_keys() const { return (frames - 1) / key_frames + 2; }
  std::uint64_t count_blocks() const { return (frames + kBlockFrames - 1) / kBlockFrames; }
  /// Dimensions and size of an array.
  struct Shape {
    const char* name;
    const char* type;
    std::array<std::uint64_t, 3> extent;  // 0: missing dimension
    std::uint64_t bytes;                  // of the array
  };
  Shape get_shape(Array array) const;
};

/// Header text, kTextBytes long.
std::string format_header(const Header& header);

/// head: first bytes of a file of `length` bytes, at least kHeaderBytes unless the file is shorter; `name`: the file. Throws InputError.
/// Does not check the digest.
Header parse_header(std::string_view head, std::uint64_t length, const std::string& name);

}  // namespace carillon::recording
