// What a file of a recorded surface says in its first 4096 bytes, and where its arrays lie.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace carillon::recording {

inline constexpr std::size_t kHeaderBytes = 4096;                       // the HDF5 user block of the file
inline constexpr std::size_t kDigestBytes = 64;                         // hexadecimal SHA-256 of all other bytes: its last ones
inline constexpr std::size_t kTextBytes = kHeaderBytes - kDigestBytes;  // padded with line feeds
inline constexpr std::uint32_t kBlockFrames = 256;                      // samples of a triangle that share a scale

/// The arrays, all little-endian and without gaps. V vertices, T triangles, B bodies, K keys, N blocks.
enum class Array : std::uint8_t {
  kTriangle,      // i4 (T, 3): vertices, counter-clockwise from outside
  kTriangleBody,  // i4 (T)
  kVertexBody,    // i4 (V)
  kArea,          // f8 (T) m2: of the rest surface
  kRadius,        // f8 (B) m: of the sphere with the surface of the body
  kCentre,        // f8 (K, B, 3) m
  kStep,          // f8 (K, B) m
  kPlace,         // i2 (K, V, 3): a vertex lies at centre + step times this
  kScale,         // f4 (N, T) m/s2
  kAcceleration,  // i2 (N, T, kBlockFrames): normal acceleration, times scale; of the rest area
};
inline constexpr std::size_t kArrays = 10;

/// One that parse_header() returned has counts and arrays that fit into the file.
struct Header {
  double sample_rate_hz = 48000.0;
  double air_density_kg_m3 = 1.21, sound_speed_m_s = 343.0;
  std::uint64_t frames = 0;       // samples
  std::uint64_t key_frames = 48;  // samples between two places of a vertex
  std::uint64_t vertices = 0, triangles = 0, bodies = 0;
  std::array<std::uint64_t, kArrays> offset{};  // from the start of the file
  std::uint64_t length = 0;                     // of the file

  std::uint64_t count_keys() const { return (frames - 1) / key_frames + 2; }
  std::uint64_t count_blocks() const { return (frames + kBlockFrames - 1) / kBlockFrames; }
  /// Rows, columns and bytes of an item.
  struct Shape {
    const char* name;
    const char* type;
    std::array<std::uint64_t, 3> extent;  // 0: no such dimension
    std::uint64_t bytes;                  // of all
  };
  Shape get_shape(Array array) const;
};

/// The text, kTextBytes long.
std::string format_header(const Header& header);

/// head: the first bytes of a file of `length` bytes, at least kHeaderBytes of them unless the file is shorter. Throws InputError, one
/// clear message; `name` is the file. Does not look at the digest.
Header parse_header(std::string_view head, std::uint64_t length, const std::string& name);

}  // namespace carillon::recording
