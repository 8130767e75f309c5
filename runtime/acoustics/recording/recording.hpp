// Recorded surface of a simulation, from an untrusted file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/acoustics/recording/header.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::recording {

/// Open file: tables in memory, blocks read on demand. Invariant: all bytes matched the digest when the file was opened; all numbers of the
/// tables are finite and in range. A file changed afterwards gives wrong sound but no crash.
class RecordedSurface {
 public:
  /// Throws InputError unless the file is complete and valid.
  explicit RecordedSurface(const std::filesystem::path& file);
  /// From memory, which must outlive it.
  RecordedSurface(std::string_view bytes, std::string name);

  const Header& get_header() const { return header_; }
  double get_duration_s() const { return static_cast<double>(header_.frames) / header_.sample_rate_hz; }
  const std::vector<Triangle>& get_triangles() const { return triangles_; }
  const std::vector<std::int32_t>& get_triangle_bodies() const { return triangle_body_; }
  const std::vector<double>& get_areas_m2() const { return area_m2_; }
  const std::vector<double>& get_radii_m() const { return radius_m_; }

  /// Mean of the centres of its bodies [m] at sample key * key_frames. key < count_keys().
  Vec3 read_centre(std::uint64_t key) const;
  /// places (V): vertices [m] at sample key * key_frames. key < count_keys().
  void read_places(std::uint64_t key, std::span<Vec3> places_m) const;
  /// acceleration (T, kBlockFrames): normal accelerations [m/s2] from sample block * kBlockFrames on; zero after the end. block <
  /// count_blocks().
  void read_accelerations(std::uint64_t block, std::span<float> acceleration_m_s2) const;

 private:
  void open();
  void read(std::uint64_t offset, std::span<std::byte> to) const;
  template <typename T>
  std::vector<T> read_array(Array array, std::uint64_t count) const;
  std::uint64_t find_offset(Array array, std::uint64_t row) const;

  std::string name_;
  std::string_view bytes_;  // empty: read from the file
  base::Descriptor descriptor_;
  Header header_;
  std::vector<Triangle> triangles_;
  std::vector<std::int32_t> triangle_body_, vertex_body_;
  std::vector<double> area_m2_, radius_m_;
};

}  // namespace carillon::recording
