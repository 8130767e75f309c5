// Method: HDF5's "core" driver builds the file in memory, so that disk errors do not reach HDF5 and the checksum is computed from memory.
//   The driver allocates through callbacks, and the memory is kept when the file is closed. All arrays of the seal are contiguous.
// Deviations: not H5Fget_file_image, which copies all bytes and in 1.10.8 leaves an image that cannot be opened (it clears a flag in the
//   superblock but keeps the old checksum).
// Source: HDF5 1.10 reference manual; VTK file formats, "VTKHDF", version 1.0 (UnstructuredGrid).
#include "runtime/bank/hdf5_image.hpp"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <set>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/hdf5_id.hpp"

namespace carillon::bank {
namespace {

/// Disables HDF5's error output during its lifetime.
class Silence {
 public:
  Silence() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Silence() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

Hdf5Id make_space(const std::vector<std::uint64_t>& shape) {
  const std::vector<hsize_t> extents(shape.begin(), shape.end());
  return {shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr), H5Sclose,
          "a space"};
}

Hdf5Id make_string_type(std::size_t bytes) {
  Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose, "a type");
  require(H5Tset_size(type, bytes), "size a text");
  if (bytes != H5T_VARIABLE) require(H5Tset_strpad(type, H5T_STR_NULLPAD), "pad a text");
  require(H5Tset_cset(type, H5T_CSET_UTF8), "set UTF-8");
  return {H5Tcopy(type), H5Tclose, "a type"};
}

Hdf5Id make_type(const std::string& dtype) {
  if (dtype == "<f8") return {H5Tcopy(H5T_IEEE_F64LE), H5Tclose, "a type"};
  if (dtype == "<f4") return {H5Tcopy(H5T_IEEE_F32LE), H5Tclose, "a type"};
  if (dtype == "<i8") return {H5Tcopy(H5T_STD_I64LE), H5Tclose, "a type"};
  if (dtype == "<i4") return {H5Tcopy(H5T_STD_I32LE), H5Tclose, "a type"};
  if (dtype == "<i2") return {H5Tcopy(H5T_STD_I16LE), H5Tclose, "a type"};
  if (dtype == "|i1") return {H5Tcopy(H5T_STD_I8LE), H5Tclose, "a type"};
  if (dtype == "|u1") return {H5Tcopy(H5T_STD_U8LE), H5Tclose, "a type"};
  return make_string_type(find_item_bytes(dtype));
}

/// Variable length, so that h5py returns str.
void write_text_attribute(hid_t object, const char* name, const std::string& text) {
  const Hdf5Id type = make_string_type(H5T_VARIABLE);
  const Hdf5Id space = make_space({});
  const Hdf5Id attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, name);
  const char* characters = text.c_str();
  require(H5Awrite(attribute, type, &characters), "write an attribute");
}

/// Creation properties without time stamps, for reproducible bytes.
Hdf5Id make_properties(hid_t kind) {
  const hid_t properties = H5Pcreate(kind);
  H5Pset_obj_track_times(properties, false);
  return {properties, H5Pclose, "a property list"};
}

Hdf5Id make_group(hid_t file, const char* path) {
  const Hdf5Id properties = make_properties(H5P_GROUP_CREATE);
  return {H5Gcreate2(file, path, H5P_DEFAULT, properties, H5P_DEFAULT), H5Gclose, path};
}

/// Writes an array of the seal; returns its position.
Extent write_field(hid_t file, const Field& field) {
  const Hdf5Id space = make_space(field.shape);
  const Hdf5Id type = make_type(field.dtype);
  const Hdf5Id creation = make_properties(H5P_DATASET_CREATE);
  require(H5Pset_layout(creation, H5D_CONTIGUOUS), "choose a layout");
  require(H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY), "allocate early");
  require(H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER), "choose not to fill");
  const Hdf5Id dataset(H5Dcreate2(file, field.name.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose, field.name.c_str());
  Extent extent{field.dtype, 0, field.shape, calc_bytes(field)};
  if (extent.bytes > 0) {
    require(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, field.data), "write an array");
    const haddr_t offset = H5Dget_offset(dataset);
    if (offset == HADDR_UNDEF) throw SystemError(fmt::format("HDF5 does not report where {} lies", field.name));
    extent.offset = offset;
  }
  write_text_attribute(dataset, "units", field.units);
  write_text_attribute(dataset, "meaning", field.meaning);
  return extent;
}

/// Virtual dataset of `shape` that maps the selection `source_space` of the dataset `source` in this file.
void make_view(hid_t group, const char* name, hid_t type, const std::vector<std::uint64_t>& shape, const char* source, hid_t source_space) {
  const Hdf5Id space = make_space(shape);
  const Hdf5Id creation = make_properties(H5P_DATASET_CREATE);
  require(H5Pset_virtual(creation, space, ".", source, source_space), "map a view");
  const Hdf5Id dataset(H5Dcreate2(group, name, type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose, name);
}

/// Small real dataset, compressed if long.
void write_list(hid_t group, const char* name, hid_t file_type, hid_t memory_type, std::uint64_t size, const void* data) {
  const Hdf5Id space = make_space({size});
  const Hdf5Id creation = make_properties(H5P_DATASET_CREATE);
  if (size > 4096 && H5Zfilter_avail(H5Z_FILTER_DEFLATE) > 0) {
    const hsize_t chunk = std::min<hsize_t>(size, 1 << 16);
    require(H5Pset_chunk(creation, 1, &chunk), "cut into chunks");
    require(H5Pset_shuffle(creation), "shuffle");
    require(H5Pset_deflate(creation, 4), "compress");
  }
  const Hdf5Id dataset(H5Dcreate2(group, name, file_type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose, name);
  require(H5Dwrite(dataset, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), "write a list");
}

/// VTKHDF views for VTK and ParaView: an unstructured grid of triangles with one point array per mode, in steps of its scale.
void write_vtk_views(hid_t file, const Bank& bank) {
  const std::uint64_t vertices = bank.vertex_count(), triangles = bank.triangles.size(), modes = bank.mode_count();
  const Hdf5Id group = make_group(file, "VTKHDF");
  {
    const Hdf5Id space = make_space({2});
    const Hdf5Id attribute(H5Acreate2(group, "Version", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "Version");
    const std::int64_t version[2] = {1, 0};
    require(H5Awrite(attribute, H5T_NATIVE_INT64, version), "write an attribute");
    const Hdf5Id type(H5Tcopy(H5T_C_S1), H5Tclose, "a type");
    require(H5Tset_size(type, 16), "size a text");
    const Hdf5Id scalar = make_space({});
    const Hdf5Id kind(H5Acreate2(group, "Type", type, scalar, H5P_DEFAULT, H5P_DEFAULT), H5Aclose, "Type");
    require(H5Awrite(kind, type, "UnstructuredGrid"), "write an attribute");
  }
  require(H5Lcreate_soft("/mesh/vertices", group, "Points", H5P_DEFAULT, H5P_DEFAULT), "link the points");
  const Hdf5Id corners = make_space({triangles, 3});
  make_view(group, "Connectivity", H5T_STD_I64LE, {3 * triangles}, "/mesh/triangles", corners);
  std::vector<std::int64_t> offsets(triangles + 1);
  for (std::size_t t = 0; t <= triangles; ++t) offsets[t] = static_cast<std::int64_t>(3 * t);
  write_list(group, "Offsets", H5T_STD_I64LE, H5T_NATIVE_INT64, triangles + 1, offsets.data());
  constexpr std::uint8_t kVtkTriangle = 5;
  const std::vector<std::uint8_t> types(triangles, kVtkTriangle);
  write_list(group, "Types", H5T_STD_U8LE, H5T_NATIVE_UINT8, triangles, types.data());
  const auto count = [&](const char* name, std::uint64_t number) {
    const auto value = static_cast<std::int64_t>(number);
    write_list(group, name, H5T_STD_I64LE, H5T_NATIVE_INT64, 1, &value);
  };
  count("NumberOfPoints", vertices);
  count("NumberOfCells", triangles);
  count("NumberOfConnectivityIds", 3 * triangles);

  const Hdf5Id arrays = make_group(file, "VTKHDF/PointData");
  const int digits = std::max<int>(3, static_cast<int>(std::to_string(modes).size()));
  for (std::uint64_t mode = 0; mode < modes; ++mode) {
    const Hdf5Id source = make_space({vertices, modes, 3});
    const hsize_t start[3] = {0, mode, 0}, extent[3] = {vertices, 1, 3};
    require(H5Sselect_hyperslab(source, H5S_SELECT_SET, start, nullptr, extent, nullptr), "select a mode");
    const std::string name = fmt::format("mode_{:0{}}_{:.1f}Hz", mode + 1, digits, find_played_hz(bank, mode));
    make_view(arrays, name.c_str(), H5T_IEEE_F32LE, {vertices, 3}, "/modes/shape", source);
  }
}

/// Memory of the core driver, kept when the file is closed.
struct Keeper {
  void* memory = nullptr;
  std::size_t size = 0;

  H5FD_file_image_callbacks_t make_callbacks() {
    H5FD_file_image_callbacks_t callbacks{};
    callbacks.image_malloc = [](size_t size, H5FD_file_image_op_t, void* keeper) { return resize(nullptr, size, keeper); };
    callbacks.image_memcpy = [](void* to, const void* from, size_t size, H5FD_file_image_op_t, void*) {
      return std::memcpy(to, from, size);
    };
    callbacks.image_realloc = [](void* memory, size_t size, H5FD_file_image_op_t, void* keeper) { return resize(memory, size, keeper); };
    callbacks.image_free = [](void* memory, H5FD_file_image_op_t operation, void* keeper) -> herr_t {
      if (operation == H5FD_FILE_IMAGE_OP_FILE_CLOSE) {
        static_cast<Keeper*>(keeper)->memory = memory;
      } else {
        std::free(memory);
      }
      return 0;
    };
    callbacks.udata_copy = [](void* keeper) { return keeper; };
    callbacks.udata_free = [](void*) -> herr_t { return 0; };
    callbacks.udata = this;
    return callbacks;
  }

  static void* resize(void* memory, std::size_t size, void* keeper) {
    static_cast<Keeper*>(keeper)->size = size;
    return std::realloc(memory, size);
  }
};

/// File length from the superblock (versions 2 and 3, behind the user block): "end of file address", bytes 28 to 35.
std::uint64_t get_end_of_file(const Keeper& kept) {
  std::uint64_t end = 0;
  if (kept.memory != nullptr && kept.size >= kSealBytes + 36)
    std::memcpy(&end, static_cast<std::byte*>(kept.memory) + kSealBytes + 28, sizeof end);
  if (end < kSealBytes || end > kept.size) throw SystemError("HDF5 left no whole file in memory");
  return end;
}

}  // namespace

Hdf5Image make_hdf5_image(const Bank& bank, const FileForm& form) {
  const std::vector<Field> fields = list_fields(bank, form);
  const bool is_packed = form.is_packed;
  const Silence silence;
  const Hdf5Id creation = make_properties(H5P_FILE_CREATE);
  require(H5Pset_userblock(creation, kSealBytes), "reserve the seal");
  const Hdf5Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "a property list");
  // The newest format has checksums in HDF5's own metadata.
  require(H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST), "choose a format");
  require(H5Pset_alignment(access, 64 << 10, 4096), "align arrays to pages");
  require(H5Pset_fclose_degree(access, H5F_CLOSE_STRONG), "close for good");
  // Allocation increment: total size of all arrays, to avoid repeated copies.
  std::uint64_t total = 1 << 20;
  for (const Field& field : fields) total += calc_bytes(field);
  require(H5Pset_fapl_core(access, static_cast<std::size_t>(total), false), "work in memory");
  Keeper keeper;
  auto callbacks = keeper.make_callbacks();
  require(H5Pset_file_image_callbacks(access, &callbacks), "lend it memory");

  Hdf5Image image;
  const hid_t file = H5Fcreate("bank", H5F_ACC_TRUNC, creation, access);
  if (file < 0) throw SystemError("HDF5 cannot make a file in memory");
  try {
    std::set<std::string> groups;
    for (const Field& field : fields) {
      const auto slash = field.name.find('/');
      if (slash != std::string::npos && groups.insert(field.name.substr(0, slash)).second) {
        make_group(file, field.name.substr(0, slash).c_str());
      }
    }
    for (const Field& field : fields) image.extents.emplace(field.name, write_field(file, field));
    if (!is_packed) write_vtk_views(file, bank);
    const Hdf5Id root(H5Gopen2(file, "/", H5P_DEFAULT), H5Gclose, "the root");
    write_text_attribute(root, "format", "Carillon mode bank");
    write_text_attribute(root, "version", fmt::format("{}", fmt::join(find_version(bank, is_packed), ".")));
  } catch (...) {
    H5Fclose(file);
    std::free(keeper.memory);
    throw;
  }
  const herr_t closed = H5Fclose(file);
  image.memory = {keeper.memory, std::free};
  require(closed, "close the file in memory");
  image.bytes = {static_cast<std::byte*>(keeper.memory), get_end_of_file(keeper)};
  return image;
}

}  // namespace carillon::bank
