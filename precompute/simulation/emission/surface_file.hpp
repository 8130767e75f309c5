// Writing recorded surfaces (.surface.hdf, docs/surface-format.md). Internal to carillon::emission.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "runtime/acoustics/recording/header.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::emission {

/// Constant data.
struct SurfaceTables {
  std::vector<Triangle> triangles;                       // into vertices
  std::vector<std::int32_t> triangle_body, vertex_body;  // (T), (V)
  std::vector<double> area_m2, radius_m;                 // (T), (B)
};

/// A file written as FILE.part and renamed when complete. Keys and blocks may be written repeatedly and in any order: a resumed run
/// continues at its checkpoint. For one process. All methods throw SystemError for write errors.
class SurfaceFile {
 public:
  /// header: counts and constants. Creates FILE.part at final length (sparse); is_resumed: opens the existing one, throws InputError if it
  /// is of another run.
  SurfaceFile(std::filesystem::path file, recording::Header header, const SurfaceTables& tables, bool is_resumed);

  /// places (V) [m] at sample key * key_frames.
  void write_key(std::uint64_t key, std::span<const Vec3> places_m);
  /// scale (T) [m/s2] and values (T, kBlockFrames).
  void write_block(std::uint64_t block, std::span<const float> scale, std::span<const std::int16_t> values);
  /// Seals and renames the file. No writes afterwards.
  void commit();

 private:
  void make(const SurfaceTables& tables);
  void write(std::uint64_t offset, std::span<const std::byte> bytes);
  void write_row(recording::Array array, std::uint64_t row, std::span<const std::byte> bytes);

  std::filesystem::path file_, part_;
  recording::Header header_;
  std::vector<std::int32_t> vertex_body_;
  base::Descriptor descriptor_;
};

}  // namespace carillon::emission
