// Numbers of one VTK XML DataArray in any encoding. Internal header of the VTU reader.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/cursor.hpp"

namespace carillon::mesh {

/// Binary encoding given by the root element.
struct VtuEncoding {
  bool swap_bytes = false;    // byte order differs from this machine's
  int header_bytes = 4;       // header_type UInt32 or UInt64
  bool zlib = false;          // compressor vtkZLibDataCompressor
  bool appended_raw = false;  // encoding of <AppendedData>
};

/// Decodes DataArrays of one file. The total decoded size is bounded by the file size, against decompression bombs and repeated references
/// to one block.
class VtuData {
 public:
  /// `file`: whole file, for messages. `appended`: bytes after the underscore of <AppendedData>.
  VtuData(const Cursor& file, VtuEncoding encoding, std::string_view appended);

  /// `count` numbers of type `type` ("Float32", "Int64", ...) as double or int64. `place`: position of the array in the file.
  /// `text`: inline content (format ascii or binary); `offset`: into the appended data when `format` is "appended".
  template <class T>
  std::vector<T> read(const std::string& name, const std::string& type, const std::string& format, std::string_view text,
                      std::uint64_t offset, std::size_t count, std::size_t place);

 private:
  std::string decode(const std::string& name, const std::string& format, std::string_view text, std::uint64_t offset, std::size_t expected,
                     std::size_t place);
  void spend(std::size_t bytes, std::size_t place);

  const Cursor& file_;
  VtuEncoding encoding_;
  std::string_view appended_;
  std::size_t budget_;
};

}  // namespace carillon::mesh
