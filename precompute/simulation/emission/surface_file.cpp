// Method: HDF5 allocates the arrays once, contiguous and at final length; rows are then written by offset without HDF5, so that an
//   interrupted process leaves a file that can be continued.
// Source: HDF5 1.10 reference manual; docs/surface-format.md.
#include "precompute/simulation/emission/surface_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "runtime/bank/hdf5_id.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::emission {
namespace {

using recording::Array;
using recording::kArrays;
using recording::kHeaderBytes;
using recording::kTextBytes;

hid_t find_type(const char* type) {
  const std::string_view name(type);
  if (name == "<f8") return H5T_IEEE_F64LE;
  if (name == "<f4") return H5T_IEEE_F32LE;
  return name == "<i4" ? H5T_STD_I32LE : H5T_STD_I16LE;
}

}  // namespace

SurfaceFile::SurfaceFile(std::filesystem::path file, recording::Header header, const SurfaceTables& tables, bool is_resumed)
    : file_(std::move(file)), part_(file_.string() + ".part"), header_(header), vertex_body_(tables.vertex_body) {
  if (!is_resumed) make(tables);
  descriptor_ = base::Descriptor(::open(part_.c_str(), O_RDWR | O_CLOEXEC));
  if (descriptor_.get() < 0) {
    const int error = errno;
    if (is_resumed)
      throw InputError(fmt::format("{}: cannot be opened: {}; the run resumes and needs it: remove the checkpoint to begin again",
                                   part_.string(), std::strerror(error)));
    throw SystemError(fmt::format("{}: cannot be opened: {}", part_.string(), std::strerror(error)));
  }
  if (!is_resumed) {
    // The text is present from now on, the digest is not: the file reads as damaged until sealed.
    const std::string text = recording::format_header(header_);
    write(0, std::as_bytes(std::span(text)));
    return;
  }
  std::string head(kHeaderBytes, '\0');
  struct stat status {};
  const bool is_read = ::pread(descriptor_.get(), head.data(), head.size(), 0) == static_cast<ssize_t>(head.size()) &&
                       ::fstat(descriptor_.get(), &status) == 0;
  const recording::Header found = recording::parse_header(head, is_read ? static_cast<std::uint64_t>(status.st_size) : 0, part_.string());
  header_.offset = found.offset;
  header_.length = found.length;
  if (recording::format_header(header_) != head.substr(0, kTextBytes))
    throw InputError(fmt::format("{}: is of another run; remove it and the checkpoint to begin again", part_.string()));
}

void SurfaceFile::make(const SurfaceTables& tables) {
  const auto properties = [](hid_t kind) { return H5Pcreate(kind); };
  const bank::Hdf5Id creation(properties(H5P_FILE_CREATE), H5Pclose, "a property list");
  H5Pset_userblock(creation, kHeaderBytes);
  H5Pset_obj_track_times(creation, false);
  {
    const bank::Hdf5Id file(H5Fcreate(part_.c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT), H5Fclose, part_.c_str());
    for (std::size_t i = 0; i < kArrays; ++i) {
      const recording::Header::Shape shape = header_.get_shape(static_cast<Array>(i));
      std::array<hsize_t, 3> extent{};
      int ranks = 0;
      while (ranks < 3 && shape.extent[ranks] > 0) {
        extent[ranks] = shape.extent[ranks];
        ++ranks;
      }
      const bank::Hdf5Id space(H5Screate_simple(ranks, extent.data(), nullptr), H5Sclose, "a space");
      const bank::Hdf5Id layout(properties(H5P_DATASET_CREATE), H5Pclose, "a property list");
      H5Pset_layout(layout, H5D_CONTIGUOUS);
      H5Pset_alloc_time(layout, H5D_ALLOC_TIME_EARLY);
      H5Pset_fill_time(layout, H5D_FILL_TIME_NEVER);
      H5Pset_obj_track_times(layout, false);
      const bank::Hdf5Id dataset(H5Dcreate2(file, shape.name, find_type(shape.type), space, H5P_DEFAULT, layout, H5P_DEFAULT), H5Dclose,
                                 shape.name);
      const haddr_t offset = H5Dget_offset(dataset);
      if (offset == HADDR_UNDEF) throw SystemError(fmt::format("{}: HDF5 does not report where {} lies", part_.string(), shape.name));
      header_.offset[i] = offset;
      const auto write_table = [&](const void* data, hid_t type) {
        if (H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0)
          throw SystemError(fmt::format("{}: HDF5 cannot write {}", part_.string(), shape.name));
      };
      if (static_cast<Array>(i) == Array::kTriangle) write_table(tables.triangles.data(), H5T_NATIVE_INT32);
      if (static_cast<Array>(i) == Array::kTriangleBody) write_table(tables.triangle_body.data(), H5T_NATIVE_INT32);
      if (static_cast<Array>(i) == Array::kVertexBody) write_table(tables.vertex_body.data(), H5T_NATIVE_INT32);
      if (static_cast<Array>(i) == Array::kArea) write_table(tables.area_m2.data(), H5T_NATIVE_DOUBLE);
      if (static_cast<Array>(i) == Array::kRadius) write_table(tables.radius_m.data(), H5T_NATIVE_DOUBLE);
    }
  }
  // HDF5 truncates the file after its own writes; the arrays extend beyond.
  struct stat status {};
  if (::stat(part_.c_str(), &status) != 0) throw SystemError(fmt::format("{}: {}", part_.string(), std::strerror(errno)));
  header_.length = static_cast<std::uint64_t>(status.st_size);
  for (std::size_t i = 0; i < kArrays; ++i)
    header_.length = std::max(header_.length, header_.offset[i] + header_.get_shape(static_cast<Array>(i)).bytes);
  if (::truncate(part_.c_str(), static_cast<off_t>(header_.length)) != 0)
    throw SystemError(fmt::format("{}: cannot be made {} bytes long: {}", part_.string(), header_.length, std::strerror(errno)));
}

void SurfaceFile::write(std::uint64_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t done = ::pwrite(descriptor_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) throw SystemError(fmt::format("{}: cannot be written: {}; make room and resume", part_.string(), std::strerror(errno)));
    offset += static_cast<std::uint64_t>(done);
    bytes = bytes.subspan(done);
  }
}

void SurfaceFile::write_row(Array array, std::uint64_t row, std::span<const std::byte> bytes) {
  write(header_.offset[static_cast<std::size_t>(array)] + row * bytes.size(), bytes);
}

void SurfaceFile::write_key(std::uint64_t key, std::span<const Vec3> places_m) {
  constexpr double kMost = std::numeric_limits<double>::max();
  std::vector<Vec3> low(header_.bodies, {kMost, kMost, kMost}), high(header_.bodies, {-kMost, -kMost, -kMost}), centre(header_.bodies);
  std::vector<double> step(header_.bodies, 0.0);
  for (std::size_t v = 0; v < places_m.size(); ++v) {
    const std::size_t body = vertex_body_[v];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[body][axis] = std::min(low[body][axis], places_m[v][axis]);
      high[body][axis] = std::max(high[body][axis], places_m[v][axis]);
    }
  }
  for (std::size_t body = 0; body < header_.bodies; ++body) {
    if (!(low[body][0] <= high[body][0])) continue;  // a body without a vertex
    centre[body] = 0.5 * (low[body] + high[body]);
    const Vec3 size = high[body] - low[body];
    step[body] = std::max({size[0], size[1], size[2]}) / 65534.0;
  }
  std::vector<std::array<std::int16_t, 3>> place(places_m.size());
  for (std::size_t v = 0; v < places_m.size(); ++v) {
    const std::size_t body = vertex_body_[v];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double steps = step[body] > 0.0 ? std::round((places_m[v][axis] - centre[body][axis]) / step[body]) : 0.0;
      place[v][axis] = static_cast<std::int16_t>(std::clamp(steps, -32767.0, 32767.0));
    }
  }
  write_row(Array::kCentre, key, std::as_bytes(std::span(centre)));
  write_row(Array::kStep, key, std::as_bytes(std::span(step)));
  write_row(Array::kPlace, key, std::as_bytes(std::span(place)));
}

void SurfaceFile::write_block(std::uint64_t block, std::span<const float> scale, std::span<const std::int16_t> values) {
  write_row(Array::kScale, block, std::as_bytes(scale));
  write_row(Array::kAcceleration, block, std::as_bytes(values));
}

void SurfaceFile::commit() {
  base::Sha256 sha;
  sha.add(recording::format_header(header_));
  std::vector<std::byte> piece(1 << 20);
  for (std::uint64_t at = kHeaderBytes; at < header_.length;) {
    const auto wanted = std::min<std::uint64_t>(piece.size(), header_.length - at);
    const ssize_t got = ::pread(descriptor_.get(), piece.data(), wanted, static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) throw SystemError(fmt::format("{}: cannot be read again: {}", part_.string(), std::strerror(errno)));
    sha.add(std::span<const std::byte>(piece).first(got));
    at += static_cast<std::uint64_t>(got);
  }
  const std::string digest = base::to_hex(sha.finish());
  write(kTextBytes, std::as_bytes(std::span(digest)));
  if (::fsync(descriptor_.get()) != 0 || ::rename(part_.c_str(), file_.c_str()) != 0)
    throw SystemError(fmt::format("{}: cannot be finished: {}", file_.string(), std::strerror(errno)));
}

}  // namespace carillon::emission
