// Reader of recorded surfaces, from untrusted bytes.
// Method:     as for banks: array positions from the header, one digest of all bytes, tables checked before use. Without HDF5.
// Source:     docs/surface-format.md.
#include "runtime/acoustics/recording/recording.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::recording {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr double kFarthest = 1e6;  // m, largest coordinate

}  // namespace

RecordedSurface::RecordedSurface(const std::filesystem::path& file) : name_(file.string()) {
  // Non-blocking, so that a FIFO without a writer cannot hang the program.
  descriptor_ = base::Descriptor(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  if (descriptor_.get() < 0)
    throw InputError(fmt::format("{}: cannot be opened: {}; give the path of a recorded surface", name_, std::strerror(errno)));
  struct stat status {};
  if (::fstat(descriptor_.get(), &status) != 0 || !S_ISREG(status.st_mode))
    throw InputError(fmt::format("{}: is not a regular file; give the path of a recorded surface", name_));
  header_.length = static_cast<std::uint64_t>(status.st_size);
  open();
}

RecordedSurface::RecordedSurface(std::string_view bytes, std::string name) : name_(std::move(name)), bytes_(bytes) {
  header_.length = bytes.size();
  open();
}

void RecordedSurface::read(std::uint64_t offset, std::span<std::byte> to) const {
  if (descriptor_.get() < 0) {
    std::memcpy(to.data(), bytes_.data() + offset, to.size());
    return;
  }
  while (!to.empty()) {
    const ssize_t got = ::pread(descriptor_.get(), to.data(), to.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw SystemError(fmt::format("{}: cannot be read at byte {}: {}", name_, offset, std::strerror(errno)));
    if (got == 0)
      throw InputError(fmt::format("{}: truncated at byte {} while it was read; read it again when its writer is done", name_, offset));
    offset += static_cast<std::uint64_t>(got);
    to = to.subspan(got);
  }
}

template <typename T>
std::vector<T> RecordedSurface::read_array(Array array, std::uint64_t count) const {
  std::vector<T> values(count);
  read(header_.offset[static_cast<std::size_t>(array)], std::as_writable_bytes(std::span(values)));
  return values;
}

std::uint64_t RecordedSurface::find_offset(Array array, std::uint64_t row) const {
  const Header::Shape shape = header_.get_shape(array);
  return header_.offset[static_cast<std::size_t>(array)] + row * (shape.bytes / shape.extent[0]);
}

void RecordedSurface::open() {
  const std::uint64_t length = header_.length;
  std::string head(std::min<std::uint64_t>(length, kHeaderBytes), '\0');
  read(0, std::as_writable_bytes(std::span(head)));
  header_ = parse_header(head, length, name_);

  base::Sha256 sha;
  sha.add(std::string_view(head).substr(0, kTextBytes));
  std::vector<std::byte> piece(std::min<std::uint64_t>(length, 1 << 20));
  for (std::uint64_t at = kHeaderBytes; at < length; at += piece.size()) {
    const auto part = std::span(piece).first(std::min<std::uint64_t>(piece.size(), length - at));
    read(at, part);
    sha.add(part);
  }
  if (base::to_hex(sha.finish()) != std::string_view(head).substr(kTextBytes)) {
    throw InputError(
        fmt::format("{}: damaged: its digest differs from the one in its header; copy the file or run "
                    "carillon-simulate again",
                    name_));
  }

  const auto refuse = [&](const char* array, std::uint64_t at, const char* what) {
    throw InputError(fmt::format("{}: {}[{}] {}; run carillon-simulate again", name_, array, at, what));
  };
  const auto check_list = [&](const auto& values, const char* array, const char* what, auto&& is_good) {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!is_good(values[i])) refuse(array, i, what);
  };
  triangles_ = read_array<Triangle>(Array::kTriangle, header_.triangles);
  triangle_body_ = read_array<std::int32_t>(Array::kTriangleBody, header_.triangles);
  vertex_body_ = read_array<std::int32_t>(Array::kVertexBody, header_.vertices);
  area_m2_ = read_array<double>(Array::kArea, header_.triangles);
  radius_m_ = read_array<double>(Array::kRadius, header_.bodies);
  const auto is_body = [&](std::int32_t body) { return body >= 0 && static_cast<std::uint64_t>(body) < header_.bodies; };
  check_list(triangles_, "triangle", "names a missing vertex", [&](const Triangle& corners) {
    return std::all_of(corners.begin(), corners.end(),
                       [&](std::int32_t vertex) { return vertex >= 0 && static_cast<std::uint64_t>(vertex) < header_.vertices; });
  });
  check_list(triangle_body_, "triangle_body", "names a missing body", is_body);
  check_list(vertex_body_, "vertex_body", "names a missing body", is_body);
  check_list(area_m2_, "area", "is not an area in m2", [](double area) { return area > 0.0 && area < 1e12; });
  check_list(radius_m_, "radius", "is not a radius in m", [](double radius) { return radius > 1e-9 && radius < 1e6; });
  // Rows of keys and blocks are checked here once, not during playback.
  const auto centre = read_array<double>(Array::kCentre, header_.count_keys() * header_.bodies * 3);
  const auto step = read_array<double>(Array::kStep, header_.count_keys() * header_.bodies);
  const auto scale = read_array<float>(Array::kScale, header_.count_blocks() * header_.triangles);
  check_list(centre, "centre", "is not a position in m", [](double value) { return std::abs(value) <= kFarthest; });
  check_list(step, "step", "is not a step in m", [](double value) { return value >= 0.0 && value <= kFarthest; });
  check_list(scale, "scale", "is not an acceleration in m/s2", [](float value) { return value >= 0.0F && value <= 1e12F; });
}

Vec3 RecordedSurface::read_centre(std::uint64_t key) const {
  std::vector<std::array<double, 3>> centre(header_.bodies);
  read(find_offset(Array::kCentre, key), std::as_writable_bytes(std::span(centre)));
  Vec3 mean{};
  for (const Vec3& one : centre) mean = mean + (1.0 / static_cast<double>(centre.size())) * one;
  return mean;
}

void RecordedSurface::read_places(std::uint64_t key, std::span<Vec3> places_m) const {
  std::vector<std::array<double, 3>> centre(header_.bodies);
  std::vector<double> step(header_.bodies);
  std::vector<std::array<std::int16_t, 3>> place(header_.vertices);
  read(find_offset(Array::kCentre, key), std::as_writable_bytes(std::span(centre)));
  read(find_offset(Array::kStep, key), std::as_writable_bytes(std::span(step)));
  read(find_offset(Array::kPlace, key), std::as_writable_bytes(std::span(place)));
  for (std::size_t v = 0; v < place.size(); ++v) {
    const std::size_t body = vertex_body_[v];
    for (std::size_t axis = 0; axis < 3; ++axis) places_m[v][axis] = centre[body][axis] + step[body] * place[v][axis];
  }
}

void RecordedSurface::read_accelerations(std::uint64_t block, std::span<float> acceleration_m_s2) const {
  std::vector<float> scale(header_.triangles);
  std::vector<std::int16_t> values(header_.triangles * kBlockFrames);
  read(find_offset(Array::kScale, block), std::as_writable_bytes(std::span(scale)));
  read(find_offset(Array::kAcceleration, block), std::as_writable_bytes(std::span(values)));
  const std::uint64_t there = std::min<std::uint64_t>(kBlockFrames, header_.frames - block * kBlockFrames);
  for (std::size_t t = 0; t < scale.size(); ++t)
    for (std::size_t i = 0; i < kBlockFrames; ++i) {
      const std::size_t at = t * kBlockFrames + i;
      acceleration_m_s2[at] = i < there ? scale[t] * static_cast<float>(values[at]) : 0.0F;
    }
}

}  // namespace carillon::recording
