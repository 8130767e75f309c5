#include "precompute/simulation/motion_file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <hdf5.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

#include "precompute/comm/exchange.hpp"
#include "precompute/simulation/bodies.hpp"
#include "runtime/bank/hdf5_id.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::simulation {
namespace {

constexpr std::size_t kFloatsPerPoint = 4;  // floats per point and frame: position and speed

void write_attribute(hid_t at, const char* name, hid_t type, std::vector<hsize_t> shape, const void* data) {
  const bank::Hdf5Id space(shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr),
                           H5Sclose);
  const bank::Hdf5Id attribute(H5Acreate2(at, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  bank::require(H5Awrite(attribute, type, data), "write the motion");
}

void write_text(hid_t at, const char* name, std::string_view text) {
  const bank::Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose);
  bank::require(H5Tset_size(type, text.size()), "write the motion");
  write_attribute(at, name, type, {}, text.data());
}

/// Data set without creation time, so that equal runs write equal bytes.
hid_t create_set(hid_t at, const char* name, hid_t type, hid_t space) {
  const bank::Hdf5Id plain(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  bank::require(H5Pset_obj_track_times(plain, false), "write the motion");
  return H5Dcreate2(at, name, type, space, H5P_DEFAULT, plain, H5P_DEFAULT);
}

void write_list(hid_t at, const char* name, const std::vector<std::int64_t>& values) {
  const hsize_t count = values.size();
  const bank::Hdf5Id space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const bank::Hdf5Id set(create_set(at, name, H5T_STD_I64LE, space), H5Dclose);
  bank::require(H5Dwrite(set, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "write the motion");
}

}  // namespace

MotionFile::MotionFile(const transient::Domain& domain, const job::SimulationSpec& spec, bool is_resumed)
    : domain_(domain),
      file_(spec.motion),
      frames_(std::filesystem::path(spec.motion) += ".frames"),
      every_samples_(spec.sample_rate_hz / spec.motion_hz),
      rate_hz_(spec.sample_rate_hz) {
  const transient::Assembly& assembly = domain.get_assembly();
  std::map<std::int32_t, std::int32_t> index;
  for (std::size_t b = 0; b < assembly.bodies.size(); ++b)
    for (auto triangle : list_skin_triangles(assembly, static_cast<std::int32_t>(b))) {
      for (std::int32_t& node : triangle) node = index.try_emplace(node, static_cast<std::int32_t>(index.size())).first->second;
      triangles_.push_back(triangle);
      body_.push_back(static_cast<std::int32_t>(b));
    }
  points_ = static_cast<std::int32_t>(index.size());
  for (const auto& [node, number] : index) {
    const std::int32_t place = domain.find_place(node);
    if (place >= 0 && place < domain.own_count()) own_.push_back({number, place});
  }
  domain.get_comm().agree([&] {
    if (!domain.get_comm().is_root()) return;
    std::error_code error;
    if (is_resumed && !std::filesystem::exists(frames_, error))
      throw InputError(
          fmt::format("{}: the frames of the run that is resumed are gone; remove the checkpoint to start again", frames_.string()));
    if (!is_resumed) base::write_file(frames_, "");
  });
}

void MotionFile::add_sample(const transient::Motion& motion) {
  const auto frame = static_cast<std::int64_t>(std::floor(static_cast<double>(motion.get_sample()) / every_samples_ + 1e-9));
  if (frame == frame_) return;
  // The due one: a resumed run starts in the middle.
  frame_ = frame;
  count_ = frame + 1;
  if (motion.get_sample() != static_cast<std::int64_t>(std::ceil(static_cast<double>(frame) * every_samples_ - 1e-9))) return;
  std::vector<Point> own;
  for (const auto& [number, place] : own_) {
    const Vec3& rest = domain_.get_rest_m()[place];
    const transient::Quad &u = motion.get_u()[place], &v = motion.get_v()[place];
    own.push_back({number, static_cast<float>(rest[0] + u.x), static_cast<float>(rest[1] + u.y), static_cast<float>(rest[2] + u.z),
                   static_cast<float>(std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z))});
  }
  const std::vector<Point> all = comm::gather(domain_.get_comm(), own);
  domain_.get_comm().agree([&] {
    if (!domain_.get_comm().is_root()) return;
    std::vector<float> row(static_cast<std::size_t>(points_) * kFloatsPerPoint);
    for (const Point& point : all) {
      float* at = &row[static_cast<std::size_t>(point.index) * kFloatsPerPoint];
      at[0] = point.x;
      at[1] = point.y;
      at[2] = point.z;
      at[3] = point.speed;
    }
    const base::Descriptor file(::open(frames_.c_str(), O_WRONLY | O_CLOEXEC));
    const auto at = static_cast<off_t>(static_cast<std::size_t>(frame) * row.size() * sizeof(float));
    int error = file.get() < 0 || ::lseek(file.get(), at, SEEK_SET) < 0 ? errno : 0;
    if (error == 0) error = base::write_all(file.get(), {reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float)});
    if (error != 0) throw SystemError(fmt::format("{}: {}", frames_.string(), std::strerror(error)));
  });
}

void MotionFile::finish() {
  domain_.get_comm().agree([&] {
    if (domain_.get_comm().is_root()) write();
  });
}

void MotionFile::write_cells(std::int64_t root) const {
  const std::int64_t version[2] = {2, 0};
  write_attribute(root, "Version", H5T_NATIVE_INT64, {2}, version);
  write_text(root, "Type", "UnstructuredGrid");
  const auto cells = static_cast<std::int64_t>(triangles_.size());
  write_list(root, "NumberOfPoints", std::vector<std::int64_t>(count_, points_));
  write_list(root, "NumberOfCells", std::vector<std::int64_t>(count_, cells));
  write_list(root, "NumberOfConnectivityIds", std::vector<std::int64_t>(count_, 3 * cells));
  std::vector<std::int64_t> corners, offsets{0};
  for (const auto& triangle : triangles_) {
    corners.insert(corners.end(), triangle.begin(), triangle.end());
    offsets.push_back(static_cast<std::int64_t>(corners.size()));
  }
  write_list(root, "Connectivity", corners);
  write_list(root, "Offsets", offsets);
  {
    const hsize_t count = triangles_.size();
    const std::vector<std::uint8_t> types(triangles_.size(), 5);  // VTK_TRIANGLE
    const bank::Hdf5Id space(H5Screate_simple(1, &count, nullptr), H5Sclose);
    const bank::Hdf5Id set(create_set(root, "Types", H5T_STD_U8LE, space), H5Dclose);
    bank::require(H5Dwrite(set, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, types.data()), "write the motion");
  }
  const bank::Hdf5Id cell_data(H5Gcreate2(root, "CellData", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  write_list(cell_data, "body", {body_.begin(), body_.end()});
}

void MotionFile::write_steps(std::int64_t root) const {
  const bank::Hdf5Id steps(H5Gcreate2(root, "Steps", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  write_attribute(steps, "NSteps", H5T_NATIVE_INT64, {}, &count_);
  std::vector<double> times;
  std::vector<std::int64_t> first_point, none(static_cast<std::size_t>(count_)), one(static_cast<std::size_t>(count_), 1), part_of;
  for (std::int64_t f = 0; f < count_; ++f) {
    times.push_back((std::ceil(static_cast<double>(f) * every_samples_ - 1e-9) + 0.0) / rate_hz_);  // + 0: not -0 for the first
    first_point.push_back(f * points_);
    part_of.push_back(f);
  }
  {
    const hsize_t count = times.size();
    const bank::Hdf5Id space(H5Screate_simple(1, &count, nullptr), H5Sclose);
    const bank::Hdf5Id set(create_set(steps, "Values", H5T_IEEE_F64LE, space), H5Dclose);
    bank::require(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, times.data()), "write the motion");
  }
  write_list(steps, "PartOffsets", part_of);
  write_list(steps, "NumberOfParts", one);
  write_list(steps, "PointOffsets", first_point);
  write_list(steps, "CellOffsets", none);
  write_list(steps, "ConnectivityIdOffsets", none);
  const bank::Hdf5Id point_offsets(H5Gcreate2(steps, "PointDataOffsets", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  write_list(point_offsets, "speed", first_point);
  const bank::Hdf5Id cell_offsets(H5Gcreate2(steps, "CellDataOffsets", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  write_list(cell_offsets, "body", none);
}

void MotionFile::write_frames(std::int64_t root) const {
  const bank::Hdf5Id point_data(H5Gcreate2(root, "PointData", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  const hsize_t all_points[2] = {static_cast<hsize_t>(count_) * static_cast<hsize_t>(points_), 3};
  const bank::Hdf5Id points_space(H5Screate_simple(2, all_points, nullptr), H5Sclose),
      speed_space(H5Screate_simple(1, all_points, nullptr), H5Sclose);
  const bank::Hdf5Id points(create_set(root, "Points", H5T_IEEE_F32LE, points_space), H5Dclose);
  const bank::Hdf5Id speed(create_set(point_data, "speed", H5T_IEEE_F32LE, speed_space), H5Dclose);
  const std::size_t row = static_cast<std::size_t>(points_) * kFloatsPerPoint;
  std::int64_t frame = 0;
  std::string kept;
  base::read_pieces(frames_, "frames of the motion", row * sizeof(float), [&](std::string_view piece) {
    kept.append(piece);
    while (kept.size() >= row * sizeof(float) && frame < count_) {
      std::vector<float> values(row), place(3 * points_), size(static_cast<std::size_t>(points_));
      std::memcpy(values.data(), kept.data(), row * sizeof(float));
      kept.erase(0, row * sizeof(float));
      for (std::size_t p = 0; p < static_cast<std::size_t>(points_); ++p) {
        for (std::size_t k = 0; k < 3; ++k) place[3 * p + k] = values[kFloatsPerPoint * p + k];
        size[p] = values[kFloatsPerPoint * p + 3];
      }
      const hsize_t begin[2] = {static_cast<hsize_t>(frame) * static_cast<hsize_t>(points_), 0},
                    count[2] = {static_cast<hsize_t>(points_), 3};
      const bank::Hdf5Id part_space(H5Screate_simple(2, count, nullptr), H5Sclose),
          part_speed(H5Screate_simple(1, count, nullptr), H5Sclose);
      bank::require(H5Sselect_hyperslab(points_space, H5S_SELECT_SET, begin, nullptr, count, nullptr), "write the motion");
      bank::require(H5Sselect_hyperslab(speed_space, H5S_SELECT_SET, begin, nullptr, count, nullptr), "write the motion");
      bank::require(H5Dwrite(points, H5T_NATIVE_FLOAT, part_space, points_space, H5P_DEFAULT, place.data()), "write the motion");
      bank::require(H5Dwrite(speed, H5T_NATIVE_FLOAT, part_speed, speed_space, H5P_DEFAULT, size.data()), "write the motion");
      ++frame;
    }
  });
}

void MotionFile::write() const {
  std::filesystem::path part = file_;
  part += ".part";
  try {
    const bank::Hdf5Id file(H5Fcreate(part.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose);
    const bank::Hdf5Id root(H5Gcreate2(file, "VTKHDF", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
    write_cells(root);
    write_steps(root);
    write_frames(root);
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw;
  }
  std::error_code error;
  std::filesystem::rename(part, file_, error);
  if (error) throw SystemError(fmt::format("{}: {}", file_.string(), error.message()));
}

}  // namespace carillon::simulation
