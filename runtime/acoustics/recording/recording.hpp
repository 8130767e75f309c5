// A recorded surface: how the surfaces of a simulation moved, from a file that is not trusted.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/descriptor.hpp"
#include "runtime/base/triangle.hpp"
#include "runtime/base/vector.hpp"
#include "runtime/acoustics/recording/header.hpp"

namespace carillon::recording {

/// The file, open; tables in memory, blocks read when they are asked for. Invariant: every byte was checked against the digest
/// when it was opened; every number in its tables is in range and finite. A file that is changed afterwards gives wrong sound, never a
/// crash.
class RecordedSurface {
 public:
  /// Throws InputError, one clear message, unless the file is whole and sane.
  explicit RecordedSurface(const std::filesystem::path& file);
  /// Of bytes in memory, which must outlive it.
  RecordedSurface(std::string_view bytes, std::string name);

  const Header& get_header() const { return header_; }
  double get_duration_s() const { return static_cast<double>(header_.frames) / header_.sample_rate_hz; }
  const std::vector<Triangle>& get_triangles() const { return triangles_; }
  const std::vector<std::int32_t>& get_triangle_bodies() const { return triangle_body_; }
  const std::vector<double>& get_areas_m2() const { return area_m2_; }
  const std::vector<double>& get_radii_m() const { return radius_m_; }

  /// The mean of the middles of its bodies [m] at sample key * key_frames. key < count_keys().
  Vec3 read_centre(std::uint64_t key) const;
  /// places (V): vertices [m] at sample key * key_frames. key < count_keys().
  void read_places(std::uint64_t key, std::span<Vec3> places_m) const;
  /// acceleration (T, kBlockFrames): of normals [m/s2], samples block * kBlockFrames on; zero behind the end. block < count_blocks().
  void read_accelerations(std::uint64_t block, std::span<float> acceleration_m_s2) const;

 private:
  void open();
  void read(std::uint64_t offset, std::span<std::byte> to) const;
  template <typename T>
  std::vector<T> read_array(Array array, std::uint64_t count) const;
  std::uint64_t find_offset(Array array, std::uint64_t row) const;

  std::string name_;
  std::string_view bytes_;  // empty: from the file
  base::Descriptor descriptor_;
  Header header_;
  std::vector<Triangle> triangles_;
  std::vector<std::int32_t> triangle_body_, vertex_body_;
  std::vector<double> area_m2_, radius_m_;
};

}  // namespace carillon::recording
